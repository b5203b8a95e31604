"""Short runs of the curves of benchmarks/stability.py: errors grow as they must, and the program says what it can."""

import numpy as np
import pytest

from dyehouse.benchmarks import stability
from dyehouse.benchmarks.speed_accuracy import pairs
from dyehouse.benchmarks.stability import FALLS_BACK, NOTHING, REFUSES, Outcome, faultless, outcome

from .quick import COLORS, FAST


@pytest.fixture(scope="module", autouse=True)
def _two_colors(shared_renders):
    # From the first two colors to each other is enough here.
    shared_renders.setattr(stability, "TARGETS", COLORS)


def outcomes(curve):
    """Outcomes of every series, by its name."""
    return [[o for _, o in line.points] for line in curve.series]


def test_the_true_coefficients_are_found_when_nothing_is_wrong():
    best = outcome([faultless(p) for p in pairs("mug", FAST, COLORS, cut=False)])
    assert best.A < 0.01
    assert best.B < 0.002
    assert best.does == best.should == NOTHING


def test_pale_products_are_harder_and_the_palest_fall_back():
    pink, pink_camera, *_ = outcomes(stability.source_chroma(FAST, chromas=(3, 12, 48), hues={"pink": 20.0}))
    assert [o.does for o in pink_camera] == [FALLS_BACK, FALLS_BACK, NOTHING]
    assert pink_camera[0].should == FALLS_BACK
    assert pink_camera[0].mean > 2 * pink_camera[1].mean > 2 * pink_camera[2].mean
    assert pink_camera[0].auto_mean < pink_camera[0].mean / 2.5
    assert pink_camera[1].auto_mean < pink_camera[1].mean
    assert all(camera.mean > exact.mean for exact, camera in zip(pink, pink_camera, strict=True))


def test_error_grows_with_noise_and_with_steps():
    for line in outcomes(stability.noise(FAST, electrons=(1e5, 1e4, 1e3))):
        assert line[0].mean < line[1].mean < line[2].mean
        assert line[0].A < line[1].A < line[2].A
        assert line[0].B < line[1].B < line[2].B
    for line in outcomes(stability.bit_depth(FAST, bits=(4, 8))):
        assert line[0].mean > 2 * line[1].mean


def test_a_wrong_exposure_is_noticed():
    mug, _ = outcomes(stability.exposure(FAST, stops=(-6, 0, 2)))
    assert [o.does for o in mug] == [FALLS_BACK, NOTHING, REFUSES]  # noise asks for the regularized model
    assert mug[0].mean > mug[1].mean < mug[2].mean


def test_a_power_law_hardly_matters_and_an_s_curve_does():
    s_curve, gamma = outcomes(stability.tone_curve(FAST, exponents=(1, 1.4)))
    assert s_curve[1].mean > 2 * s_curve[0].mean
    assert gamma[1].mean < 1.3 * gamma[0].mean


def test_gloss_in_the_reference_ruins_a_flat_swatch_under_the_plain_model_only():
    flat, sample = outcomes(stability.contamination(FAST, shares=(0, 0.02, 0.1)))
    assert flat[0].median < 0.5
    assert 1 < flat[1].median < flat[2].median
    assert all(o.auto_median < 0.5 for o in flat)  # the gloss is found and taken away
    assert sample[2].median == pytest.approx(sample[0].median, rel=0.1)


def test_a_wrong_white_costs_little():
    for line in outcomes(stability.white_error(FAST, errors=(-0.15, 0, 0.15))):
        assert line[1].mean < line[0].mean < line[1].mean + 1
        assert line[1].mean < line[2].mean < line[1].mean + 1
    # Nor does it lead to other models that do worse.
    for line in outcomes(stability.white_error(FAST, errors=(-0.3, 0.3))):
        assert all(o.auto_mean < 1.02 * o.mean for o in line)


def test_auto_is_no_worse_than_the_plain_model_under_noise_and_coarse_steps():
    for curve in (stability.noise(FAST, electrons=(1e3, 300)), stability.bit_depth(FAST, bits=(6, 7, 8))):
        for line in outcomes(curve):
            assert all(o.auto_mean < 1.05 * o.mean for o in line)


def test_a_click_anywhere_is_worse_than_the_reference_that_is_found():
    flat, sample, found = outcomes(stability.random_reference(FAST, draws=12, steps=12))
    assert len(flat) == len(sample) == 12
    assert [o.mean for o in flat] == sorted(o.mean for o in flat)
    assert found[0].median < np.median([o.median for o in flat])
    assert np.median([o.median for o in sample]) < np.median([o.median for o in flat])


def test_error_grows_with_folds_and_with_light_through_the_wall():
    for line in outcomes(stability.fold_depth(FAST, depths=(0.01, 0.16), colors=COLORS)):
        assert line[1].mean > 3 * line[0].mean
        assert line[1].A > line[0].A
    for line in outcomes(stability.translucency(FAST, parts=(0.0, 0.75), colors=COLORS)):
        assert line[1].mean > 1.3 * line[0].mean


def test_a_tight_mask_leaves_a_rim_and_a_soft_one_does_not():
    soft, hard = outcomes(stability.mask_edge(FAST, blurs=(0, 3), grown=(-2, 0)))
    assert soft[1].mean < soft[0].mean
    assert hard[0].mean > 1.5 * hard[1].mean


def test_shrinking_by_light_costs_nothing():
    mug_light, *_ = outcomes(stability.resolution(FAST, factors=(1, 4)))
    assert mug_light[1].mean < 1.3 * mug_light[0].mean


@pytest.mark.parametrize(
    ("figures", "should"),
    [
        ((1, 3, 1, 2, 9, 3, 1, 3, 1), NOTHING),
        ((1, 3, 1, 1, 3, 0.8, 1, 3, 1), FALLS_BACK),
        ((3, 6, 3, 2.5, 6, 2, 3, 6, 3), REFUSES),
        ((1, 12, 3, 1, 11, 2, 1, 12, 3), REFUSES),
        ((3, 12, 4, 1.9, 9, 2, 3, 12, 4), FALLS_BACK),
        ((3, 12, 4, 3, 11, 4, 1, 5, 2), FALLS_BACK),
    ],
)
def test_what_it_should_do_follows_from_the_errors(figures, should):
    assert Outcome(*figures, A=0.0, B=0.0, does=NOTHING).should == should
