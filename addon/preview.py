"""The recolored photo in the Image Editor, drawn by the GPU; nothing is written.

The photo and the light that each region takes part in (`core.layers`) are put into a texture once, in a thread and no
larger than the screen can show; a new target is a few matrices and one redraw.
"""

import textwrap
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import bpy
import gpu
from bpy.app.handlers import persistent

from . import background, drawing, images, recipes, session

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..batch.files import Photo
    from ..core.layers import Box, Layers
    from ..core.transfer import Curve
    from .session import Look

# Pixels of the whole photo's texture at most: what a view that rests shows of it comes in full resolution after it.
_MOST_PIXELS = 1_200_000
# Of all layers together: 16 bytes each.
_MOST_TEXELS = 10_000_000
# Seconds that the view must rest before its part of the photo is fetched in full resolution.
_REST = 0.2
# Gap between the pictures side by side, as a share of the width.
GAP = 0.02
# Entries of a table of light that is interpolated, and columns of one of steps.
_TABLE, _COLUMNS = 4096, 256
_LETTERS = 90

_VERTEX = """
void main() {
    at = pos.x;
    uv = coordinate;
    gl_Position = vec4(pos * place.xy + place.zw, 0.0, 1.0);
}
"""

# `fit` is core.gamut.fit_to_gamut.
_FRAGMENT = """
vec4 layer(int k) {
    if (nearest) {
        // The editor looks up its own pixels at the lower left corner of those of the screen (measured).
        vec2 corner = max(uv - 0.499 * (dFdx(uv) + dFdy(uv)), 0.0);
        return texelFetch(layers, ivec3(ivec2(corner * vec2(textureSize(layers, 0).xy)), k), 0);
    }
    return texture(layers, vec3(uv, float(k)));
}

vec3 times(int k, vec4 v) {
    return vec3(dot(texelFetch(matrices, ivec2(0, k), 0), v), dot(texelFetch(matrices, ivec2(1, k), 0), v),
                dot(texelFetch(matrices, ivec2(2, k), 0), v));
}

vec3 fit(vec3 rgb) {
    if (all(lessThanEqual(rgb, vec3(1.0 + tolerance))) && all(greaterThanEqual(rgb, vec3(-tolerance)))) {
        return rgb;
    }
    float grey = clamp(dot(rgb, vec3(0.2126, 0.7152, 0.0722)), 0.0, 1.0);
    vec3 away = rgb - grey;
    float room = 1.0;
    for (int k = 0; k < 3; k++) {
        if (away[k] != 0.0) {
            room = min(room, (away[k] > 0.0 ? 1.0 - grey : -grey) / away[k]);
        }
    }
    return grey + room * away;
}

vec3 as_blender_reads(vec3 rgb) {
    int columns = textureSize(curve, 0).x, last = columns * textureSize(curve, 0).y - 1;
    if (last == 0) {
        return rgb;
    }
    vec3 x = clamp(rgb, 0.0, 1.0);
    x = rooted ? sqrt(x) : x;
    for (int k = 0; k < 3; k++) {
        if (stepped) {
            int entry = min(int(x[k] * float(last + 1)), last);
            rgb[k] = texelFetch(curve, ivec2(entry % columns, entry / columns), 0).x;
        } else {
            int low = min(int(x[k] * float(last)), last - 1);
            rgb[k] = mix(texelFetch(curve, ivec2(low, 0), 0).x, texelFetch(curve, ivec2(low + 1, 0), 0).x,
                         x[k] * float(last) - float(low));
        }
    }
    return rgb;
}

void main() {
    vec4 photo = layer(0);
    vec3 rgb = photo.rgb;
    if (at >= split) {
        rgb = vec3(0.0);
        for (int k = 0; k < count; k++) {
            rgb += times(k, layer(k));
        }
        if (fitted) {
            rgb = fit(rgb);
        }
    }
    rgb = times(count, vec4(as_blender_reads(rgb), 0.0));
    if (straight) {
        rgb *= photo.a;
    }
    if (marked > 0) {
        float inside = layer(marked).a;
        float edge = 1.0 - smoothstep(0.5, 1.5, abs(inside - 0.5) / max(fwidth(inside), 0.02));
        vec3 around = vec3(dot(rgb, vec3(0.3, 0.6, 0.1))) * 0.15;
        rgb = mix(rgb, mix(around, rgb, inside), opacity);
        rgb = mix(rgb, vec3(1.0, 0.7, 0.02), edge * opacity);
    }
    result = vec4(rgb, opaque ? 1.0 : photo.a);
}
"""


