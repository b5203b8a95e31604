"""Several materials in one region: found by their hues, and offered as separate regions.

Pixels of one material lie in a plane with the white (Shafer 1985), so that gloss and shading leave its hue as it is:
each peak among the hues is a material. Gray is one too, unless it is the gloss of another: from a body color to its
gloss there are pixels of every saturation, from one material to the next there are few.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .neighborhood import erode
from .picture import Picture, above
from .reference import DARK, read_window, trimmed_mean

# Points along the longer side of the grid that is looked at.
_GRID = 240

# Saturation under which a pixel is gray; least share of a region that makes a material; hues that belong together.
_GRAY, _LEAST, _APART = 0.06, 0.04, np.radians(24)

# Bins of hue.
_BINS = 72

# Pixels between gray and colored, against the gray ones, up to which the gray is no gloss.
_GLOSS = 0.5


@dataclass(frozen=True, eq=False)
class Material:
    """One of several materials of a region.

    Attributes
    ----------
    click
        (x, y) of a pixel well inside it, to select it by.
    color
        (3,) float64 linear RGB there.
    share
        Of the region, 0..1.
    """

    click: tuple[int, int]
    color: NDArray[np.float64]
    share: float


def find_materials(picture: Picture, white: NDArray, mask: NDArray | None = None) -> list[Material]:
    """Materials of a region, the largest first; a single one where no other stands out.

    Parameters
    ----------
    picture
        The photo.
    white
        (3,) white of the light.
    mask
        Checked coverage of the region, or None for the whole picture.
    """
    height, width = picture.shape
    step = max(1, max(height, width) // _GRID)
    at = slice(step // 2, None, step)
    pixels = picture.linear(at, at)
    inside = np.ones(pixels.shape[:2], bool) if mask is None else above(mask[at, at], 0.95)
    colors = np.ascontiguousarray(pixels[inside].T)
    balanced = colors / white.astype(np.float32)[:, None]
    light = balanced.sum(axis=0)
    usable = (light > 3 * DARK) & np.isfinite(light) & (colors < picture.clip_level).all(axis=0)
    if not usable.any():
        return []
    usable &= light > 0.1 * np.quantile(light[usable], 0.9)
    inside[inside] = usable
    hue, saturation = _hue(balanced.compress(usable, axis=1), light[usable])
    kinds = _kinds(hue, saturation)
    of = np.full(inside.shape, -1, kinds.dtype)
    of[inside] = kinds
    found = []
    for kind in range(kinds.max() + 1):
        # What is coherent is a material; single fibers and specks are not.
        core = erode(of == kind, 1) & inside
        if np.count_nonzero(core) > _LEAST * np.count_nonzero(inside):
            y, x = _center(core)
            pixel = min(x * step + step // 2, width - 1), min(y * step + step // 2, height - 1)
            color = trimmed_mean(read_window(picture, pixel))
            found.append(Material(pixel, color, float((kinds == kind).mean())))
    return sorted(found, key=lambda material: -material.share)


def _hue(pixels: NDArray, light: NDArray) -> tuple[NDArray, NDArray]:
    """Angle and length in the plane of chromaticities of (3, n) white-balanced pixels."""
    red, green, blue = pixels
    x, y = (2 * red - green - blue) / 6**0.5, (green - blue) / 2**0.5
    return np.arctan2(y, x), np.hypot(x, y) / light


def _kinds(hue: NDArray, saturation: NDArray) -> NDArray[np.int8]:
    """(n,) number of the peak of hues that each pixel belongs to; one more for gray; -1 for none."""
    colored = saturation > _GRAY
    votes, _ = np.histogram(hue[colored], _BINS, (-np.pi, np.pi))
    votes = votes + np.roll(votes, 1) + np.roll(votes, -1)
    kinds = np.full(len(hue), -1, np.int8)
    count, taken = 0, np.zeros(_BINS, bool)
    centers = (np.arange(_BINS) + 0.5) * 2 * np.pi / _BINS - np.pi
    while True:
        left = np.where(taken, 0, votes)
        peak = centers[np.argmax(left)]
        if left.max() < _LEAST * len(hue):
            break
        taken |= _between(centers, peak) < _APART
        mine = colored & (kinds < 0) & (_between(hue, peak) < _APART)
        kinds[mine] = count
        count += 1
    gray = ~colored
    if gray.any():
        body = np.quantile(saturation[colored], 0.7) if colored.any() else 1.0
        ramp = (saturation > _GRAY) & (saturation < 0.6 * body)
        if count == 0 or np.count_nonzero(ramp) < _GLOSS * np.count_nonzero(gray):
            kinds[gray] = count
    return kinds


def _between(a: NDArray, b: float) -> NDArray:
    apart = np.abs(a - b)
    return np.minimum(apart, 2 * np.pi - apart)


def _center(inside: NDArray[np.bool_]) -> tuple[int, int]:
    """(row, column) of a point farthest from the outline, roughly."""
    left = np.pad(inside, 1)
    for k in reversed(range((min(left.shape) // 2).bit_length())):
        smaller = erode(left, 1 << k)
        if smaller.any():
            left = smaller
    rows, columns = np.nonzero(left)
    k = len(rows) // 2
    return int(rows[k]) - 1, int(columns[k]) - 1
