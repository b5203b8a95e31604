"""Does the program know its error? Predicted against true error, and what a wrong footing costs.

    DYEHOUSE_CACHE=... uv run --group bench python -m dyehouse.benchmarks.calibration [--fit] [--size 128]

Every scene, every ordered pair of four colors, as the renderer gives it and through cameras. The truth is a render of
the product truly in the target color. A fixed half of the pairs is used to fit the weights of `core.confidence`
(`--fit` prints them); all figures that count are those of the other half. Writes docs/calibration.md and
docs/figures/calibration.png.
"""

from __future__ import annotations

import argparse
import itertools
import textwrap
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import analyze, confidence, transfer
from ..core.colorspace import LINEAR_SRGB
from ..core.errors import DyehouseError, WhiteError
from ..core.neighborhood import dilate, erode
from ..core.picture import Picture
from ..core.recipe import light_colors
from ..core.reference import SURE_WHITE, reference_at, white_from_highlights
from . import laboratory
from .camera import Camera
from .laboratory import RGB, Settings
from .ladder import PALE
from .speed_accuracy import COLORS, FAILURES, WELL_BEHAVED, Pair, difference, pairs

DOCS = Path(__file__).resolve().parent.parent / "docs"

ANYWHERE = (
    *("mug", "fabric_cylinder", "sneaker", "mug_daylight", "color_bleeding"),
    *("folds", "folds_mixed", "translucent_mug", "satin", "heather"),
)
"""Scenes that are clicked anywhere."""

CAMERAS: Mapping[str, Camera | None] = {
    "float": None,
    "8 bits": Camera(),
    "noisy": Camera(electrons=3_000),
    "very noisy": Camera(electrons=1_000),
    "4 stops under": Camera(exposure=1 / 16),
    "JPEG": Camera(jpeg=95, subsampling="4:4:4"),
}
"""What stands between the scene and the program; None is the render itself."""

GOOD, BAD = 2.0, 5.0
"""Median CIEDE2000 up to which a result is good, and from which it has to be flagged."""

_PIXELS = 400


@dataclass(frozen=True, eq=False)
class Case:
    """One recolor: what was said before, and what came out.

    Attributes
    ----------
    scene, source, target, camera, model
        Names.
    parts
        What `Doubt.parts` found, at some pixels.
    errors
        (n,) true CIEDE2000 there.
    flagged
        Whether it was flagged.
    """

    scene: str
    source: str
    target: str
    camera: str
    model: str
    parts: Mapping[str, NDArray[np.float32]]
    errors: NDArray[np.float64]
    flagged: bool

    @property
    def held_out(self) -> bool:
        """Whether it takes no part in the fit: half of the pairs of every scene, all cameras of a pair together."""
        return zlib.crc32(f"{self.scene} {self.source} {self.target}".encode()) % 2 == 0

    @property
    def median(self) -> float:
        """True median."""
        return float(np.median(self.errors))

    def predicted(self, weights: Mapping[str, float] = confidence.WEIGHTS) -> NDArray[np.float64]:
        """(n,) predicted CIEDE2000."""
        return np.sqrt(sum((weights[name] * part) ** 2 for name, part in self.parts.items()))


def through(pair: Pair, camera: Camera | None) -> tuple[Picture, float]:
    """Take the pair's photo with a camera; the picture, and its exposure."""
    if camera is None:
        return Picture(pair.photo), 1.0
    curve = transfer.LINEAR if camera.curve == "linear" else transfer.SRGB
    return Picture(camera.shoot(pair.photo), curve), camera.exposure


