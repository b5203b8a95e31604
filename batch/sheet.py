"""Contact sheets: labelled pictures side by side, to look at."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

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
    strips = [[(label, resized(picture, width)) for label, picture in row] for row in rows]
    heights = [strip[0][1].shape[0] + LABEL + GAP for strip in strips]
    across = max(len(strip) for strip in strips) * (width + GAP) + GAP
    paper = np.full((GAP + sum(heights), across, 3), _PAPER, np.uint8)
    top = GAP
    for strip, height in zip(strips, heights, strict=True):
        for k, (label, picture) in enumerate(strip):
            left, bottom = k * (width + GAP), top + picture.shape[0]
            paper[top:bottom, left + GAP : left + GAP + width] = picture
            paper[bottom : bottom + LABEL, left : left + GAP + width] = _text(label, width + GAP)
        top += height
    return paper


def resized(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """The picture at another width, filtered, in its own proportions."""
    if picture.shape[1] == width:
        return picture
    import OpenImageIO as oiio

    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    source = oiio.ImageBuf(np.ascontiguousarray(picture))
    small = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, 3))
    return np.asarray(small.get_pixels(oiio.UINT8))


@lru_cache(maxsize=64)  # all photos of a catalog have the same colorways
def _text(label: str, width: int) -> NDArray[np.uint8]:
    import OpenImageIO as oiio

    strip = oiio.ImageBuf(np.full((LABEL, width, 3), _PAPER, np.uint8))
    oiio.ImageBufAlgo.render_text(strip, GAP, LABEL - 12, label, 17, "", _INK)
    return np.asarray(strip.get_pixels(oiio.UINT8))
