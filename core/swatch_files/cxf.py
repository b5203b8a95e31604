"""Color Exchange Format, CxF3 (ISO 17972-1): spectra, Lab, XYZ, LCh, xyY and RGB, with illuminant and observer.

Of the values that an object has, the first of these is taken that can be used: spectrum (in equal steps, or point by
point), Lab, XYZ, LCh, xyY, Adobe RGB, sRGB, HTML, RGB, CMYK. Groups are the `ObjectType` where a file has several. An
illuminant of the file's own is its power, or else the white that the file gives for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from .. import colorimetry, spectra
from ..errors import DyehouseError, FileError
from ..library import Library
from ..spectra import Spectrum
from ..swatches import Encoded, Stimulus, Swatch, Triple
from .reading import Collector, Inks, LineError, clean, losses

NAMESPACE = "http://colorexchangeformat.com/CxF3-core"
_REMEDY = "save the file again, or give another one"
_DEEPEST = 100


@dataclass
class _Node:
    tag: str
    attributes: dict[str, str]
    line: int
    text: list[str] = field(default_factory=list)
    children: list[_Node] = field(default_factory=list)

    def all(self, tag: str) -> Iterator[_Node]:
        """Find nodes of a tag below this one, in their order."""
        waiting = self.children[::-1]
        while waiting:
            node = waiting.pop()
            if node.tag == tag:
                yield node
            waiting += node.children[::-1]

    def first(self, tag: str) -> _Node | None:
        return next(self.all(tag), None)

    @property
    def content(self) -> str:
        return "".join(self.text).strip()


def _tree(data: bytes, name: str) -> _Node:
    """Read XML into nodes that know their lines; no entities, which could grow without end."""
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    root = _Node("", {}, 0)
    path = [root]

    def start(tag: str, attributes: dict[str, str]) -> None:
        node = _Node(tag.rpartition(" ")[2], attributes, parser.CurrentLineNumber)
        path[-1].children.append(node)
        path.append(node)
        if len(path) > _DEEPEST:
            raise LineError(name, node.line, f"elements are nested more than {_DEEPEST} deep", _REMEDY)

    def end(_: str) -> None:
        path.pop()

    def text(part: str) -> None:
        path[-1].text.append(part)

    def doctype(*_: object) -> None:
        raise LineError(name, parser.CurrentLineNumber, "a CxF file has no document type", _REMEDY)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise LineError(
            name, error.lineno, f"this is no sound XML ({expat.ErrorString(error.code)})", _REMEDY
        ) from None
    except (ValueError, LookupError) as error:
        if isinstance(error, FileError):
            raise
        raise LineError(name, 1, f"this is no sound XML ({error})", _REMEDY) from None
    return root


def read(data: bytes, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a file; see :func:`swatch_files.parse`."""
    root = _tree(data, name)
    if root.first("CxF") is None:
        raise LineError(name, 1, "this is XML but no CxF", "give a CxF3 file")
    found = Collector(name, inks)
    reader = _Reader(name, found, {node.attributes.get("Id", ""): node for node in root.all("ColorSpecification")})
    objects = [node for node in root.all("Object") if node.first("ColorValues") or node.first("DeviceColorValues")]
    kinds = {node.attributes.get("ObjectType", "") for node in objects}
    for node in objects:
        reader.add(node, clean(node.attributes.get("ObjectType", "")) if len(kinds) > 1 else "")
    return found.library()


