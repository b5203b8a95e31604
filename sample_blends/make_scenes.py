"""Make the sample scenes: products whose color is one custom property.

Every scene is built from nothing by a function below, so that this file is the whole description of it. Run as
a command, it writes them as .blend files::

    python -m dyehouse.sample_blends.make_scenes [NAME ...] [--out FOLDER]

What a scene carries, all as custom properties of the scene:

``dye``
    linear RGB reflectance of the dyed material (its "albedo"); change it and the product changes color.
``key_light``, ``fill_light``
    linear RGB color of the two light groups; a scene with one kind of light has no ``fill_light``.
``diffuser``
    1 turns the product into a perfect white diffuser (the white tile of a spectrometer), 0 back.
``product``
    name of the dyed material, which is also its name in the cryptomatte pass: the mask.
``reference_x``, ``reference_y``
    a matte, well-lit place on the product, as fractions of the picture from its upper left corner.
``white``
    linear RGB of a perfect white diffuser in the light at that place, up to the exposure: the sum of the light
    groups' colors, each times its ``key_share`` or ``fill_share``.
``colors``
    names of the scene's other color properties, if any: the sole of a shoe, the boards around a metal mug.

Exposure: the key light alone gives a perfect white diffuser that faces it 0.9 in linear RGB.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float, float]
Socket = Any
"""A node socket or a number or a vector: what can be put into an input."""

KEY_WHITE = 0.9
"""Radiance of a perfect white diffuser that faces the key light, from the key light alone."""

TUNGSTEN: Point = (1.83, 0.86, 0.27)
"""CIE illuminant A, of luminance 1, in linear Rec.709: what a picture balanced for D65 makes of a lamp."""

DAYLIGHT: Point = (0.92, 1.00, 1.17)
"""CIE illuminant D75 likewise."""

PRODUCT = "Product"
"""Name of the dyed material."""


# --- Geometry ---------------------------------------------------------------------------------------------
def add_grid(
    name: str,
    points: NDArray[np.floating],
    material: bpy.types.Material,
    *,
    closed_u: bool = False,
    closed_v: bool = False,
    subdivide: int = 0,
) -> bpy.types.Object:
    """Add a smooth surface through a grid of points.

    Parameters
    ----------
    points
        (U, V, 3) positions. Faces look to where u x v points.
    closed_u, closed_v
        Join the last row (column) to the first.
    subdivide
        Levels of a subdivision surface, which keeps the file small.
    """
    nu, nv = points.shape[:2]
    index = np.arange(nu * nv).reshape(nu, nv)
    uv = np.stack(np.meshgrid(np.arange(nu + 1), np.arange(nv + 1), indexing="ij"), -1).astype(float)
    uv /= (nu if closed_u else nu - 1, nv if closed_v else nv - 1)
    if closed_u:
        index = np.vstack([index, index[:1]])
    if closed_v:
        index = np.hstack([index, index[:, :1]])
    uv = uv[: index.shape[0], : index.shape[1]]

    def corners(grid: NDArray[Any]) -> NDArray[Any]:
        return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)

    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.reshape(-1, 3).tolist(), [], corners(index).reshape(-1, 4).tolist())
    layer = mesh.uv_layers.new(name="UVMap")
    layer.uv.foreach_set("vector", corners(uv).astype(np.float32).ravel())
    mesh.shade_smooth()
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    if subdivide:
        modifier = thing.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = subdivide
    return thing


def add_lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    material: bpy.types.Material,
    *,
    segments: int = 96,
    subdivide: int = 1,
) -> bpy.types.Object:
    """Add a surface of revolution about z; `profile` holds (radius, z), followed so that outside is left."""
    r, z = np.array(profile, dtype=float).T
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)[:, None]
    points = np.stack([r * np.cos(angle), r * np.sin(angle), np.broadcast_to(z, (segments, len(z)))], axis=-1)
    return add_grid(name, points, material, closed_u=True, subdivide=subdivide)


def add_tube(
    name: str,
    path: NDArray[np.floating],
    across: NDArray[np.floating],
    normal: Point,
    material: bpy.types.Material,
    *,
    segments: int = 24,
) -> bpy.types.Object:
    """Add a tube of elliptic section along a plane path.

    Parameters
    ----------
    path
        (N, 3) its center line.
    across
        (N, 2) half width along `normal` and half thickness in the plane of the path.
    normal
        Normal of that plane.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.array(normal, dtype=float)
    up = np.cross(tangent, side)
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = (
        np.cos(angle)[None, :, None] * side * across[:, None, :1]
        + np.sin(angle)[None, :, None] * up[:, None, :] * across[:, None, 1:]
    )
    return add_grid(name, path[:, None, :] + ring, material, closed_v=True, subdivide=1)


