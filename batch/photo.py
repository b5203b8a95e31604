"""A photo file from opening to writing: what the command line, the demo and the catalog share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.colorimetry import conversion_matrix
from ..core.compositing import Edge
from ..core.palette import Palette
from ..core.picture import Picture
from ..core.recipe import Prepared, Recipe, prepare
from ..core.recolor import Recoloring, RegionMatrix, Shares, shared_palette
from ..core.swatches import Swatch
from . import files


def look(
    photo: files.Photo,
    recipe: Recipe,
    base: Path | None = None,
    read_mask: Callable[[str], NDArray] | None = None,
) -> Prepared:
    """Analyze an opened photo for a recipe.

    Parameters
    ----------
    photo
        From `files.read`.
    recipe
        What is asked for. Mask files are relative to `base`.
    base
        Folder of the recipe; None for the current one.
    read_mask
        Gives the (height, width) coverage of a mask by name; None to read files.
    """

    def read_file(name: str) -> NDArray:
        return files.read_mask((base or Path()) / name, photo.pixels.shape[:2])

    alpha = photo.pixels[..., 3] if photo.pixels.shape[2] == 4 else None
    picture = Picture(photo.pixels, photo.space.curve)
    return prepare(
        picture, recipe, space=photo.space, photo_white=photo.white, alpha=alpha, read_mask=read_mask or read_file
    )


def upright(photo: files.Photo, prepared: Prepared) -> tuple[files.Photo, Prepared]:
    """Turn a photo that was read as it is stored, and look at it again for the same recipe: what files are made of."""
    if photo.orientation == 1:
        return photo, prepared
    pairs = zip(prepared.recipe.regions, prepared.analyses, strict=True)
    masks = {r.mask: a.selection for r, a in pairs if isinstance(r.mask, str) and a.selection is not None}
    turned = replace(photo, pixels=files.turned(photo.pixels, photo.orientation), orientation=1)
    recipe = turned_recipe(prepared.recipe, photo.pixels.shape, photo.orientation)
    return turned, look(turned, recipe, read_mask=lambda name: files.turned(masks[name], photo.orientation))


def turned_recipe(recipe: Recipe, shape: Sequence[int], orientation: int, back: bool = False) -> Recipe:
    """The recipe for a photo that is turned as `files.turned` does: its positions; masks stay as they are.

    Parameters
    ----------
    recipe
        What is asked for.
    shape
        (height, width, ...) of the photo before.
    orientation, back
        As for :func:`files.turned`.
    """

    def moved(point: tuple[float, ...] | str | None) -> Any:
        if point is None or isinstance(point, str) or len(point) != 2:
            return point
        return files.turned_point(point, shape, orientation, back)

    regions = [
        replace(
            region,
            reference=moved(region.reference),
            click=moved(region.click),
            added=tuple(moved(point) for point in region.added),
            removed=tuple(moved(point) for point in region.removed),
        )
        for region in recipe.regions
    ]
    return replace(recipe, regions=tuple(regions), white=moved(recipe.white))


def palette(prepared: Prepared) -> Palette | None:
    """Colors of the photo that all its colorways share; None where they are no help."""
    regions = [RegionMatrix(np.eye(3), a.mask, a.edge, a.extra) for a in prepared.analyses]
    return shared_palette(prepared.analyses[0].picture, regions)


def recoloring(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    *,
    reuse: bool = False,
    out: NDArray | None = None,
    threads: int | None = None,
    palette: Palette | None = None,
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
    palette
        From :func:`palette`, for several colorways; None for one.
    """
    dtype, space = files.output_dtype(path, photo), files.output_space(path, photo)
    height, width, channels = photo.pixels.shape
    picture, regions = prepared.analyses[0].picture, prepared.regions(swatches)
    if channels == 4 and photo.premultiplied and not files.output_premultiplied(path, photo):
        picture = Picture(_divided(picture.linear(), photo.pixels[..., 3]))
        # The edges were unmixed, and the corrections made, in light multiplied by alpha.
        alpha = photo.pixels[..., 3]
        regions = [
            replace(
                r,
                edge=None if r.edge is None else _divided_edge(r.edge, alpha),
                extra=None if r.extra is None else _divided(r.extra, alpha),
            )
            for r in regions
        ]
    if out is None:
        same = dtype == photo.pixels.dtype and space.curve == photo.space.curve
        out = photo.pixels if reuse and same else np.empty((height, width, channels), dtype)
    if channels == 4 and out is not photo.pixels:
        out[..., 3] = converted(photo.pixels[..., 3], dtype)
    convert = None if photo.wanted is None else conversion_matrix(photo.space, space)
    return Recoloring(
        picture, regions, curve=space.curve, dtype=dtype, out=out, threads=threads, convert=convert, palette=palette
    )


