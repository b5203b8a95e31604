"""Writing what the panel shows: to an image of the .blend, to a file, or all colorways to files."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from .. import images, recipes, session, writing
from . import common, modal

if TYPE_CHECKING:
    from ...batch.files import Photo
    from ...core.recipe import Colorway, Prepared, Recipe
    from ...core.recolor import Shares


def _overwrite() -> Any:
    return BoolProperty(name="Overwrite", description="Replace files that are there", options={"SKIP_SAVE"})


def _quality() -> Any:
    return IntProperty(
        name="Quality", description="Of JPEG and WebP files; 0 for the panel's", min=0, max=100, options={"SKIP_SAVE"}
    )


def _suffixes() -> Any:
    from ...batch.files import OUTPUT_KINDS

    return OUTPUT_KINDS


def shown_name(image: bpy.types.Image) -> str:
    """Name of the colorway that is shown, for the names of results."""
    settings = image.dyehouse
    active = settings.active_colorway
    return settings.colorways[active].name if 0 <= active < len(settings.colorways) else "recolored"


# --- the work -------------------------------------------------------------------------------------------------


class _Job(modal.Job):
    """Writes colorways of a photo, one after the other.

    Parameters
    ----------
    image
        The photo.
    recipe
        Of the image, checked.
    colorways
        What is written.
    paths
        The file of each.
    overwrite
        Replace files that are there.
    quality
        Of JPEG and WebP.

    Raises
    ------
    DyehouseError
        If a file cannot be written.
    """

    def __init__(
        self,
        image: bpy.types.Image,
        recipe: "Recipe",
        colorways: "Sequence[Colorway]",
        paths: Sequence[Path],
        overwrite: bool = False,
        quality: int = 95,
    ) -> None:
        super().__init__()
        self._image, self._colorways, self.paths = image.session_uid, colorways, paths
        for path in paths:
            writing.check(path, image, overwrite)
        self._begun, self._space = session.begin(image, recipe), recipes.output_space(image)
        self._upright = cache(partial(_upright, self._begun, self._space))
        self._options: dict[str, Any] = {"overwrite": overwrite, "quality": quality, "watch": self.watch}
        self.written = 0
        self.warnings: set[str] = set()

    def work(self) -> Callable[[], Any]:
        """Recolor the next colorway; returns what Blender's thread must call for its file.

        Raises
        ------
        Stopped
            After `stop`; then the file does not appear.
        DyehouseError
            If the photo cannot be recolored, or the file not be written.
        """
        photo, found = self._upright()
        self.watch(0.0)
        prepared, path = found.for_colorway(self._colorways[self.written]), self.paths[self.written]
        self.warnings.update(prepared.warnings)
        complete = writing.begin(photo, prepared, path, **self._options)
        _delivered[self._image] = writing.verified(photo, prepared, path)
        return complete

    def finish(self, made: Callable[[], Any]) -> bool:
        """Complete the file; tells whether there is another."""
        shares = made()
        self.warnings.update(_unheld(shares))
        self.written, self._share = self.written + 1, 0.0
        return self.written < len(self.paths)

    def progress(self) -> tuple[float, int, str]:
        """How many files are done, of how many, and what is going on."""
        if self.stopping:
            return self.written, len(self.paths), "Stopping"
        return self.written + self._share, len(self.paths), f"Writing {self.paths[self.written].name}"

    def rest(self) -> str:
        """How many were written."""
        return f"{_count(self)} written"


class _ImageJob(_Job):
    """Makes a new image of what is shown."""

    def __init__(self, image: bpy.types.Image, recipe: "Recipe", name: str) -> None:
        super().__init__(image, recipe, (), ())
        self.paths = (Path(name),)
        self.name, self._working = name, images.working_space()

    def work(self) -> Callable[[], Any]:
        """Recolor what is shown; the image is made in Blender's thread."""
        self.watch(0.0)
        look = self._begun()
        self.warnings.update(look.prepared.warnings)
        make = writing.begin_image(look.photo, look.prepared, self.name, self._working, self.watch)

        def complete() -> Any:
            image, shares = make()
            self.name = image.name
            return shares

        return complete


def _unheld(shares: "Shares") -> list[str]:
    from ...batch.inspection import gamut_warning

    return gamut_warning(shares)


# What the file that was written last of each image (by its session_uid) shows, in words.
_delivered: dict[int, list[str]] = {}


def delivered(image: bpy.types.Image) -> list[str]:
    """How near the file that was written last came to the asked colors: a sentence for each region."""
    return _delivered.get(image.session_uid, [])


def _upright(look: Callable[[], session.Look], space: str) -> "tuple[Photo, Prepared]":
    from ...batch.photo import upright

    found = look()
    return upright(writing.in_space(found.photo, space), found.prepared)


