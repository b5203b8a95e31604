"""`dyehouse batch`: a catalog from its tables and recipes to its files, journal and page."""

from __future__ import annotations

import argparse
import contextlib
import errno
import json
import os
import re
import secrets
import shutil
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.errors import FileError
from . import checks, engine, storage
from .jobs import Job, Problem, gather, in_order
from .journal import Journal

JOURNAL, PAGE = "dyehouse-journal.jsonl", "index.html"

# Seconds between lines of progress where there is no terminal.
_TELL_EVERY = 10.0

# Free bytes under which the disk counts as full.
_FULL = 1 << 20

# Names under which files are written before they get their own.
_UNFINISHED = re.compile(r"\.dyehouse-[0-9a-f]{12}(\.\w+)?")


@dataclass(frozen=True)
class Settings:
    """How a catalog is run.

    Attributes
    ----------
    out
        Output folder or URL.
    workers
        Processes of this machine; None for one per core, 0 for none but this one.
    scheduler
        Address of a dask.distributed scheduler, instead of processes.
    per_task
        Photos that a worker takes at a time.
    resume
        Do only what an earlier run has left, or what has changed since.
    force
        Make everything anew.
    max_error, allow_warnings, sheets, verify
        See :class:`work.Task`.
    journal
        The journal; None for one in the output folder.
    """

    out: str
    workers: int | None = None
    scheduler: str | None = None
    per_task: int = 1
    resume: bool = False
    force: bool = False
    max_error: float | None = None
    allow_warnings: bool = False
    sheets: bool = True
    verify: bool = True
    journal: str | None = None


