"""Was the asked color delivered? The written file is read back and its product compared with the swatch.

What is compared is the product's matte color, as the method has it: the pixels of the photo that are most like the
reference, whatever light falls on them. In the file each is divided by its share A of body reflection, after what gloss
B it has was taken away, and the trimmed mean of all is set against the color that the reference shall have. The photo
decides which pixels these are, so the area is chosen before the photo's pixels are spent.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import colorimetry, dichromatic, gamut, stability
from ..core.analysis import LARGEST_NOISE_GAIN, Analysis
from ..core.colorspace import RGBSpace
from ..core.errors import FileError
from ..core.picture import Picture, as_weights
from ..core.recipe import Prepared
from ..core.recolor import RegionMatrix
from ..core.reference import check_pixel, read_window, trimmed_mean, window_radius
from ..core.swatches import Camera, Light, Swatch
from . import files

# Pixels that are looked at for matte ones at most, and at a time; and how near to the reference these are: A around 1,
# and the rest of every channel (gloss, residual) as a share of the reference.
_CANDIDATES, _AT_ONCE = 80_000, 4_000
_BODY, _OFF = 0.2, 0.1

# Pixels that are averaged, and how many times as many they are chosen from.
_FEWEST, _MOST, _CHOICE = 25, 400, 2


@dataclass(frozen=True, eq=False)
class Verification:
    """Asked and delivered color of one region.

    Attributes
    ----------
    target
        The swatch as its user wrote it, or None for an unchanged color.
    asked, delivered
        (3,) L*a*b* under the white of the photo's and the file's color space.
    limit
        CIEDE2000 from the asked color to the nearest one that the file can hold; 0 where it holds it.
    pixels
        How many were averaged.
    """

    target: str | None
    asked: NDArray[np.float64]
    delivered: NDArray[np.float64]
    limit: float
    pixels: int

    @cached_property
    def ciede2000(self) -> float:
        """CIEDE2000 between asked and delivered."""
        return float(colorimetry.delta_e_2000(self.asked, self.delivered))

    @cached_property
    def cmc(self) -> tuple[float, float]:
        """CMC(2:1), for acceptability, and CMC(1:1), for perceptibility, of delivered against asked."""
        acceptable, perceptible = colorimetry.delta_e_cmc(self.asked, self.delivered, np.array([2.0, 1.0])).tolist()
        return acceptable, perceptible

    @property
    def sentence(self) -> str:
        """The figures in words."""
        text = (
            f"Delivered {self.ciede2000:.1f} of the asked color (CIEDE2000 {self.ciede2000:.2f}, CMC(2:1) "
            f"{self.cmc[0]:.2f}, CMC(1:1) {self.cmc[1]:.2f}; {self.pixels} matte pixels)"
        )
        if self.limit > 0:
            text += f"; the nearest color that the file can hold is {self.limit:.1f} away"
        return text + "."

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "target": self.target,
            "asked_lab": self.asked.tolist(),
            "delivered_lab": self.delivered.tolist(),
            "ciede2000": self.ciede2000,
            "cmc_2_1": self.cmc[0],
            "cmc_1_1": self.cmc[1],
            "limit_ciede2000": self.limit,
            "pixels": self.pixels,
            "sentence": self.sentence,
        }


@dataclass(frozen=True, eq=False)
class Area:
    """Matte pixels of a region.

    Attributes
    ----------
    rows, columns
        (n,) positions.
    body, gloss
        (n,) float32 A and B in the photo.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    body: NDArray[np.float32]
    gloss: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Expectation:
    """What a file that is yet to be written should show.

    Attributes
    ----------
    space
        RGB space of the asked colors.
    white
        (3,) W' of the new picture.
    asked
        For each region that has matte pixels: these, the (3,) linear RGB that the product shall have there, and the
        swatch as its user wrote it.
    """

    space: RGBSpace
    white: NDArray[np.float64]
    asked: tuple[tuple[Area, NDArray[np.float64], str | None], ...]

    def check(self, path: str | Path) -> list[Verification]:
        """Read the file back and compare.

        Parameters
        ----------
        path
            As written by `photo.save`.

        Returns
        -------
        One for each region that has matte pixels.

        Raises
        ------
        FileError
            If it cannot be read back, or has another size.
        """
        if not self.asked:
            return []
        # Decoders go from the top to the bottom, and not further than they must.
        back = files.read(path, rows=1 + max(int(area.rows.max()) for area, _, _ in self.asked))
        to_own = colorimetry.conversion_matrix(self.space, back.space)
        white = to_own @ self.white
        return [_compare(area, back, to_own @ asked, white, target) for area, asked, target in self.asked]


