"""Speed against accuracy of every method, ours and others', in one chart.

    DYEHOUSE_CACHE=... uv run --group bench python -m dyehouse.benchmarks.speed_accuracy [--size 128] [--rounds 7]

Accuracy: CIEDE2000 against a render of the product truly in the target color, over the product's interior, of every
scene and every ordered pair of colors. The target is read from that render at the reference pixel, as the paper did.
Time: all methods on the same megapixel, round by round in one run. Writes docs/speed_accuracy.md and
docs/figures/speed_accuracy.png.
"""

from __future__ import annotations

import argparse
import itertools
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import analyze, colorimetry, dichromatic, reflectance, spectra, transfer
from ..core.analysis import MODELS
from ..core.colorspace import LINEAR_SRGB
from ..core.errors import DyehouseError, ReferenceColorError
from ..core.picture import Picture
from ..core.recolor import RegionMatrix, recolor
from ..core.reference import reference_at
from . import laboratory, rivals, speed
from .laboratory import BANDS, RGB, Settings
from .rivals import Task

DOCS = Path(__file__).resolve().parent.parent / "docs"

COLORS: Mapping[
    str, RGB
] = {  # linear Rec.709 reflectance of four ColorChecker patches, as the trial runs and the paper's cups
    "blue": (0.0395, 0.0467, 0.305),
    "red": (0.429, 0.037, 0.045),
    "green": (0.0612, 0.2961, 0.0666),
    "yellow": (0.799, 0.571, 0.0137),
}
WELL_BEHAVED = ("mug", "fabric_cylinder", "sneaker", "mug_daylight", "mug_mixed", "color_bleeding")
FAILURES = (
    *(
        "folds",
        "folds_mixed",
        "metal",
        "satin",
        "translucent_mug",
        "near_white",
        "near_black",
        "pale",
        "clipped",
        "two_lights",
    ),
    "heather",
)
GREYISH = ("near_white", "near_black", "pale")
"""Scenes whose difficulty is their own color: they are recolored from it, never to it."""

SPECTRAL = {"well-behaved": ("mug", "fabric_cylinder"), "failures": ("folds", "translucent_mug")}
SPECTRAL_COLORS = ("blue", "red", "yellow")

QUANTILES = np.linspace(0, 1, 201)

SEE_THE_ANSWER = {name for name in rivals.RIVALS if name.startswith(("Reinhard", "color-matcher"))}
"""Rivals that are given the true picture, to take its statistics from."""

type Method = Callable[[Task], NDArray]
"""What is compared: ours and the rivals are given the same."""


# --- What is measured -------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Pair:
    """A photo of a product, and one of the same product truly in another color.

    Attributes
    ----------
    scene, source, target
        Names.
    photo, truth
        (H, W, 3) float32 linear RGB, exposed so that white is 1 in its largest channel, and mostly cut there.
    white
        (3,) of the light at the reference.
    view
        Mask, interior and reference pixel.
    """

    scene: str
    source: str
    target: str
    photo: NDArray[np.float32]
    truth: NDArray[np.float32]
    white: NDArray[np.float64]
    view: laboratory.View

    def color(self, pixels: NDArray[np.float32]) -> NDArray[np.float64]:
        """(3,) at the reference pixel, read as the program reads a click."""
        x, y = self.view.reference
        return reference_at(Picture(pixels), (x, y), self.white).color

    @property
    def readable(self) -> bool:
        """Whether neither color is clipped at the reference, so that there is a color to give and one to ask for."""
        try:
            self.color(self.photo), self.color(self.truth)
        except ReferenceColorError:
            return False
        return True

    def errors(self, result: NDArray) -> NDArray[np.float64]:
        """(n,) CIEDE2000 of the product's interior, under the photo's light."""
        inside = self.view.interior
        return difference(np.minimum(result[inside], 1), self.truth[inside], self.white)


