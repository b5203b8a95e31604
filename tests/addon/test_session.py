"""Looks at photos are kept, made in a thread, and outlive what happens in Blender meanwhile."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import bpy
import numpy as np
import pytest

from dyehouse import addon
from dyehouse.addon import background, images, session
from dyehouse.core.errors import DyehouseError

pytestmark = pytest.mark.usefixtures("blender")


@pytest.fixture
def image(photo: Any) -> bpy.types.Image:
    """A photo with a clicked region."""
    made = photo.image()
    bpy.ops.dyehouse.add_region(image=made.name)
    region = made.dyehouse.regions[0]
    region.click, region.target.text = photo.MATTE, "#1F4E79"
    return made


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], None]]:
    """Looks wait in their thread until this is called."""
    from dyehouse.batch import photo as photos

    gate, look = threading.Event(), photos.look

    def slow(*arguments: Any, **options: Any) -> Any:
        gate.wait(20)
        return look(*arguments, **options)

    monkeypatch.setattr(photos, "look", slow)
    yield gate.set
    gate.set()
    settled()


def settled() -> None:
    for _ in range(2000):
        if not background.busy():
            return
        time.sleep(0.01)
    raise AssertionError("the thread does not end")


def made(image: bpy.types.Image) -> session.Look:
    session.ready(image)
    settled()
    look = session.ready(image)
    assert look is not None
    return look


def test_a_look_is_made_in_a_thread(image: bpy.types.Image, held: Callable[[], None]) -> None:
    assert session.last(image) is None
    assert session.ready(image) is None
    assert session.busy()
    assert session.ready(image) is None
    held()
    settled()
    look = session.ready(image)
    assert look is not None
    assert session.last(image).key == look.key
    assert session.look(image).prepared.analyses[0] is look.prepared.analyses[0]


def test_another_target_needs_no_other_look_and_another_click_does(image: bpy.types.Image) -> None:
    look, region = made(image), image.dyehouse.regions[0]
    region.target.text = "lab(60, 50, 20)"
    image.dyehouse.light_source = "ILLUMINANT"
    other = session.ready(image)
    assert other.prepared.analyses[0] is look.prepared.analyses[0]
    assert str(other.prepared.recipe.regions[0].target) == "lab(60, 50, 20)"
    assert not np.allclose(other.prepared.target_white, look.prepared.target_white)
    region.tolerance = 2
    assert session.ready(image) is None
    assert made(image).photo.pixels is look.photo.pixels


def test_a_painted_mask_is_looked_at_again(image: bpy.types.Image, photo: Any) -> None:
    mask = bpy.data.images.new("mask", photo.WIDTH, photo.HEIGHT)
    values = np.repeat(photo.coverage()[..., None], 4, axis=2)
    images.set_pixels(mask, values)
    region = image.dyehouse.regions[0]
    region.mask_source, region.mask_image = "IMAGE", mask
    look = session.look(image)
    assert session.look(image).prepared.analyses[0] is look.prepared.analyses[0]
    images.set_pixels(mask, values * 0.5)
    assert session.look(image).prepared.analyses[0] is not look.prepared.analyses[0]


def test_problems_are_told_again_and_again_until_they_are_mended(image: bpy.types.Image, photo: Any) -> None:
    region = image.dyehouse.regions[0]
    region.click = (4000, 4000)
    session.ready(image)
    settled()
    for _ in range(2):
        with pytest.raises(DyehouseError, match="outside"):
            session.ready(image)
    assert session.last(image) is None
    region.click = photo.MATTE
    assert made(image)


def test_an_image_may_vanish_while_it_is_looked_at(
    image: bpy.types.Image, photo: Any, held: Callable[[], None]
) -> None:
    assert session.ready(image) is None
    bpy.data.images.remove(image)
    held()
    settled()
    again = photo.image("16-bit.png")
    bpy.ops.dyehouse.add_region(image=again.name)
    again.dyehouse.regions[0].click = photo.MATTE
    assert made(again).photo.pixels.dtype == np.uint16


def test_another_blend_may_be_opened_while_a_photo_is_looked_at(
    image: bpy.types.Image, photo: Any, held: Callable[[], None]
) -> None:
    assert session.ready(image) is None
    bpy.ops.wm.read_factory_settings(use_empty=True)
    held()
    settled()
    again = photo.image()
    bpy.ops.dyehouse.add_region(image=again.name)
    again.dyehouse.regions[0].click = photo.MATTE
    look = made(again)
    assert (look.photo.pixels == images.photo_of(again).pixels).all()


def test_the_addon_may_be_disabled_while_a_photo_is_looked_at(image: bpy.types.Image, held: Callable[[], None]) -> None:
    assert session.ready(image) is None
    addon.unregister()
    held()
    settled()
    addon.register()
    assert bpy.data.images[image.name].dyehouse.regions[0].target.text == "#1F4E79"
    assert made(image)


def test_undo_and_redo_bring_settings_and_looks_back(image: bpy.types.Image) -> None:
    name = image.name
    image.use_fake_user = True
    bpy.ops.ed.undo_push(message="first")
    first = made(image)
    image.dyehouse.regions[0].tolerance = 3
    image.dyehouse.regions[0].target.text = "#AA2211"
    bpy.ops.ed.undo_push(message="second")
    second = made(image)
    assert second.key != first.key
    bpy.ops.ed.undo()
    image = bpy.data.images[name]  # references are void after undo
    assert image.dyehouse.regions[0].target.text == "#1F4E79"
    assert session.last(image).prepared.analyses[0] is first.prepared.analyses[0]
    bpy.ops.ed.redo()
    image = bpy.data.images[name]
    assert image.dyehouse.regions[0].target.text == "#AA2211"
    assert session.last(image).prepared.analyses[0] is second.prepared.analyses[0]


def test_a_region_that_is_not_picked_yet_leaves_the_others(image: bpy.types.Image) -> None:
    before = made(image)
    settings = image.dyehouse
    bpy.ops.dyehouse.add_region(image=image.name, name="Sole")
    settings.regions.move(1, 0)
    look = made(image)
    assert look.regions == (1,)
    assert look.place(0) is None
    assert look.place(1) == 0
    assert look.prepared.analyses[0] is before.prepared.analyses[0]
    assert tuple(settings.regions[0].found_color) == (0, 0, 0)
    assert min(settings.regions[1].found_color) > 0
    with pytest.raises(DyehouseError, match="'Sole' is not picked yet"):
        session.look(image)
    settings.regions[0].mask_source = "SPLINE"
    assert made(image).regions == (1,)
    settings.regions[0].mask_source = "WHOLE"
    assert made(image).regions == (0, 1)


def test_warnings_are_found_in_a_thread(image: bpy.types.Image) -> None:
    image.dyehouse.regions[0].mask_source = "WHOLE"  # product and ground
    assert session.warnings(image, None) == ()  # the photo has not been looked at
    look = made(image)
    assert session.warnings(image, look) == ()
    settled()
    assert session.warnings(image, look) == tuple(look.prepared.warnings)
    assert look.prepared.warnings


def test_many_pixels_in_memory_are_looked_at_without_waiting(
    image: bpy.types.Image, monkeypatch: pytest.MonkeyPatch
) -> None:
    image.pixels.foreach_set(np.array(image.pixels[:], np.float32))  # now they are not those of the file
    monkeypatch.setattr(images, "_FEW", 0)
    assert images.version_of(image, hurry=True) is None
    assert session.ready(image) is None
    settled()
    assert images.version_of(image, hurry=True) == images.version_of(image)
    assert (made(image).photo.pixels == images.photo_of(image).pixels).all()


def test_few_looks_are_kept(image: bpy.types.Image, photo: Any) -> None:
    first = session.look(image)
    for kind in ("16-bit.png", "half.exr", "8-bit.tif"):
        other = photo.image(kind)
        bpy.ops.dyehouse.add_region(image=other.name)
        other.dyehouse.regions[0].click = photo.MATTE
        session.look(other)
    assert session.last(image) is None
    again = session.look(image)
    assert (again.photo.pixels == first.photo.pixels).all()


def test_a_render_is_another_photo_each_time() -> None:
    scene = bpy.context.scene
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "CYCLES", 8, 8
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.ops.object.camera_add()
    scene.camera = bpy.context.object
    versions = []
    for _ in range(2):
        bpy.ops.render.render()
        versions.append(images.version_of(bpy.data.images["Render Result"]))
    assert versions[0] != versions[1]
    assert images.version_of(bpy.data.images["Render Result"]) == versions[1]
