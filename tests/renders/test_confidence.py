"""Predicted against true error, on quick renders: half of the cases that the weights were not fitted to, and all."""

import os
from dataclasses import replace

import numpy as np
import pytest

from dyehouse.benchmarks import laboratory, speed_accuracy
from dyehouse.benchmarks.calibration import BAD, CAMERAS, GOOD, cases, rank_correlation, scores
from dyehouse.benchmarks.speed_accuracy import FAILURES, WELL_BEHAVED, pairs
from dyehouse.core import analyze

FAST = replace(laboratory.FAST, threads=2)
COLORS = {name: speed_accuracy.COLORS[name] for name in ("blue", "red")}
SEEN_BY = {name: CAMERAS[name] for name in ("float", "8 bits", "noisy", "4 stops under")}
GIVEN_CACHE = os.environ.get("DYEHOUSE_CACHE")


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory):
    # The renders of a test session are shared by its modules; a folder that the user keeps is used as it is.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYEHOUSE_CACHE", GIVEN_CACHE or str(tmp_path_factory.getbasetemp() / "renders-fast"))
        yield


@pytest.fixture(scope="module")
def found():
    """Every scene through four cameras, from blue to red and back."""
    return list(cases((*WELL_BEHAVED, *FAILURES), FAST, SEEN_BY, COLORS))


def test_predicted_and_true_medians_rank_alike(found):
    assert len(found) > 100
    assert scores(found).correlation > 0.8
    held_out = [case for case in found if case.held_out]
    assert len(held_out) > 40
    assert scores(held_out).correlation > 0.75


def test_nine_tenths_of_pixels_are_below_their_bounds(found):
    assert 0.87 < scores(found).below_pixel < 0.95
    assert 0.85 < scores(found).below_region < 0.95


def test_what_is_bad_is_flagged_and_what_is_good_is_not(found):
    score = scores(found)
    assert score.bad >= 4
    # Noise hides a second light from the program: its cases lie at the limit, and are missed.
    missed = [case for case in found if case.median > BAD and not case.flagged]
    assert {case.scene for case in missed} <= {"two_lights"}
    assert all(case.median < 5.5 for case in missed)
    assert score.good_flagged <= 0.07 * score.good


def test_within_a_picture_the_worse_pixels_are_predicted_worse(found):
    ranks = [rank_correlation(case.predicted(), case.errors) for case in found]
    assert np.median(ranks) > 0.1


@pytest.mark.parametrize("scene", ["satin", "metal", "two_lights"])
@pytest.mark.parametrize("source", COLORS)
def test_silk_metal_and_two_lights_are_told_every_time(scene, source):
    [pair] = [p for p in pairs(scene, FAST, COLORS) if p.source == source]
    analysis = analyze(pair.photo, pair.white, pair.view.reference, pair.view.mask)
    said = analysis.predicted(pair.color(pair.truth)).warnings
    assert any("silk" in s or "metal" in s or "more than one color" in s for s in said)


def test_the_bars_are_those_of_the_issue():
    assert (GOOD, BAD) == (2, 5)
