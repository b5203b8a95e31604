"""Recoloring base color textures: live in Cycles, and baked, against the command line's way through files."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from dyehouse import addon
from dyehouse.addon import images, nodes, recipes, textures
from dyehouse.batch import files
from dyehouse.batch import photo as photos
from dyehouse.benchmarks import node_renders
from dyehouse.core import transfer
from dyehouse.core.colorspace import LINEAR_SRGB, SRGB, space_named
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

HEIGHT, WIDTH = 32, 44
MATTE = (14, 18)
TARGET = "lab(42, 55, 35)"
TILES = (1001, 1002, 1011)


@pytest.fixture(autouse=True)
def material() -> Iterator[bpy.types.Material]:
    """A plane that fills the camera, and its material."""
    made = node_renders.flat_scene(WIDTH, HEIGHT)
    addon.register()
    yield made
    addon.unregister()


def linear(seed: int = 0) -> NDArray[np.float32]:
    """A disk of shaded, glossy, noisy product on a gray ground."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    shade, gloss = 0.3 + 0.6 * x / WIDTH, 0.3 * np.exp(-(((x - 28) ** 2 + (y - 10) ** 2) / 8))
    disk = np.clip(13.5 - np.hypot(x - 22, y - 16), 0, 1)[..., None]
    product = shade[..., None] * (0.10, 0.22, 0.40) + gloss[..., None]
    return (disk * product + (1 - disk) * 0.35 + rng.normal(0, 0.004, (HEIGHT, WIDTH, 3))).astype(np.float32)


def coverage() -> NDArray[np.uint8]:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.uint8(255 * np.clip(13.5 - np.hypot(x - 22, y - 16), 0, 1))


KINDS = {
    "8-bit.png": (np.uint8, 3),
    "8-bit-alpha.png": (np.uint8, 4),
    "8-bit.jpg": (np.uint8, 3),
    "16-bit.png": (np.uint16, 3),
    "16-bit-alpha.png": (np.uint16, 4),
    "half.exr": (np.float16, 3),
    "float.exr": (np.float32, 3),
    "float-alpha.exr": (np.float32, 4),
}


def written(path: Path, seed: int = 0, kind: str = "") -> Path:
    """A file of the kind that its name, or `kind`, tells."""
    dtype, channels = KINDS[kind or path.name]
    space = SRGB if np.dtype(dtype).kind == "u" else LINEAR_SRGB
    pixels = np.empty((HEIGHT, WIDTH, channels), dtype)
    pixels[..., :3] = transfer.encode(linear(seed), space.curve, dtype)
    if channels == 4:
        alpha = np.linspace(0.1, 1, WIDTH)[None].repeat(HEIGHT, axis=0)
        pixels[..., 3] = photos.converted(alpha.astype(np.float32), dtype)
        if space is LINEAR_SRGB:
            pixels[..., :3] *= pixels[..., 3:]
    return files.write(path, pixels, files.Photo(path, pixels, space, premultiplied=space is LINEAR_SRGB))


def mask_file(path: Path, values: NDArray[np.uint8] | None = None) -> Path:
    pixels = np.repeat((coverage() if values is None else values)[..., None], 3, axis=2)
    return files.write(path, pixels, files.Photo(path, pixels, SRGB))


def texture_of(material: bpy.types.Material, path: Path) -> bpy.types.Node:
    return node_renders.textured(material, bpy.data.images.load(str(path)))


def by_files(path: Path, recipe: Recipe) -> tuple[files.Photo, NDArray]:
    """The command line's result: what is read, and float32 linear RGB of the recolored picture."""
    photo = files.read(path)
    return photo, photos.look(photo, recipe).analyses[0].recolor(photos.look(photo, recipe).target())


def recipe(mask: str | None = None, **changes: object) -> Recipe:
    return Recipe((Region(parse_target(TARGET), reference=MATTE, mask=mask, **changes),))


