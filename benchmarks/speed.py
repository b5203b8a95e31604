"""Speed and memory on this machine: `uv run --group bench python -m dyehouse.benchmarks.speed`; writes docs/speed.md.

Every figure is a ratio to a plain baseline measured beside it in the same run, round by round, so that the noise of the
machine falls on both. The table shows medians, and the smallest and largest ratio that was seen.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..batch import files, photo
from ..core import analyze, transfer
from ..core.colorspace import LINEAR_SRGB, SRGB
from ..core.recipe import Prepared, Recipe, Region
from ..core.swatches import parse_target

PAGE = Path(__file__).resolve().parent.parent / "docs" / "speed.md"
_TARGET = "#1F4E79"
_OTHERS = ("#2E7D4F", "#D9A820", "#8E2C6B")


def test_picture(height: int, width: int) -> NDArray[np.float32]:
    """(height, width, 3) linear: a glossy, shaded, orange product on grey, with the noise of a real camera."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    y, x = y / height, x / width
    shade = np.clip(0.55 + 0.4 * np.sin(9 * x + 3 * np.sin(5 * y)) * np.cos(6 * y), 0.03, 1)
    gloss = np.maximum(np.sin(23 * x) * np.sin(17 * y), 0) ** 24 * 0.5
    inside = ((x - 0.5) / 0.38) ** 2 + ((y - 0.5) / 0.42) ** 2 < 1
    body = np.where(inside[..., None], np.array([0.62, 0.13, 0.05], np.float32), np.float32(0.42))
    linear = shade[..., None] * body + (gloss * inside)[..., None]
    linear += rng.standard_normal(linear.shape, dtype=np.float32) * np.sqrt(linear * 1.5e-4 + 2e-6)
    return np.clip(linear, 0.0005, 0.98).astype(np.float32)


def _interleaved(rounds: int, *jobs: Callable[[], object]) -> list[list[float]]:
    """Seconds of every job, round by round, after one round that does not count."""
    times: list[list[float]] = [[] for _ in jobs]
    for k in range(rounds + 1):
        for job, seconds in zip(jobs, times, strict=True):
            started = time.perf_counter()
            job()
            if k:
                seconds.append(time.perf_counter() - started)
    return times


