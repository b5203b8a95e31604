"""Recolored photos as files and as images of the .blend."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import images

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..batch.files import Photo
    from ..core.colorspace import RGBSpace
    from ..core.recipe import Colorway, Prepared
    from ..core.recolor import Shares


def stem_of(image: bpy.types.Image) -> str:
    """What {photo} stands for: the name of the image's file without extension, else of the image."""
    from_file = image.filepath and image.source == "FILE"
    return Path(bpy.path.basename(image.filepath) if from_file else image.name).stem


def folder_of(image: bpy.types.Image) -> Path | None:
    """Folder that `//` stands for: that of the .blend; where that is not saved yet, that of the photo; else None."""
    library = image.library
    if bpy.data.filepath or library:
        return Path(bpy.path.abspath("//", library=library))
    file = images.file_of(image)
    return file.parent if file else None


def planned(image: bpy.types.Image, pattern: str, colorways: "tuple[Colorway, ...]") -> list[Path]:
    """The files that the colorways of a photo go into.

    Raises
    ------
    FileError
        If there is no folder for them.
    RecipeError
        If two have the same name.
    """
    from ..core.errors import FileError, RecipeError
    from ..core.recipe_file import Output

    folder = folder_of(image)
    if pattern.startswith("//"):
        if folder is None:
            raise FileError("The .blend is not saved yet, so that '//' is nowhere: save it, or give a whole path.")
        pattern = str(folder / pattern[2:])
    paths = [Path(Output(pattern).named(stem_of(image), colorway.name)) for colorway in colorways]
    for number, path in enumerate(paths):
        if path in paths[:number]:
            raise RecipeError(
                f"Colorways '{colorways[paths.index(path)].name}' and '{colorways[number].name}' would both be "
                f"written to '{path}': give them other names, or put {{colorway}} into the output's."
            )
    return paths


def check(path: Path, image: bpy.types.Image, overwrite: bool) -> Path:
    """Check that a file can be written, before any work is done for it.

    Raises
    ------
    FileError
        If it cannot be, if it is the photo's own, or if it is there and may not be overwritten.
    """
    from ..batch import files
    from ..core.errors import FileError

    own = bpy.path.abspath(image.filepath, library=image.library) if image.filepath else None
    files.check_output(path, source=own, force=True)
    if not overwrite and (path.exists() or path.is_symlink()):
        raise FileError(f"'{path}' exists already: choose another name, or allow it to be overwritten.")
    return path


def in_space(photo: "Photo", name: str | None) -> "Photo":
    """The photo, to be written in a color space by its name; in its own without a name.

    Raises
    ------
    ImageError
        If there is no such space.
    """
    from ..core.colorspace import space_named

    return replace(photo, wanted=space_named(name) if name else None)


def begin(
    photo: "Photo",
    prepared: "Prepared",
    path: Path,
    *,
    overwrite: bool = False,
    quality: int = 95,
    compression: str | None = None,
    watch: Callable[[float], None] | None = None,
) -> "Callable[[], Shares]":
    """Recolor a photo for a file, without Blender, in any thread.

    Parameters
    ----------
    photo, prepared
        Of a look, made `batch.photo.upright`.
    path
        The file, as from :func:`check`.
    overwrite
        Replace a file that is there.
    quality, compression
        As for `batch.files.write`.
    watch
        As for `batch.photo.recolored`.

    Returns
    -------
    What the main thread has to call for the file to be complete; it gives what the file could not hold.

    Raises
    ------
    FileError
        If the file cannot be written. The returned function raises it too.
    """
    from ..batch import photo as photos

    options: dict[str, Any] = {"force": overwrite, "quality": quality, "compression": compression}
    if images.reads_files():
        _, shares = photos.save(photo, prepared, path, watch=watch, **options)
        return lambda: shares
    pixels, shares = photos.recolored(photo, prepared, path, watch=watch)

    def finish() -> "Shares":
        _write_with_blender(path, pixels, photo, **options)
        return shares

    return finish


