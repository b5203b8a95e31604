"""Outlines as coverage: closed curves filled with smooth edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Scan lines in each row of pixels. Along them coverage is exact to `_FINE` of a pixel; both as whole numbers, so that
# what is summed up ends in a true 0.
_LINES = 4
_FINE = 64

# How a mask layer changes what the layers below it left: (below, layer, opacity) to coverage.
_BLENDS: dict[str, Callable[[NDArray, NDArray, float], NDArray]] = {
    "MERGE_ADD": lambda below, part, _: below + part * (1 - below),
    "MERGE_SUBTRACT": lambda below, part, _: below - part * below,
    "ADD": lambda below, part, _: below + part,
    "SUBTRACT": lambda below, part, _: below - part,
    "LIGHTEN": lambda below, part, _: np.maximum(below, part),
    "DARKEN": lambda below, part, _: np.minimum(below, part),
    "MUL": lambda below, part, _: below * part,
    "REPLACE": lambda below, part, opacity: below * (1 - opacity) + part * opacity,
    "DIFFERENCE": lambda below, part, _: np.abs(below - part),
}


@dataclass(frozen=True)
class Layer:
    """One layer of a mask made of curves.

    Attributes
    ----------
    polygons
        As for :func:`fill`.
    rule
        As for :func:`fill`.
    opacity
        0 to 1.
    inverted
        Whether the layer is what the polygons leave.
    blend
        How it changes the layers below: a name of Blender's mask layers, such as "MERGE_ADD".
    """

    polygons: tuple[NDArray, ...]
    rule: str = "union"
    opacity: float = 1.0
    inverted: bool = False
    blend: str = "MERGE_ADD"


def rasterize(layers: Sequence[Layer], shape: tuple[int, int]) -> NDArray[np.uint8]:
    """(height, width) coverage, 0..255, of layers from the lowest up, without feather."""
    value = np.zeros(shape, np.float32)
    for layer in layers:
        part = fill(layer.polygons, shape, layer.rule)
        if layer.blend != "REPLACE":
            part *= np.float32(layer.opacity)
        if layer.inverted:
            part = 1 - part
        value = _BLENDS[layer.blend](value, part, layer.opacity)
    return np.rint(np.clip(value, 0, 1) * 255).astype(np.uint8)


def bezier(points: ArrayLike, closed: bool = True, steps: int = 32) -> NDArray[np.float64]:
    """Polygon of a cubic Bézier curve.

    Parameters
    ----------
    points
        (n, 3, 2): of each point its left handle, itself and its right handle.
    closed
        Whether the last point is joined to the first by a curve; else by a straight line.
    steps
        Pieces of the curve from one point to the next.

    Returns
    -------
    (m, 2) corners.
    """
    p = np.asarray(points, np.float64)
    if len(p) < 2:
        return p[:, 1]
    after = np.roll(p, -1, axis=0)
    if not closed:
        p, after = p[:-1], after[:-1]
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    weights = ((1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3)
    corners = (p[:, 1], p[:, 2], after[:, 0], after[:, 1])
    curve = sum(w * c[:, None] for w, c in zip(weights, corners, strict=True))
    outline = np.reshape(curve, (-1, 2))
    return outline if closed else np.concatenate([outline, after[-1:, 1]])


def fill(polygons: Sequence[ArrayLike], shape: tuple[int, int], rule: str = "union") -> NDArray[np.float32]:
    """Fill closed polygons.

    Parameters
    ----------
    polygons
        Each (n, 2): the corners as (x, y) from the top left corner of the picture, in pixels; may leave it.
    shape
        (height, width) of the picture.
    rule
        What is inside: "union", what any of the polygons encloses; "nonzero", where they do not wind around as often
        one way as the other; "evenodd", where an odd number of outlines lies around.

    Returns
    -------
    (height, width) float32 coverage, 0..1, in steps of 1/256.
    """
    height, width = shape
    polygon, line, x, way = _crossings(polygons, height)
    if rule == "union":
        _, line, x, way = _turns(polygon, line, x, way, "nonzero")
    _, line, x, way = _turns(np.zeros_like(line), line, x, way, rule)
    place = np.rint(np.clip(x, 0, width) * _FINE).astype(np.int64)
    row, column, fine = line // _LINES, place // _FINE, place % _FINE
    change = np.zeros((height, width + 2), np.int32)
    np.add.at(change, (row, column), way * (_FINE - fine))
    np.add.at(change, (row, column + 1), way * fine)
    np.cumsum(change, axis=1, out=change)
    return change[:, :width].astype(np.float32) / np.float32(_LINES * _FINE)


def _crossings(polygons: Sequence[ArrayLike], height: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Where outlines cross scan lines: (n,) numbers of polygon and line, x, and 1 for down or -1 for up."""
    corners = [np.asarray(p, np.float64) for p in polygons]
    edges = np.concatenate([np.empty((0, 2, 2)), *(np.stack([p, np.roll(p, -1, axis=0)], axis=1) for p in corners)])
    owner = np.repeat(np.arange(len(corners)), [len(p) for p in corners])
    # Scan line k lies at (k + 1/2) / _LINES.
    first, last = (np.ceil(np.clip(edges[:, end, 1], 0, height) * _LINES - 0.5).astype(np.int64) for end in (0, 1))
    top, count = np.minimum(first, last), np.abs(last - first)
    edge = np.repeat(np.arange(len(edges)), count)
    line = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + top[edge]
    (x0, y0), (x1, y1) = edges[edge, 0].T, edges[edge, 1].T
    x = x0 + ((line + 0.5) / _LINES - y0) / (y1 - y0) * (x1 - x0)
    return owner[edge], line, x, np.sign(last - first)[edge]


def _turns(
    polygon: NDArray, line: NDArray, x: NDArray, way: NDArray, rule: str
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Those crossings, from left to right, at which a polygon is entered (1) or left (-1)."""
    order = np.lexsort((x, line, polygon))
    winding = np.cumsum(way[order])  # 0 again at the end of each line, as the outlines are closed
    inside = winding % 2 != 0 if rule == "evenodd" else winding != 0
    turns = np.flatnonzero(inside != np.concatenate([[False], inside[:-1]]))
    kept = order[turns]
    return polygon[kept], line[kept], x[kept], np.where(inside[turns], 1, -1)
