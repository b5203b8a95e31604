"""Small pictures of colorways: the photo is made small once, and each colorway is a recolor of a few pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import colorimetry, recolor
from .colorspace import SRGB
from .picture import Picture, block_means, bounding_box
from .recipe import Prepared
from .region import shrink


@dataclass(frozen=True, eq=False)
class Proxy:
    """A photo, its masks and its correction maps, made small.

    Attributes
    ----------
    codes
        (height, width, 3) sRGB codes of the small photo.
    box
        (rows, columns) of the part that the regions lie in.
    picture
        This part, linear, in the photo's space.
    masks, extras
        Of each region, of the size of this part, or None.
    """

    codes: NDArray[np.uint8]
    box: tuple[slice, slice]
    picture: Picture
    masks: tuple[NDArray | None, ...]
    extras: tuple[NDArray | None, ...]


def proxy_of(prepared: Prepared, longest: int = 128) -> Proxy:
    """Make a prepared photo small: about `longest` pixels at its longer side."""
    picture = prepared.analyses[0].picture
    step = max(1, round(max(picture.shape) / longest))
    step = min(step, *picture.shape)
    small = Picture(shrink(picture, step))
    masks = [None if a.mask is None else _small_mask(a.mask, step) for a in prepared.analyses]
    extras = [None if a.extra is None else block_means(a.extra, step) for a in prepared.analyses]
    covered = np.maximum.reduce([np.ones(small.shape) if mask is None else mask for mask in masks])
    box = bounding_box(covered if covered.any() else np.ones(small.shape))
    return Proxy(
        _codes(small, [], prepared),
        box,
        Picture(small.pixels[box]),
        tuple(None if mask is None else mask[box] for mask in masks),
        tuple(None if extra is None else extra[box] for extra in extras),
    )


def thumbnail(proxy: Proxy, prepared: Prepared) -> NDArray[np.uint8]:
    """(height, width, 3) sRGB codes of the small photo in the targets of `prepared`, which it was made of."""
    regions = [
        replace(region, mask=mask, edge=None, extra=None if region.extra is None else extra)
        for region, mask, extra in zip(prepared.regions(), proxy.masks, proxy.extras, strict=True)
    ]
    made = proxy.codes.copy()
    made[proxy.box] = _codes(proxy.picture, regions, prepared)
    return made


def _small_mask(mask: NDArray, step: int) -> NDArray[np.float32]:
    means = block_means(mask[..., None], step)[..., 0]
    return means / np.float32(np.iinfo(mask.dtype).max) if mask.dtype.kind == "u" else means


def _codes(picture: Picture, regions: list[recolor.RegionMatrix], prepared: Prepared) -> NDArray[np.uint8]:
    convert = colorimetry.conversion_matrix(prepared.space, SRGB) if prepared.space is not SRGB else None
    codes, _ = recolor.recolor(picture, regions, curve=SRGB.curve, dtype=np.uint8, threads=1, convert=convert)
    return codes
