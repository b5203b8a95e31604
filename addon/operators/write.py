"""Writing what the panel shows: to an image of the .blend, to a file, or all colorways to files."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from .. import background, recipes, session, writing
from . import common

if TYPE_CHECKING:
    from concurrent.futures import Future

    from ...batch.files import Photo
    from ...core.recipe import Colorway, Prepared, Recipe
    from ...core.recolor import Shares

# Seconds between looks at the thread that writes.
_INTERVAL = 0.05


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


class _Stopped(Exception):  # noqa: N818, no error
    """The user does not want the rest."""


class _Job:
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
        self._image, self._colorways, self.paths = image.session_uid, colorways, paths
        for path in paths:
            writing.check(path, image, overwrite)
        self._begun = session.begin(image, recipe)
        self._upright = cache(partial(_upright, self._begun))
        self._options: dict[str, Any] = {"overwrite": overwrite, "quality": quality, "watch": self._watch}
        self._stop = threading.Event()
        self._share = 0.0
        self.written = 0
        self.warnings: set[str] = set()

    def recolor_next(self) -> Callable[[], Any]:
        """Recolor the next colorway, in any thread; returns what the main thread must call for its file.

        Raises
        ------
        _Stopped
            After `stop`; then the file does not appear.
        DyehouseError
            If the photo cannot be recolored, or the file not be written.
        """
        photo, found = self._upright()
        self._watch(0.0)
        prepared, path = found.for_colorway(self._colorways[self.written]), self.paths[self.written]
        self.warnings.update(prepared.warnings)
        complete = writing.begin(photo, prepared, path, **self._options)
        _delivered[self._image] = writing.verified(photo, prepared, path)
        return complete

    def finish(self, complete: Callable[[], Any]) -> bool:
        """Complete the file, in the main thread; tells whether there is more to do."""
        shares = complete()
        self.warnings.update(_unheld(shares))
        self.written, self._share = self.written + 1, 0.0
        return self.written < len(self.paths)

    def stop(self) -> None:
        """End as soon as possible."""
        self._stop.set()

    def progress(self) -> tuple[float, int, str]:
        """How many files are done, of how many, and what is going on."""
        if self._stop.is_set():
            return self.written, len(self.paths), "Stopping"
        return self.written + self._share, len(self.paths), f"Writing {self.paths[self.written].name}"

    def _watch(self, share: float) -> None:
        self._share = share
        if self._stop.is_set():
            raise _Stopped


class _ImageJob(_Job):
    """Makes a new image of what is shown."""

    def __init__(self, image: bpy.types.Image, recipe: "Recipe", name: str) -> None:
        super().__init__(image, recipe, (), ())
        self.paths = (Path(name),)
        self._name = name
        self.made = ""

    def recolor_next(self) -> Callable[[], Any]:
        """Recolor what is shown; the image is made in the main thread."""
        self._watch(0.0)
        look = self._begun()
        self.warnings.update(look.prepared.warnings)
        make = writing.begin_image(look.photo, look.prepared, self._name, self._watch)

        def complete() -> Any:
            image, shares = make()
            self.made = image.name
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


def _upright(look: Callable[[], session.Look]) -> "tuple[Photo, Prepared]":
    from ...batch.photo import upright

    found = look()
    return upright(found.photo, found.prepared)


@dataclass
class _Running:
    """The job that the window goes on with, and what belongs to it."""

    job: _Job
    timer: Any
    part: "Future[Callable[[], Any]]"
    shown: str = ""


_running: _Running | None = None


def progress() -> tuple[float, int, str] | None:
    """How many colorways have been written, of how many, and what is going on; None if nothing is."""
    return _running.job.progress() if _running else None


class _Writing(common.RegionOperator):
    """Runs a job: in a thread while the window goes on, or at once for scripts."""

    report: Callable[..., None]

    @classmethod
    def poll(cls, context):
        """Gray the button out while files are written."""
        if _running is not None:
            cls.poll_message_set("Files are being written; Esc stops it")
            return False
        return super().poll(context)

    def ended(self, job: _Job) -> None:
        """Tell what was made."""
        raise NotImplementedError

    def at_once(self, job: _Job) -> None:
        """Do the job now."""
        while job.finish(job.recolor_next()):
            pass
        self._end_well(job)

    def go_on(self, context: bpy.types.Context, job: _Job) -> set[str]:
        """Do the job in a thread."""
        global _running
        timer = context.window_manager.event_timer_add(_INTERVAL, window=context.window)
        _running = _Running(job, timer, _in_thread(job.recolor_next))
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    @common.reporting
    def modal(self, context, event):
        """Show how far it is, and begin the next file."""
        running = _running
        if running is None:  # the extension was disabled, or another .blend opened
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            running.job.stop()
            self._show(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        self._show(context)
        if not running.part.done():
            return {"PASS_THROUGH"}
        more = False
        try:
            more = running.job.finish(running.part.result())
        except _Stopped:
            self.report({"WARNING"}, f"Stopped: {_count(running.job)} written")
            return {"CANCELLED"}
        finally:
            if more:
                running.part = _in_thread(running.job.recolor_next)
            else:
                _end(context)
        if more:
            return {"PASS_THROUGH"}
        self._end_well(running.job)
        return {"FINISHED"}

    def cancel(self, context):
        """Stop because Blender ends or opens another file."""
        _end(context)

    def _end_well(self, job: _Job) -> None:
        for warning in sorted(job.warnings):
            self.report({"WARNING"}, warning)
        self.ended(job)

    def _show(self, context: bpy.types.Context) -> None:
        found = progress()
        if _running is None or found is None:
            return
        done, total, doing = found
        percent = round(100 * done / total)
        text = f"{doing} ({percent}%); Esc: Stop"
        if text != _running.shown:
            _running.shown = text
            context.window_manager.progress_update(percent)
            context.workspace.status_text_set(text)
            _redraw_sidebars()


class DYEHOUSE_OT_write_image(_Writing, bpy.types.Operator):
    """Recolor the photo into a new image of the .blend"""

    bl_idname = "dyehouse.write_image"
    bl_label = "Write to New Image"

    result: StringProperty(name="Name", description="Of the new image; empty for a name", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Make it now."""
        self.at_once(self._job(context))

    @common.reporting
    def invoke(self, context, event):
        """Make it while the window goes on."""
        return self.go_on(context, self._job(context))

    def _job(self, context: bpy.types.Context) -> _Job:
        image = common.image_of(context, self.image)
        name = self.result or f"{writing.stem_of(image)}-{shown_name(image)}"
        return _ImageJob(image, recipes.shown(image), name)

    def ended(self, job):
        """Tell the name."""
        self.report({"INFO"}, f"New image '{job.made}'")


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

    def ended(self, job):
        """Tell the file."""
        self.report({"INFO"}, f"Wrote {job.paths[0]}")


