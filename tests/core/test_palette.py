"""Recolors that are looked up by color: the same codes as those worked out pixel by pixel."""

from dataclasses import replace

import numpy as np
import pytest

from dyehouse.core import Picture, transfer
from dyehouse.core.compositing import refine_outline
from dyehouse.core.palette import LEAST_PIXELS
from dyehouse.core.recolor import Recoloring, RegionMatrix, shared_palette

M1 = np.array([[0.2, 0.5, 0.1], [0.3, 0.1, 0.2], [2.0, 0.1, 0.3]])
M2 = np.array([[0.7, 0.0, 0.2], [0.1, 0.2, 0.3], [0.0, 0.5, 0.1]])
HEIGHT, WIDTH = 520, 631
TURN = np.array([[0.8, 0.2, 0.0], [0.1, 0.9, 0.0], [0.0, 0.1, 0.9]])


def pixels(channels=3):
    """A photo of few colors: a smooth scene with little noise."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    shade = 90 + 80 * np.sin(x / 90) * np.cos(y / 70) + rng.integers(0, 3, (HEIGHT, WIDTH))
    return (shade[..., None] * np.array([1.4, 0.8, 0.5, 1.0])[:channels]).clip(0, 255).astype(np.uint8)


def blob(y, x, radius, soft):
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    cover = np.clip((radius - np.hypot(rows - y, columns - x)) / soft + 0.5, 0, 1)
    return np.round(cover * 255).astype(np.uint8)


def both(picture, regions, shape=(HEIGHT, WIDTH, 3), **options):
    """Codes and shares, pixel by pixel and looked up."""
    palette = shared_palette(picture, regions)
    assert palette is not None
    made = []
    for given in (None, palette):
        out = np.full(shape, 7, np.uint8)
        job = Recoloring(picture, regions, dtype=np.uint8, out=out, palette=given, threads=1, **options)
        assert list(job.rows())[-1] == HEIGHT
        made.append((out, job.shares))
    return made


def one_region(picture):
    mask, edge = refine_outline(picture, blob(260, 300, 240, 5), np.array([0.3, 0.1, 0.04]), np.ones(3))
    assert edge is not None
    return [RegionMatrix(M1, mask, edge)]


def corrected(picture):
    (region,) = one_region(picture)
    extra = np.zeros((HEIGHT, WIDTH, 1), np.float32)
    extra[200:220, 250:290] = 0.3
    return [replace(region, matrix=np.hstack([M1, [[0.2], [0.1], [0.4]]]), extra=extra)]


def two_regions(picture):
    (region,) = one_region(picture)
    return [region, RegionMatrix(M2, blob(250, 400, 150, 9).astype(np.float32) / 255)]


def over_all(picture):
    return [RegionMatrix(M2), *one_region(picture)]


def whole(picture):
    return [RegionMatrix(M1)]


def whole_corrected(picture):
    return [replace(corrected(picture)[0], mask=None, edge=None)]


@pytest.mark.parametrize("regions_of", [one_region, corrected, two_regions, over_all, whole, whole_corrected])
@pytest.mark.parametrize("channels", [3, 4])
def test_the_same_codes_as_pixel_by_pixel(regions_of, channels):
    picture = Picture(pixels(channels), transfer.SRGB)
    (direct, told), (looked_up, shares) = both(
        picture, regions_of(picture), (HEIGHT, WIDTH, channels), curve=transfer.SRGB
    )
    np.testing.assert_array_equal(looked_up, direct)
    assert shares.pixels == told.pixels > LEAST_PIXELS / 2
    assert shares.out_of_gamut == pytest.approx(told.out_of_gamut, abs=1e-4)
    assert shares.out_of_gamut > 0


def test_of_any_layout():
    flipped = Picture(np.asfortranarray(pixels())[::-1, ::-1], transfer.SRGB)
    (direct, _), (looked_up, _) = both(flipped, one_region(flipped), curve=transfer.SRGB)
    np.testing.assert_array_equal(looked_up, direct)


def test_another_target_by_the_same_palette():
    picture = Picture(pixels(), transfer.SRGB)
    (region,) = one_region(picture)
    palette = shared_palette(picture, [region])
    other = [replace(region, matrix=M2)]
    job = Recoloring(picture, other, curve=transfer.SRGB, dtype=np.uint8, palette=palette)
    list(job.rows())
    np.testing.assert_array_equal(job.out, both(picture, other, curve=transfer.SRGB)[0][0])


@pytest.mark.parametrize("options", [{"curve": transfer.ADOBE_RGB}, {"curve": transfer.SRGB, "convert": TURN}])
def test_where_all_is_encoded_anew(options):
    picture = Picture(pixels(), transfer.SRGB)
    region = RegionMatrix(M1, blob(260, 315, 800, 3))  # whose box is the picture
    (direct, _), (looked_up, _) = both(picture, [region], **options)
    np.testing.assert_array_equal(looked_up, direct)


def test_no_palette_where_it_is_no_help():
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (HEIGHT, WIDTH, 3), endpoint=True).astype(np.uint8)
    assert shared_palette(Picture(noise, transfer.SRGB), [RegionMatrix(M1)]) is None
    assert shared_palette(Picture(pixels()[:99], transfer.SRGB), [RegionMatrix(M1)]) is None
    assert shared_palette(Picture(pixels() / np.float32(255)), [RegionMatrix(M1)]) is None
    picture = Picture(pixels(), transfer.SRGB)
    assert shared_palette(picture, [RegionMatrix(M1)] * 17) is None
    assert shared_palette(picture, [RegionMatrix(M1, np.full((HEIGHT, WIDTH), 99, np.uint8))]) is None
    assert shared_palette(picture, [RegionMatrix(M1, np.zeros((HEIGHT, WIDTH), np.uint8))]) is None
