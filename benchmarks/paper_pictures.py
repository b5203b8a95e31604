"""The paper's pictures, made in the laboratory: Figs. 7 to 11, with the truth beside them that photos do not have.

The camera is the CIE 1931 observer in linear sRGB, so that every pixel has a color difference; `shoot` takes any other
that the laboratory knows. Pictures come from the spectra that `paper_tables` measures, by Eq. (11).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..core import colorimetry, dichromatic, reflectance
from ..core.colorspace import LINEAR_SRGB
from ..sample_blends import make_scenes
from . import laboratory, rivals
from .camera import Camera
from .paper_tables import Objects

RED, BLUE = (0.429, 0.037, 0.045), (0.040, 0.047, 0.305)
"""Linear RGB of the ColorChecker's red and blue, for the renders that need no spectra."""

MIXED = {"key": "D65", "fill": "A"}
"""Daylight and tungsten on `folds_mixed`."""

_GLOSSY = 0.05
"""Gloss, in parts of the white, from which a pixel is called highlight."""

_HANDLE = 0.64
"""Part of the picture's width right of which there is the handle, and the wall that it throws light on."""

_OPENING = (0.434, 0.187), (0.185, 0.034)
"""Center and half axes, in parts of the picture, of the ellipse through which one looks into the mug."""

type Regions = dict[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture and what the model needs to know of it.

    Attributes
    ----------
    image
        (H, W, 3) linear RGB.
    white
        (3,) response to a white diffuser, W.
    reference
        (3,) at the reference pixel, V.
    """

    image: NDArray[np.float64]
    white: NDArray[np.float64]
    reference: NDArray[np.float64]

    def fit(self) -> tuple[NDArray, NDArray]:
        """(A, B) of every pixel, (28)."""
        return dichromatic.fit(self.image, self.reference, self.white)

    def residual(self) -> NDArray:
        """What the model leaves over, (32), on the paper's scale of 0..255."""
        return dichromatic.residual(self.image, self.reference, self.white) * 255

    def like(self, target: Shot) -> NDArray:
        """Synthesize the target from its reference pixel and its white, (35) as it should be printed."""
        return dichromatic.synthesize(*self.fit(), target.reference, target.white)


def shot_of(image: NDArray, view: laboratory.View, white: NDArray) -> Shot:
    """Read the reference, a square of 3 pixels, and keep it with the picture."""
    x, y = view.reference
    image = np.asarray(image, np.float64)
    return Shot(image, white, image[y - 1 : y + 2, x - 1 : x + 2].mean(axis=(0, 1)))


def shoot(objects: Objects, color: str, light: str | Mapping[str, str] = "D65", sensor: str = "1931") -> Shot:
    """Photograph an object; the observer gives linear sRGB, a camera its own RGB; `light` as for `seen_by`."""
    measured = objects.measured[color]
    image, white = measured.seen_by(sensor, light), measured.white(sensor, light)
    if sensor in ("1931", "1964"):
        image, white = (colorimetry.xyz_to_linear(each, LINEAR_SRGB) for each in (image, white))
    return shot_of(image, objects.view, white)


def difference(image: NDArray, truth: NDArray) -> NDArray[np.float64]:
    """CIEDE2000 at every pixel of two linear sRGB pictures."""
    lab1, lab2 = (colorimetry.linear_to_lab(np.asarray(each, float), LINEAR_SRGB) for each in (image, truth))
    return colorimetry.delta_e_2000(lab1, lab2)


# --- Regions ----------------------------------------------------------------------------------------------
def parts_of_mug(mug: Objects) -> Regions:
    """Object, highlight, handle (with the wall beside it), inside, and the rest of the wall of a mug.

    The highlight is what a black mug of the same shape shows.
    """
    whole = mug.view.interior
    gloss = laboratory.render(mug.scene, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), mug.settings)[..., 1]
    y, x = (np.indices(whole.shape) + 0.5) / mug.settings.size
    center, axes = _OPENING
    inside = whole & (((x - center[0]) / axes[0]) ** 2 + ((y - center[1]) / axes[1]) ** 2 < 1)
    handle = whole & (x > _HANDLE)
    highlight = whole & (gloss > _GLOSSY) & ~handle & ~inside
    wall = whole & ~highlight & ~handle & ~inside
    return {"object": whole, "highlight": highlight, "handle": handle, "inside": inside, "wall": wall}


