"""What a catalog asks for: recipes and tables, made into one job for each photo.

A job is a photo, the settings of its analysis and all colorways that need this analysis, so that a photo is decoded and
looked at once. Rows of a table that differ in nothing but their colorways become one job.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from ..core.errors import DyehouseError, FileError, RecipeError
from ..core.recipe import Colorway, Recipe, with_colorway
from ..core.recipe_file import RecipeFileError, StoredRecipe, exact_form, measured, read_recipe
from . import files, storage

TABLES = (".csv", ".tsv", ".jsonl", ".ndjson")

# Bytes of a name that every file system takes.
_LONGEST = 255

# Names that surely can be, so that a hundred thousand of them are checked in no time.
_PLAIN = re.compile(rf"[\w# -][\w#. -]*({'|'.join(map(re.escape, files.OUTPUT_KINDS))})", re.ASCII | re.IGNORECASE)

# Where contact sheets go, and results that need a person.
SHEETS, ASIDE = "sheets", "needs-a-person"


class Source(NamedTuple):
    """Where something is asked for: a recipe, or a row of a table and the columns that the row fills."""

    file: str
    row: int | None = None
    columns: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"'{self.file}'" + (f", row {self.row}" if self.row else "")

    def column(self, key: str, region: str = "") -> str:
        """Name of the column that has a setting; empty if the recipe has it."""
        return next((name for name in self.columns if name in (key, f"{key}.{region}")), "")


@dataclass(frozen=True)
class Problem:
    """Something wrong with what was asked for: where it is written, and the sentence that says what and the remedy."""

    source: Source | None
    message: str
    column: str = ""

    @property
    def where(self) -> str:
        """The place in words; empty where the message names it."""
        return (str(self.source) if self.source else "") + (f", column '{self.column}'" if self.column else "")

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        file, row, _ = self.source or (None, None, ())
        return {"where": self.where, "file": file, "row": row, "column": self.column or None, "error": self.message}


def in_order(problems: Iterable[Problem]) -> list[Problem]:
    """Problems in the order of their files and rows."""
    problems = list(problems)
    files = {file: k for k, file in enumerate(dict.fromkeys(p.source.file for p in problems if p.source))}
    return sorted(problems, key=lambda p: (files[p.source.file], p.source.row or 0) if p.source else (-1, 0))


@dataclass(frozen=True)
class Want:
    """One result: a colorway of a job's photo.

    Attributes
    ----------
    colorway
        Its name and targets.
    output
        Where it goes, relative to the output folder, with ``/``.
    quality, compression
        As for `files.write`.
    output_space
        Name of the space of the file; None for the photo's own.
    source
        Where it was asked for.
    """

    colorway: Colorway
    output: str
    quality: int
    compression: str | None
    output_space: str | None
    source: Source

    @property
    def told(self) -> str:
        """How messages about other results call it."""
        return f"{self.source} (colorway '{self.colorway.name}')"


@dataclass(frozen=True)
class Job:
    """One photo and all that is wanted of it.

    Attributes
    ----------
    photo
        Path or URL.
    color_space
        As for `files.read`.
    recipe
        The settings of the analysis, paths in their places, without colorways.
    wants
        The results.
    sheet
        Where the contact sheet goes, relative to the output folder.
    """

    photo: str
    color_space: str | None
    recipe: Recipe
    wants: tuple[Want, ...]
    sheet: str = ""

    def recipe_for(self, want: Want) -> Recipe:
        """Return the recipe of one result alone."""
        return with_colorway(self.recipe, want.colorway)

    def settings(self, want: Want) -> str:
        """Hash of everything but the files that one result depends on."""
        written = want.quality, want.compression, want.output_space, want.output
        form = [exact_form(self.recipe_for(want)), self.color_space, *written]
        return hashlib.sha256(json.dumps(form, sort_keys=True).encode()).hexdigest()

    @property
    def inputs(self) -> list[str]:
        """Paths or URLs of the files that the job reads, the photo first."""
        masks = [r.mask for r in self.recipe.regions if isinstance(r.mask, str) and r.mask not in ("click", "alpha")]
        return list(dict.fromkeys([self.photo, *masks, *measured(self.recipe).values()]))


class Gathering:
    """Collects jobs from recipes and tables, and every problem on the way.

    Attributes
    ----------
    problems
        What is wrong so far.
    """

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self._groups: dict[tuple[Any, ...], tuple[str, str | None, Recipe, list[Want]]] = {}
        self._globs: dict[str, list[str]] = {}
        self._bare: dict[int, tuple[StoredRecipe, Recipe]] = {}

    def add(self, stored: StoredRecipe, colorways: Sequence[Colorway], source: Source) -> None:
        """Ask for colorways of the photo (or of every photo that its pattern means) of a recipe.

        Parameters
        ----------
        stored
            The recipe; its own colorways are not looked at. The same object for many photos saves time.
        colorways
            What is wanted.
        source
            Where this is written, for messages.
        """
        if stored.photo is None:
            self.problems.append(Problem(source, "no photo is named: give one under 'photo'."))
            return
        if not _can_be_called(stored.photo):
            said = f"photo is {stored.photo!r}, which no file can be called: write its name anew."
            self.problems.append(Problem(source, said, source.column("photo")))
            return
        asked = stored.photo if storage.is_url(stored.photo) else os.path.join(stored.folder, stored.photo)  # noqa: PTH118
        photos = self._globs.get(asked)
        if photos is None:
            try:
                photos = storage.glob(asked)
            except (DyehouseError, ValueError, OSError) as error:
                photos = []
                said = f"photo '{asked}' cannot be looked for ({error}): check folder and name."
                self.problems.append(Problem(source, said, source.column("photo")))
            else:
                if not photos:
                    said = f"no photo matches '{stored.photo}': check folder and name."
                    self.problems.append(Problem(source, said, source.column("photo")))
            self._globs[asked] = photos
        self._add_photos(photos, stored, colorways, source)

    def _add_photos(
        self, photos: Iterable[str], stored: StoredRecipe, colorways: Sequence[Colorway], source: Source
    ) -> None:
        # The recipe without its photo is the same for all rows that share their settings.
        kept = self._bare.get(id(stored.recipe))
        if kept is None:
            kept = self._bare[id(stored.recipe)] = (stored, replace(stored.located(), colorways=()))
        for photo in photos:
            key = (photo, stored.color_space, id(stored.recipe))
            group = self._groups.get(key)
            if group is None:
                group = self._groups[key] = (photo, stored.color_space, kept[1], [])
            stem, folder = Path(storage.name_of(photo)).stem, Path(photo).parent.name
            for colorway in colorways:
                asked = stored.output
                output = _tidy(asked.named(stem, colorway.name, folder))
                group[3].append(Want(colorway, output, asked.quality, asked.compression, asked.output_space, source))

    def jobs(self) -> list[Job]:
        """Return the jobs in the order of their photos' first mention, and note results that cannot be."""
        first: dict[str, Want] = {}
        folders: dict[str, Want] = {}
        sheets: set[str] = set()
        alike: Counter[str] = Counter()  # a shop may call every photo front.jpg
        made = []
        for photo, color_space, recipe, wants in self._groups.values():
            good = [want for want in wants if self._sound(want, first, folders)]
            if good:
                stem = Path(storage.name_of(photo)).stem
                sheet = f"{SHEETS}/{stem}.jpg"
                while sheet.casefold() in sheets:
                    alike[stem] += 1
                    sheet = f"{SHEETS}/{stem}-{alike[stem] + 1}.jpg"
                sheets.add(sheet.casefold())
                made.append(Job(photo, color_space, recipe, tuple(good), sheet))
        return made

    def _sound(self, want: Want, first: dict[str, Want], folders: dict[str, Want]) -> bool:
        """Whether a result can be; notes its name in `first`, and its folders."""
        key = as_one(want.output)
        above = [parent.as_posix() for parent in PurePosixPath(key).parents][:-1] if "/" in key else []
        problem, column = output_problem(want.output), "output"
        if not problem and key in first:
            problem = f"is also the output of {first[key].told}"
            problem += ": give the photos or colorways other names, or put {folder} into the output pattern."
        elif not problem and (
            other := folders.get(key) or next((first[name] for name in above if name in first), None)
        ):
            problem = f"would be a file and a folder, beside '{other.output}' of {other.told}: rename one of them."
        elif not problem and want.compression is not None:
            column, problem = "compression", _compression_problem(want)
        if problem:
            said = problem if column == "compression" else f"output '{_short(want.output)}' {problem}"
            self.problems.append(Problem(want.source, said, want.source.column(column)))
            return False
        first[key] = want
        folders |= dict.fromkeys(above, want)
        return True


