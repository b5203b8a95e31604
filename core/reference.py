"""The two colors that everything hangs on: the product's matte body color, and the white of the light.

A reference must be matte. If it holds gloss, B is below zero elsewhere on the product and the target, a flat
measured color, is mistaken for a glossy one: 1 % of the white in the reference costs about one color difference
unit over the whole product, while a white that is 3 % off costs 0.05 (trial renders).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .colorimetry import delta_e_2000, linear_to_lab
from .colorspace import LINEAR_SRGB
from .dichromatic import sine
from .errors import ReferenceColorError, WhiteError
from .interreflection import USUAL, bounced
from .neighborhood import mean_at, window
from .picture import Picture, as_weights, strongest

# Linear luminance under which a pixel is too dark, relative to white, to tell its color from noise.
DARK = 0.004

# Confidence in a white from highlights under which the user should be asked; and what a score of highlights and plane
# is worth, counted by `uv run --group bench python -m dyehouse.benchmarks.calibration`.
SURE_WHITE = 0.75
_CHANCES = (0.0, 0.65, 0.75, 1.0), (0.35, 0.45, 0.8, 0.95)

# Pixels that a search looks at; more do not change the answer. The white is found from few of them.
_READINGS, _SAMPLE_WHITE = 4_000, 60_000

# The matte readings of a material are the lowest share of them that lie closer together than so many times the closest;
# and how far these reach below the middle by noise alone, in standard deviations.
_CLOSE, _AS_CLOSE, _CLOSE_DEVIATE = 0.15, 1.75, 1.33

# Sine of the angle to the white under which gloss and body look alike, and under which body and bounce do.
_GRAYISH, _GRAYER = 0.1, 0.02

# Sine of the angle by which a pixel of the same material may leave the plane of its color and the white.
_OFF_PLANE = 0.035

# Distance from the median, in that of the nearer half of the pixels, up to which a pixel counts in full; at twice it,
# not at all.
_SCATTER = 0.8

# Gloss in a clicked pixel, against its brightest channel and times the sine of its angle to the white: below the
# first it is within what matte pixels scatter and is left alone, from the second on all of it is taken out;
# both are more where the window is noisy.
_GLOSS_RAMP = (0.005, 0.008)

# Bounce in a clicked pixel, as a share of its light, that is worth a look; what may be left over of it then; and light
# of the lamps there, against that of the well lit parts, from which that tells anything.
_FOLDED, _OFF_FOLD, _DIM = 0.02, 0.015, 0.05

# Readings that lamps alone light: their light, against that of the well lit ones, and quantiles of their paleness.
_LIT, _PALEST = 0.5, (0.85, 0.97)

# Color difference of a click from the main color of its product from which it may be another, and share of readings as
# far away under which it is; mean of the channels at which they are compared, light against that of well lit ones from
# which they count, and how many readings apart are enough for that.
_STRAY, _RARE, _MIDDLE, _SHADE, _FEW_READINGS = 1.2, 0.1, 0.3, 0.2, 4


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference color and what was seen when it was taken.

    Attributes
    ----------
    color
        (3,) float64 linear RGB, matte.
    pixel
        (x, y), or None if no pixel was given.
    gloss
        Surface reflection that was found in the pixel and is not in `color`, as a share of the white; 0 if no pixel
        was given.
    bounce, light
        What was read is ``light * v + bounce * bounced(v)``, see `interreflection`, and `color` the first part of it:
        the second is light that had met the product before.
    palest
        Whether v is the palest color of the material, as is right if nothing shines.
    readings
        (n, 3) colors of the product that it was held against, relative to the white; none if it was given as a color.
    """

    color: NDArray[np.float64]
    pixel: tuple[int, int] | None = None
    gloss: float = 0.0
    bounce: float = 0.0
    light: float = 1.0
    palest: bool = False
    readings: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)), repr=False)

    def as_read(self, white: NDArray) -> Reference:
        """Return the reference with the gloss that was left out of it."""
        return replace(self, color=self.color + self.gloss * white, gloss=0.0)


