"""The product's outline: which part of a pixel's light comes from the product, and what it throws on its surround.

A pixel on the outline holds light of the product and of what lies behind it, ``V = a F + (1 - a) G``. Only ``a F``
changes color. Blending the recolored pixel with the old one by ``a`` leaves a rim of the old color (measured: dE 25
to 30 in a band of three pixels). Two facts do better. A ground of the light's own color is left as it is by the
recolor matrix, so that a mixed pixel can take all of it. And a colored ground lies off the plane of body color and
white, which tells its share in a pixel whatever the mask says; so masks that are a few pixels too tight or too wide
do no harm either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .dichromatic import sine
from .neighborhood import dilate, erode, mean_at, rings
from .picture import Picture, above, as_weights, bands, bounding_box

# Coverage that close to 0 or 1 counts as none or all.
_CLEAR = 0.004

# Sine of the angle to the white under which body color and white make no plane.
_FLAT = 0.05


@dataclass(frozen=True, eq=False)
class Edge:
    """The product's share of the light in pixels of its outline.

    Attributes
    ----------
    rows, columns
        (n,) positions, in row order.
    share
        (n, 3) float32 linear RGB: what of the pixel takes part in the recolor.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    share: NDArray[np.float32]

    def within(self, rows: slice) -> slice:
        """Which entries lie in these rows."""
        first, last = np.searchsorted(self.rows, (rows.start, rows.stop))
        return slice(int(first), int(last))


# Of a picture of so many pixels along its sides, the colors well inside and outside are looked up for every pixel; of a
# larger one for cells.
_CELL = 600

# Pixels of an outline that are looked at in one go; pixels beside it that tell whether a mask leaves out a rim.
_AT_ONCE, _RIM_SAMPLE = 200_000, 2_000


def reach(shape: tuple[int, int]) -> int:
    """How many pixels a mask may be wrong by: 4 for small pictures, 10 for 24 megapixels."""
    return int(np.clip(round(0.002 * np.sqrt(shape[0] * shape[1])), 4, 12))