def as_one(name: str) -> str:
    """The same for names that are one file on some systems: they differ in case or in how accents are composed."""
    return name.lower() if name.isascii() else unicodedata.normalize("NFC", name).casefold()


def _tidy(output: str) -> str:
    """The name with ``/`` between its parts and no empty ones, so that a file has one name."""
    return PurePosixPath(output.replace("\\", "/")).as_posix() if "/" in output or "\\" in output else output


def _can_be_called(name: str) -> bool:
    try:
        return b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:
        return False


def _short(output: str) -> str:
    return output if len(output) <= _LONGEST else f"{output[:40]}..."


def _compression_problem(want: Want) -> str:
    try:
        files.check_compression(want.output, want.compression or "none")
    except FileError as error:
        return str(error)
    return ""


def output_problem(output: str) -> str:
    """Why a result cannot have this name, as the rest of a sentence that begins with it; empty if it can."""
    if len(output) <= _LONGEST and _PLAIN.fullmatch(output):
        return ""
    if not _can_be_called(output):
        return "is a name that no file can have: give the photo or the colorway another one."
    path = PurePosixPath(output)
    if path.is_absolute() or ".." in path.parts or ":" in output:
        return "lies outside the output folder: give a name below it."
    if path.suffix.lower() not in files.OUTPUT_KINDS:
        return f"does not end in a known extension: use one of {', '.join(files.OUTPUT_KINDS)}."
    if any(len(part.encode(errors="replace")) > _LONGEST for part in path.parts):
        return f"has a part of more than {_LONGEST} bytes: shorten the pattern or the names."
    if path.parts[0].casefold() in (SHEETS, ASIDE):
        return f"is in a folder of the run's own: give another one than {SHEETS} or {ASIDE}."
    if any(part.startswith(".dyehouse-") for part in path.parts):
        return "looks like an unfinished file: give a name that does not begin with .dyehouse-."
    return ""


