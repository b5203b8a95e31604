"""Rivals must be done fairly, or beating them says nothing."""

import colorsys

import numpy as np
import pytest

from dyehouse.benchmarks import rivals
from dyehouse.benchmarks.rivals import PLAIN, Task

MEETS_THE_TARGET = ("hue shift (display codes)", "Blender Hue/Saturation", "Blender Mix Color", "Blender Mix Multiply")
GREEN = np.array([0.06, 0.30, 0.07])


@pytest.fixture
def task(product):
    ball = product(noise=0.0)
    return Task(ball.image, ball.mask > 0, ball.body, GREEN, ball.in_color(GREEN, ball.white), ball.white)


@pytest.fixture
def colors():
    return np.random.default_rng(0).random((20, 30, 3))


@pytest.mark.parametrize("name", PLAIN)
def test_only_the_region_changes(name, task):
    done = PLAIN[name](task)
    np.testing.assert_array_equal(done[~task.region], task.picture[~task.region])
    assert np.median(done[task.region][:, 1]) > 2 * np.median(task.picture[task.region][:, 1])
    assert np.isfinite(done).all()


@pytest.mark.parametrize("name", MEETS_THE_TARGET)
def test_the_reference_meets_the_target(name, task):
    patch = np.full((2, 2, 3), task.reference)
    one = Task(patch, np.ones((2, 2), bool), task.reference, GREEN, patch, task.white)
    np.testing.assert_allclose(PLAIN[name](one), np.full((2, 2, 3), GREEN), atol=1e-9)


@pytest.mark.parametrize("name", PLAIN)
def test_its_own_color_is_left_alone(name, task):
    same = Task(task.picture, task.region, task.reference, task.reference, task.picture, task.white)
    matte = same.matte()
    np.testing.assert_allclose(PLAIN[name](same)[matte], same.picture[matte], atol=0.02)


@pytest.mark.parametrize("spread", [False, True])
def test_reinhard_moves_the_statistics_of_the_object_without_highlights(spread, task):
    matte = task.matte()
    assert 0.5 * task.region.sum() < matte.sum() < task.region.sum()
    done, goal = (rivals.to_lab(picture[matte]) for picture in (rivals.reinhard(task, spread), task.example))
    np.testing.assert_allclose(done.mean(axis=0), goal.mean(axis=0), atol=1e-3)
    if spread:
        np.testing.assert_allclose(done.std(axis=0), goal.std(axis=0), rtol=0.02)


def test_conversions_return_and_agree_with_the_standard_library(colors):
    np.testing.assert_allclose(rivals.from_hsv(rivals.to_hsv(colors)), colors, atol=1e-12)
    np.testing.assert_allclose(rivals.from_lab(rivals.to_lab(colors)), colors, atol=1e-9)
    np.testing.assert_allclose(rivals.to_hsv(colors)[0, 0], colorsys.rgb_to_hsv(*colors[0, 0]), atol=1e-12)
    np.testing.assert_array_equal(rivals.to_hsv(np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize("setting", [(0.2, 0.7, 1.3), (0.9, 1.8, 0.5)])
def test_hue_saturation_is_blenders(setting, colors):
    hue, saturation, value = setting
    node = rivals.through_blender(colors, "hue_saturation", Hue=(hue + 0.5) % 1, Saturation=saturation, Value=value)
    np.testing.assert_allclose(rivals.shift_hsv(colors, *setting), node, atol=2e-6)


def test_mix_color_is_blenders(colors):
    node = rivals.through_blender(colors, "color", B=(*GREEN, 1.0))
    np.testing.assert_allclose(rivals.mix_color(colors, GREEN), node, atol=1e-6)
    node = rivals.through_blender(colors, "multiply", B=(3.0, 0.3, 0.07, 1.0))
    np.testing.assert_allclose(colors * (3.0, 0.3, 0.07), node, atol=1e-6)