def render() -> NDArray:
    return node_renders.rendered(bpy.context.scene)[..., :3]


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("mask", [None, "click", "image"])
def test_the_live_texture_has_the_pixels_of_the_command_line(
    name: str, mask: str | None, material: bpy.types.Material, tmp_path: Path
) -> None:
    path = written(tmp_path / name)
    texture = texture_of(material, path)
    if KINDS[name][1] == 4 and not name.endswith("exr"):
        texture.image.alpha_mode = "CHANNEL_PACKED"  # else Blender itself darkens the codes by alpha
    if mask == "image":
        mask = str(mask_file(tmp_path / "mask.png"))
        bpy.data.images.load(mask)
    given = "mask.png" if mask and mask != "click" else mask or ""
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET, mask=given) == {"FINISHED"}
    node_renders.seen_as_light(material)
    _, expected = by_files(path, recipe(mask))
    assert np.abs(render() - expected).max() < 1e-5


def seen(material: bpy.types.Material) -> NDArray:
    """What Blender makes of the texture before it reaches the shader."""
    node_renders.seen_as_light(material)
    before = render()
    tree = material.node_tree
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    return before


def test_codes_that_blender_darkens_by_alpha(material: bpy.types.Material, tmp_path: Path) -> None:
    path = written(tmp_path / "8-bit-alpha.png")
    texture = texture_of(material, path)
    before = seen(material)
    arguments = {"reference": MATTE, "target": TARGET, "model": "dichromatic"}
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", **arguments) == {"FINISHED"}
    node_renders.seen_as_light(material)
    prepared = photos.look(files.read(path), recipe(model="dichromatic"))
    assert np.abs(render() - before @ prepared.analyses[0].matrix(prepared.target()).T).max() < 1e-5
    assert texture.image.alpha_mode == "STRAIGHT"


def test_where_alpha_is_used_colors_are_straight_and_so_is_the_light_of_soft_edges(
    material: bpy.types.Material, tmp_path: Path
) -> None:
    path = written(tmp_path / "float-alpha.exr")
    texture = texture_of(material, path)
    tree = material.node_tree
    tree.links.new(texture.outputs["Alpha"], tree.nodes["Principled BSDF"].inputs["Alpha"])
    arguments = {"reference": MATTE, "target": TARGET, "mask": "click"}
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", **arguments) == {"FINISHED"}
    node_renders.seen_as_light(material)
    one = tree.nodes.new("ShaderNodeMath")  # a use of alpha that changes nothing
    one.operation, one.inputs[1].default_value, one.inputs[2].default_value = "MULTIPLY_ADD", 0.0, 1.0
    tree.links.new(texture.outputs["Alpha"], one.inputs[0])
    tree.links.new(one.outputs[0], tree.nodes["Emission"].inputs["Strength"])
    photo, expected = by_files(path, recipe("click"))
    assert np.abs(render() - expected / photo.pixels[..., 3:]).max() < 1e-5


@pytest.mark.parametrize("working", ["ACEScg", "Linear Rec.2020"])
@pytest.mark.parametrize("name", ["8-bit.png", "16-bit.png", "float.exr"])
def test_in_another_working_space_the_matrix_is_that_of_the_pictures_own(
    working: str, name: str, material: bpy.types.Material, tmp_path: Path
) -> None:
    assert bpy.ops.wm.set_working_color_space(working_space=working) == {"FINISHED"}
    path = written(tmp_path / name)
    texture = texture_of(material, path)
    if name.endswith("exr"):
        texture.image.colorspace_settings.name = "Linear Rec.709"
    to_working = np.array([recipes.between(LINEAR_SRGB, images.working_space(), axis) for axis in np.eye(3)])
    before = seen(material) @ np.linalg.inv(to_working)
    # Cycles rounds textures of integer codes when it brings them into such a space.
    assert np.abs(before - files_light(path)).max() < (2e-3 if name.endswith("png") else 1e-5)
    arguments = {"reference": MATTE, "target": TARGET, "model": "dichromatic"}
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", **arguments) == {"FINISHED"}
    node_renders.seen_as_light(material)
    prepared = photos.look(files.read(path), recipe(model="dichromatic"))
    matrix = prepared.analyses[0].matrix(prepared.target())
    assert np.abs(render() - before @ matrix.T @ to_working).max() < 1e-5


