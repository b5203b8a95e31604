"""A thumbnail looks like the full picture made small."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dyehouse.core import thumbnail, transfer
from dyehouse.core.colorspace import LINEAR_SRGB, SRGB, space_named
from dyehouse.core.picture import Picture
from dyehouse.core.recipe import Colorway, Recipe, Region, prepare
from dyehouse.core.recolor import recolor
from dyehouse.core.region import shrink
from dyehouse.core.swatches import parse_target


@pytest.mark.parametrize("size", [96, 500])
def test_it_is_the_recolored_picture_made_small(size: int, product: Callable) -> None:
    scene = product(size=size)
    recipe = Recipe((Region(parse_target("#1F4E79"), reference=scene.matte, mask=scene.mask),))
    prepared = prepare(Picture(scene.image), recipe, space=LINEAR_SRGB)
    small = thumbnail.proxy_of(prepared, 64)
    other = prepared.for_colorway(Colorway("red", (parse_target("#902020"),)))
    for asked in (prepared, other):
        full, _ = recolor(asked.analyses[0].picture, asked.regions())
        step = full.shape[0] // small.codes.shape[0]
        expected = transfer.encode(shrink(Picture(full), step).clip(0, 1), SRGB.curve, np.uint8)
        made = thumbnail.thumbnail(small, asked)
        assert max(made.shape) <= 96
        assert made.shape == expected.shape
        assert np.quantile(np.abs(made.astype(int) - expected), 0.98) <= 3


def test_it_is_in_srgb_whatever_the_photo_is(product: Callable) -> None:
    scene = product()
    space = space_named("linear-rec2020")
    gray = Recipe((Region(parse_target("lab(50, 0, 0)"), reference=scene.matte, mask=scene.mask, model="body"),))
    made = [
        thumbnail.thumbnail(thumbnail.proxy_of(prepared), prepared)
        for prepared in (prepare(Picture(scene.image), gray, space=s) for s in (space, LINEAR_SRGB))
    ]
    x, y = scene.matte
    for picture in made:
        assert np.abs(picture[y, x].astype(int) - 119).max() <= 3  # lab(50, 0, 0) is #777777


def test_a_region_that_keeps_its_color_is_left_as_it_is(product: Callable) -> None:
    scene = product(noise=0.01)
    mine = Region(parse_target("#902020"), reference=scene.matte, mask=scene.mask, model="regularized")
    prepared = prepare(Picture(scene.image), Recipe((mine,)), space=LINEAR_SRGB)
    assert prepared.analyses[0].extra is not None
    kept = replace(prepared, recipe=replace(prepared.recipe, regions=(replace(mine, target=None),)))
    small = thumbnail.proxy_of(prepared)
    np.testing.assert_array_equal(thumbnail.thumbnail(small, kept), small.codes)
    made = thumbnail.thumbnail(small, prepared)
    inside = scene.mask > 0
    np.testing.assert_array_equal(made[~inside], small.codes[~inside])
    assert (made[inside] != small.codes[inside]).any(axis=1).mean() > 0.9


def test_a_mask_that_vanishes_when_it_is_made_small(product: Callable) -> None:
    scene = product(size=203)
    corner = np.zeros((203, 203))
    corner[:, 201:] = 1  # blocks of 2 leave the last column out
    corner[:, 201] = 0
    region = Region(parse_target("#902020"), reference=(0.3, 0.2, 0.1), mask=corner, model="body")
    prepared = prepare(Picture(scene.image), Recipe((region,)), space=LINEAR_SRGB)
    small = thumbnail.proxy_of(prepared, 100)
    assert np.abs(thumbnail.thumbnail(small, prepared).astype(int) - small.codes).max() <= 1