# --- Shader nodes -----------------------------------------------------------------------------------------
class Nodes:
    """A node tree, written as expressions."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        tree.nodes.clear()

    def add(self, kind: str, inputs: dict[str | int, Socket] | None = None, **settings: Any) -> bpy.types.Node:
        """Add a node of type `kind`, put its settings and connect or fill its inputs."""
        node = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(node, key, value)
        for slot, value in (inputs or {}).items():
            if isinstance(value, bpy.types.NodeSocket):
                self.tree.links.new(value, node.inputs[slot])
            else:
                node.inputs[slot].default_value = value
        node.location = 180 * len(self.tree.nodes), -40 * (len(self.tree.nodes) % 5)
        return node

    def math(self, operation: str, *values: Socket) -> Socket:
        """Return a number calculated from numbers."""
        return self.add("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def vector(self, operation: str, *values: Socket) -> Socket:
        """Return a vector (or color) calculated from vectors; SCALE takes a vector and a number."""
        inputs: dict[str | int, Socket] = dict(enumerate(values))
        if operation == "SCALE":
            inputs = {0: values[0], "Scale": values[1]}
        return self.add("ShaderNodeVectorMath", inputs, operation=operation).outputs[0]

    def scene_property(self, name: str, output: str = "Color") -> Socket:
        """Return a custom property of the scene; no driver is needed for it."""
        return self.add("ShaderNodeAttribute", attribute_type="VIEW_LAYER", attribute_name=name, label=name).outputs[
            output
        ]


def new_material(name: str, surface: Callable[[Nodes], Socket], *, dyed: bool = False) -> bpy.types.Material:
    """Make a material; a dyed one can be turned into a white diffuser by the scene's ``diffuser``."""
    material = bpy.data.materials.new(name)
    nodes = Nodes(material.node_tree)
    shader = surface(nodes)
    if dyed:
        white = nodes.add("ShaderNodeBsdfDiffuse", {"Color": (1, 1, 1, 1), "Roughness": 0.0}).outputs[0]
        switch = nodes.scene_property("diffuser", "Factor")
        shader = nodes.add("ShaderNodeMixShader", {0: switch, 1: shader, 2: white}).outputs[0]
    nodes.add("ShaderNodeOutputMaterial", {"Surface": shader})
    return material


def principled(nodes: Nodes, color: Socket, roughness: Socket, **inputs: Socket) -> Socket:
    """Body under a dielectric surface; `inputs` by the node's names, with _ for space."""
    values: dict[str | int, Socket] = {"Base Color": color, "Roughness": roughness}
    values |= {key.replace("_", " "): value for key, value in inputs.items()}
    return nodes.add("ShaderNodeBsdfPrincipled", values).outputs[0]


def plastic(nodes: Nodes, roughness: float = 0.22) -> Socket:
    """Glossy plastic: the dye in the body, a neutral reflection at the surface."""
    return principled(nodes, nodes.scene_property("dye"), roughness, IOR=1.46)


def matte(nodes: Nodes) -> Socket:
    """Nothing but body reflection."""
    return nodes.add("ShaderNodeBsdfDiffuse", {"Color": nodes.scene_property("dye"), "Roughness": 0.0}).outputs[0]


def nearly_matte(reflectance: float | Point, roughness: float = 0.7) -> Callable[[Nodes], Socket]:
    """Return a nearly matte surface, neutral or of a color: the table."""
    color = reflectance if isinstance(reflectance, tuple) else (reflectance,) * 3
    return lambda nodes: principled(nodes, (*color, 1.0), roughness, Specular_IOR_Level=0.2)


def rough(color: str) -> Callable[[Nodes], Socket]:
    """Return a rough surface of a color that is a property of the scene."""
    return lambda nodes: principled(nodes, nodes.scene_property(color), 0.8, Specular_IOR_Level=0.1)


def weave(nodes: Nodes, yarns: tuple[float, float]) -> dict[str, Socket]:
    """Plain weave on the UV map.

    Returns
    -------
    dict
        ``height`` 0..1; ``tone`` 0..1, how bright the yarn looks there; ``warp`` 1 where the lengthwise yarn is
        on top, else 0; ``u``, ``v`` in yarns.
    """
    m = nodes.math
    uv = nodes.add("ShaderNodeSeparateXYZ", {0: nodes.add("ShaderNodeTexCoord").outputs["UV"]})
    u, v = (m("MULTIPLY", uv.outputs[i], float(yarns[i])) for i in range(2))
    over_u = m("SINE", m("MULTIPLY", m("FRACT", u), math.pi))
    over_v = m("SINE", m("MULTIPLY", m("FRACT", v), math.pi))
    warp = m("FLOORED_MODULO", m("ADD", m("FLOOR", u), m("FLOOR", v)), 2.0)
    # A yarn is round across and bulges where it passes over the other.
    lengthwise = m("MULTIPLY", over_u, m("MULTIPLY_ADD", over_v, 0.5, 0.5))
    crosswise = m("MULTIPLY", over_v, m("MULTIPLY_ADD", over_u, 0.5, 0.5))
    height = m("ADD", crosswise, m("MULTIPLY", warp, m("SUBTRACT", lengthwise, crosswise)))
    return {"height": height, "warp": warp, "u": u, "v": v}


