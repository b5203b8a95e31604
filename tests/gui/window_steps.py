"""What `benchmarks/window.py` does inside Blender: a designer's way through 24 megapixels, each step measured."""

import json
import time

import bpy
import gui_kit as gui
import numpy as np

WIDTH, HEIGHT = 6000, 4000
CUP = (1200, 2500)
OVERLAYS = {
    "REGION": "Region",
    "A": "Body",
    "B": "Surface",
    "RESIDUAL": "Residual",
    "ERROR": "Predicted Error",
    "GAMUT": "Out of Gamut",
}


def a_photo_of_bytes():
    """A JPEG file."""
    pixels = _pixels()
    image = bpy.data.images.new("photo", WIDTH, HEIGHT)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(gui.folder / "large.jpg"), "JPEG"
    image.save()
    bpy.data.images.remove(image)
    yield from _way(lambda: gui.load("large.jpg"), "An 8-bit file")


def a_generated_image_of_floats():
    """Pixels that Blender alone holds."""
    pixels = _pixels()
    pixels[..., :3] **= np.float32(2.2)
    image = bpy.data.images.new("generated", WIDTH, HEIGHT, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    del pixels
    yield from _way(lambda: image, "Generated floats")


def _pixels():
    """The photo as large as a camera's, with noise: (HEIGHT, WIDTH, 4) float32 in Blender's order."""
    small = gui.load("photo.png")
    pixels = np.array(small.pixels[:], np.float32).reshape(400, 600, 4).repeat(10, axis=0).repeat(10, axis=1)
    bpy.data.images.remove(small)
    pixels[..., :3] += np.random.default_rng(1).normal(0, 0.01, (HEIGHT, WIDTH, 1)).astype(np.float32)
    return pixels.clip(0, 1)


def _way(open_image, kind):
    from bl_ext.user_default.dyehouse.addon.operators import write

    pulse, gaps = gui.Pulse(), {}

    def measured(name, steps):
        yield gui.redrawn
        begun = time.monotonic()
        yield 0.05
        yield from steps
        yield 0.2
        gaps[name] = pulse.longest(begun) | {"whole": time.monotonic() - begun}

    window, area, region = gui.editor("IMAGE_EDITOR")
    image = open_image()

    def shown():
        area.spaces.active.image = image
        gui.call(window, area, region, bpy.ops.image.view_all, fit_view=True)
        yield 0.5
        yield gui.redrawn

    def dragged():
        for k in range(20):
            image.dyehouse.regions[0].target.color = (0.02 + 0.02 * k, 0.1, 0.4 - 0.015 * k)
            yield gui.redrawn

    def clicked():
        gui.call(window, area, region, bpy.ops.dyehouse.pick_region, "INVOKE_DEFAULT")
        yield gui.redrawn
        gui.move(*gui.at(region, image, *CUP))
        yield from gui.settle()  # the photo is opened for the loupe
        yield from gui.click(*gui.at(region, image, *CUP))
        yield lambda: image.dyehouse.regions
        yield from gui.settle()
        gui.key("Return")
        yield gui.idle

    def previewed():
        image.dyehouse.preview = True
        yield from gui.settle()

    def zoomed():
        gui.call(window, area, region, bpy.ops.image.view_zoom_ratio, ratio=1.0)
        yield 0.5
        yield from gui.settle()
        gui.call(window, area, region, bpy.ops.image.view_all, fit_view=True)
        yield from gui.settle()

    def overlaid(kind):
        image.dyehouse.overlay = kind
        yield from gui.settle()

    def written(operator):
        gui.call(window, area, region, operator, "INVOKE_DEFAULT")
        while write.progress() is not None:
            yield 0.1
        yield gui.idle

    yield from measured("Blender shows the image, without Dyehouse", shown())
    yield from measured("The sidebar is opened", gui.sidebar(area, "Dyehouse"))
    yield from measured("The region is clicked", clicked())
    yield from measured("The preview is switched on", previewed())
    yield from measured("The target is dragged", dragged())
    yield from measured("The view is zoomed", zoomed())
    for overlay, title in OVERLAYS.items():
        yield from measured(f"Overlay {title}", overlaid(overlay))
    image.dyehouse.overlay = "NONE"
    bpy.ops.dyehouse.add_colorway(image=image.name, name="navy")
    image.dyehouse.output_pattern = str(gui.folder / "{photo}-{colorway}.tif")
    yield from measured("A file is written", written(bpy.ops.dyehouse.write_colorways))
    yield from measured("A new image is made", written(bpy.ops.dyehouse.write_image))
    pulse.stop()
    (gui.folder / f"{kind}.json").write_text(json.dumps(gaps))
