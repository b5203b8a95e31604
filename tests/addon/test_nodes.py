"""The live node groups give the core's pixels, in Cycles and in the compositor on both devices."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from dyehouse import addon
from dyehouse.addon import images, nodes, recipes
from dyehouse.batch import files
from dyehouse.benchmarks import node_renders
from dyehouse.core import dichromatic, mixture
from dyehouse.core.colorspace import LINEAR_SRGB

pytestmark = pytest.mark.usefixtures("blender")
HEIGHT, WIDTH = 12, 16
ENGINES = ("cycles", "compositor CPU", "compositor GPU")
type Case = dict[str, object]


@pytest.fixture
def pixels() -> NDArray[np.float32]:
    """Linear RGBA, also below 0 and above 1, alpha from 0 to 1 and multiplied in."""
    found = np.random.default_rng(5).uniform(-0.03, 1.4, (HEIGHT, WIDTH, 4)).astype(np.float32)
    found[..., 3] = np.linspace(0, 1, WIDTH)
    found[..., :3] *= found[..., 3:]
    return found


@pytest.fixture
def picture(pixels: NDArray, tmp_path: Path) -> Path:
    """The pixels in a file: Blender changes its working space only for images that it can load again."""
    path = tmp_path / "picture.exr"
    return files.write(path, pixels, files.Photo(path, pixels, LINEAR_SRGB, premultiplied=True))


def recolor_node(engine: str, picture: Path, space: str = nodes.WORKING, working: str = "") -> bpy.types.Node:
    """A scene in which a recolor node is all that happens to the picture."""
    material = node_renders.flat_scene(WIDTH, HEIGHT)
    if working:
        assert bpy.ops.wm.set_working_color_space(working_space=working) == {"FINISHED"}
    image = bpy.data.images.load(str(picture))
    image.colorspace_settings.name = "Linear Rec.709"
    if engine == "cycles":
        texture = node_renders.textured(material, image)
        node_renders.seen_as_light(material)
        socket = texture.outputs["Color"]
        return nodes.insert(socket, [link.to_socket for link in socket.links], space)
    if engine.endswith("GPU"):
        gpu = pytest.importorskip("gpu")
        try:
            gpu.init()
        except SystemError as error:
            pytest.skip(f"no GPU context here: {error}")
    tree = node_renders.compositor_scene(image)
    bpy.context.scene.render.compositor_device = engine.split()[1]
    socket = tree.nodes["Image"].outputs["Image"]
    return nodes.insert(socket, nodes.output_places(socket), space)


def to_working_space() -> NDArray:
    return np.array([recipes.between(LINEAR_SRGB, images.working_space(), axis) for axis in np.eye(3)])


def render() -> NDArray:
    return node_renders.rendered(bpy.context.scene)


def by_core(pixels: NDArray, asked: Case) -> NDArray:
    """The core's pixels: matrix and share of the residual as `Analysis.matrix` makes them."""
    made, light = asked["mixture"], np.array(asked["target_white"], float)
    share = dichromatic.residual_share(asked["residual"], made.body, asked["target"], made.white, light)
    matrix = made.matrix(np.array(asked["target"], float), light, share)[:, :3]
    return pixels[..., :3].astype(np.float64) @ matrix.T


RED, WHITE = np.array((0.42, 0.09, 0.05)), np.ones(3)
GRAY, WARM = np.array((0.4, 0.39, 0.41)), np.array((1.1, 1.0, 0.7))


def case(target: object = (0.05, 0.2, 0.5), made: mixture.Mixture | None = None, **changes: object) -> Case:
    made = made or mixture.plain("dichromatic", RED, WHITE)
    return {"mixture": made, "target": target, "target_white": (1, 1, 1), "residual": "fade", **changes}