@dataclass(frozen=True, eq=False)
class Table:
    """A function of light.

    Attributes
    ----------
    light
        (rows, columns) float32 values, row by row, for equal steps of light from 0 to 1.
    rooted
        Whether the steps are of the square root of light.
    stepped
        Whether a value holds for the whole step after it, as in a file of bytes; else it is between its neighbors.
    """

    light: "NDArray[np.floating]"
    rooted: bool
    stepped: bool


@dataclass(frozen=True, eq=False)
class Display:
    """What becomes of the photo's linear light on its way through a file into Blender's editor.

    Attributes
    ----------
    matrix
        (3, 3) linear RGB as Blender reads it to the working space.
    table
        Light as Blender reads it by light as the photo means it; None where both are the same.
    fitted
        Whether recolored pixels are brought into gamut first, as they are for files of integers.
    straight
        Whether RGB is to be multiplied by alpha.
    """

    matrix: "NDArray[np.floating]"
    table: "Table | None" = None
    fitted: bool = False
    straight: bool = False


def display_of(image: bpy.types.Image, photo: "Photo") -> Display:
    """How Blender shows files like this one, given its color space settings."""
    import numpy as np

    from ..core.colorimetry import conversion_matrix

    read, working = images.space_in_blender(image), images.working_space()
    matrix = conversion_matrix(read, working)
    table = _table(photo.space.curve, read.curve, photo.pixels.dtype == np.uint8)
    return Display(matrix, table, photo.pixels.dtype.kind == "u", not photo.premultiplied)


@lru_cache(8)
def _table(meant: "Curve", read: "Curve", byte: bool) -> Table | None:
    """What Blender makes of a photo's light by way of a file."""
    import numpy as np

    from ..core.transfer import byte_codes, decode_table

    if byte:
        codes, rooted = byte_codes(meant)
        return Table(decode_table(read, np.uint8)[codes].reshape(-1, _COLUMNS), rooted, True)
    if meant == read:
        return None
    light = np.linspace(0, 1, _TABLE) ** 2
    return Table(read.decode(np.clip(meant.encode(light), 0, 1))[None], True, False)


_shader: gpu.types.GPUShader | None = None


def _compiled() -> gpu.types.GPUShader:
    global _shader
    if _shader is None:  # not at import: there may be no GPU yet
        from ..core.gamut import TOLERANCE

        info, between = gpu.types.GPUShaderCreateInfo(), gpu.types.GPUStageInterfaceInfo("dyehouse_between")
        between.smooth("VEC2", "uv")
        between.smooth("FLOAT", "at")
        info.vertex_in(0, "VEC2", "pos")
        info.vertex_in(1, "VEC2", "coordinate")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "result")
        info.sampler(0, "FLOAT_2D_ARRAY", "layers")
        info.sampler(1, "FLOAT_2D", "matrices")
        info.sampler(2, "FLOAT_2D", "curve")
        # Only 128 bytes of push constants are sure to be there: matrices are in a texture.
        info.push_constant("VEC4", "place")
        info.push_constant("FLOAT", "split")
        info.push_constant("FLOAT", "opacity")
        info.push_constant("INT", "count")
        info.push_constant("INT", "marked")
        info.push_constant("BOOL", "nearest")
        info.push_constant("BOOL", "rooted")
        info.push_constant("BOOL", "stepped")
        info.push_constant("BOOL", "fitted")
        info.push_constant("BOOL", "straight")
        info.push_constant("BOOL", "opaque")
        info.define("tolerance", repr(TOLERANCE))
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shader = gpu.shader.create_from_info(info)
    return _shader


@dataclass(frozen=True, eq=False)
class Painting:
    """How layers are drawn.

    Attributes
    ----------
    place
        Scale x and y, and offset x and y, of the picture, which is 1 x 1 with its origin at the bottom left, in clip
        space.
    split
        Where the recolored picture begins, from 0 at the left to 1 at the right; at or above 1 there is none.
    marked
        Layer whose share is shown as a region, or 0 for none.
    opacity
        Of the mark.
    nearest
        Whether pixels are shown as squares.
    opaque
        Whether alpha is written as 1.
    """

    place: tuple[float, float, float, float]
    split: float = 0.0
    marked: int = 0
    opacity: float = 1.0
    nearest: bool = False
    opaque: bool = False