def cases(
    scenes: Sequence[str],
    settings: Settings,
    cameras: Mapping[str, Camera | None] = CAMERAS,
    colors: Mapping[str, RGB] = COLORS,
) -> Iterator[Case]:
    """Every readable pair of the scenes through every camera; the target is read at the reference of the truth."""
    rng = np.random.default_rng(0)
    for scene in scenes:
        for pair in pairs(scene, settings, colors):
            if not pair.readable:
                continue
            rows, columns = np.nonzero(pair.view.interior)
            chosen = rng.choice(len(rows), min(_PIXELS, len(rows)), replace=False)
            for name, camera in cameras.items():
                picture, exposure = through(pair, camera)
                try:
                    analysis = analyze(picture, pair.white * exposure, pair.view.reference, pair.view.mask)
                except DyehouseError:
                    continue  # it refuses, which is an answer
                target = analysis.matte_target(pair.color(pair.truth) * exposure)
                at = rows[chosen], columns[chosen]
                made = np.minimum(analysis.recolor(target)[at] / exposure, 1)
                yield Case(
                    *(scene, pair.source, pair.target, name, analysis.model),
                    analysis.doubt(target).parts(*at),
                    difference(made, pair.truth[at], pair.white),
                    analysis.predicted(target).flagged,
                )


# --- Fit --------------------------------------------------------------------------------------------------
def fit(learned: Sequence[Case]) -> dict[str, float]:
    """Weights that bring the predicted medians nearest to the true ones, by the mean square of their log ratios.

    Found by going from weight to weight and trying larger and smaller ones, in steps that get finer.
    """
    names = list(confidence.WEIGHTS)
    parts = np.array([[np.median(case.parts[name]) for name in names] for case in learned])
    true = np.log([max(case.median, 0.03) for case in learned])

    def misses(logs: NDArray) -> float:
        made = (parts**2) @ np.exp(2 * logs)
        return float(((np.log(made + 1e-4) / 2 - true) ** 2).mean())

    best = np.full(len(names), -1.0)
    for step in (0.5, 0.2, 0.1, 0.05, 0.02):
        for _ in range(30):
            before = best
            for k in range(len(names)):
                tried = [best + step * shift * (np.arange(len(names)) == k) for shift in (0, -1, 1)]
                best = np.clip(min(tried, key=misses), -4, 2)
            if np.array_equal(best, before):
                break
    return {name: float(np.exp(log)) for name, log in zip(names, best, strict=True)}


def bounds(learned: Sequence[Case], weights: Mapping[str, float]) -> tuple[float, float]:
    """Factors under which 90 % of all pixels are: times their own prediction, and times their region's 90th of it."""
    every = [case.predicted(weights) for case in learned]
    own = np.concatenate([case.errors / made for case, made in zip(learned, every, strict=True)])
    region = np.concatenate([case.errors / np.quantile(made, 0.9) for case, made in zip(learned, every, strict=True)])
    return float(np.quantile(own, 0.9)), float(np.quantile(region, 0.9))


