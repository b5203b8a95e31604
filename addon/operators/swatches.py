"""Targets from swatches, and the swatch book: use, mark, import, export."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, CollectionProperty, IntProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .. import recipes, swatches
from . import common
from .regions import free_name


class DYEHOUSE_OT_set_target(common.RegionOperator, bpy.types.Operator):
    """Put a region into a color given as text"""

    bl_idname = "dyehouse.set_target"
    bl_label = "Set Target"
    text: StringProperty(
        name="Color", description="#RRGGBB, lab(L, a, b), a CSV file, or LIBRARY#SWATCH", options={"SKIP_SAVE"}
    )
    region: IntProperty(name="Region", description="Its index; -1 for the active one", default=-1, min=-1)

    @common.reporting
    def execute(self, context):
        """Set the target's text, after it has been understood."""
        from ...core.swatches import parse_target

        image = common.editable(common.image_of(context, self.image))
        target = common.region_of(image, self.region).target
        swatch = parse_target(self.text, recipes.folder_of(image))
        target.used, target.text = True, self.text
        target.swatch_name = swatch.text


class DYEHOUSE_OT_use_swatch(common.RegionOperator, bpy.types.Operator):
    """Put the active region into this color"""

    bl_idname = "dyehouse.use_swatch"
    bl_label = "Use Swatch"
    library: StringProperty(name="Library", options={"SKIP_SAVE"})
    index: IntProperty(name="Index", description="Of the swatch in its library", min=0, options={"SKIP_SAVE"})
    listing: StringProperty(name="List", description="FAVORITES, RECENT, or empty", options={"SKIP_SAVE"})

    @classmethod
    def description(cls, context, properties):
        """Name the swatch in the tooltip."""
        from ...core.errors import DyehouseError

        try:
            swatch = _swatch(properties)
        except (DyehouseError, IndexError):
            return cls.__doc__
        return f"{swatch.text}: {swatch.kind}"

    @common.reporting
    def execute(self, context):
        """Set the target, and remember the swatch."""
        from ...core.errors import TargetError

        image = common.editable(common.image_of(context, self.image))
        target = common.region_of(image).target
        try:
            swatch = _swatch(self)
        except IndexError:
            raise TargetError(f"Library '{self.library}' has no swatch {self.index}: choose another.") from None
        target.used, target.text, target.swatch_name = True, swatch.written, swatch.text
        swatches.book().used(swatch)
        swatches.changed()


def _swatch(asked):
    book = swatches.book()
    if asked.listing == "FAVORITES":
        return book.favorites[asked.index]
    if asked.listing == "RECENT":
        return book.recent[asked.index]
    return book.library(asked.library).swatches[asked.index]


