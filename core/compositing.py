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
from .neighborhood import along_outline, mean_at, rings
from .picture import Picture, above, as_weights, bands

# Coverage that close to 0 or 1 counts as none or all.
_CLEAR = 0.004

# Light that is too little to be worth a recolor.
_LITTLE_LIGHT = 1e-4

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
_CELL = 450

# Pixels of an outline that are looked at in one go; pixels beside it that tell whether a mask leaves out a rim.
_AT_ONCE, _RIM_SAMPLE = 200_000, 1_000

# Share of a pixel's light by which its share may differ from it and still be all of it.
_SAME = 1e-6


def reach(shape: tuple[int, int]) -> int:
    """How many pixels a mask may be wrong by: 4 for small pictures, 10 for 24 megapixels."""
    return int(np.clip(round(0.002 * np.sqrt(shape[0] * shape[1])), 4, 12))


@dataclass(frozen=True, eq=False)
class Sides:
    """What a mask says of the pixels beside its outline, if it may be a few pixels wrong.

    Attributes
    ----------
    margin
        How many pixels the mask may be wrong by.
    unsure
        (height, width) which pixels lie that near its outline.
    well_inside, well_outside, outside
        (height, width) which are surely the product, surely the ground, and the ground by the mask.
    """

    margin: int
    unsure: NDArray[np.bool_]
    well_inside: NDArray[np.bool_]
    well_outside: NDArray[np.bool_]
    outside: NDArray[np.bool_]

    @classmethod
    def of(cls, mask: NDArray) -> Sides:
        """Those of (height, width) checked coverage."""
        margin = reach(mask.shape)
        unsure, outside = along_outline(above(mask, 0.5), margin), ~above(mask, _CLEAR)
        return cls(margin, unsure, above(mask, 1 - _CLEAR) > unsure, outside > unsure, outside)


