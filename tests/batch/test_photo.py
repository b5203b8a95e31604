"""An opened photo, looked at and recolored, as the front ends do it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from dyehouse.batch import files, photo
from dyehouse.core import transfer
from dyehouse.core.colorspace import SPACES
from dyehouse.core.errors import ImageError, MaskError
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

BLUE, GREEN = parse_target("rgb(0.06,0.14,0.42)"), parse_target("rgb(0.05,0.3,0.1)")
SRGB, LINEAR = SPACES["srgb"], SPACES["linear-srgb"]


def opened(pixels, space=SRGB, **options):
    return files.Photo(Path("photo.png"), pixels, space, **options)


@pytest.fixture
def ball(product):
    scene = product(size=64, noise=0.002)
    scene.codes = transfer.encode(scene.image, transfer.SRGB, np.uint8)
    scene.recipe = Recipe((Region(BLUE, reference=scene.matte, mask=scene.mask),))
    return scene


def test_recolored_again_and_again_from_one_look(ball):
    source = opened(ball.codes.copy())
    prepared = photo.look(source, ball.recipe)
    blue, _ = photo.recolored(source, prepared, "out.png")
    green, _ = photo.recolored(source, prepared, "out.png", [GREEN])
    again, _ = photo.recolored(source, prepared, "out.png", [None])
    np.testing.assert_array_equal(again, blue)
    assert (green != blue).any()
    np.testing.assert_array_equal(source.pixels, ball.codes)
    # A recipe that asks for green from the start gives the same.
    asked = Recipe((Region(GREEN, reference=ball.matte, mask=ball.mask),))
    np.testing.assert_array_equal(photo.recolored(source, photo.look(source, asked), "out.png")[0], green)


def test_reuse_gives_the_same_pixels_in_the_photos_memory(ball):
    for pixels in (ball.codes, np.dstack([ball.codes, ball.codes[..., 0]])):
        kept, spent = opened(pixels.copy()), opened(pixels.copy())
        wanted, _ = photo.recolored(kept, photo.look(kept, ball.recipe), "out.png")
        ours, _ = photo.recolored(spent, photo.look(spent, ball.recipe), "out.png", reuse=True)
        np.testing.assert_array_equal(ours, wanted)
        assert ours is spent.pixels
        np.testing.assert_array_equal(kept.pixels, pixels)
        # Another kind of pixel cannot go into the same memory.
        deep = opened(pixels.copy())
        halves, _ = photo.recolored(deep, photo.look(deep, ball.recipe), "out.exr", reuse=True)
        assert halves.dtype == np.float16
        np.testing.assert_array_equal(deep.pixels, pixels)


def test_threads_do_not_matter(ball):
    source = opened(np.tile(ball.codes, (10, 10, 1)))
    prepared = photo.look(source, Recipe((Region(BLUE, reference=ball.matte),)))
    one, count = photo.recolored(source, prepared, "out.png", threads=1)
    two, shares = photo.recolored(source, prepared, "out.png", threads=2)
    np.testing.assert_array_equal(one, two)
    assert count == shares


def test_mask_files_are_found_beside_the_recipe(ball, tmp_path, monkeypatch):
    Image.fromarray((ball.mask * 255).astype(np.uint8)).save(tmp_path / "ball mask.png")
    recipe = Recipe((Region(BLUE, mask="ball mask.png"),))
    prepared = photo.look(opened(ball.codes), recipe, base=tmp_path)
    np.testing.assert_array_equal(prepared.analyses[0].mask > 0, ball.mask > 0)
    monkeypatch.chdir(tmp_path)
    np.testing.assert_array_equal(photo.look(opened(ball.codes), recipe).analyses[0].mask > 0, ball.mask > 0)
    with pytest.raises(MaskError, match="make it the size of the photo"):
        photo.look(opened(ball.codes[:50]), recipe)


def test_white_of_the_photo_is_used_unless_the_recipe_gives_one(ball):
    source = opened(ball.codes, white=(0.9, 1.0, 0.7))
    np.testing.assert_array_equal(photo.look(source, ball.recipe).white, [0.9, 1.0, 0.7])
    asked = Recipe(ball.recipe.regions, white=(1.1, 1.0, 0.9))
    np.testing.assert_array_equal(photo.look(source, asked).white, [1.1, 1.0, 0.9])


def soft_alpha():
    return np.broadcast_to(np.clip(np.linspace(-0.1, 1.2, 64), 0, 1)[None, :], (64, 64)).astype(np.float32)


def test_straight_codes_to_premultiplied_exr(ball):
    alpha = np.round(soft_alpha() * 255).astype(np.uint8)
    source = opened(np.dstack([ball.codes, alpha]))
    out, _ = photo.recolored(source, photo.look(source, ball.recipe), "out.exr")
    assert out.shape == (64, 64, 4)
    np.testing.assert_allclose(out[..., 3], alpha / 255, atol=1e-3)
    straight, _ = photo.recolored(opened(ball.codes), photo.look(opened(ball.codes), ball.recipe), "out.exr")
    wanted = straight.astype(np.float32) * (alpha[..., None] / 255)
    np.testing.assert_allclose(out[..., :3], wanted, atol=2e-3)


def test_premultiplied_floats_to_straight_codes(ball):
    alpha = soft_alpha()
    pixels = np.dstack([ball.image * alpha[..., None], alpha]).astype(np.float32)
    source = opened(pixels, LINEAR, premultiplied=True)
    recipe = Recipe((Region(BLUE, reference=tuple(ball.body), residual="drop"),))
    out, _ = photo.recolored(source, photo.look(source, recipe), "out.png")
    assert out.dtype == np.uint16
    np.testing.assert_allclose(out[..., 3] / 65535, alpha, atol=1e-5)
    plain = opened(ball.image, LINEAR)
    straight, _ = photo.recolored(plain, photo.look(plain, recipe), "out.png")
    shows = alpha > 0.05
    assert np.abs(out[..., :3].astype(int) - straight)[shows].max() <= 2
    assert (out[..., :3][alpha == 0] == 0).all()
    np.testing.assert_array_equal(source.pixels, pixels)


def test_premultiplied_floats_stay_so_in_exr(ball):
    alpha = soft_alpha()
    pixels = np.dstack([ball.image * alpha[..., None], alpha]).astype(np.float32)
    source = opened(pixels, LINEAR, premultiplied=True)
    recipe = Recipe((Region(BLUE, reference=tuple(ball.body), residual="drop"),))
    out, _ = photo.recolored(source, photo.look(source, recipe), "out.exr")
    np.testing.assert_array_equal(out[..., 3], alpha)
    plain = opened(ball.image, LINEAR)
    straight, _ = photo.recolored(plain, photo.look(plain, recipe), "out.exr")
    np.testing.assert_allclose(out[..., :3], straight * alpha[..., None], atol=1e-5)


def test_soft_edge_of_a_premultiplied_photo_to_straight_codes():
    # Light of a red product over a green ground, all behind one half-transparent alpha: dividing first or last is one.
    cover = np.clip(np.linspace(-1, 2, 60), 0, 1)[None, :, None] * np.ones((20, 1, 1))
    body, ground = np.array([0.5, 0.1, 0.05]), np.array([0.1, 0.5, 0.2])
    straight = cover * body + (1 - cover) * ground
    pixels = np.concatenate([straight * 0.5, np.full((20, 60, 1), 0.5)], axis=2).astype(np.float32)
    recipe = Recipe((Region(BLUE, reference=tuple(body), mask=cover[..., 0]),))
    half = opened(pixels, LINEAR, premultiplied=True)
    out, _ = photo.recolored(half, photo.look(half, recipe), "out.png")
    plain = opened(straight.astype(np.float32), LINEAR)
    wanted, _ = photo.recolored(plain, photo.look(plain, recipe), "out.png")
    assert np.abs(out[..., :3].astype(int) - wanted).max() <= 60


# --- into a file ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", ["png", "jpg", "tif", "exr", "webp"])
@pytest.mark.parametrize("kind", ["8 bits", "16 bits", "floats"])
@pytest.mark.parametrize("alpha", [False, True])
def test_saved_files_are_those_of_the_whole_pixels(ball, tmp_path, extension, kind, alpha):
    if kind == "floats":
        pixels, space = np.tile(ball.image, (8, 8, 1)), LINEAR
    else:
        dtype = np.uint8 if kind == "8 bits" else np.uint16
        pixels, space = transfer.encode(np.tile(ball.image, (8, 8, 1)), transfer.SRGB, dtype), SRGB
    if alpha:
        top = 1 if kind == "floats" else np.iinfo(pixels.dtype).max
        cover = np.full(pixels.shape[:2], top, pixels.dtype)
        if extension != "jpg":  # which holds no transparency
            cover[:200] = top // 2 if top > 1 else 0.5
        pixels = np.dstack([pixels, cover])
    recipe = Recipe((Region(BLUE, reference=tuple(ball.body), mask=np.tile(ball.mask, (8, 8))),))
    source = opened(pixels.copy(), space)
    prepared = photo.look(source, recipe)
    whole, shares = tmp_path / f"whole.{extension}", tmp_path / f"saved.{extension}"
    out, counted = photo.recolored(source, prepared, whole)
    files.write(whole, out, source)
    for options in ({"threads": 1}, {"threads": 2, "reuse": True}):
        written, shares = photo.save(source, prepared, tmp_path / f"saved.{extension}", force=True, **options)
        assert shares == counted
        assert written == tmp_path / f"saved.{extension}"
        np.testing.assert_array_equal(files.read(written).pixels, files.read(whole).pixels)
        assert sorted(p.name for p in tmp_path.iterdir()) == [f"saved.{extension}", f"whole.{extension}"]


@pytest.mark.parametrize("extension", ["png", "jpg", "tif", "exr", "webp"])
def test_when_a_bad_pixel_turns_up_while_writing_nothing_is_left(ball, tmp_path, extension):
    # The reader refuses such files; this is memory gone bad, or a caller's own array.
    image = np.tile(ball.image, (20, 10, 1))
    image[-1, -1, 0] = np.nan
    source = opened(image, LINEAR)
    prepared = photo.look(source, Recipe((Region(BLUE, reference=tuple(ball.body)),)))
    out = tmp_path / f"out.{extension}"
    with pytest.raises(ImageError, match="NaN or infinite"):
        photo.save(source, prepared, out)
    assert list(tmp_path.iterdir()) == []
    out.write_bytes(b"precious")
    with pytest.raises(ImageError, match="NaN or infinite"):
        photo.save(source, prepared, out, force=True)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"precious"]


# --- alpha and coverage in another type -------------------------------------------------------------------------


@settings(deadline=None, max_examples=60)
@given(arrays(st.sampled_from([np.uint8, np.uint16]), (5, 4), elements=st.integers(0, 255)))
def test_integers_survive_the_way_through_floats(values):
    for between in (np.float32, np.float64) + ((np.float16,) if values.dtype == np.uint8 else ()):
        np.testing.assert_array_equal(photo.converted(photo.converted(values, between), values.dtype), values)
    assert photo.converted(values, values.dtype) is values


def test_converted_rounds_and_clips():
    np.testing.assert_array_equal(
        photo.converted(np.array([-0.5, 0.0, 0.5, 1.0, 7.0]), np.uint8), [0, 0, 128, 255, 255]
    )
    np.testing.assert_array_equal(photo.converted(np.arange(256, dtype=np.uint8), np.uint16), np.arange(256) * 257)
    np.testing.assert_array_equal(photo.converted((np.arange(256) * 257).astype(np.uint16), np.uint8), np.arange(256))
    assert photo.converted(np.array([255], np.uint8), np.float32)[0] == 1


def test_half_alpha_becomes_whole_codes() -> None:
    alpha = np.array([0, 0.25, 0.5, 1], np.float16)
    assert photo.converted(alpha, np.uint16).tolist() == [0, 16384, 32768, 65535]
    assert photo.converted(alpha, np.uint8).tolist() == [0, 64, 128, 255]
