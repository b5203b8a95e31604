"""Target colors: what people write for one, and what it means as a pixel.

Written forms (numbers separated by commas or blanks, names in any case):

=============================  ========================================================================
``#C0392B``, ``#c32``          sRGB codes
``rgb(0.5, 0.04, 0.02)``       linear RGB in the photo's own space, as ``0.5, 0.04, 0.02`` alone
``lab(42, 55, 35)``            CIE L*a*b*, white D50 unless stated (as ICC, CSS and Photoshop have it)
``lch(42, 65, 32)``            the same by chroma and hue in degrees
``xyz(0.2, 0.12, 0.05)``       CIE XYZ with Y = 1 for the perfect diffuser, white D65 unless stated
``xyy(0.5, 0.33, 0.12)``       the same by chromaticity
``red.csv``                    a measured reflectance, a line for each wavelength: nm, value 0..1
=============================  ========================================================================

The white follows a slash, with the observer in degrees if it is not 2: ``lab(42, 55, 35 / D65 10)``. It is
anything `spectra.illuminant` takes. Colors for the 10° observer are read as 2° ones relative to their own
white: a pixel cannot tell.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import colorimetry, spectra
from .colorimetry import Adaptation
from .colorspace import SRGB, RGBSpace
from .errors import DyehouseError, TargetError
from .spectra import Spectrum

type Triple = tuple[float, float, float]
type Light = str | float | Spectrum
type Camera = str | Path | Spectrum

# Beyond this linear RGB is surely 8-bit codes: 4 is two stops over white.
_BRIGHTEST = 4.0
_EXAMPLES = "#C0392B, lab(42, 55, 35), xyz(0.2, 0.12, 0.05), rgb(0.5, 0.04, 0.02) or a spectrum such as red.csv"


@dataclass(frozen=True)
class Linear:
    """Linear RGB (1 for white) in whichever space the photo has."""

    rgb: Triple


@dataclass(frozen=True)
class Stimulus:
    """A color seen under a white: XYZ of both, Y = 1 for the white."""

    xyz: Triple
    white: Triple


@dataclass(frozen=True)
class Swatch:
    """A target color, and all that is known about it.

    Attributes
    ----------
    text
        As the user wrote it, or the name from a swatch file.
    color
        What it is: `Linear`, `Stimulus`, or the `Spectrum` of a reflectance, 0..1.
    """

    text: str
    color: Linear | Stimulus | Spectrum

    def __str__(self) -> str:
        return self.text

    @classmethod
    def from_linear(cls, rgb: ArrayLike, name: str = "") -> Swatch:
        """Make a swatch of linear RGB (3,) in the photo's space."""
        color = _triple(rgb)
        return cls(name or f"rgb({_written(color)})", Linear(color))

    @classmethod
    def from_srgb(cls, rgb: ArrayLike, name: str = "") -> Swatch:
        """Make a swatch of sRGB codes (3,), 0..1."""
        rgb = np.asarray(rgb, np.float64)
        xyz = colorimetry.linear_to_xyz(SRGB.curve.decode(rgb), SRGB)
        code = "#" + "".join(f"{round(255 * channel):02X}" for channel in np.clip(rgb, 0, 1))
        return cls(name or code, Stimulus(_triple(xyz), _triple(SRGB.white)))

    @classmethod
    def from_xyz(cls, xyz: ArrayLike, white: Light = "D65", observer: str = "1931", name: str = "") -> Swatch:
        """Make a swatch of CIE XYZ (3,) with Y = 1 for the perfect diffuser, under a white by name."""
        color = _triple(xyz)
        white_xyz = colorimetry.white_xyz(white, observer)
        return cls(name or f"xyz({_written(color)})", Stimulus(color, _triple(white_xyz)))

    @classmethod
    def from_lab(cls, lab: ArrayLike, white: Light = "D50", observer: str = "1931", name: str = "") -> Swatch:
        """Make a swatch of CIE L*a*b* (3,) under a white by name."""
        white_xyz = colorimetry.white_xyz(white, observer)
        xyz = colorimetry.lab_to_xyz(np.asarray(lab, np.float64), white_xyz)
        return cls(name or f"lab({_written(_triple(lab))})", Stimulus(_triple(xyz), _triple(white_xyz)))

    @classmethod
    def from_spectrum(cls, reflectance: Spectrum, name: str = "") -> Swatch:
        """Make a swatch of a reflectance, 0..1.

        Raises
        ------
        TargetError
            If it is not one: in percent, or negative.
        """
        name = name or reflectance.name
        low, high = reflectance.values.min(), reflectance.values.max()
        if high > 2:
            raise TargetError(f"Spectrum '{name}' goes up to {high:g}: divide percent by 100, reflectance is 0 to 1.")
        if low < -0.05:  # an instrument's noise around black is let through
            raise TargetError(f"Spectrum '{name}' goes down to {low:g}: give a reflectance from 0 to 1.")
        return cls(name, reflectance)

    def to_linear(
        self,
        space: RGBSpace,
        illuminant: Light | None = None,
        observer: str = "1931",
        camera: Camera | None = None,
        adaptation: Adaptation = "cat16",
    ) -> NDArray[np.float64]:
        """Color as a pixel of a photo.

        Parameters
        ----------
        space
            RGB space of the photo.
        illuminant
            The light on the product, for a spectrum: the pixel is then what that light gives, not adapted, so
            that a perfect diffuser gives `colorimetry.illuminant_white` of it. None: the photo is balanced,
            and the color is adapted from daylight of the space's white (D50, D55, D60, D65 or D75, the
            nearest) to exactly that white. Other swatches carry their own white and are adapted from it to
            that of the space.
        observer
            "1931" or "1964", for a spectrum.
        camera
            Sensitivities of the camera, for a spectrum: its response with G = 1 for a perfect diffuser under
            `illuminant` (D65 when that is None), in the camera's own RGB instead of `space`.
        adaptation
            "cat16" or "bradford".

        Returns
        -------
        (3,) float64 linear RGB. Colors outside the space have negative channels.
        """
        if isinstance(self.color, Linear):
            return np.array(self.color.rgb)
        if isinstance(self.color, Spectrum):
            if camera is not None:
                return spectra.to_camera("D65" if illuminant is None else illuminant, self.color, camera)
            if illuminant is not None:
                return colorimetry.xyz_to_linear(spectra.to_xyz(illuminant, self.color, observer), space)
            balanced = _daylight_near(space)
            xyz = spectra.to_xyz(balanced, self.color, observer)
            white = spectra.to_xyz(balanced, None, observer)
        else:
            xyz, white = np.array(self.color.xyz), np.array(self.color.white)
        adapted = colorimetry.adaptation_matrix(white, space.white, adaptation) @ xyz
        return colorimetry.xyz_to_linear(adapted, space)

    def to_reflected(
        self,
        space: RGBSpace,
        white: ArrayLike,
        illuminant: Light | None = None,
        observer: str = "1931",
        camera: Camera | None = None,
        adaptation: Adaptation = "cat16",
    ) -> NDArray[np.float64]:
        """Pixel of a matte product of this color where a perfect diffuser gives `white`.

        A spectrum under a known illuminant (or camera) is exact: per channel, its response over that of the
        diffuser, times `white`. Anything else is `to_linear` times `white`: von Kries in the photo's own RGB,
        an approximation that is exact for grays and under the white of the space.

        Parameters
        ----------
        space, illuminant, observer, camera, adaptation
            As for `to_linear`.
        white
            (3,) linear RGB of a perfect diffuser in the photo.

        Returns
        -------
        (3,) float64 linear RGB.

        Raises
        ------
        WhiteError
            If the illuminant lies outside the space.
        """
        pixel = self.to_linear(space, illuminant, observer, camera, adaptation)
        if isinstance(self.color, Spectrum) and (illuminant is not None or camera is not None):
            light = "D65" if illuminant is None else illuminant
            pixel = pixel / colorimetry.illuminant_white(light, space, observer, camera)
        return pixel * np.asarray(white, np.float64)

    def to_xyz(
        self, illuminant: Light = "D50", space: RGBSpace = SRGB, adaptation: Adaptation = "cat16"
    ) -> NDArray[np.float64]:
        """XYZ (3,), Y = 1 for white, under a light: a spectrum as measured, anything else adapted.

        Parameters
        ----------
        illuminant
            Anything `spectra.illuminant` takes, for the 2° observer.
        space
            What linear RGB means.
        adaptation
            "cat16" or "bradford".
        """
        if isinstance(self.color, Spectrum):
            return spectra.to_xyz(illuminant, self.color)
        if isinstance(self.color, Linear):
            xyz, white = colorimetry.linear_to_xyz(self.color.rgb, space), space.white
        else:
            xyz, white = np.array(self.color.xyz), np.array(self.color.white)
        return colorimetry.adaptation_matrix(white, colorimetry.white_xyz(illuminant), adaptation) @ xyz

    def to_lab(
        self, illuminant: Light = "D50", space: RGBSpace = SRGB, adaptation: Adaptation = "cat16"
    ) -> NDArray[np.float64]:
        """CIE L*a*b* (3,) under a light, for reports; parameters as for `to_xyz`."""
        if isinstance(self.color, Spectrum):
            white = spectra.to_xyz(illuminant)
        else:
            white = colorimetry.white_xyz(illuminant)
        return colorimetry.xyz_to_lab(self.to_xyz(illuminant, space, adaptation), white)


