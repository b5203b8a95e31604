"""Stability: how the error grows with everything that can be wrong with a photo, a product or a click.

    uv run --group bench python -m dyehouse.benchmarks.stability [--size 128] [--samples 64]

Every curve varies one thing and compares the recolored render with a render of the product truly in the target color.
At every point it also says what the method should have done, by the measurement, and what it does. Writes
docs/stability.md and docs/figures/stability_*.png.
"""

from __future__ import annotations

import argparse
import textwrap
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core import Analysis, analyze, colorimetry, transfer
from ..core.colorspace import LINEAR_SRGB
from ..core.errors import DyehouseError, ReferenceColorError
from ..core.neighborhood import erode
from ..core.picture import Picture
from ..core.reference import matte_reference, read_window, reference_at
from . import laboratory
from .camera import Camera
from .laboratory import RGB, Settings
from .speed_accuracy import COLORS, Pair, difference, pairs, photograph

DOCS = Path(__file__).resolve().parent.parent / "docs"

MEDIAN_LIMIT, HIGH_LIMIT = 2.0, 10.0
"""CIEDE2000 from which a result should be refused, or the user told: median, 95th percentile."""

NOTHING, WARNS, FALLS_BACK, REFUSES = "", "warns", "takes another model", "refuses"
SOURCES = ("red", "blue")
TARGETS: Mapping[str, RGB] = COLORS
"""Colors of most curves: from each of the one to each other of these."""

READ_THERE = "read at the reference pixel of a real sample, with its gloss"
SWATCH = "flat swatch, in the light of the true reference"
SWATCH_ANYWHERE = "flat swatch, in whatever light the reference has"
"""What a target may be."""

type Pixel = tuple[int, int]


# --- One recolor ------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Trial:
    """What the program is given, and what is true.

    Attributes
    ----------
    picture
        The photo as the program gets it.
    white, pixel, target, mask
        What the user says: white of the light, reference pixel (None: the program finds one), target color, coverage.
    clean, truth
        (H, W, 3) linear RGB without fault, in the source's and in the target's color.
    true_white, true_pixel
        White of the light, and a pixel that is matte indeed.
    where
        (H, W) bool: pixels that count.
    exposure
        Of the picture, against `clean`.
    means
        What the target is: READ_THERE, SWATCH or SWATCH_ANYWHERE.
    """

    picture: Picture
    white: NDArray[np.float64]
    pixel: Pixel | None
    target: NDArray[np.float64]
    mask: NDArray
    clean: NDArray[np.float32]
    truth: NDArray[np.float32]
    true_white: NDArray[np.float64]
    true_pixel: Pixel
    where: NDArray[np.bool_]
    exposure: float = 1.0
    means: str = READ_THERE

    def asked(self, analysis: Analysis) -> NDArray[np.float64]:
        """(3,) target as the program is given it, for the reference that it has."""
        if self.means == READ_THERE:
            return analysis.matte_target(self.target)
        if self.means == SWATCH:
            return self.target
        matte = read(Picture(self.clean), self.true_pixel, self.true_white)
        return self.target * float(analysis.reference @ matte / (matte @ matte))


def faultless(pair: Pair) -> Trial:
    """A trial with nothing wrong, to be spoiled with `dataclasses.replace`."""
    view, photo = pair.view, Picture(pair.photo)
    target = read(Picture(pair.truth), view.reference, pair.white)
    return Trial(
        *(photo, pair.white, view.reference, target, view.mask),
        *(pair.photo, pair.truth, pair.white, view.reference, view.interior),
    )


def read(picture: Picture, pixel: Pixel, white: NDArray) -> NDArray[np.float64]:
    """(3,) color at a pixel, as the program reads it, also where it would refuse to."""
    try:
        return reference_at(picture, pixel, white).color
    except ReferenceColorError:
        return read_window(picture, pixel).mean(axis=0, dtype=np.float64)


