"""Maps over the picture, with a legend: body and surface reflection, residual, predicted error, gamut, and the region.

The numbers come from the core, and are made from the picture as large as it is drawn, in a thread.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import bpy
import gpu

from . import background, drawing, preview, properties

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..core.colorspace import RGBSpace
    from ..core.layers import Layers
    from ..core.recolor import RegionMatrix


@dataclass(frozen=True)
class Scale:
    """What the colors of a map mean.

    Attributes
    ----------
    top
        Number of the brightest color; 0 has the darkest.
    unit
        Said after the title.
    factor
        Of the numbers, for the legend.
    """

    top: float
    unit: str
    factor: float = 1.0


# As in the maps that `dyehouse inspect` writes; the residual in the paper's unit.
SCALES = {
    "A": Scale(2.0, "1 at the reference"),
    "B": Scale(0.5, "share of the white"),
    "RESIDUAL": Scale(0.125, "of 255", 255),
    "ERROR": Scale(10.0, "CIEDE2000"),
}
_TITLES = {name: title for name, title, _ in properties.OVERLAYS}
_TICKS = 4
_OUT_OF_GAMUT = (1.0, 0.0, 1.0)

# Polynomial of degree 6 through matplotlib's viridis, perceptually uniform and rising in lightness, by Matt Zucker
# (shadertoy.com/view/WlfXRN, CC0). Rows: powers 0 to 6; columns: red, green, blue of sRGB.
_VIRIDIS = (
    (0.2777273272234177, 0.005407344544966578, 0.3340998053353061),
    (0.1050930431085774, 1.404613529898575, 1.384590162594685),
    (-0.3308618287255563, 0.214847559468213, 0.09509516302823659),
    (-4.634230498983486, -5.799100973351585, -19.33244095627987),
    (6.228269936347081, 14.17993336680509, 56.69055260068105),
    (4.776384997670288, -13.74514537774601, -65.35303263337234),
    (-5.435455855934631, 4.645852612178535, 26.3124352495832),
)


def viridis(values: "NDArray[np.floating]") -> "NDArray[np.float32]":
    """(..., 3) sRGB codes in 0..1 of values in 0..1, which are clipped."""
    import numpy as np

    x = np.clip(values, 0, 1)[..., None].astype(np.float32)
    color = np.zeros((*values.shape, 3), np.float32)
    for row in reversed(_VIRIDIS):
        color = color * x + np.array(row, np.float32)
    return np.clip(color, 0, 1)


@dataclass(frozen=True, eq=False)
class Map:
    """A map ready to be drawn.

    Attributes
    ----------
    colors
        (height, width, 4) float32 linear RGB of the working space, and coverage.
    words
        What the legend says besides the scale.
    """

    colors: "NDArray[np.float32]"
    words: str = ""


# sRGB codes in 0..1 and coverage (height, width, 4), and what the legend says.
type _Codes = tuple[NDArray[np.float32], str]

_maps: "background.Worker[Map]" = background.Worker()
# Of each image (session_uid), the map that was there last and its texture, and what they are of.
_last: dict[int, tuple[tuple[object, ...], Map, gpu.types.GPUTexture]] = {}


def map_of(kind: str, index: int, now: preview.Shown) -> Map | None:
    """A map of a region for what is shown now, or None while it is being made.

    Raises
    ------
    DyehouseError
        If a target cannot be used.
    """
    from . import images

    (key, make), working = _asked(kind, index, now), images.working_space()
    return _maps.ask((key, working.name), lambda: partial(_made, make, working))


def _asked(kind: str, index: int, now: preview.Shown) -> tuple[tuple[object, ...], Callable[[], _Codes]]:
    """What a map depends on, and the function that makes it."""
    prepared = now.look.prepared
    if kind == "GAMUT":
        regions = prepared.regions()
        space = now.look.photo.wanted or now.look.photo.space
        key = now.look.key, kind, space.name, *(r.matrix.tobytes() for r in regions)
        return key, partial(_gamut, now, regions, space)
    if kind == "ERROR":
        target, white = prepared.target(index), prepared.target_white
        return (now.look.key, kind, index, target.tobytes(), white.tobytes()), partial(_error, now, index, target)
    return (now.look.key, kind, index), partial(_found, kind, now, index)


def _made(make: Callable[[], _Codes], working: "RGBSpace") -> Map:
    import numpy as np

    from ..core import colorimetry, colorspace, transfer

    codes, words = make()
    matrix = colorimetry.conversion_matrix(colorspace.SRGB, working).astype(np.float32)
    return Map(np.dstack([transfer.SRGB.decode(codes[..., :3]) @ matrix.T, codes[..., 3]]), words)


def _found(kind: str, now: preview.Shown, index: int) -> _Codes:
    analysis = now.look.prepared.analyses[index].thinned(now.whole.step)
    values = {"A": analysis.A, "B": analysis.B}[kind] if kind in "AB" else analysis.residual
    return _colored(kind, values, now, index)


def _error(now: preview.Shown, index: int, target: "NDArray[np.float64]") -> _Codes:
    prepared, step = now.look.prepared, now.whole.step
    values = prepared.analyses[index].predicted_error(target, prepared.target_white)
    return _colored("ERROR", values[::step, ::step], now, index)


def _colored(kind: str, values: "NDArray", now: preview.Shown, index: int) -> _Codes:
    import numpy as np

    share = now.whole.data[now.whole.firsts[index], ..., 3]
    inside = values[share > 0.5]
    scale = SCALES[kind]
    words = f"Mean {inside.mean() * scale.factor:.3g}, {scale.unit}" if inside.size else ""
    return np.dstack([viridis(values / scale.top), share]), words


def _gamut(now: preview.Shown, regions: "list[RegionMatrix]", space: "RGBSpace") -> _Codes:
    import numpy as np

    from ..core.colorimetry import conversion_matrix
    from ..core.gamut import out_of_gamut

    product = (now.whole.data[list(now.whole.firsts), ..., 3] > 0).any(axis=0)
    recolored = now.whole.recolored(regions)
    if space is not now.look.photo.space:
        recolored = recolored @ np.float32(conversion_matrix(now.look.photo.space, space)).T
    outside = out_of_gamut(recolored) & product
    colors = np.zeros((*outside.shape, 4), np.float32)
    colors[outside] = (*_OUT_OF_GAMUT, 1)
    part = outside[product].mean() if product.any() else 0.0
    return colors, f"{part:.1%} of the product outside {space.name}"


def _region_words(now: preview.Shown, index: int) -> str:
    share = float(now.whole.data[now.whole.firsts[index], ..., 3].mean())
    return f"{now.look.prepared.recipe.regions[index].name}: {share:.1%} of the picture"


# --- the editor ------------------------------------------------------------------------------------------------


def _shown(space: bpy.types.SpaceImageEditor) -> tuple[bpy.types.Image, str, int, preview.Shown] | None:
    """Image, overlay, place of the active region in the look, and what is shown, where there is one to draw."""
    image = preview.wanted(space)
    if image is None or (kind := preview.overlay_of(image)) == "NONE":
        return None
    now, _ = preview.shown(image)
    index = now.look.place(image.dyehouse.active_region) if now else None
    return None if now is None or index is None else (image, kind, index, now)


def _draw() -> None:
    from ..core.errors import DyehouseError

    found = _shown(bpy.context.space_data)
    if found is None or found[1] == "REGION":
        _free()
        return
    image, kind, index, now = found
    key = (now.look.key, kind, index)
    try:
        made = map_of(kind, index, now)
    except DyehouseError:
        return  # said in words by the preview
    last = _last.get(image.session_uid)
    if made is not None and (last is None or last[1] is not made):
        last = _last[image.session_uid] = key, made, drawing.texture(made.colors)
    if last is None or last[0] != key:
        return  # better no map than another one
    with preview.canvas().bind():
        _draw_map(last[2], now.whole, image.dyehouse.overlay_opacity)


def _free() -> None:
    """Free the maps of images that no editor shows with an overlay."""
    images = [preview.wanted(area.spaces.active) for area in background.image_editors()]
    drawn = {image.session_uid for image in images if image and preview.overlay_of(image) not in {"NONE", "REGION"}}
    for uid in set(_last) - drawn:
        del _last[uid]


def _draw_map(texture: gpu.types.GPUTexture, layers: "Layers", opacity: float) -> None:
    from gpu_extras.batch import batch_for_shader

    left, top, right, bottom = layers.box
    u = (right - left) / (layers.step * texture.width)
    v = (bottom - top) / (layers.step * texture.height)
    shader = gpu.shader.from_builtin("IMAGE_COLOR")
    corners, coordinates = [(0, 0), (1, 0), (0, 1), (1, 1)], [(0, v), (u, v), (0, 0), (u, 0)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners, "texCoord": coordinates})
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_sampler("image", texture)
    shader.uniform_float("color", (1, 1, 1, opacity))
    batch.draw(shader)
    gpu.state.blend_set("NONE")


def _draw_legend() -> None:
    found = _shown(bpy.context.space_data)
    if found is None:
        return
    image, kind, index, now = found
    left, bottom = drawing.scaled(12), drawing.scaled(48)
    if kind == "REGION":
        drawing.note(left, bottom, [_region_words(now, index)])
        return
    last = _last.get(image.session_uid)
    if last is None or last[0] != (now.look.key, kind, index):
        drawing.note(left, bottom, [f"{_TITLES[kind]}..."])
    elif kind == "GAMUT":
        drawing.note(left, bottom, [_TITLES[kind], last[1].words])
    else:
        _draw_scale(left, bottom, kind, last[1].words)


def _draw_scale(left: float, bottom: float, kind: str, words: str) -> None:
    import numpy as np

    scale, margin, length = SCALES[kind], drawing.scaled(10), drawing.scaled(240)
    bar, line = drawing.scaled(12), drawing.scaled(16)
    drawing.box(left, bottom, length + 3 * margin, bar + 3 * line + margin, drawing.BACKGROUND)
    drawing.write(left + margin, bottom + bar + 2 * line + margin, _TITLES[kind])
    drawing.write(left + margin, bottom + bar + line + margin, words)
    pieces = 64
    for k, color in enumerate(viridis(np.arange(pieces) / (pieces - 1))):
        # What lies over the picture is shown with a plain power of 1/2.2.
        piece = (*(color.astype(float) ** 2.2), 1)
        drawing.box(left + margin + length * k / pieces, bottom + line + margin / 2, length / pieces + 1, bar, piece)
    for k in range(_TICKS + 1):
        number = f"{scale.top * scale.factor * k / _TICKS:.3g}" + ("+" if k == _TICKS else "")
        drawing.write(left + margin / 2 + length * k / _TICKS, bottom + margin / 2, number, 9)


_handles: list[object] = []


def register() -> None:
    """Draw over the preview."""
    add = bpy.types.SpaceImageEditor.draw_handler_add
    _handles.append(add(_draw, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(_draw_legend, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    """Free everything."""
    while _handles:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    _last.clear()
