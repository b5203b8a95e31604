"""Recipes in TOML files: what the panel saves, and what `recolor --recipe` and `batch` take.

::

    format = 1
    photo = "shirt.jpg"
    white = [120, 90]

    [[region]]
    name = "shirt"
    click = [640, 820]

    [[colorway]]
    name = "navy"
    targets = { shirt = "#1F4E79" }

    [output]
    pattern = "{photo}-{colorway}.png"

Keys are the attributes of `Recipe`, `Region`, `Colorway`, `StoredRecipe` and `Output`; what is left out has its usual
value. Paths are relative to the file. A color is a text that `swatches.parse_target` understands, or a table of its
name and its numbers where no text gives exactly that swatch. A colorway without a target for a region, or with the
target "keep", leaves the region as it is in the photo.
"""

from __future__ import annotations

import difflib
import json
import math
import os
import re
import secrets
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import spectra
from .analysis import MODELS
from .colorspace import SPACES, space_named
from .errors import DyehouseError, FileError, RecipeError
from .recipe import ADAPTATIONS, MEANINGS, OBSERVERS, Colorway, Recipe, Region
from .swatches import Encoded, Linear, Stimulus, Swatch, parse_target

FORMAT = 1
KEEP = "keep"

# Masks that are no files.
_MASK_WORDS = ("click", "alpha")


@dataclass(frozen=True)
class Output:
    """How the results of a recipe are written.

    Attributes
    ----------
    pattern
        Name of each result; {photo} is the photo's name without extension, {colorway} that of the colorway, {folder}
        that of the photo's folder.
    quality
        Of JPEG and WebP, 1 to 100.
    compression
        Of TIFF and EXR; None for the photo's.
    output_space
        Name of the RGB space whose primaries the results have; None for the photo's own.
    """

    pattern: str = "{photo}-{colorway}.png"
    quality: int = 95
    compression: str | None = None
    output_space: str | None = None

    def named(self, photo: str, colorway: str, folder: str = "") -> str:
        """Path of one result; what cannot stand in a file name becomes a hyphen."""
        names = {"{photo}": photo, "{colorway}": colorway, "{folder}": folder}
        return re.sub(_PLACES, lambda found: _plain(names[found[0]]), self.pattern)


_PLACES = r"\{photo\}|\{colorway\}|\{folder\}"


def _plain(name: str) -> str:
    return re.sub(r'[\x00-\x1f<>:"/\\|?*]+', "-", name).strip(" .") or "unnamed"


@dataclass(frozen=True)
class StoredRecipe:
    """A recipe and what a file says besides it.

    Attributes
    ----------
    recipe
        What is asked for. Masks, camera, lights and spectra are as written: relative to `folder`; see :meth:`located`.
    photo
        The photo's path as written, or None.
    color_space
        The photo's, if its file does not say or is wrong: a name of `colorspace.SPACES`.
    output
        How the results are written.
    folder
        That relative paths start from: the folder of the recipe file.
    """

    recipe: Recipe
    photo: str | None = None
    color_space: str | None = None
    output: Output = Output()
    folder: Path = field(default=Path(), compare=False)

    @property
    def photo_path(self) -> Path | None:
        """Where the photo is."""
        return None if self.photo is None else self.folder / self.photo

    def located(self) -> Recipe:
        """Return the recipe with the paths of masks, camera and lights joined to the folder."""
        return _with_paths(self.recipe, lambda path: path if "://" in path else str(self.folder / path))


class RecipeFileError(RecipeError):
    """A recipe file that cannot be used.

    Attributes
    ----------
    problems
        Every problem of the file, a sentence each; the message is the first.
    """

    def __init__(self, problems: Iterable[str]) -> None:
        self.problems = tuple(problems)
        more = len(self.problems) - 1
        super().__init__(self.problems[0] + (f" ({more} more in this file.)" if more else ""))


