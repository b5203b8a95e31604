"""What a picture file says besides its pixels, carried from file to file as the bytes it is.

OpenImageIO re-encodes metadata from its own attributes: maker notes, IPTC titles and unknown XMP are lost or
replaced in JPEG and PNG, all EXIF and XMP in WebP, EXIF in TIFF. So the blocks are read here, and put into
the finished file after its pixels were encoded. Only what would be untrue of the new picture changes: the
orientation becomes 1, and embedded thumbnails, which show the old color, go.

Sources: JPEG (ITU-T T.81, B.1.1.3), PNG (W3C PNG, third edition, 5 and 11.3), WebP (RFC 9649, 2.5 and 2.7),
TIFF 6.0 (section 2), EXIF (CIPA DC-008, 4.6), XMP (ISO 16684-1; part 3 for where it is stored).
"""

from __future__ import annotations

import io
import re
import struct
import zlib
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import BinaryIO

from ..core.errors import FileError

type Tags = dict[int, tuple[int, int, bytes]]
"""TIFF tag to its type, count and little-endian value."""

_DAMAGE = (struct.error, IndexError, OverflowError, ValueError, zlib.error)
_ICC = b"ICC_PROFILE\0"
_EXIF = b"Exif\0\0"
_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_XMP_MORE = b"http://ns.adobe.com/xmp/extension/\0"
_PHOTOSHOP = b"Photoshop 3.0\0"
_PNG = b"\x89PNG\r\n\x1a\n"
_XMP_KEYWORD = b"XML:com.adobe.xmp"

EXIF_IFD, GPS_IFD, INTEROP_IFD = 0x8769, 0x8825, 0xA005
_MAKER_NOTE = 0x927C
_TIFF_XMP, _TIFF_IPTC, _TIFF_PHOTOSHOP, _TIFF_ICC, _TIFF_LAYERS = 700, 33723, 34377, 34675, 37724
_RESOLUTION = (282, 283, 296)
# Tags of a TIFF's first directory that describe the pixels as they were stored, or other pictures beside it.
_STRUCTURE = {
    *(
        *range(254, 267),
        273,
        *range(277, 282),
        284,
        *range(288, 294),
        301,
        *range(317, 348),
        *range(512, 533),
    ),
    *(EXIF_IFD, GPS_IFD, _TIFF_XMP, _TIFF_IPTC, _TIFF_PHOTOSHOP, _TIFF_ICC, _TIFF_LAYERS),
    *(32995, 32996, 32997, 32998, 33421, 33422, 37398, 40965, *range(50706, 52600)),
}
# Photoshop resources: thumbnails, and what has a place of its own here (IPTC, ICC, EXIF, XMP).
_NOT_KEPT = {0x0409, 0x040C, 0x0404, 0x040F, 0x0422, 0x0423, 0x0424}


@dataclass
class Blocks:
    """The metadata of one file.

    Attributes
    ----------
    kind
        ``jpeg``, ``png``, ``webp`` or ``tiff``: what the file is by its first bytes; else an empty string.
    exif
        A TIFF stream (EXIF 4.5.2), without the ``Exif`` prefix of JPEG. For a TIFF, made of its own tags.
    xmp, xmp_more
        The XMP packet, and the segments of Extended XMP of a JPEG.
    iptc, photoshop
        The IPTC-IIM records, and the other Photoshop image resources.
    icc
        The ICC profile.
    density
        Pixels per unit across and down, and the unit by its TIFF number: 1 none, 2 inch, 3 centimeter.
    texts, color_chunks
        PNG chunks as (name, body): the texts, and those that tell the color space.
    comments
        Comments of a JPEG.
    orientation
        1 to 8 (EXIF 4.6.5.1.6), of the pixels as stored; `upright` makes it 1.
    components
        Components of a JPEG: 4 is CMYK.
    lossless
        Whether a WebP is.
    pages
        Pages of a TIFF, or more than 1 for an animation.
    associated
        Whether the colors of a TIFF are multiplied by its alpha (TIFF 6.0, ExtraSamples).
    """

    kind: str = ""
    exif: bytes = b""
    xmp: bytes = b""
    xmp_more: tuple[bytes, ...] = ()
    iptc: bytes = b""
    photoshop: bytes = b""
    icc: bytes = b""
    density: tuple[float, float, int] | None = None
    texts: tuple[tuple[bytes, bytes], ...] = ()
    color_chunks: tuple[tuple[bytes, bytes], ...] = ()
    comments: tuple[bytes, ...] = ()
    orientation: int = 1
    components: int = 0
    lossless: bool = False
    pages: int = 1
    associated: bool = False

    def color_chunk(self, name: bytes) -> bytes | None:
        """Return the body of the PNG chunk of that name, if there is one."""
        return dict(self.color_chunks).get(name)


