"""The panel's settings as a recipe of the core, and a recipe as the panel's settings."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import bpy

from . import images, masks, picked_colors
from .properties import NOWHERE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ..core.colorspace import RGBSpace
    from ..core.recipe import Colorway, Recipe, Region
    from ..core.swatches import Swatch
    from .properties import DyehouseColorway, DyehousePhoto, DyehouseRegion, DyehouseTarget


def swatch_of(target: "DyehouseTarget", image: bpy.types.Image | None = None) -> "Swatch | None":
    """The swatch that a target means: its text, else its picked color; None if its region keeps its color.

    Raises
    ------
    TargetError
        If its text cannot be understood.
    """
    from ..core.swatches import parse_target

    if not target.used:
        return None
    if not target.text:
        return picked(target.color, image)
    swatch = parse_target(target.text, folder_of(image))
    return replace(swatch, text=target.swatch_name) if target.swatch_name else swatch


def picked(color: "NDArray | bpy.types.bpy_prop_array", image: bpy.types.Image | None = None) -> "Swatch":
    """The swatch of a color that was picked, written so that the same text gives the same color anywhere."""
    from ..core.colorimetry import adaptation_matrix, linear_to_xyz
    from ..core.colorspace import SRGB
    from ..core.swatches import parse_target

    working = picked_colors.space_of(image)
    xyz = adaptation_matrix(working.white, SRGB.white, "bradford") @ linear_to_xyz(list(color), working)
    return parse_target("xyz({!r}, {!r}, {!r})".format(*(max(0.0, float(v)) for v in xyz)))


def problem_of(target: "DyehouseTarget", image: bpy.types.Image | None = None) -> str:
    """Why a target cannot be understood, in a sentence; empty if it can."""
    from ..core.errors import DyehouseError

    try:
        swatch_of(target, image)
    except DyehouseError as error:
        return str(error)
    return ""


def shown_color(text: str, image: bpy.types.Image | None = None) -> tuple[float, float, float]:
    """A color as Blender's color button shows it: the working space's RGB, black if it cannot be understood."""
    from ..core.errors import DyehouseError
    from ..core.swatches import parse_target

    try:
        red, green, blue = parse_target(text, folder_of(image)).to_linear(images.working_space(), adaptation="bradford")
    except DyehouseError:
        return 0.0, 0.0, 0.0
    return max(0.0, red), max(0.0, green), max(0.0, blue)


def folder_of(image: bpy.types.Image | None) -> str | None:
    """Folder that the spectra of an image's targets are relative to: that of the .blend."""
    return bpy.path.abspath("//", library=image.library if image else None) or None


def recipe_of(image: bpy.types.Image) -> "Recipe":
    """The recipe that an image's settings describe.

    Raises
    ------
    DyehouseError
        If a setting cannot be understood; the sentence says which and why.
    """
    return _with_regions(image, range(len(image.dyehouse.regions)))


def recipe_so_far(image: bpy.types.Image) -> "tuple[Recipe, tuple[int, ...]]":
    """The recipe without the regions that are not picked yet, if others are, and which of the panel's regions it has.

    Errors as of `recipe_of`.
    """
    regions = image.dyehouse.regions
    picked = tuple(k for k, region in enumerate(regions) if not unpicked(region)) or tuple(range(len(regions)))
    return _with_regions(image, picked), picked


def unpicked(region: "DyehouseRegion") -> str:
    """Why a region does not say yet what belongs to it, in a sentence; empty if it does."""
    reference = region.reference_source == "PIXEL" and tuple(region.reference) != NOWHERE
    if region.mask_source == "CLICK" and tuple(region.click) == NOWHERE and not reference:
        return f"Region '{region.name}' is not picked yet: press Pick Product and click it in the photo."
    return masks.missing(region)


