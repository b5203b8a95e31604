"""Baking a texture while the window goes on."""

import bpy
import gui_kit as gui
import numpy as np
from bl_ext.user_default.dyehouse.addon import images
from bl_ext.user_default.dyehouse.addon.operators import texture

ASKED = {"material": "Material", "reference": (840, 1750), "target": "#1F4E79", "mask": "click"}


def _textured():
    """The cube's material with a large picture as its base color."""
    codes = np.tile(images.pixels_of(gui.load("photo.png")), (7, 7, 1))
    height, width = codes.shape[:2]
    image = bpy.data.images.new("cloth", width, height)
    images.set_pixels(image, codes)
    tree = bpy.data.materials["Material"].node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return image, node


def escape_leaves_no_image_and_another_try_makes_it():
    image, node = _textured()
    window, area, region = gui.editor("NODE_EDITOR")
    yield gui.redrawn
    gui.call(window, area, region, bpy.ops.dyehouse.bake_texture, "INVOKE_DEFAULT", **ASKED)
    assert texture.progress() is not None, "nothing is being baked"
    assert not bpy.ops.dyehouse.bake_texture.poll(), "a second one may begin"
    before = len(bpy.data.images)
    gui.move(region.x + region.width // 2, region.y + region.height // 2)
    gui.key("Escape")
    yield lambda: texture.progress() is None
    yield gui.idle
    assert len(bpy.data.images) == before, "an image was made after Esc"
    assert node.image == image

    gui.call(window, area, region, bpy.ops.dyehouse.bake_texture, "INVOKE_DEFAULT", **ASKED, use=True)
    yield lambda: texture.progress() is None
    yield gui.idle
    assert node.image.name == "cloth Recolored", node.image.name
    x, y = ASKED["reference"]
    made = images.pixels_of(node.image)[y, x, :3] * 255
    assert np.abs(made - (0x1F, 0x4E, 0x79)).max() < 40, made
