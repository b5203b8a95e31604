"""Gloss and bounce of single pixels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from dyehouse.core.interreflection import bounced
from dyehouse.core.separation import MODEL_ERROR, NO_GLOSS, frame, split

BODIES = {"saturated": (0.43, 0.06, 0.2), "pale": (0.72, 0.5, 0.46), "dark": (0.05, 0.02, 0.01)}


def along_and_across(pixels, axes):
    return pixels @ axes.along, (pixels @ axes.across.T).T


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_the_frame_turns_and_does_not_stretch(body):
    axes = frame(np.array(body), 0.5)
    basis = np.vstack([axes.along, axes.across])
    np.testing.assert_allclose(basis @ basis.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(basis @ body, [axes.length, 0, 0], atol=1e-12)
    np.testing.assert_allclose(axes.white, basis @ np.ones(3), atol=1e-12)
    np.testing.assert_allclose(axes.bounce, basis @ bounced(body, 0.5), atol=1e-12)
    assert axes.white[1] > 0
    assert axes.white[2] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_gloss_is_found_exactly_where_there_is_no_noise(body):
    axes = frame(np.array(body))
    a, b = np.meshgrid(np.linspace(0.2, 1, 5), np.linspace(0, 0.5, 6))
    pixels = a[..., None] * body + b[..., None]
    light = pixels @ axes.along
    found, none, _ = split(light, np.moveaxis(pixels @ axes.across.T, -1, 0), np.zeros_like(a), axes, bounce=False)
    # The model error of 0.3 % is all that it is shrunk by.
    np.testing.assert_allclose(found, b, atol=2e-3)
    assert not none.any()


def test_it_is_the_minimum_of_the_sum_it_says():
    body = np.array(BODIES["pale"])
    axes = frame(body, 0.5)
    rng = np.random.default_rng(1)
    for _ in range(40):
        pixel = body * rng.uniform(0.3, 1) + rng.normal(0, 0.05) + rng.normal(0, 0.1) * bounced(body, 0.5)
        light, across = along_and_across(pixel, axes)
        variance = 1e-12  # so small that the last step, on what is not proven, changes nothing
        total = variance + (MODEL_ERROR * light) ** 2

        def cost(x, across=across, light=light, total=total):
            left = across - np.array(axes.white[1:]) * x[0] - np.array(axes.bounce[1:]) * x[1]
            wide_b = 1.0 if x[0] >= 0 else NO_GLOSS
            wide_c = 0.3 if x[1] >= 0 else 0.05
            return (
                (left**2).sum() / total
                + (x[0] / light / wide_b) ** 2
                + (x[1] / (light * axes.exposure / axes.length) / wide_c) ** 2
            )

        options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000}
        starts = ([0.0, 0.0], [0.05, 0.05], [-0.05, 0.2])
        least = min(minimize(cost, start, method="Nelder-Mead", options=options).fun for start in starts)
        b, c, _ = split(np.array([light]), across[:, None], np.array([variance]), axes, bounce=True)
        assert cost([b[0], c[0]]) <= least * (1 + 1e-3) + 1e-3


@given(
    st.sampled_from(list(BODIES.values())),
    st.floats(1e-4, 2),
    st.floats(-1, 1),
    st.floats(-1, 1),
    st.floats(1e-10, 0.1),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_it_moves_continuously_and_stays_finite(body, light, y1, y2, variance, bounce, gloss, doubted):
    axes = frame(np.array(body), 0.55)
    light = np.array([light, light * (1 + 1e-6)])
    across = np.array([[y1, y1 + 1e-7], [y2, y2 - 1e-7]])
    for values in split(light, across, np.full(2, variance), axes, bounce, gloss, doubted=doubted)[:2]:
        assert np.isfinite(values).all()
        assert abs(values[1] - values[0]) < 1e-2 * max(1, np.abs(values).max())


def test_what_the_noise_does_not_prove_is_none():
    axes = frame(np.array(BODIES["pale"]))
    rng = np.random.default_rng(0)
    light = np.ones(5000)
    matte = rng.normal(0, 0.05, (2, 5000))
    found, _, _ = split(light, matte, np.full(5000, 0.05**2), axes, bounce=False)
    assert (found == 0).mean() > 0.9
    raw = matte[0] / axes.white[1]
    assert np.abs(found).mean() < 0.1 * np.abs(raw).mean()


def test_gloss_and_bounce_that_make_up_for_each_other_are_none_where_noise_explains_them():
    axes = frame(np.array(BODIES["pale"]), 0.55)
    rng = np.random.default_rng(0)
    light, variance = np.ones(5000), np.full(5000, 0.004**2)
    noise = rng.normal(0, 0.004, (2, 5000))
    # Without a price on each, noise makes both; with it, neither.
    plain, sure = (split(light, noise, variance, axes, bounce=True, doubted=d)[:2] for d in (False, True))
    assert all(np.abs(after).mean() < 0.5 * np.abs(before).mean() for before, after in zip(plain, sure, strict=True))
    # What there is, stays; both together, where there is little noise.
    for b, c, grain in ((0.1, 0.0, 1.0), (0.0, 0.2, 1.0), (0.2, 0.4, 0.01)):
        across = b * np.array(axes.white[1:])[:, None] + c * np.array(axes.bounce[1:])[:, None] + grain * noise
        gloss, bounce, _ = split(light, across, grain**2 * variance, axes, bounce=True, doubted=True)
        assert np.median(gloss) == pytest.approx(b, abs=0.02)
        assert np.median(bounce) == pytest.approx(c, abs=0.05)


def test_no_more_gloss_than_light():
    axes = frame(np.array([0.4, 0.395, 0.4]))
    found, _, _ = split(np.ones(3), np.array([[0.5, 5, 50], [0, 0, 0]]), np.full(3, 1e-6), axes, bounce=False)
    assert (found <= 1 / axes.white[0] + 1e-12).all()
