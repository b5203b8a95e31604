"""Soft masks: which part of a pixel's light comes from the product.

A pixel on the outline holds light of the product and of what lies behind it, ``V = a F + (1 - a) G``. Only ``a F``
changes color. Blending the recolored pixel with the old one by ``a`` leaves a rim of the old color (measured: dE 20
to 30 in a band of three pixels); subtracting the background first does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .picture import Picture, as_weights


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


def box_sum(values: NDArray, radius: int) -> NDArray[np.float64]:
    """Sum over the (2 radius + 1) square around every pixel of (h, w) or (h, w, c), cut off at the border."""
    height, width = values.shape[:2]
    table = np.zeros((height + 1, width + 1, *values.shape[2:]))
    np.cumsum(np.cumsum(values, axis=0, dtype=np.float64), axis=1, out=table[1:, 1:])
    top, bottom = (
        np.clip(np.arange(height) - radius, 0, None),
        np.clip(np.arange(height) + radius + 1, None, height),
    )
    left, right = (
        np.clip(np.arange(width) - radius, 0, None),
        np.clip(np.arange(width) + radius + 1, None, width),
    )
    rows = table[bottom] - table[top]
    return rows[:, right] - rows[:, left]


def unmix_edge(picture: Picture, mask: NDArray, radius: int = 6) -> Edge | None:
    """Find the product's share in every pixel of soft coverage, from the background beside it.

    Parameters
    ----------
    picture
        The photo.
    mask
        (height, width) checked coverage.
    radius
        How far to look for clear background, in pixels. Where there is none the share is ``a V``, a plain blend.

    Returns
    -------
    The edge, or None where the mask has no soft pixel.
    """
    height, width = picture.shape
    parts: list[tuple[NDArray, NDArray, NDArray]] = []
    strip = max(1, 16 * 24_000 // width)
    for top in range(0, height, strip):
        bottom = min(height, top + strip)
        first, last = max(0, top - radius), min(height, bottom + radius)
        own = as_weights(mask[top:bottom])
        soft = (own > 0.004) & (own < 0.996)
        if not soft.any():
            continue
        columns = np.flatnonzero(soft.any(axis=0))
        left, right = max(0, int(columns[0]) - radius), min(width, int(columns[-1]) + 1 + radius)
        linear = picture.linear(slice(first, last), slice(left, right))
        outside = as_weights(mask[first:last, left:right]) <= 0.004
        count = box_sum(outside, radius)[top - first : bottom - first]
        light = box_sum(linear * outside[..., None], radius)[top - first : bottom - first]
        y, x = np.nonzero(soft[:, left:right])
        cover, n = own[:, left:right][y, x][:, None], count[y, x][:, None]
        pixels = linear[top - first : bottom - first][y, x]
        background = light[y, x] / np.maximum(n, 1)
        share = np.where(n > 0, pixels - (1 - cover) * background, cover * pixels)
        # No more light than the pixel has, and none below zero beyond what the pixel itself shows.
        share = np.clip(share, np.minimum(pixels, 0), np.maximum(pixels, 0))
        parts.append((y + top, x + left, share.astype(np.float32)))
    if not parts:
        return None
    return Edge(*(np.concatenate(column) for column in zip(*parts, strict=True)))
