"""What people write for a color, and the pixel it becomes."""

import re

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyehouse.core import colorimetry, spectra, swatches
from dyehouse.core.colorspace import SPACES, SRGB
from dyehouse.core.errors import TargetError, WhiteError
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Encoded, Linear, Swatch, parse_target

P3, PROPHOTO, ACES, REC2020 = (SPACES[name] for name in ("display-p3", "prophoto", "acescg", "rec2020"))
RED = spectra.chart()["red"]
WHITE_TILE = Spectrum(np.array([380.0, 780.0]), np.ones(2), "tile")


def close(ours, expected, atol=1e-9):
    np.testing.assert_allclose(ours, expected, rtol=0, atol=atol)


@pytest.mark.parametrize("text", ["#C0392B", "#c0392b", "  #C0392b "])
def test_hex_is_srgb(text):
    swatch = parse_target(text)
    expected = SRGB.curve.decode(np.array([0xC0, 0x39, 0x2B]) / 255)
    close(swatch.to_linear(SRGB), expected)
    close(swatch.to_linear(P3), P3.from_xyz @ SRGB.to_xyz @ expected)
    assert swatch.text == text.strip()


def test_short_hex():
    assert parse_target("#c32").color == parse_target("#cc3322").color


@pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
def test_white_is_white_in_every_space(space):
    # However it is written: each form is adapted from its own white to the space's.
    for text in ("#FFF", "lab(100,0,0)", "lab(100 0 0 / A)", "lch(100, 0, 77 / 5600 K 10)", "rgb(1,1,1)"):
        close(parse_target(text).to_linear(space), [1, 1, 1])
        close(parse_target(text).to_linear(space, adaptation="bradford"), [1, 1, 1])
    close(Swatch.from_spectrum(WHITE_TILE).to_linear(space), [1, 1, 1])
    close(Swatch.from_spectrum(WHITE_TILE).to_linear(space, observer="1964"), [1, 1, 1])


@pytest.mark.parametrize("text", ["rgb(0.2, 0.1, 0.05)", "0.2,0.1,0.05", ".2 .1 5e-2", "RGB( 0.2  0.1,0.05 )"])
def test_linear_rgb_is_taken_as_it_is(text):
    for space in (SRGB, PROPHOTO):
        close(parse_target(text).to_linear(space), [0.2, 0.1, 0.05])


def test_lab_is_d50_unless_stated():
    assert parse_target("lab(50, 20, 30)").color == parse_target("lab(50 20 30/d50)").color
    assert parse_target("lab(50, 20, 30)").color != parse_target("lab(50 20 30/d65)").color
    close(parse_target("lab(50, 20, 30)").to_lab(), [50, 20, 30])
    close(parse_target("lab(50, 20, -30 / D65)").to_lab("D65"), [50, 20, -30])


def test_lab_in_the_white_of_the_space_is_not_adapted():
    close(colorimetry.linear_to_lab(parse_target("lab(50,20,30/D65)").to_linear(SRGB), SRGB), [50, 20, 30])
    close(colorimetry.linear_to_lab(parse_target("lab(50,20,30)").to_linear(PROPHOTO), PROPHOTO), [50, 20, 30])


def test_lch_is_lab():
    close(
        parse_target("lch(60, 50, 120)").to_lab(),
        [60, 50 * np.cos(2 * np.pi / 3), 50 * np.sin(2 * np.pi / 3)],
    )


def test_xyz_is_d65_unless_stated():
    xyz = np.array([0.2, 0.12, 0.05])
    close(parse_target("xyz(0.2, 0.12, 0.05)").to_linear(SRGB), SRGB.from_xyz @ xyz)
    close(parse_target("xyz(0.2, 0.12, 0.05 / D50)").to_linear(PROPHOTO), PROPHOTO.from_xyz @ xyz)
    x, y, Y = colorimetry.xyz_to_xyy(xyz)
    close(parse_target(f"xyy({x} {y} {Y})").to_linear(SRGB), SRGB.from_xyz @ xyz)


def test_adaptation_follows_the_matrix():
    xyz = np.array([0.2, 0.12, 0.05])
    for method in ("cat16", "bradford"):
        matrix = colorimetry.adaptation_matrix(spectra.to_xyz("A"), SRGB.white, method)
        ours = parse_target("xyz(0.2, 0.12, 0.05 / A)").to_linear(SRGB, adaptation=method)
        close(ours, SRGB.from_xyz @ matrix @ xyz)


@pytest.mark.parametrize("tail", ["D65 10", "D65/10", "d65  10°", "D65 / 10"])
def test_ten_degree_observer(tail):
    swatch = parse_target(f"xyz(0.2, 0.12, 0.05 / {tail})")
    close(swatch.color.white, spectra.to_xyz("D65", observer_name="1964"))


