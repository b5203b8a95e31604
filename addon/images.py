"""Blender's images as photos, and back: the one place that knows its rows, channels and color spaces.

`Image.pixels` is float32 from the bottom row up. Byte images hold the file's codes / 255 with straight alpha; float
images hold scene-linear light in the .blend's working space, multiplied by alpha, unless they are set to Non-Color:
then they hold the file's codes.
"""

import os
import tempfile
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from . import background

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..batch.files import Decoded, Photo
    from ..core.colorspace import RGBSpace

# Blender's names of color spaces, in our own.
SPACE_NAMES = {
    "sRGB": "srgb",
    "Display P3": "display-p3",
    "sRGB Encoded P3-D65": "display-p3",
    "Gamma 2.2 Encoded AdobeRGB": "adobe-rgb",
    "Rec.2020": "rec2020",
    "Linear Rec.709": "linear-srgb",
    "Linear DCI-P3 D65": "linear-p3",
    "Linear Rec.2020": "linear-rec2020",
    "ACEScg": "acescg",
    "ACES2065-1": "aces2065-1",
}


@cache
def reads_files() -> bool:
    """Whether OpenImageIO is there; without it Blender itself reads and writes."""
    try:
        import OpenImageIO  # noqa: F401
    except ImportError:
        return False
    return True


def working_space() -> "RGBSpace":
    """The .blend's scene-linear space, which color properties and float images are in."""
    from ..core.colorspace import space_named

    return space_named(SPACE_NAMES[bpy.data.colorspace.working_space])


def shape_of(image: bpy.types.Image) -> tuple[int, int]:
    """(height, width) of an image that can be recolored.

    Raises
    ------
    ImageError
        If it has no pixels; the sentence says why.
    """
    from ..core.errors import ImageError

    name = image.name
    if image.source == "TILED":
        raise ImageError(f"Image '{name}' has UDIM tiles: use Recolor Texture in the Shader Editor.")
    if image.source in {"MOVIE", "SEQUENCE"}:
        raise ImageError(f"Image '{name}' is a {image.source.lower()}: open one frame of it as an image.")
    width, height = image.size
    path = file_of(image)
    if image.type == "MULTILAYER" and path is not None and not width:
        from ..batch.exr import Header

        return Header(path).shape
    if not width or not height:
        if image.type == "RENDER_RESULT":
            raise ImageError(f"'{name}' is empty: render in a window first, or open the rendered file.")
        wanted = bpy.path.abspath(image.filepath, library=image.library)
        if image.filepath and not Path(wanted).exists():
            raise ImageError(f"Image '{name}' has lost its file '{wanted}': find it with File > External Data.")
        if path is not None:
            raise ImageError(f"'{path}' is damaged or of a kind that Blender cannot read: copy or export it again.")
        raise ImageError(f"Image '{name}' has no pixels: render or load it first.")
    return height, width


def file_of(image: bpy.types.Image) -> Path | None:
    """The file that holds exactly the image's pixels, or None."""
    if image.source != "FILE" or image.is_dirty or image.packed_file or not image.filepath:
        return None
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    return path if path.is_file() else None


def orientation_of(image: bpy.types.Image) -> int:
    """EXIF orientation of an image's file, by which Blender does not turn it; 1 without a file."""
    path = file_of(image)
    return 1 if path is None else _orientation(path, path.stat().st_mtime_ns)


@lru_cache(8)
def _orientation(path: Path, _version: int) -> int:
    from ..batch import metadata

    return metadata.extract(path).orientation


def color_space_name(image: bpy.types.Image) -> str | None:
    """What the image's numbers mean where the user has said so, in the panel or in Blender; None: as the file says."""
    asked = image.dyehouse.color_space
    if asked != "FILE":
        return asked
    told = image.colorspace_settings.name
    usual = {"sRGB", "Linear Rec.709", "Non-Color", bpy.data.colorspace.working_space}
    return None if told in usual else SPACE_NAMES.get(told)


def space_in_blender(image: bpy.types.Image) -> "RGBSpace":
    """What Blender takes the numbers of an image for when it shows it (measured in 5.2)."""
    from ..core.colorspace import space_named

    told = image.colorspace_settings.name
    in_memory = file_of(image) is None and (image.is_dirty or not image.packed_file)
    if told == "Non-Color" or (image.is_float and in_memory):
        return working_space()
    return space_named(SPACE_NAMES.get(told, "srgb"))


