"""Contact sheets: labelled pictures side by side, to look at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Paper around a picture, and height of the line under it, in pixels.
GAP, LABEL = 12, 34

_PAPER, _INK = 250, (0.13, 0.13, 0.13)


def contact_sheet(rows: Sequence[Sequence[tuple[str, NDArray[np.uint8]]]], width: int = 380) -> NDArray[np.uint8]:
    """Lay labelled pictures out in rows.

    Parameters
    ----------
    rows
        Of (label, picture); pictures are (height, width, 3) uint8 and of one shape within a row.
    width
        Of every picture on the sheet, in pixels.

    Returns
    -------
    (height, width, 3) uint8.
    """
    strips = [_row(row, width) for row in rows]
    across = max(strip.shape[1] for strip in strips)
    padded = [np.pad(s, ((0, 0), (0, across - s.shape[1]), (0, 0)), constant_values=_PAPER) for s in strips]
    return np.concatenate([np.full((GAP, across, 3), _PAPER, np.uint8), *padded])


def _row(cells: Sequence[tuple[str, NDArray[np.uint8]]], width: int) -> NDArray[np.uint8]:
    parts = []
    for label, picture in cells:
        small = resized(picture, width)
        cell = np.full((small.shape[0] + LABEL + GAP, width + GAP, 3), _PAPER, np.uint8)
        cell[: small.shape[0], GAP:] = small
        cell[small.shape[0] : small.shape[0] + LABEL] = _text(label, width + GAP)
        parts.append(cell)
    return np.concatenate([*parts, np.full((parts[0].shape[0], GAP, 3), _PAPER, np.uint8)], axis=1)


def resized(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """The picture at another width, filtered, in its own proportions."""
    if picture.shape[1] == width:
        return picture
    import OpenImageIO as oiio

    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    source = oiio.ImageBuf(np.ascontiguousarray(picture))
    small = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
    return np.asarray(small.get_pixels(oiio.UINT8))


def _text(label: str, width: int) -> NDArray[np.uint8]:
    import OpenImageIO as oiio

    strip = oiio.ImageBuf(np.full((LABEL, width, 3), _PAPER, np.uint8))
    oiio.ImageBufAlgo.render_text(strip, GAP, LABEL - 12, label, 17, "", _INK)
    return np.asarray(strip.get_pixels(oiio.UINT8))