class Table:
    """Rows of (what, median seconds, ratio to a baseline, bar)."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, str, str, str]] = [("what", "seconds", "ratio (min-max)", "bar")]

    def add(self, what: str, seconds: list[float], base: list[float] | None = None, bar: str = "") -> None:
        """Add a row; ratios are taken round by round."""
        ratio = ""
        if base is not None:
            each = sorted(a / b for a, b in zip(seconds, base, strict=True))
            ratio = f"{np.median(each):.2f} ({each[0]:.2f}-{each[-1]:.2f})"
        self.rows.append((what, f"{np.median(seconds):.3f}", ratio, bar))

    def __str__(self) -> str:
        widths = [max(len(row[k]) for row in self.rows) for k in range(4)]
        lines = [
            "| " + " | ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) + " |" for row in self.rows
        ]
        lines.insert(1, "|" + "|".join("-" * (w + 2) for w in widths) + "|")
        return "\n".join(lines)


def arrays(table: Table, linear: NDArray[np.float32], rounds: int) -> None:
    """(a) and (d): arrays in memory against a plain copy, and against other libraries."""
    target = np.array([0.02, 0.08, 0.2])
    height, width = linear.shape[:2]
    center = (width // 2, height // 2)
    copy = np.empty_like(linear)
    out = np.empty_like(linear)

    def ours() -> None:
        analyze(linear, reference=center).recolor(target, out=out)

    def ours_new() -> None:
        analyze(linear, reference=center).recolor(target)

    base, into, new = _interleaved(rounds, lambda: np.copyto(copy, linear), ours, ours_new)
    table.add("numpy.copyto, float32", base)
    table.add("(a) analyze + recolor into a given array", into, base, "4")
    table.add("(a) analyze + recolor into a new array", new, base, "4")


def rivals(table: Table, linear: NDArray[np.float32], rounds: int) -> None:
    """(d): other libraries on the same picture, as they are used."""
    import cv2
    from color_matcher import ColorMatcher

    target = np.array([0.02, 0.08, 0.2])
    height, width = linear.shape[:2]
    analysis = analyze(linear, reference=(width // 2, height // 2))
    matrix = analysis.matrix(target).astype(np.float32)
    wanted = np.clip(analysis.recolor(target)[::4, ::4], 0, 1).astype(np.float64)
    source = linear.astype(np.float64)
    mine, transform, reinhard, mkl = _interleaved(
        rounds,
        lambda: analyze(linear, reference=(width // 2, height // 2)).recolor(target),
        lambda: cv2.transform(linear, matrix),
        lambda: ColorMatcher(src=source, ref=wanted, method="reinhard").main(),
        lambda: ColorMatcher(src=source, ref=wanted, method="mkl").main(),
    )
    size = f"{height * width / 1e6:.0f} MP"
    table.add(f"(d) analyze + recolor, {size}", mine)
    table.add(f"(d) cv2.transform, {size}", transform, mine)
    table.add(f"(d) color-matcher reinhard, {size}", reinhard, mine)
    table.add(f"(d) color-matcher mkl, {size}", mkl, mine)


def _prepared(source: Path) -> tuple[files.Photo, Prepared]:
    opened = files.read(source)
    height, width = opened.pixels.shape[:2]
    region = Region(parse_target(_TARGET), reference=(width // 2, height // 2))
    return opened, photo.look(opened, Recipe((region,)))


def _recolor_file(source: Path, output: Path) -> None:
    opened, prepared = _prepared(source)
    photo.save(opened, prepared, output, reuse=True, force=True)


def in_files(table: Table, folder: Path, linear: NDArray[np.float32], rounds: int) -> None:
    """(b) and (c): from file to file, against OpenImageIO decoding and encoding alone with the same settings."""
    import OpenImageIO as oiio

    kinds = (
        ("jpg", SRGB, np.uint8, "2.0"),
        ("png", SRGB, np.uint8, "1.15"),
        ("tif", SRGB, np.uint16, "1.3"),
        ("exr", LINEAR_SRGB, np.float16, "1.3"),
    )
    for suffix, space, dtype, bar in kinds:
        source, output, plain = (folder / f"{name}.{suffix}" for name in ("source", "output", "plain"))
        codes = transfer.encode(linear, space.curve, dtype)
        files.write(source, codes, files.Photo(source, codes, space), force=True)
        opened, prepared = _prepared(source)
        spec = files._output_spec(opened.pixels, files._kind(output), output, opened, 95, None)

        room = np.empty_like(opened.pixels)

        def copy(source: Path = source, plain: Path = plain, spec: oiio.ImageSpec = spec) -> None:
            reader = oiio.ImageInput.open(str(source))
            if reader is None:
                raise RuntimeError(oiio.geterror())
            pixels = reader.read_image(reader.spec().format)
            reader.close()
            encode(np.asarray(pixels), plain, spec)

        def encode(pixels: NDArray, plain: Path, spec: oiio.ImageSpec) -> None:
            writer = oiio.ImageOutput.create(str(plain))
            if writer is None:
                raise RuntimeError(oiio.geterror())
            if not (writer.open(str(plain), spec) and writer.write_image(pixels) and writer.close()):
                raise RuntimeError(writer.geterror())

        def first(source: Path = source, output: Path = output) -> None:
            _recolor_file(source, output)

        def further(
            output: Path = output, opened: files.Photo = opened, prepared: Prepared = prepared, room: NDArray = room
        ) -> None:
            photo.save(opened, prepared, output, [parse_target(_OTHERS[0])], out=room, force=True)

        def encode_only(plain: Path = plain, opened: files.Photo = opened, spec: oiio.ImageSpec = spec) -> None:
            encode(opened.pixels, plain, spec)

        base, whole, more, encoding = _interleaved(rounds, copy, first, further, encode_only)
        label = f"{suffix} {np.dtype(dtype)}"
        table.add(f"OpenImageIO decode + encode, {label}", base)
        table.add(f"(b) file to file, {label}", whole, base, bar)
        beyond = [m - e for m, e in zip(more, encoding, strict=True)]
        table.add(f"(c) further colorway beyond its encoding, {label}", beyond, whole, "0.25")


# The child tells its own peak: what the operating system reports to the parent begins with the parent's own size.
_CHILD = """
import sys
from dyehouse.batch.cli import main
try:
    status = main(sys.argv[1:])
