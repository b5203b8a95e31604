"""The live preview: what is on the screen is what the core makes of the photo, within one code."""

from pathlib import Path

import bpy
import gui_kit as gui
import numpy as np
from preview_kit import CLICK, addon, ready, with_region


def _expected(image):
    """The codes of the recolored photo in a file like its own, (height, width, 3)."""
    from bl_ext.user_default.dyehouse.core import recolor

    look = addon()[2].look(image)
    kind = look.photo.pixels.dtype
    picture = look.prepared.analyses[0].picture
    return recolor.recolor(picture, look.prepared.regions(), curve=look.photo.space.curve, dtype=kind)[0]


def _differences(image, region, expected, shift=0.0, step=37, columns=slice(None), rows=(35, 400)):
    """Differences in codes between the screen and the expected codes at a grid of the picture's pixels."""
    shown, found = gui.screen(), []
    height, width = expected.shape[:2]
    for y in range(rows[0], min(height, rows[1]), step):
        for x in range(5, width, step)[columns]:
            place = gui.place(*gui.at(region, image, x + shift * width, y))
            found.append(np.abs(shown[place].astype(int) - expected[y, x].astype(int)).max())
    assert len(found) > 20, len(found)
    return np.array(found)


def the_screen_shows_what_the_core_makes():
    image = gui.load("photo.png")
    picked = with_region(image)
    _, _, region = yield from gui.image_editor(image)
    yield from ready(image)
    first = _expected(image)
    difference = _differences(image, region, first)
    assert difference.max() <= 1, difference.max()
    picked.target.color = (0.7, 0.02, 0.01)
    yield gui.redrawn
    second = _expected(image)
    assert np.abs(first.astype(int) - second).max() > 100
    difference = _differences(image, region, second)
    assert difference.max() <= 1, difference.max()


def split_and_side_by_side():
    image = gui.load("photo.png")
    with_region(image)
    window, area, region = yield from gui.image_editor(image)
    yield from ready(image)
    codes = np.round(np.array(image.pixels[:]).reshape(400, 600, 4)[::-1, :, :3] * 255).astype(int)
    recolored = _expected(image)
    image.dyehouse.view, image.dyehouse.split = "SPLIT", 0.5
    yield gui.redrawn
    assert _differences(image, region, codes, columns=slice(0, 8)).max() <= 1
    assert _differences(image, region, recolored, columns=slice(9, None)).max() <= 1
    image.dyehouse.view = "SIDE"
    gui.call(window, area, region, bpy.ops.image.view_zoom_ratio, ratio=2.0)
    yield gui.redrawn
    gui.call(window, area, region, bpy.ops.image.view_pan, offset=(300, 0))
    yield gui.redrawn
    assert _differences(image, region, codes, columns=slice(-8, None), rows=(120, 300)).max() <= 1
    assert _differences(image, region, recolored, shift=1.02, columns=slice(0, 8), rows=(120, 300)).max() <= 1
    gui.screenshot(gui.folder / "side.png")


def _shown(name, space="sRGB"):
    """Open a file of the scratch folder in an editor: `yield from` gives image and region."""
    image = gui.load(name)
    image.colorspace_settings.name = space
    _, _, region = yield from gui.image_editor(image)
    return image, region


def _patches():
    """(200, 300, 3) smooth red to dark, linear: a product with gloss on gray."""
    y, x = np.mgrid[:200, :300]
    shade = np.clip(1.1 - np.hypot(y - 90, x - 120) / 120, 0.02, 1)
    picture = shade[..., None] * np.array([0.6, 0.12, 0.08]) + (np.exp(-np.hypot(y - 60, x - 90) / 9) * 0.3)[..., None]
    picture[:, 240:] = 0.3
    return picture.astype(np.float32)


def _same_as_written(image, region):
    """The preview looks like the recolored photo, written and opened in the same editor; `yield from` it."""
    from bl_ext.user_default.dyehouse.batch import photo as photos

    yield from ready(image)
    preview, look = gui.screen(), addon()[2].look(image)
    path = gui.folder / f"written-{image.session_uid}-{Path(image.filepath).name or image.name}"
    photos.save(look.photo, look.prepared, path, force=True)
    written = bpy.data.images.load(str(path))
    written.colorspace_settings.name = image.colorspace_settings.name
    window = gui.main_window()
    area = next(area for area in window.screen.areas if area.type == "IMAGE_EDITOR")
    area.spaces.active.image = written
    gui.call(window, area, region, bpy.ops.image.view_all, fit_view=True)
    yield gui.redrawn
    yield gui.redrawn
    left, top = gui.at(region, image, 4, 4)
    right, bottom = gui.at(region, image, image.size[0] - 30, image.size[1] - 4)
    (r0, c0), (r1, c1) = gui.place(left, top), gui.place(right, bottom)
    difference = np.abs(preview[r0:r1, c0:c1].astype(int) - gui.screen()[r0:r1, c0:c1]).max(axis=2)
    assert difference.size > 40_000, difference.shape
    assert difference.max() <= 1, (image.name, difference.max(), (difference > 1).mean())