def files_light(path: Path) -> NDArray:
    photo = files.read(path)
    return transfer.decode(photo.pixels[..., :3], photo.space.curve)


@pytest.mark.parametrize("floats", [False, True])
def test_a_generated_texture(floats: bool, material: bpy.types.Material) -> None:
    image = bpy.data.images.new("made", WIDTH, HEIGHT, float_buffer=floats)
    rgba = np.ones((HEIGHT, WIDTH, 4), np.float32)
    rgba[..., :3] = linear() if floats else transfer.encode(linear(), SRGB.curve, np.uint8) / np.float32(255)
    images.set_pixels(image, rgba)
    node_renders.textured(material, image)
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET) == {"FINISHED"}
    assert bpy.ops.dyehouse.bake_texture(material="Flat") == {"FINISHED"}
    node_renders.seen_as_light(material)
    stored = linear() if floats else transfer.decode(transfer.encode(linear(), SRGB.curve, np.uint8), SRGB.curve)
    prepared = photos.look(files.Photo(Path(), stored, LINEAR_SRGB), recipe())
    expected = prepared.analyses[0].recolor(prepared.target())
    assert np.abs(render() - expected).max() < 1e-5
    baked = images.pixels_of(bpy.data.images["made Recolored"])[..., :3]
    assert np.abs(baked - expected).max() < 1e-6 if floats else np.ptp(baked) > 0.1


