"""A sample scene opens with its photo in an Image Editor and the tab ready to use."""

from pathlib import Path

import bpy
import gui_kit as gui
import numpy as np

BLENDS = Path(__file__).resolve().parents[3] / "sample_blends"


def the_panel_is_ready_to_use():
    from bl_ext.user_default.dyehouse.addon import session

    bpy.ops.wm.open_mainfile(filepath=str(BLENDS / "sneaker.blend"), load_ui=True)
    yield gui.redrawn
    image = bpy.data.images["Photo"]
    areas = [a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "IMAGE_EDITOR"]
    assert areas, "no Image Editor is shown"
    assert areas[0].spaces.active.image == image
    _, area, region = yield from gui.image_editor(image, tab="Dyehouse")
    yield lambda: session.last(image) is not None
    yield gui.redrawn
    image.dyehouse.view = "FULL"
    x, y = image.dyehouse.regions[0].reference
    yield gui.redrawn
    shown = gui.screen()[gui.place(*gui.at(region, image, x, y))]
    look = session.look(image)
    target = look.prepared.regions()[0].matrix[:, :3] @ look.prepared.analyses[0].picture.linear()[y, x]
    codes = 255 * np.where(target <= 0.0031308, 12.92 * target, 1.055 * np.clip(target, 0, 1) ** (1 / 2.4) - 0.055)
    assert np.abs(shown - codes.clip(0, 255)).max() <= 1.5, (shown, codes)
    image.dyehouse.view = "SPLIT"
    yield gui.redrawn
    gui.figure("blender-sample", area)
