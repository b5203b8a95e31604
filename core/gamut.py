"""Colors outside the range that the output can hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    grey = np.clip(pixels @ _LUMINANCE, 0.0, 1.0)[:, None]
    away = pixels - grey
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        room = np.where(away > 0, (1 - grey) / away, np.where(away < 0, -grey / away, np.inf))
    linear[outside] = grey + np.minimum(room.min(axis=1), 1)[:, None] * away
    return len(outside)