def fabric(nodes: Nodes, yarns: tuple[float, float], *, undyed: str | None = None) -> Socket:
    """Woven cloth: bump, and a body and a gloss that change from yarn to yarn.

    With `undyed`, it is heather: only some of the fibers take the dye, others keep the color of that property.
    """
    m = nodes.math
    w = weave(nodes, yarns)
    tone = m("MULTIPLY_ADD", w["height"], 0.3, 0.7)
    tone = m("MULTIPLY", tone, m("MULTIPLY_ADD", w["warp"], 0.12, 0.88))
    color = nodes.scene_property("dye")
    if undyed is not None:
        flecks = []
        for along, across in ((0.15, 1.1), (1.1, 0.15)):  # fibers are long: along the yarn the noise is slow
            place = nodes.add(
                "ShaderNodeCombineXYZ", {0: m("MULTIPLY", w["u"], across), 1: m("MULTIPLY", w["v"], along)}
            ).outputs[0]
            noise = nodes.add("ShaderNodeTexNoise", {"Vector": place, "Scale": 1.0, "Detail": 1.0})
            flecks.append(noise.outputs[0])
        mixed = m("ADD", flecks[1], m("MULTIPLY", w["warp"], m("SUBTRACT", flecks[0], flecks[1])))
        uptake = nodes.add("ShaderNodeMapRange", {0: mixed, 1: 0.38, 2: 0.52}).outputs[0]
        bare = nodes.scene_property(undyed)
        color = nodes.vector("ADD", bare, nodes.vector("SCALE", nodes.vector("SUBTRACT", color, bare), uptake))
    bump = nodes.add("ShaderNodeBump", {"Height": w["height"], "Distance": 0.006, "Strength": 0.8})
    return principled(
        nodes,
        nodes.vector("SCALE", color, tone),
        m("MULTIPLY_ADD", w["warp"], -0.1, 0.65),
        Specular_IOR_Level=0.25,
        Normal=bump.outputs[0],
    )


# --- Light, camera, scene ---------------------------------------------------------------------------------
def new_scene(name: str, *, dye: Point = (0.25, 0.05, 0.06)) -> bpy.types.Scene:
    """Start from an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.name = name
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 512
    # The measurement must see linear light: the view transform changes only what the screen shows.
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = 128
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    # Light that a glossy surface throws onto another is all noise in a path tracer, and little light.
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold = 0.0
    # No Russian roulette: which paths it ends depends on the color, and noise shall be common to all colors.
    cycles.min_light_bounces = cycles.max_bounces = 8
    cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 8
    scene["dye"] = dye
    scene.id_properties_ui("dye").update(
        subtype="COLOR", min=0.0, max=1.0, description="Linear RGB reflectance of the dyed material"
    )
    scene["diffuser"] = 0.0
    scene.id_properties_ui("diffuser").update(
        min=0.0, max=1.0, description="1: the product is a perfect white diffuser"
    )
    scene["product"] = PRODUCT
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_material = True
    return scene


def aim(thing: bpy.types.Object, place: Point, look_at: Point = (0.0, 0.0, 0.0)) -> None:
    """Put a light or a camera at a place, looking at another."""
    x, y, z = np.subtract(place, look_at) / math.dist(place, look_at)
    thing.location = place
    thing.rotation_euler = (math.acos(z), 0.0, math.atan2(x, -y))


def light_group(scene: bpy.types.Scene, group: str, color: Point) -> str:
    """Make a group of lights with one color, a property of the scene; returns the property's name."""
    name = f"{group}_light"
    if name not in scene:
        scene[name] = color
        scene.id_properties_ui(name).update(subtype="COLOR", min=0.0, soft_max=1.0, description="Light color")
        scene.view_layers[0].lightgroups.add(name=group)
    return name


def add_sun(
    scene: bpy.types.Scene,
    place: Point,
    *,
    white: float = KEY_WHITE,
    angle: float = 3.0,
    group: str = "key",
    color: Point = (1.0, 1.0, 1.0),
) -> bpy.types.Object:
    """Add nearly parallel light from the direction of `place`.

    Parameters
    ----------
    white
        Radiance of a perfect white diffuser that faces it. A sun's strength is its irradiance, so E = pi * white.
    angle
        Its angular diameter in degrees.
    """
    name = light_group(scene, group, color)
    lamp = bpy.data.lights.new(group.title(), "SUN")
    lamp.energy = math.pi * white
    lamp.angle = math.radians(angle)
    nodes = Nodes(lamp.node_tree)
    nodes.add(
        "ShaderNodeOutputLight",
        {0: nodes.add("ShaderNodeEmission", {"Color": nodes.scene_property(name), "Strength": 1.0}).outputs[0]},
    )
    thing = bpy.data.objects.new(group.title(), lamp)
    aim(thing, place)
    thing.lightgroup = group
    scene.collection.objects.link(thing)
    return thing


