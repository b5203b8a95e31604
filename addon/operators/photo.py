"""Opening a photo."""

import bpy
from bpy.props import StringProperty

from . import common


class DYEHOUSE_OT_open_photo(bpy.types.Operator):
    """Open a photo and show it in the Image Editor"""

    bl_idname = "dyehouse.open_photo"
    bl_label = "Open Photo"
    bl_options = {"REGISTER", "UNDO"}

    filepath: StringProperty(name="File", description="Photo to open", subtype="FILE_PATH", options=common.PATH)
    filter_image: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context, event):
        """Ask for the file."""
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @common.reporting
    def execute(self, context):
        """Open it."""
        image = opened(common.absolute(self.filepath))
        if context.area and context.area.type == "IMAGE_EDITOR":
            context.space_data.image = image
        self.report({"INFO"}, f"Opened '{image.name}'")


def opened(path) -> bpy.types.Image:
    """The image of a file, loaded if it is not there yet.

    Raises
    ------
    FileError
        If it cannot be opened.
    """
    from ...core.errors import FileError

    if not path.is_file():
        raise FileError(f"'{path}' is no file: choose a photo.")
    try:
        image = bpy.data.images.load(str(path), check_existing=True)
    except RuntimeError:
        raise FileError(f"'{path}' cannot be opened by Blender: use PNG, JPEG, TIFF, EXR or WebP.") from None
    if not image.has_data and 0 in image.size:
        bpy.data.images.remove(image)
        raise FileError(f"'{path}' is no picture that Blender can read: use PNG, JPEG, TIFF, EXR or WebP.")
    return image


CLASSES = (DYEHOUSE_OT_open_photo,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
