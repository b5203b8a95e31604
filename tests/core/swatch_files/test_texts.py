"""GPL, CSV and CGATS, against Pillow and colour-science where they read them."""

from pathlib import Path

import colour
import numpy as np
import pytest
from PIL.GimpPaletteFile import GimpPaletteFile

from dyehouse.core import spectra, swatch_files
from dyehouse.core.errors import FileError
from dyehouse.core.library import Group, Library
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Encoded, Swatch, parse_target

RED = spectra.chart()["red"]
MIXED = Library(
    "Mixed",
    (
        Group("", (parse_target("#C0392B"), Swatch.from_spectrum(RED, "Red, measured"))),
        Group("Lab", (Swatch.from_lab((42, 55, 35), "D65", "1964", 'The "brick"'), parse_target("rgb(.1 .2 -.01)"))),
    ),
)
SPECTRAL = Library.of("Chart", [Swatch.from_spectrum(s, name) for name, s in spectra.chart().items()])


def parse(text, extension, **options):
    return swatch_files.parse(text.encode(), extension, "table", **options)


def test_gpl_is_read_as_pillow_reads_it(tmp_path):
    losses = swatch_files.write(tmp_path / "x.gpl", MIXED)
    with (tmp_path / "x.gpl").open("rb") as file:
        codes = np.frombuffer(GimpPaletteFile(file).getpalette()[0], np.uint8).reshape(-1, 3)[:4]
    ours = swatch_files.read(tmp_path / "x.gpl")
    assert ours.name == "Mixed"
    assert [s.text for s in ours.swatches] == [s.text for s in MIXED.swatches]
    np.testing.assert_array_equal([np.rint(255 * np.array(s.color.rgb)) for s in ours.swatches], codes)
    assert list(codes[0]) == [0xC0, 0x39, 0x2B]
    np.testing.assert_allclose(codes / 255, MIXED.display_colors, atol=0.51 / 255)
    assert losses[0].startswith("3 of 4 swatches")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1.*no GIMP palette"),
        ("GIMP Palette\n256 0 0 x", "line 2.*no color"),
        ("GIMP Palette\nName: x\n#\n1 2\n", "line 4.*'1 2'"),
        ("GIMP Palette\nName: x\n", "no swatch"),
    ],
)
def test_malformed_gpl(text, said):
    with pytest.raises(FileError, match=said):
        parse(text, ".gpl")


@pytest.mark.parametrize("library", [MIXED, SPECTRAL], ids=["mixed", "spectral"])
def test_csv_loses_nothing(library):
    data, losses = swatch_files.encode(library, ".csv")
    again = swatch_files.parse(data, ".csv", library.name)
    assert losses == []
    assert [g.name for g in again.groups] == [g.name for g in library.groups]
    for before, after in zip(library.swatches, again.swatches, strict=True):
        assert after.text == before.text
        assert after.written == before.written


LAYOUTS = [
    ("name,L,a,b\nBrick,42,55,35\n", (42, 55, 35), "D50"),
    ("Sample Name;L*;a*;b*\nBrick;42,0;55,0;35,0\n", (42, 55, 35), "D50"),
    ("CIE L*\tCIE a*\tCIE b*\tNAME\n42\t55\t35\tBrick\n", (42, 55, 35), "D50"),
    ("name,LAB_L,LAB_A,LAB_B,R,G,B\nBrick,42,55,35,1,2,3\n", (42, 55, 35), "D50"),
    ("name,illuminant,observer,L,a,b\nBrick,D65,10,42,55,35\n", (42, 55, 35), "D65"),
    ("# a comment\nname,L,C*ab,h°\nBrick,42,65.192024,32.471192\n", (42, 55, 35), "D50"),
    ("id,X,Y,Z\nBrick,0.2,0.12,0.05\n", parse_target("xyz(.2 .12 .05)").to_lab("D65"), "D65"),
    ("id,X,Y,Z\nBrick,20,12,5\n", parse_target("xyz(.2 .12 .05)").to_lab("D65"), "D65"),
    ("id,x,y,Y\nBrick,0.4,0.3,12\n", parse_target("xyy(.4 .3 .12)").to_lab("D65"), "D65"),
]


@pytest.mark.parametrize(("text", "lab", "light"), LAYOUTS)
def test_colorimetric_csv(text, lab, light):
    (swatch,) = parse(text, ".csv").swatches
    assert swatch.text == "Brick"
    assert swatch.color.illuminant == light
    if light == swatch.color.illuminant and swatch.color.observer == "1931":
        np.testing.assert_allclose(swatch.to_lab(light), lab, atol=1e-5)
    else:
        assert swatch.written == "lab(42, 55, 35 / D65 10)"