# --- Scores -----------------------------------------------------------------------------------------------
def rank_correlation(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's coefficient."""
    first, second = (np.argsort(np.argsort(values)).astype(float) for values in (a, b))
    return float(np.corrcoef(first, second)[0, 1])


@dataclass(frozen=True)
class Scores:
    """How well errors were predicted.

    Attributes
    ----------
    count
        Cases.
    correlation
        Spearman's coefficient of predicted and true medians.
    below_pixel, below_region
        Shares of pixels below their own bound, and below that of their region.
    bad, bad_flagged
        Cases of a true median over `BAD`, and how many of them are flagged.
    good, good_flagged
        The same of those under `GOOD`.
    """

    count: int
    correlation: float
    below_pixel: float
    below_region: float
    bad: int
    bad_flagged: int
    good: int
    good_flagged: int


def scores(found: Sequence[Case]) -> Scores:
    """Score the constants of `core.confidence` on cases."""
    made = [case.predicted() for case in found]
    medians, true = [float(np.median(m)) for m in made], [case.median for case in found]
    flagged = [case.flagged for case in found]
    own = np.concatenate([c.errors <= confidence.PIXEL_BOUND * m for c, m in zip(found, made, strict=True)])
    region = np.concatenate(
        [c.errors <= confidence.REGION_BOUND * np.quantile(m, 0.9) for c, m in zip(found, made, strict=True)]
    )
    bad, good = [t > BAD for t in true], [t < GOOD for t in true]
    return Scores(
        len(found),
        rank_correlation(medians, true),
        float(own.mean()),
        float(region.mean()),
        sum(bad),
        sum(f for f, b in zip(flagged, bad, strict=True) if b),
        sum(good),
        sum(f for f, g in zip(flagged, good, strict=True) if g),
    )


# --- Footing ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Click:
    """A click with gloss in it, and a target known as a flat swatch.

    Attributes
    ----------
    gloss
        True gloss of the pixel, as a share of the white.
    median, high
        CIEDE2000 of the recolor, median and 95th percentile.
    read_median, read_high
        The same if the pixel were taken as it is read.
    """

    gloss: float
    median: float
    high: float
    read_median: float
    read_high: float


def clicks(
    scene: str, settings: Settings, colors: Mapping[str, RGB] = COLORS, most: float = 0.05, draws: int = 10
) -> Iterator[Click]:
    """Click pixels of every amount of gloss up to `most`, and ask for the matte target color in their light."""
    rng = np.random.default_rng(0)
    for pair in pairs(scene, settings, colors):
        if not pair.readable:
            continue
        picture, mask = Picture(pair.photo), pair.view.mask
        to_terms, target = _terms(pair), pair.color(pair.truth)
        gloss = (pair.photo @ to_terms.T)[..., 1]
        able = pair.view.interior & (pair.photo.max(axis=2) < 1) & (pair.photo @ to_terms[0] > 0.25) & (gloss <= most)
        rows, columns = np.nonzero(able)
        # As many of much gloss as of little.
        step = np.digitize(gloss[able], np.linspace(0, most, draws + 1)[1:-1])
        for k in np.unique(step):
            at = int(rng.choice(np.flatnonzero(step == k)))
            pixel = int(columns[at]), int(rows[at])
            read = reference_at(picture, pixel, pair.white, mask).color
            strength, share = to_terms @ read
            flat = target * strength
            figures = []
            for reference in (pixel, read):
                errors = pair.errors(analyze(picture, pair.white, reference, mask).recolor(flat))
                figures += [float(np.median(errors)), float(np.quantile(errors, 0.95))]
            yield Click(float(share), *figures)


def from_each(scene: str, settings: Settings, colors: Mapping[str, RGB]) -> Iterator[Pair]:
    """From every color, the first pair that can be read."""
    seen = set()
    for pair in pairs(scene, settings, colors):
        if pair.source not in seen and pair.readable:
            seen.add(pair.source)
            yield pair


@dataclass(frozen=True)
class Anywhere:
    """A click anywhere on the lit product; the target is what a true sample shows at the same place.

    Attributes
    ----------
    scene, source
        Names.
    pixel
        (x, y).
    median
        CIEDE2000 of the recolor.
    flagged
        Whether the program says that it will be wrong.
    """

    scene: str
    source: str
    pixel: tuple[int, int]
    median: float
    flagged: bool


def anywhere(
    scene: str,
    settings: Settings,
    colors: Mapping[str, RGB],
    camera: Camera | None = None,
    draws: int = 12,
) -> Iterator[Anywhere]:
    """Click pixels that get a fifth of the light of the brightest or more, from every color to the next."""
    rng = np.random.default_rng(0)
    for pair in from_each(scene, settings, colors):
        picture, exposure = through(pair, camera)
        light = pair.photo.mean(axis=2)
        inside, whole = pair.view.interior, (pair.photo.max(axis=2) < 1) & (pair.truth.max(axis=2) < 1)
        rows, columns = np.nonzero(inside & (light > 0.2 * np.quantile(light[inside], 0.9)) & whole)
        for k in rng.choice(len(rows), draws, replace=False):
            pixel = int(columns[k]), int(rows[k])
            try:
                analysis = analyze(picture, pair.white * exposure, pixel, pair.view.mask)
            except DyehouseError:
                continue  # it refuses, which is an answer
            there = replace(pair, view=replace(pair.view, reference=pixel))
            target = analysis.matte_target(there.color(pair.truth) * exposure)
            made = np.minimum(analysis.recolor(target) / exposure, 1)
            flagged = analysis.predicted(target).flagged
            yield Anywhere(scene, pair.source, pixel, float(np.median(pair.errors(made))), flagged)


def _terms(pair: Pair) -> NDArray[np.float64]:
    """(2, 3): true A and B of a pixel of the photo, by its own reference."""
    return np.linalg.pinv(np.column_stack([pair.color(pair.photo), pair.white]))


@dataclass(frozen=True)
class Footing:
    """What it costs to let the program find the reference, or the white too, against the true ones.

    Attributes
    ----------
    scene, source
        Names.
    true, reference, both
        Median CIEDE2000 with the true footing, with the reference found, and with both found.
    asks
        Whether the program says that it is not sure, or refuses.
    """

    scene: str
    source: str
    true: float
    reference: float
    both: float
    asks: bool


def footings(scenes: Sequence[str], settings: Settings, colors: Mapping[str, RGB] = COLORS) -> Iterator[Footing]:
    """From every color to the next; targets are flat, in the light of the reference that is used."""
    lights = light_colors(LINEAR_SRGB)
    for scene in scenes:
        for pair in from_each(scene, settings, colors):
            picture = Picture(pair.photo)
            true, _ = _flat(picture, pair, pair.view.reference, pair.white)
            found, asks = _flat(picture, pair, None, pair.white)
            try:
                white, sure = white_from_highlights(picture, lights, pair.view.mask)
                both = _flat(picture, pair, None, white)[0]
                asks |= sure < SURE_WHITE
            except WhiteError:
                both, asks = found, True
            yield Footing(scene, pair.source, true, found, both, asks)


def _flat(picture: Picture, pair: Pair, reference: tuple[int, int] | None, white: NDArray) -> tuple[float, bool]:
    """Median error for a flat target in the light of the reference, and whether the program has doubts."""
    analysis = analyze(picture, white, reference, pair.view.mask)
    strength = 1.0 if reference else float(_terms(pair)[0] @ analysis.reference)
    target = pair.color(pair.truth) * strength
    median = float(np.median(pair.errors(analysis.recolor(target))))
    return median, bool(analysis.predicted(target).warnings)


@dataclass(frozen=True)
class Guess:
    """A white found in highlights: degrees away from the truth, and the confidence in it."""

    degrees: float
    confidence: float


GLOSSY = ("mug", "clipped", "color_bleeding", "satin", "translucent_mug", "sneaker", "fabric_cylinder", "metal")


def guesses(
    scenes: Sequence[str], settings: Settings, colors: Mapping[str, RGB] = COLORS, lights: int = 5
) -> tuple[list[Guess], int]:
    """Whites of products of every color in lights of many colors; and how often the program refuses."""
    locus = light_colors(LINEAR_SRGB)
    found, refused = [], 0
    for scene in scenes:
        view = laboratory.view(scene, settings)
        for dye in colors.values():
            for k in np.linspace(0.05, 0.95, lights):
                light = locus[int(k * (len(locus) - 1))]
                white = view.white(light).astype(float)
                picture = np.minimum(laboratory.render(scene, dye, light, settings) / white.max(), 1)
                for photo in (Picture(picture), Picture(Camera().shoot(picture), transfer.SRGB)):
                    try:
                        guess, sure = white_from_highlights(photo, locus, view.mask)
                    except WhiteError:
                        refused += 1
                        continue
                    cosine = guess @ white / np.linalg.norm(guess) / np.linalg.norm(white)
                    found.append(Guess(float(np.degrees(np.arccos(min(1.0, cosine)))), sure))
    return found, refused


# --- Edges ------------------------------------------------------------------------------------------------
SOLES: Mapping[str, RGB] = {"orange sole": (0.6, 0.25, 0.05), "teal sole": (0.05, 0.4, 0.3)}


def colored_ground(sole: RGB, settings: Settings, colors: Mapping[str, RGB] = COLORS) -> Iterator[Pair]:
    """Pairs of the sneaker, whose upper borders on a sole of this color."""
    view = laboratory.view("sneaker", settings)
    white = view.white()
    photos = {
        name: np.minimum(
            laboratory.render("sneaker", dye, settings=settings, colors={"sole": sole}) / np.float32(white.max()), 1
        )
        for name, dye in colors.items()
    }
    for source, target in itertools.permutations(colors, 2):
        yield Pair("sneaker", source, target, photos[source], photos[target], white / white.max(), view)


def wrong_mask(mask: NDArray[np.float32], wrong: int | None) -> NDArray[np.float32]:
    """A hard mask that is so many pixels too wide (or too tight, below zero); None for the true, soft one."""
    if wrong is None:
        return mask
    hard = mask > 0.5
    return (dilate(hard, wrong) if wrong > 0 else erode(hard, -wrong)).astype(np.float32)


def rim(pair: Pair, wrong: int | None, *, spill: bool = False, plain: bool = False) -> float:
    """95th percentile of the errors in the three pixels inside the outline, as far as the product is in them.

    `plain` blends the recolored pixel with the old one by the coverage, for comparison.
    """
    true = pair.view.mask
    band = (true > 0.02) & ~erode(true > 0.999, 3)
    mask = wrong_mask(true, wrong)
    analysis = analyze(pair.photo, pair.white, pair.color(pair.photo), mask, spill=spill)
    target = pair.color(pair.truth)
    made = analysis.recolor(target)
    if plain:
        whole = analyze(pair.photo, pair.white, pair.color(pair.photo), model="dichromatic").recolor(target)
        made = mask[..., None] * whole + (1 - mask[..., None]) * pair.photo
    return float(np.quantile(difference(np.minimum(made[band], 1), pair.truth[band], pair.white), 0.95))


def surround(pair: Pair, *, spill: bool) -> tuple[float, float]:
    """Median and 95th percentile of the errors outside the product."""
    outside = ~dilate(pair.view.mask > 0.001, 1)
    analysis = analyze(pair.photo, pair.white, pair.color(pair.photo), pair.view.mask, spill=spill)
    made = analysis.recolor(pair.color(pair.truth))
    errors = difference(np.minimum(made[outside], 1), pair.truth[outside], pair.white)
    return float(np.median(errors)), float(np.quantile(errors, 0.95))


# --- Page -------------------------------------------------------------------------------------------------
def draw(found: Sequence[Case], path: Path) -> None:
    """Draw predicted against true medians, and how often pixels are below multiples of their prediction."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.4))
    colors = plt.get_cmap("tab10")
    for k, camera in enumerate(dict.fromkeys(case.camera for case in found)):
        chosen = [case for case in found if case.camera == camera]
        made = [float(np.median(case.predicted())) for case in chosen]
        left.plot(made, [c.median for c in chosen], ".", ms=4, color=colors(k), label=camera)
        shares = np.linspace(0.05, 0.99, 60)
        ratios = np.concatenate([c.errors / c.predicted() for c in chosen])
        right.plot(np.quantile(ratios, shares), shares, color=colors(k), label=camera)
    ends = [0.03, 40]
    left.plot(ends, ends, "k-", lw=0.7)
    left.axvline(confidence.FLAG, color="k", lw=0.7, ls=":")
    left.axhline(BAD, color="k", lw=0.7, ls=":")
    left.set(xscale="log", yscale="log", xlim=ends, ylim=[0.015, 40])
    left.set(xlabel="predicted median CIEDE2000", ylabel="true median", title="Held-out recolors")
    right.plot([1, 1], [0, 0.5], "k:", lw=0.7)
    right.plot([confidence.PIXEL_BOUND] * 2, [0, 0.9], "k:", lw=0.7)
    right.set(xscale="log", xlim=[0.05, 20], xlabel="true error / predicted error of the pixel", ylim=[0, 1])
    right.set(ylabel="share of pixels below", title="Reliability: half at 1, nine tenths at the bound")
    for axis in (left, right):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _row(name: str, s: Scores) -> str:
    return (
        f"| {name} | {s.count} | {s.correlation:.2f} | {s.below_pixel:.0%} | {s.below_region:.0%} "
        f"| {s.bad_flagged} of {s.bad} | {s.good_flagged} of {s.good} |"
    )


def _predictions(found: Sequence[Case]) -> list[str]:
    held, learned = [c for c in found if c.held_out], [c for c in found if not c.held_out]
    lines = [
        "| cases | number | rank correlation | pixels below their bound | below their region's "
        f"| median over {BAD:.0f} flagged | median under {GOOD:.0f} flagged |",
        "|---|---|---|---|---|---|---|",
        _row("**held out**", scores(held)),
        _row("fitted", scores(learned)),
    ]
    lines += [_row(f"held out, {name}", scores([c for c in held if c.camera == name])) for name in CAMERAS]
    missed = sorted((c for c in found if c.median > BAD and not c.flagged), key=lambda c: -c.median)
    lines += ["", "Not flagged though they should be, fitted or held out:", ""]
    lines += [
        f"- {c.scene}, {c.source} to {c.target}, {c.camera}: {c.median:.1f}, predicted "
        f"{np.median(c.predicted()):.1f} (model {c.model})"
        for c in missed
    ] or ["- none"]
    return lines


def _scene_table(found: Sequence[Case]) -> list[str]:
    lines = ["| scene | predicted, float | true, float | predicted, cameras | true, cameras |", "|---|---|---|---|---|"]
    for scene in dict.fromkeys(case.scene for case in found):
        cells = []
        for clean in (True, False):
            chosen = [c for c in found if c.scene == scene and (c.camera == "float") == clean]
            cells += [f"{np.median([np.median(c.predicted()) for c in chosen]):.2f}"] if chosen else ["-"]
            cells += [f"{np.median([c.median for c in chosen]):.2f}"] if chosen else ["-"]
        lines.append(f"| {scene} | {' | '.join(cells)} |")
    return lines


def _click_table(settings: Settings) -> list[str]:
    lines = ["| scene | gloss | median / 95th | taken as read |", "|---|---|---|---|"]
    for scene in ("mug", "mug_daylight", "sneaker", "fabric_cylinder"):
        every = list(clicks(scene, settings))
        for low, high in ((-1.0, 0.005), (0.005, 0.015), (0.015, 0.03), (0.03, 0.06)):
            chosen = [c for c in every if low < c.gloss <= high]
            if chosen:
                mean = np.mean([[c.median, c.high, c.read_median, c.read_high] for c in chosen], axis=0)
                lines.append(
                    f"| {scene} | {max(low, 0):.1%} to {high:.1%} | {mean[0]:.2f} / {mean[1]:.1f} "
                    f"| {mean[2]:.2f} / {mean[3]:.1f} |"
                )
    return lines


def _anywhere_table(scenes: Sequence[str], settings: Settings) -> list[str]:
    lines = [
        "| scene | strong colors | through a camera | pale colors | through a camera | flagged over 5 | under 2 |",
        "|---|---|---|---|---|---|---|",
    ]
    every: list[Anywhere] = []
    for scene in scenes:
        cells, here = [], []
        for colors, camera in itertools.product((COLORS, {"blue": COLORS["blue"], **PALE}), (None, Camera())):
            found = [c for c in anywhere(scene, settings, colors, camera) if (c.source in PALE) == ("pink" in colors)]
            errors = [c.median for c in found]
            cells.append("{:.2f} / {:.1f}".format(*np.quantile(errors, (0.5, 0.9))) if errors else "-")
            here += found
        every += here
        lines.append(f"| {scene} | {' | '.join(cells)} | {_flags(here)} |")
    return [*lines, f"| **all** | | | | | {_flags(every)} |"]


def _flags(found: Sequence[Anywhere]) -> str:
    bad, good = [c for c in found if c.median > 5], [c for c in found if c.median < 2]
    return " | ".join(f"{sum(c.flagged for c in those)} of {len(those)}" for those in (bad, good))


def _footing_table(scenes: Sequence[str], settings: Settings, colors: Mapping[str, RGB] = COLORS) -> list[str]:
    lines = ["| scene | true footing | reference found | white found too | asks |", "|---|---|---|---|---|"]
    every = [f for f in footings(scenes, settings, colors) if colors is COLORS or f.source in PALE]
    for scene in dict.fromkeys(f.scene for f in every):
        chosen = [f for f in every if f.scene == scene]
        figures = np.mean([[f.true, f.reference, f.both] for f in chosen], axis=0)
        lines.append(
            f"| {scene} | {' | '.join(f'{v:.2f}' for v in figures)} | {sum(f.asks for f in chosen)} of {len(chosen)} |"
        )
    return lines


def _white_table(settings: Settings) -> list[str]:
    found, refused = guesses(GLOSSY, settings)
    lines = ["| confidence | number | within 3 degrees | median | worst |", "|---|---|---|---|---|"]
    for low, high in ((0, 0.4), (0.4, SURE_WHITE), (SURE_WHITE, 0.85), (0.85, 1.0)):
        chosen = [g.degrees for g in found if low <= g.confidence < high]
        if chosen:
            lines.append(
                f"| {low:.0%} to {high:.0%} | {len(chosen)} | {np.mean(np.array(chosen) < 3):.0%} "
                f"| {np.median(chosen):.1f} | {max(chosen):.1f} |"
            )
    return [*lines, "", f"In {refused} more pictures there is nothing to learn from, and the program says so."]


def _edge_table(settings: Settings) -> list[str]:
    grounds: dict[str, list[Pair]] = {
        "mug, gray table": list(pairs("mug", settings)),
        "fabric, gray table": list(pairs("fabric_cylinder", settings)),
        **{f"sneaker, {name}": list(colored_ground(sole, settings)) for name, sole in SOLES.items()},
    }
    columns: dict[str, dict[str, Any]] = {
        "blended": {"wrong": None, "plain": True},
        "soft mask": {"wrong": None},
        "hard mask": {"wrong": 0, "spill": True},
        "1 too tight": {"wrong": -1, "spill": True},
        "2 too tight": {"wrong": -2, "spill": True},
        "2 too wide": {"wrong": 2},
    }
    lines = [f"| ground | {' | '.join(columns)} |", "|" + "---|" * (1 + len(columns))]
    for name, chosen in grounds.items():
        cells = [f"{np.mean([rim(p, **how) for p in chosen if p.readable]):.1f}" for how in columns.values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    lines += ["", "| surround | left alone | with spill |", "|---|---|---|"]
    for scene in ("color_bleeding", "mug", "folds"):
        chosen = [p for p in pairs(scene, settings) if p.readable]
        cells = [
            "{:.2f} / {:.1f}".format(*np.mean([surround(p, spill=s) for p in chosen], axis=0)) for s in (False, True)
        ]
        lines.append(f"| {scene} | {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Measure, draw, and write the page; or fit."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--size", type=int, default=128)
    options.add_argument("--samples", type=int, default=64)
    options.add_argument("--fit", action="store_true", help="fit the weights, print them and stop")
    given = options.parse_args()
    settings, scenes = Settings(size=given.size, samples=given.samples), (*WELL_BEHAVED, *FAILURES)
    found = list(cases(scenes, settings))
    if given.fit:
        learned = [case for case in found if not case.held_out]
        weights = fit(learned)
        print("WEIGHTS =", {name: round(value, 2) for name, value in weights.items()})
        print("PIXEL_BOUND, REGION_BOUND = {:.1f}, {:.1f}".format(*bounds(learned, weights)))
        return
    draw([case for case in found if case.held_out], DOCS / "figures" / "calibration.png")

    def paragraph(text: str) -> list[str]:
        return [*textwrap.wrap(" ".join(text.split()), 118), ""]

    page = [
        "# Does it know its error?",
        "",
        *paragraph(
            f"""Made by `uv run --group bench python -m dyehouse.benchmarks.calibration`. CIEDE2000 against renders of
            the product truly in the target color, over its interior ({given.size} pixels, {given.samples} samples)."""
        ),
        "## Predicted error",
        "",
        *paragraph(
            f"""Every scene, every ordered pair of four colors, as the renderer gives it and through
            {len(CAMERAS) - 1} cameras: 8 bits; noisy (3000 electrons in a full pixel); very noisy (1000); "4 stops
            under", 8 bits; JPEG of quality 95. The truth is always free of noise. A half of the pairs, drawn by a hash
            of their names, was used to fit the weights and bounds of `core/confidence.py` (`--fit` prints them); the
            other half is held out, but it is of the same scenes. The 90 % bound of a pixel is
            {confidence.PIXEL_BOUND:.1f} times its predicted error, that of a region {confidence.REGION_BOUND:.1f} times
            its 90th percentile. Flagged is what is predicted to have a median over {confidence.FLAG:g}, or hangs on
            the choice of the model for metal or two lights, or departs from the plain model in a way that noise
            hides, or was clicked on another color than most of its region."""
        ),
        *_predictions(found),
        "",
        "![Predicted against true error](figures/calibration.png)",
        "",
        *paragraph("Medians over the pairs of each scene:"),
        *_scene_table(found),
        "",
        *paragraph(
            """What is seen too little: light through a thin wall looks like a more saturated body, which is told in
            words and not in the figure; a contrast curve that nobody undid looks like another shading; and what
            JPEG did to a texture is not noise, so that the prediction is too low there."""
        ),
        "## A click with gloss in it",
        "",
        *paragraph(
            """The target is a flat swatch in the light of the clicked pixel. The gloss of the pixel is found from the
            matte pixels of its material and left out of the reference; "taken as read" is without that."""
        ),
        *_click_table(settings),
        "",
        "## A click anywhere",
        "",
        *paragraph(
            """Clicks on any pixel that gets a fifth of the light of the brightest or more: in folds, in highlights, on
            what lies beside; the target is what a true sample shows at the same place. Median over the product, half
            and 90 % of the clicks, from every color to the next: four strong colors; pink, beige and white."""
        ),
        *_anywhere_table(ANYWHERE, settings),
        "",
        "## Reference and white found by the program",
        "",
        *paragraph(
            f"""Median over the product, mean of four colors, flat targets. It asks if it warns, flags the result, is
            less than {SURE_WHITE:.0%} sure of the white, or refuses to look for one."""
        ),
        *_footing_table(scenes, settings),
        "",
        "The same in pink, beige and white:",
        "",
        *_footing_table(ANYWHERE, settings, {"blue": COLORS["blue"], **PALE}),
        "",
        "Whites from highlights, of eight scenes in four colors under five lights, as float and through a camera:",
        "",
        *_white_table(settings),
        "",
        "## Edges and spill",
        "",
        *paragraph(
            """95th percentile in the three pixels inside the outline, mean of the pairs. "Blended" is what alpha
            blending leaves. Hard masks and those that are too tight are used with `spill`, which lets pixels outside
            the mask change."""
        ),
        *_edge_table(settings),
        "",
    ]
    (DOCS / "calibration.md").write_text("\n".join(page))
    print("\n".join(page))


if __name__ == "__main__":
    main()
