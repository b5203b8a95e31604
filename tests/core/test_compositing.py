"""Soft outlines: the product's share of a mixed pixel, against composites put together here."""

import numpy as np
import pytest

from dyehouse.core import analyze, transfer
from dyehouse.core.compositing import unmix_edge
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


def test_share_is_the_products_light(composite):
    photo, cover, product, _ = composite
    edge = unmix_edge(Picture(photo), cover)
    soft = (cover > 0.004) & (cover < 0.996)
    np.testing.assert_array_equal(np.column_stack([edge.rows, edge.columns]), np.argwhere(soft))
    np.testing.assert_allclose(edge.share, (cover[..., None] * product)[soft], atol=1e-5)


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


def test_share_holds_no_more_light_than_the_pixel_and_none_below_zero():
    # A mask that is wrong: it claims half of pixels that are pure ground, bright, beside darker ground.
    image = np.full((20, 20, 3), 0.4, np.float32)
    image[:, :8] = [0.5, 0.1, 0.1]
    image[:, 8:10] = [0.05, 0.9, 0.05]
    mask = np.zeros((20, 20))
    mask[:, :8], mask[:, 8:10] = 1, 0.5
    edge = unmix_edge(Picture(image), mask)
    pixels = image[edge.rows, edge.columns]
    assert len(pixels) == 40
    assert (edge.share >= 0).all()
    assert (edge.share <= pixels).all()


def test_where_there_is_no_ground_to_see_it_is_a_plain_blend():
    image = np.random.default_rng(0).random((30, 30, 3), dtype=np.float32)
    mask = np.full((30, 30), 0.3)
    edge = unmix_edge(Picture(image), mask)
    np.testing.assert_allclose(edge.share, 0.3 * image.reshape(-1, 3), atol=1e-6)


@pytest.mark.parametrize("mask", [np.ones((9, 9)), np.eye(9), np.eye(9, dtype=bool).astype(np.uint8) * 255])
def test_a_hard_mask_has_no_edge(mask):
    assert unmix_edge(Picture(np.ones((9, 9, 3), np.float32)), mask) is None
    assert analyze(np.full((9, 9, 3), 0.3, np.float32), mask=mask, reference=(0.4, 0.1, 0.1)).edge is None


def test_edge_of_a_tall_picture_is_in_row_order_and_found_by_rows():
    # Tall enough for several strips.
    rng = np.random.default_rng(0)
    mask = np.where(rng.random((3000, 400)) < 0.01, 0.5, 0.0)
    mask[::2, ::3] = np.where(mask[::2, ::3] == 0, 1, mask[::2, ::3])
    image = rng.random((3000, 400, 3), dtype=np.float32)
    edge = unmix_edge(Picture(image), mask)
    np.testing.assert_array_equal(np.column_stack([edge.rows, edge.columns]), np.argwhere(mask == 0.5))
    for first, last in ((0, 3000), (955, 966), (100, 100), (2999, 3000)):
        part = edge.within(slice(first, last))
        expected = np.argwhere(mask[first:last] == 0.5) + np.array([first, 0])
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