def parts_of_folds(cloth: Objects) -> Regions:
    """Object, and the quarters of it that get most and least light from other cloth.

    How much that is, a white cloth tells beside a nearly black one, whose light meets the cloth only once.
    """
    inside = cloth.view.interior
    white = laboratory.render(cloth.scene, (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), cloth.settings, diffuser=True)[..., 1]
    black = laboratory.render(cloth.scene, (0.01, 0.01, 0.01), (1.0, 1.0, 1.0), cloth.settings)[..., 1]
    gain = np.where(inside, white / np.maximum(black * 100, 1e-6), 1.0)
    low, high = np.quantile(gain[inside], [0.25, 0.75])
    return {"object": inside, "deep folds": inside & (gain > high), "ridges": inside & (gain < low)}


# --- Figs. 7 to 10 ----------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Synthesis:
    """One picture made from another, and the truth."""

    name: str
    source: NDArray
    made: NDArray
    truth: NDArray
    parts: Regions

    @cached_property
    def error(self) -> NDArray[np.float64]:
        """(H, W) CIEDE2000."""
        return difference(self.made, self.truth)

    def within(self, part: str) -> NDArray[np.float64]:
        """CIEDE2000 at the pixels of a part."""
        return self.error[self.parts[part]]


def synthesize(objects: Objects, source: str, targets: Iterable[str], parts: Regions) -> list[Synthesis]:
    """Figs. 8 and 9: one object put into the colors of the others, under the same light."""
    start = shoot(objects, source)
    found = []
    for color in targets:
        goal = shoot(objects, color)
        found.append(Synthesis(f"{source} to {color}", start.image, start.like(goal), goal.image, parts))
    return found


def change_light(name: str, start: Shot, goal: Shot, parts: Regions) -> dict[str, Synthesis]:
    """Fig. 10: another color in another light, by (35) as derived and as printed."""
    printed = dichromatic.synthesize(*start.fit(), goal.reference, goal.white / start.white)
    return {
        "B W'": Synthesis(name, start.image, start.like(goal), goal.image, parts),
        "B W'/W as printed": Synthesis(name, start.image, printed, goal.image, parts),
    }


def cloth_in_other_light(cloth: Objects, parts: Regions) -> dict[str, Synthesis]:
    """Red cloth in daylight and tungsten into blue cloth in daylight; and the same with no change of light."""
    goal, same = shoot(cloth, "blue", "D65"), shoot(cloth, "red", "D65")
    found = change_light("red to blue", shoot(cloth, "red", MIXED), goal, parts)
    return found | {
        "daylight before and after": Synthesis("red to blue", same.image, same.like(goal), goal.image, parts)
    }


def mug_in_other_light(settings: laboratory.Settings) -> dict[str, Synthesis]:
    """The same for a glossy mug, where B counts; without spectra."""
    view = laboratory.view("mug_mixed", settings)
    shots = []
    for color, lamp in ((RED, make_scenes.TUNGSTEN), (BLUE, (1.0, 1.0, 1.0))):
        light = {"key": (1.0, 1.0, 1.0), "fill": lamp}
        image = laboratory.render("mug_mixed", color, light, settings)
        shots.append(shot_of(image, view, view.white(light)))
    return change_light("red to blue", shots[0], shots[1], {"object": view.interior})


@dataclass(frozen=True, eq=False)
class Variation:
    """Fig. 7: fits to pictures of cups of one shape.

    Attributes
    ----------
    A, B, residual
        (N, H, W) of every cup; the residual on the scale of 0..255.
    spread
        (H, W): E_V, the bound (33), on the scale of 0..255, mean of the channels.
    clipped
        (N, H, W) bool: the camera had no more room.
    """

    A: NDArray
    B: NDArray
    residual: NDArray
    spread: NDArray
    clipped: NDArray[np.bool_]


CAMERAS = {
    "observer, no noise": ("1931", None),
    "Nikon D5100, no noise": ("Nikon 5100 (NPL)", None),
    "observer, 12-bit raw with noise": ("1931", Camera(bits=12, curve="linear")),
    "observer, 8-bit sRGB with noise": ("1931", Camera()),
    "observer, 8-bit sRGB, tone curve": ("1931", Camera(curve="tone")),
}
"""Cameras for Fig. 7: a sensor, and what lies between it and the file."""