def _with_regions(image: bpy.types.Image, indices: Sequence[int]) -> "Recipe":
    asked: DyehousePhoto = image.dyehouse
    return replace(
        without_regions(image),
        regions=tuple(_region(asked.regions[index], index) for index in indices),
        colorways=tuple(_colorway(colorway, image, indices) for colorway in asked.colorways),
    )


def without_regions(image: bpy.types.Image) -> "Recipe":
    """The part of the recipe that is about the whole photo: its light and the new one; errors as of `recipe_of`."""
    from ..core.recipe import Recipe

    asked: DyehousePhoto = image.dyehouse
    return Recipe(
        regions=(),
        white=_white(asked),
        gray=decimal(asked.gray) if asked.white_source == "PIXEL" else 1.0,
        illuminant=_light(asked),
        observer=asked.observer,
        camera=bpy.path.abspath(asked.camera, library=image.library) or None,
        adaptation=asked.adaptation,
    )


def shown(image: bpy.types.Image) -> "Recipe":
    """The recipe of what is shown, without the other colorways, checked.

    Raises
    ------
    DyehouseError
        As of `recipe_of`, or if it changes nothing.
    """
    from ..core.recipe import check

    recipe = replace(recipe_of(image), colorways=())
    check(recipe)
    return recipe


def colorway_of(colorway: "DyehouseColorway", image: bpy.types.Image) -> "Colorway":
    """A colorway of the panel as the core's; regions that it has no target for keep their color."""
    return _colorway(colorway, image, range(len(image.dyehouse.regions)))


def _colorway(colorway: "DyehouseColorway", image: bpy.types.Image, indices: Sequence[int]) -> "Colorway":
    from ..core.recipe import Colorway

    targets = colorway.targets
    swatches = [swatch_of(targets[index], image) if index < len(targets) else None for index in indices]
    return Colorway(colorway.name, tuple(swatches))


def _region(region: "DyehouseRegion", index: int) -> "Region":
    from ..core.errors import MaskError
    from ..core.recipe import Region
    from ..core.swatches import parse_target

    if problem := unpicked(region):
        raise MaskError(problem)
    clicked = region.mask_source == "CLICK"
    clicks = region.more_clicks if clicked else ()
    return Region(
        target=swatch_of(region.target, region.id_data),
        reference=_reference(region),
        mask=masks.asked(region, index),
        click=_pixel(region.click) if clicked else None,
        tolerance=decimal(region.tolerance),
        meaning=region.meaning,
        source=parse_target(region.source, folder_of(region.id_data)) if region.source else None,
        model=region.model,
        residual=region.residual,
        spill=region.spill,
        name=region.name,
        added=tuple(_known(click.pixel) for click in clicks if not click.removes),
        removed=tuple(_known(click.pixel) for click in clicks if click.removes),
    )


def output_space(image: bpy.types.Image) -> str:
    """Name of the color space that files of an image are to have; empty for the photo's own."""
    chosen: str = image.dyehouse.output_space
    return "" if chosen == "PHOTO" else chosen


def decimal(value: float) -> float:
    """The number that the user typed; Blender's properties have only seven digits of it."""
    return float(f"{value:.7g}")


def _known(pixel: "bpy.types.bpy_prop_array") -> tuple[int, int]:
    return int(pixel[0]), int(pixel[1])


def _pixel(pixel: "bpy.types.bpy_prop_array") -> tuple[int, int] | None:
    return None if tuple(pixel) == NOWHERE else _known(pixel)


def _reference(region: "DyehouseRegion") -> tuple[float, ...] | None:
    if region.reference_source == "COLOR":
        return in_photo_space(region.reference_color, region.id_data)
    return _pixel(region.reference) if region.reference_source == "PIXEL" else None


def _white(asked: "DyehousePhoto") -> str | tuple[float, ...] | None:
    kind = asked.white_source
    if kind == "PIXEL":
        return _pixel(asked.white_pixel)
    if kind == "ILLUMINANT":
        return bpy.path.abspath(asked.white_illuminant, library=asked.id_data.library)
    if kind == "TEMPERATURE":
        return f"{asked.white_temperature:g}K"
    if kind == "HIGHLIGHTS":
        return "highlights"
    return in_photo_space(asked.white_color, asked.id_data) if kind == "COLOR" else None