def _compare(area: Area, back: files.Photo, asked: NDArray, white: NDArray, target: str | None) -> Verification:
    picture = Picture(back.pixels, back.space.curve)
    height, width = picture.shape
    if area.rows.max() >= height or area.columns.max() >= width:
        raise FileError(f"'{back.path}' is {width} x {height} pixels, less than was written: write it again.")
    pixels: NDArray = picture.at(area.rows, area.columns)
    if back.premultiplied and back.pixels.shape[2] == 4:
        pixels = pixels / np.asarray(back.pixels[area.rows, area.columns, 3:], np.float32)
    matte = (pixels - area.gloss[:, None] * white) / area.body[:, None]
    return _verification(target, asked, trimmed_mean(matte), back, len(matte))


def _verification(
    target: str | None, asked: NDArray, delivered: NDArray, back: files.Photo, pixels: int
) -> Verification:
    asked_lab, delivered_lab = (colorimetry.linear_to_lab(color, back.space) for color in (asked, delivered))
    limit = _limit(tuple(asked), back.space) if back.pixels.dtype.kind == "u" else 0.0
    return Verification(target, asked_lab, delivered_lab, limit, pixels)


@lru_cache(maxsize=64)  # all photos of a catalog have the same targets
def _limit(asked: tuple[float, ...], space: RGBSpace) -> float:
    return float(gamut.nearest(asked, space).difference)


def expect(
    photo: files.Photo,
    prepared: Prepared,
    swatches: Sequence[Swatch | None] | None = None,
    areas: Sequence[Area | None] | None = None,
) -> Expectation:
    """Note what a recolor should deliver, and where to look for it.

    Parameters
    ----------
    photo, prepared
        The opened photo and what was made of it, its pixels not yet reused.
    swatches
        Targets of this colorway; None for the recipe's own.
    areas
        From :func:`matte_areas`, for several colorways of one photo; None to look for them.
    """
    chosen = swatches or [None] * len(prepared.analyses)
    asked = []
    for k, area in enumerate(matte_areas(photo, prepared) if areas is None else areas):
        if area is not None:
            swatch = chosen[k] or prepared.recipe.regions[k].target
            asked.append((area, prepared.target(k, chosen[k]), str(swatch) if swatch else None))
    return Expectation(prepared.space, np.asarray(prepared.target_white, np.float64), tuple(asked))


def matte_areas(photo: files.Photo, prepared: Prepared) -> list[Area | None]:
    """Find the matte pixels of every region; None for one that has none. They do not depend on the targets."""
    alpha = photo.pixels[..., 3] if photo.pixels.shape[2] == 4 else None
    analyses = prepared.analyses
    return [_matte_area(a, [later.mask for later in analyses[k + 1 :]], alpha) for k, a in enumerate(analyses)]


def _matte_area(analysis: Analysis, covers: Sequence[NDArray | None], alpha: NDArray | None) -> Area | None:
    """Pixels of the region that look like its reference."""
    if any(cover is None for cover in covers):
        return None  # another region lies over all of it
    # From the top to the bottom until there are enough, so that not all of a file need be decoded.
    found, near = [], 0
    for part in _grids(analysis):
        pixels, *places = _clear_pixels(analysis, covers, alpha, part)
        body, gloss, unlike = _compared(pixels, analysis)
        found.append((*places, body, gloss, unlike))
        near += int(np.count_nonzero(unlike < 1))
        if near >= _CHOICE * _MOST:
            break
    if not found:
        return None
    rows, columns, body, gloss, unlike = (np.concatenate(values) for values in zip(*found, strict=True))
    # The color of a product varies, and the reference is one of its colors: the nearest ones.
    alike = np.argsort(unlike, kind="stable")[: min(max(near, _FEWEST), _MOST)]
    alike = alike[body[alike] > 0.1]
    return Area(rows[alike], columns[alike], body[alike], gloss[alike]) if len(alike) else None