def test_temperature_after_the_slash():
    swatch = parse_target("lab(50, 0, 0 / 2856 K)")
    close(swatch.color.white, spectra.to_xyz("2856K"))


def test_colors_outside_the_space_are_kept():
    assert parse_target("#00FF00").to_linear(SPACES["prophoto"]).min() > 0
    assert parse_target("lab(60, -80, 20)").to_linear(SRGB).min() < 0


MALFORMED = [
    ("red", "not a color"),
    ("", "not a color"),
    ("#12345", "not a color"),
    ("#GGG", "not a color"),
    ("lab(50, 20)", "not a color"),
    ("lab(50, 20, 30", "not a color"),
    ("hsv(1, 2, 3)", "not a color"),
    ("0.1, 0.2", "not a color"),
    ("rgb(nan, 0, 0)", "not a color"),
    ("rgb(192, 57, 43)", "#C0392B"),
    ("192, 57, 43", "linear light"),
    ("rgb(0.1, 0.2, 0.3 / D50)", "leave out '/ D50'"),
    ("lab(50, 20, 30 /)", "after the slash"),
    ("lab(50, 20, 30 / D66X)", "D65"),
    ("lab(120, 0, 0)", "0 .black. to 100"),
    ("lab(-1, 0, 0)", "0 .black. to 100"),
    ("lch(50, -3, 0)", "chroma -3"),
    ("xyz(20, 12, 5)", "divide percent by 100"),
    ("xyz(0.2, -0.1, 0.05)", "Y = -0.1"),
    ("xyz(-0.2, 0.1, 0.05)", "0 or more"),
    ("xyy(0.5, 0.33, 12)", "divide percent by 100"),
    ("xyy(0.8, 0.33, 0.2)", "at most 1"),
    ("xyy(0.3, 0, 0.2)", "at most 1"),
    ("missing.csv", "cannot be read"),
    ("spectrum(missing.csv)", "cannot be read"),
    ("color(srgb 192 57 43)", "#C0392B"),
    ("color(moonlight 0.1 0.2 0.3)", "moonlight"),
    ("lab(50, 20, 30 / 0.9 0 1)", "above 0"),
    ("reflectance(400:0.1)", "no reflectance"),
    ("reflectance(500:0.1, 400:0.2)", "increasing"),
    ("reflectance(400:0.1, 700:0.2 x)", "no reflectance"),
    ("reflectance(400:10, 700:20)", "divide percent by 100"),
    ("nothing#x", "is no file"),
]


@pytest.mark.parametrize(("text", "said"), MALFORMED)
def test_malformed(text, said):
    with pytest.raises(TargetError, match=said) as caught:
        parse_target(text)
    assert f"'{text}'" in str(caught.value)


@given(st.text(max_size=30))
def test_any_text_is_a_swatch_or_a_target_error(text):
    try:
        swatch = parse_target(text)
    except TargetError as error:
        assert text.strip() in str(error)  # noqa: PT017
    else:
        assert np.isfinite(swatch.to_linear(SRGB)).all()


def write(path, spectrum, scale=1.0):
    rows = zip(spectrum.wavelengths, scale * spectrum.values, strict=True)
    path.write_text("nm,R\n" + "\n".join(f"{nm},{float(value)!r}" for nm, value in rows))


@pytest.mark.parametrize("form", ["red.csv", "spectrum(red.csv)", "spectrum( 'red.csv' )"])
def test_spectrum_file(tmp_path, form):
    write(tmp_path / "red.csv", RED)
    swatch = parse_target(form, base=tmp_path)
    assert swatch.color == RED
    assert parse_target(str(tmp_path / "red.csv"), base="elsewhere").color == RED


def test_spectrum_that_is_not_a_reflectance(tmp_path):
    write(tmp_path / "red.csv", RED, 100)
    with pytest.raises(TargetError, match="divide percent by 100"):
        parse_target("red.csv", tmp_path)
    write(tmp_path / "red.csv", RED, -1)
    with pytest.raises(TargetError, match="0 to 1"):
        parse_target("red.csv", tmp_path)


def test_spectrum_file_error_names_the_line(tmp_path):
    (tmp_path / "red.csv").write_text("nm,R\n400,0.1\n410,x\n")
    with pytest.raises(TargetError, match=r"red\.csv, line 3"):
        parse_target("red.csv", tmp_path)


def test_balanced_photo_of_a_spectrum():
    swatch = Swatch.from_spectrum(RED)
    for space, light in ((SRGB, "D65"), (PROPHOTO, "D50"), (ACES, "D60")):
        matrix = colorimetry.adaptation_matrix(spectra.to_xyz(light), space.white)
        close(swatch.to_linear(space), space.from_xyz @ matrix @ spectra.to_xyz(light, RED))