def _light(asked: "DyehousePhoto") -> str | tuple[float, ...] | None:
    kind = asked.light_source
    if kind == "ILLUMINANT":
        return bpy.path.abspath(asked.light_illuminant, library=asked.id_data.library)
    if kind == "TEMPERATURE":
        return f"{asked.light_temperature:g}K"
    return in_photo_space(asked.light_color, asked.id_data) if kind == "COLOR" else None


def use(recipe: "Recipe", image: bpy.types.Image) -> list[str]:
    """Set the panel of an image to a recipe whose paths are absolute.

    Returns
    -------
    Names of what the recipe asks for and the panel has no setting for.
    """
    asked: DyehousePhoto = image.dyehouse
    asked.colorways.clear()
    asked.regions.clear()
    asked.active_region, asked.active_colorway = 0, -1
    _use_white(asked, recipe.white)
    _use_light(asked, recipe.illuminant)
    asked.gray, asked.camera = recipe.gray, recipe.camera or ""
    lost = _use_rest(asked, recipe, {"regions", "white", "gray", "illuminant", "camera", "colorways"})
    for region in recipe.regions:
        lost += _use_region(asked.regions.add(), region, image)
    for colorway in recipe.colorways:
        added = asked.colorways.add()
        added.name = colorway.name
        for swatch in colorway.targets:
            _use_swatch(added.targets.add(), swatch, image)
    return sorted(set(lost))


def _use_region(asked: "DyehouseRegion", region: "Region", image: bpy.types.Image) -> list[str]:
    asked.name = region.name or "Product"
    reference = region.reference
    if reference is not None and len(reference) == 2:
        asked.reference_source, asked.reference = "PIXEL", [math.floor(v) for v in reference]
    elif reference is not None:
        asked.reference_source, asked.reference_color = "COLOR", in_working_space(reference, image)
    click = region.click
    if region.mask == "click" and click is None and asked.reference_source == "PIXEL":
        click = tuple(asked.reference)
    clicked = region.mask == "click" or (region.mask is None and click is not None)
    asked.click = click or NOWHERE
    if isinstance(region.mask, str) and region.mask not in ("click", "alpha"):
        asked.mask_source, asked.mask_file = "FILE", region.mask
    else:
        asked.mask_source = "CLICK" if clicked else "ALPHA" if region.mask == "alpha" else "WHOLE"
    for pixels, removes in ((region.added, False), (region.removed, True)):
        for pixel in pixels:
            more = asked.more_clicks.add()
            more.pixel, more.removes = pixel, removes
    _use_swatch(asked.target, region.target, image)
    asked.source = text_of(region.source, image) if region.source else ""
    done = {"name", "reference", "mask", "click", "added", "removed", "target", "source"}
    return _use_rest(asked, region, done)


def _use_rest(asked: "DyehousePhoto | DyehouseRegion", given: "Recipe | Region", done: set[str]) -> list[str]:
    """Set what has the same name in the panel; returns the names of what is asked for and cannot be set."""
    lost = []
    for field in fields(given):
        if field.name in done:
            continue
        value = getattr(given, field.name)
        try:
            setattr(asked, field.name, value)
        except (AttributeError, TypeError):
            if value != field.default:
                lost.append(field.name)
    return lost


def _use_swatch(target: "DyehouseTarget", swatch: "Swatch | None", image: bpy.types.Image) -> None:
    target.used = swatch is not None
    if swatch is not None:
        target.text = text_of(swatch, image)
        target.swatch_name = "" if target.text == swatch.text else swatch.text


