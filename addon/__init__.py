"""The Blender side: everything that touches bpy, and nothing else."""

from types import ModuleType

from . import (
    background,
    command,
    nodes,
    overlays,
    panels,
    panels_nodes,
    picked_colors,
    preview,
    properties,
    session,
    swatches,
    thumbnails,
)
from .operators import catalog as catalog_operators
from .operators import colorways as colorway_operators
from .operators import compositor, photo, pick, recipe, recolor, regions, texture, write
from .operators import swatches as swatch_operators

_PARTS = (
    properties,
    picked_colors,
    background,
    session,
    thumbnails,
    preview,
    overlays,
    photo,
    regions,
    pick,
    recolor,
    colorway_operators,
    write,
    catalog_operators,
    recipe,
    swatches,
    swatch_operators,
    panels,
    nodes,
    texture,
    compositor,
    panels_nodes,
    command,
)


_registered: list[ModuleType] = []


def register() -> None:
    """Register every part, in order."""
    for part in _PARTS:
        part.register()
        _registered.append(part)


def unregister() -> None:
    """Unregister what is registered, in reverse order; a second time in a row, that is nothing."""
    while _registered:
        _registered.pop().unregister()
