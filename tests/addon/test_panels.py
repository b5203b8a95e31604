"""What the panel computes of colors, it computes once and not whenever it is drawn."""

import numpy as np
import pytest

from dyehouse.addon import panels
from dyehouse.core import gamut, metamerism, spectra
from dyehouse.core.colorspace import SRGB, space_named
from dyehouse.core.errors import TargetError
from dyehouse.core.swatches import Swatch, parse_target


def test_the_nearest_color_is_found_once() -> None:
    linear = (-0.31, 0.87, 0.11)
    found = panels.compromise(linear, SRGB)
    np.testing.assert_array_equal(found.linear, gamut.nearest(linear, SRGB).linear)
    assert panels.compromise(linear, SRGB) is found
    assert panels.compromise(linear, space_named("rec2020")) is not found
    assert panels.compromise((-0.31, 0.87, 0.12), SRGB) is not found


def test_the_look_under_other_lights_is_found_once() -> None:
    def foliage() -> Swatch:
        return Swatch("foliage", spectra.chart()["foliage"])

    found = panels.under_lights(foliage(), "1931")
    assert [look.shift for look in found] == [look.shift for look in metamerism.under_lights(foliage())]
    assert panels.under_lights(foliage(), "1931") is found  # another swatch of the same spectrum
    assert [look.shift for look in panels.under_lights(foliage(), "1964")] != [look.shift for look in found]
    with pytest.raises(TargetError, match="cannot be known"):
        panels.under_lights(parse_target("#1F4E79"), "1931")


def test_the_metamerism_of_two_spectra() -> None:
    patches = spectra.chart()
    source, target = (Swatch(name, patches[name]) for name in ("bluish green", "foliage"))
    found = panels.metamerism_of(source, target, "1931")
    assert [index.test for index in found] == [name for name in metamerism.LIGHTS if name != "D65"]
    assert [index.value for index in found] == [
        metamerism.special_index(source, target, index.test).value for index in found
    ]
    assert panels.metamerism_of(source, target, "1931") is found
    assert panels.metamerism_of(None, target, "1931") == []
    assert panels.metamerism_of(parse_target("#1F4E79"), target, "1931") == []