def extract(path: Path) -> Blocks:
    """Read the metadata of a JPEG, PNG, WebP or TIFF; of any other file there is none.

    A block that is damaged is left out; whether the picture itself is sound is for its decoder to say.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(16)
        file.seek(0)
        blocks = Blocks()
        try:
            if head[:3] == b"\xff\xd8\xff":
                blocks.kind = "jpeg"
                _extract_jpeg(file, blocks)
            elif head[:8] == _PNG:
                blocks.kind = "png"
                _extract_png(file, blocks)
            elif head[:4] == b"RIFF" and head[8:12] == b"WEBP":
                blocks.kind = "webp"
                _extract_webp(file, blocks)
            elif head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
                blocks.kind = "tiff"
                _extract_tiff(file, blocks)
        except _DAMAGE:
            pass
    if blocks.density and not all(0 < side < 1e6 for side in blocks.density[:2]):
        blocks.density = None
    if blocks.exif and blocks.kind != "tiff":
        tags = exif_tags(blocks.exif)[0]
        blocks.orientation = _number(tags, 0x0112, 1)
    if not 1 <= blocks.orientation <= 8:
        blocks.orientation = 1
    return blocks


def exif_tags(exif: bytes) -> tuple[Tags, dict[int, Tags]]:
    """Return the tags of a TIFF stream: of its first directory, and of those it points to."""
    try:
        return _read_tree(io.BytesIO(exif))[:2]
    except _DAMAGE:
        return {}, {}


def _number(tags: Tags, tag: int, default: int) -> int:
    """Return the first integer of a tag."""
    kind, _, value = tags.get(tag, (0, 0, b""))
    size = {1: 1, 3: 2, 4: 4}.get(kind, 0)
    return int.from_bytes(value[:size], "little") if size else default


def ascii_tag(tags: Tags, tag: int) -> str:
    """Return the text of a tag, or an empty string."""
    return tags.get(tag, (0, 0, b""))[2].split(b"\0")[0].decode("latin-1").strip()


def integer_tag(tags: Tags, tag: int) -> int | None:
    """Return the first integer of a tag, or None."""
    value = _number(tags, tag, -1)
    return None if value < 0 else value


def upright(blocks: Blocks) -> None:
    """Make the blocks true of the upright picture, in place: orientation 1, no thumbnail, sides exchanged."""
    blocks.exif = _upright_exif(blocks.exif, blocks.orientation)
    blocks.xmp = re.sub(rb"(tiff:Orientation\s*(?:=\s*[\"']|>\s*))[2-8]", rb"\g<1>1", blocks.xmp)
    if blocks.density and blocks.orientation >= 5:
        x, y, unit = blocks.density
        blocks.density = (y, x, unit)
    blocks.orientation = 1


def _upright_exif(exif: bytes, orientation: int) -> bytes:
    """Patch EXIF where it stands, because maker notes hold offsets that a new layout would break."""
    data = bytearray(exif)
    try:
        order = {b"II": "<", b"MM": ">"}[bytes(data[:2])]
        start = struct.unpack_from(order + "I", data, 4)[0]
        places, after = _places(data, order, start)
        if 0x0112 in places:
            struct.pack_into(order + "HIHH", data, places[0x0112] + 2, 3, 1, 1, 0)
        if orientation >= 5 and EXIF_IFD in places:
            sub = struct.unpack_from(order + "I", data, places[EXIF_IFD] + 8)[0]
            inner, _ = _places(data, order, sub)
            if 0xA002 in inner and 0xA003 in inner:  # PixelXDimension and PixelYDimension
                x, y = inner[0xA002], inner[0xA003]
                # Type, count and value together, since the two may have different types.
                data[x + 2 : x + 12], data[y + 2 : y + 12] = data[y + 2 : y + 12], data[x + 2 : x + 12]
        second = struct.unpack_from(order + "I", data, after)[0]
        struct.pack_into(order + "I", data, after, 0)
        if second:
            thumb, _ = _places(data, order, second)
            if 0x0201 in thumb and 0x0202 in thumb:
                offset = struct.unpack_from(order + "I", data, thumb[0x0201] + 8)[0]
                length = struct.unpack_from(order + "I", data, thumb[0x0202] + 8)[0]
                if offset + length >= len(data) > offset > 8:
                    del data[offset:]
                elif offset + length < len(data):
                    data[offset : offset + length] = bytes(length)
    except (*_DAMAGE, KeyError):
        pass  # what follows the damage stays as it is
    return bytes(data)


def _places(data: bytearray, order: str, start: int) -> tuple[dict[int, int], int]:
    """Return where the entries of a directory stand, and where its link to the next directory stands."""
    count = struct.unpack_from(order + "H", data, start)[0]
    places: dict[int, int] = {}
    for i in range(count):
        place = start + 2 + 12 * i
        places.setdefault(struct.unpack_from(order + "H", data, place)[0], place)
    return places, start + 2 + 12 * count


# --- TIFF directories ---------------------------------------------------------------------------------------

_SIZES = {
    1: 1,
    2: 1,
    3: 2,
    4: 4,
    5: 8,
    6: 1,
    7: 1,
    8: 2,
    9: 4,
    10: 8,
    11: 4,
    12: 8,
    13: 4,
    16: 8,
    17: 8,
    18: 8,
}
_WORDS = {5: 4, 10: 4}  # what is swapped in a rational is its two halves
_MOST = 1 << 28  # no tag worth keeping is larger than this


def _read_header(file: BinaryIO) -> tuple[str, bool, int]:
    file.seek(0)
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2])
    if order is None:
        raise struct.error
    magic = struct.unpack_from(order + "H", head, 2)[0]
    if magic == 42:
        return order, False, struct.unpack_from(order + "I", head, 4)[0]
    if magic == 43:
        return order, True, struct.unpack_from(order + "Q", head, 8)[0]
    raise struct.error


def _read_directory(file: BinaryIO, order: str, big: bool, start: int) -> tuple[Tags, int]:
    """Return the tags of the directory at `start`, and where the next one is (0: there is none)."""
    entry = order + ("HHQ8s" if big else "HHI4s")
    step, room, link = (20, 8, order + "Q") if big else (12, 4, order + "I")
    file.seek(start)
    count = struct.unpack(order + ("Q" if big else "H"), file.read(8 if big else 2))[0]
    if count > 65535:
        raise struct.error
    table = file.read(step * count + room)
    tags: Tags = {}
    for i in range(count):
        tag, kind, number, value = struct.unpack_from(entry, table, step * i)
        size = _SIZES.get(kind, 0) * number
        if not size or size > _MOST:
            continue
        if size > room:
            file.seek(struct.unpack(link, value)[0])
            value = file.read(size)
            if len(value) != size:
                continue
        value = value[:size]
        word = _WORDS.get(kind, _SIZES[kind])
        # IPTC is bytes whatever its type says, as the writers of such files agree.
        if order == ">" and word > 1 and tag != _TIFF_IPTC:
            value = b"".join(value[j : j + word][::-1] for j in range(0, size, word))
        tags.setdefault(tag, (kind, number, value))
    return tags, struct.unpack_from(link, table, step * count)[0]


def _read_tree(file: BinaryIO) -> tuple[Tags, dict[int, Tags], int]:
    """Return the first directory of a TIFF stream, the EXIF, GPS and interoperability ones, and the pages."""
    order, big, start = _read_header(file)
    main, following = _read_directory(file, order, big, start)
    subs: dict[int, Tags] = {}
    for tag, parent in ((EXIF_IFD, main), (GPS_IFD, main), (INTEROP_IFD, None)):
        kind, _, value = (subs.get(EXIF_IFD, {}) if parent is None else parent).get(tag, (0, 0, b""))
        if kind in (4, 13, 16, 18):
            try:
                subs[tag] = _read_directory(file, order, big, int.from_bytes(value, "little"))[0]
            except _DAMAGE:
                continue
    pages, seen = 1, {start}
    while following and following not in seen and len(seen) < 1000:
        seen.add(following)
        try:
            tags, following = _read_directory(file, order, big, following)
        except _DAMAGE:
            break
        # Bit 0 of NewSubfileType marks a smaller copy of another picture, which is no page.
        pages += not _number(tags, 254, 0) & 1
    return main, subs, pages


def _pack_directory(tags: Tags, base: int, big: bool) -> bytes:
    """Lay a directory out, with its values after it, to stand at `base` (even)."""
    room, step, link = (8, 20, "<Q") if big else (4, 12, "<I")
    if not big:
        tags = {tag: entry for tag, entry in tags.items() if entry[0] < 16}
    table, values = b"", b""
    values_at = base + (8 if big else 2) + step * len(tags) + room
    for tag, (kind, number, value) in sorted(tags.items()):
        if len(value) <= room:
            field = value.ljust(room, b"\0")
        else:
            field = struct.pack(link, values_at + len(values))
            values += value + bytes(len(value) % 2)
        table += struct.pack("<HHQ" if big else "<HHI", tag, kind, number) + field
    return struct.pack("<Q" if big else "<H", len(tags)) + table + bytes(room) + values


def _pack_tree(main: Tags, subs: dict[int, Tags], base: int, big: bool = False) -> tuple[bytes, int]:
    """Lay directories out from `base` on; return the bytes and where the first directory stands."""
    pack, kind = ("<Q", 18) if big else ("<I", 13)
    kind = kind if big else 4
    main = {tag: entry for tag, entry in main.items() if tag not in (EXIF_IFD, GPS_IFD)}
    exif = {tag: entry for tag, entry in subs.get(EXIF_IFD, {}).items() if tag != INTEROP_IFD}
    data = b""
    for tag, tags, parent in (
        (INTEROP_IFD, subs.get(INTEROP_IFD, {}), exif),
        (EXIF_IFD, exif, main),
        (GPS_IFD, subs.get(GPS_IFD, {}), main),
    ):
        if tags:
            parent[tag] = (kind, 1, struct.pack(pack, base + len(data)))
            data += _pack_directory(tags, base + len(data), big)
            data += bytes(len(data) % 2)
    start = base + len(data)
    return data + _pack_directory(main, start, big), start


def _exif_stream(main: Tags, subs: dict[int, Tags]) -> bytes:
    if not main and not subs:
        return b""
    body, start = _pack_tree(main, subs, 8)
    return b"II*\0" + struct.pack("<I", start) + body


def _extract_tiff(file: BinaryIO, blocks: Blocks) -> None:
    main, subs, blocks.pages = _read_tree(file)
    blocks.orientation = _number(main, 0x0112, 1)
    blocks.associated = _number(main, 338, 0) == 1
    blocks.icc = main.get(_TIFF_ICC, (0, 0, b""))[2]
    blocks.xmp = main.get(_TIFF_XMP, (0, 0, b""))[2]
    blocks.iptc = main.get(_TIFF_IPTC, (0, 0, b""))[2]
    _split_photoshop(main.get(_TIFF_PHOTOSHOP, (0, 0, b""))[2], blocks)
    blocks.density = _density(main)
    kept = {tag: entry for tag, entry in main.items() if tag not in _STRUCTURE and tag not in _RESOLUTION}
    if blocks.orientation >= 5 and EXIF_IFD in subs:
        sizes = subs[EXIF_IFD]
        if 0xA002 in sizes and 0xA003 in sizes:
            sizes[0xA002], sizes[0xA003] = sizes[0xA003], sizes[0xA002]
    kept.pop(0x0112, None)
    blocks.exif = _exif_stream(kept, subs)


def _density(tags: Tags) -> tuple[float, float, int] | None:
    sides = []
    for tag in _RESOLUTION[:2]:
        kind, _, value = tags.get(tag, (0, 0, b""))
        if kind != 5 or len(value) < 8:
            return None
        top, bottom = struct.unpack("<II", value[:8])
        sides.append(top / bottom if bottom else 0.0)
    return (*sides, _number(tags, 296, 2)) if all(sides) else None  # type: ignore[return-value]


# --- Photoshop resources ------------------------------------------------------------------------------------


def _split_photoshop(data: bytes, blocks: Blocks) -> None:
    """Keep the image resources (Adobe Photoshop File Formats, Image Resource Blocks) that stay true."""
    kept, place = b"", 0
    while data[place : place + 4] == b"8BIM":
        number = struct.unpack_from(">H", data, place + 4)[0]
        name = data[place + 6] + 1
        at = place + 6 + name + name % 2
        size = struct.unpack_from(">I", data, at)[0]
        end = at + 4 + size + size % 2
        if number == 0x0404 and not blocks.iptc:
            blocks.iptc = data[at + 4 : at + 4 + size]
        if number not in _NOT_KEPT and len(data) >= at + 4 + size:
            kept += data[place:end].ljust(end - place, b"\0")
        place = end
    blocks.photoshop += kept


def _photoshop(blocks: Blocks) -> bytes:
    if not blocks.iptc:
        return blocks.photoshop
    head = b"8BIM\x04\x04\0\0" + struct.pack(">I", len(blocks.iptc))
    return head + blocks.iptc + bytes(len(blocks.iptc) % 2) + blocks.photoshop


# --- JPEG ---------------------------------------------------------------------------------------------------


def _segments(file: BinaryIO) -> list[tuple[int, bytes, int]]:
    """Return the segments before the scan, as (marker, body, where it starts)."""
    found = []
    file.seek(2)
    while True:
        place = file.tell()
        mark = file.read(2)
        while mark == b"\xff\xff":  # fill bytes (B.1.1.2)
            file.seek(-1, 1)
            mark = file.read(2)
        if len(mark) < 2 or mark[0] != 0xFF or mark[1] in (0xD9, 0xDA):
            found.append((mark[1] if len(mark) == 2 else 0, b"", place))
            return found
        size = struct.unpack(">H", file.read(2))[0]
        found.append((mark[1], file.read(size - 2), place))


def _extract_jpeg(file: BinaryIO, blocks: Blocks) -> None:
    icc: dict[int, bytes] = {}
    photoshop = b""
    for marker, body, _ in _segments(file):
        if marker == 0xE0 and body[:5] == b"JFIF\0" and len(body) >= 12:
            unit, x, y = struct.unpack_from(">BHH", body, 7)
            if unit in (1, 2) and x and y:
                blocks.density = (x, y, unit + 1)
        elif marker == 0xE1 and body.startswith(_EXIF):
            blocks.exif = blocks.exif or body[len(_EXIF) :]
        elif marker == 0xE1 and body.startswith(_XMP):
            blocks.xmp = blocks.xmp or body[len(_XMP) :]
        elif marker == 0xE1 and body.startswith(_XMP_MORE):
            blocks.xmp_more += (body,)
        elif marker == 0xE2 and body.startswith(_ICC):
            icc[body[12]] = body[14:]
        elif marker == 0xED and body.startswith(_PHOTOSHOP):
            photoshop += body[len(_PHOTOSHOP) :]
        elif marker == 0xFE:
            blocks.comments += (body,)
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            blocks.components = body[5]
    blocks.icc = b"".join(icc[i] for i in sorted(icc))
    _split_photoshop(photoshop, blocks)


def _embed_jpeg(path: Path, blocks: Blocks) -> None:
    data = path.read_bytes()
    _whole(path, data.endswith(b"\xff\xd9"))
    segments = _segments(io.BytesIO(data))
    scan = segments[-1][2]
    jfif = b"JFIF\0\1\2" + struct.pack(">BHHBB", 0, 1, 1, 0, 0)
    if blocks.density:
        x, y = _per_inch(blocks.density)
        unit = int(blocks.density[2] != 1)
        jfif = b"JFIF\0\1\2" + struct.pack(">BHHBB", unit, min(round(x), 65535), min(round(y), 65535), 0, 0)
    out = [b"\xff\xd8", _segment(0xE0, jfif)]
    if blocks.exif:
        exif = blocks.exif
        if len(_EXIF + exif) > 65533:
            # Maker notes of raw files alone can be larger than a JPEG segment.
            main, subs = exif_tags(exif)
            subs.get(EXIF_IFD, {}).pop(_MAKER_NOTE, None)
            exif = _exif_stream(main, subs)
        out.append(_segment(0xE1, _EXIF + exif, "EXIF"))
    if blocks.xmp:
        out.append(_segment(0xE1, _XMP + blocks.xmp, "XMP"))
        out += [_segment(0xE1, body) for body in blocks.xmp_more]
    pieces = [blocks.icc[i : i + 65519] for i in range(0, len(blocks.icc), 65519)]
    for i, piece in enumerate(pieces):
        out.append(_segment(0xE2, _ICC + bytes([i + 1, len(pieces)]) + piece))
    photoshop = _photoshop(blocks)
    size = 65533 - len(_PHOTOSHOP)
    for i in range(0, len(photoshop), size):
        out.append(_segment(0xED, _PHOTOSHOP + photoshop[i : i + size]))
    out += [_segment(0xFE, comment) for comment in blocks.comments]
    # What is left of the encoder's own: tables and frame. Its APP0 to APP13 and comments are replaced.
    out += [_segment(marker, body) for marker, body, _ in segments[:-1] if marker == 0xEE or marker < 0xE0]
    with path.open("wb") as file:
        file.write(b"".join(out))
        file.write(memoryview(data)[scan:])


def _segment(marker: int, body: bytes, name: str = "metadata") -> bytes:
    if len(body) > 65533:
        raise FileError(
            f"The {name} of the source is {len(body)} bytes, more than a JPEG can hold: write a PNG or TIFF."
        )
    return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body


def _whole(path: Path, complete: bool) -> None:
    """Refuse a file whose end is missing although its encoder did not say so."""
    if not complete:
        raise OSError(0, "the encoded picture is not complete")


def _per_inch(density: tuple[float, float, int]) -> tuple[float, float]:
    scale = 2.54 if density[2] == 3 else 1.0
    return density[0] * scale, density[1] * scale


# --- PNG ----------------------------------------------------------------------------------------------------

_COLOR_CHUNKS = (b"cICP", b"sRGB", b"gAMA", b"cHRM")


def _extract_png(file: BinaryIO, blocks: Blocks) -> None:
    file.seek(8)
    while len(head := file.read(8)) == 8:
        size, name = struct.unpack(">I4s", head)
        if name == b"IEND" or size > 0x7FFFFFFF:
            break
        if name == b"IDAT" or size > _MOST:
            file.seek(size + 4, 1)
            continue
        body = file.read(size)
        file.seek(4, 1)
        if name == b"iCCP":
            blocks.icc = _inflate(body.split(b"\0", 1)[1][1:])
        elif name == b"eXIf":
            blocks.exif = body.removeprefix(_EXIF)
        elif name == b"pHYs" and len(body) == 9:
            x, y, unit = struct.unpack(">IIB", body)
            blocks.density = (x / 100, y / 100, 3) if unit else (x, y, 1)
        elif name == b"iTXt" and body.startswith(_XMP_KEYWORD + b"\0"):
            blocks.xmp = _international_text(body)
        elif name in (b"tEXt", b"zTXt", b"iTXt"):
            blocks.texts += ((name, body),)
        elif name in _COLOR_CHUNKS:
            blocks.color_chunks += ((name, body),)
        elif name == b"acTL":
            blocks.pages = max(1, struct.unpack_from(">I", body)[0])


def _inflate(data: bytes) -> bytes:
    machine = zlib.decompressobj()
    return machine.decompress(data, _MOST)  # the limit is against files made to burst


def _international_text(body: bytes) -> bytes:
    packed = body[len(_XMP_KEYWORD) + 1]
    text = body[len(_XMP_KEYWORD) + 3 :].split(b"\0", 2)[2]
    return _inflate(text) if packed else text


def _embed_png(path: Path, blocks: Blocks) -> None:
    data = path.read_bytes()
    _whole(path, data[-8:-4] == b"IEND")
    place, before, first = 8, [], 0
    while not first:
        size, name = struct.unpack_from(">I4s", data, place)
        if name == b"IDAT":
            first = place
        elif name in (b"IHDR", b"PLTE", b"tRNS"):
            before.append(data[place : place + 12 + size])
        place += 12 + size
    out = [data[:8], before[0]]
    if blocks.icc:
        out.append(_chunk(b"iCCP", b"ICC Profile\0\0" + zlib.compress(blocks.icc)))
    # A profile and sRGB exclude each other; the other chunks may stand beside a profile (11.3.2).
    out += [_chunk(name, body) for name, body in blocks.color_chunks if not (blocks.icc and name == b"sRGB")]
    if blocks.density:
        x, y, unit = blocks.density
        if unit != 1:
            x, y = (v * 100 / 2.54 for v in _per_inch(blocks.density))
        out.append(_chunk(b"pHYs", struct.pack(">IIB", round(x), round(y), unit != 1)))
    out += before[1:]
    if blocks.exif:
        out.append(_chunk(b"eXIf", blocks.exif))
    if blocks.xmp:
        out.append(_chunk(b"iTXt", _XMP_KEYWORD + bytes(5) + blocks.xmp.rstrip(b"\0")))
    out += [_chunk(name, body) for name, body in blocks.texts]
    out += [_chunk(b"tEXt", b"Comment\0" + c.replace(b"\0", b"")) for c in blocks.comments]
    if photoshop := _photoshop(blocks):
        # PNG has no place for IPTC. This one is ImageMagick's, which the common tools read.
        text = b"\niptc\n%8d\n" % len(photoshop)
        text += b"\n".join(photoshop[i : i + 36].hex().encode() for i in range(0, len(photoshop), 36)) + b"\n"
        out.append(_chunk(b"zTXt", b"Raw profile type iptc\0\0" + zlib.compress(text)))
    with path.open("wb") as file:
        file.write(b"".join(out))
        file.write(memoryview(data)[first:])


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


# --- WebP ---------------------------------------------------------------------------------------------------


def _riff(file: BinaryIO) -> list[tuple[bytes, int, int]]:
    """Return the chunks of a WebP as (name, where the body starts, its size)."""
    found: list[tuple[bytes, int, int]] = []
    place = 12
    while True:
        file.seek(place)
        head = file.read(8)
        if len(head) < 8:
            return found
        name, size = struct.unpack("<4sI", head)
        found.append((name, place + 8, size))
        place += 8 + size + size % 2


def _extract_webp(file: BinaryIO, blocks: Blocks) -> None:
    for name, place, size in _riff(file):
        if name in (b"ICCP", b"EXIF", b"XMP ") and size < _MOST:
            file.seek(place)
            body = file.read(size)
            if name == b"ICCP":
                blocks.icc = body
            elif name == b"EXIF":
                blocks.exif = body.removeprefix(_EXIF)
            else:
                blocks.xmp = body
        elif name == b"VP8L":
            blocks.lossless = True
        elif name == b"ANIM":
            blocks.pages = 2


def _embed_webp(path: Path, blocks: Blocks, width: int, height: int) -> None:
    data = path.read_bytes()
    _whole(path, len(data) > 20 and struct.unpack_from("<I", data, 4)[0] + 8 == len(data))
    view = memoryview(data)
    image: list[bytes | memoryview] = []
    flags = 0
    for name, place, size in _riff(io.BytesIO(data)):
        if name in (b"ALPH", b"VP8 ", b"VP8L"):
            image.append(view[place - 8 : place + size + size % 2])
            # The alpha bit of a lossless stream follows its signature and two 14-bit sizes (RFC 9649, 3.4).
            lossless_alpha = name == b"VP8L" and data[place + 4] & 0x10
            flags |= 0x10 if name == b"ALPH" or lossless_alpha else 0
    flags |= (0x20 if blocks.icc else 0) | (0x08 if blocks.exif else 0) | (0x04 if blocks.xmp else 0)
    size24 = (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    out = [_riff_chunk(b"VP8X", bytes([flags, 0, 0, 0]) + size24)]
    out += [_riff_chunk(b"ICCP", blocks.icc)] if blocks.icc else []
    out += image  # type: ignore[arg-type]
    out += [_riff_chunk(b"EXIF", blocks.exif)] if blocks.exif else []
    out += [_riff_chunk(b"XMP ", blocks.xmp)] if blocks.xmp else []
    body = b"WEBP" + b"".join(out)
    path.write_bytes(b"RIFF" + struct.pack("<I", len(body)) + body)


def _riff_chunk(name: bytes, body: bytes) -> bytes:
    return name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2)


# --- TIFF ---------------------------------------------------------------------------------------------------


def _embed_tiff(path: Path, blocks: Blocks) -> None:
    """Append a directory of the encoder's structure tags and the source's metadata, and point to it."""
    with path.open("r+b") as file:
        order, big, start = _read_header(file)
        if order == ">":
            raise FileError(f"'{path.name}' was encoded in an unexpected byte order: write a PNG instead.")
        encoded, _ = _read_directory(file, order, big, start)
        main = {tag: entry for tag, entry in encoded.items() if tag in _STRUCTURE}
        for tag in (EXIF_IFD, GPS_IFD, _TIFF_XMP, _TIFF_IPTC, _TIFF_PHOTOSHOP, _TIFF_ICC):
            main.pop(tag, None)
        kept, subs = exif_tags(blocks.exif)
        main |= {tag: entry for tag, entry in kept.items() if tag not in _STRUCTURE}
        main[0x0112] = (3, 1, struct.pack("<H", 1))
        if blocks.density:
            for tag, side in zip(_RESOLUTION, blocks.density[:2], strict=False):
                value = Fraction(side).limit_denominator(10000)
                main[tag] = (5, 1, struct.pack("<II", value.numerator, value.denominator))
            main[_RESOLUTION[2]] = (3, 1, struct.pack("<H", blocks.density[2]))
        if blocks.comments and 270 not in main:
            text = blocks.comments[0].rstrip(b"\0") + b"\0"
            main[270] = (2, len(text), text)
        for tag, kind, data in (
            (_TIFF_XMP, 1, blocks.xmp),
            (_TIFF_IPTC, 7, blocks.iptc),
            (_TIFF_PHOTOSHOP, 1, blocks.photoshop),
            (_TIFF_ICC, 7, blocks.icc),
        ):
            if data:
                main[tag] = (kind, len(data), data)
        base = file.seek(0, 2)
        if base % 2:
            file.write(b"\0")
            base += 1
        body, first = _pack_tree(main, subs, base, big)
        if not big and base + len(body) >= 1 << 32:
            raise FileError(f"'{path.name}' would be larger than a TIFF can be: write an EXR instead.")
        file.write(body)
        file.seek(8 if big else 4)
        file.write(struct.pack("<Q" if big else "<I", first))


def tell_association(path: Path, associated: bool) -> None:
    """Say in a TIFF whether its colors are multiplied by its alpha (TIFF 6.0, ExtraSamples)."""
    with path.open("r+b") as file:
        order, big, start = _read_header(file)
        size = 20 if big else 12
        file.seek(start)
        count = struct.unpack(order + ("Q" if big else "H"), file.read(8 if big else 2))[0]
        entries = file.tell()
        for place in range(entries, entries + count * size, size):
            file.seek(place)
            if struct.unpack(order + "H", file.read(2))[0] == 338:
                file.seek(place + (12 if big else 8))
                file.write(struct.pack(order + "H", 1 if associated else 2))


def embed(path: Path, blocks: Blocks, kind: str, size: tuple[int, int]) -> None:
    """Put metadata into a file just encoded, in place of what its encoder wrote by itself.

    WebP has no place for IPTC, for resolution outside EXIF, or for comments: these are left out there.

    Parameters
    ----------
    path
        A JPEG, PNG, WebP or TIFF that nobody else uses yet.
    blocks
        What to put in, of any kind of source, made `upright`.
    kind
        ``jpeg``, ``png``, ``webp`` or ``tiff``.
    size
        Width and height in pixels.

    Raises
    ------
    FileError
        If a block is larger than the format can hold.
    OSError
        If the file cannot be written.
    """
    if kind == "jpeg":
        _embed_jpeg(path, blocks)
    elif kind == "png":
        _embed_png(path, blocks)
    elif kind == "webp":
        _embed_webp(path, blocks, *size)
    elif kind == "tiff":
        _embed_tiff(path, blocks)