def show_tile(number: int) -> None:
    """Let the plane show a tile."""
    u, v = (number - 1001) % 10, (number - 1001) // 10
    corners = bpy.data.objects["Plane"].data.uv_layers[0].data
    for corner, (x, y) in zip(corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        corner.uv = x + u, y + v


@dataclass
class Tiled:
    """A texture of three tiles in files, and a mask of as many, empty in the last."""

    folder: Path

    def __post_init__(self) -> None:
        for k, number in enumerate(TILES):
            written(self.file(number), k, "8-bit.png")
            mask_file(self.mask(number), coverage() * np.uint8(number != TILES[-1]))
        self.image = self.load("colors")
        self.mask_image = self.load("masks")

    def file(self, number: int) -> Path:
        return self.folder / f"colors.{number}.png"

    def mask(self, number: int) -> Path:
        return self.folder / f"masks.{number}.png"

    def load(self, name: str) -> bpy.types.Image:
        image = bpy.data.images.load(str(self.folder / f"{name}.{TILES[0]}.png"))
        image.source, image.name = "TILED", name
        return image

    def by_files(self, number: int, mask: bool) -> tuple[NDArray, NDArray]:
        """Linear RGB and codes of a tile by the command line's way, on the footing of the first tile."""
        photo = files.read(self.file(number))
        if mask and number == TILES[-1]:
            return transfer.decode(photo.pixels, SRGB.curve), photo.pixels
        masks = (str(self.mask(TILES[0])), str(self.mask(number))) if mask else (None, None)
        return on_footing(files.read(self.file(TILES[0])), photo, *masks)


def on_footing(
    first: files.Photo, photo: files.Photo, first_mask: str | None = None, mask: str | None = None
) -> tuple[NDArray, NDArray]:
    """Linear RGB and codes of a photo with the reference that another one has."""
    found = photos.look(first, recipe(first_mask, model="dichromatic")).analyses[0]
    region = Region(parse_target(TARGET), tuple(found.reference), model="dichromatic", mask=mask)
    prepared = photos.look(photo, Recipe((region,)))
    return prepared.analyses[0].recolor(prepared.target()), photos.recolored(photo, prepared, "x.png")[0]


@pytest.fixture
def tiled(tmp_path: Path) -> Tiled:
    return Tiled(tmp_path)


def codes_of(image: bpy.types.Image, folder: Path) -> dict[int, NDArray]:
    """What the file of each tile of an image holds."""
    return {number: load().pixels for number, load in textures.loaders(image, folder, None).items()}


@pytest.mark.parametrize("mask", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_udim_tiles_live_and_baked(
    mask: bool, packed: bool, material: bpy.types.Material, tiled: Tiled, tmp_path: Path
) -> None:
    expected = {number: tiled.by_files(number, mask) for number in TILES}
    if packed:
        for image in (tiled.image, tiled.mask_image):
            image.pack()
        for number in TILES:
            tiled.file(number).unlink()
            tiled.mask(number).unlink()
    node_renders.textured(material, tiled.image)
    arguments = {"reference": MATTE, "target": TARGET, "mask": "masks" if mask else "", "model": "dichromatic"}
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", **arguments) == {"FINISHED"}
    assert bpy.ops.dyehouse.bake_texture(material="Flat") == {"FINISHED"}
    baked = bpy.data.images["colors Recolored"]
    assert [tile.number for tile in baked.tiles] == list(TILES)
    assert {tuple(tile.size) for tile in baked.tiles} == {(WIDTH, HEIGHT)}
    for number, codes in codes_of(baked, tmp_path).items():
        # The node holds single floats: a code may round the other way.
        assert np.abs(codes.astype(int) - expected[number][1]).max() <= 1
    node_renders.seen_as_light(material)
    for number in TILES:
        show_tile(number)
        assert np.abs(render() - expected[number][0]).max() < 1e-5


def test_what_was_found_in_the_first_tile_holds_for_all(material: bpy.types.Material, tiled: Tiled) -> None:
    """Noise and model too, so that a tile that is the same gets the same pixels, whatever the others are."""
    node_renders.textured(material, tiled.image)
    shutil.copy(tiled.file(1001), tiled.file(1011))
    assert bpy.ops.dyehouse.bake_texture(material="Flat", reference=MATTE, target=TARGET) == {"FINISHED"}
    codes = codes_of(bpy.data.images["colors Recolored"], tiled.folder)
    photo = files.read(tiled.file(1001))
    assert np.array_equal(codes[1001], photos.recolored(photo, photos.look(photo, recipe()), "x.png")[0])
    assert np.array_equal(codes[1011], codes[1001])
    assert not np.array_equal(codes[1002], codes[1001])


def test_generated_and_painted_tiles(material: bpy.types.Material, tmp_path: Path) -> None:
    image = bpy.data.images.new("painted", WIDTH, HEIGHT, tiled=True)
    image.tiles.new(1002)
    node_renders.textured(material, image)
    made = []
    for index, code in enumerate(((30, 60, 90), (20, 50, 80))):
        image.tiles.active = image.tiles[index]
        with bpy.context.temp_override(edit_image=image):
            bpy.ops.image.tile_fill(color=(*(c / 255 for c in code), 1), width=WIDTH, height=HEIGHT)
        made.append(files.Photo(Path(), np.full((HEIGHT, WIDTH, 3), code, np.uint8), SRGB))
    before = image.filepath_raw, image.file_format, image.source
    arguments = {"reference": MATTE, "target": TARGET, "model": "dichromatic"}
    assert bpy.ops.dyehouse.bake_texture(material="Flat", **arguments) == {"FINISHED"}
    assert (image.filepath_raw, image.file_format, image.source) == before
    for number, codes in codes_of(bpy.data.images["painted Recolored"], tmp_path).items():
        assert np.array_equal(codes[..., :3], on_footing(made[0], made[number - 1001])[1])


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("packed", [False, True])
def test_a_baked_image_holds_the_file_that_the_command_line_writes(
    name: str, packed: bool, material: bpy.types.Material, tmp_path: Path
) -> None:
    path = written(tmp_path / name)
    texture = texture_of(material, path)
    texture.image.alpha_mode = "CHANNEL_PACKED"
    asked = recipe("click")
    photo = files.read(path)
    kind = ".png" if photo.pixels.dtype.kind == "u" else ".exr"
    expected = tmp_path / f"expected{kind}"
    photos.save(photo, photos.look(photo, asked), expected)
    if packed:
        texture.image.pack()
        path.unlink()
    arguments = {"reference": MATTE, "target": TARGET, "mask": "click"}
    assert bpy.ops.dyehouse.bake_texture(material="Flat", name="done", **arguments) == {"FINISHED"}
    baked = bpy.data.images["done"]
    assert tuple(baked.size) == (WIDTH, HEIGHT)
    assert baked.colorspace_settings.name == texture.image.colorspace_settings.name
    assert baked.alpha_mode == "CHANNEL_PACKED"
    got, wanted = codes_of(baked, tmp_path)[1001], files.read(expected).pixels
    assert got.dtype == wanted.dtype
    assert np.array_equal(got, wanted)
    assert "/tmp" not in baked.filepath
    assert len(material.node_tree.nodes) == 3  # the material is as it was


@pytest.mark.parametrize("name", ["8-bit.png", "16-bit.png", "float-alpha.exr"])
def test_without_openimageio_the_pixels_are_the_same(
    name: str, material: bpy.types.Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path / name)
    photo, expected = by_files(path, recipe("click"))
    texture_of(material, path)
    monkeypatch.setattr(images, "reads_files", lambda: False)
    arguments = {"reference": MATTE, "target": TARGET, "mask": "click"}
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", **arguments) == {"FINISHED"}
    assert bpy.ops.dyehouse.bake_texture(material="Flat", name="done", **arguments) == {"FINISHED"}
    monkeypatch.undo()
    node_renders.seen_as_light(material)
    assert np.abs(render() - expected).max() < 1e-5
    got = codes_of(bpy.data.images["done"], tmp_path)[1001]
    wanted = photos.recolored(photo, photos.look(photo, recipe("click")), name)[0]
    if photo.pixels.dtype == np.uint16:
        got = transfer.encode(got[..., :3], SRGB.curve, np.uint16)
    difference = np.abs(got.astype(np.float64) - wanted)
    assert difference.max() <= (1 if wanted.dtype.kind == "u" else 1e-5)


def test_a_bake_into_a_file_never_overwrites_one(material: bpy.types.Material, tmp_path: Path) -> None:
    texture_of(material, written(tmp_path / "8-bit.png"))
    arguments = {"material": "Flat", "reference": MATTE, "target": TARGET, "output": str(tmp_path / "out.png")}
    assert bpy.ops.dyehouse.bake_texture(**arguments) == {"FINISHED"}
    content = (tmp_path / "out.png").read_bytes()
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.bake_texture(**{**arguments, "target": "#102030"})
    assert (tmp_path / "out.png").read_bytes() == content
    with pytest.raises(RuntimeError, match=r"let its name end in \.png"):
        bpy.ops.dyehouse.bake_texture(**{**arguments, "output": str(tmp_path / "out.jpg")})
    assert len(list(tmp_path.iterdir())) == 2


def test_a_bake_that_is_stopped_leaves_nothing(material: bpy.types.Material, tiled: Tiled, tmp_path: Path) -> None:
    """What Esc does: the next sign of progress raises."""

    class StoppedError(Exception):
        pass

    shares = []

    def watch(share: float) -> None:
        shares.append(share)
        if share > 0.5:
            raise StoppedError

    texture = textures.Texture(tiled.image, recipe(model="dichromatic"))
    with pytest.raises(StoppedError):
        texture.bake(watch)
    assert shares == sorted(shares)
    texture.close()
    assert not texture.folder.exists()
    assert {image.name for image in bpy.data.images} == {"colors", "masks"}


def test_every_region_of_the_image_editor_is_baked(material: bpy.types.Material, tmp_path: Path) -> None:
    path = written(tmp_path / "8-bit.png")
    texture = texture_of(material, path)
    left, right = coverage().copy(), coverage().copy()
    left[:, 22:], right[:, :22] = 0, 0
    asked = []
    for name, values, code in (("left", left, "#1F4E79"), ("right", right, "#C28A1E")):
        file = mask_file(tmp_path / f"{name}.png", values)
        region = texture.image.dyehouse.regions.add()
        region.mask_source, region.mask_image = "IMAGE", bpy.data.images.load(str(file))
        region.target.text = code
        asked.append(Region(parse_target(code), mask=str(file)))
    assert bpy.ops.dyehouse.bake_texture(material="Flat", image_settings=True, name="done") == {"FINISHED"}
    photo = files.read(path)
    expected = photos.recolored(photo, photos.look(photo, Recipe(tuple(asked))), path)[0]
    assert np.array_equal(codes_of(bpy.data.images["done"], tmp_path)[1001], expected)


def test_tiles_go_into_files_of_their_own(material: bpy.types.Material, tiled: Tiled, tmp_path: Path) -> None:
    node_renders.textured(material, tiled.image)
    arguments = {"material": "Flat", "reference": MATTE, "target": TARGET, "model": "dichromatic"}
    with pytest.raises(RuntimeError, match="put <UDIM> into the name"):
        bpy.ops.dyehouse.bake_texture(**arguments, output=str(tmp_path / "out.png"))
    assert bpy.ops.dyehouse.bake_texture(**arguments, output=str(tmp_path / "out.<UDIM>.png")) == {"FINISHED"}
    for number in TILES:
        assert np.array_equal(files.read(tmp_path / f"out.{number}.png").pixels, tiled.by_files(number, False)[1])


def test_a_live_node_says_what_is_baked_and_makes_room_for_it(material: bpy.types.Material, tmp_path: Path) -> None:
    path = written(tmp_path / "8-bit.png")
    texture = texture_of(material, path)
    arguments = {"material": "Flat", "reference": MATTE, "mask": "click"}
    assert bpy.ops.dyehouse.recolor_texture(**arguments, target="#102030") == {"FINISHED"}
    node = nodes.after(texture.outputs["Color"])
    color = parse_target(TARGET).to_linear(SRGB)
    node.inputs["Target Color"].default_value = (*color, 1)
    assert bpy.ops.dyehouse.bake_texture(material="Flat", name="done", use=True) == {"FINISHED"}
    assert texture.image.name == "done"
    assert nodes.recolor_nodes(material.node_tree) == []
    photo = files.read(path)
    expected = photos.recolored(photo, photos.look(photo, recipe("click")), path)[0]
    assert np.abs(codes_of(texture.image, tmp_path)[1001].astype(int) - expected).max() <= 1


def test_used_again_it_sets_the_same_node_and_removed_leaves_no_trace(
    material: bpy.types.Material, tmp_path: Path
) -> None:
    texture_of(material, written(tmp_path / "8-bit.png"))

    def state() -> tuple:
        tree = material.node_tree
        wires = {(k.from_node.name, k.from_socket.name, k.to_node.name, k.to_socket.name) for k in tree.links}
        return {n.name for n in tree.nodes}, wires, {i.name for i in bpy.data.images if i.type != "RENDER_RESULT"}

    before = state()
    bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target="#102030", mask="click")
    first = state()
    bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET, mask="click")
    assert state()[:2] == first[:2]
    assert len(state()[2]) == len(first[2])
    bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET, model="dichromatic")
    assert len(material.node_tree.nodes) == len(before[0]) + 1
    assert bpy.ops.dyehouse.remove_recolor(material="Flat") == {"FINISHED"}
    assert state() == before
    with pytest.raises(RuntimeError, match="nothing to remove"):
        bpy.ops.dyehouse.remove_recolor(material="Flat")


