"""Checks of a catalog before a pixel is touched: the files that jobs read, and what is in the way of results."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from ..core.errors import FileError
from ..core.recipe import Recipe
from ..core.recipe_file import measured
from . import files, storage
from .jobs import ASIDE, Job, Problem, as_one


def outputs(jobs: Sequence[Job], out: str, *, replacing: bool) -> list[Problem]:
    """Find results that are in the way of something: of an input always, of any file unless `replacing`."""
    there = storage.listing(out)
    alike = {as_one(name) for name in there}
    sources: set[tuple[int, int] | None] = set()
    if alike:
        sources = {_identity(path) for job in jobs for path in job.inputs if not storage.is_url(path)} - {None}
    found = []
    for job in jobs:
        for want in job.wants:
            for name in (want.output, f"{ASIDE}/{want.output}", job.sheet):
                place = storage.join(out, name)
                # A name that differs in case is the same file where the file system says so.
                if as_one(name) not in alike or not (name in there or _identity(place)):
                    continue
                if not storage.is_url(place) and _identity(place) in sources:
                    said = f"output '{place}' is a file that the run reads: choose another output folder."
                elif not replacing:
                    said = f"output '{place}' exists already: give --resume to go on, or --force to make all anew."
                else:
                    continue
                found.append(Problem(want.source, said, want.source.column("output")))
    return found


def _identity(path: str) -> tuple[int, int] | None:
    """What two paths have in common that lead to one file of this machine; None if there is none."""
    try:
        status = os.stat(path)  # noqa: PTH116, a hundred thousand of them
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


class _Seen(NamedTuple):
    """What a file's header tells: (width, height) of the upright picture, zeros where only decoding would."""

    width: int = 0
    height: int = 0
    opaque: bool = False


def inputs(jobs: Sequence[Job]) -> list[Problem]:
    """Find photos and masks that are missing or no pictures, and pixels that lie outside their photo."""
    with ThreadPoolExecutor(max_workers=8) as pool:  # most of the time is waiting for disks and networks
        names = list(dict.fromkeys(name for job in jobs for name in job.inputs))
        seen = dict(zip(names, pool.map(_look, names), strict=True))
    found = []
    for job in jobs:
        source = job.wants[0].source
        found += [Problem(source, said, source.column(*setting)) for setting, said in _problems(job, seen)]
    return found


def _problems(job: Job, seen: dict[str, _Seen | str]) -> Iterable[tuple[tuple[str, ...], str]]:
    """Settings, each a key and perhaps a region, and what is wrong with them."""
    photo = seen[job.photo]
    if isinstance(photo, str):
        yield ("photo",), photo
        return
    for region in job.recipe.regions:
        if region.mask == "alpha" and photo.opaque:
            said = f"photo '{job.photo}' has no alpha to take the mask from: give a mask file, or click the product."
            yield ("mask", region.name), said
        elif isinstance(region.mask, str) and region.mask in seen:
            for said in _mask_problems(job.photo, photo, region.mask, seen[region.mask]):
                yield ("mask", region.name), said
    for key, name in measured(job.recipe).items():
        if isinstance(found := seen[name], str):
            yield (key,), found
    if photo.width:
        for setting, pixels in _pixels(job.recipe):
            for x, y in pixels:
                if not (0 <= x < photo.width and 0 <= y < photo.height):
                    yield (
                        setting,
                        f"{setting[0]} ({x:g}, {y:g}) lies outside the photo of {photo.width} x {photo.height} pixels: "
                        f"x goes from 0 to {photo.width - 1} and y from 0 to {photo.height - 1}.",
                    )


def _mask_problems(photo: str, seen: _Seen, mask: str, found: _Seen | str) -> Iterable[str]:
    if isinstance(found, str):
        yield found
    elif seen.width and found.width and seen[:2] != found[:2]:
        yield (
            f"mask '{mask}' is {found.width} x {found.height} pixels and photo '{photo}' {seen.width} x {seen.height}: "
            "make it the size of the photo."
        )


def _pixels(recipe: Recipe) -> Iterable[tuple[tuple[str, ...], Sequence[tuple[float, ...]]]]:
    """Settings that are pixels of the photo."""
    if isinstance(recipe.white, tuple) and len(recipe.white) == 2:
        yield ("white",), [recipe.white]
    for region in recipe.regions:
        if region.reference is not None and len(region.reference) == 2:
            yield ("reference", region.name), [region.reference]
        if region.click is not None:
            yield ("click", region.name), [region.click]
        yield ("added", region.name), region.added
        yield ("removed", region.name), region.removed


def _look(path: str) -> _Seen | str:
    """What a file's header tells, or what is wrong with the file."""
    if storage.is_url(path):
        try:
            return _Seen() if storage.exists(path) else f"'{path}' does not exist: check the URL."
        except FileError as error:
            return str(error)
    place = Path(path)
    try:
        with place.open("rb") as file:
            empty = not file.read(1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return f"'{path}' cannot be read ({reason}): check folder, name and permissions."
    if empty:
        return f"'{path}' is empty: copy it again from its source."
    if place.suffix.lower() in (".csv", *files.RAW_EXTENSIONS):
        return _Seen()
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(path)
    if source is None:
        OpenImageIO.geterror()
        return f"'{path}' is no picture, or is damaged: use PNG, JPEG, TIFF, EXR or WebP."
    spec = source.spec()
    source.close()
    size = spec.width, spec.height
    if spec.get_int_attribute("Orientation", 1) >= 5:
        size = spec.height, spec.width
    return _Seen(*size, opaque=spec.alpha_channel < 0 and spec.nchannels in (1, 3))