def paint(
    layers: "Layers",
    texture: gpu.types.GPUTexture,
    size: tuple[int, int],
    weights: "NDArray[np.float32]",
    display: Display,
    painting: Painting,
) -> None:
    """Draw layers into the active framebuffer, in linear light multiplied by alpha.

    Parameters
    ----------
    layers, texture
        What to draw, and its `data` as a texture.
    size
        (width, height) of the whole photo.
    weights
        From `layers.weights`.
    display, painting
        How and where.
    """
    import numpy as np
    from gpu_extras.batch import batch_for_shader

    shader, (width, height) = _compiled(), size
    left, top, right, bottom = layers.box
    x, y = (left / width, right / width), (1 - bottom / height, 1 - top / height)
    # The last blocks of pixels may reach beyond the box.
    u = (right - left) / (layers.step * layers.data.shape[2])
    v = (bottom - top) / (layers.step * layers.data.shape[1])
    batch = batch_for_shader(
        shader,
        "TRI_STRIP",
        {
            "pos": [(x[0], y[0]), (x[1], y[0]), (x[0], y[1]), (x[1], y[1])],
            "coordinate": [(0, v), (u, v), (0, 0), (u, 0)],
        },
    )
    to_working = np.zeros((1, 3, 4), np.float32)
    to_working[0, :, :3] = display.matrix
    table = display.table or Table(np.zeros((1, 1)), False, False)
    light = np.zeros((*table.light.shape, 4), np.float32)
    light[..., 0] = table.light
    # Named: a texture that nobody holds is gone before the drawing.
    matrices, curve = drawing.texture(np.concatenate([weights, to_working])), drawing.texture(light)
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")
    shader.bind()
    shader.uniform_sampler("layers", texture)
    shader.uniform_sampler("matrices", matrices)
    shader.uniform_sampler("curve", curve)
    shader.uniform_float("place", painting.place)
    shader.uniform_float("split", painting.split)
    shader.uniform_float("opacity", painting.opacity)
    shader.uniform_int("count", len(weights))
    shader.uniform_int("marked", painting.marked)
    shader.uniform_bool("nearest", painting.nearest)
    shader.uniform_bool("opaque", painting.opaque)
    shader.uniform_bool("rooted", table.rooted)
    shader.uniform_bool("stepped", table.stepped)
    shader.uniform_bool("fitted", display.fitted)
    shader.uniform_bool("straight", display.straight)
    batch.draw(shader)


# --- layers and their textures ---------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Shown:
    """What there is to be seen of a photo by now.

    Attributes
    ----------
    look
        The look, maybe of a moment ago.
    whole
        Its layers, small enough for a texture.
    """

    look: "Look"
    whole: "Layers"


_wholes: "background.Worker[Layers]" = background.Worker()
_details: "background.Worker[Layers]" = background.Worker()
# The last that was there for an image, by its session_uid: shown until the next is there.
_last: dict[int, Shown] = {}
_textures: dict[tuple[object, ...], gpu.types.GPUTexture] = {}
# Textures that the editors have drawn, and how long their views have been at rest, by the areas' pointers.
_in_use: dict[int, set[tuple[object, ...]]] = {}
_resting: dict[int, tuple[tuple[object, ...], float]] = {}


def overlay_of(image: bpy.types.Image) -> str:
    """The overlay to be shown; while regions are clicked it is the region."""
    return "REGION" if image.session_uid in selecting else image.dyehouse.overlay


# Images (session_uid) whose regions are being clicked.
selecting: set[int] = set()


def wanted(space: bpy.types.SpaceImageEditor) -> bpy.types.Image | None:
    """The image that an Image Editor shows, if there is anything to be drawn over it."""
    image = space.image
    if image is None or space.ui_mode == "UV" or space.display_channels not in {"COLOR", "COLOR_ALPHA"}:
        return None
    return image if image.dyehouse.preview or overlay_of(image) != "NONE" else None


def shown(image: bpy.types.Image) -> tuple[Shown | None, str]:
    """What there is to be seen of a photo by now, and a sentence on what is wrong or being done."""
    from ..core.errors import DyehouseError

    try:
        look = session.ready(image)
        whole = None if look is None else _wholes.ask(look.key, partial(_begin, look, None, 0))
    except DyehouseError as error:
        return None, str(error)
    if look is not None and whole is not None:
        _last[image.session_uid] = Shown(look, whole)
        return _last[image.session_uid], ""
    return _last.get(image.session_uid), "Analyzing..."


