"""The preview's shader, off screen, against the core; and what the preview makes ready in its thread."""

import time
from dataclasses import replace
from pathlib import Path

import bpy
import gpu
import numpy as np
import pytest

from dyehouse.addon import background, drawing, preview, session
from dyehouse.batch import files
from dyehouse.core import colorspace, gamut, transfer
from dyehouse.core.compositing import Edge
from dyehouse.core.layers import Layers, take_apart
from dyehouse.core.picture import Picture
from dyehouse.core.recolor import RegionMatrix, recolor

pytestmark = pytest.mark.usefixtures("blender")
WHOLE = preview.Painting((2, 2, -1, -1), nearest=True)


@pytest.fixture(scope="module")
def graphics() -> None:
    try:
        gpu.init()
    except SystemError as error:
        pytest.skip(f"THE SHADER IS NOT TESTED: there is no OpenGL here, not even in software ({error})")


def painted(
    layers: Layers,
    regions: list[RegionMatrix],
    display: preview.Display | None = None,
    painting: preview.Painting = WHOLE,
) -> np.ndarray:
    """(height, width, 4) linear RGB and alpha as the shader makes them, one pixel for each of the layers'."""
    left, top, right, bottom = layers.box
    height, width = layers.data.shape[1:3]
    display, texture = display or preview.Display(np.eye(3)), drawing.texture(layers.data)
    target = gpu.types.GPUOffScreen(width, height, format="RGBA32F")
    with target.bind():
        size = (right - left, bottom - top)
        preview.paint(replace(layers, box=(0, 0, *size)), texture, size, layers.weights(regions), display, painting)
        buffer = gpu.state.active_framebuffer_get().read_color(0, 0, width, height, 4, 0, "FLOAT")
    target.free()
    buffer.dimensions = height * width * 4
    return np.array(buffer, np.float32).reshape(height, width, 4)[::-1]


def regions_on(picture: Picture, count: int, corrections: int = 0) -> list[RegionMatrix]:
    """Overlapping disks with soft edges, random matrices and corrections."""
    random, (height, width) = np.random.default_rng(count), picture.shape
    y, x = np.mgrid[:height, :width]
    found = []
    for k in range(count):
        distance = np.hypot(y - height / 2, x - (k + 1) * width / (count + 1))
        mask = np.clip((height / 2.2 - distance) / 3, 0, 1).astype(np.float32)
        extra = random.normal(0, 0.05, (height, width, corrections)).astype(np.float32) if corrections else None
        matrix = np.hstack([random.uniform(-0.4, 1.5, (3, 3)), random.normal(0, 1, (3, corrections))])
        rows, columns = np.nonzero((mask > 0) & (mask < 1))
        share = picture.at(rows, columns) * random.uniform(0, 1, (len(rows), 3)).astype(np.float32)
        found.append(RegionMatrix(matrix, mask, Edge(rows, columns, share), extra))
    return found


@pytest.mark.parametrize(("count", "corrections"), [(0, 0), (1, 0), (3, 0), (2, 1), (2, 6)])
def test_the_shader_makes_what_the_core_makes(graphics: None, count: int, corrections: int) -> None:
    picture = Picture(np.random.default_rng(0).random((90, 151, 3), dtype=np.float32))
    regions = regions_on(picture, count, corrections)
    expected = recolor(picture, regions)[0]
    got = painted(take_apart(picture, regions), regions)
    np.testing.assert_allclose(got[..., :3], expected, atol=1e-4)
    assert count == 0 or np.abs(expected - picture.pixels).max() > 0.1


def test_a_plain_region_is_the_whole_picture(graphics: None) -> None:
    picture = Picture(np.random.default_rng(1).random((30, 50, 3), dtype=np.float32))
    regions = [RegionMatrix(np.random.default_rng(2).normal(0, 1, (3, 3)))]
    got = painted(take_apart(picture, regions), regions)
    np.testing.assert_allclose(got[..., :3], recolor(picture, regions)[0], atol=1e-4)


