"""The colors of an 8-bit picture, each once, so that a recolor is worked out for them and looked up for the pixels.

A photo of millions of pixels has some ten thousand colors. What is done to a pixel that is wholly of one region, or of
none, depends on its color alone; the others, along outlines and where corrections count, are worked out one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .compositing import Edge
from .picture import Picture, bands

# Codes of a color: three bytes; what is done to it stands above them. So many bits of red make a block.
_BYTES, _BLOCK = 24, 4
_WITHIN = (1 << _BLOCK) - 1

# Looking up saves time from so many pixels on, if no more than these shares of them are of a color of their own, or to
# be worked out one by one.
LEAST_PIXELS, _DISTINCT, _SINGLE = 200_000, 0.25, 0.1

# More regions would need large tables.
MOST_REGIONS = 16


class Part(Protocol):
    """What is looked at of a region; see :class:`recolor.RegionMatrix`."""

    @property
    def mask(self) -> NDArray | None:
        """(height, width) checked coverage."""

    @property
    def edge(self) -> Edge | None:
        """Pixels of the outline."""

    @property
    def extra(self) -> NDArray | None:
        """(height, width, n) corrections."""


class Palette:
    """The colors of a part of a picture, by the region that their pixels are wholly of.

    Parameters
    ----------
    picture
        Of uint8 codes.
    regions
        Where they overlap, a later one lies over an earlier one.
    box
        Rows and columns of the part.

    Attributes
    ----------
    codes
        (n, 3) uint8: the colors, those of no region first, then region by region.
    ends
        Where the colors of no region, and of each region, end in `codes`.
    inside
        Number of pixels that are wholly of a region.
    rows, columns
        (m,) positions of the pixels that are to be worked out one by one, in row order.
    places
        (m,) the same in the picture's pixels, counted along the rows.
    light
        (m, 3) float32 linear RGB of them.
    worthwhile
        Whether there are few colors, and few such pixels.
    """

    def __init__(self, picture: Picture, regions: Sequence[Part], box: tuple[slice, slice]) -> None:
        self.box = box
        kinds = len(regions) + 1
        height, width = (side.stop - side.start for side in box)
        seen = np.zeros(kinds << _BYTES - _BLOCK, bool)
        self.inside, singles, found = 0, [], {}
        for rows in bands(height, width, box[0].start):
            keys, inside, single = _keys(picture, regions, rows, box[1])
            self.inside += inside
            singles.append(single + (rows.start - box[0].start) * width)
            found[rows.start] = keys
            seen[keys >> _BLOCK] = True
        self.rows, self.columns = np.divmod(np.concatenate(singles), width)
        self.rows += box[0].start
        self.columns += box[1].start
        self.places = self.rows * picture.shape[1] + self.columns
        self.light = picture.at(self.rows, self.columns)
        # Few of all blocks are seen, and few of the colors in these: found in two steps, the tables stay small.
        blocks = np.flatnonzero(seen)
        number = np.empty(len(seen), np.intp)
        number[blocks] = np.arange(0, len(blocks) << _BLOCK, 1 << _BLOCK)
        seen = np.zeros(len(blocks) << _BLOCK, bool)
        for start, keys in found.items():
            within = keys & _WITHIN
            keys >>= _BLOCK
            within += number.take(keys)
            seen[within] = True
            found[start] = within
        self._found, self._slots = found, np.flatnonzero(seen)
        keys = (blocks[self._slots >> _BLOCK] << _BLOCK) | (self._slots & _WITHIN)
        self.codes = keys.astype("<u4").view(np.uint8).reshape(-1, 4)[:, :3]
        self.ends = np.searchsorted(keys, np.arange(1, kinds + 1) << _BYTES)
        area = height * width
        self.worthwhile = len(keys) <= _DISTINCT * area and len(self.rows) <= _SINGLE * area

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """(n,) how many pixels have each color."""
        found = sum(np.bincount(slots, minlength=self._slots[-1] + 1) for slots in self._found.values())
        return np.asarray(found)[self._slots]

    def table(self, values: NDArray[np.uint8]) -> NDArray[np.void]:
        """(n, 3) codes, one for each of `codes`, as what :meth:`look_up` looks up."""
        table = np.empty((self._slots[-1] + 1, 3), np.uint8)
        table[self._slots] = values
        return table.view("V3")[:, 0]

    def look_up(self, table: NDArray[np.void], rows: slice) -> NDArray[np.uint8]:
        """(m, 3) codes of the pixels of a band of the box, one of `picture.bands`."""
        return table.take(self._found[rows.start], mode="clip").view(np.uint8).reshape(-1, 3)


def _keys(
    picture: Picture, regions: Sequence[Part], rows: slice, columns: slice
) -> tuple[NDArray[np.intp], int, NDArray[np.intp]]:
    """Look at a band.

    Returns
    -------
    (n,) color of every pixel and, above that, 1 + its region; how many are wholly of one; (m,) those to be worked out
    one by one.
    """
    codes = picture.pixels[rows, columns]
    if codes.strides[2] != 1:
        codes = np.ascontiguousarray(codes)
    keys = codes[..., 2].astype(np.intp)
    keys <<= 16
    keys |= codes[..., :2].view("<u2")[..., 0]
    kind, single = np.zeros(keys.shape, np.uint8), np.zeros(keys.shape, bool)
    for number, region in enumerate(regions, 1):
        if region.mask is None:
            kind[...], single[...] = number, False
            continue
        mask = region.mask[rows, columns]
        whole = mask >= (np.iinfo(mask.dtype).max if mask.dtype.kind == "u" else 1)
        single |= mask > 0
        single &= ~whole
        np.copyto(kind, np.uint8(number), where=whole)
    for region in regions:
        if region.edge is not None:
            part = region.edge.within(rows)
            single[region.edge.rows[part] - rows.start, region.edge.columns[part] - columns.start] = True
        if region.extra is not None:
            single |= region.extra[rows, columns].any(axis=2)
    kind *= ~single
    above = kind.astype(np.intp)
    above <<= _BYTES
    keys |= above
    return keys.reshape(-1), int(np.count_nonzero(kind)), np.flatnonzero(single)