class DYEHOUSE_OT_favorite_swatch(common.RegionOperator, bpy.types.Operator):
    """Mark the target of the active region as a favorite"""

    bl_idname = "dyehouse.favorite_swatch"
    bl_label = "Favorite"
    bl_options = {"REGISTER"}
    remove: BoolProperty(name="Remove", description="Take the mark away", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Mark it, under the name of its swatch if it has one."""
        from ...core.errors import TargetError
        from ...core.swatches import Swatch

        image = common.image_of(context, self.image)
        target = common.region_of(image).target
        swatch = recipes.swatch_of(target, image)
        if swatch is None:
            raise TargetError("The region keeps its color: give it a target to mark.")
        named = Swatch(target.swatch_name, swatch.color) if target.swatch_name and target.text else swatch
        swatches.book().set_favorite(named, not self.remove)
        swatches.changed()


class DYEHOUSE_OT_copy_target(common.RegionOperator, bpy.types.Operator):
    """Give another region the target of the active one"""

    bl_idname = "dyehouse.copy_target"
    bl_label = "Copy Target to Region"
    to: IntProperty(name="Region", description="Index of the region that takes the target", min=0)

    @common.reporting
    def execute(self, context):
        """Copy color, text and name."""
        image = common.editable(common.image_of(context, self.image))
        source, target = common.region_of(image).target, common.region_of(image, self.to).target
        target.used, target.color, target.text = True, source.color, source.text
        target.swatch_name = source.swatch_name


class DYEHOUSE_OT_import_swatches(bpy.types.Operator, ImportHelper):
    """Add swatch files, or a folder of them as one library, to the swatch book"""

    bl_idname = "dyehouse.import_swatches"
    bl_label = "Import Swatches"
    filter_glob: StringProperty(
        default="*.ase;*.aco;*.gpl;*.cxf;*.csv;*.txt;*.it8;*.cgats", options={"HIDDEN", "SKIP_SAVE"}
    )
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    cmyk: StringProperty(
        name="CMYK Profile",
        description="ICC profile of the printer, for CMYK swatches; without it they are left out",
        subtype="FILE_PATH",
        options=common.PATH,
    )

    @common.reporting
    def execute(self, context):
        """Copy the files into the user's folder, after they have been read."""
        from ...core.swatch_files.printer import inks_as

        inks = inks_as(common.absolute(self.cmyk)) if self.cmyk else None
        chosen = [Path(self.directory) / each.name for each in self.files if each.name] or [Path(self.filepath)]
        for path in chosen:
            library = swatches.book().import_file(path, inks)
            self.report({"INFO"}, f"{library.name}: {len(library)} swatches")
            for note in library.notes:
                self.report({"WARNING"}, note)
        swatches.changed()


class DYEHOUSE_OT_export_swatches(bpy.types.Operator, ExportHelper):
    """Write a library of the swatch book, or what the browser shows, as a swatch file"""

    bl_idname = "dyehouse.export_swatches"
    bl_label = "Export Swatches"
    filename_ext = ".ase"
    check_extension = None
    library: StringProperty(name="Library", description="Empty for what the browser shows", options={"SKIP_SAVE"})
    overwrite: BoolProperty(name="Overwrite", description="Replace an existing file", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Write the file; its ending decides on the format."""
        from ...core import swatch_files
        from ...core.library import Library

        if self.library:
            library = swatches.book().library(self.library)
        else:
            library = Library.of("Swatches", [hit.swatch for hit in swatches.shown(None)])
        lost = swatch_files.write(common.absolute(self.filepath), library, force=self.overwrite)
        for sentence in lost:
            self.report({"WARNING"}, sentence)
        self.report({"INFO"}, f"Wrote {len(library)} swatches")


class DYEHOUSE_OT_remove_library(bpy.types.Operator):
    """Take a library of your own out of the swatch book"""

    bl_idname = "dyehouse.remove_library"
    bl_label = "Remove Library"
    library: StringProperty(name="Library", options={"SKIP_SAVE"})

    def invoke(self, context, event):
        """Ask first: the file is deleted."""
        return context.window_manager.invoke_confirm(self, event)

    @common.reporting
    def execute(self, context):
        """Delete the library's file."""
        swatches.book().remove(self.library)
        swatches.browser().library = "ALL"
        swatches.changed()


class DYEHOUSE_OT_swatches_from_palette(bpy.types.Operator):
    """Make a library of a palette of this .blend"""

    bl_idname = "dyehouse.swatches_from_palette"
    bl_label = "Library from Palette"
    palette: StringProperty(name="Palette", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Keep the palette's colors as a library of the user's own."""
        from ...core.errors import FileError
        from ...core.library import Library

        palette = bpy.data.palettes.get(self.palette)
        if palette is None:
            raise FileError(f"There is no palette '{self.palette}': give the name of one of this .blend.")
        colors = [recipes.in_rec709(entry.color) for entry in palette.colors]
        if not colors:
            raise FileError(f"Palette '{palette.name}' is empty: add colors first.")
        name = free_name(palette.name, list(swatches.book().names))
        swatches.book().keep(name, Library.from_linear_colors(name, colors).swatches)
        swatches.changed()
        self.report({"INFO"}, f"{name}: {len(colors)} swatches")


class DYEHOUSE_OT_swatches_to_palette(bpy.types.Operator):
    """Make a palette of a library, for painting in Blender"""

    bl_idname = "dyehouse.swatches_to_palette"
    bl_label = "Palette from Library"
    bl_options = {"REGISTER", "UNDO"}
    library: StringProperty(name="Library", options={"SKIP_SAVE"})

    @common.reporting
    def execute(self, context):
        """Fill a new palette; its colors have no names."""
        library = swatches.book().library(self.library)
        palette = bpy.data.palettes.new(library.name)
        for color in library.linear_colors:
            palette.colors.new().color = recipes.from_rec709(color)
        self.report({"INFO"}, f"Made palette {palette.name} of {len(library)} colors")


CLASSES = (
    DYEHOUSE_OT_set_target,
    DYEHOUSE_OT_use_swatch,
    DYEHOUSE_OT_favorite_swatch,
    DYEHOUSE_OT_copy_target,
    DYEHOUSE_OT_import_swatches,
    DYEHOUSE_OT_export_swatches,
    DYEHOUSE_OT_remove_library,
    DYEHOUSE_OT_swatches_from_palette,
    DYEHOUSE_OT_swatches_to_palette,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