def check_pixel(picture: Picture, pixel: ArrayLike, what: str) -> tuple[int, int]:
    """(x, y) as whole numbers inside the picture, from numbers of any kind; a fraction lies in its pixel.

    Raises
    ------
    ReferenceColorError
        If it lies outside, or is not two numbers.
    """
    position = np.asarray(pixel)
    if position.shape != (2,) or position.dtype.kind not in "iuf" or not np.isfinite(position).all():
        raise ReferenceColorError(f"{what} {pixel!r} is not a pixel: give x and y as numbers.")
    x, y = (int(v) for v in np.floor(position))
    height, width = picture.shape
    if not (0 <= x < width and 0 <= y < height):
        raise ReferenceColorError(
            f"{what} ({x}, {y}) lies outside the picture of {width} x {height} pixels: x goes from 0 to "
            f"{width - 1} and y from 0 to {height - 1}."
        )
    return x, y


def window_radius(shape: tuple[int, int]) -> int:
    """Radius of the small window that stands for a clicked pixel: 1 for small pictures, 6 for 24 megapixels."""
    return int(np.clip(round(0.0015 * max(shape)), 1, 6))


def read_window(picture: Picture, pixel: tuple[int, int], mask: NDArray | None = None) -> NDArray[np.float32]:
    """(n, 3) linear pixels of the small window around (x, y), those of the mask only."""
    x, y = pixel
    radius = window_radius(picture.shape)
    rows, columns = slice(max(0, y - radius), y + radius + 1), slice(max(0, x - radius), x + radius + 1)
    window = picture.linear(rows, columns).reshape(-1, 3)
    if mask is not None:
        window = window[as_weights(mask[rows, columns]).reshape(-1) > 0.5]
    return window


def trimmed_mean(pixels: NDArray, keep: float = 0.6) -> NDArray[np.float64]:
    """(3,) mean of the share of (n, 3) pixels that lie nearest to their median: blind to specks and edges."""
    middle = np.quantile(pixels, 0.5, axis=0)
    distance = np.linalg.norm(pixels - middle, axis=1)
    nearest = np.argsort(distance, kind="stable")[: max(1, round(keep * len(pixels)))]
    return pixels[nearest].mean(axis=0, dtype=np.float64)


def steady_mean(pixels: NDArray) -> NDArray[np.float64]:
    """(3,) mean of (n, 3) pixels that leaves out what is far from their median, little by little.

    So photos of one texture in two colors are read alike: which pixels a trimmed mean keeps differs between them.
    """
    middle = np.quantile(pixels, 0.5, axis=0)
    distance = np.linalg.norm(pixels - middle, axis=1)
    scatter = float(np.median(distance)) + 0.01 * float(np.linalg.norm(middle)) + 1e-12
    weights = np.clip(2 - distance / (_SCATTER * scatter), 0, 1)
    return np.average(pixels, axis=0, weights=weights).astype(np.float64)


def reference_at(picture: Picture, pixel: ArrayLike, white: NDArray, mask: NDArray | None = None) -> Reference:
    """Read the color at a clicked pixel as it is, gloss and all.

    Parameters
    ----------
    picture
        The photo.
    pixel
        (x, y) from the top left.
    white
        (3,) white of the light.
    mask
        Checked coverage of the product, or None.

    Raises
    ------
    ReferenceColorError
        If the pixel lies outside the picture or the mask, or is clipped or black.
    """
    x, y = check_pixel(picture, pixel, "Reference pixel")
    if mask is not None and as_weights(mask[y : y + 1, x : x + 1])[0, 0] <= 0.5:
        raise ReferenceColorError(
            f"Reference pixel ({x}, {y}) is outside the mask: pick a pixel of the product that the mask covers."
        )
    window = read_window(picture, (x, y), mask)
    if not np.isfinite(window).all():
        raise ReferenceColorError(f"Reference pixel ({x}, {y}) is not finite: pick an ordinary pixel.")
    color = steady_mean(window)
    own = picture.linear(slice(y, y + 1), slice(x, x + 1))[0, 0]
    if own.max() >= picture.clip_level:
        raise ReferenceColorError(
            f"Reference pixel ({x}, {y}) is clipped: a channel is at its maximum, so its color is lost; pick a "
            "less bright, matte part of the product."
        )
    if color.max() <= 0 or (color / white).max() < DARK / 4:
        raise ReferenceColorError(f"Reference pixel ({x}, {y}) is black: pick a lit, matte part of the product.")
    return Reference(color, (x, y))


