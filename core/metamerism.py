"""What a measured color looks like under other lights, and whether two that match under one match under another.

Both need the reflectance. Of a swatch of three numbers they cannot be known: many reflectances have the same three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import colorimetry, gamut, spectra
from .colorimetry import Adaptation
from .colorspace import SRGB
from .errors import TargetError
from .spectra import Spectrum
from .swatches import Light, Swatch

LIGHTS = ("D65", "D50", "A", "FL2", "FL11", "LED-B3")

# CIE76 of a pair under the reference light above which nobody would call it a match.
_NO_MATCH = 5.0


@dataclass(frozen=True, eq=False)
class Look:
    """A swatch under a light.

    Attributes
    ----------
    light
        Its name.
    lab
        (3,) L*a*b* as measured under that light, with the light's own white.
    display
        (3,) sRGB codes, 0..1, of what an eye adapted to the light sees; paler where sRGB does not hold it.
    shift
        CIEDE2000 between that and what the eye sees under the reference light: 0 for a color that stays itself.
    """

    light: str
    lab: NDArray[np.float64]
    display: NDArray[np.float64]
    shift: float


@dataclass(frozen=True)
class MetamerismIndex:
    """CIE special metamerism index for a change in illuminant.

    Attributes
    ----------
    value
        CIE 1976 difference under the test light, corrected for that under the reference light.
    reference_difference
        CIE 1976 difference under the reference light; 0 for metamers.
    reference, test
        Names of the lights.
    observer
        "1931" or "1964".
    """

    value: float
    reference_difference: float
    reference: str
    test: str
    observer: str

    @property
    def sentence(self) -> str:
        """The figures in words."""
        degrees = {"1931": 2, "1964": 10}[self.observer]
        return (
            f"Metamerism index {self.value:.2f} (CIE 15:2018, 9.2: CIELAB, {self.reference} to {self.test}, "
            f"{degrees}° observer); {self.match}"
        )

    @property
    def match(self) -> str:
        """How well the two match under the reference light, in words."""
        text = f"under {self.reference} the two differ by {self.reference_difference:.2f}"
        return text + (", which is no match." if self.reference_difference > _NO_MATCH else ", which is corrected for.")


def cannot_be_known(swatch: Swatch) -> str | None:
    """Say why the look of a swatch under other lights cannot be known; None where it can, of a spectrum."""
    if isinstance(swatch.color, Spectrum):
        return None
    return (
        f"What '{swatch}' looks like under another light cannot be known from its {swatch.kind}: measure its "
        "reflectance spectrum."
    )


def _reflectance(swatch: Swatch) -> Spectrum:
    if isinstance(swatch.color, Spectrum):
        return swatch.color
    raise TargetError(str(cannot_be_known(swatch)))


def under_lights(
    swatch: Swatch,
    lights: Sequence[Light] = LIGHTS,
    reference: Light = "D65",
    observer: str = "1931",
    adaptation: Adaptation = "cat16",
) -> list[Look]:
    """Look at a spectral swatch under several lights.

    Parameters
    ----------
    swatch
        Of a reflectance spectrum.
    lights, reference
        Anything `spectra.illuminant` takes.
    observer
        "1931" or "1964".
    adaptation
        How the eye adapts from each light to D65: "cat16" or "bradford".

    Raises
    ------
    TargetError
        If the swatch is no spectrum: then it cannot be known.
    """
    reflectance = _reflectance(swatch)

    def seen(light: Light) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        xyz = spectra.to_xyz(light, reflectance, observer)
        white = spectra.to_xyz(light, None, observer)
        adapted = colorimetry.adaptation_matrix(white, SRGB.white, adaptation) @ xyz
        return colorimetry.xyz_to_lab(xyz, white), adapted

    before = colorimetry.xyz_to_lab(seen(reference)[1], SRGB.white)
    looks = []
    for light in lights:
        lab, adapted = seen(light)
        shift = float(colorimetry.delta_e_2000(before, colorimetry.xyz_to_lab(adapted, SRGB.white)))
        linear = colorimetry.xyz_to_linear(adapted, SRGB).astype(np.float32)[None]
        gamut.fit_to_gamut(linear)
        codes = SRGB.curve.encode(np.clip(linear[0], 0, 1))
        looks.append(Look(spectra.illuminant(light).name, lab, codes, shift))
    return looks


def special_indices(
    standard: Swatch, sample: Swatch, reference: Light = "D65", observer: str = "1931"
) -> list[MetamerismIndex]:
    """:func:`special_index` for each of `LIGHTS` but the reference."""
    return [special_index(standard, sample, test, reference, observer) for test in LIGHTS if test != reference]


def special_index(
    standard: Swatch, sample: Swatch, test: Light = "A", reference: Light = "D65", observer: str = "1931"
) -> MetamerismIndex:
    """CIE special metamerism index of a pair for a change in illuminant (CIE 15:2018, 9.2).

    Where the pair does not quite match under the reference light, the tristimulus values of the sample under the test
    light are multiplied by those of the standard over those of the sample under the reference light.

    Parameters
    ----------
    standard, sample
        Of reflectance spectra: the product's present color and the swatch, or a standard and a lab dip.
    test, reference
        Anything `spectra.illuminant` takes.
    observer
        "1931" or "1964".

    Raises
    ------
    TargetError
        If one of them is no spectrum, or the sample is black, which has no ratio.
    """
    pair = _reflectance(standard), _reflectance(sample)
    (one, other), (one_test, other_test) = (
        [spectra.to_xyz(light, reflectance, observer) for reflectance in pair] for light in (reference, test)
    )
    if other.min() <= 0:
        raise TargetError(f"'{sample}' reflects nothing under {reference}: its metamerism cannot be told.")
    white, test_white = (spectra.to_xyz(light, None, observer) for light in (reference, test))
    corrected = other_test * one / other
    return MetamerismIndex(
        float(
            colorimetry.delta_e_1976(
                colorimetry.xyz_to_lab(one_test, test_white), colorimetry.xyz_to_lab(corrected, test_white)
            )
        ),
        float(colorimetry.delta_e_1976(colorimetry.xyz_to_lab(one, white), colorimetry.xyz_to_lab(other, white))),
        spectra.illuminant(reference).name,
        spectra.illuminant(test).name,
        observer,
    )