def add_window(
    scene: bpy.types.Scene,
    place: Point,
    look_at: Point,
    size: tuple[float, float],
    *,
    white: float = KEY_WHITE,
    group: str = "key",
    color: Point = (1.0, 1.0, 1.0),
) -> bpy.types.Object:
    """Add a rectangle of light.

    Parameters
    ----------
    white
        Radiance of a perfect white diffuser at `look_at` that faces it (taken as small and far).
    """
    name = light_group(scene, group, color)
    lamp = bpy.data.lights.new("Window", "AREA")
    lamp.shape, lamp.size, lamp.size_y = "RECTANGLE", *size
    # A Lambertian source of power P gives P / (pi d^2) on its axis, and a white diffuser there 1 / pi of that.
    lamp.energy = white * math.pi**2 * math.dist(place, look_at) ** 2
    nodes = Nodes(lamp.node_tree)
    emission = nodes.add("ShaderNodeEmission", {"Color": nodes.scene_property(name), "Strength": 1.0})
    nodes.add("ShaderNodeOutputLight", {0: emission.outputs[0]})
    thing = bpy.data.objects.new("Window", lamp)
    aim(thing, place, look_at)
    thing.lightgroup = group
    scene.collection.objects.link(thing)
    return thing


def add_environment(
    scene: bpy.types.Scene, radiance: float, *, group: str = "key", color: Point = (1.0, 1.0, 1.0)
) -> bpy.types.World:
    """Add the same light from everywhere."""
    name = light_group(scene, group, color)
    world = bpy.data.worlds.new("Environment")
    nodes = Nodes(world.node_tree)
    sky = nodes.add("ShaderNodeBackground", {"Color": nodes.scene_property(name), "Strength": radiance})
    nodes.add("ShaderNodeOutputWorld", {0: sky.outputs[0]})
    world.lightgroup = group
    world.cycles.sampling_method = "NONE"  # even light is best found by paths that leave the scene
    scene.world = world
    return world


def add_camera(scene: bpy.types.Scene, place: Point, look_at: Point, *, lens: float = 85.0) -> None:
    """Add the camera, on a 36 mm square sensor."""
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    thing = bpy.data.objects.new("Camera", data)
    aim(thing, place, look_at)
    scene.collection.objects.link(thing)
    scene.camera = thing


def add_table(material: bpy.types.Material) -> bpy.types.Object:
    """Add a table that bends up into a backdrop, so that no horizon shows."""
    bend = np.linspace(0, np.pi / 2, 9)
    y = np.concatenate([[-12.0], 3.0 + 2.0 * np.sin(bend), [5.0]])
    z = np.concatenate([[0.0], 2.0 - 2.0 * np.cos(bend), [9.0]])
    x = np.array([-12.0, 12.0])
    points = np.stack([np.broadcast_to(x[:, None], (2, len(y))), np.tile(y, (2, 1)), np.tile(z, (2, 1))], -1)
    return add_grid("Table", points, material)


def color_property(scene: bpy.types.Scene, name: str, color: Point, description: str) -> None:
    """Give the scene another color; materials read it by its name, and spectra are made up for it."""
    scene[name] = color
    scene.id_properties_ui(name).update(subtype="COLOR", min=0.0, max=1.0, description=description)
    scene["colors"] = " ".join([*scene.get("colors", "").split(), name])


def finish(
    scene: bpy.types.Scene, reference: tuple[float, float], shares: dict[str, float] | None = None
) -> bpy.types.Scene:
    """Note where to look, and what white is there.

    Parameters
    ----------
    reference
        Place in fractions of the picture from its upper left corner.
    shares
        What each group of lights adds to white at the reference; default: the key light all of it.
    """
    scene["reference_x"], scene["reference_y"] = reference
    shares = shares or {"key": 1.0}
    white = np.zeros(3)
    for group in scene.view_layers[0].lightgroups:
        scene[f"{group.name}_share"] = shares.get(group.name, 0.0)
        white += scene[f"{group.name}_share"] * np.array(scene[f"{group.name}_light"])
    scene["white"] = tuple(white)
    return scene


