"""Eyedroppers: the reference, the white, and the region, picked in the Image Editor or given as a pixel."""

import math
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty, IntVectorProperty

from .. import background, loupe, preview, session
from ..properties import NOWHERE
from . import common, regions

if TYPE_CHECKING:
    from ...batch.files import Photo
    from ...core.picture import Picture
    from ..properties import DyehouseRegion

MODES = (
    ("SET", "Select", "Select the material under the pixel instead of what was selected"),
    ("ADD", "Add", "Add the material under the pixel"),
    ("REMOVE", "Remove", "Take the material under the pixel away"),
)

# What zooms and pans the editor goes on to it.
_PASSED = {
    "MIDDLEMOUSE",
    "WHEELUPMOUSE",
    "WHEELDOWNMOUSE",
    "WHEELINMOUSE",
    "WHEELOUTMOUSE",
    "WHEELLEFTMOUSE",
    "WHEELRIGHTMOUSE",
    "TRACKPADPAN",
    "TRACKPADZOOM",
    "MOUSEROTATE",
    "MOUSESMARTZOOM",
    "NDOF_MOTION",
    "HOME",
    "INBETWEEN_MOUSEMOVE",
    *(f"NUMPAD_{key}" for key in ("1", "2", "4", "8", "PLUS", "MINUS", "PERIOD")),
}
_CONFIRM = {"RET", "NUMPAD_ENTER", "SPACE"}


def place_under(context: bpy.types.Context, x: int, y: int) -> "tuple[bpy.types.Region, bpy.types.Image] | None":
    """The main region of the Image Editor at a window position, and its image.

    Like Blender's own eyedropper this looks through the sidebar, whose empty parts show the picture.
    """
    for area in context.window.screen.areas:
        if area.type == "IMAGE_EDITOR" and area.spaces.active.image is not None:
            for region in area.regions:
                inside = region.x <= x < region.x + region.width and region.y <= y < region.y + region.height
                if region.type == "WINDOW" and inside:
                    return region, area.spaces.active.image
    return None


def pixel_under(region: bpy.types.Region, image: bpy.types.Image, x: int, y: int) -> tuple[int, int] | None:
    """The pixel (x, y) from the top left at a window position, in either of two pictures side by side; None outside."""
    u, v = region.view2d.region_to_view(x - region.x, y - region.y)
    settings = image.dyehouse
    if settings.preview and settings.view == "SIDE" and u >= 1 + preview.GAP:
        u -= 1 + preview.GAP
    width, height = image.size
    column, row = math.floor(u * width), math.floor((1 - v) * height)
    return (column, row) if 0 <= column < width and 0 <= row < height else None


def picture_of(photo: "Photo") -> "Picture":
    """The photo as the core takes it."""
    from ...core.picture import Picture

    return Picture(photo.pixels, photo.space.curve)


