"""GIMP palettes: text lines of three sRGB codes, 0..255, and a name."""

from __future__ import annotations

import re

import numpy as np

from ..library import Library
from ..swatches import Encoded, Swatch
from .reading import Collector, Inks, LineError, clean, decode, is_srgb, losses

_REMEDY = "write red, green and blue of 0 to 255 and a name, as in '192 57 43 Brick'"


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    lines = decode(data).splitlines()
    if not lines or lines[0].strip() != "GIMP Palette":
        raise LineError(name, 1, "this is no GIMP palette", "its first line is 'GIMP Palette'")
    title = next((line[5:].strip() for line in lines[1:5] if line.startswith("Name:")), "")
    found = Collector(title or name, inks)
    header = True
    for number, line in enumerate(lines[1:], 2):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if header and re.match(r"(Name|Columns|Channels):", text):
            continue
        header = False
        match = re.fullmatch(r"(\d{1,3})\s+(\d{1,3})\s+(\d{1,3})(?:\s+(.*))?", text)
        codes = [int(code) for code in match.groups()[:3]] if match else [256]
        if match is None or max(codes) > 255:
            raise LineError(name, number, f"'{text[:60]}' is no color", _REMEDY)
        red, green, blue = (code / 255 for code in codes)
        found.add(Swatch(match[4] or "", Encoded((red, green, blue))))
    return found.library()


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write sRGB codes of 8 bits; what sRGB does not hold becomes paler."""
    codes = np.rint(library.display_colors * 255).astype(int)
    for k, swatch in enumerate(library.swatches):
        if isinstance(swatch.color, Encoded) and is_srgb(swatch.color):
            codes[k] = np.rint(np.clip(swatch.color.rgb, 0, 1) * 255)
    lines = ["GIMP Palette", f"Name: {clean(library.name)}", "Columns: 0", "#"]
    pairs = zip(codes, library.swatches, strict=True)
    lines += [f"{r:3d} {g:3d} {b:3d}\t{clean(swatch.text)}" for (r, g, b), swatch in pairs]
    notes = losses(library, is_srgb, "sRGB codes of 8 bits")
    if any(group.name for group in library.groups):
        notes.append("The names of groups are not written, as the format has none.")
    return ("\n".join(lines) + "\n").encode(), notes