def _with_paths(recipe: Recipe, moved: Callable[[str], str]) -> Recipe:
    """Return the recipe with every path of a mask, a camera or a measured light replaced."""

    def mask(region: Region) -> Region:
        if not isinstance(region.mask, str) or region.mask in _MASK_WORDS:
            return region
        return replace(region, mask=moved(region.mask))

    files: dict[str, Any] = {name: moved(path) for name, path in measured(recipe).items()}
    return replace(recipe, regions=tuple(mask(region) for region in recipe.regions), **files)


def measured(recipe: Recipe) -> dict[str, Any]:
    """Attributes of a recipe that name a measurement in a file: of the camera, the white or the new light."""
    values = {name: getattr(recipe, name) for name in ("camera", "white", "illuminant")}
    return {name: value for name, value in values.items() if isinstance(value, str) and _is_file(value)}


def _is_file(name: str) -> bool:
    return name.lower().endswith(".csv") and "+" not in name  # mixtures hold names


# --- files ----------------------------------------------------------------------------------------------------


def read_recipe(path: str | Path) -> StoredRecipe:
    """Read a recipe file.

    Raises
    ------
    FileError
        If it cannot be read.
    RecipeFileError
        If it is no recipe; each problem names the file, the line, the key and the remedy.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise FileError(f"Recipe '{path}' cannot be read ({error.strerror}): check the name.") from None
    except UnicodeDecodeError:
        raise FileError(f"Recipe '{path}' is not UTF-8 text: save it again as UTF-8.") from None
    return from_toml(text, path)


def write_recipe(path: str | Path, stored: StoredRecipe, *, force: bool = False) -> Path:
    """Write a recipe file; it appears under its name only when it is complete.

    Paths are rewritten so that they start from the new file's folder; spectra from files that are not found from there
    are written as numbers.

    Parameters
    ----------
    path
        The file.
    stored
        What to write.
    force
        Overwrite a file that is there.

    Raises
    ------
    FileError
        If it cannot be written; then no file has changed.
    RecipeError
        If a part of it has no form in a file, such as a mask that is an array.
    """
    path = Path(path)
    if not force and (path.exists() or path.is_symlink()):
        raise FileError(f"'{path}' exists already: choose another name, or allow it to be replaced.")
    text = to_toml(moved_to(stored, path.parent))
    temporary = path.with_name(f".dyehouse-{secrets.token_hex(6)}.toml")
    try:
        temporary.write_text(text, encoding="utf-8", newline="\n")
        temporary.replace(path)
    except OSError as error:
        raise FileError(f"'{path}' could not be written ({error.strerror}): check the disk and folder.") from None
    finally:
        temporary.unlink(missing_ok=True)
    return path


def moved_to(stored: StoredRecipe, folder: Path) -> StoredRecipe:
    """Return the same recipe for a file in another folder."""
    old, new = Path(os.path.abspath(stored.folder)), Path(os.path.abspath(folder))  # noqa: PTH100, links stay as they are
    if old == new:
        return replace(stored, folder=folder)

    def moved(path: str) -> str:
        if "://" in path or Path(path).is_absolute():
            return path
        try:
            return Path(os.path.relpath(old / path, new)).as_posix()
        except ValueError:  # on another drive of Windows
            return (old / path).as_posix()

    photo = None if stored.photo is None else moved(stored.photo)
    return replace(stored, recipe=_with_paths(stored.recipe, moved), photo=photo, folder=folder)


# --- writing --------------------------------------------------------------------------------------------------


def to_toml(stored: StoredRecipe) -> str:
    """Write a recipe as TOML text; `from_toml` gives exactly the same recipe back.

    Raises
    ------
    RecipeError
        If a part of it has no form in a file, such as a mask that is an array.
    """
    recipe, folder = stored.recipe, stored.folder
    head: dict[str, Any] = {"format": FORMAT, "photo": stored.photo, "color_space": stored.color_space}
    head |= _changed(recipe, Recipe(), folder, without=("regions", "colorways"))
    if not recipe.regions:
        head["region"] = []
    parts = [_lines(head)]
    for k, region in enumerate(recipe.regions):
        if region.mask is not None and not isinstance(region.mask, str):
            raise RecipeError(f"The mask of region {region.name or k + 1} is an array: save it as a file and name it.")
        parts.append(["[[region]]", *_lines(_changed(region, Region(), folder))])
    names = [region.name for region in recipe.regions]
    for colorway in recipe.colorways:
        targets: Any = [KEEP if t is None else _swatch_value(t, folder) for t in colorway.targets]
        if len(targets) == len(names) and all(names) and len(set(names)) == len(names):
            targets = {n: v for n, v in zip(names, targets, strict=True) if v != KEEP}
        parts.append(["[[colorway]]", *_lines({"name": colorway.name, "targets": targets})])
    if output := _changed(stored.output, Output(), folder):
        parts.append(["[output]", *_lines(output)])
    text = "\n\n".join("\n".join(part) for part in parts) + "\n"
    try:
        text.encode()
    except UnicodeEncodeError:
        raise RecipeError("A name or path in the recipe is not Unicode text: rename the file.") from None
    return text


def _changed(thing: Any, usual: Any, folder: Path, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Attributes that differ from the usual, as values for TOML."""
    found = {}
    for f in fields(thing):
        value = getattr(thing, f.name)
        if f.name not in without and value is not getattr(usual, f.name) and value != getattr(usual, f.name):
            found[f.name] = _swatch_value(value, folder) if isinstance(value, Swatch) else value
    return found


