"""The panel's settings as a recipe file, and back: the same file that the command line takes."""

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bpy.props import BoolProperty, StringProperty

from .. import images, masks, recipes, session, writing
from . import common
from .regions import free_name

if TYPE_CHECKING:
    from ...core.recipe import Recipe, Region
    from ...core.recipe_file import Output, StoredRecipe


class _RecipeFile(common.ImageOperator):
    """Base of operators about a recipe file."""

    filepath: StringProperty(name="File", description="Recipe file", subtype="FILE_PATH", options=common.PATH)
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN", "SKIP_SAVE"})


class DYEHOUSE_OT_save_recipe(_RecipeFile, common.RegionOperator, bpy.types.Operator):
    """Save the settings of the photo as a recipe, for the command line and for other photos"""

    bl_idname = "dyehouse.save_recipe"
    bl_label = "Save Recipe"
    bl_options = {"REGISTER"}

    overwrite: BoolProperty(name="Overwrite", description="Replace files that are there", options={"SKIP_SAVE"})

    @common.reporting
    def invoke(self, context, event):
        """Ask for the file."""
        image = common.image_of(context, self.image)
        self.image = image.name
        if not self.filepath:
            self.filepath = str((writing.folder_of(image) or Path()) / f"{writing.stem_of(image)}.toml")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @common.reporting
    def execute(self, context):
        """Write it, with the masks that are in no file beside it."""
        from ...batch.photo import turned_recipe
        from ...core import recipe_file

        image = common.image_of(context, self.image)
        path = common.absolute(self.filepath).with_suffix(".toml")
        if path.exists() and not self.overwrite:
            raise _exists(path)
        recipe = recipes.recipe_of(image)
        _check_names("regions", [region.name for region in recipe.regions])
        _check_names("colorways", [colorway.name for colorway in recipe.colorways])
        recipe, written = _with_mask_files(recipe, image, path, self.overwrite)
        recipe = turned_recipe(recipe, images.shape_of(image), images.orientation_of(image))
        photo = images.file_of(image)
        stored = recipe_file.StoredRecipe(
            recipe,
            photo=_from(path.parent, photo) if photo else None,
            color_space=images.color_space_name(image),
            output=_output(image),
            folder=path.parent,
        )
        recipe_file.write_recipe(path, stored, force=self.overwrite)
        if photo is None:
            self.report({"WARNING"}, f"'{image.name}' is in no file as it is, so the recipe names no photo")
        self.report({"INFO"}, f"Wrote {', '.join(str(p) for p in [path, *written])}")


class DYEHOUSE_OT_load_recipe(_RecipeFile, bpy.types.Operator):
    """Set the photo's settings to those of a recipe file; without a photo, the recipe's own is opened"""

    bl_idname = "dyehouse.load_recipe"
    bl_label = "Load Recipe"

    @classmethod
    def poll(cls, context):
        """Always: the recipe may name its photo."""
        return True

    def invoke(self, context, event):
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @common.reporting
    def execute(self, context):
        """Read it."""
        from ...batch.photo import turned_recipe
        from ...core import recipe_file

        stored = recipe_file.read_recipe(common.absolute(self.filepath))
        image = common.editable(self._image(context, stored))
        settings = image.dyehouse
        settings.color_space = stored.color_space or "FILE"
        session.photo_of(image)  # says in words if it cannot be opened, before anything is set
        height, width = images.shape_of(image)
        orientation = images.orientation_of(image)
        shape = (height, width) if orientation < 5 else (width, height)
        lost = recipes.use(turned_recipe(stored.located(), shape, orientation, back=True), image)
        pattern = stored.output.pattern
        settings.output_pattern = pattern if Path(pattern).is_absolute() else f"//{pattern}"
        settings.quality = stored.output.quality
        settings.output_space = stored.output.output_space or "PHOTO"
        for name in lost:
            self.report({"WARNING"}, f"The panel has no setting for '{name}' of the recipe: it is left out")
        self.report({"INFO"}, f"Loaded {self.filepath} for '{image.name}'")

    def _image(self, context: bpy.types.Context, stored: "StoredRecipe") -> bpy.types.Image:
        from .photo import opened

        if self.image or getattr(context, "edit_image", None) or stored.photo_path is None:
            return common.image_of(context, self.image)
        image = opened(stored.photo_path.absolute())
        if context.area and context.area.type == "IMAGE_EDITOR":
            context.space_data.image = image
        return image


def _exists(path: Path) -> Exception:
    from ...core.errors import FileError

    return FileError(f"'{path}' exists already: choose another name, or allow it to be overwritten.")


def _from(folder: Path, path: Path) -> str:
    """A path as a recipe in a folder names it: relative if it lies there, so that both can be moved together."""
    absolute = path.absolute()
    inside = absolute.is_relative_to(folder.absolute())
    return absolute.relative_to(folder.absolute()).as_posix() if inside else str(absolute)


def _check_names(kind: str, names: list[str]) -> None:
    from ...core.errors import RecipeError

    for number, name in enumerate(names):
        if not name or name in names[:number]:
            what = f"Two {kind} are named '{name}'" if name else f"One of the {kind} has no name"
            raise RecipeError(f"{what}: a recipe file tells them apart by their names, so rename one.")


def _output(image: bpy.types.Image) -> "Output":
    from ...core.recipe_file import Output

    asked = image.dyehouse
    space = recipes.output_space(image) or None
    return Output(asked.output_pattern.removeprefix("//"), asked.quality, output_space=space)


def _with_mask_files(
    recipe: "Recipe", image: bpy.types.Image, path: Path, overwrite: bool
) -> "tuple[Recipe, list[Path]]":
    """The recipe with masks in files: where they are in one, that one, else a new one beside the recipe."""
    from ...batch.files import turned

    regions: list[Region] = []
    written: list[Path] = []
    sources, shape, orientation = masks.sources(image), images.shape_of(image), images.orientation_of(image)
    for region in recipe.regions:
        source = sources.get(region.mask) if isinstance(region.mask, str) else None
        if source is not None:
            file = source.file
            if file is None or (orientation > 1 and not source.upright):
                stem = f"{path.stem}-{re.sub(r'[^\w-]+', '-', region.name)}-mask"
                file = path.with_name(free_name(stem, [p.stem for p in written]) + ".png")
                if file.exists() and not overwrite:
                    raise _exists(file)
                writing.save_mask(file, turned(source.load(shape)(), orientation))
                written.append(file)
            region = replace(region, mask=_from(path.parent, file))
        regions.append(region)
    return replace(recipe, regions=tuple(regions)), written


CLASSES = (DYEHOUSE_OT_save_recipe, DYEHOUSE_OT_load_recipe)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
