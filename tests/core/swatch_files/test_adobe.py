"""ASE and ACO, against the `swatch` package and bytes put together by hand."""

import struct

import numpy as np
import pytest
import swatch as independent

from dyehouse.core import swatch_files
from dyehouse.core.errors import FileError
from dyehouse.core.library import Group, Library
from dyehouse.core.swatches import Encoded, Swatch, parse_target

RED, BRICK = parse_target("#C0392B"), Swatch.from_lab((42, 55, -35), name="Brick é")
LIBRARY = Library("x", (Group("", (RED,)), Group("Warm", (BRICK, parse_target("lab(50, 1, 2 / D65)")))))


def test_ase_is_read_as_another_reader_reads_it(tmp_path):
    losses = swatch_files.write(tmp_path / "x.ase", LIBRARY)
    red, warm = independent.parse(tmp_path / "x.ase")
    assert (red["name"], red["data"]["mode"]) == ("#C0392B", "RGB")
    np.testing.assert_allclose(red["data"]["values"], np.array([0xC0, 0x39, 0x2B]) / 255, atol=1e-7)
    assert warm["name"] == "Warm"
    brick, other = warm["swatches"]
    assert (brick["name"], brick["data"]["mode"]) == ("Brick é", "LAB")
    np.testing.assert_allclose(brick["data"]["values"], (0.42, 55, -35), rtol=1e-6)
    np.testing.assert_allclose(other["data"]["values"] * np.array([100, 1, 1]), LIBRARY.lab[2], rtol=1e-6)
    assert losses == ["1 of 3 swatches are written as Lab under D50, as the format holds no more."]


def test_ase_of_another_writer(tmp_path):
    def color(name, mode, values):
        return {"name": name, "type": "Process", "data": {"mode": mode, "values": values}}

    tree = [
        color("Light Grey", "Gray", [0.75]),
        {"name": "Büro", "type": "Color Group", "swatches": [color("Teal", "LAB", [0.6, -35.0, -5.0])]},
        color("Ink", "CMYK", [1.0, 0.5, 0.0, 0.2]),
        color("Blue", "RGB", [0.0, 0.25, 1.0]),
    ]
    independent.write(tree, tmp_path / "y.ase")
    library = swatch_files.read(tmp_path / "y.ase")
    assert [(g.name, [s.text for s in g.swatches]) for g in library.groups] == [
        ("", ["Light Grey", "Blue"]),
        ("Büro", ["Teal"]),
    ]
    assert library.named("Blue").color == Encoded((0.0, 0.25, 1.0))
    assert library.named("light grey").color == Encoded((0.75, 0.75, 0.75))
    np.testing.assert_allclose(library.named("Büro/Teal").to_lab(), (60, -35, -5), atol=1e-5)
    assert any("1 swatches are CMYK" in note and "left out" in note for note in library.notes)
    assert any("taken as sRGB" in note for note in library.notes)

    plain = swatch_files.read(tmp_path / "y.ase", "plain")
    np.testing.assert_allclose(plain.named("Ink").color.rgb, (0, 0.4, 0.8), atol=1e-7)
    assert any("without a profile" in note for note in plain.notes)
    by_profile = swatch_files.read(tmp_path / "y.ase", lambda inks: 100 - 20 * inks[:, :3])
    np.testing.assert_allclose(by_profile.named("Ink").to_lab(), (80, 90, 100), atol=1e-6)


def test_short_floats_are_what_they_stand_for():
    again = swatch_files.parse(swatch_files.encode(LIBRARY, ".ase")[0], ".ase", "x")
    assert again.swatches[0].written == "#C0392B"
    assert again.swatches[1].written == "lab(42, 55, -35 / D50)"


