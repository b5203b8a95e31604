"""The swatch book in Blender: targets from swatches, favorites, files, palettes."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse.addon import recipes, swatches
from dyehouse.core import swatch_files
from dyehouse.core.colorspace import SRGB
from dyehouse.core.library import Library
from dyehouse.core.swatches import Swatch, parse_target


@pytest.fixture(autouse=True)
def image(blender: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bpy.types.Image:
    """An image of two regions, and a swatch book in an empty folder."""
    monkeypatch.setattr(swatches, "folder", lambda: str(tmp_path / "swatches"))
    made = bpy.data.images.new("photo", 8, 8)
    for name in ("Upper", "Sole"):
        made.dyehouse.regions.add().name = name
    return made


def target(image: bpy.types.Image, index: int = 0):
    return image.dyehouse.regions[index].target


def test_a_swatch_becomes_the_target_with_all_that_it_is(image: bpy.types.Image) -> None:
    foliage = swatches.book().library("ColorChecker").named("foliage")
    index = swatches.book().library("ColorChecker").swatches.index(foliage)
    assert bpy.ops.dyehouse.use_swatch(image="photo", library="ColorChecker", index=index) == {"FINISHED"}
    assert target(image).swatch_name == "foliage"
    for light in ("D65", "A", "FL11"):  # the spectrum is kept, not only its color
        expected, got = foliage.to_linear(SRGB, light), recipes.swatch_of(target(image)).to_linear(SRGB, light)
        assert np.allclose(got, expected, atol=1e-9)
    assert np.allclose(target(image).color, np.clip(foliage.to_linear(SRGB, adaptation="bradford"), 0, None), atol=1e-6)
    assert [s.text for s in swatches.book().recent] == ["foliage"]


def test_a_color_from_the_picker_replaces_the_swatch(image: bpy.types.Image) -> None:
    bpy.ops.dyehouse.set_target(image="photo", text="#1F4E79")
    assert recipes.swatch_of(target(image)) == parse_target("#1F4E79")
    target(image).color = (0.1, 0.2, 0.3)
    assert target(image).text == ""
    assert np.allclose(recipes.swatch_of(target(image)).to_linear(SRGB), (0.1, 0.2, 0.3), atol=1e-7)


def test_a_color_dropped_on_another_region_brings_its_swatch_along(image: bpy.types.Image) -> None:
    bpy.ops.dyehouse.use_swatch(image="photo", library="ColorChecker", index=3)
    target(image, 1).color = target(image).color
    assert target(image, 1).text == target(image).text
    assert target(image, 1).swatch_name == target(image).swatch_name
    bpy.ops.dyehouse.set_target(image="photo", region=1, text="#102030")
    assert bpy.ops.dyehouse.copy_target(image="photo", to=1) == {"FINISHED"}
    assert target(image, 1).text == target(image).text


def test_lists_of_the_browser(image: bpy.types.Image) -> None:
    state = swatches.browser()
    state.library, state.search = "CSS", "teal"
    assert [hit.swatch.text for hit in swatches.shown(None)] == ["teal"]
    state.listing = "NEAREST"
    near = swatches.shown(parse_target("#018080"))
    assert near[0].swatch.text == "teal"
    assert near[0].difference < 1
    state.listing = "FAVORITES"
    assert swatches.shown(None) == []
    bpy.ops.dyehouse.set_target(image="photo", text="#018080")
    bpy.ops.dyehouse.favorite_swatch(image="photo")
    assert [hit.swatch.text for hit in swatches.shown(None)] == ["#018080"]
    bpy.ops.dyehouse.use_swatch(image="photo", listing="FAVORITES", index=0)
    assert recipes.swatch_of(target(image)).to_linear(SRGB) == pytest.approx(parse_target("#018080").to_linear(SRGB))
    bpy.ops.dyehouse.favorite_swatch(image="photo", remove=True)
    assert swatches.shown(None) == []


def test_files_come_in_and_go_out(image: bpy.types.Image, tmp_path: Path) -> None:
    source, back = tmp_path / "brand.ase", tmp_path / "again.ase"
    made = [Swatch.from_srgb((k / 255, 0.5, 0.25), f"Shade {k}") for k in range(5)]
    swatch_files.write(source, Library.of("brand", made))
    assert bpy.ops.dyehouse.import_swatches(filepath=str(source)) == {"FINISHED"}
    assert swatches.book().is_own("brand")
    assert (tmp_path / "swatches" / "brand.ase").is_file()
    assert bpy.ops.dyehouse.export_swatches(filepath=str(back), library="brand") == {"FINISHED"}
    again = swatch_files.read(back)
    assert [s.text for s in again.swatches] == [s.text for s in made]
    assert np.allclose(again.lab, swatch_files.read(source).lab, atol=1e-9)
    with pytest.raises(RuntimeError, match="exists"):
        bpy.ops.dyehouse.export_swatches(filepath=str(back), library="brand")
    assert bpy.ops.dyehouse.remove_library(library="brand") == {"FINISHED"}
    assert not swatches.book().is_own("brand")


def test_palettes_come_in_and_go_out(image: bpy.types.Image) -> None:
    palette = bpy.data.palettes.new("Autumn")
    colors = [(0.4, 0.1, 0.02), (0.05, 0.2, 0.1)]
    for color in colors:
        palette.colors.new().color = color
    assert bpy.ops.dyehouse.swatches_from_palette(palette="Autumn") == {"FINISHED"}
    assert np.allclose(swatches.book().library("Autumn").linear_colors, colors, atol=1e-6)
    assert bpy.ops.dyehouse.swatches_to_palette(library="Autumn") == {"FINISHED"}
    made = bpy.data.palettes["Autumn.001"]
    assert np.allclose([entry.color for entry in made.colors], colors, atol=1e-6)
    palette.colors[0].color = (1, 1, 1)
    assert bpy.ops.dyehouse.swatches_from_palette(palette="Autumn") == {"FINISHED"}
    assert np.allclose(swatches.book().library("Autumn").linear_colors, colors, atol=1e-6)  # is left as it was
    assert np.allclose(swatches.book().library("Autumn 2").linear_colors[0], 1, atol=1e-6)


def test_a_folder_comes_in_as_one_library(image: bpy.types.Image, tmp_path: Path) -> None:
    folder = tmp_path / "Season 26"
    folder.mkdir()
    made = {"warm": [Swatch.from_srgb((k / 9, 0.2, 0.1), f"W{k}") for k in range(4)]}
    made["cold"] = [Swatch.from_lab((k * 10, 5, -40), "D65", "1964", f"C{k}") for k in range(3)]
    swatch_files.write(folder / "warm.ase", Library.of("warm", made["warm"]))
    swatch_files.write(folder / "cold.cxf", Library.of("cold", made["cold"]))
    assert bpy.ops.dyehouse.import_swatches(filepath=f"{folder}/") == {"FINISHED"}
    library = swatches.book().library("Season 26")
    assert set(library.group_names) == {"warm.ase", "cold.cxf"}
    assert {s.text for s in library.swatches} == {s.text for some in made.values() for s in some}
    assert library.named("C2").color.observer == "1964"
    with pytest.raises(RuntimeError, match=r"has 'Season 26\.csv' already"):
        bpy.ops.dyehouse.import_swatches(filepath=f"{folder}/")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: bpy.ops.dyehouse.set_target(image="photo", text="nonsense"), "not a color"),
        (lambda: bpy.ops.dyehouse.set_target(image="gone", text="#123456"), "no image 'gone'"),
        (lambda: bpy.ops.dyehouse.set_target(image="photo", region=7, text="#123456"), "no region 8"),
        (lambda: bpy.ops.dyehouse.use_swatch(image="photo", library="None such", index=0), "no library"),
        (lambda: bpy.ops.dyehouse.use_swatch(image="photo", library="CSS", index=9999), "no swatch 9999"),
        (lambda: bpy.ops.dyehouse.import_swatches(filepath="/nowhere/x.ase"), "x.ase"),
        (lambda: bpy.ops.dyehouse.swatches_from_palette(palette="None such"), "no palette"),
    ],
)
def test_bad_input_is_told_in_a_sentence(call, words: str) -> None:
    with pytest.raises(RuntimeError, match=words) as told:
        call()
    assert "Traceback" not in str(told.value)


def test_ten_thousand_swatches_are_searched_without_reading_them_again(image: bpy.types.Image, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    many = [Swatch.from_srgb(rng.random(3), f"Color {k}") for k in range(10_000)]
    swatches.book().keep("Many", many)
    swatches.changed()
    state = swatches.browser()
    state.library = "Many"
    library = swatches.book().library("Many")
    assert len(swatches.shown(None)) == swatches._MOST_HITS
    state.search = "9999"
    assert [hit.swatch.text for hit in swatches.shown(None)] == ["Color 9999"]
    assert swatches.book().library("Many") is library
    assert swatches.shown(None) is swatches.shown(None)  # drawn again and again
