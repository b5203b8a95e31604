"""Noise gain and predicted error, before anything is recolored."""

import colour
import numpy as np
import pytest

from dyehouse.core import stability
from dyehouse.core.picture import Picture


@pytest.mark.parametrize(("chroma", "gain"), [(10, 5.6), (5, 11)])
def test_noise_gain_of_the_method_page(chroma, gain):
    # 5.6 at C* = 10 and 11 at C* = 5 for L* = 50, whatever the hue: mean over hues.
    gains = []
    for hue in np.radians(np.arange(0, 360, 15)):
        xyz = colour.Lab_to_XYZ([50, chroma * np.cos(hue), chroma * np.sin(hue)], (0.3127, 0.3290))
        rgb = colour.XYZ_to_RGB(xyz, "sRGB", apply_cctf_encoding=False)
        gains.append(stability.noise_gain(rgb, np.ones(3)))
    assert np.median(gains) == pytest.approx(gain, rel=0.2)
    assert min(gains) > 0.4 * gain


def test_noise_gain_is_one_over_the_sine_of_the_angle():
    white = np.array([0.9, 1.0, 0.6])
    for degrees in (5, 30, 54):
        # Turned from the white by a known angle, in white-balanced coordinates.
        axis, away = np.ones(3) / 3**0.5, np.array([1, -1, 0]) / 2**0.5
        balanced = np.cos(np.radians(degrees)) * axis + np.sin(np.radians(degrees)) * away
        assert stability.noise_gain(balanced * white * 0.3, white) == pytest.approx(
            1 / np.sin(np.radians(degrees)), rel=1e-9
        )
    assert stability.noise_gain(white * 0.4, white) > 1e6


def test_matrix_gain_is_the_largest_growth_of_a_vector():
    matrix = np.random.default_rng(0).normal(size=(3, 3))
    directions = np.random.default_rng(1).normal(size=(200_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert stability.matrix_gain(matrix) == pytest.approx(np.linalg.norm(directions @ matrix.T, axis=1).max(), rel=1e-3)


def noisy_ramp(read, shot, seed=0):
    light = np.linspace(0.01, 0.9, 900)[None, :, None] * np.ones((400, 1, 3))
    sigma = np.sqrt(read**2 + shot * light)
    return (light + np.random.default_rng(seed).normal(size=light.shape) * sigma).astype(np.float32)


@pytest.mark.parametrize(("read", "shot"), [(0.004, 0.0), (0.002, 2e-4), (0.0005, 1e-3)])
def test_noise_is_found(read, shot):
    found = stability.estimate_noise(Picture(noisy_ramp(read, shot)))
    for light in (0.05, 0.2, 0.7):
        assert found.at(light) == pytest.approx(np.sqrt(read**2 + shot * light), rel=0.15)


def test_noise_scales_and_a_clean_picture_has_next_to_none():
    clean = stability.estimate_noise(Picture(noisy_ramp(0, 0)))
    assert clean.at(0.5) < 2e-4
    one, two = (stability.estimate_noise(Picture(noisy_ramp(r, 0))).at(0.4) for r in (0.003, 0.006))
    assert two == pytest.approx(2 * one, rel=0.1)


def test_edges_are_not_noise():
    stripes = noisy_ramp(0.002, 0)
    stripes[:, ::40] += 0.5
    assert stability.estimate_noise(Picture(stripes)).at(0.4) == pytest.approx(0.002, rel=0.2)


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (5, 2), (2, 3)])
def test_noise_of_tiny_pictures(shape):
    found = stability.estimate_noise(Picture(np.full((*shape, 3), 0.3, np.float32)))
    assert np.isfinite(found.at(np.array([0, 0.5, 1]))).all()
