"""The two rules of the core that were found by measurement, on renders of products truly in another color.

    uv run python -m dyehouse.benchmarks.rules [--size 160]

1. How much of the residual to carry over, against the distance of the target: `dichromatic.carried_residual`.
2. From which noise gain on "auto" leaves the dichromatic model: `analysis.LARGEST_NOISE_GAIN`.

Writes docs/rules.md. The truth is always a render of the object in the target color; the target at the reference is
read from it, as the paper did.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core import colorimetry, dichromatic, transfer
from ..core.colorspace import LINEAR_SRGB
from ..core.stability import noise_gain
from . import laboratory

SCENES = ("mug", "fabric_cylinder", "folds", "heather")
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
ANGLES = (0.0, 3.0, 6.0, 9.0, 12.0, 18.0, 30.0)
SOURCES = {"blue": (0.04, 0.047, 0.305), "red": (0.43, 0.037, 0.045)}
TOWARD = {"blue": (0.06, 0.3, 0.067), "red": (0.8, 0.57, 0.014)}
NEUTRALS = {  # name: linear reflectance
    "beige, C* 16": (0.42, 0.31, 0.22),
    "beige, C* 8": (0.388, 0.333, 0.279),
    "off-white, C* 3": (0.593, 0.562, 0.533),
    "pale pink": (0.72, 0.5, 0.46),
    "dark brown": (0.04, 0.024, 0.018),
    "olive": (0.13, 0.12, 0.05),
}
TARGETS = {"blue": SOURCES["blue"], "red": SOURCES["red"], "yellow": TOWARD["red"]}
PAGE = Path(__file__).resolve().parent.parent / "docs" / "rules.md"


def turned(source: NDArray, toward: NDArray, degrees: float) -> NDArray[np.float64]:
    """Reflectance turned from `source` toward another by an angle, at the same length."""
    a = source / np.linalg.norm(source)
    b = toward - (toward @ a) * a
    b /= np.linalg.norm(b)
    angle = np.radians(degrees)
    return np.clip(np.linalg.norm(source) * (np.cos(angle) * a + np.sin(angle) * b), 0.002, 0.95)


class Scene:
    """Renders of one scene, and what is read from them."""

    def __init__(self, name: str, settings: laboratory.Settings) -> None:
        self.name, self.settings = name, settings
        self.view = laboratory.view(name, settings)

    def picture(self, reflectance: NDArray) -> NDArray[np.float64]:
        """(n, 3) linear pixels of the product's interior."""
        return self._render(reflectance)[self.view.interior].astype(np.float64)

    def reference(self, reflectance: NDArray) -> NDArray[np.float64]:
        """(3,) linear RGB at the reference."""
        x, y = self.view.reference
        return self._render(reflectance)[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).mean(axis=0, dtype=np.float64)

    def _render(self, reflectance: NDArray) -> NDArray[np.float32]:
        return laboratory.render(self.name, reflectance, (1.0, 1.0, 1.0), self.settings)


def photographed(pixels: NDArray, rng: np.random.Generator) -> NDArray[np.float64]:
    """The same pixels with shot noise (1.3 % at a fifth of white) and in 8-bit sRGB codes."""
    noisy = pixels + rng.standard_normal(pixels.shape) * np.sqrt(3.5e-5 * np.maximum(pixels, 0) + 1e-6)
    return transfer.decode(transfer.encode(noisy, transfer.SRGB, np.uint8), transfer.SRGB).astype(np.float64)


def error(pixels: NDArray, truth: NDArray) -> NDArray[np.float64]:
    """(n,) CIEDE2000."""
    return colorimetry.delta_e_2000(
        colorimetry.linear_to_lab(pixels, LINEAR_SRGB), colorimetry.linear_to_lab(truth, LINEAR_SRGB)
    )