def refine_outline(
    picture: Picture,
    mask: NDArray,
    reference: NDArray,
    white: NDArray,
    *,
    splits: bool = True,
    spill: NDArray[np.float32] | None = None,
) -> tuple[NDArray, Edge | None]:
    """Find the product's share in every pixel along the outline of a mask.

    Parameters
    ----------
    picture
        The photo.
    mask
        (height, width) checked coverage.
    reference, white
        (3,) linear RGB of the product and of the light.
    splits
        Whether the model leaves a ground of the light's color as it is; the body model does not.
    spill
        (height, width) of :func:`spill_weights`, to take in pixels outside the mask too: these, and the rim of the
        product where the mask is too tight. None leaves everything outside the mask as it is.

    Returns
    -------
    mask
        The coverage, with what was taken in; the given array if that is nothing.
    edge
        The shares, or None where no pixel needs one.
    """
    margin = reach(picture.shape)
    inside, outer, sure, clear = _grounds(mask, margin)
    band = outer & ~inside
    band |= ~(clear | sure)
    if spill is None:
        band &= mask > 0  # what lies outside stays as it is
    rows, columns = np.divmod(np.flatnonzero(band), band.shape[1])
    del band  # a byte for each of perhaps a hundred million pixels
    original = mask
    if spill is not None:
        mask = _with_spill(mask, spill)
    if len(rows) == 0:
        return mask, None
    asked = as_weights(original[rows, columns])
    np.logical_not(outer, out=outer)
    outer &= clear
    del sure
    find = _Outline(picture, (inside, outer, clear), margin, reference, white, splits, spill)
    share, taken = np.empty((len(rows), 3), np.float32), np.empty(len(rows), np.float32)
    for start in range(0, len(rows), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        share[part], taken[part] = find.shares(rows[part], columns[part], asked[part])
    covered = np.where(asked > 0, asked, taken)
    kept = covered > 0
    edge = Edge(rows[kept], columns[kept], share[kept])
    if taken.any():
        added = taken > 0
        mask[rows[added], columns[added]] = _coverage(taken[added], mask.dtype)
    return mask, edge


def rim_left_out(picture: Picture, mask: NDArray, reference: NDArray, white: NDArray) -> float:
    """Mean width, in pixels, of the product's rim that a mask leaves out: told up to :func:`reach`, from a sample.

    The mask is (height, width) checked coverage, the colors are (3,) linear RGB. The width is 0.3 to 0.9 for the half
    covered pixels about a hard mask that is right.
    """
    margin = reach(picture.shape)
    inside, outer, _, clear = _grounds(mask, margin)
    beside = np.flatnonzero(outer & clear)
    beside = beside[:: max(1, len(beside) // _RIM_SAMPLE)]
    if len(beside) == 0:
        return 0.0
    rows, columns = np.divmod(beside, mask.shape[1])
    none = np.broadcast_to(np.float32(0), picture.shape)
    find = _Outline(picture, (inside, ~outer & clear, clear), margin, reference, white, True, none)
    return margin * float(find.shares(rows, columns, np.zeros(len(rows)))[1].mean())


def _grounds(mask: NDArray, margin: int) -> tuple[NDArray[np.bool_], ...]:
    """Where a mask, wrong by `margin` at most, is surely the product; may be; covers all of a pixel; covers nothing."""
    sure, clear = above(mask, 1 - _CLEAR), ~above(mask, _CLEAR)
    inside, outer = np.zeros(mask.shape, bool), np.zeros(mask.shape, bool)
    box = tuple(slice(max(0, side.start - margin), side.stop + margin) for side in bounding_box(mask))
    solid = above(mask[box], 0.5)
    inside[box], outer[box] = erode(solid, margin), dilate(solid, margin)
    inside &= sure
    return inside, outer, sure, clear


class _Outline:
    """Finds the product's share in pixels along an outline.

    Parameters
    ----------
    picture, reference, white, splits, spill
        As for :func:`refine_outline`.
    grounds
        Which pixels are the product well inside, the ground well outside, and the ground by the mask.
    margin
        How many pixels the mask may be wrong by.
    """

    def __init__(
        self,
        picture: Picture,
        grounds: tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]],
        margin: int,
        reference: NDArray,
        white: NDArray,
        splits: bool,
        spill: NDArray[np.float32] | None,
    ) -> None:
        self.picture, self.reference, self.white, self.spill = picture, reference, white, spill
        self.inside, self.well_outside, self.outside = grounds
        # The product well inside and the ground well outside, whatever the mask is wrong by; and the ground next to it.
        self.cell = int(np.clip(np.sqrt(picture.shape[0] * picture.shape[1]) / _CELL, 1, margin // 2))
        self.far = rings((margin + 1, margin + 2, 2 * margin), (3 * margin, 4 * margin), (8 * margin,))
        self.near = rings((1, 2), (3, 4), (6,))
        self.split = _Shares(reference / white, splits)

    def shares(self, rows: NDArray, columns: NDArray, asked: NDArray) -> tuple[NDArray, NDArray]:
        """(n, 3) share of the product in the light of n pixels of coverage `asked`; (n,) coverage taken in by spill."""
        white = self.white
        product, known, ground, seen = self._far(rows, columns)
        product[~known] = self.reference
        pixels = self.picture.at(rows, columns)
        near, next_to = mean_at(self.picture, self.outside, rows, columns, self.near)
        by_far, by_near = (
            self.split.of(asked, pixels / white, product / white, there / white, there_is)
            for there, there_is in ((ground, seen), (near, next_to))
        )
        share, product_light, fits = by_far
        # Where the far ground does not explain the pixel the near one may; where none does, the mask has the word.
        rest = asked[:, None] * (pixels / white)
        share = fits * share + (1 - fits) * (by_near[2] * by_near[0] + (1 - by_near[2]) * rest)
        taken = np.zeros(len(rows))
        if self.spill is not None:
            taken = np.maximum(_rise(product_light, 0.05, 0.15) * fits[:, 0] * known, self.spill[rows, columns])
        share = np.where(asked > 0, 1, taken)[:, None] * share * white
        # No more light than the pixel has, and none below zero beyond what the pixel itself shows.
        return np.clip(share, np.minimum(pixels, 0), np.maximum(pixels, 0)), taken

    def _far(self, rows: NDArray, columns: NDArray) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        """Mean color of the product well inside, and of the ground well outside; each with whether there is any.

        They change slowly: those of one point stand for all pixels of its cell.
        """
        height, width = self.picture.shape
        across = -(-width // self.cell)
        cells, place = np.unique(rows // self.cell * across + columns // self.cell, return_inverse=True)
        y, x = (k * self.cell + self.cell // 2 for k in np.divmod(cells, across))
        at = np.minimum(y, height - 1), np.minimum(x, width - 1)
        found = (mean_at(self.picture, wanted, *at, self.far) for wanted in (self.inside, self.well_outside))
        (product, known), (ground, seen) = found
        return product[place], known[place], ground[place], seen[place]


def _coverage(weights: NDArray, dtype: np.dtype) -> NDArray:
    """Weights in 0..1 as the values of a mask; none that is more than 0 becomes 0."""
    return np.ceil(weights * np.iinfo(dtype).max).astype(dtype) if dtype.kind == "u" else weights.astype(dtype)


class _Shares:
    """Splits mixed pixels into product and ground, all white-balanced."""

    def __init__(self, color: NDArray, splits: bool) -> None:
        self.splits = splits and sine(color) > _FLAT
        gray = np.ones(3)
        self.body = np.linalg.pinv(np.column_stack([color, gray]))[0] if self.splits else color / (color @ color)
        normal = np.cross(color, gray)
        self.normal = normal / np.linalg.norm(normal) if self.splits else np.zeros(3)
        self.length = float(np.linalg.norm(color))

    def of(
        self, asked: NDArray, pixels: NDArray, product: NDArray, ground: NDArray, known: NDArray[np.bool_]
    ) -> tuple[NDArray, NDArray, NDArray]:
        """Split (n, 3) mixtures of product and ground, both (n, 3), where the ground is known; `asked` is coverage.

        Returns
        -------
        share
            (n, 3) what takes part in the recolor.
        product_light
            (n,) the product's body reflection in the pixel, 0..1 of the pure product's.
        fits
            (n, 1) 0..1: whether the pixel is such a mixture, and the two differ.
        """
        bright = np.linalg.norm(ground, axis=1) + 1e-9
        off_pixel, off_product, off_ground = (x @ self.normal for x in (pixels, product, ground))
        a_pixel, a_product, a_ground = (x @ self.body for x in (pixels, product, ground))
        a_product = np.maximum(a_product, 1e-3)
        # A ground off the plane: its share is the share of what is off the plane.
        apart = off_ground - off_product
        part = (off_pixel - off_product) / np.where(apart == 0, 1, apart)
        # Where the mask is sure, so little of it is the product's own doing: noise, light thrown back by the ground.
        part = np.where(asked == 1, part * _rise(part, 0.04, 0.12), part)
        left = pixels - np.clip(part, 0, 1)[:, None] * ground
        a_left = left @ self.body
        fits_off = _fall(np.abs(part - 0.5), 0.6, 0.8) * _rise(a_left / a_product, -0.15, -0.05)
        # A ground in the plane needs no share where it is neutral; where it has the product's hue, shading looks like a
        # mixture, and the mask has the word.
        between = a_product - a_ground
        body = np.clip((a_pixel - a_ground) / np.where(np.abs(between) < 1e-6, 1, between), 0, 1)
        stray = np.abs(off_pixel - body * off_product) / (np.linalg.norm(pixels, axis=1) + 1e-9)
        tinted = _rise(np.abs(a_ground) * self.length / bright, 0.35, 0.7) if self.splits else np.ones(len(pixels))
        inside = _fall(np.abs(apart) / bright, 0.08, 0.16)
        taken = inside * tinted * (1 - asked) + (1 - inside) * np.clip(part, 0, 1)
        fits = inside * _fall(stray, 0.08, 0.16) + (1 - inside) * fits_off
        distance = np.linalg.norm(product - ground, axis=1) / (np.linalg.norm(product, axis=1) + bright)
        return (
            pixels - taken[:, None] * ground,
            inside * (1 - tinted) * body + (1 - inside) * np.clip(a_left / a_product, 0, 1),
            (known * fits * _rise(distance, 0.08, 0.2))[:, None],
        )


def spill_weights(picture: Picture, mask: NDArray, reference: NDArray, white: NDArray) -> NDArray[np.float32]:
    """How much of each pixel around the product is a neutral surround with light of the product on it.

    There the recolor moves the bleeding along, as the paper does by processing the background too: a neutral surround
    is B, the light on it A. Counted are pixels in the plane of body color and white, on the product's side of it and
    with less of the product than of the light, up to the product's size away.

    Returns
    -------
    (height, width) float32 in 0..1; 0 where the mask covers anything.
    """
    height, width = picture.shape
    out = np.zeros((height, width), np.float32)
    split = _Shares(reference / white, True)
    if not split.splits:
        return out
    covered = as_weights(mask) > _CLEAR
    rows, columns = (_faded(covered.any(axis=axis)) for axis in (1, 0))
    for part in bands(height, width):
        if not rows[part].any():
            continue
        pixels = picture.linear(part) / white.astype(np.float32)
        size = np.linalg.norm(pixels, axis=2) + 1e-9
        stray = np.abs(pixels @ split.normal.astype(np.float32)) / size
        body = pixels @ split.body.astype(np.float32) * np.float32(split.length) / size
        neutral = _fall(stray, 0.04, 0.12) * _fall(body, 0.5, 0.8) * _rise(body, -0.06, -0.02)
        out[part] = neutral * np.minimum(rows[part, None], columns[None, :]) * ~covered[part]
    return out


def _with_spill(mask: NDArray, weights: NDArray[np.float32]) -> NDArray:
    """Coverage of the product and of its spill; (height, width) of the mask's kind, always a copy."""
    return np.maximum(mask, _coverage(weights, mask.dtype))


def _faded(line: NDArray[np.bool_]) -> NDArray[np.float32]:
    """1 along a line's true part and half its extent beyond, falling to 0 over the next half, on both sides."""
    inside = np.flatnonzero(line)
    if len(inside) == 0:
        return np.zeros(len(line), np.float32)
    at = np.arange(len(line))
    away = np.maximum(np.maximum(inside[0] - at, at - inside[-1]), 0)
    return np.clip(2 - 2 * away / (inside[-1] + 1 - inside[0]), 0, 1).astype(np.float32)


def _rise(x: NDArray, low: float, high: float) -> NDArray:
    """Smooth step from 0 at `low` to 1 at `high`."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _fall(x: NDArray, low: float, high: float) -> NDArray:
    return 1 - _rise(x, low, high)
