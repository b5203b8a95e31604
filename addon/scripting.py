"""Dyehouse for Blender's Python: recolor images of the .blend, with a window or without.

::

    from bl_ext.user_default.dyehouse.addon import scripting

    navy = scripting.recolor("shirt.jpg", "#1F4E79", click=(640, 820))

Images are given as such or by name. What else can be asked for has the names and meanings of the command line's
options (`blender --command dyehouse recolor --help`); pixels are (x, y) from the top left of the image as Blender shows
it. Everything that goes wrong is a `DyehouseError` whose one sentence says what and how to mend it.

The look at a photo is kept: the same photo in another target color costs only the recolor itself.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import images, masks, recipes, session, writing
from .operators import common

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..core.recipe import Recipe
    from ..core.swatches import Swatch

type Image = bpy.types.Image | str


def recolor(
    image: Image,
    target: "str | Sequence[float] | Swatch | None" = None,
    *,
    output: str | Path | None = None,
    name: str = "",
    overwrite: bool = False,
    quality: int = 95,
    compression: str | None = None,
    output_space: str | None = None,
    **asked: Any,
) -> bpy.types.Image | Path:
    """Put a product into another color, into a new image or a file; the image's own settings are not used.

    Parameters
    ----------
    image
        The photo.
    target
        A text such as ``"#1F4E79"`` or ``"lab(42, 55, 35)"``, a CSV file of a spectrum, linear RGB of the photo's
        space, or a `core.swatches.Swatch`.
    output
        File to write, with the depth, color space and metadata of the photo; None for a new image.
    name
        Of the new image.
    overwrite
        Replace a file that is there.
    quality, compression
        Of the file, as for `batch.files.write`.
    output_space
        Of the file, such as ``"display-p3"``; None for the photo's own.
    asked
        ``reference`` ((x, y) or linear RGB), ``click`` ((x, y)), ``mask``, ``tolerance``, ``model``, ``residual``,
        ``meaning``, ``source``, ``white`` ((x, y), linear RGB, or the name of a light), ``gray``, ``illuminant``,
        ``observer``, ``camera``, ``adaptation``; ``regions``, a list of mappings with the keys of one region. A mask is
        ``"click"``, ``"alpha"``, a file, an image, a mask of the mask editor, an array (height, width) of coverage from
        the top row down, or ``"objects:Cup, Plate"`` for what the cryptomatte of a render names.

    Returns
    -------
    The new image, or the path of the file.

    Raises
    ------
    DyehouseError
        If something cannot be used.
    """
    found = _image(image)
    path = None if output is None else writing.check(common.absolute(str(output)), found, overwrite)
    look = look_at(found, target=target, **asked)
    if path is None:
        return writing.to_image(look.photo, look.prepared, name or f"{writing.stem_of(found)}-recolored")[0]
    photo = writing.in_space(look.photo, output_space)
    writing.save(photo, look.prepared, path, overwrite=overwrite, quality=quality, compression=compression)
    return path


def inspect(image: Image, target: "str | Sequence[float] | Swatch | None" = None, **asked: Any) -> dict[str, Any]:
    """Say what a recolor would do, without writing a picture; parameters and errors as for :func:`recolor`.

    Returns
    -------
    Plain values: the size, the white and where it comes from, warnings, and for each region the reference found, the
    model, noise gain, residual and the matrix on linear RGB; as ``dyehouse inspect --json`` prints them.
    """
    from ..batch import inspection

    look = look_at(_image(image), target=target, **asked)
    return inspection.figures(look.photo, look.prepared)


def write(image: Image, output: str | Path, *, overwrite: bool = False, quality: int = 0) -> Path:
    """Write what the panel of an image shows to a file.

    Parameters
    ----------
    image
        The photo, with its settings in ``image.dyehouse``.
    output
        The file.
    overwrite
        Replace a file that is there.
    quality
        Of JPEG and WebP; 0 for the panel's.

    Returns
    -------
    The file.

    Raises
    ------
    DyehouseError
        If a setting cannot be used or the file not be written.
    """
    found = _image(image)
    path = writing.check(common.absolute(str(output)), found, overwrite)
    look = session.look(found, recipes.shown(found))
    photo = writing.in_space(look.photo, recipes.output_space(found))
    writing.save(photo, look.prepared, path, overwrite=overwrite, quality=quality or found.dyehouse.quality)
    return path


def look_at(image: bpy.types.Image, **asked: Any) -> session.Look:
    """Look at a photo for a recipe in the words of the command line; parameters and errors as for :func:`recolor`.

    Returns
    -------
    The photo and what was found in it; ``look.prepared`` gives the analyses, matrices and targets.
    """
    from ..core.recipe import check

    recipe, sources = recipe_of(image, **asked)
    check(recipe)
    return session.look(image, recipe, sources)


def recipe_of(image: bpy.types.Image, **asked: Any) -> "tuple[Recipe, dict[str, masks.Source]]":
    """The recipe of arguments, and its masks by the names that they have in it; parameters as for :func:`recolor`."""
    from argparse import Namespace

    from ..batch.cli import parser, recipe_from
    from ..core.errors import RecipeError
    from ..core.recipe import with_target

    usual = {k: v for k, v in vars(parser().parse_args(["inspect", "photo"])).items() if k not in _NO_RECIPE}
    unknown = asked.keys() - usual.keys() - {"regions"}
    if unknown:
        raise RecipeError(f"'{min(unknown)}' is not understood: use regions, {', '.join(sorted(usual))}.")
    regions = [_region_of(image, region) for region in asked.pop("regions", ()) or ()]
    common_part, sources, swatch = _region_of(image, asked)
    given = {key: value for key, value in common_part.items() if value not in (None, "")}
    lines = [" ".join(_written(key, value) for key, value in texts.items()) for texts, *_ in regions]
    recipe = recipe_from(Namespace(**usual | given | {"region": lines}))
    for _, more, _ in regions:
        sources |= more
    swatches = [own or swatch or region.target for (*_, own), region in zip(regions, recipe.regions, strict=False)]
    if regions or swatch:
        recipe = with_target(recipe, *(swatches or [swatch]))
    return recipe, sources


# Options of the command line that are no part of what is asked of a photo.
_NO_RECIPE = {
    *("command", "photo", "run", "json", "maps", "force", "version"),
    *("recipe", "colorway", "region", "color_space"),
}


def _image(image: Image) -> bpy.types.Image:
    return common.image_named(image) if isinstance(image, str) else image


def _region_of(
    image: bpy.types.Image, asked: Mapping[str, Any]
) -> "tuple[dict[str, Any], dict[str, masks.Source], Swatch | None]":
    """Arguments as the command line's texts, the masks that are named in them, and a target that is no text."""
    from ..core.swatches import Swatch

    texts, target = dict(asked), asked.get("target")
    swatch = target if isinstance(target, Swatch) else None
    if swatch is not None:
        del texts["target"]
    elif target is not None and not isinstance(target, str | Path):
        texts["target"] = f"rgb({_numbers(target)})"
    for key in ("reference", "click", "white", "illuminant"):
        if key in texts and not isinstance(texts[key], str | None):
            texts[key] = _numbers(texts[key])
    for key in ("target", "source", "camera"):
        if key in texts:
            texts[key] = _path(texts[key], image)
    sources: dict[str, masks.Source] = {}
    mask = texts.get("mask")
    if mask is not None and not (isinstance(mask, str) and mask in ("", "click", "alpha")):
        texts["mask"], source = _mask_of(image, mask)
        sources[texts["mask"]] = source
    return texts, sources, swatch


