"""Pictures in files: what their numbers mean when read, and the same facts kept when written.

OpenImageIO decodes and encodes the pixels; `metadata` carries everything else over as the bytes it is.
"""

from __future__ import annotations

import collections
import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core import transfer
from ..core.colorspace import LINEAR_SRGB, SPACES, SRGB, RGBSpace, normalized_primary_matrix, space_named
from ..core.errors import DyehouseError, FileError, ImageError, MaskError
from . import icc, metadata
from .metadata import Blocks

OUTPUT_KINDS = {
    ".png": "png",
    ".jpg": "jpeg",
    ".jpeg": "jpeg",
    ".tif": "tiff",
    ".tiff": "tiff",
    ".exr": "exr",
    ".webp": "webp",
}
RAW_EXTENSIONS = frozenset(
    f".{name}"
    for name in (
        *("3fr", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "iiq", "kdc", "mef", "mos", "mrw"),
        *("nef", "nrw", "orf", "pef", "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f"),
    )
)
_REMEDY = "give its color space with --color-space"
_LARGEST = {"jpeg": 65535, "webp": 16383}  # width or height: T.81, B.2.2; RFC 9649, 2.4

# Linear spaces and what holds the same colors in integer codes.
_ENCODED = {"linear-srgb": "srgb", "linear-p3": "display-p3", "linear-rec2020": "rec2020"}
# Names of the Color Interop Forum's "Color Space Encodings for Texture Assets", as OpenEXR files carry them.
_INTEROP = {
    "lin_rec709_scene": "linear-srgb",
    "lin_p3d65_scene": "linear-p3",
    "lin_rec2020_scene": "linear-rec2020",
    "lin_ap1_scene": "acescg",
    "lin_ap0_scene": "aces2065-1",
    "srgb_rec709_scene": "srgb",
    "srgb_rec709_display": "srgb",
    "srgb_p3d65_scene": "display-p3",
    "srgb_p3d65_display": "display-p3",
    "g22_adobergb_scene": "adobe-rgb",
}


@dataclass
class _Source:
    """What `write` needs of the file that was read."""

    kind: str
    blocks: Blocks
    spec: Any = None  # OpenImageIO.ImageSpec
    tagged: bool = True  # False: the space is an assumption
    overridden: bool = False
    associated: bool = False  # the file holds integer codes multiplied by alpha


@dataclass
class Photo:
    """A picture as it was read.

    Attributes
    ----------
    path
        The file.
    pixels
        (height, width, 3 or 4), the top row first and upright, of the dtype the file has: uint8, uint16,
        float16 or float32. Channel 4 is alpha. Codes are those of the file, not converted. In integer
        pictures RGB is not multiplied by alpha.
    space
        What `pixels[..., :3]` mean: integers are its codes, floats its values.
    premultiplied
        Whether RGB is multiplied by alpha (EXR, and TIFF of floats that says so).
    white
        Of a RAW photo, the linear RGB of a white surface under the light of the photo; else None.
    assumptions
        Sentences on what was not in the file and had to be assumed.
    metadata
        For `write`.
    orientation
        1 for an upright picture. Else the pixels are as they are stored, with that EXIF orientation, and `turned`
        makes them upright.
    wanted
        The space whose primaries the output shall have; None for the photo's own.
    """

    path: Path
    pixels: NDArray
    space: RGBSpace
    premultiplied: bool = False
    white: tuple[float, float, float] | None = None
    assumptions: tuple[str, ...] = ()
    metadata: Any = None
    orientation: int = 1
    wanted: RGBSpace | None = None


@dataclass
class Decoded:
    """The pixels of a file as they are stored, and what its decoder tells.

    Attributes
    ----------
    pixels
        (height, width, 3 or 4), the top row first.
    spec
        The header: an OpenImageIO.ImageSpec, or what answers `getattribute` and its kin as one does.
    kind
        ``png``, ``jpeg``, ``tiff``, ``webp`` or ``exr``.
    notes
        Sentences on what was left out.
    associated
        Whether RGB is multiplied by alpha.
    grey
        Whether the file holds grey values.
    """

    pixels: NDArray
    spec: Any
    kind: str
    notes: list[str]
    associated: bool
    grey: bool


# --- reading ------------------------------------------------------------------------------------------------


def read(
    path: str | Path,
    color_space: str | None = None,
    *,
    upright: bool = True,
    decoded: Decoded | None = None,
    rows: int | None = None,
) -> Photo:
    """Read a picture.

    The color space comes from, in this order: `color_space`; PNG ``cICP``; the ICC profile; PNG ``sRGB``,
    ``gAMA`` and ``cHRM`` (W3C PNG, third edition, 4.3); EXR ``colorInteropID`` and ``chromaticities``; the
    EXIF color space and interoperability index (CIPA DC-008, 4.6.6). If none of these is there, integers are
    taken as sRGB and floats as linear Rec.709, which `Photo.assumptions` tells.

    Parameters
    ----------
    path
        PNG, JPEG, TIFF, EXR or WebP, whatever its name ends in; or a camera RAW file by its extension.
    color_space
        A name of `core.colorspace.SPACES` that is used instead of what the file says. For a RAW file, the
        primaries to develop into.
    upright
        Turn the picture by its EXIF orientation.
    decoded
        The pixels, where another decoder than OpenImageIO has read them already.
    rows
        Decode so many rows from the top, or all of them where that saves nothing; None for all.

    Raises
    ------
    FileError
        If the file is missing, damaged, or of a kind or color space that cannot be handled.
    ImageError
        If it has no pixels or not only finite ones, or if `color_space` is not known.
    """
    path = Path(path)
    override = space_named(color_space) if color_space else None
    _check_input(path)
    if path.suffix.lower() in RAW_EXTENSIONS:
        return _read_raw(path, color_space)
    blocks = _extract(path)
    found = decoded or _decode(path, blocks, rows)
    pixels, kind, notes, associated, grey = found.pixels, found.kind, found.notes, found.associated, found.grey
    orientation = blocks.orientation
    if upright:
        pixels, orientation = turned(pixels, orientation), 1

    premultiplied = False
    if associated and pixels.dtype.kind == "f":
        premultiplied, associated = True, False
    elif associated:
        pixels = _divide_by_alpha(pixels)
    if override is not None:
        space, tagged = override, True
    else:
        try:
            space, tagged, note = _space(blocks, found.spec, kind, pixels.dtype, grey)
        except FileError as error:
            raise FileError(f"'{path.name}': {error}") from None
        notes += note
    if grey and blocks.icc and icc.data_space(blocks.icc) == "GRAY":
        blocks.icc = b""
    metadata.upright(blocks)
    source = _Source(kind, blocks, found.spec, tagged, override is not None, associated)
    return Photo(path, pixels, space, premultiplied, None, tuple(notes), source, orientation)


