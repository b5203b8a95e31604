"""Checks of a catalog before a pixel is touched: the files that jobs read, and what is in the way of results."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..core.errors import FileError
from ..core.recipe import Region
from . import files, storage
from .jobs import ASIDE, Job, Problem


def outputs(jobs: Sequence[Job], out: str, *, replacing: bool) -> list[Problem]:
    """Find results that are in the way of something: of an input always, of any file unless `replacing`."""
    there = storage.listing(out)
    sources = {os.path.realpath(path) for job in jobs for path in job.inputs if not storage.is_url(path)}
    found = []
    for job in jobs:
        for want in job.wants:
            for name in (want.output, f"{ASIDE}/{want.output}", job.sheet):
                if name not in there:
                    continue
                place = storage.join(out, name)
                if not storage.is_url(place) and os.path.realpath(place) in sources:
                    said = f"output '{place}' is a file that the run reads: choose another output folder."
                elif not replacing:
                    said = f"output '{place}' exists already: give --resume to go on, or --force to make all anew."
                else:
                    continue
                found.append(Problem(want.source, said))
    return found


def inputs(jobs: Sequence[Job]) -> list[Problem]:
    """Find photos and masks that are missing or no pictures, and pixels that lie outside their photo."""
    with ThreadPoolExecutor(max_workers=8) as pool:  # most of the time is waiting for disks and networks
        names = list(dict.fromkeys(name for job in jobs for name in job.inputs))
        sizes = dict(zip(names, pool.map(_size, names), strict=True))
    return [Problem(job.wants[0].source, said) for job in jobs for said in _problems(job, sizes)]


def _problems(job: Job, sizes: dict[str, tuple[int, int] | str]) -> Iterable[str]:
    size = sizes[job.photo]
    if isinstance(size, str):
        yield size
        return
    white = job.recipe.white
    if size != (0, 0):
        if isinstance(white, tuple) and len(white) == 2:
            yield from _outside("white", [white], size)
        for region in job.recipe.regions:
            for what, pixels in _pixels(region):
                yield from _outside(what, pixels, size)
    for name in job.inputs[1:]:
        found = sizes[name]
        if isinstance(found, str):
            yield found
        elif (0, 0) not in (size, found) and size != found:
            yield (
                f"mask '{name}' is {found[0]} x {found[1]} pixels and photo '{job.photo}' {size[0]} x {size[1]}: make "
                "it the size of the photo."
            )


def _pixels(region: Region) -> Iterable[tuple[str, Sequence[tuple[float, ...]]]]:
    if region.reference is not None and len(region.reference) == 2:
        yield "reference", [region.reference]
    if region.click is not None:
        yield "click", [region.click]
    yield "added", region.added
    yield "removed", region.removed


def _outside(what: str, pixels: Sequence[tuple[float, ...]], size: tuple[int, int]) -> Iterable[str]:
    width, height = size
    for x, y in pixels:
        if not (0 <= x < width and 0 <= y < height):
            yield (
                f"{what} ({x:g}, {y:g}) lies outside the photo of {width} x {height} pixels: x goes from 0 to "
                f"{width - 1} and y from 0 to {height - 1}."
            )


def _size(path: str) -> tuple[int, int] | str:
    """(width, height) of an upright picture, zeros where only decoding would tell, or what is wrong with the file."""
    if storage.is_url(path):
        try:
            return (0, 0) if storage.exists(path) else f"'{path}' does not exist: check the URL."
        except FileError as error:
            return str(error)
    place = Path(path)
    try:
        with place.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        return f"'{path}' cannot be read ({error.strerror}): check folder, name and permissions."
    if empty:
        return f"'{path}' is empty: copy it again from its source."
    if place.suffix.lower() in (".csv", *files.RAW_EXTENSIONS):
        return 0, 0
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(path)
    if source is None:
        OpenImageIO.geterror()
        return f"'{path}' is no picture, or is damaged: use PNG, JPEG, TIFF, EXR or WebP."
    spec = source.spec()
    source.close()
    turned = spec.get_int_attribute("Orientation", 1) >= 5
    return (spec.height, spec.width) if turned else (spec.width, spec.height)