def text_of(swatch: "Swatch", image: bpy.types.Image) -> str:
    """Text that `parse_target` makes the swatch of, beside this image: the user's own if possible."""
    from ..core.errors import DyehouseError
    from ..core.swatches import parse_target

    try:
        same = parse_target(swatch.text, folder_of(image)) == swatch
    except DyehouseError:
        same = False
    return swatch.text if same else swatch.written


def _use_white(asked: "DyehousePhoto", white: str | tuple[float, ...] | None) -> None:
    if white is None:
        asked.white_source = "BALANCED"
    elif white == "highlights":
        asked.white_source = "HIGHLIGHTS"
    elif isinstance(white, str):
        asked.white_source, asked.white_illuminant = "ILLUMINANT", white
    elif len(white) == 2:
        asked.white_source, asked.white_pixel = "PIXEL", [math.floor(v) for v in white]
    else:
        asked.white_source, asked.white_color = "COLOR", in_working_space(white, asked.id_data)


def _use_light(asked: "DyehousePhoto", light: str | tuple[float, ...] | None) -> None:
    if light is None:
        asked.light_source = "SAME"
    elif isinstance(light, str):
        asked.light_source, asked.light_illuminant = "ILLUMINANT", light
    else:
        asked.light_source, asked.light_color = "COLOR", in_working_space(light, asked.id_data)


def in_photo_space(color: "NDArray | bpy.types.bpy_prop_array", image: bpy.types.Image) -> tuple[float, ...]:
    """A color of the working space as linear RGB of the photo's space, for colors that stand for pixels."""
    from . import session

    return tuple(float(v) for v in between(picked_colors.space_of(image), session.space_of(image), color))


def in_working_space(color: "ArrayLike", image: bpy.types.Image) -> tuple[float, ...]:
    """The way back: linear RGB of the photo as Blender's color buttons show it."""
    from . import session

    return tuple(float(v) for v in between(session.space_of(image), images.working_space(), color))


def in_rec709(color: "NDArray | bpy.types.bpy_prop_array") -> "NDArray[np.float64]":
    """A color of the working space as linear Rec.709."""
    from ..core.colorspace import LINEAR_SRGB

    return between(images.working_space(), LINEAR_SRGB, color)


def from_rec709(color: "NDArray") -> tuple[float, ...]:
    """Linear Rec.709 as Blender's color buttons show it."""
    from ..core.colorspace import LINEAR_SRGB

    return _shown(color, LINEAR_SRGB)


def codes(color: "NDArray", space: "RGBSpace") -> tuple[float, ...]:
    """Linear RGB (3,) of a space as sRGB codes 0..1, for icons."""
    import numpy as np

    from ..core.colorspace import LINEAR_SRGB, SRGB

    return tuple(SRGB.curve.encode(np.clip(between(space, LINEAR_SRGB, color), 0, 1)))


def found_color(image: bpy.types.Image, index: int) -> tuple[float, ...]:
    """The reference color of a region as Blender shows it; black while it is not known."""
    from . import session

    look = session.last(image)
    analysis = look.analysis(index) if look else None
    return _shown(analysis.reference, look.photo.space) if look and analysis else (0.0, 0.0, 0.0)


def found_white(image: bpy.types.Image) -> tuple[float, ...]:
    """The white of the photo as Blender shows it; black while it is not known."""
    from . import session

    look = session.last(image)
    return (0.0, 0.0, 0.0) if look is None else _shown(look.prepared.white, look.photo.space)


def _shown(color: "NDArray", space: "RGBSpace") -> tuple[float, ...]:
    return tuple(max(0.0, float(v)) for v in between(space, images.working_space(), color))


def between(source, destination, color) -> "NDArray[np.float64]":
    """Linear RGB (3,) of one space in another, white to white."""
    import numpy as np

    from ..core.colorimetry import conversion_matrix

    if np.allclose(source.to_xyz, destination.to_xyz, atol=1e-9):
        return np.asarray(color, np.float64)
    return conversion_matrix(source, destination) @ np.asarray(color, np.float64)
