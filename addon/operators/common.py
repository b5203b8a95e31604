"""What the operators share: which image they are about, and how they say what went wrong."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import StringProperty

# Options of arguments that are paths, in which `//` stands for the folder of the .blend.
PATH = {"SKIP_SAVE", "PATH_SUPPORTS_BLEND_RELATIVE"}


def image_named(name: str) -> bpy.types.Image:
    """The image of this name: the .blend's own if a linked one has the same.

    Raises
    ------
    ImageError
        If there is none.
    """
    from ...core.errors import ImageError

    found = bpy.data.images.get((name, None)) or bpy.data.images.get(name)
    if found is None:
        raise ImageError(f"There is no image '{name}': give the name of an image of this .blend.")
    return found


def image_of(context: bpy.types.Context, name: str = "") -> bpy.types.Image:
    """The image of this name; without a name, the one that the Image Editor in context shows.

    Raises
    ------
    ImageError
        If there is none.
    """
    from ...core.errors import ImageError

    if name:
        return image_named(name)
    image = getattr(context, "edit_image", None)
    if image is None:
        raise ImageError("There is no image here: open one in the Image Editor, or give an image by its name.")
    return image


def editable(image: bpy.types.Image) -> bpy.types.Image:
    """Return the image if its settings can be saved with this .blend.

    Raises
    ------
    ImageError
        If it is linked from another one.
    """
    from ...core.errors import ImageError

    if image.library is not None and image.override_library is None:
        raise ImageError(f"Image '{image.name}' is linked from '{image.library.name}': make it local to set anything.")
    return image


def region_index(image: bpy.types.Image, index: int = -1) -> int:
    """The index of a region: as given, or of the active one for -1.

    Raises
    ------
    RecipeError
        If there is none.
    """
    from ...core.errors import RecipeError

    settings = image.dyehouse
    index = settings.active_region if index < 0 else index
    if not settings.regions:
        raise RecipeError(f"Image '{image.name}' has no region: add one first.")
    if not 0 <= index < len(settings.regions):
        raise RecipeError(f"Image '{image.name}' has no region {index + 1}: it has {len(settings.regions)}.")
    return index


def region_of(image: bpy.types.Image, index: int = -1) -> Any:
    """The region (DyehouseRegion) at an index, or the active one for -1; raises as `region_index`."""
    return image.dyehouse.regions[region_index(image, index)]


def absolute(path: str, library: bpy.types.Library | None = None) -> Path:
    """A path of a property: `//` stands for the folder of the .blend, or of the library."""
    return Path(bpy.path.abspath(path, library=library))


def reporting(method: Callable[..., set[str] | None]) -> Callable[..., set[str]]:
    """Decorate execute, invoke or modal: bad input becomes a report and CANCELLED, no return value FINISHED."""

    def tell(operator: bpy.types.Operator, *arguments: Any) -> set[str]:
        from ...core.errors import DyehouseError

        try:
            return method(operator, *arguments) or {"FINISHED"}
        except DyehouseError as error:
            operator.report({"ERROR"}, str(error))
        except MemoryError:
            operator.report({"ERROR"}, "There is not enough memory for this: close other programs.")
        return {"CANCELLED"}

    # Blender counts the parameters.
    @wraps(method)
    def with_event(self: bpy.types.Operator, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return tell(self, context, event)

    @wraps(method)
    def without_event(self: bpy.types.Operator, context: bpy.types.Context) -> set[str]:
        return tell(self, context)

    return with_event if method.__code__.co_argcount == 3 else without_event


class ImageOperator:
    """Base of operators about one image.

    The image is given by its name, or is the one of the Image Editor in context; scripts need no context at all.
    """

    if TYPE_CHECKING:
        poll_message_set: Callable[[str], None]

    bl_options = {"REGISTER", "UNDO"}
    image: StringProperty(
        name="Image",
        description="Name of the image; empty for the one in the Image Editor",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out, with the reason, in an Image Editor without an image."""
        if context.area and context.area.type == "IMAGE_EDITOR" and getattr(context, "edit_image", None) is None:
            cls.poll_message_set("The Image Editor shows no image")
            return False
        return True


class RegionOperator(ImageOperator):
    """Base of operators about one region of an image."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out, with the reason, in an Image Editor whose image has no region."""
        if not super().poll(context):
            return False
        image = getattr(context, "edit_image", None)
        if image is not None and not image.dyehouse.regions:
            cls.poll_message_set("The image has no region yet")
            return False
        return True


class ColorwaysOperator(RegionOperator):
    """Base of operators about the colorways of an image."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out, with the reason, in an Image Editor whose image has no colorway."""
        image = getattr(context, "edit_image", None)
        if image is not None and not image.dyehouse.colorways:
            cls.poll_message_set("The image has no colorway yet")
            return False
        return super().poll(context)