def _numbers(values: Sequence[float]) -> str:
    return ",".join(repr(float(v)) for v in values)


def _path(text: Any, image: bpy.types.Image) -> Any:
    text = str(text) if isinstance(text, Path) else text
    return str(common.absolute(text, image.library)) if isinstance(text, str) and text.startswith("//") else text


def _written(key: str, value: Any) -> str:
    """A key of a region as the command line has it; nothing for what is not given."""
    import shlex

    return "" if value in (None, "", False) else f"{key}={'yes' if value is True else shlex.quote(str(value))}"


def _mask_of(image: bpy.types.Image, mask: "bpy.types.ID | NDArray | str | Path") -> tuple[str, masks.Source]:
    """A name for a mask, and the mask."""
    import numpy as np

    from ..core.errors import MaskError

    if isinstance(mask, bpy.types.Image):
        return f"image:{mask.name}", masks.of_image(mask)
    if isinstance(mask, bpy.types.Mask):
        return f"spline:{mask.name}", masks.of_spline(mask)
    if isinstance(mask, np.ndarray):
        coverage = np.ascontiguousarray(mask)
        return f"array:{id(coverage)}", masks.Source((coverage.tobytes(),), lambda _shape: lambda: coverage)
    kind, _, name = str(mask).partition(":")
    if kind == "image":
        return str(mask), masks.of_image(common.image_named(name))
    if kind == "spline":
        if name not in bpy.data.masks:
            raise MaskError(f"There is no mask '{name}': give the name of a mask of this .blend.")
        return str(mask), masks.of_spline(bpy.data.masks[name])
    if kind == "objects":
        return str(mask), masks.of_matte(common.absolute(image.filepath, image.library), name)
    path = common.absolute(str(mask), image.library)
    return str(path), masks.of_file(path, images.orientation_of(image))