def _triple(values: ArrayLike) -> Triple:
    first, second, third = np.asarray(values, np.float64).tolist()
    return first, second, third


def _written(triple: Triple) -> str:
    return ", ".join(f"{value:.4g}" for value in triple)


def _daylight_near(space: RGBSpace) -> str:
    """Return the tabulated daylight whose chromaticity is nearest to the white of the space."""
    white = colorimetry.xyz_to_xyy(space.white)[:2]
    names = ("D65", "D50", "D55", "D60", "D75")
    return min(names, key=lambda name: float(np.hypot(*(colorimetry.xyz_to_xyy(spectra.to_xyz(name))[:2] - white))))


_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_SEPARATOR = r"(?:\s*,\s*|\s+)"
_NUMBERS = rf"\s*({_NUMBER}){_SEPARATOR}({_NUMBER}){_SEPARATOR}({_NUMBER})\s*"
_FUNCTION = re.compile(rf"(rgb|lab|lch|xyz|xyy)\s*\({_NUMBERS}(?:/([^()]*))?\)", re.IGNORECASE)
_BARE = re.compile(_NUMBERS, re.IGNORECASE)
_HEX = re.compile(r"#([0-9a-f]{3}|[0-9a-f]{6})", re.IGNORECASE)
_WHITE = re.compile(r"\s*(\S.*?)(?:[\s/]+(2|10)\s*°?)?\s*")


