"""A designer's way through a photo, with the mouse; what is left is compared with the core by `test_designer.py`."""

import json

import bpy
import gui_kit as gui
import numpy as np

SAUCER, COFFEE, CARD = (120, 250), (272, 151), (395, 90)
TARGETS = {"Petrol": "#1F5E66", "Sand": "#C8B48C", "Black": "#1E1E20"}


def _open(area, name):
    """Open a file by the panel's button and Blender's file browser."""
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from gui.press(area, "dyehouse.open_photo")
    yield lambda: gui.main_window().screen.areas[0].type == "FILE_BROWSER"
    browser = gui.main_window().screen.areas[0]
    yield lambda: browser.spaces.active.params
    browser.spaces.active.params.directory = str(gui.folder).encode()
    browser.spaces.active.params.filename = name
    yield 0.3
    gui.move(browser.x + browser.width * 0.6, browser.y + browser.height * 0.5)
    yield gui.PAUSE
    gui.key("Return")
    yield lambda: name in bpy.data.images
    yield gui.redrawn


def _editor(tab="Dyehouse"):
    _, area, region = gui.editor("IMAGE_EDITOR")
    yield from gui.sidebar(area, tab)
    return area, region


def _zoom(area, region, ratio):
    gui.call(gui.main_window(), area, region, bpy.ops.image.view_zoom_ratio, ratio=ratio)
    yield gui.redrawn


def _seen(area, region, image):
    """The whole picture as the screen shows it, nothing over it."""
    yield from gui.sidebar(area, None)
    gui.move(region.x + 5, region.y + 5)
    yield from gui.settle()
    seen = gui.picture(region, image)
    yield from gui.sidebar(area, "Dyehouse")
    return seen


