"""The list of colorways: named sets of targets for the regions of a photo."""

from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import EnumProperty, IntProperty, StringProperty

from .. import colorways
from . import common
from .regions import DIRECTIONS, free_name

if TYPE_CHECKING:
    from ..properties import DyehouseColorway, DyehousePhoto


class _ColorwayOperator(common.ColorwaysOperator):
    """Base of operators about one colorway."""

    index: IntProperty(name="Colorway", description="-1 for the active one", default=-1, options={"SKIP_SAVE"})

    def found(self, context: bpy.types.Context) -> tuple[Any, int]:
        """The settings of the image, and the index of the colorway."""
        from ...core.errors import RecipeError

        image = common.editable(common.image_of(context, self.image))
        settings = image.dyehouse
        index = settings.active_colorway if self.index < 0 else self.index
        if not 0 <= index < len(settings.colorways):
            missing = "no active colorway: choose one" if self.index < 0 else f"no colorway {index + 1}: add it first"
            raise RecipeError(f"Image '{image.name}' has {missing}.")
        return settings, index


def _added(settings: "DyehousePhoto", name: str) -> "DyehouseColorway":
    """A new colorway under a free name like the given one; what was taken from the list before is void after it."""
    taken = [other.name for other in settings.colorways]
    added = settings.colorways.add()
    added.name = free_name(name, taken)
    return added


class DYEHOUSE_OT_add_colorway(common.RegionOperator, bpy.types.Operator):
    """Add a colorway with the targets of the regions"""

    bl_idname = "dyehouse.add_colorway"
    bl_label = "Add Colorway"

    name: StringProperty(name="Name", description="Empty for a numbered one", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Add it as the active one."""
        image = common.editable(common.image_of(context, self.image))
        common.region_index(image, 0)  # says in words if there is none
        settings = image.dyehouse
        added = _added(settings, self.name or "Colorway")
        for region in settings.regions:
            colorways.copy(region.target, added.targets.add())
        settings.active_colorway = len(settings.colorways) - 1


class DYEHOUSE_OT_duplicate_colorway(_ColorwayOperator, bpy.types.Operator):
    """Duplicate the colorway"""

    bl_idname = "dyehouse.duplicate_colorway"
    bl_label = "Duplicate Colorway"

    @common.reporting
    def execute(self, context):
        """Put the copy after it."""
        settings, index = self.found(context)
        added = _added(settings, settings.colorways[index].name)
        for target in settings.colorways[index].targets:
            colorways.copy(target, added.targets.add())
        settings.colorways.move(len(settings.colorways) - 1, index + 1)
        settings.active_colorway = index + 1


class DYEHOUSE_OT_remove_colorway(_ColorwayOperator, bpy.types.Operator):
    """Remove the colorway"""

    bl_idname = "dyehouse.remove_colorway"
    bl_label = "Remove Colorway"

    @common.reporting
    def execute(self, context):
        """Remove it; if it was active, its neighbor becomes active."""
        settings, index = self.found(context)
        active = settings.active_colorway
        settings.colorways.remove(index)
        settings.active_colorway = min(active - (index < active), len(settings.colorways) - 1)


class DYEHOUSE_OT_move_colorway(_ColorwayOperator, bpy.types.Operator):
    """Move the colorway in the list"""

    bl_idname = "dyehouse.move_colorway"
    bl_label = "Move Colorway"

    direction: EnumProperty(name="Direction", items=DIRECTIONS)

    @common.reporting
    def execute(self, context):
        """Move it by one; the same colorway stays active."""
        settings, index = self.found(context)
        place = index + (1 if self.direction == "DOWN" else -1)
        if not 0 <= place < len(settings.colorways):
            return {"CANCELLED"}
        settings.colorways.move(index, place)
        settings.active_colorway = {index: place, place: index}.get(settings.active_colorway, settings.active_colorway)
        return {"FINISHED"}


class DYEHOUSE_OT_use_colorway(_ColorwayOperator, bpy.types.Operator):
    """Show the colorway: its targets become those of the regions"""

    bl_idname = "dyehouse.use_colorway"
    bl_label = "Use Colorway"

    @common.reporting
    def execute(self, context):
        """Make it the active one."""
        settings, index = self.found(context)
        settings.active_colorway = index


CLASSES = (
    DYEHOUSE_OT_add_colorway,
    DYEHOUSE_OT_duplicate_colorway,
    DYEHOUSE_OT_remove_colorway,
    DYEHOUSE_OT_move_colorway,
    DYEHOUSE_OT_use_colorway,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