def difference(pixels: NDArray, truth: NDArray, white: ArrayLike = (1.0, 1.0, 1.0)) -> NDArray[np.float64]:
    """CIEDE2000 of (..., 3) linear RGB pixels, each seen relative to the white of the light."""
    w = np.asarray(white, np.float64)
    lab = [colorimetry.linear_to_lab(np.asarray(p, np.float64) / w, LINEAR_SRGB) for p in (pixels, truth)]
    return np.asarray(colorimetry.delta_e_2000(*lab), np.float64)


def photograph(
    scene: str, dye: ArrayLike, settings: Settings, *, cut: bool = True, **parameters: Any
) -> NDArray[np.float32]:
    """Render of a scene as a photo holds it: white is 1 in the largest channel, and what is brighter is cut."""
    white = laboratory.view(scene, settings, **parameters).white()
    picture = laboratory.render(scene, dye, settings=settings, **parameters) / np.float32(white.max())
    return np.minimum(picture, 1) if cut else picture


def pairs(
    scene: str, settings: Settings, colors: Mapping[str, RGB] = COLORS, *, cut: bool = True, **parameters: Any
) -> Iterator[Pair]:
    """Every ordered pair of colors of a scene; of a greyish one, its own color with each of them."""
    view = laboratory.view(scene, settings, **parameters)
    white = view.white() / view.white().max()
    photos = {name: photograph(scene, dye, settings, cut=cut, **parameters) for name, dye in colors.items()}
    if scene in GREYISH:
        own = photograph(scene, view.dye, settings, cut=cut, **parameters)
        for name in colors:
            yield Pair(scene, "its own", name, own, photos[name], white, view)
        return
    for source, target in itertools.permutations(colors, 2):
        yield Pair(scene, source, target, photos[source], photos[target], white, view)


# --- Our methods ------------------------------------------------------------------------------------------
def _matrix32(task: Task, model: str = "dichromatic", residual: float = 0.0) -> NDArray:
    matrix = dichromatic.recolor_matrix(task.reference, task.target, task.white, model=model, residual=residual)
    return recolor(Picture(task.picture), [RegionMatrix(matrix)])[0]


def _matrix64(task: Task) -> NDArray:
    return task.picture.astype(np.float64) @ dichromatic.recolor_matrix(task.reference, task.target, task.white).T


def _coefficients(task: Task) -> NDArray:
    pixels = task.picture.astype(np.float64)
    return dichromatic.synthesize(*dichromatic.fit(pixels, task.reference, task.white), task.target, task.white)


def _tables(task: Task) -> NDArray:
    matrix = dichromatic.recolor_matrix(task.reference, task.target, task.white)
    codes = Picture(task.picture, transfer.SRGB)
    return recolor(codes, [RegionMatrix(matrix)], curve=transfer.SRGB, dtype=np.uint8)[0]


def _house(task: Task, model: str) -> NDArray:
    return analyze(task.picture, task.white, task.reference, task.region, model).recolor(task.target)


BASE = "3x3 matrix, float32"
CODES = "3x3 matrix, 8-bit tables"
"""The one that takes sRGB codes and gives them."""

SPECTRAL_NAME = "spectral (a, b), 31 bands"

_ANALYZE: dict[str, Method] = {f"analyze, {model}": partial(_house, model=model) for model in MODELS}
OURS: dict[str, Method] = {
    BASE: _matrix32,
    "3x3 matrix, float64": _matrix64,
    CODES: _tables,
    "3x3 matrix, residual kept": partial(_matrix32, residual=1.0),
    "body only, float32": partial(_matrix32, model="body"),
    "A and B, float64": _coefficients,
    **_ANALYZE,
}
"""`analyze` also does the edges, fades the residual and warns; a model that the core gains appears by itself."""


@dataclass(frozen=True)
class Score:
    """How a method did on one pair: quantiles of its errors, or None if it refused or gave no numbers."""

    scene: str
    errors: NDArray[np.float64] | None


