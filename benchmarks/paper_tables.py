"""The paper's spectral part, measured in the laboratory: Figs. 4 to 6 and Tables 1 to 3.

Objects of one shape and several colors are measured at the same positions; from every one of them the coefficients
(a, b) of (15) are calculated, which then have to serve for the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..core import colorimetry, reflectance, spectra
from . import laboratory

CUPS = ("blue", "green", "red", "yellow")
"""The paper's cups, in the order of its pairs."""

FABRICS = ("blue", "purple", "red")
"""Three fabrics; the paper names the colors of only two of them (Fig. 9)."""

SETTINGS = laboratory.Settings(size=160, samples=64)

OBSERVER, LIGHT = "1964", "D65"
"""For color differences; the paper does not say which it took."""

POSITIONS: dict[str, dict[str, tuple[float, float]]] = {
    # As fractions of the picture from its upper left corner. 1 is the reference, 5 the darkest, as in the paper.
    "mug": {
        "1": (0.27, 0.39),
        "2": (0.32, 0.56),
        "3": (0.385, 0.37),
        "4": (0.53, 0.46),
        "5": (0.655, 0.55),
        "highlight": (0.366, 0.335),
        "handle": (0.655, 0.35),
    },
    "fabric_cylinder": {
        "1": (0.32, 0.75),
        "2": (0.38, 0.45),
        "3": (0.48, 0.62),
        "4": (0.60, 0.55),
        "5": (0.665, 0.40),
    },
}
"""Where the spectroradiometer looks; highlight and handle, which the paper has no numbers for, are beyond it."""

AIM = 0.005
"""Scatter of the instrument's aim, in parts of the picture's width, for `Objects.spread_aimed_anew`."""

_SPOT = 2
"""Half width, in pixels of a picture of 160, of the square that the spectroradiometer sees."""


def dye(color: str) -> NDArray[np.float64]:
    """(31,): reflectance of a ColorChecker patch at `laboratory.BANDS`."""
    return spectra.chart("BabelColor Average")[color].at(laboratory.BANDS)


@dataclass(frozen=True, eq=False)
class Objects:
    """Objects of one shape in several colors, measured.

    Attributes
    ----------
    scene
        Name in the laboratory.
    colors
        Patches of the ColorChecker.
    settings
        How it is rendered.
    """

    scene: str
    colors: tuple[str, ...]
    settings: laboratory.Settings = SETTINGS

    @cached_property
    def view(self) -> laboratory.View:
        """Mask and reference pixel."""
        return laboratory.view(self.scene, self.settings)

    @cached_property
    def measured(self) -> dict[str, laboratory.Measurement]:
        """Spectra at every pixel, by color."""
        return {color: laboratory.measure(self.scene, dye(color), self.settings) for color in self.colors}

    @cached_property
    def factors(self) -> NDArray[np.float32]:
        """(N, H, W, 31) reflectance factors; the tile is read once, at the reference."""
        return np.stack([m.factors(at=self.view.reference) for m in self.measured.values()])

    @property
    def positions(self) -> list[str]:
        """Names of the positions."""
        return list(POSITIONS[self.scene])

    def pixel(self, position: str) -> tuple[int, int]:
        """(x, y) of a position."""
        x, y = POSITIONS[self.scene][position]
        return int(x * self.settings.size), int(y * self.settings.size)

    @cached_property
    def readings(self) -> NDArray[np.float64]:
        """(N, positions, 31): what the spectroradiometer reads."""
        return self._read(np.zeros((len(self.colors), len(self.positions), 2), int))

    def _read(self, offsets: NDArray[np.int_]) -> NDArray[np.float64]:
        r = max(1, round(_SPOT * self.settings.size / 160))
        found = np.empty((*offsets.shape[:2], len(laboratory.BANDS)))
        for n, position in np.ndindex(offsets.shape[:2]):
            x, y = self.pixel(self.positions[position]) + offsets[n, position]
            found[n, position] = self.factors[n, y - r : y + r + 1, x - r : x + r + 1].mean(axis=(0, 1))
        return found

    def spread_aimed_anew(self, draws: int = 40) -> NDArray[np.float64]:
        """(positions,): E as `spread`, if the instrument is aimed anew for every object and position.

        Mean of several draws; the aim scatters by `AIM` of the picture's width, either way.
        """
        rng = np.random.default_rng(0)
        found = []
        for _ in range(draws):
            scatter = rng.normal(0, AIM * self.settings.size, (len(self.colors), len(self.positions), 2))
            read = self._read(np.round(scatter).astype(int))
            found.append(reflectance.spread(*_fit(read[:, 0], read)))
        return np.mean(found, axis=0)

    @cached_property
    def coefficients(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(a, b), each (N, positions), relative to the first position, weighted as (18) has it."""
        return _fit(self.readings[:, 0], self.readings)

    @cached_property
    def coefficient_maps(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(a, b), each (N, n), at every pixel of the object's interior."""
        return _fit(self.readings[:, 0], self.factors[:, self.view.interior])

    @cached_property
    def differences(self) -> NDArray[np.float64]:
        """(pairs, objects, positions): CMC(1:1) between measured and synthesized reflectance.

        The pair of object i is used to synthesize object j, as Tables 1 and 2 do for the first object.
        """
        a, b = self.coefficients
        made = a[:, None, :, None] * self.readings[None, :, :1] + b[:, None, :, None]
        return colorimetry.delta_e_cmc(_lab(self.readings)[None], _lab(made), l=1.0)

    @cached_property
    def correlation(self) -> NDArray[np.float64]:
        """(positions,): of a with b over the objects; the reference, where both are fixed, is nan."""
        a, b = self.coefficients
        da, db = a - a.mean(axis=0), b - b.mean(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            found = (da * db).sum(axis=0) / np.sqrt((da**2).sum(axis=0) * (db**2).sum(axis=0))
        found[0] = np.nan
        return found

    @cached_property
    def spread(self) -> NDArray[np.float64]:
        """(positions,): E, the bound (26)."""
        return reflectance.spread(*self.coefficients)

    @cached_property
    def spread_exact(self) -> NDArray[np.float64]:
        """(positions,): E itself, (22)."""
        return reflectance.spread_exact(*self.coefficients)

    @cached_property
    def spread_map(self) -> NDArray[np.float64]:
        """(n,): the bound (26) at every pixel of the object's interior."""
        return reflectance.spread(*self.coefficient_maps)


def _fit(reference: NDArray, others: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    weights = spectra.observer(OBSERVER).at(laboratory.BANDS)
    pairs = [reflectance.fit(x, y, weights) for x, y in zip(reference, others, strict=True)]
    a, b = (np.stack(part) for part in zip(*pairs, strict=True))
    return a, b


def _lab(factors: NDArray) -> NDArray[np.float64]:
    response = laboratory.response(OBSERVER, LIGHT)
    return colorimetry.xyz_to_lab(factors @ response, response.sum(axis=0))