def a_product_is_recolored_with_the_mouse():
    area, region = yield from _editor()
    yield from _open(area, "photo.png")
    image = area.spaces.active.image
    settings = image.dyehouse
    yield from _zoom(area, region, 2)
    codes = np.array(image.pixels).reshape(400, 600, 4)[::-1, :, :3] * 255

    # The region: its overlay leaves what is selected as it is, and dims the rest.
    yield from gui.press(area, "dyehouse.pick_region")
    yield gui.redrawn

    def dimmed(x, y):
        gui.move(region.x + 5, region.y + 5)  # so that the loupe is out of the way
        yield from gui.settle()
        shown = gui.screen()[gui.place(*gui.at(region, image, x, y))]
        return np.abs(shown - codes[y, x]).max() > 8

    yield from gui.click(*gui.at(region, image, *SAUCER))
    yield lambda: settings.regions
    (product,) = settings.regions
    assert not (yield from dimmed(*SAUCER)), "the clicked product is dimmed"
    assert (yield from dimmed(*COFFEE)), "what was not clicked is not dimmed"
    yield from gui.click(*gui.at(region, image, *COFFEE), hold=("shift",))
    yield lambda: len(product.more_clicks) == 1
    assert not (yield from dimmed(*COFFEE)), "Shift did not add"
    yield from gui.click(*gui.at(region, image, *COFFEE), hold=("ctrl",))
    yield lambda: len(product.more_clicks) == 2
    assert (yield from dimmed(*COFFEE)), "Ctrl did not remove"
    assert not (yield from dimmed(*SAUCER)), "Ctrl removed too much"
    gui.figure("blender-region", area)
    gui.key("Return")
    yield gui.idle
    (product,) = settings.regions

    yield from gui.press(area, "dyehouse.pick_reference")
    yield gui.redrawn
    gui.move(*gui.at(region, image, *SAUCER))
    yield from gui.settle()
    gui.figure("blender-reference", area)
    yield from gui.click(*gui.at(region, image, *SAUCER))
    yield gui.idle
    assert tuple(product.reference) == SAUCER, tuple(product.reference)

    yield from gui.press(area, "dyehouse.pick_white")
    yield gui.redrawn
    gui.move(*gui.at(region, image, *CARD))
    yield from gui.settle()
    gui.figure("blender-white", area)
    yield from gui.click(*gui.at(region, image, *CARD))
    yield gui.idle
    assert tuple(settings.white_pixel) == CARD, tuple(settings.white_pixel)

    # Live: the screen follows the color while the button is still down, and nothing is written.
    yield from gui.press(area, "dyehouse.preview")
    yield from gui.settle()
    before, color_before = (yield from _seen(area, region, image)), tuple(product.target.color)
    assert np.abs(before.astype(int) - codes).max() > 50, "the preview shows nothing"
    x, y = yield from gui.find(area, "target.color", across=0.7)
    closed = gui.screen()
    yield from gui.click(x, y)
    yield gui.redrawn
    wheel = gui.color_wheel(closed)
    shown = []

    def midway():
        yield gui.redrawn
        gui.figure("blender-target")
        shown.append(gui.screen()[gui.place(*gui.at(region, image, *SAUCER))])

    yield from gui.drag(wheel, (wheel[0] - 30, wheel[1] - 20), (wheel[0] - 25, wheel[1] + 35), between=midway)
    yield from gui.click(region.x + 5, region.y + 5)  # closes the picker, and makes the drag one step to undo
    yield gui.idle
    color = tuple(product.target.color)
    assert np.abs(np.subtract(color, color_before)).max() > 0.05, "the drag did not change the color"
    after = yield from _seen(area, region, image)
    moved = np.abs(shown[0].astype(int) - before[SAUCER[::-1]]).max()
    assert moved > 8, f"the preview did not follow the drag: {moved}"
    assert not np.abs(np.array(image.pixels).reshape(400, 600, 4)[::-1, :, :3] * 255 - codes).max() > 0
    np.save(gui.folder / "preview.npy", after)

    # Undo and redo bring back the color and the preview.
    gui.move(*gui.at(region, image, *SAUCER))
    gui.key("ctrl+z")
    yield from gui.settle()
    image = bpy.data.images["photo.png"]
    assert tuple(image.dyehouse.regions[0].target.color) == color_before, "undo"
    assert (yield from _seen(area, region, image)).tolist() == before.tolist(), "the preview after undo"
    gui.move(*gui.at(region, image, *SAUCER))
    gui.key("ctrl+shift+z")
    yield from gui.settle()
    image = bpy.data.images["photo.png"]
    assert tuple(image.dyehouse.regions[0].target.color) == color, "redo"
    assert (yield from _seen(area, region, image)).tolist() == after.tolist(), "the preview after redo"

    # Colorways, each typed in, and all of them to files.
    settings = image.dyehouse
    for name, text in TARGETS.items():
        yield from gui.press(area, "dyehouse.add_colorway", across=0.83)
        yield gui.redrawn
        settings.colorways[settings.active_colorway].name = name
        yield from gui.click(*(yield from gui.find(area, "target.text", across=0.7)))
        yield gui.redrawn
        gui.key("ctrl+a")
        gui.write(text)
        gui.key("Return")
        yield from gui.settle()
    settings.output_pattern = str(gui.folder / "{photo}-{colorway}.png")
    yield from gui.press(area, "dyehouse.write_colorways")
    yield lambda: all((gui.folder / f"photo-{name}.png").exists() for name in TARGETS)
    yield gui.idle
    settings.output_pattern = "//{photo}-{colorway}.png"  # no folder of this machine in the picture
    yield gui.redrawn
    gui.figure("blender-colorways", area)

    product = settings.regions[0]
    left = {
        "click": tuple(product.click),
        "added": [tuple(more.pixel) for more in product.more_clicks if not more.removes],
        "removed": [tuple(more.pixel) for more in product.more_clicks if more.removes],
        "reference": tuple(product.reference),
        "white": tuple(settings.white_pixel),
        "dragged": color,
        "colorways": TARGETS,
    }
    (gui.folder / "asked.json").write_text(json.dumps(left))