def version_of(image: bpy.types.Image, hurry: bool = False) -> tuple[object, ...] | None:
    """Changes whenever the image's pixels, or their meaning, do.

    Parameters
    ----------
    image
        Any image.
    hurry
        While a window is drawn: pixels that are in no file may be looked at only now and then, and if they are many,
        nothing may be known yet: then it is None, and the editors are drawn when it can be known.
    """
    if image.type == "RENDER_RESULT":
        return image.session_uid, image.render_slots.active_index, _renders
    path = file_of(image)
    base = (image.session_uid, tuple(image.size), image.colorspace_settings.name, color_space_name(image))
    if path is not None:
        state = path.stat()
        return (*base, str(path), state.st_mtime_ns, state.st_size)
    if image.packed_file and not image.is_dirty:
        return (*base, "packed", image.packed_file.size)
    found = _fingerprint(image, hurry)
    return None if found is None else (*base, "pixels", found)


# Renders of this session: of a render, Blender shows no pixels to compare.
_renders = 0


def count_render() -> None:
    """Know that there is a new render."""
    global _renders
    _renders += 1


# Of each image in memory: when it may be looked at again, and what was found.
_fingerprints: dict[int, tuple[float, int]] = {}


def _fingerprint(image: bpy.types.Image, hurry: bool) -> int | None:
    """A number that changes with the pixels: Blender does not tell when those of an image in memory change."""
    begun = time.monotonic()
    again, found = _fingerprints.get(image.session_uid, (0.0, None))
    if hurry and begun < again:
        return found
    room = _room(len(image.pixels), hurry)
    if room is None:
        return found
    image.pixels.foreach_get(room)
    found = zlib.crc32(room)
    ended = time.monotonic()
    _fingerprints[image.session_uid] = (ended + max(0.3, 20 * (ended - begun)), found)
    return found


# Memory that Blender's pixels can be copied into. The system hands it out page by page as it is touched, which may take
# ten times as long as the copy, so that is done in a thread.
_rooms: "background.Worker[NDArray[np.float32]]" = background.Worker(kept=1)
# Numbers that need no thread, and seconds for which memory is kept.
_FEW, _KEPT = 16_000_000, 30.0
_room_used = 0.0


def _room(size: int, hurry: bool = False) -> "NDArray[np.float32] | None":
    """Memory for so many numbers; None while it is being made ready, in a hurry."""
    global _room_used
    import numpy as np

    if size <= _FEW:
        return np.empty(size, np.float32)
    room = _rooms.ask(size, lambda: partial(_touched, size)) if hurry else _rooms.found(size)
    _room_used = time.monotonic()
    if hurry and not bpy.app.timers.is_registered(_give_back):
        bpy.app.timers.register(_give_back, first_interval=_KEPT)
    return np.empty(size, np.float32) if room is None and not hurry else room


def _touched(size: int) -> "NDArray[np.float32]":
    import numpy as np

    room = np.empty(size, np.float32)
    room.fill(0)
    return room


def _give_back() -> float | None:
    """Keep no memory that has not been used lately; a timer."""
    rest = _room_used + _KEPT - time.monotonic()
    if rest > 0:
        return rest
    _rooms.forget()
    return None


def loader(image: bpy.types.Image) -> "Callable[[], Photo]":
    """Return a function that gives the photo; only this call touches Blender, so another thread may make the photo.

    The photo lies as Blender shows it, which does not turn it by its EXIF orientation.

    Raises
    ------
    DyehouseError
        If the image cannot be recolored.
    """
    shape_of(image)
    name = color_space_name(image)
    if image.type == "RENDER_RESULT":
        return partial(_read_once, file_loader(saved_render(image), name), image.name)
    path = file_of(image)
    if path is not None:
        return file_loader(path, name)
    if image.packed_file and not image.is_dirty and image.source == "FILE":
        return partial(_read_once, file_loader(_unpacked(image), name), image.name)
    return partial(_photo, *_held(image), name, Path(image.name), working_space())


def file_loader(path: Path, name: str | None) -> "Callable[[], Photo]":
    """Return a function that gives the photo in a file as it is stored, not turned by its orientation.

    Parameters
    ----------
    path
        The file.
    name
        Its color space, a key of `core.colorspace.SPACES`; None for what it says itself.

    Raises
    ------
    FileError
        If Blender must read the file and cannot.
    """
    from ..batch import files

    decoded = None if reads_files() else _decoded(path)
    return partial(files.read, path, name, upright=False, decoded=decoded)


def photo_of(image: bpy.types.Image) -> "Photo":
    """The image as a photo, as `batch.files.read` gives it.

    Raises
    ------
    ImageError, FileError
        If it has no pixels, or its file cannot be read.
    """
    return loader(image)()


