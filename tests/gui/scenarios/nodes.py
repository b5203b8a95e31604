"""Recolor Texture by the buttons of the Shader Editor and of the material's properties."""

import bpy
import gui_kit as gui
import numpy as np
from bl_ext.user_default.dyehouse.addon import images
from bl_ext.user_default.dyehouse.addon import nodes as recoloring


def _textured():
    """Put the photo on the cube of the start-up file: its material and image."""
    bpy.context.scene.render.engine = "CYCLES"  # by which the icons of materials are rendered sooner on a CPU
    image = gui.load("photo.png")
    material = bpy.data.materials["Material"]
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.location = image, (-900, 300)
    shader = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    for node in tree.nodes:
        node.select = False
    return material, image


def _node(material):
    found = recoloring.recolor_nodes(material.node_tree)
    return found[0] if found else None


def _use_and_bake(area, material, image):
    """Recolor by the buttons of an editor, choose a color in its picker, and bake; `yield from` it."""
    yield from gui.press(area, "dyehouse.recolor_texture")
    yield lambda: _node(material)
    yield from gui.settle()
    before = tuple(_node(material).inputs["Target Color"].default_value)
    socket = list(_node(material).inputs).index(_node(material).inputs["Target Color"])
    at = yield from gui.find(area, f"inputs[{socket}].default_value", across=0.7)
    closed = gui.screen()
    yield from gui.click(*at)
    yield gui.redrawn
    x, y = gui.color_wheel(closed)
    yield from gui.drag((x, y), (x - 30, y - 20), (x - 25, y + 35))
    view = max(gui.main_window().screen.areas, key=lambda area: area.width * area.height)
    yield from gui.click(view.x + 30, view.y + 40)  # closes the picker
    yield gui.redrawn
    color = tuple(_node(material).inputs["Target Color"].default_value)
    assert np.abs(np.subtract(color, before)).max() > 0.05, "the drag did not change the color"
    if area.type == "NODE_EDITOR":
        gui.figure("blender-shader", area)
    known = set(bpy.data.images)
    yield from gui.press(area, "dyehouse.bake_texture", across=0.3)
    yield lambda: set(bpy.data.images) - known
    yield gui.idle
    (baked,) = set(bpy.data.images) - known
    assert tuple(baked.size) == tuple(image.size)
    # The same settings without the window.
    again = set(bpy.data.images)
    bpy.ops.dyehouse.bake_texture(material=material.name, name="again")
    (expected,) = set(bpy.data.images) - again
    assert (images.pixels_of(baked) == images.pixels_of(expected)).all()
    assert np.abs(images.pixels_of(baked) - images.pixels_of(image)).max() > 0.2
    yield from gui.press(area, "dyehouse.remove_recolor")
    yield lambda: _node(material) is None


def in_the_shader_editor():
    material, image = _textured()
    window, area, region = gui.editor("NODE_EDITOR")
    area.ui_type = "ShaderNodeTree"
    yield gui.redrawn
    gui.call(window, area, region, bpy.ops.node.view_all)
    yield from gui.sidebar(area, "Dyehouse")
    yield from _use_and_bake(area, material, image)


def in_the_material_properties():
    material, image = _textured()
    area = next(area for area in gui.main_window().screen.areas if area.type == "PROPERTIES")
    area.spaces.active.context = "MATERIAL"
    area.spaces.active.search_filter = "recolor"  # opens the panel
    yield gui.redrawn
    yield from _use_and_bake(area, material, image)
