"""RGB spaces against colour-science."""

import colour
import numpy as np
import pytest

from dyehouse.core import colorspace, transfer
from dyehouse.core.errors import ImageError

THEIRS = {
    "srgb": "sRGB",
    "display-p3": "Display P3",
    "adobe-rgb": "Adobe RGB (1998)",
    "rec2020": "ITU-R BT.2020",
    "linear-srgb": "sRGB",
    "linear-p3": "Display P3",
    "linear-rec2020": "ITU-R BT.2020",
    "acescg": "ACEScg",
    "aces2065-1": "ACES2065-1",
}


def test_every_space_is_compared():
    assert set(colorspace.SPACES) == {*THEIRS, "prophoto"}


@pytest.mark.parametrize("name", THEIRS)
def test_matrices_agree_with_colour_science(name):
    theirs = colour.RGB_COLOURSPACES[THEIRS[name]]
    expected = colour.normalised_primary_matrix(theirs.primaries, theirs.whitepoint)
    ours = colorspace.SPACES[name]
    np.testing.assert_allclose(ours.to_xyz, expected, atol=1e-6)
    np.testing.assert_allclose(ours.from_xyz, np.linalg.inv(expected), atol=1e-5)


def test_prophoto_has_the_primaries_of_the_standard_to_their_four_digits():
    # ISO 22028-2 gives four digits, and D50 as 0.3457, 0.3585; colour-science carries six.
    theirs = colour.RGB_COLOURSPACES["ProPhoto RGB"]
    rounded = colour.normalised_primary_matrix(np.round(theirs.primaries, 4), (0.3457, 0.3585))
    np.testing.assert_allclose(colorspace.SPACES["prophoto"].to_xyz, rounded, atol=1e-6)


@pytest.mark.parametrize("space", colorspace.SPACES.values(), ids=colorspace.SPACES)
def test_white_has_luminance_one_and_the_inverse_inverts(space):
    assert space.white[1] == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(space.from_xyz @ space.to_xyz, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(space.to_xyz @ np.ones(3), space.white, atol=1e-12)
    assert space.white.sum() == pytest.approx(space.white[1] / (space.white[1] / space.white.sum()))


@pytest.mark.parametrize(
    ("name", "xy"), [("srgb", (0.3127, 0.3290)), ("prophoto", (0.3457, 0.3585)), ("acescg", (0.32168, 0.33767))]
)
def test_white_chromaticity(name, xy):
    white = colorspace.SPACES[name].white
    np.testing.assert_allclose(white[:2] / white.sum(), xy, atol=1e-12)


def test_curves():
    named = {name: space.curve for name, space in colorspace.SPACES.items()}
    assert named["srgb"] == named["display-p3"] == transfer.SRGB
    assert named["adobe-rgb"] == transfer.ADOBE_RGB
    assert named["rec2020"] == transfer.REC_2020
    assert named["prophoto"] == transfer.PROPHOTO
    for name, curve in named.items():
        assert curve.is_linear == (name.startswith(("linear", "aces"))), name


def test_with_curve_keeps_the_primaries():
    linear = colorspace.SPACES["adobe-rgb"].with_curve(transfer.LINEAR, "Linear Adobe")
    np.testing.assert_array_equal(linear.to_xyz, colorspace.SPACES["adobe-rgb"].to_xyz)
    assert linear.curve.is_linear
    assert linear.name == "Linear Adobe"
    assert colorspace.SPACES["adobe-rgb"].curve == transfer.ADOBE_RGB


@pytest.mark.parametrize("text", ["srgb", "sRGB", "  SRGB "])
def test_names_are_found_however_written(text):
    assert colorspace.space_named(text) is colorspace.SRGB


@pytest.mark.parametrize("text", ["", "cmyk", "srgb2"])
def test_unknown_name(text):
    with pytest.raises(ImageError, match=r"is not known: use one of srgb, .*acescg"):
        colorspace.space_named(text)