def sixteen_bits():
    from bl_ext.user_default.dyehouse.batch import files
    from bl_ext.user_default.dyehouse.core import colorspace, transfer

    codes = transfer.encode(_patches(), transfer.SRGB, np.uint16)
    path = gui.folder / "sixteen.png"
    files.write(path, codes, files.Photo(path, codes, colorspace.SRGB))
    image, region = yield from _shown("sixteen.png")
    with_region(image, (120, 110))
    yield from _same_as_written(image, region)


def an_exr_with_alpha():
    from bl_ext.user_default.dyehouse.batch import files
    from bl_ext.user_default.dyehouse.core import colorspace

    alpha = np.clip((_patches()[..., :1] * 3), 0, 1)
    pixels = np.concatenate([_patches() * alpha, alpha], axis=2).astype(np.float32)
    path = gui.folder / "light.exr"
    files.write(path, pixels, files.Photo(path, pixels, colorspace.LINEAR_SRGB, premultiplied=True))
    image, region = yield from _shown("light.exr", "Linear Rec.709")
    with_region(image, (120, 110), color=(0.01, 0.3, 0.02))
    yield from _same_as_written(image, region)


def straight_alpha():
    from bl_ext.user_default.dyehouse.batch import files
    from bl_ext.user_default.dyehouse.core import colorspace, transfer

    codes = transfer.encode(_patches(), transfer.SRGB, np.uint8)
    alpha = np.broadcast_to(np.linspace(20, 255, 300).astype(np.uint8)[None, :, None], (200, 300, 1))
    pixels = np.concatenate([codes, alpha], axis=2)
    path = gui.folder / "alpha.png"
    files.write(path, pixels, files.Photo(path, pixels, colorspace.SRGB))
    image, region = yield from _shown("alpha.png")
    with_region(image, (120, 110))
    yield from _same_as_written(image, region)


def other_working_spaces():
    for space in ("ACEScg", "Linear Rec.2020"):
        with bpy.context.temp_override(window=gui.main_window()):
            done = bpy.ops.wm.set_working_color_space(working_space=space)
        assert done == {"FINISHED"}, done
        assert bpy.data.colorspace.working_space == space
        image = gui.load("photo.png")
        _, _, region = yield from gui.image_editor(image)
        with_region(image)
        yield from _same_as_written(image, region)
        bpy.data.images.remove(image)


def a_photo_in_another_space():
    from bl_ext.user_default.dyehouse.batch import files
    from bl_ext.user_default.dyehouse.core import colorspace, transfer

    space = colorspace.SPACES["display-p3"]
    codes = transfer.encode(_patches(), space.curve, np.uint8)
    path = gui.folder / "wide.png"
    files.write(path, codes, files.Photo(path, codes, space))
    for name in ("sRGB", "Display P3"):
        image, region = yield from _shown("wide.png", name)
        image.dyehouse.color_space = "display-p3"
        with_region(image, (120, 110), color=(0.01, 0.3, 0.02))
        yield from _same_as_written(image, region)
        bpy.data.images.remove(image)


def undo_and_redo():
    image = gui.load("photo.png")
    window, _, region = yield from gui.image_editor(image)
    colors = [(0.02, 0.1, 0.3), (0.7, 0.02, 0.01)]
    with_region(image)
    for color in colors:
        image.dyehouse.regions[0].target.color = color
        with bpy.context.temp_override(window=window):
            bpy.ops.ed.undo_push(message="Target")
    yield from ready(image)
    expected = {}
    for color in colors:
        image.dyehouse.regions[0].target.color = color
        expected[color] = _expected(image)
    assert _differences(image, region, expected[colors[1]]).max() <= 1
    gui.undo()
    image = bpy.data.images["photo.png"]
    yield from ready(image)
    assert _differences(image, region, expected[colors[0]]).max() <= 1
    gui.redo()
    image = bpy.data.images["photo.png"]
    yield from ready(image)
    assert _differences(image, region, expected[colors[1]]).max() <= 1