# --- The products -----------------------------------------------------------------------------------------
def add_mug(material: bpy.types.Material) -> list[bpy.types.Object]:
    """Add a mug, 0.95 high, with its handle to the right, standing on z = 0."""
    thickness, top = 0.045, 0.95

    # The belly turns part of the wall toward the light, so that the highlight falls on it.
    def radius(z: Any) -> Any:
        return 0.445 - 0.5 * (z - 0.40) ** 2

    wall = [(0.0, 0.02), (0.25, 0.02), (0.28, 0.0), (0.33, 0.0), (0.365, 0.02), (0.385, 0.06)]
    wall += [(radius(z), z) for z in np.linspace(0.14, top - thickness / 2, 12)]
    lip = np.linspace(0, np.pi, 7)[1:-1]
    middle, half = radius(top) - thickness / 2, thickness / 2
    wall += [(middle + half * math.cos(t), top - half + half * math.sin(t)) for t in lip]
    wall += [(radius(z) - thickness, z) for z in np.linspace(top - half, 0.16, 12)]
    wall += [(0.33, 0.09), (0.29, 0.055), (0.22, 0.045), (0.0, 0.045)]
    body = add_lathe("Mug", wall, material)

    # The handle: a rounded C, wider where it meets the wall and ending inside the wall's thickness.
    t = np.linspace(-1, 1, 33)
    z = 0.49 - 0.25 * np.sin(t * np.pi / 2)
    reach = 0.32 * (1 - np.abs(t) ** 3.2) + (0.445 - radius(z)) * (1 - np.abs(t) ** 2)
    path = np.stack([radius(z) - 0.02 + reach, np.zeros_like(t), z], axis=-1)
    flare = 1 + 0.5 * np.abs(t) ** 12
    across = np.stack([0.062 * flare, 0.036 * flare], axis=-1)
    handle = add_tube("Handle", path, across, (0, 1, 0), material)
    for thing in (body, handle):
        thing.rotation_euler = (0, 0, math.radians(-28))
    return [body, handle]


def mug(
    name: str = "mug",
    *,
    dye: Point = (0.429, 0.037, 0.045),
    roughness: float = 0.22,
    translucency: float = 0.0,
    table: float | Point = 0.45,
    key: float = KEY_WHITE,
) -> bpy.types.Scene:
    """Glossy plastic mug on a neutral table, nearly parallel light: the paper's cups.

    Parameters
    ----------
    name, dye
        Of the scene.
    roughness
        Of its surface.
    translucency
        Part of the light that a face of the wall passes on instead of reflecting it (0..1).
    table
        Reflectance of the table, or its color.
    key
        Radiance of a white diffuser that faces the key light.
    """
    scene = new_scene(name, dye=dye)

    def body(nodes: Nodes) -> Socket:
        surface = plastic(nodes, roughness)
        if not translucency:
            return surface
        # Both faces of the wall pass light on, so what comes through is dye ** 1.5: more saturated than the body.
        dye = nodes.vector("POWER", nodes.scene_property("dye"), (0.75, 0.75, 0.75))
        through = nodes.add("ShaderNodeBsdfTranslucent", {"Color": dye}).outputs[0]
        return nodes.add("ShaderNodeMixShader", {0: translucency, 1: surface, 2: through}).outputs[0]

    add_mug(new_material(PRODUCT, body, dyed=True))
    add_table(new_material("Table", nearly_matte(table)))
    add_sun(scene, (-2.6, -4.5, 2.8), white=key)
    add_environment(scene, 0.12)
    add_camera(scene, (0.1, -6.5, 2.2), (0.1, 0.0, 0.46), lens=160)
    return finish(scene, (0.27, 0.39))


def mug_daylight() -> bpy.types.Scene:
    """The mug in daylight from a large window, without sun."""
    scene = mug("mug_daylight", dye=(0.0395, 0.0467, 0.305))
    bpy.data.objects.remove(bpy.data.objects["Key"])
    # A window of 1.8 x 2.2 in front of a much wider scene: its size is what the highlight shows.
    lamp = add_window(scene, (-3.2, -3.0, 2.6), (0.0, 0.0, 0.4), (1.8, 2.2), color=DAYLIGHT)
    scene["key_light"] = DAYLIGHT
    lamp.name = "Window"
    return finish(scene, (0.23, 0.44))


def mug_mixed() -> bpy.types.Scene:
    """The mug in a mixture of daylight and tungsten from one direction: one light, and a color of its own."""
    scene = mug("mug_mixed", key=KEY_WHITE / 2)
    add_sun(scene, (-2.6, -4.5, 2.8), white=KEY_WHITE / 2, group="fill", color=TUNGSTEN)
    return finish(scene, (0.27, 0.39), {"key": 0.5, "fill": 0.5})


def two_lights() -> bpy.types.Scene:
    """The mug between a window and a lamp: daylight from the left, tungsten from the right."""
    scene = mug("two_lights", key=0.7)
    add_sun(scene, (4.0, -3.0, 2.2), white=0.45, group="fill", color=TUNGSTEN)
    return finish(scene, (0.465, 0.465))


def color_bleeding() -> bpy.types.Scene:
    """The mug on a white table before a white wall, which both take on its color."""
    scene = mug("color_bleeding", table=0.85, key=0.75)
    wall = new_material("Wall", nearly_matte(0.85))
    # The wall, beside the mug, gets little light of its own: most of what it shows has met the mug.
    points = np.array([[[-0.62, -1.0, z], [-0.62, 2.0, z]] for z in (0.0, 1.4)])
    add_grid("Wall", points, wall)
    aim(bpy.data.objects["Key"], (0.4, -4.5, 2.4))
    return finish(scene, (0.61, 0.40))


