"""The eyedropper's loupe: the pixels under the cursor, enlarged, and the color found there."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from . import drawing, preview, session

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..batch.files import Photo

# Pixels across, and what one is enlarged to.
_ACROSS = 11
_ENLARGED = 10
_APART = 24
_LETTERS = 60


@dataclass
class Reading:
    """What an eyedropper finds at a pixel.

    Attributes
    ----------
    color
        (3,) linear RGB in the photo's space, or None if there is none to be had.
    words
        Sentences for the user, such as why there is none.
    """

    color: "NDArray[np.float64] | None"
    words: Sequence[str] = ()


class Loupe:
    """Draws at the cursor as long as it is open.

    Parameters
    ----------
    read
        Gives the reading of a pixel (x, y) of a photo.
    """

    def __init__(self, read: "Callable[[bpy.types.Image, Photo, tuple[int, int]], Reading]") -> None:
        self._read = read
        self._at: tuple[bpy.types.Region, float, float, bpy.types.Image, tuple[int, int]] | None = None
        add = bpy.types.SpaceImageEditor.draw_handler_add
        self._handles = [add(self._draw, (), "WINDOW", "POST_PIXEL")]

    def show(
        self, region: bpy.types.Region, x: float, y: float, image: bpy.types.Image, pixel: tuple[int, int]
    ) -> None:
        """Show pixel (x, y) of an image beside a position of the region."""
        self.hide()
        self._at = region, x, y, image, pixel
        region.tag_redraw()

    def hide(self) -> None:
        """Show nothing: the cursor is off the picture."""
        if self._at is not None:
            self._at[0].tag_redraw()
        self._at = None

    def close(self) -> None:
        """Never draw again."""
        self.hide()
        bpy.types.SpaceImageEditor.draw_handler_remove(self._handles.pop(), "WINDOW")

    def _draw(self) -> None:
        if self._at is None or bpy.context.region != self._at[0]:
            return
        from ..core.errors import DyehouseError

        region, x, y, image, pixel = self._at
        photo = None
        try:
            photo = session.photo_ready(image)
            reading = Reading(None, ["Opening the photo..."]) if photo is None else self._read(image, photo, pixel)
        except DyehouseError as error:
            reading = Reading(None, [str(error)])
        side, apart = drawing.scaled(_ACROSS * _ENLARGED), drawing.scaled(_APART)
        lines = _lines(photo, pixel, reading)
        beside = drawing.scaled(4)
        width = max(1.5 * side + beside, *(drawing.text_size(text)[0] for text in lines)) + drawing.scaled(14)
        height = side + drawing.scaled(16) * len(lines) + drawing.scaled(14)
        # To the right of the cursor and above, or where there is room.
        left = x + apart if x + apart + width < _right_of(region) else max(0.0, x - apart - width)
        bottom = y + apart if y + apart + height < region.height else max(0.0, y - apart - height)
        height = drawing.note(left, bottom, lines)
        if photo is not None:
            display, base = preview.display_of(image, photo), bottom + height
            _picture(_around(photo, pixel), left, base, side, display)
            cell = side / _ACROSS
            _frame(left, base, side)
            _frame(left + _ACROSS // 2 * cell, base + _ACROSS // 2 * cell, cell)
            if reading.color is not None:
                _picture(reading.color.reshape(1, 1, 3), left + side + beside, base, side / 2, display)
                _frame(left + side + beside, base, side / 2)


def _right_of(region: bpy.types.Region) -> float:
    """Where the part of a region ends that the sidebar does not cover."""
    sidebars = [part for part in bpy.context.area.regions if part.type == "UI" and part.width > 1 and part.x > region.x]
    return min([part.x - region.x for part in sidebars], default=region.width)


def _lines(photo: "Photo | None", pixel: tuple[int, int], reading: Reading) -> list[str]:
    import numpy as np

    from ..core import colorimetry, transfer
    from ..core.colorspace import SRGB

    lines = [f"{pixel[0]}, {pixel[1]}"]
    if photo is not None and reading.color is not None:
        linear = colorimetry.conversion_matrix(photo.space, SRGB) @ reading.color
        codes = transfer.encode(linear, SRGB.curve, np.uint8)
        lab = colorimetry.linear_to_lab(reading.color, photo.space)
        lines[0] += "   #{:02X}{:02X}{:02X}".format(*codes)
        lines.append("Lab {:.1f}, {:.1f}, {:.1f}".format(*lab))
    for sentence in reading.words:
        lines += textwrap.wrap(sentence, _LETTERS)
    return lines


def _around(photo: "Photo", pixel: tuple[int, int]) -> "NDArray[np.float32]":
    """(across, across, 3) linear pixels around one; black beyond the picture."""
    import numpy as np

    from ..core.picture import Picture

    height, width = photo.pixels.shape[:2]
    left, top = (at - _ACROSS // 2 for at in pixel)
    rows, columns = slice(max(0, top), min(height, top + _ACROSS)), slice(max(0, left), min(width, left + _ACROSS))
    square = np.zeros((_ACROSS, _ACROSS, 3), np.float32)
    inside = Picture(photo.pixels, photo.space.curve).linear(rows, columns)
    square[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left] = inside
    return square


def _picture(linear: "NDArray", left: float, bottom: float, side: float, display: preview.Display) -> None:
    """Draw a few pixels as a square of the region, in the colors that the photo has there."""
    from ..core.layers import take_apart
    from ..core.picture import Picture

    layers = take_apart(Picture(linear), [])
    texture = drawing.texture(layers.data)
    x, y, dx, dy = preview.view_to_clip()
    place = (x * side, y * side, dx + x * left, dy + y * bottom)
    size, painting = (linear.shape[1], linear.shape[0]), preview.Painting(place, nearest=True)
    with preview.canvas().bind():
        preview.paint(layers, texture, size, layers.weights([]), display, painting)


def _frame(left: float, bottom: float, side: float) -> None:
    """A square that shows on any color."""
    line = max(1.0, drawing.scaled(1))
    for grown, color in ((line, (0, 0, 0, 1)), (0.0, (1, 1, 1, 1))):
        x, y, size = left - grown, bottom - grown, side + 2 * grown
        for dx, dy, width, height in ((0, 0, size, line), (0, size - line, size, line)):
            drawing.box(x + dx, y + dy, width, height, color)
            drawing.box(x + dy, y + dx, height, width, color)
