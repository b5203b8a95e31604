"""The ladder of models: which one "auto" takes where, what it buys, what it costs.

    uv run --group bench python -m dyehouse.benchmarks.ladder [--size 128] [--samples 64]

Every figure compares a recolored render with a render of the product truly in the target color, over its interior.
The target is read from that render at the reference pixel. Writes docs/models.md and docs/figures/models_*.
"""

from __future__ import annotations

import argparse
import itertools
import textwrap
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Analysis, analyze, spectra, transfer
from ..core.colorspace import LINEAR_SRGB
from ..core.errors import DyehouseError
from ..core.picture import Picture
from . import laboratory, speed
from .camera import Camera
from .laboratory import BANDS, RGB, Settings
from .speed_accuracy import COLORS, QUANTILES, Pair, photograph
from .stability import read

DOCS = Path(__file__).resolve().parent.parent / "docs"

PALE: Mapping[str, RGB] = {"pink": (0.72, 0.50, 0.46), "beige": (0.42, 0.31, 0.22), "white": (0.80, 0.78, 0.74)}
NEUTRAL: Mapping[str, RGB] = {
    "white": (0.80, 0.78, 0.74),
    "beige": (0.388, 0.333, 0.279),
    "warm gray": (0.205, 0.18, 0.165),
    "gray": (0.18, 0.18, 0.18),
    "black": (0.012, 0.012, 0.014),
}
METALS: Mapping[str, RGB] = {"copper": (0.72, 0.30, 0.16), "gold": (0.9, 0.65, 0.25)}
TUNGSTEN = (1.83, 0.86, 0.27)

MODELS = ("body", "dichromatic", "auto")
BEST = "best A, B"


@dataclass(frozen=True)
class Case:
    """One line of the table: a scene, the colors it is recolored from, and how it is photographed.

    Attributes
    ----------
    title, scene
        What it is.
    bar
        Median and 95th percentile that were to be reached; None if there is no number.
    sources
        Colors to start from; None for every pair of `COLORS`.
    parameters
        Of the scene.
    camera
        That takes the source, which is noise-free without one.
    light
        (3,) of another light that the target is seen in; None for the same.
    """

    title: str
    scene: str
    bar: tuple[float, float] | None = None
    sources: Mapping[str, RGB] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    camera: Camera | None = None
    light: RGB | None = None


CASES = (
    Case("glossy mug", "mug", (0.2, 1.5)),
    Case("fabric on a cylinder", "fabric_cylinder", (0.2, 0.6)),
    Case("cloth in deep folds", "folds", (0.6, 4)),
    Case("the same, pale", "folds", (0.6, 4), PALE),
    Case("the same, pale, 8-bit camera", "folds", (0.6, 4), PALE, camera=Camera()),
    Case("almost gray mug", "mug", (2, 9), NEUTRAL),
    Case("the same, 8-bit camera", "mug", (2, 9), NEUTRAL, camera=Camera()),
    Case("almost gray fabric, 8-bit camera", "fabric_cylinder", (2, 9), NEUTRAL, camera=Camera()),
    Case("pale mug", "mug", None, {"pink": PALE["pink"]}),
    Case("the same, 8-bit camera", "mug", (0.5, 2), {"pink": PALE["pink"]}, camera=Camera()),
    Case("clipped highlights", "clipped", (0.25, 2)),
    Case("daylight and tungsten", "two_lights", (2.5, 12)),
    Case("the same, folds", "folds_mixed"),
    Case("recolored into tungsten light", "mug", (0.15, 0.9), light=TUNGSTEN),
    Case("metal, gray surroundings", "metal", (0.3, 1.5), parameters={"colored": False}),
    Case("copper and gold, gray surroundings", "metal", (0.3, 1.5), METALS, {"colored": False}),
    Case("metal, colored surroundings", "metal", (1.5, 4)),
    Case("copper and gold, colored surroundings", "metal", (1.5, 4), METALS),
    Case("satin", "satin"),
    Case("translucent mug", "translucent_mug"),
    Case("heather", "heather"),
)
"""The bars of the table; "the same" is the case above."""