def refine_outline(
    picture: Picture,
    mask: NDArray,
    reference: NDArray,
    white: NDArray,
    *,
    splits: bool = True,
    spill: NDArray[np.float32] | None = None,
    sides: Sides | None = None,
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
    sides
        Of the mask, if they are known already.

    Returns
    -------
    mask
        The coverage, with what was taken in; the given array if that is nothing.
    edge
        The shares, or None where no pixel needs one.
    """
    sides = sides or Sides.of(mask)
    outline = _Outline(picture, sides, reference, white, splits)
    band = ~(sides.well_inside | sides.well_outside)
    if spill is None:
        band &= mask > 0  # what lies outside stays as it is
    rows, columns = np.divmod(np.flatnonzero(band), band.shape[1])
    del band  # a byte for each of perhaps a hundred million pixels
    asked = as_weights(mask[rows, columns])
    share, taken = np.empty((len(rows), 3), np.float32), np.zeros(len(rows), np.float32)
    kept = np.empty(len(rows), bool)
    for start in range(0, len(rows), _AT_ONCE):
        part = slice(start, start + _AT_ONCE)
        at = rows[part], columns[part]
        light, product, pixels = outline.shares(*at, asked[part])
        # What is all the product's needs no share.
        kept[part] = (asked[part] < 1) | (np.abs(light - pixels) > _SAME * np.abs(pixels)).any(axis=0)
        if spill is not None:
            taken[part] = np.maximum(product, spill[at])
            light *= np.where(asked[part] > 0, 1, taken[part])
        share[part] = light.T
    if spill is not None:
        mask = _with_spill(mask, spill)
        added = taken > asked
        mask[rows[added], columns[added]] = _coverage(taken[added], mask.dtype)
        kept &= (asked > 0) | (taken > 0)
    return mask, Edge(rows[kept], columns[kept], share[kept]) if kept.any() else None


def rim_left_out(picture: Picture, sides: Sides, reference: NDArray, white: NDArray) -> float:
    """Mean width, in pixels, of the product's rim that a mask leaves out: told up to :func:`reach`, from a sample.

    The colors are (3,) linear RGB. The width is 0.3 to 0.9 for the half covered pixels about a hard mask that is right.
    """
    outline = _Outline(picture, sides, reference, white, True)
    beside = np.flatnonzero(sides.unsure & sides.outside)
    beside = beside[:: max(1, len(beside) // _RIM_SAMPLE)]
    if len(beside) == 0:
        return 0.0
    seen = outline.by_far(*np.divmod(beside, picture.shape[1]), np.zeros(len(beside), np.float32))
    return sides.margin * float(seen.shows.mean())


@dataclass(eq=False)
class _Mixed:
    """Pixels told apart by the color of the product well inside, and of the ground well outside.

    Attributes
    ----------
    pixels, product
        (3, n) white-balanced: the pixels, and the product next to them.
    share
        (3, n) what of them takes part in the recolor.
    fits
        (n,) 0..1: whether they are such a mixture.
    shows
        (n,) 0..1: how surely the product shows in them.
    """

    pixels: NDArray
    product: NDArray
    share: NDArray
    fits: NDArray
    shows: NDArray


class _Outline:
    """Finds the product's share in pixels along an outline.

    Parameters
    ----------
    picture, sides, reference, white, splits
        As for :func:`refine_outline`.
    """

    def __init__(self, picture: Picture, sides: Sides, reference: NDArray, white: NDArray, splits: bool) -> None:
        self.picture, self.sides, margin = picture, sides, sides.margin
        # Codes are of ordinary size; the square of a float may be too large for its kind.
        self.white: NDArray = white.astype(np.float32 if picture.pixels.dtype.kind == "u" else np.float64)[:, None]
        self.reference = reference[:, None] / self.white
        self.cell = int(np.clip(np.sqrt(picture.shape[0] * picture.shape[1]) / _CELL, 1, margin))
        # The product well inside and the ground well outside, whatever the mask is wrong by; and the ground next to it.
        self.far = rings((margin + 1, margin + 2, 2 * margin), (3 * margin, 4 * margin), (8 * margin,))
        self.near = rings((1, 2), (3, 4), (6,))
        self.split = _Shares(reference / white, splits)

    def shares(self, rows: NDArray, columns: NDArray, asked: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Find the share of the product in n pixels of coverage `asked`.

        Returns
        -------
        (3, n) its light, (n,) how surely it shows in them, and (3, n) all their light.
        """
        seen = self.by_far(rows, columns, asked)
        share, pixels = seen.share, seen.pixels
        # Where the far ground does not explain the pixel the near one may; where none does, the mask has the word.
        k = np.flatnonzero(seen.fits < 1)
        if len(k):
            unfit, inner, there = (x.take(k, axis=1) for x in (pixels, seen.product, share))
            near, next_to = self._mean(self.sides.outside, rows[k], columns[k], self.near, -(-self.cell // 2))
            by_near, _, fits = self.split.of(asked[k], unfit, inner, near, next_to)
            rest = asked[k] * unfit
            rest += fits * (by_near - rest)
            share[:, k] = rest + seen.fits[k] * (there - rest)
        share *= self.white
        pixels *= self.white
        # No more light than the pixel has, and none below zero beyond what the pixel itself shows.
        return np.clip(share, np.minimum(pixels, 0), np.maximum(pixels, 0)), seen.shows, pixels

    def by_far(self, rows: NDArray, columns: NDArray, asked: NDArray) -> _Mixed:
        """Tell n pixels of coverage `asked` apart by the product well inside and the ground well outside."""
        pixels = np.ascontiguousarray(self.picture.at(rows, columns).T) / self.white
        # They change slowly.
        product, known = self._mean(self.sides.well_inside, rows, columns, self.far, self.cell)
        ground, seen = self._mean(self.sides.well_outside, rows, columns, self.far, self.cell)
        product[:, ~known] = self.reference
        share, light, fits = self.split.of(asked, pixels, product, ground, seen)
        return _Mixed(pixels, product, share, fits, _rise(light, 0.05, 0.15) * fits * known)

    def _mean(
        self, wanted: NDArray[np.bool_], rows: NDArray, columns: NDArray, around: list[NDArray[np.intp]], cell: int
    ) -> tuple[NDArray, NDArray]:
        """White-balanced mean color around n pixels, (3, n), and whether there is any: one for all pixels of a cell."""
        across = -(-self.picture.shape[1] // cell)
        places = rows // cell * across + columns // cell
        seen = np.zeros(-(-self.picture.shape[0] // cell) * across, bool)
        seen[places] = True
        cells = np.flatnonzero(seen)
        number = np.empty(len(seen), np.int32)
        number[cells] = np.arange(len(cells))
        y, x = (
            np.minimum(k * cell + cell // 2, side - 1)
            for k, side in zip(np.divmod(cells, across), self.picture.shape, strict=True)
        )
        mean, found = mean_at(self.picture, wanted, y, x, around)
        place = number.take(places)
        return (mean / self.white).take(place, axis=1), found.take(place)


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
        """Split mixtures of product and ground, (3, n) all, where the ground is known; `asked` is coverage.

        Returns
        -------
        share
            (3, n) what takes part in the recolor.
        product_light
            (n,) the product's body reflection in the pixel, 0..1 of the pure product's.
        fits
            (n,) 0..1: whether the pixel is such a mixture, and the two differ.
        """
        axes = np.stack([self.normal, self.body]).astype(pixels.dtype)
        bright = _length(ground) + 1e-9
        (off_pixel, a_pixel), (off_product, a_product), (off_ground, a_ground) = (
            axes @ x for x in (pixels, product, ground)
        )
        a_product = np.maximum(a_product, 1e-3)
        # A ground off the plane: its share is the share of what is off the plane.
        apart = off_ground - off_product
        part = (off_pixel - off_product) / np.where(apart == 0, 1, apart)
        # Where the mask is sure, so little of it is the product's own doing: noise, light thrown back by the ground.
        part = np.where(asked == 1, part * _rise(part, 0.04, 0.12), part)
        most = np.clip(part, 0, 1)
        a_left = a_pixel - most * a_ground
        fits_off = _fall(np.abs(part - 0.5), 0.6, 0.8) * _rise(a_left / a_product, -0.15, -0.05)
        # A ground in the plane needs no share where it is neutral; where it has the product's hue, shading looks like a
        # mixture, and the mask has the word.
        between = a_product - a_ground
        body = np.clip((a_pixel - a_ground) / np.where(np.abs(between) < 1e-6, 1, between), 0, 1)
        stray = np.abs(off_pixel - body * off_product) / (_length(pixels) + 1e-9)
        tinted = _rise(np.abs(a_ground) * self.length / bright, 0.35, 0.7) if self.splits else 1.0
        inside = _fall(np.abs(apart) / bright, 0.08, 0.16)
        taken = inside * tinted * (1 - asked) + (1 - inside) * most
        fits = inside * _fall(stray, 0.08, 0.16) + (1 - inside) * fits_off
        distance = _length(product - ground) / (_length(product) + bright)
        return (
            pixels - taken * ground,
            inside * (1 - tinted) * body + (1 - inside) * np.clip(a_left / a_product, 0, 1),
            known * fits * _rise(distance, 0.08, 0.2),
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


def add_spill(
    picture: Picture, mask: NDArray, edge: Edge | None, spill: NDArray[np.float32], reference: NDArray, white: NDArray
) -> tuple[NDArray, Edge | None]:
    """Take in the light of the product on its surround, for models that do not leave the surround itself as it is.

    Parameters
    ----------
    picture
        The photo.
    mask, edge
        From :func:`refine_outline`, without spill.
    spill
        (height, width) of :func:`spill_weights`.
    reference, white
        (3,) linear RGB of the product and of the light.

    Returns
    -------
    mask, edge
        The same, and of the surround what has the color of the product, A V of (28): B W stays.
    """
    rows, columns = np.nonzero((spill > 0) & (mask == 0))
    body = _Shares(reference / white, True).body / white
    light = spill[rows, columns] * (picture.at(rows, columns) @ body)
    some = np.abs(light) * reference.max() > _LITTLE_LIGHT
    rows, columns, share = rows[some], columns[some], np.outer(light[some], reference).astype(np.float32)
    if len(rows) == 0:
        return mask, edge
    mask = mask.copy()
    mask[rows, columns] = _coverage(spill[rows, columns], mask.dtype)
    if edge is not None:
        rows, columns = np.concatenate([rows, edge.rows]), np.concatenate([columns, edge.columns])
        share = np.concatenate([share, edge.share])
    order = np.lexsort((columns, rows))
    return mask, Edge(rows[order], columns[order], share[order])


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


def _length(vectors: NDArray) -> NDArray:
    """(n,) lengths of (3, n) vectors."""
    return np.sqrt(np.square(vectors).sum(axis=0))


def _rise(x: NDArray, low: float, high: float) -> NDArray:
    """Smooth step from 0 at `low` to 1 at `high`."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _fall(x: NDArray, low: float, high: float) -> NDArray:
    return 1 - _rise(x, low, high)
