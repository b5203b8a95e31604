"""Colors outside the range that the output can hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import colorimetry
from .colorspace import SRGB, RGBSpace

# How far outside 0..1 a linear channel may lie before the pixel counts as out of gamut. Below this it is noise of
# the picture, and clipping it is invisible.
TOLERANCE = 1e-3

# Rec.709 luminance, the weights that the eye gives linear RGB; near enough for other display primaries here.
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def out_of_gamut(linear: NDArray) -> NDArray[np.bool_]:
    """(...) bool: which pixels (..., 3) have a channel outside 0..1 by more than the tolerance."""
    r, g, b = linear[..., 0], linear[..., 1], linear[..., 2]
    return (np.maximum(np.maximum(r, g), b) > 1 + TOLERANCE) | (np.minimum(np.minimum(r, g), b) < -TOLERANCE)


def fit_to_gamut(linear: NDArray[np.float32]) -> int:
    """Bring pixels into 0..1, in place, keeping hue and luminance and giving up chroma.

    Each pixel outside moves along the straight line to the grey of its own luminance until it is inside: the hue
    (dominant wavelength) stays, the color becomes paler. A pixel brighter than white becomes white. Single
    channels are never cut, which would turn the hue.

    Parameters
    ----------
    linear
        (n, 3) float32. Modified.

    Returns
    -------
    Number of pixels that were outside.
    """
    above = linear.size > 0 and linear.max() > 1 + TOLERANCE
    below = linear.size > 0 and linear.min() < -TOLERANCE
    if not (above or below):
        return 0
    # Channels first, for speed: a channel's place over three is its pixel's, and they come in order.
    if above and below:
        outlying = (linear > 1 + TOLERANCE) | (linear < -TOLERANCE)
    else:
        outlying = linear > 1 + TOLERANCE if above else linear < -TOLERANCE
    channels = np.flatnonzero(outlying) // 3
    outside = channels[np.diff(channels, prepend=-1) > 0]
    pixels = linear[outside]
    # Not as a product, which may round a pixel otherwise among other pixels.
    grey = np.clip(sum(pixels[:, k] * _LUMINANCE[k] for k in range(3)), 0.0, 1.0)[:, None]
    away = pixels - grey
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        room = np.where(away > 0, (1 - grey) / away, np.where(away < 0, -grey / away, np.inf))
    linear[outside] = grey + np.minimum(room.min(axis=1), 1)[:, None] * away
    return len(outside)


type Method = Literal["lab", "oklch"]


@dataclass(frozen=True, eq=False)
class Compromise:
    """The colors of a space that are nearest to given ones.

    Attributes
    ----------
    linear
        (..., 3) linear RGB in 0..1; those that were inside, as they were.
    difference
        (...) CIEDE2000 that they are away.
    """

    linear: NDArray[np.float64]
    difference: NDArray[np.float64]


# Lightnesses that are tried at once, how often between the best one's neighbors, and halvings of the search for chroma.
_LIGHTNESSES = 33
_PASSES = 6
_HALVINGS = 24


def nearest(linear: ArrayLike, space: RGBSpace = SRGB, method: Method = "lab") -> Compromise:
    """Find the nearest color that a space holds, by CIEDE2000 among the lightnesses and chromas of the same hue.

    For colors that a person chose, such as targets: it takes a hundred times as long as :func:`fit_to_gamut`, and
    keeps more of the chroma by giving up some lightness as well.

    Parameters
    ----------
    linear
        (..., 3) linear RGB of the space.
    space
        The space.
    method
        Whose hue is kept: that of CIELAB under the white of the space, or of Oklch, which turns blues less to violet.

    Returns
    -------
    Compromise
    """
    given = np.asarray(linear, np.float64)
    pixels = given.reshape(-1, 3)
    found = np.clip(pixels, 0, 1)
    outside = np.flatnonzero(out_of_gamut(pixels))
    if outside.size:
        found[outside] = _nearest(pixels[outside], space, method)
    inside = np.setdiff1d(np.arange(len(pixels)), outside)
    found[inside] = pixels[inside]
    labs = (colorimetry.linear_to_lab(colors, space) for colors in (pixels, found))
    return Compromise(found.reshape(given.shape), colorimetry.delta_e_2000(*labs).reshape(given.shape[:-1]))


def _nearest(pixels: NDArray, space: RGBSpace, method: Method) -> NDArray[np.float64]:
    """(n, 3) nearest colors to those outside: along a grid of lightnesses, then along a finer one around the best."""
    to_d65 = colorimetry.adaptation_matrix(space.white, SRGB.white)
    if method == "lab":
        given, top = colorimetry.lab_to_lch(colorimetry.linear_to_lab(pixels, space)), 100.0
    else:
        given, top = colorimetry.lab_to_lch(colorimetry.xyz_to_oklab(pixels @ (to_d65 @ space.to_xyz).T)), 1.0
    _, C0, hue = given.T

    def linear(L: NDArray, C: NDArray) -> NDArray:
        lab = colorimetry.lch_to_lab(np.stack([L, C, np.broadcast_to(hue, L.shape)], axis=-1))
        if method == "lab":
            return colorimetry.lab_to_linear(lab, space)
        return colorimetry.oklab_to_xyz(lab) @ np.linalg.inv(to_d65 @ space.to_xyz).T

    def chroma(L: NDArray) -> NDArray:
        """The most chroma, up to the given one, that the space has at a lightness."""
        low, high = np.zeros_like(L), np.broadcast_to(C0, L.shape).copy()
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            rgb = linear(L, middle)
            fits = (rgb.min(axis=-1) >= 0) & (rgb.max(axis=-1) <= 1)
            low, high = np.where(fits, middle, low), np.where(fits, high, middle)
        return low

    wanted = colorimetry.linear_to_lab(pixels, space)

    def distance(L: NDArray) -> NDArray:
        return colorimetry.delta_e_2000(wanted, colorimetry.linear_to_lab(linear(L, chroma(L)), space))

    low, high = np.zeros_like(C0), np.full_like(C0, top)
    for _ in range(_PASSES):
        grid = np.linspace(low, high, _LIGHTNESSES)
        best = grid[np.argmin(distance(grid), axis=0), np.arange(len(C0))]
        step = (high - low) / (_LIGHTNESSES - 1)
        low, high = np.maximum(best - step, low), np.minimum(best + step, high)
    return np.clip(linear(best, chroma(best)), 0, 1)


def marked(linear: NDArray[np.float32], color: ArrayLike = (1.0, 0.0, 1.0)) -> tuple[NDArray[np.float32], float]:
    """Show where a picture leaves the gamut.

    Parameters
    ----------
    linear
        (height, width, 3) linear RGB. Not modified.
    color
        (3,) of the marking.

    Returns
    -------
    picture
        The same with every pixel outside in that color.
    share
        Share of those pixels, 0..1.
    """
    outside = out_of_gamut(linear)
    picture = np.array(linear, np.float32)
    picture[outside] = np.asarray(color, np.float32)
    return picture, float(outside.mean()) if outside.size else 0.0
