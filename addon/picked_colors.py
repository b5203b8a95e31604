"""Colors that the user picked stay what they are when the .blend gets another working space.

Blender converts its own colors then, but not those of extensions. So each image notes which space its colors are in.
"""

from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from . import colorways, images

if TYPE_CHECKING:
    from ..core.colorspace import RGBSpace
    from .properties import DyehousePhoto


def space_of(image: bpy.types.Image | None) -> "RGBSpace":
    """The space that the picked colors of an image are in."""
    from ..core.colorspace import space_named

    noted = image.dyehouse.colors_in if image else ""
    return space_named(images.SPACE_NAMES[noted]) if noted else images.working_space()


def note(settings: "DyehousePhoto") -> None:
    """Note the space of a color that has just been picked, and bring the others into it."""
    if colorways.copying():
        return
    if settings.colors_in:
        _bring(settings)
    else:
        settings.colors_in = bpy.data.colorspace.working_space


def _bring(settings: "DyehousePhoto") -> None:
    """Bring the colors of an image into the working space."""
    from . import recipes

    space, now = space_of(settings.id_data), bpy.data.colorspace.working_space
    if settings.colors_in == now:
        return

    def moved(color: Any) -> list[float]:
        return [max(0.0, float(v)) for v in recipes.between(space, images.working_space(), list(color))]

    settings.colors_in = now
    with colorways.quiet():
        settings.white_color, settings.light_color = moved(settings.white_color), moved(settings.light_color)
        for region in settings.regions:
            region.reference_color = moved(region.reference_color)
        lists = [settings.regions, *(colorway.targets for colorway in settings.colorways)]
        for target in (getattr(each, "target", each) for each in (t for some in lists for t in some)):
            target.shown = recipes.shown_color(target.text) if target.text else moved(target.shown)
            target.color = target.shown if target.text else moved(target.color)


@persistent
def _on_change(*_: object) -> None:
    now = bpy.data.colorspace.working_space
    for image in bpy.data.images:
        if image.library is None and image.dyehouse.colors_in not in ("", now):
            _bring(image.dyehouse)


_HANDLERS = ("depsgraph_update_post", "load_post", "undo_post", "redo_post")


def register() -> None:
    """Watch for another working space."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).append(_on_change)


def unregister() -> None:
    """Watch no more."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(_on_change)
