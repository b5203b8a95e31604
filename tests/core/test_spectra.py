"""Spectra against colour-science, and the files and names people give."""

import colour
import numpy as np
import pytest

from dyehouse.benchmarks import export_tables
from dyehouse.core import spectra
from dyehouse.core.errors import FileError, WhiteError
from dyehouse.core.spectra import Spectrum

OBSERVERS = {
    "1931": colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"],
    "1964": colour.MSDS_CMFS["CIE 1964 10 Degree Standard Observer"],
}
VISIBLE = np.arange(360.0, 831.0)


def theirs(spectrum: Spectrum) -> colour.SpectralDistribution:
    return colour.SpectralDistribution(spectrum.values, spectrum.wavelengths)


def their_xyz(reflectance, light, observer="1931"):
    return colour.sd_to_XYZ(reflectance, OBSERVERS[observer], light, method="Integration") / 100


def test_shipped_tables_are_what_the_export_writes():
    with np.load(export_tables.OUTPUT) as shipped:
        fresh = export_tables.tables()
        assert set(shipped.files) == set(fresh)
        for name, table in fresh.items():
            np.testing.assert_array_equal(shipped[name], table)
    assert export_tables.OUTPUT.stat().st_size < 300_000
    assert export_tables.CSS_OUTPUT.read_text() == export_tables.css()


@pytest.mark.parametrize("observer", ["1931", "1964"])
def test_whites_of_all_illuminants(observer):
    for name in spectra.illuminant_names():
        expected = their_xyz(colour.sd_ones(), colour.SDS_ILLUMINANTS[name], observer)
        np.testing.assert_allclose(
            spectra.to_xyz(name, observer_name=observer), expected, rtol=0, atol=1e-6, err_msg=name
        )


@pytest.mark.parametrize("chart", ["ISO 17321-1", "ColorChecker N Ohta", "BabelColor Average"])
@pytest.mark.parametrize("light", ["D65", "A", "FL11", "LED-B3", "HP1"])
def test_xyz_of_reflectances(chart, light):
    for name, reflectance in spectra.chart(chart).items():
        expected = their_xyz(colour.SDS_COLOURCHECKERS[chart][name], colour.SDS_ILLUMINANTS[light])
        np.testing.assert_allclose(spectra.to_xyz(light, reflectance), expected, rtol=0, atol=1e-6, err_msg=name)


@pytest.mark.parametrize(
    "wavelengths",
    [
        np.arange(400.0, 701, 20),
        np.arange(380.0, 731, 7),
        np.array([390, 400, 430, 445, 500, 550, 620, 700, 720]),
    ],
    ids=["20 nm", "7 nm", "uneven"],
)
def test_interpolation(wavelengths):
    values = np.random.default_rng(3).uniform(0, 1, len(wavelengths))
    spectrum = Spectrum(wavelengths.astype(float), values)
    shape = colour.SpectralShape(wavelengths[0], wavelengths[-1], 1)
    expected = theirs(spectrum).copy().interpolate(shape)
    np.testing.assert_allclose(spectrum.at(expected.wavelengths), expected.values, rtol=0, atol=1e-6)


def test_interpolation_keeps_the_samples_and_the_ends():
    spectrum = spectra.chart()["blue"]
    np.testing.assert_allclose(spectrum.at(spectrum.wavelengths), spectrum.values, rtol=0, atol=1e-12)
    np.testing.assert_allclose(spectrum.at([100, 2000]), spectrum.values[[0, -1]], rtol=0, atol=1e-12)


def test_several_functions_are_interpolated_as_one_by_one():
    for wavelengths in (np.arange(400.0, 701, 10), np.array([390.0, 400, 430, 445, 500, 550, 620, 720])):
        values = np.random.default_rng(5).uniform(0, 1, (len(wavelengths), 3))
        together = Spectrum(wavelengths, values).at(VISIBLE)
        alone = [Spectrum(wavelengths, column).at(VISIBLE) for column in values.T]
        np.testing.assert_allclose(together, np.column_stack(alone), rtol=0, atol=1e-12)
        linear = Spectrum(wavelengths, values).at(VISIBLE, linear=True)
        np.testing.assert_array_equal(linear[:, 1], np.interp(VISIBLE, wavelengths, values[:, 1]))


def test_few_samples_are_interpolated_linearly():
    spectrum = Spectrum(np.array([400.0, 700.0]), np.array([0.0, 0.3]))
    np.testing.assert_allclose(spectrum.at([500.0]), [0.1])