def test_only_the_way_to_the_base_color_changes(material: bpy.types.Material, tmp_path: Path) -> None:
    texture = texture_of(material, written(tmp_path / "8-bit.png"))
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    mix, other = tree.nodes.new("ShaderNodeMix"), tree.nodes.new("ShaderNodeTexImage")
    mix.data_type = "RGBA"
    other.name = "Roughness Map"
    tree.links.new(other.outputs["Color"], mix.inputs["Factor"])
    tree.links.new(texture.outputs["Color"], mix.inputs["A"])
    tree.links.new(mix.outputs["Result"], shader.inputs["Base Color"])
    tree.links.new(texture.outputs["Color"], shader.inputs["Roughness"])
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET) == {"FINISHED"}
    assert mix.inputs["A"].links[0].from_node == nodes.after(texture.outputs["Color"])
    assert shader.inputs["Roughness"].links[0].from_node == texture


def test_one_undo_step(material: bpy.types.Material, tmp_path: Path) -> None:
    texture_of(material, written(tmp_path / "8-bit.png"))
    bpy.ops.ed.undo_push(message="before")
    count = len(material.node_tree.nodes)
    bpy.ops.dyehouse.recolor_texture("EXEC_DEFAULT", True, material="Flat", reference=MATTE, target=TARGET)
    node = nodes.recolor_nodes(bpy.data.materials["Flat"].node_tree)[0]
    target = tuple(node.inputs["Target Color"].default_value)
    bpy.ops.ed.undo()
    assert len(bpy.data.materials["Flat"].node_tree.nodes) == count
    bpy.ops.ed.redo()
    node = nodes.recolor_nodes(bpy.data.materials["Flat"].node_tree)[0]
    assert tuple(node.inputs["Target Color"].default_value) == target
    node_renders.seen_as_light(bpy.data.materials["Flat"])
    assert np.abs(render() - by_files(tmp_path / "8-bit.png", recipe())[1]).max() < 1e-5


