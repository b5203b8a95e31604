"""Soft outlines: the product's share of a mixed pixel, against composites put together here."""

import numpy as np
import pytest

from dyehouse.core import analyze, transfer
from dyehouse.core.compositing import Sides, refine_outline, rim_left_out, spill_weights
from dyehouse.core.neighborhood import dilate, erode
from dyehouse.core.picture import Picture
from dyehouse.core.recolor import RegionMatrix, recolor

BODY, TARGET = np.array([0.5, 0.1, 0.06]), np.array([0.06, 0.2, 0.5])
GROUND = np.array([0.1, 0.55, 0.2])  # colored, and not in the product's plane


@pytest.fixture
def composite():
    """Return (photo, cover, product, ground): a shaded disc with a soft outline of known cover."""
    y, x = np.mgrid[:80, :90].astype(float)
    cover = np.clip((30 - np.hypot(x - 45, y - 40)) / 4 + 0.5, 0, 1)
    shading = 0.4 + 0.6 * x / 90
    product = shading[..., None] * BODY
    ground = np.broadcast_to(GROUND, product.shape)
    photo = cover[..., None] * product + (1 - cover[..., None]) * ground
    return photo.astype(np.float32), cover, product, ground


def edge_of(photo, mask, reference=BODY, **options):
    return refine_outline(Picture(photo), mask, np.asarray(reference), np.ones(3), **options)[1]


def test_share_is_the_products_light(composite):
    photo, cover, product, _ = composite
    edge = edge_of(photo, cover)
    listed = np.zeros(cover.shape, bool)
    listed[edge.rows, edge.columns] = True
    assert listed[(cover > 0.004) & (cover < 0.996)].all()
    assert (cover[listed] > 0).all()
    # Beside the outline, where hardly any ground is in a pixel, it is not looked for.
    mixed = (cover > 0.1) & (cover < 0.9)
    share = np.zeros_like(photo)
    share[edge.rows, edge.columns] = edge.share
    np.testing.assert_allclose(share[mixed], (cover[..., None] * product)[mixed], atol=1e-5)


def test_recolored_composite_is_the_composite_of_the_recolored(composite):
    photo, cover, product, ground = composite
    truth = cover[..., None] * (product @ (np.diag(TARGET / BODY))) + (1 - cover[..., None]) * ground
    analysis = analyze(photo, reference=BODY, mask=cover)
    ours = analysis.recolor(TARGET)
    np.testing.assert_allclose(ours, truth, atol=2e-5)
    # Plain blending, recolored against old by the cover, leaves a rim.
    matrix = analysis.matrix(TARGET)
    blended = cover[..., None] * (photo @ matrix.T) + (1 - cover[..., None]) * photo
    rim = (cover > 0.1) & (cover < 0.9)
    assert np.abs(ours - truth)[rim].max() < 0.01 * np.abs(blended - truth)[rim].max()


def test_ground_that_varies_slowly(composite):
    photo, cover, product, _ = composite
    ramp = GROUND * (0.8 + 0.4 * np.linspace(0, 1, 90)[None, :, None])
    photo = (cover[..., None] * product + (1 - cover[..., None]) * ramp).astype(np.float32)
    truth = cover[..., None] * (product @ np.diag(TARGET / BODY)) + (1 - cover[..., None]) * ramp
    analysis = analyze(photo, reference=BODY, mask=cover)
    ours, matrix = analysis.recolor(TARGET), analysis.matrix(TARGET)
    blended = cover[..., None] * (photo @ matrix.T) + (1 - cover[..., None]) * photo
    rim = (cover > 0.1) & (cover < 0.9)
    assert np.abs(ours - truth)[rim].mean() < 0.2 * np.abs(blended - truth)[rim].mean()


def test_noisy_8_bit_photo_and_mask(composite):
    photo, cover, product, ground = composite
    noisy = photo + np.random.default_rng(0).normal(0, 0.003, photo.shape)
    codes = transfer.encode(noisy, transfer.SRGB, np.uint8)
    mask = np.round(cover * 255).astype(np.uint8)
    truth = cover[..., None] * (product @ np.diag(TARGET / BODY)) + (1 - cover[..., None]) * ground
    ours = analyze(Picture(codes, transfer.SRGB), reference=BODY, mask=mask).recolor(TARGET)
    rim = (cover > 0.1) & (cover < 0.9)
    assert np.abs(ours - truth)[rim].mean() < 0.012


def test_a_neutral_ground_needs_no_share(composite):
    _, cover, product, _ = composite
    photo = (cover[..., None] * product + (1 - cover[..., None]) * 0.3).astype(np.float32)
    edge = edge_of(photo, cover)
    np.testing.assert_allclose(edge.share, photo[edge.rows, edge.columns], atol=1e-5)