def pixels_of(image: bpy.types.Image) -> "NDArray[np.float32]":
    """(height, width, channels) float32, top row first: the numbers as Blender holds them."""
    import numpy as np

    width, height = image.size
    size = width * height * image.channels
    taken = _rooms.take(size)
    out = np.empty(size, np.float32) if taken is None else taken
    image.pixels.foreach_get(out)
    return out.reshape(height, width, image.channels)[::-1]


def set_pixels(image: bpy.types.Image, pixels: "NDArray") -> None:
    """Fill an image with (height, width, channels of the image), top row first."""
    import numpy as np

    image.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
    image.update()
    image.update_tag()  # or the compositor goes on with the old pixels


def _held(image: bpy.types.Image) -> "tuple[NDArray, str, bool, bool, bool]":
    """Pixels that Blender alone holds, what they mean to it, and whether they are bytes, linear, times alpha."""
    meaning, pixels = image.colorspace_settings.name, pixels_of(image)
    linear = image.is_float and meaning != "Non-Color"
    return pixels, meaning, not image.is_float, linear, linear and image.alpha_mode in {"STRAIGHT", "PREMUL"}


def _stored(pixels: "NDArray[np.float32]", byte: bool) -> "NDArray":
    """Codes of a byte image, which Blender gives divided by 255; other pixels as they are."""
    import numpy as np

    return (pixels * 255 + 0.5).astype(np.uint8) if byte else pixels


def _decoded(path: Path) -> "Decoded":
    """The pixels of a file, decoded by Blender."""
    import numpy as np

    from ..batch import exr, files, metadata
    from ..core.errors import FileError

    if not path.is_file():
        raise FileError(f"'{path}' does not exist: check the name.")
    blocks = metadata.extract(path)
    kind = files.kind_of(path, blocks)
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"  # the codes of the file
        if 0 in image.size:
            raise FileError(f"'{path}' is damaged or of a kind that Blender cannot read: save it as PNG.")
        if image.type == "MULTILAYER":
            raise FileError(f"'{path}' has several layers, which need OpenImageIO: save the picture as plain RGBA.")
        pixels, is_float = pixels_of(image), image.is_float
        channels = image.depth // (32 if is_float else 8)
    finally:
        bpy.data.images.remove(image)
    header = exr.Header(path) if kind == "exr" else None
    if header is not None:
        found = header.channels
        grey, has_alpha, associated = "Y" in found, "A" in found, "A" in found
        codes = pixels.astype(np.float16 if set(found.values()) == {"half"} else np.float32)
    else:
        grey, has_alpha, associated = channels < 3, channels in (2, 4), blocks.associated and channels in (2, 4)
        codes = _integers(pixels, is_float)
    notes = ["The file is greyscale: it is read, and written, as RGB."] if grey else []
    codes = np.ascontiguousarray(codes if has_alpha else codes[..., :3])
    return files.Decoded(codes, header, kind, notes, associated, grey)


def _integers(pixels: "NDArray", is_float: bool) -> "NDArray":
    """The codes that 0..1 stands for: of 8 bits, or of 16 for an image of floats; a TIFF of floats stays one."""
    import numpy as np

    if not is_float:
        return np.floor(pixels * 255 + 0.5).astype(np.uint8)
    codes = pixels * 65535
    whole = np.floor(codes + 0.5)
    if whole.min() < 0 or whole.max() > 65535 or np.abs(codes - whole).max() > 0.01:
        return pixels
    return whole.astype(np.uint16)


def _photo(
    pixels: "NDArray",
    meaning: str,
    byte: bool,
    linear: bool,
    premultiplied: bool,
    name: str | None,
    path: Path,
    working: "RGBSpace",
) -> "Photo":
    from ..batch.files import Photo
    from ..core.colorspace import SRGB, space_named

    pixels = _stored(pixels, byte)
    if linear:
        space = working
    else:
        space = space_named(name or SPACE_NAMES.get(meaning, "srgb")) if meaning != "Non-Color" or name else SRGB
    if pixels.shape[2] < 3:
        pixels = pixels[..., [0, 0, 0]] if pixels.shape[2] == 1 else pixels[..., [0, 0, 0, 1]]
    opaque = pixels.shape[2] == 4 and bool((pixels[..., 3] == _opaque(pixels)).all())
    return Photo(path, pixels[..., :3] if opaque else pixels, space, premultiplied and not opaque)


def _opaque(pixels: "NDArray") -> float:
    import numpy as np

    return np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0