def result_of(name: str, method: Method, pair: Pair) -> NDArray:
    """Linear pixels that a method makes of a pair's photo."""
    colors = pair.color(pair.photo), pair.color(pair.truth)
    photo = transfer.encode(pair.photo, transfer.SRGB, np.uint8) if name == CODES else pair.photo
    # Rivals learn statistics: only from pixels of nothing but the product.
    result = method(Task(photo, pair.view.mask > 0.999, *colors, pair.truth, pair.white))
    return transfer.decode(result, transfer.SRGB) if name == CODES else result


def accuracy(
    scenes: Sequence[str], methods: dict[str, Method], settings: Settings, colors: Mapping[str, RGB] = COLORS
) -> list[dict[str, Score]]:
    """Scores of every method on every readable pair of the scenes, by the methods' names."""
    rows = []
    for pair in itertools.chain.from_iterable(pairs(scene, settings, colors) for scene in scenes):
        if not pair.readable:
            continue
        row = {}
        for name, method in methods.items():
            try:
                result = result_of(name, method, pair)
            except DyehouseError:
                row[name] = Score(pair.scene, None)
                continue
            fine = np.isfinite(result[pair.view.interior]).all()
            row[name] = Score(pair.scene, np.quantile(pair.errors(result), QUANTILES) if fine else None)
        rows.append(row)
    return rows


def pooled(scores: Sequence[Score]) -> tuple[float, float]:
    """Median and 95th percentile over pairs, each pair counting alike whatever its number of pixels."""
    every = [s.errors for s in scores if s.errors is not None]
    return (float(np.median(every)), float(np.quantile(every, 0.95))) if every else (np.nan, np.nan)


# --- Spectral ---------------------------------------------------------------------------------------------
def spectral(scenes: Sequence[str], settings: Settings) -> dict[str, list[Score]]:
    """Spectral method with the true spectra, and the 3x3 matrix, both on renders in 31 bands under D65."""
    chart = spectra.chart("BabelColor Average")
    from_xyz = np.linalg.inv(LINEAR_SRGB.to_xyz)
    response = laboratory.response("1931", "D65") @ from_xyz.T
    found: dict[str, list[Score]] = {SPECTRAL_NAME: [], BASE: []}
    for scene in scenes:
        view = laboratory.view(scene, settings)
        x, y = view.reference
        # The white tile is read once, at the reference, as the paper's spectroradiometer was.
        factors = {
            name: laboratory.measure(scene, np.clip(chart[name].at(BANDS), 0, 1), settings).factors(at=(x, y))
            for name in SPECTRAL_COLORS
        }
        for source, target in itertools.permutations(SPECTRAL_COLORS, 2):
            photo, truth = (np.minimum(factors[name] @ response, 1).astype(np.float32) for name in (source, target))
            pair = Pair(scene, source, target, photo, truth, np.ones(3), view)
            spot = slice(y - 1, y + 2), slice(x - 1, x + 2)
            at, to = (factors[name][spot].mean(axis=(0, 1)) for name in (source, target))
            made = reflectance.predict(*reflectance.fit(at, factors[source]), to) @ response
            for name, result in ((SPECTRAL_NAME, made), (BASE, result_of(BASE, OURS[BASE], pair))):
                found[name].append(Score(scene, np.quantile(pair.errors(result), QUANTILES)))
    return found


# --- Time -------------------------------------------------------------------------------------------------
def times(others: dict[str, Method], rounds: int) -> dict[str, list[float]]:
    """Seconds of every method for one megapixel, interleaved round by round after one that does not count."""
    photo = speed.test_picture(1000, 1000)
    y, x = np.mgrid[0:1000, 0:1000] / 999
    region = ((x - 0.5) / 0.38) ** 2 + ((y - 0.5) / 0.42) ** 2 < 1
    v, target, white = photo[500, 500].astype(np.float64), np.array([0.02, 0.08, 0.2]), np.ones(3)
    example = np.clip(analyze(photo, white, v, region).recolor(target), 0, 1)
    task = Task(photo, region, v, target, example, white)
    in_codes = replace(task, picture=transfer.encode(photo, transfer.SRGB, np.uint8))
    jobs: dict[str, Callable[[], object]] = {
        name: partial(method, in_codes if name == CODES else task) for name, method in (OURS | others).items()
    }
    factors, goal = np.repeat(photo, [10, 10, 11], axis=2), np.repeat(target, [10, 10, 11])
    jobs[SPECTRAL_NAME] = lambda: reflectance.predict(*reflectance.fit(factors[500, 500], factors), goal)
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for k in range(rounds + 1):
        for name, job in jobs.items():
            started = time.perf_counter()
            job()
            if k:
                seconds[name].append(time.perf_counter() - started)
    return seconds


