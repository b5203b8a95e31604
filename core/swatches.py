"""Target colors: what people write for one, and what it means as a pixel.

Written forms (numbers separated by commas or blanks, names in any case):

=============================  ========================================================================
``#C0392B``, ``#c32``          sRGB codes
``rgb(0.5, 0.04, 0.02)``       linear RGB in the photo's own space, as ``0.5, 0.04, 0.02`` alone
``lab(42, 55, 35)``            CIE L*a*b*, white D50 unless stated (as ICC, CSS and Photoshop have it)
``lch(42, 65, 32)``            the same by chroma and hue in degrees
``xyz(0.2, 0.12, 0.05)``       CIE XYZ with Y = 1 for the perfect diffuser, white D65 unless stated
``xyy(0.5, 0.33, 0.12)``       the same by chromaticity
``color(rec2020 .8 .2 .1)``    codes of a space of `colorspace.SPACES`
``red.csv``                    a measured reflectance, a line for each wavelength: nm, value 0..1
``reflectance(400:0.1, ...)``  the same without a file
``CSS#teal``                   a swatch of a library by name: built-in, or a swatch file or a folder of them
=============================  ========================================================================

The white follows a slash, with the observer in degrees if it is not 2: ``lab(42, 55, 35 / D65 10)``. It is
anything `spectra.illuminant` takes, or XYZ. Colors for the 10° observer are read as 2° ones relative to their own
white: a pixel cannot tell.

A swatch keeps what it was given as. It is converted once, to the pixel or to the figures that are asked for.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import colorimetry, spectra
from .colorimetry import Adaptation
from .colorspace import SRGB, RGBSpace, space_named
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
class Encoded:
    """RGB codes, 0..1, of a space by its name in `colorspace.SPACES`."""

    rgb: Triple
    space: str = "srgb"


@dataclass(frozen=True)
class Stimulus:
    """A color seen under a white: XYZ of both, Y = 1 for the white.

    `illuminant` and `observer` say which white it is; no illuminant: one without a name.
    """

    xyz: Triple
    white: Triple
    illuminant: str = ""
    observer: str = "1931"


type Color = Linear | Encoded | Stimulus | Spectrum


@dataclass(frozen=True)
class Swatch:
    """A target color, and all that is known about it.

    Attributes
    ----------
    text
        As the user wrote it, or the name from a swatch file.
    color
        What it is: `Linear`, `Encoded`, `Stimulus`, or the `Spectrum` of a reflectance, 0..1.
    """

    text: str
    color: Color

    def __str__(self) -> str:
        return self.text

    @property
    def written(self) -> str:
        """The color itself as `parse_target` reads it, without a file or a library."""
        color = self.color
        if isinstance(color, Spectrum):
            pairs = zip(color.wavelengths, color.values, strict=True)
            return "reflectance(" + ", ".join(f"{nm:g}:{value:.10g}" for nm, value in pairs) + ")"
        if isinstance(color, Linear):
            return f"rgb({_exact(color.rgb)})"
        if isinstance(color, Encoded):
            codes = 255 * np.array(color.rgb)
            if color.space == "srgb" and np.array_equal(codes.round() / 255, color.rgb) and codes.min() >= 0:
                return _hexadecimal(color.rgb)
            return f"color({color.space} {_exact(color.rgb).replace(',', '')})"
        white = color.illuminant or _exact(color.white)
        degrees = " 10" if color.observer == "1964" and color.illuminant else ""
        lab = _triple(colorimetry.xyz_to_lab(color.xyz, color.white))
        kind, numbers = ("lab", lab) if 0 <= lab[0] <= 100 else ("xyz", color.xyz)
        return f"{kind}({_exact(numbers)} / {white}{degrees})"

    @property
    def kind(self) -> str:
        """What the swatch is, in words: how it was measured or written."""
        color = self.color
        if isinstance(color, Spectrum):
            first, last = color.wavelengths[[0, -1]]
            return f"reflectance spectrum, {first:g} to {last:g} nm in {len(color.wavelengths)} steps"
        if isinstance(color, Linear):
            return "linear RGB of the photo"
        if isinstance(color, Encoded):
            return f"{space_named(color.space).name} codes"
        degrees = {"1931": "2°", "1964": "10°"}[color.observer]
        return f"CIE color under {color.illuminant or 'its own white'}, {degrees} observer"

    def fate(
        self,
        space: RGBSpace,
        illuminant: Light | None = None,
        observer: str = "1931",
        camera: Camera | None = None,
        adaptation: Adaptation = "cat16",
    ) -> str:
        """What `to_linear` will do to the swatch, in one sentence; parameters as there."""
        method = {"cat16": "CAT16", "bradford": "Bradford"}[adaptation]
        if isinstance(self.color, Linear):
            return "The linear RGB is taken as it is."
        if not isinstance(self.color, Spectrum):
            return f"The {self.kind} is adapted to the white of {space.name} by {method}."
        light = spectra.illuminant("D65" if illuminant is None else illuminant).name
        if camera is not None:
            name = spectra.camera_sensitivities(camera).name
            return f"The spectrum is integrated under {light} with the sensitivities of {name}."
        if illuminant is not None:
            return f"The spectrum is integrated under {light} for the CIE {observer} observer, without adaptation."
        return (
            f"The spectrum is integrated under {_daylight_near(space)} for the CIE {observer} observer and adapted to "
            f"the white of {space.name} by {method}."
        )

    @classmethod
    def from_linear(cls, rgb: ArrayLike, name: str = "") -> Swatch:
        """Make a swatch of linear RGB (3,) in the photo's space."""
        color = _triple(rgb)
        return cls(name or f"rgb({_written(color)})", Linear(color))

    @classmethod
    def from_srgb(cls, rgb: ArrayLike, name: str = "") -> Swatch:
        """Make a swatch of sRGB codes (3,), 0..1."""
        codes = _triple(rgb)
        return cls(name or _hexadecimal(codes), Encoded(codes))

    @classmethod
    def from_xyz(cls, xyz: ArrayLike, white: Light = "D65", observer: str = "1931", name: str = "") -> Swatch:
        """Make a swatch of CIE XYZ (3,) with Y = 1 for the perfect diffuser, under a white by name."""
        color = _triple(xyz)
        return cls(name or f"xyz({_written(color)})", _stimulus(color, white, observer))

    @classmethod
    def from_lab(cls, lab: ArrayLike, white: Light = "D50", observer: str = "1931", name: str = "") -> Swatch:
        """Make a swatch of CIE L*a*b* (3,) under a white by name."""
        xyz = colorimetry.lab_to_xyz(np.asarray(lab, np.float64), _white_named(white, observer)[0])
        return cls(name or f"lab({_written(_triple(lab))})", _stimulus(xyz, white, observer))

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
            xyz, white = _seen(self.color)
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
        return xyz_of([self], illuminant, space, adaptation)[0]

    def to_lab(
        self, illuminant: Light = "D50", space: RGBSpace = SRGB, adaptation: Adaptation = "cat16"
    ) -> NDArray[np.float64]:
        """CIE L*a*b* (3,) under a light, for reports; parameters as for `to_xyz`."""
        return lab_of([self], illuminant, space, adaptation)[0]