def _check_input(path: Path) -> None:
    try:
        if path.is_dir():
            raise FileError(f"'{path}' is a folder: give a picture file.")
        if path.stat().st_size == 0:
            raise FileError(f"'{path}' is empty: copy it again from its source.")
    except FileNotFoundError:
        raise FileError(f"'{path}' does not exist: check the name.") from None
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from None


def _extract(path: Path) -> Blocks:
    try:
        return metadata.extract(path)
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from None


def kind_of(path: Path, blocks: Blocks) -> str:
    """The kind of a picture file by its first bytes, as `Decoded` has it.

    Raises
    ------
    FileError
        If it is none that can be read.
    """
    kind = blocks.kind
    if not kind:
        with path.open("rb") as file:
            kind = "exr" if file.read(4) == b"v/1\x01" else ""
    if not kind:
        raise FileError(f"'{path}' is no picture of a known kind: use PNG, JPEG, TIFF, EXR or WebP.")
    if kind == "jpeg" and blocks.components == 4:
        raise FileError(f"'{path}' is in CMYK: convert it to RGB first, through its color profile.")
    return kind


def _decode(path: Path, blocks: Blocks, rows: int | None = None) -> Decoded:
    import OpenImageIO

    kind = kind_of(path, blocks)
    hints = OpenImageIO.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # straight alpha is delivered as stored, not multiplied in
    source = OpenImageIO.ImageInput.open(str(path), hints)
    if source is None:
        raise _damaged(path, OpenImageIO.geterror())
    try:
        spec = source.spec()
        if spec.width < 1 or spec.height < 1 or spec.deep:
            raise ImageError(f"'{path}' holds no plain pixels: give a picture with flat pixels.")
        model = spec.getattribute("tiff:ColorSpace") or spec.getattribute("jpeg:ColorSpace")
        if model in ("CMYK", "CIELAB", "ICCLAB", "ITULAB", "color separated", "LOGLUV"):
            raise FileError(f"'{path}' is in {model}: convert it to RGB first, through its color profile.")
        part, spec, color, alpha, notes = _channels(source, spec, kind, path)
        if blocks.pages > 1:
            notes.append(f"'{path.name}' has more than one picture: only the first is used.")
        picked = [*color, alpha] if alpha is not None else color
        first, last = min(picked), max(picked) + 1
        sample = _sample_type(spec, picked, path)
        if rows is None or rows >= spec.height or blocks.orientation != 1 or spec.tile_width:
            pixels = source.read_image(part, 0, first, last, sample)
        else:
            pixels = source.read_scanlines(part, 0, spec.y, spec.y + rows, 0, first, last, sample)
        error = source.geterror()
        # The JPEG decoder delivers grey rows for what is missing, and only tells so.
        if pixels is None or error:
            raise _damaged(path, error)
        spec = spec.copy()
    finally:
        source.close()

    grey = len(color) == 1
    order = [i - first for i in (color * 3 if grey else color)] + ([alpha - first] if alpha is not None else [])
    if order != list(range(pixels.shape[2])):
        pixels = np.ascontiguousarray(pixels[:, :, order])
    if grey:
        notes.append("The file is greyscale: it is read, and written, as RGB.")
    if kind == "exr":
        blocks.orientation = spec.get_int_attribute("Orientation", 1)
    _check_finite(pixels, path)
    associated = alpha is not None and not spec.get_int_attribute("oiio:UnassociatedAlpha", 0)
    return Decoded(pixels, spec, kind, notes, associated, grey)


def _damaged(path: Path, reason: str) -> FileError:
    first = reason.strip().split("\n")[0].split(' ("')[0].strip().rstrip(".") or "no reason given"
    return FileError(f"'{path}' is damaged or cut short ({first}): copy it again from its source.")