def seen(trial: Trial) -> NDArray[np.float64]:
    """(3,) color at the trial's reference, gloss and all, as the plain models take it."""
    if trial.pixel is None:
        return matte_reference(trial.picture, trial.white, trial.mask).color
    return read(trial.picture, trial.pixel, trial.white)


@dataclass(frozen=True)
class Outcome:
    """How a trial, or several together, came out.

    Attributes
    ----------
    median, high, mean
        CIEDE2000 of the dichromatic model over the pixels; `high` is the 95th percentile.
    body_median, body_high, body_mean
        The same of body reflection alone.
    auto_median, auto_high, auto_mean
        The same of the model that the program takes by itself, with the gloss in the reference that it finds; where
        it refuses, of the model that it takes when the color is given instead.
    A, B
        Median error of the coefficients of the dichromatic model; A relative to the color at the true reference. True
        are those that fit both true renders best.
    does
        What `analyze` does by itself: nothing, warns, takes another model than the dichromatic one, or refuses.
    """

    median: float
    high: float
    mean: float
    body_median: float
    body_high: float
    body_mean: float
    auto_median: float
    auto_high: float
    auto_mean: float
    A: float
    B: float
    does: str

    @property
    def should(self) -> str:
        """What it should do, by the measurement."""
        medians, highs = (self.median, self.body_median, self.auto_median), (self.high, self.body_high, self.auto_high)
        if min(medians) > MEDIAN_LIMIT or min(highs) > HIGH_LIMIT:
            return REFUSES
        return FALLS_BACK if min(self.body_mean, self.auto_mean) < 0.9 * self.mean else NOTHING


def outcome(trials: Iterable[Trial]) -> Outcome:
    """Run trials and take the mean of their figures; what it does is what it does mostly."""
    figures, deeds = [], []
    for trial in trials:
        try:
            auto = analyze(trial.picture, trial.white, trial.pixel, trial.mask)
            deeds.append(FALLS_BACK if auto.model != "dichromatic" else WARNS if auto.warnings else NOTHING)
        except DyehouseError:
            deeds.append(REFUSES)
            auto = None
        v = seen(trial)
        row: list[float] = []
        for model in ("dichromatic", "body", "auto"):
            given = auto if model == "auto" else None
            analysis = given or analyze(trial.picture, trial.white, v, trial.mask, model)
            result = analysis.recolor(trial.asked(analysis))[trial.where] / trial.exposure
            errors = difference(result, trial.truth[trial.where], trial.true_white)
            row += [float(np.median(errors)), float(np.quantile(errors, 0.95)), float(errors.mean())]
            if model == "dichromatic":
                coefficients = analysis.A[trial.where], analysis.B[trial.where]
        figures.append([*row, *_coefficient_errors(trial, v, *coefficients)])
    names = [each.name for each in fields(Outcome)][:-1]
    means = dict(zip(names, (float(f) for f in np.mean(figures, axis=0)), strict=True))
    return Outcome(does=Counter(deeds).most_common(1)[0][0], **means)


def _coefficient_errors(trial: Trial, v: NDArray, a: NDArray, b: NDArray) -> tuple[float, float]:
    white = trial.true_white
    one, two = (read(Picture(p), trial.true_pixel, white) for p in (trial.clean, trial.truth))
    system = np.column_stack([np.concatenate([one, two]), np.concatenate([white, white])])
    pixels = np.concatenate([trial.clean[trial.where], trial.truth[trial.where]], axis=1).astype(np.float64)
    true_a, true_b = np.linalg.lstsq(system, pixels.T, rcond=None)[0]
    # A counts in units of its own reference, B in those of the white: both are turned into light.
    scale = np.linalg.norm(v) / trial.exposure / np.linalg.norm(one)
    shine = np.linalg.norm(trial.white) / trial.exposure / np.linalg.norm(white)
    return float(np.median(np.abs(a * scale - true_a))), float(np.median(np.abs(b * shine - true_b)))


