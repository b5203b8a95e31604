"""A picture as the core sees it: scene-linear RGB on demand, whatever the pixels are stored as."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import transfer
from .errors import ImageError, MaskError

# Pixels in one band: its working arrays fit the second-level cache, and the calls for it are few.
BAND_PIXELS = 72_000


class Picture:
    """Pixels and the curve that linearizes them; nothing is decoded before it is asked for.

    Parameters
    ----------
    pixels
        (height, width, 3 or more), top row first: uint8 or uint16 codes, or floats. Channels after the third are
        carried along by the front ends and not looked at here.
    curve
        The transfer curve of the pixels. Without one they must be floats, scene-linear.

    Raises
    ------
    ImageError
        If the array is not a picture, or holds integer codes and no curve is given.
    """

    def __init__(self, pixels: ArrayLike, curve: transfer.Curve | None = None) -> None:
        try:
            array = np.asarray(pixels)
        except ValueError:
            raise ImageError("Picture is ragged: give an array (height, width, 3), linear RGB.") from None
        if array.ndim != 3 or array.shape[2] < 3:
            raise ImageError(f"Picture has shape {array.shape}: give (height, width, 3), linear RGB.")
        if 0 in array.shape:
            raise ImageError(f"Picture of shape {array.shape} has no pixels: give one of at least 1 x 1.")
        if array.dtype.kind not in "fu" or (array.dtype.kind == "u" and array.dtype.itemsize > 2):
            raise ImageError(f"Picture has dtype {array.dtype}: give float32, linear RGB.")
        if array.dtype.kind == "u" and curve is None:
            raise ImageError(
                f"Picture holds {array.dtype} codes: decode them to linear floats first "
                "(dyehouse.core.transfer.decode)."
            )
        self.pixels = array
        self.curve = curve or transfer.LINEAR

    @classmethod
    def of(cls, image: ArrayLike | Picture) -> Picture:
        """Take a picture as it is, and an array as scene-linear floats."""
        return image if isinstance(image, Picture) else cls(image)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        return self.pixels.shape[0], self.pixels.shape[1]

    def linear(self, rows: slice = slice(None), columns: slice = slice(None)) -> NDArray[np.float32]:
        """(height, width, 3) float32 scene-linear RGB of a part; may be a view of the pixels, do not write to it."""
        part = self.pixels[rows, columns, :3]
        if part.dtype == np.float32 and self.curve.is_linear:
            return part
        return transfer.decode(part, self.curve)

    def at(self, rows: NDArray, columns: NDArray) -> NDArray[np.float32]:
        """(n, 3) linear RGB of n pixels."""
        return transfer.decode(self.pixels[rows, columns, :3], self.curve)

    def sample(self, most: int, mask: NDArray | None = None, extra: NDArray | None = None) -> NDArray[np.float32]:
        """(n, 3) linear pixels on a regular grid, about `most` of them or all; with a mask, well inside it only.

        With `extra`, an array (height, width, k), its channels come after the colors: (n, 3 + k).
        """
        height, width = self.shape

        def part(rows: slice = slice(None), columns: slice = slice(None)) -> NDArray[np.float32]:
            linear = self.linear(rows, columns)
            return linear if extra is None else np.concatenate([linear, extra[rows, columns]], axis=2, dtype=np.float32)

        if mask is None:
            step = _step(height * width, most)
            some = part(slice(step // 2, None, step), slice(step // 2, None, step))
            return some.reshape(-1, some.shape[2])
        inside = strongest(mask)
        step = _step(int(np.count_nonzero(inside)), most)
        grid = inside[step // 2 :: step, step // 2 :: step]
        if not grid.any():
            return part()[inside]
        return part(slice(step // 2, None, step), slice(step // 2, None, step))[grid]

    @cached_property
    def overview(self) -> NDArray[np.float32]:
        """(n, 3) linear pixels from all over the picture."""
        return self.sample(60_000)

    @cached_property
    def clip_level(self) -> float:
        """Linear value from which a channel counts as clipped; infinite for scene-linear floats without a top."""
        if self.pixels.dtype.kind == "u":
            return 1.0 - 1e-6
        top = float(self.overview.max())
        return 1.0 - 1e-6 if 1.0 - 1e-6 <= top <= 1.0 + 1e-6 else np.inf


def _step(pixels: int, most: int) -> int:
    return max(1, int(np.ceil(np.sqrt(pixels / most))))


def bands(height: int, width: int, start: int = 0) -> Iterator[slice]:
    """Row slices of about `BAND_PIXELS` pixels each, from row `start` to `start + height`."""
    rows = max(1, BAND_PIXELS // max(1, width))
    for top in range(start, start + height, rows):
        yield slice(top, min(top + rows, start + height))


def strips(height: int, width: int) -> Iterator[tuple[int, int]]:
    """(top, bottom) of strips of rows that are worth one step of array work, and small beside the picture."""
    rows = max(1, 5 * BAND_PIXELS // width)
    for top in range(0, height, rows):
        yield top, min(height, top + rows)


# A mask needs a pixel covered by more than this: codes of 0 and 1 are a mistake, not a mask.
_LEAST_COVERAGE = 0.02


def as_mask(mask: ArrayLike | None, shape: tuple[int, int]) -> NDArray | None:
    """Check a mask against a picture.

    Parameters
    ----------
    mask
        (height, width): bool, uint8 or uint16 codes of coverage, or floats in 0..1; None for the whole picture.
    shape
        (height, width) of the picture.

    Raises
    ------
    MaskError
        If the size differs, a value is out of range, or nothing is selected.
    """
    if mask is None:
        return None
    try:
        m = np.asarray(mask)
    except ValueError:
        raise MaskError("Mask is ragged: give an array (height, width).") from None
    if m.dtype == bool:
        m = m.astype(np.uint8) * np.uint8(255)
    if m.dtype.kind not in "fu" or (m.dtype.kind == "u" and m.dtype.itemsize > 2):
        raise MaskError(f"Mask has dtype {m.dtype}: give coverage as floats in 0..1, or bool.")
    if m.shape != shape:
        raise MaskError(
            f"Mask is {_size(m.shape)} and the picture is {_size(shape)}: give a mask of the picture's size."
        )
    # Written so that a NaN fails too.
    if m.dtype.kind == "f" and not ((m >= -1e-6) & (m <= 1 + 1e-6)).all():
        raise MaskError("Mask has values outside 0..1: scale coverage so that 1 is fully selected.")
    if not as_weights(m).max() > _LEAST_COVERAGE:
        if m.any():
            raise MaskError(
                "Mask selects next to nothing: its brightest pixel is almost black; make the product white."
            )
        raise MaskError("Mask selects nothing: every pixel of it is 0, so there is no product to recolor.")
    return m


def coverage(mask: NDArray) -> float:
    """Mean coverage of a mask, 0..1."""
    return float(mask.mean(dtype=np.float64)) / (np.iinfo(mask.dtype).max if mask.dtype.kind == "u" else 1)


def as_weights(mask: NDArray) -> NDArray[np.float32]:
    """Coverage of a checked mask (or a part of one) as float32 in 0..1."""
    if mask.dtype.kind == "u":
        return mask.astype(np.float32) * np.float32(1 / np.iinfo(mask.dtype).max)
    return mask.astype(np.float32, copy=False)


def above(mask: NDArray, level: float) -> NDArray[np.bool_]:
    """Where a checked mask covers more than `level`, 0..1, without its weights as floats."""
    return mask > (int(level * np.iinfo(mask.dtype).max) if mask.dtype.kind == "u" else level)


def strongest(mask: NDArray) -> NDArray[np.bool_]:
    """Where a checked mask covers all of a pixel, or, if it is soft all over, where it covers most."""
    return above(mask, 0.95 * min(1.0, float(as_weights(mask.max()))))


def bounding_box(mask: NDArray) -> tuple[slice, slice]:
    """(rows, columns) that hold everything a mask covers; empty slices if that is nothing."""
    rows, columns = np.flatnonzero(mask.max(axis=1)), np.flatnonzero(mask.max(axis=0))
    if len(rows) == 0:
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def block_means(values: NDArray, step: int) -> NDArray[np.float32]:
    """(h, w, n) means of the step x step blocks of a (height, width, n) map; incomplete ones are left out."""
    rows, columns, count = values.shape[0] // step, values.shape[1] // step, values.shape[2]
    by_row = values[: rows * step].reshape(rows, step, -1).sum(axis=1, dtype=np.float32)
    # As a product, for sums of a few numbers that lie apart are slow.
    mean = np.tile(np.eye(count, dtype=np.float32) / np.float32(step * step), (step, 1))
    return by_row[:, : columns * step * count].reshape(rows, columns, step * count) @ mean


def _size(shape: tuple[int, ...]) -> str:
    return f"{shape[1]} x {shape[0]} pixels" if len(shape) == 2 else f"of shape {shape}"
