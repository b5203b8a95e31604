"""Correction maps: noise, clipping, outlines, cells and strips."""

import numpy as np
import pytest

from dyehouse.core import Picture, analyze, maps, mixture, transfer
from dyehouse.core.interreflection import bounced
from dyehouse.core.maps import Region, corrections, with_corrections
from dyehouse.core.stability import Noise

WHITE = np.ones(3)
PALE = np.array([0.6, 0.45, 0.42])
TARGET = np.array([0.05, 0.3, 0.2])
QUIET = Noise(1e-6, 0.0)


def folded(body=PALE, *, size=90, noise=0.0, gloss=True, seed=0):
    """A product with shading, a highlight and a fold, all known; photo and true gloss and bounce."""
    y, x = np.mgrid[:size, :size] / (size - 1)
    shading = 0.4 + 0.6 * y
    shine = 0.25 * np.exp(-(((x - 0.3) / 0.06) ** 2)) if gloss else np.zeros_like(x)
    back = 0.3 * np.exp(-(((x - 0.75) / 0.08) ** 2))
    photo = shading[..., None] * body + shine[..., None] + back[..., None] * bounced(body, 0.55)
    photo += np.random.default_rng(seed).normal(0, noise, photo.shape) if noise else 0
    return photo.astype(np.float32), shading, shine, back


def test_gloss_and_bounce_of_a_clean_photo():
    photo, _, shine, back = folded()
    region = Region(Picture(photo), None, mixture.mapped("bounce", PALE, WHITE, 0.55), QUIET, clipped=False)
    found = corrections(region)
    assert (found.dtype, found.shape) == (np.float32, (90, 90, 2))
    np.testing.assert_allclose(found[..., 0], shine, atol=0.02)
    np.testing.assert_allclose(found[..., 1], back, atol=0.06)


def test_smoothing_takes_most_of_the_noise_and_keeps_the_highlight():
    photo, _, shine, back = folded(noise=0.01)
    clean, *_ = folded()
    m = mixture.mapped("regularized", PALE, WHITE)
    noisy, still = (
        corrections(Region(Picture(p), None, m, Noise(s, 0.0), clipped=False))[..., 0]
        for p, s in ((photo, 0.01), (clean, 1e-6))
    )
    plain = photo @ mixture.plain("dichromatic", PALE, WHITE).coefficient("white")
    matte = (shine < 1e-4) & (back < 1e-4)
    assert noisy[matte].std() < 0.3 * (plain - still)[matte].std()
    assert np.abs(noisy - still)[shine > 0.2].mean() < 0.03


@pytest.mark.parametrize("cells", [40, 11])
def test_cells_and_strips_hardly_change_the_maps(cells, monkeypatch):
    photo, *_ = folded(noise=0.004)
    region = Region(Picture(photo), None, mixture.mapped("bounce", PALE, WHITE, 0.55), Noise(0.004, 0.0), clipped=False)
    fine = corrections(region)
    monkeypatch.setattr(maps, "_STRIP", 90 * 7)
    np.testing.assert_allclose(corrections(region), fine, atol=1e-5)
    monkeypatch.setattr(maps, "_CELLS", cells)
    assert np.abs(corrections(region) - fine).mean() < 0.02


# --- clipping -------------------------------------------------------------------------------------------------


def overexposed(body, strength=1.2):
    y, x = np.mgrid[:80, :80] / 79 * 2 - 1
    shading = 0.75 + 0.1 * y
    shine = strength * np.exp(-(x**2 + y**2) / 0.05)
    full = (shading[..., None] * body + shine[..., None]).astype(np.float32)
    return full, np.minimum(full, 1), shading, shine


@pytest.mark.parametrize("model", ["dichromatic", "regularized"])
def test_clipped_highlights_are_restored_from_their_channels_and_their_neighbors(model):
    body = np.array([0.75, 0.2, 0.03])
    full, photo, shading, shine = overexposed(body)
    analysis = analyze(photo, WHITE, body, None, model)
    clipped = (full > 1).any(axis=2)
    one = clipped & ((full > 1).sum(axis=2) == 1)
    core = (full > 1).all(axis=2)
    assert one.sum() > 20 < core.sum()
    np.testing.assert_allclose(analysis.B[one], shine[one], atol=0.03)
    np.testing.assert_allclose(analysis.A[clipped], shading[clipped], atol=0.3)
    # Where all channels are gone the product stays as white as it was: no hole, and no dark rim.
    result = analysis.recolor(TARGET)
    truth = shading[..., None] * TARGET + shine[..., None]
    assert result[core].min() > 0.97
    assert (np.minimum(result, 1) > np.minimum(truth, 1) - 0.12)[clipped].all()
    bare = photo @ mixture.plain("dichromatic", body, WHITE).matrix(TARGET, WHITE, 0.0).T
    error, before = (np.abs(np.minimum(r, 1) - np.minimum(truth, 1))[clipped].mean() for r in (result, bare))
    assert error < 0.6 * before


