"""A catalog from the panel: run beside the window, stopped with Esc, gone on with later."""

from time import monotonic

import bpy
import gui_kit as gui
import numpy as np
from bl_ext.user_default.dyehouse.addon import images
from bl_ext.user_default.dyehouse.addon.operators import catalog

PHOTOS = 12
COLORWAYS = {"petrol": "#17606E", "navy": "#1F4E79"}


def _table():
    codes = images.pixels_of(gui.load("photo.png"))
    height, width = codes.shape[:2]
    for number in range(PHOTOS):
        image = bpy.data.images.new(f"cup{number}", width, height)
        images.set_pixels(image, np.roll(codes, number, axis=1))
        image.filepath_raw, image.file_format = str(gui.folder / f"cup{number}.png"), "PNG"
        image.save()
    asked = " | ".join(f"{name}={color}" for name, color in COLORWAYS.items())
    lines = ["photo,click,colorways", *(f'cup{k}.png,"{120 + k},250",{asked}' for k in range(PHOTOS))]
    path = gui.folder / "catalog.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def escape_stops_a_catalog_and_resume_goes_on():
    table, out = _table(), gui.folder / "finished"
    gui.open_panel("DYEHOUSE_PT_catalog")
    window, area, region = yield from gui.image_editor(gui.load("photo.png"), tab="Dyehouse")
    asked = bpy.context.scene.dyehouse_catalog
    assert not gui.call(window, area, region, bpy.ops.dyehouse.run_batch.poll), "there is nothing to run yet"
    asked.jobs, asked.output = str(table), str(out)
    yield from gui.press(area, "dyehouse.check_batch", across=0.3)
    yield lambda: catalog.outcome() is not None
    yield gui.idle
    assert catalog.outcome().sentence == f"{PHOTOS} photos, {2 * PHOTOS} results: all good", catalog.outcome()
    assert not out.exists(), "a check writes"

    yield from gui.press(area, "dyehouse.run_batch", across=0.8)
    yield lambda: catalog.progress() is not None
    assert not bpy.ops.dyehouse.run_batch.poll(), "a second catalog may begin"
    slowest = 0.0
    while catalog.progress()[0] < 3:
        begun = monotonic()
        yield gui.redrawn
        slowest = max(slowest, monotonic() - begun)
    print(f"two frames took at most {slowest:.2f} s while the catalog ran", flush=True)
    gui.move(region.x + region.width // 2, region.y + region.height // 2)
    gui.key("Escape")
    yield lambda: catalog.progress() is None
    yield gui.idle
    done = {path.name for path in out.glob("*.png")}
    assert 3 <= len(done) < 2 * PHOTOS, f"{len(done)} results after Esc"
    assert not list(out.rglob(".dyehouse-*")), "a part of a file is left"
    for name in done:
        assert images.pixels_of(bpy.data.images.load(str(out / name))).shape[:2] == (400, 600), name

    asked.existing = "RESUME"
    yield from gui.press(area, "dyehouse.run_batch", across=0.8)
    yield lambda: catalog.progress() is not None
    yield lambda: catalog.progress() is None
    expected = f"{2 * PHOTOS - len(done)} done, {len(done)} kept, 0 need a person, 0 failed, of {2 * PHOTOS}"
    assert catalog.outcome().sentence == expected, catalog.outcome()
    assert catalog.outcome().page == out / "index.html"
