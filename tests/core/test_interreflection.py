"""Light that met the product more than once."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dyehouse.core.interreflection import USUAL, bounced, find_feedback, unbounced

RHO = np.array([0.72, 0.5, 0.46])
K = 0.6


def light_in_a_corner(rho, share, bounces):
    """Sum of all light that comes back, bounce by bounce."""
    return sum(share ** (n - 2) * rho**n for n in range(2, bounces))


def test_it_is_the_sum_of_all_bounces():
    np.testing.assert_allclose(bounced(RHO, K), light_in_a_corner(RHO, K, 200), rtol=1e-12)
    np.testing.assert_array_equal(bounced(RHO, 0), RHO**2)


def test_it_is_more_saturated_than_the_body():
    saturation = [1 - c.min() / c.max() for c in (RHO, bounced(RHO, 0), bounced(RHO, K))]
    assert saturation == sorted(saturation)


@given(arrays(np.float64, 3, elements=st.floats(-1, 1e6)), st.floats(0, 1e3))
def test_it_is_finite_and_grows_with_the_color(rho, k):
    assert np.isfinite(bounced(rho, k)).all()
    assert (bounced(rho, k) >= 0).all()
    assert (bounced(np.maximum(rho, 0) * 1.1, k) >= bounced(rho, k)).all()


@given(arrays(np.float64, 3, elements=st.floats(0, 1.5)), st.floats(0.05, 2), st.floats(0, 5))
def test_what_was_read_with_its_bounce_is_parted_from_it(rho, light, bounce):
    read = light * rho + bounce * bounced(rho, USUAL)
    np.testing.assert_allclose(unbounced(read, bounce, light), light * rho, rtol=1e-9, atol=1e-12)


@given(arrays(np.float64, 3, elements=st.floats(-1, 1e6)), st.floats(0.05, 2), st.floats(0, 1e3))
def test_parting_any_color_is_finite(color, light, bounce):
    assert np.isfinite(unbounced(color, bounce, light)).all()


@pytest.mark.parametrize("exposure", [1.0, 0.4])
@pytest.mark.parametrize("feedback", [0.2, 0.6, 0.9])
def test_feedback_and_exposure_are_found_together(exposure, feedback):
    rng = np.random.default_rng(0)
    direct, returned = rng.uniform(0.2, 1, 4000), rng.uniform(0, 1, 4000)
    pixels = exposure * (direct[:, None] * RHO + returned[:, None] * bounced(RHO, feedback))
    body = exposure * RHO
    light = pixels @ (body / np.linalg.norm(body))
    found = find_feedback(pixels / light[:, None], body, np.full(4000, 2e-3))
    assert found * exposure == pytest.approx(feedback, rel=0.25)


def test_without_folds_or_color_it_is_the_usual():
    flat = np.tile(RHO / np.linalg.norm(RHO), (500, 1))
    assert find_feedback(flat, RHO, np.full(500, 0.01)) == pytest.approx(USUAL)
    gray = np.full(3, 0.5)
    assert find_feedback(np.tile(gray, (500, 1)), gray, np.full(500, 0.01)) == USUAL