# --- Page -------------------------------------------------------------------------------------------------
def table(scores: dict[str, list[Score]], seconds: dict[str, list[float]]) -> list[str]:
    """Lines of a table of methods, the most accurate at the 95th percentile first."""
    lines = [
        "| method | s / MP | times the float32 matrix | median | 95th percentile | worst scene (95th) | no result |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, each in sorted(scores.items(), key=lambda item: pooled(item[1])[1]):
        median, high = pooled(each)
        by_scene = {s.scene: pooled([t for t in each if t.scene == s.scene])[1] for s in each if s.errors is not None}
        worst = max(by_scene, key=lambda scene: by_scene[scene])
        ratios = [a / b for a, b in zip(seconds[name], seconds[BASE], strict=True)]
        slower = f"{np.median(ratios):.1f} ({min(ratios):.1f}-{max(ratios):.1f})"
        refused = sum(s.errors is None for s in each)
        lines.append(
            f"| {name}{' *' * (name in SEE_THE_ANSWER)} | {np.median(seconds[name]):.4f} | {slower} "
            f"| {median:.2f} | {high:.1f} | {worst} ({by_scene[worst]:.1f}) | {refused or ''} |"
        )
    return lines


def by_scene(rows: list[dict[str, Score]]) -> list[str]:
    """Lines of a table of scenes, the worst first, for our own models."""
    shown = list(_ANALYZE)
    house = shown[0]
    scenes = sorted(
        {row[BASE].scene for row in rows},
        key=lambda scene: -pooled([row[house] for row in rows if row[house].scene == scene])[1],
    )
    lines = ["| scene | " + " | ".join(shown) + " |", "|" + "---|" * (1 + len(shown))]
    for scene in scenes:
        cells = []
        for name in shown:
            median, high = pooled([row[name] for row in rows if row[name].scene == scene])
            cells.append(f"{median:.2f} / {high:.1f}")
        lines.append(f"| {scene} | {' | '.join(cells)} |")
    return lines


def draw(panels: dict[str, dict[str, list[Score]]], seconds: dict[str, list[float]], path: Path) -> None:
    """Draw the chart: a panel for each group of scenes, a number for each method."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    names = sorted(seconds, key=lambda name: float(np.median(seconds[name])))
    figure, axes = plt.subplots(1, len(panels), figsize=(13, 7), sharey=True, sharex=True)
    for axis, (title, scores) in zip(axes, panels.items(), strict=True):
        place = np.log10([np.median(seconds[name]) for name in names])
        for number, name in enumerate(names, 1):
            median, high = pooled(scores[name])
            color = "tab:green" if name == SPECTRAL_NAME else "tab:blue" if name in OURS else "tab:red"
            x = 10 ** place[number - 1]
            axis.plot([x, x], [median, high], "-", color=color, lw=1.2, alpha=0.6)
            axis.plot(x, high, "_", color=color, ms=6)
            axis.plot(x, median, "o", color=color, ms=5, mfc="white" if name in SEE_THE_ANSWER else color)
            # Neighbors are drawn apart, so that no number covers another.
            before = number > 1 and place[number - 1] - place[number - 2] < 0.06
            after = number < len(names) and place[number] - place[number - 1] < 0.06
            shift = 5 * (int(before) - int(after))
            lift = 4 + 8 * (number % 2) * (before or after)
            axis.annotate(str(number), (x, high), (shift, lift), textcoords="offset points", ha="center", fontsize=8)
        axis.set(xscale="log", yscale="log", title=title, xlabel="seconds per megapixel")
        axis.grid(alpha=0.3, which="both")
    axes[0].set_ylabel("CIEDE2000: median (dot) to 95th percentile")
    legend = [f"{number}  {name}" for number, name in enumerate(names, 1)]
    rows = -(-len(legend) // 3)
    for column in range(3):
        text = "\n".join(legend[column * rows : (column + 1) * rows])
        figure.text(0.06 + 0.31 * column, 0.015, text, fontsize=8.5, va="bottom", family="monospace")
    title = "Speed against accuracy: ours (blue), spectral (green), others' (red; hollow: these see the true picture)"
    figure.suptitle(title, fontsize=12)
    figure.subplots_adjust(bottom=0.12 + 0.022 * rows, left=0.06, right=0.98, top=0.9, wspace=0.04)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main() -> None:
    """Measure, draw, and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--size", type=int, default=128)
    options.add_argument("--samples", type=int, default=64)
    options.add_argument("--rounds", type=int, default=7)
    given = options.parse_args()
    settings = Settings(size=given.size, samples=given.samples)
    small = Settings(size=64, samples=48)
    others = rivals.RIVALS
    seconds = times(others, given.rounds)
    panels, rows, sections = {}, [], []
    for title, scenes in (("well-behaved", WELL_BEHAVED), ("failures", FAILURES)):
        found = accuracy(scenes, OURS | others, settings)
        rows += found
        scores: dict[str, list[Score]] = {name: [row[name] for row in found] for name in found[0]}
        bands = spectral(SPECTRAL[title], small)
        panels[title] = scores | {SPECTRAL_NAME: bands[SPECTRAL_NAME]}
        ours, plain = (pooled(bands[name]) for name in (SPECTRAL_NAME, BASE))
        sections += [
            f"## {title.capitalize()}",
            "",
            *textwrap.wrap(f"Scenes: {', '.join(scenes)}; {len(found)} pairs of colors.", 118),
            "",
            *table(panels[title], seconds),
            "",
            *textwrap.wrap(
                f"The spectral method is measured on other renders, in 31 bands at {small.size} pixels, of "
                f"{' and '.join(SPECTRAL[title])}: {ours[0]:.2f} / {ours[1]:.1f}. On the same renders the {BASE} has "
                f"{plain[0]:.2f} / {plain[1]:.1f}.",
                118,
            ),
            "",
        ]
    scenes_table = by_scene(rows)
    draw(panels, seconds, DOCS / "figures" / "speed_accuracy.png")
    page = "\n".join(
        [
            "# Speed against accuracy",
            "",
            *textwrap.wrap(
                "Made by `uv run --group bench python -m dyehouse.benchmarks.speed_accuracy`. Accuracy is CIEDE2000 "
                "against a render of the product truly in the target color, over its interior "
                f"({given.size} pixels, {given.samples} samples); every ordered pair of four colors, or the scene's "
                "own color to each of them where that color is the difficulty (near white, near black, pale). "
                "Pictures are cut at 1, as photos are; pairs of which one is clipped at the reference itself are "
                f"left out. Every pair counts alike. Time is the median of {given.rounds} rounds on one megapixel, all "
                "methods in turn in every round; ratios are taken within rounds (smallest and largest in parentheses).",
                118,
            ),
            "",
            *textwrap.wrap(
                'Rows that begin with "analyze" include looking for the model, soft edges and warnings; the others are '
                "the arithmetic alone, given the reference color. Methods with an asterisk are given the true picture "
                "to take statistics from, which nobody has who needs a recoloring; the others are given its color at "
                "the reference pixel.",
                118,
            ),
            "",
            "![Time per megapixel against CIEDE2000](figures/speed_accuracy.png)",
            "",
            *sections,
            "## Scene by scene",
            "",
            f"Median / 95th percentile. The worst scene is {scenes_table[2].split()[1]}; it is the first.",
            "",
            *scenes_table,
            "",
        ]
    )
    (DOCS / "speed_accuracy.md").write_text(page)
    print(page)


if __name__ == "__main__":
    main()