def test_many_reflectances_at_once():
    patches = list(spectra.chart().values())
    together = Spectrum(patches[0].wavelengths, np.column_stack([patch.values for patch in patches]))
    one_by_one = [spectra.to_xyz("A", patch) for patch in patches]
    np.testing.assert_allclose(spectra.to_xyz("A", together), one_by_one, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kelvin", [4000, 5003, 5600, 6500, 7000, 7001, 9300, 25000])
def test_daylight(kelvin):
    expected = colour.sd_CIE_illuminant_D_series(colour.temperature.CCT_to_xy_CIE_D(kelvin))
    light = spectra.illuminant(f"{kelvin}K")
    np.testing.assert_allclose(light.values, expected.values, rtol=1e-6)
    np.testing.assert_array_equal(light.wavelengths, expected.wavelengths)


@pytest.mark.parametrize("kelvin", [1000, 2856, 3999])
def test_black_body(kelvin):
    expected = colour.sd_blackbody(kelvin, colour.SpectralShape(300, 830, 1))
    light = spectra.illuminant(kelvin)
    np.testing.assert_allclose(light.values, 100 * expected.values / expected[560], rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "kelvin"), [("blackbody 6500K", 6500), ("Black Body 40000", 40000), ("BLACKBODY700K", 700)]
)
def test_black_body_of_any_temperature(text, kelvin):
    light = spectra.illuminant(text)
    expected = colour.sd_blackbody(kelvin, colour.SpectralShape(300, 830, 1))
    np.testing.assert_allclose(light.values, 100 * expected.values / expected[560], rtol=1e-6)
    assert spectra.illuminant(light.name) == light
    assert spectra.illuminant("daylight 5600K") == spectra.illuminant("5600K")


@pytest.mark.parametrize(
    ("text", "shares"),
    [
        ("0.7 D65 + 0.3 A", (0.7, 0.3)),
        ("70% d65+30%A", (0.7, 0.3)),
        ("7*D65 + 3 * A", (0.7, 0.3)),
        ("D65 + A", (0.5, 0.5)),
        ("6500.5K + 2856 K", None),
    ],
)
def test_mixture_of_lights(text, shares):
    light = spectra.illuminant(text)
    assert spectra.illuminant(light.name) == light
    if shares is not None:
        # By luminance: the white is the mean of the two whites of Y = 1.
        expected = [
            s * their_xyz(colour.sd_ones(), colour.SDS_ILLUMINANTS[n])
            for s, n in zip(shares, ("D65", "A"), strict=True)
        ]
        np.testing.assert_allclose(spectra.to_xyz(light), np.sum(expected, axis=0), atol=1e-6)


def test_measured_light(tmp_path):
    lamp = colour.SDS_ILLUMINANTS["LED-B3"]
    rows = "\n".join(f"{nm:g},{value:.9g}" for nm, value in zip(lamp.wavelengths, lamp.values, strict=True))
    path = tmp_path / "my+lamp.csv"
    path.write_text("nm,power\n" + rows)
    np.testing.assert_allclose(spectra.to_xyz(str(path)), spectra.to_xyz("LED-B3"), atol=1e-6)
    plain = tmp_path / "lamp.csv"
    plain.write_text(rows)
    mixed = spectra.to_xyz(f"0.5 {plain} + 0.5 A")
    np.testing.assert_allclose(mixed, (spectra.to_xyz("LED-B3") + spectra.to_xyz("A")) / 2, atol=1e-6)
    plain.write_text(rows.replace(f"{lamp.wavelengths[9]:g},", f"{lamp.wavelengths[9]:g},-"))
    with pytest.raises(FileError, match="below 0"):
        spectra.illuminant(str(plain))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.7 D65 + A", "lacks a share"),
        ("0 D65 + 0 A", "lacks a share"),
        ("D65 + moonshine", "moonshine"),
        ("D65 +", "is not known"),
        ("blackbody 100K", "500 to 100000"),
        ("daylight 3000K", "4000 to 25000"),
    ],
)
def test_mixtures_and_temperatures_that_make_no_sense(text, said):
    with pytest.raises(WhiteError, match=said):
        spectra.illuminant(text)


def test_untabulated_daylight_is_nominal():
    xy = colour.temperature.CCT_to_xy_CIE_D(9300 * 1.4388 / 1.4380)
    expected = colour.sd_CIE_illuminant_D_series(xy).values
    np.testing.assert_allclose(spectra.illuminant("D93").values, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("d65", "D65"),
        (" D 65 ", "D65"),
        ("CIE D50", "D50"),
        ("F11", "FL11"),
        ("f3.1", "FL3.1"),
        ("ledb3", "LED-B3"),
        ("led_rgb1", "LED-RGB1"),
        ("iso 7589 studio tungsten", "ISO 7589 Studio Tungsten"),
    ],
)
def test_forgiving_names(written, meant):
    light = spectra.illuminant(written)
    assert light.name == meant
    assert light == spectra.illuminant(meant)


