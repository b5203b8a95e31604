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
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

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


@dataclass(frozen=True)
class Problem:
    """Something wrong with what was asked for: where it is written, and the sentence that says what and the remedy."""

    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


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
        Where it was asked for, such as ``catalog.csv, row 3``.
    """

    colorway: Colorway
    output: str
    quality: int
    compression: str | None
    output_space: str | None
    source: str


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

    def add(self, stored: StoredRecipe, colorways: Sequence[Colorway], source: str) -> None:
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
        asked = stored.photo if storage.is_url(stored.photo) else os.path.join(stored.folder, stored.photo)  # noqa: PTH118
        photos = self._globs.get(asked)
        if photos is None:
            try:
                photos = storage.glob(asked)
            except (DyehouseError, ValueError, OSError) as error:
                photos = []
                self.problems.append(Problem(source, f"photo '{asked}' cannot be looked for ({error})."))
            else:
                if not photos:
                    self.problems.append(Problem(source, f"no photo matches '{stored.photo}': check folder and name."))
            self._globs[asked] = photos
        self._add_photos(photos, stored, colorways, source)

    def _add_photos(
        self, photos: Iterable[str], stored: StoredRecipe, colorways: Sequence[Colorway], source: str
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
            named = PurePosixPath(photo) if storage.is_url(photo) else Path(photo)
            for colorway in colorways:
                asked = stored.output
                output = asked.named(named.stem, colorway.name, named.parent.name)
                group[3].append(Want(colorway, output, asked.quality, asked.compression, asked.output_space, source))

    def jobs(self) -> list[Job]:
        """Return the jobs in the order of their photos' first mention, and note results that cannot be."""
        first: dict[str, Want] = {}
        sheets: set[str] = set()
        made = []
        for photo, color_space, recipe, wants in self._groups.values():
            good = [want for want in wants if self._sound(want, first)]
            if good:
                stem = Path(storage.name_of(photo)).stem
                sheet, number = f"{SHEETS}/{stem}.jpg", 1
                while sheet.casefold() in sheets:
                    number += 1
                    sheet = f"{SHEETS}/{stem}-{number}.jpg"
                sheets.add(sheet.casefold())
                made.append(Job(photo, color_space, recipe, tuple(good), sheet))
        return made

    def _sound(self, want: Want, first: dict[str, Want]) -> bool:
        problem = output_problem(want.output)
        # Names that differ in case or in how accents are composed are one file on some systems.
        key = want.output.lower()
        if not key.isascii():
            key = unicodedata.normalize("NFC", want.output).casefold()
        if not problem and key in first:
            other = first[key]
            problem = (
                f"'{want.output}' is also the output of {other.source} (colorway '{other.colorway.name}'): give the "
                "photos or colorways other names, or put {folder} into the output pattern."
            )
        if problem:
            self.problems.append(Problem(want.source, f"output {problem}"))
            return False
        first[key] = want
        return True


def output_problem(output: str) -> str:
    """Why a result cannot have this name, in words; empty if it can."""
    if len(output) <= _LONGEST and _PLAIN.fullmatch(output):
        return ""
    path = PurePosixPath(output.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts or ":" in output or "\0" in output:
        return f"'{output}' lies outside the output folder: give a name below it."
    if path.suffix.lower() not in files.OUTPUT_KINDS:
        return f"'{output}' does not end in a known extension: use one of {', '.join(files.OUTPUT_KINDS)}."
    if any(len(part.encode(errors="replace")) > _LONGEST for part in path.parts):
        return f"'{output[:40]}...' has a part of more than {_LONGEST} bytes: shorten the pattern or the names."
    if path.parts[0].casefold() in (SHEETS, ASIDE):
        return f"'{output}' is in a folder of the run's own: give another one than {SHEETS} or {ASIDE}."
    if any(part.startswith(".dyehouse-") for part in path.parts):
        return f"'{output}' looks like an unfinished file: give a name that does not begin with .dyehouse-."
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
        here = storage.glob(path)
        if not here:
            gathering.problems.append(Problem("", f"No file matches '{path}': check folder and name."))
        found += here
    for path in dict.fromkeys(found):
        try:
            suffix = Path(path).suffix.lower()
            if suffix == ".toml":
                stored = read_recipe(path)
                if stored.recipe.illuminant is None and not _asks(stored):
                    raise RecipeError(f"'{path}' has neither a colorway nor a target: give at least one.")
                gathering.add(stored, colorways_of(stored), f"'{path}'")
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
        gathering.problems.append(Problem("", "Nothing is asked for: the tables have no rows."))
    return jobs, gathering.problems


def _asks(stored: StoredRecipe) -> bool:
    return bool(stored.recipe.colorways) or any(region.target for region in stored.recipe.regions)


def _problems_of(error: DyehouseError) -> list[Problem]:
    if isinstance(error, RecipeFileError):
        return [Problem("", said) for said in error.problems]
    return [Problem("", str(error))]