@pytest.mark.parametrize(
    "text",
    [
        "Brick,#C0392B\nOther,#000000\n",
        "#C0392B\n#000000\n",
        "hex;name\nC0392B;Brick\n#000000;Other",
        "name,R,G,B\nBrick,192,57,43\nOther,0,0,0\n",
        "name,red,green,blue\nBrick,0.7529411764705882,0.2235294117647059,0.16862745098039217\nOther,0,0,0\n",
        "name,color\nBrick,#C0392B\nOther,rgb(0 0 0)\n",
        "\ufeffname,RGB_R,RGB_G,RGB_B\r\nBrick,192,57,43\r\n\r\nOther,0,0,0\r\n",
    ],
)
def test_rgb_csv(text):
    library = parse(text, ".csv")
    assert len(library) == 2
    np.testing.assert_allclose(library.lab[0], parse_target("#C0392B").to_lab(), atol=1e-9)
    np.testing.assert_allclose(library.lab[1], 0, atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_names_of_any_encoding(encoding):
    data = "name,hex\nBüro,#C0392B\n".encode(encoding)
    assert swatch_files.parse(data, ".csv", "x").swatches[0].text == "Büro"


@pytest.mark.parametrize(
    ("title", "wavelengths"),
    [
        ("{}", np.arange(400, 701, 10)),
        ("{} nm", np.arange(360, 781, 5)),
        ("R{}nm", np.arange(380, 731, 10)),
        ("SPECTRAL_NM_{}", np.arange(700, 399, -20)),
        ("nm{}", np.array([390, 400, 430, 445, 500, 550, 620, 700, 720])),
    ],
)
@pytest.mark.parametrize("scale", [1, 100])
def test_spectral_csv_in_rows(title, wavelengths, scale):
    values = np.linspace(0.06, 0.9, len(wavelengths))
    rows = [
        "name," + ",".join(title.format(nm) for nm in wavelengths),
        "Up," + ",".join(f"{scale * v}" for v in values),
    ]
    library = parse("\n".join(rows), ".csv")
    order = np.argsort(wavelengths)
    np.testing.assert_array_equal(library.named("up").color.wavelengths, wavelengths[order])
    np.testing.assert_allclose(library.named("up").color.values, values[order], rtol=1e-12)
    assert any("percent" in note for note in library.notes) == (scale == 100)


def test_spectral_csv_in_columns_as_colour_science_reads_it(tmp_path):
    names = list(spectra.chart())[:4]
    columns = np.column_stack([RED.wavelengths, *(spectra.chart()[name].values for name in names)])
    text = (
        "wavelength," + ",".join(names) + "\n" + "\n".join(",".join(f"{v!r}" for v in row) for row in columns.tolist())
    )
    (tmp_path / "x.csv").write_text(text)
    theirs = colour.read_sds_from_csv_file(tmp_path / "x.csv")
    library = swatch_files.read(tmp_path / "x.csv")
    assert [s.text for s in library.swatches] == names
    for swatch in library.swatches:
        np.testing.assert_array_equal(swatch.color.wavelengths, theirs[swatch.text].wavelengths)
        np.testing.assert_array_equal(swatch.color.values, theirs[swatch.text].values)


def test_one_spectrum_is_called_by_its_file():
    text = "\n".join(f"{nm:g};{v}".replace(".", ",") for nm, v in zip(RED.wavelengths, RED.values, strict=True))
    (swatch,) = parse(text, ".csv").swatches
    assert swatch.text == "table"
    assert swatch.color == RED


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1.*no lines"),
        ("apples,pears\n1,2\n", "line 1.*'?apples, pears"),
        ("name,L,a,b\nBrick,42,55\n", "line 2.*lacks a number"),
        ("name,L,a,b\nBrick,42,55,x\n", "line 2.*lacks a number"),
        ("name,L,a,b\nok,1,2,3\n\nBrick,42,55,inf\n", "line 4.*lacks a number"),
        ("name,hex\nBrick,#12345\n", "line 2.*'#12345'"),
        ("name,illuminant,L,a,b\nBrick,Moon,42,55,35\n", "line 2.*Moon"),
        ("name,400,410,420,430,440,450,460\nx,1,1,1,1,1,1,1\n", "line 1.*400 to 700"),
        ("nm,a\n400,0.1\n390,0.2\n", "line 3.*does not increase"),
        ("nm,a\n400,0.1\n410,0.2,0.3\n", "line 3.*is not 2 numbers"),
        ("name," + ",".join(map(str, range(400, 701, 10))) + "\nx" + ",-0.5" * 31, "line 2.*goes down to -0.5"),
    ],
)
def test_malformed_csv(text, said):
    with pytest.raises(FileError, match=said):
        parse(text, ".csv")


