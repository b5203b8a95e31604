"""Writing all colorways while the window goes on, stopping it with Esc, and their thumbnails."""

import bpy
import gui_kit as gui
import numpy as np
from bl_ext.user_default.dyehouse.addon import images, scripting, thumbnails
from bl_ext.user_default.dyehouse.addon.operators import write

SAUCER = (120, 250)
COLORS = {"navy": "#1F4E79", "brick": "#9A3B2E", "sand": "#C8B48C", "petrol": "#1F5E66", "moss": "#5A6B3A"}


def _set_up(image, click):
    bpy.ops.dyehouse.add_region(image=image.name)
    region = image.dyehouse.regions[0]
    region.click = click
    for name, color in COLORS.items():
        bpy.ops.dyehouse.add_colorway(image=image.name, name=name)
        region.target.text = color


def _written(pattern):
    return {name for name in COLORS if (gui.folder / pattern.format(colorway=name)).exists()}


def all_colorways_are_written_in_a_thread():
    image = gui.load("photo.png")
    window, area, region = yield from gui.image_editor(image, tab="Dyehouse")
    _set_up(image, SAUCER)
    output = str(gui.folder / "all-{colorway}.png")
    gui.call(window, area, region, bpy.ops.dyehouse.write_colorways, "INVOKE_DEFAULT", pattern=output)
    assert write.progress() is not None, "nothing is being written"
    assert not bpy.ops.dyehouse.write_colorways.poll(), "a second job may begin"
    yield lambda: write.progress() is None
    yield gui.idle
    assert _written("all-{colorway}.png") == set(COLORS), "a file is missing"
    for name, color in COLORS.items():
        expected = scripting.recolor(image, color, click=SAUCER)
        found = bpy.data.images.load(str(gui.folder / f"all-{name}.png"))
        assert (images.pixels_of(found)[..., :3] == images.pixels_of(expected)[..., :3]).all(), name


def escape_leaves_whole_files_only():
    small = gui.load("photo.png")
    codes = np.tile(images.pixels_of(small), (7, 7, 1))
    height, width = codes.shape[:2]
    image = bpy.data.images.new("large", width, height)
    images.set_pixels(image, codes)
    image.filepath_raw, image.file_format = str(gui.folder / "large.png"), "PNG"
    image.save()
    image = gui.load("large.png")
    window, area, region = yield from gui.image_editor(image, tab="Dyehouse")
    _set_up(image, SAUCER)
    output = str(gui.folder / "stopped-{colorway}.png")
    gui.call(window, area, region, bpy.ops.dyehouse.write_colorways, "INVOKE_DEFAULT", pattern=output)
    yield lambda: write.progress()[0] > 1.1  # in the middle of the second
    gui.move(region.x + region.width // 2, region.y + region.height // 2)
    gui.key("Escape")
    yield lambda: write.progress() is None
    yield gui.idle
    written = _written("stopped-{colorway}.png")
    assert 1 <= len(written) < len(COLORS), f"{written} after Esc"
    for name in written:
        found = bpy.data.images.load(str(gui.folder / f"stopped-{name}.png"))
        assert images.pixels_of(found).shape[:2] == (height, width), name
    left = [path.name for path in gui.folder.iterdir() if path.name.startswith((".dyehouse", "stopped"))]
    assert len(left) == len(written), f"{left} are left"
    # Nothing is in the way of another try.
    asked = {"pattern": output, "overwrite": True}
    gui.call(window, area, region, bpy.ops.dyehouse.write_colorways, "INVOKE_DEFAULT", **asked)
    yield lambda: write.progress() is None
    assert _written("stopped-{colorway}.png") == set(COLORS)


def another_file_may_be_opened_meanwhile():
    image = gui.load("photo.png")
    window, area, region = yield from gui.image_editor(image, tab="Dyehouse")
    _set_up(image, SAUCER)
    output = str(gui.folder / "left-{colorway}.tif")
    gui.call(window, area, region, bpy.ops.dyehouse.write_colorways, "INVOKE_DEFAULT", pattern=output)
    bpy.ops.wm.read_homefile(use_empty=True)
    yield lambda: write.progress() is None
    yield 0.5
    for path in gui.folder.glob("left-*.tif"):
        assert images.pixels_of(bpy.data.images.load(str(path))).shape[:2] == (400, 600), path
    assert not list(gui.folder.glob(".dyehouse*")), "a part of a file is left"


def colorways_have_thumbnails():
    image = gui.load("photo.png")
    _, area, _ = yield from gui.image_editor(image, tab="Dyehouse")
    _set_up(image, SAUCER)

    def shown():
        area.tag_redraw()
        thumbnails.update(image)
        return all(thumbnails.icon(image, index) for index in range(len(COLORS)))

    yield shown
    middle = []
    for index, color in enumerate(COLORS.values()):
        icon = thumbnails._icons[f"{image.session_uid}-{index}"]
        side = icon.image_size[0]
        pixels = np.array(icon.image_pixels_float[:]).reshape(side, side, 4)[::-1]
        x, y = SAUCER[0] * side // 600, SAUCER[1] * side // 600 + (side - side * 400 // 600) // 2
        middle.append(pixels[y, x, :3])
        wanted = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255
        assert np.corrcoef(middle[-1], wanted)[0, 1] > 0.8, f"{color} is shown as {middle[-1]}"
    before = thumbnails.icon(image, 0)
    image.dyehouse.active_colorway = 0
    image.dyehouse.regions[0].target.text = "#EEEE22"

    def changed():
        shown()
        icon = thumbnails._icons[f"{image.session_uid}-0"]
        pixels = np.array(icon.image_pixels_float[:]).reshape(icon.image_size[1], icon.image_size[0], 4)[::-1]
        return np.abs(pixels[y, x, :3] - middle[0]).max() > 0.2

    yield changed
    assert thumbnails.icon(image, 0) == before, "the icon has another number"