def _watched(job: Recoloring, watch: Callable[[float], None] | None) -> Iterator[int]:
    for done in job.rows():
        if watch is not None:
            watch(done / len(job.out))
        yield done


def _must_multiply(photo: files.Photo, path: str | Path) -> bool:
    return photo.pixels.shape[2] == 4 and not photo.premultiplied and files.output_premultiplied(path, photo)


def recolored(
    photo: files.Photo,
    prepared: Prepared,
    path: str | Path,
    swatches: Sequence[Swatch | None] | None = None,
    *,
    watch: Callable[[float], None] | None = None,
    **options: Any,
) -> tuple[NDArray, Shares]:
    """Pixels of the recolored photo as the output file wants them.

    Parameters
    ----------
    photo, prepared, path, swatches, options
        As for :func:`recoloring`.
    watch
        Called now and then with the share that is done, 0 to 1; what it raises stops the work.

    Returns
    -------
    pixels
        (height, width, 3 or 4) for `files.write`.
    shares
        What the output could not hold.
    """
    job = recoloring(photo, prepared, path, swatches, **options)
    for _ in _watched(job, watch):
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
    watch: Callable[[float], None] | None = None,
    **options: Any,
) -> tuple[Path, Shares]:
    """Recolor a photo into a file; rows are encoded while the next ones are recolored.

    Parameters
    ----------
    photo, prepared, path, swatches, options
        As for :func:`recoloring`.
    force, quality, compression
        As for :func:`files.write`.
    watch
        As for :func:`recolored`; when it raises, no file is left.

    Returns
    -------
    path
        The file.
    shares
        What it could not hold.
    """
    rows: Iterator[int] | None = None
    if _must_multiply(photo, path):
        pixels, shares = recolored(photo, prepared, path, swatches, watch=watch, **options)
    else:
        job = recoloring(photo, prepared, path, swatches, **options)
        pixels, rows = job.out, _watched(job, watch)
    written = files.write(path, pixels, photo, force=force, quality=quality, compression=compression, rows=rows)
    return written, job.shares if rows else shares


def _divided_edge(edge: Edge, alpha: NDArray) -> Edge:
    return replace(edge, share=_divided(edge.share, alpha[edge.rows, edge.columns]))


def _divided(linear: NDArray, alpha: NDArray) -> NDArray[np.float32]:
    a = alpha.astype(np.float32)[..., None]
    return np.divide(linear, a, out=np.zeros(linear.shape, np.float32), where=a > 0)


def converted(values: NDArray, dtype: DTypeLike) -> NDArray:
    """Alpha or coverage (any shape) in another type: integers stand for 0..1, rounded to nearest."""
    dtype = np.dtype(dtype)
    if values.dtype == dtype:
        return values
    if values.dtype.kind == "u":
        values = values / np.float32(np.iinfo(values.dtype).max)
    if dtype.kind == "u":
        top = np.float32(np.iinfo(dtype).max)  # more than half floats can hold
        return np.floor(np.clip(values, 0, 1).astype(np.float32) * top + np.float32(0.5)).astype(dtype)
    return values.astype(dtype)
