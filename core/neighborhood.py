"""What lies around pixels: growing and shrinking masks, and mean colors nearby."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from . import transfer
from .picture import Picture

# Points in a window along each axis; a larger window is looked at on a coarser grid.
_POINTS = 13

# Positions that are looked around in one go, so that what is seen there fits the cache.
_AT_ONCE = 4096


def dilate(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Grow a (h, w) mask by a square of 2 radius + 1 pixels."""
    return _unpacked(_grown(mask, radius), mask.shape[1])


def erode(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Shrink a (h, w) mask by a square of 2 radius + 1 pixels; beyond the border counts as inside."""
    return ~dilate(~mask, radius)


def along_outline(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Pixels of a (h, w) mask that :func:`erode` takes away, and those that :func:`dilate` adds."""
    return _unpacked(_grown(mask, radius) & _grown(~mask, radius), mask.shape[1])


def _grown(mask: NDArray[np.bool_], radius: int) -> NDArray[np.uint64]:
    """Grow a (h, w) mask; returns it as bits, 64 pixels of a row in a word."""
    words = np.zeros((mask.shape[0], -(-mask.shape[1] // 64)), "<u8")
    packed = np.packbits(mask, axis=1, bitorder="little")
    words.view(np.uint8)[:, : packed.shape[1]] = packed
    for spread in (_spread_down, _spread_across):
        reached = 0
        while reached < radius:
            # No further than what is reached already: past the border there is nothing to shift in.
            step = min(radius - reached, reached + 1, 63)
            words, reached = spread(words, step), reached + step
    return words


def _unpacked(words: NDArray[np.uint64], width: int) -> NDArray[np.bool_]:
    return np.unpackbits(words.view(np.uint8), axis=1, count=width, bitorder="little").view(bool)


def _spread_down(words: NDArray[np.uint64], step: int) -> NDArray[np.uint64]:
    """Bits, and those `step` rows above and below them."""
    out = words.copy()
    out[step:] |= words[:-step]
    out[:-step] |= words[step:]
    return out


def _spread_across(words: NDArray[np.uint64], step: int) -> NDArray[np.uint64]:
    """Bits, and those `step` columns before and after them."""
    ahead, rest = np.uint64(step), np.uint64(64 - step)
    out = words | words << ahead | words >> ahead
    out[:, 1:] |= words[:, :-1] >> rest
    out[:, :-1] |= words[:, 1:] << rest
    return out


def window(radius: int) -> NDArray[np.intp]:
    """Offsets (n, 2), rows and columns, of a square window of half the side `radius`; a wide one is a coarser grid."""
    step = max(1, -(-(2 * radius + 1) // _POINTS))
    offsets = np.arange(-(radius // step) * step, radius + 1, step)
    return np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)


@cache
def rings(*radii: tuple[float, ...]) -> list[NDArray[np.intp]]:
    """Offsets (n, 2), rows and columns, of points on circles: one array for each group of radii."""
    groups = []
    for group in radii:
        angles = 2 * np.pi * (np.arange(12) + 0.5 * np.arange(len(group))[:, None]) / 12
        circles = np.asarray(group)[:, None, None] * np.stack([np.sin(angles), np.cos(angles)], axis=-1)
        groups.append(np.unique(np.rint(circles).astype(np.intp).reshape(-1, 2), axis=0))
    return groups


def mean_at(
    picture: Picture, wanted: NDArray[np.bool_], rows: NDArray, columns: NDArray, offsets: list[NDArray[np.intp]]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Mean color, around each position, of the pixels that are wanted.

    Parameters
    ----------
    picture
        The photo.
    wanted
        (height, width) which pixels count.
    rows, columns
        (n,) positions.
    offsets
        Groups of (m, 2) where to look, from :func:`window` or :func:`rings`: the first group in which any pixel counts
        is taken.

    Returns
    -------
    mean
        (3, n) float32 linear RGB, 0 where there is none.
    found
        (n,) whether any wanted pixel was there.
    """
    mean, found = np.zeros((3, len(rows)), np.float32), np.zeros(len(rows), bool)
    for group in offsets:
        missing = np.flatnonzero(~found)
        if len(missing) == 0:
            break
        sums, total = _sums(picture, wanted, rows[missing], columns[missing], group)
        mean[:, missing] = sums / np.maximum(total, 1)
        found[missing] = total > 0
    return mean, found


def _sums(
    picture: Picture, wanted: NDArray[np.bool_], rows: NDArray, columns: NDArray, group: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(3, n) sums of the wanted pixels at the offsets of one group, and (n,) how many they are."""
    height, width = picture.shape
    codes, counts = picture.pixels.reshape(height * width, -1), wanted.reshape(-1)
    sums, total = np.zeros((3, len(rows)), np.float32), np.zeros(len(rows), np.float32)
    down, across = group.T[..., None]
    for start in range(0, len(rows), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        y, x = rows[part], columns[part]
        places = (down * width + across) + (y * width + x)
        counted = counts.take(places, mode="clip")
        if any(
            at.min() + off.min() < 0 or at.max() + off.max() >= side
            for at, off, side in ((y, down, height), (x, across, width))
        ):
            counted &= (y + down >= 0) & (y + down < height) & (x + across >= 0) & (x + across < width)
        found = np.flatnonzero(counted)
        of = found % len(y)
        light = transfer.decode(codes.take(places.reshape(-1).take(found), axis=0)[:, :3], picture.curve)
        total[part] = np.bincount(of, minlength=len(y))
        for k in range(3):
            sums[k, part] = np.bincount(of, light[:, k], len(y))
    return sums, total
