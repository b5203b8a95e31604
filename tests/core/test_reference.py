"""The matte reference and the white, found in scenes whose truth is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dyehouse.core import reference as r
from dyehouse.core import transfer
from dyehouse.core.colorspace import SPACES, SRGB
from dyehouse.core.errors import ReferenceColorError, WhiteError
from dyehouse.core.picture import Picture
from dyehouse.core.recipe import light_colors

BODIES = [(0.42, 0.09, 0.05), (0.05, 0.12, 0.45), (0.08, 0.35, 0.1), (0.6, 0.42, 0.05), (0.3, 0.12, 0.33)]


def angle(a, b):
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1)))


# --- the matte reference --------------------------------------------------------------------------------------


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("white", [(1, 1, 1), (1.1, 1.0, 0.6)])
@pytest.mark.parametrize("spoiled", ["clean", "noisy", "clipped"])
def test_matte_reference_in_a_glossy_shaded_scene(product, body, white, spoiled):
    scene = product(np.array(body) * white, white, noise=0.005 if spoiled == "noisy" else 0.0, size=160)
    image = scene.image
    if spoiled == "clipped":  # one pixel in a hundred
        image = np.minimum(image / np.quantile(image[scene.mask == 1].max(axis=1), 0.99), 1).astype(np.float32)
        scene.body = scene.body / np.quantile(scene.image[scene.mask == 1].max(axis=1), 0.99)
    found = r.matte_reference(Picture(image), scene.white, scene.mask)
    assert found.pixel is None
    # 1 % of the white in this body color would turn it by more than this.
    assert angle(found.color / white, scene.body / white) < (1.0 if spoiled == "noisy" else 0.4)
    # As bright as a well lit part, and no brighter than the brightest matte one.
    scale = np.linalg.norm(found.color) / np.linalg.norm(scene.body)
    assert 0.4 < scale < 1.05


def test_matte_reference_needs_no_mask(product):
    scene = product(ground=0.02)
    found = r.matte_reference(Picture(scene.image), scene.white)
    assert angle(found.color, scene.body) < 1


def test_matte_reference_is_not_led_astray_by_dirt_and_neighbors(product):
    scene = product(size=128, noise=0.003)
    rng = np.random.default_rng(0)
    rows, columns = np.nonzero(scene.mask)
    bad = rng.choice(len(rows), len(rows) // 25, replace=False)
    scene.image[rows[bad], columns[bad]] = rng.uniform(0, 1, (len(bad), 3))
    scene.mask[:, :14] = 1  # a sloppy mask: some of the grey ground too
    found = r.matte_reference(Picture(scene.image), scene.white, scene.mask)
    assert angle(found.color, scene.body) < 1.2


def test_matte_reference_scales_with_exposure(product):
    scene = product(noise=0)
    one, half = (r.matte_reference(Picture(k * scene.image), scene.white, scene.mask).color for k in (1, 0.5))
    np.testing.assert_allclose(half, one / 2, rtol=1e-5)


def test_matte_reference_from_8_bit_codes(product):
    scene = product(noise=0.002)
    codes = transfer.encode(scene.image, transfer.SRGB, np.uint8)
    found = r.matte_reference(Picture(codes, transfer.SRGB), scene.white, scene.mask)
    assert angle(found.color, scene.body) < 1


def test_no_reference_in_black_or_clipped_pictures(product):
    with pytest.raises(ReferenceColorError, match="black everywhere"):
        r.matte_reference(Picture(np.zeros((20, 20, 3), np.float32)), np.ones(3))
    with pytest.raises(ReferenceColorError, match="is clipped"):
        r.matte_reference(Picture(np.full((20, 20, 3), 255, np.uint8), transfer.SRGB), np.ones(3))
    scene = product()
    scene.image[scene.mask == 1] = 0  # black where it counts
    with pytest.raises(ReferenceColorError, match="black everywhere"):
        r.matte_reference(Picture(scene.image), np.ones(3), scene.mask)


# --- a clicked reference --------------------------------------------------------------------------------------


@pytest.mark.parametrize("masked", [True, False])
@pytest.mark.parametrize("share", [0.02, 0.08, 0.2, 0.4])
def test_gloss_under_a_click_is_found_and_left_out(product, share, masked):
    scene = product(size=200, noise=0.001, white=(1.1, 1.0, 0.6))
    off = np.where(scene.mask == 1, np.abs(scene.gloss - share), np.inf)
    y, x = np.unravel_index(np.argmin(off), off.shape)
    mask = scene.mask if masked else None
    read, found = (f(Picture(scene.image), (int(x), int(y)), scene.white, mask) for f in (r.reference_at, r.matte_at))
    assert read.pixel == found.pixel == (x, y)
    assert read.gloss == 0
    assert found.gloss == pytest.approx(share, abs=0.1 * share + 0.004)
    np.testing.assert_allclose(found.color, read.color - found.gloss * scene.white)
    assert angle(found.color, scene.body) < 1.5


def test_a_matte_click_is_taken_as_it_is_read(product):
    scene = product(size=200, noise=0.001)
    read, found = (f(Picture(scene.image), scene.matte, scene.white, scene.mask) for f in (r.reference_at, r.matte_at))
    assert found.gloss == 0
    np.testing.assert_array_equal(found.color, read.color)


def test_a_click_on_another_color_than_most_of_the_product_is_seen():
    rng = np.random.default_rng(0)
    body, label = np.array([0.5, 0.2, 0.15]), np.array([0.5, 0.16, 0.09])
    image = rng.uniform(0.5, 1, (80, 80, 1)) * body
    image[10:20, 10:70] = rng.uniform(0.5, 1, (10, 60, 1)) * label
    mask = np.ones((80, 80))
    clicks = [r.matte_at(Picture(image.astype(np.float32)), at, np.ones(3), mask) for at in ((40, 60), (40, 15))]
    own, other = (r.stray(click, np.ones(3), matte=False) for click in clicks)
    assert own < 0.5
    assert other > 3
    assert r.stray(r.Reference(body), np.ones(3), matte=False) == 0  # a color that was not clicked


def test_gloss_under_a_click_does_not_depend_on_exposure(product):
    scene = product(size=128)
    y, x = np.unravel_index(np.argmin(np.where(scene.mask == 1, np.abs(scene.gloss - 0.01), 9)), scene.mask.shape)
    one, four = (r.matte_at(Picture(k * scene.image), (x, y), scene.white, scene.mask) for k in (1, 4))
    np.testing.assert_allclose(four.color, 4 * one.color, rtol=1e-5)


@pytest.mark.parametrize("noise", [0.02, 0.06, 0.15])
def test_gloss_that_noise_makes_is_left_in_the_reference(product, noise):
    scene = product(size=200, noise=noise)
    rows, columns = np.nonzero((scene.mask == 1) & (scene.gloss < 0.002) & (scene.image.mean(axis=2) > 0.1))
    chosen = np.random.default_rng(0).choice(len(rows), 40, replace=False)
    clicks = [(int(columns[k]), int(rows[k])) for k in chosen]
    read, found = (
        np.mean([angle(f(Picture(scene.image), click, scene.white, scene.mask).color, scene.body) for click in clicks])
        for f in (r.reference_at, r.matte_at)
    )
    assert found < 1.1 * read


def test_grain_of_a_cloth_is_not_its_matte_edge():
    # Yarns of more and less gloss: the reference is their mean, as a window reads it, and not the most matte yarn.
    rng = np.random.default_rng(0)
    body, size = np.array(BODIES[0]), 120
    gloss = rng.uniform(0, 0.02, (size, size, 1))
    image = (rng.uniform(0.7, 1, (size, size, 1)) * body + gloss).astype(np.float32)
    found = r.matte_reference(Picture(image), np.ones(3)).color
    a, b = np.linalg.pinv(np.column_stack([body, np.ones(3)])) @ found
    assert b / a == pytest.approx(0.01 / 0.85, abs=0.004)


def test_window_is_kept_inside_picture_and_mask():
    image = np.zeros((10, 10, 3), np.float32)
    image[:, :5], image[:, 5:] = [0.5, 0.1, 0.1], [0.1, 0.1, 0.5]
    mask = np.zeros((10, 10))
    mask[:, :5] = 1
    picture = Picture(image)
    np.testing.assert_allclose(r.reference_at(picture, (4, 0), np.ones(3), mask).color, [0.5, 0.1, 0.1], atol=1e-6)
    np.testing.assert_allclose(r.reference_at(picture, (0, 9), np.ones(3)).color, [0.5, 0.1, 0.1], atol=1e-6)
    np.testing.assert_allclose(r.reference_at(picture, (9, 0), np.ones(3)).color, [0.1, 0.1, 0.5], atol=1e-6)
    assert len(r.read_window(picture, (0, 0))) == 4
    assert len(r.read_window(picture, (5, 5))) == 9


def test_window_grows_with_the_picture():
    radii = [r.window_radius(shape) for shape in ((1, 1), (500, 500), (2000, 1500), (4000, 6000), (9000, 9000))]
    assert radii[0] == 1
    assert radii[3] == radii[4] == 6
    assert radii == sorted(radii)


# --- trimmed mean ---------------------------------------------------------------------------------------------


def test_trimmed_mean_by_hand():
    # Median (0, 0, 0); of ten pixels the six nearest are those of -0.1..0.1.
    values = np.array([-9, -5, -0.1, -0.05, 0, 0, 0.05, 0.1, 4, 8.0])
    pixels = np.column_stack([values, np.zeros(10), np.zeros(10)])
    np.testing.assert_allclose(r.trimmed_mean(pixels), [0, 0, 0], atol=1e-12)
    pixels[5:8, 1] = 0.06
    np.testing.assert_allclose(r.trimmed_mean(pixels)[1], 0.06 * 3 / 6, atol=1e-12)
    np.testing.assert_allclose(r.trimmed_mean(np.array([[1, 2, 3.0]])), [1, 2, 3])


@settings(deadline=None, max_examples=60)
@given(arrays(float, st.tuples(st.integers(1, 30), st.just(3)), elements=st.floats(-2, 2)), st.integers(0, 99))
def test_trimmed_mean_stays_among_the_pixels_and_ignores_specks(pixels, seed):
    mean = r.trimmed_mean(pixels)
    assert (mean >= pixels.min(axis=0) - 1e-12).all()
    assert (mean <= pixels.max(axis=0) + 1e-12).all()
    shifted = r.trimmed_mean(pixels + np.array([1, 2, 3]))
    assert np.isfinite(shifted).all()
    specks = np.vstack([np.full((20, 3), 0.5), np.random.default_rng(seed).uniform(-50, 50, (5, 3))])
    np.testing.assert_allclose(r.trimmed_mean(specks), 0.5, atol=1e-12)


def test_steady_mean_by_hand():
    # Median (0, 0, 0); half of the distances are up to 0.1: up to 0.8 of that they count in full, at twice it no more.
    values = np.array([-9, -5, -0.1, -0.1, -0.01, 0, 0.01, 0.1, 0.1, 4, 8.0])
    pixels = np.column_stack([values, np.zeros(11), np.zeros(11)])
    np.testing.assert_allclose(r.steady_mean(pixels), [0, 0, 0], atol=1e-12)
    pixels[4:7, 1] = 0.06
    near = 2 - 0.1 / (0.8 * 0.1)
    np.testing.assert_allclose(r.steady_mean(pixels)[1], 0.06 * 3 / (3 + 4 * near), rtol=1e-6)
    np.testing.assert_allclose(r.steady_mean(np.array([[1, 2, 3.0]])), [1, 2, 3])


def test_texture_is_read_alike_in_two_colors():
    # Yarn of different brightness with gloss between: the same pixels must count in both photos.
    rng = np.random.default_rng(0)
    shading, gloss = rng.uniform(0.6, 1, (200, 9, 1)), rng.uniform(0, 0.02, (200, 9, 1))
    bodies = np.array([0.04, 0.05, 0.31]), np.array([0.43, 0.04, 0.05])
    read = [np.array([r.steady_mean(window) for window in shading * body + gloss]) for body in bodies]
    terms = [np.linalg.pinv(np.column_stack([body, np.ones(3)])) for body in bodies]
    found = [colors @ split.T for colors, split in zip(read, terms, strict=True)]
    assert np.abs(found[0] - found[1])[:, 0].mean() < 0.01


# --- the white ------------------------------------------------------------------------------------------------


def card(color=(0.7, 0.65, 0.5)):
    image = np.full((30, 40, 3), 0.1, np.float32)
    image[5:15, 5:20] = color
    return Picture(image)


def test_white_at():
    np.testing.assert_allclose(r.white_at(card(), (10, 10)), (0.7, 0.65, 0.5), atol=1e-6)


def test_white_at_a_grey_card():
    light = np.array([1.1, 1.0, 0.6])
    np.testing.assert_allclose(r.white_at(card(0.18 * light), (10, 10), 0.18), light, rtol=1e-5)


@pytest.mark.parametrize("where", [(-1, 3), (40, 3), (3, 30)])
def test_white_outside(where):
    with pytest.raises(ReferenceColorError, match=r"White pixel .* lies outside the picture of 40 x 30"):
        r.white_at(card(), where)


@pytest.mark.parametrize("color", [(0, 0, 0), (0.5, 0.4, 0), (0.5, -0.1, 0.4)])
def test_white_that_is_black_in_a_channel(color):
    with pytest.raises(WhiteError, match="black in a channel"):
        r.white_at(card(color), (10, 10))


def test_white_that_is_clipped():
    codes = np.full((30, 40, 3), 90, np.uint8)
    codes[5:15, 5:20] = [255, 250, 200]
    with pytest.raises(WhiteError, match="clipped"):
        r.white_at(Picture(codes, transfer.SRGB), (10, 10))


def test_white_that_is_not_finite():
    with pytest.raises(WhiteError, match="finite"):
        r.white_at(card((np.nan, 0.5, 0.5)), (10, 10))


LIGHTS = light_colors(SRGB)


def test_light_colors_are_lights():
    np.testing.assert_allclose(LIGHTS @ SRGB.to_xyz[1], 1, atol=1e-9)
    assert (LIGHTS > 0).all()
    # From bluish to reddish.
    assert LIGHTS[0, 0] < 0.8 < 1.2 < LIGHTS[0, 2]
    assert LIGHTS[-1, 2] < 0.3 < 1.5 < LIGHTS[-1, 0]
    # D65, the white of sRGB, is among them.
    assert min(angle(light, (1, 1, 1)) for light in LIGHTS) < 0.6


@pytest.mark.parametrize("share", [0.1, 0.35, 0.6, 0.9])
@pytest.mark.parametrize("body", [(0.08, 0.35, 0.1), (0.3, 0.1, 0.3)])
def test_white_from_highlights(product, body, share):
    light = LIGHTS[int(share * (len(LIGHTS) - 1))]
    # Off the locus of lights, so that the plane of body and light cuts it steeply.
    scene = product(np.array(body) * light, light, size=200, noise=0.001)
    found, confidence = r.white_from_highlights(Picture(scene.image), LIGHTS, scene.mask)
    assert angle(found, light) < 2.5
    assert found @ SRGB.to_xyz[1] == pytest.approx(1, abs=1e-6)
    assert 0.3 < confidence <= 1


def test_confidence_is_low_where_the_plane_runs_along_the_lights(product):
    light = LIGHTS[len(LIGHTS) // 2]
    sure, unsure = (
        r.white_from_highlights(
            Picture((scene := product(np.array(body) * light, light, size=200, noise=0.001)).image), LIGHTS, scene.mask
        )[1]
        for body in ((0.08, 0.35, 0.1), (0.45, 0.2, 0.04))  # green; orange, on the way from blue to red lights
    )
    assert sure > unsure


@pytest.mark.parametrize("space", ["acescg", "prophoto"])
def test_white_from_highlights_in_other_spaces(product, space):
    lights = light_colors(SPACES[space])
    light = lights[len(lights) // 3]
    scene = product(np.array((0.08, 0.35, 0.1)) * light, light, size=200, noise=0.001)
    found, _ = r.white_from_highlights(Picture(scene.image), lights, scene.mask)
    assert angle(found, light) < 2.5


def test_no_highlights_to_find_a_white_from(product):
    dull = product(gloss=0, noise=0.002, size=160)
    with pytest.raises(WhiteError, match="no highlights"):
        r.white_from_highlights(Picture(dull.image), LIGHTS, dull.mask)
    with pytest.raises(WhiteError, match="too few"):
        r.white_from_highlights(Picture(np.zeros((30, 30, 3), np.float32)), LIGHTS)
    with pytest.raises(WhiteError, match="too few"):
        r.white_from_highlights(Picture(np.full((30, 30, 3), 255, np.uint8), transfer.SRGB), LIGHTS)


def test_highlights_of_no_light(product):
    # Green gloss on blue: no light lies in a plane of blues and greens.
    scene = product((0.05, 0.1, 0.5), (0.2, 1.4, 0.3), size=160, noise=0.001)
    with pytest.raises(WhiteError, match="do not point to the color of any usual light"):
        r.white_from_highlights(Picture(scene.image), LIGHTS, scene.mask)
