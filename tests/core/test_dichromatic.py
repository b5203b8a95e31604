"""The dichromatic model against least squares, scenes of known truth, and its own algebra."""

import re

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dyehouse.core import dichromatic as d
from dyehouse.core.errors import DyehouseError, ImageError, ReferenceColorError, TargetError, WhiteError

ordinary = settings(deadline=None, max_examples=80)
channel = st.floats(0.02, 2.0)
whites = st.tuples(channel, channel, channel).map(np.array)
targets = st.tuples(*[st.floats(-0.05, 1.5)] * 3).map(np.array)


@st.composite
def footings(draw):
    """A reference and a white that can be told apart."""
    v, w = draw(whites), draw(whites)
    assume(np.linalg.norm(np.cross(v, w)) > 0.05 * np.linalg.norm(v) * np.linalg.norm(w))
    assume(d.sine(v, w) > 0.05)
    return v, w


def pixels(seed, shape=(40,)):
    return np.random.default_rng(seed).normal(0.4, 0.4, (*shape, 3))


V, W = np.array([0.42, 0.11, 0.05]), np.array([0.9, 1.0, 0.7])
V2, W2 = np.array([0.05, 0.2, 0.5]), np.array([1.1, 0.8, 0.4])


# --- fit and residual: numpy's least squares is the judge -----------------------------------------------------


@ordinary
@given(footings(), st.integers(0, 999))
def test_fit_and_residual_equal_least_squares(footing, seed):
    v, w = footing
    x = pixels(seed)
    a, b = d.fit(x, v, w)
    left = d.residual(x, v, w)
    for k, pixel in enumerate(x):
        solution, squares, _, _ = np.linalg.lstsq(np.column_stack([v, w]), pixel, rcond=None)
        np.testing.assert_allclose((a[k], b[k]), solution, rtol=1e-7, atol=1e-7)
        assert left[k] ** 2 == pytest.approx(squares[0], rel=1e-6, abs=1e-12)


def test_fit_by_hand():
    # V = (1, 0, 0), W = (1, 1, 1): B is the mean of the second and third channel, A what is over in the first.
    a, b = d.fit([[0.5, 0.2, 0.1], [1, 0, 0], [1, 1, 1]], [1, 0, 0], [1, 1, 1])
    np.testing.assert_allclose(a, [0.35, 1, 0], atol=1e-12)
    np.testing.assert_allclose(b, [0.15, 0, 1], atol=1e-12)
    # The residual of the first pixel: +-0.05 in the second and third channel.
    np.testing.assert_allclose(d.residual([[0.5, 0.2, 0.1]], [1, 0, 0], [1, 1, 1]), [np.hypot(0.05, 0.05)], atol=1e-12)


@ordinary
@given(footings(), st.integers(0, 999))
def test_residual_is_orthogonal_to_body_and_white(footing, seed):
    v, w = footing
    left = pixels(seed) @ d.residual_projector(v, w).T
    np.testing.assert_allclose(left @ np.column_stack([v, w]), 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(left, axis=1), d.residual(pixels(seed), v, w), atol=1e-12)


@ordinary
@given(footings())
def test_reference_and_white_have_their_own_coefficients(footing):
    v, w = footing
    a, b = d.fit(np.array([v, w, 0.3 * v + 0.7 * w]), v, w)
    np.testing.assert_allclose(a, [1, 0, 0.3], atol=1e-9)
    np.testing.assert_allclose(b, [0, 1, 0.7], atol=1e-9)


def test_coefficients_are_not_clamped():
    a, b = d.fit(np.array([-0.2 * V + 0.5 * W, 1.2 * V - 0.1 * W]), V, W)
    np.testing.assert_allclose(a, [-0.2, 1.2], atol=1e-12)
    np.testing.assert_allclose(b, [0.5, -0.1], atol=1e-12)


