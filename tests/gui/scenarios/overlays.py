"""The diagnostic maps over the picture, with their legends."""

import gui_kit as gui
import numpy as np
from preview_kit import addon, ready, with_region


def _settled(image):
    """Wait until nothing more is being made."""
    from bl_ext.user_default.dyehouse.addon import background

    yield lambda: not background.busy()
    yield gui.redrawn
    yield gui.redrawn


def every_overlay_shows_the_core_numbers():
    _, overlays, session = addon()
    image = gui.load("photo.png")
    with_region(image).model = "dichromatic"
    image.dyehouse.overlay_opacity = 1.0
    _, area, region = yield from gui.image_editor(image, zoom=2.0)
    yield from ready(image)
    analysis = session.look(image).prepared.analyses[0]
    prepared = session.look(image).prepared
    numbers = {
        "A": analysis.A,
        "B": analysis.B,
        "RESIDUAL": analysis.residual,
        "ERROR": analysis.predicted_error(prepared.target(0), prepared.target_white),
    }
    plain = gui.screen()
    for kind, values in numbers.items():
        image.dyehouse.overlay = kind
        yield from _settled(image)
        shown = gui.screen()
        gui.screenshot(gui.folder / f"overlay-{kind}.png")
        if kind == "ERROR":
            gui.figure("blender-overlay", area=area)
        inside, difference = 0, 0
        for y in range(150, 300, 17):
            for x in range(110, 240, 13):
                if analysis.mask[y, x] == 255:
                    color = overlays.viridis(np.array(values[y, x] / overlays.SCALES[kind].top)) * 255
                    place = gui.place(*gui.at(region, image, x, y))
                    difference = max(difference, np.abs(shown[place] - np.round(color)).max())
                    inside += 1
        assert inside > 30, inside
        assert difference <= 2, (kind, difference)
        beside = gui.place(*gui.at(region, image, 500, 120))
        assert np.abs(shown[beside].astype(int) - plain[beside]).max() <= 1, kind


def the_region_is_shown():
    image = gui.load("photo.png")
    with_region(image)
    image.dyehouse.preview = False
    _, _, region = yield from gui.image_editor(image)
    plain = gui.screen()
    image.dyehouse.overlay = "REGION"
    yield from ready(image)
    shown = gui.screen()
    gui.screenshot(gui.folder / "overlay-REGION.png")
    inside, beside = (gui.place(*gui.at(region, image, *at)) for at in ((150, 220), (540, 80)))
    assert np.abs(shown[inside].astype(int) - plain[inside]).max() <= 1
    assert shown[beside].max() < plain[beside].max() * 0.8


def out_of_gamut_follows_the_target():
    image = gui.load("photo.png")
    picked = with_region(image, color=(0.3, 0.2, 0.1))
    image.dyehouse.overlay, image.dyehouse.overlay_opacity = "GAMUT", 1.0
    yield from gui.image_editor(image)
    yield from ready(image)

    def marked():
        shown = gui.screen()[:, :1100].astype(int)
        return int(((shown[..., 0] > 240) & (shown[..., 1] < 20) & (shown[..., 2] > 240)).sum())

    yield from _settled(image)
    few = marked()
    picked.target.text = "rgb(-0.2, 0.6, 0.1)"
    yield gui.redrawn
    yield from _settled(image)
    gui.screenshot(gui.folder / "overlay-GAMUT.png")
    assert marked() > 10_000 + few, (few, marked())
    image.dyehouse.overlay = "NONE"
    yield from _settled(image)
    assert marked() < 100
