"""CGATS.17 and IT8.7 text tables, spectral and colorimetric (ISO 28178 describes the exchange format).

A table lists its fields between BEGIN_DATA_FORMAT and END_DATA_FORMAT and a line for each set between BEGIN_DATA and
END_DATA. Illuminant and observer come from the lines that name them, such as WEIGHTING_FUNCTION; without them
colorimetry is that of graphic arts, D50 and 2°. Argyll's tables (.ti3) differ in nothing that matters here.
"""

from __future__ import annotations

import re

import numpy as np

from ..library import Library
from ..spectra import Spectrum
from .columns import Columns
from .reading import Collector, Inks, LineError, clean, decode

_TOKEN = re.compile(r'"((?:[^"]|"")*)"|(\S+)')
_END = {"BEGIN_DATA_FORMAT": "END_DATA_FORMAT", "BEGIN_DATA": "END_DATA"}


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    found = Collector(name, inks)
    lines = decode(data).splitlines()
    if "BEGIN_DATA" not in (line.strip() for line in lines):
        raise LineError(name, max(1, len(lines)), "there is no line BEGIN_DATA", "give a CGATS or IT8 table")
    titles: list[str] = []
    title_line, keywords = 1, ""
    k = 0
    while k < len(lines):
        word = lines[k].strip()
        k += 1
        if word not in _END:
            # Later tables inherit what they do not say themselves.
            keywords += word + "\n"
            continue
        block, k = _block(lines, k, _END[word], name)
        if word == "BEGIN_DATA_FORMAT":
            titles, title_line = [token for _, tokens in block for token in tokens], k
        elif not titles:
            raise LineError(name, k, "the data have no format", "list the fields from BEGIN_DATA_FORMAT on")
        else:
            _add_sets(titles, title_line, block, keywords, name, found)
    return found.library()


def _block(lines: list[str], start: int, end: str, name: str) -> tuple[list[tuple[int, list[str]]], int]:
    """Return the tokens of lines up to the end mark, with their numbers, and the line after it."""
    block: list[tuple[int, list[str]]] = []
    for k in range(start, len(lines)):
        text = lines[k].strip()
        if text == end:
            return block, k + 1
        if text and not text.startswith("#"):
            tokens = [plain or quoted.replace('""', '"') for quoted, plain in _TOKEN.findall(text)]
            block.append((k + 1, tokens))
    raise LineError(name, len(lines), f"the file ends without {end}", "save the file again")


def _add_sets(
    titles: list[str], title_line: int, block: list[tuple[int, list[str]]], keywords: str, name: str, found: Collector
) -> None:
    for line, row in block:
        if len(row) != len(titles):
            raise LineError(
                name,
                line,
                f"{len(row)} values stand for {len(titles)} fields",
                "give each set one value for each field",
            )
    light = re.search(r'ILLUMINA(?:NT|TION)(?:_NAME)?"?[\s,"=]+([\w-]+)', keywords, re.IGNORECASE)
    observer = re.search(r'OBSERVER(?:_?ANGLE)?"?[\s,"=]+(10|2|1931|1964)', keywords, re.IGNORECASE)
    if not light and any(title.startswith(("LAB_", "XYZ_")) for title in titles):
        found.note("The file names no illuminant: taken as D50.")
    stated = light[1] if light else "D50", observer[1] if observer else "1931"
    for fields, sets in _without_pairs(titles, title_line, block, name):
        Columns(fields, name, title_line, found, *stated).add(sets)


# Fields that follow a wavelength, and what their values are to be multiplied by.
_OF_PAIRS = {"SPECTRAL_DEC": 1.0, "SPECTRAL_PCT": 0.01}


def _without_pairs(
    titles: list[str], title_line: int, block: list[tuple[int, list[str]]], name: str
) -> list[tuple[list[str], list[tuple[int, list[str]]]]]:
    """Give spectra that are pairs of wavelength and value, in one set or several of a sample, a field a wavelength.

    Returns
    -------
    A table for each choice of wavelengths: its fields, and its sets with their lines.
    """
    places = [k for k, title in enumerate(titles) if title == "SPECTRAL_NM"]
    if not places:
        return [(titles, block)]
    following = [titles[k + 1] if k + 1 < len(titles) else "nothing" for k in places]
    if odd := set(following) - set(_OF_PAIRS):
        raise LineError(
            name, title_line, f"SPECTRAL_NM is followed by {clean(odd.pop())[:40]}", f"write {' or '.join(_OF_PAIRS)}"
        )
    others = [k for k in range(len(titles)) if k not in places and k - 1 not in places]
    samples: dict[tuple[str, ...], tuple[int, dict[float, str]]] = {}
    for line, row in block:
        _, pairs = samples.setdefault(tuple(row[k] for k in others), (line, {}))
        for k in places:
            try:
                pairs[float(row[k])] = repr(float(row[k + 1]) * _OF_PAIRS[titles[k + 1]])
            except ValueError:
                raise LineError(
                    name, line, f"'{clean(f'{row[k]} {row[k + 1]}')[:60]}' is no pair of numbers", "mend it"
                ) from None
    tables: dict[tuple[float, ...], list[tuple[int, list[str]]]] = {}
    for label, (line, pairs) in samples.items():
        tables.setdefault(tuple(pairs), []).append((line, [*label, *pairs.values()]))
    labels = [titles[k] for k in others]
    return [([*labels, *(f"SPECTRAL_NM{nm:g}" for nm in table)], sets) for table, sets in tables.items()]


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write spectra if all have the same wavelengths, else L*a*b* under D50."""
    colors = [swatch.color for swatch in library.swatches]
    nm = colors[0].wavelengths if isinstance(colors[0], Spectrum) else None
    if nm is not None and all(isinstance(c, Spectrum) and np.array_equal(c.wavelengths, nm) for c in colors):
        fields = [f"SPECTRAL_NM{wavelength:g}" for wavelength in nm]
        values = [[f"{v:.8g}" for v in c.values] for c in colors if isinstance(c, Spectrum)]
        notes = []
    else:
        fields = ["LAB_L", "LAB_A", "LAB_B"]
        values = [[f"{v:.8g}" for v in lab] for lab in library.lab]
        notes = ["All swatches are written as Lab under D50, as they are not spectra of the same wavelengths."]
    lines = [
        "CGATS.17",
        'ORIGINATOR "Dyehouse"',
        f'DESCRIPTOR "{_quoted(library.name)}"',
        'WEIGHTING_FUNCTION "ILLUMINANT, D50"',
        'WEIGHTING_FUNCTION "OBSERVER, 2 degree"',
        f"NUMBER_OF_FIELDS {2 + len(fields)}",
        "BEGIN_DATA_FORMAT",
        " ".join(["SAMPLE_ID", "SAMPLE_NAME", *fields]),
        "END_DATA_FORMAT",
        f"NUMBER_OF_SETS {len(library)}",
        "BEGIN_DATA",
    ]
    for number, (swatch, row) in enumerate(zip(library.swatches, values, strict=True), 1):
        lines.append(" ".join([str(number), f'"{_quoted(swatch.text)}"', *row]))
    return ("\n".join([*lines, "END_DATA"]) + "\n").encode(), notes


def _quoted(text: str) -> str:
    return clean(text).replace('"', '""')
