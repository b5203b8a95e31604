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
        trial = Trial(case.scene, source, target, photo, truth, light, view, picture, light)
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


def _errors(trial: Trial, result: NDArray) -> NDArray[np.float64]:
    seen = Pair(*(getattr(trial, name) for name in ("scene", "source", "target", "photo", "truth")),
                trial.target_white, trial.view)  # fmt: skip
    return np.quantile(seen.errors(result), QUANTILES)


def _pooled(each: list[NDArray]) -> tuple[float, float]:
    return (float(np.median(each)), float(np.quantile(each, 0.95))) if each else (np.nan, np.nan)


# --- In 31 bands ------------------------------------------------------------------------------------------
def in_bands(scene: str, settings: Settings, names: tuple[str, ...] = ("blue", "red", "yellow")) -> dict[str, Any]:
    """The models on spectral renders, where the bounce is not a square of RGB."""
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