def test_body_model_is_least_squares_on_the_body_alone():
    x = pixels(3)
    a, b = d.fit(x, V, W, model="body")
    expected = np.array([np.linalg.lstsq(V[:, None], p, rcond=None)[0][0] for p in x])
    np.testing.assert_allclose(a, expected, atol=1e-12)
    assert (b == 0).all()
    left = np.array([np.sqrt(np.linalg.lstsq(V[:, None], p, rcond=None)[1][0]) for p in x])
    np.testing.assert_allclose(d.residual(x, V, W, model="body"), left, atol=1e-12)


# --- one matrix -----------------------------------------------------------------------------------------------


@ordinary
@given(footings(), targets, whites, st.sampled_from(d.MODELS), st.integers(0, 999))
def test_matrix_equals_fit_then_synthesize(footing, v2, w2, model, seed):
    v, w = footing
    x = pixels(seed, (5, 4))
    one = x @ d.recolor_matrix(v, v2, w, w2, model).T
    a, b = d.fit(x, v, w, model)
    np.testing.assert_allclose(one, d.synthesize(a, b, v2, w2), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(one[2, 3], a[2, 3] * v2 + b[2, 3] * w2, rtol=1e-9, atol=1e-9)


@ordinary
@given(footings(), targets, whites, st.floats(0, 1), st.integers(0, 999))
def test_matrix_is_linear_in_the_target_and_adds_the_share_of_the_residual(footing, v2, w2, share, seed):
    v, w = footing
    x = pixels(seed)
    first, second = (x @ d.recolor_matrix(v, t, w, w2).T for t in (v2, 2 * v2 + 0.1))
    middle = x @ d.recolor_matrix(v, (v2 + 2 * v2 + 0.1) / 2, w, w2).T
    np.testing.assert_allclose(middle, (first + second) / 2, atol=1e-9)
    a, b = d.fit(x, v, w)
    left = x - a[:, None] * v - b[:, None] * w
    with_residual = x @ d.recolor_matrix(v, v2, w, w2, residual=share).T
    np.testing.assert_allclose(with_residual, first + share * left * w2 / w, rtol=1e-8, atol=1e-8)


@ordinary
@given(footings(), targets, st.floats(0.01, 100), st.integers(0, 999))
def test_exposure_invariance(footing, v2, k, seed):
    v, w = footing
    x = pixels(seed)
    plain = x @ d.recolor_matrix(v, v2, w).T
    # A longer exposure scales the picture and with it everything read from it; W as well, or not.
    for scaled_white in (k * w, w):
        longer = (k * x) @ d.recolor_matrix(k * v, k * v2, scaled_white).T
        np.testing.assert_allclose(longer, k * plain, rtol=1e-7, atol=1e-7 * k)
    a, b = d.fit(x, v, w)
    a2, b2 = d.fit(k * x, k * v, k * w)
    np.testing.assert_allclose(a2, a, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(b2, b, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(d.residual(k * x, k * v, k * w), k * d.residual(x, v, w), rtol=1e-7, atol=1e-8 * k)


@ordinary
@given(footings(), st.sampled_from(d.MODELS))
def test_own_color_with_the_residual_kept_is_the_identity(footing, model):
    v, w = footing
    np.testing.assert_allclose(d.recolor_matrix(v, v, w, model=model, residual=1), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(d.recolor_matrix(v, v, w, w, model, residual=1), np.eye(3), atol=1e-9)


@ordinary
@given(footings(), targets, whites)
def test_reference_becomes_the_target_and_white_the_new_white(footing, v2, w2):
    v, w = footing
    for share in (0, 0.5, 1):
        m = d.recolor_matrix(v, v2, w, w2, residual=share)
        np.testing.assert_allclose(m @ v, v2, atol=1e-8)
        np.testing.assert_allclose(m @ w, w2, atol=1e-8)


@ordinary
@given(footings(), whites)
def test_there_and_back_again(footing, v2):
    v, w = footing
    assume(d.sine(v2, w) > 0.05)
    x = np.random.default_rng(0).random((20, 2)) @ np.array([v, w])
    there = x @ d.recolor_matrix(v, v2, w).T
    np.testing.assert_allclose(there @ d.recolor_matrix(v2, v, w).T, x, rtol=1e-6, atol=1e-7)


# --- the paper's errata, on a scene whose truth is known ------------------------------------------------------


def linear_camera_scene(light, reflectance, sensitivities):
    """Pixels by Eq. (11): body a R + gloss b, under a light, through a linear camera; 16 geometries."""
    rng = np.random.default_rng(5)
    body, gloss = rng.uniform(0.1, 1.2, 16), rng.uniform(0, 0.5, 16)
    body[0], gloss[0] = 1, 0  # the matte reference
    spectra = (body[:, None] * reflectance + gloss[:, None]) * light
    return spectra @ sensitivities


BANDS = np.linspace(400, 700, 31)
CAMERA = np.exp(-(((BANDS[:, None] - [600, 540, 450]) / 40) ** 2)) / 7
RED_CLOTH = 0.05 + 0.6 / (1 + np.exp(-(BANDS - 590) / 12))
BLUE_CLOTH = 0.04 + 0.5 * np.exp(-(((BANDS - 460) / 45) ** 2))
FLAT_LIGHT, WARM_LIGHT = np.ones(31), np.linspace(0.4, 1.6, 31)


def test_synthesis_is_exact_for_a_linear_camera_under_any_light():
    for old, new in ((FLAT_LIGHT, FLAT_LIGHT), (WARM_LIGHT, WARM_LIGHT), (FLAT_LIGHT, WARM_LIGHT)):
        photo, truth = (
            linear_camera_scene(old, RED_CLOTH, CAMERA),
            linear_camera_scene(new, BLUE_CLOTH, CAMERA),
        )
        w, w2 = old @ CAMERA, new @ CAMERA
        ours = photo @ d.recolor_matrix(photo[0], truth[0], w, w2).T
        np.testing.assert_allclose(ours, truth, atol=1e-10)


def printed_equation_35(photo, v, v2, w, w2):
    a, b = d.fit(photo, v, w)
    return a[:, None] * v2 + b[:, None] * w2 / w


def test_printed_equation_35_is_right_for_a_balanced_photo_only():
    photo = linear_camera_scene(FLAT_LIGHT, RED_CLOTH, CAMERA)
    truth = linear_camera_scene(WARM_LIGHT, BLUE_CLOTH, CAMERA)
    w, w2 = FLAT_LIGHT @ CAMERA, WARM_LIGHT @ CAMERA
    # Balanced: channels divided by the white, so that W = (1, 1, 1).
    balanced = photo / w
    np.testing.assert_allclose(printed_equation_35(balanced, balanced[0], truth[0], np.ones(3), w2), truth, atol=1e-10)
    np.testing.assert_allclose(balanced @ d.recolor_matrix(balanced[0], truth[0], np.ones(3), w2).T, truth, atol=1e-10)
    # Any other white: the printed form is off, B W' is not.
    photo, w = linear_camera_scene(WARM_LIGHT, RED_CLOTH, CAMERA) * 0.7, WARM_LIGHT @ CAMERA * 0.7
    assert np.abs(w - 1).max() > 0.2
    off = np.abs(printed_equation_35(photo, photo[0], truth[0], w, w2) - truth).max()
    assert off > 0.05
    np.testing.assert_allclose(photo @ d.recolor_matrix(photo[0], truth[0], w, w2).T, truth, atol=1e-10)


def test_illuminant_change_alone_is_von_kries():
    x = pixels(1)
    m = d.recolor_matrix(V, V * W2 / W, W, W2, residual=1)
    in_plane = np.random.default_rng(0).random((9, 2)) @ np.array([V, W])
    np.testing.assert_allclose(in_plane @ m.T, in_plane * W2 / W, atol=1e-9)
    # The residual, with diag(W'/W), takes the new light too: the whole change is von Kries.
    np.testing.assert_allclose(x @ m.T, x * W2 / W, atol=1e-9)


# --- the residual rule ----------------------------------------------------------------------------------------


@ordinary
@given(footings())
def test_whole_residual_at_the_own_color(footing):
    v, w = footing
    assert d.carried_residual(v, v, w) == pytest.approx(1, abs=1e-9)
    # A new light alone keeps it too.
    assert d.carried_residual(v, v * W2 / w, w, W2) == pytest.approx(1, abs=1e-9)


def test_carried_residual_falls_with_distance_and_is_continuous():
    # From red round to blue at constant length, in fine steps.
    red, blue = np.array([0.5, 0.1, 0.1]), np.array([0.1, 0.1, 0.5])
    way = [red * (1 - t) + blue * t for t in np.linspace(0, 1, 400)]
    way = [p / np.linalg.norm(p) * np.linalg.norm(red) for p in way]
    shares = np.array([d.carried_residual(red, p) for p in way])
    assert shares[0] == pytest.approx(1, abs=1e-6)
    assert (np.diff(shares) <= 1e-9).all()
    assert (np.diff(shares) > -0.02).all()
    assert shares[-1] < 0.05
    # Darker and darker along the same hue, down to black.
    darker = np.array([d.carried_residual(red, red * k) for k in np.linspace(1, 0, 200)])
    assert (np.diff(darker) <= 1e-9).all()
    assert (np.diff(darker) > -0.02).all()
    assert darker[-1] == 0
    assert ((shares >= 0) & (shares <= 1)).all()


@ordinary
@given(footings(), whites, whites, st.floats(0.01, 100))
def test_carried_residual_is_blind_to_exposure(footing, v2, w2, k):
    v, w = footing
    share = d.carried_residual(v, v2, w, w2)
    assert 0 <= share <= 1
    assert d.carried_residual(k * v, k * v2, w, w2) == pytest.approx(share, abs=1e-6)
    assert d.carried_residual(k * v, k * v2, k * w, k * w2) == pytest.approx(share, abs=1e-6)


def test_residual_rules():
    assert d.residual_share("keep", V, V2) == 1
    assert d.residual_share("drop", V, V2) == 0
    assert d.residual_share(0.25, V, V2) == 0.25
    assert d.residual_share("fade", V, V2, W, W2) == d.carried_residual(V, V2, W, W2)


@pytest.mark.parametrize("rule", ["most", "", -0.1, 1.01, float("nan"), float("inf")])
def test_unknown_residual_rule(rule):
    with pytest.raises(TargetError, match="fade, keep, drop, or a share"):
        d.residual_share(rule, V, V2)


# --- dtypes, layouts, shapes ----------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble])
def test_any_float_dtype(dtype):
    x = (np.random.default_rng(4).integers(0, 256, (6, 7, 3)) / 256).astype(dtype)  # exact in all of them
    a, b = d.fit(x, V, W)
    expected = d.fit(x.astype(np.float64), V, W)
    np.testing.assert_allclose(a, expected[0], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(b, expected[1], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(d.residual(x, V, W), d.residual(x.astype(np.float64), V, W), atol=1e-5)
    assert a.dtype == (np.float32 if dtype in (np.float16, np.float32) else np.float64)
    assert a.shape == b.shape == (6, 7)


def test_non_contiguous_arrays_and_unchanged_input():
    x = np.random.default_rng(4).random((12, 14, 3), dtype=np.float32)
    padded = np.random.default_rng(5).random((24, 14, 4), dtype=np.float32)
    padded[::2, :, :3] = x
    swapped = np.ascontiguousarray(x[..., ::-1])[..., ::-1]
    expected = d.fit(x, V, W)[0], d.fit(x, V, W)[1], d.residual(x, V, W)
    for view in (np.asfortranarray(x), padded[::2, :, :3], swapped, np.ascontiguousarray(x[::-1, ::-1])[::-1, ::-1]):
        before = view.copy()
        np.testing.assert_array_equal(view, x)
        got = (*d.fit(view, V, W), d.residual(view, V, W))
        for ours, wanted in zip(got, expected, strict=True):
            np.testing.assert_allclose(ours, wanted, rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(view, before)


@pytest.mark.parametrize("shape", [(3,), (1, 3), (0, 3), (2, 3, 4, 3)])
def test_any_number_of_dimensions(shape):
    x = np.ones(shape) * 0.5
    a, b = d.fit(x, V, W)
    assert a.shape == b.shape == d.residual(x, V, W).shape == shape[:-1]
    assert d.synthesize(a, b, V2, W2).shape == shape


def test_vectors_are_not_modified():
    v, w, v2, w2 = V.copy(), W.copy(), V2.copy(), W2.copy()
    d.recolor_matrix(v, v2, w, w2, residual=0.5)
    d.carried_residual(v, v2, w, w2)
    for ours, before in ((v, V), (w, W), (v2, V2), (w2, W2)):
        np.testing.assert_array_equal(ours, before)


# --- bad input ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("white", [(1, 1, 1), (0.9, 1.0, 0.7)])
def test_white_of_the_color_of_the_reference(white):
    for k in (1, 0.3, 1 + 1e-9):
        with pytest.raises(ReferenceColorError, match="color of the white") as caught:
            d.recolor_matrix(np.array(white) * k, V2, white)
        assert "\n" not in str(caught.value)
    # The body model does not need to tell them apart.
    assert np.isfinite(d.recolor_matrix(white, V2, white, model="body")).all()


@pytest.mark.parametrize("bad", [(0, 1, 1), (1, -0.1, 1), (0, 0, 0)])
def test_white_with_a_zero_or_negative_channel(bad):
    for call in (
        lambda: d.projector(V, bad),
        lambda: d.recolor_matrix(V, V2, bad),
        lambda: d.recolor_matrix(V, V2, W, bad),
        lambda: d.synthesize(0.5, 0.5, V2, bad),
        lambda: d.fit([[1, 1, 1]], V, bad, "body"),
    ):
        with pytest.raises(WhiteError, match="zero or negative"):
            call()


@pytest.mark.parametrize("bad", [(1, 1), "red", (1, 1, np.nan), (np.inf, 1, 1), [[1, 1, 1]], (1, "a", 2), None])
def test_colors_that_are_not_three_numbers(bad):
    with pytest.raises(ReferenceColorError):
        d.recolor_matrix(bad, V2, W)
    with pytest.raises(TargetError):
        d.recolor_matrix(V, bad, W)
    if bad is not None:  # None is the white of a balanced photo
        with pytest.raises(WhiteError):
            d.recolor_matrix(V, V2, bad)


@pytest.mark.parametrize("black", [(0, 0, 0), (-0.1, 0, -0.2)])
def test_black_reference(black):
    with pytest.raises(ReferenceColorError, match="is black"):
        d.fit([[1, 1, 1]], black, W)


def test_black_target_and_targets_below_zero_are_allowed():
    np.testing.assert_allclose(d.recolor_matrix(V, (0, 0, 0), W) @ V, 0, atol=1e-12)
    np.testing.assert_allclose(d.recolor_matrix(V, (0.5, -0.03, 0.1), W) @ V, (0.5, -0.03, 0.1), atol=1e-12)


def test_unknown_model_and_wrong_shape():
    with pytest.raises(ImageError, match="'metal' is not known"):
        d.projector(V, W, "metal")
    for bad in (np.ones((4, 4)), np.ones((2, 3, 4)), np.float64(1)):
        with pytest.raises(ImageError, match="last axis"):
            d.fit(bad, V, W)


def test_messages_are_one_sentence():
    for bad in ((1, 1), (0, 1, 1), (np.nan, 1, 1)):
        with pytest.raises(DyehouseError) as caught:
            d.as_white(bad)
        assert re.fullmatch(r"[A-Z][^\n]*: [^\n]*\.", str(caught.value))