def test_the_settings_of_the_image_editor(material: bpy.types.Material, tmp_path: Path) -> None:
    path = written(tmp_path / "8-bit.png")
    texture = texture_of(material, path)
    with pytest.raises(RuntimeError, match="has no settings yet"):
        bpy.ops.dyehouse.recolor_texture(material="Flat", image_settings=True)
    region = texture.image.dyehouse.regions.add()
    region.click, region.reference, region.reference_source = MATTE, MATTE, "PIXEL"
    region.target.text, region.residual = TARGET, "keep"
    assert bpy.ops.dyehouse.recolor_texture(material="Flat", image_settings=True) == {"FINISHED"}
    node_renders.seen_as_light(material)
    photo = files.read(path)
    prepared = photos.look(photo, recipe("click", residual="keep"))
    assert np.abs(render() - prepared.analyses[0].recolor(prepared.target(), residual="keep")).max() < 1e-5


def _no_node(material: bpy.types.Material, folder: Path) -> dict:
    return {}


def _no_image(material: bpy.types.Material, folder: Path) -> dict:
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return {}


def _data(material: bpy.types.Material, folder: Path) -> dict:
    texture_of(material, written(folder / "8-bit.png")).image.colorspace_settings.name = "Non-Color"
    return {}


def _odd_space(material: bpy.types.Material, folder: Path) -> dict:
    texture_of(material, written(folder / "8-bit.png")).image.colorspace_settings.name = "ARRI LogC4"
    return {}