def colorways_of(stored: StoredRecipe) -> tuple[Colorway, ...]:
    """Colorways that a recipe asks for: its own, or else one of its regions' targets, named 'recolored'."""
    if stored.recipe.colorways:
        return stored.recipe.colorways
    return (Colorway("recolored", tuple(region.target for region in stored.recipe.regions)),)


def gather(paths: Sequence[str], defaults: str | None = None) -> tuple[list[Job], list[Problem]]:
    """Make jobs of recipes and tables.

    Parameters
    ----------
    paths
        Recipe files (.toml) and tables (.csv, .tsv, .jsonl); patterns with ``*`` are looked up.
    defaults
        A recipe whose settings hold for what the tables leave open.

    Returns
    -------
    jobs
        What can be done.
    problems
        Everything that is wrong, each with file, row, column and remedy.
    """
    from . import tables

    gathering = Gathering()
    base = None
    try:
        base = read_recipe(defaults) if defaults else None
    except DyehouseError as error:
        gathering.problems += _problems_of(error)
    found = []
    for path in paths:
        if storage.is_url(path):
            said = "tables and recipes are read on this machine (photos, masks and outputs may be URLs): copy it here."
            gathering.problems.append(Problem(None, f"'{path}' is a URL; {said}"))
            continue
        here = storage.glob(path)
        if not here:
            gathering.problems.append(Problem(None, f"No file matches '{path}': check folder and name."))
        found += here
    for path in dict.fromkeys(found):
        try:
            suffix = Path(path).suffix.lower()
            if suffix == ".toml":
                stored = read_recipe(path)
                if stored.recipe.illuminant is None and not _asks(stored):
                    raise RecipeError(f"'{path}' has neither a colorway nor a target: give at least one.")
                gathering.add(stored, colorways_of(stored), Source(path))
            elif suffix in TABLES:
                tables.read(path, base, gathering)
            else:
                raise FileError(
                    f"'{path}' is neither a recipe nor a table: give files that end in .toml, {', '.join(TABLES)}."
                )
        except DyehouseError as error:
            gathering.problems += _problems_of(error)
    jobs = gathering.jobs()
    if not jobs and not gathering.problems:
        gathering.problems.append(Problem(None, "Nothing is asked for: the tables have no rows."))
    return jobs, gathering.problems


def _asks(stored: StoredRecipe) -> bool:
    return bool(stored.recipe.colorways) or any(region.target for region in stored.recipe.regions)


def _problems_of(error: DyehouseError) -> list[Problem]:
    if isinstance(error, RecipeFileError):
        return [Problem(None, said) for said in error.problems]
    return [Problem(None, str(error))]