HEADER = "{}\nNUMBER_OF_FIELDS {}\nBEGIN_DATA_FORMAT\n{}\nEND_DATA_FORMAT\nNUMBER_OF_SETS 1\nBEGIN_DATA\n{}\nEND_DATA\n"


def cgats(fields, row, head="CGATS.17"):
    return HEADER.format(head, len(fields.split()), fields, row)


@pytest.mark.parametrize("name", ["SPECTRAL_NM{}", "SPECTRAL_NM_{}", "SPEC_{}", "nm{}", "SPECTRAL_{}", "R_{}"])
@pytest.mark.parametrize(("start", "end", "step"), [(380, 730, 10), (400, 700, 20), (360, 750, 5)])
def test_spectral_cgats(name, start, end, step):
    wavelengths = np.arange(start, end + 1, step)
    values = np.linspace(6.0, 90.0, len(wavelengths))
    fields = "SAMPLE_ID SAMPLE_NAME LAB_L LAB_A LAB_B " + " ".join(name.format(nm) for nm in wavelengths)
    text = cgats(fields, '1 "Navy ""deep"" blue" 1 2 3 ' + " ".join(map(str, values)))
    (swatch,) = parse(text, ".txt").swatches
    assert swatch.text == 'Navy "deep" blue'
    np.testing.assert_array_equal(swatch.color.wavelengths, wavelengths)
    np.testing.assert_allclose(swatch.color.values, values / 100)


@pytest.mark.parametrize(("field", "scale"), [("SPECTRAL_PCT", 100), ("SPECTRAL_DEC", 1)])
@pytest.mark.parametrize("in_one_set", [True, False])
def test_spectral_cgats_in_pairs(field, scale, in_one_set):
    """As ISO 28178 has it: a wavelength, its value, in one set of a sample or in a set for each wavelength."""
    wanted = {}
    rows = []
    for name, wavelengths in (
        ("black", np.arange(400, 701, 20)),
        ("wine", np.arange(400, 701, 20)),
        ("gray", np.arange(380, 731, 10)),
    ):
        values = np.linspace(0.004, 0.012 if name == "black" else 0.9, len(wavelengths))
        wanted[name] = wavelengths, values
        pairs = [f"{nm} {v * scale!r}" for nm, v in zip(wavelengths, values.tolist(), strict=True)]
        rows += [f"{name} {' '.join(pairs)}"] if in_one_set else [f"{name} {pair}" for pair in pairs]
    if in_one_set:  # all sets of a table have as many fields
        wanted.pop("gray")
        rows.pop()
    fields = "SAMPLE_NAME" + f" SPECTRAL_NM {field}" * (16 if in_one_set else 1)
    library = parse(cgats(fields, "\n".join(rows)), ".txt")
    assert {swatch.text for swatch in library.swatches} == set(wanted)
    for swatch in library.swatches:
        wavelengths, values = wanted[swatch.text]
        np.testing.assert_array_equal(swatch.color.wavelengths, wavelengths)
        np.testing.assert_allclose(swatch.color.values, values)


@pytest.mark.parametrize(
    ("head", "light", "observer"),
    [
        ("CGATS.17", "D50", "1931"),
        ('IT8.7/2\nWEIGHTING_FUNCTION "ILLUMINANT, D65"\nWEIGHTING_FUNCTION "OBSERVER, 10 degree"', "D65", "1964"),
        ('CGATS.17\nILLUMINATION_NAME "D65"\nOBSERVER_ANGLE "10"', "D65", "1964"),
        ('CGATS.17\nILLUMINANT "A"\nOBSERVER "2"', "A", "1931"),
    ],
)
def test_colorimetric_cgats(head, light, observer):
    (swatch,) = parse(cgats("SAMPLE_ID LAB_L LAB_A LAB_B", "A1 42 55 35", head), ".it8").swatches
    (from_xyz,) = parse(cgats("SAMPLE_ID XYZ_X XYZ_Y XYZ_Z", "A1 20 12 5", head), ".it8").swatches
    assert {(s.color.illuminant, s.color.observer) for s in (swatch, from_xyz)} == {(light, observer)}
    assert swatch.text == "A1"
    np.testing.assert_allclose(from_xyz.color.xyz, (0.2, 0.12, 0.05))


def test_xrite_file_as_colour_science_reads_it():
    path = Path(colour.__file__).parent / "io" / "tests" / "resources" / "X-Rite_Digital_Colour_Checker.txt"
    theirs, library = colour.read_sds_from_xrite_file(path), swatch_files.read(path)
    assert [s.text for s in library.swatches] == list(theirs)
    for swatch in library.swatches:
        np.testing.assert_array_equal(swatch.color.wavelengths, theirs[swatch.text].wavelengths)
        np.testing.assert_array_equal(swatch.color.values, theirs[swatch.text].values)


