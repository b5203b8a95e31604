"""Tables of swatches: what the titles of the columns mean, and a swatch out of every row."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from .. import colorimetry, spectra
from ..errors import DyehouseError
from ..spectra import Spectrum
from ..swatches import Encoded, Swatch, parse_target
from .reading import Collector, LineError, clean

_WORDS = {
    "name": ("name", "samplename", "sample", "colorname", "colourname", "label", "title"),
    "id": ("id", "sampleid", "no", "number", "#", "code"),
    "group": ("group", "category", "family", "collection"),
    "hex": ("hex", "html", "hexcode", "htmlcode", "rgbhex", "srgbhex"),
    "color": ("color", "colour", "target", "swatch"),
    "illuminant": ("illuminant", "light"),
    "observer": ("observer",),
    "wavelength": ("wavelength", "wavelengthnm", "wavelengths", "nm", "lambda", "λ", "wl"),
}
_ROLES = {word: role for role, words in _WORDS.items() for word in words}
_WAVELENGTH = re.compile(
    r"(?:spectral|spec|refl|nm|r)?[ _]*(?:nm|pct)?[ _]*(\d{3,4}(?:\.\d+)?)(?: *nm)?", re.IGNORECASE
)
_NUMBER = re.compile(r"(lab|lch|xyz|xyy|s?rgb|cmyk)?[ _]*(capy|red|green|blue|[a-z])\*?", re.IGNORECASE)

# The kinds of color in the order in which they are trusted, and the letters of their columns.
_KINDS = {
    "lab": "Lab",
    "xyz": "XYZ",
    "lch": "LCh",
    "xyy": "xyY",
    "rgb": "RGB",
    "cmyk": "CMYK",
}


def role(title: str) -> str | float | None:
    """What a column holds: a word, a wavelength in nm, ``lab L`` and the like, or None if that is not known."""
    plain = re.sub(r"[\s_().*-]", "", title.lower())
    if plain in _ROLES:
        return _ROLES[plain]
    if (match := _WAVELENGTH.fullmatch(title.strip())) and 200 <= float(match[1]) <= 2500:
        return float(match[1])
    bare = re.sub(r"[*°()]|^(?:cie|CIE)[ _]*|(?<=[CcHh*])_?ab$", "", title.strip()) or title.strip()
    if match := _NUMBER.fullmatch(bare):
        kind, letter = (match[1] or "").lower(), match[2]
        letter = {"red": "R", "green": "G", "blue": "B", "capy": "Y"}.get(letter.lower(), letter)
        if kind == "xyy" and match[2].lower() != "capy":
            letter = letter if letter == "Y" and bare[:3] == "xyY" else letter.lower()
        return f"{kind.replace('srgb', 'rgb')} {letter}"
    return None


class Columns:
    """The columns of a table.

    Parameters
    ----------
    titles
        Of all columns.
    name, line
        Of the file and of the titles in it, for errors.
    found
        Where swatches and notes go.
    illuminant, observer
        Of colorimetric columns, where the rows do not say: a name, or None for the usual one, which is noted.
    """

    def __init__(
        self,
        titles: Sequence[str],
        name: str,
        line: int,
        found: Collector,
        illuminant: str | None = None,
        observer: str | None = None,
    ) -> None:
        self._name, self._found = name, found
        self._illuminant, self._observer = illuminant, observer
        roles = [role(title) for title in titles]
        self._places = {part: k for k, part in reversed(list(enumerate(roles))) if isinstance(part, str)}
        nm = sorted((part, k) for k, part in enumerate(roles) if isinstance(part, float))
        self._wavelengths = np.array([part for part, _ in nm])
        self._samples = [k for _, k in nm]
        self._kind, self._numbers = self._best()
        if not self._kind:
            raise LineError(
                name,
                line,
                f"the columns {clean(', '.join(titles))[:80]} hold no color that is known",
                "title them name, L, a, b or name, hex or name, 400, 410, ... 700",
            )
        if self._kind == "spectrum" and (
            (np.diff(self._wavelengths) <= 0).any() or not spectra.covers(self._wavelengths)
        ):
            raise LineError(
                name, line, "the wavelengths do not cover 400 to 700 nm in six steps or more", "measure all of it"
            )

    def _best(self) -> tuple[str, list[int]]:
        """Return the kind of color to read and its columns."""
        if "color" in self._places:
            return "color", [self._places["color"]]
        if len(self._samples) >= 7:
            return "spectrum", self._samples
        for kind, letters in _KINDS.items():
            columns = [self._column(kind, letter) for letter in letters]
            if len({c for c in columns if c is not None}) == len(letters):
                if kind == "rgb" and "hex" in self._places:
                    break
                return kind, [c for c in columns if c is not None]
        return ("hex", [self._places["hex"]]) if "hex" in self._places else ("", [])

    def _column(self, kind: str, letter: str) -> int | None:
        """Column of a letter: titled with its kind, or by the letter alone in this or, if not two mean so, any case."""
        cases = (letter,) if letter in "Yy" and kind == "xyy" else (letter, letter.lower(), letter.upper())
        for prefix in (kind, "lab" if kind == "lch" else kind, ""):
            for case in cases:
                if f"{prefix} {case}" in self._places:
                    return self._places[f"{prefix} {case}"]
        return None

    def add(self, rows: Sequence[tuple[int, Sequence[str]]]) -> None:
        """Add a swatch for each row, given with the number of its line.

        Raises
        ------
        LineError
            If a row has no such color.
        """
        if self._kind in ("color", "hex"):
            for line, row in rows:
                self._add_written(line, row)
            return
        values = np.array([self._values(line, row) for line, row in rows]).reshape(len(rows), len(self._numbers))
        values = self._scaled(values)
        for (line, row), numbers in zip(rows, values, strict=True):
            try:
                self._add_numbers(row, numbers)
            except DyehouseError as error:
                raise self._error(line, str(error).rstrip(".").partition(": ")[0]) from None

    def _values(self, line: int, row: Sequence[str]) -> list[float]:
        try:
            values = [float(row[k]) for k in self._numbers]
        except (ValueError, IndexError):
            values = [math.nan]
        if not all(math.isfinite(value) for value in values):
            raise self._error(line, f"'{clean(' '.join(row))[:60]}' lacks a number")
        return values

    def _error(self, line: int, problem: str) -> LineError:
        return LineError(self._name, line, problem, "give every swatch all numbers of its color")

    def _scaled(self, values: np.ndarray) -> np.ndarray:
        """Bring values to the scale of 0..1, where the file has them in percent or in codes."""
        if self._kind == "lab" or self._kind == "lch" or not values.size:
            return values
        scaled, note = np.array(values), ""
        if self._kind == "spectrum" and values.max() > 2:
            scaled, note = values / 100, f"Reflectances go up to {values.max():.4g}: read as percent."
        elif self._kind in ("xyz", "xyy"):
            column = 1 if self._kind == "xyz" else 2
            if values[:, column].max() > 1.5:
                part = slice(None) if self._kind == "xyz" else slice(2, 3)
                scaled[:, part] /= 100
                note = f"Y goes up to {values[:, column].max():.4g}: read as percent."
        elif self._kind == "rgb" and values.max() > 1:
            scaled, note = values / 255, "RGB is read as codes of 0 to 255."
        elif self._kind == "cmyk" and values.max() > 1:
            scaled, note = values / 100, "CMYK is read as percent."
        if note:
            self._found.note(note)
        return scaled

    def _text(self, row: Sequence[str], part: str) -> str:
        k = self._places.get(part)
        return clean(row[k]) if k is not None and k < len(row) else ""

    def _label(self, row: Sequence[str]) -> tuple[str, str]:
        return self._text(row, "name") or self._text(row, "id"), self._text(row, "group")

    def _add_written(self, line: int, row: Sequence[str]) -> None:
        name, group = self._label(row)
        text = self._text(row, self._kind)
        if self._kind == "hex":
            text = "#" + text.removeprefix("#")
        try:
            color = parse_target(text).color
        except DyehouseError as error:
            raise LineError(self._name, line, str(error).rstrip(".").partition(": ")[0], "write #RRGGBB") from None
        self._found.add(Swatch(name or text, color), group)

    def _add_numbers(self, row: Sequence[str], numbers: np.ndarray) -> None:
        name, group = self._label(row)
        if self._kind == "spectrum":
            spectrum = Spectrum(self._wavelengths, np.array(numbers), name)
            self._found.add(Swatch(name, Swatch.from_spectrum(spectrum, name or "without a name").color), group)
            return
        if self._kind == "cmyk":
            self._found.add_inks(numbers, name, group)
            return
        if self._kind == "rgb":
            self._found.note("RGB names no color space: taken as sRGB.")
            red, green, blue = numbers.tolist()
            self._found.add(Swatch(name, Encoded((red, green, blue))), group)
            return
        lab = self._kind in ("lab", "lch")
        light = self._text(row, "illuminant") or self._illuminant
        if light is None:
            light = "D50" if lab else "D65"
            self._found.note(f"{_KINDS[self._kind]} names no illuminant: taken as {light}.")
        observer = self._text(row, "observer") or self._observer or "1931"
        observer = "1964" if observer.startswith("10") or "1964" in observer else "1931"
        if lab:
            made = Swatch.from_lab(numbers if self._kind == "lab" else colorimetry.lch_to_lab(numbers), light, observer)
        else:
            made = Swatch.from_xyz(numbers if self._kind == "xyz" else colorimetry.xyy_to_xyz(numbers), light, observer)
        self._found.add(Swatch(name, made.color), group)