class _Reader:
    """Colors out of the nodes of a file."""

    def __init__(self, name: str, found: Collector, specifications: dict[str, _Node]) -> None:
        self._name, self._found, self._specifications = name, found, specifications

    def add(self, thing: _Node, group: str) -> None:
        """Add the best color of an object."""
        name = clean(thing.attributes.get("Name", "")) or clean(thing.attributes.get("Id", ""))
        for tag in _TAGS:
            for node in thing.all(tag):
                swatch = self._swatch(node, name)
                if swatch is not None:
                    self._found.add(swatch, group)
                    return
        inks = thing.first("ColorCMYK")
        if inks is not None:
            parts = self._numbers(inks, ("Cyan", "Magenta", "Yellow", "Black"))
            self._found.add_inks([part / 100 for part in parts], name, group)
            return
        self._found.leave_out("objects without a color that is known here")

    def _swatch(self, node: _Node, name: str) -> Swatch | None:
        """Return the swatch of a color node, or None for one that cannot be used."""
        try:
            if node.tag == "ReflectanceSpectrum":
                return self._spectrum(node, name)
            if node.tag == "CustomSpectrum":
                kind = self._specification(node, "MeasurementType")
                reflects = kind is not None and kind.content == "Spectrum_Reflectance"
                return self._reflectance(*self._points(node), name) if reflects else None
            if node.tag == "ColorHTML":
                code = node.attributes.get("HTML", "").removeprefix("#")
                red, green, blue = np.frombuffer(bytes.fromhex(code), np.uint8) / 255
                return Swatch(name, Encoded((float(red), float(green), float(blue))))
            if "RGB" in node.tag:
                return self._codes(node, name)
            return self._colorimetric(node, name)
        except LineError:
            raise
        except (DyehouseError, ValueError) as error:
            problem = str(error).rstrip(".").partition(": ")[0]
            raise LineError(self._name, node.line, f"{node.tag} is not understood ({problem})", _REMEDY) from None

    def _numbers(self, node: _Node, tags: tuple[str, ...]) -> list[float]:
        values = []
        for tag in tags:
            part = next((child for child in node.children if child.tag == tag), None)
            values.append(self._float(part.content if part else "", node, tag))
        return values

    def _float(self, text: str, node: _Node, what: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise LineError(
                self._name, node.line, f"{what} of {node.tag} is '{clean(text)[:40]}' and no number", _REMEDY
            )
        return value

    def _specification(self, node: _Node, tag: str) -> _Node | None:
        found = self._specifications.get(node.attributes.get("ColorSpecification", ""))
        return found.first(tag) if found else None

    def _spectrum(self, node: _Node, name: str) -> Swatch | None:
        values = np.array([self._float(text, node, "a value") for text in node.content.split()], np.float64)
        range_ = self._specification(node, "WavelengthRange")
        stated = range_.attributes if range_ else {}
        start = node.attributes.get("StartWL") or stated.get("StartWL")
        if start is None:
            self._found.note("A spectrum without a first wavelength is left out.")
            return None
        if "Increment" not in stated:
            self._found.note("Spectra name no step: taken as 10 nm.")
        first, step = self._float(start, node, "StartWL"), self._float(stated.get("Increment", "10"), node, "Increment")
        if not (100 <= first <= 3000 and 0 < step <= 100):
            raise LineError(self._name, node.line, f"the spectrum starts at {first:g} nm in steps of {step:g}", _REMEDY)
        return self._reflectance(first + step * np.arange(len(values), dtype=np.float64), values, name)

    def _points(self, node: _Node) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return wavelengths and values of a spectrum that is given point by point."""
        found = {
            self._float(point.attributes.get("WL", ""), point, "WL"): self._float(point.content, point, "a value")
            for point in node.all("SpectralPoint")
        }
        wavelengths = np.array(sorted(found))
        return wavelengths, np.array([found[nm] for nm in wavelengths.tolist()])

    def _reflectance(self, wavelengths: NDArray, values: NDArray, name: str) -> Swatch | None:
        if not spectra.covers(wavelengths):
            self._found.note(
                "Spectra that do not cover 400 to 700 nm are left out; Lab or RGB is taken, if there is any."
            )
            return None
        return Swatch(name, Swatch.from_spectrum(Spectrum(wavelengths, values, name), name or "without a name").color)

    def _codes(self, node: _Node, name: str) -> Swatch:
        most = next((child for child in node.children if child.tag == "MaxRange"), None)
        top = self._float(most.content if most else "255", node, "MaxRange")
        if top <= 0:
            raise LineError(self._name, node.line, f"MaxRange is {top:g}", _REMEDY)
        red, green, blue = (value / top for value in self._numbers(node, ("R", "G", "B")))
        if node.tag == "ColorRGB":
            self._found.note("RGB names no color space: taken as sRGB.")
        return Swatch(name, Encoded((red, green, blue), "adobe-rgb" if node.tag == "ColorAdobeRGB" else "srgb"))

    def _colorimetric(self, node: _Node, name: str) -> Swatch | None:
        specification = self._specification(node, "TristimulusSpec")
        observer = self._observer(specification)
        seen_under = self._white(specification, observer)
        if seen_under is None:
            return None
        white, light = seen_under
        numbers = self._numbers(node, _TAGS[node.tag])
        if node.tag == "ColorCIELab":
            xyz = colorimetry.lab_to_xyz(numbers, white)
        elif node.tag == "ColorCIELCh":
            xyz = colorimetry.lab_to_xyz(colorimetry.lch_to_lab(numbers), white)
        elif node.tag == "ColorCIEXYZ":
            xyz = np.array(numbers) / 100
        else:
            x, y, luminance = numbers
            xyz = colorimetry.xyy_to_xyz([x, y, luminance / 100])
        X, Y, Z = xyz.tolist()
        return Swatch(name, Stimulus((X, Y, Z), white, light, observer))

    def _observer(self, specification: _Node | None) -> str:
        node = specification.first("Observer") if specification else None
        if node is not None and node.content == "Custom_CMF":
            self._found.note("The file has an observer of its own: the CIE's for the same angle is taken.")
            angle = self._float(node.attributes.get("Angle", "2"), node, "Angle")
            return "1964" if angle > 4 else "1931"  # as CIE 15:2018, 6, has it
        return "1964" if node is not None and node.content.startswith("10") else "1931"

    def _white(self, specification: _Node | None, observer: str) -> tuple[Triple, str] | None:
        """Return XYZ of the white of colorimetric nodes, and the name of its light; None where it is not known."""
        light = specification.first("Illuminant") if specification else None
        own = specification.first("CustomIlluminant") if specification else None
        if own is not None:
            X, Y, Z = spectra.to_xyz(self._power(own), None, observer).tolist()
            return (X, Y, Z), ""
        if light is None:
            self._found.note("The file names no illuminant: taken as D50.")
        name = light.content if light else "D50"
        if light is not None and name in _WITHOUT_SPECTRUM:
            if not all(axis in light.attributes for axis in "XYZ"):
                self._found.note(f"Colors under {name} are left out: the file does not say which white that is.")
                return None
            X, Y, Z = (self._float(light.attributes[axis], light, "the white") for axis in "XYZ")
            if min(X, Y, Z) <= 0:
                raise LineError(self._name, light.line, f"the white of {name} is not above 0", _REMEDY)
            return (X / Y, 1.0, Z / Y), ""
        found = spectra.illuminant(_LAMPS.get(name, name))
        X, Y, Z = colorimetry.white_xyz(found, observer).tolist()
        return (X, Y, Z), found.name

    def _power(self, node: _Node) -> Spectrum:
        """Return the light of a node that has its spectral power."""
        powers = node.first("SPDList")
        if powers is None:
            wavelengths, values = self._points(node)
        else:
            values = np.array([self._float(text, node, "a value") for text in powers.content.split()])
            first, step = (
                self._float(node.attributes.get(key, ""), node, key) for key in ("WLStart", "List_Increment")
            )
            wavelengths = first + step * np.arange(len(values), dtype=np.float64)
        if not spectra.covers(wavelengths) or (np.diff(wavelengths) <= 0).any() or values.min() < 0:
            raise LineError(self._name, node.line, "the illuminant is no power from 400 to 700 nm", _REMEDY)
        return Spectrum(wavelengths, values, clean(node.attributes.get("Name", "")) or "the file's own illuminant")


_TAGS: dict[str, tuple[str, ...]] = {
    "ReflectanceSpectrum": (),
    "CustomSpectrum": (),
    "ColorCIELab": ("L", "A", "B"),
    "ColorCIEXYZ": ("X", "Y", "Z"),
    "ColorCIELCh": ("L", "C", "H"),
    "ColorCIExyY": ("x", "y", "Y"),
    "ColorAdobeRGB": ("R", "G", "B"),
    "ColorSRGB": ("R", "G", "B"),
    "ColorHTML": (),
    "ColorRGB": ("R", "G", "B"),
}

# Lamps that the schema has by other names; FL10 to FL12 are those of the same makers in CIE 15:2018, table T.6.
_LAMPS = {"9300": "9300K", "TL83": "FL12", "TL84": "FL11", "UL30": "FL12", "UL50": "FL10"}
_WITHOUT_SPECTRUM = ("Custom", "UL35")

# The illuminants that the schema has, by our names.
_ILLUMINANTS = {name: name for name in ("A", "B", "C", "D50", "D55", "D60", "D65", "D75", "E")} | {
    f"FL{number}": f"F{number}" for number in (2, 3, 7, 9, 10, 11, 12)
}


def _keeps(color: object) -> bool:
    if isinstance(color, Spectrum):
        return _schema_range(color) is not None
    if isinstance(color, Stimulus):
        return color.illuminant in _ILLUMINANTS
    return isinstance(color, Encoded) and color.space in ("srgb", "adobe-rgb")


def _schema_range(spectrum: Spectrum) -> tuple[int, int] | None:
    """Return first wavelength and step if the schema can state them."""
    nm = spectrum.wavelengths
    first, step = nm[0], nm[1] - nm[0]
    even = np.allclose(np.diff(nm), step, rtol=0, atol=1e-9)
    if even and first == int(first) and step == int(step) and 360 <= first <= 400:
        return int(first), int(step)
    return None


def write(library: Library) -> tuple[bytes, list[str]]:
    """Write spectra, Lab with its illuminant and observer, and RGB; see :func:`swatch_files.encode`."""
    specifications: dict[str, str] = {}
    objects = []
    items = zip(library.group_names, library.swatches, library.lab, strict=True)
    for number, (group, swatch, lab) in enumerate(items, 1):
        identity, specification, value = _value(swatch, lab)
        specifications[identity] = specification
        objects.append(
            f"<cc:Object ObjectType={quoteattr(clean(group) or 'Standard')} Name={quoteattr(clean(swatch.text))} "
            f'Id="{number}"><cc:CreationDate>2000-01-01T00:00:00Z</cc:CreationDate>'
            f"<cc:ColorValues>{value}</cc:ColorValues></cc:Object>"
        )
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<cc:CxF xmlns:cc="{NAMESPACE}">\n'
        f"<cc:FileInformation><cc:Creator>Dyehouse</cc:Creator><cc:Description>{escape(clean(library.name))}"
        "</cc:Description></cc:FileInformation>\n<cc:Resources>\n<cc:ObjectCollection>\n"
        + "\n".join(objects)
        + "\n</cc:ObjectCollection>\n<cc:ColorSpecificationCollection>\n"
        + "\n".join(specifications.values())
        + "\n</cc:ColorSpecificationCollection>\n</cc:Resources>\n</cc:CxF>\n"
    )
    return text.encode(), losses(library, _keeps, "Lab under D50")


def _value(swatch: Swatch, lab: np.ndarray) -> tuple[str, str, str]:
    """Return the identity of the specification, the specification, and the value of a swatch."""
    color = swatch.color
    range_ = _schema_range(color) if isinstance(color, Spectrum) else None
    if isinstance(color, Spectrum) and range_:
        identity = f"spectrum-{range_[0]}-{range_[1]}"
        values = " ".join(f"{value:.8g}" for value in color.values)
        body = (
            f'<cc:ReflectanceSpectrum ColorSpecification="{identity}" StartWL="{range_[0]}">{values}'
            "</cc:ReflectanceSpectrum>"
        )
        return identity, _specification(identity, "D50", "1931", range_), body
    if isinstance(color, Encoded) and _keeps(color):
        tag = {"srgb": "ColorSRGB", "adobe-rgb": "ColorAdobeRGB"}[color.space]
        codes = np.array(color.rgb) * 255
        top = 255 if np.array_equal(codes.round() / 255, color.rgb) else 65535
        parts = "".join(
            f"<cc:{letter}>{round(min(max(code, 0), 1) * top)}</cc:{letter}>"
            for letter, code in zip("RGB", color.rgb, strict=True)
        )
        body = f'<cc:{tag} ColorSpecification="rgb"><cc:MaxRange>{top}</cc:MaxRange>{parts}</cc:{tag}>'
        return "rgb", _specification("rgb", "D65", "1931"), body
    light, observer = "D50", "1931"
    if isinstance(color, Stimulus) and _keeps(color):
        light, observer = color.illuminant, color.observer
        lab = colorimetry.xyz_to_lab(color.xyz, color.white)
    identity = f"lab-{light}-{observer}"
    parts = "".join(f"<cc:{letter}>{value:.10g}</cc:{letter}>" for letter, value in zip("LAB", lab, strict=True))
    body = f'<cc:ColorCIELab ColorSpecification="{identity}">{parts}</cc:ColorCIELab>'
    return identity, _specification(identity, light, observer), body


def _specification(identity: str, light: str, observer: str, range_: tuple[int, int] | None = None) -> str:
    kind = "Spectrum_Reflectance" if range_ else "Colorimetric_Reflectance"
    wavelengths = f'<cc:WavelengthRange StartWL="{range_[0]}" Increment="{range_[1]}"/>' if range_ else ""
    degrees = {"1931": "2_Degree", "1964": "10_Degree"}[observer]
    return (
        f'<cc:ColorSpecification Id="{identity}"><cc:TristimulusSpec>'
        f"<cc:Illuminant>{_ILLUMINANTS[light]}</cc:Illuminant><cc:Observer>{degrees}</cc:Observer>"
        "<cc:Method>unknown</cc:Method></cc:TristimulusSpec><cc:MeasurementSpec>"
        f"<cc:MeasurementType>{kind}</cc:MeasurementType>"
        "<cc:GeometryChoice><cc:UnknownGeometry>unknown</cc:UnknownGeometry></cc:GeometryChoice>"
        f"{wavelengths}</cc:MeasurementSpec></cc:ColorSpecification>"
    )
