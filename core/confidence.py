"""How far a recolor will be from the truth, before any pixel is touched.

The error of a pixel is made up of ways in which it can depart from the model. Each is a small change of the pixel
that is followed through the recolor matrix and seen as a color difference, so that it counts the more, the farther
the target is and the worse body and surface can be told apart:

==========  ================================================================================================
noise       the photo's noise in each channel, and the steps of its codes
reference   the same in the reference color, for all pixels alike
residual    what the model does not explain of the pixel: as much may have gone unseen into body and gloss
body        1 % more or less body reflection
hue         1 % of the light in a direction that is neither body nor white
grain       gloss that changes from pixel to pixel: fibers of another color look the same
lights      the difference from the plain model, where that of two lights has taken over; or from that of two lights,
            where it was not taken and may be right
gray        gloss that is lost in the body, where noise hides it: an ordinary 2 % of the white
==========  ================================================================================================

They are added as squares. Their weights, and the factors of the bounds, are fitted on half of the laboratory's cases
and tested on the others by ``python -m dyehouse.benchmarks.calibration``, which prints them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from . import dichromatic
from .colorimetry import delta_e_2000, linear_to_lab
from .colorspace import LINEAR_SRGB
from .mixture import Mixture
from .picture import Picture
from .stability import Noise

# Fitted: `uv run --group bench python -m dyehouse.benchmarks.calibration --fit`.
WEIGHTS: Mapping[str, float] = {
    "noise": 0.78,
    "reference": 0.75,
    "residual": 0.33,
    "body": 0.67,
    "hue": 0.13,
    "grain": 0.15,
    "lights": 0.65,
    "gray": 0.14,
}

# 90 % of pixels are below this times their own predicted error; and below this times the 90th percentile of their
# region's.
PIXEL_BOUND, REGION_BOUND = 3.0, 2.2

# Predicted median from which a recolor is flagged; and median difference from the plain model from which one is that
# takes the product for metal or sees two lights.
FLAG, FLAG_MODEL = 2.25, 4.0

_REMEDIES: Mapping[str, str] = {
    "noise": "the photo is too noisy or too dark for so large a change: use a longer exposure or a lower ISO",
    "reference": "the reference is dark or noisy: click a better lit part",
    "residual": "the product shows colors that the model does not explain: select one material, or check a sample",
    "body": "the change is large: check the result against a sample",
    "hue": "the change is large: check the result against a sample",
    "grain": "fibers, a print or wear of another color look like gloss: select one material, or check a sample",
    "lights": "light of more than one color falls on the product: photograph it in one light",
    "gray": "the product is almost the color of the light, so highlights and body cannot be told apart: mask the "
    "highlights out, or photograph a colored sample",
}

# Noise gain from which a product counts as almost gray.
_GRAY_GAIN = 6.0

# Change of the light, for "body" and "hue".
_SMALL = 0.01

# Gloss of an ordinary surface away from its highlights, as a share of the white, for "gray".
_USUAL_GLOSS = 0.02

# Sine of the angle to the white under which there is no plane of body and white.
_FLAT = 1e-3


@dataclass(frozen=True)
class Prediction:
    """What to expect of a region's recolor.

    Attributes
    ----------
    median
        CIEDE2000 that half of the pixels are expected to stay below.
    bound90
        CIEDE2000 that 90 % of the pixels are expected to stay below.
    flagged
        Whether the color will probably be visibly wrong.
    warnings
        Sentences for the user, each with a remedy.
    """

    median: float
    bound90: float
    flagged: bool
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sample:
    """Some pixels of a region, and what each may depart from the model by: the same for every target.

    Attributes
    ----------
    given
        (n, 3 + m) float32 pixels with their corrections.
    recolored
        (7, n, 3) float32 changes of the pixel that are recolored with it: noise and reference by channel, body.
    left
        (2, n, 3) float32 changes that shall stay what they are: residual, hue.
    grain
        (n, 1) float32 gloss of the pixel beyond that of its neighborhood.
    """

    given: NDArray[np.float32]
    recolored: NDArray[np.float32]
    left: NDArray[np.float32]
    grain: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Grounds:
    """What makes predictions of a region uncertain, whatever its target.

    Attributes
    ----------
    picture
        The photo.
    extra
        (height, width, n) corrections, or None.
    mixture
        The model.
    noise
        Of the color, relative to the white.
    noise_gain
        Of the split into body and gloss.
    split_noise
        Noise of the gloss, relative to the light.
    hidden
        Whether noise hides what the model does not explain, see `selection.Evidence`.
    other
        A model that was not taken and may be right, or None.
    """

    picture: Picture
    extra: NDArray | None
    mixture: Mixture
    noise: Noise
    noise_gain: float
    split_noise: float = 0.0
    hidden: bool = False
    other: Mixture | None = None

    @cached_property
    def colored(self) -> bool:
        """Whether there is a plane of body and white."""
        return bool(dichromatic.sine(self.mixture.body, self.mixture.white) > _FLAT)

    @property
    def splits(self) -> bool:
        """Whether body and gloss can be told apart."""
        return self.colored and self.noise_gain < _GRAY_GAIN

    def sample(self, rows: NDArray, columns: NDArray) -> Sample:
        """Look at n pixels."""
        white = self.mixture.white
        pixels = self.picture.at(rows, columns).astype(np.float64)
        given = pixels
        if self.extra is not None:
            given = np.hstack([pixels, self.extra[rows, columns].astype(np.float64)])
        body, toward, normal = self._axes
        light = (pixels / white) @ body
        color = self.mixture.body / white
        sigma = np.hypot(self.noise.at(light)[:, None], self._step(pixels) / white)
        wrong = np.hypot(self.noise.at(color @ body), self._step(self.mixture.body[None])[0] / white)
        strength = (light / (color @ body))[:, None]
        off = np.linalg.norm((given @ self.mixture.left_over.T) / white, axis=1, keepdims=True)
        axes = np.eye(3)[:, None]
        recolored = np.concatenate([sigma * axes, strength * wrong * axes, (_SMALL * pixels / white)[None]]) * white
        left = np.stack([off * toward, _SMALL * light[:, None] * normal]) * white
        grain = self._grain(rows, columns) if self.splits else np.zeros((len(rows), 1))
        return Sample(*(_float32(values) for values in (given, recolored, left, grain)))

    @cached_property
    def _axes(self) -> tuple[NDArray, NDArray, NDArray]:
        """Of the white-balanced light: body, in its plane with the white across it, and across both; unit vectors."""
        body = self.mixture.body / self.mixture.white
        body = body / np.linalg.norm(body)
        gray = np.full(3, 3**-0.5)
        toward = gray - (gray @ body) * body
        if np.linalg.norm(toward) < _FLAT:
            toward = np.cross(body, np.eye(3)[np.argmin(np.abs(body))])
        toward = toward / np.linalg.norm(toward)
        return body, toward, np.cross(body, toward)

    def _step(self, pixels: NDArray) -> NDArray[np.float64]:
        """(n, 3) linear light of one code; 0 for pictures of floats."""
        stored = self.picture.pixels.dtype
        if stored.kind == "f":
            return np.zeros_like(pixels)
        codes = np.asarray(self.picture.curve.encode(np.clip(pixels, 0, 1)), np.float64)
        return np.asarray(self.picture.curve.decode(codes + 1 / np.iinfo(stored).max), np.float64) - np.clip(
            pixels, 0, 1
        )

    def _grain(self, rows: NDArray, columns: NDArray) -> NDArray[np.float64]:
        """(n, 1) gloss of pixels beyond that of their neighborhood."""
        height, width = self.picture.shape
        split = dichromatic.projector(self.mixture.body, self.mixture.white)

        def coefficients(down: int, right: int) -> NDArray:
            at = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            return self.picture.at(*at).astype(np.float64) @ split.T

        here = coefficients(0, 0)
        around = np.mean([coefficients(*shift) for shift in ((-1, 0), (1, 0), (0, -1), (0, 1))], axis=0)
        share = around[:, 1] / np.maximum(around[:, 0], 1e-3)
        return np.abs(here[:, 1] - share * np.maximum(here[:, 0], 0))[:, None]


@dataclass(frozen=True, eq=False)
class Doubt:
    """All that the prediction for one target is made from.

    Attributes
    ----------
    grounds
        What does not depend on it.
    matrix
        (3, 3 + n) of the recolor.
    target
        (3,) V'.
    target_white
        (3,) W'.
    """

    grounds: Grounds
    matrix: NDArray[np.float64]
    target: NDArray[np.float64]
    target_white: NDArray[np.float64]

    def parts(self, rows: NDArray, columns: NDArray) -> dict[str, NDArray[np.float32]]:
        """(n,) CIEDE2000 at n pixels, of every way to depart from the model; names as in `WEIGHTS`."""
        return self._parts(self.grounds.sample(rows, columns))

    def _parts(self, seen: Sample) -> dict[str, NDArray[np.float32]]:
        grounds, matrix = self.grounds, self.matrix[:, :3]
        result = seen.given @ _float32(self.matrix.T)
        lost = _USUAL_GLOSS * (self.target_white - matrix @ grounds.mixture.white)
        differences = self._difference(
            result,
            result + seen.recolored @ _float32(matrix.T),
            result + seen.left @ _float32(matrix.T - np.eye(3)),
            (result + _float32(lost))[None],
            (result + seen.grain * _float32(self.target_white))[None],
        )
        found = {
            "noise": np.linalg.norm(differences[:3], axis=0),
            "reference": np.linalg.norm(differences[3:6], axis=0),
            "body": differences[6],
            "residual": differences[7],
            "hue": differences[8],
            "gray": differences[9] * np.float32(min(1.0, grounds.split_noise) if grounds.colored else 1.0),
            "grain": differences[10],
            "lights": np.zeros(len(result), np.float32),
        }
        if grounds.mixture.model == "lights" or (grounds.other is not None and grounds.mixture.model != "bounce"):
            found["lights"] = self._disagreement(seen)
        return found

    def _disagreement(self, seen: Sample) -> NDArray[np.float32]:
        """(n,) CIEDE2000 between the model and the other, or the plain one; 0 where the plain one is of no use."""
        grounds, mixture = self.grounds, self.grounds.mixture
        if grounds.other is None and not grounds.splits:
            return np.zeros(len(seen.given), np.float32)
        if grounds.other is None:
            other = dichromatic.recolor_matrix(mixture.body, self.target, mixture.white, self.target_white)
        else:
            other = grounds.other.matrix(self.target, self.target_white, 0.0)
        made = seen.given @ _float32(self.matrix.T)
        return self._difference(made, (seen.given[:, :3] @ _float32(other.T))[None])[0]

    def predict(self, seen: Sample) -> Prediction:
        """What to expect of the region that these pixels are a sample of."""
        parts = self._parts(seen)
        errors = _together(parts, WEIGHTS)
        median, most = (float(error) for error in np.quantile(errors, (0.5, 0.9)))
        bound = REGION_BOUND * most
        model = self.grounds.mixture.model
        rivaled = model in ("metal", "lights") or (model == "bounce" and self.grounds.other is not None)
        apart = parts["lights"] if model == "lights" or not rivaled else self._disagreement(seen)
        overruled = rivaled and float(np.median(apart)) > FLAG_MODEL
        said = []
        if median > FLAG:
            worst = max(parts, key=lambda name: WEIGHTS[name] * float(np.median(parts[name])))
            said.append(
                f"The color will probably be off by about {median:.1f} CIEDE2000 (90 % of the product within "
                f"{bound:.0f}): {_REMEDIES[worst]}."
            )
        elif overruled:
            what = "metal" if model == "metal" else "lit by two lights"
            other = "lights" if model == "bounce" else "dichromatic"
            said.append(
                f"The result depends on whether the product is really {what}: compare the model '{other}', or check a "
                "sample."
            )
        elif self.grounds.hidden:
            said.append(
                "Noise hides why the product departs from body color and gloss, by light of more than one color or as "
                "metal does: use a longer exposure, or check a sample."
            )
        return Prediction(median, bound, bool(said), tuple(said))

    def errors(self, rows: NDArray, columns: NDArray, weights: Mapping[str, float] = WEIGHTS) -> NDArray[np.float32]:
        """(n,) predicted CIEDE2000 at n pixels."""
        return _together(self.parts(rows, columns), weights)

    def _difference(self, result: NDArray, *others: NDArray) -> NDArray[np.float32]:
        """(m, n) CIEDE2000 of (n, 3) pixels from (m, n, 3) others, of which there may be several arrays."""
        # In white-balanced Rec.709 whatever the photo's primaries: it is an estimate.
        lab = linear_to_lab(np.concatenate([result[None], *others]) / _float32(self.target_white), LINEAR_SRGB)
        return delta_e_2000(lab[1:], lab[0])


def _float32(values: NDArray) -> NDArray[np.float32]:
    return values.astype(np.float32)


def _together(parts: Mapping[str, NDArray[np.float32]], weights: Mapping[str, float]) -> NDArray[np.float32]:
    return np.sqrt(np.sum([(weights[name] * part) ** 2 for name, part in parts.items()], axis=0))
