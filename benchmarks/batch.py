"""Speed and memory of catalogs: `uv run --group bench python -m dyehouse.benchmarks.batch`.

Writes docs/catalog_speed.md.

Ratios are of whole runs of one session, one after the other, on JPEGs of 2 megapixels with shading, gloss and camera
noise. What would take hours (a command for every result, color-matcher) is done for some of the photos and counted by
the photo; the table says so.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import heapq
import io
import itertools
import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from multiprocessing import forkserver
from pathlib import Path

import numpy as np

from ..batch import engine, files, photo, sheet, storage, verification, work
from ..batch.catalog import Run, Settings
from ..batch.jobs import Job, gather
from ..core import transfer
from ..core.colorspace import SRGB
from .speed import test_picture

PAGE = Path(__file__).resolve().parent.parent / "docs" / "catalog_speed.md"
SIZE = (1224, 1632)
COLORWAYS = ("navy=#1F4E79", "green=#2E7D4F", "mustard=#D9A820", "plum=#8E2C6B", "charcoal=#2B2D2F")
CLICK = (700, 560)


def photos(folder: Path, count: int, size: tuple[int, int] = SIZE) -> None:
    """Write JPEGs, no two alike, and the mask that fits them all."""
    folder.mkdir()
    linear = test_picture(*size)
    rng = np.random.default_rng(2)
    for k in range(count):
        exposed = linear * np.float32(1 - 0.001 * k % 0.2)
        codes = transfer.encode(exposed, SRGB.curve, np.uint8)
        picture = (codes + rng.integers(-1, 2, codes.shape)).clip(0, 255).astype(np.uint8)
        files.write(folder / f"photo{k:04}.jpg", picture, files.Photo(Path(), picture, SRGB))
    y, x = np.mgrid[0 : size[0], 0 : size[1]]
    inside = ((x / size[1] - 0.5) / 0.38) ** 2 + ((y / size[0] - 0.5) / 0.42) ** 2 < 1  # as in `test_picture`
    mask = np.repeat(inside[..., None], 3, axis=2).astype(np.uint8) * np.uint8(255)
    files.write(folder / "mask.png", mask, files.Photo(Path(), mask, SRGB))


def jobs_of(folder: Path, how: str, colorways: tuple[str, ...] = COLORWAYS, most: int | None = None) -> list[Job]:
    """Jobs of the photos in a folder; `how` is the columns and cells that choose the region."""
    column, _, cell = how.partition("=")
    rows = [f'{p.name},"{cell}",{" | ".join(colorways)}' for p in sorted(folder.glob("*.jpg"))[:most]]
    table = folder / "catalog.csv"
    table.write_text(f"photo,{column},colorways,output\n" + "\n".join(f"{r},{{photo}}-{{colorway}}.jpg" for r in rows))
    jobs, problems = gather([str(table)])
    if problems:
        raise SystemExit(str(problems[0]))
    return jobs


def cpu_seconds() -> float:
    """Of this process, of what it has waited for, and of the fork server that the workers are children of."""
    own, children = os.times(), resource.getrusage(resource.RUSAGE_CHILDREN)
    total = own.user + own.system + children.ru_utime + children.ru_stime
    server = vars(forkserver._forkserver)["_forkserver_pid"]
    if server is not None:
        figures = Path(f"/proc/{server}/stat").read_text().rpartition(")")[2].split()[11:15]
        total += sum(map(int, figures)) / os.sysconf("SC_CLK_TCK")
    return total


def seconds_of(do: Callable[[], object]) -> np.ndarray:
    """(wall, CPU) seconds."""
    started, cpu = time.perf_counter(), cpu_seconds()
    do()
    return np.array([time.perf_counter() - started, cpu_seconds() - cpu])


def run_batch(
    jobs: list[Job],
    workers: int,
    *,
    sheets: bool = True,
    verify: bool = True,
    watch: Callable[[int], None] | None = None,
) -> None:
    """Do jobs into a folder that goes afterwards."""
    with tempfile.TemporaryDirectory() as out:
        settings = Settings(out, workers=workers, sheets=sheets, verify=verify)
        for number, entry in enumerate(Run(jobs, settings).entries()):
            if entry["status"] != "done":
                raise SystemExit(f"{entry['output']}: {entry.get('reason')}")
            if watch:
                watch(number)


def codec(task: tuple[str, str, int]) -> None:
    """Decode a photo and encode it as often as there are colorways, and nothing else."""
    path, out, count = task
    opened = files.read(path)
    for k in range(count):
        files.write(Path(out) / f"{Path(path).stem}-{k}.jpg", opened.pixels, opened, force=True)


def run_codec(jobs: list[Job], workers: int) -> None:
    with tempfile.TemporaryDirectory() as out:
        tasks = [(job.photo, out, len(job.wants)) for job in jobs]
        executor = engine.processes(workers, 1, work.begin, str(Path(out) / "none"), 1)
        for _ in engine.run(tasks, codec, executor, workers, _refuse):
            pass


def _refuse(task: object, reason: str) -> None:
    raise SystemExit(f"{task}: {reason}")


def run_shell(jobs: list[Job]) -> None:
    """One `dyehouse recolor` for every result, two at a time, as xargs does it."""
    program = [sys.executable, "-m", "dyehouse", "recolor"]
    with tempfile.TemporaryDirectory() as out:
        lines = []
        for job in jobs:
            for want in job.wants:
                target = str(want.colorway.targets[0])
                mask = ["--mask", str(job.recipe.regions[0].mask)]
                command = [*program, job.photo, *mask, "--target", target, "-o", f"{out}/{want.output}"]
                lines.append(shlex.join(command))
        script = "\n".join(lines)
        subprocess.run(
            ["xargs", "-P", "2", "-I", "{}", "sh", "-c", "{} > /dev/null"],
            input=script.replace("'", "\\'"),
            text=True,
            check=True,
        )
        if len(list(Path(out).iterdir())) != len(lines):
            raise SystemExit("the shell loop did not write all its files")


def run_color_matcher(folder: Path, count: int) -> None:
    """color-matcher's command line, one reference for some of the photos."""
    with tempfile.TemporaryDirectory() as place:
        source = Path(place) / "source"
        source.mkdir()
        for path in sorted(folder.glob("*.jpg"))[:count]:
            shutil.copy(path, source)
        program = Path(sys.executable).with_name("color-matcher")
        command = [str(program), "-s", str(source), "-r", str(folder / "photo0000.jpg"), "-m", "mkl"]
        subprocess.run(command, check=False, cwd=place, capture_output=True)  # its exit code is 1 whatever happens
        if len(list(source.glob("batch_proc_mkl/*"))) != count:
            raise SystemExit("color-matcher did not write all its files")