def renamed_reloaded_and_removed():
    import shutil

    from bl_ext.user_default.dyehouse.batch import files
    from bl_ext.user_default.dyehouse.core import colorspace

    preview, _, _ = addon()
    shutil.copy(gui.folder / "photo.png", gui.folder / "copy.png")
    image = gui.load("copy.png")
    with_region(image)
    _, _, region = yield from gui.image_editor(image)
    yield from ready(image)
    image.name = "another name"
    yield gui.redrawn
    assert _differences(image, region, _expected(image)).max() <= 1
    codes = files.read(gui.folder / "photo.png").pixels[:, ::-1]
    path = gui.folder / "copy.png"
    files.write(path, codes, files.Photo(gui.folder / "new.png", codes, colorspace.SRGB), force=True)
    image.reload()
    image.dyehouse.regions[0].click = (599 - CLICK[0], CLICK[1])
    yield gui.redrawn
    yield from ready(image)
    assert np.array_equal(addon()[2].look(image).photo.pixels, codes)
    assert _differences(image, region, _expected(image)).max() <= 1
    bpy.data.images.remove(image)
    yield gui.redrawn
    yield gui.redrawn
    assert not preview._textures, preview._textures


def textures_go_with_the_image():
    preview, _, _ = addon()
    image = gui.load("photo.png")
    with_region(image)
    _, area, _ = yield from gui.image_editor(image)
    yield from ready(image)
    assert len(preview._textures) == 1
    image.dyehouse.preview = False
    yield gui.redrawn
    assert not preview._textures
    image.dyehouse.preview = True
    yield from ready(image)
    assert len(preview._textures) == 1
    area.spaces.active.image = bpy.data.images.new("plain", 8, 8)
    yield gui.redrawn
    assert not preview._textures


def a_region_that_cannot_be_found_is_said():
    preview, _, _ = addon()
    image = gui.load("photo.png")
    with_region(image, click=(-1, -1))
    yield from gui.image_editor(image)
    yield lambda: "is not picked yet" in preview.shown(image)[1]
    yield gui.redrawn


def _refusal(operator, **properties):
    """What the operator says against being run; empty if it does run."""
    try:
        operator(**properties)
    except RuntimeError as error:
        return str(error)
    return ""


def a_region_that_is_not_picked_yet_leaves_the_others():
    image = gui.load("photo.png")
    with_region(image)
    _, _, region = yield from gui.image_editor(image, tab="Dyehouse")
    yield from ready(image)
    expected = _expected(image)
    bpy.ops.dyehouse.add_region(image=image.name, name="Sole")
    assert image.dyehouse.active_region == 1
    image.dyehouse.overlay = "ERROR"  # of the region that is not picked
    image.dyehouse.regions[0].target.color = (0.7, 0.02, 0.01)
    yield from gui.settle()
    image.dyehouse.regions[0].target.color = (0.02, 0.1, 0.3)
    yield from gui.settle()
    assert _differences(image, region, expected, columns=slice(0, 10)).max() <= 1
    assert "'Sole' is not picked yet" in _refusal(bpy.ops.dyehouse.write_image, image=image.name)
    image.dyehouse.regions[1].mask_source = "IMAGE"  # none is chosen
    yield from gui.settle()
    assert _differences(image, region, expected, columns=slice(0, 10)).max() <= 1


def two_editors_show_it():
    image = gui.load("photo.png")
    with_region(image)
    window, area, region = yield from gui.image_editor(image)
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    yield gui.redrawn
    yield from ready(image)
    editors = [a for a in window.screen.areas if a.type == "IMAGE_EDITOR"]
    assert len(editors) == 2
    for editor in editors:
        part = gui.region_of(editor)
        gui.call(window, editor, part, bpy.ops.image.view_zoom_ratio, ratio=2.0)
        yield gui.redrawn
        assert _differences(image, part, _expected(image), columns=slice(5, 11), rows=(120, 300)).max() <= 1


def the_picture_is_sharp_where_it_is_zoomed():
    """A photo too large for one texture is drawn small, and pixel by pixel once the view rests."""
    preview, _, _ = addon()
    image = gui.load("photo.png")
    large = bpy.data.images.new("large", 3000, 2000)
    tiled = np.tile(np.array(image.pixels[:], np.float32).reshape(400, 600, 4), (5, 5, 1))
    large.pixels.foreach_set(tiled.ravel())
    large.filepath_raw, large.file_format = str(gui.folder / "large.png"), "PNG"
    large.save()
    bpy.data.images.remove(large)
    large = gui.load("large.png")
    with_region(large)
    window, area, region = yield from gui.image_editor(large)
    yield from ready(large)
    now, _ = preview.shown(large)
    assert now.whole.step > 1
    gui.call(window, area, region, bpy.ops.image.view_zoom_ratio, ratio=2.0)
    yield lambda: any(key[-1] == 1 for key in preview._textures)
    yield gui.redrawn
    expected, shown, found = _expected(large), gui.screen(), []
    for y in range(850, 1150, 31):
        for x in range(1300, 1700, 37):
            place = gui.place(*gui.at(region, large, x, y))
            found.append(np.abs(shown[place].astype(int) - expected[y, x].astype(int)).max())
    assert max(found) <= 1, max(found)