class DYEHOUSE_OT_write_colorways(_Writing, bpy.types.Operator):
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

    @classmethod
    def poll(cls, context):
        """Gray the button out where there is nothing to write."""
        image = getattr(context, "edit_image", None)
        if image is not None and not image.dyehouse.colorways:
            cls.poll_message_set("The image has no colorway yet")
            return False
        return super().poll(context)

    @common.reporting
    def execute(self, context):
        """Write them now."""
        self.at_once(self._job(context))

    @common.reporting
    def invoke(self, context, event):
        """Write them in a thread, while the window goes on."""
        return self.go_on(context, self._job(context))

    def _job(self, context: bpy.types.Context) -> _Job:
        image = common.image_of(context, self.image)
        settings = image.dyehouse
        overwrite, quality = self.overwrite or settings.overwrite, self.quality or settings.quality
        return all_colorways(image, self.pattern or settings.output_pattern, overwrite, quality)

    def ended(self, job):
        """Tell how many."""
        self.report({"INFO"}, f"{_count(job)} written to {job.paths[0].parent}")


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


def _redraw_sidebars() -> None:
    for area in background.image_editors():
        for region in area.regions:
            if region.type == "UI":
                region.tag_redraw()


def _count(job: _Job) -> str:
    total = len(job.paths)
    return f"{job.written} of {total} colorways" if job.written < total else f"{total} colorway{'s' * (total > 1)}"


def _in_thread(function: Callable[[], Any]) -> "Future[Any]":
    from concurrent.futures import Future

    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(function())
        except Exception as error:  # for the main thread
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future


def _end(context: bpy.types.Context) -> None:
    """Stop the job that runs, and take away what shows it."""
    global _running
    if _running is None:
        return
    _running.job.stop()
    context.window_manager.event_timer_remove(_running.timer)
    context.window_manager.progress_end()
    if context.workspace:
        context.workspace.status_text_set(None)
    _running = None
    _redraw_sidebars()


CLASSES = (DYEHOUSE_OT_write_image, DYEHOUSE_OT_write_file, DYEHOUSE_OT_write_colorways)
_register, _unregister = bpy.utils.register_classes_factory(CLASSES)


def register() -> None:
    """Offer the operators."""
    _register()


def unregister() -> None:
    """Stop what is being written, and take the operators back."""
    _end(bpy.context)
    _unregister()
