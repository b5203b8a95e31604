"""The eyedroppers, with a real mouse."""

import bpy
import gui_kit as gui
import numpy as np


def _open():
    image = gui.load("photo.png")
    window, area, region = yield from gui.image_editor(image)
    return image, window, area, region


def _begin(place, name):
    window, area, region = place
    operator = getattr(bpy.ops.dyehouse, name)
    gui.call(window, area, region, operator, "INVOKE_DEFAULT")
    yield gui.redrawn


def the_reference_and_undo():
    image, *place = yield from _open()
    image.dyehouse.regions.add()
    with bpy.context.temp_override(window=place[0]):
        bpy.ops.ed.undo_push(message="Region")
    yield from _begin(place, "pick_reference")
    yield from gui.click(*gui.at(place[2], image, 150, 220))
    yield gui.idle
    picked = bpy.data.images["photo.png"].dyehouse.regions[0]
    assert tuple(picked.reference) == (150, 220), tuple(picked.reference)
    assert picked.reference_source == "PIXEL"
    gui.undo()
    yield gui.redrawn
    picked = bpy.data.images["photo.png"].dyehouse.regions[0]
    assert tuple(picked.reference) == (-1, -1), tuple(picked.reference)
    gui.redo()
    yield gui.redrawn
    assert tuple(bpy.data.images["photo.png"].dyehouse.regions[0].reference) == (150, 220)


def the_white():
    image, *place = yield from _open()
    yield from _begin(place, "pick_white")
    yield from gui.click(*gui.at(place[2], image, 215, 140))
    yield gui.idle
    assert tuple(image.dyehouse.white_pixel) == (215, 140), tuple(image.dyehouse.white_pixel)
    assert image.dyehouse.white_source == "PIXEL"


def escape_and_right_mouse_leave_everything():
    image, *place = yield from _open()
    for leave in (lambda: gui.key("Escape"), lambda: gui._xdo("click", 3)):
        for name in ("pick_reference", "pick_white", "pick_region"):
            yield from _begin(place, name)
            gui.move(*gui.at(place[2], image, 150, 220))
            yield 0.1
            if name == "pick_region":
                yield from gui.click(*gui.at(place[2], image, 150, 220))
                yield from gui.click(*gui.at(place[2], image, 300, 30), hold=("shift",))
                assert len(image.dyehouse.regions) == 1
            leave()
            yield gui.idle
            settings = image.dyehouse
            assert len(settings.regions) == 0, name
            assert (settings.white_source, tuple(settings.white_pixel)) == ("BALANCED", (-1, -1))


def the_loupe_shows_the_pixels():
    image, *place = yield from _open()
    region = place[2]
    yield from _begin(place, "pick_reference")
    x, y = gui.at(region, image, 150, 220)
    gui.move(x, y)
    yield 1.0
    yield gui.redrawn
    gui.screenshot(gui.folder / "loupe.png")
    shown = gui.screen()
    codes = np.round(np.array(image.pixels[:]).reshape(400, 600, 4)[::-1, :, :3] * 255).astype(int)
    # 11 x 11 pixels, each ten screen pixels wide, beside the cursor.
    found = _find(shown, codes[215:226, 145:156], 10, gui.place(x, y))
    assert found, "the pixels around the cursor are not on the screen, enlarged"
    gui.key("Escape")
    yield gui.idle
    assert not _find(gui.screen(), codes[215:226, 145:156], 10, gui.place(x, y)), "the loupe is still there"


def _find(shown, pixels, size, near):
    """Whether the pixels are shown enlarged anywhere near a place, each within a code; the middle is marked."""
    row, column = near
    half = size // 2
    for top in range(row - 260, row + 60):
        for left in range(column - 200, column + 60):
            spots = shown[top + half : top + 11 * size : size, left + half : left + 11 * size : size].astype(int)
            if spots.shape == pixels.shape and (np.abs(spots - pixels).max(axis=2) <= 1).mean() > 0.95:
                return True
    return False


def clicks_of_a_region_are_single_steps():
    image, *place = yield from _open()
    with bpy.context.temp_override(window=place[0]):
        bpy.ops.ed.undo_push(message="Opened")
    yield from _begin(place, "pick_region")
    region = place[2]
    yield 1.0
    yield from gui.click(*gui.at(region, image, 150, 220))
    yield from gui.click(*gui.at(region, image, 300, 30), hold=("shift",))
    yield from gui.click(*gui.at(region, image, 500, 300), hold=("ctrl",))
    picked = image.dyehouse.regions[0]
    assert tuple(picked.click) == (150, 220), tuple(picked.click)
    assert [(tuple(m.pixel), m.removes) for m in picked.more_clicks] == [((300, 30), False), ((500, 300), True)]
    yield 1.0
    gui.screenshot(gui.folder / "region.png")
    gui.key("Return")
    yield gui.idle

    def clicks():
        regions = bpy.data.images["photo.png"].dyehouse.regions
        return None if not regions else len(regions[0].more_clicks)

    assert clicks() == 2
    for expected in (1, 0, None):
        gui.undo()
        yield gui.redrawn
        assert clicks() == expected, (clicks(), expected)
    for expected in (0, 1, 2):
        gui.redo()
        yield gui.redrawn
        assert clicks() == expected, (clicks(), expected)


def backspace_takes_a_click_back():
    image, *place = yield from _open()
    yield from _begin(place, "pick_region")
    region = place[2]
    yield 1.0
    yield from gui.click(*gui.at(region, image, 150, 220))
    yield from gui.click(*gui.at(region, image, 300, 30))
    gui.key("BackSpace")
    yield lambda: tuple(image.dyehouse.regions[0].click) == (150, 220)
    gui.key("Return")
    yield gui.idle
    assert tuple(image.dyehouse.regions[0].click) == (150, 220)


def a_click_on_a_clipped_pixel_is_refused():
    image, *place = yield from _open()
    codes = np.array(image.pixels[:]).reshape(400, 600, 4)[::-1, :, :3]
    y, x = np.argwhere((codes[100:300, 100:500] == 1).any(axis=2))[0] + 100
    yield from _begin(place, "pick_reference")
    yield 1.0
    yield from gui.click(*gui.at(place[2], image, int(x), int(y)))
    yield 0.3
    gui.screenshot(gui.folder / "clipped.png")
    assert len(image.dyehouse.regions) == 0
    assert place[0].modal_operators
    gui.key("Escape")
    yield gui.idle


def the_mouse_wheel_zooms_meanwhile():
    image, *place = yield from _open()
    yield from _begin(place, "pick_reference")
    space = place[1].spaces.active
    before = space.zoom[0]
    gui.move(*gui.at(place[2], image, 150, 220))
    yield 0.2
    gui._xdo("click", 4)
    yield lambda: space.zoom[0] > before
    yield gui.redrawn
    yield from gui.click(*gui.at(place[2], image, 150, 220))
    yield gui.idle
    assert tuple(image.dyehouse.regions[0].reference) == (150, 220)
