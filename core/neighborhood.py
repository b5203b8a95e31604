"""What lies around pixels: growing and shrinking masks, and mean colors nearby."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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


def mean_nearby(
    picture: Picture, wanted: NDArray[np.bool_], rows: NDArray, columns: NDArray, radius: int, top: int = 0
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Mean color, around each position, of the pixels that are wanted.

    Parameters
    ----------
    picture
        The photo.
    wanted
        (h, width) which pixels count, for the picture's rows from `top` on; other rows do not count.
    rows, columns
        (n,) positions in the picture.
    radius
        Half the side of the square window. Wide windows are sampled on a grid.

    Returns
    -------
    mean
        (n, 3) float32 linear RGB, 0 where there is none.
    found
        (n,) whether any wanted pixel was there.
    """
    step = max(1, -(-(2 * radius + 1) // _POINTS))
    offsets = np.arange(-(radius // step) * step, radius + 1, step)
    dy, dx = (grid.reshape(-1) for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    mean, found = np.zeros((len(rows), 3), np.float32), np.zeros(len(rows), bool)
    chunk = max(1, 400_000 // len(dy))
    for start in range(0, len(rows), chunk):
        part = slice(start, start + chunk)
        y, x = rows[part, None] + dy, columns[part, None] + dx
        inside = (y >= top) & (y < top + wanted.shape[0]) & (x >= 0) & (x < wanted.shape[1])
        y, x = np.clip(y, top, top + wanted.shape[0] - 1), np.clip(x, 0, wanted.shape[1] - 1)
        counts = inside & wanted[y - top, x]
        chosen = np.nonzero(counts)
        light = picture.at(y[chosen], x[chosen])
        total = counts.sum(axis=1)
        sums = np.stack([np.bincount(chosen[0], light[:, k], minlength=len(y)) for k in range(3)], axis=1)
        mean[part] = sums / np.maximum(total, 1)[:, None]
        found[part] = total > 0
    return mean, found


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
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
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
        Groups of (m, 2) where to look: the first group in which any pixel counts is taken.

    Returns
    -------
    mean
        (n, 3) linear RGB, 0 where there is none.
    found
        (n,) whether any wanted pixel was there.
    """
    height, width = picture.shape
    mean, found = np.zeros((len(rows), 3)), np.zeros(len(rows), bool)
    for group in offsets:
        missing = np.flatnonzero(~found)
        chunk = max(1, 400_000 // len(group))
        for start in range(0, len(missing), chunk):
            at = missing[start : start + chunk]
            y, x = rows[at, None] + group[:, 0], columns[at, None] + group[:, 1]
            inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
            counts = inside & wanted[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
            chosen = np.nonzero(counts)
            light = picture.at(y[chosen], x[chosen])
            total = counts.sum(axis=1)
            sums = np.stack([np.bincount(chosen[0], light[:, k], minlength=len(at)) for k in range(3)], axis=1)
            mean[at] = sums / np.maximum(total, 1)[:, None]
            found[at] = total > 0
    return mean, found
