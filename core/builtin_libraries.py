"""Libraries that come with Dyehouse: measured charts, the colors of CSS, and grids that are computed.

There are none of Pantone, RAL or another house whose books may not be copied: import your own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import numpy as np

from . import colorimetry, gamut, spectra
from .colorspace import SPACES
from .library import Group, Library
from .swatches import Stimulus, Swatch

_CHARTS = {
    "ColorChecker": ("BabelColor Average", "Mean of 30 ColorChecker charts measured by BabelColor."),
    "ColorChecker ISO 17321-1": ("ISO 17321-1", "As printed in ISO 17321-1:2012."),
    "ColorChecker Ohta": ("ColorChecker N Ohta", "As measured by N. Ohta in 1997."),
    "CIE test colors": ("CIE 13.3", "The 14 test color samples of CIE 13.3-1995."),
    "CQS test colors": ("NIST CQS", "The 15 test color samples of the NIST color quality scale, version 9.0."),
}


def _of_chart(name: str) -> Library:
    key, note = _CHARTS[name]
    return Library.of(name, (Swatch.from_spectrum(s, patch) for patch, s in spectra.chart(key).items()), [note])


def _css() -> Library:
    from .swatch_files import read

    library = read(Path(__file__).parent / "tables" / "css.gpl")
    return Library("CSS", library.groups, ("CSS Color Module Level 4, 6.1: sRGB codes.",))


def _hlc() -> Library:
    """CIELAB in steps of 10 degrees of hue, 5 of lightness and 10 of chroma, under D50, as far as Display P3 goes."""
    grays = Group("Gray", _grid(((L, 0.0, 0.0, f"N L{L:02d}") for L in range(0, 101, 5)), everything=True))
    groups = []
    for hue in range(0, 360, 10):
        points = ((L, C, hue, f"H{hue:03d} L{L:02d} C{C:03d}") for L in range(5, 100, 5) for C in range(10, 150, 10))
        groups.append(Group(f"Hue {hue}", _grid(points)))
    note = "Computed: CIELAB hue, lightness and chroma under D50, as far as Display P3 goes."
    return Library("HLC", (grays, *groups), (note,))


# Hue angles in CIELAB under D50 of Munsell's 5R, 5YR ... at value 5 and chroma 8 (renotation, adapted from C by CAT16).
_MUNSELL = {
    "Red": 26, "Yellow-Red": 60, "Yellow": 86, "Green-Yellow": 112, "Green": 162,
    "Blue-Green": 190, "Blue": 225, "Purple-Blue": 265, "Purple": 312, "Red-Purple": 354,
}  # fmt: skip


def _munsell_like() -> Library:
    """Ten hues in steps of one value (10 L*) and two chromas (10 C*), roughly as in Munsell's book."""
    groups = [Group("Neutral", _grid(((10 * v, 0.0, 0.0, f"Neutral {v}/") for v in range(1, 10)), everything=True))]
    for name, hue in _MUNSELL.items():
        points = ((10 * v, 5.0 * c, hue, f"{name} {v}/{c}") for v in range(1, 10) for c in range(2, 22, 2))
        groups.append(Group(name, _grid(points)))
    note = (
        "Computed: ten hues in even steps of CIELAB under D50 that resemble Munsell's notation and are not its colors."
    )
    return Library("Munsell-like", tuple(groups), (note,))


def _grid(points: Iterable[tuple[float, float, float, str]], *, everything: bool = False) -> tuple[Swatch, ...]:
    """Swatches of (L, C, h, name) under D50, those that Display P3 holds."""
    listed = list(points)
    lab = colorimetry.lch_to_lab(np.array([point[:3] for point in listed], np.float64))
    white = colorimetry.white_xyz("D50")
    xyz, space = colorimetry.lab_to_xyz(lab, white), SPACES["display-p3"]
    linear = colorimetry.xyz_to_linear(xyz @ colorimetry.adaptation_matrix(white, space.white).T, space)
    held = ~gamut.out_of_gamut(linear) | everything
    seen_under = tuple(white.tolist())
    return tuple(
        Swatch(point[3], Stimulus(tuple(color.tolist()), seen_under, "D50"))
        for point, color, inside in zip(listed, xyz, held, strict=True)
        if inside
    )


_MAKERS: dict[str, Callable[[], Library]] = {"CSS": _css, "HLC": _hlc, "Munsell-like": _munsell_like}
NAMES = (*_CHARTS, *_MAKERS)


@cache
def builtin(name: str) -> Library:
    """Make a library by its exact name, one of `NAMES`; made once."""
    return _MAKERS[name]() if name in _MAKERS else _of_chart(name)