# --- Curves -----------------------------------------------------------------------------------------------
@dataclass
class Series:
    """One line of a curve: outcomes against x."""

    name: str
    points: list[tuple[float, Outcome]] = field(default_factory=list)

    def add(self, x: float, trials: Iterable[Trial]) -> None:
        """Measure a point."""
        self.points.append((float(x), outcome(trials)))


@dataclass(frozen=True)
class Curve:
    """Series that belong together, and what is said of them."""

    title: str
    axis: str
    series: list[Series]
    log: bool = False


def _trials(scene: str, settings: Settings) -> list[Trial]:
    """Faultless trials of a scene: from red and from blue to all others."""
    return [faultless(p) for p in pairs(scene, settings, TARGETS, cut=False) if p.source in SOURCES]


def source_chroma(
    settings: Settings,
    chromas: Sequence[float] = (2, 3, 5, 7, 10, 14, 20, 32, 48),
    hues: Mapping[str, float] | None = None,
) -> Curve:
    """How colored the product is, at L* 50; by the CIELAB hues of a pink and of a blue."""
    series = []
    for name, hue in (hues or {"pink": 20.0, "blue": 270.0}).items():
        exact, camera = Series(f"{name}, float"), Series(f"{name}, 8-bit camera")
        for chroma in chromas:
            angle = np.radians(hue)
            lab = np.array([50.0, chroma * np.cos(angle), chroma * np.sin(angle)])
            xyz = colorimetry.lab_to_xyz(lab, LINEAR_SRGB.white)
            dye = np.clip(colorimetry.xyz_to_linear(xyz, LINEAR_SRGB), 0.002, 1)
            photo = photograph("mug", dye, settings, cut=False)
            view = laboratory.view("mug", settings)
            trials = [
                faultless(
                    Pair("mug", name, to, photo, photograph("mug", COLORS[to], settings, cut=False), np.ones(3), view)
                )
                for to in TARGETS
            ]
            exact.add(chroma, trials)
            camera.add(chroma, [through(t, Camera()) for t in trials])
        series += [exact, camera]
    return Curve("Color of the product", "CIELAB chroma of the source", series, log=True)


def through(trial: Trial, camera: Camera) -> Trial:
    """Take the trial's photo with a camera; the target stays what it is, in the camera's exposure."""
    curve = transfer.LINEAR if camera.curve == "linear" else transfer.SRGB
    picture = Picture(camera.shoot(trial.clean), curve)
    return replace(trial, picture=picture, target=trial.target * camera.exposure, exposure=camera.exposure)


def noise(settings: Settings, electrons: Sequence[float] = (1e6, 1e5, 3e4, 1e4, 3e3, 1e3, 300)) -> Curve:
    """Noise of the sensor, without quantization."""
    series = []
    for scene in ("mug", "fabric_cylinder"):
        line = Series(scene)
        trials = _trials(scene, settings)
        for full in electrons:
            camera = Camera(electrons=full, bits=16, curve="linear", exposure=0.5)
            level = 100 * np.sqrt(0.2 * 0.5 / full + (camera.read_noise / full) ** 2) / (0.2 * 0.5)
            line.add(level, [through(t, camera) for t in trials])
        series.append(line)
    return Curve("Noise", "noise at 20 % gray, in % of it", series, log=True)


def bit_depth(settings: Settings, bits: Sequence[int] = (4, 5, 6, 7, 8, 10, 12, 16)) -> Curve:
    """Steps of the file, without noise; x is bits for each channel."""
    series = []
    for name, curve in (("sRGB codes", transfer.SRGB), ("linear codes", transfer.LINEAR)):
        line = Series(name)
        trials = _trials("mug", settings)
        for depth in bits:
            top = 2**depth - 1

            def quantized(pixels: NDArray, top: int = top, curve: transfer.Curve = curve) -> Picture:
                codes = np.floor(np.asarray(curve.encode(np.clip(pixels, 0, 1))) * top + 0.5) / top
                return Picture(np.asarray(curve.decode(codes), np.float32))

            line.add(depth, [replace(t, picture=quantized(t.clean)) for t in trials])
        series.append(line)
    return Curve("Bit depth", "bits per channel", series)


