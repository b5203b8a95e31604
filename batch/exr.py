"""The header of an OpenEXR file, where OpenImageIO is not there to read it (OpenEXR, "OpenEXR File Layout")."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError

# A header is a few hundred bytes, or as long as the names in a cryptomatte.
_LONGEST = 1 << 24


class Header:
    """Attributes of the first part of a file; answers as an OpenImageIO.ImageSpec does.

    Parameters
    ----------
    path
        The file.

    Attributes
    ----------
    attributes
        By name: type and bytes.
    end
        Where the header ends in the file.

    Raises
    ------
    FileError
        If it is no EXR.
    """

    def __init__(self, path: Path) -> None:
        self.attributes: dict[str, tuple[str, bytes]] = {}
        with path.open("rb") as file:
            data = file.read(_LONGEST)
        try:
            if data[:4] != b"v/1\x01":
                raise ValueError
            place = 8
            while data[place]:
                name = _text(data, place)
                place += len(name) + 1
                kind = _text(data, place)
                place += len(kind) + 1
                size = struct.unpack_from("<i", data, place)[0]
                self.attributes[name] = kind, data[place + 4 : place + 4 + size]
                place += 4 + size
            self.end = place + 1
        except (IndexError, ValueError, struct.error):
            raise FileError(f"'{path}' is damaged or no EXR: copy it again from its source.") from None

    @property
    def channels(self) -> dict[str, str]:
        """Names of the channels and their types: "uint", "half" or "float"."""
        data, place, found = self.attributes["channels"][1], 0, {}
        while place < len(data) and data[place]:
            name = _text(data, place)
            place += len(name) + 1
            found[name] = ("uint", "half", "float")[struct.unpack_from("<i", data, place)[0]]
            place += 16
        return found

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the pixels."""
        left, top, right, bottom = struct.unpack("<4i", self.attributes["dataWindow"][1])
        return bottom - top + 1, right - left + 1

    def getattribute(self, name: str) -> Any:
        """The value of a number, a text or chromaticities; None for what is not there or of another kind."""
        kind, data = self.attributes.get(name, ("", b""))
        if kind == "string":
            return data.decode("utf-8", "replace")
        form = {"int": "<i", "float": "<f", "chromaticities": "<8f"}.get(kind)
        if form is None:
            return None
        values = struct.unpack(form, data)
        return values if len(values) > 1 else values[0]

    def get_string_attribute(self, name: str, default: str = "") -> str:
        """A text."""
        found = self.getattribute(name)
        return found if isinstance(found, str) else default

    def get_int_attribute(self, name: str, default: int = 0) -> int:
        """A whole number."""
        found = self.getattribute(name)
        return found if isinstance(found, int) else default


def _text(data: bytes, place: int) -> str:
    return data[place : data.index(0, place)].decode("latin-1")


def tell_space(path: Path, chromaticities: Sequence[float]) -> None:
    """Say in a scan line EXR which primaries and white it has, instead of what its encoder wrote.

    Parameters
    ----------
    path
        A file of one part that nobody else uses yet.
    chromaticities
        x and y of red, green, blue and white.
    """
    header = Header(path)
    kept = {name: a for name, a in header.attributes.items() if name not in ("colorInteropID", "chromaticities")}
    kept["chromaticities"] = "chromaticities", struct.pack("<8f", *chromaticities)
    data = path.read_bytes()
    made = data[:8] + b"".join(
        f"{name}\0{kind}\0".encode("latin-1") + struct.pack("<i", len(value)) + value
        for name, (kind, value) in kept.items()
    )
    made += b"\0"
    # Where each chunk of lines begins: the table ends where the first of them does.
    table = np.frombuffer(data, "<u8", (struct.unpack_from("<Q", data, header.end)[0] - header.end) // 8, header.end)
    shifted = (table.astype(np.int64) + len(made) - header.end).astype("<u8")
    path.write_bytes(made + shifted.tobytes() + data[header.end + table.nbytes :])
