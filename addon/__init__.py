"""The Blender side: everything that touches bpy, and nothing else."""

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


def register() -> None:
    """Register every part, in order."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Unregister every part, in reverse order."""
    for part in reversed(_PARTS):
        part.unregister()