@dataclass(frozen=True, eq=False)
class Trial(Pair):
    """A pair of photos, and the light of the second."""

    picture: Picture
    target_white: NDArray[np.float64]

    def analysis(self, model: str) -> Analysis:
        """Look at the photo, as a user does who clicks the reference pixel."""
        return analyze(self.picture, self.white, self.view.reference, self.view.mask, model)

    def recolored(self, analysis: Analysis) -> NDArray[np.float32]:
        """Photo in the color that the true picture has at the reference."""
        seen = read(Picture(self.truth), self.view.reference, self.target_white)
        return analysis.recolor(analysis.matte_target(seen, self.target_white), self.target_white)

    def best(self, analysis: Analysis) -> NDArray[np.float64]:
        """Picture by the A and B that fit both photos best: what the dichromatic model could do at most."""
        v = analysis.reference
        t = analysis.matte_target(read(Picture(self.truth), self.view.reference, self.target_white), self.target_white)
        both = np.concatenate([self.photo, self.truth], axis=2).reshape(-1, 6)
        terms = np.column_stack([np.concatenate([v, t]), np.concatenate([self.white, self.target_white])])
        a, b = np.linalg.lstsq(terms, both.T, rcond=None)[0]
        return (a[:, None] * t + b[:, None] * self.target_white).reshape(self.truth.shape)


def trials(case: Case, settings: Settings) -> Iterator[Trial]:
    """All pairs of colors of a case whose references can be read."""
    view = laboratory.view(case.scene, settings, **case.parameters)
    white = view.white() / view.white().max()
    light = white if case.light is None else np.array(case.light) / max(case.light)
    colors = dict(COLORS) | dict(case.sources or {})
    sources = list(case.sources or COLORS)
    photos = {n: photograph(case.scene, c, settings, cut=False, **case.parameters) for n, c in colors.items()}
    for source, target in itertools.product(sources, COLORS):
        if source == target:
            continue
        photo = np.minimum(photos[source], 1)
        picture = Picture(photo) if case.camera is None else Picture(case.camera.shoot(photos[source]), transfer.SRGB)
        truth = np.minimum(photos[target] * (light / white).astype(np.float32), 1)
        trial = Trial(case.scene, source, target, photo, truth, white, view, picture, light)
        if trial.readable:
            yield trial


def measure(case: Case, settings: Settings) -> tuple[dict[str, tuple[float, float]], Counter[str]]:
    """Median and 95th percentile of every model over the pairs of a case; and what "auto" took."""
    errors: dict[str, list[NDArray]] = {name: [] for name in (*MODELS, BEST)}
    taken: Counter[str] = Counter()
    for trial in trials(case, settings):
        for model in MODELS:
            try:
                analysis = trial.analysis(model)
            except DyehouseError:
                continue
            errors[model].append(_errors(trial, trial.recolored(analysis)))
            if model == "auto":
                taken[analysis.model] += 1
                errors[BEST].append(_errors(trial, trial.best(analysis)))
    return {name: _pooled(each) for name, each in errors.items()}, taken


def best_gain(case: Case, settings: Settings) -> tuple[float, float]:
    """Median and 95th percentile of one gain by channel that fits the true pictures best: nobody has it."""
    errors = []
    for trial in trials(case, settings):
        whole = trial.view.interior & (trial.photo.max(axis=2) < 1) & (trial.truth.max(axis=2) < 1)
        gain = np.median(trial.truth[whole] / np.maximum(trial.photo[whole], 1e-4), axis=0)
        errors.append(_errors(trial, np.minimum(trial.photo * gain, 1).astype(np.float32)))
    return _pooled(errors)


def _errors(trial: Trial, result: NDArray) -> NDArray[np.float64]:
    t = trial
    seen = Pair(t.scene, t.source, t.target, t.photo, t.truth, t.target_white, t.view)
    return np.quantile(seen.errors(result), QUANTILES)


def _pooled(each: list[NDArray]) -> tuple[float, float]:
    return (float(np.median(each)), float(np.quantile(each, 0.95))) if each else (np.nan, np.nan)


