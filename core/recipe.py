"""What a user asks for, and its translation into the numbers that the method works with.

Every front end fills in a `Recipe` and calls `prepare`, so that the same recipe means the same everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import colorimetry, spectra
from .analysis import Analysis, analyze
from .colorspace import SRGB, RGBSpace
from .confidence import Prediction
from .dichromatic import as_white
from .errors import MaskError, RecipeError, TargetError
from .picture import Picture, as_mask
from .recolor import RegionMatrix
from .reference import SURE_WHITE, white_at, white_from_highlights
from .region import region_from_clicks
from .swatches import Swatch

MEANINGS = ("reference", "product")
OBSERVERS = ("1931", "1964")
ADAPTATIONS = ("cat16", "bradford")


@dataclass(frozen=True)
class Region:
    """One product, or one material of it, in a photo.

    Attributes
    ----------
    target
        The color to put it into; None to keep its color (for a change of the illuminant alone).
    reference
        (x, y) pixel, (r, g, b) linear, or None to find it in the mask.
    mask
        "click" (what the reference pixel shows), "alpha" (what the photo's alpha covers), a file for the
        `read_mask` of `prepare`, an array, or None for the whole picture.
    click
        (x, y) that chooses the region, when it is not the reference pixel.
    added, removed
        Further clicks, whose materials are added to a clicked region or taken away from it.
    tolerance
        Of a clicked region, see :func:`region.region_from_clicks`.
    meaning
        "reference": the product shall have the target color in the light that falls on the reference pixel. A matte
        pixel reads exactly that; gloss in it is found and stays on top. (For a target that was read with its gloss
        give the reference as a color.) "product": the product shall have the target reflectance, in the light that
        falls on the reference.
    source
        The product's present color as a swatch: from it and the reference, "product" takes the exposure. Without
        it the white must have been read where the reference is.
    model, residual
        See :func:`analysis.analyze` and :meth:`analysis.Analysis.matrix`.
    spill
        Recolor what shows of the product outside the mask too: the rim that a mask too tight leaves, and the light
        thrown on a neutral surround.
    name
        What the user calls it; colorways in recipe files and warnings name regions by it.
    """

    target: Swatch | None = None
    reference: tuple[float, ...] | None = None
    mask: str | NDArray | None = None
    click: tuple[int, int] | None = None
    tolerance: float = 1.0
    meaning: str = "reference"
    source: Swatch | None = None
    model: str = "auto"
    residual: str | float = "fade"
    name: str = ""
    added: tuple[tuple[int, int], ...] = ()
    removed: tuple[tuple[int, int], ...] = ()
    spill: bool = False


@dataclass(frozen=True)
class Colorway:
    """A named set of targets for the regions of a photo.

    Attributes
    ----------
    name
        As shown to the user, and in file names.
    targets
        One for each region; None for a region that keeps the color it has in the photo.
    """

    name: str
    targets: tuple[Swatch | None, ...]


@dataclass(frozen=True)
class Recipe:
    """All that is asked of one photo.

    Attributes
    ----------
    regions
        Where they overlap, a later one lies over an earlier one.
    white
        (x, y) of a white or grey card, (r, g, b) linear, "highlights", an illuminant's name or color temperature,
        or None: a photo that is white-balanced (a raw photo: the camera's own white).
    gray
        Reflectance of the card that `white` points at.
    illuminant
        The new light, as (r, g, b) or by name; None for an unchanged light.
    observer, camera, adaptation
        For swatches and illuminants, see :meth:`swatches.Swatch.to_linear`.
    colorways
        Sets of targets that the same photo is wanted in, besides those of the regions themselves.
    """

    regions: tuple[Region, ...] = field(default_factory=lambda: (Region(),))
    white: str | tuple[float, ...] | None = None
    gray: float = 1.0
    illuminant: str | tuple[float, ...] | None = None
    observer: str = "1931"
    camera: str | None = None
    adaptation: colorimetry.Adaptation = "cat16"
    colorways: tuple[Colorway, ...] = ()

    def footing(self) -> Recipe:
        """Return the part that the look at the photo depends on; the rest may change without another look."""
        plain = [
            replace(region, target=_ANY, meaning=MEANINGS[0], source=None, residual="fade", name="")
            for region in self.regions
        ]
        return replace(self, regions=tuple(plain), illuminant=None, adaptation="cat16", colorways=())


_ANY = Swatch.from_linear((0.5, 0.5, 0.5))


@dataclass(frozen=True, eq=False)
class Prepared:
    """A recipe looked at against its photo: everything but the target colors, which may change cheaply.

    Attributes
    ----------
    recipe
        What was asked for.
    space
        RGB space of the photo.
    white, target_white
        (3,) whites W and W' of the old and the new light.
    analyses
        One for each region.
    white_source
        Where the white came from, in words.
    white_warnings
        Sentences for the user about the white, each with a remedy.
    """

    recipe: Recipe
    space: RGBSpace
    white: NDArray[np.float64]
    target_white: NDArray[np.float64]
    analyses: tuple[Analysis, ...]
    white_source: str
    white_warnings: tuple[str, ...] = ()

    def target(self, index: int = 0, swatch: Swatch | None = None) -> NDArray[np.float64]:
        """(3,) linear RGB that region `index` shall have at its reference, V', for its own or another swatch."""
        region, analysis = self.recipe.regions[index], self.analyses[index]
        swatch = region.target if swatch is None else swatch
        if swatch is None:
            return analysis.reference * self.target_white / self.white
        r = self.recipe
        light = r.illuminant if isinstance(r.illuminant, str) else None
        old_light = r.white if isinstance(r.white, str) and r.white != "highlights" else None
        if region.meaning == "reference":
            return swatch.to_linear(self.space, light, r.observer, r.camera, r.adaptation)
        new = swatch.to_reflected(self.space, self.target_white, light or old_light, r.observer, r.camera, r.adaptation)
        if region.source is None:
            return new
        old = region.source.to_reflected(self.space, self.white, old_light, r.observer, r.camera, r.adaptation)
        # Exposure: how much light falls on the reference, by the channels that carry it.
        return new * float(analysis.reference @ old / (old @ old))

    def regions(self, swatches: Sequence[Swatch | None] | None = None) -> list[RegionMatrix]:
        """What :func:`recolor.recolor` needs, for the recipe's own targets or for those of another colorway."""
        chosen: Sequence[Swatch | None] = swatches or [None] * len(self.analyses)
        if len(chosen) != len(self.analyses):
            raise RecipeError(f"{len(chosen)} targets are given for {len(self.analyses)} regions: give one for each.")
        return [self._matrix(k, swatch) for k, swatch in enumerate(chosen)]

    def _matrix(self, index: int, swatch: Swatch | None) -> RegionMatrix:
        region, analysis = self.recipe.regions[index], self.analyses[index]
        if swatch is None and region.target is None and np.array_equal(self.white, self.target_white):
            return RegionMatrix(np.eye(3), analysis.mask)  # kept to the last bit, whatever the model
        return analysis.region(self.target(index, swatch), self.target_white, region.residual)

    def asking(self, recipe: Recipe) -> Prepared:
        """Return the same look at the photo for a recipe of the same footing: other targets, another new light."""
        return replace(self, recipe=recipe, target_white=_target_white(recipe, self.space, self.white))

    def for_colorway(self, colorway: Colorway) -> Prepared:
        """Return the same analyses with the targets of a colorway, without another look at the photo."""
        return replace(self, recipe=with_colorway(self.recipe, colorway))

    @cached_property
    def predictions(self) -> list[Prediction | None]:
        """What to expect of each region, for the recipe's own targets; None for one that nothing changes."""
        same = np.array_equal(self.white, self.target_white)
        return [
            None
            if same and self.recipe.regions[k].target is None
            else analysis.predicted(self.target(k), self.target_white)
            for k, analysis in enumerate(self.analyses)
        ]

    @cached_property
    def warnings(self) -> list[str]:
        """Sentences for the user: about the white, and all regions that the recipe's targets or colorways change."""
        said = list(self.white_warnings)
        for k, (region, analysis) in enumerate(zip(self.recipe.regions, self.analyses, strict=True)):
            asked = [region.target, *(colorway.targets[k] for colorway in self.recipe.colorways)]
            if all(target is None for target in asked) and np.array_equal(self.white, self.target_white):
                continue
            name = f"Region '{region.name}'" if region.name else f"Region {k + 1}"
            prediction = self.predictions[k] if region.target is not None else None
            found = analysis.warnings if prediction is None else prediction.warnings
            said += [f"{name}: {warning}" if len(self.analyses) > 1 else warning for warning in found]
        return said


def check(recipe: Recipe) -> None:
    """Find what is wrong with a recipe before there is a photo.

    Raises
    ------
    DyehouseError
        The first problem, if there is one.
    """
    if not recipe.regions:
        raise RecipeError("The recipe has no region: give at least one.")
    for given, known, what in (
        (recipe.adaptation, ADAPTATIONS, "Adaptation"),
        (recipe.observer, OBSERVERS, "Observer"),
    ):
        if given not in known:
            raise RecipeError(f"{what} '{given}' is not known: use {' or '.join(known)}.")
    if recipe.camera is not None:
        spectra.camera_sensitivities(recipe.camera)  # says in words if there is none
    for region in recipe.regions:
        if region.meaning not in MEANINGS:
            raise RecipeError(f"Meaning '{region.meaning}' is not known: use one of {', '.join(MEANINGS)}.")
    if recipe.illuminant is None and not recipe.colorways and all(r.target is None for r in recipe.regions):
        raise TargetError("There is no target color and no new illuminant: give at least one of them.")
    for colorway in recipe.colorways:
        with_colorway(recipe, colorway)  # says in words if it does not fit


def prepare(
    picture: Picture,
    recipe: Recipe,
    *,
    space: RGBSpace = SRGB,
    photo_white: ArrayLike | None = None,
    alpha: NDArray | None = None,
    read_mask: Callable[[str], NDArray] | None = None,
) -> Prepared:
    """Analyze a photo for a recipe.

    Parameters
    ----------
    picture
        The photo.
    recipe
        What is asked for.
    space
        RGB space of the photo.
    photo_white
        (3,) white that came with the photo, for a recipe that gives none.
    alpha
        (height, width) alpha of the photo, codes or 0..1, for masks that ask for it.
    read_mask
        Turns the name of a mask file into (height, width) coverage.

    Returns
    -------
    Prepared

    Raises
    ------
    DyehouseError
        If any part of the recipe cannot be used on this photo.
    """
    check(recipe)
    white, source = white_asked(picture, recipe, space, photo_white)
    masks = [_mask(picture, region, white, alpha, read_mask) for region in recipe.regions]
    unsure: tuple[str, ...] = ()
    if recipe.white == "highlights":
        white, confidence = white_from_highlights(picture, light_colors(space), masks[0])
        source = f"highlights (confidence {confidence:.0%})"
        if confidence < SURE_WHITE:
            unsure = (
                f"The highlights tell the color of the light with {confidence:.0%} confidence only: click a white or "
                "grey card, or name the light.",
            )
    has_white = recipe.white is not None or photo_white is not None
    analyses = tuple(
        analyze(picture, white if has_white else None, region.reference, mask, region.model, region.spill)
        for region, mask in zip(recipe.regions, masks, strict=True)
    )
    return Prepared(recipe, space, white, _target_white(recipe, space, white), analyses, source, unsure)


def light_colors(space: RGBSpace) -> NDArray[np.float64]:
    """(n, 3) linear RGB, of luminance 1, of black bodies and daylights from 2000 K to 12000 K."""
    mired = np.arange(1e6 / 12000, 1e6 / 2000, 4.0)
    whites = [colorimetry.xyz_to_linear(spectra.to_xyz(float(1e6 / m)), space) for m in mired]
    return np.array([w for w in whites if w.min() > 0])


def white_asked(
    picture: Picture, recipe: Recipe, space: RGBSpace, photo_white: ArrayLike | None
) -> tuple[NDArray[np.float64], str]:
    """(3,) white that a recipe gives a photo, and where it comes from in words; ones for one to be found in highlights.

    Parameters and errors as for :func:`prepare`.
    """
    if not 0 < recipe.gray <= 1:
        raise RecipeError(f"Reflectance {recipe.gray} of the card is not in 0..1: a grey card has 0.18.")
    asked = recipe.white
    if asked is None:
        if photo_white is not None:
            return as_white(photo_white), "the camera's white balance"
        return np.ones(3), "taken as balanced"
    if asked == "highlights":
        return np.ones(3), "highlights"
    if isinstance(asked, str):
        return colorimetry.illuminant_white(asked, space, recipe.observer, recipe.camera), f"illuminant {asked}"
    if len(asked) == 2:
        return white_at(picture, asked, recipe.gray), f"pixel ({asked[0]:.0f}, {asked[1]:.0f})"
    return as_white(asked), "given"


def _target_white(recipe: Recipe, space: RGBSpace, white: NDArray) -> NDArray[np.float64]:
    asked = recipe.illuminant
    if asked is None:
        return white
    if isinstance(asked, str):
        # A light by name has no strength: the new one is as bright as the old.
        new = colorimetry.illuminant_white(asked, space, recipe.observer, recipe.camera)
        weights = space.to_xyz[1] if recipe.camera is None else np.array([0.0, 1.0, 0.0])
        return new * float((weights @ white) / (weights @ new))
    return as_white(asked)


def _mask(
    picture: Picture,
    region: Region,
    white: NDArray,
    alpha: NDArray | None,
    read_mask: Callable[[str], NDArray] | None,
) -> NDArray | None:
    asked = region.mask
    if asked is None and region.click is not None:
        asked = "click"
    if asked is None or not isinstance(asked, str):
        return as_mask(asked, picture.shape)
    if asked == "click":
        click = region.click or region.reference
        if click is None or len(click) != 2:
            raise MaskError("A clicked region needs a pixel of the product: give the reference as x,y.")
        return region_from_clicks(picture, click, region.added, region.removed, white, region.tolerance)
    if asked == "alpha":
        if alpha is None:
            raise MaskError("The photo has no alpha to take the mask from: give a mask file, or click the product.")
        # The photo's colors are those of the product itself wherever it shows at all.
        return as_mask(alpha > 0, picture.shape)
    if read_mask is None:
        raise MaskError(f"Mask '{asked}' cannot be read here: give it as an array.")
    return as_mask(read_mask(asked), picture.shape)


def with_target(recipe: Recipe, *swatches: Swatch | None) -> Recipe:
    """Return the same recipe with other targets, one for each region."""
    if len(swatches) != len(recipe.regions):
        raise RecipeError(f"{len(swatches)} targets are given for {len(recipe.regions)} regions: give one for each.")
    pairs = zip(recipe.regions, swatches, strict=True)
    return replace(recipe, regions=tuple(replace(region, target=swatch) for region, swatch in pairs))


def with_colorway(recipe: Recipe, colorway: Colorway) -> Recipe:
    """Return the same recipe with the targets of a colorway."""
    try:
        return with_target(recipe, *colorway.targets)
    except RecipeError as error:
        raise RecipeError(f"Colorway '{colorway.name}': {error}") from None
