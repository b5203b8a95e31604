"""Tables of a catalog: CSV as spreadsheets write it, and JSON Lines. A row is a photo with one or more colorways.

=================  ==============================================================================================
column             what it holds
=================  ==============================================================================================
photo              path relative to the table, URL, or pattern such as ``shirts/*.jpg``
recipe             recipe file that holds what the row leaves open (else that of ``--recipe``)
colorway           name of a colorway: of the recipe, or for the target
target             the color; for one of several regions ``target.NAME``
colorways          several: names of the recipe's, ``navy | red``, or with their colors, ``navy=#1F4E79 | red=#A02818``
output             pattern of the results' names, such as ``{photo}-{colorway}.jpg``
...                every other key of a recipe file; of several regions as ``click.NAME``
=================  ==============================================================================================

Pixels and numbers are written ``640,820`` or ``640 820``, several pixels ``10,20; 30,40``. In JSON Lines a row is an
object with the same keys and the values of a recipe file; colorways may be an object of names and colors.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core.errors import DyehouseError, FileError
from ..core.recipe import Colorway, Recipe, Region
from ..core.recipe_file import KEEP, Output, StoredRecipe, Unfit, converted, nearest, read_recipe, swatch_from, types_of
from ..core.swatches import Swatch
from .jobs import Gathering, Problem, Source, colorways_of

_OWN = ("photo", "recipe", "colorway", "target", "colorways", "output", "color_space")
_RECIPE = types_of(Recipe, without=("regions", "colorways")) | {"color_space": "str | None"}
_REGION = types_of(Region, without=("name", "target"))
_OUTPUT = types_of(Output, without=("pattern",))
_KEYS = tuple(dict.fromkeys((*_OWN, *_RECIPE, *_REGION, *_OUTPUT)))

# Keys whose text is a list of numbers, and of lists of numbers.
_LISTS, _NESTED, _MAYBE = ("click", "reference"), ("added", "removed"), ("white", "illuminant")


def read(path: str, base: StoredRecipe | None, gathering: Gathering) -> None:
    """Add the jobs of a table, and its problems.

    Parameters
    ----------
    path
        The table.
    base
        What holds where the table is silent.
    gathering
        Collects them.

    Raises
    ------
    FileError
        If the file cannot be read at all.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"Table '{path}' cannot be read ({error.strerror}): check the name.") from None
    suffix = Path(path).suffix.lower()
    reader = _Rows(path, base, gathering)
    lines = reader.decoded(data)
    rows = reader.json_rows(lines) if suffix in (".jsonl", ".ndjson") else reader.csv_rows(lines)
    count = 0
    for count, (number, row) in enumerate(rows, 1):  # noqa: B007, the last count is what is asked for
        reader.add(number, row)
    if not count and not reader.failed:
        raise FileError(f"Table '{path}' has no rows: write one for each photo or colorway below the column names.")