def test_a_file_of_inks_alone_is_refused_with_the_reason(tmp_path):
    independent.write(
        [{"name": "K", "type": "Spot", "data": {"mode": "CMYK", "values": [0.0, 0.0, 0.0, 1.0]}}], tmp_path / "k.ase"
    )
    with pytest.raises(FileError, match="profile of its printer"):
        swatch_files.read(tmp_path / "k.ase")


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "byte 0.*ASEF"),
        (b"ASEX" + bytes(20), "byte 0.*ASEF"),
        (b"ASEF\0\1\0\0\0\0\0\1\0\1\0\0\0\x40", "byte 12.*64 bytes"),
        (b"ASEF\0\1\0\0\0\0\0\1\0\1\0\0\0\x08\0\1\0\0HSB ", "byte 22.*'HSB '"),
        (b"ASEF\0\1\0\0\0\0\0\1\0\1\0\0\0\x0c\0\1\0\0Gray\x7f\xc0\0\0", "byte 26.*not finite"),
    ],
)
def test_malformed_ase(data, said):
    with pytest.raises(FileError, match=said):
        swatch_files.parse(data, ".ase", "bad")


def aco(version, *colors):
    data = struct.pack(">HH", version, len(colors))
    for space, numbers, name in colors:
        data += struct.pack(">H4H", space, *numbers)
        if version == 2:
            text = (name + "\0").encode("utf-16-be")
            data += struct.pack(">I", len(text) // 2) + text
    return data


COLORS = [
    (0, (49344, 14649, 11051, 0), "Brick"),
    (1, (43690, 65535, 65535, 0), "Blue by hue"),
    (7, (4200, 5500, 0x10000 - 3500, 0), "Lab"),
    (8, (2500, 0, 0, 0), "Quarter gray"),
    (2, (0, 65535, 65535, 65535), "Cyan"),
    (3, (1, 2, 3, 4), "Somebody's"),
]


@pytest.mark.parametrize("data", [aco(2, *COLORS), aco(1, *COLORS) + aco(2, *COLORS)], ids=["version 2", "both"])
def test_aco_with_names(data):
    library = swatch_files.parse(data, ".aco", "x", "plain")
    assert [s.text for s in library.swatches] == ["Brick", "Blue by hue", "Lab", "Quarter gray", "Cyan"]
    assert library.named("Brick").color == parse_target("#C0392B").color
    np.testing.assert_allclose(library.named("Blue by hue").color.rgb, (0, 0, 1), atol=1e-4)
    np.testing.assert_allclose(library.named("Lab").to_lab(), (42, 55, -35), atol=1e-9)
    assert library.named("Quarter gray").color.rgb == (0.75, 0.75, 0.75)
    assert library.named("Cyan").color.rgb == (0, 1, 1)
    assert any("Pantone book" in note for note in library.notes)


def test_aco_without_names():
    library = swatch_files.parse(aco(1, *COLORS), ".aco", "x")
    assert [s.text for s in library.swatches] == [f"Color {k}" for k in (1, 2, 3, 4)]


def test_written_aco_holds_both_versions():
    data, losses = swatch_files.encode(LIBRARY, ".aco")
    assert data[:4] == b"\0\1\0\3"
    assert struct.unpack(">5H", data[4:14]) == (0, 49344, 14649, 11051, 0)
    assert struct.unpack(">HHhhH", data[14:24]) == (7, 4200, 5500, -3500, 0)
    again = swatch_files.parse(data, ".aco", "x")
    assert [s.text for s in again.swatches] == [s.text for s in LIBRARY.swatches]
    np.testing.assert_allclose(again.lab, LIBRARY.lab, atol=0.006)
    assert any("groups" in loss for loss in losses)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\0", "byte 0.*bytes are missing"),
        (b"\0\5\0\0", "byte 0.*version is 5"),
        (aco(1, *COLORS)[:-3], "byte 54.*missing"),
        (aco(2, (0, (0, 0, 0, 0), "Long name"))[:-4], "byte 14.*name of 10 characters"),
        (aco(1, (99, (0, 0, 0, 0), "")), "byte 4.*color space 99"),
        (aco(1), "no swatch that can be used"),
    ],
)
def test_malformed_aco(data, said):
    with pytest.raises(FileError, match=said):
        swatch_files.parse(data, ".aco", "bad")