def test_spellings_of_temperature():
    assert spectra.illuminant("2856 K") == spectra.illuminant(2856) == spectra.illuminant("2856.0k")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("D66X", "D65"),
        ("LED-B9", "LED-B"),
        ("moonshine", "5600K"),
        ("D30", "D50"),
        ("300K", "1000 to 25000"),
        (30000, "1000 to 25000"),
    ],
)
def test_unknown_light(name, said):
    with pytest.raises(WhiteError, match=said) as caught:
        spectra.illuminant(name)
    assert str(name) in str(caught.value)


def test_observers():
    assert spectra.observer("10") == spectra.observer("1964") == spectra.observer("10°")
    assert spectra.observer("2") == spectra.observer()
    with pytest.raises(WhiteError, match="2012"):
        spectra.observer("2012")


def test_camera_response_is_the_integral_over_the_camera_s_range():
    # Eq. (11) with colour-science's interpolation, over the range in which the sensitivities are known.
    camera = colour.MSDS_CAMERA_SENSITIVITIES["Sigma SDMerill (NPL)"]
    shape = colour.SpectralShape(camera.wavelengths[0], camera.wavelengths[-1], 1)
    red = colour.SDS_COLOURCHECKERS["ISO 17321-1"]["red"]
    light = colour.SDS_ILLUMINANTS["FL2"].copy().align(shape).values[:, None]
    sensitivities = camera.copy().align(shape).values
    expected = (light * sensitivities * red.copy().align(shape).values[:, None]).sum(axis=0)
    expected /= (light * sensitivities).sum(axis=0)[1]
    response = spectra.to_camera("FL2", spectra.chart()["red"], "sigma")
    np.testing.assert_allclose(response, expected, rtol=0, atol=1e-6)


def test_white_of_a_camera_is_green_normalized():
    white = spectra.to_camera("A", None, "Nikon 5100 (NPL)")
    assert white[1] == 1
    assert white[0] > white[2]


@pytest.mark.parametrize("name", ["leica", "NPL"])
def test_unknown_or_ambiguous_camera(name):
    with pytest.raises(WhiteError, match="Nikon 5100"):
        spectra.camera_sensitivities(name)


def test_a_camera_that_sees_nothing():
    blind = Spectrum(VISIBLE, np.zeros((len(VISIBLE), 3)))
    with pytest.raises(WhiteError, match="nothing to see"):
        spectra.to_camera("D65", None, blind)


def test_camera_from_a_file(tmp_path):
    nikon = spectra.camera_sensitivities("nikon")
    table = np.column_stack([nikon.wavelengths, nikon.values])
    path = tmp_path / "camera.csv"
    np.savetxt(path, table, delimiter=",", header="nm,r,g,b", comments="", fmt="%.17g")
    assert spectra.camera_sensitivities(path) == nikon


def lines(*rows: str) -> str:
    return "\n".join(rows)


GOOD = [f"{nm}, {nm / 1000}" for nm in range(380, 731, 10)]


@pytest.mark.parametrize(
    "text",
    [
        lines(*GOOD),
        lines("Wavelength,Reflectance", *GOOD),
        "\ufeff# measured yesterday\r\n\r\nnm;R\r\n" + "\r\n".join(GOOD).replace(",", ";"),
        lines(*GOOD).replace(",", "\t"),
    ],
    ids=["plain", "header", "excel", "tabs"],
)
def test_csv(tmp_path, text):
    path = tmp_path / "ramp.csv"
    path.write_bytes(text.encode())
    spectrum = spectra.read_csv(path)
    np.testing.assert_allclose(spectrum.values, spectrum.wavelengths / 1000)
    assert len(spectrum.values) == 36
    assert spectrum.name == "ramp"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (lines("nm, R", *GOOD[:4], "420, dark", *GOOD[5:]), "line 6 is '420, dark'"),
        (lines(*GOOD[:4], "420", *GOOD[5:]), "line 5 is '420'"),
        (lines("38O, 0.3", *GOOD[1:]), "line 1 is"),
        (lines(*GOOD[:4], "420, nan", *GOOD[5:]), "line 5"),
        (lines(*GOOD[:4], *GOOD[3:]), "line 5: wavelength 410 does not increase"),
        (lines(*GOOD[5:]), "400 to 700"),
        (lines(*GOOD[:20]), "400 to 700"),
        (lines("400, 0.1", "700, 0.2"), "six steps"),
        ("", "400 to 700"),
    ],
)
def test_bad_csv(tmp_path, text, said):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=said) as caught:
        spectra.read_csv(path)
    assert "bad.csv" in str(caught.value)


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(FileError, match=r"none\.csv"):
        spectra.read_csv(tmp_path / "none.csv")
    (tmp_path / "noise.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(FileError, match=r"noise\.csv"):
        spectra.read_csv(tmp_path / "noise.csv")


def test_spectra_compare_by_value():
    one, other = spectra.chart()["red"], spectra.chart()["red"]
    assert one == other
    assert len({one, other, spectra.chart()["green"]}) == 2
    assert one != "red"
