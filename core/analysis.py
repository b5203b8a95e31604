"""Look at a photo once, then recolor it as often as wanted.

`analyze` finds the footing (white, reference, model) and says how sure it is; the `Analysis` it returns recolors.
Under every model a recolor is one matrix, on the pixel and at most a few maps that belong to the photo; see `mixture`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import confidence, dichromatic, maps, stability
from . import recolor as recoloring
from .compositing import Edge, Sides, add_spill, refine_outline, rim_left_out, spill_weights
from .errors import ImageError, ReferenceColorError, WhiteError
from .interreflection import USUAL, bounced, unbounced
from .materials import find_materials
from .mixture import MODELS as _MODELS
from .mixture import Mixture
from .picture import Picture, as_mask, as_weights, bounding_box, coverage
from .reference import DARK, Reference, matte_at, matte_reference, stray, unfolded
from .selection import Evidence, choose, noise_across

MODELS = ("auto", *_MODELS)

# Noise gain above which the product counts as nearly grey.
LARGEST_NOISE_GAIN = 6.0

# Share of a region that no model explains from which it is said.
_UNEXPLAINED = 0.06

# Gloss of the highlights from which a product shines, lack of gloss elsewhere that makes a shining one more saturated
# than its own folds do (shares of the light), and noise gain up to which both are sure.
_SHINES, _SATURATED, _STRONG = 0.02, 0.03, 3.0

# Gloss in a clicked reference, as a share of the white, from which it is reported.
_GLOSSY = 0.03

# The same for light that had met the product before, as a share of the rest.
_BOUNCED = 0.05
_SAMPLE = 200_000

# Share of a region that gloss and shading do not explain from which it may lie in folds, and from which its palest
# color may be that of the lamps alone; mean square of the bounce, against the usual one, that folds have at least; and
# the part of what was not explained that another reference may leave.
_FOLDS, _PALE_FOLDS, _DEEP, _MUCH_LESS = 0.015, 0.06, 0.4, 0.6

# Bounce that a click may hold which is odd in its region: more of it is a material of another kind, as silk is.
_ODD_BOUNCE = 0.3

# Pixels that the predicted error is found at: for its map, and for the region; and those in one go.
_MAPPED, _LOOKED_AT, _AT_ONCE = 1_000_000, 1_000, 10_000

# Share of the picture under which a region is so small that a click has probably missed the product.
_FEWEST_PIXELS = 0.001

# Width in pixels, and more, of a rim of the product outside the mask that is worth a word.
_RIM = 1.0


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
    selection
        (height, width) coverage of the product as it was given, or None for the whole picture.
    evidence
        What the pixels show, and the model that was chosen or asked for.
    noise_gain
        By how much telling body from surface reflection multiplies noise, 1/sin of the angle between V and W.
    warnings
        Sentences for the user, each with a remedy.
    gloss
        Surface reflection that was found in the reference pixel and left out of `reference`, as a share of the white.
    bounce, light
        What was found in the reference pixel besides gloss is ``light * v + bounce * bounced(v)``, see
        `interreflection`; `reference` is the first part, for the second is light that had met the product before.
    stray
        CIEDE2000, lightness apart, between the color that was clicked and that of most of the product; 0 for an
        ordinary click.
    spill
        Whether what shows of the product outside the selection is recolored too: its rim where the selection is too
        tight, and the light that it throws on a neutral surround.
    """

    picture: Picture
    white: NDArray[np.float64]
    reference: NDArray[np.float64]
    pixel: tuple[int, int] | None
    selection: NDArray | None
    evidence: Evidence
    noise_gain: float
    warnings: tuple[str, ...]
    gloss: float = 0.0
    bounce: float = 0.0
    light: float = 1.0
    stray: float = 0.0
    spill: bool = False

    def matte_target(self, color: ArrayLike, target_white: ArrayLike | None = None) -> NDArray[np.float64]:
        """(3,) target for a color that was read with its gloss, at the same place of a photo of a real sample.

        The paper reads its targets so. Targets are matte colors: a swatch, or what a matte pixel shall show; the
        gloss of the reference pixel is not in them and stays on top, and so does light that had met the product before.
        """
        white = self.white if target_white is None else dichromatic.as_white(target_white)
        return unbounced(dichromatic.as_target(color) / white - self.gloss, self.bounce, self.light) * white

    def matrix(
        self, target: ArrayLike, target_white: ArrayLike | None = None, residual: str | float = "fade"
    ) -> NDArray[np.float64]:
        """(3, 3 + n) matrix that recolors the region's pixels and their n corrections, :attr:`extra`.

        Parameters
        ----------
        target
            (3,) linear RGB that the product shall have at the reference, V', under the new light; matte, see
            :meth:`matte_target`.
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
        white = self.white if target_white is None else dichromatic.as_white(target_white)
        return self.mixture.matrix(dichromatic.as_target(target), white, share)

    def region(
        self, target: ArrayLike, target_white: ArrayLike | None = None, residual: str | float = "fade"
    ) -> recoloring.RegionMatrix:
        """Everything that :func:`recolor.recolor` needs to put the region into the target color."""
        return recoloring.RegionMatrix(self.matrix(target, target_white, residual), self.mask, self.edge, self.extra)

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
    def extra(self) -> NDArray | None:
        """(height, width, n) corrections that :meth:`matrix` takes after red, green and blue; None if n is 0.

        They depend on the photo alone, so that a new target only needs a new matrix.
        """
        if self.mixture.projector.shape[1] == 3:
            return None
        return maps.corrections(self._maps, self.mask, self.edge)

    @property
    def model(self) -> str:
        """Name of the model, one of `mixture.MODELS`."""
        return self.evidence.mixture.model

    @cached_property
    def _maps(self) -> maps.Region:
        pixels = self.picture.sample(_SAMPLE // 4, self.selection)
        clipped = bool((pixels >= self.picture.clip_level).any())
        e = self.evidence
        return maps.Region(self.picture, self.selection, e.mixture, e.noise, clipped, e.below, e.shines, e.body_noise)

    @cached_property
    def mixture(self) -> Mixture:
        """The model as :meth:`matrix` uses it, with what restores clipped pixels."""
        return maps.with_corrections(self.evidence.mixture, self._maps.clipped)

    @cached_property
    def _outline(self) -> tuple[NDArray | None, Edge | None]:
        if self.selection is None:
            return None, None
        splits, seen = self.evidence.mixture.keeps_white, (self.picture, self.selection, self.reference, self.white)
        # Metal mirrors, and throws no light of its color around.
        spill = spill_weights(*seen) if self.spill and self.model != "metal" else None
        sides = self.__dict__.pop("_sides", None)
        if splits or spill is None:
            return refine_outline(*seen, splits=splits, spill=spill, sides=sides)
        outline = refine_outline(*seen, splits=False, sides=sides)
        return add_spill(self.picture, *outline, spill, self.reference, self.white)

    @property
    def mask(self) -> NDArray | None:
        """(height, width) coverage that is recolored: the selection, its outline refined, with the spill if asked."""
        return self._outline[0]

    @property
    def edge(self) -> Edge | None:
        """The product's share of the light in the pixels of its outline."""
        return self._outline[1]

    @cached_property
    def _coefficients(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        rows = np.stack([self.mixture.coefficient(term) for term in ("body", "white")]).astype(np.float32)
        both = self.picture.linear() @ rows[:, :3].T
        if self.extra is not None:
            both += self.extra @ rows[:, 3:].T
        return both[..., 0], both[..., 1]

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
        return self._left_over(self.picture.linear(), self.extra)

    def _left_over(self, linear: NDArray, extra: NDArray | None) -> NDArray[np.float32]:
        matrix = self.mixture.left_over.astype(np.float32)
        left = linear @ matrix[:, :3].T
        if extra is not None:
            left += extra @ matrix[:, 3:].T
        return np.linalg.norm(left, axis=-1)

    @cached_property
    def noise(self) -> stability.Noise:
        """Noise of the photo in linear light."""
        return stability.estimate_noise(self.picture)

    def predicted_error(self, target: ArrayLike, target_white: ArrayLike | None = None) -> NDArray[np.float32]:
        """Color error to expect of a recolor at every pixel, before it is made; see `confidence`.

        Parameters
        ----------
        target, target_white
            As for :meth:`matrix`.

        Returns
        -------
        (height, width) float32 CIEDE2000, calibrated on the laboratory: half of the pixels stay below it, 90 % below
        `confidence.PIXEL_BOUND` times it. 0 outside the selection. Large photos are looked at on a grid.
        """
        doubt = self.doubt(target, target_white)
        height, width = self.picture.shape
        step = max(1, int(np.ceil(np.sqrt(height * width / _MAPPED))))
        inside = np.ones((height, width), bool) if self.selection is None else self.selection > 0
        rows, columns = np.nonzero(inside[::step, ::step])
        coarse = np.zeros(inside[::step, ::step].shape, np.float32)
        for start in range(0, len(rows), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            coarse[rows[part], columns[part]] = doubt.errors(rows[part] * step, columns[part] * step)
        if step > 1:
            coarse = coarse.repeat(step, axis=0)[:height].repeat(step, axis=1)[:, :width]
        return np.where(inside, coarse, np.float32(0))

    def predicted(self, target: ArrayLike, target_white: ArrayLike | None = None) -> confidence.Prediction:
        """Color error to expect of the region as a whole, before it is recolored.

        Parameters
        ----------
        target, target_white
            As for :meth:`matrix`.
        """
        prediction = self.doubt(target, target_white).predict(self._sample)
        flagged = prediction.flagged or self.stray > 0
        return replace(prediction, flagged=flagged, warnings=(*prediction.warnings, *self.warnings))

    def doubt(self, target: ArrayLike, target_white: ArrayLike | None = None) -> confidence.Doubt:
        """What the prediction for one target is made from."""
        white = self.white if target_white is None else dichromatic.as_white(target_white)
        v = dichromatic.as_target(target)
        return confidence.Doubt(self._grounds, self.matrix(v, white), v, white)

    @cached_property
    def _grounds(self) -> confidence.Grounds:
        """What makes predictions uncertain, for all targets."""
        e = self.evidence
        noise = e.noise if e.noise.read else noise_across(self.picture, self.reference, self.white)
        split_noise = e.figures.get("split_noise", 0.0)
        return confidence.Grounds(
            self.picture, self.extra, self.mixture, noise, self.noise_gain, split_noise, e.hidden, e.other
        )

    @cached_property
    def _sample(self) -> confidence.Sample:
        """Pixels that are to stand for the region."""
        return self._grounds.sample(*self._looked_at())

    def _looked_at(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of pixels all over the region, well inside it."""
        height, width = self.picture.shape
        box = (slice(0, height), slice(0, width)) if self.selection is None else bounding_box(self.selection)
        step = max(1, int(np.sqrt((box[0].stop - box[0].start) * (box[1].stop - box[1].start) / _LOOKED_AT)))
        while True:
            rows, columns = np.mgrid[
                box[0].start + step // 2 : box[0].stop : step, box[1].start + step // 2 : box[1].stop : step
            ].reshape(2, -1)
            if self.selection is None:
                return rows, columns
            cover = as_weights(self.selection[rows, columns])
            inside = cover > 0.95 * min(1.0, float(cover.max(initial=0.0)))
            if step == 1 or 2 * np.count_nonzero(inside) >= _LOOKED_AT:
                return rows[inside], columns[inside]
            step //= 2  # the region fills little of its box

    def thinned(self, step: int) -> Analysis:
        """Return the same findings on every step-th pixel of every step-th row, for small maps of A, B and residual."""
        if step == 1:
            return self

        def thin[T: NDArray | None](values: T) -> T:
            return values if values is None else values[::step, ::step]  # type: ignore[return-value]

        picture = Picture(thin(self.picture.pixels), self.picture.curve)
        small = replace(self, picture=picture, selection=thin(self.selection))
        # What was found in the whole photo is not to be found again in the small one.
        small.__dict__.update(extra=thin(self.extra), _maps=self._maps, mixture=self.mixture)
        return small

    @cached_property
    def report(self) -> dict[str, object]:
        """Figures about the fit, plain values, for `inspect` and for machines.

        The residual is on the paper's scale of 0..255 (it states 0.27 for a plastic cup), over the region.
        """
        pixels = self.picture.sample(_SAMPLE, self.selection, self.extra)
        left = self._left_over(pixels[:, :3], None if self.extra is None else pixels[:, 3:]) * 255
        clip = self.picture.clip_level
        return {
            "model": self.model,
            "reference": [float(v) for v in self.reference],
            "reference_pixel": list(self.pixel) if self.pixel else None,
            "white": [float(v) for v in self.white],
            "noise_gain": float(self.noise_gain) if np.isfinite(self.noise_gain) else None,
            "residual_mean": float(left.mean()),
            "residual_p95": float(np.quantile(left, 0.95)),
            "clipped_share": float((pixels[:, :3].max(axis=1) >= clip).mean()),
            "evidence": {name: float(value) for name, value in self.evidence.figures.items()},
            "covered_share": 1.0 if self.selection is None else coverage(self.selection),
            "warnings": list(self.warnings),
        }


def analyze(
    image: ArrayLike | Picture,
    white: ArrayLike | None = None,
    reference: ArrayLike | Sequence[int] | None = None,
    mask: ArrayLike | None = None,
    model: str = "auto",
    spill: bool = False,
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
        (x, y) pixel of the product, lit and not in a highlight: a small window around it is averaged, and the gloss
        found in it is left out. Or (r, g, b) linear, which is taken as it is; None to find the product's matte
        color in the mask.
    mask
        (height, width) coverage of the product, 0..1 (or bool, or integer codes); None for the whole picture.
    model
        "auto": the simplest that leaves nothing beyond the noise, see `selection`. Or one of `mixture.MODELS`:
        "dichromatic", body and surface reflection; "body", body reflection alone; "regularized", "bounce", "lights",
        "metal".
    spill
        Recolor what shows of the product outside the mask too: its rim where the mask is a few pixels too tight, and
        the light that it throws on a neutral surround (:func:`compositing.spill_weights`).

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
    found, evidence, apart = _look(picture, found, w, m, model)
    gain = stability.noise_gain(found.color, w)
    warnings = (
        reference_warnings(found, w, model)
        + _stray_warnings(apart)
        + _evidence_warnings(evidence)
        + _region_warnings(picture, m)
        + _material_warnings(picture, w, m)
    )
    sides = None
    if m is not None and not spill:
        sides = Sides.of(m)
        warnings += _rim_warnings(rim_left_out(picture, sides, found.color, w))
    made = Analysis(
        picture,
        w,
        found.color,
        found.pixel,
        m,
        evidence,
        gain,
        tuple(warnings),
        found.gloss,
        found.bounce,
        found.light,
        apart,
        spill,
    )
    made.__dict__["_sides"] = sides  # until the outline is found
    return made


def _look(
    picture: Picture, found: Reference, white: NDArray, mask: NDArray | None, model: str
) -> tuple[Reference, Evidence, float]:
    """Choose the model, and the reference with it: what sets a click apart from its region may be gloss or folds.

    Returns them, and how odd the reference is, see :func:`_apart`.
    """
    evidence = choose(picture, found.color, white, mask, found.pixel, model)
    apart = _apart(found, white, mask, evidence)
    if model not in ("auto", "bounce"):
        return found, evidence, apart
    odd = apart > 0
    for other in unfolded(found, white) if odd or evidence.broken > _FOLDS else ():
        if other.palest and not odd and evidence.broken < _PALE_FOLDS:
            continue
        folds = choose(picture, other.color, white, mask, found.pixel, model)
        if _fits_better(other, folds, evidence, odd):
            return other, folds, _apart(other, white, mask, folds)
    if found.gloss > 0 and evidence.mixture.model != "dichromatic":
        # Folds are more saturated than a matte ridge, which makes it look glossy beside them.
        read = found.as_read(white)
        folds = choose(picture, read.color, white, mask, read.pixel, model)
        if folds.matte:
            return read, folds, _apart(read, white, mask, folds)
    return found, evidence, apart


def _fits_better(other: Reference, folds: Evidence, evidence: Evidence, odd: bool) -> bool:
    """Whether what a region shows about a reference that was parted from its bounce speaks for it."""
    if folds.matte:
        return not other.palest or folds.figures["bounce"] > _DEEP
    if other.palest:
        return False
    return folds.broken < _MUCH_LESS * evidence.broken or (odd and other.bounce < _ODD_BOUNCE)


def _apart(found: Reference, white: NDArray, mask: NDArray | None, evidence: Evidence) -> float:
    """Color difference of an odd click from most of its region; 0 of an ordinary one."""
    return stray(found, white, evidence.matte) if mask is not None and found.pixel is not None else 0.0


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
        return matte_at(picture, given, white, mask)
    return Reference(dichromatic.as_reference(given))


def reference_warnings(found: Reference, white: NDArray, model: str = "auto") -> list[str]:
    """Sentences for the user on a reference color: almost grey, glossy or dark; each with a remedy.

    Parameters
    ----------
    found
        From :func:`reference.matte_at`.
    white
        (3,) white of the light.
    model
        That is asked for.
    """
    said = []
    gain = stability.noise_gain(found.color, white)
    if gain > LARGEST_NOISE_GAIN:
        remedy = (
            f"noise grows {gain:.0f} times; use the model 'auto' or 'body'"
            if model == "dichromatic"
            else "highlights are kept only as far as the noise allows, and else take the body color"
        )
        said.append(
            f"The product is almost the color of the light, so highlights and body are hard to tell apart: {remedy}. "
            "A photo of a colored sample gives a better result."
        )
    if found.gloss > _GLOSSY:
        said.append(
            f"The reference pixel is glossy (about {found.gloss:.0%} of the white): the target is given to the matte "
            "color under it, and the gloss stays on top; click a matte part if the pixel shall read the target."
        )
    body = found.color / white
    if found.bounce * np.linalg.norm(bounced(body / found.light, USUAL)) > _BOUNCED * np.linalg.norm(body):
        said.append(
            "The reference pixel lies in light that the product throws on itself: the target is given to the color "
            "that lamps alone show there; click an open, lit part if the pixel shall read the target."
        )
    if body.max() < 4 * DARK:
        said.append("The reference is dark, so its color is uncertain: click a better lit part.")
    return said


def _evidence_warnings(evidence: Evidence) -> list[str]:
    """Sentences on what the chosen model does not explain, each with a remedy."""
    chosen, figures = evidence.mixture.model, evidence.figures
    if chosen == "lights":
        return [
            "Light of more than one color falls on the product, or it is metal: its highlights are a guess; use the "
            "model 'metal' if it is, or even light for another photo."
        ]
    if chosen == "metal" and figures:
        return [
            "The product looks like metal, or lies in light of more than one color without gloss: each channel is "
            "scaled by itself; check the result against a sample."
        ]
    strong = stability.noise_gain(evidence.mixture.body, evidence.mixture.white) < _STRONG
    if strong and figures.get("highlights", 0.0) > _SHINES and figures.get("least_gloss", 0.0) < -_SATURATED:
        return [
            "Parts of the product are more saturated than its matte color, though it shines: light that came through "
            "it (translucent material) or a sheen of its own color (silk) comes out with errors; check the result "
            "against a sample."
        ]
    left = max(figures.get("negative_gloss", 0.0), figures.get("residual", 0.0))
    if chosen in ("dichromatic", "regularized") and left > _UNEXPLAINED:
        return [
            f"{left:.0%} of the product has colors that gloss, shading and folds do not explain: silk, translucent or "
            "patterned material comes out with errors; check the result against a sample, or select less."
        ]
    return []


def _material_warnings(picture: Picture, white: NDArray, mask: NDArray | None) -> list[str]:
    """A sentence if a region holds several materials; a whole picture does anyway."""
    found = find_materials(picture, white, mask) if mask is not None else []
    if len(found) < 2:
        return []
    parts = ", ".join(f"{m.share:.0%} around {m.click}" for m in found)
    return [
        f"The region holds {len(found)} materials ({parts}) and is recolored as one: make each a region of its own, "
        "selected by a click there."
    ]


def _stray_warnings(apart: float) -> list[str]:
    if apart == 0:
        return []
    return [
        f"The reference pixel has another color than most of the region ({apart:.1f} CIEDE2000): click where the "
        "product has its own color, or select what has that of the pixel."
    ]


def _rim_warnings(width: float) -> list[str]:
    if width < _RIM:
        return []
    return [
        f"The mask leaves out a rim of the product about {width:.0f} pixels wide, which keeps its old color: grow the "
        "mask by as much."
    ]


def _region_warnings(picture: Picture, mask: NDArray | None) -> list[str]:
    said = []
    if mask is not None and np.count_nonzero(mask) < _FEWEST_PIXELS * mask.size:
        said.append(
            f"The region covers only {np.count_nonzero(mask)} of {mask.size} pixels: if that is not all of the "
            "product, click another part of it or raise the tolerance."
        )
    pixels = picture.sample(_SAMPLE // 4, mask) if mask is not None else picture.overview
    # Channel by channel: a maximum over three numbers at a time takes ten times as long.
    clipped = float(np.logical_or.reduce([pixels[:, k] >= picture.clip_level for k in range(3)]).mean())
    if clipped > 0.01:
        said.append(
            f"{clipped:.1%} of the region is clipped, its color there is a guess: use a darker exposure if there is "
            "one."
        )
    return said
