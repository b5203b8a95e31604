"""The list of regions: the products, or materials of them, in a photo."""

from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from .. import colorways
from . import common

if TYPE_CHECKING:
    from ..properties import DyehousePhoto, DyehouseRegion

DIRECTIONS = (("UP", "Up", "Toward the top"), ("DOWN", "Down", "Toward the bottom"))


class DYEHOUSE_OT_add_region(common.ImageOperator, bpy.types.Operator):
    """Add a region for another product or material; it lies over the ones before it"""

    bl_idname = "dyehouse.add_region"
    bl_label = "Add Region"

    name: StringProperty(name="Name", description="Empty for a numbered one", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Add it as the active one."""
        image = common.editable(common.image_of(context, self.image))
        add(image.dyehouse, self.name)


class DYEHOUSE_OT_remove_region(common.RegionOperator, bpy.types.Operator):
    """Remove the region"""

    bl_idname = "dyehouse.remove_region"
    bl_label = "Remove Region"

    index: IntProperty(name="Region", description="-1 for the active one", default=-1, options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Remove it here and in the colorways."""
        image = common.editable(common.image_of(context, self.image))
        remove(image.dyehouse, common.region_index(image, self.index))


class DYEHOUSE_OT_move_region(common.RegionOperator, bpy.types.Operator):
    """Move the region in the list; a later one lies over an earlier one"""

    bl_idname = "dyehouse.move_region"
    bl_label = "Move Region"

    index: IntProperty(name="Region", description="-1 for the active one", default=-1, options={"SKIP_SAVE"})
    direction: EnumProperty(name="Direction", items=DIRECTIONS)

    @common.reporting
    def execute(self, context):
        """Move it, and its targets in the colorways."""
        image = common.editable(common.image_of(context, self.image))
        settings, index = image.dyehouse, common.region_index(image, self.index)
        place = index + (1 if self.direction == "DOWN" else -1)
        if not 0 <= place < len(settings.regions):
            return {"CANCELLED"}
        colorways.fill(settings)
        settings.regions.move(index, place)
        for colorway in settings.colorways:
            colorway.targets.move(index, place)
        settings.active_region = place
        return {"FINISHED"}


def add(settings: "DyehousePhoto", name: str = "") -> "DyehouseRegion":
    """Add a region as the active one, with no target in the colorways."""
    region = settings.regions.add()
    region.name = free_name(name or "Product", [other.name for other in settings.regions[:-1]])
    for colorway in settings.colorways:
        colorway.targets.add().used = False
    settings.active_region = len(settings.regions) - 1
    return region


def remove(settings: "DyehousePhoto", index: int) -> None:
    """Remove a region, and its targets from the colorways."""
    settings.regions.remove(index)
    for colorway in settings.colorways:
        if index < len(colorway.targets):
            colorway.targets.remove(index)
    settings.active_region = max(0, min(settings.active_region, len(settings.regions) - 1))


def free_name(name: str, taken: list[str]) -> str:
    """The name, numbered if it is taken: names tell regions and colorways apart in recipe files."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name} {number}"
    return free


CLASSES = (DYEHOUSE_OT_add_region, DYEHOUSE_OT_remove_region, DYEHOUSE_OT_move_region)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
