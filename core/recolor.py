"""The one path from pixels to recolored pixels, which every front end takes.

Under the plain models recoloring a region is a 3x3 matrix on linear light; under the others the same matrix with a
few more columns, for correction maps that the analysis made once. The work is done in bands that fit the cache, on
all cores, and only inside the region's bounding box; for the pixels of an 8-bit picture, which share few colors, it is
looked up (see `palette`).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import gamut, transfer
from .compositing import Edge
from .errors import ImageError
from .palette import LEAST_PIXELS, MOST_REGIONS, Palette
from .picture import Picture, as_weights, bands, bounding_box

# Pixels in one matrix product: under the size from which OpenBLAS spreads a product over threads, which is many
# times slower when another process uses the cores.
_PRODUCT_PIXELS = 24_000

# All products are of so many pixels times a whole number: OpenBLAS rounds the last ones of others in another way on
# some processors.
_TILE = 192

# Pixels that are worked out one by one at a time.
_SINGLES = 100_000

# Bands that one thread does in a row.
_STRIP_BANDS = 4


@dataclass(frozen=True, eq=False)
class RegionMatrix:
    """What is done to one region.

    Attributes
    ----------
    matrix
        (3, 3 + n): the pixel's linear RGB and its n corrections to linear RGB.
    mask
        (height, width) checked coverage, or None for the whole picture.
    edge
        The product's share in pixels of soft coverage, or None for plain blending.
    extra
        (height, width, n) float32 or float16 corrections, 0 where the plain model is enough; None for n = 0. They
        belong to the product alone: in pixels of soft coverage they count by it.
    """

    matrix: NDArray[np.float64]
    mask: NDArray | None = None
    edge: Edge | None = None
    extra: NDArray | None = None

    @cached_property
    def box(self) -> tuple[slice, slice] | None:
        """(rows, columns) that hold the region; None for the whole picture."""
        return None if self.mask is None else bounding_box(self.mask)


@dataclass(frozen=True)
class Shares:
    """How much of the recolored regions the output could not hold.

    Attributes
    ----------
    pixels
        Number of pixels in the regions.
    out_of_gamut
        Share of them, 0..1, outside the output's range before they were brought in.
    """

    pixels: int
    out_of_gamut: float


def recolor(
    picture: Picture,
    regions: Sequence[RegionMatrix],
    *,
    curve: transfer.Curve | None = None,
    dtype: DTypeLike = np.float32,
    out: NDArray | None = None,
    threads: int | None = None,
    convert: NDArray | None = None,
) -> tuple[NDArray, Shares]:
    """Apply the regions' matrices.

    Parameters
    ----------
    picture
        The photo.
    regions
        Where they overlap, a later one lies over an earlier one.
    curve, dtype
        Encoding of the result: uint8 or uint16 codes, or floats. Integer results are brought into gamut by
        :func:`gamut.fit_to_gamut`; float results are left as they are, below 0 and above 1 too. Without a curve
        the result is linear.
    out
        (height, width, 3 or more) array of `dtype` to write the first three channels of; may be the picture's own
        pixels if those may be lost. None for a new (height, width, 3).
    threads
        None for one per core.
    convert
        (3, 3) linear RGB of the photo to that of the result, for all of the picture; None for the same space.

    Returns
    -------
    out
        The recolored picture.
    shares
        What was outside the output's range; always 0 for floats.

    Raises
    ------
    ImageError
        If the picture has NaN or infinite pixels.
    """
    job = Recoloring(picture, regions, curve=curve, dtype=dtype, out=out, threads=threads, convert=convert)
    for _ in job.rows():
        pass
    return job.out, job.shares


class Recoloring:
    """A recolor that tells how far it is, so that a file can be encoded while it goes on.

    Parameters
    ----------
    picture, regions, curve, dtype, out, threads, convert
        As for :func:`recolor`.
    palette
        From :func:`shared_palette`, for several recolors of one picture by the same regions: the same result in less
        time.

    Attributes
    ----------
    out
        The result; its rows are done as far as :meth:`rows` has told.
    shares
        What was outside the output's range, once all rows are done.
    """

    def __init__(
        self,
        picture: Picture,
        regions: Sequence[RegionMatrix],
        *,
        curve: transfer.Curve | None = None,
        dtype: DTypeLike = np.float32,
        out: NDArray | None = None,
        threads: int | None = None,
        convert: NDArray | None = None,
        palette: Palette | None = None,
    ) -> None:
        self._dtype = np.dtype(dtype)
        self._height, self._width = picture.shape
        self._threads = threads or os.process_cpu_count() or 1
        self.out = np.empty((self._height, self._width, 3), self._dtype) if out is None else out
        self.shares = Shares(0, 0.0)
        self._rows, columns = palette.box if palette else _bounds(regions, self._height, self._width)
        if self._dtype != picture.pixels.dtype or (curve or transfer.LINEAR) != picture.curve or convert is not None:
            # Everything must be encoded anew.
            self._rows, columns = slice(0, self._height), slice(0, self._width)
        self._job = _Job(picture, regions, columns, curve or transfer.LINEAR, self._dtype, self.out, convert)
        self._palette = palette

    def rows(self) -> Iterator[int]:
        """Do the work; yields the number of rows from the top that are done, growing to the height.

        Raises
        ------
        ImageError
            If the picture has NaN or infinite pixels.
        """
        job, counts = self._job, []
        columns = job.columns
        if self._palette is not None and self._dtype == np.uint8 and self._palette.box == (self._rows, columns):
            job.look_up(self._palette)
        whole = (self._rows.stop - self._rows.start, columns.stop - columns.start) == (self._height, self._width)
        if not whole and not np.shares_memory(self.out, job.picture.pixels):
            np.copyto(self.out[..., :3], job.picture.pixels[..., :3])
        parts = list(bands(self._rows.stop - self._rows.start, max(1, columns.stop - columns.start), self._rows.start))
        strips = [parts[k : k + _STRIP_BANDS] for k in range(0, len(parts), _STRIP_BANDS)]
        if min(self._threads, len(strips)) <= 1:
            for strip in strips:
                counts.append(job.run(strip))
                yield strip[-1].stop
        else:
            pool = ThreadPoolExecutor(min(self._threads, len(strips)))
            try:
                for strip, result in zip(strips, [pool.submit(job.run, strip) for strip in strips], strict=True):
                    counts.append(result.result())
                    yield strip[-1].stop
            finally:
                pool.shutdown(cancel_futures=True)
        pixels, outside = (sum(c) for c in zip(job.looked_up, *counts, strict=True))
        self.shares = Shares(int(pixels), float(outside / pixels) if pixels else 0.0)
        yield self._height


def shared_palette(picture: Picture, regions: Sequence[RegionMatrix]) -> Palette | None:
    """Colors of the part of a picture that these regions change, for several recolors; None where they are no help."""
    box = rows, columns = _bounds(regions, *picture.shape)
    few = (rows.stop - rows.start) * (columns.stop - columns.start) < LEAST_PIXELS
    if few or picture.pixels.dtype != np.uint8 or len(regions) > MOST_REGIONS:
        return None
    palette = Palette(picture, regions, box)
    return palette if palette.worthwhile else None


def _bounds(regions: Sequence[RegionMatrix], height: int, width: int) -> tuple[slice, slice]:
    boxes = [r.box for r in regions]
    if any(b is None for b in boxes):
        return slice(0, height), slice(0, width)
    known = [b for b in boxes if b is not None and b[0].stop > b[0].start]
    if not known:
        return slice(0, 0), slice(0, 0)
    return (
        slice(min(b[0].start for b in known), max(b[0].stop for b in known)),
        slice(min(b[1].start for b in known), max(b[1].stop for b in known)),
    )


class _Job:
    """One recolor: what the threads share."""

    def __init__(
        self,
        picture: Picture,
        regions: Sequence[RegionMatrix],
        columns: slice,
        curve: transfer.Curve,
        dtype: np.dtype,
        out: NDArray,
        convert: NDArray | None = None,
    ) -> None:
        self.picture, self.regions, self.columns, self.out = picture, regions, columns, out
        self.curve, self.dtype = curve, dtype
        self.integer, self.floats = dtype.kind == "u", picture.pixels.dtype.kind == "f"
        # Linear float32 needs no encoding: the result is made where it belongs.
        self.same_codes = dtype == picture.pixels.dtype and curve == picture.curve and convert is None
        # Float codes do not survive decoding and encoding to the last bit: outside the regions they are put back.
        self.restore = (
            self.same_codes and self.floats and not curve.is_linear and all(r.mask is not None for r in regions)
        )
        self.direct = dtype == np.float32 and curve.is_linear and not np.shares_memory(out, picture.pixels)
        self.convert = None if convert is None else np.ascontiguousarray(convert.T, np.float32)
        # A pixel times the transposed matrix, so that (n, 3) rows need no turning round.
        self.matrices = [np.ascontiguousarray(r.matrix[:, :3].T, np.float32) for r in regions]
        self.changes = [np.ascontiguousarray((r.matrix[:, :3] - np.eye(3)).T, np.float32) for r in regions]
        self.corrections = [np.ascontiguousarray(r.matrix[:, 3:].T, np.float32) for r in regions]
        # What is done to a pixel must not depend on those beside it.
        self.plain = len(regions) == 1 and regions[0].mask is None
        self.palette: Palette | None = None
        self.looked_up = 0, 0

    def look_up(self, palette: Palette) -> None:
        """Work out all colors of the picture, and the pixels that need more than their color."""
        linear = transfer.decode(palette.codes, self.picture.curve)
        result = linear.copy()
        for k, change in enumerate(self.changes):
            part = slice(*palette.ends[k : k + 2])
            if self.plain:
                _product(linear[part], self.matrices[k], result[part])
            else:
                result[part] += _product(linear[part], change, np.empty_like(linear[part]))
        codes, beyond = self._encoded(result)
        self.recolored = palette.table(codes)
        singles = [self._singly(palette, start) for start in range(0, len(palette.rows), _SINGLES)]
        self.singles = np.concatenate([np.empty((0, 3), np.uint8), *(codes for codes, _, _ in singles)])
        outside = int(palette.counts[beyond].sum()) if beyond.any() else 0
        self.looked_up = palette.inside + sum(s[1] for s in singles), outside + sum(s[2] for s in singles)
        self.palette = palette

    def _singly(self, palette: Palette, start: int) -> tuple[NDArray[np.uint8], int, int]:
        """Recolor some pixels one by one; returns their codes, how many are inside regions, and out of gamut."""
        part = slice(start, start + _SINGLES)
        y, x, here, linear = palette.rows[part], palette.columns[part], palette.places[part], palette.light[part]
        weights = [None if r.mask is None else as_weights(r.mask[y, x]) for r in self.regions]
        extras = [None if r.extra is None else r.extra[y, x] for r in self.regions]
        edges = []
        for region in self.regions:
            at, share = _edge(region.edge, slice(int(y[0]), int(y[-1]) + 1), 0, self.picture.shape[1])
            at += y[0] * self.picture.shape[1]
            known = slice(*np.searchsorted(at, (here[0], here[-1] + 1)))
            edges.append((np.searchsorted(here, at[known]), share[known]))
        result = np.empty_like(linear)
        inside = self._blend(linear, weights, edges, extras, result)
        codes, beyond = self._encoded(result)
        return codes, inside, int(np.count_nonzero(beyond))

    def _encoded(self, result: NDArray[np.float32]) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """(n, 3) codes of recolored colors, which are overwritten, and which of them are out of gamut."""
        if self.convert is not None:
            result = _product(result, self.convert, np.empty_like(result))
        beyond = gamut.out_of_gamut(result)
        gamut.fit_to_gamut(result)
        codes = np.empty((1, len(result), 3), np.uint8)
        transfer.Encoder(self.curve, self.dtype).into(result, codes)
        return codes[0], beyond

    def _run_looked_up(self, palette: Palette, rows: slice) -> None:
        target = self.out[rows, self.columns, :3]
        target[...] = palette.look_up(self.recolored, rows).reshape(target.shape)
        first, last = np.searchsorted(palette.rows, (rows.start, rows.stop))
        self.out[palette.rows[first:last], palette.columns[first:last], :3] = self.singles[first:last]

    def run(self, parts: list[slice]) -> tuple[int, int]:
        """Recolor these bands; returns (pixels in regions, pixels out of gamut)."""
        if self.palette is not None:
            for rows in parts:
                self._run_looked_up(self.palette, rows)
            return 0, 0
        inside = outside = 0
        if not parts:
            return 0, 0
        width = self.columns.stop - self.columns.start
        size = max(p.stop - p.start for p in parts) * width
        scratch = np.empty((size, 3), np.float32)
        product = np.empty((size, 3), np.float32)
        decoder = transfer.Decoder(self.picture.curve, self.picture.pixels.dtype)
        encoder = transfer.Encoder(self.curve, self.dtype)
        for rows in parts:
            n = (rows.stop - rows.start) * width
            stored = self.picture.pixels[rows, self.columns, :3]
            target = self.out[rows, self.columns, :3]
            weights = [self._weights(region, rows) for region in self.regions]
            if self.same_codes and all(w is not None and not w.any() for w in weights):
                target[...] = stored
                continue
            linear = decoder.into(stored.reshape(n, 3), scratch[:n])
            in_target = self.direct and target.flags.c_contiguous
            result = target.reshape(n, 3) if in_target else product[:n]
            with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is told in words below
                inside += self._apply(rows, linear, weights, result)
                if self.convert is not None:
                    result[...] = _product(result, self.convert, scratch[:n])
            if self.floats and not np.isfinite(np.vdot(result, result)):
                _check_finite(result)
            if self.integer:
                outside += gamut.fit_to_gamut(result)
            if not in_target:
                before = stored.copy() if self.restore else stored
                encoder.into(result, target, scratch[:n].view(np.int32))
                if self.restore:
                    outer = np.all([w == 0 for w in weights if w is not None], axis=0).reshape(target.shape[:2])
                    target[outer] = before[outer]
        return inside, outside

    def _apply(
        self,
        rows: slice,
        linear: NDArray[np.float32],
        weights: list[NDArray[np.float32] | None],
        result: NDArray[np.float32],
    ) -> int:
        """Recolor one band into `result`; returns the number of pixels inside regions."""
        columns = self.columns
        extras = [None if r.extra is None else _flat(r.extra[rows, columns]) for r in self.regions]
        edges = [_edge(r.edge, rows, columns.start, columns.stop - columns.start) for r in self.regions]
        return self._blend(linear, weights, edges, extras, result)

    def _blend(
        self,
        linear: NDArray[np.float32],
        weights: list[NDArray[np.float32] | None],
        edges: list[tuple[NDArray[np.intp], NDArray[np.float32]]],
        extras: list[NDArray | None],
        result: NDArray[np.float32],
    ) -> int:
        """Recolor (n, 3) pixels by (n,) weights of the regions, places and shares of edges, and (n, k) corrections."""
        if self.plain:
            _product(linear, self.matrices[0], result)
            correction = self._correction(0, extras[0])
            if correction is not None:
                result += correction
            return len(linear)
        np.copyto(result, linear)
        room = np.ones(len(linear), np.float32)
        for k in reversed(range(len(self.regions))):
            asked = weights[k]
            if asked is None:
                asked = np.ones(len(linear), np.float32)
            granted = np.minimum(asked, room)
            room -= granted
            change = _product(linear, self.changes[k], np.empty_like(linear))
            change *= granted[:, None]
            at, share = edges[k]
            if len(at):
                scale = granted[at] / np.maximum(asked[at], 1e-6)
                change[at] = _product(share, self.changes[k], np.empty_like(share)) * scale[:, None]
            correction = self._correction(k, extras[k])
            if correction is not None:
                change += correction * granted[:, None]
            result += change
        return int(np.count_nonzero(room < 1))

    def _correction(self, k: int, extra: NDArray | None) -> NDArray[np.float32] | None:
        """(n, 3) what (n, k) corrections of region `k` add; None where they are all 0."""
        if extra is None or not extra.any():
            return None
        maps = extra.astype(np.float32, copy=False)
        return _product(maps, self.corrections[k], np.empty((len(maps), 3), np.float32))

    def _weights(self, region: RegionMatrix, rows: slice) -> NDArray[np.float32] | None:
        if region.mask is None:
            return None
        return as_weights(region.mask[rows, self.columns]).reshape(-1)


def _edge(edge: Edge | None, rows: slice, left: int, width: int) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Places in a band that begins at column `left`, and (n, 3) shares, of the pixels of an edge."""
    if edge is None:
        return np.empty(0, np.intp), np.empty((0, 3), np.float32)
    part = edge.within(rows)
    return (edge.rows[part] - rows.start) * width + edge.columns[part] - left, edge.share[part]


def _flat(extra: NDArray) -> NDArray:
    return extra.reshape(-1, extra.shape[2])


def _product(pixels: NDArray[np.float32], matrix: NDArray[np.float32], out: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n, m) pixels times (m, 3), in `out`: the same for the same pixel, wherever among others it stands."""
    multiply = np.dot if len(matrix) == 1 else np.matmul  # which is three times slower for a single column
    whole = len(pixels) // _TILE * _TILE
    for start in range(0, whole, _PRODUCT_PIXELS):
        part = slice(start, min(start + _PRODUCT_PIXELS, whole))
        multiply(pixels[part], matrix, out=out[part])
    if whole < len(pixels):
        rest = np.zeros((_TILE, pixels.shape[1]), np.float32)
        rest[: len(pixels) - whole] = pixels[whole:]
        out[whole:] = multiply(rest, matrix)[: len(pixels) - whole]
    return out


def _check_finite(pixels: NDArray) -> None:
    bad = int(np.count_nonzero(~np.isfinite(pixels).all(axis=-1)))
    if bad:  # the sum of squares of huge ordinary numbers may overflow without one
        raise ImageError("Picture has NaN or infinite pixels: repair them before recoloring.")