@pytest.mark.parametrize("model", ["metal", "bounce"])
def test_clipped_highlights_of_metal_have_its_own_color(model):
    y, x = np.mgrid[:80, :80] / 79
    light = (0.4 + 0.3 * x)[..., None] + 2.0 * np.exp(-(((x - 0.5) / 0.1) ** 2 + ((y - 0.5) / 0.1) ** 2))[..., None]
    copper = np.array([0.72, 0.3, 0.16])
    photo = np.minimum(light * copper, 1).astype(np.float32)
    region = Region(
        Picture(photo),
        None,
        mixture.metal(copper, WHITE) if model == "metal" else mixture.mapped("bounce", copper, WHITE, 1.1),
        QUIET,
        clipped=True,
        shines=False,
    )
    final = with_corrections(region.mixture, clipped=True)
    made = np.concatenate([photo, corrections(region)], axis=2) @ final.matrix(TARGET, WHITE, 0.0).T
    one = (photo >= 1).sum(axis=2) == 1
    assert one.sum() > 100
    np.testing.assert_allclose(made[one], (light * TARGET)[one], atol=0.02)


def test_a_photo_without_clipping_has_no_corrections():
    full, *_ = overexposed(np.array([0.75, 0.2, 0.03]), strength=0.1)
    for picture in (full, Picture(transfer.encode(full, transfer.SRGB, np.uint8), transfer.SRGB)):
        analysis = analyze(picture, WHITE, (0.75, 0.2, 0.03), None, "dichromatic")
        assert analysis.extra is None
        assert analysis.matrix(TARGET).shape == (3, 3)


@pytest.mark.parametrize(
    ("model", "extras"),
    [
        (mixture.plain("body", PALE, WHITE), 2),
        (mixture.plain("dichromatic", PALE, WHITE), 2),
        (mixture.matte_bounce(PALE, WHITE, 0.5), 2),
        (mixture.mapped("regularized", PALE, WHITE), 2),
        (mixture.mapped("bounce", PALE, WHITE, 0.5), 3),
        (mixture.mapped("bounce", PALE, WHITE, 0.5, gloss=False), 3),
        (mixture.two_lights(PALE, WHITE, np.array([1.5, 1, 0.5])), 2),
        (mixture.metal(PALE, WHITE), 3),
    ],
)
def test_restoring_adds_columns_and_fits_what_is_known(model, extras):
    final = with_corrections(model, clipped=True)
    assert final.projector.shape[1] == 3 + extras <= 7
    photo, *_ = folded()
    photo = np.minimum(photo * 1.3, 1)
    found = corrections(Region(Picture(photo), None, model, QUIET, clipped=True))
    assert found.shape[2] == extras
    assert np.isfinite(found).all()
    own = np.concatenate([photo, found], axis=2) @ final.matrix(PALE, WHITE, 1.0).T
    np.testing.assert_allclose(own, photo, atol=1e-5)


# --- outlines and odd pictures ----------------------------------------------------------------------------------


def test_soft_outline_on_a_neutral_ground_leaves_no_rim():
    photo, shading, shine, back = folded()
    y, x = np.mgrid[:90, :90]
    cover = np.clip((38 - np.hypot(x - 45, y - 45)) / 4 + 0.5, 0, 1)
    mixed = (cover[..., None] * photo + (1 - cover[..., None]) * 0.3).astype(np.float32)
    analysis = analyze(mixed, WHITE, PALE, cover, "bounce")
    assert analysis.extra is not None
    truth = shading[..., None] * TARGET + shine[..., None] + back[..., None] * bounced(TARGET, 0.55)
    truth = cover[..., None] * truth + (1 - cover[..., None]) * 0.3
    error = np.abs(analysis.recolor(TARGET) - truth).max(axis=2)
    band = (cover > 0.02) & (cover < 0.98)
    assert np.quantile(error[band], 0.9) < 0.06
    np.testing.assert_array_equal(analysis.recolor(TARGET)[cover == 0][:50], mixed[cover == 0][:50])


@pytest.mark.parametrize("model", ["regularized", "bounce", "lights", "metal"])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e12])
def test_no_nan_for_any_finite_picture(model, scale):
    rng = np.random.default_rng(0)
    image = rng.normal(0.3, 0.4, (40, 50, 3)).astype(np.float32) * np.float32(scale)
    image[:5], image[5:9] = 0, -0.2
    image[10, 10] = 3e37
    mask = np.clip(rng.normal(0.5, 1, (40, 50)), 0, 1)
    analysis = analyze(image, WHITE, (0.5, 0.2, 0.1), mask, model)
    region = analysis.region(TARGET)
    assert np.isfinite(region.matrix).all()
    assert region.extra is None or np.isfinite(region.extra).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (2, 2), (3, 400)])
@pytest.mark.parametrize("model", ["regularized", "bounce", "lights", "metal", "auto"])
def test_tiny_pictures(shape, model):
    image = np.tile(np.array([0.5, 0.2, 0.1], np.float32), (*shape, 1))
    result = analyze(image, reference=(0.5, 0.2, 0.1), model=model).recolor(TARGET)
    np.testing.assert_allclose(result, np.broadcast_to(TARGET, (*shape, 3)), atol=1e-4)