def residual_rule(scenes: list[Scene]) -> list[str]:
    """Mean CIEDE2000 against the share of the residual and the angle between the body colors."""
    lines = [
        "| scene | source | angle | " + " | ".join(f"{s:.0%}" for s in SHARES) + " | rule's share | rule |",
        "|" + "---|" * (5 + len(SHARES)),
    ]
    rng = np.random.default_rng(0)
    for scene in scenes:
        for degrees in ANGLES:
            for kind in ("float", "8-bit"):
                errors: dict[float | str, list[float]] = {s: [] for s in (*SHARES, "rule")}
                used = []
                for name, source in SOURCES.items():
                    start = np.array(source)
                    # At no angle the target is the same dye, half as strong in light: only darker.
                    goal = start * 0.6 if degrees == 0 else turned(start, np.array(TOWARD[name]), degrees)
                    v, v2 = scene.reference(start), scene.reference(goal)
                    pixels, truth = scene.picture(start), scene.picture(goal)
                    if kind == "8-bit":
                        pixels = photographed(pixels, rng)
                    used.append(dichromatic.carried_residual(v, v2))
                    for share in errors:
                        r = used[-1] if share == "rule" else float(share)
                        matrix = dichromatic.recolor_matrix(v, v2, residual=r)
                        errors[share].append(error(pixels @ matrix.T, truth).mean())
                cells = [f"{np.mean(errors[s]):.2f}" for s in SHARES]
                lines.append(
                    f"| {scene.name} | {kind} | {degrees:.0f} | {' | '.join(cells)} | {np.mean(used):.2f} | "
                    f"{np.mean(errors['rule']):.2f} |"
                )
    return lines


def model_rule(scenes: list[Scene]) -> list[str]:
    """Median / 95th percentile of CIEDE2000 of both models, against the noise gain of the source."""
    rows = []
    rng = np.random.default_rng(0)
    for scene in scenes:
        for name, source in NEUTRALS.items():
            v, pixels = scene.reference(np.array(source)), scene.picture(np.array(source))
            noisy = photographed(pixels, rng)
            cells = []
            for given in (pixels, noisy):
                for model in dichromatic.MODELS:
                    found = [
                        error(
                            given @ dichromatic.recolor_matrix(v, scene.reference(np.array(t)), model=model).T,
                            scene.picture(np.array(t)),
                        )
                        for t in TARGETS.values()
                    ]
                    every = np.concatenate(found)
                    cells.append(f"{np.median(every):.2f} / {np.quantile(every, 0.95):.1f}")
            rows.append((scene.name, noise_gain(v, np.ones(3)), name, cells))
    lines = [
        "| scene | source | noise gain | dichromatic, float | body, float | dichromatic, 8-bit | body, 8-bit |",
        "|" + "---|" * 7,
    ]
    lines += [f"| {s} | {n} | {g:.1f} | {' | '.join(c)} |" for s, g, n, c in sorted(rows, key=lambda r: (r[0], r[1]))]
    return lines


def main() -> None:
    """Measure, print and write the page."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--size", type=int, default=160)
    given = options.parse_args()
    scenes = [Scene(name, laboratory.Settings(size=given.size, samples=64)) for name in SCENES]
    page = "\n".join(
        [
            "# Two rules and what they were found from",
            "",
            "Made by `uv run python -m dyehouse.benchmarks.rules`. Every figure compares a recolored",
            'render with a render of the object truly in the target color, over the object\'s interior. "8-bit" is the',
            "source with the noise of a camera and in 8-bit codes; the truth is always noise-free.",
            "",
            "## The residual",
            "",
            "Mean CIEDE2000 when this share of the residual is carried over to a body color this many degrees away (0:",
            "the same hue, 0.6 times as bright), mean of two sources. The last columns are `carried_residual`.",
            "",
            *residual_rule(scenes),
            "",
            "## The model",
            "",
            'Median / 95th percentile of CIEDE2000, three strong target colors together. "auto" takes the body model',
            "from a noise gain of 6 on.",
            "",
            *model_rule(scenes),
            "",
        ]
    )
    PAGE.write_text(page)
    print(page)


if __name__ == "__main__":
    main()
