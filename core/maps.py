"""Correction maps of a region: gloss and bounce pixel by pixel, and what clipping took away.

They are made once for a photo, in strips of rows on all cores; statistics of the neighborhood are kept on a coarse
grid of cells.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .compositing import Edge
from .mixture import Mixture
from .picture import Picture, as_weights, bounding_box
from .separation import MODEL_ERROR, NO_GLOSS, Frame, frame, split
from .stability import Noise

# Cells along the longer side of a large picture, and half the side of the smoothing window in cells.
_CELLS, _RADIUS = 400, 4

# Coverage from which a pixel is the product's alone.
_WHOLE = 0.95

# How closely the body's light in the neighborhood of a clipped pixel holds for it, relative.
_NEIGHBOR_ERROR = 0.4

# Light beyond this is no picture of a product.
_HUGE = 1e6

# Pixels of one strip, and pixels of an 8-bit picture beyond which its maps are kept in half precision: 2 ** -12 of a
# value, less than half a step of the codes.
_STRIP, _LARGE = 50_000, 16_000_000


@dataclass(frozen=True)
class Region:
    """What the maps are made from.

    Attributes
    ----------
    picture
        The photo.
    selection
        Checked coverage of the product, or None for all of the photo.
    mixture
        The model, without the columns for clipped pixels.
    noise
        Of the color across the body color, against the light along it, relative to the white.
    clipped
        Whether the product has clipped pixels to restore.
    below
        How far gloss may go below zero, as a share of the light.
    shines
        Whether highlights have the color of the light; if not, they have the product's.
    body_noise
        Noise of the body color itself, relative to its length.
    """

    picture: Picture
    selection: NDArray | None
    mixture: Mixture
    noise: Noise
    clipped: bool
    below: float = NO_GLOSS
    shines: bool = True
    body_noise: float = 0.0

    @property
    def mapped(self) -> bool:
        """Whether the model has maps of its own."""
        return self.mixture.projector.shape[1] > 3

    def balanced(self, rows: slice, columns: slice) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
        """Pixels relative to the white; which are the product's alone; which of these are clipped in any channel."""
        linear = self.picture.linear(rows, columns)
        whole = np.ones(linear.shape[:2], bool)
        if self.selection is not None:
            whole = as_weights(self.selection[rows, columns]) > _WHOLE
        over = np.logical_or.reduce([linear[..., k] >= self.picture.clip_level for k in range(3)])
        balanced: NDArray[np.float32] = np.divide(linear, self.mixture.white, dtype=np.float32)
        return np.clip(balanced, -_HUGE, _HUGE, out=balanced), whole, over & whole


def with_corrections(mixture: Mixture, clipped: bool) -> Mixture:
    """The same model, with columns for the corrections that restore clipped pixels."""
    if not clipped:
        return mixture
    if mixture.model == "metal":
        return replace(mixture, projector=np.hstack([mixture.projector, np.eye(3)]))
    terms = mixture.terms if "white" in mixture.terms else (*mixture.terms, "white")
    projector = np.zeros((len(terms), mixture.projector.shape[1]))
    projector[: len(mixture.terms)] = mixture.projector
    restored = ["body", "white"] if mixture.projector.shape[1] == 3 or "white" not in mixture.terms else ["body"]
    added = np.stack([np.array([term == name for term in terms], float) for name in restored], axis=1)
    return replace(mixture, terms=terms, projector=np.hstack([projector, added]))


