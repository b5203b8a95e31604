"""Small pictures of colorways: the photo is made small once, and each colorway is a recolor of a few pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import colorimetry, recolor
from .colorspace import SRGB
from .picture import Picture, as_weights, block_means
from .recipe import Prepared
from .region import shrink


@dataclass(frozen=True, eq=False)
class Proxy:
    """A photo, its masks and its correction maps, made small.

    Attributes
    ----------
    picture
        The small photo, linear.
    masks, extras
        Of each region, of the size of the small photo, or None.
    """

    picture: Picture
    masks: tuple[NDArray | None, ...]
    extras: tuple[NDArray | None, ...]


def proxy_of(prepared: Prepared, longest: int = 128) -> Proxy:
    """Make a prepared photo small: about `longest` pixels at its longer side."""
    picture = prepared.analyses[0].picture
    step = max(1, round(max(picture.shape) / longest))
    step = min(step, *picture.shape)
    regions = prepared.regions()
    return Proxy(
        Picture(shrink(picture, step)),
        tuple(None if r.mask is None else block_means(as_weights(r.mask)[..., None], step)[..., 0] for r in regions),
        tuple(None if r.extra is None else block_means(r.extra, step) for r in regions),
    )


def thumbnail(proxy: Proxy, prepared: Prepared) -> NDArray[np.uint8]:
    """(height, width, 3) sRGB codes of the small photo in the targets of `prepared`, which it was made of."""
    regions = [
        replace(region, mask=mask, edge=None, extra=extra)
        for region, mask, extra in zip(prepared.regions(), proxy.masks, proxy.extras, strict=True)
    ]
    convert = colorimetry.conversion_matrix(prepared.space, SRGB) if prepared.space is not SRGB else None
    codes, _ = recolor.recolor(proxy.picture, regions, curve=SRGB.curve, dtype=np.uint8, threads=1, convert=convert)
    return codes
