"""The region that a click means, in dichromatic terms: all of one material, whatever its shading and gloss.

Shading moves a pixel along the line from black through the body color, gloss moves it from there toward the white.
So a pixel is of the clicked material if it lies in the plane of body color and white, near the body line; how
bright it is does not matter. From the click this grows over connected pixels, bridges narrow gaps (a strap, a
seam), and takes in what the material surrounds: highlights, clipped cores and deep shadow, but not a patch of
another color.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .dichromatic import sine
from .errors import MaskError
from .neighborhood import dilate, erode, mean_at, window
from .picture import Picture, bands, block_means, strips
from .reference import DARK, _plane, check_pixel, read_window, trimmed_mean

# Pixels of the reduced picture on which the region is grown.
_WORKING_PIXELS = 300_000

# Pixels of a selection from which its scatter is learned.
_LEARNED_PIXELS = 30_000

# Half the step of 8-bit sRGB codes near black, in linear light.
_DARK_STEP = 1.5e-4


@dataclass(frozen=True)
class _Tolerance:
    """Angles, in degrees, within which a pixel counts as of the material.

    Out of the plane of body color and white; within the plane, toward the white and away from it. `tilt` is the
    slope by which the plane itself is turned about the body color: what a white that is not quite right does.
    """

    out: float
    toward: float
    away: float
    tilt: float = 0.0


# The first growth is strict. What it finds shows how far the material itself scatters, and the second growth
# accepts four times that, within these bounds.
_STRICT = _Tolerance(1.6, 4.0, 4.0)
_LEAST = _Tolerance(1.8, 4.5, 4.5)
_MOST = _Tolerance(4.0, 14.0, 10.0)
_MOST_TILT = 0.4

# Within this angle of the white, in degrees, a product is almost grey, and steps of brightness of this size (natural
# logarithm, from pixel to pixel) bound it.
_PALE = 9.0
_STEP = 0.12

# Around a click, in pixels of the reduced picture, colors may differ by this angle before they count as texture.
_NEAR = 7
_TEXTURED = 6.0

# How far highlights may leave the plane, as a slope: lights differ a little, and clipping bends them.
_GLOSS_SLOPE = 0.18

# How far sheen may go toward the white, as a slope, and how little the color may change, from one pixel to the next,
# where a large highlight or fold passes over to the body: as a share of the lighter pixel.
_SHEEN_SLOPE = 0.5
_SMOOTH = 0.2

# Half the width, in pixels of the reduced picture, of the seam between two materials that are both selected.
_SEAM = 2

# How far folds may leave it.
_FOLD_SLOPE = 0.21


def region_at(
    picture: Picture, click: ArrayLike, white: NDArray | None = None, tolerance: float = 1.0
) -> NDArray[np.uint8]:
    """Select the material under a click; see :func:`region_from_clicks`."""
    return region_from_clicks(picture, click, white=white, tolerance=tolerance)


def region_from_clicks(
    picture: Picture,
    click: ArrayLike,
    added: Sequence[ArrayLike] = (),
    removed: Sequence[ArrayLike] = (),
    white: NDArray | None = None,
    tolerance: float = 1.0,
) -> NDArray[np.uint8]:
    """Select the material under a click, with what more clicks add and without what others take away.

    Parameters
    ----------
    picture
        The photo.
    click
        (x, y) from the top left, on a matte, lit part of the product.
    added, removed
        Further such clicks. What a click in `removed` would select goes, whichever click brought it.
    white
        (3,) white of the light; None for ones.
    tolerance
        Factor on the accepted difference in color: 0.5 is strict, 2 is generous.

    Returns
    -------
    (height, width) uint8 coverage, 255 inside, with a soft edge of one to three pixels around the whole; where
    materials of the selection meet there is no edge.

    Raises
    ------
    ReferenceColorError
        If a click lies outside the picture.
    MaskError
        If a click is on black, nothing is left, or the tolerance is not above zero.
    """
    if not tolerance > 0:
        raise MaskError(f"Tolerance {tolerance} is not above zero: 1 is ordinary, 0.5 strict, 2 generous.")
    w = np.ones(3) if white is None else np.asarray(white, np.float64)
    pixels = [check_pixel(picture, at, "Click") for at in (click, *added, *removed)]
    height, width = picture.shape
    step = max(1, int(np.ceil(np.sqrt(height * width / _WORKING_PIXELS))))
    small = shrink(picture, step)
    parts = [_grown_from(picture, small, step, pixel, w, tolerance) for pixel in pixels]
    kept = 1 + len(added)
    inside = parts[0][0]
    for grown, _ in parts[1:kept]:
        # Where two materials meet, mixed pixels look like neither.
        inside = inside | grown | (dilate(inside, _SEAM) & dilate(grown, _SEAM))
    for grown, _ in parts[kept:]:
        inside = inside & ~grown
    if not inside.any():
        raise MaskError("The clicks that take away leave nothing of the region: drop one, or lower the tolerance.")
    cover = _soft_edge(picture, small, inside, step)
    textured = [grown for grown, blurred in parts if blurred]
    if textured:
        # Around a texture there are no two pure colors to unmix an edge between.
        near = _hard_edge(picture.shape, dilate(np.logical_or.reduce(textured), _SEAM + 1), step)
        np.copyto(cover, _hard_edge(picture.shape, inside, step), where=near > 0)
    return cover


def _grown_from(
    picture: Picture, small: NDArray, step: int, pixel: tuple[int, int], white: NDArray, tolerance: float
) -> tuple[NDArray[np.bool_], bool]:
    """Return what one click selects of the reduced picture, and whether that had to be blurred for its texture."""
    x, y = pixel
    body = trimmed_mean(read_window(picture, pixel)) / white
    if body.max() < DARK / 4:
        raise MaskError(f"Click ({x}, {y}) is on black: click a lit part of the product.")
    start = min(y // step, small.shape[0] - 1), min(x // step, small.shape[1] - 1)
    balanced, body, blurred = _calm(small / white.astype(np.float32), body, start)
    grower = _Grower(balanced, white, start, picture.clip_level)
    own = _STRICT
    for _ in range(2):
        body, own = grower.learn(grower.grow(body, _times(own, tolerance)), body)
    return grower.grow(body, _times(own, tolerance)), blurred


def _calm(balanced: NDArray, body: NDArray, start: tuple[int, int]) -> tuple[NDArray, NDArray, bool]:
    """Blur a picture until the texture around the click has one color.

    A heather or a coarse weave has no single body color from pixel to pixel; its mean over a few yarns has.

    Returns
    -------
    The picture, the body color in it, and whether it was blurred at all.
    """
    y, x = start
    calm = balanced
    for radius in (0, 1, 2, 4, 7):
        if radius:
            calm = _box_mean(balanced, radius)
        near = calm[max(0, y - _NEAR) : y + _NEAR + 1, max(0, x - _NEAR) : x + _NEAR + 1].reshape(-1, 3)
        if radius:
            body = trimmed_mean(near)
        size = np.linalg.norm(near, axis=1)
        cosine = near @ (body / np.linalg.norm(body)) / np.maximum(size, 1e-6)
        apart = np.degrees(np.arccos(np.clip(cosine[size > 0.2 * np.linalg.norm(body)], -1, 1)))
        if len(apart) == 0 or np.quantile(apart, 0.84) <= _TEXTURED:
            return calm, body, radius > 0
    return calm, body, True


def _box_mean(values: NDArray, radius: int) -> NDArray[np.float32]:
    """Mean over the (2 radius + 1) square around every pixel of (h, w, 3); the border is repeated."""
    out = values.astype(np.float64)
    for axis in (0, 1):
        pads = [(radius + 1, radius) if k == axis else (0, 0) for k in range(3)]
        total = np.cumsum(np.pad(out, pads, mode="edge"), axis=axis)
        ahead = tuple(slice(2 * radius + 1, None) if k == axis else slice(None) for k in range(3))
        behind = tuple(slice(None, -2 * radius - 1) if k == axis else slice(None) for k in range(3))
        out = (total[ahead] - total[behind]) / (2 * radius + 1)
    return out.astype(np.float32)


def _hard_edge(shape: tuple[int, int], grown: NDArray[np.bool_], step: int) -> NDArray[np.uint8]:
    rows = np.minimum(np.arange(shape[0]) // step, grown.shape[0] - 1)
    columns = np.minimum(np.arange(shape[1]) // step, grown.shape[1] - 1)
    return (grown * np.uint8(255)).take(columns, axis=1).take(rows, axis=0)


def _times(t: _Tolerance, factor: float) -> _Tolerance:
    return _Tolerance(t.out * factor, t.toward * factor, t.away * factor, t.tilt)


def shrink(picture: Picture, step: int) -> NDArray[np.float32]:
    """Mean of every step x step block of linear light; incomplete blocks at the right and bottom are left out."""
    height, width = picture.shape
    if step == 1:
        return picture.linear()
    rows, columns = height // step, width // step
    out = np.empty((rows, columns, 3), np.float32)
    for part in bands(rows, columns * step * step):
        out[part] = block_means(picture.linear(slice(part.start * step, part.stop * step)), step)
    return out


def _half_range(values: NDArray) -> float:
    low, high = np.quantile(values, (0.16, 0.84))
    return float(high - low) / 2


def _angles(balanced: NDArray, body: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Light along the body color, and the components out of the plane and toward the white."""
    normal, toward = _plane(body)
    axes = np.stack([body / np.linalg.norm(body), normal, toward]).astype(np.float32)
    along, out, paler = (axes @ balanced.reshape(-1, 3).T).reshape(3, *balanced.shape[:-1])
    return along, out, paler