# --- In 31 bands ------------------------------------------------------------------------------------------
def in_bands(
    scene: str,
    settings: Settings,
    names: tuple[str, ...] = ("blue", "red", "yellow", "green", "orange", "light skin"),
) -> dict[str, Any]:
    """The models on spectral renders of dyes of a chart, where the bounce is not a square of RGB."""
    chart = spectra.chart("BabelColor Average")
    response = laboratory.response("1931", "D65") @ np.linalg.inv(LINEAR_SRGB.to_xyz).T
    view = laboratory.view(scene, settings)
    factors = {
        name: laboratory.measure(scene, np.clip(chart[name].at(BANDS), 0, 1), settings).factors(at=view.reference)
        for name in names
    }
    errors: dict[str, list[NDArray]] = {name: [] for name in (*MODELS, BEST)}
    white = np.ones(3)
    for source, target in itertools.permutations(names, 2):
        photo, truth = (np.minimum(factors[name] @ response, 1).astype(np.float32) for name in (source, target))
        trial = Trial(scene, source, target, photo, truth, white, view, Picture(photo), white)
        for model in MODELS:
            errors[model].append(_errors(trial, trial.recolored(trial.analysis(model))))
        errors[BEST].append(_errors(trial, trial.best(trial.analysis("auto"))))
    return {name: _pooled(each) for name, each in errors.items()}