@pytest.mark.parametrize("ground", [GROUND, np.full(3, 0.3)])
@pytest.mark.parametrize("wrong", [-3, -2, -1, 1, 2, 3])
def test_a_mask_that_is_a_few_pixels_wrong(composite, ground, wrong):
    _, cover, product, _ = composite
    photo = (cover[..., None] * product + (1 - cover[..., None]) * ground).astype(np.float32)
    truth = cover[..., None] * (product @ np.diag(TARGET / BODY)) + (1 - cover[..., None]) * ground
    hard = cover > 0.5
    hard = dilate(hard, wrong) if wrong > 0 else erode(hard, -wrong)
    ours = analyze(photo, None, BODY, hard, "dichromatic", spill=True).recolor(TARGET)
    # Pixels with next to nothing of the product, or far from the mask, may keep it; the target is 0.44 away.
    assert np.abs(ours - truth).max() < 0.1
    assert np.abs(ours - truth)[cover > 0.5].max() < 0.05
    # Without leave to recolor outside the mask, nothing there changes.
    kept = analyze(photo, None, BODY, hard, "dichromatic").recolor(TARGET)
    np.testing.assert_array_equal(kept[~hard], photo[~hard])


@pytest.mark.parametrize("ground", [GROUND, np.full(3, 0.3)])
def test_the_width_of_a_rim_that_the_mask_leaves_out(composite, ground):
    _, cover, product, _ = composite
    picture = Picture((cover[..., None] * product + (1 - cover[..., None]) * ground).astype(np.float32))

    def width(mask):
        return rim_left_out(picture, Sides.of(mask), BODY, np.ones(3))

    widths = [width(erode(cover > 0.5, wrong).astype(np.float32)) for wrong in (0, 1, 2)]
    np.testing.assert_allclose(np.diff(widths), 1, atol=0.2)
    assert width(cover) < 0.2
    assert width(np.ones(cover.shape)) == 0


def test_a_mask_through_the_middle_of_a_product_is_meant_so(composite):
    photo, cover, _, _ = composite
    mask = (cover > 0.5) & (np.arange(90) < 45)
    changed = (analyze(photo, reference=BODY, mask=mask, spill=True).recolor(TARGET) != photo).any(axis=-1)
    assert not changed[:, 50:].any()


@pytest.mark.parametrize("model", ["dichromatic", "body", "regularized"])
def test_spill_moves_the_light_on_a_neutral_surround_and_nothing_else(model):
    y, x = np.mgrid[:80, :120].astype(float)
    cover = (np.hypot(x - 60, y - 40) < 20).astype(float)
    glow = 0.15 * np.exp(-((np.hypot(x - 60, y - 40) - 20).clip(0) / 4))[..., None]
    gray, blue = np.full(3, 0.4), np.array([0.1, 0.2, 0.5])
    surround = np.where((x > 105)[..., None], blue, gray + glow * BODY)
    photo = np.where(cover[..., None] == 1, BODY, surround).astype(np.float32)
    truth = np.where(cover[..., None] == 1, TARGET, np.where((x > 105)[..., None], blue, gray + glow * TARGET))
    ours = analyze(photo, None, BODY, cover, model, spill=True).recolor(TARGET)
    np.testing.assert_allclose(ours, truth, atol=2e-3)
    np.testing.assert_array_equal(ours[x > 105], photo[x > 105])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_what_is_taken_in_is_coverage_of_the_masks_kind(composite, dtype):
    photo, cover, _, _ = composite
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    given = (erode(cover > 0.5, 2) * top).astype(dtype)
    before = given.copy()
    seen = (Picture(photo), given, BODY, np.ones(3))
    mask, edge = refine_outline(*seen, spill=spill_weights(*seen))
    assert mask.dtype == dtype
    assert (mask[edge.rows, edge.columns] > 0).all()
    assert np.count_nonzero(mask) > np.count_nonzero(given)
    np.testing.assert_array_equal(given, before)
    np.testing.assert_array_equal(mask[given > 0], given[given > 0])


def test_share_holds_no_more_light_than_the_pixel_and_none_below_zero():
    # A mask that is wrong: it claims half of pixels that are pure ground, bright, beside darker ground.
    image = np.full((20, 20, 3), 0.4, np.float32)
    image[:, :8] = [0.5, 0.1, 0.1]
    image[:, 8:10] = [0.05, 0.9, 0.05]
    mask = np.zeros((20, 20))
    mask[:, :8], mask[:, 8:10] = 1, 0.5
    edge = edge_of(image, mask, (0.5, 0.1, 0.1))
    pixels = image[edge.rows, edge.columns]
    assert (edge.share >= 0).all()
    assert (edge.share <= pixels).all()


