"""The eyedroppers with a pixel that is given, without a window."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse.addon import session
from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB

pytestmark = pytest.mark.usefixtures("blender")


@pytest.fixture
def image(coffee_file: Path) -> bpy.types.Image:
    return bpy.data.images.load(str(coffee_file))


def shown(image: bpy.types.Image) -> tuple[object, ...]:
    region = image.dyehouse.regions[0]
    more = [(tuple(click.pixel), click.removes) for click in region.more_clicks]
    return region.mask_source, tuple(region.click), more


def test_the_reference_makes_a_region_if_there_is_none(image: bpy.types.Image) -> None:
    assert bpy.ops.dyehouse.pick_reference(image=image.name, pixel=(150, 220)) == {"FINISHED"}
    region = image.dyehouse.regions[0]
    assert (region.reference_source, tuple(region.reference)) == ("PIXEL", (150, 220))
    assert session.look(image).prepared.analyses[0].pixel == (150, 220)


def test_the_reference_of_the_active_region(image: bpy.types.Image) -> None:
    for _ in range(2):
        image.dyehouse.regions.add()
    image.dyehouse.active_region = 1
    bpy.ops.dyehouse.pick_reference(image=image.name, pixel=(150, 220))
    assert [tuple(region.reference) for region in image.dyehouse.regions] == [(-1, -1), (150, 220)]


def test_the_white_is_the_color_of_the_card(image: bpy.types.Image) -> None:
    image.dyehouse.gray = 0.18
    assert bpy.ops.dyehouse.pick_white(image=image.name, pixel=(215, 140)) == {"FINISHED"}
    assert (image.dyehouse.white_source, tuple(image.dyehouse.white_pixel)) == ("PIXEL", (215, 140))
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(150, 220))
    look = session.look(image)
    card = look.prepared.analyses[0].picture.linear()[140, 215]
    np.testing.assert_allclose(look.prepared.white, card / 0.18, rtol=0.1)


def test_clicks_select_add_and_remove(image: bpy.types.Image) -> None:
    name = image.name
    bpy.ops.dyehouse.pick_region(image=name, pixel=(150, 220))
    assert shown(image) == ("CLICK", (150, 220), [])
    bpy.ops.dyehouse.pick_region(image=name, pixel=(300, 30), mode="ADD")
    bpy.ops.dyehouse.pick_region(image=name, pixel=(500, 300), mode="REMOVE")
    assert shown(image) == ("CLICK", (150, 220), [((300, 30), False), ((500, 300), True)])
    bpy.ops.dyehouse.pick_region(image=name, pixel=(160, 230))
    assert shown(image) == ("CLICK", (160, 230), [])


def test_a_click_selects_instead_of_another_kind_of_mask(image: bpy.types.Image) -> None:
    region = image.dyehouse.regions.add()
    region.mask_source, region.click = "WHOLE", (1, 1)
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(150, 220), mode="ADD")
    assert shown(image) == ("CLICK", (150, 220), [])


def test_adding_to_what_the_reference_selects(image: bpy.types.Image) -> None:
    bpy.ops.dyehouse.pick_reference(image=image.name, pixel=(150, 220))
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(300, 30), mode="ADD")
    assert shown(image) == ("CLICK", (-1, -1), [((300, 30), False)])
    covered = [np.count_nonzero(session.look(image).prepared.analyses[0].mask)]
    image.dyehouse.regions[0].more_clicks.clear()
    covered.append(np.count_nonzero(session.look(image).prepared.analyses[0].mask))
    assert covered[0] > covered[1]


@pytest.mark.parametrize("name", ["pick_reference", "pick_white", "pick_region"])
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"pixel": (600, 0)}, "outside the picture of 600 x 400"),
        ({}, "No pixel is given"),
        ({"image": "nothing", "pixel": (1, 1)}, "no image 'nothing'"),
        ({"image": "", "pixel": (1, 1)}, "no image here"),
    ],
)
def test_bad_input_is_told_and_changes_nothing(
    image: bpy.types.Image, name: str, arguments: dict[str, object], said: str
) -> None:
    with pytest.raises(RuntimeError, match=said):
        getattr(bpy.ops.dyehouse, name)(**{"image": image.name, **arguments})
    assert len(image.dyehouse.regions) == 0
    assert image.dyehouse.white_source == "BALANCED"


def test_nothing_is_taken_from_nothing(image: bpy.types.Image) -> None:
    with pytest.raises(RuntimeError, match="Nothing is selected yet"):
        bpy.ops.dyehouse.pick_region(image=image.name, pixel=(150, 220), mode="REMOVE")
    assert len(image.dyehouse.regions) == 0


@pytest.fixture
def patches(tmp_path: Path) -> bpy.types.Image:
    """Clipped, black, dark red, gray and red patches of 60 x 60 pixels."""
    codes = np.array([[255, 255, 255], [0, 0, 0], [22, 9, 9], [120, 121, 119], [180, 40, 40]], np.uint8)
    picture = codes.repeat(60, 0)[None].repeat(60, 0)
    path = tmp_path / "patches.png"
    files.write(path, picture, files.Photo(path, picture, SRGB))
    return bpy.data.images.load(str(path))


@pytest.mark.parametrize(
    ("name", "x", "said"),
    [
        ("pick_reference", 30, "is clipped"),
        ("pick_reference", 90, "is black"),
        ("pick_white", 30, "is clipped"),
        ("pick_white", 90, "is black"),
    ],
)
def test_pixels_that_say_nothing_are_refused(patches: bpy.types.Image, name: str, x: int, said: str) -> None:
    with pytest.raises(RuntimeError, match=said):
        getattr(bpy.ops.dyehouse, name)(image=patches.name, pixel=(x, 30))
    assert len(patches.dyehouse.regions) == 0
    assert patches.dyehouse.white_source == "BALANCED"


@pytest.mark.parametrize(("x", "said"), [(150, "reference is dark"), (210, "almost the color of the light"), (270, "")])
def test_doubtful_references_are_taken_with_the_warning(
    patches: bpy.types.Image, capfd: pytest.CaptureFixture[str], x: int, said: str
) -> None:
    assert bpy.ops.dyehouse.pick_reference(image=patches.name, pixel=(x, 30)) == {"FINISHED"}
    assert tuple(patches.dyehouse.regions[0].reference) == (x, 30)
    printed = capfd.readouterr().out
    assert said in printed
    assert ("Warning" in printed) == bool(said)


def test_linked_images_cannot_be_set(image: bpy.types.Image, tmp_path: Path) -> None:
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {image})
    bpy.data.images.remove(image)
    with bpy.data.libraries.load(path, link=True) as (source, target):
        target.images = source.images
    linked = target.images[0]
    with pytest.raises(RuntimeError, match="is linked from"):
        bpy.ops.dyehouse.pick_region(image=linked.name, pixel=(150, 220))


def test_there_is_no_mouse_in_the_background(image: bpy.types.Image) -> None:
    with pytest.raises(RuntimeError, match="No pixel is given"):
        bpy.ops.dyehouse.pick_reference("INVOKE_DEFAULT", image=image.name)
    assert bpy.ops.dyehouse.pick_reference("INVOKE_DEFAULT", image=image.name, pixel=(150, 220)) == {"FINISHED"}