def xyz_of(
    swatches: Sequence[Swatch], illuminant: Light = "D50", space: RGBSpace = SRGB, adaptation: Adaptation = "cat16"
) -> NDArray[np.float64]:
    """XYZ (n, 3) of many swatches at once; parameters as for :meth:`Swatch.to_xyz`."""
    return _under(swatches, illuminant, space, adaptation)[0]


def lab_of(
    swatches: Sequence[Swatch], illuminant: Light = "D50", space: RGBSpace = SRGB, adaptation: Adaptation = "cat16"
) -> NDArray[np.float64]:
    """CIE L*a*b* (n, 3) of many swatches at once; parameters as for :meth:`Swatch.to_xyz`."""
    return colorimetry.xyz_to_lab(*_under(swatches, illuminant, space, adaptation))


def _under(
    swatches: Sequence[Swatch], illuminant: Light, space: RGBSpace, adaptation: Adaptation
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) XYZ of swatches under a light, and (n, 3) of its white as each kind of swatch has it."""
    xyz = np.empty((len(swatches), 3))
    whites = np.tile(colorimetry.white_xyz(illuminant), (len(swatches), 1))
    # What shares its wavelengths or its white is converted together: one after the other takes a hundred times longer.
    together: dict[object, list[int]] = {}
    for k, swatch in enumerate(swatches):
        together.setdefault(_company(swatch.color), []).append(k)
    for places in together.values():
        colors = [swatches[k].color for k in places]
        if isinstance(colors[0], Spectrum):
            columns = np.column_stack([color.values for color in colors if isinstance(color, Spectrum)])
            xyz[places] = spectra.to_xyz(illuminant, Spectrum(colors[0].wavelengths, columns))
            whites[places] = spectra.to_xyz(illuminant)
            continue
        if isinstance(colors[0], Linear):
            rgb = np.array([color.rgb for color in colors if isinstance(color, Linear)])
            seen, white = colorimetry.linear_to_xyz(rgb, space), space.white
        else:
            pairs = [_seen(color) for color in colors if isinstance(color, Encoded | Stimulus)]
            seen, white = np.array([pair[0] for pair in pairs]), pairs[0][1]
        xyz[places] = seen @ colorimetry.adaptation_matrix(white, whites[places[0]], adaptation).T
    return xyz, whites


def is_plausible(color: Color) -> bool:
    """Tell whether a color read from a file can be one, so that `Swatch.written` of it can be read again."""
    if isinstance(color, Spectrum):
        return True  # checked when it was made
    if not isinstance(color, Stimulus):
        return bool(np.abs(color.rgb).max() <= _BRIGHTEST)
    X, Y, Z = color.xyz
    # Lab of very saturated colors means XYZ below 0, and white may be brighter than the diffuser.
    return (
        min(X, Z) >= -_BRIGHTEST and max(X, Z) <= _BRIGHTEST and 0 <= Y <= (1.5 if min(X, Z) >= 0 else color.white[1])
    )


def _company(color: Color) -> object:
    if isinstance(color, Spectrum):
        return color.wavelengths.tobytes()
    if isinstance(color, Stimulus):
        return color.white
    return color.space if isinstance(color, Encoded) else None


def _seen(color: Encoded | Stimulus) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """XYZ of a color and of its white."""
    if isinstance(color, Stimulus):
        return np.array(color.xyz), np.array(color.white)
    space = space_named(color.space)
    return colorimetry.linear_to_xyz(space.curve.decode(color.rgb), space), space.white


def _stimulus(xyz: ArrayLike, white: Light, observer: str) -> Stimulus:
    seen_under, name, year = _white_named(white, observer)
    return Stimulus(_triple(xyz), seen_under, name, year)


def _white_named(white: Light, observer: str) -> tuple[Triple, str, str]:
    """XYZ of a white, the name that stands for it ("" for none), and the observer."""
    if isinstance(white, Spectrum) or ".csv" in str(white).lower():  # a file may be another one tomorrow
        return _triple(colorimetry.white_xyz(white, observer)), "", spectra.observer(observer).name[-4:]
    return _known_white(str(white), observer)


@lru_cache(maxsize=256)
def _known_white(white: str, observer: str) -> tuple[Triple, str, str]:
    xyz = _triple(colorimetry.white_xyz(white, observer))
    return xyz, spectra.illuminant(white).name, spectra.observer(observer).name[-4:]


def _triple(values: ArrayLike) -> Triple:
    first, second, third = np.asarray(values, np.float64).tolist()
    return first, second, third


def _written(triple: Triple) -> str:
    return ", ".join(f"{value:.4g}" for value in triple)


def _exact(triple: Triple) -> str:
    return ", ".join(f"{value:.12g}" for value in triple)


def _hexadecimal(codes: Triple) -> str:
    return "#" + "".join(f"{round(255 * channel):02X}" for channel in np.clip(codes, 0, 1))


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
_CODES = re.compile(rf"color\s*\(\s*([a-z][\w-]*)\s{_NUMBERS}\)", re.IGNORECASE)
_REFLECTANCE = re.compile(r"reflectance\s*\((.*)\)", re.IGNORECASE | re.DOTALL)
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
        if match := _REFLECTANCE.fullmatch(text):
            return _parse_reflectance(match[1], text)
        if match := _CODES.fullmatch(text):
            return _parse_codes(match[1], [float(code) for code in match.groups()[1:]], text)
        if "#" in text[1:]:
            return _parse_library(text, base)
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


def _parse_reflectance(inside: str, text: str) -> Swatch:
    pairs = re.findall(rf"({_NUMBER})\s*:\s*({_NUMBER})", inside, re.IGNORECASE)
    plain = re.sub(r"[\s,]", "", inside)
    table = np.array(pairs, np.float64).reshape(-1, 2)
    if len(table) < 2 or len(plain) != sum(len(a) + len(b) + 1 for a, b in pairs) or (np.diff(table[:, 0]) <= 0).any():
        raise TargetError(
            f"Target '{text}' is no reflectance: write increasing wavelengths with values of 0 to 1, as in "
            "reflectance(400:0.05, 500:0.1, 600:0.4, 700:0.5)."
        )
    return Swatch.from_spectrum(Spectrum(table[:, 0], table[:, 1], text), text)


def _parse_codes(space: str, codes: list[float], text: str) -> Swatch:
    space_named(space)  # says in words if there is none
    if max(codes) > _BRIGHTEST:
        raise _too_bright(text, "color() takes codes of 0 to 1")
    return Swatch(text, Encoded(_triple(codes), space.lower()))


def _too_bright(text: str, why: str) -> TargetError:
    return TargetError(f"Target '{text}' is too bright: {why}, so write codes of 0 to 255 in hexadecimal as #C0392B.")


def _parse_library(text: str, base: str | Path | None) -> Swatch:
    from . import swatch_book  # which is made of swatches

    place, _, name = text.partition("#")
    return Swatch(text, swatch_book.find(place.strip(), base).named(name).color)


def _parse_numbers(kind: str, numbers: list[float], white: str | None, text: str) -> Swatch:
    if kind == "rgb":
        if white is not None:
            raise TargetError(f"Target '{text}' has a white, but rgb() is in the photo's space: leave out '/{white}'.")
        if max(numbers) > _BRIGHTEST:
            raise _too_bright(text, "rgb() is linear light where 1 is white")
        return Swatch.from_linear(numbers, text)
    _check_range(kind, numbers, text)
    seen_under, name, observer = _parse_white(kind, white, text)
    if kind in ("lab", "lch"):
        xyz = colorimetry.lab_to_xyz(numbers if kind == "lab" else colorimetry.lch_to_lab(numbers), seen_under)
    else:
        xyz = np.array(numbers) if kind == "xyz" else colorimetry.xyy_to_xyz(numbers)
    return Swatch(text, Stimulus(_triple(xyz), seen_under, name, observer))


def _parse_white(kind: str, white: str | None, text: str) -> tuple[Triple, str, str]:
    """XYZ of the white after the slash, the name of its light, and the observer."""
    if white is None:
        # Written without a white, Lab is a print's (D50) and XYZ a screen's (D65).
        light, observer = "D50" if kind in ("lab", "lch") else "D65", "1931"
    elif match := _BARE.fullmatch(white):
        xyz = _triple([float(number) for number in match.groups()])
        if min(xyz) <= 0:
            raise TargetError(f"Target '{text}' has the white {white.strip()}: its X, Y and Z are above 0.")
        return xyz, "", "1931"
    elif match := _WHITE.fullmatch(white):
        light, observer = match[1], {"10": "1964"}.get(match[2], "1931")
    else:
        raise TargetError(f"Target '{text}' has no white after the slash: write one, as in lab(42, 55, 35 / D65).")
    return _white_named(light, observer)


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
