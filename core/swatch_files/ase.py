"""Adobe Swatch Exchange: RGB, CMYK, Lab and grey swatches in groups.

Adobe has not published the format; it is as its programs write it and the open readers agree on. RGB and grey name no
space and are taken as sRGB; Lab is D50, with L as 0..1 and a, b as they are.
"""

from __future__ import annotations

import struct

from ..library import Library
from ..swatches import Encoded, Swatch, lab_of
from .reading import Bytes, Collector, Inks, is_print_lab, is_srgb, losses

_GROUP, _GROUP_END, _COLOR = 0xC001, 0xC002, 0x0001
_NUMBERS = {b"RGB ": 3, b"CMYK": 4, b"LAB ": 3, b"Gray": 1}
_PROCESS = 2  # kind of swatch: 0 is global, 1 spot


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    file, found = Bytes(data, name), Collector(name, inks)
    if file.left < 12 or file.bytes(4) != b"ASEF":
        raise file.error("this is no Adobe Swatch Exchange file, which begins with ASEF", 0)
    file.take("HH")  # version
    (stated,) = file.take("I")
    blocks, group = 0, ""
    while file.left:
        kind, length = file.take("HI")
        place = file.place
        block = Bytes(data[: place + length], name) if length <= file.left else None
        if block is None:
            raise file.error(f"a block of {length} bytes goes beyond the end of the file", place - 6)
        block.place = place
        if kind == _GROUP:
            group = block.text(*block.take("H"))
        elif kind == _GROUP_END:
            group = ""
        elif kind == _COLOR:
            _add_color(block, found, group)
        else:
            found.note(f"Blocks of the unknown kind {kind:#06x} are left out.")
        file.bytes(length)
        blocks += 1
    if blocks != stated:
        found.note(f"The file says that it has {stated} blocks and has {blocks}.")
    return found.library()


def _add_color(block: Bytes, found: Collector, group: str) -> None:
    name = block.text(*block.take("H"))
    model = block.bytes(4)
    if model not in _NUMBERS:
        raise block.error(f"the color model {model.decode('latin-1')!r} is not known", block.place - 4)
    numbers = block.take(f"{_NUMBERS[model]}f")
    if model == b"CMYK":
        found.add_inks(numbers, name, group)
    elif model == b"LAB ":
        L, a, b = numbers
        # Beyond the fifth decimal is only the rounding of the file's short floats.
        found.add(Swatch(name, Swatch.from_lab([round(v, 5) for v in (100 * L, a, b)]).color), group)
    else:
        found.note("RGB and grey of the file name no color space: taken as sRGB.")
        red, green, blue = (_code(v) for v in (numbers if model == b"RGB " else 3 * numbers))
        found.add(Swatch(name, Encoded((red, green, blue))), group)


def _code(value: float) -> float:
    """The code of 8 bits that a short float stands for, or itself."""
    nearest = round(255 * value) / 255
    return nearest if abs(nearest - value) < 1e-7 else value


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write sRGB codes as RGB, everything else as Lab under D50; see :func:`swatch_files.encode`."""
    blocks = []
    for group in library.groups:
        if group.name:
            blocks.append(_block(_GROUP, _text(group.name)))
        for swatch, lab in zip(group.swatches, lab_of(group.swatches), strict=True):
            if isinstance(swatch.color, Encoded) and is_srgb(swatch.color):
                color = b"RGB " + struct.pack(">3f", *swatch.color.rgb)
            else:
                color = b"LAB " + struct.pack(">3f", lab[0] / 100, lab[1], lab[2])
            blocks.append(_block(_COLOR, _text(swatch.text) + color + struct.pack(">H", _PROCESS)))
        if group.name:
            blocks.append(_block(_GROUP_END, b""))
    notes = losses(library, lambda color: is_srgb(color) or is_print_lab(color), "Lab under D50")
    return b"ASEF" + struct.pack(">HHI", 1, 0, len(blocks)) + b"".join(blocks), notes


def _block(kind: int, body: bytes) -> bytes:
    return struct.pack(">HI", kind, len(body)) + body


def _text(text: str) -> bytes:
    data = (text + "\0").encode("utf-16-be", "replace")
    return struct.pack(">H", len(data) // 2) + data
