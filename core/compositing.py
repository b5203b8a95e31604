"""Soft masks: which part of a pixel's light comes from the product.

A pixel on the outline holds light of the product and of what lies behind it, ``V = a F + (1 - a) G``. Only ``a F``
changes color. Blending the recolored pixel with the old one by ``a`` leaves a rim of the old color (measured: dE 20
to 30 in a band of three pixels); subtracting the background first does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .neighborhood import mean_nearby
from .picture import Picture, as_weights, strips

# Coverage that close to 0 or 1 counts as none or all.
_CLEAR = 0.004

# A share this far below zero, against the pixel, is no share.
_IMPOSSIBLE = 0.1

# How far to look for clear background, in pixels: near first, farther for wide soft edges. Where there is none
# the share is ``a V``, a plain blend.
_RADII = (6, 30)


@dataclass(frozen=True, eq=False)
class Edge:
    """The product's share of the light in pixels that the mask covers in part.

    Attributes
    ----------
    rows, columns
        (n,) positions, in row order.
    share
        (n, 3) float32 linear RGB, ``a F``.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    share: NDArray[np.float32]

    def within(self, rows: slice) -> slice:
        """Which entries lie in these rows."""
        first, last = np.searchsorted(self.rows, (rows.start, rows.stop))
        return slice(int(first), int(last))


def unmix_edge(picture: Picture, mask: NDArray) -> Edge | None:
    """Find the product's share in every pixel of soft coverage, from the background beside it.

    Parameters
    ----------
    picture
        The photo.
    mask
        (height, width) checked coverage.

    Returns
    -------
    The edge, or None where the mask has no soft pixel.
    """
    height, width = picture.shape
    found: list[tuple[NDArray, NDArray, NDArray]] = []
    for top, bottom in strips(height, width):
        cover = as_weights(mask[top:bottom])
        rows, columns = np.nonzero((cover > _CLEAR) & (cover < 1 - _CLEAR))
        if len(rows) == 0:
            continue
        background, known = np.zeros((len(rows), 3), np.float32), np.zeros(len(rows), bool)
        for radius in _RADII:
            missing = np.flatnonzero(~known)
            if len(missing) == 0:
                break
            first = max(0, top - radius)
            outside = as_weights(mask[first : bottom + radius]) <= _CLEAR
            background[missing], known[missing] = mean_nearby(
                picture, outside, rows[missing] + top, columns[missing], radius, top=first
            )
        a = cover[rows, columns][:, None]
        pixels = picture.at(rows + top, columns)
        share = pixels - (1 - a) * background
        # A mask that was blurred, not seen: the pixel is no such mixture, so nothing can be subtracted from it.
        impossible = (share < -_IMPOSSIBLE * np.abs(pixels).max(axis=1, keepdims=True)).any(axis=1)
        share = np.where((known & ~impossible)[:, None], share, a * pixels)
        # No more light than the pixel has, and none below zero beyond what the pixel itself shows.
        share = np.clip(share, np.minimum(pixels, 0), np.maximum(pixels, 0))
        found.append((rows + top, columns, share.astype(np.float32)))
    if not found:
        return None
    return Edge(*(np.concatenate(column) for column in zip(*found, strict=True)))
