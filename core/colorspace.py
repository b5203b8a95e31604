"""RGB spaces: which light the three numbers of a picture mean."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import transfer
from .errors import ImageError


@dataclass(frozen=True, eq=False)
class RGBSpace:
    """Primaries, white and transfer curve of a picture.

    Attributes
    ----------
    name
        As shown to the user.
    to_xyz
        (3, 3) float64: linear RGB to CIE 1931 XYZ, not adapted; (1, 1, 1) gives the white, with Y = 1.
    curve
        Codes to linear light.
    """

    name: str
    to_xyz: NDArray[np.float64]
    curve: transfer.Curve

    @cached_property
    def from_xyz(self) -> NDArray[np.float64]:
        """(3, 3): CIE 1931 XYZ to linear RGB."""
        return np.linalg.inv(self.to_xyz)

    @cached_property
    def white(self) -> NDArray[np.float64]:
        """(3,) XYZ of RGB (1, 1, 1), with Y = 1."""
        return self.to_xyz.sum(axis=1)

    @cached_property
    def chromaticities(self) -> tuple[float, ...]:
        """(x, y) of red, green, blue and white, eight numbers."""
        columns = np.column_stack([self.to_xyz, self.white])
        return tuple(float(v) for v in (columns[:2] / columns.sum(axis=0)).T.ravel())

    def with_curve(self, curve: transfer.Curve, name: str | None = None) -> RGBSpace:
        """Return the same primaries under another transfer curve."""
        return RGBSpace(name or self.name, self.to_xyz, curve)


def normalized_primary_matrix(primaries: ArrayLike, white: ArrayLike) -> NDArray[np.float64]:
    """Linear RGB to XYZ from chromaticities (SMPTE RP 177-1993, 3.3).

    Parameters
    ----------
    primaries
        (3, 2) xy of red, green, blue.
    white
        (2,) xy of the white.
    """
    xy = np.vstack([primaries, np.reshape(white, (1, 2))]).astype(np.float64)
    xyz = np.column_stack([xy[:, 0] / xy[:, 1], np.ones(4), (1 - xy.sum(axis=1)) / xy[:, 1]])
    columns = xyz[:3].T
    return columns * np.linalg.solve(columns, xyz[3])


D65 = (0.3127, 0.3290)
D50 = (0.3457, 0.3585)
_ACES_WHITE = (0.32168, 0.33767)


def _space(name: str, primaries: ArrayLike, white: ArrayLike, curve: transfer.Curve) -> RGBSpace:
    return RGBSpace(name, normalized_primary_matrix(primaries, white), curve)


_REC_709 = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)]
_P3 = [(0.680, 0.320), (0.265, 0.690), (0.150, 0.060)]
_REC_2020 = [(0.708, 0.292), (0.170, 0.797), (0.131, 0.046)]

SPACES: dict[str, RGBSpace] = {
    "srgb": _space("sRGB", _REC_709, D65, transfer.SRGB),  # IEC 61966-2-1
    "display-p3": _space("Display P3", _P3, D65, transfer.SRGB),  # SMPTE EG 432-1, curve of sRGB
    "adobe-rgb": _space("Adobe RGB (1998)", [(0.64, 0.33), (0.21, 0.71), (0.15, 0.06)], D65, transfer.ADOBE_RGB),
    "prophoto": _space("ProPhoto RGB", [(0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001)], D50, transfer.PROPHOTO),
    "rec2020": _space("Rec.2020", _REC_2020, D65, transfer.REC_2020),  # ITU-R BT.2020-2
    "linear-srgb": _space("Linear Rec.709", _REC_709, D65, transfer.LINEAR),
    "linear-p3": _space("Linear P3", _P3, D65, transfer.LINEAR),
    "linear-rec2020": _space("Linear Rec.2020", _REC_2020, D65, transfer.LINEAR),
    "acescg": _space(  # AMPAS S-2014-004
        "ACEScg", [(0.713, 0.293), (0.165, 0.830), (0.128, 0.044)], _ACES_WHITE, transfer.LINEAR
    ),
    "aces2065-1": _space(  # SMPTE ST 2065-1
        "ACES2065-1", [(0.7347, 0.2653), (0.0, 1.0), (0.0001, -0.0770)], _ACES_WHITE, transfer.LINEAR
    ),
}
SRGB = SPACES["srgb"]
LINEAR_SRGB = SPACES["linear-srgb"]


def space_named(name: str) -> RGBSpace:
    """Look an RGB space up by the name used in recipes and on the command line.

    Raises
    ------
    ImageError
        If there is none of that name.
    """
    try:
        return SPACES[name.strip().lower()]
    except KeyError:
        known = ", ".join(SPACES)
        raise ImageError(f"Color space '{name}' is not known: use one of {known}.") from None