def translucent_mug(*, translucency: float = 0.5) -> bpy.types.Scene:
    """A mug of a plastic that light goes through: it shows beside the handle, where the sun falls on the inside."""
    scene = mug("translucent_mug", dye=(0.0612, 0.2961, 0.0666), translucency=translucency)
    aim(bpy.data.objects["Key"], (-4.0, -2.4, 4.4))
    return finish(scene, (0.27, 0.39))


def near_white() -> bpy.types.Scene:
    """A mug that is all but white: its color and its gloss can hardly be told apart."""
    return mug("near_white", dye=(0.80, 0.78, 0.74))


def near_black() -> bpy.types.Scene:
    """A mug that is all but black: there is more gloss than body."""
    return mug("near_black", dye=(0.012, 0.012, 0.014))


def pale() -> bpy.types.Scene:
    """A pale pink mug."""
    return mug("pale", dye=(0.72, 0.50, 0.46))


def clipped() -> bpy.types.Scene:
    """A very glossy mug, exposed so that a camera clips its highlights and nearly its body."""
    return mug("clipped", dye=(0.75, 0.20, 0.03), roughness=0.12, key=1.3)


def fabric_cylinder(name: str = "fabric_cylinder", *, undyed: Point | None = None) -> bpy.types.Scene:
    """Matte woven fabric wrapped on a cylinder: the paper's fabrics.

    Parameters
    ----------
    name
        Of the scene.
    undyed
        Reflectance of the fibers that do not take the dye; None if all do.
    """
    scene = new_scene(name, dye=(0.20, 0.045, 0.23))
    if undyed is not None:
        color_property(scene, "undyed", undyed, "Reflectance of the fibers that do not take the dye")
    thread = None if undyed is None else "undyed"
    material = new_material(PRODUCT, lambda n: fabric(n, (96, 50), undyed=thread), dyed=True)
    side = [(0.45, z) for z in np.linspace(0.0, 1.5, 12)]
    add_lathe("Fabric", side, material, subdivide=0, segments=192)
    board = new_material("Board", nearly_matte(0.8))
    cap = add_lathe("Cap", [(0.455, 1.5), (0.455, 1.53), (0.45, 1.535), (0.0, 1.535)], board, subdivide=0)
    cap.data.shade_flat()
    add_table(new_material("Table", nearly_matte(0.45)))
    add_sun(scene, (-3.0, -4.0, 3.5))
    add_environment(scene, 0.12)
    add_camera(scene, (0.0, -6.5, 2.3), (0.05, 0.0, 0.76), lens=128)
    return finish(scene, (0.32, 0.75))


def heather() -> bpy.types.Scene:
    """Heather: cloth of two fibers, of which one takes the dye and the other stays gray-white."""
    scene = fabric_cylinder("heather", undyed=(0.70, 0.69, 0.66))
    return finish(scene, (0.559, 0.371))  # a dyed yarn


def add_curtain(material: bpy.types.Material, depth: float, *, subdivide: int = 1) -> bpy.types.Object:
    """Add a curtain of seven folds, 0.36 apart and of half depth `depth`."""
    rng = np.random.default_rng(4)
    s = np.linspace(0, 1, 181)[:, None]
    z = np.linspace(0, 1, 25)[None, :]
    # Folds that differ: the phase runs at an uneven pace and drifts a little on its way down.
    phase = 2 * np.pi * (7 * s + 0.12 * np.sin(2 * np.pi * (2 * s + 0.3)) + 0.05 * np.sin(3 * z + 9 * s))
    swing = 1 + 0.25 * np.sin(phase / 2 + rng.uniform(0, 6))
    open_up = 0.55 + 0.45 * z  # gathered at the top, full below
    # The sideways swing of twice the phase bends a sine into the omega of a heavy curtain.
    x = 2.5 * (s - 0.5) - 0.05 * np.sin(2 * phase) * open_up
    y = depth * open_up * swing * np.sin(phase)
    height = 1.9 - 1.85 * z + 0.02 * np.sin(phase) * z
    points = np.stack(np.broadcast_arrays(x, y, height), axis=-1)
    return add_grid("Cloth", points, material, subdivide=subdivide)


def folds(name: str = "folds", *, depth: float = 0.16, key: float = KEY_WHITE) -> bpy.types.Scene:
    """Draped cloth with deep folds; a body without gloss, so that only interreflection departs from (A, B).

    Parameters
    ----------
    name
        Of the scene.
    depth
        Half depth of the folds; they are 0.36 apart.
    key
        Radiance of a white diffuser that faces the key light.
    """
    scene = new_scene(name, dye=(0.429, 0.037, 0.045))
    add_curtain(new_material(PRODUCT, matte, dyed=True), depth)
    add_table(new_material("Table", nearly_matte(0.45)))
    add_sun(scene, (-1.3, -4.5, 2.2), white=key, angle=6.0)
    add_environment(scene, 0.15)
    add_camera(scene, (0.0, -7.5, 1.3), (0.0, 0.0, 0.95), lens=118)
    return finish(scene, (0.50, 0.75))


