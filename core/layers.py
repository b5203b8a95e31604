"""A photo taken apart, so that new colors cost a few products per pixel wherever it is drawn.

How much of a pixel's light each region takes part in is decided by the masks alone, soft edges and overlaps included.
That light is a picture of its own, and a recolor is a sum over these pictures,

    new = photo + sum over regions k of (M_k - 1) light_k + C_k corrections_k

with ``M_k`` and ``C_k`` the columns of the region's matrix. The sum is linear, so its pictures may be averaged over
blocks of pixels, for a smaller view, before the colors are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .picture import Picture, as_weights, bands
from .recolor import RegionMatrix

type Box = tuple[int, int, int, int]


@dataclass(frozen=True, eq=False)
class Layers:
    """The pictures of the sum.

    Attributes
    ----------
    box
        (left, top, right, bottom) of the part of the photo, in pixels.
    step
        Side of the square of pixels that one layer pixel is the mean of; those at the right and bottom of the box
        may be cut.
    data
        (n, height, width, 4) float32. Layer 0: linear RGB of the photo, and its alpha. Then of each region: the
        light that it takes part in, and the share of the pixel that it has; and its corrections, four to a layer.
    firsts
        Index of each region's first layer.
    """

    box: Box
    step: int
    data: NDArray[np.float32]
    firsts: tuple[int, ...]

    def weights(self, regions: Sequence[RegionMatrix]) -> NDArray[np.float32]:
        """(n, 3, 4) matrices of the layers: their products with the layers' pixels add up to the new pixels.

        `regions` has other colors, but the masks and corrections that the layers were made of.
        """
        matrices = np.zeros((len(self.data), 3, 4), np.float32)
        matrices[0, :, :3] = np.eye(3)
        for first, region in zip(self.firsts, regions, strict=True):
            matrices[first, :, :3] = region.matrix[:, :3] - np.eye(3)
            corrections = region.matrix[:, 3:]
            for k in range(0, corrections.shape[1], 4):
                part = corrections[:, k : k + 4]
                matrices[first + 1 + k // 4, :, : part.shape[1]] = part
        return matrices

    def recolored(self, regions: Sequence[RegionMatrix]) -> NDArray[np.float32]:
        """(height, width, 3) the sum: linear RGB, neither clipped nor brought into gamut."""
        return np.einsum("nhwc,nrc->hwr", self.data, self.weights(regions), optimize=True)


def step_for(shape: tuple[int, int], most_pixels: int, most_side: int = 8192) -> int:
    """Side of the blocks that leave a picture of (height, width) with no more pixels than that."""
    height, width = shape
    return max(1, int(np.ceil(np.sqrt(height * width / most_pixels))), -(-max(height, width) // most_side))


def take_apart(
    picture: Picture,
    regions: Sequence[RegionMatrix],
    box: Box | None = None,
    step: int = 1,
    alpha: NDArray | None = None,
) -> Layers:
    """Take a photo apart.

    Parameters
    ----------
    picture
        The photo.
    regions
        As for :func:`recolor.recolor`; of the matrices only the widths count.
    box
        (left, top, right, bottom) of the part that is wanted, inside the picture; None for all of it.
    step
        Side of the blocks of pixels to average.
    alpha
        (height, width) of the photo, codes or 0..1; None for an opaque one.
    """
    height, width = picture.shape
    left, top, right, bottom = box = box or (0, 0, width, height)
    firsts, count = [], 1
    for region in regions:
        firsts.append(count)
        extra = 0 if region.extra is None else region.extra.shape[2]
        count += 1 + -(-extra // 4)
    data = np.zeros((count, -(-(bottom - top) // step), -(-(right - left) // step), 4), np.float32)
    data[0, ..., 3] = 1
    columns = slice(left, right)
    for strip in bands((bottom - top + step - 1) // step, (right - left) * step):
        rows = slice(top + strip.start * step, min(bottom, top + strip.stop * step))
        linear = picture.linear(rows, columns)
        data[0, strip, :, :3] = _means(linear, step)
        if alpha is not None:
            data[0, strip, :, 3] = _means(as_weights(alpha[rows, columns])[..., None], step)[..., 0]
        room = np.ones(linear.shape[:2], np.float32)
        for region, first in zip(reversed(regions), reversed(firsts), strict=True):
            asked = room if region.mask is None else as_weights(region.mask[rows, columns])
            if not asked.any():
                continue
            granted = np.minimum(asked, room)
            room = room - granted
            light = _light(region, linear, asked, granted, rows, columns)
            data[first, strip, :, :3] = _means(light, step)
            data[first, strip, :, 3] = _means(granted[..., None], step)[..., 0]
            if region.extra is not None:
                corrections = _means(region.extra[rows, columns] * granted[..., None], step)
                for k in range(corrections.shape[2]):
                    data[first + 1 + k // 4, strip, :, k % 4] = corrections[..., k]
    return Layers(box, step, data, tuple(firsts))


def _light(
    region: RegionMatrix,
    linear: NDArray[np.float32],
    asked: NDArray[np.float32],
    granted: NDArray[np.float32],
    rows: slice,
    columns: slice,
) -> NDArray[np.float32]:
    """Light that a region takes part in: the pixels by its share of them, at soft edges what was unmixed."""
    light = linear * granted[..., None]
    if region.edge is not None:
        part = region.edge.within(rows)
        y, x = region.edge.rows[part] - rows.start, region.edge.columns[part] - columns.start
        here = (x >= 0) & (x < linear.shape[1])
        y, x = y[here], x[here]
        scale = granted[y, x] / np.maximum(asked[y, x], 1e-6)
        light[y, x] = region.edge.share[part][here] * scale[:, None]
    return light


def _means(values: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    """Mean of every block of (height, width, n) values; the last ones may be smaller."""
    if step == 1:
        return values
    for axis in (0, 1):
        values = np.moveaxis(values, axis, 0)
        length = len(values)
        sums = np.zeros((-(-length // step), *values.shape[1:]), np.float32)
        for start in range(step):
            part = values[start::step]
            sums[: len(part)] += part
        sizes = np.minimum(step, length - step * np.arange(len(sums)))
        sums /= sizes[:, None, None]
        values = np.moveaxis(sums, 0, axis)
    return values
