"""What lies around pixels: growing and shrinking masks, and mean colors nearby."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import transfer
from .picture import Picture

# Points in a window along each axis; a larger window is looked at on a coarser grid.
_POINTS = 13


def dilate(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Grow a (h, w) mask by a square of 2 radius + 1 pixels."""
    out = mask
    for axis in (0, 1):
        reached = 0
        while reached < radius:
            # No further than what is reached already: past the border there is nothing to shift in.
            step = min(radius - reached, reached + 1)
            grown = out.copy()
            ahead, behind = [slice(None)] * 2, [slice(None)] * 2
            ahead[axis], behind[axis] = slice(step, None), slice(None, -step)
            if step < out.shape[axis]:
                grown[tuple(ahead)] |= out[tuple(behind)]
                grown[tuple(behind)] |= out[tuple(ahead)]
            else:
                grown |= out.any(axis=axis, keepdims=True)
            out, reached = grown, reached + step
    return out


def erode(mask: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """Shrink a (h, w) mask by a square of 2 radius + 1 pixels; beyond the border counts as inside."""
    return ~dilate(~mask, radius)


def window(radius: int) -> NDArray[np.intp]:
    """Offsets (n, 2), rows and columns, of a square window of half the side `radius`; a wide one is a coarser grid."""
    step = max(1, -(-(2 * radius + 1) // _POINTS))
    offsets = np.arange(-(radius // step) * step, radius + 1, step)
    return np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)


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
        (n, 3) float32 linear RGB, 0 where there is none.
    found
        (n,) whether any wanted pixel was there.
    """
    mean, found = np.zeros((len(rows), 3), np.float32), np.zeros(len(rows), bool)
    for group in offsets:
        missing = np.flatnonzero(~found)
        if len(missing) == 0:
            break
        sums, total = _sums(picture, wanted, rows[missing], columns[missing], group)
        mean[missing] = sums / np.maximum(total, 1)[:, None]
        found[missing] = total > 0
    return mean, found


def _sums(
    picture: Picture, wanted: NDArray[np.bool_], rows: NDArray, columns: NDArray, group: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(n, 3) sums of the wanted pixels at the offsets of one group, and (n,) how many they are."""
    height, width = picture.shape
    codes, counts = picture.pixels.reshape(height * width, -1), wanted.reshape(-1)
    sums, total = np.zeros((len(rows), 3), np.float32), np.zeros(len(rows), np.float32)
    reach = np.abs(group).max(axis=0)
    near_border = (
        min(rows.min(), height - 1 - rows.max()) < reach[0] or min(columns.min(), width - 1 - columns.max()) < reach[1]
    )
    at = rows * width + columns
    for down, across in group.tolist():
        places = at + (down * width + across)
        if near_border:
            y, x = rows + down, columns + across
            inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
            counted = counts.take(places, mode="clip") & inside
        else:
            counted = counts.take(places)
        light = transfer.decode(codes.take(places, axis=0, mode="clip")[:, :3], picture.curve)
        np.add(sums, light, out=sums, where=counted[:, None])
        total += counted
    return sums, total
