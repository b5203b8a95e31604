"""A photo file from opening to writing: what the command line, the demo and the catalog share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.picture import Picture
from ..core.recipe import Prepared, Recipe, prepare
from ..core.recolor import Shares, recolor
from ..core.swatches import Swatch
from . import files


def look(photo: files.Photo, recipe: Recipe, base: Path | None = None) -> Prepared:
    """Analyze an opened photo for a recipe.

    Parameters
    ----------
    photo
        From `files.read`.
    recipe
        What is asked for. Mask files are relative to `base`.
    base
        Folder of the recipe; None for the current one.
    """

    def read_mask(name: str) -> NDArray:
        return files.read_mask((base or Path()) / name, photo.pixels.shape[:2])

    alpha = photo.pixels[..., 3] if photo.pixels.shape[2] == 4 else None
    picture = Picture(photo.pixels, photo.space.curve)
    return prepare(picture, recipe, space=photo.space, photo_white=photo.white, alpha=alpha, read_mask=read_mask)


def recolored(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    *,
    reuse: bool = False,
    out: NDArray | None = None,
    threads: int | None = None,
) -> tuple[NDArray, Shares]:
    """Pixels of the recolored photo as the output file wants them.

    Parameters
    ----------
    photo, prepared
        The opened photo, and what `look` made of it.
    path
        The file to be; its extension decides on the kind of pixels.
    swatches
        Targets of this colorway, one for each region; None for the recipe's own.
    reuse
        Overwrite the photo's pixels if they have the right kind, to save memory; the photo is then spent.
    out
        Array of an earlier colorway of the same photo and kind of output, to be overwritten.
    threads
        None for one per core.

    Returns
    -------
    pixels
        (height, width, 3 or 4) for `files.write`.
    shares
        What the output could not hold.
    """
    dtype, space = files.output_dtype(path, photo), files.output_space(path, photo)
    height, width, channels = photo.pixels.shape
    analyzed = prepared.analyses[0].picture
    wants_premultiplied = channels == 4 and files.output_premultiplied(path, photo)
    has_premultiplied = channels == 4 and photo.premultiplied
    regions = prepared.regions(swatches)
    if has_premultiplied and not wants_premultiplied:
        straight = _divided(analyzed.linear(), photo.pixels[..., 3])
        regions = [type(r)(r.matrix, r.mask) for r in regions]  # edges were unmixed in premultiplied light
        analyzed = Picture(straight)
    same = dtype == photo.pixels.dtype and space.curve == photo.space.curve
    if out is None:
        out = photo.pixels if reuse and same else np.empty((height, width, channels), dtype)
    _, shares = recolor(analyzed, regions, curve=space.curve, dtype=dtype, out=out, threads=threads)
    if channels == 4 and out is not photo.pixels:
        out[..., 3] = converted(photo.pixels[..., 3], dtype)
        if wants_premultiplied and not has_premultiplied:
            out[..., :3] *= out[..., 3:]
    return out, shares


def _divided(linear: NDArray[np.float32], alpha: NDArray) -> NDArray[np.float32]:
    a = alpha.astype(np.float32)[..., None]
    return np.divide(linear, a, out=np.zeros_like(linear), where=a > 0)


def converted(values: NDArray, dtype: DTypeLike) -> NDArray:
    """Alpha or coverage (any shape) in another type: integers stand for 0..1, rounded to nearest."""
    dtype = np.dtype(dtype)
    if values.dtype == dtype:
        return values
    if values.dtype.kind == "u":
        values = values / np.float32(np.iinfo(values.dtype).max)
    if dtype.kind == "u":
        return np.floor(np.clip(values, 0, 1) * np.iinfo(dtype).max + 0.5).astype(dtype)
    return values.astype(dtype)
