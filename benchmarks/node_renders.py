"""What the node groups give, rendered by Blender: for tests and for the pictures of docs/nodes.md."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray


def flat_scene(width: int, height: int) -> bpy.types.Material:
    """An empty file with a plane that fills the camera pixel by pixel; returns its material, which is empty."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    bpy.ops.mesh.primitive_plane_add(size=2)
    plane = bpy.context.object
    plane.scale = width / height, 1, 1
    material = bpy.data.materials.new("Flat")
    plane.data.materials.append(material)
    bpy.ops.object.camera_add(location=(0, 0, 5))
    scene.camera = bpy.context.object
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 2 * max(1, width / height)
    return material


def textured(material: bpy.types.Material, image: bpy.types.Image) -> bpy.types.Node:
    """Make the material a Principled BSDF with the image for its base color; returns the texture node."""
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return texture


def seen_as_light(material: bpy.types.Material) -> None:
    """Let the material glow in its base color, so that a render shows that color exactly."""
    tree = material.node_tree
    emission = tree.nodes.new("ShaderNodeEmission")
    shown = tree.nodes["Principled BSDF"].inputs["Base Color"].links[0].from_socket
    tree.links.new(shown, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])


def rendered(scene: bpy.types.Scene) -> NDArray[np.float32]:
    """Render: (height, width, 4) float32 in the working space, top row first, alpha multiplied in."""
    with tempfile.TemporaryDirectory() as folder:
        settings = scene.render.image_settings
        settings.media_type, settings.file_format, settings.color_depth = "IMAGE", "OPEN_EXR", "32"
        settings.color_mode = "RGBA"
        scene.render.filepath, scene.render.use_file_extension = str(Path(folder) / "render.exr"), False
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(scene.render.filepath, check_existing=False)
        try:
            image.colorspace_settings.name = "Non-Color"
            width, height = image.size
            out = np.empty(width * height * 4, np.float32)
            image.pixels.foreach_get(out)
        finally:
            bpy.data.images.remove(image)
    return out.reshape(height, width, 4)[::-1]


def compositor_scene(image: bpy.types.Image) -> bpy.types.NodeTree:
    """Give the scene a compositor that shows an image; returns its tree."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = image.size
    scene.render.resolution_percentage = 100
    scene.render.compositor_precision = "FULL"  # else half floats
    tree = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    source, output = tree.nodes.new("CompositorNodeImage"), tree.nodes.new("NodeGroupOutput")
    source.image = image
    tree.links.new(source.outputs["Image"], output.inputs[0])
    return tree
