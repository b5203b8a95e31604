"""The tab of the Image Editor: every panel draws, with a photo and without, and shows what it should."""

import bpy
import gui_kit as gui

PANELS = (
    "photo",
    "region",
    "white",
    "target",
    "swatches",
    "lights",
    "colorways",
    "write",
    "diagnostics",
    "advanced",
)


def draws_without_a_region():
    image = gui.load("photo.png")
    _, area, _ = yield from gui.image_editor(image, tab="Dyehouse")
    yield gui.redrawn
    gui.figure("blender-begin", area)


def draws_every_panel():
    image = gui.load("photo.png")
    _, area, _ = yield from gui.image_editor(image, tab="Dyehouse")
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(150, 300))
    bpy.ops.dyehouse.add_region(image=image.name)
    bpy.ops.dyehouse.set_target(image=image.name, text="#1F4E79")
    bpy.ops.dyehouse.add_colorway(image=image.name)
    image.dyehouse.preview = True
    for white in ("PIXEL", "ILLUMINANT", "TEMPERATURE", "HIGHLIGHTS", "COLOR", "BALANCED"):
        image.dyehouse.white_source = white
        yield gui.redrawn
    for mask in ("WHOLE", "ALPHA", "IMAGE", "SPLINE", "CRYPTOMATTE", "FILE", "CLICK"):
        image.dyehouse.regions[1].mask_source = mask
        yield gui.redrawn
    bpy.ops.dyehouse.set_target(image=image.name, text="lch(60, 130, 140)")  # no screen can show it
    bpy.ops.dyehouse.use_swatch(image=image.name, library="ColorChecker", index=3)
    for name in PANELS:
        assert hasattr(bpy.types, f"DYEHOUSE_PT_{name}"), name
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(272, 151))
    yield from gui.settle()
    gui.figure("blender-panels", area)