class _Eyedropper(common.ImageOperator):
    """Base of the eyedroppers.

    Invoked, it waits for a click in the Image Editor; with a pixel, or executed, it takes that.
    """

    bl_options = {"REGISTER", "UNDO", "BLOCKING"}
    pixel: IntVectorProperty(
        name="Pixel", description="Position from the top left", size=2, default=NOWHERE, min=-1, options={"SKIP_SAVE"}
    )
    hint = "Click: Pick     Esc: Cancel"

    def read(self, image: bpy.types.Image, photo: "Photo", pixel: tuple[int, int]) -> loupe.Reading:
        """What there is at a pixel; raises a DyehouseError if it cannot be used."""
        raise NotImplementedError

    def take(self, image: bpy.types.Image, pixel: tuple[int, int], event: bpy.types.Event | None) -> bool:
        """Set what was picked; returns whether that was all."""
        raise NotImplementedError

    def take_back(self, image: bpy.types.Image, whole: bool) -> None:
        """Undo the last click, or all."""

    def keep(self, image: bpy.types.Image) -> bool:
        """Finish with what was picked; returns whether there is anything."""
        return False

    @common.reporting
    def execute(self, context):
        """Take the pixel that is given."""
        from ...core.errors import ImageError

        image = common.editable(common.image_of(context, self.image))
        pixel = (self.pixel[0], self.pixel[1])
        if pixel == NOWHERE:
            raise ImageError("No pixel is given: give pixel=(x, y), or start the eyedropper in a window.")
        reading = self.read(image, session.photo_of(image), pixel)
        self.take(image, pixel, None)
        _say(self, reading)

    @common.reporting
    def invoke(self, context, event):
        """Wait for a click."""
        from ...core.errors import ImageError

        if tuple(self.pixel) != NOWHERE:
            return self.execute(context)
        image = common.editable(common.image_of(context, self.image))
        if not any(area.spaces.active.image == image for area in background.image_editors()):
            raise ImageError(f"No Image Editor shows '{image.name}': open it in one, or give a pixel.")
        self._uid = image.session_uid
        self._loupe = loupe.Loupe(self.read)
        self._follow(context, event, image)
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set(self.hint)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Follow the mouse, take clicks, and let the editor zoom and pan."""
        image = next((image for image in bpy.data.images if image.session_uid == self._uid), None)
        if image is None:
            self.cancel(context)
            return {"CANCELLED"}
        pressed = event.value == "PRESS"
        if event.type in {"ESC", "RIGHTMOUSE"} and pressed:
            self.take_back(image, whole=True)
            self.cancel(context)
            return {"CANCELLED"}
        if event.type in _CONFIRM and pressed:
            kept = self.keep(image)
            self.cancel(context)
            return {"FINISHED"} if kept else {"CANCELLED"}
        if pressed and (event.type == "BACK_SPACE" or (event.type == "Z" and (event.ctrl or event.oskey))):
            self.take_back(image, whole=False)
        elif event.type == "LEFTMOUSE" and pressed and self._click(context, event, image):
            self.cancel(context)
            return {"FINISHED"}
        elif event.type == "MOUSEMOVE":
            self._follow(context, event, image)
        elif event.type in _PASSED:
            return {"PASS_THROUGH"}
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Clear everything away, whichever way it ends."""
        self._loupe.close()
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        background.redraw()

    def _follow(self, context: bpy.types.Context, event: bpy.types.Event, image: bpy.types.Image) -> None:
        found = self._under(context, event, image)
        if found is None:
            self._loupe.hide()
        else:
            region, pixel = found
            self._loupe.show(region, event.mouse_x - region.x, event.mouse_y - region.y, image, pixel)

    def _under(
        self, context: bpy.types.Context, event: bpy.types.Event, image: bpy.types.Image
    ) -> tuple[bpy.types.Region, tuple[int, int]] | None:
        place = place_under(context, event.mouse_x, event.mouse_y)
        if place is None or place[1] != image:
            return None
        pixel = pixel_under(*place, event.mouse_x, event.mouse_y)
        return None if pixel is None else (place[0], pixel)

    def _click(self, context: bpy.types.Context, event: bpy.types.Event, image: bpy.types.Image) -> bool:
        """Take a click if it can be used; returns whether that was all."""
        from ...core.errors import DyehouseError

        found = self._under(context, event, image)
        if found is None:
            return False
        try:
            photo = session.photo_ready(image)
            if photo is None:
                return False  # the loupe says that it is being opened
            reading = self.read(image, photo, found[1])
            done = self.take(image, found[1], event)
        except DyehouseError as error:
            context.workspace.status_text_set(f"{error}     {self.hint}")
            return False
        self.pixel = found[1]
        context.workspace.status_text_set(self.hint)
        _say(self, reading)
        return done


def _say(operator: bpy.types.Operator, reading: loupe.Reading) -> None:
    for sentence in reading.words:
        operator.report({"WARNING"}, sentence)


class DYEHOUSE_OT_pick_reference(_Eyedropper, bpy.types.Operator):
    """Pick the product's present color: a lit, matte pixel of it"""

    bl_idname = "dyehouse.pick_reference"
    bl_label = "Pick Reference"

    def read(self, image, photo, pixel):
        """The matte color there, with the core's warnings."""
        from ...core.analysis import reference_warnings
        from ...core.recipe import white_asked
        from ...core.reference import matte_at
        from .. import recipes

        picture, known = picture_of(photo), session.last(image)
        if known is not None:
            white = known.prepared.white
        else:
            white, _ = white_asked(picture, recipes.without_regions(image), photo.space, photo.white)
        found = matte_at(picture, pixel, white)
        model = common.region_of(image).model if image.dyehouse.regions else "auto"
        return loupe.Reading(found.color, reference_warnings(found, white, model))

    def take(self, image, pixel, event):
        """Make it the reference of the active region."""
        settings = image.dyehouse
        region = common.region_of(image) if settings.regions else regions.add(settings)
        region.reference, region.reference_source = pixel, "PIXEL"
        return True