class _Grower:
    """Growth of one region on the reduced, white-balanced picture."""

    def __init__(self, balanced: NDArray, white: NDArray, start: tuple[int, int], clip: float) -> None:
        self.balanced, self.white, self.start = balanced, white, start
        self.clipped = np.logical_or.reduce([balanced[..., k] * white[k] >= clip for k in range(3)])
        self.size = np.sqrt(np.einsum("...i,...i", balanced, balanced))

    def grow(self, body: NDArray, tolerance: _Tolerance) -> NDArray[np.bool_]:
        """Select what is of this body color and hangs together with the start."""
        along, out, paler = _angles(self.balanced, body)
        untilted, out = out, out - tolerance.tilt * paler
        safe = np.maximum(along, 1e-6)
        # The step of an 8-bit code near black turns the color of dark pixels, most where the white is low.
        normal, toward = _plane(body)
        blur, blur_toward = (3 * _DARK_STEP * float(np.linalg.norm(axis / self.white)) for axis in (normal, toward))
        # Toward the white no further than half way: there begins what is grey.
        to_white = float(np.degrees(np.arcsin(sine(body))))
        limits = [tolerance.out, min(tolerance.toward, 0.5 * to_white), tolerance.away]
        slope = np.tan(np.radians(np.minimum(limits, 80)))
        lit = along > max(0.01 * float(np.linalg.norm(body)), DARK / 4)
        similar = lit & (np.abs(out) <= slope[0] * safe + blur)
        similar &= (paler <= slope[1] * safe + blur_toward) & (-paler <= slope[2] * safe + blur_toward)
        if to_white < _PALE:
            similar &= ~self._steps()
        similar[self.start] = True
        core = _connected(similar, self.start)
        # What the material surrounds: gloss near the plane, clipped pixels, shadow too dark to have a color, folds.
        glossy = (np.minimum(np.abs(out), np.abs(untilted)) <= _GLOSS_SLOPE * self.size + blur) & (along > 0)
        # Deep folds: light that met the material twice is darker, more colored and turned in hue.
        folded = (along < 0.7 * float(np.linalg.norm(body))) & (paler < 0) & (np.abs(out) <= _FOLD_SLOPE * safe + blur)
        sheen_slope = min(_SHEEN_SLOPE, float(np.tan(np.radians(0.7 * to_white))))
        # Sheen at grazing angles: the same plane, further toward the white.
        sheen = lit & (np.abs(out) <= slope[0] * safe + blur) & (paler <= sheen_slope * safe) & (paler > 0)
        total = np.count_nonzero(core)
        found = core.copy()
        for kind in (sheen, glossy | self.clipped, folded | ~lit):
            found |= _surrounded(kind & ~found, found, self.balanced, 0.03 * total, 0.2 * total)
        return found

    def _steps(self) -> NDArray[np.bool_]:
        """Where brightness jumps: for a product almost the color of the light this is all that bounds it."""
        light = np.log(np.maximum(self.balanced.sum(axis=-1), 3 * DARK))
        y, x = self.start
        near = light[max(0, y - _NEAR) : y + _NEAR + 1, max(0, x - _NEAR) : x + _NEAR + 1]
        usual = [np.abs(np.diff(near, axis=k)).ravel() for k in (0, 1)]
        # A weave has steps of its own; only larger ones bound it.
        least = max(_STEP, 2.5 * float(np.quantile(np.concatenate([*usual, [0.0]]), 0.9)))
        down, across = np.abs(np.diff(light, axis=0)) > least, np.abs(np.diff(light, axis=1)) > least
        steps = np.zeros(light.shape, bool)
        steps[:-1] |= down
        steps[1:] |= down
        steps[:, :-1] |= across
        steps[:, 1:] |= across
        return steps

    def learn(self, inside: NDArray, body: NDArray) -> tuple[NDArray, _Tolerance]:
        """Body color and tolerance of the material, from what a strict growth found."""
        places = np.flatnonzero(inside)
        pixels = self.balanced.reshape(-1, 3)[places[:: max(1, len(places) // _LEARNED_PIXELS)]]
        if len(pixels) < 30:
            return body, _LEAST
        light = pixels.sum(axis=1)
        lit = pixels[light >= np.quantile(light, 0.5)]
        body = np.quantile(lit / lit.sum(axis=1, keepdims=True), 0.5, axis=0) * body.sum()
        along, out, paler = _angles(pixels, body)
        usable = along > 0.2 * np.quantile(along, 0.5)
        off, pale = (np.degrees(np.arctan2(c[usable], along[usable])) for c in (out, paler))
        # Where the material varies enough along the plane to show it, the plane is learned too.
        tilt = 0.0
        if np.std(pale) > 1.0:
            tilt = float(np.clip(np.quantile(off * pale, 0.5) / np.quantile(pale * pale, 0.5), -_MOST_TILT, _MOST_TILT))
        wide, long = (4 * _half_range(values) for values in (off - tilt * pale, pale))
        return body, _Tolerance(
            float(np.clip(wide, _LEAST.out, _MOST.out)),
            float(np.clip(long, _LEAST.toward, _MOST.toward)),
            float(np.clip(long, _LEAST.away, _MOST.away)),
            tilt,
        )


def label(mask: NDArray) -> tuple[NDArray[np.int32], int]:
    """Number the 4-connected parts of a (h, w) bool mask.

    Returns
    -------
    labels
        (h, w) int32: 0 outside, 1..n inside.
    n
        Number of parts.

    Notes
    -----
    Runs of pixels in a row are joined to the runs they touch in the next row, and each takes the smallest number
    of its neighbors, with pointer jumping, until nothing changes.
    """
    height, width = mask.shape
    padded = np.zeros((height, width + 2), np.int8)
    padded[:, 1:-1] = mask
    change = np.diff(padded, axis=1)
    row, begin = np.divmod(np.flatnonzero(change == 1), width + 1)
    end = np.flatnonzero(change == -1) % (width + 1)
    if len(row) == 0:
        return np.zeros((height, width), np.int32), 0
    # Two runs in neighboring rows touch if each begins before the other ends: candidates by binary search.
    key_begin, key_end = row * (width + 1) + begin, row * (width + 1) + end
    first = np.searchsorted(key_end, (row + 1) * (width + 1) + begin, side="right")
    last = np.searchsorted(key_begin, (row + 1) * (width + 1) + end, side="left")
    counts = np.maximum(last - first, 0)
    upper = np.repeat(np.arange(len(row)), counts)
    lower = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(first, counts)
    parent = np.arange(len(row))
    while len(upper):
        a, b = parent[upper], parent[lower]
        differ = a != b
        if not differ.any():
            break
        upper, lower, a, b = upper[differ], lower[differ], a[differ], b[differ]
        np.minimum.at(parent, np.maximum(a, b), np.minimum(a, b))
        while True:
            jumped = parent[parent]
            if np.array_equal(jumped, parent):
                break
            parent = jumped
    _, number = np.unique(parent, return_inverse=True)
    starts = np.zeros(height * (width + 1) + 1, np.int32)
    starts[key_begin] = number + 1
    np.subtract.at(starts, key_end, (number + 1).astype(np.int32))
    labels = np.cumsum(starts[:-1].reshape(height, width + 1)[:, :width], axis=1, dtype=np.int32)
    return labels, int(number.max()) + 1


# How far growth may jump, as a share of the picture's longer side, to a part of at least this share of what was
# selected so far: over seams to small parts, over a strap to large ones.
_JUMPS = ((0.01, 0.0005), (0.022, 0.003), (0.04, 0.05))


def _connected(similar: NDArray, start: tuple[int, int]) -> NDArray[np.bool_]:
    """Parts of `similar` that hang together with `start`, over narrow gaps too."""
    # Parts joined by a thread of mixed pixels only are not one: they are told apart by their kernels.
    kernel = erode(similar, 1)
    if not kernel[start]:
        kernel |= dilate(_only(start, similar.shape), 2) & similar
    labels, count = label(kernel)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    chosen = np.zeros(count + 1, bool)
    chosen[labels[start]] = True
    while True:
        inside = chosen[labels]
        total = np.count_nonzero(inside)
        added = False
        for reach, least in _JUMPS:
            near = dilate(inside, max(2, round(reach * max(similar.shape))))
            reached = np.bincount(labels[near], minlength=count + 1) > 0
            reached[0] = False
            new = reached & ~chosen & (sizes >= max(12, least * total))
            chosen |= new
            added |= bool(new.any())
        if not added:
            return dilate(inside, 2) & similar


def _only(position: tuple[int, int], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, bool)
    mask[position] = True
    return mask


def _surrounded(rest: NDArray, core: NDArray, balanced: NDArray, small: float, large: float) -> NDArray[np.bool_]:
    """Parts of `rest` whose outline lies mostly against `core`.

    Parts of up to `small` pixels as they are; of up to `large` pixels if the color passes over to the core smoothly,
    as highlights and folds do, and things that lie before the product do not.
    """
    labels, count = label(rest)
    against, outline, jump = np.zeros(count + 1), np.zeros(count + 1), np.zeros(count + 1)
    names, inside, colors = labels.reshape(-1), core.reshape(-1), balanced.reshape(-1, 3)
    for one, other in _borders(labels):
        edge = names[one] > 0
        touching = edge & inside[other]
        a, b = colors[one[touching]], colors[other[touching]]
        differ = np.linalg.norm(a - b, axis=1) / np.maximum(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
        outline += np.bincount(names[one[edge]], minlength=count + 1)
        against += np.bincount(names[one[touching]], minlength=count + 1)
        jump += np.bincount(names[one[touching]], np.nan_to_num(differ), minlength=count + 1)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    smooth = jump < _SMOOTH * np.maximum(against, 1)
    keep = (against > 0.45 * np.maximum(outline, 1)) & ((sizes <= small) | (smooth & (sizes <= large)))
    keep[0] = False
    return keep.take(labels)


def _borders(labels: NDArray) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Places, counted along the rows, of neighbors of different label: in all four directions."""
    width = labels.shape[1]
    down = np.flatnonzero(labels[1:] != labels[:-1])
    y, x = np.divmod(np.flatnonzero(labels[:, 1:] != labels[:, :-1]), max(1, width - 1))
    across = y * width + x
    for low, high in ((down, down + width), (across, across + 1)):
        yield low, high
        yield high, low


def _soft_edge(picture: Picture, small: NDArray, grown: NDArray[np.bool_], step: int) -> NDArray[np.uint8]:
    """Full-size coverage: along the outline, each pixel is unmixed between the colors on its two sides.

    The pure colors of the two sides are taken on the reduced picture, `small`; the pixels are those of the photo.
    """
    height, width = picture.shape
    rows = np.minimum(np.arange(height) // step, grown.shape[0] - 1)
    columns = np.minimum(np.arange(width) // step, grown.shape[1] - 1)
    reach = 2 if step == 1 else 1  # half width of the band in which the outline may truly lie
    band = dilate(grown, reach) & ~erode(grown, reach)
    y, x = np.divmod(np.flatnonzero(band), band.shape[1])
    reduced = Picture(small)
    around = [window(2 * reach + 3)]
    product, has_product = mean_at(reduced, grown & ~band, y, x, around)
    behind, has_behind = mean_at(reduced, ~grown & ~band, y, x, around)
    across = product - behind
    length = np.square(across).sum(axis=0)
    known = has_product & has_behind & (length > 1e-6)
    across /= np.maximum(length, 1e-12)
    across, behind = across.T, behind.T
    cell = np.full(grown.shape, -1, np.int32)
    cell[y, x] = np.where(known, np.arange(len(y)), -1)

    whole = (grown * np.uint8(255)).take(columns, axis=1)
    result = np.empty((height, width), np.uint8)
    for top, bottom in strips(height, width):
        part = whole.take(rows[top:bottom], axis=0)
        own = cell[rows[top:bottom]].take(columns, axis=1)
        y, x = np.divmod(np.flatnonzero(own >= 0), width)
        if len(y):
            k = own[y, x]
            cover = np.einsum("ij,ij->i", picture.at(y + top, x) - behind[k], across[k])
            # Nearly pure pixels are pure: noise is not transparency.
            part[y, x] = np.round(np.clip((cover - 0.08) / 0.84, 0, 1) * 255)
        result[top:bottom] = part
    return result
