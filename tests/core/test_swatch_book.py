"""The book: what is built in, what the user adds, and what is remembered."""

import json
import struct
import subprocess
import sys

import numpy as np
import pytest

from dyehouse.core import builtin_libraries, swatch_files
from dyehouse.core.errors import FileError, TargetError
from dyehouse.core.library import Library
from dyehouse.core.swatch_book import MOST_RECENT, Book, find
from dyehouse.core.swatches import Swatch, parse_target

NAVY, RED = Swatch("Navy", parse_target("#1F4E79").color), parse_target("ColorChecker#red")


@pytest.fixture
def book(tmp_path):
    return Book(tmp_path / "swatches")


@pytest.mark.parametrize("name", builtin_libraries.NAMES)
def test_built_in_libraries(name):
    library = find(name.upper())
    assert library.name in (name, "CSS")
    assert len(library) >= 14
    assert len({(g, s.text) for g, s in zip(library.group_names, library.swatches, strict=True)}) == len(library)
    assert np.isfinite(library.lab).all()
    assert library.notes


def test_nothing_that_may_not_be_shipped():
    names = " ".join(builtin_libraries.NAMES).casefold()
    assert not any(house in names for house in ("pantone", "ral", "hks", "ncs", "toyo"))


def test_grids_are_where_they_say():
    hlc = find("HLC")
    for text, lch in (("H260 L30 C030", (30, 30, 260)), ("H000 L50 C060", (50, 60, 0))):
        L, a, b = hlc.named(text).to_lab("D50")
        np.testing.assert_allclose((L, np.hypot(a, b), np.degrees(np.arctan2(b, a)) % 360), lch, atol=1e-6)
    assert find("Munsell-like").named("Red 5/10").to_lab()[0] == pytest.approx(50)
    assert parse_target("CSS#rebeccapurple").written == "#663399"


def test_a_user_s_file_becomes_a_library(book, tmp_path):
    swatch_files.write(tmp_path / "Spring.ase", Library.of("x", [NAVY]))
    assert not (tmp_path / "swatches").exists()  # nothing is written until something is kept
    imported = book.import_file(tmp_path / "Spring.ase")
    assert book.names[0] == "Spring"
    assert book.is_own("Spring")
    assert not book.is_own("CSS")
    assert imported.swatches[0].text == "Navy"
    assert book.library("Spring").named("navy").color.space == "srgb"
    with pytest.raises(FileError, match=r"'Spring\.ase' already"):
        book.import_file(tmp_path / "Spring.ase")
    assert [hit.library for hit in book.search("navy")] == ["Spring", "CSS"]
    nearest = book.nearest(NAVY, count=3)
    assert (nearest[0].library, nearest[0].difference) == ("Spring", pytest.approx(0, abs=1e-4))
    assert nearest == sorted(nearest, key=lambda hit: hit.difference)
    book.remove("Spring")
    assert not book.is_own("Spring")
    with pytest.raises(FileError, match="built in"):
        book.remove("CSS")


def test_what_is_no_swatch_file_is_not_imported(book, tmp_path):
    (tmp_path / "bad.ase").write_bytes(b"nothing")
    with pytest.raises(FileError, match="byte 0"):
        book.import_file(tmp_path / "bad.ase")
    assert not (tmp_path / "swatches").exists()


def test_a_bad_file_in_the_folder_is_told_and_hides_nothing(book, tmp_path):
    book.keep("Good", [NAVY])
    (tmp_path / "swatches" / "Bad.gpl").write_text("nothing")
    book.reload()
    assert book.search("navy")[0].library == "Good"
    assert any("no GIMP palette" in problem for problem in book.problems)
    with pytest.raises(FileError, match="no GIMP palette"):
        book.library("Bad")


def test_a_changed_file_is_read_again(book, tmp_path):
    book.keep("Mine", [NAVY])
    assert len(book.library("Mine")) == 1
    book.keep("Mine", [NAVY, RED])
    assert len(book.library("Mine")) == 2


def test_kept_libraries_lose_nothing(book):
    swatches = [NAVY, RED, parse_target("lab(42, 55, 35 / F11 10)"), parse_target("color(rec2020 .1 .9 .2)")]
    book.keep("All / kinds?", swatches)
    kept = book.library(next(name for name in book.names if name.startswith("All")))
    assert [s.written for s in kept.swatches] == [s.written for s in swatches]


def test_favorites_and_recent_outlive_the_session(book, tmp_path):
    for swatch in (NAVY, RED, NAVY):
        book.set_favorite(swatch)
        book.used(swatch)
    again = Book(tmp_path / "swatches")
    assert [s.text for s in again.favorites] == ["ColorChecker#red", "Navy"]
    assert [s.text for s in again.recent] == ["Navy", "ColorChecker#red"]
    assert again.favorites[0].color == RED.color  # the spectrum, without the library
    again.set_favorite(RED, False)
    assert [s.text for s in book.favorites] == ["Navy"]  # the other session sees it
    for k in range(MOST_RECENT + 5):
        book.used(Swatch.from_lab((50, k, 0)))
    assert len(book.recent) == MOST_RECENT
    assert book.recent[0].text == f"lab(50, {MOST_RECENT + 4}, 0)"
    assert json.loads((tmp_path / "swatches" / "favorites.json").read_text()) == [{"name": "Navy", "color": "#1F4E79"}]


def test_a_spoiled_list_is_told(book, tmp_path):
    book.set_favorite(NAVY)
    for text in ("[", "7", '[{"name": "x"}]', '[{"name": "x", "color": "x"}]'):
        (tmp_path / "swatches" / "favorites.json").write_text(text)
        with pytest.raises(FileError, match=r"favorites\.json' cannot be read"):
            _ = Book(tmp_path / "swatches").favorites


def test_a_book_without_a_folder_keeps_nothing():
    book = Book()
    assert book.favorites == []
    assert "CSS" in book.names
    with pytest.raises(FileError, match="no folder"):
        book.used(NAVY)


def test_swatches_of_files_as_targets(tmp_path):
    swatch_files.write(tmp_path / "My book.csv", Library.of("x", [NAVY, RED]))
    swatch = parse_target("My book.csv # navy", tmp_path)
    assert swatch.color == NAVY.color
    assert swatch.text == "My book.csv # navy"
    assert parse_target(f"{tmp_path}#Navy").color == NAVY.color  # the folder is a library
    for text, said in (
        ("My book.csv#teal", "no swatch 'teal'"),
        ("nothing.csv#x", "is no file"),
        ("CSS#", "no swatch ''"),
    ):
        with pytest.raises(TargetError, match=said):
            parse_target(text, tmp_path)


def test_tables_are_read_when_they_are_needed():
    code = """
from dyehouse.core import metamerism, spectra, swatch_book
book = swatch_book.Book()
assert len(book.names) == 8
assert swatch_book.parse_target("#1F4E79").written == "#1F4E79"
assert spectra._tables.cache_info().currsize == 0
assert len(book.library("ColorChecker")) == 24
assert spectra._tables.cache_info().currsize == 1
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_cmyk_is_kept_as_the_color_that_its_printer_makes_of_it(tmp_path):
    source = tmp_path / "press.aco"
    source.write_bytes(b"\0\1\0\1" + b"\0\2" + struct.pack(">4H", 0, 32767, 65535, 65535))
    book = Book(tmp_path / "book")
    with pytest.raises(FileError, match="CMYK"):
        book.import_file(source)
    book.import_file(source, lambda inks: np.array([[50.0, 40.0, -20.0]]))
    np.testing.assert_allclose(Book(tmp_path / "book").library("press").lab, [[50, 40, -20]], atol=1e-6)