def exposure(settings: Settings, stops: Sequence[float] = (-7, -6, -5, -4, -3, -2, -1, 0, 1, 2)) -> Curve:
    """Exposure of an 8-bit camera: noise and steps below, clipping above; compared with the unclipped truth."""
    series = []
    for scene in ("mug", "fabric_cylinder"):
        line = Series(scene)
        trials = _trials(scene, settings)
        for stop in stops:
            line.add(stop, [through(t, Camera(exposure=2.0**stop)) for t in trials])
        series.append(line)
    return Curve("Exposure and clipping", "stops (0: white is 1)", series)


def tone_curve(
    settings: Settings, exponents: Sequence[float] = (0.7, 0.8, 0.9, 0.95, 1, 1.05, 1.1, 1.25, 1.5)
) -> Curve:
    """A tone curve that nobody undoes: photo and truth both went through it and are compared as they look."""

    def s_curve(x: NDArray, s: float) -> NDArray:
        return x**s / (x**s + (1 - x) ** s)

    series = []
    for name, shape in (("S-curve", s_curve), ("gamma", lambda x, s: x**s)):
        line = Series(name)
        trials = _trials("mug", settings)
        for exponent in exponents:

            def toned(
                pixels: NDArray, exponent: float = exponent, shape: Callable[[NDArray, float], NDArray] = shape
            ) -> NDArray[np.float32]:
                codes = np.asarray(transfer.SRGB.encode(np.clip(pixels, 0, 1)), np.float64)
                return np.asarray(transfer.SRGB.decode(shape(codes, exponent)), np.float32)

            spoiled = []
            for t in trials:
                truth = toned(t.truth)
                target = read(Picture(truth), t.true_pixel, t.white)
                spoiled.append(replace(t, picture=Picture(toned(t.clean)), truth=truth, target=target))
            line.add(exponent, spoiled)
        series.append(line)
    return Curve("Tone curve not undone", "exponent of the curve (1: none)", series)


def contamination(settings: Settings, shares: Sequence[float] = (0, 0.005, 0.01, 0.02, 0.04, 0.07, 0.1, 0.2)) -> Curve:
    """Gloss in the reference; the target a flat swatch, or read at the same place of a real sample."""
    flat, same = Series("flat swatch"), Series("sample, same place")
    for share in shares:
        glossy, read_too = [], []
        for t in _trials("mug", settings):
            x, y = t.true_pixel
            photo = t.clean.copy()
            photo[y - 1 : y + 2, x - 1 : x + 2] += (share * t.white).astype(np.float32)
            glossy.append(replace(t, picture=Picture(photo)))
            read_too.append(replace(glossy[-1], target=t.target + share * t.white))
        flat.add(share, [replace(t, means=SWATCH) for t in glossy])
        same.add(share, read_too)
    return Curve("Gloss in the reference", "share of the white", [flat, same])


def white_error(settings: Settings, errors: Sequence[float] = (-0.3, -0.15, -0.05, 0, 0.05, 0.15, 0.3)) -> Curve:
    """The white wrong in one channel."""
    series = []
    for channel, name in enumerate(("red", "green", "blue")):
        line = Series(f"{name} channel")
        trials = _trials("mug", settings)
        for error in errors:
            factor = np.ones(3)
            factor[channel] += error
            line.add(error, [replace(t, white=t.true_white * factor) for t in trials])
        series.append(line)
    return Curve("White", "relative error of one channel", series)


