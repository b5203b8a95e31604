"""Layers add up to what `recolor` makes, wherever and however small they are drawn."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import transfer
from dyehouse.core.compositing import Edge
from dyehouse.core.layers import step_for, take_apart
from dyehouse.core.picture import Picture
from dyehouse.core.recolor import RegionMatrix, recolor


def _regions(picture: Picture, count: int, extras: int, seed: int) -> list[RegionMatrix]:
    """Overlapping disks with soft edges, random matrices and corrections."""
    random = np.random.default_rng(seed)
    height, width = picture.shape
    y, x = np.mgrid[:height, :width]
    regions = []
    for _ in range(count):
        distance = np.hypot(y - random.uniform(0, height), x - random.uniform(0, width))
        mask = np.clip((height / 2 - distance) / 3, 0, 1).astype(np.float32)
        extra = random.normal(0, 0.05, (height, width, extras)).astype(np.float32) if extras else None
        matrix = np.hstack([random.uniform(-0.3, 1, (3, 3)), random.normal(0, 1, (3, extras))])
        rows, columns = np.nonzero((mask > 0) & (mask < 1))
        share = picture.at(rows, columns) * random.uniform(0, 1, (len(rows), 1)).astype(np.float32)
        edge = Edge(rows, columns, share) if len(rows) else None
        regions.append(RegionMatrix(matrix, mask, edge, extra))
    return regions


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 3),
    st.integers(0, 6),
    st.integers(5, 40),
    st.integers(5, 40),
    st.integers(1, 6),
    st.integers(0, 1000),
    st.booleans(),
)
def test_the_sum_is_the_mean_of_the_recolored_pixels(
    count: int, extras: int, height: int, width: int, step: int, seed: int, whole: bool
) -> None:
    random = np.random.default_rng(seed)
    picture = Picture(random.uniform(0, 1, (height, width, 3)).astype(np.float32))
    regions = _regions(picture, count, extras, seed)
    if whole:
        regions.insert(0, RegionMatrix(random.uniform(0, 1, (3, 3))))
    left, top = int(random.integers(0, width - 2)), int(random.integers(0, height - 2))
    right, bottom = int(random.integers(left + 1, width + 1)), int(random.integers(top + 1, height + 1))
    layers = take_apart(picture, regions, (left, top, right, bottom), step)
    expected = recolor(picture, regions)[0][top:bottom, left:right]
    got = layers.recolored(regions)
    for row in range(got.shape[0]):
        for column in range(got.shape[1]):
            block = expected[row * step : (row + 1) * step, column * step : (column + 1) * step]
            np.testing.assert_allclose(got[row, column], block.mean(axis=(0, 1)), atol=2e-5)


def test_codes_and_alpha() -> None:
    codes = np.random.default_rng(0).integers(0, 256, (30, 20, 4), np.uint8)
    picture = Picture(codes, transfer.SRGB)
    regions = [RegionMatrix(np.diag([0.5, 1.0, 0.2]), (codes[..., 0] > 99).astype(np.uint8) * np.uint8(255))]
    layers = take_apart(picture, regions, alpha=codes[..., 3])
    np.testing.assert_allclose(layers.recolored(regions), recolor(picture, regions)[0], atol=1e-6)
    np.testing.assert_allclose(layers.data[0, ..., 3], codes[..., 3] / 255, atol=1e-6)
    np.testing.assert_array_equal(layers.data[1, ..., 3] > 0, codes[..., 0] > 99)


def test_new_colors_need_no_new_layers() -> None:
    picture = Picture(np.random.default_rng(1).uniform(0, 1, (20, 30, 3)).astype(np.float32))
    regions = _regions(picture, 2, 3, 5)
    layers = take_apart(picture, regions)
    others = [replace(r, matrix=r.matrix + 0.1) for r in regions]
    np.testing.assert_allclose(layers.recolored(others), recolor(picture, others)[0], atol=2e-5)


def test_the_photo_is_not_modified() -> None:
    pixels = np.random.default_rng(1).uniform(0, 1, (20, 30, 3)).astype(np.float32)
    before = pixels.copy()
    picture = Picture(pixels)
    take_apart(picture, _regions(picture, 2, 3, 5), step=3)
    np.testing.assert_array_equal(pixels, before)


@pytest.mark.parametrize("shape", [(4000, 6000), (1, 100_000), (300, 200), (9000, 9000)])
def test_steps_keep_the_limits(shape: tuple[int, int]) -> None:
    step = step_for(shape, 2_400_000)
    height, width = (-(-n // step) for n in shape)
    assert height * width <= 2_400_000 * 1.01
    assert max(height, width) <= 8192
    assert step == 1 or (shape[0] * shape[1] > 2_400_000 or max(shape) > 8192)
