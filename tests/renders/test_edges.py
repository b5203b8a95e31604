"""Outlines and the light on the surround, on quick renders; errors are 95th percentiles in three pixels."""

from dataclasses import replace

import numpy as np
import pytest

from dyehouse.benchmarks.calibration import SOLES, colored_ground, rim, surround
from dyehouse.benchmarks.speed_accuracy import pairs
from dyehouse.core import analyze
from dyehouse.core.neighborhood import dilate, erode

from .quick import COLORS, FAST

pytestmark = pytest.mark.usefixtures("shared_renders")

FINER = replace(FAST, size=128)
"""For the sole, which is four pixels wide."""


def mean_rim(found, wrong, **options):
    return np.mean([rim(pair, wrong, **options) for pair in found])


@pytest.mark.parametrize(
    ("scene", "bar"), [("mug", 2.5), ("fabric_cylinder", 2), ("clipped", 2), ("mug_daylight", 2.5)]
)
def test_a_soft_outline_on_neutral_ground(scene, bar):
    found = list(pairs(scene, FAST, COLORS))
    assert mean_rim(found, None) <= bar
    assert mean_rim(found, None, plain=True) > 2.5 * bar


@pytest.mark.parametrize("sole", SOLES)
def test_a_soft_outline_on_colored_ground(sole):
    found = list(colored_ground(SOLES[sole], FINER, COLORS))
    assert mean_rim(found, None) <= 4
    assert mean_rim(found, None, plain=True) > 8


@pytest.mark.parametrize(("wrong", "bar"), [(-2, 8), (-1, 7), (0, 6), (1, 2.5), (2, 2.5)])
def test_a_mask_a_few_pixels_wrong_on_neutral_ground(wrong, bar):
    assert mean_rim(list(pairs("mug", FAST, COLORS)), wrong, spill=True) <= bar


@pytest.mark.parametrize(("wrong", "bar"), [(-2, 16), (-1, 9), (0, 6), (1, 9)])
def test_a_mask_a_few_pixels_wrong_on_colored_ground(wrong, bar):
    for sole in SOLES.values():
        assert mean_rim(list(colored_ground(sole, FINER, COLORS)), wrong, spill=True) <= bar


@pytest.mark.parametrize("scene", ["mug", "fabric_cylinder", "folds", "sneaker", "color_bleeding", "metal", "heather"])
def test_a_mask_that_is_too_tight_is_told_and_no_other(scene):
    for pair in pairs(scene, FINER, COLORS):
        true = pair.view.mask > 0.5

        def warns(mask, pair=pair):
            found = analyze(pair.photo, pair.white, pair.view.reference, mask)
            return any("leaves out a rim" in said for said in found.warnings)

        assert not any(warns(mask) for mask in (pair.view.mask, true, dilate(true, 1)))
        assert all(warns(erode(true, pixels)) for pixels in (1, 2, 3))


@pytest.mark.parametrize("scene", ["color_bleeding", "folds"])
def test_bleeding_on_a_neutral_surround_moves_along(scene):
    found = [surround(pair, spill=True) for pair in pairs(scene, FAST, COLORS)]
    median, high = np.mean(found, axis=0)
    assert median <= 0.3
    assert high <= 1.5
    left = np.mean([surround(pair, spill=False) for pair in pairs(scene, FAST, COLORS)], axis=0)
    assert left[0] > 5 * median
    assert left[1] > 5 * high


def test_nothing_outside_the_mask_changes_unless_asked():
    pair = next(iter(pairs("color_bleeding", FAST, COLORS)))
    hard = pair.view.mask > 0.5
    made = analyze(pair.photo, pair.white, pair.view.reference, hard).recolor(pair.color(pair.truth))
    np.testing.assert_array_equal(made[~hard], pair.photo[~hard])
