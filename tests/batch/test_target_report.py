"""What is told of a target before anything is written."""

import numpy as np
import pytest

from dyehouse.batch import target_report
from dyehouse.core import metamerism
from dyehouse.core.colorspace import SPACES, SRGB, RGBSpace
from dyehouse.core.picture import Picture
from dyehouse.core.recipe import Recipe, Region, prepare
from dyehouse.core.swatches import parse_target


def about(target, space=SRGB, source=None, **options):
    image = np.tile(np.array([0.4, 0.1, 0.05], np.float32), (20, 20, 1))
    source = parse_target(source) if source else None
    region = Region(parse_target(target) if target else None, reference=(5, 5), source=source)
    return target_report.about(prepare(Picture(image), Recipe((region,), **options), space=space), 0)


def test_no_target_nothing_to_tell():
    assert about(None, white="D65", illuminant="A") == {}
    assert target_report.in_words({}) == []


def test_a_color_that_can_be_held():
    found = about("#1F4E79")
    assert "nearest" not in found
    assert "cannot be known" in found["unknown"]
    assert "adapted to the white of sRGB by Bradford" in about("#1F4E79", adaptation="bradford")["target_fate"]


@pytest.mark.parametrize(
    ("space", "written"),
    [(SRGB, "#"), (SPACES["display-p3"], "color(display-p3"), (RGBSpace("own", SRGB.to_xyz, SRGB.curve), "rgb(")],
)
def test_the_nearest_color_is_written_as_a_target(space, written):
    found = about("lab(60, -110, 60)", space)
    assert found["nearest"]["color"].startswith(written)
    again = parse_target(found["nearest"]["color"]).to_linear(space)
    np.testing.assert_allclose(again, found["nearest"]["linear"], atol=4e-3)
    assert found["nearest"]["ciede2000"] > 3
    assert any("outside" in line for line in target_report.in_words(found))


def test_a_spectrum_under_other_lights_and_against_the_source():
    found = about("ColorChecker#red", source="ColorChecker Ohta#red", illuminant="A", observer="1964")
    assert [look["light"] for look in found["looks"]] == list(metamerism.LIGHTS)
    assert "under A for the CIE 1964" in found["target_fate"]
    pair = parse_target("ColorChecker Ohta#red"), parse_target("ColorChecker#red")
    expected = metamerism.special_index(*pair, "FL11", observer="1964").value
    assert next(i for i in found["metamerism"] if i["test"] == "FL11")["index"] == expected
    words = "\n".join(target_report.in_words(found))
    assert "FL11" in words
    assert "against the source; under D65 the two differ" in words
    assert "metamerism" not in about("ColorChecker#red", source="#804020")
