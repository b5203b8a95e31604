"""CxF3 against colour-cxf, whose classes are made from the standard's schema."""

from pathlib import Path

import colour
import colour_cxf
import numpy as np
import pytest
from colour_cxf import cxf3

from dyehouse.core import colorimetry, spectra, swatch_files
from dyehouse.core.errors import FileError
from dyehouse.core.library import Group, Library
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Encoded, Swatch, parse_target

SAMPLE = Path(colour_cxf.__file__).parent / "tests" / "resources" / "sample.cxf"
NAMESPACE = 'xmlns:cc="http://colorexchangeformat.com/CxF3-core"'


def values(thing, kind):
    return [v for v in thing.color_values.choice if isinstance(v, kind)]


def test_the_sample_of_colour_cxf():
    library, theirs = (
        swatch_files.read(SAMPLE),
        colour_cxf.read_cxf_from_file(SAMPLE).resources.object_collection.object_value,
    )
    assert [s.text for s in library.swatches] == [thing.name for thing in theirs]
    # Its spectra end at 680 nm, so that Lab is taken.
    assert any("400 to 700" in note for note in library.notes)
    for swatch, thing in zip(library.swatches, theirs, strict=True):
        (lab,) = values(thing, cxf3.ColorCielab)
        np.testing.assert_allclose(swatch.to_lab("D50"), (lab.l, lab.a, lab.b), atol=1e-9)
        assert (swatch.color.illuminant, swatch.color.observer) == ("D50", "1931")


def test_written_files_follow_the_schema():
    reflectance = Spectrum(np.arange(380.0, 731, 10), np.linspace(0.05, 0.9, 36))
    uneven = Spectrum(np.array([360.0, 400, 450, 500, 550, 600, 650, 700]), np.linspace(0.1, 0.3, 8))
    swatches = (
        Swatch.from_spectrum(reflectance, "Rising <red> & more"),
        Swatch.from_lab((42, 55, -35), "D65", "1964", "Ten degrees"),
        parse_target("#C0392B"),
        Swatch("Adobe", Encoded((0.2, 0.4, 0.6), "adobe-rgb")),
        Swatch.from_lab((50, 10, 10), "F11", name="Store"),
        Swatch.from_spectrum(uneven, "Uneven"),
    )
    data, losses = swatch_files.encode(Library("All", (Group("Standard", swatches),)), ".cxf")
    theirs = colour_cxf.read_cxf(data).resources
    things = {thing.name: thing for thing in theirs.object_collection.object_value}
    specifications = {one.id: one.tristimulus_spec for one in theirs.color_specification_collection.color_specification}
    assert list(things) == [s.text for s in swatches]
    (spectrum,) = values(things["Rising <red> & more"], cxf3.ReflectanceSpectrum)
    assert spectrum.start_wl == 380
    np.testing.assert_allclose(spectrum.value, reflectance.values, rtol=1e-7)
    (lab,) = values(things["Ten degrees"], cxf3.ColorCielab)
    np.testing.assert_allclose((lab.l, lab.a, lab.b), (42, 55, -35), atol=1e-7)
    stated = specifications[lab.color_specification]
    assert stated.illuminant_or_custom_illuminant.value.value == "D65"
    assert stated.observer.value.value == "10_Degree"
    (rgb,) = values(things["#C0392B"], cxf3.ColorSrgb)
    assert (rgb.r, rgb.g, rgb.b) == (0xC0, 0x39, 0x2B)
    assert losses == ["1 of 6 swatches are written as Lab under D50, as the format holds no more."]

    again = swatch_files.parse(data, ".cxf", "All")
    np.testing.assert_allclose(again.lab, Library.of("", swatches).lab, atol=1e-6)
    assert isinstance(again.swatches[0].color, Spectrum)
    assert again.swatches[3].color == Encoded((0.2, 0.4, 0.6), "adobe-rgb")
    assert again.swatches[4].color.illuminant == "FL11"


def cxf(values, specification="", name="Navy"):
    return (
        f"<cc:CxF {NAMESPACE}>\n<cc:Resources><cc:ObjectCollection>\n"
        f'<cc:Object Name="{name}" Id="1" ObjectType="Target">'
        f"<cc:ColorValues>\n{values}</cc:ColorValues></cc:Object></cc:ObjectCollection>"
        f'<cc:ColorSpecificationCollection><cc:ColorSpecification Id="S">{specification}</cc:ColorSpecification>'
        "</cc:ColorSpecificationCollection></cc:Resources></cc:CxF>"
    ).encode()


STEP_20 = '<cc:MeasurementSpec><cc:WavelengthRange StartWL="360" Increment="20"/></cc:MeasurementSpec>'
REFLECTANCE = "<cc:ReflectanceSpectrum ColorSpecification='S'>{}</cc:ReflectanceSpectrum>"