_SLOT = modal.Slot("Files are being written; Esc stops it")
progress = _SLOT.progress


class _Writing(modal.JobOperator, common.RegionOperator):
    """Base of operators that write."""

    slot = _SLOT

    def ended(self, job: _Job) -> None:
        """Tell what the user should know, and what was made."""
        for warning in sorted(job.warnings):
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, self.made(job))

    def made(self, job: Any) -> str:
        """What was made, in words."""
        raise NotImplementedError


class DYEHOUSE_OT_write_image(_Writing, bpy.types.Operator):
    """Recolor the photo into a new image of the .blend"""

    bl_idname = "dyehouse.write_image"
    bl_label = "Write to New Image"

    result: StringProperty(name="Name", description="Of the new image; empty for a name", options={"SKIP_SAVE"})

    def job(self, context):
        """Of what is shown."""
        image = common.image_of(context, self.image)
        name = self.result or f"{writing.stem_of(image)}-{shown_name(image)}"
        return _ImageJob(image, recipes.shown(image), name)

    def made(self, job):
        """Tell the name."""
        return f"New image '{job.name}'"


class DYEHOUSE_OT_write_file(_Writing, bpy.types.Operator):
    """Recolor the photo into a file, with its depth, color space and metadata"""

    bl_idname = "dyehouse.write_file"
    bl_label = "Write to File"
    bl_options = {"REGISTER"}

    filepath: StringProperty(name="File", description="To write", subtype="FILE_PATH", options=common.PATH)
    overwrite: _overwrite()
    quality: _quality()
    filter_image: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    in_window: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    @common.reporting
    def invoke(self, context, event):
        """Ask for the file."""
        image = common.image_of(context, self.image)
        self.image, self.in_window = image.name, True
        if not self.filepath:
            suffix = Path(image.filepath).suffix.lower()
            name = f"{writing.stem_of(image)}-{shown_name(image)}{suffix if suffix in _suffixes() else '.png'}"
            self.filepath = str((writing.folder_of(image) or Path()) / name)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @common.reporting
    def execute(self, context):
        """Recolor it: while the window goes on if a window asked for the file."""
        from ...core.recipe import Colorway

        image = common.image_of(context, self.image)
        recipe = recipes.shown(image)
        shown = Colorway(shown_name(image), tuple(region.target for region in recipe.regions))
        path = common.absolute(self.filepath)
        job = _Job(image, recipe, (shown,), (path,), self.overwrite, self.quality or image.dyehouse.quality)
        if self.in_window:
            return self.go_on(context, job)
        return self.at_once(job)

    def made(self, job):
        """Tell the file."""
        return f"Wrote {job.paths[0]}"


class DYEHOUSE_OT_write_colorways(_Writing, common.ColorwaysOperator, bpy.types.Operator):
    """Write every colorway to a file; Esc stops after the files that are complete"""

    bl_idname = "dyehouse.write_colorways"
    bl_label = "Write All Colorways"
    bl_options = {"REGISTER"}

    pattern: StringProperty(
        name="Output",
        description="Name of the files with {photo} and {colorway}; empty for the panel's",
        options={"SKIP_SAVE"},
    )
    overwrite: _overwrite()
    quality: _quality()

    def job(self, context):
        """Of all colorways, as the panel says where arguments do not."""
        image = common.image_of(context, self.image)
        settings = image.dyehouse
        overwrite, quality = self.overwrite or settings.overwrite, self.quality or settings.quality
        return all_colorways(image, self.pattern or settings.output_pattern, overwrite, quality)

    def made(self, job):
        """Tell how many."""
        return f"{_count(job)} written to {job.paths[0].parent}"


def all_colorways(image: bpy.types.Image, pattern: str, overwrite: bool, quality: int) -> _Job:
    """The job of writing every colorway of a photo.

    Raises
    ------
    DyehouseError
        If there is nothing to write, or a file cannot be written.
    """
    from ...core.errors import RecipeError
    from ...core.recipe import check

    recipe = recipes.recipe_of(image)
    if not recipe.colorways:
        raise RecipeError(f"Image '{image.name}' has no colorway: add one first.")
    check(recipe)
    paths = writing.planned(image, pattern, recipe.colorways)
    return _Job(image, recipe, recipe.colorways, paths, overwrite, quality)


def _count(job: _Job) -> str:
    total = len(job.paths)
    return f"{job.written} of {total} colorways" if job.written < total else f"{total} colorway{'s' * (total > 1)}"


CLASSES = (DYEHOUSE_OT_write_image, DYEHOUSE_OT_write_file, DYEHOUSE_OT_write_colorways)
register, unregister = modal.registration(_SLOT, CLASSES)