def random_reference(settings: Settings, draws: int = 60, steps: int = 9) -> Curve:
    """The reference clicked anywhere on the product; x is the share of clicks that do better."""
    flat, same, found = Series("flat swatch"), Series("sample, same place"), Series("flat, found by the program")
    rng = np.random.default_rng(0)
    trials = _trials("mug", settings)
    trials = [trials[0], trials[-1]]  # many clicks, few pairs: one from each source
    rows, columns = np.nonzero(trials[0].where)
    chosen = rng.choice(len(rows), draws, replace=False)
    outcomes: list[tuple[Outcome, Outcome]] = []
    for k in chosen:
        pixel = (int(columns[k]), int(rows[k]))
        swatch, sample = [], []
        for t in trials:
            swatch.append(replace(t, pixel=pixel, means=SWATCH_ANYWHERE))
            sample.append(replace(t, pixel=pixel, target=read(Picture(t.truth), pixel, t.white)))
        outcomes.append((outcome(swatch), outcome(sample)))
    at = np.unique(np.linspace(0, draws - 1, steps).round().astype(int))
    for line, which in ((flat, 0), (same, 1)):
        ordered = sorted((o[which] for o in outcomes), key=lambda o: o.mean)
        line.points += [(100 * k / (draws - 1), ordered[k]) for k in at]
    best = outcome([replace(t, pixel=None, means=SWATCH_ANYWHERE) for t in trials])
    found.points += [(0.0, best), (100.0, best)]
    return Curve("Reference clicked at random", "% of clicks that do better", [flat, same, found])


def _from_each(
    scene: str, settings: Settings, colors: Mapping[str, RGB], values: Mapping[str, Sequence[float]]
) -> list[Series]:
    """Series from each color to all others, as a parameter of the scene takes these values."""
    lines = {name: Series(f"from {name}") for name in colors}
    [(parameter, each)] = values.items()
    for value in each:
        found = list(pairs(scene, settings, colors, cut=False, **{parameter: value}))
        for name, line in lines.items():
            line.add(value, [faultless(p) for p in found if p.source == name])
    return list(lines.values())


def fold_depth(
    settings: Settings,
    depths: Sequence[float] = (0.01, 0.04, 0.08, 0.12, 0.16, 0.20),
    colors: Mapping[str, RGB] | None = None,
) -> Curve:
    """Depth of folds, by which light meets the cloth more than once; the brighter the cloth, the more often."""
    colors = colors or {"red": COLORS["red"], "yellow": COLORS["yellow"], "pale pink": (0.72, 0.50, 0.46)}
    lines = _from_each("folds", settings, colors, {"depth": depths})
    return Curve("Depth of folds", "half depth (folds are 0.36 apart)", lines)


def translucency(
    settings: Settings,
    parts: Sequence[float] = (0.0, 0.1, 0.25, 0.5, 0.75),
    colors: Mapping[str, RGB] | None = None,
) -> Curve:
    """Part of the light that goes through the wall of the mug."""
    colors = colors or {name: COLORS[name] for name in ("red", "blue", "green")}
    lines = _from_each("translucent_mug", settings, colors, {"translucency": parts})
    return Curve("Translucency", "part of the light that passes", lines)


def mask_edge(
    settings: Settings, blurs: Sequence[float] = (0, 0.5, 1, 2, 4), grown: Sequence[int] = (-3, -2, -1, 0, 1, 2, 3)
) -> Curve:
    """A mask whose edge is too soft, or hard and too wide; measured in the three pixels on both sides of the edge."""
    soft, hard = Series("blurred, sigma"), Series("hard, grown by")
    trials = _trials("mug", settings)
    true = trials[0].mask
    band = ~erode(true > 0.999, 3) & ~erode(true < 0.001, 3)
    for sigma in blurs:
        mask = _blurred(true, sigma)
        soft.add(sigma, [replace(t, mask=mask, where=band) for t in trials])
    for reach in grown:
        inside = true > 0.5
        inside = ~erode(~inside, reach) if reach > 0 else erode(inside, -reach)
        hard.add(reach, [replace(t, mask=inside.astype(np.float32), where=band) for t in trials])
    return Curve("Edge of the mask", "pixels", [soft, hard])


