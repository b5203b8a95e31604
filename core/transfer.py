"""Transfer curves between a file's codes and scene-linear light, and the tables that make them fast.

Codes are what a file stores: uint8, uint16, or a float in 0..1. Linear values are float32, 0 for no light and 1
for the white of the encoding. Curves go on below 0 by odd symmetry and above 1 by their own formula, so nothing
is clamped until integer codes are made.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray


@dataclass(frozen=True)
class ParametricCurve:
    """The parametric curve of ICC.1:2022, 10.18, function type 4: every common curve is one of these.

    Decoding: ``(a x + b) ** g + e`` where ``x >= d``, else ``c x + f``.
    """

    g: float
    a: float = 1.0
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0
    e: float = 0.0
    f: float = 0.0

    @property
    def is_linear(self) -> bool:
        """Whether codes are proportional to light already."""
        return self == LINEAR

    def decode(self, codes: ArrayLike) -> NDArray[np.float64]:
        """Codes (any shape, 0..1) to linear light."""
        x = np.asarray(codes, np.float64)
        if self.is_linear:
            return x.copy()
        size = np.abs(x)
        power = np.maximum(self.a * size + self.b, 0.0) ** self.g + self.e
        return np.copysign(np.where(size >= self.d, power, self.c * size + self.f), x)

    def encode(self, linear: ArrayLike) -> NDArray[np.float64]:
        """Linear light (any shape) to codes, 0..1 for light in 0..1."""
        y = np.asarray(linear, np.float64)
        if self.is_linear:
            return y.copy()
        size = np.abs(y)
        knee = (self.a * self.d + self.b) ** self.g + self.e
        power = (np.maximum(size - self.e, 0.0) ** (1.0 / self.g) - self.b) / self.a
        straight = (size - self.f) / self.c if self.c else np.zeros_like(size)
        return np.copysign(np.where(size >= knee, power, straight), y)


@dataclass(frozen=True)
class SampledCurve:
    """A curve given by equally spaced samples of linear light over codes 0..1 (ICC.1:2022, 10.6, ``curv``)."""

    samples: tuple[float, ...]
    is_linear = False

    def decode(self, codes: ArrayLike) -> NDArray[np.float64]:
        """Codes (any shape, 0..1) to linear light."""
        x = np.asarray(codes, np.float64)
        return np.copysign(np.interp(np.abs(x), np.linspace(0, 1, len(self.samples)), self.samples), x)

    def encode(self, linear: ArrayLike) -> NDArray[np.float64]:
        """Linear light (any shape) to codes, 0..1."""
        y = np.asarray(linear, np.float64)
        light = np.maximum.accumulate(np.array(self.samples))
        codes = np.linspace(0, 1, len(self.samples))
        return np.copysign(np.interp(np.abs(y), light, codes), y)


type Curve = ParametricCurve | SampledCurve

LINEAR = ParametricCurve(1.0)
SRGB = ParametricCurve(2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)  # IEC 61966-2-1
ADOBE_RGB = ParametricCurve(563 / 256)  # Adobe RGB (1998), 4.3.4.2
REC_2020 = ParametricCurve(  # ITU-R BT.2020-2, table 4 (12 bits), inverted; BT.709 to its precision
    1 / 0.45, 1 / 1.09929682680944, 0.09929682680944 / 1.09929682680944, 1 / 4.5, 4.5 * 0.018053968510807
)
PROPHOTO = ParametricCurve(1.8, c=1 / 16, d=1 / 32)  # ISO 22028-2 (ROMM RGB)


@lru_cache(maxsize=16)
def decode_table(curve: Curve, dtype: DTypeLike) -> NDArray[np.float32]:
    """Linear light of every code of an integer type.

    Parameters
    ----------
    curve
        The transfer curve of the file.
    dtype
        ``uint8`` or ``uint16``.

    Returns
    -------
    (256,) or (65536,) float32, read-only.
    """
    top = np.iinfo(np.dtype(dtype)).max
    table = curve.decode(np.arange(top + 1) / top).astype(np.float32)
    table.setflags(write=False)
    return table


@lru_cache(maxsize=4)
def _pair_table(curve: Curve) -> NDArray[np.float64]:
    """Linear light of every pair of 8-bit codes, as the bits of two float32 in one float64: half the look-ups."""
    pairs = np.arange(65536, dtype=np.uint16).view(np.uint8).reshape(-1, 2)
    table = decode_table(curve, np.uint8)[pairs].view(np.float64)[:, 0]
    table.setflags(write=False)
    return table


@dataclass(frozen=True)
class _Index:
    """How light becomes an index into an encoding table."""

    entries: int
    root: bool

    def of(self, light: NDArray[np.float32], out: NDArray[np.int32] | None = None) -> NDArray[np.int32]:
        """Indices of `light`, which is overwritten; to be clipped by the look-up."""
        if self.root:
            np.sqrt(np.maximum(light, 0, out=light), out=light)
        light *= np.float32(self.entries)
        if out is None:
            out = np.empty(light.shape, np.int32)
        np.copyto(out, light, casting="unsafe")
        return out


def _index(curve: Curve, dtype: np.dtype) -> _Index:
    """Choose an index fine enough for every code at the steep dark end, and no larger than the cache likes.

    Plain steps of light do for 8 bits where the curve starts with a straight line. 16 bits, and powers that start
    infinitely steep, are indexed by the square root of light, which spreads the dark end.
    """
    straight_start = isinstance(curve, ParametricCurve) and (curve.is_linear or curve.d > 0)
    if dtype == np.uint8:
        return _Index(1 << 16, False) if straight_start else _Index(1 << 13, True)
    return _Index(1 << 18, True)


@lru_cache(maxsize=16)
def _encode_table(curve: Curve, dtype: np.dtype) -> NDArray[np.unsignedinteger]:
    index = _index(curve, dtype)
    light = (np.arange(index.entries) + 0.5) / index.entries
    if index.root:
        light = light * light
    top = np.iinfo(dtype).max
    table = np.floor(np.clip(curve.encode(light), 0, 1) * top + 0.5).astype(dtype)
    # A code's own linear value must come back as that code, whichever way its index was rounded.
    own = np.minimum(index.of(decode_table(curve, dtype).copy()), index.entries - 1)
    alone = np.bincount(own, minlength=index.entries)[own] == 1
    table[own[alone]] = np.arange(top + 1, dtype=dtype)[alone]
    table.setflags(write=False)
    return table


def byte_codes(curve: Curve) -> tuple[NDArray[np.uint8], bool]:
    """(n,) codes that `encode` rounds light to, for n equal steps from 0 to 1 of it or, if told so, of its root."""
    byte = np.dtype(np.uint8)
    return _encode_table(curve, byte), _index(curve, byte).root


class Decoder:
    """Codes to linear light, band by band, into given arrays.

    Parameters
    ----------
    curve, dtype
        Of the codes.
    """

    def __init__(self, curve: Curve, dtype: DTypeLike) -> None:
        self._curve, self._dtype = curve, np.dtype(dtype)
        self._table = decode_table(curve, self._dtype) if self._dtype.kind == "u" else None
        self._pairs = _pair_table(curve) if self._dtype == np.uint8 else None

    def into(self, codes: NDArray, out: NDArray[np.float32]) -> NDArray[np.float32]:
        """Linear light of `codes`, in `out`, or the codes themselves if they are that already."""
        if self._pairs is not None and codes.size % 2 == 0 and codes.flags.c_contiguous and codes.ctypes.data % 2 == 0:
            flat = codes.reshape(-1).view(np.uint16)
            np.take(self._pairs, flat, out=out.reshape(-1).view(np.float64), mode="clip")
            return out
        if self._table is not None:
            return np.take(self._table, codes, out=out, mode="clip")
        if self._dtype == np.float32 and self._curve.is_linear:
            return codes
        np.copyto(out, codes if self._curve.is_linear else self._curve.decode(codes), casting="same_kind")
        return out


class Encoder:
    """Linear light to codes, band by band, into given arrays.

    Parameters
    ----------
    curve, dtype
        Of the codes.
    """

    def __init__(self, curve: Curve, dtype: DTypeLike) -> None:
        self._curve, self._dtype = curve, np.dtype(dtype)
        if self._dtype.kind == "u":
            self._index, self._table = _index(curve, self._dtype), _encode_table(curve, self._dtype)

    def into(self, linear: NDArray[np.float32], out: NDArray, room: NDArray[np.int32] | None = None) -> None:
        """Codes of `linear` (n, 3), which may be overwritten, in `out` (rows, columns, 3) with n pixels.

        `room` (n, 3), if given, is working memory.

        Integer codes are rounded to nearest and clipped to their range; the table behind them is exact at every
        code's own value and elsewhere within 0.8 code of the unrounded value, 0.9 for sampled curves.
        """
        if self._dtype.kind != "u":
            light = linear if self._curve.is_linear else self._curve.encode(linear)
            np.copyto(out, light.reshape(out.shape), casting="same_kind")
            return
        places = self._index.of(linear, room)
        if out.flags.c_contiguous:
            np.take(self._table, places, out=out.reshape(-1, 3), mode="clip")
        else:
            out[...] = np.take(self._table, places, mode="clip").reshape(out.shape)


def decode(codes: NDArray, curve: Curve) -> NDArray[np.float32]:
    """Codes of any supported type to scene-linear float32 of the same shape.

    Integer codes go through a table; float codes through the curve, unclamped.
    """
    if codes.dtype.kind == "u":
        return Decoder(curve, codes.dtype).into(codes, np.empty(codes.shape, np.float32))
    if curve.is_linear:
        return codes.astype(np.float32)
    return curve.decode(codes).astype(np.float32)


def encode(linear: NDArray, curve: Curve, dtype: DTypeLike) -> NDArray:
    """Scene-linear light (any shape) to codes of `dtype`, as :class:`Encoder` does."""
    dtype = np.dtype(dtype)
    if dtype.kind == "u":
        # Light far out of range would overflow the index, and a NaN has none: both are made plain first.
        light = np.nan_to_num(np.clip(linear, 0, 1), nan=0.0).astype(np.float32)
        return np.take(_encode_table(curve, dtype), _index(curve, dtype).of(light), mode="clip")
    if curve.is_linear:
        return np.asarray(linear).astype(dtype)
    return curve.encode(linear).astype(dtype)
