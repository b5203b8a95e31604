"""Boxes, texts and tables of numbers on the GPU, for what is drawn over the Image Editor."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import blf
import bpy
import gpu

if TYPE_CHECKING:
    from numpy.typing import NDArray

TEXT = (0.95, 0.95, 0.95, 1.0)
BACKGROUND = (0.0, 0.0, 0.0, 0.65)
_FONT = 0


def scaled(points: float) -> float:
    """Pixels of a length that is given for an interface of scale 1."""
    return points * bpy.context.preferences.system.ui_scale


def texture(numbers: "NDArray") -> gpu.types.GPUTexture:
    """A float texture of (height, width, 4) or, as a texture array, (layers, height, width, 4)."""
    import numpy as np

    data = np.ascontiguousarray(numbers, np.float32)
    layers = data.shape[0] if data.ndim == 4 else 0
    buffer = gpu.types.Buffer("FLOAT", data.size, data.ravel())
    return gpu.types.GPUTexture((data.shape[-2], data.shape[-3]), layers=layers, format="RGBA32F", data=buffer)


def box(left: float, bottom: float, width: float, height: float, color: Sequence[float], blend: str = "ALPHA") -> None:
    """A filled rectangle, in pixels of the region or whatever is drawn in."""
    from gpu_extras.batch import batch_for_shader

    right, top = left + width, bottom + height
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(left, bottom), (right, bottom), (left, top), (right, top)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
    gpu.state.blend_set(blend)
    shader.uniform_float("color", color)
    batch.draw(shader)
    gpu.state.blend_set("NONE")


def text_size(text: str, size: float = 11) -> tuple[float, float]:
    """(width, height) in pixels of a line of text."""
    blf.size(_FONT, scaled(size))
    return blf.dimensions(_FONT, text)


def write(left: float, bottom: float, text: str, size: float = 11, color: Sequence[float] = TEXT) -> None:
    """Write a line of text, in pixels of the region."""
    blf.size(_FONT, scaled(size))
    blf.color(_FONT, *color)
    blf.position(_FONT, left, bottom, 0)
    blf.draw(_FONT, text)


def note(left: float, bottom: float, lines: Sequence[str]) -> float:
    """Lines of text in a dark box, the first one on top; returns the height of the box."""
    line, margin = scaled(16), scaled(7)
    width = max(text_size(text)[0] for text in lines) + 2 * margin
    height = line * len(lines) + margin
    box(left, bottom, width, height, BACKGROUND)
    for number, text in enumerate(reversed(lines)):
        write(left + margin, bottom + margin + number * line, text)
    return height