except SystemExit as stop:
    status = stop.code
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print("peak", peak.split()[1])
sys.exit(status)
"""


def process(arguments: list[str]) -> tuple[float, float]:
    """Seconds and peak resident megabytes of the command line as a process of its own."""
    started = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", _CHILD, *arguments], capture_output=True, text=True, check=True)
    seconds = time.perf_counter() - started
    return seconds, int(done.stdout.rsplit(maxsplit=1)[1]) / 1024


def processes(table: Table, folder: Path, rounds: int, width: int) -> list[str]:
    """(e) memory of 8-bit files, as lines of a table, and the times of whole processes."""
    options = ["--reference", f"{width // 2},300", "--target", _TARGET, "--force"]
    one = folder / "one.png"
    codes = transfer.encode(test_picture(1000, 1000), SRGB.curve, np.uint8)
    files.write(one, codes, files.Photo(one, codes, SRGB), force=True)
    small = [
        "recolor",
        str(one),
        "--click",
        "500,500",
        "--target",
        _TARGET,
        "--force",
        "-o",
        str(folder / "one-out.png"),
    ]
    starts, runs = [], []
    for _ in range(rounds):
        starts.append(process(["--help"])[0])
        runs.append(process(small)[0])
    table.add("dyehouse --help, whole process", starts, None, "0.3 s")
    table.add("1 MP PNG, one click, whole process", runs, None, "1 s")
    lines = ["| file | peak resident memory | of which the decoded picture |", "|---|---|---|"]
    for suffix in ("jpg", "png"):
        for height in (2000, 4000, 8000):
            source = folder / f"tall-{height}.{suffix}"
            part = transfer.encode(test_picture(1000, width), SRGB.curve, np.uint8)
            codes = np.concatenate([part] * (height // 1000))
            files.write(source, codes, files.Photo(source, codes, SRGB), force=True)
            _, peak = process(["recolor", str(source), *options, "-o", str(folder / f"tall-out.{suffix}")])
            decoded = codes.nbytes / 2**20
            lines.append(f"| {suffix}, {height * width / 1e6:.0f} MP | {peak:.0f} MB | {decoded:.0f} MB |")
    return lines


def main() -> None:
    """Print the table and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--megapixels", type=float, default=24)
    options.add_argument("--rounds", type=int, default=7)
    given = options.parse_args()
    width = round((given.megapixels * 1e6 * 1.5) ** 0.5)
    height = round(given.megapixels * 1e6 / width)
    linear = test_picture(height, width)
    table = Table()
    arrays(table, linear, given.rounds)
    with tempfile.TemporaryDirectory() as name:
        in_files(table, Path(name), linear, given.rounds)
        memory = processes(table, Path(name), min(5, given.rounds), width)
    rivals(table, np.ascontiguousarray(linear[: height // 2, : width // 2]), 3)
    page = "\n".join(
        [
            "# Speed and memory",
            "",
            "Made by `uv run --group bench python -m dyehouse.benchmarks.speed` on",
            f"{os.process_cpu_count()} cores, with a picture of {width} x {height} pixels that has shading, gloss and",
            "camera noise. Every ratio is to the baseline above it (d: to ours), taken round by round in one run:",
            f"median of {given.rounds} rounds, smallest and largest",
            "in parentheses. (a) and (b) are to be at most the bar; (c) is a share of the first colorway's whole time.",
            "",
            str(table),
            "",
            "Peak memory of `dyehouse recolor` as a process of its own:",
            "",
            *memory,
            "",
        ]
    )
    PAGE.write_text(page)
    print(page)


if __name__ == "__main__":
    main()