def _begin(look: "Look", box: "Box | None", step: int) -> "Callable[[], Layers]":
    """Return a function that makes the layers of a part of the photo, for a thread; step 0: as fine as is sensible."""
    return partial(_taken_apart, look, box, step)


def _taken_apart(look: "Look", box: "Box | None", step: int) -> "Layers":
    import numpy as np

    from ..core.layers import step_for, take_apart
    from ..core.recolor import RegionMatrix

    analyses, pixels = look.prepared.analyses, look.photo.pixels
    regions = []
    for analysis in analyses:
        corrections = 0 if analysis.extra is None else analysis.extra.shape[2]
        regions.append(RegionMatrix(np.eye(3, 3 + corrections), analysis.mask, analysis.edge, analysis.extra))
    alpha = pixels[..., 3] if pixels.shape[2] == 4 else None
    step = step or step_for(pixels.shape[:2], min(_MOST_PIXELS, _MOST_TEXELS // (1 + 2 * len(regions))))
    return take_apart(analyses[0].picture, regions, box, step, alpha)


def _texture(key: tuple[object, ...], layers: "Layers", used: set[tuple[object, ...]]) -> gpu.types.GPUTexture:
    if key not in _textures:
        _textures[key] = drawing.texture(layers.data)
        _textures[key].filter_mode(True)
        _textures[key].extend_mode("EXTEND")
    used.add(key)
    return _textures[key]


def _free(area: bpy.types.Area, used: set[tuple[object, ...]]) -> None:
    """Free the textures that no editor has drawn last."""
    open_editors = {editor.as_pointer(): editor for editor in background.image_editors()}
    _in_use[area.as_pointer()] = used
    for pointer in set(_in_use) - set(open_editors):
        del _in_use[pointer]
    kept = set().union(*_in_use.values())
    for key in set(_textures) - kept:
        del _textures[key]
    seen = {editor.spaces.active.image.session_uid for editor in open_editors.values() if editor.spaces.active.image}
    for uid in set(_last) - seen:
        del _last[uid]


# --- the editor ------------------------------------------------------------------------------------------------


# The framebuffer that the editor's own picture is drawn into: half floats, scene-linear in the working space,
# multiplied by alpha. Handlers after it draw into another one, of 8 bits, for what lies over the picture.
_canvas: list[gpu.types.GPUFrameBuffer] = []


def _find_canvas() -> None:
    _canvas[:] = [gpu.state.active_framebuffer_get()]


def canvas() -> gpu.types.GPUFrameBuffer:
    """What the editor being drawn shows its picture on, color management still to come."""
    return _canvas[0]


def view_to_clip() -> tuple[float, float, float, float]:
    """Scale x and y, and offset x and y, of what is drawn now."""
    p = gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix()
    return p[0][0], p[1][1], p[0][3], p[1][3]


def _draw() -> None:
    context = bpy.context
    used: set[tuple[object, ...]] = set()
    image = wanted(context.space_data)
    if image is not None:
        now, _ = shown(image)
        if now is not None:
            _draw_photo(context, image, now, used)
    _free(context.area, used)


def _draw_photo(context: bpy.types.Context, image: bpy.types.Image, now: Shown, used: set) -> None:
    from ..core.errors import DyehouseError

    try:
        regions = now.look.prepared.regions()
    except DyehouseError:
        return  # said in words by `_draw_notes`
    asked, photo = image.dyehouse, now.look.photo
    height, width = photo.pixels.shape[:2]
    place = view_to_clip()
    pictures = [(0.0, {"FULL": 0.0, "SPLIT": asked.split, "SIDE": 2.0}[asked.view] if asked.preview else 2.0)]
    if asked.preview and asked.view == "SIDE":
        pictures.append((1 + GAP, 0.0))
        drawing.box(1 + GAP, 0, 1, 1, (0, 0, 0, 0), blend="NONE")  # the editor's own ground, which lies over it there
    drawn: tuple[tuple[object, ...], Layers] = (now.look.key, now.whole)
    used.add(now.look.key)  # for the next time that the view moves
    scale = place[0] * context.region.width / 2 / width  # pixels of the screen for one of the photo
    if now.whole.step > 1 and scale * now.whole.step > 1:
        boxes = [_visible(place, shift, width, height) for shift, _ in pictures]
        drawn = _detail(context.area, now, boxes, scale) or drawn
    display = display_of(image, photo)
    selected = now.look.place(asked.active_region) if overlay_of(image) == "REGION" else None
    key, layers = drawn
    texture, weights = _texture(key, layers, used), layers.weights(regions)
    for shift, split in pictures:
        painting = Painting(
            (place[0], place[1], place[2] + shift * place[0], place[3]),
            split,
            0 if selected is None else layers.firsts[selected],
            asked.overlay_opacity,
            nearest=scale * layers.step >= 1,
            opaque=context.space_data.display_channels == "COLOR" or shift > 0,
        )
        with canvas().bind():
            paint(layers, texture, (width, height), weights, display, painting)


def _visible(place: tuple[float, ...], shift: float, width: int, height: int) -> "Box | None":
    """The part of the photo that is in the region, if any."""
    low = [(-1 - place[2 + k]) / place[k] for k in (0, 1)]
    high = [(1 - place[2 + k]) / place[k] for k in (0, 1)]
    left, right = ((x - shift) * width for x in (low[0], high[0]))
    top, bottom = (1 - high[1]) * height, (1 - low[1]) * height
    box = max(0, int(left)), max(0, int(top)), min(width, int(right) + 1), min(height, int(bottom) + 1)
    return box if box[0] < box[2] and box[1] < box[3] else None


def _detail(
    area: bpy.types.Area, now: Shown, visible: "list[Box | None]", scale: float
) -> "tuple[tuple[object, ...], Layers] | None":
    """The visible part of the photo in the resolution of the screen, once the view rests."""
    from ..core.errors import DyehouseError
    from ..core.layers import step_for

    boxes = [box for box in visible if box is not None]
    if not boxes:
        return None
    box = tuple(pick(edges) for pick, edges in zip((min, min, max, max), zip(*boxes, strict=True), strict=True))
    most = min(_MOST_PIXELS, _MOST_TEXELS // len(now.whole.data))
    step = max(int(1 / scale), step_for((box[3] - box[1], box[2] - box[0]), most))
    if step >= now.whole.step:
        return None
    key = (now.look.key, box, step)
    pointer, instant = area.as_pointer(), time.monotonic()
    view, since = _resting.get(pointer, (None, 0.0))
    if view != key:
        _resting[pointer] = key, instant
        since = instant
    try:
        if instant - since >= _REST:
            found = _details.ask(key, partial(_begin, now.look, box, step))
        else:
            found = _details.found(key)
            if found is None and not bpy.app.timers.is_registered(background.redraw):
                bpy.app.timers.register(background.redraw, first_interval=_REST * 1.1)
    except DyehouseError:
        return None
    return None if found is None else (key, found)


def _draw_notes() -> None:
    image = wanted(bpy.context.space_data)
    if image is None:
        return
    from ..core.errors import DyehouseError

    now, note = shown(image)
    if now is not None and not note:
        try:
            now.look.prepared.regions()
        except DyehouseError as error:
            note = str(error)
        note = note or "     ".join(filter(None, map(recipes.unpicked, image.dyehouse.regions)))
    if now is not None and image.dyehouse.preview and image.dyehouse.view == "SPLIT":
        _draw_line(bpy.context.region, image.dyehouse.split)
    if note:
        drawing.note(drawing.scaled(12), drawing.scaled(12), textwrap.wrap(note, _LETTERS))


def _draw_line(region: bpy.types.Region, split: float) -> None:
    (x, bottom), (_, top) = (region.view2d.view_to_region(split, y, clip=False) for y in (0, 1))
    width = drawing.scaled(1)
    drawing.box(x - width, bottom, 2 * width, top - bottom, (0, 0, 0, 0.6))
    drawing.box(x - width / 2, bottom, width, top - bottom, (1, 1, 1, 0.8))


_handles: list[object] = []


@persistent
def _on_load(_path: str) -> None:
    _forget()


def _forget() -> None:
    for kept in (_last, _textures, _in_use, _resting, selecting, _canvas):
        kept.clear()


def register() -> None:
    """Draw over every Image Editor whose image asks for it."""
    add = bpy.types.SpaceImageEditor.draw_handler_add
    _handles.append(add(_find_canvas, (), "WINDOW", "PRE_VIEW"))
    _handles.append(add(_draw, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(_draw_notes, (), "WINDOW", "POST_PIXEL"))
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Free everything."""
    global _shader
    while _handles:
        bpy.types.SpaceImageEditor.draw_handler_remove(_handles.pop(), "WINDOW")
    if bpy.app.timers.is_registered(background.redraw):
        bpy.app.timers.unregister(background.redraw)
    bpy.app.handlers.load_post.remove(_on_load)
    _forget()
    _shader = None
    background.redraw()