def folds_mixed() -> bpy.types.Scene:
    """The draped cloth in a mixture of daylight and tungsten from one direction."""
    scene = folds("folds_mixed", key=KEY_WHITE / 2)
    add_sun(scene, (-1.3, -4.5, 2.2), white=KEY_WHITE / 2, angle=6.0, group="fill", color=TUNGSTEN)
    return finish(scene, (0.50, 0.75), {"key": 0.5, "fill": 0.5})


def satin(*, tint: float = 0.6, sheen: float = 0.45) -> bpy.types.Scene:
    """Draped satin: a sheen along the yarns that takes on part of the dye's color.

    Parameters
    ----------
    tint
        How much of the sheen's color is the dye's (0: white, as on plastic; 1: as on metal).
    sheen
        Share of the sheen beside the body; with 0 it is cotton in the same folds.
    """

    def silk(nodes: Nodes) -> Socket:
        dye = nodes.scene_property("dye")
        # White sheen lies on top of fibers that are themselves colored through: the sheen is between both.
        tinted = nodes.vector("ADD", nodes.vector("SCALE", dye, tint), (0.6 * (1 - tint),) * 3)
        gloss = nodes.add(
            "ShaderNodeBsdfAnisotropic",
            {
                "Color": tinted,
                "Roughness": 0.38,
                "Anisotropy": 0.75,
                "Tangent": nodes.add("ShaderNodeTangent", direction_type="UV_MAP").outputs[0],
            },
        )
        body = nodes.add("ShaderNodeBsdfDiffuse", {"Color": dye})
        return nodes.add("ShaderNodeMixShader", {0: sheen, 1: body.outputs[0], 2: gloss.outputs[0]}).outputs[0]

    scene = new_scene("satin", dye=(0.30, 0.03, 0.10))
    add_curtain(new_material(PRODUCT, silk, dyed=True), 0.09)
    add_table(new_material("Table", nearly_matte(0.45)))
    add_sun(scene, (-1.3, -4.5, 2.6), angle=6.0)
    add_environment(scene, 0.15)
    add_camera(scene, (0.0, -7.5, 1.3), (0.0, 0.0, 0.95), lens=118)
    return finish(scene, (0.33, 0.41))


def metal(*, colored: bool = True) -> bpy.types.Scene:
    """A mug of colored metal between colored boards: nothing of the dichromatic model but one term.

    Parameters
    ----------
    colored
        False makes the boards gray.
    """
    scene = new_scene("metal", dye=(0.72, 0.30, 0.16))
    color_property(scene, "left", (0.75, 0.30, 0.06) if colored else (0.5,) * 3, "Color of the board at the left")
    color_property(scene, "right", (0.07, 0.25, 0.60) if colored else (0.5,) * 3, "Color of the board at the right")
    body = new_material(PRODUCT, lambda n: principled(n, n.scene_property("dye"), 0.33, Metallic=1.0), dyed=True)
    add_mug(body)
    for side, x in (("left", -1.3), ("right", 1.5)):
        board = new_material(side.title(), rough(side))
        points = np.array([[[x, -2.2, z], [x, 1.5, z]] for z in (0.0, 2.2)])
        add_grid(f"Board {side}", points, board)
    add_table(new_material("Table", nearly_matte(0.45)))
    add_sun(scene, (-0.9, -4.5, 3.2), white=0.8, angle=8.0)
    add_environment(scene, 0.35)
    add_camera(scene, (0.1, -6.5, 2.2), (0.1, 0.0, 0.46), lens=160)
    return finish(scene, (0.4, 0.5))


def outline(count: int) -> NDArray[np.float64]:
    """(count, 2): the sole of a shoe seen from above, heel at x = -1, toe at x = 1."""
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    x = np.cos(t)
    # Round toe and heel, a narrow waist, the ball of the foot at its widest.
    width = 0.30 + 0.075 * np.sin(1.9 * (x - 0.1)) + 0.03 * np.cos(2.6 * (x + 0.9))
    y = width * np.sign(np.sin(t)) * np.abs(np.sin(t)) ** 0.72 + 0.05 * x**2
    return np.stack([x, y], axis=-1)