def _channels(source: Any, spec: Any, kind: str, path: Path) -> tuple[int, Any, list[int], int | None, list[str]]:
    """Choose the part and the channels of color and alpha."""
    notes: list[str] = []
    if kind != "exr":
        names = list(spec.channelnames)
        color = [0, 1, 2] if len(names) >= 3 else [0]
        alpha = spec.alpha_channel if spec.alpha_channel >= 0 else None
        if len(names) > len(color) + (alpha is not None):
            notes.append("Channels of the TIFF besides color and transparency are not read, and not written.")
        return 0, spec, color, alpha, notes

    part, seen = 0, []
    while True:
        names = list(spec.channelnames)
        seen += names
        # Blender's render layers are named Layer.Pass.Channel; Combined is the picture.
        prefixes = dict.fromkeys(n[:-1] for n in names if n[-2:] == "R" or n[-2:] == ".R")
        for prefix in sorted(prefixes, key=lambda p: (p != "", not p.endswith("Combined."))):
            color = [names.index(prefix + c) for c in "RGB" if prefix + c in names]
            if len(color) == 3 and (not prefix or prefix.endswith("Combined.") or len(prefixes) == 1):
                alpha = names.index(prefix + "A") if prefix + "A" in names else None
                if part or len(names) > 3 + (alpha is not None) or spec.get_int_attribute("oiio:subimages", 1) > 1:
                    notes.append("Only the RGBA of the EXR is read, and written: it has more layers or channels.")
                return part, spec, color, alpha, notes
        if set(names) in ({"Y"}, {"Y", "A"}):
            return part, spec, [names.index("Y")], names.index("A") if "A" in names else None, notes
        part += 1
        if not source.seek_subimage(part, 0):
            source.geterror()  # that there is no further part is no error
            break
        spec = source.spec()
    found = ", ".join(seen[:20])
    raise FileError(f"'{path}' has no R, G and B channels but {found}: save the picture as RGB or RGBA.")


def _sample_type(spec: Any, picked: list[int], path: Path) -> str:
    kinds = {str(spec.channelformat(i)) for i in picked}
    if kinds <= {"half"}:
        return "half"
    if kinds <= {"half", "float", "double"}:
        return "float"
    if kinds in ({"uint8"}, {"uint16"}):
        return kinds.pop()
    raise FileError(
        f"'{path}' has pixels of type {' and '.join(sorted(kinds))}: save it with 8 or 16 bits, or as floats."
    )


def turned(pixels: NDArray, orientation: int, back: bool = False) -> NDArray:
    """Make a picture or a mask upright (EXIF orientation: CIPA DC-008, 4.6.5.1.6), or lay it `back` as it was."""
    down, across = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
        down, across = (across, down) if back else (down, across)
    pixels = pixels[:: -1 if down else 1, :: -1 if across else 1]
    return np.ascontiguousarray(pixels)


def turned_point(point: Sequence[float], shape: Sequence[int], orientation: int, back: bool = False) -> tuple:
    """Where a pixel (x, y) of a (height, width) picture comes to lie when that is `turned`."""
    x, y = point
    height, width = shape[:2]
    down, across = orientation in (3, 4, 7, 8), orientation in (2, 3, 6, 7)
    if orientation >= 5:
        x, y, height, width = y, x, width, height
        down, across = (across, down) if back else (down, across)
    return (width - 1 - x if across else x, height - 1 - y if down else y)


def _check_finite(pixels: NDArray, path: Path) -> None:
    if pixels.dtype.kind != "f":
        return
    count, first = 0, None
    for start in range(0, len(pixels), 256):
        sound = np.isfinite(pixels[start : start + 256]).all(axis=2)
        if not sound.all():
            y, x = np.argwhere(~sound)[0]
            first = first or (int(x), int(y) + start)
            count += int((~sound).sum())
    if first:
        raise ImageError(
            f"'{path}' contains NaN or infinite pixels ({count} of them, the first at {first[0]},{first[1]}): "
            "render or export it again without them."
        )