def test_colors_are_brought_into_gamut_as_for_integers(graphics: None) -> None:
    picture = Picture(np.random.default_rng(0).random((90, 151, 3), dtype=np.float32))
    regions = regions_on(picture, 3)
    expected = recolor(picture, regions)[0].reshape(-1, 3)
    assert gamut.fit_to_gamut(expected) > 1000
    got = painted(take_apart(picture, regions), regions, preview.Display(np.eye(3), fitted=True))
    np.testing.assert_allclose(got[..., :3].reshape(-1, 3), expected, atol=1e-4)


def test_blocks_of_pixels_are_averaged(graphics: None) -> None:
    picture = Picture(np.random.default_rng(0).random((90, 150, 3), dtype=np.float32))
    regions = regions_on(picture, 2)
    got = painted(take_apart(picture, regions, step=3), regions)
    expected = recolor(picture, regions)[0].reshape(30, 3, 50, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(got[..., :3], expected, atol=1e-4)


def test_split(graphics: None) -> None:
    picture = Picture(np.random.default_rng(0).random((20, 60, 3), dtype=np.float32))
    regions = [RegionMatrix(np.diag([0.1, 0.5, 0.9]))]
    got = painted(take_apart(picture, regions), regions, painting=replace(WHOLE, split=1 / 3))
    np.testing.assert_allclose(got[:, :20, :3], picture.pixels[:, :20], atol=1e-6)
    np.testing.assert_allclose(got[:, 20:, :3], recolor(picture, regions)[0][:, 20:], atol=1e-6)


def test_alpha(graphics: None) -> None:
    random = np.random.default_rng(0)
    picture, alpha = Picture(random.random((20, 30, 3), dtype=np.float32)), random.random((20, 30), dtype=np.float32)
    layers = take_apart(picture, [], alpha=alpha)
    straight = preview.Display(np.eye(3), straight=True)
    multiplied = picture.pixels * alpha[..., None]
    np.testing.assert_allclose(painted(layers, [], straight), np.dstack([multiplied, alpha]), atol=1e-6)
    opaque = painted(layers, [], straight, replace(WHOLE, opaque=True))
    np.testing.assert_allclose(opaque, np.dstack([multiplied, np.ones_like(alpha)]), atol=1e-6)
    associated = painted(layers, [])
    np.testing.assert_allclose(associated, np.dstack([picture.pixels, alpha]), atol=1e-6)


def saved(path: Path, pixels: np.ndarray, space: colorspace.RGBSpace) -> bpy.types.Image:
    files.write(path, pixels, files.Photo(path, pixels, space))
    return bpy.data.images.load(str(path))


@pytest.mark.parametrize("blenders", ["sRGB", "Display P3", "Non-Color", "Linear Rec.2020"])
def test_codes_are_shown_as_blender_reads_them(graphics: None, tmp_path: Path, blenders: str) -> None:
    """A photo of Adobe RGB that Blender takes for something else looks as wrong as it does without the preview."""
    codes = np.random.default_rng(3).integers(0, 256, (20, 30, 3), np.uint8)
    image = saved(tmp_path / "photo.png", codes, colorspace.SPACES["adobe-rgb"])
    image.colorspace_settings.name = blenders
    image.dyehouse.color_space = "adobe-rgb"
    photo = session.photo_of(image)
    assert photo.space.curve == transfer.ADOBE_RGB
    read = {
        "sRGB": colorspace.SRGB,
        "Display P3": colorspace.SPACES["display-p3"],
        "Non-Color": colorspace.LINEAR_SRGB,
        "Linear Rec.2020": colorspace.SPACES["linear-rec2020"],
    }[blenders]
    picture = Picture(photo.pixels, photo.space.curve)
    got = painted(take_apart(picture, []), [], preview.display_of(image, photo))[..., :3]
    # All of white D65: no adaptation.
    expected = read.curve.decode(codes / 255) @ (colorspace.SRGB.from_xyz @ read.to_xyz).T
    difference = np.abs(transfer.SRGB.encode(got) - transfer.SRGB.encode(expected)) * 255
    assert difference.max() < 0.3


def test_the_display_is_in_the_working_space(tmp_path: Path) -> None:
    image = saved(tmp_path / "photo.png", np.full((4, 4, 3), 99, np.uint8), colorspace.SRGB)
    photo = session.photo_of(image)
    np.testing.assert_allclose(preview.display_of(image, photo).matrix, np.eye(3), atol=1e-9)
    assert bpy.ops.wm.set_working_color_space(working_space="ACEScg") == {"FINISHED"}
    # Rec.709 to ACEScg by Bradford; Academy TB-2014-004 with the white of D60 adapted.
    expected = [[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0135], [0.0206, 0.1096, 0.8698]]
    image = bpy.data.images[image.name]
    np.testing.assert_allclose(preview.display_of(image, photo).matrix, expected, atol=2e-4)


# --- what is made ready ---


def settle(image: bpy.types.Image) -> preview.Shown:
    """What is shown of an image in the end."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        now, note = preview.shown(image)
        if not background.busy():
            now, note = preview.shown(image)
            if not background.busy():
                break
        time.sleep(0.01)
    assert note == ""
    assert now is not None
    return now


@pytest.fixture
def photo(coffee_file: Path) -> bpy.types.Image:
    image = bpy.data.images.load(str(coffee_file))
    region = image.dyehouse.regions.add()
    region.click, region.target.color = (150, 220), (0.02, 0.1, 0.3)
    image.dyehouse.preview = True
    return image


def test_a_real_photo(graphics: None, photo: bpy.types.Image) -> None:
    now = settle(photo)
    regions = now.look.prepared.regions()
    expected = recolor(now.look.prepared.analyses[0].picture, regions)[0]
    np.testing.assert_allclose(painted(now.whole, regions)[..., :3], expected, atol=1e-4)


def test_it_is_made_in_a_thread(photo: bpy.types.Image) -> None:
    now, note = preview.shown(photo)
    assert now is None
    assert note == "Analyzing..."
    assert background.busy()
    settle(photo)


def test_a_new_target_makes_nothing_anew(photo: bpy.types.Image) -> None:
    before = settle(photo)
    matrix = before.look.prepared.regions()[0].matrix
    photo.dyehouse.regions[0].target.color = (0.5, 0.02, 0.02)
    after, note = preview.shown(photo)
    assert note == ""
    assert after is not None
    assert after.whole is before.whole
    assert np.abs(after.look.prepared.regions()[0].matrix - matrix).max() > 0.1
    assert not background.busy()


def test_the_last_is_shown_until_the_next_is_ready(photo: bpy.types.Image) -> None:
    before = settle(photo)
    photo.dyehouse.regions[0].tolerance = 2
    meanwhile, note = preview.shown(photo)
    assert meanwhile is not None
    assert meanwhile.whole is before.whole
    assert note == "Analyzing..."
    assert settle(photo).whole is not before.whole


def test_what_is_wrong_is_said(photo: bpy.types.Image) -> None:
    photo.dyehouse.regions[0].click = (5000, 5000)
    preview.shown(photo)
    while background.busy():
        time.sleep(0.01)
    now, note = preview.shown(photo)
    assert now is None
    assert "(5000, 5000) lies outside the picture" in note
    photo.dyehouse.regions[0].click = (150, 220)
    settle(photo)


def test_an_image_without_a_region_is_refused_in_words() -> None:
    image = bpy.data.images.new("made", 20, 10)
    preview.shown(image)
    while background.busy():
        time.sleep(0.01)
    now, note = preview.shown(image)
    assert now is None
    assert "no region" in note


def test_large_photos_are_made_small(tmp_path: Path) -> None:
    codes = np.zeros((1600, 2500, 3), np.uint8)
    codes[...] = np.random.default_rng(0).integers(60, 200, (1600, 1, 3), np.uint8)
    image = saved(tmp_path / "large.png", codes, colorspace.SRGB)
    image.dyehouse.regions.add().mask_source = "WHOLE"
    now = settle(image)
    assert now.whole.step == 2
    assert now.whole.data.shape[1:3] == (800, 1250)