def test_where_there_is_no_ground_to_see_it_is_a_plain_blend():
    image = np.random.default_rng(0).random((30, 30, 3), dtype=np.float32)
    mask = np.full((30, 30), 0.3)
    edge = edge_of(image, mask)
    np.testing.assert_allclose(edge.share, 0.3 * image.reshape(-1, 3), atol=1e-6)


def test_a_product_of_the_lights_color_keeps_to_its_mask():
    y, x = np.mgrid[:60, :60].astype(float)
    cover = np.clip((20 - np.hypot(x - 30, y - 30)) / 4 + 0.5, 0, 1)
    white, ground = np.full(3, 0.8) * (0.4 + 0.6 * x / 60)[..., None], np.full(3, 0.2)
    photo = (cover[..., None] * white + (1 - cover[..., None]) * ground).astype(np.float32)
    edge = edge_of(photo, cover, np.full(3, 0.8), splits=False)
    truth = (cover[..., None] * white)[edge.rows, edge.columns]
    assert np.abs(edge.share - truth).max() < 0.02


def test_pixels_that_are_all_the_products_are_not_listed(composite):
    _, cover, product, _ = composite
    photo = (cover[..., None] * product + (1 - cover[..., None]) * 0.3).astype(np.float32)
    edge = edge_of(photo, cover)
    assert (cover[edge.rows, edge.columns] < 1).all()
    assert len(edge.rows) == np.count_nonzero((cover > 0) & (cover < 1))


def test_a_mask_without_an_outline_has_no_edge():
    image = np.full((9, 9, 3), 0.3, np.float32)
    assert edge_of(image, np.ones((9, 9))) is None
    assert analyze(image, reference=(0.4, 0.1, 0.1)).edge is None


def test_edge_of_a_tall_picture_is_in_row_order_and_found_by_rows():
    # Tall enough for several strips.
    rng = np.random.default_rng(0)
    mask = np.where(rng.random((3000, 400)) < 0.01, 0.5, 0.0)
    mask[::2, ::3] = np.where(mask[::2, ::3] == 0, 0.9, mask[::2, ::3])
    image = rng.random((3000, 400, 3), dtype=np.float32)
    edge = edge_of(image, mask)
    np.testing.assert_array_equal(np.column_stack([edge.rows, edge.columns]), np.argwhere(mask > 0))
    for first, last in ((0, 3000), (955, 966), (100, 100), (2999, 3000)):
        part = edge.within(slice(first, last))
        expected = np.argwhere(mask[first:last] > 0) + np.array([first, 0])
        np.testing.assert_array_equal(np.column_stack([edge.rows[part], edge.columns[part]]), expected)


def test_two_products_that_touch_along_a_soft_border():
    # Red passes over to green pixel by pixel; each mask knows its share. Both are recolored in one pass.
    a = np.broadcast_to(np.clip((np.arange(80) - 37) / 6, 0, 1)[None, :, None], (30, 80, 1))
    first, second = np.array([0.5, 0.1, 0.06]), np.array([0.08, 0.4, 0.15])
    new_first, new_second = np.array([0.06, 0.2, 0.5]), np.array([0.5, 0.4, 0.05])
    photo = (a * first + (1 - a) * second).astype(np.float32)
    left = analyze(photo, reference=second, mask=1 - a[..., 0]).region(new_second)
    right = analyze(photo, reference=first, mask=a[..., 0]).region(new_first)
    for regions in ([left, right], [right, left]):
        ours, _ = recolor(Picture(photo), regions)
        np.testing.assert_allclose(ours, a * new_first + (1 - a) * new_second, atol=2e-5)


def test_an_edge_below_another_region_counts_only_where_it_shows():
    # A soft red product on a green ground, and half of everything covered by a second region that keeps its color.
    y, x = np.mgrid[:40, :60].astype(float)
    cover = np.clip((14 - np.hypot(x - 30, y - 20)) / 4 + 0.5, 0, 1)[..., None]
    photo = (cover * BODY + (1 - cover) * GROUND).astype(np.float32)
    below = analyze(photo, reference=BODY, mask=cover[..., 0]).region(TARGET)
    whole = RegionMatrix(np.eye(3), np.full((40, 60), 0.5))
    ours, _ = recolor(Picture(photo), [below, whole])
    # Of what it asks, the lower region gets at most the half that is left.
    granted = np.minimum(cover, 0.5) / np.maximum(cover, 1e-9)
    np.testing.assert_allclose(ours, photo + granted * cover * (TARGET - BODY), atol=2e-5)
