"""The spectral form of the paper, its inequality, and its slips."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dyehouse.core import reflectance, spectra
from dyehouse.core.errors import ReferenceColorError

WAVELENGTHS = np.arange(400.0, 701, 10)
RED, BLUE, GRAY = (spectra.chart()[name].at(WAVELENGTHS) for name in ("red", "blue", "neutral 5 (.70 D)"))
MATCHING = spectra.observer().at(WAVELENGTHS)
RNG = np.random.default_rng(2)

coefficients = st.integers(1, 6).flatmap(
    lambda n: st.tuples(*[arrays(np.float64, (n, 2), elements=st.floats(-5, 5, width=32)) for _ in "ab"])
)


def close(ours, expected, atol=1e-9):
    np.testing.assert_allclose(ours, expected, rtol=0, atol=atol)


@pytest.mark.parametrize("weights", [None, MATCHING[:, 1], MATCHING], ids=["equal", "one", "three"])
def test_fit_finds_the_coefficients_of_the_model(weights):
    a, b = RNG.uniform(0, 2, (4, 5)), RNG.uniform(-0.1, 0.5, (4, 5))
    spectra_y = reflectance.predict(a, b, RED)
    assert spectra_y.shape == (4, 5, 31)
    fitted_a, fitted_b = reflectance.fit(RED, spectra_y, weights)
    close(fitted_a, a)
    close(fitted_b, b)
    close(reflectance.residual(RED, spectra_y, fitted_a, fitted_b), 0)


@pytest.mark.parametrize("weights", [None, MATCHING[:, 1], MATCHING], ids=["equal", "one", "three"])
def test_fit_minimizes_the_weighted_error(weights):
    # Eq. (18) as numpy solves it: the rows of the design times the root of the weight.
    noisy = 0.7 * RED + 0.1 + RNG.normal(0, 0.05, RED.shape)
    w = np.ones(31) if weights is None else weights.reshape(31, -1).sum(axis=1)
    design = np.column_stack([RED, np.ones(31)]) * np.sqrt(w)[:, None]
    expected = np.linalg.lstsq(design, noisy * np.sqrt(w))[0]
    close(reflectance.fit(RED, noisy, weights), expected)


def test_residual_is_signed():
    close(reflectance.residual(RED, RED + 0.25, 1, 0), 0.25)


def test_weights_of_several_sensors_are_stacked_equations():
    noisy = 0.7 * RED + 0.1 + RNG.normal(0, 0.05, RED.shape)
    root = np.sqrt(MATCHING.T.ravel())
    design = np.column_stack([np.tile(RED, 3), np.ones(93)]) * root[:, None]
    expected = np.linalg.lstsq(design, np.tile(noisy, 3) * root)[0]
    close(reflectance.fit(RED, noisy, MATCHING), expected)


def test_scale_of_weights_does_not_matter():
    noisy = RED + RNG.normal(0, 0.05, RED.shape)
    close(reflectance.fit(RED, noisy, MATCHING), reflectance.fit(RED, noisy, 1e6 * MATCHING))


def test_prediction_is_the_target_material_there():
    # (13), (16), (17): body and gloss factors at x and y, the target sharing the geometry.
    body_x, gloss_x, body_y, gloss_y = 0.9, 0.02, 0.5, 0.3
    a, b = reflectance.fit(body_x * RED + gloss_x, body_y * RED + gloss_y)
    assert a == pytest.approx(body_y / body_x)
    assert b == pytest.approx(gloss_y - body_y / body_x * gloss_x)
    close(reflectance.predict(a, b, body_x * BLUE + gloss_x), body_y * BLUE + gloss_y)


def test_glossy_reference_makes_b_negative():
    b = reflectance.fit(0.9 * RED + 0.3, 0.9 * RED)[1]
    assert b == pytest.approx(-0.3)


@pytest.mark.parametrize("flat", [np.full(31, 0.5), np.zeros(31), 0.4 + 1e-5 * RED], ids=["gray", "black", "pale"])
def test_flat_reference(flat):
    with pytest.raises(ReferenceColorError, match="more saturated"):
        reflectance.fit(flat, RED)


def test_flat_where_the_sensor_sees():
    step = np.where(WAVELENGTHS < 600, 0.2, 0.8)
    with pytest.raises(ReferenceColorError, match="flat"):
        reflectance.fit(step, RED, np.where(WAVELENGTHS < 600, 1.0, 0.0))
    assert np.isfinite(reflectance.fit(step, RED)).all()


def test_a_real_gray_patch_is_not_flat_enough_to_refuse():
    assert np.isfinite(reflectance.fit(GRAY, GRAY)).all()


def test_missing_values():
    holed = RED.copy()
    holed[3] = np.nan
    with pytest.raises(ReferenceColorError, match="missing values"):
        reflectance.fit(holed, RED)
    a, b = reflectance.fit(RED, np.stack([RED, holed]))
    np.testing.assert_array_equal(np.isfinite([a, b]), [[True, False], [True, False]])


@pytest.mark.parametrize(
    ("reference", "spectrum", "weights", "said"),
    [
        (RED, RED[:-1], None, "do not match"),
        (RED, RED, MATCHING[:-1], "do not match"),
        (np.stack([RED, RED]), RED, None, "do not match"),
        (RED, RED, np.zeros(31), "negative or all zero"),
        (RED, RED, -MATCHING, "negative or all zero"),
    ],
)
def test_bad_shapes_and_weights(reference, spectrum, weights, said):
    with pytest.raises(ValueError, match=said):
        reflectance.fit(reference, spectrum, weights)


def camera(light: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
    """V of Eqs. (11) and (27) with c = 1, for spectra (..., n)."""
    return spectrum @ (light[:, None] * MATCHING)


@given(st.floats(0.1, 3), st.floats(-0.05, 0.6))
def test_rgb_form_agrees_with_spectral_form(a, b):
    # (27)-(31): a linear camera keeps R_y = a R_x + b as V_y = A V_x + B W, under any light.
    for name in ("D65", "A", "FL11"):
        light = spectra.illuminant(name).at(WAVELENGTHS, linear=True)
        reference, white = camera(light, RED), camera(light, np.ones(31))
        other = camera(light, a * RED + b)
        A, B = np.linalg.lstsq(np.column_stack([reference, white]), other)[0]
        close([A, B], reflectance.fit(RED, a * RED + b), 1e-9)


def test_new_light_needs_b_times_the_new_white():
    # (35): B W' is right; B W'/W, as printed, only where W = (1, 1, 1).
    a, b = 0.6, 0.2
    old, new = (spectra.illuminant(name).at(WAVELENGTHS, linear=True) for name in ("D65", "A"))
    truth = camera(new, a * BLUE + b)
    white, new_white = camera(old, np.ones(31)), camera(new, np.ones(31))
    close(a * camera(new, BLUE) + b * new_white, truth)
    assert np.abs(a * camera(new, BLUE) + b * new_white / white - truth).max() > 0.1 * truth.max()


def test_angles_of_equations_5_and_6():
    # Integrating cos t sin t against the delta at one angle leaves sin 2t / 2, not cos 2t / 2.
    angle = np.linspace(0.1, 1.5, 50)
    close(np.cos(angle) * np.sin(angle), np.sin(2 * angle) / 2)
    assert np.abs(np.cos(angle) * np.sin(angle) - np.cos(2 * angle) / 2).max() > 0.4


@given(coefficients)
def test_inequality_26(pair):
    # (24)-(26): the bound is never below the exact expectation of (22).
    a, b = pair
    exact, bound = reflectance.spread_exact(a, b), reflectance.spread(a, b)
    assert exact.shape == bound.shape == (2,)
    assert (exact <= bound + 1e-12).all()
    assert (exact >= 0).all()


@given(coefficients)
def test_exact_spread_is_the_integral(pair):
    a, b = pair
    # The midpoint rule is exact on straight pieces; only the one step holding the kink is off.
    steps = 2000
    R = (np.arange(steps) + 0.5)[:, None, None] / steps
    line = (a.mean(axis=0) - a) * R + (b.mean(axis=0) - b)
    expected = np.abs(line).mean(axis=0).mean(axis=0)
    close(reflectance.spread_exact(a, b), expected, 10 / steps**2)


@given(st.lists(st.floats(0, 2), min_size=1, max_size=6))
def test_bound_is_tight_where_deviations_agree_in_sign(values):
    a = np.array(values)
    close(reflectance.spread_exact(a, 0.3 * a), reflectance.spread(a, 0.3 * a))


def test_negative_correlation_makes_the_bound_generous():
    # The paper's observation: what a adds, b takes away.
    a = np.array([0.9, 1.0, 1.1])
    b = 0.05 - 0.5 * (a - 1)
    assert reflectance.spread_exact(a, b) == pytest.approx(reflectance.spread(a, b) / 4)


def test_one_object_has_no_spread():
    assert reflectance.spread([0.5], [0.1]) == reflectance.spread_exact([0.5], [0.1]) == 0


def test_mean_of_the_codes_is_not_128():
    # (33) prints 128 for the mean of 0..255.
    A = np.array([0.9, 1.1])
    assert np.arange(256).mean() == 127.5
    assert reflectance.spread_rgb(A, np.zeros(2)) == pytest.approx(127.5 * 0.1)


def test_b_of_33_must_carry_the_white():
    # With B of (28) the white belongs in the bound; with B W in place of B the printed form is right.
    A, B, white = np.array([0.9, 1.1]), np.array([0.02, 0.06]), 240.0
    assert reflectance.spread_rgb(A, B, white=white) == pytest.approx(127.5 * 0.1 + 240 * 0.02)
    assert reflectance.spread_rgb(A, B * white) == reflectance.spread_rgb(A, B, white=white)
    assert reflectance.spread_rgb(A, B) == pytest.approx(127.5 * 0.1 + 0.02)


def test_spread_by_channel():
    A, B = RNG.uniform(0, 1, (3, 4, 5)), RNG.uniform(0, 1, (3, 4, 5))
    white = np.array([1.2, 1.0, 0.5])
    by_channel = reflectance.spread_rgb(A, B, top=1, white=white)
    assert by_channel.shape == (4, 5, 3)
    for channel in range(3):
        close(by_channel[..., channel], reflectance.spread_rgb(A, B, top=1, white=white[channel]))
    close(reflectance.spread_rgb(A, B, top=1, white=1), reflectance.spread(A, B))


@given(coefficients, st.floats(0, 2))
def test_bound_holds_for_camera_output(pair, white):
    # (33) with B W bounds the mean of |ΔA V + ΔB W| over V in 0..top.
    A, B = pair
    exact = reflectance.spread_exact(A, B * white)
    assert (exact <= reflectance.spread_rgb(A, B, top=1, white=white) + 1e-12).all()
