"""What the readers and writers of swatch files have in common."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from ..library import Group, Library
from ..swatches import Color, Encoded, Stimulus, Swatch, is_plausible

type Inks = Literal["plain"] | Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""What CMYK means: a function from (n, 4) inks, 0..1, to (n, 3) L*a*b* under D50, as a profile has it; or "plain",
PostScript's (1 - ink) (1 - black) as sRGB codes, which no printer agrees with."""


class Bytes:
    """Big-endian numbers and texts out of bytes, with their place for errors.

    Parameters
    ----------
    data
        All of the file.
    name
        What errors call it.
    """

    def __init__(self, data: bytes, name: str) -> None:
        self._data, self._name, self.place = data, name, 0

    @property
    def left(self) -> int:
        """Number of bytes that are left."""
        return len(self._data) - self.place

    def take(self, layout: str) -> tuple[Any, ...]:
        """Unpack a `struct` layout, without its byte order."""
        size = struct.calcsize(">" + layout)
        values = struct.unpack(">" + layout, self.bytes(size))
        if any(isinstance(value, float) and not np.isfinite(value) for value in values):
            raise self.error("a number is not finite", self.place - size)
        return values

    def bytes(self, size: int) -> bytes:
        """Take so many bytes."""
        if size > self.left:
            raise self.error(f"{size} bytes are missing, as the file ends after {len(self._data)}")
        self.place += size
        return self._data[self.place - size : self.place]

    def text(self, units: int) -> str:
        """Take UTF-16 of so many code units, up to its end mark."""
        return clean(self.bytes(2 * units).decode("utf-16-be", "replace").split("\0")[0])

    def error(self, problem: str, place: int | None = None) -> FileError:
        """Make the error for what is wrong at a place, by default the present one."""
        at = self.place if place is None else place
        return FileError(f"'{self._name}', byte {at}: {problem}: save the file again, or give another one.")


class LineError(FileError):
    """A line of a text that cannot be understood."""

    def __init__(self, name: str, line: int, problem: str, remedy: str) -> None:
        super().__init__(f"'{name}', line {line}: {problem}: {remedy}.")


def decode(data: bytes) -> str:
    """Text of any of the usual encodings."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("cp1252", "replace")


def clean(text: str) -> str:
    """Text for one line, without what cannot be shown."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


class Collector:
    """Groups, swatches and notes as they come out of a file.

    Parameters
    ----------
    name
        Of the library.
    inks
        What CMYK means, see `Inks`.
    """

    def __init__(self, name: str, inks: Inks | None = None) -> None:
        self._name, self._inks = name, inks
        self._groups: dict[str, list[Swatch]] = {}
        self._notes: dict[str, None] = {}
        self._left_out: dict[str, int] = {}
        self._count = 0

    def add(self, swatch: Swatch, group: str = "") -> None:
        """Append a swatch to a group; one without a name is called by its number."""
        self._count += 1
        if not is_plausible(swatch.color):
            self.leave_out("out of the range of colors")
            return
        if not swatch.text:
            swatch = Swatch(f"Color {self._count}", swatch.color)
        self._groups.setdefault(group, []).append(swatch)

    def add_inks(self, inks: Iterable[float], name: str, group: str = "") -> None:
        """Append a swatch of four inks, 0..1, if what they mean is known."""
        cmyk = np.array([list(inks)], np.float64)
        if self._inks is None:
            self.leave_out("CMYK, which is no color without the profile of its printer")
        elif self._inks == "plain":
            self.note("CMYK is read as (1 - ink) (1 - black) in sRGB, without a profile: the colors are rough.")
            self.add(Swatch(name, Encoded(tuple(((1 - cmyk[0, :3]) * (1 - cmyk[0, 3])).tolist()))), group)
        else:
            lab = np.asarray(self._inks(cmyk), np.float64).reshape(3)
            self.add(Swatch(name, Swatch.from_lab(lab).color), group)

    def note(self, sentence: str) -> None:
        """Tell once what was assumed."""
        self._notes[sentence] = None

    def leave_out(self, what: str) -> None:
        """Count a swatch that cannot be used, and say why."""
        self._left_out[what] = self._left_out.get(what, 0) + 1

    def library(self) -> Library:
        """Make the library.

        Raises
        ------
        FileError
            If it would have no swatch.
        """
        left_out = [f"{count} swatches are {what}: they are left out." for what, count in self._left_out.items()]
        if not self._groups:
            reason = f" ({left_out[0].rstrip('.')})" if left_out else ""
            raise FileError(f"'{self._name}' has no swatch that can be used{reason}: give another file.")
        groups = tuple(Group(name, tuple(swatches)) for name, swatches in self._groups.items())
        return Library(self._name, groups, (*self._notes, *left_out))


def losses(library: Library, keeps: Callable[[Color], bool], holds: str) -> list[str]:
    """Say in words how many swatches a format holds only as something else."""
    lost = sum(not keeps(swatch.color) for swatch in library.swatches)
    return [f"{lost} of {len(library)} swatches are written as {holds}, as the format holds no more."] if lost else []


def is_srgb(color: Color) -> bool:
    """Tell whether a color is sRGB codes."""
    return isinstance(color, Encoded) and color.space == "srgb"


def is_print_lab(color: Color) -> bool:
    """Tell whether a color is one under D50 for the 2° observer, as Lab of print is."""
    return isinstance(color, Stimulus) and (color.illuminant, color.observer) == ("D50", "1931")