def _clear_pixels(
    analysis: Analysis, covers: Sequence[NDArray | None], alpha: NDArray | None, part: tuple[slice, slice]
) -> tuple[NDArray[np.float32], NDArray[np.intp], NDArray[np.intp]]:
    """(n, 3) linear RGB, and rows and columns, of a part's pixels that are of the region alone and not clipped."""
    linear = analysis.picture.linear(*part)
    keep = linear.max(axis=2) < analysis.picture.clip_level
    if analysis.mask is not None:
        keep &= as_weights(analysis.mask[part]) == 1
    for cover in covers:
        keep &= as_weights(np.asarray(cover)[part]) == 0
    if alpha is not None:
        keep &= alpha[part] == (np.iinfo(alpha.dtype).max if alpha.dtype.kind == "u" else 1)
    rows, columns = (s.start + s.step * places for s, places in zip(part, np.nonzero(keep), strict=True))
    return linear[keep], rows, columns


def _compared(pixels: NDArray[np.float32], analysis: Analysis) -> tuple[NDArray, NDArray, NDArray]:
    """A and B of (n, 3) pixels, and how unlike the reference they are: under 1 is near."""
    V, W = analysis.reference, analysis.white
    # The plain model chooses them, whatever the photo is recolored by: where it fits, all models agree.
    model = "dichromatic" if stability.noise_gain(V, W) < LARGEST_NOISE_GAIN else "body"
    body, gloss = dichromatic.fit(pixels, V, W, model)
    # Channel by channel, as a weak channel of the old color may be a strong one of the new.
    off = np.abs(pixels - body[:, None] * V) / np.maximum(np.abs(V), 0.02 * np.abs(V).max())
    return body, gloss, np.maximum(np.abs(body - 1) / _BODY, off.max(axis=1) / _OFF)


def _grids(analysis: Analysis) -> Iterator[tuple[slice, slice]]:
    """Rows and columns of grids that lie below one another, around the reference pixel or all over the region."""
    height, width = analysis.picture.shape
    if analysis.pixel is not None:
        x, y = analysis.pixel
        reach = 6 * window_radius(analysis.picture.shape)
        box = slice(max(0, y - reach), min(height, y + reach + 1)), slice(max(0, x - reach), min(width, x + reach + 1))
    else:
        box = RegionMatrix(np.eye(3), analysis.mask).box or (slice(0, height), slice(0, width))
    rows, columns = ((side.start, side.stop) for side in box)
    step = max(1, int(np.sqrt((rows[1] - rows[0]) * (columns[1] - columns[0]) / _CANDIDATES)))
    tall = step * max(1, _AT_ONCE * step // max(1, columns[1] - columns[0]))
    for top in range(*rows, tall):
        yield slice(top, min(top + tall, rows[1]), step), slice(*columns, step)


def verify(
    path: str | Path,
    reference: ArrayLike,
    target: Swatch,
    *,
    color_space: str | None = None,
    illuminant: Light | None = None,
    observer: str = "1931",
    camera: Camera | None = None,
    adaptation: colorimetry.Adaptation = "cat16",
) -> Verification:
    """Compare a picture's matte color at a pixel with a swatch.

    Parameters
    ----------
    path
        The picture.
    reference
        (x, y) of a matte pixel of the product; the small window around it is averaged without its outliers.
    target
        The asked color.
    color_space
        See :func:`files.read`.
    illuminant, observer, camera, adaptation
        See :meth:`Swatch.to_linear`.

    Raises
    ------
    DyehouseError
        If the picture cannot be read, or the pixel lies outside.
    """
    back = files.read(path, color_space)
    picture = Picture(back.pixels, back.space.curve)
    window = read_window(picture, check_pixel(picture, reference, "Reference pixel"))
    asked = target.to_linear(back.space, illuminant, observer, camera, adaptation)
    return _verification(str(target), asked, trimmed_mean(window), back, len(window))