# --- Cost -------------------------------------------------------------------------------------------------
def costs(rounds: int = 3, side: int = 2000) -> dict[str, tuple[float, float]]:
    """Time of looking at a photo and of one more colorway, in times those of the dichromatic model; medians."""
    photo = speed.test_picture(side, side)
    reference, target = photo[side // 2, side // 2].astype(np.float64), (0.02, 0.08, 0.2)
    models = ("dichromatic", "auto", "body", "regularized", "bounce", "lights", "metal")
    ratios: dict[str, list[tuple[float, float]]] = {model: [] for model in models}
    for k in range(rounds + 1):
        spent = {}
        for model in models:
            start = time.perf_counter()
            analysis = analyze(photo, np.ones(3), reference, None, model)
            analysis.recolor(target)
            first = time.perf_counter()
            analysis.recolor(target)
            spent[model] = first - start, time.perf_counter() - first
        if k:
            for model in models:
                ratios[model].append(tuple(np.divide(spent[model], spent["dichromatic"])))
    return {model: tuple(np.median(each, axis=0)) for model, each in ratios.items()}


# --- Page -------------------------------------------------------------------------------------------------
_WHEN = {
    "body": "the product has the color of the light",
    "dichromatic": "nothing below speaks against it: the paper's model",
    "regularized": "noise of the split into body and gloss is above 2 % of the light: B is smoothed along "
    "shading and "
    "shrunk to what the noise leaves of it",
    "bounce": "pixels are more saturated than the reference, as light that met the surface twice makes them: a third "
    "color rho^2 / (1 - K rho); K is found from the folds. Matte products need a matrix, glossy ones maps of B and C",
    "lights": "a fifth of the pixels leaves the plane of body and white, smoothly, and the product shines: the "
    "body color "
    "in a second light, on the line of black bodies, is the third color",
    "metal": "the same without highlights, or more bounce than surfaces make: each channel gets its own gain. Among "
    "gray things metal is a product with bounce, whose highlights have its own color",
}

_FAILS = (
    "**Metal among colored things.** A gain by channel is right where it mirrors them once. Its edges turn white, its "
    "walls mirror each other, and both are of the same three numbers as what is mirrored: the 95th percentile stays "
    "far over the bar. Through an 8-bit camera the metal may be taken for a product in two lights. It is flagged.",
    "**Gold in gray surroundings.** Clipped in two channels, and lit by itself many times over.",
    "**Pale products between two lights.** Lamp light on a pale product looks like gloss. Without a wide gap between "
    "body color and white the second light is not found (up to 30 off); what a second light would explain as well is "
    "flagged, through a camera not always.",
    "**Pale mug through an 8-bit camera.** Gloss and bounce move a pale color in almost opposite directions. Where "
    "noise could have made both, neither is believed: that keeps blotches away, and loses the faint gloss and bounce "
    "of the true picture, and the rim of small highlights. The true color at the reference would make it little better "
    "(0.51 against 0.56, mean of four noises).",
    "**Real folds.** The bounce is calculated channel by channel, which is exact for these renders and not for "
    "spectra: in 31 bands, on saturated cloth, it buys less (see above). A smooth spectrum uplifted from RGB (least "
    "slope) was tried and did no better, since pigments are not smooth.",
    "**A pale product clicked in its shade.** What a click holds of light that met the product before is found from "
    "the product's other colors and left out, as gloss is. Between gloss and bounce, in almost opposite directions on "
    "a pale product, that goes wrong: a tenth of the clicks on a pale mug is off by 4 or more, on white cloth between "
    "two lights by 20 to 50, and few of these are flagged (see calibration.md). Click an open, lit part.",
    "**Truly gray products.** Nothing tells gloss from body: highlights take the body color.",
    "**Satin and heather.** The sheen of satin is partly colored, and heather has two body colors. The plane of body "
    "and white holds what can be held.",
    "**Noise.** The light along the body color is left as it is, with its noise. Beyond some noise a second light and "
    "metal are seen in means of windows only: then the plain model is kept, and the result flagged.",
)

_DROPPED = (
    "A bounce map on every product was dropped: on fabric it turned the gloss between yarns into bounce (0.28 / 0.7 "
    "became 0.32 / 0.8). All three terms without a prior (the exact solution of three channels) are best on a clean "
    "glossy mug and 33 at the 95th percentile on pale folds. A gain by channel for everything that is not explained "
    "ruined folds in 31 bands (36.7, and 66 for saturated yellow cloth), so that it asks for pixels paler than the "
    "body color now. On metal among colored things, gloss and bounce beside the gain by channel were tried with "
    "priors as wide as the colors scatter: 19 to 21 at the 95th percentile against 11, since a mirrored board looks "
    "like either; and gloss at the limb alone, where metal turns white, by the distance from the outline or where the "
    "light would be implausible otherwise: 12.9 became 10.5 to 11.2, and 8.1 on copper and gold 8.1 to 12.5. A wider "
    "window around the reference was steadier on the pale mug (0.56 / 3.7 to 0.55 / 3.4, mean of four noises) and "
    "worse in pale folds (0.28 to 0.30). Smoothing that is judged in smaller windows bought 2 % at the rims of "
    "highlights. A reference found by the program without its shift to the matte edge was better on fabric (0.4 to "
    "0.25) and worse on mugs (0.1 to 1.1). A trimmed mean at the reference pixel kept other pixels of a texture in "
    "the photo than in the sample: weights that fall off slowly took fabric from 0.28 / 0.7 to what is above."
)


def draw(rows: Mapping[str, Mapping[str, tuple[float, float]]], path: Path) -> None:
    """Chart of the 95th percentiles, case by case."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axis = plt.subplots(figsize=(10, 0.36 * len(rows) + 1.4))
    marks = {"body": ("s", "tab:orange"), "dichromatic": ("o", "tab:red"), "auto": ("D", "tab:blue"), BEST: ("|", "k")}
    for k, row in enumerate(rows.values()):
        values = [row[name][1] for name in ("dichromatic", "auto")]
        axis.plot(values, [k, k], "-", color="0.8", lw=2, zorder=0)
    for name, (mark, color) in marks.items():
        axis.plot([row[name][1] for row in rows.values()], range(len(rows)), mark, color=color, ms=6, label=name)
    axis.set_yticks(range(len(rows)), rows)
    axis.invert_yaxis()
    axis.set(xscale="log", xlabel="CIEDE2000, 95th percentile")
    axis.grid(alpha=0.3, which="both", axis="x")
    axis.legend(loc="lower right", fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_folds(settings: Settings, path: Path) -> None:
    """Pale folds: photo, truth, and what three models make of it."""
    from PIL import Image

    case = Case("", "folds", sources={"pink": PALE["pink"]}, camera=Camera())
    trial = next(t for t in trials(case, settings) if t.target == "red")
    results = [trial.recolored(trial.analysis(model)) for model in ("body", "dichromatic", "auto")]
    side = trial.truth.shape[0]
    gap = np.full((side, side // 40, 3), 1, np.float32)
    shown = [trial.photo, *results, trial.truth]
    strip = np.concatenate([part for picture in shown for part in (picture, gap)][:-1], axis=1)
    Image.fromarray(transfer.encode(np.clip(strip, 0, 1), transfer.SRGB, np.uint8)).save(path, quality=90)


def _cells(pair: tuple[float, float]) -> str:
    return "-" if np.isnan(pair[0]) else f"{pair[0]:.2f} / {pair[1]:.1f}"


def main() -> None:
    """Measure, draw, and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--size", type=int, default=128)
    options.add_argument("--samples", type=int, default=64)
    given = options.parse_args()
    settings = Settings(size=given.size, samples=given.samples)
    rows, lines = {}, []
    base = ""
    for case in CASES:
        base = case.title if "the same" not in case.title else base
        title = case.title.replace("the same", base)
        rows[title], taken = measure(case, settings)
        bar = "-" if case.bar is None else f"{case.bar[0]:g} / {case.bar[1]:g}"
        models = ", ".join(f"{name} {count}" for name, count in taken.most_common())
        values = [_cells(rows[title][name]) for name in (*MODELS, BEST)]
        lines.append(f"| {title} | {' | '.join(values)} | {bar} | {models} |")
        print(lines[-1], flush=True)
    draw(rows, DOCS / "figures" / "models.png")
    draw_folds(Settings(size=256, samples=given.samples), DOCS / "figures" / "models_folds.jpg")
    bands = [
        f"| {scene} | {' | '.join(_cells(found[name]) for name in (*MODELS, BEST))} |"
        for scene in ("folds", "translucent_mug")
        for found in [in_bands(scene, settings)]
    ]
    gains = [_cells(best_gain(c, settings)) for c in CASES if c.scene == "metal" and not c.parameters]
    times = costs()
    price = {name: f"{times[name][0]:.1f} | {times[name][1]:.1f}" for name in times}
    page = [
        "# Models",
        "",
        *textwrap.wrap(
            "Made by `uv run --group bench python -m dyehouse.benchmarks.ladder`. A photo is looked at once; "
            '`model="auto"` takes the simplest model that leaves nothing beyond the noise, and `inspect` shows its '
            "evidence. Under every model a new target is one matrix, on the pixel and at most four maps of the "
            "photo.",
            118,
        ),
        "",
        "## Which, and what it costs",
        "",
        *textwrap.wrap(
            "Time for a 4-megapixel photo as a multiple of the dichromatic model's, looking and the first colorway "
            f'together, then any further one (medians of interleaved rounds; "auto" on a plain product: '
            f"{price['auto']}).",
            118,
        ),
        "",
        "| model | taken when | first | further |",
        "|---|---|---|---|",
        *(f"| {name} | {when} | {price[name]} |" for name, when in _WHEN.items()),
        "",
        *textwrap.wrap(
            "Clipped pixels are restored under all of them: the unclipped channels and the body's light nearby tell A "
            "and B; where highlights have the product's own color, they are A. Noise is estimated in the photo, across "
            "the body color, and is no less than codes and compression make; where it is large, means of windows are "
            "looked at.",
            118,
        ),
        "",
        "## What it buys",
        "",
        *textwrap.wrap(
            "CIEDE2000, median / 95th percentile against renders of the product truly in the target color, all "
            "pairs of a "
            f'case ({given.size} pixels, {given.samples} samples). "{BEST}" are the coefficients of the '
            f"dichromatic model "
            "that fit the true picture best: nobody has them. The last column counts what auto took.",
            118,
        ),
        "",
        "| case | " + " | ".join((*MODELS, BEST)) + " | bar | auto took |",
        "|" + "---|" * 7,
        *lines,
        "",
        *textwrap.wrap(
            "A gain by channel is what metal among colored things asks for. The best one, taken from the true "
            f"pictures, reaches {gains[0]}, on copper and gold {gains[1]}: the bars for them ask for more than that.",
            118,
        ),
        "",
        "![95th percentile, case by case](figures/models.png)",
        "",
        "Pale cloth through an 8-bit camera: photo; body, dichromatic, auto; the cloth truly in red:",
        "",
        "![Folds before and after](figures/models_folds.jpg)",
        "",
        "In 31 bands, where the bounce is not a function of RGB:",
        "",
        "| scene | " + " | ".join((*MODELS, BEST)) + " |",
        "|" + "---|" * 5,
        *bands,
        "",
        "## What still fails",
        "",
        *(textwrap.fill(f"- {text}", 118, subsequent_indent="  ") for text in _FAILS),
        "",
        "## What was tried and dropped",
        "",
        *textwrap.wrap(_DROPPED, 118),
        "",
    ]
    (DOCS / "models.md").write_text("\n".join(page))


if __name__ == "__main__":
    main()