def variation(mug: Objects, camera: str) -> Variation:
    """Fig. 7 by one of `CAMERAS`."""
    sensor, file = CAMERAS[camera]
    shots = [shoot(mug, color, sensor=sensor) for color in mug.colors]
    clipped = np.zeros((len(shots), *shots[0].image.shape[:2]), bool)
    if file is not None:
        shots = [shot_of(file.photograph(shot.image), mug.view, shot.white) for shot in shots]
        clipped = np.stack([shot.image.max(axis=-1) > 0.999 for shot in shots])
    pairs = [shot.fit() for shot in shots]
    A, B = (np.stack(part) for part in zip(*pairs, strict=True))
    spread = reflectance.spread_rgb(A, B, white=shots[0].white * 255).mean(axis=-1)
    return Variation(A, B, np.stack([shot.residual() for shot in shots]), spread, clipped)


# --- Satin ------------------------------------------------------------------------------------------------
def cotton_and_satin(settings: laboratory.Settings) -> dict[str, Synthesis]:
    """Coefficients of cotton and of satin in the same folds, from red, used for blue.

    The reference is one pixel for all, well lit and where the sheen is least: else the satin's reference holds sheen,
    which no coefficient of cotton can take away.
    """
    light = (1.0, 1.0, 1.0)
    sheens = {"cotton": 0.0, "satin": 0.45}
    images = {
        (cloth, name): laboratory.render("satin", color, light, settings, sheen=sheen)
        for cloth, sheen in sheens.items()
        for name, color in (("red", RED), ("blue", BLUE))
    }
    view = laboratory.view("satin", settings)
    lit = images["cotton", "red"][..., 0]
    sheen = laboratory.render("satin", (0.0, 0.0, 0.0), light, settings)[..., 1]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(sheen, 1, mode="edge"), (3, 3)).mean(axis=(2, 3))
    candidates = view.interior & (lit > np.quantile(lit[view.interior], 0.5))
    candidates[[0, -1]] = candidates[:, [0, -1]] = False
    y, x = np.unravel_index(np.argmin(np.where(candidates, around, np.inf)), around.shape)
    view = replace(view, reference=(int(x), int(y)))
    shots = {key: shot_of(image, view, np.ones(3)) for key, image in images.items()}
    found = {}
    for start, goal in (("cotton", "cotton"), ("satin", "satin"), ("cotton", "satin")):
        source, target = shots[start, "red"], shots[goal, "blue"]
        name = f"red {start} to blue {goal}"
        parts = {"object": view.interior}
        found[f"{start} to {goal}"] = Synthesis(name, source.image, source.like(target), target.image, parts)
    return found


# --- Fig. 11 ----------------------------------------------------------------------------------------------
OURS = "dichromatic (A, B)"
"""The name of the paper's method in `compare`."""


def compare(objects: Objects, source: str, targets: Iterable[str], methods: Mapping[str, rivals.Rival]) -> list[dict]:
    """Every method on every target: a dict of pictures by the method's name, with the truth under "truth".

    Methods that end in display codes cannot say anything brighter than white, so all are cut to 0..1.
    """
    start = shoot(objects, source)
    found = []
    for color in targets:
        goal = shoot(objects, color)
        task = rivals.Task(
            start.image, objects.view.mask > 0.999, start.reference, goal.reference, goal.image, start.white
        )
        pictures = {"truth": goal.image, OURS: task.with_pixels(start.like(goal)[task.region])}
        body = dichromatic.recolor_matrix(start.reference, goal.reference, start.white, model="body")
        pictures["body only (A)"] = task.with_pixels(start.image[task.region] @ body.T)
        pictures |= {name: method(task) for name, method in methods.items()}
        found.append({name: np.clip(picture, 0, 1) for name, picture in pictures.items()})
    return found


def pooled(pictures: list[dict], method: str, part: NDArray[np.bool_]) -> NDArray[np.float64]:
    """CIEDE2000 of one method over all targets at the pixels of a part."""
    return np.concatenate([difference(each[method][part], each["truth"][part]) for each in pictures])
