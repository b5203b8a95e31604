"""The pictures of docs/nodes.md: `uv run python -m dyehouse.benchmarks.node_figures`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import addon
from ..addon import nodes
from ..batch import files
from ..batch.sheet import contact_sheet
from ..core import gamut, transfer
from ..core.colorspace import SRGB
from .figures import FIGURES
from .node_renders import rendered

_SIDE, _SAMPLES = 320, 96
_CLOTH, _NAVY = (0.42, 0.07, 0.04), (0.02, 0.05, 0.16)
_TARGETS = {"petrol": "#0F6E78", "navy": "#1F3A6E", "ochre": "#C28A1E"}


def cloth(side: int = 512) -> NDArray[np.uint8]:
    """A woven cloth with white stitches, as sRGB codes: what a texture painter would start from."""
    y, x = np.mgrid[:side, :side] * (2 * np.pi / side)
    rng = np.random.default_rng(1)
    weave = 0.75 + 0.2 * np.sin(40 * x) * np.sin(40 * y) + rng.normal(0, 0.03, (side, side))
    light = weave[..., None] * _CLOTH
    stitches = (np.abs(np.sin(4 * y)) < 0.06) & (np.sin(48 * x) > 0)
    light[stitches] = 0.7
    return transfer.encode(light.astype(np.float32), SRGB.curve, np.uint8)


def _scene(color: tuple[float, float, float] | None = None, texture: Path | None = None) -> bpy.types.Material:
    """A smooth monkey on a gray ground; returns its material."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", _SAMPLES, False
    scene.cycles.max_bounces = 2
    scene.render.resolution_x = scene.render.resolution_y = _SIDE
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.6, 0.6, 0.6, 1)
    bpy.ops.mesh.primitive_plane_add(size=200, location=(0, 0, -1))
    ground = bpy.data.materials.new("Ground")
    ground.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.45, 0.45, 0.45, 1)
    bpy.context.object.data.materials.append(ground)
    bpy.ops.mesh.primitive_monkey_add(rotation=(-0.5, 0, 0.5))
    monkey = bpy.context.object
    monkey.name = "Monkey"
    monkey.modifiers.new("Smooth", "SUBSURF").render_levels = 2
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials.new("Cloth")
    monkey.data.materials.append(material)
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.35
    if color is not None:
        shader.inputs["Base Color"].default_value = (*color, 1)
    if texture is not None:
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.load(str(texture))
        material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.3, 0))
    bpy.context.object.data.energy = 2.5
    bpy.ops.object.camera_add(location=(0, -5.2, 1.1), rotation=(1.38, 0, 0))
    scene.camera = bpy.context.object
    return material


def _codes() -> NDArray[np.uint8]:
    light = np.ascontiguousarray(rendered(bpy.context.scene)[..., :3])
    gamut.fit_to_gamut(light.reshape(-1, 3))
    return transfer.encode(light, SRGB.curve, np.uint8)


def _texture(folder: Path) -> list[tuple[str, NDArray[np.uint8]]]:
    """One live node, its target keyframed."""
    path, codes = folder / "cloth.png", cloth()
    files.write(path, codes, files.Photo(path, codes, SRGB))
    material = _scene(texture=path)
    cells = [("the texture as painted", _codes())]
    bpy.ops.dyehouse.recolor_texture(material=material.name)
    (node,) = nodes.recolor_nodes(material.node_tree)
    for frame, code in enumerate(_TARGETS.values(), 1):
        target = transfer.decode(np.array([int(code[k : k + 2], 16) for k in (1, 3, 5)], np.uint8), SRGB.curve)
        nodes.set_target(node, target)
        node.inputs["Target Color"].keyframe_insert("default_value", frame=frame)
    for frame, name in enumerate(_TARGETS, 1):
        bpy.context.scene.frame_set(frame)
        cells.append((f"frame {frame}: {name}", _codes()))
    return cells


def _compositor() -> list[tuple[str, NDArray[np.uint8]]]:
    """A render recolored by cryptomatte, and the render of the other material."""
    _scene(_NAVY)
    truth = _codes()
    _scene(_CLOTH)
    cells = [("render", _codes())]
    bpy.ops.dyehouse.add_compositor_group(
        reference_color=_CLOTH, target="rgb({}, {}, {})".format(*_NAVY), model="dichromatic", matte="Monkey"
    )
    cells.append(("recolored in the compositor", _codes()))
    cells.append(("rendered in that color", truth))
    tree = bpy.context.scene.compositing_node_group
    (node,) = nodes.recolor_nodes(tree)
    tree.links.remove(node.inputs["Edge Light"].links[0])
    cells.append(("without Edge Light", _codes()))
    return cells


def main() -> None:
    """Render the pictures and lay them out."""
    addon.register()
    try:
        with tempfile.TemporaryDirectory() as folder:
            rows = {"nodes-texture.jpg": _texture(Path(folder)), "nodes-compositor.jpg": _compositor()}
    finally:
        addon.unregister()
    for name, row in rows.items():
        sheet = contact_sheet([row], width=_SIDE)
        files.write(FIGURES / name, sheet, files.Photo(Path(), sheet, SRGB), force=True, quality=90)
        print(f"docs/figures/{name}")


if __name__ == "__main__":
    main()