def _missing(material: bpy.types.Material, folder: Path) -> dict:
    path = written(folder / "8-bit.png")
    texture_of(material, path)
    path.unlink()
    return {}


def _missing_tile(material: bpy.types.Material, folder: Path) -> dict:
    tiled = Tiled(folder)
    node_renders.textured(material, tiled.image)
    tiled.file(1002).unlink()
    return {}


def _other_tiles(material: bpy.types.Material, folder: Path) -> dict:
    tiled = Tiled(folder)
    node_renders.textured(material, tiled.image)
    bpy.data.images.load(str(tiled.mask(1001))).name = "single"
    return {"mask": "single"}


def _click_in_tiles(material: bpy.types.Material, folder: Path) -> dict:
    node_renders.textured(material, Tiled(folder).image)
    return {"mask": "click"}


def _small_mask(material: bpy.types.Material, folder: Path) -> dict:
    texture_of(material, written(folder / "8-bit.png"))
    bpy.data.images.new("small", 4, 4)
    return {"mask": "small"}


def _textured(material: bpy.types.Material, folder: Path) -> dict:
    texture_of(material, written(folder / "8-bit.png"))
    return {}


BAD = {
    "no such material": (_no_node, {"material": "Wood"}, "no material 'Wood'"),
    "nothing in context": (_no_node, {"material": ""}, "no active material"),
    "no texture": (_no_node, {}, "comes from no image texture"),
    "no such node": (_no_node, {"node": "Image"}, "no Image Texture node 'Image'"),
    "no image": (_no_image, {}, "has no image"),
    "data": (_data, {}, "Non-Color data"),
    "odd space": (_odd_space, {}, "color space 'ARRI LogC4'"),
    "missing file": (_missing, {}, "has lost its file"),
    "missing tile": (_missing_tile, {}, "has lost its file"),
    "a mask without the tiles": (_other_tiles, {}, "has other tiles"),
    "a click in tiles": (_click_in_tiles, {}, "give a mask image"),
    "a mask of another size": (_small_mask, {}, "make it the size of the photo"),
    "no such mask": (_textured, {"mask": "nothing"}, "no image 'nothing'"),
    "no such tile": (_textured, {"tile": 1005}, "no tile 1005"),
    "outside": (_textured, {"reference": (500, 3)}, "outside the picture"),
    "no color": (_textured, {"target": "reddish"}, "reddish"),
    "no light": (_textured, {"white": "sunshine"}, "sunshine"),
}