def sneaker() -> bpy.types.Scene:
    """A sneaker of two materials, upper and sole, each with its own mask and its own color property."""
    scene = new_scene("sneaker", dye=(0.0395, 0.0467, 0.305))
    color_property(scene, "sole", (0.78, 0.76, 0.70), "Linear RGB reflectance of the sole")
    upper = new_material(
        PRODUCT, lambda n: principled(n, n.scene_property("dye"), 0.55, Specular_IOR_Level=0.35), dyed=True
    )
    rubber = new_material("Sole", lambda n: principled(n, n.scene_property("sole"), 0.4))
    foot = outline(72)
    center = np.array([0.0, 0.05])

    # The sole: the outline, a little larger, with rounded edges.
    rings = [
        (0.0, 0.012),
        (0.90, 0.0),
        (1.02, 0.02),
        (1.05, 0.07),
        (1.04, 0.14),
        (1.03, 0.175),
        (1.0, 0.19),
        (0.0, 0.19),
    ]
    toe_spring = 0.10 * np.clip(foot[:, 0] - 0.35, 0, None) ** 2
    points = [
        np.column_stack([(foot - center) * scale + center, height + toe_spring * min(scale, 1)])
        for scale, height in rings
    ]
    add_grid("Sole", np.stack(points, axis=1), rubber, closed_u=True, subdivide=1)

    # The upper: from every point of the sole's edge a Bezier curve leads to the collar, steep at heel and sides,
    # over the toes and up the tongue in front.
    t = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    ahead = ((1 + np.cos(t)) / 2) ** 1.5
    collar = np.stack([-0.52 + 0.37 * np.cos(t), 0.07 + 0.17 * np.sin(t)], axis=-1)
    top = 0.58 + 0.24 * np.clip(np.cos(t), 0, None) ** 2 + 0.14 * np.clip(-np.cos(t), 0, None) ** 2
    part = (0.85 - 0.42 * ahead)[:, None]
    ends = [
        np.column_stack([foot * 0.985, 0.16 + toe_spring]),
        np.column_stack([foot * 1.04, 0.44 + toe_spring - 0.02 * ahead]),
        np.column_stack([foot * (1 - part) + collar * part, (top - 0.16) * (1 - ahead) + 0.37 * ahead]),
        np.column_stack([collar, top]),
    ]
    k = np.linspace(0, 1, 17)
    weights = np.stack([math.comb(3, i) * (1 - k) ** (3 - i) * k**i for i in range(4)], axis=1)
    layers = list(np.tensordot(weights, np.stack(ends), axes=1))
    for scale, drop in ((0.93, 0.012), (0.86, -0.03), (0.82, -0.15), (0.80, -0.40)):  # over the edge and inside
        inside = (collar - collar.mean(axis=0)) * scale + collar.mean(axis=0)
        layers.append(np.column_stack([inside, top + drop]))
    surface = np.stack(layers, axis=1)
    add_grid("Upper", surface, upper, closed_u=True, subdivide=1)

    # Laces across the instep.
    white = new_material("Laces", nearly_matte(0.75))
    for ring in (9, 11, 13, 15):
        path = surface[np.arange(-8, 9), ring] + (0.0, 0.0, 0.008)
        add_tube("Lace", path, np.full((17, 2), (0.022, 0.014)), (1, 0, 0), white, segments=10)

    add_table(new_material("Table", nearly_matte(0.45)))
    add_sun(scene, (-2.0, -4.5, 4.0), angle=6.0)
    add_environment(scene, 0.15)
    add_camera(scene, (2.6, -5.6, 3.0), (0.0, 0.0, 0.34), lens=100)
    return finish(scene, (0.80, 0.59))


SCENES: dict[str, Callable[..., bpy.types.Scene]] = {
    scene.__name__: scene
    for scene in (
        *(mug, fabric_cylinder, folds, sneaker, mug_daylight, mug_mixed, folds_mixed, color_bleeding),
        *(metal, satin, translucent_mug, near_white, near_black, pale, clipped, two_lights, heather),
    )
}
"""All scenes by name; each function builds its scene in place of the open file and returns it."""


def build(name: str, **parameters: Any) -> bpy.types.Scene:
    """Build the scene called `name` in place of whatever is open.

    Raises
    ------
    KeyError
        No scene has that name.
    """
    return SCENES[name](**parameters)


def save(path: Path) -> None:
    """Write the open scene as a small .blend file, without the paths of the machine that makes it."""
    bpy.context.scene.render.filepath = "//"
    for screen in bpy.data.screens:
        for area in screen.areas:
            for space in area.spaces:
                if space.type == "FILE_BROWSER" and space.params:
                    space.params.directory = b"/"
    bpy.context.preferences.filepaths.save_version = 0  # no .blend1 beside it
    bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), compress=True, copy=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the .blend files."""
    from .. import addon
    from . import photos  # renders the scenes, which are built here

    parser = argparse.ArgumentParser(description="Make the sample scenes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes to make (default: all)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder to write to")
    options = parser.parse_args(arguments)
    addon.register()
    for name in options.names or SCENES:
        picture, view = photos.take(name)
        photos.add(build(name), picture, view)
        path = options.out / f"{name}.blend"
        save(path)
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