def test_range_and_step_of_spectra():
    numbers = np.linspace(0.1, 0.9, 20)
    (swatch,) = swatch_files.parse(cxf(REFLECTANCE.format(" ".join(map(str, numbers))), STEP_20), ".cxf", "x").swatches
    np.testing.assert_array_equal(swatch.color.wavelengths, np.arange(360, 741, 20))
    np.testing.assert_allclose(swatch.color.values, numbers)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (
            "<cc:ColorCIEXYZ ColorSpecification='S'><cc:X>20</cc:X><cc:Y>12</cc:Y><cc:Z>5</cc:Z></cc:ColorCIEXYZ>",
            [0.2, 0.12, 0.05],
        ),
        (
            "<cc:ColorCIExyY ColorSpecification='S'><cc:x>0.4</cc:x><cc:y>0.3</cc:y><cc:Y>12</cc:Y></cc:ColorCIExyY>",
            colour.xyY_to_XYZ([0.4, 0.3, 0.12]),
        ),
        (
            "<cc:ColorCIELCh ColorSpecification='S'><cc:L>50</cc:L><cc:C>30</cc:C><cc:H>120</cc:H></cc:ColorCIELCh>",
            colorimetry.lab_to_xyz(colorimetry.lch_to_lab([50, 30, 120]), spectra.to_xyz("A", None, "1964")),
        ),
    ],
)  # fmt: skip
def test_other_kinds_of_color(value, expected):
    light = (
        "<cc:TristimulusSpec><cc:Illuminant>A</cc:Illuminant><cc:Observer>10_Degree</cc:Observer></cc:TristimulusSpec>"
    )
    (swatch,) = swatch_files.parse(cxf(value, light), ".cxf", "x").swatches
    assert (swatch.color.illuminant, swatch.color.observer) == ("A", "1964")
    np.testing.assert_allclose(swatch.color.xyz, expected, atol=1e-9)


LAB = "<cc:ColorCIELab ColorSpecification='S'><cc:L>42</cc:L><cc:A>55</cc:A><cc:B>-35</cc:B></cc:ColorCIELab>"
CUSTOM = "<cc:TristimulusSpec>{}<cc:Observer>{}</cc:Observer></cc:TristimulusSpec>"


@pytest.mark.parametrize(("degrees", "theirs"), [("2_Degree", "2 Degree"), ("10_Degree", "10 Degree")])
@pytest.mark.parametrize("by_points", [False, True])
def test_an_illuminant_of_the_file_s_own(degrees, theirs, by_points):
    lamp = colour.SDS_ILLUMINANTS["LED-RGB1"].copy().align(colour.SpectralShape(380, 780, 5))
    powers = " ".join(map(str, lamp.values))
    inside = f'<cc:CustomIlluminant Name="Lamp" WLStart="380" List_Increment="5"><cc:SPDList>{powers}</cc:SPDList>'
    if by_points:
        points = zip(lamp.wavelengths, lamp.values, strict=True)
        inside = "<cc:CustomIlluminant>" + "".join(
            f'<cc:SpectralPoint WL="{nm}">{v}</cc:SpectralPoint>' for nm, v in points
        )
    data = cxf(LAB, CUSTOM.format(inside + "</cc:CustomIlluminant>", degrees))
    library = swatch_files.parse(data, ".cxf", "x")
    assert library.notes == ()
    ((xyz, white),) = [(s.color.xyz, s.color.white) for s in library.swatches]
    cmfs = colour.MSDS_CMFS[f"CIE {'1931' if degrees[0] == '2' else '1964'} {theirs} Standard Observer"]
    expected = colour.sd_to_XYZ(colour.sd_ones(lamp.shape), cmfs, lamp) / 100
    np.testing.assert_allclose(white, expected, rtol=2e-4)  # theirs is summed at the lamp's own 5 nm
    np.testing.assert_allclose(colorimetry.xyz_to_lab(xyz, white), (42, 55, -35), atol=1e-9)
    assert library.swatches[0].color.illuminant == ""


def test_a_white_that_the_file_gives():
    named = CUSTOM.format('<cc:Illuminant X="90" Y="100" Z="40">Custom</cc:Illuminant>', "10_Degree")
    (swatch,) = swatch_files.parse(cxf(LAB, named), ".cxf", "x").swatches
    np.testing.assert_allclose(swatch.color.white, (0.9, 1, 0.4))
    assert (swatch.color.illuminant, swatch.color.observer) == ("", "1964")
    np.testing.assert_allclose(colorimetry.xyz_to_lab(swatch.color.xyz, swatch.color.white), (42, 55, -35), atol=1e-9)


def test_lamps_by_their_makers_names():
    for name, ours in (("TL83", "FL12"), ("TL84", "FL11"), ("UL30", "FL12"), ("UL50", "FL10"), ("F7", "FL7")):
        data = cxf(LAB, CUSTOM.format(f"<cc:Illuminant>{name}</cc:Illuminant>", "2_Degree"))
        assert swatch_files.parse(data, ".cxf", "x").swatches[0].color.illuminant == ours