@pytest.mark.parametrize("light", ["D65", "A", "FL11", 3200])
def test_spectrum_under_a_light_is_not_adapted(light):
    close(Swatch.from_spectrum(RED).to_linear(SRGB, light), SRGB.from_xyz @ spectra.to_xyz(light, RED))
    for observer in ("1931", "1964"):
        close(
            Swatch.from_spectrum(WHITE_TILE).to_linear(SRGB, light, observer),
            colorimetry.illuminant_white(light, SRGB, observer),
        )


def test_spectrum_in_a_camera():
    swatch = Swatch.from_spectrum(RED)
    close(swatch.to_linear(SRGB, "A", camera="nikon"), spectra.to_camera("A", RED, "nikon"))
    close(swatch.to_linear(SRGB, camera="nikon"), spectra.to_camera("D65", RED, "nikon"))


WHITE = np.array([1.3, 0.9, 0.4])


@pytest.mark.parametrize("text", ["#C0392B", "lab(42, 55, 35)", "rgb(0.4, 0.1, 0.02)"])
def test_reflected_by_von_kries(text):
    swatch = parse_target(text)
    close(swatch.to_reflected(SRGB, WHITE), swatch.to_linear(SRGB) * WHITE)


def test_reflected_spectrum_is_the_response_itself():
    # With the white of that very light, the product's pixel is what the light gives: no approximation left.
    swatch = Swatch.from_spectrum(RED)
    for light in ("A", "FL2"):
        white = colorimetry.illuminant_white(light, SRGB)
        close(swatch.to_reflected(SRGB, white, light), swatch.to_linear(SRGB, light))
        white = colorimetry.illuminant_white(light, SRGB, camera="nikon")
        close(swatch.to_reflected(SRGB, white, light, camera="nikon"), spectra.to_camera(light, RED, "nikon"))
    white = colorimetry.illuminant_white("D65", SRGB, camera="sigma")
    close(swatch.to_reflected(SRGB, white, camera="sigma"), spectra.to_camera("D65", RED, "sigma"))
    close(swatch.to_reflected(SRGB, WHITE), swatch.to_linear(SRGB) * WHITE)


@pytest.mark.parametrize("light", [None, "A", "FL11"])
def test_a_white_tile_reflects_the_white(light):
    close(Swatch.from_spectrum(WHITE_TILE).to_reflected(SRGB, WHITE, light), WHITE)


def test_reflected_under_a_light_outside_the_space():
    with pytest.raises(WhiteError, match="wider space"):
        Swatch.from_spectrum(RED).to_reflected(SRGB, WHITE, "HP1")
    assert np.isfinite(Swatch.from_spectrum(RED).to_reflected(REC2020, WHITE, "HP1")).all()


def test_reports_of_a_spectrum_are_measurements():
    swatch = Swatch.from_spectrum(RED)
    for light in ("D50", "A"):
        expected = colorimetry.xyz_to_lab(spectra.to_xyz(light, RED), spectra.to_xyz(light))
        close(swatch.to_lab(light), expected)
        close(swatch.to_xyz(light), spectra.to_xyz(light, RED))


def test_reports_of_linear_rgb_depend_on_the_space():
    swatch = parse_target("rgb(0.4, 0.1, 0.02)")
    close(swatch.to_lab("D65", SRGB), colorimetry.linear_to_lab([0.4, 0.1, 0.02], SRGB))
    close(swatch.to_lab("D50", PROPHOTO), colorimetry.linear_to_lab([0.4, 0.1, 0.02], PROPHOTO))


def test_made_swatches_say_what_they_are():
    assert str(Swatch.from_srgb([192 / 255, 57 / 255, 43 / 255])) == "#C0392B"
    assert str(Swatch.from_linear([0.5, 0.04, 0.02])) == "rgb(0.5, 0.04, 0.02)"
    assert str(Swatch.from_lab([42, 55, 35])) == "lab(42, 55, 35)"
    assert str(Swatch.from_xyz([0.2, 0.12, 0.05])) == "xyz(0.2, 0.12, 0.05)"
    assert str(Swatch.from_spectrum(RED)) == "red"
    assert str(Swatch.from_lab([42, 55, 35], name="Brick")) == "Brick"


def test_text_of_a_made_swatch_reads_back():
    for swatch in (
        Swatch.from_lab([42, 55, 35]),
        Swatch.from_xyz([0.2, 0.12, 0.05]),
        Swatch.from_linear([1, 0, 0.5]),
    ):
        assert parse_target(str(swatch)) == swatch