class Run:
    """A catalog on its way. Iterating over :meth:`entries` does the work.

    Parameters
    ----------
    jobs
        What to do.
    settings
        How.

    Attributes
    ----------
    stop
        Set its `asked` to end the run cleanly.
    counts
        Results so far, by status.
    stopped
        Why the run ended early; empty if it did not.

    Raises
    ------
    FileError
        If the output folder or the journal cannot be used.
    """

    def __init__(self, jobs: Sequence[Job], settings: Settings) -> None:
        self.jobs, self.settings = jobs, settings
        self.stop, self.stopped = engine.Stop(), ""
        self.counts: Counter[str] = Counter()
        self.total = sum(len(job.wants) for job in jobs)
        out = settings.out
        if not storage.is_url(out):
            _writable_folder(Path(out))
        elif settings.journal is None:
            raise FileError(f"A journal cannot be kept at '{out}': give one of this machine with --journal FILE.")
        self.journal = Journal(Path(settings.journal or Path(out) / JOURNAL))
        try:
            self._clean()
            if self.journal and not (settings.resume or settings.force):
                raise FileError(f"'{out}' holds an earlier run: give --resume to go on, or --force to make all anew.")
            self.journal.share()
        except BaseException:
            self.journal.close()
            raise

    def entries(self) -> Iterator[dict[str, Any]]:
        """Do the work; yields an entry for each result when it is done, kept, set aside or failed."""
        try:
            with self._executor() as (executor, workers, alive):
                results = engine.run(self._tasks(), _perform_all, executor, workers, _failures, self.stop, alive)
                with contextlib.closing(results):
                    for entries in results:
                        yield from self._noted(entries)
        except engine.LostError as error:
            self.stopped = f"{error}: start it again, then go on with --resume."
        else:
            if self.settings.sheets and not self.stopped:
                self._write_page()
        finally:
            self._clean()  # a worker that dies leaves what it was writing
            self.journal.close()

    def _clean(self) -> None:
        if not storage.is_url(self.settings.out):
            _remove_unfinished(Path(self.settings.out))

    def _noted(self, entries: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        self.journal.add(entry for entry in entries if entry["status"] != "kept")
        for entry in entries:
            if entry["status"].startswith("sheet"):
                continue
            self.counts[entry["status"]] += 1
            if entry["status"] == "failed" and self._disk_full(entry["reason"]):
                self.stop.asked = True
                self.stopped = f"The disk of '{self.settings.out}' is full: make room, then go on with --resume."
            yield entry

    def _disk_full(self, reason: str) -> bool:
        if storage.is_url(self.settings.out):
            return False
        return os.strerror(errno.ENOSPC) in reason or shutil.disk_usage(self.settings.out).free < _FULL

    @contextlib.contextmanager
    def _executor(self) -> Iterator[tuple[Any, int, Any]]:
        from . import work

        settings = self.settings
        if settings.scheduler:
            with engine.cluster(settings.scheduler) as found:
                yield found
            return
        cores = os.process_cpu_count() or 1
        asked = cores if settings.workers is None else settings.workers
        workers = max(1, min(asked, len(self.jobs)))
        if asked == 0 or _in_blender():
            yield engine.threads_of(workers), workers, lambda: True
        else:
            threads = max(1, cores // workers)
            yield engine.processes(workers, threads, work.begin, str(self.journal.path), threads), workers, lambda: True

    def _tasks(self) -> Iterator[list[Any]]:
        from .work import Task

        settings, known = self.settings, self.journal
        out = settings.out if storage.is_url(settings.out) else str(Path(settings.out).absolute())
        threads = 1 if settings.scheduler else None
        some = []
        for job in self.jobs:
            names = [job.sheet, *(want.output for want in job.wants)]
            before = {name: known[name] for name in names if name in known} if settings.resume else {}
            gate = settings.max_error, settings.allow_warnings
            some.append(Task(job, out, before, *gate, settings.sheets, settings.verify, threads))
            if len(some) == settings.per_task:
                yield some
                some = []
        if some:
            yield some

    def _write_page(self) -> None:
        from . import page

        names = [name for job in self.jobs for name in (job.sheet, *(want.output for want in job.wants))]
        text = page.run_page(self.journal, [name for name in names if name in self.journal], self.settings.out)
        with storage.arriving(storage.join(self.settings.out, PAGE)) as place:
            beside = place.with_name(f".dyehouse-{secrets.token_hex(6)}.html")
            try:
                beside.write_text(text, encoding="utf-8")
                beside.replace(place)
            except OSError as error:
                raise FileError(
                    f"The page '{place}' cannot be written ({error.strerror}): make room, then go on with --resume."
                ) from None
            finally:
                beside.unlink(missing_ok=True)

    @property
    def summary(self) -> dict[str, Any]:
        """Plain values for JSON."""
        names = {"done": "done", "kept": "kept", "needs a person": "needs_a_person", "failed": "failed"}
        counts = {name: self.counts[status] for status, name in names.items()}
        return {"results": self.total, **counts, "stopped": self.stopped, "out": self.settings.out}


def _perform_all(tasks: list[Any]) -> list[dict[str, Any]]:
    from .work import perform_all

    return perform_all(tasks)


def _failures(tasks: list[Any], reason: str) -> list[dict[str, Any]]:
    from .work import failures

    return [entry for task in tasks for entry in failures(task, reason)]


def _in_blender() -> bool:
    """Whether this program is Blender, which would be what is started again as a worker."""
    bpy = sys.modules.get("bpy")
    return bpy is not None and bool(bpy.app.binary_path)


def _writable_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder '{folder}' cannot be made ({error.strerror}): choose another one.") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"The folder '{folder}' is not writable: choose another one.")


def _remove_unfinished(folder: Path) -> None:
    """Remove what workers were writing when they were killed."""
    for place, _, names in os.walk(folder):
        for name in names:
            if _UNFINISHED.fullmatch(name):
                Path(place, name).unlink(missing_ok=True)


# --- the command ----------------------------------------------------------------------------------------------


def command_line(options: argparse.Namespace) -> int:
    """Run `dyehouse batch`.

    Returns
    -------
    0 when everything is done or set aside, 1 when something failed, 2 for bad input, 130 when stopped by Ctrl-C.
    """
    if options.workers is not None and options.workers < 0:
        raise FileError(f"--workers {options.workers} is too few: give 1 or more, or 0 to work in this process.")
    if options.per_task < 1:
        raise FileError(f"--per-task {options.per_task} is too few: give 1 or more.")
    if options.max_error is not None and not options.max_error >= 0:
        raise FileError(f"--max-error {options.max_error} is no color difference: give 0 or more, such as 2.")
    try:
        import OpenImageIO  # noqa: F401
    except ImportError:
        raise FileError(
            "A catalog needs OpenImageIO, which this Python does not have: use a Blender that has it, or pip install "
            "dyehouse."
        ) from None
    if options.resume and options.force:
        raise FileError("--resume and --force contradict each other: give one of them.")
    jobs, problems = gather(options.tables, options.recipe)
    replacing = options.resume or options.force
    problems += checks.outputs(jobs, options.out, replacing=replacing)
    page = storage.join(options.out, PAGE)
    if not (options.no_sheets or replacing or problems) and storage.exists(page):
        problems.append(Problem(None, f"'{page}' exists already: give --resume to go on, or --force to replace it."))
    if options.check:
        problems += checks.inputs(jobs)
        if not problems:
            said = {"photos": len(jobs), "results": sum(len(job.wants) for job in jobs), "problems": 0}
            print(json.dumps(said) if options.json else f"{said['photos']} photos, {said['results']} results: all good")
            return 0
    if problems:
        _tell_problems(problems, as_json=options.json)
        return 2
    names = ("workers", "scheduler", "per_task", "resume", "force", "max_error", "allow_warnings", "journal")
    chosen = {name: getattr(options, name) for name in names}
    run = Run(jobs, Settings(options.out, sheets=not options.no_sheets, verify=not options.no_verify, **chosen))
    return _watched(run, options)


def _tell_problems(problems: Sequence[Problem], *, as_json: bool) -> None:
    for problem in in_order(problems):
        if as_json:
            print(json.dumps(problem.as_dict(), ensure_ascii=False))
        else:
            print(f"dyehouse: {problem}", file=sys.stderr)
    if not as_json:
        print(f"dyehouse: {len(problems)} problem{'s' if len(problems) > 1 else ''}, nothing written", file=sys.stderr)


def _watched(run: Run, options: argparse.Namespace) -> int:
    started = time.perf_counter()
    interrupted = False

    def interrupt(*_: Any) -> None:
        nonlocal interrupted
        interrupted = run.stop.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)  # the second time at once

    handled = threading.current_thread() is threading.main_thread()
    if handled:
        before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    failed: list[dict[str, Any]] = []
    try:
        with _progress(run, options) as show:
            for entry in run.entries():
                show(entry)
                if entry["status"] == "failed":
                    failed.append(entry)
    finally:
        if handled:
            for number, handler in before.items():
                signal.signal(number, handler or signal.SIG_DFL)  # None: it was not Python's, as in Blender
    if interrupted:
        run.stopped = "stopped: go on with --resume"
    summary = run.summary | {"seconds": round(time.perf_counter() - started, 1)}
    if options.json:
        print(json.dumps({"summary": summary}, ensure_ascii=False))
    else:
        for entry in failed:
            print(f"dyehouse: {entry['source']}: '{entry['output']}' failed: {entry['reason']}", file=sys.stderr)
        if not options.quiet or failed or run.stopped:
            print(_in_words(summary, page=run.settings.sheets), file=sys.stderr if options.quiet else sys.stdout)
    if interrupted:
        return 130
    return 2 if run.stopped else int(bool(failed))


def _in_words(summary: dict[str, Any], *, page: bool) -> str:
    text = (
        f"{summary['done']} done, {summary['kept']} kept, {summary['needs_a_person']} need a person, "
        f"{summary['failed']} failed, of {summary['results']} in {summary['seconds']} s"
    )
    look = f"; look at {storage.join(summary['out'], PAGE)}" if page else ""
    return text + look + (f"\n{summary['stopped']}" if summary["stopped"] else "")


@contextlib.contextmanager
def _progress(run: Run, options: argparse.Namespace) -> Iterator[Any]:
    """Show how far the run is: a bar, plain lines where there is no terminal or no rich, JSON, or nothing."""
    if options.json:
        yield lambda entry: print(json.dumps(entry, ensure_ascii=False), flush=True)
        return
    if options.quiet:
        yield lambda entry: None
        return
    try:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
    except ImportError:
        yield _PlainProgress(run.total)
        return
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _PlainProgress(run.total)
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    rate = TextColumn("{task.fields[rate]}")
    with Progress(*columns, rate, TimeRemainingColumn(), console=console, transient=True) as bar:
        started = time.perf_counter()
        task = bar.add_task("Recoloring", total=run.total, rate="")

        def show(_: dict[str, Any]) -> None:
            done = bar.tasks[0].completed + 1
            bar.update(task, advance=1, rate=f"{done / (time.perf_counter() - started):.1f} a second")

        yield show


class _PlainProgress:
    """A line now and then."""

    def __init__(self, total: int) -> None:
        self.total, self.done = total, 0
        self.started = self.told = time.perf_counter()

    def __call__(self, _: dict[str, Any]) -> None:
        self.done += 1
        now = time.perf_counter()
        if now - self.told > _TELL_EVERY:
            rate = self.done / (now - self.started)
            left = (self.total - self.done) / rate
            print(f"{self.done} of {self.total}, {rate:.1f} a second, {left:.0f} s left", file=sys.stderr, flush=True)
            self.told = now
