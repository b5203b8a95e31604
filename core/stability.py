"""How sure a recolor is, before any pixel is touched."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .dichromatic import sine
from .picture import Picture


def noise_gain(reference: NDArray, white: NDArray) -> float:
    """How much the split into body and surface reflection multiplies noise: 1/sin of the angle between them.

    1 for colors at right angles to white, 5.6 for a product of CIELAB chroma 10 and lightness 50, 11 at chroma 5;
    infinite for grey.
    """
    s = sine(reference, white)
    return 1 / s if s > 1e-6 else float("inf")  # below, it is rounding


def matrix_gain(matrix: NDArray) -> float:
    """Largest factor by which a recolor matrix multiplies noise in a pixel: its spectral norm."""
    return float(np.linalg.norm(matrix, 2))


@dataclass(frozen=True)
class Noise:
    """Noise of a picture in linear light: variance = read ** 2 + shot * light."""

    read: float
    shot: float

    def at(self, light: NDArray) -> NDArray:
        """Standard deviation at this linear light (any shape)."""
        return np.sqrt(self.read**2 + self.shot * np.maximum(light, 0.0))


def estimate_noise(picture: Picture) -> Noise:
    """Estimate the noise from one picture.

    From the second differences along rows, in which shading cancels, of each of eight ranges of brightness; of
    each range the lower quartile, so that texture and edges on up to half of the pixels do not count (after
    Immerkaer 1996, "Fast noise variance estimation").

    Returns
    -------
    The noise; an upper bound where fine texture covers the whole picture. A hair above zero for a noiseless one.
    """
    height, width = picture.shape
    quiet = Noise(5e-5, 0.0)
    if width < 3:
        return quiet
    step = max(1, height * width // 400_000)
    values = picture.linear(slice(step // 2, None, step))
    second = np.abs(values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2]).reshape(-1)
    light = ((values[:, 2:] + values[:, :-2]) / 2).reshape(-1)
    edges = np.array([-np.inf, 0.004, 0.012, 0.03, 0.07, 0.15, 0.3, 0.55, 0.95])
    rows, variances, weights = [], [], []
    for low, high in itertools.pairwise(edges):
        chosen = (light > low) & (light <= high)
        n = int(np.count_nonzero(chosen))
        if n < 200:
            continue
        sigma = float(np.quantile(second[chosen], 0.25)) / 0.3186 / np.sqrt(6)
        rows.append((1.0, float(np.maximum(light[chosen], 0).mean())))
        variances.append(sigma**2)
        weights.append(np.sqrt(n) / (sigma**2 + 1e-9))
    if not rows:
        return quiet
    # Relative errors count alike; a bin can only be too noisy, so a negative solution is cut.
    a, v, k = np.array(rows), np.array(variances), np.array(weights)
    if len(rows) == 1:
        return Noise(max(quiet.read, float(np.sqrt(v[0]))), 0.0)
    read, shot = np.linalg.lstsq(a * k[:, None], v * k, rcond=None)[0]
    if read < 0:
        read, shot = 0.0, float((a[:, 1] * v * k * k).sum() / (a[:, 1] ** 2 * k * k).sum())
    return Noise(max(quiet.read, float(np.sqrt(max(read, 0.0)))), max(float(shot), 0.0))
