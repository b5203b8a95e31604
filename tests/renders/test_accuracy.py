"""Recolored renders against renders of the product truly in the other color, scene by scene.

The bars are what was measured, with a small margin. They may only be tightened.
"""

import numpy as np
import pytest

from dyehouse.benchmarks import rivals, speed_accuracy
from dyehouse.benchmarks.speed_accuracy import BASE, FAILURES, OURS, WELL_BEHAVED, pairs, pooled
from dyehouse.core import analyze
from dyehouse.sample_blends import make_scenes

from .quick import COLORS, FAST

pytestmark = pytest.mark.usefixtures("shared_renders")


BARS = {  # scene: CIEDE2000, median and 95th percentile over the pairs
    "mug": (0.13, 0.6),
    "fabric_cylinder": (0.135, 0.43),
    "folds": (0.03, 0.19),
    "folds_mixed": (0.39, 1.76),
    "sneaker": (0.075, 0.35),
    "mug_daylight": (0.15, 0.74),
    "mug_mixed": (0.45, 1.78),
    "color_bleeding": (0.23, 0.76),
    "metal": (0.19, 9.6),
    "satin": (0.21, 0.71),
    "translucent_mug": (0.27, 1.12),
    "near_white": (0.72, 5.2),
    "near_black": (0.43, 1.68),
    "pale": (0.39, 2.4),
    "clipped": (0.13, 0.64),
    "two_lights": (2.25, 7.7),
    "heather": (0.92, 2.3),
}


def errors(scene, model="auto"):
    found = []
    for pair in pairs(scene, FAST, COLORS):
        analysis = analyze(pair.photo, pair.white, pair.view.reference, pair.view.mask, model)
        # Read at the same place of the true picture, with what gloss is there.
        target = analysis.matte_target(pair.color(pair.truth))
        found.append(pair.errors(analysis.recolor(target)))
    return np.concatenate(found)


def test_every_scene_has_a_bar():
    assert set(BARS) == set(make_scenes.SCENES) == {*WELL_BEHAVED, *FAILURES}


@pytest.mark.parametrize("scene", BARS)
def test_a_scene_stays_within_its_bars(scene):
    found = errors(scene)
    median, high = BARS[scene]
    assert np.median(found) <= median
    assert np.quantile(found, 0.95) <= high


def test_every_rival_is_worse_where_the_model_holds():
    rows = speed_accuracy.accuracy(WELL_BEHAVED, {BASE: OURS[BASE]} | rivals.PLAIN, FAST, COLORS)
    ours, *theirs = (pooled([row[name] for row in rows]) for name in rows[0])
    for median, high in theirs:
        assert ours[0] < median
        assert ours[1] < high


def test_gloss_needs_the_second_term():
    dichromatic, body = (np.quantile(errors("mug", model), 0.95) for model in ("dichromatic", "body"))
    assert dichromatic < body / 2


def test_precision_of_the_arithmetic_is_not_what_limits_it():
    names = (BASE, "3x3 matrix, float64", "A and B, float64", speed_accuracy.CODES)
    rows = speed_accuracy.accuracy(("mug",), {name: OURS[name] for name in names}, FAST, COLORS)
    single, double, coefficients, codes = (pooled([row[name] for row in rows]) for name in names)
    np.testing.assert_allclose(single, double, rtol=1e-3)
    np.testing.assert_allclose(double, coefficients, rtol=1e-6)
    assert single[0] < codes[0] < single[0] + 0.5


def test_a_greyish_scene_is_recolored_from_its_own_color_only():
    assert [(p.source, p.target) for p in pairs("pale", FAST, COLORS)] == [("its own", c) for c in COLORS]


def test_every_method_is_timed_and_repeated():
    seconds = speed_accuracy.times({}, rounds=2)
    assert set(seconds) == {*OURS, speed_accuracy.SPECTRAL_NAME}
    assert {len(each) for each in seconds.values()} == {2}