def _unpacked(image: bpy.types.Image) -> Path:
    """A file of what is packed in the .blend."""
    handle, path = tempfile.mkstemp(suffix=Path(image.filepath or image.name).suffix)
    with os.fdopen(handle, "wb") as file:
        file.write(image.packed_file.data)
    return Path(path)


def _read_once(load: "Callable[[], Photo]", name: str) -> "Photo":
    """Read a file of our own, and remove it."""
    path = load.args[0]  # type: ignore[attr-defined]
    try:
        return replace(load(), path=Path(name))
    finally:
        path.unlink(missing_ok=True)


def saved_render(image: bpy.types.Image) -> Path:
    """Save the render to a file: its pixels cannot be read otherwise."""
    handle, path = tempfile.mkstemp(suffix=".exr")
    os.close(handle)
    save_exr(image, Path(path), "32", True)
    return Path(path)


def save_exr(image: bpy.types.Image, path: Path, depth: str, alpha: bool) -> None:
    """Save what an image holds as EXR of a depth of "16" or "32" bits, which has no view transform."""
    scene = bpy.data.scenes.new("Dyehouse")
    try:
        settings = scene.render.image_settings
        settings.media_type, settings.file_format = "IMAGE", "OPEN_EXR"
        settings.color_depth, settings.color_mode, settings.exr_codec = depth, "RGBA" if alpha else "RGB", "ZIP"
        image.save_render(str(path), scene=scene)
    finally:
        bpy.data.scenes.remove(scene)


def coverage_loader(image: bpy.types.Image, shape: tuple[int, int]) -> "Callable[[], NDArray]":
    """Return a function that gives the (height, width) coverage a mask image means.

    As `batch.files.read_mask` has it. Only this call touches Blender.

    Raises
    ------
    ImageError
        If the mask has no pixels. The function raises MaskError if it is not a mask of this size.
    """
    from ..batch import files

    shape_of(image)
    path = file_of(image)
    if path is not None:
        return mask_file_loader(path, shape)
    (pixels, _, byte, *_), name = _held(image), f"The mask '{image.name}'"
    return lambda: files.coverage(_stored(pixels, byte), shape, name)


def mask_file_loader(path: Path, shape: tuple[int, int]) -> "Callable[[], NDArray]":
    """Return a function that gives the (height, width) coverage in a mask file; as `coverage_loader`.

    Raises
    ------
    FileError
        If Blender must read the file and cannot.
    """
    from ..batch import files

    return partial(files.read_mask, path, shape, None if reads_files() else _decoded(path))


def new_image(name: str, pixels: "NDArray", space: "RGBSpace", premultiplied: bool) -> bpy.types.Image:
    """Make an image of recolored pixels.

    Parameters
    ----------
    name
        Of the new image.
    pixels
        (height, width, 3 or 4): uint8 codes of a space that Blender knows give a byte image, all else a float one.
    space
        What the pixels mean. Floats are brought into the working space.
    premultiplied
        Whether RGB is multiplied by alpha.
    """
    return image_maker(name, pixels, space, premultiplied, working_space())()


def image_maker(
    name: str, pixels: "NDArray", space: "RGBSpace", premultiplied: bool, working: "RGBSpace"
) -> Callable[[], bpy.types.Image]:
    """Return a function that makes an image as `new_image` does.

    Only that function touches Blender, so another thread may make it; `working` is from `working_space`.
    """
    import numpy as np

    from ..core import colorimetry, transfer
    from ..core.colorspace import SPACES

    height, width, channels = pixels.shape
    named = [blenders for blenders, ours in SPACE_NAMES.items() if SPACES[ours] is space]
    byte = pixels.dtype == np.uint8 and bool(named)
    rgba = np.ones((height, width, 4), np.float32)[::-1]  # in memory as Blender has it
    if byte:
        np.divide(pixels, np.float32(255), out=rgba[..., :channels])
    else:
        linear = transfer.decode(pixels[..., :3], space.curve) if not space.curve.is_linear else pixels[..., :3]
        if not np.allclose(space.to_xyz, working.to_xyz, atol=1e-6):
            linear = linear @ np.float32(colorimetry.conversion_matrix(space, working)).T
        rgba[..., :3] = linear
        if channels == 4:
            top = np.float32(np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1)
            rgba[..., 3] = pixels[..., 3] / top
            if not premultiplied:
                rgba[..., :3] *= rgba[..., 3:]

    def make() -> bpy.types.Image:
        image = bpy.data.images.new(name, width, height, alpha=channels == 4, float_buffer=not byte)
        if byte:
            image.colorspace_settings.name = named[0]
        set_pixels(image, rgba)
        return image

    return make
