"""CSV: a swatch in each row, or a spectrum in each column after the wavelengths.

Fields are separated by commas, semicolons or tabs, whichever the first line has; with semicolons or tabs numbers may
have decimal commas. `columns` knows the titles. Without titles rows are ``name, #RRGGBB``, or wavelengths and values.
"""

from __future__ import annotations

import csv
import io
import re

import numpy as np

from .. import spectra
from ..errors import DyehouseError
from ..library import Library
from ..spectra import Spectrum
from ..swatches import Swatch
from .columns import Columns, role
from .reading import Collector, Inks, LineError, clean, decode

_HEX = re.compile(r"#?[0-9a-fA-F]{6}")


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    rows = _rows(decode(data), name)
    found = Collector(name, inks)
    if not rows:
        raise LineError(name, 1, "the file has no lines", "give a table with a swatch in each row")
    line, first = rows[0]
    if role(first[0]) == "wavelength" or all(map(_is_number, first)):
        _add_spectra(rows, name, found)
    elif any(_HEX.fullmatch(field.strip()) for field in first) and len(first) <= 2:
        titles = ["hex" if _HEX.fullmatch(field.strip()) else "name" for field in first]
        Columns(titles, name, line, found).add(rows)
    else:
        Columns(first, name, line, found).add(rows[1:])
    return found.library()


def _rows(text: str, name: str) -> list[tuple[int, list[str]]]:
    """Fields of the lines that have any, with their numbers."""
    lines = text.splitlines()
    plain = [line for line in lines if line.strip() and not line.lstrip().startswith("# ")]
    separator = next((s for s in ";\t," if plain and s in plain[0]), ",")
    rows = []
    reader = csv.reader(lines, delimiter=separator)
    try:
        for row in reader:
            fields = [field.strip() for field in row]
            if any(fields) and not fields[0].startswith("# "):
                if separator != ",":
                    fields = [re.sub(r"^([+-]?\d*),(\d+)$", r"\1.\2", field) for field in fields]
                rows.append((reader.line_num, fields))
    except csv.Error as error:
        raise LineError(name, reader.line_num, f"the line cannot be read ({error})", "save the table again") from None
    return rows


def _is_number(field: str) -> bool:
    try:
        return bool(np.isfinite(float(field)))
    except ValueError:
        return False


def _add_spectra(rows: list[tuple[int, list[str]]], name: str, found: Collector) -> None:
    first = rows[0][1]
    titled = not all(map(_is_number, first))
    names = first[1:] if titled else [""] * (len(first) - 1)
    if len(names) == 1:
        names = [name]
    table: list[list[float]] = []
    for line, row in rows[titled:]:
        if len(row) != len(first) or not all(map(_is_number, row)):
            raise LineError(
                name, line, f"'{clean(' '.join(row))[:60]}' is not {len(first)} numbers", "write numbers as '550, 0.25'"
            )
        if table and float(row[0]) <= table[-1][0]:
            raise LineError(name, line, f"the wavelength {row[0]} does not increase", "sort the lines")
        table.append([float(field) for field in row])
    values = np.array(table).reshape(len(table), len(first))
    if not spectra.covers(values[:, 0]) or len(first) < 2:
        raise LineError(name, rows[-1][0], "the wavelengths do not cover 400 to 700 nm in six steps", "measure all")
    if values[:, 1:].max() > 2:
        found.note(f"Reflectances go up to {values[:, 1:].max():.4g}: read as percent.")
        values[:, 1:] /= 100
    for title, column in zip(names, values[:, 1:].T, strict=True):
        try:
            swatch = Swatch.from_spectrum(Spectrum(values[:, 0], column.copy(), title), title or "without a name")
        except DyehouseError as error:
            raise LineError(name, rows[0][0], str(error).partition(": ")[0], "give reflectances of 0 to 1") from None
        found.add(Swatch(title, swatch.color))


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write everything without loss: spectra by wavelength if all have the same, else in the column ``color``.

    For other programs L*a*b* under D50 and sRGB codes follow, from which this reader takes nothing.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    colors = [swatch.color for swatch in library.swatches]
    nm = colors[0].wavelengths if isinstance(colors[0], Spectrum) else None
    spectral = nm is not None and all(isinstance(c, Spectrum) and np.array_equal(c.wavelengths, nm) for c in colors)
    rows = zip(library.group_names, library.swatches, library.lab, library.display_colors, strict=True)
    if nm is not None and spectral:
        writer.writerow(["group", "name", *(f"{wavelength:g}" for wavelength in nm)])
    else:
        writer.writerow(["group", "name", "color", "L", "a", "b", "hex"])
    for group, swatch, lab, codes in rows:
        if spectral and isinstance(swatch.color, Spectrum):
            values = [f"{value:.10g}" for value in swatch.color.values]
        else:
            hexadecimal = "#" + "".join(f"{round(255 * float(code)):02X}" for code in codes)
            values = [swatch.written, *(f"{value:.4f}" for value in lab), hexadecimal]
        writer.writerow([clean(group), clean(swatch.text), *values])
    return out.getvalue().encode(), []
