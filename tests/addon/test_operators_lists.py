"""The lists of regions and colorways, from scripts."""

from typing import Any

import bpy
import pytest

pytestmark = pytest.mark.usefixtures("blender")


@pytest.fixture
def image() -> bpy.types.Image:
    """An image with two regions and two colorways."""
    made = bpy.data.images.new("photo", 8, 8)
    for name, text in (("Upper", "#112233"), ("Sole", "#445566")):
        bpy.ops.dyehouse.add_region(image="photo", name=name)
        made.dyehouse.regions[-1].target.text = text
    bpy.ops.dyehouse.add_colorway(image="photo", name="First")
    bpy.ops.dyehouse.add_colorway(image="photo", name="Second")
    for region, text in zip(made.dyehouse.regions, ("#AA0000", "#BB0000"), strict=True):
        region.target.text = text
    return made


def texts(image: bpy.types.Image) -> dict[str, list[Any]]:
    return {c.name: [t.text if t.used else None for t in c.targets] for c in image.dyehouse.colorways}


def test_colorways_keep_the_targets_they_were_made_of(image: bpy.types.Image) -> None:
    assert texts(image) == {"First": ["#112233", "#445566"], "Second": ["#AA0000", "#BB0000"]}
    bpy.ops.dyehouse.use_colorway(image="photo", index=0)
    assert [r.target.text for r in image.dyehouse.regions] == ["#112233", "#445566"]


def test_duplicate_and_reorder(image: bpy.types.Image) -> None:
    bpy.ops.dyehouse.duplicate_colorway(image="photo", index=0)
    assert [c.name for c in image.dyehouse.colorways] == ["First", "First 2", "Second"]
    assert texts(image)["First 2"] == ["#112233", "#445566"]
    assert image.dyehouse.active_colorway == 1
    bpy.ops.dyehouse.move_colorway(image="photo", direction="DOWN")
    assert [c.name for c in image.dyehouse.colorways] == ["First", "Second", "First 2"]
    assert image.dyehouse.active_colorway == 2
    bpy.ops.dyehouse.move_colorway(image="photo", index=1, direction="UP")
    assert [c.name for c in image.dyehouse.colorways] == ["Second", "First", "First 2"]
    assert image.dyehouse.active_colorway == 2
    assert bpy.ops.dyehouse.move_colorway(image="photo", index=0, direction="UP") == {"CANCELLED"}


def test_removing_a_colorway_shows_its_neighbor(image: bpy.types.Image) -> None:
    assert image.dyehouse.active_colorway == 1
    bpy.ops.dyehouse.remove_colorway(image="photo", index=0)
    assert texts(image) == {"Second": ["#AA0000", "#BB0000"]}
    assert image.dyehouse.active_colorway == 0
    bpy.ops.dyehouse.remove_colorway(image="photo")
    assert image.dyehouse.active_colorway == -1
    assert [r.target.text for r in image.dyehouse.regions] == ["#AA0000", "#BB0000"]
    with pytest.raises(RuntimeError, match="no active colorway"):
        bpy.ops.dyehouse.remove_colorway(image="photo")
    with pytest.raises(RuntimeError, match="no colorway 8"):
        bpy.ops.dyehouse.duplicate_colorway(image="photo", index=7)


def test_colorways_follow_their_regions(image: bpy.types.Image) -> None:
    bpy.ops.dyehouse.move_region(image="photo", index=0, direction="DOWN")
    assert [r.name for r in image.dyehouse.regions] == ["Sole", "Upper"]
    assert texts(image) == {"First": ["#445566", "#112233"], "Second": ["#BB0000", "#AA0000"]}
    bpy.ops.dyehouse.add_region(image="photo", name="Sole")
    assert image.dyehouse.regions[2].name == "Sole 2"
    assert texts(image)["First"] == ["#445566", "#112233", None]
    bpy.ops.dyehouse.remove_region(image="photo", index=0)
    assert [r.name for r in image.dyehouse.regions] == ["Upper", "Sole 2"]
    assert texts(image)["First"] == ["#112233", None]
    with pytest.raises(RuntimeError, match="has no region 6"):
        bpy.ops.dyehouse.remove_region(image="photo", index=5)


def test_open_photo(photo: Any, tmp_path: Any) -> None:
    path = photo.file("16-bit.png")
    assert bpy.ops.dyehouse.open_photo(filepath=str(path)) == {"FINISHED"}
    bpy.ops.dyehouse.open_photo(filepath=str(path))
    assert [i.name for i in bpy.data.images if i.source == "FILE"] == ["16-bit.png"]
    (tmp_path / "text.png").write_text("no picture")
    for name, words in (("text.png", "no picture"), ("missing.png", "is no file")):
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.dyehouse.open_photo(filepath=str(tmp_path / name))
    assert [i.name for i in bpy.data.images if i.source == "FILE"] == ["16-bit.png"]