def matte_at(picture: Picture, pixel: ArrayLike, white: NDArray, mask: NDArray | None = None) -> Reference:
    """Read the product's body color at a clicked pixel, in the light that falls there.

    What surface reflection the pixel holds, against the matte pixels of its material, is taken out: the click says
    which product and how much light, its region says what is matte. Parameters and errors as for
    :func:`reference_at`, which reads a pixel as it is.
    """
    read = reference_at(picture, pixel, white, mask)
    color = read.color / white
    readings = _readings(picture, mask, read.pixel if mask is None else None) / white
    read = replace(read, readings=readings)
    gloss = _gloss_against(color, readings)
    if gloss <= 0:
        return read
    around = read_window(picture, check_pixel(picture, pixel, "Reference pixel"), mask) / white
    noise = _as_gloss(color, float((around @ _plane(color)[0]).std()) / len(around) ** 0.5)
    low, high = np.maximum(np.array(_GLOSS_RAMP) * color.max() / max(sine(color), 1e-3), (2 * noise, 3 * noise))
    # No body color gives back less than nothing in a channel.
    gloss = min(gloss * float(np.clip((gloss - low) / (high - low), 0, 1)), max(0.0, float(color.min())))
    return replace(read, color=read.color - gloss * white, gloss=gloss)


def unfolded(found: Reference, white: NDArray) -> tuple[Reference, ...]:
    """Part a reference from light that had met the product before.

    Parameters
    ----------
    found
        A reference that was clicked or found.
    white
        (3,) white of the light.

    Returns
    -------
    References without bounce, the palest first, of which the region has to tell whether one is right.
    """
    matte = _matte_of(found.readings)
    if matte is None or sine(matte) < _GRAYER:
        return ()
    read = found.as_read(white)
    palest = _palest(matte, found.readings)
    parted = _parted(read, white, palest, True), _parted(read, white, matte, False)
    if found.pixel is None and parted[0] is not None:
        # In the light of the lamps, as there is no click to say which.
        return (replace(read, color=palest * white, palest=True),)
    return tuple(other for other in parted if other is not None)


def stray(found: Reference, white: NDArray, matte: bool) -> float:
    """Color difference of a click from most of its product, lightness apart, if few of its readings are as far from it.

    Parameters
    ----------
    found
        A reference that was clicked.
    white
        (3,) white of the light.
    matte
        Whether nothing shines, so that the palest color is the product's.

    Returns
    -------
    CIEDE2000; 0 where the click is an ordinary one, or there is nothing to hold it against.
    """
    readings = found.readings[::_FEW_READINGS]
    main = _matte_of(readings)
    if main is None:
        return 0.0
    if matte:
        main = _palest(main, readings)
    light = readings.mean(axis=1)
    lit = readings[light > _SHADE * np.quantile(light, 0.9)]
    colors = np.vstack([main, found.color / white, lit])
    lab = linear_to_lab(_MIDDLE * colors / np.maximum(colors.mean(axis=1, keepdims=True), 1e-6), LINEAR_SRGB)
    away, *others = delta_e_2000(lab[1:], lab[0])
    return float(away) if away > _STRAY and np.mean(np.array(others) >= away) < _RARE else 0.0


def _parted(read: Reference, white: NDArray, matte: NDArray, palest: bool) -> Reference | None:
    """Part a reference into the matte color of its material, as lamps alone show it, and bounce."""
    color = read.color / white
    terms = np.column_stack([matte, bounced(matte, USUAL)])
    light, bounce = np.linalg.lstsq(terms, color, rcond=None)[0]
    left, whole = float(np.linalg.norm(color - terms @ [light, bounce])), float(np.linalg.norm(color))
    if light < _DIM or bounce * np.linalg.norm(terms[:, 1]) < _FOLDED * whole or left > _OFF_FOLD * whole:
        return None
    return replace(read, color=light * matte * white, bounce=float(bounce), light=float(light), palest=palest)


def _palest(matte: NDArray, readings: NDArray) -> NDArray[np.float64]:
    """(3,) color of the palest of the well lit readings (n, 3): what lamps alone light, if nothing shines."""
    a, b = np.linalg.pinv(np.column_stack([matte, np.ones(3)])) @ readings.T
    lit = (a > 0) & (a >= _LIT * np.quantile(a, 0.9))
    return _median_between(readings[lit], b[lit] / a[lit], *_PALEST) if lit.any() else matte