@pytest.mark.parametrize("operator", ["recolor_texture", "bake_texture"])
@pytest.mark.parametrize("problem", BAD)
def test_bad_input_is_told_in_words_and_changes_nothing(
    operator: str, problem: str, material: bpy.types.Material, tmp_path: Path
) -> None:
    prepare, changes, words = BAD[problem]
    bpy.context.view_layer.objects.active = None
    arguments = {"material": "Flat", "reference": MATTE, "target": TARGET, **prepare(material, tmp_path), **changes}
    counts = len(material.node_tree.nodes), len(bpy.data.images), len(bpy.data.node_groups)
    with pytest.raises(RuntimeError, match=words) as raised:
        getattr(bpy.ops.dyehouse, operator)(**arguments)
    assert "Traceback" not in str(raised.value)
    assert (len(material.node_tree.nodes), len(bpy.data.images), len(bpy.data.node_groups)) == counts


def test_a_linked_material_is_told_in_words(material: bpy.types.Material, tmp_path: Path) -> None:
    texture_of(material, written(tmp_path / "8-bit.png"))
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {material})
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.materials = ["Flat"]
    with pytest.raises(RuntimeError, match="linked from a library"):
        bpy.ops.dyehouse.recolor_texture(material="Flat", reference=MATTE, target=TARGET)
    assert bpy.ops.dyehouse.bake_texture(material="Flat", reference=MATTE, target=TARGET) == {"FINISHED"}


def test_the_first_argument_is_the_material_in_context(material: bpy.types.Material, tmp_path: Path) -> None:
    texture = texture_of(material, written(tmp_path / "8-bit.png"))
    bpy.context.view_layer.objects.active = bpy.data.objects["Plane"]
    assert bpy.ops.dyehouse.recolor_texture() == {"FINISHED"}
    assert nodes.after(texture.outputs["Color"]) is not None


def test_every_space_of_the_core_has_its_name_in_blender(material: bpy.types.Material, tmp_path: Path) -> None:
    image = bpy.data.images.load(str(written(tmp_path / "8-bit.png")))
    for name, key in images.SPACE_NAMES.items():
        image.colorspace_settings.name = name
        assert space_named(textures.space_of(image)) is space_named(key)
