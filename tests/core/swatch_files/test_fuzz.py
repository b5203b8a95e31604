"""Whatever bytes come: a library, or one sentence."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import swatch_files
from dyehouse.core.errors import DyehouseError, FileError
from dyehouse.core.library import Group, Library
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Swatch, parse_target

WAVELENGTHS = np.arange(380.0, 731.0, 10.0)
SWATCHES = (
    parse_target("#C0392B"),
    Swatch.from_lab((42, 55, 35), "D65", "1964", "Brick, no. 2"),
    Swatch.from_spectrum(Spectrum(WAVELENGTHS, np.linspace(0.04, 0.8, 36)), 'Rising "red"'),
)
LIBRARY = Library("All kinds", (Group("", SWATCHES[:1]), Group("Measured", SWATCHES[1:])))
SOUND = {extension: swatch_files.encode(LIBRARY, extension)[0] for extension in swatch_files.WRITABLE}
SOUND |= {".tsv": SOUND[".csv"].replace(b",", b"\t"), ".ti3": SOUND[".txt"], ".mxf": SOUND[".cxf"]}
PIECES = {
    ".csv": ["name", "L", "a", "b", "hex", ",", ";", "\n", '"', "400", "#aabbcc", "1e9", "nan", "-", "0.5", "light"],
    ".txt": ["BEGIN_DATA\n", "END_DATA\n", "\n", "BEGIN_DATA_FORMAT\n", "END_DATA_FORMAT\n", " ", '"', "LAB_L", "5"],
    ".gpl": ["GIMP Palette", "\n", "Name: ", "255", " ", "\t", "#", "-1", "x"],
    ".cxf": ["<CxF>", "</CxF>", "<Object>", "<ColorValues>", "<L>", "5", "<!DOCTYPE x>", "&lt;", "&x;", "<ColorSRGB>"],
}  # fmt: skip


def read_or_told(data, extension):
    try:
        library, told = swatch_files.parse(data, extension, "fuzz"), None
    except DyehouseError as error:
        told = str(error)
    if told is not None:
        assert told.endswith(".")
        assert "\n" not in told
        assert len(told) < 1000
        return
    assert len(library) > 0
    assert np.isfinite(library.lab).all()
    assert np.isfinite(library.display_colors).all()
    for swatch in library.swatches:
        assert np.isfinite(parse_target(swatch.written).to_lab()).all()


def test_every_format_is_tried():
    assert set(SOUND) == set(swatch_files.FORMATS)
    for extension, data in SOUND.items():
        assert len(swatch_files.parse(data, extension, "sound")) == 3


@pytest.mark.parametrize("extension", SOUND)
@settings(deadline=None, max_examples=40)
@given(data=st.binary(max_size=300))
def test_any_bytes(extension, data):
    read_or_told(data, extension)


@pytest.mark.parametrize("extension", SOUND)
@settings(deadline=None, max_examples=80)
@given(edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 4), st.binary(max_size=8)), min_size=1, max_size=4))
def test_damaged_files(extension, edits):
    data = SOUND[extension]
    for place, size, new in edits:
        at = round(place * len(data))
        data = data[:at] + new + data[at + size :]
    read_or_told(data, extension)


@pytest.mark.parametrize("extension", PIECES)
@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_texts_that_are_almost_right(extension, data):
    parts = data.draw(st.lists(st.sampled_from(PIECES[extension]), max_size=40))
    read_or_told("".join(parts).encode(), extension)


@pytest.mark.parametrize("extension", SOUND)
def test_every_end(extension):
    data = SOUND[extension]
    for end in range(0, len(data), max(1, len(data) // 120)):
        read_or_told(data[:end], extension)


def test_no_hang_and_no_flood():
    bomb = b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' + b"".join(
        b'<!ENTITY %c "&%c;&%c;&%c;&%c;&%c;&%c;&%c;&%c;">' % (b + 1, *[b] * 8) for b in range(ord("a"), ord("z"))
    )
    with pytest.raises(FileError, match="document type"):
        swatch_files.parse(bomb + b"]><CxF>&z;</CxF>", ".cxf", "bomb")
    with pytest.raises(FileError, match="deep"):
        swatch_files.parse(b"<CxF>" + b"<a>" * 100_000, ".cxf", "deep")
    with pytest.raises(FileError, match="byte"):
        swatch_files.parse(b"\0\1\xff\xff" + b"\0" * 100, ".aco", "short")
    with pytest.raises(FileError, match="byte"):
        swatch_files.parse(b"ASEF\0\1\0\0\xff\xff\xff\xff\0\1\xff\xff\xff\xff", ".ase", "short")
    with pytest.raises(FileError, match="line 1"):
        swatch_files.parse(b'"' + b"a" * 200_000 + b'"', ".csv", "long")
