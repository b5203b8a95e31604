"""The kit itself: the mouse hits the pixel that is asked for, and the screen is read where it is shown."""

from typing import ClassVar

import bpy
import gui_kit as gui
import numpy as np


def the_extension_is_enabled():
    assert bpy.context.preferences.addons.get("bl_ext.user_default.dyehouse")
    yield gui.redrawn


def screen_pixels_are_the_codes():
    codes = np.array([[30, 60, 90, 255], [200, 40, 40, 255], [250, 240, 230, 255], [20, 20, 25, 255]], np.float32)
    image = bpy.data.images.new("patches", 300, 200)
    picture = codes.reshape(2, 2, 4).repeat(100, 0).repeat(150, 1) / 255
    image.pixels.foreach_set(picture[::-1].ravel())
    image.update()
    _, _, region = yield from gui.image_editor(image)
    shown = gui.screen()
    for (x, y), code in zip(((75, 50), (225, 50), (75, 150), (225, 150)), codes, strict=True):
        assert np.abs(shown[gui.place(*gui.at(region, image, x, y))] - code[:3]).max() <= 1


class _Record(bpy.types.Operator):
    """Note where clicks land, and with which keys held."""

    bl_idname = "test.record"
    bl_label = "Record"
    seen: ClassVar[list] = []

    def invoke(self, context, event):
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            return {"CANCELLED"}
        if event.type == "LEFTMOUSE" and event.value == "PRESS":
            area = next(area for area in context.screen.areas if area.type == "IMAGE_EDITOR")
            region = gui.region_of(area)
            u, v = region.view2d.region_to_view(event.mouse_x - region.x, event.mouse_y - region.y)
            width, height = area.spaces.active.image.size
            self.seen.append((int(u * width // 1), int((1 - v) * height // 1), event.shift, event.ctrl))
        return {"RUNNING_MODAL"}


def the_mouse_hits_the_pixel():
    bpy.utils.register_class(_Record)
    image = gui.load("photo.png")
    window, area, region = yield from gui.image_editor(image)
    gui.call(window, area, region, bpy.ops.test.record, "INVOKE_DEFAULT")
    yield gui.redrawn
    clicks = [(0, 0, ()), (137, 61, ("shift",)), (599, 399, ("ctrl",))]
    for count, (x, y, hold) in enumerate(clicks, 1):
        yield from gui.click(*gui.at(region, image, x, y), hold=hold)
        yield lambda count=count: len(_Record.seen) == count
    gui.key("Escape")
    yield gui.idle
    bpy.utils.unregister_class(_Record)
    expected = [(x, y, "shift" in hold, "ctrl" in hold) for x, y, hold in clicks]
    assert _Record.seen == expected, _Record.seen


def buttons_are_found_and_pressed():
    image = gui.load("photo.png")
    _, area, _ = yield from gui.image_editor(image, tab="Image")
    assert not image.use_view_as_render
    yield from gui.press(area, "use_view_as_render")
    yield lambda: image.use_view_as_render
    yield from gui.find(area, "image.reload", across=0.8)