def _blurred(mask: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    if sigma == 0:
        return mask
    reach = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        pads = [(reach, reach) if k == axis else (0, 0) for k in (0, 1)]
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(mask, pads, mode="edge"), 2 * reach + 1, axis=axis)
        mask = (windows @ kernel).astype(np.float32)
    return mask.clip(0, 1)


def resolution(settings: Settings, factors: Sequence[int] = (1, 2, 4, 8)) -> Curve:
    """Pixels made larger: by a sensor, which adds light, or by software that averages sRGB codes."""

    def by_light(pixels: NDArray, factor: int) -> NDArray[np.float32]:
        height, width = (n // factor * factor for n in pixels.shape[:2])
        parts = pixels[:height, :width].reshape(height // factor, factor, width // factor, factor, -1)
        return parts.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)

    def by_codes(pixels: NDArray, factor: int) -> NDArray[np.float32]:
        codes = np.asarray(transfer.SRGB.encode(np.clip(pixels, 0, 1)), np.float32)
        return np.asarray(transfer.SRGB.decode(by_light(codes, factor)), np.float32)

    series = []
    for scene in ("mug", "heather"):
        trials = _trials(scene, settings)
        for name, shrink in (("light", by_light), ("codes", by_codes)):
            line = Series(f"{scene}, {name}")
            for factor in factors:
                coarse = []
                for t in trials:
                    photo, truth = shrink(t.clean, factor), shrink(t.truth, factor)
                    pixel = (t.true_pixel[0] // factor, t.true_pixel[1] // factor)
                    coarse.append(
                        replace(
                            t,
                            picture=Picture(photo),
                            clean=photo,
                            truth=truth,
                            pixel=pixel,
                            true_pixel=pixel,
                            mask=by_light(t.mask[..., None], factor)[..., 0],
                            where=by_light(t.where[..., None], factor)[..., 0] > 0.999,
                            target=read(Picture(truth), pixel, t.white),
                        )
                    )
                line.add(settings.size // factor, coarse)
            series.append(line)
    return Curve("Resolution", "pixels on a side", series, log=True)


GROUPS: dict[str, tuple[tuple[Callable[[Settings], Curve], str], ...]] = {
    "photo": (
        (
            noise,
            "The error of the plain model grows in proportion to noise, and the body model overtakes it on matte "
            "cloth; the regularized model, taken from some noise on, keeps what either has.",
        ),
        (
            bit_depth,
            "An sRGB file of common depth costs next to nothing; linear codes of as few bits are coarse in the dark. "
            "At four bits of sRGB the plain model does better.",
        ),
        (
            exposure,
            "Underexposure is noise and is noticed late, by the darkness of the reference; overexposure is harmless "
            "until the body itself clips, and then nothing brings it back.",
        ),
        (
            tone_curve,
            "A power law keeps planes through black nearly plane and hardly matters to the picture, though the "
            "coefficients are wrong; a contrast curve does, and the residual is the only sign of it.",
        ),
    ),
    "footing": (
        (
            contamination,
            "For a target known as a flat swatch a trace of gloss in the reference shifts the whole product under the "
            "plain model; the program finds the gloss and takes it away, but not quite where there is least of it. For "
            "a target read at the same place of a real sample it cancels.",
        ),
        (
            white_error,
            "The white matters in the highlights only. One that is wrong by more than a tenth tilts the plane; this is "
            "recognized, and the plain model kept.",
        ),
        (
            random_reference,
            "Most clicks are good; one in the highlight ruins the plain model and is mended when its gloss is taken "
            "away. The reference found by the program is better than the typical click.",
        ),
    ),
    "product": (
        (
            source_chroma,
            "Without noise even an almost gray product can be split, and is; with an ordinary camera's noise the plain "
            "model fails from some paleness on, and smoothing the split mends most of it.",
        ),
        (
            fold_depth,
            "Light that met the cloth twice spoils every color in the folds and ruins a pale cloth everywhere under "
            "the plain model, which takes it for gloss below zero; the bounce as a term of its own does not.",
        ),
        (
            translucency,
            "What comes through the wall is more saturated than the body, but it is a small part of the picture: "
            "the tail grows, the median hardly.",
        ),
    ),
    "geometry": (
        (
            mask_edge,
            "A hard mask that is too tight leaves a rim of the old color, the worst of all errors here; a soft mask, "
            "or one that is too wide, on neutral ground does good.",
        ),
        (
            resolution,
            "Larger pixels cost nothing, whether light or codes are averaged; of a texture they mix dyed and undyed "
            "yarn into the reference.",
        ),
    ),
}
"""Figures, the curves in each, and a sentence on every curve."""


# --- Page -------------------------------------------------------------------------------------------------
_MARKS = {WARNS: ("v", "tab:olive"), FALLS_BACK: ("s", "tab:orange"), REFUSES: ("X", "tab:red")}


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Draw curves side by side: what to do on top, color difference, and error of the coefficients at the bottom."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    most = max(len(curve.series) for curve in curves)
    figure, axes = plt.subplots(
        3,
        len(curves),
        figsize=(4.8 * len(curves), 7.6),
        squeeze=False,
        height_ratios=(0.35 + 0.28 * most, 5, 2.6),
        sharex="col",
    )
    for (marks, upper, lower), curve in zip(axes.T, curves, strict=True):
        for k, line in enumerate(curve.series):
            color = f"C{k}"
            x = [x for x, _ in line.points]
            each = [o for _, o in line.points]
            upper.plot(x, [o.auto_median for o in each], "-o", color=color, ms=3)
            upper.plot(x, [o.auto_high for o in each], "--", color=color, lw=1)
            upper.plot(x, [o.median for o in each], "-.", color=color, lw=1)
            upper.plot(x, [o.body_median for o in each], ":", color=color, lw=1.2)
            lower.plot(x, [max(o.A, 1e-5) for o in each], "-o", color=color, ms=3)
            lower.plot(x, [max(o.B, 1e-5) for o in each], "--", color=color, lw=1)
            for at, one in line.points:
                for deed, size, full in ((one.should, 9, False), (one.does, 4, True)):
                    if deed:
                        mark, hue = _MARKS[deed]
                        marks.plot(at, k, mark, mec=hue, mfc=hue if full else "none", ms=size)
        marks.set(title=curve.title, ylim=(len(curve.series) - 0.4, -0.6))
        marks.set_yticks(range(len(curve.series)), [line.name for line in curve.series], fontsize=8)
        for k, label in enumerate(marks.get_yticklabels()):
            label.set_color(f"C{k}")
        marks.tick_params(length=0)
        lower.set_xlabel(curve.axis)
        plain = FuncFormatter(lambda value, _: f"{value:g}")
        scaled = [upper.yaxis, lower.yaxis]
        upper.set_yscale("log")
        lower.set_yscale("log")
        if curve.log:
            lower.set_xscale("log")
            scaled.append(lower.xaxis)
        for axis in scaled:
            axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.set_major_formatter(plain)
            axis.set_minor_formatter(NullFormatter())
        for axis in (upper, lower):
            axis.grid(alpha=0.3)
    axes[1, 0].set_ylabel("CIEDE2000")
    axes[2, 0].set_ylabel("error of A and B")
    figure.text(
        0.5,
        0.005,
        "Top: large and hollow, what it should do; small and full, what it does (triangle: warn, square: take another "
        "model, cross: refuse).\nMiddle: auto, median (solid) and 95th percentile (dashed); median of the dichromatic "
        "(dash-dotted) and the body model (dotted). "
        "Bottom: A (solid), B (dashed).",
        ha="center",
        fontsize=8,
    )
    figure.tight_layout(rect=(0, 0.045, 1, 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def worst(curves: Sequence[Curve], most: int = 20) -> list[str]:
    """Lines of a table of the points with the largest errors by what the program chooses itself."""
    rows = []
    for curve in curves:
        for line in curve.series:
            for x, o in line.points:
                rows.append(((o.auto_median, o.auto_high), curve, line, x, o))
    rows.sort(key=lambda row: -row[0][1])
    lines = [
        "| curve | series | at | as chosen | dichromatic | body | should | does |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for chosen, curve, line, x, o in rows[:most]:
        lines.append(
            f"| {curve.title} | {line.name} | {x:.3g} {curve.axis} | {chosen[0]:.2f} / {chosen[1]:.1f} "
            f"| {o.median:.2f} / {o.high:.1f} | {o.body_median:.2f} / {o.body_high:.1f} "
            f"| {o.should or 'nothing'} | {o.does or 'nothing'} |"
        )
    return lines


def from_where(curves: Sequence[Curve]) -> list[str]:
    """Lines of a table of the marks: at which x every series should fall back or refuse, and what it does there."""
    lines = [
        "| curve | series | should take another model at | should refuse at | of these it says nothing at |",
        "|" + "---|" * 5,
    ]
    for curve in curves:
        for line in curve.series:
            back, refuse = ([x for x, o in line.points if o.should == what] for what in (FALLS_BACK, REFUSES))
            silent = [x for x, o in line.points if o.should and not o.does]
            cells = [", ".join(f"{x:.3g}" for x in xs) or "-" for xs in (back, refuse, silent)]
            lines.append(f"| {curve.title} | {line.name} | {' | '.join(cells)} |")
    return lines


_MADE = """\
Made by `uv run --group bench python -m dyehouse.benchmarks.stability`. Every curve varies one thing and compares the
recolored render with a render of the product truly in the target color: CIEDE2000, median / 95th percentile over the
product's interior, mean of several pairs of colors ({size} pixels, {samples} samples). The true coefficients are those
that fit both true renders best. The renders' own noise is common to all channels and colors, so that "float" is a
camera without noise."""

_SHOULD = """\
By the measurement, a method *should* refuse, or at least say so, where even the best model is beyond a median of
{median:g} or a 95th percentile of {high:g}, and *should* take another model where the body model, or the one that it
finds, does better than the dichromatic one by a tenth in the mean. What it *does* is what `analyze` does by itself,
most often."""


def main() -> None:
    """Measure, draw, and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--size", type=int, default=128)
    options.add_argument("--samples", type=int, default=64)
    given = options.parse_args()
    settings = Settings(size=given.size, samples=given.samples)
    everything: list[Curve] = []
    sections: list[str] = []
    for group, members in GROUPS.items():
        curves = [make(settings) for make, _ in members]
        draw(curves, DOCS / "figures" / f"stability_{group}.png")
        everything += curves
        sections += [f"## {group.capitalize()}", "", f"![{group}](figures/stability_{group}.png)", ""]
        sections += [
            textwrap.fill(f"- **{curve.title}.** {text}", 118, subsequent_indent="  ")
            for curve, (_, text) in zip(curves, members, strict=True)
        ]
        sections.append("")
        print(group, flush=True)
    page = "\n".join(
        [
            "# Stability",
            "",
            *textwrap.wrap(_MADE.format(size=given.size, samples=given.samples), 118),
            "",
            *textwrap.wrap(_SHOULD.format(median=MEDIAN_LIMIT, high=HIGH_LIMIT), 118),
            "",
            "## The worst points",
            "",
            '"As chosen" is the model that the program takes by itself.',
            "",
            *worst(everything),
            "",
            "## Where it should take another model or refuse",
            "",
            *from_where(everything),
            "",
            *sections,
        ]
    )
    (DOCS / "stability.md").write_text(page)
    print(page)


if __name__ == "__main__":
    main()