def _median_between(readings: NDArray, by: NDArray, low: float, high: float) -> NDArray[np.float64]:
    """(3,) median of those readings (n, 3) that lie between two quantiles in the order of some numbers (n,)."""
    first, last = (int(share * len(by)) for share in (low, high))
    return np.quantile(readings[np.argsort(by)[first : max(last, first + 1)]], 0.5, axis=0)


def _readings(picture: Picture, mask: NDArray | None, near: tuple[int, int] | None = None) -> NDArray[np.float64]:
    """(n, 3) unclipped colors all over the product, or near a pixel, each read over a window as a click is.

    So the grain of a texture and noise are as small in them as in a reference.
    """
    height, width = picture.shape
    wanted = np.ones((height, width), bool) if mask is None else strongest(mask)
    if near is None:
        step = max(1, int(np.sqrt(np.count_nonzero(wanted) / _READINGS)))
        left = top = step // 2
        right, bottom = width, height
    else:
        reach = max(8, round(0.12 * max(height, width)))
        step = max(1, reach // 18)
        (left, right), (top, bottom) = ((max(0, k - reach), k + reach) for k in near)
    rows, columns = np.nonzero(wanted[top:bottom:step, left:right:step])
    rows, columns = top + step * rows, left + step * columns
    clear = picture.at(rows, columns).max(axis=1) < picture.clip_level
    means, _ = mean_at(picture, wanted, rows[clear], columns[clear], [window(window_radius(picture.shape))])
    return means.T[np.isfinite(means).all(axis=0)].astype(np.float64)


def _gloss_against(color: NDArray, pixels: NDArray) -> float:
    """Gloss in a white-balanced color (3,), against the most matte of the pixels (n, 3) of its material.

    The pixels of one material lie in the plane of its color and the white (Shafer 1985); in units of the color, those
    without gloss have the same B / A. Below zero if the color is more matte than they are.
    """
    if sine(color) < _GRAYISH:
        return 0.0  # almost grey: gloss and body look alike
    split = np.linalg.pinv(np.column_stack([color, np.ones(3)]))
    a, b = split @ pixels.T
    normal, _ = _plane(color)
    off = pixels @ normal
    angle = np.where(a > 0, np.abs(off) / np.linalg.norm(pixels, axis=1).clip(1e-12), np.inf)
    near, same = _OFF_PLANE, angle < _OFF_PLANE
    # Noise that fills the gate is more than is seen of it.
    while near < 1 and same.any() and np.median(angle[same]) > near / 3:
        near *= 2
        same = angle < near
    if np.count_nonzero(same) < 20:
        return 0.0
    # Only the best lit: reflections of all that is around, light that met the cloth twice, and noise weigh less there.
    lit = same & (a > 0.8 * np.quantile(a[same], 0.9))
    away = off[lit] / a[lit]
    noise = _as_gloss(color, float(np.median(np.abs(away - np.median(away)))) / 0.6745)
    # Gloss reaches far upward and light of folds far downward. Matte readings lie close together, below those of gloss.
    ratio = np.sort(b[lit] / a[lit])
    count = int(_CLOSE * len(ratio))
    width = ratio[count:] - ratio[: len(ratio) - count]
    edge = ratio[np.argmax(width <= _AS_CLOSE * width.min())]
    above = max(0.0, float(np.median(ratio)) - edge)
    matte = color + edge + above - np.sqrt(max(0.0, above**2 - (_CLOSE_DEVIATE * noise) ** 2))
    # A matte color that is almost grey, or none, says nothing of the material.
    known = matte.max() > 0 and sine(np.maximum(matte, 0)) > 0.05
    return float(color[0] - matte[0]) if known else 0.0


def _as_gloss(color: NDArray, off: float) -> float:
    """Noise of gloss from that off the plane of a white-balanced color: variance goes with the light of a channel."""
    body, gloss = np.maximum(color, 0), np.linalg.pinv(np.column_stack([color, np.ones(3)]))[1]
    return off * float(np.sqrt((gloss**2 @ body) / (_plane(color)[0] ** 2 @ body)))


def _plane(color: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """For a white-balanced color: unit normal of its plane with grey, and the in-plane direction toward grey."""
    body = color / np.linalg.norm(color)
    grey = np.full(3, 3**-0.5)
    toward = grey - (grey @ body) * body
    length = np.linalg.norm(toward)
    if length < 1e-6:  # grey itself: any plane will do
        other = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
        return np.cross(body, other), other
    toward = toward / length
    return np.cross(body, toward), toward


def matte_reference(picture: Picture, white: NDArray, mask: NDArray | None = None) -> Reference:
    """Find the product's body color inside the mask: matte, unclipped, not dark, trimmed.

    Gloss makes a color paler and brighter, folds and shadow make it darker and more colored. So: of the well lit
    readings of the mask's main color the median, moved within its plane to where the best lit ones begin to lie close.

    Parameters
    ----------
    picture
        The photo.
    white
        (3,) white of the light.
    mask
        Checked coverage of the product, or None for the whole picture.

    Raises
    ------
    ReferenceColorError
        If every pixel is clipped or black.
    """
    usable = _readings(picture, mask)
    if len(usable) == 0:
        raise ReferenceColorError(
            "Every pixel of the product is clipped, so its color is lost: use a darker exposure, or give the "
            "reference as an RGB color."
        )
    readings = usable / white
    found = _matte_of(readings)
    if found is None:
        raise ReferenceColorError(
            "The product is black everywhere: use a brighter exposure, or give the reference as an RGB color."
        )
    return Reference(found * white, readings=readings)


def _matte_of(balanced: NDArray) -> NDArray[np.float64] | None:
    """(3,) matte color of the main material of white-balanced readings (n, 3); None without any that are not black."""
    if len(balanced) == 0:
        return None
    light = balanced.mean(axis=1)
    lit = light > max(DARK, 0.05 * float(np.quantile(light, 0.95)))
    if not lit.any():
        return None
    balanced, light = balanced[lit], light[lit]
    same = _main_material(balanced)
    balanced, light = balanced[same], light[same]
    color = _median_between(balanced, light, 0.5, 0.9)
    return color - _gloss_against(color, balanced)


def _main_material(balanced: NDArray) -> NDArray[np.bool_]:
    """Which white-balanced pixels (n, 3) share the most frequent hue; all of them if the picture is mostly grey."""
    total = balanced.sum(axis=1)
    chroma = balanced / total[:, None] - 1 / 3
    # Orthogonal axes in the chromaticity plane; the angle is a hue, the length a saturation.
    x, y = (2 * chroma[:, 0] - chroma[:, 1] - chroma[:, 2]) / 6**0.5, (chroma[:, 1] - chroma[:, 2]) / 2**0.5
    length = np.hypot(x, y)
    colored = length > 0.06
    if np.count_nonzero(colored) < 0.5 * len(balanced):
        return np.ones(len(balanced), bool) if not colored.any() else ~colored
    hue = np.arctan2(y, x)
    votes, _ = np.histogram(hue[colored], bins=72, range=(-np.pi, np.pi), weights=length[colored])
    smooth = votes + np.roll(votes, 1) + np.roll(votes, -1)
    peak = (np.argmax(smooth) + 0.5) * 2 * np.pi / 72 - np.pi
    apart = np.abs((hue - peak + np.pi) % (2 * np.pi) - np.pi)
    return colored & (apart < np.radians(12))


def _most_colored(pixels: NDArray) -> NDArray[np.float64]:
    """(3,) body color of (n, 3) pixels of one product when the white is not known: well lit and of much color."""
    light = pixels.mean(axis=1)
    well_lit = pixels[_main_material(pixels) & (light >= np.quantile(light, 0.35))]
    colored = 1 - well_lit.min(axis=1) / well_lit.mean(axis=1)
    return _median_between(well_lit, colored, 0.55, 0.95)


def white_at(picture: Picture, pixel: ArrayLike, gray: float = 1.0) -> NDArray[np.float64]:
    """White of the light from a pixel of a white or grey card in the photo.

    Parameters
    ----------
    picture
        The photo.
    pixel
        (x, y) on the card.
    gray
        Reflectance of the card, 0..1: 1 for a white card, 0.18 for a photographic grey card.

    Returns
    -------
    (3,) float64 linear RGB of a perfect diffuser in the light that falls on the card.

    Raises
    ------
    WhiteError, ReferenceColorError
        If the pixel lies outside, or is clipped or black.
    """
    x, y = check_pixel(picture, pixel, "White pixel")
    color = steady_mean(read_window(picture, (x, y)))
    if not np.isfinite(color).all():
        raise WhiteError(f"White pixel ({x}, {y}) is not finite: pick an ordinary pixel of the card.")
    if color.max() >= picture.clip_level:
        raise WhiteError(
            f"White pixel ({x}, {y}) is clipped, so its color is lost: pick a darker part of the card, or a grey one."
        )
    if color.min() <= 0:
        raise WhiteError(f"White pixel ({x}, {y}) is black in a channel: pick a lit white or grey card.")
    return color / gray


def white_from_highlights(
    picture: Picture, locus: NDArray, mask: NDArray | None = None
) -> tuple[NDArray[np.float64], float]:
    """Estimate the white of the light from the highlights of one product.

    All pixels of a glossy product lie in one plane through black, which holds the body color and the white
    (Shafer 1985). The white is where this plane meets the colors that lights have (Finlayson & Schaefer 2001,
    "Solving for colour constancy using a constrained dichromatic reflection model").

    Parameters
    ----------
    picture
        The photo.
    locus
        (n, 3) linear RGB of lights in the photo's space, of luminance 1: black bodies and daylights.
    mask
        Checked coverage of the product, or None.

    Returns
    -------
    white
        (3,) float64, of luminance 1.
    confidence
        0..1: the chance that it is within 3 degrees of the truth, as counted in the laboratory, by how clearly
        highlights stand out and how sharply the plane cuts the locus. Under `SURE_WHITE` the user should be asked.

    Raises
    ------
    WhiteError
        If there are no highlights to learn from.
    """
    sample = picture.sample(_SAMPLE_WHITE, mask)
    pixels = sample[(sample.max(axis=1) < picture.clip_level) & (sample.mean(axis=1) > DARK)].astype(np.float64)
    if len(pixels) < 50:
        raise WhiteError(
            "The product has too few unclipped, lit pixels to find the white: pick a white card or name the light."
        )
    body = _most_colored(pixels)
    body = body / np.linalg.norm(body)
    along = pixels @ body
    across = pixels - along[:, None] * body
    size = np.linalg.norm(across, axis=1)
    # Highlights: far from the body line, and brighter than the body usually is.
    bright = along > np.quantile(along, 0.5)
    spread = float(np.quantile(size[bright], 0.5)) + 1e-9
    glossy = bright & (size > 4 * spread) & (size > 0.03)
    if np.count_nonzero(glossy) < max(20, 0.0005 * len(pixels)):
        raise WhiteError("The product shows no highlights to find the white from: pick a white card or name the light.")
    # The plane: the body line, and the main direction in which highlights leave it.
    _, strength, directions = np.linalg.svd(across[glossy], full_matrices=False)
    normal = np.cross(body, directions[0])
    normal /= np.linalg.norm(normal)
    # Of the lights, the one nearest to the plane, on the side of the body to which highlights go.
    lights = locus / np.linalg.norm(locus, axis=1, keepdims=True)
    toward = directions[0] * np.sign(np.sum(across[glossy] @ directions[0]))
    off = np.abs(lights @ normal)
    off[(lights - (lights @ body)[:, None] * body) @ toward <= 0] = np.inf
    best = int(np.argmin(off))
    if not np.isfinite(off[best]) or off[best] > 0.1:
        raise WhiteError(
            "The highlights do not point to the color of any usual light: pick a white card or name the light."
        )
    flat = 1 - min(1.0, float(strength[1] / strength[0]) * 2)
    # A plane that runs along the locus cuts it nowhere in particular: how far apart are lights that fit as well?
    near = lights[off < off[best] + 0.02]
    spread = np.degrees(np.arccos(np.clip(near @ near.T, -1, 1))).max()
    sharp = 1 - min(1.0, float(spread) / 25)
    return locus[best].astype(np.float64), float(np.interp(flat * sharp, *_CHANCES))