# --- memory ---------------------------------------------------------------------------------------------------


def resident(pid: int) -> float:
    """Megabytes of a process and all that it has started."""
    total = 0.0
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                total += int(line.split()[1]) / 1024
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            total += resident(int(child))
    return total


def memory(folder: Path, count: int) -> tuple[float, float]:
    """(megabytes at the end, megabytes more for every thousand jobs) of a run over many small photos."""
    jobs = jobs_of(folder, "mask=mask.png", COLORWAYS[:1])
    seen: list[float] = []
    run_batch(jobs, 2, sheets=False, watch=lambda n: seen.append(resident(os.getpid())) if n % 20 == 0 else None)
    later = np.array(seen[len(seen) // 4 :])  # the first quarter fills caches
    slope = float(np.polyfit(np.arange(len(later)) * 20 / 1000, later, 1)[0])
    assert len(jobs) == count
    return float(later[-1]), slope


# --- a thousand workers, simulated ----------------------------------------------------------------------------


def scheduler_seconds(tasks: int = 3000) -> float:
    """Seconds that a dask scheduler and its client take for a task that does nothing."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        pool = client.get_executor(pure=False)
        list(engine.run(range(200), abs, lambda: pool, 50, _refuse))
        started = time.perf_counter()
        pool = client.get_executor(pure=False)
        list(engine.run(range(tasks), abs, lambda: pool, 50, _refuse))
        return (time.perf_counter() - started) / tasks


def simulate(workers: int, batch: int, job: np.ndarray, service: float, tasks: int = 20_000) -> float:
    """Photos a second of workers that one scheduler serves, one task after the other.

    A worker that becomes free waits for the scheduler, which takes `service` seconds for a task of `batch` photos;
    the photos take times drawn from those that were measured.
    """
    rng = np.random.default_rng(3)
    free = [0.0] * workers
    heapq.heapify(free)
    scheduler = 0.0
    durations = rng.choice(job, (tasks, batch)).sum(axis=1)
    for duration in durations:
        scheduler = max(scheduler, heapq.heappop(free)) + service
        heapq.heappush(free, scheduler + duration)
    # Until the last task is given out all workers are busy: what came before is the steady rate.
    return tasks * batch / scheduler


# --- the page -------------------------------------------------------------------------------------------------


def report(count: int, some: int, small: int, rounds: int) -> Iterator[str]:
    """Lines of the page, as they are measured."""
    with tempfile.TemporaryDirectory() as place:
        folder, tiny = Path(place) / "photos", Path(place) / "tiny"
        photos(folder, count)
        jobs, clicked = jobs_of(folder, "mask=mask.png"), jobs_of(folder, f"click={CLICK[0]} {CLICK[1]}")
        yield (
            f"{count} photos of {SIZE[1]} x {SIZE[0]} (JPEG), {len(COLORWAYS)} colorways each, {rounds} round(s). "
            "Every row but those that say otherwise is `dyehouse batch` with its defaults (contact sheets, "
            "every file verified, a journal, a page) on 2 processes, and with a mask for every photo. Other work on "
            "the machine changes CPU seconds little, wall seconds much."
        )
        yield ""
        yield "| what | seconds a photo | CPU seconds | ratio by CPU | by wall | bar |"
        yield "|---|---|---|---|---|---|"

        def median(do: Callable[[], object], divisor: float) -> np.ndarray:
            return np.median([seconds_of(do) for _ in range(rounds)], axis=0) / divisor

        def row(what: str, taken: np.ndarray, ratio: np.ndarray | None = None, to: str = "", bar: str = "") -> str:
            ratios = ("", "") if ratio is None else (f"{ratio[1]:.2f} {to}", f"{ratio[0]:.2f}")
            return f"| {what} | {taken[0]:.3f} | {taken[1]:.3f} | {ratios[0]} | {ratios[1]} | {bar} |"

        bare = median(lambda: run_codec(jobs, 2), count)
        yield row("decode and encode alone", bare)
        two = median(lambda: run_batch(jobs, 2), count)
        codec_ratio = "of decode and encode"
        yield row("batch", two, two / bare, codec_ratio, "at most 1.6")
        for what, sheets, verify in (
            ("without contact sheets and page", False, True),
            ("without verification", True, False),
            ("without both", False, False),
        ):
            taken = median(functools.partial(run_batch, jobs, 2, sheets=sheets, verify=verify), count)
            yield row(what, taken, taken / bare, codec_ratio)
        one = median(lambda: run_batch(jobs, 1), count)
        yield row("batch on 1 process", one, one / two, "of 2 processes", "at least 1.8 by wall")
        click = median(lambda: run_batch(clicked, 2), count)
        yield row("batch by one click, without masks", click, click / bare, codec_ratio)
        shell = seconds_of(lambda: run_shell(jobs[:some])) / some
        loop = f"`xargs -P 2` of `dyehouse recolor` ({some} photos)"
        yield row(loop, shell, shell / two, "of batch", "at least 5")
        rival = seconds_of(lambda: run_color_matcher(folder, some)) / some
        what = f"color-matcher's command line, mkl, one result a photo ({some} photos)"
        yield row(what, rival, rival / (two / len(COLORWAYS)), "of batch, by the result")
        yield ""
        yield from _stages(jobs[: some + 1])
        yield ""
        job = np.array(_photo_seconds(jobs[: some + 1]))
        yield from _simulation(job, scheduler_seconds())
        photos(tiny, small, (96, 128))
        end, slope = memory(tiny, small)
        yield ""
        yield (
            f"Memory of all processes over {small} jobs on 2 processes: {end:.0f} MB at the end, {slope:+.2f} MB for "
            "every thousand jobs (least squares, after the first quarter)."
        )


def _stages(jobs: list[Job]) -> Iterator[str]:
    """Table of what a photo's time goes into, in one process with one thread."""
    with tempfile.TemporaryDirectory() as out:
        found = [stages(job, Path(out)) for job in jobs][1:]  # the first one imports and fills caches
    taken = {name: 1000 * float(np.median([one[name] for one in found])) for name in found[0]}
    total, codec_part = sum(taken.values()), taken["decode the photo"] + taken["encode"]
    yield f"| stage, {len(found)} photos | CPU milliseconds a photo (median) | share |"
    yield "|---|---|---|"
    for name, spent in (*taken.items(), ("all", total)):
        yield f"| {name} | {spent:.1f} | {spent / total:.0%} |"
    each = 1e6 * taken["recolor"] / (SIZE[0] * SIZE[1] * len(COLORWAYS))
    yield ""
    yield (
        f"For 1.6 times the {codec_part:.0f} ms of decoding and encoding, all else would have to take "
        f"{0.6 * codec_part:.0f} ms; it takes {total - codec_part:.0f} ms. Recoloring alone takes "
        f"{taken['recolor']:.0f} ms, {each:.1f} nanoseconds for a pixel and a colorway."
    )


def stages(job: Job, out: Path) -> dict[str, float]:
    """CPU seconds of one thread for each part of the work on a photo with a mask, done as `work.perform` does it."""
    taken: dict[str, float] = {}

    @contextlib.contextmanager
    def timed(name: str) -> Iterator[None]:
        started = time.thread_time()
        yield
        taken[name] = taken.get(name, 0.0) + time.thread_time() - started

    with timed("decode the photo"):
        opened = files.read(job.photo)
    recipe = replace(job.recipe, colorways=tuple(want.colorway for want in job.wants))
    mask = files.read_mask(str(recipe.regions[0].mask), opened.pixels.shape)  # that of all photos
    with timed("look: white, reference, model"):
        prepared = photo.look(opened, recipe, read_mask=lambda name: mask)
    (analysis,) = prepared.analyses
    with timed("outline"):
        assert analysis.mask is not None
    with timed("correction maps"):
        assert analysis.extra is None or analysis.extra.any()
    owns = [prepared.for_colorway(want.colorway) for want in job.wants]
    with timed("contact sheet"):
        cells = work.small_pictures(prepared, owns, job.wants)
    with timed("recolor"):
        palette = photo.palette(prepared)
    with timed("verify"):
        areas = verification.matte_areas(opened, prepared)
    room = np.empty_like(opened.pixels)
    for want, own in zip(job.wants, owns, strict=True):
        path = out / want.output
        with timed("predict the error"):
            assert own.predictions
        with timed("recolor"):
            pixels, _ = photo.recolored(opened, own, path, out=room, threads=1, palette=palette)
        with timed("encode"):
            files.write(path, pixels, opened, force=True)
        with timed("hashes"):
            storage.digest(path)
        with timed("verify"):
            verification.expect(opened, own, areas=areas).check(path)
    with timed("contact sheet"):
        rows = [cells[k : k + work.ACROSS] for k in range(0, len(cells), work.ACROSS)]
        picture = sheet.contact_sheet(rows, cells[0][1].shape[1])
        files.write(out / "sheet.jpg", picture, files.Photo(Path(), picture, SRGB), force=True, quality=88)
    with timed("hashes"):
        storage.digest(Path(job.photo))
    return taken


def _photo_seconds(jobs: list[Job]) -> list[float]:
    with tempfile.TemporaryDirectory() as out:
        tasks = [work.Task(job, out, threads=1) for job in jobs]
        # The first one imports; CPU seconds, as a machine of its own would take.
        return [float(seconds_of(functools.partial(work.perform, task))[1]) for task in tasks][1:]


def _simulation(job: np.ndarray, service: float) -> Iterator[str]:
    counts, batches = (1, 10, 100, 300, 1000), (1, 2, 4, 8, 16)
    yield (
        f"**Simulated, not measured:** one scheduler that takes {service * 1000:.2f} ms a task (measured here: dask "
        "with empty tasks, client and two workers on the same two cores, so an upper bound) and workers that take "
        f"{np.median(job):.2f} s for a photo (measured here, median of {len(job)}). Photos a second:"
    )
    yield ""
    yield "| workers | " + " | ".join(f"{b} a task" for b in batches) + " | without a scheduler |"
    yield "|---" * (len(batches) + 2) + "|"
    for workers in counts:
        rates = [simulate(workers, b, job, service) for b in batches]
        ideal = workers / job.mean()
        yield f"| {workers} | " + " | ".join(f"{rate:.1f}" for rate in rates) + f" | {ideal:.1f} |"
    limit = job.mean() / service
    enough = next((b for b in batches if simulate(1000, b, job, service) > 0.95 * 1000 / job.mean()), None)
    yield ""
    yield (
        f"With one photo a task the scheduler saturates at about {limit:.0f} workers (the time of a photo over that of "
        f"a task); a thousand workers reach 95 % of their rate from `--per-task {enough}` on."
    )


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--photos", type=int, default=200)
    options.add_argument("--some", type=int, default=10, help="photos for what is slow")
    options.add_argument("--small", type=int, default=2000, help="photos for the memory")
    options.add_argument("--rounds", type=int, default=1)
    chosen = options.parse_args()
    command = " ".join(["uv run --group bench python -m dyehouse.benchmarks.batch", *sys.argv[1:]])
    head = ["# Speed and memory of catalogs", "", f"Made by `{command}` on {os.process_cpu_count()} cores.", ""]
    text = io.StringIO()
    for line in itertools.chain(head, report(chosen.photos, chosen.some, chosen.small, chosen.rounds)):
        print(line, flush=True)
        text.write(line + "\n")
    PAGE.write_text(text.getvalue())


if __name__ == "__main__":
    main()
