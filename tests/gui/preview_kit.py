"""What the scenarios of the preview and of its overlays share."""

import gui_kit as gui

CLICK = (150, 220)


def addon():
    from bl_ext.user_default.dyehouse.addon import overlays, preview, session

    return preview, overlays, session


def with_region(image, click=CLICK, color=(0.02, 0.1, 0.3)):
    region = image.dyehouse.regions.add()
    region.click = click
    region.target.color = color
    image.dyehouse.preview = True
    return region


def ready(image):
    """Wait until the editors show the preview of the present settings: `yield from` it."""
    preview, _, _ = addon()

    def made():
        now, note = preview.shown(image)
        return now is not None and not note

    yield made
    yield gui.redrawn
    yield gui.redrawn