class _Rows:
    """The rows of one table."""

    def __init__(self, path: str, base: StoredRecipe | None, gathering: Gathering) -> None:
        self.path, self.folder, self.gathering = path, Path(path).absolute().parent, gathering
        self.base = base or StoredRecipe(Recipe(), folder=self.folder)
        self.text, self.failed = False, False
        self._cache: dict[Any, Any] = {}
        self._columns: dict[tuple[str, ...], tuple[str, ...]] = {}

    def problem(self, row: int | None, column: str, message: str) -> None:
        self.failed = True
        ended = message if message.endswith((".", "?")) else message + "."
        self.gathering.problems.append(Problem(Source(self.path, row), ended, column))

    def decoded(self, data: bytes) -> list[str]:
        """Lines of text; UTF-8 with or without a byte order mark, or UTF-16 with one."""
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return list(io.StringIO(data.decode("utf-16", errors="replace"), newline=""))
        if b"\0" in data[:4]:
            self.problem(None, "", "this is UTF-16 without a byte order mark: save the table again as 'CSV UTF-8'")
            return []
        lines = []
        for number, line in enumerate(data.removeprefix(b"\xef\xbb\xbf").splitlines(keepends=True), 1):
            try:
                lines.append(line.decode())
            except UnicodeDecodeError:
                self.problem(number, "", "this is not UTF-8 text: save the table again as 'CSV UTF-8'")
                lines.append("\n")
        return lines

    # --- what a row looks like --------------------------------------------------------------------------------

    def csv_rows(self, lines: list[str]) -> Iterator[tuple[int, dict[str, Any]]]:
        self.text = True
        blank = next((k for k, line in enumerate(lines) if line.strip()), 0)
        lines = lines[blank:]
        if not lines or (blank and self.failed):  # the names of the columns are what cannot be read
            return
        separator = max(",;\t", key=lines[0].count)
        reader = csv.reader(lines, delimiter=separator)
        try:
            header = [name.strip() for name in next(reader)]
        except csv.Error as error:
            self.problem(blank + 1, "", f"this is not CSV ({error})")
            return
        wrong = [k for k, name in enumerate(header) if name and (not self._known(name) or name in header[:k])]
        for k in wrong:
            self._say_unknown(blank + 1, header[k], doubled=header[k] in header[:k])
        if wrong:
            return
        try:
            for number, cells in enumerate(reader, blank + 2):
                if any(cell.strip() for cell in cells[len(header) :]):
                    self.problem(
                        number, "", f"there are {len(cells)} cells for {len(header)} columns: quote cells with commas"
                    )
                elif any(cells):
                    pairs = zip(header, cells, strict=False)
                    yield number, {name: cell.strip() for name, cell in pairs if name and cell.strip()}
        except csv.Error as error:
            self.problem(blank + reader.line_num, "", f"this is not CSV ({error})")

    def json_rows(self, lines: list[str]) -> Iterator[tuple[int, dict[str, Any]]]:
        for number, line in enumerate(lines, 1):
            if not line.strip():
                continue
            try:
                row = json.loads(line)
            except (json.JSONDecodeError, RecursionError) as error:
                self.problem(number, "", f"this is not JSON ({error}): write one object a line")
                continue
            if not isinstance(row, dict):
                self.problem(number, "", 'this is no object: write {"photo": ..., "target": ...}')
                continue
            unknown = [name for name in row if not self._known(name)]
            for name in unknown:
                self._say_unknown(number, name)
            if not unknown:
                yield number, {name: value for name, value in row.items() if value is not None}

    def _known(self, name: str) -> bool:
        key, _, region = name.partition(".")
        return key in _KEYS and (not region or key == "target" or key in _REGION)

    def _say_unknown(self, row: int, name: str, doubled: bool = False) -> None:
        if doubled:
            self.problem(row, name, "there are two columns of this name: remove one")
        else:
            self.problem(row, name, f"this is not known: {nearest(name.partition('.')[0], _KEYS)}")

    # --- what a row means -------------------------------------------------------------------------------------

    def add(self, number: int, row: dict[str, Any]) -> None:
        """Ask for what a row says."""
        fine = len(self.gathering.problems)
        photo = row.get("photo")
        if photo is not None:
            photo = self._value(number, "photo", "photo", photo, "str")
        stored = self._stored(number, row)
        colorways = self._colorways(number, row, stored) if stored else ()
        if len(self.gathering.problems) > fine:
            self.failed = True
        elif stored is not None:
            # The settings are one object for all rows that share them.
            if photo is not None:
                stored = replace(stored, photo=photo, folder=self.folder)
            columns = self._columns.setdefault(tuple(row), tuple(row))
            self.gathering.add(stored, colorways, Source(self.path, number, columns))

    def _once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What `make` gives, made once for each key: tables repeat themselves."""
        found = self._cache.get(key)
        if found is None:  # what failed is tried again, so that every row tells its problem
            found = self._cache[key] = make()
        return found

    def _stored(self, number: int, row: dict[str, Any]) -> StoredRecipe | None:
        """The settings of a row: those of its recipe and its own."""
        rest = {
            k: v for k, v in row.items() if k not in ("photo", "colorway", "colorways") and not k.startswith("target")
        }
        return self._once(json.dumps(rest, sort_keys=True), lambda: self._overridden(number, rest))

    def _overridden(self, number: int, row: dict[str, Any]) -> StoredRecipe | None:
        stored = self.base
        fine = len(self.gathering.problems)
        if "recipe" in row:
            path = self._value(number, "recipe", "recipe", row["recipe"], "str")
            if path is None:
                return None
            try:
                stored = read_recipe(self.folder / path)
            except DyehouseError as error:
                self.problem(number, "recipe", str(error))
                return None
        # Paths of the recipe start from its own folder, those of the table from the table's.
        recipe = stored.located()
        head: dict[str, Any] = {}
        output: dict[str, Any] = {}
        regions: list[dict[str, Any]] = [{} for _ in recipe.regions]
        for name, value in row.items():
            key, _, region = name.partition(".")
            if key == "output":
                value = self._value(number, name, "pattern", value, "str")
                output["pattern"] = value
            elif key in _OUTPUT:
                output[key] = self._value(number, name, key, value, _OUTPUT[key])
            elif key in _RECIPE:
                head[key] = self._value(number, name, key, value, _RECIPE[key])
            elif key in _REGION:
                index = self._region(number, name, region, recipe)
                if index is not None:
                    regions[index][key] = self._value(number, name, key, value, _REGION[key])
        if len(self.gathering.problems) > fine:
            return None
        for given in (head, *regions):
            for key in ("mask", "camera"):
                path = given.get(key)
                if path not in (None, "click", "alpha") and "://" not in path and (key == "mask" or ".csv" in path):
                    given[key] = str((self.folder / path).absolute())
        color_space = head.pop("color_space", stored.color_space)
        pairs = zip(recipe.regions, regions, strict=True)
        recipe = replace(recipe, regions=tuple(replace(r, **given) for r, given in pairs), **head)
        photo = None if stored.photo is None else str(stored.photo_path)
        return replace(
            stored, recipe=recipe, photo=photo, color_space=color_space, output=replace(stored.output, **output)
        )

    def _value(self, number: int, column: str, key: str, value: Any, kind: str) -> Any:
        try:
            return converted(key, _from_text(key, value, kind) if self.text else value, kind, self.folder)
        except Unfit as error:
            self.problem(number, column, f"{key} {error}")
        except DyehouseError as error:
            self.problem(number, column, str(error))
        return None

    def _region(self, number: int, column: str, region: str, recipe: Recipe) -> int | None:
        names = [r.name for r in recipe.regions]
        if region in names and region:
            return names.index(region)
        if not region and len(names) == 1:
            return 0
        known = [name for name in names if name]
        if region:
            remedy = nearest(region, known) if known else "the recipe's regions have no names, so give it one"
            self.problem(number, column, f"the recipe has no region '{region}': {remedy}")
        else:
            self.problem(number, column, f"the recipe has {len(names)} regions: write the column as {column}.NAME")
        return None

    def _colorways(self, number: int, row: dict[str, Any], stored: StoredRecipe) -> tuple[Colorway, ...]:
        targets = {k: v for k, v in row.items() if k.partition(".")[0] == "target"}
        own = {colorway.name: colorway for colorway in stored.recipe.colorways}
        name, several = row.get("colorway"), row.get("colorways")
        if name is not None and not isinstance(name, str | int | float):
            self.problem(number, "colorway", f"'{name}' is no name: write a text in quotes")
            return ()
        if several is not None and (targets or name is not None):
            self.problem(number, "colorways", "this is given beside a colorway or target: give one or the other")
        elif targets:
            given = [self._target(number, column, value, stored.recipe) for column, value in targets.items()]
            places = dict(pair for pair in given if pair is not None)
            made = tuple(places.get(k) for k in range(len(stored.recipe.regions)))
            return (Colorway(str(name or " ".join(str(value) for value in targets.values())), made),)
        elif several is not None:
            return self._several(number, several, stored, own)
        elif name is not None:
            return self._named(number, "colorway", [str(name)], own)
        elif own or stored.recipe.illuminant is not None or any(region.target for region in stored.recipe.regions):
            return colorways_of(stored)
        else:
            self.problem(number, "target", "there is no color: give a target, or the name of a recipe's colorway")
        return ()

    def _named(self, number: int, column: str, names: list[str], own: dict[str, Colorway]) -> tuple[Colorway, ...]:
        for name in names:
            if name not in own:
                remedy = nearest(name, own) if own else "the recipe has none, so give the color under 'target'"
                self.problem(number, column, f"colorway '{name}' is not in the recipe: {remedy}")
        return tuple(own[name] for name in names if name in own)

    def _several(
        self, number: int, several: Any, stored: StoredRecipe, own: dict[str, Colorway]
    ) -> tuple[Colorway, ...]:
        if isinstance(several, str):
            parts = [part.strip() for part in several.split("|") if part.strip()]
            several = [part if "=" not in part else tuple(p.strip() for p in part.split("=", 1)) for part in parts]
        elif isinstance(several, dict):
            several = list(several.items())
        if not isinstance(several, list) or not several:
            self.problem(number, "colorways", "write names, or names with colors as navy=#1F4E79 | red=#A02818")
            return ()
        found: list[Colorway] = []
        for item in several:
            if isinstance(item, tuple):
                found += self._defined(number, str(item[0]), item[1], stored)
            elif isinstance(item, str):
                found += self._named(number, "colorways", [item], own)
            else:
                self.problem(number, "colorways", f"'{item}' is no name: write names, or an object of names and colors")
        return tuple(found)

    def _defined(self, number: int, name: str, value: Any, stored: StoredRecipe) -> list[Colorway]:
        regions = stored.recipe.regions
        if not isinstance(value, dict) or "name" in value:
            pair = self._target(number, "colorways", value, stored.recipe)
            places = {} if pair is None else dict([pair])
        else:
            given = [self._target(number, f"target.{region}", v, stored.recipe) for region, v in value.items()]
            places = dict(pair for pair in given if pair is not None)
        return [Colorway(name, tuple(places.get(k) for k in range(len(regions))))]

    def _target(self, number: int, column: str, value: Any, recipe: Recipe) -> tuple[int, Swatch | None] | None:
        index = self._region(number, column, column.partition(".")[2], recipe)
        if index is None:
            return None
        if value == KEEP:
            return index, None
        try:
            return index, self._once(("swatch", json.dumps(value)), lambda: swatch_from(value, self.folder))
        except Unfit as error:
            self.problem(number, column, f"target {error}")
        except DyehouseError as error:
            self.problem(number, column, str(error))
        return None


def _from_text(key: str, text: str, kind: str) -> Any:
    """Value as a recipe file would have it, from the text of a cell."""
    if key in _NESTED:
        return [_numbers(part) for part in text.split(";") if part.strip()]
    if key in _LISTS or (key in _MAYBE and re.fullmatch(r"[\d.+\-eE,\s]+", text) and re.search(r"[,\s]", text)):
        return _numbers(text)
    words = {part.strip() for part in kind.split("|")}
    if "bool" in words and text.lower() in ("true", "false", "yes", "no"):
        return text.lower() in ("true", "yes")
    if words & {"float", "int"}:
        return _number(text)
    return text


def _numbers(text: str) -> Any:
    return [_number(part) for part in re.split(r"[,\s]+", text.strip())]


def _number(text: str) -> Any:
    """A number, or the text itself where it is none, for the message."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
