"""Recoloring renders and images in the compositor, against files and against renders of another material."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from dyehouse.addon import nodes
from dyehouse.batch import files
from dyehouse.batch import photo as photos
from dyehouse.benchmarks import node_renders
from dyehouse.core import transfer
from dyehouse.core.colorspace import LINEAR_SRGB, SRGB
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

pytestmark = pytest.mark.usefixtures("blender")
HEIGHT, WIDTH = 32, 44
MATTE = (14, 18)
TARGET = "lab(42, 55, 35)"
RED, BLUE = (0.5, 0.06, 0.04), (0.05, 0.15, 0.5)


@pytest.fixture(params=["CPU", "GPU"])
def device(request: pytest.FixtureRequest) -> str:
    if request.param == "GPU":
        gpu = pytest.importorskip("gpu")
        try:
            gpu.init()
        except SystemError as error:
            pytest.skip(f"no GPU context here: {error}")
    return request.param


def disk() -> NDArray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.clip(13.5 - np.hypot(x - 22, y - 16), 0, 1)


def picture(path: Path, alpha: bool = False) -> Path:
    """A disk of shaded, noisy product on gray, as floats or 8-bit codes."""
    rng = np.random.default_rng(0)
    shade = 0.3 + 0.6 * np.arange(WIDTH) / WIDTH
    product = np.broadcast_to(shade[:, None] * (0.10, 0.22, 0.40), (HEIGHT, WIDTH, 3))
    light = disk()[..., None] * product + (1 - disk()[..., None]) * 0.35 + rng.normal(0, 0.004, (HEIGHT, WIDTH, 3))
    if path.suffix == ".png":
        pixels = transfer.encode(light.astype(np.float32), SRGB.curve, np.uint8)
        return files.write(path, pixels, files.Photo(path, pixels, SRGB))
    pixels = light.astype(np.float32)
    if alpha:
        a = np.linspace(0.1, 1, WIDTH, dtype=np.float32)[None, :, None].repeat(HEIGHT, axis=0)
        pixels = np.concatenate([pixels * a, a], axis=2)
    return files.write(path, pixels, files.Photo(path, pixels, LINEAR_SRGB, premultiplied=True))


def mask_file(path: Path) -> Path:
    pixels = np.repeat(np.uint8(255 * disk())[..., None], 3, axis=2)
    return files.write(path, pixels, files.Photo(path, pixels, SRGB))


def recipe(**changes: object) -> Recipe:
    return Recipe((Region(parse_target(TARGET), reference=MATTE, **changes),))


def render(device: str = "CPU") -> NDArray:
    bpy.context.scene.render.compositor_device = device
    return node_renders.rendered(bpy.context.scene)


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("mask", [False, True])
def test_an_image_has_the_pixels_of_the_command_line(device: str, alpha: bool, mask: bool, tmp_path: Path) -> None:
    path = picture(tmp_path / "picture.exr", alpha)
    tree = node_renders.compositor_scene(bpy.data.images.load(str(path)))
    bpy.data.images.load(str(mask_file(tmp_path / "mask.png")))
    arguments = {"reference": MATTE, "target": TARGET, "mask": "mask.png" if mask else ""}
    assert bpy.ops.dyehouse.add_compositor_group(**arguments) == {"FINISHED"}
    photo = files.read(path)
    prepared = photos.look(photo, recipe(mask=str(tmp_path / "mask.png") if mask else None))
    got = render(device)
    assert np.abs(got[..., :3] - prepared.analyses[0].recolor(prepared.target())).max() < 1e-5
    if alpha:
        assert np.array_equal(got[..., 3], photo.pixels[..., 3])
    assert len(nodes.recolor_nodes(tree)) == 1


def test_codes_as_the_compositor_decodes_them(device: str, tmp_path: Path) -> None:
    """Its own decoding of 8-bit codes is only good to 1e-5 or so."""
    path = picture(tmp_path / "picture.png")
    node_renders.compositor_scene(bpy.data.images.load(str(path)))
    before = render(device)[..., :3]
    prepared = photos.look(files.read(path), recipe(model="dichromatic"))
    assert np.abs(before - prepared.analyses[0].picture.linear()).max() < 3e-5
    arguments = {"reference": MATTE, "target": TARGET, "model": "dichromatic"}
    assert bpy.ops.dyehouse.add_compositor_group(**arguments) == {"FINISHED"}
    matrix = prepared.analyses[0].matrix(prepared.target())
    assert np.abs(render(device)[..., :3] - before @ matrix.T).max() < 1e-5


def product_scene(color: tuple[float, float, float]) -> bpy.types.Object:
    """A diffuse ball before a gray wall in the light of one sun, without indirect light."""
    material = node_renders.flat_scene(WIDTH, HEIGHT)
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.seed = 64, 0, 1
    scene.render.use_persistent_data = False
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.4, 0.4, 0.4, 1)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7, location=(0, 0, 1.5), segments=64, ring_count=32)
    ball = bpy.context.object
    ball.name = "Ball"
    paint = bpy.data.materials.new("Paint")
    ball.data.materials.append(paint)
    paint.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1)
    for made in (material, paint):
        made.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.0
    scene.collection.objects.link(bpy.data.objects.new("Sun", sun))
    return ball


@pytest.mark.parametrize("layer", ["CryptoObject", "CryptoMaterial"])
def test_a_render_recolored_by_cryptomatte_looks_like_one_of_another_material(layer: str) -> None:
    product_scene(BLUE)
    truth = render()[..., :3]
    product_scene(RED)
    before = render()[..., :3]
    names = {"CryptoObject": "Ball", "CryptoMaterial": "Paint"}[layer]
    arguments = {"reference_color": RED, "target": "rgb({}, {}, {})".format(*BLUE), "model": "dichromatic"}
    assert bpy.ops.dyehouse.add_compositor_group(**arguments, matte=names, matte_layer=layer) == {"FINISHED"}
    after = render()[..., :3]
    assert np.abs(before - truth).max() > 0.3
    assert np.abs(after - truth).max() < 1e-5


def test_without_the_light_of_the_edge_a_rim_of_the_old_color_is_left() -> None:
    """Which is why the group has that input."""
    product_scene(BLUE)
    truth = render()[..., :3]
    product_scene(RED)
    arguments = {"reference_color": RED, "target": "rgb({}, {}, {})".format(*BLUE), "model": "dichromatic"}
    bpy.ops.dyehouse.add_compositor_group(**arguments, matte="Ball")
    tree = bpy.context.scene.compositing_node_group
    node = nodes.recolor_nodes(tree)[0]
    tree.links.remove(node.inputs["Edge Light"].links[0])
    assert np.abs(render()[..., :3] - truth).max() > 0.01


def test_a_spline_mask() -> None:
    product_scene(RED)
    before = render()[..., :3]
    mask = bpy.data.masks.new("Left Half")
    spline = mask.layers.new().splines.new()
    spline.points.add(3)
    spline.use_cyclic = True
    for point, at in zip(spline.points, ((-1, -1), (0.5, -1), (0.5, 2), (-1, 2)), strict=True):
        point.handle_type, point.co = "VECTOR", at
    arguments = {"reference_color": RED, "target": "rgb({}, {}, {})".format(*BLUE), "model": "body"}
    assert bpy.ops.dyehouse.add_compositor_group(**arguments, mask="Left Half") == {"FINISHED"}
    changed = np.abs(render()[..., :3] - before).max(axis=2) > 1e-3
    assert changed[:, : WIDTH // 2 - 2].mean() > 0.9
    assert not changed[:, WIDTH // 2 + 2 :].any()


def test_used_again_it_sets_the_same_node_and_removed_leaves_no_trace(tmp_path: Path) -> None:
    path = picture(tmp_path / "picture.exr")
    tree = node_renders.compositor_scene(bpy.data.images.load(str(path)))
    bpy.data.images.load(str(mask_file(tmp_path / "mask.png")))

    def state() -> tuple:
        wires = {(k.from_node.name, k.to_node.name, k.to_socket.name) for k in tree.links}
        return {n.name for n in tree.nodes}, wires, {i.name for i in bpy.data.images}

    before, counts = state(), set()
    for target in ("#102030", TARGET):
        bpy.ops.dyehouse.add_compositor_group(reference=MATTE, target=target, mask="mask.png")
        assert len(nodes.recolor_nodes(tree)) == 1
        counts.add(tuple(map(len, state())))
    assert len(counts) == 1
    assert bpy.ops.dyehouse.remove_recolor(scene="Scene") == {"FINISHED"}
    assert state() == before


def test_only_the_way_to_the_output_changes(tmp_path: Path) -> None:
    tree = node_renders.compositor_scene(bpy.data.images.load(str(picture(tmp_path / "picture.exr"))))
    source = tree.nodes["Image"]
    viewer, matte = tree.nodes.new("CompositorNodeViewer"), tree.nodes.new("CompositorNodeCryptomatteV2")
    for other in (viewer, matte):
        tree.links.new(source.outputs["Image"], other.inputs["Image"])
    assert bpy.ops.dyehouse.add_compositor_group(reference=MATTE, target=TARGET) == {"FINISHED"}
    node = nodes.recolor_nodes(tree)[0]
    assert tree.nodes["Group Output"].inputs[0].links[0].from_node == node
    assert viewer.inputs["Image"].links[0].from_node == source
    assert matte.inputs["Image"].links[0].from_node == source


def test_one_undo_step() -> None:
    product_scene(RED)
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.dyehouse.add_compositor_group("EXEC_DEFAULT", True, reference_color=RED, target=TARGET)
    assert len(nodes.recolor_nodes(bpy.context.scene.compositing_node_group)) == 1
    bpy.ops.ed.undo()
    assert bpy.context.scene.compositing_node_group is None
    bpy.ops.ed.redo()
    assert len(nodes.recolor_nodes(bpy.context.scene.compositing_node_group)) == 1


def test_a_reference_from_a_saved_render_needs_no_maps(tmp_path: Path) -> None:
    """Those of one frame are of no use for the others."""
    path = picture(tmp_path / "saved.exr")
    bpy.data.images.load(str(path))
    assert bpy.ops.dyehouse.add_compositor_group(image="saved.exr", reference=MATTE, target=TARGET) == {"FINISHED"}
    node = nodes.recolor_nodes(bpy.context.scene.compositing_node_group)[0]
    assert not node.inputs["Correction"].is_linked
    assert np.linalg.norm(node.inputs["Gloss Weights"].default_value) > 0.1
    assert node.inputs[0].links[0].from_node.bl_idname == "CompositorNodeRLayers"


BAD = {
    "no such scene": ({"scene": "Stage"}, "no scene 'Stage'"),
    "nothing rendered": ({"reference_color": (0, 0, 0)}, "There is no render to read the reference from"),
    "no such image": ({"image": "render.exr"}, "no image 'render.exr'"),
    "no such mask": ({"mask": "nothing"}, "no image and no mask 'nothing'"),
    "two masks": ({"mask": "m", "matte": "Ball"}, "leave one out"),
    "no color": ({"target": "reddish"}, "reddish"),
    "no light": ({"white": "sunshine"}, "sunshine"),
    "the white of a render that is not there": ({"white": "3,4"}, "no render to read"),
}


@pytest.mark.parametrize("problem", BAD)
def test_bad_input_is_told_in_words_and_changes_nothing(problem: str) -> None:
    changes, words = BAD[problem]
    arguments = {"reference_color": RED, "target": TARGET, **changes}
    with pytest.raises(RuntimeError, match=words) as raised:
        bpy.ops.dyehouse.add_compositor_group(**arguments)
    assert "Traceback" not in str(raised.value)
    assert bpy.context.scene.compositing_node_group is None
    assert len(bpy.data.node_groups) == 0


def test_an_image_node_without_color_is_told_in_words(tmp_path: Path) -> None:
    image = bpy.data.images.load(str(picture(tmp_path / "picture.png")))
    tree = node_renders.compositor_scene(image)
    image.colorspace_settings.name = "Non-Color"
    with pytest.raises(RuntimeError, match="Non-Color data"):
        bpy.ops.dyehouse.add_compositor_group(reference=MATTE, target=TARGET)
    tree.nodes["Image"].image = None
    with pytest.raises(RuntimeError, match="has no image"):
        bpy.ops.dyehouse.add_compositor_group(reference=MATTE, target=TARGET)
    with pytest.raises(RuntimeError, match="no Render Layers or Image node 'Layers'"):
        bpy.ops.dyehouse.add_compositor_group(reference=MATTE, target=TARGET, node="Layers")


def test_a_linked_scene_is_told_in_words(tmp_path: Path) -> None:
    bpy.context.scene.name = "Stage"
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {bpy.context.scene})
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.scenes = ["Stage"]
    with pytest.raises(RuntimeError, match="linked from a library"):
        bpy.ops.dyehouse.add_compositor_group(scene="Stage", reference_color=RED, target=TARGET)
