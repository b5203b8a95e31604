"""The swatch book in the window: found by name and by color, taken, marked, dragged, with ten thousand swatches."""

from statistics import median
from time import perf_counter

import bpy
import gui_kit as gui
import numpy as np
from bl_ext.user_default.dyehouse.addon import panels, recipes, swatches
from bl_ext.user_default.dyehouse.core.swatches import Swatch, parse_target

MANY = 10_000
NAVY = "#1F4E79"
VIVID = "reflectance(400:0, 490:0, 510:1, 560:1, 580:0, 700:0)"  # a green that no screen can show


def _book():
    """An editor with two regions, and a library of many swatches in the open browser."""
    rng = np.random.default_rng(0)
    swatches.book().keep("Many", [Swatch.from_srgb(rng.random(3), f"Color {k:04d}") for k in range(MANY)])
    swatches.changed()
    gui.open_panel("DYEHOUSE_PT_swatches")
    image = gui.load("photo.png")
    window, area, _ = yield from gui.image_editor(image, tab="Dyehouse")
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=(120, 250))
    bpy.ops.dyehouse.add_region(image=image.name, name="Ground")
    image.dyehouse.regions[1].click, image.dyehouse.regions[1].target.used = (300, 380), False
    image.dyehouse.active_region = 0
    swatches.browser().library = "Many"
    yield from gui.settle()
    return image, window, area


def _swatch(image, index=0):
    return recipes.swatch_of(image.dyehouse.regions[index].target, image)


def _listing(area, name):
    """Press one of the four buttons over the browser."""
    place = ["LIBRARY", "NEAREST", "FAVORITES", "RECENT"].index(name)
    yield from gui.press(area, "listing", across=0.16 + 0.21 * place)
    yield lambda: swatches.browser().listing == name


def _ways(image, area):
    # By name: typed into the search field, taken with a click.
    yield from gui.press(area, "search")
    gui.write("0777")
    yield lambda: swatches.browser().search == "0777"
    gui.key("Return")
    yield gui.redrawn
    yield from gui.press(area, "dyehouse.use_swatch", across=0.12)
    yield lambda: image.dyehouse.regions[0].target.swatch_name == "Color 0777"
    taken = swatches.book().library("Many").named("Color 0777")
    assert _swatch(image).written == taken.written, _swatch(image)
    yield from gui.press(area, "dyehouse.favorite_swatch", across=0.3)
    yield lambda: [kept.text for kept in swatches.book().favorites] == ["Color 0777"]

    # By color: the first that is listed is the nearest of all.
    image.dyehouse.regions[0].target.text = NAVY
    yield from _listing(area, "NEAREST")
    yield from gui.press(area, "dyehouse.use_swatch")
    yield lambda: image.dyehouse.regions[0].target.swatch_name != ""
    (nearest,), _ = swatches.book().library("Many").nearest(parse_target(NAVY), 1)
    assert image.dyehouse.regions[0].target.swatch_name == f"Color {nearest:04d}", _swatch(image)

    # What was used last comes first, and a favorite is taken again.
    yield from _listing(area, "RECENT")
    assert [hit.swatch.text for hit in swatches.shown(None)][:2] == [f"Color {nearest:04d}", "Color 0777"]
    yield from _listing(area, "FAVORITES")
    yield from gui.press(area, "dyehouse.use_swatch", across=0.12)
    yield lambda: image.dyehouse.regions[0].target.swatch_name == "Color 0777"
    return taken


def swatches_are_found_taken_and_dragged():
    image, _, area = yield from _book()
    taken = yield from _ways(image, area)

    # Dragged from the first region's color in the list onto the second's, with all that is known of it.
    image.dyehouse.regions[1].target.used = True
    yield gui.redrawn
    yield from gui.scroll(area, 0)  # there is another button of the same color farther down
    source = yield from gui.find(area, "regions[0].target.color", across=0.6)
    target = yield from gui.find(area, "regions[1].target.color", across=0.6)
    yield from gui.drag(source, target)
    yield lambda: _swatch(image, 1).text == "Color 0777"
    assert _swatch(image, 1).written == taken.written, "the dragged swatch is another one"
    state = swatches.browser()
    state.library, state.listing, state.search = "Munsell-like", "LIBRARY", ""
    yield from gui.scroll(area, 4)
    yield from gui.settle()
    gui.figure("blender-swatches", region=gui.region_of(area, "UI"))

    # Or copied with a button.
    bpy.ops.dyehouse.set_target(image=image.name, text=NAVY)
    yield from gui.press(area, "dyehouse.copy_target")
    yield lambda: image.dyehouse.regions[1].target.text == NAVY


def ten_thousand_swatches_do_not_slow_the_panel_down():
    gui.open_panel("DYEHOUSE_PT_lights")
    image, _, area = yield from _book()
    state, panel, drawn = swatches.browser(), panels.DYEHOUSE_PT_swatches, []
    draw = panel.of_photo

    def timed(*arguments):
        begun = perf_counter()
        draw(*arguments)
        drawn.append(perf_counter() - begun)

    def drawing(library, listing="LIBRARY"):
        state.library, state.listing = library, listing
        drawn.clear()
        while len(drawn) < 12:
            gui.region_of(area, "UI").tag_redraw()
            yield 0.02
        return median(drawn[4:])

    def seconds(function):
        begun = perf_counter()
        function()
        return perf_counter() - begun

    bpy.ops.dyehouse.use_swatch(image=image.name, library="ColorChecker", index=2)
    yield from gui.settle()
    panel.of_photo = timed
    try:
        few = yield from drawing("ColorChecker")
        many = yield from drawing("Many")
        near = yield from drawing("Many", "NEAREST")
    finally:
        panel.of_photo = draw
    print(f"swatches drawn in {1e3 * few:.1f} ms of 24, {1e3 * many:.1f} of {MANY}, {1e3 * near:.1f} nearest of {MANY}")
    assert many < 4 * few, "a large library slows the panel down"

    searches = []
    state.listing = "LIBRARY"
    for text in ("7", "77", "777", "color 1", "9"):
        state.search = text
        searches.append(seconds(lambda: swatches.shown(None)))
    state.search, state.listing = "", "NEAREST"
    nearest = [seconds(lambda t=t: swatches.shown(parse_target(t))) for t in ("#102030", "#A0B0C0", "#FF0080")]
    print(f"searched in {1e3 * median(searches):.1f} ms by name, {1e3 * median(nearest):.1f} ms by color", flush=True)

    # Drawn again, nothing is computed again.
    bpy.ops.dyehouse.set_target(image=image.name, text=VIVID)
    state.listing = "LIBRARY"
    yield from gui.settle()
    caches = (panels.compromise, panels.under_lights, swatches.codes_of)
    before = [cache.cache_info() for cache in caches]
    area.tag_redraw()
    yield gui.redrawn
    for cache, known in zip(caches, before, strict=True):
        assert cache.cache_info().misses == known.misses, f"{cache.__name__} computes while drawing"
        assert cache.cache_info().hits > known.hits, f"{cache.__name__} was not asked"