def test_what_cannot_be_known_of_light_and_observer_is_told():
    unknown = CUSTOM.format("<cc:Illuminant>UL35</cc:Illuminant>", "2_Degree")
    html = "<cc:ColorHTML HTML='#C0392B'/>"
    library = swatch_files.parse(cxf(LAB + html, unknown), ".cxf", "x")
    assert library.swatches[0].color == parse_target("#C0392B").color
    assert any("UL35" in note for note in library.notes)
    with pytest.raises(FileError, match="without a color that is known"):
        swatch_files.parse(cxf(LAB, unknown), ".cxf", "x")
    own = CUSTOM.format("<cc:Illuminant>D50</cc:Illuminant>", "Custom_CMF").replace("r>C", 'r Angle="8">C')
    library = swatch_files.parse(cxf(LAB, own), ".cxf", "x")
    assert library.swatches[0].color.observer == "1964"
    assert any("observer of its own" in note for note in library.notes)


def test_a_spectrum_point_by_point():
    nm, values = [390, 420, 450, 500, 540, 600, 650, 710], np.linspace(0.1, 0.8, 8)
    points = "".join(
        f'<cc:SpectralPoint WL="{w}">{v}</cc:SpectralPoint>' for w, v in list(zip(nm, values, strict=True))[::-1]
    )
    spectrum = f"<cc:CustomSpectrum ColorSpecification='S'>{points}</cc:CustomSpectrum>"
    measured = "<cc:MeasurementSpec><cc:MeasurementType>{}</cc:MeasurementType></cc:MeasurementSpec>"
    data = cxf(spectrum, measured.format("Spectrum_Reflectance"))
    (swatch,) = swatch_files.parse(data, ".cxf", "x").swatches
    np.testing.assert_array_equal(swatch.color.wavelengths, nm)
    np.testing.assert_allclose(swatch.color.values, values)
    with pytest.raises(FileError, match="without a color that is known"):  # a light has no color of a product
        swatch_files.parse(cxf(spectrum, measured.format("Spectrum_Emissive")), ".cxf", "x")


def test_inks_of_a_device():
    inks = "<cc:Cyan>100</cc:Cyan><cc:Magenta>50</cc:Magenta><cc:Yellow>0</cc:Yellow><cc:Black>20</cc:Black>"
    data = cxf(f"<cc:ColorCMYK>{inks}</cc:ColorCMYK>").replace(b"ColorValues", b"DeviceColorValues")
    np.testing.assert_allclose(swatch_files.parse(data, ".cxf", "x", "plain").swatches[0].color.rgb, (0, 0.4, 0.8))
    with pytest.raises(FileError, match="CMYK"):
        swatch_files.parse(data, ".cxf", "x")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "line 1.*no element"),
        (b"not xml", "line 1.*no sound XML"),
        (b"<a>\n<b></a>", "line 2.*mismatched"),
        (b"<html/>", "no CxF"),
        (cxf("<cc:ColorCIELab><cc:L>x</cc:L></cc:ColorCIELab>"), "line 4.*'x' and no number"),
        (cxf(REFLECTANCE.format("0.1 nan")), "line 4.*'nan'"),
        (cxf(REFLECTANCE.format("90 " * 20), STEP_20), "line 4.*goes up to 90"),
        (cxf("<cc:ColorHTML HTML='#12'/>"), "line 4.*ColorHTML is not understood"),
        (cxf("<cc:ColorDensity/>"), "without a color that is known"),
        (cxf(LAB, CUSTOM.format("<cc:CustomIlluminant WLStart='400' List_Increment='50'><cc:SPDList>1 1 1 1 1 1"
                                "</cc:SPDList></cc:CustomIlluminant>", "2_Degree")), "no power from 400 to 700"),
        (cxf(LAB, CUSTOM.format("<cc:CustomIlluminant><cc:SPDList>1</cc:SPDList></cc:CustomIlluminant>", "2_Degree")),
         "WLStart"),
        (cxf(LAB, CUSTOM.format("<cc:Illuminant X='0' Y='1' Z='1'>Custom</cc:Illuminant>", "2_Degree")), "not above 0"),
        (cxf("<cc:ColorCIELab ColorSpecification='S'><cc:L>1</cc:L><cc:A>1</cc:A><cc:B>1</cc:B></cc:ColorCIELab>",
             "<cc:TristimulusSpec><cc:Illuminant>Moon</cc:Illuminant></cc:TristimulusSpec>"), "line 4.*Moon"),
    ],
)  # fmt: skip
def test_malformed(data, said):
    with pytest.raises(FileError, match=said):
        swatch_files.parse(data, ".cxf", "bad")
