"""One photo of a catalog: decoded once, looked at once, and put into all its colorways."""

from __future__ import annotations

import contextlib
import hashlib
import time
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..core.colorspace import space_named
from ..core.errors import DyehouseError, FileError
from ..core.recipe import Prepared
from ..core.recipe_file import measured
from ..core.thumbnail import proxy_of, thumbnail
from . import files, inspection, journal, photo, sheet, storage, verification
from .jobs import ASIDE, Job, Want

# Greatest and least width of a picture on a contact sheet, and pictures in a row.
_WIDEST, _NARROWEST, ACROSS = 360, 200, 4

type Entry = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A job and all that a worker anywhere needs to do it.

    Attributes
    ----------
    job
        The photo and what is wanted of it.
    out
        Output folder or URL.
    known
        Of an earlier run, the last entries of the job's outputs and sheet.
    max_error
        CIEDE2000 from which a result needs a person, of the prediction for 90 % of its pixels; None: never.
    allow_warnings
        Whether results with warnings need none.
    sheets, verify
        Whether to make contact sheets, and to read back what was written.
    threads
        That one photo may use; None for one per core.
    """

    job: Job
    out: str
    known: dict[str, Entry] = field(default_factory=dict)
    max_error: float | None = None
    allow_warnings: bool = False
    sheets: bool = True
    verify: bool = True
    threads: int | None = None


# Masks that were used last, by what is in their files.
_masks: OrderedDict[tuple[str, tuple[int, int]], NDArray] = OrderedDict()
_MASKS = 2

_held: list[IO[bytes]] = []


def begin(journal_path: str, threads: int) -> None:
    """Prepare a worker process of this machine."""
    import OpenImageIO

    OpenImageIO.attribute("threads", threads)
    file = journal.hold(journal_path)
    if file is not None:
        _held.append(file)


def perform_all(tasks: list[Task]) -> list[Entry]:
    """Do several tasks one after the other; see :func:`perform`."""
    return [entry for task in tasks for entry in perform(task)]


def perform(task: Task) -> list[Entry]:
    """Do what is missing or changed of one job.

    Returns
    -------
    An entry for each result, and one for the contact sheet: plain values, see ``docs/catalog.md``. Nothing is raised:
    what goes wrong with a photo is told in its entries.
    """
    try:
        return _perform(task)
    except MemoryError:
        return failures(task, "there is not enough memory for this photo: use fewer --workers")
    except DyehouseError as error:
        return failures(task, str(error))
    except Exception as error:  # one photo, or a fault of this program, never stops the others
        return failures(task, f"this is a fault of Dyehouse, please report it: {type(error).__name__}: {error}")


def failures(task: Task, reason: str) -> list[Entry]:
    """Entries that say that nothing of a job could be done."""
    return [_entry(task.job, want, "failed") | {"reason": reason} for want in task.job.wants]


def _entry(job: Job, want: Want, status: str) -> Entry:
    return {
        "output": want.output,
        "status": status,
        "photo": job.photo,
        "colorway": want.colorway.name,
        "source": str(want.source),
    }


def _perform(task: Task) -> list[Entry]:
    job = task.job
    with contextlib.ExitStack() as stack:
        places = {path: stack.enter_context(storage.local(path)) for path in job.inputs}
        digests = {path: storage.digest(place) for path, place in places.items()}
        inputs = hashlib.sha256("".join(digests.values()).encode()).hexdigest()
        settings = {want.output: _settings(task, want) for want in job.wants}
        settings[job.sheet] = hashlib.sha256("".join(settings.values()).encode()).hexdigest()
        due = [want for want in job.wants if not _done(task, want.output, inputs, settings[want.output])]
        sheet_due = task.sheets and not _done(task, job.sheet, inputs, settings[job.sheet])
        if not due and not sheet_due:
            return [task.known[want.output] | {"status": "kept"} for want in job.wants]
        try:
            entries = _recolored(task, due, sheet_due, places, digests)
        except DyehouseError as error:  # files that were fetched are called as they were asked for
            said = str(error)
            for path, place in places.items():
                said = said.replace(f"'{place}'", f"'{path}'")
            return failures(task, said)
    for entry in entries:
        entry["input"] = inputs
        if "sha256" in entry:
            entry["settings"] = settings[entry["output"]]
    return entries


def _settings(task: Task, want: Want) -> str:
    gate = "" if task.max_error is None else f"{task.max_error!r} {task.allow_warnings}"
    return hashlib.sha256((task.job.settings(want) + gate).encode()).hexdigest()


def _done(task: Task, output: str, inputs: str, settings: str) -> bool:
    """Whether an earlier run made this file, from the same, and it is still as it was made."""
    entry = task.known.get(output)
    if entry is None or entry.get("input") != inputs or entry.get("settings") != settings or not entry.get("sha256"):
        return False
    return storage.digest_at(storage.join(task.out, entry["file"])) == entry["sha256"]


def _recolored(
    task: Task, due: list[Want], sheet_due: bool, places: dict[str, Path], digests: dict[str, str]
) -> list[Entry]:
    job = task.job
    started = time.perf_counter()
    opened = files.read(places[job.photo], job.color_space)
    fetched: dict[str, Any] = {name: str(places[path]) for name, path in measured(job.recipe).items()}
    recipe = replace(job.recipe, **fetched, colorways=tuple(want.colorway for want in job.wants))
    prepared = photo.look(opened, recipe, read_mask=lambda name: _mask(places[name], digests[name], opened))
    owns = [prepared.for_colorway(want.colorway) for want in job.wants]
    cells = small_pictures(prepared, owns, job.wants) if sheet_due else []
    entries = []
    shared = _Shared(opened, prepared, task.verify) if due else None
    for want, own in zip(job.wants, owns, strict=True):
        if shared is None or want not in due:
            entries.append(task.known[want.output] | {"status": "kept"})
            continue
        try:
            entry = _written(task, want, shared, own)
        except DyehouseError as error:
            entry = _entry(job, want, "failed") | {"reason": str(error)}
        entries.append(entry | {"seconds": round(time.perf_counter() - started, 3)})
        started = time.perf_counter()
    if cells:
        entries.append(_sheet(task, cells))
    return entries


def small_pictures(
    prepared: Prepared, owns: Sequence[Prepared], wants: Sequence[Want]
) -> list[tuple[str, NDArray[np.uint8]]]:
    """Labels and pictures for a contact sheet: the photo, and each of its colorways."""
    proxy = proxy_of(prepared, _WIDEST)
    made = [(want.colorway.name, thumbnail(proxy, own)) for want, own in zip(wants, owns, strict=True)]
    return [("photo", proxy.codes), *made]


def _mask(place: Path, digest: str, opened: files.Photo) -> NDArray:
    shape = (opened.pixels.shape[0], opened.pixels.shape[1])
    key = (digest or str(place), shape)
    if key not in _masks:
        mask = files.read_mask(place, shape)
        _masks[key] = mask
        while len(_masks) > _MASKS:
            _masks.popitem(last=False)
        return mask
    _masks.move_to_end(key)
    return _masks[key]


class _Shared:
    """What the results of one photo share: its colors, where it is verified, and room for the pixels of one result."""

    def __init__(self, opened: files.Photo, prepared: Prepared, verify: bool) -> None:
        self.opened, self.palette = opened, photo.palette(prepared)
        self.areas = verification.matte_areas(opened, prepared) if verify else None
        self._room: NDArray = np.empty(0, np.void)

    def room(self, output: str) -> NDArray:
        """Array for the pixels of a file of this name, which those of the last one may be in."""
        dtype = files.output_dtype(output, self.opened)
        if self._room.dtype != dtype:
            self._room = np.empty(self.opened.pixels.shape, dtype)
        return self._room


def _written(task: Task, want: Want, shared: _Shared, own: Prepared) -> Entry:
    """Write one result and tell of it, and of what it shows in the matte areas."""
    opened, areas = shared.opened, shared.areas
    opened.wanted = space_named(want.output_space) if want.output_space else None
    error = predicted_error(own)
    reason = _gate(task, own, error)
    file = f"{ASIDE}/{want.output}" if reason else want.output
    place = _place(task.out, file)
    expected = None if areas is None else verification.expect(opened, own, areas=areas)
    with storage.arriving(place) as local:
        written, shares = photo.save(
            opened,
            own,
            local,
            force=True,
            quality=want.quality,
            compression=want.compression,
            out=shared.room(want.output),
            threads=task.threads,
            palette=shared.palette,
        )
        digest = storage.digest(written)
        delivered = [] if expected is None else [check.as_dict() for check in expected.check(written)]
    # An earlier run may have come to another opinion.
    storage.remove(storage.join(task.out, want.output if reason else f"{ASIDE}/{want.output}"))
    entry = _entry(task.job, want, "needs a person" if reason else "done")
    return entry | {
        "file": file,
        "sha256": digest,
        "model": [analysis.model for analysis in own.analyses],
        "predicted_error": error,
        "verification": delivered,
        "warnings": inspection.with_shares({"warnings": own.warnings}, shares)["warnings"],
        "notes": list(opened.assumptions),
        "reason": reason,
    }


def predicted_error(own: Prepared) -> dict[str, float]:
    """CIEDE2000 that half, and 90 %, of the pixels of the worst region are expected to stay below."""
    worst = {"median": 0.0, "bound90": 0.0}
    for found in own.predictions:
        if found is not None:
            worst = max(worst, {"median": found.median, "bound90": found.bound90}, key=lambda f: f["bound90"])
    return {name: round(value, 4) for name, value in worst.items()}


def _gate(task: Task, own: Prepared, error: dict[str, float]) -> str:
    """Why a result needs a person; empty if it does not."""
    if task.max_error is None:
        return ""
    if not error["bound90"] <= task.max_error:
        return f"the predicted error is {error['bound90']:.1f} CIEDE2000, more than {task.max_error:g}"
    return own.warnings[0] if own.warnings and not task.allow_warnings else ""


def _place(out: str, file: str) -> str:
    """Path or URL of a file in the output folder; its folder is made, and must not lead elsewhere by a link."""
    place = storage.join(out, file)
    if not storage.is_url(place):
        folder, root = Path(place).parent, Path(out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            inside = folder.resolve().is_relative_to(root.resolve())
        except (OSError, RuntimeError) as error:
            raise FileError(f"The folder '{folder}' cannot be made ({error}): check the output folder.") from None
        if not inside:
            raise FileError(f"'{place}' leads out of the output folder by a link: remove the link.")
    return place


def _sheet(task: Task, cells: list[tuple[str, NDArray[np.uint8]]]) -> Entry:
    """Write the contact sheet of a photo."""
    entry = {"output": task.job.sheet, "status": "sheet", "photo": task.job.photo, "file": task.job.sheet}
    tall, wide = cells[0][1].shape[:2]
    cell = min(max(wide, _NARROWEST), _WIDEST)
    picture = sheet.contact_sheet([cells[k : k + ACROSS] for k in range(0, len(cells), ACROSS)], cell)
    try:
        with storage.arriving(_place(task.out, task.job.sheet)) as local:
            files.write(local, picture, files.Photo(Path(), picture, files.SRGB), force=True, quality=88)
            digest = storage.digest(local)
    except DyehouseError as error:
        return entry | {"status": "sheet failed", "reason": str(error)}
    height, width = picture.shape[:2]
    return entry | {
        "sha256": digest,
        "size": [width, height],
        "cell": [cell, round(tall * cell / wide)],
        "cells": [want.output for want in task.job.wants],
    }