class DYEHOUSE_OT_pick_white(_Eyedropper, bpy.types.Operator):
    """Pick a white or gray card in the photo, for the color of the light"""

    bl_idname = "dyehouse.pick_white"
    bl_label = "Pick White"

    def read(self, image, photo, pixel):
        """The color of the card."""
        from ...core.reference import white_at

        return loupe.Reading(white_at(picture_of(photo), pixel))

    def take(self, image, pixel, event):
        """Make it the white of the photo."""
        image.dyehouse.white_pixel, image.dyehouse.white_source = pixel, "PIXEL"
        return True


# What the clicks of a region are, for going back: its mask, its click and its further clicks; None for no region.
type _Clicks = tuple[str, tuple[int, ...], list[tuple[tuple[int, ...], bool]]] | None


class DYEHOUSE_OT_pick_region(_Eyedropper, bpy.types.Operator):
    """Select the product by clicks; Shift adds a material, Ctrl takes one away"""

    bl_idname = "dyehouse.pick_region"
    bl_label = "Pick Region"

    mode: EnumProperty(name="Mode", description="What a click does", items=MODES, options={"SKIP_SAVE"})
    hint = (
        "Click: Select     Shift Click: Add     Ctrl Click: Remove     Backspace: Take Back     Enter: Done     "
        "Esc: Cancel"
    )

    def invoke(self, context, event):
        """Show the region meanwhile."""
        begun = super().invoke(context, event)
        if begun == {"RUNNING_MODAL"}:
            image = common.image_of(context, self.image)
            self._states = [_clicks(image)]
            preview.selecting.add(self._uid)
            background.redraw()
        return begun

    def cancel(self, context):
        """Show the region no more."""
        preview.selecting.discard(self._uid)
        super().cancel(context)

    def read(self, image, photo, pixel):
        """The color there as it is."""
        from ...core.reference import check_pixel, read_window, trimmed_mean

        picture = picture_of(photo)
        return loupe.Reading(trimmed_mean(read_window(picture, check_pixel(picture, pixel, "Click"))))

    def take(self, image, pixel, event):
        """Select, add or remove; more clicks may follow."""
        from ...core.errors import MaskError

        if event is not None:
            self.mode = "ADD" if event.shift else "REMOVE" if event.ctrl else "SET"
        settings = image.dyehouse
        region = common.region_of(image) if settings.regions else None
        begun = region is not None and region.mask_source == "CLICK" and _is_clicked(region)
        if self.mode == "REMOVE" and not begun:
            raise MaskError("Nothing is selected yet that could be taken away: click the product first.")
        region = region or regions.add(settings)
        if self.mode == "SET" or not begun:
            region.mask_source, region.click = "CLICK", pixel
            region.more_clicks.clear()
        else:
            more = region.more_clicks.add()
            more.pixel, more.removes = pixel, self.mode == "REMOVE"
        if event is not None:
            self._states.append(_clicks(image))
            background.redraw()
        return False

    def take_back(self, image, whole):
        """Return to what was clicked before."""
        if len(self._states) > 1:
            del self._states[1 if whole else -1 :]
            _click_again(image, self._states[-1])
            background.redraw()

    def keep(self, image):
        """Make every click a step that can be undone; the last one is that of the operator itself."""
        for state in self._states[1:-1]:
            _click_again(image, state)
            bpy.ops.ed.undo_push(message=self.bl_label)
        _click_again(image, self._states[-1])
        return len(self._states) > 1


def _is_clicked(region: "DyehouseRegion") -> bool:
    """Whether a clicked region has a first click: its own, or the reference pixel in its stead."""
    at_reference = region.reference_source == "PIXEL" and tuple(region.reference) != NOWHERE
    return tuple(region.click) != NOWHERE or at_reference


def _clicks(image: bpy.types.Image) -> _Clicks:
    if not image.dyehouse.regions:
        return None
    region = common.region_of(image)
    return region.mask_source, tuple(region.click), [(tuple(more.pixel), more.removes) for more in region.more_clicks]


def _click_again(image: bpy.types.Image, state: _Clicks) -> None:
    settings = image.dyehouse
    if state is None:
        regions.remove(settings, 0)
        return
    region = common.region_of(image) if settings.regions else regions.add(settings)
    region.mask_source, region.click, more_clicks = state
    region.more_clicks.clear()
    for pixel, removes in more_clicks:
        more = region.more_clicks.add()
        more.pixel, more.removes = pixel, removes


CLASSES = (DYEHOUSE_OT_pick_reference, DYEHOUSE_OT_pick_white, DYEHOUSE_OT_pick_region)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
