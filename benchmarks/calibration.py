"""Does the program know its error? Predicted against true error, and what a wrong footing costs.

    DYEHOUSE_CACHE=... uv run --group bench python -m dyehouse.benchmarks.calibration [--fit] [--size 128]

Every scene, every ordered pair of four colors, as the renderer gives it and through cameras. The truth is a render of
the product truly in the target color. A fixed half of the pairs is used to fit the weights of `core.confidence`
(`--fit` prints them); all figures that count are those of the other half. Writes docs/calibration.md and
docs/figures/calibration.png.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core import analyze, confidence, transfer
from ..core.errors import DyehouseError
from ..core.picture import Picture
from .camera import Camera
from .laboratory import RGB, Settings
from .speed_accuracy import COLORS, Pair, difference, pairs

DOCS = Path(__file__).resolve().parent.parent / "docs"

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
    warned
        Whether the analysis had anything to say.
    """

    scene: str
    source: str
    target: str
    camera: str
    model: str
    parts: Mapping[str, NDArray[np.float64]]
    errors: NDArray[np.float64]
    warned: bool

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
                    bool(analysis.warnings),
                )


# --- Fit --------------------------------------------------------------------------------------------------
def fit(learned: Sequence[Case]) -> dict[str, float]:
    """Weights that bring the predicted medians nearest to the true ones, by the mean of their absolute log ratios."""
    from scipy.optimize import minimize

    names = list(confidence.WEIGHTS)
    parts = np.array([[np.median(case.parts[name]) for name in names] for case in learned])
    true = np.log([max(case.median, 0.02) for case in learned])

    def misses(logs: NDArray) -> float:
        made = (parts**2) @ np.exp(2 * np.clip(logs, -6, 2))
        return float(np.abs(np.log(made + 1e-4) / 2 - true).mean())

    starts = (np.log(list(confidence.WEIGHTS.values())), np.full(len(names), -1.0))
    best = min((minimize(misses, start, method="Powell") for start in starts), key=lambda found: found.fun)
    return {name: float(np.exp(np.clip(log, -6, 2))) for name, log in zip(names, best.x, strict=True)}


def bounds(learned: Sequence[Case], weights: Mapping[str, float]) -> tuple[float, float]:
    """Factors under which 90 % of all pixels are: times their own prediction, and times their region's 90th of it."""
    every = [case.predicted(weights) for case in learned]
    own = np.concatenate([case.errors / made for case, made in zip(learned, every, strict=True)])
    region = np.concatenate([case.errors / np.quantile(made, 0.9) for case, made in zip(learned, every, strict=True)])
    return float(np.quantile(own, 0.9)), float(np.quantile(region, 0.9))


def flag_level(learned: Sequence[Case], weights: Mapping[str, float]) -> float:
    """Predicted median that is passed by all that is bad; a tenth lower, for those that were not seen."""
    bad = [float(np.median(case.predicted(weights))) for case in learned if case.median > BAD]
    return 0.9 * min(bad) if bad else confidence.FLAG


# --- Scores -----------------------------------------------------------------------------------------------
def rank_correlation(a: Sequence[float], b: Sequence[float]) -> float:
    """Spearman's coefficient."""
    ranks = [np.argsort(np.argsort(values)) for values in (a, b)]
    return float(np.corrcoef(*ranks)[0, 1])


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
    flagged = [m > confidence.FLAG for m in medians]
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
