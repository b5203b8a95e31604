"""Predicted error: what it is made of, and how it answers to noise, misfit and distance."""

import numpy as np
import pytest

from dyehouse.core import analyze, transfer
from dyehouse.core.confidence import FLAG, WEIGHTS, Prediction
from dyehouse.core.picture import Picture

FAR = np.array([0.05, 0.1, 0.4])


def predictions(scene, target, **options):
    analysis = analyze(scene.image, scene.white, scene.body, scene.mask, **options)
    return analysis.predicted(target), analysis.predicted_error(target)


def test_map_and_region_of_the_own_color_of_an_object_that_fits(product):
    scene = product(noise=0.0)
    region, error = predictions(scene, scene.body)
    assert isinstance(region, Prediction)
    assert error.shape == scene.mask.shape
    assert error.dtype == np.float32
    assert np.isfinite(error).all()
    assert (error >= 0).all()
    assert (error[scene.mask == 0] == 0).all()
    assert np.median(error[scene.mask == 1]) < 0.3
    assert region.median < 0.3
    assert not region.flagged


def test_the_regions_figures_are_those_of_its_map(product):
    scene = product(noise=0.004)
    region, error = predictions(scene, FAR)
    inside = error[scene.mask == 1]
    assert region.median == pytest.approx(np.median(inside), rel=0.1)
    assert np.quantile(inside, 0.9) < region.bound90


def test_error_grows_with_what_the_model_does_not_explain(product):
    scene = product(noise=0.0)
    normal = np.cross(scene.body, scene.white)
    scene.image[:, :30] += (0.02 * normal / np.linalg.norm(normal)).astype(np.float32)
    error = predictions(scene, FAR, model="dichromatic")[1]
    spoiled, sound = scene.mask == 1, scene.mask == 1
    spoiled[:, 30:], sound[:, :31] = False, False
    assert np.median(error[spoiled]) > 3 * np.median(error[sound])


def test_error_grows_with_noise(product):
    quiet, noisy = (predictions(product(noise=noise), FAR, model="dichromatic")[0].median for noise in (0.002, 0.01))
    assert noisy > 2 * quiet


def test_error_grows_with_the_distance_of_the_target(product):
    scene = product(noise=0.0)
    normal = np.cross(scene.body, scene.white)
    scene.image += (0.02 * normal / np.linalg.norm(normal)).astype(np.float32)
    near, far = (predictions(scene, t, model="dichromatic")[0].median for t in (scene.body * 1.02, FAR))
    assert far > 2 * near


def test_coarse_codes_count_as_noise(product):
    scene = product(noise=0.0)
    dark = (scene.image * 0.02).astype(np.float32)
    codes = Picture(transfer.encode(dark, transfer.SRGB, np.uint8), transfer.SRGB)
    exact, coarse = (
        analyze(picture, scene.white * 0.02, scene.body * 0.02, scene.mask, "dichromatic").predicted(FAR * 0.02).median
        for picture in (dark, codes)
    )
    assert coarse > 2 * exact


def test_a_hopeless_change_is_flagged_with_a_remedy(product):
    scene = product((0.02, 0.019, 0.018), noise=0.01)
    region, _ = predictions(scene, (0.02, 0.5, 0.1))
    assert region.flagged
    assert region.median > FLAG
    assert any("probably be off by about" in sentence and ": " in sentence for sentence in region.warnings)
    assert all(sentence.endswith(".") for sentence in region.warnings)


def test_fibers_that_do_not_take_the_dye_are_doubted(product):
    scene = product(noise=0.0)
    fibers = np.random.default_rng(0).random(scene.mask.shape) < 0.3
    scene.image[fibers] += 0.1
    plain, woven = (predictions(s, FAR, model="dichromatic")[0].median for s in (product(noise=0.0), scene))
    assert woven > 2 * plain


@pytest.mark.parametrize("model", ["auto", "body", "dichromatic", "regularized", "bounce", "lights", "metal"])
@pytest.mark.parametrize("target", [(0, 0, 0), (0.4, 0.4, 0.4), (-0.02, 0.1, 2.0)])
def test_every_model_and_any_target_has_finite_figures(product, model, target):
    scene = product(noise=0.003)
    region, error = predictions(scene, target, model=model)
    assert np.isfinite([region.median, region.bound90]).all()
    assert np.isfinite(error).all()


def test_a_new_light_and_a_gray_product(product):
    scene = product((0.3, 0.3, 0.3), white=(1.0, 0.9, 0.6))
    analysis = analyze(scene.image, scene.white, scene.body, scene.mask)
    assert np.isfinite(analysis.predicted(FAR, (1.3, 0.9, 0.4)).bound90)


def test_exposure_of_photo_and_target_changes_nothing(product):
    scene = product(noise=0.003)
    one, four = (
        analyze(k * scene.image, k * scene.white, k * scene.body, scene.mask, "dichromatic")
        .doubt(k * FAR, k * scene.white)
        .parts(np.array([40, 50]), np.array([40, 60]))["noise"]
        for k in (1, 4)
    )
    np.testing.assert_allclose(one, four, rtol=0.05)


def test_large_photos_are_looked_at_on_a_grid(product, monkeypatch):
    scene = product(noise=0.003)
    fine = predictions(scene, FAR)[1]
    monkeypatch.setattr("dyehouse.core.analysis._MAPPED", 96 * 96 / 9)
    coarse = predictions(scene, FAR)[1]
    inside = scene.mask == 1
    assert (coarse[scene.mask == 0] == 0).all()
    assert np.median(coarse[inside]) == pytest.approx(np.median(fine[inside]), rel=0.1)
    np.testing.assert_array_equal(coarse[48, 48], fine[48, 48])


def test_the_parts_are_those_that_have_weights(product):
    scene = product()
    parts = analyze(scene.image, scene.white, scene.body, scene.mask).doubt(FAR).parts(np.array([48]), np.array([48]))
    assert set(parts) == set(WEIGHTS)