CASES = {
    "another hue": case(),
    "the same color": case(RED),
    "a little off, where the residual matters": case((0.40, 0.10, 0.06)),
    "darker": case((0.2, 0.045, 0.026)),
    "black": case((0, 0, 0)),
    "another light": case(made=mixture.plain("dichromatic", RED, WARM), target_white=(0.8, 0.9, 1.2)),
    "body alone": case((0.1, 0.3, 0.2), mixture.plain("body", GRAY, WHITE)),
    "body alone, residual kept": case(made=mixture.plain("body", RED, WHITE), residual="keep"),
    "residual dropped": case((0.40, 0.10, 0.06), residual="drop"),
    "a share of the residual": case(residual=0.3),
    "almost gray": case(made=mixture.plain("dichromatic", np.array((0.5, 0.42, 0.40)), WHITE)),
    "channels below zero": case((-0.02, 0.3, 0.4), mixture.plain("dichromatic", np.array((0.5, 0.1, -0.01)), WHITE)),
    "folds": case((0.2, 0.6, 0.9), mixture.matte_bounce(RED, WARM, 0.9), target_white=(0.8, 0.9, 1.2), residual="keep"),
    "two lights": case(made=mixture.two_lights(RED, WHITE, np.array((2.0, 1.0, 0.4))), residual="keep"),
    "metal": case(made=mixture.metal(np.array((0.9, 0.6, 0.3)), WARM), residual="keep"),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("gloss", [True, False])
def test_corrections_of_single_pixels(engine: str, gloss: bool, pixels: NDArray, picture: Path) -> None:
    node = recolor_node(engine, picture)
    for model in ("regularized", "bounce"):
        made = mixture.mapped(model, RED, WARM, 0.6, gloss=gloss or model == "regularized")
        nodes.fill(node, made, (0.2, 0.6, 0.9), (0.8, 0.9, 1.2), 0.4)
        extra = np.array((0.05, -0.1))[: made.projector.shape[1] - 3]
        rows = np.stack([made.coefficient(term)[3:] for term in nodes.CORRECTED])
        node.inputs["Correction"].default_value, node.inputs["Mask"].default_value = rows @ extra, 0.7
        matrix = made.matrix(np.array((0.2, 0.6, 0.9)), np.array((0.8, 0.9, 1.2)), 0.4)
        share = 0.7 * np.concatenate([pixels[..., :3], np.broadcast_to(extra, (HEIGHT, WIDTH, len(extra)))], axis=2)
        expected = 0.3 * pixels[..., :3] + share @ matrix.T
        assert np.abs(render()[..., :3] - expected).max() < 1e-5


@pytest.mark.parametrize("engine", ENGINES)
def test_every_input_gives_the_cores_pixels(engine: str, pixels: NDArray, picture: Path) -> None:
    node = recolor_node(engine, picture)
    for name, asked in CASES.items():
        nodes.fill(node, **asked)
        got, expected = render(), by_core(pixels, asked)
        # Some of these random pixels come out at 40 times white, where single floats have steps of 4e-6.
        assert (np.abs(got[..., :3] - expected) / np.maximum(1, np.abs(expected))).max() < 1e-5, name
        if engine != "cycles":
            assert np.array_equal(got[..., 3], pixels[..., 3])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_mask_and_the_light_of_its_edge(engine: str, pixels: NDArray, picture: Path) -> None:
    rng = np.random.default_rng(3)
    node = recolor_node(engine, picture)
    nodes.fill(node, **case())
    for mask, light in ((0.0, np.zeros(3)), (0.3, np.zeros(3)), (0.6, rng.uniform(-0.1, 0.1, 3))):
        node.inputs["Mask"].default_value, node.inputs["Edge Light"].default_value = mask, light
        share = mask * pixels[..., :3] + light
        expected = pixels[..., :3] + by_core(share, case()) - share
        assert np.abs(render()[..., :3] - expected).max() < 1e-5


@pytest.mark.parametrize("engine", ENGINES)
def test_a_keyframed_target_gives_the_cores_pixels_at_every_frame(engine: str, pixels: NDArray, picture: Path) -> None:
    node = recolor_node(engine, picture)
    nodes.fill(node, **case())
    socket = node.inputs["Target Color"]
    for frame, color in ((1, (0.4, 0.1, 0.06)), (11, (0.05, 0.2, 0.5))):
        socket.default_value = (*color, 1)
        socket.keyframe_insert("default_value", frame=frame)
    shown = []
    for frame in (1, 4, 11):
        bpy.context.scene.frame_set(frame)
        shown.append(tuple(socket.default_value)[:3])
        assert np.abs(render()[..., :3] - by_core(pixels, case(shown[-1]))).max() < 1e-5
    assert len(set(shown)) == 3


@pytest.mark.parametrize("engine", ENGINES)
def test_a_driven_target_gives_the_cores_pixels(engine: str, pixels: NDArray, picture: Path) -> None:
    node = recolor_node(engine, picture)
    nodes.fill(node, **case())
    driver = node.inputs["Target Color"].driver_add("default_value", 2).driver
    driver.expression = "frame / 20"
    bpy.context.scene.frame_set(13)
    assert np.abs(render()[..., :3] - by_core(pixels, case((0.05, 0.2, 0.65)))).max() < 1e-5


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("working", ["ACEScg", "Linear Rec.2020"])
def test_in_another_working_space_the_picture_is_recolored_in_its_own(
    engine: str, working: str, pixels: NDArray, picture: Path
) -> None:
    node = recolor_node(engine, picture, "linear-srgb", working)
    asked = case((0.40, 0.10, 0.06), residual=0.5)
    nodes.fill(node, **asked)
    assert np.abs(render()[..., :3] - by_core(pixels, asked) @ to_working_space()).max() < 1e-5


@pytest.mark.parametrize("engine", ENGINES)
def test_the_groups_follow_a_change_of_the_working_space(engine: str, pixels: NDArray, picture: Path) -> None:
    node = recolor_node(engine, picture, "linear-srgb")
    nodes.fill(node, **case(residual=0.5))
    assert bpy.ops.wm.set_working_color_space(working_space="ACEScg") == {"FINISHED"}
    # Blender rounds the colors that it converts, and this is what it made of the target.
    target = np.linalg.inv(to_working_space()).T @ tuple(node.inputs["Target Color"].default_value)[:3]
    assert target == pytest.approx((0.05, 0.2, 0.5), abs=1e-4)
    expected = by_core(pixels, case(target, residual=0.5)) @ to_working_space()
    assert np.abs(render()[..., :3] - expected).max() < 1e-5


def test_one_group_serves_all_nodes_of_a_kind_and_space() -> None:
    first = nodes.ensure_group("SHADER", "srgb")
    assert nodes.ensure_group("SHADER", "srgb") == first
    assert nodes.ensure_group("SHADER", "acescg") != first
    assert nodes.ensure_group("COMPOSITOR", "srgb") != first
    assert {item.name for item in first.interface.items_tree} >= {"Color", "Target Color", "Mask", "Reference"}


def test_it_works_on_after_saving_and_opening_without_the_extension(picture: Path, tmp_path: Path) -> None:
    node = recolor_node("compositor CPU", picture)
    nodes.fill(node, **case())
    bpy.data.images[picture.name].pack()
    picture.unlink()
    expected = render()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    addon.unregister()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
        assert np.abs(render() - expected).max() < 1e-6
    finally:
        addon.register()


def test_a_target_that_no_color_socket_can_hold_has_a_node_until_it_is_gone(picture: Path) -> None:
    node = recolor_node("compositor CPU", picture)
    count = len(node.id_data.nodes)
    for _ in range(2):
        nodes.fill(node, **case((-0.1, 0.2, 0.3)))
        assert len(node.id_data.nodes) == count + 1
    matrix = nodes.mixture_of(node)[1][:, :3]
    assert matrix @ RED == pytest.approx((-0.1, 0.2, 0.3), abs=1e-6)
    nodes.set_target(node, (0.1, 0.2, 0.3))
    assert len(node.id_data.nodes) == count
    assert tuple(node.inputs["Target Color"].default_value) == pytest.approx((0.1, 0.2, 0.3, 1))


@pytest.mark.parametrize("name", CASES)
def test_a_node_tells_the_matrix_that_it_is_set_to(name: str, picture: Path) -> None:
    node = recolor_node("compositor CPU", picture)
    asked = CASES[name]
    nodes.fill(node, **asked)
    _, matrix = nodes.mixture_of(node)
    assert np.allclose(np.eye(3) @ matrix[:, :3].T, by_core(np.eye(3), asked), atol=1e-6)


def test_registering_twice_leaves_nothing_behind() -> None:
    handlers = bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.load_post
    addon.unregister()
    counts = [len(found) for found in handlers]
    for _ in range(2):
        addon.register()
        assert hasattr(bpy.types, "DYEHOUSE_PT_shader")
        addon.unregister()
        assert not hasattr(bpy.types, "DYEHOUSE_PT_shader")
    assert [len(found) for found in handlers] == counts
    addon.register()