def test_written_spectral_cgats_reads_back(tmp_path):
    assert swatch_files.write(tmp_path / "x.txt", SPECTRAL) == []
    for before, after in zip(SPECTRAL.swatches, swatch_files.read(tmp_path / "x.txt").swatches, strict=True):
        assert after.text == before.text
        np.testing.assert_allclose(after.color.values, before.color.values, rtol=1e-7)


def test_cgats_of_what_is_not_all_spectral():
    data, losses = swatch_files.encode(MIXED, ".cgats")
    np.testing.assert_allclose(swatch_files.parse(data, ".cgats", "x").lab, MIXED.lab, atol=1e-5)
    assert "Lab under D50" in losses[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("CGATS.17\n", "BEGIN_DATA"),
        ("BEGIN_DATA\n1 2 3\nEND_DATA\n", "no format"),
        (cgats("SAMPLE_ID LAB_L LAB_A LAB_B", "1 2 3"), "line 8.*3 values stand for 4 fields"),
        (cgats("SAMPLE_ID LAB_L LAB_A LAB_B", "1 2 3 x"), "line 8.*lacks a number"),
        (cgats("SAMPLE_ID DENSITY", "1 2"), "hold no color"),
        (cgats("SAMPLE_ID LAB_L LAB_A LAB_B", "1 2 3 4").replace("END_DATA\n", ""), "without END_DATA"),
        (cgats("SAMPLE_ID SPECTRAL_NM SPECTRAL_PCT", "1 400 3"), "hold no color"),
        (cgats("SAMPLE_ID SPECTRAL_NM SPECTRAL_PCT", "1 400 x"), "line 8.*'400 x' is no pair"),
        (cgats("SAMPLE_ID SPECTRAL_NM LAB_L", "1 400 3"), "SPECTRAL_NM is followed by LAB_L"),
    ],
)
def test_malformed_cgats(text, said):
    with pytest.raises(FileError, match=said):
        parse(text, ".txt")


def test_linear_colors_of_a_palette():
    colors = [[0.5, 0.04, 0.02], [1.5, 0.2, -0.1]]
    library = Library.from_linear_colors("Palette", colors, ["One"])
    assert [s.text for s in library.swatches] == ["One", "Color 2"]
    assert library.swatches[0].color == Encoded((0.5, 0.04, 0.02), "linear-srgb")
    np.testing.assert_allclose(library.linear_colors, colors, atol=1e-9)
    again = swatch_files.parse(swatch_files.encode(library, ".csv")[0], ".csv", "x")
    np.testing.assert_allclose(again.linear_colors, colors, atol=1e-9)


def test_a_folder_is_a_library(tmp_path):
    swatch_files.write(tmp_path / "a.csv", MIXED)
    swatch_files.write(tmp_path / "b.gpl", MIXED)
    (tmp_path / "notes.md").write_text("no swatches")
    (tmp_path / "bad.ase").write_bytes(b"nothing")
    library = swatch_files.read(tmp_path)
    assert [g.name for g in library.groups] == ["a.csv", "a.csv Lab", "b.gpl"]
    assert len(library) == 8
    assert any("'bad', byte 0" in note for note in library.notes)
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileError, match="no swatch file"):
        swatch_files.read(tmp_path / "empty")


def test_files_that_are_not_there_or_too_many(tmp_path):
    with pytest.raises(FileError, match="does not exist"):
        swatch_files.read(tmp_path / "no.ase")
    with pytest.raises(FileError, match="by its extension"):
        swatch_files.read(tmp_path / "no.docx")
    swatch_files.write(tmp_path / "x.gpl", MIXED)
    before = (tmp_path / "x.gpl").read_bytes()
    with pytest.raises(FileError, match="exists already"):
        swatch_files.write(tmp_path / "x.gpl", SPECTRAL)
    assert (tmp_path / "x.gpl").read_bytes() == before
    with pytest.raises(FileError, match=r"cannot be written as '\.ti3'"):
        swatch_files.write(tmp_path / "x.ti3", MIXED)
    with pytest.raises(FileError, match="could not be written"):
        swatch_files.write(tmp_path / "nowhere" / "x.gpl", MIXED)
    assert [p.name for p in tmp_path.iterdir()] == ["x.gpl"]


def test_a_spectrum_without_name_in_a_row():
    text = ",".join(map(str, range(400, 701, 10))) + "\n" + ",".join(["0.5"] * 31)
    with pytest.raises(FileError, match="does not increase"):
        parse(text, ".csv")  # without a name column the titles look like a line of numbers
    assert isinstance(parse("id," + text.replace("\n", "\n7,"), ".csv").named("7").color, Spectrum)
