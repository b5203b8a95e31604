"""Color formulas against colour-science, published pairs and their own inverses."""

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from dyehouse.core import colorimetry, spectra
from dyehouse.core.colorspace import D50, D65, SPACES, SRGB
from dyehouse.core.errors import WhiteError
from dyehouse.core.spectra import Spectrum

WHITE = np.array([0.9504559, 1.0, 1.0890578])
RNG = np.random.default_rng(1)
LAB = RNG.uniform([0, -128, -128], [100, 128, 128], (4, 500, 3))
NEAR = LAB + RNG.normal(size=LAB.shape)

# Sharma, Wu and Dalal 2005, Color Res. Appl. 30, 21, table 1: two colors and their difference.
SHARMA = np.array(
    [
        [50.0000, 2.6772, -79.7751, 50.0000, 0.0000, -82.7485, 2.0425],
        [50.0000, 3.1571, -77.2803, 50.0000, 0.0000, -82.7485, 2.8615],
        [50.0000, 2.8361, -74.0200, 50.0000, 0.0000, -82.7485, 3.4412],
        [50.0000, -1.3802, -84.2814, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, -1.1848, -84.8006, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, -0.9009, -85.5211, 50.0000, 0.0000, -82.7485, 1.0000],
        [50.0000, 0.0000, 0.0000, 50.0000, -1.0000, 2.0000, 2.3669],
        [50.0000, -1.0000, 2.0000, 50.0000, 0.0000, 0.0000, 2.3669],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0009, 7.1792],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0010, 7.1792],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0011, 7.2195],
        [50.0000, 2.4900, -0.0010, 50.0000, -2.4900, 0.0012, 7.2195],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0009, -2.4900, 4.8045],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0010, -2.4900, 4.8045],
        [50.0000, -0.0010, 2.4900, 50.0000, 0.0011, -2.4900, 4.7461],
        [50.0000, 2.5000, 0.0000, 50.0000, 0.0000, -2.5000, 4.3065],
        [50.0000, 2.5000, 0.0000, 73.0000, 25.0000, -18.0000, 27.1492],
        [50.0000, 2.5000, 0.0000, 61.0000, -5.0000, 29.0000, 22.8977],
        [50.0000, 2.5000, 0.0000, 56.0000, -27.0000, -3.0000, 31.9030],
        [50.0000, 2.5000, 0.0000, 58.0000, 24.0000, 15.0000, 19.4535],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.1736, 0.5854, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.2972, 0.0000, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 1.8634, 0.5757, 1.0000],
        [50.0000, 2.5000, 0.0000, 50.0000, 3.2592, 0.3350, 1.0000],
        [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
        [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
        [61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731],
        [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
        [22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373],
        [36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
        [90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441],
        [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
        [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
        [2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082],
    ]
)

colors = arrays(np.float64, (5, 3), elements=st.floats(-0.2, 2))
labs = arrays(
    np.float64,
    (3,),
    elements=st.floats(-100, 100).filter(lambda x: abs(x) > 1e-3 or x == 0),
)


def close(ours, theirs, atol=1e-6):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=atol)


def test_lab():
    xyz = RNG.uniform(-0.1, 1.5, (10, 50, 3)) ** 3  # a third of them dark
    xy = colour.XYZ_to_xy(WHITE)
    close(colorimetry.xyz_to_lab(np.abs(xyz), WHITE), colour.XYZ_to_Lab(np.abs(xyz), xy))
    close(colorimetry.lab_to_xyz(LAB, WHITE), colour.Lab_to_XYZ(LAB, xy))
    close(colorimetry.lab_to_lch(LAB), colour.Lab_to_LCHab(LAB))


def test_xyy():
    xyz = RNG.uniform(0, 1.5, (100, 3))
    close(colorimetry.xyz_to_xyy(xyz), colour.XYZ_to_xyY(xyz))
    close(colorimetry.xyy_to_xyz(xyz), colour.xyY_to_XYZ(xyz))
    close(colorimetry.xyz_to_xyy([0, 0, 0]), [0, 0, 0])
    close(colorimetry.xyy_to_xyz([0.3, 0, 0.5]), [0, 0, 0])


@given(colors)
def test_conversions_come_back(xyz):
    close(colorimetry.lab_to_xyz(colorimetry.xyz_to_lab(xyz, WHITE), WHITE), xyz, 1e-10)
    lab = colorimetry.xyz_to_lab(xyz, WHITE)
    close(colorimetry.lch_to_lab(colorimetry.lab_to_lch(lab)), lab, 1e-10)
    for space in SPACES.values():
        close(colorimetry.linear_to_xyz(colorimetry.xyz_to_linear(xyz, space), space), xyz, 1e-10)
        close(colorimetry.lab_to_linear(colorimetry.linear_to_lab(xyz, space), space), xyz, 1e-8)


@given(arrays(np.float64, (5, 3), elements=st.floats(0.01, 1)))
def test_xyy_comes_back(xyz):
    close(colorimetry.xyy_to_xyz(colorimetry.xyz_to_xyy(xyz)), xyz, 1e-10)


@pytest.mark.parametrize(("method", "name"), [("cat16", "CAT16"), ("bradford", "Bradford")])
def test_adaptation(method, name):
    source, destination = spectra.to_xyz("A"), spectra.to_xyz("D65")
    expected = colour.adaptation.matrix_chromatic_adaptation_VonKries(source, destination, transform=name)
    ours = colorimetry.adaptation_matrix(source, destination, method)
    close(ours, expected)
    close(ours @ source, destination, 1e-12)
    close(ours @ colorimetry.adaptation_matrix(destination, source, method), np.eye(3), 1e-12)


def test_unknown_adaptation():
    with pytest.raises(ValueError, match="cat16 or bradford"):
        colorimetry.adaptation_matrix(WHITE, WHITE, "cat97")


def test_named_whites_are_those_of_the_rgb_spaces():
    close(colorimetry.white_xyz("d65"), SRGB.white, 1e-12)
    close(colorimetry.white_xyz("D50"), SPACES["prophoto"].white, 1e-12)
    for name, xy in (("D65", D65), ("D50", D50)):
        close(colorimetry.xyz_to_xyy(spectra.to_xyz(name))[:2], xy, 1e-4)
    close(colorimetry.white_xyz("D65", "1964"), spectra.to_xyz("D65", observer_name="1964"), 0)
    assert np.abs(colorimetry.white_xyz("D65", "10") - SRGB.white).max() > 1e-3


def test_linear_to_lab():
    rgb = RNG.uniform(0, 1, (20, 3))
    expected = colour.XYZ_to_Lab(rgb @ SRGB.to_xyz.T, D65)
    close(colorimetry.linear_to_lab(rgb, SRGB), expected, 1e-6)
    warm = np.array([1.2, 1.0, 0.6])
    close(colorimetry.linear_to_lab(warm, SRGB, warm), [100, 0, 0], 1e-10)
    close(colorimetry.lab_to_linear(colorimetry.linear_to_lab(rgb, SRGB, warm), SRGB, warm), rgb, 1e-10)


@pytest.mark.parametrize("function", [colorimetry.linear_to_lab, colorimetry.xyz_to_linear])
def test_float32_stays_float32(function):
    values = RNG.uniform(0, 1, (7, 5, 3))
    small = function(values.astype(np.float32), SRGB)
    assert small.dtype == np.float32
    close(small, function(values, SRGB), 1e-3)
    assert function(values.astype(np.float16), SRGB).dtype == np.float64


def test_published_pairs_of_ciede2000():
    first, second, expected = SHARMA[:, :3], SHARMA[:, 3:6], SHARMA[:, 6]
    assert len(SHARMA) == 34
    close(colorimetry.delta_e_2000(first, second), expected, 1e-4)
    close(colorimetry.delta_e_2000(second, first), expected, 1e-4)


@pytest.mark.parametrize("other", [LAB[::-1], NEAR], ids=["far", "near"])
def test_differences(other):
    close(colorimetry.delta_e_2000(LAB, other), colour.delta_E(LAB, other, method="CIE 2000"))
    close(colorimetry.delta_e_1976(LAB, other), colour.delta_E(LAB, other, method="CIE 1976"))
    for l, c in ((1, 1), (2, 1)):
        expected = colour.delta_E(LAB, other, method="CMC", l=l, c=c)
        close(colorimetry.delta_e_cmc(LAB, other, l, c), expected)


def test_differences_broadcast_across_blocks():
    many = RNG.uniform(-50, 100, (3, 20000, 3))
    one = np.array([50.0, 10.0, -20.0])
    ours = colorimetry.delta_e_2000(many, one)
    close(ours, colour.delta_E(many, np.broadcast_to(one, many.shape), method="CIE 2000"))
    assert colorimetry.delta_e_2000(one, 1.1 * one).shape == ()
    assert colorimetry.delta_e_cmc(many[:, None, :4], many[None, :, :4]).shape == (3, 3, 4)


def test_differences_in_float32():
    # Near colors, for which the difference matters; float32 L*a*b* itself is only good to 1e-5.
    ours = colorimetry.delta_e_2000(LAB.astype(np.float32), NEAR.astype(np.float32))
    assert ours.dtype == np.float32
    close(ours, colorimetry.delta_e_2000(LAB, NEAR), 2e-4)


@given(labs, labs)
def test_algebra_of_differences(one, other):
    for difference in (colorimetry.delta_e_1976, colorimetry.delta_e_2000, colorimetry.delta_e_cmc):
        assert difference(one, one) == 0
        assert difference(one, other) >= 0
    close(colorimetry.delta_e_2000(one, other), colorimetry.delta_e_2000(other, one), 1e-9)


def test_white_of_an_illuminant():
    close(colorimetry.illuminant_white("D65", SRGB), [1, 1, 1], 3e-4)
    close(colorimetry.illuminant_white("D50", SPACES["prophoto"]), [1, 1, 1], 3e-4)
    red, green, blue = colorimetry.illuminant_white("A", SRGB)
    assert red > green > blue > 0
    expected = spectra.to_xyz("A") @ SRGB.from_xyz.T
    close([red, green, blue], expected, 1e-12)
    assert SRGB.to_xyz[1] @ [red, green, blue] == pytest.approx(1)
    assert np.abs(colorimetry.illuminant_white("A", SRGB, "1964") - expected).max() > 0.01


def test_white_of_an_illuminant_in_a_camera():
    ours = colorimetry.illuminant_white("A", SRGB, camera="nikon")
    close(ours, spectra.to_camera("A", None, "nikon"), 0)


LASER = Spectrum(np.array([360.0, 640, 645, 650, 830]), np.array([0.0, 0, 1, 0, 0]), "laser")


@pytest.mark.parametrize(("light", "name"), [("HP1", "HP1"), ("1700K", "1700K"), (LASER, "laser")])
def test_white_outside_the_space(light, name):
    with pytest.raises(WhiteError, match="wider space") as caught:
        colorimetry.illuminant_white(light, SRGB)
    assert name in str(caught.value)


def test_wider_space_is_a_remedy():
    assert colorimetry.illuminant_white("1700K", SPACES["rec2020"]).min() > 0


def test_oklab():
    xyz = np.random.default_rng(1).uniform(-0.1, 1, (50, 3))
    np.testing.assert_allclose(colorimetry.xyz_to_oklab(xyz), colour.XYZ_to_Oklab(xyz), atol=1e-6)
    np.testing.assert_allclose(colorimetry.oklab_to_xyz(colorimetry.xyz_to_oklab(xyz)), xyz, atol=1e-9)
