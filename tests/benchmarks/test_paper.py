"""The paper's claims, put to the test on small renders; docs/paper.md has the same with larger ones."""

import numpy as np
import pytest

from dyehouse.benchmarks import laboratory, paper_claims, paper_pictures
from dyehouse.benchmarks.paper_tables import CUPS, POSITIONS, Objects

QUICK = laboratory.Settings(size=64, samples=12)


@pytest.fixture(scope="module", autouse=True)
def _cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYEHOUSE_CACHE", str(tmp_path_factory.mktemp("renders")))
        yield


@pytest.fixture(scope="module")
def cups():
    return Objects("mug", CUPS, QUICK)


@pytest.fixture(scope="module")
def fabrics():
    return Objects("fabric_cylinder", ("blue", "purple"), QUICK)


@pytest.fixture(scope="module")
def cloth():
    return Objects("folds_mixed", ("red", "blue"), QUICK)


@pytest.fixture(scope="module")
def plastic(cups):
    return paper_pictures.synthesize(cups, "yellow", ("red", "green", "blue"), paper_pictures.parts_of_mug(cups))


@pytest.fixture(scope="module")
def draped(cloth):
    return paper_pictures.cloth_in_other_light(cloth, paper_pictures.parts_of_folds(cloth))


# --- the instrument
@pytest.mark.parametrize("scene", POSITIONS)
def test_the_spectroradiometer_looks_at_the_object(scene):
    objects = Objects(scene, ("blue",), QUICK)
    for x, y in map(objects.pixel, objects.positions):
        assert (objects.view.mask[y - 1 : y + 2, x - 1 : x + 2] > 0.999).all()


def test_gloss_takes_the_yellow_cup_above_1_and_5_is_the_darkest(cups):
    yellow = cups.readings[CUPS.index("yellow")].max(axis=-1)
    assert yellow[cups.positions.index("highlight")] > 1.2
    assert yellow[:5].argmin() == 4


def test_every_pair_returns_the_reference(cups):
    np.testing.assert_allclose(cups.differences[..., 0], 0, atol=1e-6)


# --- Tables 1 to 3
def test_differences_are_of_the_size_of_table_1(cups):
    found = cups.differences[:, 0, 1:5].T
    assert np.median(found) < np.median(paper_claims.TABLE_1)
    assert found.max() < 1.5 * paper_claims.TABLE_1.max()


def test_an_objects_own_pair_is_best(cups, fabrics):
    for objects in (cups, fabrics):
        error = objects.differences[:, :, 1:5].mean(axis=-1)  # pairs, objects
        assert (error.argmin(axis=0) == np.arange(len(objects.colors))).all()


def test_variation_is_below_2_percent_for_most_positions(cups, fabrics):
    assert paper_claims.variation_is_small(cups, fabrics).holds
    assert (cups.spread_map < paper_claims.LIMIT).mean() > 0.9
    assert cups.spread[1:5].max() < 1.5 * paper_claims.TABLE_3["plastic"].max()


def test_the_bound_is_above_the_difference_as_a_and_b_are_negatively_correlated(cups, fabrics):
    assert paper_claims.bound_is_upper_limit(cups, fabrics).holds
    assert np.median(cups.correlation[1:5]) < -0.5
    assert np.median(fabrics.correlation[1:5]) < -0.5


# --- pictures
def test_variation_and_residual_are_of_the_papers_size(cups, plastic):
    fits = paper_pictures.variation(cups, "observer, no noise")
    whole = plastic[0].parts["object"]
    assert 0.1 < fits.spread[whole].mean() < paper_claims.VARIATION
    assert 0.1 * paper_claims.RESIDUAL < fits.residual[:, whole].mean() < 3 * paper_claims.RESIDUAL


def test_variation_is_larger_at_a_highlight_that_the_camera_clips(cups, plastic):
    parts = plastic[0].parts
    assert min(part.sum() for part in parts.values()) >= 8
    spread = {
        camera: paper_pictures.variation(cups, camera).spread
        for camera in ("observer, no noise", "observer, 12-bit raw with noise")
    }
    ratio = {camera: E[parts["highlight"]].mean() / E[parts["wall"]].mean() for camera, E in spread.items()}
    assert ratio["observer, 12-bit raw with noise"] > 2
    assert ratio["observer, no noise"] < 1


def test_synthesized_plastic_is_close_to_the_truth(plastic):
    assert paper_claims.plastic_is_close(plastic).holds


def test_deep_folds_are_worst(cups, plastic, draped):
    claim = paper_claims.deep_folds_are_worst(draped["daylight before and after"], plastic)
    assert claim.holds, claim.found


def test_another_light_is_b_times_the_new_white_and_not_as_printed(draped):
    mug = paper_pictures.mug_in_other_light(QUICK)
    right, printed = (np.quantile(mug[kind].within("object"), 0.95) for kind in ("B W'", "B W'/W as printed"))
    assert right < 5
    assert printed > 1.5 * right
    mixed, same = (np.median(draped[kind].within("object")) for kind in ("B W'", "daylight before and after"))
    assert mixed < 1.5 * same


def test_coefficients_of_cotton_fail_on_satin():
    claim = paper_claims.cotton_fails_on_satin(paper_pictures.cotton_and_satin(QUICK))
    assert claim.holds, claim.found
