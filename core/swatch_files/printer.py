"""What four inks look like, by the ICC profile of their printer (ICC.1:2022, 10.10 and 10.11).

Only the tables that CMYK profiles of print have as a rule are read, lut8Type and lut16Type to Lab: the relative
colorimetric one, so that paper is white.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .reading import Inks

_REMEDY = "give another profile of the printer, or 'plain'"
_LARGEST_TABLE = 1 << 24


def inks_as(how: str | Path) -> Inks:
    """Say what CMYK means, for :func:`swatch_files.read`.

    Parameters
    ----------
    how
        "plain", or the path of an ICC profile for CMYK.

    Raises
    ------
    FileError
        If the profile cannot be read, or is of another kind.
    """
    if str(how) == "plain":
        return "plain"
    try:
        data = Path(how).read_bytes()
    except OSError as error:
        raise FileError(f"The profile '{how}' cannot be read ({error.strerror}): {_REMEDY}.") from None
    return profile_inks(data, Path(how).name)


def profile_inks(data: bytes, name: str = "CMYK profile") -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Make the function of a profile's bytes from inks (n, 4), 0..1, to L*a*b* (n, 3) under D50.

    Raises
    ------
    FileError
        If it is no profile for CMYK by such tables.
    """
    try:
        return _parse(data, name)
    except FileError:
        raise
    except (struct.error, ValueError):
        raise FileError(f"The profile '{name}' is damaged: {_REMEDY}.") from None


def _parse(data: bytes, name: str) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    if data[36:40] != b"acsp" or data[16:20] != b"CMYK" or data[20:24] != b"Lab ":
        raise FileError(f"The profile '{name}' is not one from CMYK to Lab: {_REMEDY}.")
    (count,) = struct.unpack_from(">I", data, 128)
    entries = [struct.unpack_from(">4sII", data, 132 + 12 * k) for k in range(min(count, 1000))]
    tags = {tag: data[start : start + size] for tag, start, size in entries}
    table = tags.get(b"A2B1") or tags.get(b"A2B0") or b""
    kind = table[:4]
    if kind not in (b"mft1", b"mft2") or tuple(table[8:10]) != (4, 3):
        raise FileError(f"The profile '{name}' has no table of 8 or 16 bits from CMYK to Lab: {_REMEDY}.")
    grid = table[10]
    if grid < 2 or grid**4 * 3 > _LARGEST_TABLE:
        raise ValueError
    wide = kind == b"mft2"
    n, m = struct.unpack_from(">2H", table, 48) if wide else (256, 256)
    numbers = np.frombuffer(table[52 if wide else 48 :], ">u2" if wide else np.uint8).astype(np.float64)
    sizes = 4 * n, grid**4 * 3, 3 * m
    if min(n, m) < 2 or len(numbers) < sum(sizes):
        raise ValueError
    curves, nodes, ends = np.split(numbers[: sum(sizes)], np.cumsum(sizes)[:2])
    top = 65535.0 if wide else 255.0
    return _Printer(
        curves.reshape(4, n) / top, nodes.reshape(grid, grid, grid, grid, 3) / top, ends.reshape(3, m) / top, wide
    )


class _Printer:
    """The tables of a profile: a curve for each ink, a grid of colors, a curve for each of L, a, b."""

    def __init__(self, curves: NDArray, nodes: NDArray, ends: NDArray, wide: bool) -> None:
        self._curves, self._nodes, self._ends = curves, nodes, ends
        # ICC.1:2022, 10.10: L of 100 is 0xFF00 in 16 bits, and a and b of 0 are 0x8000.
        self._scale = np.array([100.0, 255.0, 255.0]) * (65535 / 65280 if wide else 1.0)

    def __call__(self, inks: NDArray[np.float64]) -> NDArray[np.float64]:
        grid = self._nodes.shape[0]
        columns = np.clip(inks, 0, 1).T
        place = np.stack([_along(curve, ink) for curve, ink in zip(self._curves, columns, strict=True)]) * (grid - 1)
        low = np.minimum(place.astype(int), grid - 2)
        part = place - low
        color = np.zeros((inks.shape[0], 3))
        for corner in product((0, 1), repeat=4):
            weight = np.prod([p if c else 1 - p for p, c in zip(part, corner, strict=True)], axis=0)
            color += weight[:, None] * self._nodes[tuple(k + c for k, c in zip(low, corner, strict=True))]
        color = np.stack([_along(curve, value) for curve, value in zip(self._ends, color.T, strict=True)], axis=1)
        return color * self._scale - np.array([0.0, 128.0, 128.0])


def _along(curve: NDArray, place: NDArray) -> NDArray[np.float64]:
    return np.interp(place, np.linspace(0, 1, len(curve)), curve)
