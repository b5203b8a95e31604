"""analyze(): its arguments, its choice of model, its maps and what it says about bad input."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import DyehouseError, Picture, analyze, transfer
from dyehouse.core.errors import ImageError, MaskError, ReferenceColorError, WhiteError
from dyehouse.core.neighborhood import erode

TARGET = np.array([0.05, 0.12, 0.4])


def angle(a, b):
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1)))


# --- reference, white, mask in every form ---------------------------------------------------------------------


@pytest.mark.parametrize("form", [tuple, list, np.array, lambda p: np.array(p, float), lambda p: (p[0] + 0.4, p[1])])
def test_reference_as_a_pixel(product, form):
    scene = product()
    analysis = analyze(scene.image, scene.white, form(scene.matte), scene.mask)
    assert analysis.pixel == scene.matte
    x, y = scene.matte
    np.testing.assert_allclose(analysis.reference, scene.shading[y, x] * scene.body, atol=0.01)


@pytest.mark.parametrize("form", [tuple, list, np.array])
def test_reference_as_rgb(product, form):
    scene = product()
    analysis = analyze(scene.image, scene.white, form(scene.body))
    assert analysis.pixel is None
    np.testing.assert_allclose(analysis.reference, scene.body)


def test_reference_found(product):
    scene = product()
    analysis = analyze(scene.image, scene.white, mask=scene.mask)
    assert analysis.pixel is None
    assert angle(analysis.reference, scene.body) < 1.0


def test_a_clicked_pixel_is_averaged_over_a_window(product):
    # One spoiled pixel, right under the click, hardly matters.
    scene = product(noise=0)
    x, y = scene.matte
    clean = analyze(scene.image, reference=(x, y)).reference
    scene.image[y, x] = [0.05, 0.6, 0.6]
    np.testing.assert_allclose(analyze(scene.image, reference=(x, y)).reference, clean, atol=0.01)
    # But only nearby pixels count: the rest of the picture may be anything.
    far = np.full_like(scene.image, 0.3)
    far[y - 2 : y + 3, x - 2 : x + 3] = scene.image[y - 2 : y + 3, x - 2 : x + 3]
    np.testing.assert_allclose(analyze(far, reference=(x, y)).reference, clean, atol=0.01)


def test_everything_is_left_as_it_was(product):
    scene = product(white=(0.9, 1.0, 0.7))
    mask = scene.mask.astype(np.float32)
    mask[40:50, 40:50] = 0.5
    given = [scene.image, mask, scene.white, scene.body]
    before = [a.copy() for a in given]
    analysis = analyze(scene.image, scene.white, scene.body, mask)
    analysis.recolor(TARGET, (0.5, 0.6, 0.7))
    _ = analysis.A, analysis.B, analysis.residual, analysis.predicted_error(TARGET), analysis.report
    for ours, kept in zip(given, before, strict=True):
        np.testing.assert_array_equal(ours, kept)


def test_white_defaults_to_ones(product):
    scene = product()
    np.testing.assert_array_equal(analyze(scene.image, None, scene.body).white, [1, 1, 1])
    np.testing.assert_array_equal(analyze(scene.image, (0.9, 1.0, 0.7), scene.body).white, [0.9, 1.0, 0.7])


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.float16, np.float32, np.float64])
def test_mask_of_any_kind(product, dtype):
    scene = product()
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    plain = analyze(scene.image, mask=scene.mask).recolor(TARGET)
    ours = analyze(scene.image, mask=(scene.mask * top).astype(dtype)).recolor(TARGET)
    np.testing.assert_allclose(ours, plain, atol=1e-6)
    np.testing.assert_array_equal(ours[scene.mask == 0], scene.image[scene.mask == 0])


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble])
def test_image_of_any_float_dtype(product, dtype):
    scene = product()
    image = scene.image.astype(np.float16)
    plain = analyze(image.astype(np.float32), scene.white, scene.body, scene.mask)
    ours = analyze(image.astype(dtype), scene.white, scene.body, scene.mask)
    np.testing.assert_allclose(ours.recolor(TARGET), plain.recolor(TARGET), atol=1e-6)
    np.testing.assert_allclose(ours.A, plain.A, atol=1e-6)
    assert ours.recolor(TARGET).dtype == np.float32


@pytest.mark.parametrize("layout", ["fortran", "strided", "reversed", "channels", "four channels", "big endian"])
def test_image_of_any_layout(product, layout):
    scene = product()
    image, mask = scene.image, scene.mask
    padded = np.zeros((image.shape[0] * 2, image.shape[1] * 3, 4), np.float32)
    padded[::2, ::3, :3] = image
    views = {
        "fortran": (np.asfortranarray(image), np.asfortranarray(mask)),
        "strided": (padded[::2, ::3, :3], mask),
        "reversed": (
            np.ascontiguousarray(image[::-1, ::-1])[::-1, ::-1],
            np.ascontiguousarray(mask[::-1])[::-1],
        ),
        "channels": (np.ascontiguousarray(image.transpose(2, 0, 1)).transpose(1, 2, 0), mask),
        "four channels": (padded[::2, ::3], mask),
        "big endian": (image.astype(">f4"), mask.astype(">f8")),
    }
    view, view_mask = views[layout]
    plain = analyze(image, reference=scene.matte, mask=mask)
    ours = analyze(view, reference=scene.matte, mask=view_mask)
    np.testing.assert_allclose(ours.reference, plain.reference, atol=1e-7)
    np.testing.assert_allclose(ours.recolor(TARGET), plain.recolor(TARGET), atol=1e-6)
    np.testing.assert_allclose(ours.residual, plain.residual, atol=1e-6)
    found, wanted = (analyze(*v, mask=m) for v, m in (((view,), view_mask), ((image,), mask)))
    np.testing.assert_allclose(found.reference, wanted.reference, atol=1e-6)


# --- the maps -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["dichromatic", "body"])
def test_maps_are_least_squares_per_pixel(product, model):
    scene = product(white=(0.9, 1.0, 0.7), size=24, noise=0.02)
    analysis = analyze(scene.image, scene.white, scene.body, scene.mask, model)
    assert analysis.A.shape == analysis.B.shape == analysis.residual.shape == (24, 24)
    assert analysis.A.dtype == analysis.B.dtype == analysis.residual.dtype == np.float32
    columns = np.column_stack([scene.body, scene.white])[:, : 1 if model == "body" else 2]
    for y in range(24):
        for x in range(24):
            solution, squares, _, _ = np.linalg.lstsq(columns, scene.image[y, x].astype(float), rcond=None)
            assert analysis.A[y, x] == pytest.approx(solution[0], abs=1e-5)
            assert analysis.B[y, x] == pytest.approx(solution[1] if model == "dichromatic" else 0, abs=1e-5)
            assert analysis.residual[y, x] == pytest.approx(np.sqrt(squares[0]), abs=1e-5)


def test_maps_find_shading_and_gloss(product):
    scene = product(white=(0.9, 1.0, 0.7), noise=0)
    analysis = analyze(scene.image, scene.white, scene.body)
    inside = scene.mask == 1
    np.testing.assert_allclose(analysis.A[inside], scene.shading[inside], atol=1e-5)
    np.testing.assert_allclose(analysis.B[inside], scene.gloss[inside], atol=1e-5)
    assert analysis.residual[inside].max() < 1e-6


def test_maps_are_made_once(product):
    analysis = analyze(product().image, reference=product().body)
    assert analysis.A is analysis.A
    assert analysis.B is analysis.B
    assert analysis.residual is analysis.residual


# --- recolor, against the truth -------------------------------------------------------------------------------


@settings(deadline=None, max_examples=15)
@given(
    st.tuples(*[st.floats(0.02, 0.9)] * 3),
    st.tuples(*[st.floats(0.3, 1.5)] * 3),
    st.tuples(*[st.floats(0.3, 1.5)] * 3),
)
def test_recolored_scene_is_the_true_scene(target, white, target_white):
    rng = np.random.default_rng(1)
    shading, gloss = rng.uniform(0.1, 1.1, (8, 9, 1)), rng.uniform(0, 0.4, (8, 9, 1))
    body = np.array([0.5, 0.08, 0.03]) * white
    image = (shading * body + gloss * np.array(white)).astype(np.float32)
    truth = shading * np.array(target) + gloss * np.array(target_white)
    ours = analyze(image, white, body).recolor(target, target_white)
    np.testing.assert_allclose(ours, truth, atol=2e-5)


def test_linearity_and_exposure(product):
    scene = product()
    one = analyze(scene.image, reference=scene.matte, mask=scene.mask).recolor(TARGET)
    four = analyze(4 * scene.image, reference=scene.matte, mask=scene.mask).recolor(4 * TARGET)
    np.testing.assert_allclose(four, 4 * one, rtol=1e-4, atol=1e-5)
    scaled = analyze(4 * scene.image, (4, 4, 4), scene.matte, scene.mask).recolor(4 * TARGET)
    np.testing.assert_allclose(scaled, 4 * one, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("model", ["dichromatic", "body", "auto"])
def test_own_color_returns_the_picture(product, model):
    scene = product(white=(0.9, 1.0, 0.7), noise=0.02)
    for rule in ("fade", "keep"):
        analysis = analyze(scene.image, scene.white, mask=scene.mask, model=model)
        np.testing.assert_allclose(analysis.recolor(analysis.reference, residual=rule), scene.image, atol=2e-6)


def test_residual_rules(product):
    scene = product(noise=0.02)
    analysis = analyze(scene.image, mask=scene.mask)
    kept, dropped, faded, half = (analysis.recolor(TARGET, residual=r) for r in ("keep", "drop", "fade", 0.5))
    left = np.linalg.norm(kept - dropped, axis=-1)
    inside = erode(scene.mask == 1, 5)  # along the outline the ground's share is left out
    np.testing.assert_allclose(left[inside], analysis.residual[inside], atol=1e-5)
    np.testing.assert_allclose(half, (kept + dropped) / 2, atol=1e-6)
    # The target is far: the rule drops nearly all.
    assert np.abs(faded - dropped).max() < 0.05 * np.abs(kept - dropped).max()


def test_new_light_reaches_the_gloss(product):
    scene = product(noise=0)
    new = np.array([1.2, 0.9, 0.5])
    ours = analyze(scene.image, None, scene.body, scene.mask).recolor(TARGET, new)
    inside = scene.mask == 1
    np.testing.assert_allclose(ours[inside], scene.in_color(TARGET, new)[inside], atol=1e-5)


# --- the choice of the model ----------------------------------------------------------------------------------


def test_a_colored_product_is_dichromatic_a_greyish_one_regularized_and_a_grey_one_body(product):
    colored = analyze(product().image, reference=product().body)
    assert colored.model == "dichromatic"
    assert colored.noise_gain < 3
    for body, model in (
        ((0.4, 0.4, 0.4), "body"),
        ((0.4, 0.41, 0.39), "regularized"),
        ((0.2, 0.2, 0.205), "regularized"),
    ):
        grey = analyze(product(body).image, mask=product(body).mask)
        assert grey.model == model
        assert any("almost the color of the light" in w for w in grey.warnings)


@pytest.mark.parametrize("chroma", [0, 1e-7, 1e-4, 0.001, 0.003, 0.01, 0.02, 0.03, 0.05, 0.1])
@pytest.mark.parametrize("white", [(1, 1, 1), (1.0, 0.8, 0.5)])
def test_auto_never_gives_garbage(product, chroma, white):
    body = (0.35 + np.array([chroma, -chroma, chroma / 2])) * white
    scene, clean = product(body, white, noise=0.01), product(body, white, noise=0)
    target = np.array([0.7, 0.03, 0.02])
    for reference in (None, scene.matte, scene.body):
        analysis = analyze(scene.image, scene.white, reference, scene.mask)
        result = analysis.recolor(target)
        assert np.isfinite(result).all()
        # Nothing gets lighter than its light says: as bright as the target is against the reference, plus its gloss.
        brightest = np.linalg.norm(scene.image, axis=-1).max()
        assert result.max() < brightest * (np.linalg.norm(target) / np.linalg.norm(analysis.reference) + 1)
        assert result.min() > -0.5
        assert np.abs(analysis.B).max() < 2
    # Noise is multiplied, but by no more than the model may: 6, times the target's length over the reference's.
    grown = result - analyze(clean.image, clean.white, clean.body, clean.mask).recolor(target)
    assert grown[scene.mask == 1].std() < 0.01 * 7 * np.linalg.norm(target) / np.linalg.norm(body)


def test_asking_for_dichromatic_on_a_greyish_product_warns(product):
    scene = product((0.36, 0.35, 0.35))
    analysis = analyze(scene.image, mask=scene.mask, reference=scene.body, model="dichromatic")
    assert analysis.model == "dichromatic"
    assert analysis.noise_gain > 6
    assert any("use the model 'auto' or 'body'" in w for w in analysis.warnings)


def test_noise_grows_as_said(product):
    # The spread of A and B over a noisy flat product against a clean one: noise gain is no empty word.
    rng = np.random.default_rng(0)
    for body in ((0.5, 0.1, 0.05), (0.4, 0.3, 0.3)):
        body = np.array(body)
        image = (body + rng.normal(0, 0.01, (200, 200, 3))).astype(np.float32)
        analysis = analyze(image, reference=body, model="dichromatic")
        # B's own spread is sigma / (|W| sin angle).
        assert analysis.B.std() == pytest.approx(0.01 / 3**0.5 * analysis.noise_gain, rel=0.03)


# --- warnings and the report ----------------------------------------------------------------------------------


def test_a_glossy_click_is_reported(product):
    scene = product(size=160)
    lobe = np.where((scene.gloss > 0.1) & (scene.gloss < 0.3), scene.gloss, 0)
    y, x = np.unravel_index(np.argmax(lobe), lobe.shape)
    glossy = analyze(scene.image, reference=(int(x), int(y)), mask=scene.mask)
    assert any("glossy" in w for w in glossy.warnings)
    matte = analyze(scene.image, reference=scene.matte, mask=scene.mask)
    assert not any("glossy" in w for w in matte.warnings)


def test_clipping_is_reported(product):
    scene = product(gloss=2)
    image = np.minimum(scene.image, 1)
    share = (image[scene.mask == 1].max(axis=1) >= 1).mean()
    assert share > 0.02
    analysis = analyze(image, mask=scene.mask)
    assert any("is clipped" in w for w in analysis.warnings)
    assert analysis.report["clipped_share"] == pytest.approx(share, abs=0.02)
    assert angle(analysis.reference, scene.body) < 1.5


def test_a_dark_reference_is_reported(product):
    scene = product()
    analysis = analyze(scene.image * 0.02, reference=scene.matte)
    assert any("dark" in w for w in analysis.warnings)


def test_warnings_are_sentences_with_a_remedy(product):
    scene = product((0.4, 0.4, 0.41), gloss=2)
    analysis = analyze(np.minimum(scene.image, 1), mask=scene.mask)
    assert len(analysis.warnings) >= 2
    for text in analysis.warnings:
        assert re.fullmatch(r"\S[^\n]*[:.] [^\n]*\.", text), text


def test_report(product):
    scene = product(white=(0.9, 1.0, 0.7), noise=0.01)
    analysis = analyze(scene.image, scene.white, scene.matte, scene.mask, "dichromatic")
    report = analysis.report
    assert set(report) >= {
        "model", "reference", "reference_pixel", "white", "noise_gain", "residual_mean", "residual_p95",
        "clipped_share", "covered_share", "warnings",
    }  # fmt: skip
    assert json.loads(json.dumps(report)) == report
    inside = analysis.residual[scene.mask == 1] * 255
    assert report["residual_mean"] == pytest.approx(inside.mean(), rel=0.02)
    assert report["residual_p95"] == pytest.approx(np.quantile(inside, 0.95), rel=0.03)
    assert report["covered_share"] == pytest.approx(scene.mask.mean(), abs=1e-6)
    assert report["reference_pixel"] == list(scene.matte)
    assert report["model"] == "dichromatic"
    assert report["clipped_share"] == 0
    # The noise of 0.01 has one direction left over beside body and white: mean |noise| there is 0.8 sigma.
    known = analyze(scene.image, scene.white, scene.body, scene.mask, "dichromatic").report
    assert known["residual_mean"] == pytest.approx(0.798 * 0.01 * 255, rel=0.05)


def test_report_of_a_grey_product_is_json_too(product):
    report = analyze(np.full((5, 5, 3), 0.5, np.float32)).report
    assert report["noise_gain"] is None
    assert json.loads(json.dumps(report, allow_nan=False)) == report


# --- odd and bad input ----------------------------------------------------------------------------------------


def test_one_pixel():
    image = np.array([[[0.5, 0.2, 0.1]]], np.float32)
    for reference in (None, (0, 0), (0.5, 0.2, 0.1)):
        analysis = analyze(image, reference=reference)
        np.testing.assert_allclose(analysis.recolor(TARGET), TARGET[None, None], atol=1e-6)
        assert np.isfinite([v for v in analysis.report.values() if isinstance(v, float)]).all()
        assert analysis.predicted_error(TARGET).shape == (1, 1)


@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (2, 2)])
def test_tiny_pictures(shape):
    image = np.tile(np.array([0.5, 0.2, 0.1], np.float32), (*shape, 1))
    mask = np.zeros(shape)
    mask.flat[:3] = 1, 0.5, 0
    result = analyze(image, mask=mask).recolor(TARGET)
    np.testing.assert_allclose(result.reshape(-1, 3)[0], TARGET, atol=1e-6)
    np.testing.assert_array_equal(result.reshape(-1, 3)[2:], image.reshape(-1, 3)[2:])


@given(st.integers(0, 2**32 - 1), st.integers(1, 24), st.integers(1, 24), st.sampled_from([0.02, 0.2, 0.9]))
@settings(max_examples=150, deadline=None)
def test_scraps_of_pictures_are_recolored_or_refused(seed, height, width, share):
    rng = np.random.default_rng(seed)
    shades = rng.uniform(0, 0.6, (height, width, 1)) * rng.uniform(0, 1, 3)
    image = [shades, rng.uniform(-0.1, 1.2, (height, width, 3)), np.where(shades < 0.1, 1.0, shades)][seed % 3]
    picture = image.astype(np.float32) if seed % 2 else (255 * np.clip(image, 0, 1)).astype(np.uint8)
    mask = (rng.random((height, width)) < share).astype(np.float32)
    for reference in (None, (width // 2, height // 2)):
        try:
            analysis = analyze(picture, reference=reference, mask=mask)
        except DyehouseError:
            continue
        assert np.isfinite(analysis.recolor(TARGET)).all()
        assert np.isfinite(analysis.predicted(TARGET).median)


def test_soft_mask_everywhere(product):
    # No pixel is wholly covered: hair, lace, a thin strap.
    image = np.tile(np.array([0.5, 0.2, 0.1], np.float32), (20, 30, 1))
    for mask in (np.full((20, 30), 0.6), np.full((20, 30), 160, np.uint8)):
        for reference in (None, (0.5, 0.2, 0.1), (5, 5)):
            analysis = analyze(image, reference=reference, mask=mask)
            np.testing.assert_allclose(analysis.reference, (0.5, 0.2, 0.1), atol=1e-6)
            assert analysis.report["residual_p95"] == pytest.approx(0, abs=1e-3)
            cover = 0.6 if mask.dtype.kind == "f" else 160 / 255
            expected = (1 - cover) * image + cover * TARGET
            np.testing.assert_allclose(analysis.recolor(TARGET), expected, atol=1e-5)


@pytest.mark.parametrize("reference", [(-1, 5), (5, -1), (96, 5), (5, 96), (10**9, 0), (-0.5, 5)])
def test_reference_outside(product, reference):
    with pytest.raises(ReferenceColorError, match="lies outside the picture of 96 x 96"):
        analyze(product().image, reference=reference)


def test_reference_clipped_black_or_outside_the_mask(product):
    scene = product(gloss=2)
    image = np.minimum(scene.image, 1)
    y, x = np.unravel_index(np.argmax(scene.gloss), scene.gloss.shape)
    with pytest.raises(ReferenceColorError, match="is clipped"):
        analyze(image, reference=(int(x), int(y)), mask=scene.mask)
    with pytest.raises(ReferenceColorError, match=r"\(0, 0\) is outside the mask"):
        analyze(image, reference=(0, 0), mask=scene.mask)
    image[:10, :10] = 0
    with pytest.raises(ReferenceColorError, match="is black"):
        analyze(image, reference=(4, 4))


@pytest.mark.parametrize(
    "reference", [(np.nan, 5), (5, np.inf), "ab", ("1", "2"), (1, 2, 3, 4), (5,), 5, ((1, 2), 3), [[1, 2]], {}]
)
def test_reference_that_is_none(product, reference):
    with pytest.raises(ReferenceColorError, match="Reference"):
        analyze(product().image, reference=reference)


@pytest.mark.parametrize("reference", [(0, 0, 0), (-0.1, -0.1, -0.1), (np.nan, 0.1, 0.1), (0.2, np.inf, 0.1)])
def test_reference_colors_that_are_none(product, reference):
    with pytest.raises(ReferenceColorError):
        analyze(product().image, reference=reference)


@pytest.mark.parametrize("white", [(0, 1, 1), (1, -1, 1), (1, np.nan, 1), (1, 1), "D65x", (np.inf, 1, 1)])
def test_bad_whites(product, white):
    with pytest.raises(WhiteError, match="White"):
        analyze(product().image, white, product().body)


def test_white_equal_to_the_reference(product):
    scene = product()
    for model in ("auto", "dichromatic"):
        with pytest.raises(DyehouseError, match="the same color") as caught:
            analyze(scene.image, scene.body, scene.body, scene.mask, model)
        assert "\n" not in str(caught.value)
    assert analyze(scene.image, scene.body, scene.body, scene.mask, "body").model == "body"


@pytest.mark.parametrize(
    "mask",
    [np.ones((96, 95)), np.ones((95, 96)), np.zeros((96, 96)), np.full((96, 96), np.nan), np.full((96, 96), 2.0)],
)
def test_bad_masks(product, mask):
    with pytest.raises(MaskError, match="Mask"):
        analyze(product().image, mask=mask)


@pytest.mark.parametrize("curve", [None, transfer.SRGB])
def test_all_black_and_all_white(curve):
    dtype = np.float32 if curve is None else np.uint8
    top = 1 if curve is None else 255
    with pytest.raises(ReferenceColorError, match="black"):
        analyze(Picture(np.zeros((9, 9, 3), dtype), curve))
    with pytest.raises(ReferenceColorError, match="clipped"):
        analyze(Picture(np.full((9, 9, 3), top, dtype), curve))


def test_a_given_color_recolors_even_a_black_or_white_picture():
    for value in (0.0, 1.0):
        image = np.full((4, 4, 3), value, np.float32)
        result = analyze(image, reference=(0.5, 0.1, 0.1)).recolor(TARGET)
        # Black stays black; what is white is all gloss.
        np.testing.assert_allclose(result, image, atol=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_numbers(product, bad):
    scene = product()
    whole = np.full((6, 6, 3), bad, np.float32)
    for reference in (None, (0.5, 0.1, 0.1)):
        with pytest.raises(ImageError, match="NaN or infinite"):
            analyze(whole, reference=reference)
    scene.image[50, 50, 1] = bad
    for reference in (None, scene.body):
        with pytest.raises(ImageError, match="NaN or infinite"):
            analyze(scene.image, reference=reference).recolor(TARGET)
    with pytest.raises(ReferenceColorError, match="not finite"):
        analyze(scene.image, reference=(50, 50))


def test_one_bad_pixel_in_a_large_picture_is_found_when_recolored():
    image = np.tile(np.array([0.5, 0.2, 0.1], np.float32), (1500, 1500, 1))
    image[777, 778, 2] = np.nan
    with pytest.raises(ImageError, match="NaN or infinite"):
        analyze(image, reference=(0.5, 0.2, 0.1)).recolor(TARGET)


@pytest.mark.parametrize("image", [np.ones((4, 4)), np.ones((4, 4, 3), np.uint8), np.ones((4, 4, 3), int), "x", None])
def test_images_that_are_none(image):
    with pytest.raises(ImageError, match="Picture"):
        analyze(image)


def test_unknown_model(product):
    with pytest.raises(ImageError, match="'wood' is not known: use one of auto, dichromatic, body"):
        analyze(product().image, model="wood")


@pytest.mark.parametrize("target", [(1, 2), "red", (np.nan, 0, 0), None])
def test_bad_targets(product, target):
    analysis = analyze(product().image, reference=product().body)
    with pytest.raises(DyehouseError, match="Target"):
        analysis.recolor(target)
    with pytest.raises(WhiteError):
        analysis.recolor(TARGET, (0, 1, 1))
    with pytest.raises(DyehouseError, match="Residual rule"):
        analysis.recolor(TARGET, residual="most")


@pytest.mark.parametrize(("covered", "warned"), [(3, True), (400, False)])
def test_a_tiny_region_is_warned_of(product, covered, warned):
    scene = product()
    mask = np.zeros(scene.image.shape[:2], bool)
    side = int(np.ceil(covered**0.5))
    y, x = np.argwhere(scene.mask == 1).mean(axis=0).astype(int)
    mask[y : y + side, x : x + side] = True
    warnings = analyze(scene.image, reference=scene.body, mask=mask).warnings
    assert any("covers only" in text for text in warnings) == warned
