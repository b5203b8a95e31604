"""Adobe Color, Photoshop's swatches: version 1 without names, version 2 with them, mostly both in one file.

Adobe Photoshop File Formats Specification, "Color swatches". It says that grey goes from 0 to 10000 and not which end
is black; here it is the amount of black, as in Photoshop's own sliders and in GIMP.
"""

from __future__ import annotations

import colorsys
import struct

import numpy as np

from ..library import Library
from ..swatches import Encoded, Swatch, lab_of
from .reading import Bytes, Collector, Inks, is_srgb, losses

_BOOKS = {3: "Pantone", 4: "Focoltone", 5: "Trumatch", 6: "Toyo", 10: "HKS"}
_MOST = 0xFFFF


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    file = Bytes(data, name)
    version, count = file.take("HH")
    if version not in (1, 2):
        raise file.error(f"this is no Adobe Color file, as its version is {version} and not 1 or 2", 0)
    if version == 1 and len(data) >= 8 + 10 * count and data[4 + 10 * count : 6 + 10 * count] == b"\0\2":
        # The second half says the same with names.
        file.bytes(10 * count)
        version, count = file.take("HH")
    found = Collector(name, inks)
    for _ in range(count):
        place = file.place
        space, *numbers = file.take("H4H")
        title = ""
        if version == 2:
            (length,) = file.take("I")
            if 2 * length > file.left:
                raise file.error(f"a name of {length} characters goes beyond the end of the file", file.place - 4)
            title = file.text(length)
        if space > 15:
            raise file.error(f"the color space {space} is not known", place)
        _add_color(found, space, numbers, title)
    return found.library()


def _add_color(found: Collector, space: int, numbers: list[int], name: str) -> None:
    w, x, y, z = numbers
    if space in (0, 1):
        codes = (w / _MOST, x / _MOST, y / _MOST)
        if space == 1:
            codes = colorsys.hsv_to_rgb(*codes)
        found.note("RGB and HSB of the file name no color space: taken as sRGB.")
        found.add(Swatch(name, Encoded(codes)))
    elif space == 2:
        found.add_inks([1 - v / _MOST for v in (w, x, y, z)], name)
    elif space == 7:
        lab = w / 100, *(v / 100 for v in struct.unpack(">2h", struct.pack(">2H", x, y)))
        found.add(Swatch(name, Swatch.from_lab(lab).color))
    elif space == 8:
        found.note("Grey of the file is taken as an amount of black in sRGB.")
        grey = 1 - w / 10000
        found.add(Swatch(name, Encoded((grey, grey, grey))))
    else:
        found.leave_out(f"numbers of a {_BOOKS[space]} book" if space in _BOOKS else f"of the color space {space}")


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write both versions: sRGB codes as RGB of 16 bits, everything else as Lab under D50 in hundredths."""
    kept = library.swatches[:_MOST]
    colors = []
    for swatch, lab in zip(kept, lab_of(kept), strict=True):
        if isinstance(swatch.color, Encoded) and is_srgb(swatch.color):
            codes = np.rint(np.clip(swatch.color.rgb, 0, 1) * _MOST).astype(int)
            colors.append(struct.pack(">5H", 0, *codes.tolist(), 0))
        else:
            numbers = np.rint(np.clip(lab, (0, -128, -128), (100, 127, 127)) * 100).astype(int)
            colors.append(struct.pack(">HHhhH", 7, *numbers.tolist(), 0))
    names = [(swatch.text + "\0").encode("utf-16-be", "replace") for swatch in kept]
    named = [c + struct.pack(">I", len(n) // 2) + n for c, n in zip(colors, names, strict=True)]
    notes = losses(library, is_srgb, "Lab under D50 in steps of 0.01")
    if len(kept) < len(library):
        notes.append(f"Only the first {_MOST} of {len(library)} swatches are written, as the format holds no more.")
    if any(group.name for group in library.groups):
        notes.append("The names of groups are not written, as the format has none.")
    head = [struct.pack(">HH", version, len(kept)) for version in (1, 2)]
    return b"".join([head[0], *colors, head[1], *named]), notes