def _lines(values: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in values.items() if value is not None]


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _value(key)


def _value(value: Any) -> str:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, str):
        # The escapes of JSON are escapes of TOML, which also wants one for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_lines(value)) + " }" if value else "{}"
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    return repr(value)


def _swatch_value(swatch: Swatch, folder: Path) -> str | dict[str, Any]:
    """Text, or else a table, that gives exactly this swatch when it is read in `folder`."""
    if _parses_to(swatch.text, swatch, folder):
        return swatch.text
    color = swatch.color
    if _parses_to(swatch.written, Swatch(swatch.written, color), folder):
        return {"name": swatch.text, "color": swatch.written}
    if isinstance(color, spectra.Spectrum):
        numbers = {"wavelengths": color.wavelengths, "reflectance": color.values}
    else:
        numbers = {f.name: getattr(color, f.name) for f in fields(color)}
    return {"name": swatch.text} | numbers


def exact_form(value: Any) -> Any:
    """All numbers and words that a recipe, or a part of it, stands for, as plain values for JSON.

    A swatch is its color, whatever it is called and wherever it is read from: equal forms give equal pixels.
    """
    if isinstance(value, Swatch):
        return [type(value.color).__name__, exact_form(value.color)]
    if is_dataclass(value):
        return {f.name: exact_form(getattr(value, f.name)) for f in fields(value) if f.name not in ("name", "text")}
    if isinstance(value, (tuple, list)):
        return [exact_form(v) for v in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _parses_to(text: str, swatch: Swatch, folder: Path) -> bool:
    try:
        return parse_target(text, folder) == swatch
    except DyehouseError:
        return False


# --- reading --------------------------------------------------------------------------------------------------


def from_toml(text: str, where: str | Path = "recipe.toml") -> StoredRecipe:
    """Read a recipe from TOML text.

    Parameters
    ----------
    text
        The TOML.
    where
        The file it is from (or would be in): for messages, and as the place that paths start from.

    Raises
    ------
    RecipeFileError
        If it is no recipe; each problem names the file, the line, the key and the remedy.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).rstrip(")").rpartition(" (at ")
        place = place.replace("end of document", f"line {len(text.splitlines())}").split(",")[0]
        raise RecipeFileError([f"'{where}', {place}: this is not TOML ({reason}): mend the line."]) from None
    except RecursionError:
        raise RecipeFileError([f"'{where}' is nested too deeply: a recipe needs two levels."]) from None
    return _Reader(text, Path(where)).stored(document)


class _Reader:
    """Reads one document and gathers its problems."""

    def __init__(self, text: str, where: Path) -> None:
        self.lines, self.where, self.folder = text.splitlines(), where, where.parent.absolute()
        self.problems: list[str] = []
        self.section, self.index = "", 0

    def stored(self, document: dict[str, Any]) -> StoredRecipe:
        version = document.pop("format", FORMAT)
        if version != FORMAT:
            self._problem("format", f"is {version!r}: this Dyehouse reads format {FORMAT}, so update it")
        sections = {name: document.pop(name, None) for name in ("region", "colorway", "output")}
        own = {"photo": "str | None", "color_space": "str | None"}
        head = self._values(
            document, types_of(Recipe, without=("regions", "colorways")) | own, also=(*sections, "format")
        )
        extra = {name: head.pop(name) for name in own if name in head}
        regions = [Region(**values) for values in self._tables("region", sections["region"], types_of(Region))]
        if sections["region"] is not None:
            head["regions"] = tuple(regions)
        self._unique("region", [region.name for region in regions])
        regions = regions or [Region()]
        colorways = []
        for values in self._tables("colorway", sections["colorway"], {"name": "str", "targets": "targets"}):
            colorways.append(self._colorway(values, regions))
        self._unique("colorway", [colorway.name for colorway in colorways])
        self.section, self.index = "output", 0
        output = {}
        if sections["output"] is not None and not isinstance(sections["output"], dict):
            self._problem("", "must be a table: write [output] above its keys")
        elif sections["output"]:
            output = self._values(sections["output"], types_of(Output))
        if self.problems:
            raise RecipeFileError(self.problems)
        recipe = Recipe(**head, colorways=tuple(colorways))
        return StoredRecipe(recipe, **extra, output=Output(**output), folder=self.folder)

    def _tables(self, section: str, tables: Any, types: dict[str, str]) -> Iterable[dict[str, Any]]:
        self.section, self.index = section, 0
        if tables is None:
            return
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            self._problem("", f"must be a list of tables: write [[{section}]], with two brackets, above its keys")
            return
        for self.index, table in enumerate(tables):
            yield self._values(table, types)

    def _values(self, table: dict[str, Any], types: dict[str, str], also: tuple[str, ...] = ()) -> dict[str, Any]:
        found = {}
        for key, value in table.items():
            if key not in types:
                self._problem(key, f"is not known: {nearest(key, (*types, *also))}")
                continue
            try:
                found[key] = converted(key, value, types[key], self.folder)
            except DyehouseError as error:
                self._problem(key, str(error).rstrip("."), joined=": ")
            except Unfit as error:
                self._problem(key, str(error))
        return found

    def _colorway(self, values: dict[str, Any], regions: list[Region]) -> Colorway:
        name, given = values.get("name", ""), values.get("targets", [])
        if not name:
            self._problem("name", "is missing: give every colorway a name")
        if isinstance(given, str):
            given = [given]
        if isinstance(given, dict):
            names = [region.name for region in regions]
            for key in given:
                if key not in names:
                    known = tuple(n for n in names if n)
                    remedy = nearest(key, known) if known else "give the regions names, or write a list"
                    self._problem("targets", f"names region '{key}', which is not there: {remedy}")
            given = [given.get(n, KEEP) for n in names]
        if not isinstance(given, list):
            self._problem("targets", f"is {given!r}: write a color for each region, by name or as a list")
            return Colorway(name, ())
        if len(given) != len(regions):
            self._problem("targets", f"are {len(given)} for {len(regions)} regions: give one for each, or '{KEEP}'")
        targets: list[Swatch | None] = []
        for value in given:
            try:
                targets.append(None if value == KEEP else swatch_from(value, self.folder))
            except DyehouseError as error:
                self._problem("targets", str(error).rstrip("."), joined=": ")
            except Unfit as error:
                self._problem("targets", str(error))
        return Colorway(name, tuple(targets))

    def _unique(self, section: str, names: list[str]) -> None:
        self.section = section
        for self.index, name in enumerate(names):
            if name and name in names[: self.index]:
                self._problem("name", f"'{name}' is given to an earlier {section} too: rename one of them")

    def _problem(self, key: str, said: str, joined: str = " ") -> None:
        number = self._line(key)
        place = f"'{self.where}', line {number}" if number else f"'{self.where}'"
        owner = f"{self.section} {self.index + 1}, " if self.section in ("region", "colorway") else ""
        if not key:
            owner, key = "", self.section
        self.problems.append(f"{place}: {owner}{key}{joined}{said}" + "." * (not said.endswith("?")))

    def _line(self, key: str) -> int:
        """Line of a key of the present section, or of the section if it has none; 0 if that cannot be told."""
        section, count, found = "", -1, 0
        for number, line in enumerate(self.lines, 1):
            if header := re.match(r"\s*\[\[?\s*[\"']?([^\"'\]]+?)[\"']?\s*\]", line):
                section = header[1]
                count += section == self.section
            inside = section == self.section and (not section or count == self.index)
            if inside and key and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]", line):
                return number
            own = header and (inside or section == key)
            if own or (not section and re.match(rf"\s*{self.section or key}\s*=", line)):
                found = found or number
        return found


class Unfit(Exception):  # noqa: N818, it is made a sentence of before a user sees it
    """What is wrong with a value, as the rest of a sentence that begins with its key."""


def converted(key: str, value: Any, kind: str, folder: Path) -> Any:
    """Value of an attribute from what a file has under its key.

    Parameters
    ----------
    key
        Name of the attribute.
    value
        As TOML or JSON has it.
    kind
        The attribute's annotation, from :func:`types_of`.
    folder
        That paths start from.

    Raises
    ------
    Unfit, DyehouseError
        If it has another type, or is not allowed.
    """
    special = _READERS.get(key)
    if special is not None:
        value = special(value, folder)
    elif kind != "targets":
        value = _scalar(value, kind)
    if key in _CHOICES and value not in _CHOICES[key]:
        raise Unfit(f"is '{value}', which is not known: {nearest(str(value), _CHOICES[key])}")
    if key in _RANGES and not _RANGES[key][0](value):
        raise Unfit(f"is {value!r}: {_RANGES[key][1]}")
    return value


def nearest(word: str, known: Iterable[str]) -> str:
    """The remedy for an unknown word: the known one that is nearest to it, or all of them."""
    known = list(known)
    close = difflib.get_close_matches(word.lower(), known, 1, 0.6)
    return f"did you mean '{close[0]}'?" if close else f"use one of {', '.join(known)}"


def types_of(kind: type, without: tuple[str, ...] = ()) -> dict[str, str]:
    """Attributes of a dataclass and their annotations."""
    return {f.name: str(f.type) for f in fields(kind) if f.name not in without}


def _scalar(value: Any, kind: str) -> Any:
    """A text, number or flag that an attribute of this annotation takes."""
    allowed = {part.strip() for part in kind.split("|")}
    if "bool" in allowed and isinstance(value, bool):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        if "float" in allowed:
            return value
        if "int" in allowed and isinstance(value, int):
            return value
    if isinstance(value, str) and not allowed <= {"bool", "float", "int", "None"}:
        return value
    words = {"bool": "true or false", "float": "a number", "int": "a whole number"}
    wanted = [word for name, word in words.items() if name in allowed] or ["a text in quotes"]
    raise Unfit(f"is {value!r}: write {' or '.join(wanted)}")


def _numbers(value: Any, counts: tuple[int, ...], example: str) -> tuple[float, ...]:
    good = isinstance(value, list) and len(value) in counts
    if not good or not all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value):
        raise Unfit(f"is {value!r}: write numbers such as {example}")
    return tuple(value)


def _pixel(value: Any) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2 or not all(type(v) is int for v in value):
        raise Unfit(f"is {value!r}: write a pixel as two whole numbers, such as [640, 820]")
    return value[0], value[1]


def _pixels(value: Any) -> tuple[tuple[int, int], ...]:
    if not isinstance(value, list):
        raise Unfit(f"is {value!r}: write a list of pixels, such as [[640, 820]]")
    return tuple(_pixel(v) for v in value)


def _light(value: Any, counts: tuple[int, ...], example: str, folder: Path) -> str | tuple[float, ...]:
    if not isinstance(value, str):
        return _numbers(value, counts, f"{example}, or the name of a light")
    if value != "highlights":
        spectra.illuminant(str(folder / value) if _is_file(value) else value)  # says in words if there is none
    return value


def _illuminant(value: Any, folder: Path) -> str | tuple[float, ...]:
    if value == "highlights":
        raise Unfit("is 'highlights': name the new light, such as A")
    return _light(value, (3,), "[1.0, 0.9, 0.7]", folder)


def _camera(value: Any, folder: Path) -> str:
    name = str(_scalar(value, "str"))
    spectra.camera_sensitivities(folder / name if _is_file(name) else name)
    return name


def swatch_from(value: Any, folder: Path) -> Swatch:
    """Swatch from its text, or from a table of its name and numbers; errors as for :func:`converted`."""
    if isinstance(value, str):
        return parse_target(value, folder)
    if isinstance(value, dict) and isinstance(value.get("name"), str):
        name, given = value["name"], {key: v for key, v in value.items() if key != "name"}
        if given.keys() == {"color"} and isinstance(given["color"], str):
            return replace(parse_target(given["color"], folder), text=name)
        kinds: tuple[type[Any], ...] = (Linear, Encoded, Stimulus)
        for kind in kinds:
            if given.keys() == {f.name for f in fields(kind)}:
                return Swatch(name, kind(**{k: v if isinstance(v, str) else _triple(v) for k, v in given.items()}))
        if given.keys() == {"wavelengths", "reflectance"}:
            w, r = (np.array(_list(given[key]), np.float64) for key in ("wavelengths", "reflectance"))
            if len(w) != len(r) or len(w) < 2 or (np.diff(w) <= 0).any():
                raise Unfit(f"has {len(w)} wavelengths and {len(r)} reflectances: give as many, in rising order")
            return Swatch.from_spectrum(spectra.Spectrum(w, r, name), name)
    raise Unfit(f"is {value!r}: write a color such as '#C0392B', or a table with a name and its numbers")


def _triple(value: Any) -> tuple[float, float, float]:
    first, second, third = _numbers(value, (3,), "[0.5, 0.04, 0.02]")
    return float(first), float(second), float(third)


def _list(value: Any) -> tuple[float, ...]:
    return _numbers(value, (len(value),) if isinstance(value, list) else (), "[400, 410, 420]")


_READERS: dict[str, Callable[[Any, Path], Any]] = {
    "target": swatch_from,
    "source": swatch_from,
    "reference": lambda value, _: _numbers(value, (2, 3), "[812, 640]"),
    "click": lambda value, _: _pixel(value),
    "added": lambda value, _: _pixels(value),
    "removed": lambda value, _: _pixels(value),
    "white": lambda value, folder: _light(value, (2, 3), "[120, 90]", folder),
    "illuminant": _illuminant,
    "camera": _camera,
}
_CHOICES: dict[str, tuple[str, ...]] = {
    "meaning": MEANINGS,
    "model": MODELS,
    "observer": OBSERVERS,
    "adaptation": ADAPTATIONS,
}
_RANGES: dict[str, tuple[Callable[[Any], bool], str]] = {
    "gray": (lambda v: 0 < v <= 1, "write the reflectance of the card, 0 to 1"),
    "tolerance": (lambda v: v > 0, "write a number above zero; 1 is ordinary"),
    "quality": (lambda v: 1 <= v <= 100, "write 1 to 100"),
    "residual": (
        lambda v: v in ("fade", "keep", "drop") if isinstance(v, str) else 0 <= v <= 1,
        "write fade, keep, drop or a share from 0 to 1",
    ),
    "color_space": (lambda v: bool(space_named(v)), f"use one of {', '.join(SPACES)}"),
    "output_space": (lambda v: bool(space_named(v)), f"use one of {', '.join(SPACES)}"),
    "photo": (bool, "give the photo's path, or leave the key out"),
    "pattern": (
        lambda v: bool(v) and not set("{}") & set(re.sub(_PLACES, "", v)),
        "write a name such as {photo}-{colorway}.png, with no braces but {photo}, {colorway} and {folder}",
    ),
}
