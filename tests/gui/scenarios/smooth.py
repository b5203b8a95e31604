"""The window goes on while a photo is looked at; `benchmarks/window.py` measures it in seconds, on 24 megapixels."""

import time

import bpy
import gui_kit as gui
import numpy as np
from preview_kit import addon, ready, with_region


def the_window_goes_on_meanwhile():
    small = gui.load("photo.png")
    pixels = np.array(small.pixels[:], np.float32).reshape(400, 600, 4).repeat(5, axis=0).repeat(5, axis=1)
    image = bpy.data.images.new("large", 3000, 2000)
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(gui.folder / "large.png"), "PNG"
    image.save()
    bpy.data.images.remove(image)
    image = gui.load("large.png")
    yield from gui.image_editor(image, tab="Dyehouse")
    yield gui.redrawn
    pulse, begun = gui.Pulse(), time.monotonic()
    with_region(image, click=(750, 1100))
    yield from ready(image)
    yield from gui.settle()
    pulse.stop()
    gap = pulse.longest(begun)
    _, _, session = addon()
    session.forget()
    begun = time.thread_time()
    session.look(image)
    frozen = time.thread_time() - begun
    assert gap["thread"] < frozen / 2, (gap, frozen)
