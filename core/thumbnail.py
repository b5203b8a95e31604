"""Small pictures of colorways: the photo is made small once, and each colorway is a recolor of a few pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import colorimetry, recolor
from .colorspace import SRGB
from .picture import Picture, as_weights
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
        tuple(None if r.mask is None else _means(as_weights(r.mask)[..., None], step)[..., 0] for r in regions),
        tuple(None if r.extra is None else _means(r.extra, step) for r in regions),
    )


def thumbnail(proxy: Proxy, prepared: Prepared) -> NDArray[np.uint8]:
    """(height, width, 3) sRGB codes of the small photo in the targets of `prepared`, which it was made of."""
    regions = [
        replace(region, mask=mask, edge=None, extra=extra)
        for region, mask, extra in zip(prepared.regions(), proxy.masks, proxy.extras, strict=True)
    ]
    linear, _ = recolor.recolor(proxy.picture, regions, threads=1)
    space = prepared.space
    adapt = colorimetry.adaptation_matrix(space.white, SRGB.white, "bradford")
    shown = linear @ np.float32(SRGB.from_xyz @ adapt @ space.to_xyz).T
    return recolor.recolor(Picture(shown), [], curve=SRGB.curve, dtype=np.uint8)[0]


def _means(values: NDArray, step: int) -> NDArray[np.float32]:
    """Means of blocks of a (height, width, n) map, as `region.shrink` has those of a picture."""
    rows, columns, count = values.shape[0] // step, values.shape[1] // step, values.shape[2]
    whole = values[: rows * step, : columns * step].reshape(rows, step, columns, step, count)
    return whole.mean(axis=(1, 3), dtype=np.float32)
