"""Terms, coefficients and matrices of the models."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dyehouse.core import dichromatic, mixture
from dyehouse.core.errors import ReferenceColorError
from dyehouse.core.interreflection import bounced

V, W = np.array([0.42, 0.09, 0.05]), np.array([0.9, 1.0, 0.7])
T, W2 = np.array([0.05, 0.2, 0.4]), np.array([1.1, 0.9, 0.5])
LIGHT = np.array([1.7, 0.9, 0.4])
COLORS = arrays(np.float64, 3, elements=st.floats(0.02, 0.9))

LINEAR = {
    "body": mixture.plain("body", V, W),
    "dichromatic": mixture.plain("dichromatic", V, W),
    "bounce": mixture.matte_bounce(V, W, 0.5),
    "lights": mixture.two_lights(V, W, LIGHT),
    "metal": mixture.metal(V, W),
}
MAPPED = {
    "regularized": mixture.mapped("regularized", V, W),
    "glossy bounce": mixture.mapped("bounce", V, W, 0.5),
    "noisy matte bounce": mixture.mapped("bounce", V, W, 0.5, gloss=False),
}
EVERY = LINEAR | MAPPED


@pytest.mark.parametrize("model", ["body", "dichromatic"])
@pytest.mark.parametrize("residual", [0.0, 0.4, 1.0])
def test_plain_models_are_those_of_the_paper(model, residual):
    expected = dichromatic.recolor_matrix(V, T, W, W2, model, residual)
    np.testing.assert_array_equal(LINEAR[model].matrix(T, W2, residual), expected)


@pytest.mark.parametrize("name", EVERY)
def test_every_term_goes_over_to_the_new_color_and_light(name):
    # A pixel that is nothing but one of the terms becomes that term of the target.
    m = EVERY[name]
    matrix, extras = m.matrix(T, W2, 0.0), m.projector.shape[1] - 3
    assert extras == (0 if name in LINEAR else len(m.terms) - 1)
    old, new = m.colors(V, W), m.colors(T, W2)
    for k in range(old.shape[1]):
        if not m.projector[k].any():
            continue  # "body" knows no gloss
        corrections = np.zeros(extras)
        if extras and k:
            corrections[k - 1] = 1
        np.testing.assert_allclose(matrix @ np.concatenate([old[:, k], corrections]), new[:, k], atol=1e-12)


@pytest.mark.parametrize("name", EVERY)
def test_own_color_with_the_residual_is_the_picture(name):
    m = EVERY[name]
    np.testing.assert_allclose(m.matrix(V, W, 1.0), np.eye(3, m.projector.shape[1]), atol=1e-12)


@pytest.mark.parametrize("name", EVERY)
def test_a_neutral_ground_is_kept_by_models_with_gloss(name):
    m = EVERY[name]
    assert m.keeps_white == (name in ("dichromatic", "lights", "regularized", "glossy bounce"))
    if m.keeps_white:
        corrections = np.zeros(m.projector.shape[1] - 3)
        corrections[:1] = 1
        np.testing.assert_allclose(m.matrix(T, W, 0.0) @ np.concatenate([W, corrections]), W, atol=1e-12)


def test_coefficients_of_the_terms():
    pixel = 0.7 * V + 0.2 * W + 0.1 * bounced(V / W, 0.5) * W
    extended = np.concatenate([pixel, [0.2, 0.1]])
    m = MAPPED["glossy bounce"]
    assert [m.coefficient(term) @ extended for term in ("body", "white", "bounce")] == pytest.approx([0.7, 0.2, 0.1])
    assert not LINEAR["bounce"].coefficient("white").any()
    assert LINEAR["metal"].coefficient("body") @ (0.6 * V) == pytest.approx(0.6)
    np.testing.assert_allclose(m.left_over @ extended, 0, atol=1e-12)


@given(COLORS, COLORS, st.floats(0.01, 1), st.floats(0, 3))
def test_a_small_step_of_the_target_is_a_small_step_of_the_matrix(target, toward, step, feedback):
    for m in (mixture.matte_bounce(V, W, feedback), mixture.mapped("bounce", V, W, feedback), *LINEAR.values()):
        near = target + 1e-4 * step * (toward - target)
        change = np.abs(m.matrix(near, W, 0.0) - m.matrix(target, W, 0.0)).max()
        assert change <= 1e-4 * 200 * np.abs(m.projector).max()


@given(COLORS, st.permutations(range(3)))
def test_channels_may_be_permuted_with_the_white(target, order):
    p = list(order)
    pairs = [
        (mixture.plain("dichromatic", V, W), mixture.plain("dichromatic", V[p], W[p])),
        (mixture.matte_bounce(V, W, 0.5), mixture.matte_bounce(V[p], W[p], 0.5)),
        (mixture.mapped("bounce", V, W, 0.5), mixture.mapped("bounce", V[p], W[p], 0.5)),
        (mixture.metal(V, W), mixture.metal(V[p], W[p])),
    ]
    for one, other in pairs:
        expected, found = one.matrix(target, W2, 0.3), other.matrix(target[p], W2[p], 0.3)
        np.testing.assert_allclose(found[:, :3], expected[p][:, p], atol=1e-9)
        np.testing.assert_allclose(found[:, 3:], expected[p][:, 3:], atol=1e-9)


def test_a_channel_of_zero_is_no_error_for_metal():
    assert np.isfinite(mixture.metal(np.array([0.5, 0.0, 0.2]), W).matrix(T, W, 0.0)).all()


def test_gray_has_no_dichromatic_split():
    with pytest.raises(ReferenceColorError, match="color of the white"):
        mixture.plain("dichromatic", 0.4 * W, W)
