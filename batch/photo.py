"""A photo file from opening to writing: what the command line, the demo and the catalog share."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.compositing import unmix_edge
from ..core.picture import Picture
from ..core.recipe import Prepared, Recipe, prepare
from ..core.recolor import Recoloring, RegionMatrix, Shares
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


def recoloring(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    *,
    reuse: bool = False,
    out: NDArray | None = None,
    threads: int | None = None,
) -> Recoloring:
    """Set up the recolor of a photo into the pixels that the output file wants.

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
    """
    dtype, space = files.output_dtype(path, photo), files.output_space(path, photo)
    height, width, channels = photo.pixels.shape
    picture, regions = prepared.analyses[0].picture, prepared.regions(swatches)
    if channels == 4 and photo.premultiplied and not files.output_premultiplied(path, photo):
        picture = Picture(_divided(picture.linear(), photo.pixels[..., 3]))
        # The edges were unmixed in light multiplied by alpha.
        regions = [
            RegionMatrix(r.matrix, r.mask, None if r.mask is None else unmix_edge(picture, r.mask)) for r in regions
        ]
    if out is None:
        same = dtype == photo.pixels.dtype and space.curve == photo.space.curve
        out = photo.pixels if reuse and same else np.empty((height, width, channels), dtype)
    if channels == 4 and out is not photo.pixels:
        out[..., 3] = converted(photo.pixels[..., 3], dtype)
    return Recoloring(picture, regions, curve=space.curve, dtype=dtype, out=out, threads=threads)


def _must_multiply(photo: files.Photo, path: str | Path) -> bool:
    return photo.pixels.shape[2] == 4 and not photo.premultiplied and files.output_premultiplied(path, photo)


def recolored(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    **options: Any,
) -> tuple[NDArray, Shares]:
    """Pixels of the recolored photo as the output file wants them.

    Parameters
    ----------
    photo, prepared, path, swatches, options
        As for :func:`recoloring`.

    Returns
    -------
    pixels
        (height, width, 3 or 4) for `files.write`.
    shares
        What the output could not hold.
    """
    job = recoloring(photo, prepared, path, swatches, **options)
    for _ in job.rows():
        pass
    if _must_multiply(photo, path):
        job.out[..., :3] *= job.out[..., 3:]
    return job.out, job.shares


def save(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    *,
    force: bool = False,
    quality: int = 95,
    compression: str | None = None,
    **options: Any,
) -> tuple[Path, Shares]:
    """Recolor a photo into a file; rows are encoded while the next ones are recolored.

    Parameters
    ----------
    photo, prepared, path, swatches, options
        As for :func:`recoloring`.
    force, quality, compression
        As for :func:`files.write`.

    Returns
    -------
    path
        The file.
    shares
        What it could not hold.
    """
    rows: Iterator[int] | None = None
    if _must_multiply(photo, path):
        pixels, shares = recolored(photo, prepared, path, swatches, **options)
    else:
        job = recoloring(photo, prepared, path, swatches, **options)
        pixels, rows = job.out, job.rows()
    written = files.write(path, pixels, photo, force=force, quality=quality, compression=compression, rows=rows)
    return written, job.shares if rows else shares


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