ALL_KINDS = [
    parse_target("#C0392B"),
    Swatch("Float codes", Encoded((0.123456789, 0.5, 0.9))),
    Swatch("P3", Encoded((0.9, -0.01, 0.1), "display-p3")),
    parse_target("rgb(0.5, 0.04, -0.02)"),
    Swatch.from_lab((42, 55, 35), "D65", "1964"),
    Swatch.from_lab((42, 55, 35), "0.7 D65 + 0.3 A"),
    Swatch.from_lab((42, 55, 35), 3200),
    Swatch.from_lab((102, -1, 2), "C"),
    Swatch.from_xyz((0.2, 0.12, 0.05), Spectrum(np.array([380.0, 780.0]), np.array([1.0, 3.0]), "lamp")),
    Swatch.from_spectrum(RED),
]


@pytest.mark.parametrize("swatch", ALL_KINDS, ids=lambda swatch: swatch.kind)
def test_what_is_written_is_the_same_color(swatch):
    again = parse_target(swatch.written)
    assert again.written == swatch.written
    assert type(again.color) is type(swatch.color)
    for space in (SRGB, PROPHOTO):
        close(again.to_linear(space), swatch.to_linear(space))
        close(again.to_linear(space, "A"), swatch.to_linear(space, "A"))


def test_swatches_keep_what_they_were_given_as():
    assert parse_target("lab(42 55 35 / F11 10)").color.illuminant == "FL11"
    assert parse_target("lab(42 55 35 / F11 10)").color.observer == "1964"
    assert parse_target("#C0392B").kind == "sRGB codes"
    assert "F11" not in parse_target("#C0392B").kind
    assert ALL_KINDS[8].color.illuminant == ""
    assert "81 steps" in ALL_KINDS[9].kind


def test_fate_says_what_is_done():
    red, lab = Swatch.from_spectrum(RED), parse_target("lab(42 55 35)")
    assert "integrated under A for the CIE 1964" in red.fate(SRGB, "A", "1964")
    assert "integrated under D65 with the sensitivities of Nikon" in red.fate(SRGB, camera="nikon")
    assert "adapted to the white of sRGB by CAT16" in red.fate(SRGB)
    assert "under D50, 2° observer is adapted to the white of sRGB by Bradford" in lab.fate(SRGB, adaptation="bradford")
    assert "as it is" in parse_target("rgb(.1 .2 .3)").fate(SRGB)


@pytest.mark.parametrize("method", ["cat16", "bradford"])
@pytest.mark.parametrize("space", [SRGB, P3, ACES, REC2020, PROPHOTO], ids=lambda space: space.name)
def test_conversion_against_colour_science(space, method):
    theirs = {"cat16": "CAT16", "bradford": "Bradford"}[method]
    whites = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]
    target = colour.xy_to_XYZ(colour.XYZ_to_xy(space.white))
    for name in ("D50", "D65"):
        white = colour.xy_to_XYZ(whites[name])
        xyz = colour.Lab_to_XYZ([42, 55, 35], whites[name])
        adapted = colour.adaptation.chromatic_adaptation_VonKries(xyz, white, target, transform=theirs)
        close(Swatch.from_lab((42, 55, 35), name).to_linear(space, adaptation=method), space.from_xyz @ adapted, 1e-6)
    sd = colour.SpectralDistribution(RED.values, RED.wavelengths)
    for light in ("A", "FL11", "LED-B3"):
        for observer in ("1931", "1964"):
            cmfs = colour.MSDS_CMFS[f"CIE {observer} {'2' if observer == '1931' else '10'} Degree Standard Observer"]
            xyz = colour.sd_to_XYZ(sd, cmfs, colour.SDS_ILLUMINANTS[light], method="Integration") / 100
            ours = Swatch.from_spectrum(RED).to_linear(space, light, observer)
            close(ours, space.from_xyz @ xyz, 1e-6)


def test_swatches_compare_by_value():
    assert parse_target("#C0392B") == parse_target("#C0392B")
    assert len({parse_target("#C0392B"), parse_target("#C0392B"), Swatch("x", Linear((1, 0, 0)))}) == 2
    assert Swatch.from_spectrum(RED) == Swatch.from_spectrum(spectra.chart()["red"])


def test_documented_examples_are_accepted():
    first_columns = re.findall(r"^(``.*?)  ", swatches.__doc__, re.MULTILINE)
    examples = [text for column in first_columns for text in re.findall(r"``([^`]+)``", column)]
    assert len(examples) == 11
    for text in examples:
        if not text.endswith((".csv", "...)")):
            assert np.isfinite(parse_target(text).to_linear(SRGB)).all()