def _write_with_blender(
    path: Path, pixels: "NDArray", photo: "Photo", *, force: bool, quality: int, compression: str | None
) -> None:
    """Write a file as `batch.files.write` does, encoded by Blender."""
    from ..batch import exr, files, metadata
    from ..core.errors import FileError

    kind, space = files.OUTPUT_KINDS[path.suffix.lower()], files.output_space(path, photo)
    if kind == "tiff" and pixels.dtype.kind == "f":
        raise FileError(f"'{path}' needs OpenImageIO for floats in a TIFF: write an EXR.")
    if compression is not None:
        raise FileError(f"'{path}' needs OpenImageIO for a choice of compression: leave it out.")

    lossless = photo.metadata is not None and photo.metadata.blocks.lossless

    def encode(temporary: Path, fitted: "NDArray", premultiplied: bool) -> None:
        _encode_with_blender(temporary, kind, fitted, 100 if lossless else quality)
        if kind == "tiff" and fitted.shape[2] == 4:
            metadata.tell_association(temporary, premultiplied)
        if kind == "exr":
            exr.tell_space(temporary, space.chromaticities)

    files.write(path, pixels, photo, force=force, encode=encode)


def _encode_with_blender(path: Path, kind: str, pixels: "NDArray", quality: int) -> None:
    """Encode exactly these codes or floats, without view transform or dither."""
    import numpy as np

    height, width, channels = pixels.shape
    byte = pixels.dtype == np.uint8
    image = bpy.data.images.new("Dyehouse", width, height, alpha=channels == 4, float_buffer=not byte)
    try:
        if not byte:
            image.colorspace_settings.name = "Non-Color"  # before the pixels
        rgba = np.ones((height, width, 4), np.float32)
        top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1
        rgba[..., :channels] = pixels / np.float32(top)
        if kind == "png" and not byte:
            rgba[..., :3] *= rgba[..., 3:]  # Blender divides by it
        images.set_pixels(image, rgba)
        if kind == "exr":
            images.save_exr(image, path, "16" if pixels.dtype == np.float16 else "32", channels == 4)
        else:
            image.filepath_raw, image.file_format = str(path), kind.upper()
            image.save(quality=quality)
    finally:
        bpy.data.images.remove(image)


def save(photo: "Photo", prepared: "Prepared", path: Path, **options) -> "Shares":
    """Recolor a photo, however it lies, into a file; parameters as for :func:`begin`."""
    from ..batch.photo import upright

    return begin(*upright(photo, prepared), path, **options)()


def save_mask(path: Path, coverage: "NDArray") -> None:
    """Write a mask as a PNG that `batch.files.read_mask` gives back exactly; a file that is there is replaced.

    Parameters
    ----------
    path
        The file.
    coverage
        (height, width) uint8, or float32 in steps of 16 bits.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    import numpy as np

    from ..batch import files
    from ..core.colorspace import SRGB

    codes = coverage if coverage.dtype == np.uint8 else np.rint(coverage * np.float32(65535)).astype(np.uint16)
    pixels = np.repeat(codes[..., None], 3, axis=2)
    photo = files.Photo(Path(), pixels, SRGB)
    if images.reads_files():
        files.write(path, pixels, photo, force=True)
    else:
        _write_with_blender(path, pixels, photo, force=True, quality=100, compression=None)


def begin_image(
    photo: "Photo",
    prepared: "Prepared",
    name: str,
    working: "RGBSpace",
    watch: Callable[[float], None] | None = None,
) -> "Callable[[], tuple[bpy.types.Image, Shares]]":
    """Recolor a photo for a new image of the .blend, in any thread; the main thread has to call what is returned.

    The image has the same pixels as a file of the photo's own kind. `working` is from `images.working_space`.
    """
    from ..batch import files
    from ..batch import photo as photos

    kind = "image.tif"  # holds every kind of pixels
    pixels, shares = photos.recolored(photo, prepared, kind, watch=watch)
    premultiplied = files.output_premultiplied(kind, photo)
    make = images.image_maker(name, pixels, files.output_space(kind, photo), premultiplied, working)
    return lambda: (make(), shares)


def to_image(photo: "Photo", prepared: "Prepared", name: str) -> "tuple[bpy.types.Image, Shares]":
    """Recolor a photo into a new image of the .blend; see :func:`begin_image`."""
    return begin_image(photo, prepared, name, images.working_space())()


def verified(photo: "Photo", prepared: "Prepared", path: Path) -> list[str]:
    """Read a file back: how near it came to the asked color, a sentence for each region; none without OpenImageIO."""
    from ..batch import verification

    if not images.reads_files():
        return []
    return [found.sentence for found in verification.expect(photo, prepared).check(path)]