def corrections(region: Region, mask: NDArray | None = None, edge: Edge | None = None) -> NDArray:
    """(height, width, n) corrections for the model :func:`with_corrections` of the region's.

    Parameters
    ----------
    region
        The product.
    mask, edge
        What is recolored: coverage, and the shares along the outline, see :func:`compositing.refine_outline`. There
        the corrections are those of the share, over its coverage.

    Returns
    -------
    float32, or float16 for large 8-bit pictures; 0 where nothing is recolored.
    """
    height, width = region.picture.shape
    final = with_corrections(region.mixture, region.clipped)
    coarse = region.picture.pixels.dtype == np.uint8 and height * width > _LARGE
    precision = np.float16 if coarse else np.float32
    out: NDArray = np.zeros((height, width, final.projector.shape[1] - 3), precision)
    rows, columns = (
        bounding_box(region.selection) if region.selection is not None else (slice(0, height), slice(0, width))
    )
    if out.shape[2] == 0 or rows.stop == rows.start:
        return out
    grid = _Grid(rows, columns, max(1, max(height, width) // _CELLS))
    axes = frame(region.mixture.body / region.mixture.white, region.mixture.feedback)
    if region.mapped:
        smooth = _Smooth(grid, grid.sums(lambda r: _moments(region, axes, r, columns)), region.noise)
        means = grid.sums(lambda r: _map_strip(region, axes, smooth, r, columns, out))
        whole = _Grid(slice(0, height), slice(0, width), 1)  # the mask may reach beyond the selection
        whole.each(lambda r: _outline(region, axes, mask, edge, r, out))
    else:
        means = grid.sums(lambda r: _plain_strip(region, r, columns))
    if region.clipped:
        filled = _fill(means)
        grid.each(lambda r: _restore_strip(region, final, filled, grid, r, columns, out))
    return out


class _Grid:
    """Cells over a box of the picture, and the strips of rows that it is worked in."""

    def __init__(self, rows: slice, columns: slice, cell: int) -> None:
        self.rows, self.columns, self.cell = rows, columns, cell
        self.height, self.width = -(-(rows.stop - rows.start) // cell), -(-(columns.stop - columns.start) // cell)
        step = max(1, _STRIP // (columns.stop - columns.start) // cell) * cell
        self.strips = [slice(r, min(r + step, rows.stop)) for r in range(rows.start, rows.stop, step)]

    def each[T](self, work: Callable[[slice], T]) -> list[T]:
        """Do some work for every strip, on all cores."""
        threads = min(os.process_cpu_count() or 1, len(self.strips))
        if threads == 1:
            return [work(strip) for strip in self.strips]
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(work, self.strips))

    def sums(self, work: Callable[[slice], NDArray]) -> NDArray[np.float64]:
        """(height, width, k) sums over each cell of the (h, w, k) that `work` makes of every strip."""
        return np.concatenate(self.each(lambda strip: self._summed(work(strip))))

    def _summed(self, part: NDArray) -> NDArray[np.float64]:
        if self.cell == 1:
            return part.astype(np.float64)
        rest = [(0, -size % self.cell) for size in part.shape[:2]]
        whole = np.pad(part, (*rest, (0, 0))) if any(more for _, more in rest) else part
        height, width, count = whole.shape
        by_row = whole.reshape(height // self.cell, self.cell, -1).sum(axis=1, dtype=np.float64)
        # As a product, for sums of a few numbers that lie apart are slow.
        sums = by_row.reshape(-1, self.cell * count) @ np.tile(np.eye(count), (self.cell, 1))
        return sums.reshape(height // self.cell, width // self.cell, count)

    def at(self, values: NDArray, rows: slice) -> NDArray[np.float32]:
        """(h, w, k) values (height, width, k) of the cells at every pixel of a strip, by linear interpolation."""
        down = (np.arange(rows.start, rows.stop) - self.rows.start + 0.5) / self.cell - 0.5
        over = (np.arange(self.columns.stop - self.columns.start) + 0.5) / self.cell - 0.5
        return _lerp(_lerp(values.astype(np.float32), down, 0), over, 1)


def _lerp(values: NDArray, at: NDArray, axis: int) -> NDArray:
    if len(at) == values.shape[axis] and (at == np.arange(len(at))).all():
        return values
    at = np.clip(at, 0, values.shape[axis] - 1)
    low = np.minimum(at.astype(np.intp), max(values.shape[axis] - 2, 0))
    part = (at - low).astype(np.float32).reshape((-1,) + (1,) * (values.ndim - 1 - axis))
    high = np.minimum(low + 1, values.shape[axis] - 1)
    below = np.take(values, low, axis=axis)
    below += part * (np.take(values, high, axis=axis) - below)
    return below


# --- Statistics of the neighborhood -----------------------------------------------------------------------
def _moments(region: Region, axes: Frame, rows: slice, columns: slice) -> NDArray[np.float32]:
    """(h, w, 9) weight, light, its square, and for both colors across: themselves, squares, products with light."""
    pixels, whole, over = region.balanced(rows, columns)
    light, y1, y2 = np.moveaxis(pixels @ _basis(axes), -1, 0)
    weight = (whole & ~over).astype(np.float32)
    parts = [np.ones_like(light), light, light * light, y1, y2, y1 * y1, y2 * y2, y1 * light, y2 * light]
    return np.stack(parts, axis=-1) * weight[..., None]


class _Smooth:
    """Color across as a straight line of the light along, in the neighborhood of every cell."""

    def __init__(self, grid: _Grid, moments: NDArray, noise: Noise) -> None:
        total = _windowed(moments)
        count = np.maximum(total[..., 0], 1.0)
        mean = total / count[..., None]
        light = mean[..., 1]
        spread = np.maximum(mean[..., 2] - light**2, 0.0)
        variance = noise.at(light) ** 2
        across = mean[..., 3:5]
        own = np.maximum(mean[..., 5:7] - across**2, 0.0)
        joint = mean[..., 7:9] - light[..., None] * across
        slope = joint / (spread + variance + 1e-12)[..., None]
        explained = slope**2 * spread[..., None]
        # A slope that noise alone could have made is none.
        slope *= np.maximum(0.0, 1 - 4 * (variance / count)[..., None] / np.maximum(explained, 1e-30))
        left = np.maximum(own - 2 * slope * joint + slope**2 * spread[..., None], 0.0)
        kept = np.maximum(0.0, 1 - 1.2 * variance[..., None] / np.maximum(left, 1e-30))
        offset = across - slope * light[..., None]
        # Offset and slope of windows of windows: each about half the variance of the mean of one.
        lines = np.concatenate([slope, offset, kept, (1 / count)[..., None]], axis=-1)
        weights = (total[..., 0] > 0).astype(np.float64)
        smooth = _windowed(lines * weights[..., None]) / np.maximum(_windowed(weights), 1e-9)[..., None]
        self.lines, self.grid, self.noise = smooth, grid, noise

    def apply(self, light: NDArray, across: NDArray, rows: slice) -> tuple[NDArray, NDArray]:
        """Smoothed color across (2, h, w) of a strip, and the variance of the noise left in it."""
        lines = np.moveaxis(self.grid.at(self.lines, rows), -1, 0)
        line = lines[0:2] * light + lines[2:4]
        kept = lines[4:6]
        variance = (self.noise.at(light) ** 2).astype(np.float32)
        left = (kept**2 + (1 - kept) ** 2 * lines[6]).mean(axis=0)
        return line + kept * (across - line), variance * left


def _windowed(values: NDArray) -> NDArray:
    """Sums over square windows of cells, smaller at the border."""
    for axis in (0, 1):
        size = values.shape[axis]
        total = np.concatenate([np.zeros_like(np.take(values, [0], axis)), np.cumsum(values, axis=axis)], axis=axis)
        high = np.take(total, np.minimum(np.arange(size) + _RADIUS + 1, size), axis=axis)
        values = high - np.take(total, np.maximum(np.arange(size) - _RADIUS, 0), axis=axis)
    return values


# --- Strips -----------------------------------------------------------------------------------------------
def _map_strip(
    region: Region, axes: Frame, smooth: _Smooth, rows: slice, columns: slice, out: NDArray
) -> NDArray[np.float32]:
    """Write gloss and bounce of a strip; returns (h, w, 2) weight and body of the pixels that count for neighbors."""
    pixels, whole, over = region.balanced(rows, columns)
    light, *across = np.moveaxis(pixels @ _basis(axes), -1, 0)
    safe = np.maximum(light, _floor(axes))
    colors, variance = smooth.apply(safe, np.stack(across), rows)
    known = whole & ~over & (light >= safe)
    maps, body = _told_apart(region, axes, safe, colors, variance)
    for k, found in enumerate(maps):
        out[rows, columns, k] = np.where(known, found, 0)
    return np.stack([known, body * known], axis=-1, dtype=np.float32)


def _told_apart(
    region: Region, axes: Frame, light: NDArray, across: NDArray, variance: NDArray
) -> tuple[list[NDArray], NDArray]:
    """Maps that the model has, of gloss and bounce; and A."""
    terms = region.mixture.terms
    variance = variance + (region.body_noise * light) ** 2
    has = "bounce" in terms, "white" in terms
    gloss, bounce, _ = split(light, across, variance, axes, *has, region.below, region.shines)
    body = (light - gloss * axes.white[0] - bounce * axes.bounce[0]) / axes.length
    return [found for found, term in ((gloss, "white"), (bounce, "bounce")) if term in terms], body


def _outline(region: Region, axes: Frame, mask: NDArray | None, edge: Edge | None, strip: slice, out: NDArray) -> None:
    """Tell apart, pixel by pixel, what is recolored in a strip beside the pixels that are wholly the product's."""
    if mask is None or region.selection is None:
        return
    rows, columns = np.nonzero((mask[strip] > 0) & (as_weights(region.selection[strip]) <= _WHOLE))
    if len(rows) == 0:
        return
    rows += strip.start
    light = region.picture.at(rows, columns)
    if edge is not None:
        part = edge.within(strip)
        edge_rows, edge_columns = edge.rows[part], edge.columns[part]
        here, places = (r * mask.shape[1] + c for r, c in ((rows, columns), (edge_rows, edge_columns)))
        beside = np.isin(places, here, assume_unique=True)
        cover = as_weights(mask[edge_rows[beside], edge_columns[beside]])
        light[np.searchsorted(here, places[beside])] = edge.share[part][beside] / np.maximum(cover, 1e-6)[:, None]
    balanced = np.clip(light / region.mixture.white.astype(np.float32), -_HUGE, _HUGE)
    along, *across = np.moveaxis(balanced @ _basis(axes), -1, 0)
    safe = np.maximum(along, _floor(axes))
    maps, _ = _told_apart(region, axes, safe, np.stack(across), region.noise.at(safe) ** 2)
    for k, told in enumerate(maps):
        out[rows, columns, k] = np.where(along >= safe, told, 0)


def _basis(axes: Frame) -> NDArray[np.float32]:
    return np.vstack([axes.along, axes.across]).astype(np.float32).T


def _floor(axes: Frame) -> np.float32:
    return np.float32(1e-4 * axes.length)


def _plain_strip(region: Region, rows: slice, columns: slice) -> NDArray[np.float32]:
    """(h, w, 2): weight and body of the pixels that are whole and not clipped."""
    pixels, whole, over = region.balanced(rows, columns)
    row = (region.mixture.coefficient("body") * region.mixture.white).astype(np.float32)
    weight = (whole & ~over).astype(np.float32)
    return np.stack([weight, (pixels @ row) * weight], axis=-1)


def _restore_strip(
    region: Region, final: Mixture, filled: NDArray, grid: _Grid, rows: slice, columns: slice, out: NDArray
) -> None:
    """Restore clipped pixels of a strip: their known channels, and the body's light around, tell A and B."""
    pixels, _, over = region.balanced(rows, columns)
    if not over.any():
        return
    part = out[rows, columns]
    x = pixels[over].astype(np.float64)
    v = region.mixture.body / region.mixture.white
    near = np.maximum(grid.at(filled[..., -1:], rows)[over, 0].astype(np.float64), 1e-7)
    top = x * region.mixture.white >= region.picture.clip_level
    body, gloss = _unclipped(region, x, top, near)
    has = np.concatenate([pixels[over] * region.mixture.white.astype(np.float32), part[over]], axis=1)
    base = region.mixture.projector.shape[1] - 3
    if region.mixture.model == "metal":
        part[over] = np.where(top, np.maximum(body[:, None] - x / (v + 1e-9), 0), 0)
    elif region.mapped and "white" in region.mixture.terms:
        part[over, 0] = gloss
        has[:, 3] = gloss
        part[over, base] = body - has @ final.coefficient("body")
    else:
        part[over, base] = body - has @ final.coefficient("body")
        part[over, base + 1] = gloss - has @ final.coefficient("white")


def _unclipped(
    region: Region, x: NDArray, top: NDArray[np.bool_], near: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A and B of (n, 3) balanced pixels whose channels `top` are clipped, in the body's light `near` them.

    Least squares over the known channels, and A near that of the neighbors; or, where highlights have the product's
    color, B near none.
    """
    v = region.mixture.body / region.mixture.white
    known = (~top).astype(np.float64)
    level = (known * x).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    sigma = np.hypot(region.noise.at(level), MODEL_ERROR * level)
    trust = sigma / _NEIGHBOR_ERROR if region.shines else 1e-3 * sigma
    matte = 0.0 if region.shines else (sigma / (NO_GLOSS * np.maximum(level, 1e-6))) ** 2
    a11 = (known * v**2).sum(axis=1) + (trust / near) ** 2 + 1e-9
    a12, a22 = (known * v).sum(axis=1), known.sum(axis=1) + matte + 1e-9
    r1 = (known * x * v).sum(axis=1) + trust**2 / near + 1e-9 * near
    r2 = (known * x).sum(axis=1)
    body = np.clip((a22 * r1 - a12 * r2) / (a11 * a22 - a12**2), 0, 6 * near)
    # A clipped channel was at least what was stored.
    if not region.shines:
        body = np.maximum(body, np.where(top, x / np.maximum(v, 1e-9), 0).max(axis=1))
    gloss = (r2 - a12 * body) / a22
    return body, np.maximum(gloss, np.where(top, x - body[:, None] * v, -np.inf).max(axis=1))


def _fill(means: NDArray) -> NDArray[np.float64]:
    """Mean of every cell from sums with their weight first; cells without any get what lies around (pull and push).

    S. J. Gortler, R. Grzeszczuk, R. Szeliski and M. F. Cohen, "The lumigraph", SIGGRAPH 96, 43-54 (1996).
    """
    weight, sums = means[..., :1], means[..., 1:]
    own = sums / np.maximum(weight, 1e-9)
    if (weight > 0).all() or max(weight.shape[:2]) == 1:
        return own
    height, width = weight.shape[:2]
    rows, columns = np.arange(0, height, 2), np.arange(0, width, 2)
    coarse = np.add.reduceat(np.add.reduceat(means, rows, axis=0), columns, axis=1)
    wide = _fill(coarse)
    wide = _lerp(_lerp(wide, (np.arange(height) - 0.5) / 2, 0), (np.arange(width) - 0.5) / 2, 1)
    return np.where(weight > 0, own, wide)
