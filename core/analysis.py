"""Look at a photo once, then recolor it as often as wanted.

`analyze` finds the footing (white, reference, model) and says how sure it is; the `Analysis` it returns recolors.
Under the plain models a recolor is one 3x3 matrix, see `dichromatic`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import dichromatic, stability
from . import recolor as recoloring
from .compositing import Edge, unmix_edge
from .errors import ImageError, ReferenceColorError, WhiteError
from .picture import Picture, as_mask, as_weights
from .reference import DARK, Reference, matte_reference, reference_at

MODELS = ("auto", *dichromatic.MODELS)

# Noise gain above which "auto" leaves the dichromatic model, and the product counts as nearly grey. Found with
# benchmarks/near_neutral.py: up to here the body model alone is worse, beyond it the split is.
LARGEST_NOISE_GAIN = 6.0

# Gloss in a clicked reference, as a share of the white, from which it is reported.
_GLOSSY = 0.03
_SAMPLE = 200_000

# Share of the picture under which a region is so small that a click has probably missed the product.
_FEWEST_PIXELS = 0.001


@dataclass(frozen=True, eq=False)
class Analysis:
    """What is known of one region of one photo.

    Attributes
    ----------
    picture
        The photo.
    white
        (3,) float64 linear RGB of a perfect white diffuser, W.
    reference
        (3,) float64 linear RGB of the product at the reference, V.
    pixel
        (x, y) of the reference, or None.
    mask
        (height, width) coverage of the product, or None for the whole picture.
    model
        "dichromatic" or "body".
    noise_gain
        By how much telling body from surface reflection multiplies noise, 1/sin of the angle between V and W.
    warnings
        Sentences for the user, each with a remedy.
    """

    picture: Picture
    white: NDArray[np.float64]
    reference: NDArray[np.float64]
    pixel: tuple[int, int] | None
    mask: NDArray | None
    model: str
    noise_gain: float
    warnings: tuple[str, ...]

    def matrix(
        self, target: ArrayLike, target_white: ArrayLike | None = None, residual: str | float = "fade"
    ) -> NDArray[np.float64]:
        """(3, 3) matrix that recolors the region's pixels; see :func:`dichromatic.recolor_matrix`.

        Parameters
        ----------
        target
            (3,) linear RGB that the reference shall have, V', under the new light.
        target_white
            (3,) white W' of the new light; None for an unchanged light.
        residual
            "fade" (the house rule, :func:`dichromatic.carried_residual`), "keep", "drop", or a share 0..1.

        Raises
        ------
        TargetError, WhiteError
            If the target or its white is not three ordinary numbers.
        """
        share = dichromatic.residual_share(residual, self.reference, target, self.white, target_white)
        return dichromatic.recolor_matrix(self.reference, target, self.white, target_white, self.model, residual=share)

    def region(
        self, target: ArrayLike, target_white: ArrayLike | None = None, residual: str | float = "fade"
    ) -> recoloring.RegionMatrix:
        """Everything that :func:`recolor.recolor` needs to put the region into the target color."""
        return recoloring.RegionMatrix(self.matrix(target, target_white, residual), self.mask, self.edge)

    def recolor(
        self,
        target: ArrayLike,
        target_white: ArrayLike | None = None,
        *,
        residual: str | float = "fade",
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Put the product into another color, under another light if wanted.

        Parameters
        ----------
        target, target_white, residual
            As for :meth:`matrix`.
        out
            (height, width, 3) float32 array for the result; None for a new one.

        Returns
        -------
        (height, width, 3) float32 scene-linear RGB, neither clipped nor brought into gamut.
        """
        region = self.region(target, target_white, residual)
        return recoloring.recolor(self.picture, [region], out=out)[0]

    @cached_property
    def edge(self) -> Edge | None:
        """The product's share of the light in pixels that the mask covers in part."""
        return None if self.mask is None else unmix_edge(self.picture, self.mask)

    @cached_property
    def _coefficients(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return dichromatic.fit(self.picture.linear(), self.reference, self.white, self.model)

    @property
    def A(self) -> NDArray[np.float32]:  # noqa: N802, the paper's symbol
        """(height, width) float32: body reflection relative to the reference; Eq. (29)."""
        return self._coefficients[0]

    @property
    def B(self) -> NDArray[np.float32]:  # noqa: N802, the paper's symbol
        """(height, width) float32: surface reflection relative to the white; Eq. (30). 0 under "body"."""
        return self._coefficients[1]

    @cached_property
    def residual(self) -> NDArray[np.float32]:
        """(height, width) float32 >= 0: distance from the model in linear RGB; Eq. (32)."""
        return dichromatic.residual(self.picture.linear(), self.reference, self.white, self.model)

    @cached_property
    def noise(self) -> stability.Noise:
        """Noise of the photo in linear light."""
        return stability.estimate_noise(self.picture)

    def predicted_error(self, target: ArrayLike, target_white: ArrayLike | None = None) -> NDArray[np.float32]:
        """Estimate of the color error of a recolor, before it is made.

        Two parts, added as squares. What the model does not explain of a pixel may or may not belong to the new
        color: the difference between carrying the residual over whole and dropping it, which counts the more the
        farther the target is. And the photo's noise, as the recolor matrix multiplies it beyond what the photo has.

        Parameters
        ----------
        target, target_white
            As for :meth:`matrix`.

        Returns
        -------
        (height, width) float32 CIEDE2000, 0 outside the mask. A first-order estimate, not calibrated.
        """
        return stability.predicted_error(
            self.picture,
            self.matrix(target, target_white, "drop"),
            self.matrix(
                target, target_white, 1 - dichromatic.carried_residual(self.reference, target, self.white, target_white)
            ),
            self.noise,
            self.white if target_white is None else dichromatic.as_white(target_white),
            self.mask,
        )

    @cached_property
    def report(self) -> dict[str, object]:
        """Figures about the fit, plain values, for `inspect` and for machines.

        The residual is on the paper's scale of 0..255 (it states 0.27 for a plastic cup), over the region.
        """
        pixels = self.picture.sample(_SAMPLE, self.mask)
        left = dichromatic.residual(pixels, self.reference, self.white, self.model) * 255
        clip = self.picture.clip_level
        return {
            "model": self.model,
            "reference": [float(v) for v in self.reference],
            "reference_pixel": list(self.pixel) if self.pixel else None,
            "white": [float(v) for v in self.white],
            "noise_gain": float(self.noise_gain) if np.isfinite(self.noise_gain) else None,
            "residual_mean": float(left.mean()),
            "residual_p95": float(np.quantile(left, 0.95)),
            "clipped_share": float((pixels.max(axis=1) >= clip).mean()),
            "covered_share": 1.0 if self.mask is None else float(as_weights(self.mask).mean(dtype=np.float64)),
            "warnings": list(self.warnings),
        }


def analyze(
    image: ArrayLike | Picture,
    white: ArrayLike | None = None,
    reference: ArrayLike | Sequence[int] | None = None,
    mask: ArrayLike | None = None,
    model: str = "auto",
) -> Analysis:
    """Find how a product's color is made up in a photo, so that it can be recolored.

    Parameters
    ----------
    image
        (height, width, 3) float, scene-linear RGB, top row first; or a `Picture`. Not modified.
    white
        (3,) response to a perfect white diffuser under the photo's light; None for ones, a photo that is
        white-balanced.
    reference
        (x, y) pixel of the product, matte and lit (a small window around it is averaged); or (r, g, b) linear;
        None to find the product's matte color in the mask.
    mask
        (height, width) coverage of the product, 0..1 (or bool, or integer codes); None for the whole picture.
    model
        "dichromatic": body and surface reflection. "body": body reflection alone, for products that are almost
        grey. "auto": dichromatic unless the reference is so near to grey that the two cannot be told apart.

    Returns
    -------
    Analysis

    Raises
    ------
    ImageError
        If the image is no picture, or the model is unknown.
    WhiteError, ReferenceColorError, MaskError
        If the white, the reference or the mask cannot be used; the sentence says why and what to do.
    """
    if model not in MODELS:
        raise ImageError(f"Model '{model}' is not known: use one of {', '.join(MODELS)}.")
    picture = Picture.of(image)
    w = dichromatic.as_white(white)
    m = as_mask(mask, picture.shape)
    if reference is None:
        _check_finite(picture)
    found = _find_reference(picture, reference, w, m)
    _check_finite(picture)
    if white is not None and model != "body" and np.allclose(found.color, w, rtol=1e-6, atol=0):
        raise WhiteError(
            "The white and the reference are the same color: pick the product for the reference, and a white or grey "
            "card for the white."
        )
    gain = stability.noise_gain(found.color, w)
    warnings = []
    chosen = model
    if model == "auto":
        chosen = "dichromatic" if gain <= LARGEST_NOISE_GAIN else "body"
    if gain > LARGEST_NOISE_GAIN:
        remedy = (
            "the body model is used and highlights take the body color"
            if chosen == "body"
            else f"noise grows {gain:.0f} times; use the model 'auto' or 'body'"
        )
        warnings.append(
            f"The product is almost the color of the light, so highlights and body cannot be told apart: {remedy}. "
            "A photo of a colored sample gives a better result."
        )
    if chosen == "dichromatic":
        dichromatic.projector(found.color, w)  # says in words if it is grey to the last digit
    warnings += _warnings(picture, found, w, m)
    return Analysis(picture, w, found.color, found.pixel, m, chosen, gain, tuple(warnings))


def _check_finite(picture: Picture) -> None:
    if not np.isfinite(picture.overview).all():
        raise ImageError("Picture has NaN or infinite pixels: repair them before recoloring.")


def _find_reference(picture: Picture, reference: ArrayLike | None, white: NDArray, mask: NDArray | None) -> Reference:
    if reference is None:
        return matte_reference(picture, white, mask)
    try:
        given = np.asarray(reference)
    except ValueError:
        raise ReferenceColorError(f"Reference {reference!r} is not understood: give x, y or r, g, b.") from None
    if given.shape == (2,):
        return reference_at(picture, given, white, mask)
    return Reference(dichromatic.as_reference(given))


def _warnings(picture: Picture, found: Reference, white: NDArray, mask: NDArray | None) -> list[str]:
    said = []
    if found.gloss > _GLOSSY:
        said.append(
            f"The reference pixel is glossy (about {found.gloss:.0%} of the white): click a matte part, or leave the "
            "reference out to have one found."
        )
    if (found.color / white).max() < 4 * DARK:
        said.append("The reference is dark, so its color is uncertain: click a better lit part.")
    if mask is not None and np.count_nonzero(mask) < _FEWEST_PIXELS * mask.size:
        said.append(
            f"The region covers only {np.count_nonzero(mask)} of {mask.size} pixels: if that is not all of the "
            "product, click another part of it or raise the tolerance."
        )
    pixels = picture.sample(_SAMPLE // 4, mask) if mask is not None else picture.overview
    clipped = float((pixels.max(axis=1) >= picture.clip_level).mean())
    if clipped > 0.01:
        said.append(
            f"{clipped:.1%} of the region is clipped, its color there is a guess: use a darker exposure if there is "
            "one."
        )
    return said