def parse_target(text: str, base: str | Path | None = None) -> Swatch:
    """Read a target color in any of the forms of this module.

    Parameters
    ----------
    text
        As written by the user.
    base
        The folder that paths of spectra start from; None for the current one.

    Returns
    -------
    The swatch, with `text` as its text.

    Raises
    ------
    TargetError
        If it cannot be understood, its numbers are out of range, or its spectrum cannot be read.
    """
    text = text.strip()
    try:
        if text.lower().endswith(".csv") or re.match(r"spectrum\s*\(", text, re.IGNORECASE):
            return _parse_spectrum(text, base)
        if match := _HEX.fullmatch(text):
            digits = match[1] if len(match[1]) == 6 else "".join(2 * digit for digit in match[1])
            return Swatch.from_srgb(np.frombuffer(bytes.fromhex(digits), np.uint8) / 255, text)
        if match := _FUNCTION.fullmatch(text):
            kind, *numbers, white = match.groups()
        elif match := _BARE.fullmatch(text):
            kind, numbers, white = "rgb", list(match.groups()), None
        else:
            raise TargetError(f"Target '{text}' is not a color: write {_EXAMPLES}.")
        return _parse_numbers(kind.lower(), [float(number) for number in numbers], white, text)
    except TargetError:
        raise
    except DyehouseError as error:
        raise TargetError(f"Target '{text}': {error}") from error


def _parse_spectrum(text: str, base: str | Path | None) -> Swatch:
    match = re.fullmatch(r"spectrum\s*\(\s*['\"]?(.+?)['\"]?\s*\)", text, re.IGNORECASE)
    path = Path(match[1] if match else text).expanduser()
    return Swatch.from_spectrum(spectra.read_csv(Path(base or ".") / path), text)


def _parse_numbers(kind: str, numbers: list[float], white: str | None, text: str) -> Swatch:
    if kind == "rgb":
        if white is not None:
            raise TargetError(f"Target '{text}' has a white, but rgb() is in the photo's space: leave out '/{white}'.")
        if max(numbers) > _BRIGHTEST:
            raise TargetError(
                f"Target '{text}' is too bright: rgb() is linear light where 1 is white, so write codes of 0 "
                "to 255 in hexadecimal as #C0392B."
            )
        return Swatch.from_linear(numbers, text)
    _check_range(kind, numbers, text)
    # Written without a white, Lab is a print's (D50) and XYZ a screen's (D65).
    light, observer = "D50" if kind in ("lab", "lch") else "D65", "1931"
    if white is not None:
        if not (match := _WHITE.fullmatch(white)):
            raise TargetError(f"Target '{text}' has no white after the slash: write one, as in lab(42, 55, 35 / D65).")
        light, observer = match[1], {"10": "1964"}.get(match[2], "1931")
    if kind in ("lab", "lch"):
        lab = numbers if kind == "lab" else colorimetry.lch_to_lab(numbers)
        return Swatch.from_lab(lab, light, observer, text)
    xyz = numbers if kind == "xyz" else colorimetry.xyy_to_xyz(numbers)
    return Swatch.from_xyz(xyz, light, observer, text)


def _check_range(kind: str, numbers: list[float], text: str) -> None:
    first, second, third = numbers
    if kind in ("lab", "lch"):
        if not 0 <= first <= 100:
            raise TargetError(f"Target '{text}' has lightness {first:g}: L is 0 (black) to 100 (white).")
        if kind == "lch" and second < 0:
            raise TargetError(f"Target '{text}' has chroma {second:g}: C is 0 or more, as in lch(42, 65, 32).")
        return
    Y = second if kind == "xyz" else third
    if not 0 <= Y <= 1.5:
        raise TargetError(f"Target '{text}' has Y = {Y:g}: Y is 0 to 1 here, 1 for white, so divide percent by 100.")
    if kind == "xyz" and min(first, third) < 0:
        raise TargetError(f"Target '{text}' is negative: X, Y and Z are 0 or more, as in xyz(0.2, 0.12, 0.05).")
    if kind == "xyy" and not (first >= 0 and second > 0 and first + second <= 1):
        raise TargetError(
            f"Target '{text}' has no such chromaticity: x and y are positive with x + y at most 1, as in "
            "xyy(0.5, 0.33, 0.12)."
        )
