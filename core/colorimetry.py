"""Color in numbers: XYZ, Lab, chromatic adaptation, color differences, and linear RGB by way of them.

Scales: XYZ has Y = 1 for the white, L* is 0..100, hues are in degrees, linear RGB is 1 for the white of its
space. Everything works on the last axis, of three, and keeps float32 as float32; anything else becomes
float64. Spectra are in `spectra`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import spectra
from .colorspace import D50, D65, RGBSpace
from .errors import WhiteError

type Adaptation = Literal["cat16", "bradford"]


def _float(values: ArrayLike) -> NDArray:
    array = np.asarray(values)
    return array if array.dtype == np.float32 else array.astype(np.float64, copy=False)


def _times(values: ArrayLike, matrix: NDArray) -> NDArray:
    """Apply a matrix along the last axis in the precision of the values."""
    array = _float(values)
    return array @ matrix.T.astype(array.dtype)


# XYZ, xyY, Lab, LCh


def xyy_to_xyz(xyy: ArrayLike) -> NDArray:
    """CIE xyY (..., 3) to XYZ on the scale of Y; y = 0 gives no light."""
    x, y, Y = np.moveaxis(_float(xyy), -1, 0)
    scale = np.divide(Y, y, out=np.zeros_like(Y), where=y != 0)
    return np.stack([x * scale, np.where(y != 0, Y, 0), (1 - x - y) * scale], axis=-1)


def xyz_to_xyy(xyz: ArrayLike) -> NDArray:
    """XYZ (..., 3) to CIE xyY; black, which has no chromaticity, gets x = y = 0."""
    xyz = _float(xyz)
    total = xyz.sum(axis=-1, keepdims=True)
    xy = np.divide(xyz[..., :2], total, out=np.zeros_like(xyz[..., :2]), where=total != 0)
    return np.concatenate([xy, xyz[..., 1:2]], axis=-1)


def xyz_to_lab(xyz: ArrayLike, white: ArrayLike) -> NDArray:
    """XYZ to CIE 1976 L*a*b* (CIE 15:2018, 8.2.1).

    Parameters
    ----------
    xyz
        (..., 3), on the scale of the white. May be negative.
    white
        (3,) XYZ of the white.

    Returns
    -------
    (..., 3) L* (0..100), a*, b*.
    """
    xyz = _float(xyz)
    t = xyz / np.asarray(white, xyz.dtype)
    fx, fy, fz = np.moveaxis(np.where(t > (6 / 29) ** 3, np.cbrt(t), t * (29 / 6) ** 2 / 3 + 4 / 29), -1, 0)
    return np.stack([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)], axis=-1)


def lab_to_xyz(lab: ArrayLike, white: ArrayLike) -> NDArray:
    """CIE 1976 L*a*b* (..., 3) to XYZ on the scale of the white (3,); the inverse of `xyz_to_lab`."""
    L, a, b = np.moveaxis(_float(lab), -1, 0)
    fy = (L + 16) / 116
    f = np.stack([fy + a / 500, fy, fy - b / 200], axis=-1)
    t = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    return t * np.asarray(white, t.dtype)


def lab_to_lch(lab: ArrayLike) -> NDArray:
    """L*a*b* (..., 3) to L*, chroma, hue in 0..360 degrees."""
    L, a, b = np.moveaxis(_float(lab), -1, 0)
    return np.stack([L, np.hypot(a, b), np.degrees(np.arctan2(b, a)) % 360], axis=-1)


def lch_to_lab(lch: ArrayLike) -> NDArray:
    """L*, chroma and hue in degrees (..., 3) to L*a*b*."""
    L, C, h = np.moveaxis(_float(lch), -1, 0)
    h = np.radians(h)
    return np.stack([L, C * np.cos(h), C * np.sin(h)], axis=-1)


# Chromatic adaptation

_CONES = {
    "cat16": np.array(  # Li et al. 2017, "Comprehensive color solutions", Color Res. Appl. 42, 703
        [[0.401288, 0.650173, -0.051461], [-0.250268, 1.204414, 0.045854], [-0.002079, 0.048952, 0.953127]]
    ),
    "bradford": np.array(  # ICC.1:2022, annex E
        [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
    ),
}


# B. Ottosson, "A perceptual color space for image processing", 2020: XYZ to cones, and their cube roots to Oklab.
_OKLAB_CONES = np.array(
    [
        [0.8189330101, 0.3618667424, -0.1288597137],
        [0.0329845436, 0.9293118715, 0.0361456387],
        [0.0482003018, 0.2643662691, 0.6338517070],
    ]
)
_OKLAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def xyz_to_oklab(xyz: ArrayLike) -> NDArray:
    """XYZ (..., 3) under D65, Y = 1 for white, to Oklab with L of 0..1 (Ottosson 2020)."""
    return _times(np.cbrt(_times(xyz, _OKLAB_CONES)), _OKLAB)


def oklab_to_xyz(oklab: ArrayLike) -> NDArray:
    """Oklab (..., 3) to XYZ under D65; the inverse of `xyz_to_oklab`."""
    return _times(_times(oklab, np.linalg.inv(_OKLAB)) ** 3, np.linalg.inv(_OKLAB_CONES))


def adaptation_matrix(source: ArrayLike, destination: ArrayLike, method: Adaptation = "cat16") -> NDArray[np.float64]:
    """Von Kries adaptation of XYZ from one white to another, complete.

    Parameters
    ----------
    source, destination
        (3,) XYZ of the whites.
    method
        "cat16" or "bradford".

    Returns
    -------
    (3, 3) float64: multiplies XYZ columns seen under `source` and gives those seen under `destination`.

    Raises
    ------
    ValueError
        If there is no such method.
    """
    if method not in _CONES:
        raise ValueError(f"Adaptation '{method}' is not known: use {' or '.join(_CONES)}.")
    cones = _CONES[method]
    gains = (cones @ np.asarray(destination, np.float64)) / (cones @ np.asarray(source, np.float64))
    return np.linalg.inv(cones) @ (gains[:, None] * cones)


def white_xyz(name: str | float | spectra.Spectrum, observer: str = "1931") -> NDArray[np.float64]:
    """XYZ of a light's white, with Y = 1.

    Parameters
    ----------
    name
        Anything `spectra.illuminant` takes.
    observer
        "1931" or "1964". D65 and D50 for the 1931 observer are the four-digit chromaticities by which RGB
        spaces are defined (1e-4 from the integral of their spectra), so that a color measured under the white
        of a space needs no adaptation.
    """
    light = spectra.illuminant(name)
    published = {"D65": D65, "D50": D50}.get(light.name)
    if published and spectra.observer(observer) is spectra.observer("1931"):
        return xyy_to_xyz([*published, 1.0])
    return spectra.to_xyz(light, observer_name=observer)


# Linear RGB


def linear_to_xyz(rgb: ArrayLike, space: RGBSpace) -> NDArray:
    """Linear RGB (..., 3) of a space to XYZ, not adapted; (1, 1, 1) gives Y = 1."""
    return _times(rgb, space.to_xyz)


def xyz_to_linear(xyz: ArrayLike, space: RGBSpace) -> NDArray:
    """XYZ (..., 3) to linear RGB of a space, not adapted, not clipped."""
    return _times(xyz, space.from_xyz)


def conversion_matrix(source: RGBSpace, target: RGBSpace) -> NDArray[np.float64]:
    """(3, 3): linear RGB of one space to that of another, white to white by Bradford, as ICC profiles have it."""
    adapted = adaptation_matrix(source.white, target.white, "bradford")
    return target.from_xyz @ adapted @ source.to_xyz


def linear_to_lab(rgb: ArrayLike, space: RGBSpace, white: ArrayLike | None = None) -> NDArray:
    """Linear RGB (..., 3) of a space to L*a*b*.

    Parameters
    ----------
    rgb
        (..., 3) linear RGB.
    space
        What it means.
    white
        (3,) linear RGB, in the same space, of what counts as white; None for the white of the space. It
        becomes the white of L*a*b* as it is, which is CIE 1976's own adaptation.
    """
    white = space.white if white is None else linear_to_xyz(np.asarray(white, np.float64), space)
    return xyz_to_lab(linear_to_xyz(rgb, space), white)


def lab_to_linear(lab: ArrayLike, space: RGBSpace, white: ArrayLike | None = None) -> NDArray:
    """L*a*b* (..., 3) to linear RGB of a space; the inverse of `linear_to_lab`."""
    white = space.white if white is None else linear_to_xyz(np.asarray(white, np.float64), space)
    return xyz_to_linear(lab_to_xyz(lab, white), space)


def illuminant_white(
    name: str | float | spectra.Spectrum,
    space: RGBSpace,
    observer: str = "1931",
    camera: str | Path | spectra.Spectrum | None = None,
) -> NDArray[np.float64]:
    """Pixel of a perfect white diffuser under a light, in a photo balanced for the white of its space.

    Nothing is adapted: in a space with a D65 white, D65 gives (1, 1, 1) within 3e-4 (the white of the space
    is rounded to four digits) and A a warm triple.

    Parameters
    ----------
    name
        Anything `spectra.illuminant` takes.
    space
        RGB space of the photo. With a camera it is the camera's own, and `space` is not used.
    observer
        "1931" or "1964". The 10° values are read as if they were 1931 ones, as RGB spaces know no other.
    camera
        Anything `spectra.camera_sensitivities` takes: its response instead of the observer's, W_k of Eq.
        (31).

    Returns
    -------
    (3,) float64 linear RGB with Y = 1 (with a camera, G = 1).

    Raises
    ------
    WhiteError
        If the light is not known, or lies outside the space so that a channel would not be positive.
    """
    if camera is not None:
        white = spectra.to_camera(name, None, camera)
    else:
        white = xyz_to_linear(spectra.to_xyz(name, observer_name=observer), space)
    if white.min() <= 0:
        shown = name.name if isinstance(name, spectra.Spectrum) else name
        rgb = ", ".join(f"{channel:.3g}" for channel in white)
        raise WhiteError(
            f"Illuminant '{shown}' is outside {space.name} (its white would be {rgb}): use a wider space "
            "such as rec2020, or give the white as linear RGB."
        )
    return white


# Color difference


def delta_e_1976(lab1: ArrayLike, lab2: ArrayLike) -> NDArray:
    """CIE 1976 color difference of L*a*b* (..., 3), broadcast (CIE 15:2018, 8.2.1.3)."""
    return np.linalg.norm(_float(lab1) - _float(lab2), axis=-1)


def delta_e_cmc(
    reference: ArrayLike,
    sample: ArrayLike,
    l: float | NDArray = 2.0,  # noqa: E741
    c: float | NDArray = 1.0,
) -> NDArray:
    """CMC(l:c) color difference (ISO 105-J03:2009); the paper uses CMC(1:1).

    Parameters
    ----------
    reference, sample
        (..., 3) L*a*b*, broadcast. The tolerances are those of the reference: the two do not commute.
    l, c
        Weights of lightness and chroma, broadcast: 2:1 for acceptability, 1:1 for perceptibility.

    Returns
    -------
    (...) differences.
    """
    L1, C1, h1 = np.moveaxis(lab_to_lch(reference), -1, 0)
    L2, C2, _ = np.moveaxis(lab_to_lch(sample), -1, 0)
    _, da, db = np.moveaxis(_float(reference) - _float(sample), -1, 0)
    dL, dC = L1 - L2, C1 - C2
    dH2 = np.maximum(da**2 + db**2 - dC**2, 0)
    S_L = np.where(L1 < 16, 0.511, 0.040975 * L1 / (1 + 0.01765 * L1))
    S_C = 0.0638 * C1 / (1 + 0.0131 * C1) + 0.638
    F = np.sqrt(C1**4 / (C1**4 + 1900))
    violet = (h1 >= 164) & (h1 <= 345)
    T = np.where(
        violet,
        0.56 + np.abs(0.2 * np.cos(np.radians(h1 + 168))),
        0.36 + np.abs(0.4 * np.cos(np.radians(h1 + 35))),
    )
    S_H = S_C * (F * T + 1 - F)
    return np.sqrt((dL / (l * S_L)) ** 2 + (dC / (c * S_C)) ** 2 + dH2 / S_H**2)


def delta_e_2000(lab1: ArrayLike, lab2: ArrayLike) -> NDArray:
    """CIEDE2000 color difference with k_L = k_C = k_H = 1 (ISO/CIE 11664-6:2014).

    Parameters
    ----------
    lab1, lab2
        (..., 3) L*a*b*, broadcast. Two float32 arrays are compared in float32.

    Returns
    -------
    (...) differences.
    """
    first, second = np.broadcast_arrays(_float(lab1), _float(lab2))
    result = np.empty(first.shape[:-1], np.result_type(first, second))
    flat1, flat2, out = first.reshape(-1, 3), second.reshape(-1, 3), result.reshape(-1)
    # In blocks that fit the processor's cache the two dozen temporaries cost half as much.
    for start in range(0, len(out), 16384):
        block = slice(start, start + 16384)
        out[block] = _delta_e_2000(flat1[block], flat2[block])
    return result


def _delta_e_2000(lab1: NDArray, lab2: NDArray) -> NDArray:
    # In the notation of Sharma, Wu and Dalal 2005, Color Res. Appl. 30, 21; their pairs are in the tests.
    L1, a1, b1 = np.ascontiguousarray(lab1.T)
    L2, a2, b2 = np.ascontiguousarray(lab2.T)
    stretch = 1.5 - 0.5 * _saturation((_length(a1, b1) + _length(a2, b2)) / 2)
    a1, a2 = a1 * stretch, a2 * stretch
    C1, C2 = _length(a1, b1), _length(a2, b2)
    h1, h2 = _positive(np.arctan2(b1, a1)), _positive(np.arctan2(b2, a2))

    product = C1 * C2
    dh = h2 - h1
    # Opposite hues have two means; rounding must not choose between them.
    apart = np.abs(dh) > np.pi + 1e-9
    dh = np.where(apart, dh - np.copysign(2 * np.pi, dh).astype(dh.dtype), dh)
    dh = np.where(product == 0, 0, dh)
    # Without hue on one side the mean is the sum, as the other hue is what remains.
    h = np.where(product == 0, h1 * (C1 != 0) + h2 * (C2 != 0), h1 + dh / 2)

    L, C = (L1 + L2) / 2, (C1 + C2) / 2
    T = (
        1
        - 0.17 * np.cos(h - np.pi / 6)
        + 0.24 * np.cos(2 * h)
        + 0.32 * np.cos(3 * h + np.pi / 30)
        - 0.20 * np.cos(4 * h - 63 * np.pi / 180)
    )
    S_L = 1 + 0.015 * (L - 50) ** 2 / np.sqrt(20 + (L - 50) ** 2)
    S_C = 1 + 0.045 * C
    S_H = 1 + 0.015 * C * T
    turns = h / (2 * np.pi)
    # Cut where it is nothing, as numbers under the smallest ordinary ones take many times as long.
    blue = np.exp(-np.minimum(((360 * (turns - np.floor(turns)) - 275) / 25) ** 2, 40))
    R_T = -2 * _saturation(C) * np.sin(np.pi / 3 * blue)
    dL = (L2 - L1) / S_L
    dC = (C2 - C1) / S_C
    dH = 2 * np.sqrt(product) * np.sin(dh / 2) / S_H
    # Rounding can make the sum of equal colors a hair negative.
    return np.sqrt(np.maximum(dL**2 + dC**2 + dH**2 + R_T * dC * dH, 0))


def _length(a: NDArray, b: NDArray) -> NDArray:
    # np.hypot, which minds overflow, takes ten times as long.
    return np.sqrt(a * a + b * b)


def _positive(angle: NDArray) -> NDArray:
    return np.where(angle < 0, angle + 2 * np.pi, angle)


def _saturation(C: NDArray) -> NDArray:
    C7 = (C / 25) ** 7
    return np.sqrt(C7 / (C7 + 1))