def _divide_by_alpha(pixels: NDArray) -> NDArray:
    """Straight codes from multiplied ones, rounded so that `_multiply_by_alpha` gives the same codes back."""
    top = np.iinfo(pixels.dtype).max
    out = pixels.copy()
    for start in range(0, len(pixels), 256):
        rows = pixels[start : start + 256].astype(np.uint64)
        alpha = rows[..., 3:]
        straight = (rows[..., :3] * top + alpha // 2) // np.maximum(alpha, 1)
        out[start : start + 256, :, :3] = np.minimum(straight, top)
    return out


def _multiply_by_alpha(pixels: NDArray) -> NDArray:
    top = np.iinfo(pixels.dtype).max
    out = pixels.copy()
    for start in range(0, len(pixels), 256):
        rows = pixels[start : start + 256].astype(np.uint64)
        out[start : start + 256, :, :3] = (rows[..., :3] * rows[..., 3:] + top // 2) // top
    return out


# --- color spaces -------------------------------------------------------------------------------------------


def _space(blocks: Blocks, spec: Any, kind: str, dtype: np.dtype, grey: bool) -> tuple[RGBSpace, bool, list[str]]:
    """Return the color space a file states, whether it does, and what was assumed."""
    code = blocks.color_chunk(b"cICP")
    if code is not None and len(code) >= 4:
        return _cicp(code[0], code[1], code[2], code[3]), True, []
    if kind == "exr" and (given := spec.getattribute("CICP")):
        return _cicp(given[0], given[1], given[2], 1), True, []
    if blocks.icc:
        if grey and icc.data_space(blocks.icc) == "GRAY":
            name = icc.description(blocks.icc)
            note = f"The grey profile '{name}' is left out: the grey values are taken as sRGB."
            return SRGB, False, [note]
        return icc.parse(blocks.icc), True, []
    if blocks.color_chunk(b"sRGB") is not None:
        return SRGB, True, []
    if blocks.color_chunk(b"gAMA") is not None or blocks.color_chunk(b"cHRM") is not None:
        return _png_gamma(blocks)
    if kind == "exr":
        return _exr_space(spec)
    _, subs = metadata.exif_tags(blocks.exif)
    stated = metadata.integer_tag(subs.get(metadata.EXIF_IFD, {}), 0xA001)
    index = metadata.ascii_tag(subs.get(metadata.INTEROP_IFD, {}), 1)
    if dtype.kind == "f":
        return LINEAR_SRGB, False, ["No color profile in the file: floats are taken as linear Rec.709."]
    if stated == 2 or (index == "R03" and stated != 1):
        return SPACES["adobe-rgb"], True, []
    if stated == 1:
        return SRGB, True, []
    return SRGB, False, ["No color profile in the file: taken as sRGB."]


# Code points of ITU-T H.273, tables 2 and 3.
_CICP_PRIMARIES = {1: "srgb", 9: "rec2020", 12: "display-p3"}
_CICP_CURVES: dict[int, transfer.Curve] = {
    1: transfer.REC_2020,
    4: transfer.ParametricCurve(2.2),
    5: transfer.ParametricCurve(2.8),
    6: transfer.REC_2020,
    8: transfer.LINEAR,
    13: transfer.SRGB,
    14: transfer.REC_2020,
    15: transfer.REC_2020,
}


def _cicp(primaries: int, curve: int, matrix: int, full_range: int) -> RGBSpace:
    if primaries not in _CICP_PRIMARIES or curve not in _CICP_CURVES or matrix != 0 or full_range != 1:
        kind = {16: "PQ (HDR)", 18: "HLG (HDR)"}.get(curve, f"CICP {primaries}/{curve}/{matrix}/{full_range}")
        raise FileError(f"The color is stated as {kind}, which is not supported: convert it, or {_REMEDY}.")
    return _known(SPACES[_CICP_PRIMARIES[primaries]].with_curve(_CICP_CURVES[curve], f"CICP {primaries}/{curve}"))


def _known(space: RGBSpace) -> RGBSpace:
    """Return the named space that `space` equals within rounding, or itself."""
    for named in SPACES.values():
        if icc.same_curve(named.curve, space.curve) and np.abs(named.to_xyz - space.to_xyz).max() < 2e-3:
            return named
    return space


def _from_xy(name: str, xy: list[float], curve: transfer.Curve) -> RGBSpace:
    """Make a space of the xy of red, green, blue and white."""
    points = np.reshape(np.array(xy, np.float64), (4, 2))
    try:
        with np.errstate(all="ignore"):
            to_xyz = normalized_primary_matrix(points[:3], points[3])
        if not np.isfinite(to_xyz).all() or np.linalg.cond(to_xyz) > 1e4 or points[3].min() < 0.05:
            raise np.linalg.LinAlgError
    except np.linalg.LinAlgError:
        raise FileError(f"The chromaticities in the file are not those of three primaries: {_REMEDY}.") from None
    return _known(RGBSpace(name, to_xyz, curve))


def _png_gamma(blocks: Blocks) -> tuple[RGBSpace, bool, list[str]]:
    """``gAMA`` and ``cHRM`` (W3C PNG, third edition, 11.3.2.1 and 11.3.2.2)."""
    curve: transfer.Curve = transfer.SRGB
    notes = []
    gamma = blocks.color_chunk(b"gAMA")
    value = int.from_bytes(gamma[:4]) if gamma else 0
    if gamma is None:
        notes.append("No transfer curve in the PNG: taken as that of sRGB.")
    elif value == 100000:
        curve = transfer.LINEAR
    elif 45000 <= value <= 46000:
        notes.append("The gamma of 1/2.2 in the PNG is taken as the curve of sRGB.")
    elif 10000 <= value < 200000:
        curve = transfer.ParametricCurve(100000 / value)
    else:
        raise FileError(f"The gamma of {value / 100000} in the PNG makes no sense: {_REMEDY}.")
    chroma = blocks.color_chunk(b"cHRM")
    if chroma is None or len(chroma) != 32:
        notes.append("No primaries in the PNG: taken as those of sRGB.")
        return _known(SRGB.with_curve(curve, f"gamma {value / 100000:.4g}")), True, notes
    xy = [int.from_bytes(chroma[i : i + 4], signed=True) / 100000 for i in range(0, 32, 4)]
    return _from_xy("PNG chromaticities", xy[2:] + xy[:2], curve), True, notes


def _exr_space(spec: Any) -> tuple[RGBSpace, bool, list[str]]:
    """Attributes of OpenEXR ("Standard Attributes"): ``colorInteropID``, ``chromaticities``."""
    for attribute in ("colorInteropID", "oiio:ColorSpace"):
        name = spec.get_string_attribute(attribute).lower()
        if name in _INTEROP:
            return SPACES[_INTEROP[name]], True, []
    xy = spec.getattribute("chromaticities")
    if xy is not None:
        return _from_xy("EXR chromaticities", list(xy), transfer.LINEAR), True, []
    if spec.get_int_attribute("acesImageContainerFlag", 0) == 1:  # SMPTE ST 2065-4
        return SPACES["aces2065-1"], True, []
    stated = spec.get_string_attribute("colorInteropID")
    if stated and stated.lower() not in ("unknown", "data", "raw"):
        raise FileError(f"The color space '{stated}' of the EXR is not known: {_REMEDY}.")
    return LINEAR_SRGB, False, ["No color space in the EXR: taken as linear Rec.709."]


# --- RAW ----------------------------------------------------------------------------------------------------


def _read_raw(path: Path, color_space: str | None) -> Photo:
    """Develop a camera RAW file into linear 16-bit codes.

    The camera's white balance is applied by LibRaw before its color matrix, since the matrix is made for
    balanced camera RGB: without it, saturated colors would come out negative and be clipped. A white surface
    then has equal R, G and B, so that the camera's white is W = (1, 1, 1). Nothing is brightened or stretched:
    code 65535 is the white level of the sensor.
    """
    try:
        import rawpy
    except ImportError:
        raise FileError(
            f"'{path}' is a camera RAW file, which needs rawpy: install it with: pip install rawpy"
        ) from None
    name = color_space or "linear-srgb"
    primaries = {
        "linear-srgb": rawpy.ColorSpace.sRGB,
        "linear-p3": rawpy.ColorSpace.P3D65,
        "linear-rec2020": rawpy.ColorSpace.Rec2020,
    }
    name = name.strip().lower()
    if name not in primaries:
        known = ", ".join(primaries)
        raise FileError(f"'{path}' is a camera RAW file, which is developed into one of {known}: give one of these.")
    into = f"Developed from camera RAW into {SPACES[name].name}"
    notes = [f"{into}, with the white of the camera as shot."]
    try:
        with rawpy.imread(str(path)) as raw:
            balance = list(raw.camera_whitebalance)[:3]
            white: tuple[float, float, float] | None = (1.0, 1.0, 1.0)
            if not all(np.isfinite(balance)) or min(balance) <= 0:
                white = None
                notes = [f"Developed from camera RAW into {SPACES[name].name}; it holds no white: taken as daylight."]
            pixels = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,
                output_bps=16,
                use_camera_wb=white is not None,
                output_color=primaries[name],
            )
    except rawpy.LibRawError as error:
        reason = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else str(error)
        raise _damaged(path, reason) from None
    blocks = _extract(path)
    found = Blocks(exif=blocks.exif, xmp=blocks.xmp) if blocks.kind == "tiff" else Blocks()
    metadata.upright(found)
    return Photo(path, pixels, SPACES[name], False, white, tuple(notes), _Source("raw", found, None, True, False))


# --- masks --------------------------------------------------------------------------------------------------


def read_mask(path: str | Path, shape: tuple[int, ...], decoded: Decoded | None = None) -> NDArray:
    """Read a mask: how much of each pixel is the product.

    Parameters
    ----------
    path
        A picture whose grey value (the codes as they are, no transfer curve) is the coverage; if it has an
        alpha channel and its color is the same everywhere, alpha is.
    shape
        (height, width, ...) of the upright photo.
    decoded
        As for `read`.

    Returns
    -------
    (height, width) uint8, 0..255; or float32, 0..1, for files of more than 8 bits.

    Raises
    ------
    MaskError
        If it is of another size, or colored.
    FileError, ImageError
        As of `read`.
    """
    path = Path(path)
    _check_input(path)
    if path.suffix.lower() in RAW_EXTENSIONS:
        raise MaskError(f"The mask '{path}' is a camera RAW file: save the mask as PNG.")
    blocks = _extract(path)
    found = decoded or _decode(path, blocks)
    return coverage(turned(found.pixels, blocks.orientation), shape, f"The mask '{path}'")


def coverage(pixels: NDArray, shape: tuple[int, ...], name: str) -> NDArray:
    """Tell how much of each pixel is the product, from a mask's pixels.

    Parameters
    ----------
    pixels
        (height, width, 3 or 4) codes, or floats 0..1; see `read_mask`.
    shape
        (height, width, ...) of the photo.
    name
        What errors call the mask.

    Returns
    -------
    (height, width) uint8, 0..255; or float32, 0..1, for pixels of more than 8 bits.

    Raises
    ------
    MaskError
        If it is of another size, or colored.
    """
    height, width = shape[:2]
    if pixels.shape[:2] != (height, width):
        raise MaskError(
            f"{name} is {pixels.shape[1]} x {pixels.shape[0]} pixels and the photo {width} x {height}: "
            "make it the size of the photo."
        )
    color = pixels[..., :3]
    if pixels.shape[2] == 4 and (color == color[0, 0]).all():
        mask = pixels[..., 3]
    else:
        mask = color[..., 0]
        if not ((mask == color[..., 1]).all() and (mask == color[..., 2]).all()):
            raise MaskError(f"{name} is colored: save it as greyscale, white where the product is.")
    if mask.dtype == np.uint8:
        return np.ascontiguousarray(mask)
    if mask.dtype.kind == "u":
        return mask.astype(np.float32) / np.float32(np.iinfo(mask.dtype).max)
    return np.clip(mask.astype(np.float32), 0, 1)


# --- writing ------------------------------------------------------------------------------------------------


def check_output(path: str | Path, *, source: str | Path | None = None, force: bool = False) -> Path:
    """Check that a file can be written, before any work is done for it.

    Parameters
    ----------
    path
        The file to be.
    source
        A file that must not be overwritten, whatever name or link leads to it, even with `force`.
    force
        Allow another existing file to be overwritten.

    Raises
    ------
    FileError
        If the extension is not known, the folder does not exist or is not writable, or the file is there.
    """
    path = Path(path)
    if path.suffix.lower() in RAW_EXTENSIONS:
        raise FileError(f"'{path}' is the name of a camera RAW file, which cannot be written: use .tif or .png.")
    if path.suffix.lower() not in OUTPUT_KINDS:
        raise FileError(f"'{path}' does not end in a known extension: use one of {', '.join(OUTPUT_KINDS)}.")
    try:
        path.exists()
    except OSError as error:
        raise FileError(f"'{path.name[:40]}...' cannot be a file ({error.strerror}): choose another name.") from None
    if path.is_dir():
        raise FileError(f"'{path}' is a folder: give the name of a file.")
    folder = path.parent
    if not folder.is_dir():
        raise FileError(f"The folder '{folder}' does not exist: create it first.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FileError(f"The folder '{folder}' is not writable: choose another one.")
    if source is not None and path.exists() and Path(source).exists() and path.samefile(source):
        raise FileError(f"'{path}' is the source itself, which is never overwritten: choose another name.")
    if not force and (path.exists() or path.is_symlink()):
        raise FileError(f"'{path}' exists already: choose another name or give --force.")
    return path


def _kind(path: str | Path) -> str:
    try:
        return OUTPUT_KINDS[Path(path).suffix.lower()]
    except KeyError:
        known = ", ".join(OUTPUT_KINDS)
        raise FileError(f"'{path}' does not end in a known extension: use one of {known}.") from None


def output_dtype(path: str | Path, photo: Photo) -> np.dtype:
    """Return the dtype of the pixels to make for an output file: the photo's own, where the format holds it."""
    kind, dtype = _kind(path), photo.pixels.dtype
    if kind in ("jpeg", "webp"):
        return np.dtype(np.uint8)
    if kind == "png":
        return dtype if dtype.kind == "u" else np.dtype(np.uint16)
    if kind == "exr" and dtype.kind == "u":
        # Half floats hold 8-bit codes with room to spare, but not 16-bit ones.
        return np.dtype(np.float16 if dtype == np.uint8 else np.float32)
    return dtype


def output_space(path: str | Path, photo: Photo) -> RGBSpace:
    """Return the color space of the pixels to make for an output file.

    The primaries are the photo's own, or those of the space that is wanted. Floats made from integers are linear;
    integers made from linear floats or from RAW get a curve, as codes spread evenly over the light would show steps in
    the dark.
    """
    before, after = photo.pixels.dtype, output_dtype(path, photo)
    space = photo.space if photo.wanted is None else photo.wanted
    name = next((name for name, named in SPACES.items() if named is space), "")
    if after.kind == "f":
        if (before.kind == "f" and photo.wanted is None) or space.curve == transfer.LINEAR:
            return space
        linear = {encoded: linear for linear, encoded in _ENCODED.items()}.get(name)
        return SPACES[linear] if linear else space.with_curve(transfer.LINEAR, f"Linear {space.name}")
    wanted = photo.wanted is not None
    if space.curve == transfer.LINEAR and (before != after or wanted or _source(photo).kind == "raw"):
        encoded = _ENCODED.get(name)
        return SPACES[encoded] if encoded else space.with_curve(transfer.SRGB, f"{space.name}, sRGB curve")
    return space


def output_premultiplied(path: str | Path, photo: Photo) -> bool:
    """Tell whether RGB of the pixels to make for an output file is to be multiplied by alpha."""
    if _kind(path) == "exr":
        return True
    return output_dtype(path, photo).kind == "f" and photo.premultiplied


def _source(photo: Photo) -> _Source:
    return photo.metadata if isinstance(photo.metadata, _Source) else _Source("", Blocks())


def write(
    path: str | Path,
    pixels: NDArray,
    photo: Photo,
    *,
    force: bool = False,
    quality: int = 95,
    compression: str | None = None,
    rows: Iterable[int] | None = None,
    encode: Callable[[Path, NDArray, bool], None] | None = None,
) -> Path:
    """Write a picture with everything its source says besides the pixels.

    The file appears under its name only when it is complete. Codes are in `output_space`; alpha is straight
    unless `output_premultiplied`.

    Parameters
    ----------
    path
        The file; its extension decides on the format.
    pixels
        (height, width, 3 or 4), best of `output_dtype`. Integers and floats in 0..1 are converted to what
        the format holds, rounded to nearest; integers for EXR are decoded by `photo.space`.
    photo
        The source, from `read`.
    force
        Overwrite a file that is there.
    quality
        1 to 100, of JPEG and lossy WebP. A WebP made from a lossless WebP is lossless.
    compression
        Of TIFF or EXR, by OpenImageIO's name, such as ``zip``; None keeps the source's, or is lzw or zip.
    rows
        If `pixels` are still being made: how many rows from the top are done, growing to the height. They are
        encoded as they come.
    encode
        Another encoder than OpenImageIO, called with the file, its pixels and whether RGB is multiplied by alpha.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    FileError
        If it cannot be written; then nothing is left behind and no file has changed.
    """
    path = check_output(path, source=photo.path, force=force)
    kind = _kind(path)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or not pixels.size:
        raise ImageError(f"'{path}' needs pixels of 3 or 4 channels and not an array of shape {pixels.shape}.")
    height, width = pixels.shape[:2]
    if max(height, width) > _LARGEST.get(kind, 1 << 30):
        raise FileError(
            f"'{path}' would be {width} x {height} pixels, too large for a {kind.upper()}: write a PNG or TIFF."
        )
    if rows is not None and not _fits(pixels, kind, path, photo):
        collections.deque(rows, maxlen=0)
        rows = None
    pixels = _fit(pixels, kind, path, photo)
    spec = None if encode else _output_spec(pixels, kind, path, photo, quality, compression)
    blocks = _output_blocks(kind, path, photo)
    # The name is short and plain, so that it is possible wherever the file's own is.
    temporary = path.with_name(f".dyehouse-{secrets.token_hex(6)}{path.suffix}")
    try:
        if encode is not None:
            integers = kind == "tiff" and pixels.dtype.kind == "u"
            encode(temporary, pixels, _source(photo).associated if integers else output_premultiplied(path, photo))
        else:
            _encode(temporary, spec, pixels, rows)
        metadata.embed(temporary, blocks, kind, (width, height))
        if not force and path.exists():
            raise FileError(f"'{path}' exists already: choose another name or give --force.")
        temporary.replace(path)
    except OSError as error:
        raise FileError(f"'{path}' could not be written ({error.strerror}): check the disk and folder.") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path


def _fits(pixels: NDArray, kind: str, path: Path, photo: Photo) -> bool:
    """Tell whether `_fit` would leave the pixels as they are."""
    straight_alpha = pixels.shape[2] == 4 and kind in ("jpeg", "tiff")
    return pixels.dtype == output_dtype(path, photo) and pixels.flags.c_contiguous and not straight_alpha


def _fit(pixels: NDArray, kind: str, path: Path, photo: Photo) -> NDArray:
    """Bring pixels to a type the format holds, contiguous."""
    if kind == "jpeg" and pixels.shape[2] == 4:
        top = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1
        if (pixels[..., 3] < top).any():
            raise FileError(f"'{path}' cannot hold transparency as a JPEG: write a PNG, WebP or TIFF.")
        pixels = pixels[..., :3]
    given = pixels.dtype
    if given not in (np.uint8, np.uint16, np.float16, np.float32):
        raise ImageError(f"'{path}' cannot be written from {given} pixels: use uint8, uint16, float16 or float32.")
    if kind in ("jpeg", "webp"):
        pixels = _convert(pixels, np.uint8)
    elif kind == "png" and given.kind == "f":
        pixels = _convert(pixels, output_dtype(path, photo))
    elif kind == "exr" and given.kind == "u":
        dtype = output_dtype(path, photo)
        linear = transfer.decode(pixels[..., :3], photo.space.curve)
        if pixels.shape[2] == 4:
            alpha = pixels[..., 3:] / np.float32(np.iinfo(given).max)
            linear = np.concatenate([linear * alpha, alpha], axis=2)
        pixels = linear.astype(dtype if dtype.kind == "f" else np.float32)
    elif kind == "tiff" and given.kind == "u" and pixels.shape[2] == 4 and _source(photo).associated:
        pixels = _multiply_by_alpha(pixels)
    return np.ascontiguousarray(pixels)


def _convert(pixels: NDArray, dtype: DTypeLike) -> NDArray:
    """Bring codes to an integer type, rounded to nearest, in strips to save memory."""
    dtype = np.dtype(dtype)
    if pixels.dtype == dtype:
        return pixels
    top = np.iinfo(dtype).max
    scale = top / np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else top
    out = np.empty(pixels.shape, dtype)
    for start in range(0, len(pixels), 256):
        rows = pixels[start : start + 256].astype(np.float32)
        out[start : start + 256] = np.floor(np.clip(rows * np.float32(scale), 0, top) + np.float32(0.5))
    return out


_COMPRESSIONS = {
    "tiff": ("none", "lzw", "zip", "packbits", "zstd", "lzma"),
    "exr": ("none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"),
}


def check_compression(path: str | Path, compression: str) -> None:
    """Check that `write` can compress a file of this name so.

    Raises
    ------
    FileError
        If it cannot.
    """
    kind = _kind(path)
    allowed = _COMPRESSIONS.get(kind)
    if allowed is None:
        raise FileError(f"'{path}' takes no compression: leave the option out, or write a TIFF or EXR.")
    if compression.split(":")[0] not in allowed:
        raise FileError(f"The compression '{compression}' is not known for {kind}: use {', '.join(allowed)}.")


def _output_spec(pixels: NDArray, kind: str, path: Path, photo: Photo, quality: int, compression: str | None) -> Any:
    import OpenImageIO

    source = _source(photo)
    height, width, channels = pixels.shape
    sample = {"float16": "half", "float32": "float"}.get(pixels.dtype.name, pixels.dtype.name)
    spec = OpenImageIO.ImageSpec(width, height, channels, sample)
    if not 1 <= quality <= 100:
        raise FileError(f"The quality {quality} is out of range: give a number from 1 to 100.")
    own = source.spec.get_string_attribute("compression") if source.spec and source.kind == kind else ""
    if compression is not None:
        check_compression(path, compression)
    if kind in _COMPRESSIONS:
        # For 8 bits, LZW packs nearly as well as zip in a quarter of the time.
        usual = "lzw" if kind == "tiff" and pixels.dtype == np.uint8 else "zip"
        spec.attribute("Compression", compression or (own if own in _COMPRESSIONS[kind] else usual))

    straight = channels == 4 and not output_premultiplied(path, photo)
    if kind == "tiff" and pixels.dtype.kind == "u" and source.associated:
        straight = False
    if straight:
        spec.attribute("oiio:UnassociatedAlpha", 1)
    if kind == "jpeg":
        spec.attribute("Compression", f"jpeg:{quality}")
        spec.attribute("jpeg:subsampling", "4:4:4")  # halved chroma would blur colored edges
    elif kind == "webp":
        spec.attribute("Compression", "lossless" if source.blocks.lossless else f"webp:{quality}")
        spec.attribute("webp:method", 2)
    elif kind == "png":
        spec.attribute("png:compressionLevel", 2)  # a third of the time of the usual 6, for 5% more bytes
    elif kind == "tiff":
        spec.attribute("tiff:write_exif", 0)
        spec.attribute("tiff:half", 1)
    else:
        _exr_attributes(spec, path, photo)
    return spec


# Attributes of OpenImageIO that tell about the encoding of the file that was read.
_ENCODING = ("oiio:", "png:", "jpeg:", "tiff:", "webp:", "openexr:", "ICCProfile")
_ENCODING_NAMES = {
    "compression", "planarconfig", "PixelAspectRatio", "Orientation", "CICP", "textureformat", "name",
    "chromaticities", "colorInteropID", "acesImageContainerFlag", "XResolution", "YResolution", "ResolutionUnit",
}  # fmt: skip


def _exr_attributes(spec: Any, path: Path, photo: Photo) -> None:
    source = _source(photo)
    space = output_space(path, photo)
    if source.spec is not None:
        before = source.spec
        for item in before.extra_attribs:
            if not item.name.startswith(_ENCODING) and item.name not in _ENCODING_NAMES:
                spec.attribute(item.name, item.type, item.value)
        if source.kind == "exr":
            pixel_aspect = before.get_float_attribute("PixelAspectRatio", 1.0)
            spec.attribute("PixelAspectRatio", pixel_aspect)
            if (before.width, before.height) == (spec.width, spec.height):
                for side in ("x", "y", "full_x", "full_y", "full_width", "full_height"):
                    setattr(spec, side, getattr(before, side))
            if space is photo.space and not source.overridden:
                for name in ("chromaticities", "colorInteropID", "acesImageContainerFlag"):
                    for item in before.extra_attribs:
                        if item.name == name:
                            spec.attribute(item.name, item.type, item.value)
                return
    density = source.blocks.density
    if density and density[2] != 1:
        spec.attribute("XResolution", float(density[0]))
        spec.attribute("YResolution", float(density[1]))
        spec.attribute("ResolutionUnit", "cm" if density[2] == 3 else "in")
    if space.curve == transfer.LINEAR:
        spec.attribute("chromaticities", "float[8]", space.chromaticities)


def _output_blocks(kind: str, path: Path, photo: Photo) -> Blocks:
    """Return the metadata to embed, with the color space of the output."""
    source, space = _source(photo), output_space(path, photo)
    blocks = replace(source.blocks)
    if kind != source.kind:
        blocks.texts, blocks.comments = (), () if kind == "webp" else blocks.comments
    same = space is photo.space and not source.overridden
    if same and kind == source.kind == "png":
        pass
    elif same and not (source.tagged and (blocks.color_chunks or not blocks.icc)):
        blocks.color_chunks = ()
    else:
        had = bool(source.blocks.icc)
        blocks.color_chunks, blocks.icc = (), b""
        if space is not SRGB or had or photo.space is not SRGB:
            blocks.icc = icc.write_profile(space)
    return blocks


def _encode(path: Path, spec: Any, pixels: NDArray, rows: Iterable[int] | None) -> None:
    if path.suffix.lower() in (".jpg", ".jpeg", ".webp"):
        _encode_in_memory(path, spec, pixels, rows)
    else:
        _write_image(path, str(path), spec, pixels, rows)


def _encode_in_memory(path: Path, spec: Any, pixels: NDArray, rows: Iterable[int] | None) -> None:
    """Encode where room does not end, and store the result.

    When a disk is full, libjpeg ends the whole process and OpenImageIO's WebP writer repeats itself forever, so
    neither may write to one. Where there are no files in memory, more room is asked for than they can need.
    """
    most = pixels.nbytes * 3 // 2 + (1 << 20)
    if os.name == "posix":
        import resource

        limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]  # holds for files in memory as well
        if limit != resource.RLIM_INFINITY and limit < most:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
    if not hasattr(os, "memfd_create"):
        if shutil.disk_usage(path.parent).free < most:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        _write_image(path, str(path), spec, pixels, rows)
        return
    memory = os.memfd_create("dyehouse")
    try:
        _write_image(path, f"/proc/self/fd/{memory}", spec, pixels, rows)
        os.lseek(memory, 0, os.SEEK_SET)
        with path.open("wb") as file:
            while part := os.read(memory, 1 << 20):
                file.write(part)
    finally:
        os.close(memory)


def _write_image(path: Path, target: str, spec: Any, pixels: NDArray, rows: Iterable[int] | None) -> None:
    import OpenImageIO

    output = OpenImageIO.ImageOutput.create(str(path))
    if output is None:
        raise FileError(f"'{path.name}' cannot be encoded ({OpenImageIO.geterror()}): use another extension.")
    done = output.open(target, spec)
    try:
        if rows is None:
            done = done and output.write_image(pixels)
        else:
            top = 0
            for bottom in rows:
                if done and bottom > top:
                    done, top = output.write_scanlines(top, bottom, 0, pixels[top:bottom]), bottom
        reason = output.geterror()
    finally:
        closed = output.close()
    reason = reason or output.geterror()
    if not (done and closed) or reason:
        first = reason.replace(str(path), "the file").strip().split("\n")[0].rstrip(" .")
        full = shutil.disk_usage(path.parent).free < 1 << 16
        raise OSError(0, "No space left on device" if full else first or "the encoder gave no reason")


def write_map(path: str | Path, array: NDArray, *, force: bool = False, scale: float = 1.0) -> Path:
    """Write a map of numbers for looking at: EXR as it is, PNG as a preview.

    Parameters
    ----------
    path
        ``.exr`` (float32, unchanged) or ``.png`` (8 bits: 0 is black, `scale` white, clipped).
    array
        (height, width) or (height, width, 3) of floats.
    force
        Overwrite a file that is there.
    scale
        The value that is white in a PNG.

    Raises
    ------
    FileError
        If the extension is another, or the file cannot be written.
    """
    path = check_output(path, force=force)
    kind = _kind(path)
    if kind not in ("exr", "png"):
        raise FileError(f"The map '{path}' must be an EXR or a PNG: change its extension.")
    values = np.asarray(array, np.float32)
    if values.ndim == 2:
        values = np.repeat(values[..., None], 3, axis=2)
    if kind == "png":
        values = _convert(np.nan_to_num(values / np.float32(scale)), np.uint8)
    space = SRGB if kind == "png" else LINEAR_SRGB
    photo = Photo(Path(), values, space, metadata=_Source("", Blocks(), None, tagged=False))
    try:
        return write(path, values, photo, force=force)
    except DyehouseError as error:
        raise FileError(str(error)) from None
