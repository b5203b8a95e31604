"""Masks of Blender: splines as its compositor fills them, painted images, cryptomattes of a render."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from dyehouse.addon import images, masks
from dyehouse.batch import cryptomatte, files
from dyehouse.core.errors import DyehouseError
from dyehouse.core.neighborhood import dilate, erode

pytestmark = pytest.mark.usefixtures("blender")


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    """A scene that writes what its compositor makes."""
    made = bpy.data.scenes.new("compositor")
    yield made
    bpy.data.scenes.remove(made)


def composited(scene: bpy.types.Scene, mask: bpy.types.Mask, width: int, height: int, path: Path) -> NDArray:
    """What Blender's own Mask node makes, top row first."""
    tree = bpy.data.node_groups.new("tree", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    node = tree.nodes.new("CompositorNodeMask")
    node.mask, node.inputs["Size Source"].default_value = mask, "Fixed"
    node.inputs["Size X"].default_value, node.inputs["Size Y"].default_value = width, height
    tree.links.new(node.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    settings, render = scene.render.image_settings, scene.render
    settings.media_type, settings.file_format, settings.color_depth = "IMAGE", "OPEN_EXR", "32"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.filepath, render.use_file_extension = str(path), False
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return files.read(path).pixels[..., 0]


def outline(layer: Any, corners: list[tuple[float, float]], bend: float = 0.0, cyclic: bool = True) -> Any:
    spline = layer.splines.new()
    spline.use_cyclic = cyclic
    spline.points.add(len(corners) - 1)  # a new spline has one point
    for point, (x, y) in zip(spline.points, corners, strict=True):
        point.co = x, y
        point.handle_left_type = point.handle_right_type = "FREE"  # before the handles
        point.handle_left, point.handle_right = (x - bend, y + bend), (x + bend, y - bend)
    return spline


def ring(x: float, y: float, r: float, clockwise: bool = False) -> list[tuple[float, float]]:
    corners = [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r)]
    return corners[::-1] if clockwise else corners


def leaf(mask: Any) -> None:
    outline(mask.layers.new(), [(0.2, 0.35), (0.7, 0.3), (0.8, 0.6), (0.4, 0.65)], 0.06)


def overlapping(mask: Any) -> None:
    layer = mask.layers.new()
    outline(layer, ring(0.4, 0.45, 0.15))
    outline(layer, ring(0.55, 0.55, 0.15, clockwise=True))
    outline(layer, ring(0.5, 0.5, 0.04, clockwise=True))


def holes(mask: Any) -> None:
    overlapping(mask)
    mask.layers[0].use_fill_holes = True


def star(mask: Any) -> None:
    angles = np.arange(5) * 4 * np.pi / 5
    outline(mask.layers.new(), [(0.5 + 0.3 * np.sin(a), 0.5 + 0.3 * np.cos(a)) for a in angles])


def layers(mask: Any) -> None:
    outline(mask.layers.new(), ring(0.45, 0.5, 0.2), 0.02)
    over = mask.layers.new()
    over.blend, over.alpha = "MERGE_SUBTRACT", 0.5
    outline(over, ring(0.6, 0.5, 0.15))
    hidden = mask.layers.new()
    hidden.hide_render = True
    outline(hidden, ring(0.2, 0.5, 0.1))


def inverted(mask: Any) -> None:
    leaf(mask)
    mask.layers[0].invert = True


def open_curve(mask: Any) -> None:
    outline(mask.layers.new(), [(0.2, 0.35), (0.7, 0.3), (0.8, 0.6)], 0.05, cyclic=False)


@pytest.mark.parametrize("make", [leaf, overlapping, holes, star, layers, inverted, open_curve])
@pytest.mark.parametrize(("width", "height"), [(300, 200), (160, 240)])
def test_splines_are_filled_as_by_the_compositor(
    make: Any, width: int, height: int, scene: bpy.types.Scene, tmp_path: Path
) -> None:
    mask = bpy.data.masks.new("mask")
    make(mask)
    ours = masks.of_spline(mask).load((height, width))() / 255
    theirs = composited(scene, mask, width, height, tmp_path / "mask.exr")
    for level in (0.4, 0.9):
        a, b = ours > level, theirs > level
        assert b.any()
        # They may differ in the pixels of the outline, where the compositor hardly smooths.
        assert np.count_nonzero(b & ~dilate(a, 1)) < 10  # sharp tips
        assert not (erode(a, 1) & ~b).any()


def test_smooth_outlines_agree_with_the_compositor(scene: bpy.types.Scene, tmp_path: Path) -> None:
    mask = bpy.data.masks.new("mask")
    leaf(mask)
    for width, height in ((600, 400), (400, 600), (500, 500)):
        a = masks.of_spline(mask).load((height, width))() > 127
        b = composited(scene, mask, width, height, tmp_path / "mask.exr") > 0.5
        assert (a & b).sum() / (a | b).sum() > 0.998


def test_a_changed_spline_is_another_mask() -> None:
    mask = bpy.data.masks.new("mask")
    leaf(mask)
    before = masks.of_spline(mask).version
    assert masks.of_spline(mask).version == before
    mask.layers[0].splines[0].points[0].co.x += 0.01
    assert masks.of_spline(mask).version != before


def test_a_painted_image_means_what_it_shows(photo: Any, tmp_path: Path) -> None:
    codes = np.arange(48 * 64, dtype=np.float32).reshape(48, 64) % 256
    byte = bpy.data.images.new("byte", 64, 48)
    images.set_pixels(byte, np.repeat(codes[..., None] / 255, 4, axis=2))
    assert (masks.of_image(byte).load((48, 64))() == codes).all()
    floats = bpy.data.images.new("floats", 64, 48, float_buffer=True, is_data=True)
    values = np.linspace(0, 1, 48 * 64, dtype=np.float32).reshape(48, 64)
    images.set_pixels(floats, np.concatenate([np.repeat(values[..., None], 3, axis=2), np.ones((48, 64, 1))], axis=2))
    assert np.abs(masks.of_image(floats).load((48, 64))() - values).max() <= 0.5 / 65535 + 1e-7
    before = masks.of_image(byte).version
    byte.pixels[7] = 0.123
    assert masks.of_image(byte).version != before
    with pytest.raises(DyehouseError, match=r"64 x 48 .* 10 x 10"):
        masks.of_image(byte).load((10, 10))()
    colored = bpy.data.images.new("colored", 8, 8)
    colored.pixels[0] = 0.7
    with pytest.raises(DyehouseError, match="colored"):
        masks.of_image(colored).load((8, 8))()


@pytest.fixture(scope="module")
def render(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two balls with cryptomatte passes."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 4, "CPU"
    scene.cycles.use_denoising = False
    material = bpy.data.materials.new("Glaze")
    for name, x in (("Cup", -0.8), ("Plate", 0.8)):
        bpy.ops.mesh.primitive_uv_sphere_add(location=(x, 0, 0))
        bpy.context.object.name = name
        bpy.context.object.data.materials.append(material)
    bpy.ops.object.camera_add(location=(0, -7, 0), rotation=(1.5708, 0, 0))
    scene.camera = bpy.context.object
    layer = scene.view_layers[0]
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = True
    settings, render = scene.render.image_settings, scene.render
    settings.media_type, settings.file_format = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    path = tmp_path_factory.mktemp("render") / "render.exr"
    render.filepath, render.resolution_x, render.resolution_y, render.resolution_percentage = str(path), 90, 60, 100
    bpy.ops.render.render(write_still=True)
    return path


def test_cryptomattes_cover_what_they_name(render: Path) -> None:
    assert {"Cup", "Plate"} <= cryptomatte.names_in(render)["ViewLayer.CryptoObject"].keys()
    cup, plate, both = (masks.of_matte(render, names).load((60, 90))() for names in ("Cup", "Plate", "Cup, Plate"))
    left, right = np.arange(90) < 45, np.arange(90) >= 45
    assert cup[:, left].sum() > 0.98 * cup.sum() > 300
    assert plate[:, right].sum() > 0.98 * plate.sum() > 300
    assert np.abs(cup + plate - both).max() < 1e-4
    glaze = masks.of_matte(render, "Glaze").load((60, 90))()
    assert np.abs(glaze - both).max() < 1e-4


def test_the_compositor_reads_the_same_cryptomatte(render: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = masks.of_matte(render, "Plate").load((60, 90))()
    monkeypatch.setattr(images, "reads_files", lambda: False)
    assert np.abs(masks.of_matte(render, "Plate").load((60, 90))() - expected).max() < 1e-4
    for names, words in (("Cap", "'Cap'"), ("Plate", "does not exist")):
        path = render if names == "Cap" else render.with_name("missing.exr")
        with pytest.raises(DyehouseError, match=words):
            masks.of_matte(path, names).load((60, 90))


@pytest.mark.parametrize(
    ("file", "names", "layer", "words"),
    [
        ("render.exr", "Cap", "", "'Cap': use one of Cup"),
        ("render.exr", "Cup", "CryptoAsset", "no cryptomatte layer 'CryptoAsset'"),
        ("missing.exr", "Cup", "", "cannot be read"),
    ],
)
def test_what_a_cryptomatte_lacks_is_said(render: Path, file: str, names: str, layer: str, words: str) -> None:
    with pytest.raises(DyehouseError, match=words):
        masks.of_matte(render.with_name(file), names, layer).load((60, 90))()


def test_a_render_is_recolored_by_its_own_cryptomatte(render: Path, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(render))
    bpy.ops.dyehouse.add_region(image=image.name)
    region = image.dyehouse.regions[0]
    region.mask_source, region.matte_names = "CRYPTOMATTE", "Cup"
    region.reference_source, region.reference_color = "COLOR", (0.2, 0.1, 0.1)
    region.target.text = "#1F4E79"
    assert bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "out.exr")) == {"FINISHED"}
    before, after = files.read(render).pixels[..., :3], files.read(tmp_path / "out.exr").pixels[..., :3]
    covered = masks.of_matte(render, "Cup").load((60, 90))()
    assert (before[covered == 0] == after[covered == 0]).all()
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(tmp_path / "r.toml"))
    from dyehouse.batch.cli import main

    options = ["--recipe", str(tmp_path / "r.toml"), "--no-verify", "-o", str(tmp_path / "cli.exr")]
    assert main(["recolor", str(render), *options]) == 0
    assert (files.read(tmp_path / "cli.exr").pixels[..., :3] == after).all()
