"""The swatch book: built-in libraries and the user's own, favorites, recent swatches, and a search over all of them.

The user's folder holds swatch files, each a library, and what the book keeps itself in two JSON files. Swatches are
kept there as they are written for `parse_target`, so that they outlive the library they came from.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from . import builtin_libraries, swatch_files
from .errors import DyehouseError, FileError
from .library import Library
from .swatch_files.reading import Inks
from .swatches import Swatch, parse_target

FAVORITES, RECENT = "favorites.json", "recent.json"
MOST_RECENT = 30


@dataclass(frozen=True)
class Hit:
    """A swatch that was found: its library, its index there, and its CIEDE2000 from the color that was looked for."""

    library: str
    index: int
    swatch: Swatch
    difference: float | None = None


def find(place: str, base: str | Path | None = None, inks: Inks | None = None) -> Library:
    """Find a library: a built-in one by its name in any case, a swatch file, or a folder of them.

    Parameters
    ----------
    place
        Name or path.
    base
        The folder that paths start from; None for the current one.
    inks
        What CMYK of a file means, see :func:`swatch_files.read`.

    Raises
    ------
    FileError
        If there is none, or it cannot be read.
    """
    for name in builtin_libraries.NAMES:
        if name.casefold() == place.casefold():
            return builtin_libraries.builtin(name)
    path = Path(base or ".") / Path(place).expanduser()
    try:
        changed = path.stat().st_mtime_ns
    except (OSError, ValueError):
        names = ", ".join(builtin_libraries.NAMES)
        raise FileError(f"Library '{place}' is no file, and none of the built-in ones: {names}.") from None
    if path.is_dir() or inks is not None:
        return swatch_files.read(path, inks)
    return _read(path, changed)


@lru_cache(maxsize=64)
def _read(path: Path, changed: int) -> Library:
    """Read a file once as long as it does not change."""
    return swatch_files.read(path)


class Book:
    """All libraries that a user has.

    Parameters
    ----------
    folder
        Of the user's swatch files, favorites and recent swatches; need not exist yet. None: nothing is kept.

    Attributes
    ----------
    problems
        Sentences on files of the folder that could not be read.
    """

    def __init__(self, folder: str | Path | None = None) -> None:
        self._folder = None if folder is None else Path(folder)
        self.problems: list[str] = []
        self._own: dict[str, Path] = {}
        self._lists: dict[str, tuple[int, list[Swatch]]] = {}
        self.reload()

    def reload(self) -> None:
        """Look at the folder again; files are read when they are first needed."""
        self.problems = []
        paths = sorted(self._folder.iterdir()) if self._folder and self._folder.is_dir() else []
        self._own = {path.stem: path for path in paths if path.suffix.lower() in swatch_files.FORMATS}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the libraries, the user's own first."""
        return (*self._own, *(name for name in builtin_libraries.NAMES if name not in self._own))

    def is_own(self, name: str) -> bool:
        """Tell whether a library is a file of the user's."""
        return name in self._own

    def library(self, name: str) -> Library:
        """Return a library by its name.

        Raises
        ------
        FileError
            If there is none, or its file cannot be read.
        """
        if name not in self._own:
            return find(name) if name in builtin_libraries.NAMES else self._missing(name)
        return find(str(self._own[name].absolute()))

    def _missing(self, name: str) -> Library:
        raise FileError(f"The swatch book has no library '{name}': it has {', '.join(self.names)}.")

    def _all(self, library: str | None) -> Iterator[tuple[str, Library]]:
        for name in self.names if library is None else [library]:
            try:
                yield name, self.library(name)
            except DyehouseError as error:
                if library is not None:
                    raise
                if str(error) not in self.problems:
                    self.problems.append(str(error))

    def search(self, text: str, library: str | None = None, limit: int = 200) -> list[Hit]:
        """Find swatches by the words of their names and groups, in one library or in all."""
        hits: list[Hit] = []
        for name, found in self._all(library):
            hits += [Hit(name, k, found.swatches[k]) for k in found.search(text)[: limit - len(hits)]]
        return hits

    def nearest(self, color: Swatch | ArrayLike, library: str | None = None, count: int = 10) -> list[Hit]:
        """Find the swatches nearest to a color by CIEDE2000, in one library or in all; see :meth:`Library.nearest`."""
        lab = color.to_lab() if isinstance(color, Swatch) else np.asarray(color, np.float64)
        hits = []
        for name, found in self._all(library):
            pairs = zip(*found.nearest(lab, count), strict=True)
            hits += [Hit(name, int(k), found.swatches[k], float(difference)) for k, difference in pairs]
        return sorted(hits, key=lambda hit: hit.difference or 0.0)[:count]

    def import_file(self, path: str | Path, inks: Inks | None = None) -> Library:
        """Copy a swatch file into the user's folder and return its library.

        A folder of files, and a file with CMYK, are kept as a table of what was read.

        Parameters
        ----------
        path
            The file or folder.
        inks
            What CMYK means; see :func:`swatch_files.read`.

        Raises
        ------
        FileError
            If it cannot be read as swatches, or the folder has a file of that name already.
        """
        path = Path(path)
        library = swatch_files.read(path, inks)
        as_table = path.is_dir() or inks is not None
        target = self._writable() / (
            f"{_file_name(path.resolve().name if path.is_dir() else path.stem)}.csv" if as_table else path.name
        )
        if target.exists():
            raise FileError(
                f"The swatch book has '{target.name}' already: rename '{path.name}', or remove the old one first."
            )
        try:
            if as_table:
                swatch_files.write(target, library)  # which loses nothing
            else:
                shutil.copyfile(path, target)
        except OSError as error:
            raise FileError(f"'{target}' could not be written ({error.strerror}): check the disk and folder.") from None
        self.reload()
        return library

    def keep(self, name: str, swatches: Iterable[Swatch]) -> Library:
        """Make or replace a library of the user's own, without loss."""
        library = Library.of(name, swatches)
        swatch_files.write(self._writable() / f"{_file_name(name)}.csv", library, force=True)
        self.reload()
        return library

    def remove(self, name: str) -> None:
        """Delete the file of a library of the user's own."""
        if name not in self._own:
            raise FileError(f"Library '{name}' is built in: only your own libraries can be removed.")
        self._own[name].unlink(missing_ok=True)
        self.reload()

    @property
    def favorites(self) -> list[Swatch]:
        """The user's favorites, the oldest first."""
        return self._load(FAVORITES)

    @property
    def recent(self) -> list[Swatch]:
        """The swatches that were used last, the newest first."""
        return self._load(RECENT)

    def set_favorite(self, swatch: Swatch, favorite: bool = True) -> None:
        """Add a swatch to the favorites, or take it away."""
        others = [kept for kept in self.favorites if not _same(kept, swatch)]
        self._save(FAVORITES, [*others, swatch] if favorite else others)

    def used(self, swatch: Swatch) -> None:
        """Put a swatch at the head of the recent ones."""
        others = [kept for kept in self.recent if not _same(kept, swatch)]
        self._save(RECENT, [swatch, *others][:MOST_RECENT])

    def _writable(self) -> Path:
        if self._folder is None:
            raise FileError("This swatch book has no folder: nothing can be kept in it.")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"The folder '{self._folder}' cannot be made ({error.strerror}): choose another.") from None
        return self._folder

    def _load(self, name: str) -> list[Swatch]:
        path = None if self._folder is None else self._folder / name
        if path is None or not path.exists():
            return []
        try:
            changed = path.stat().st_mtime_ns
            if changed != self._lists.get(name, (0, []))[0]:
                self._lists[name] = changed, self._parsed(path)
        except OSError as error:
            raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from None
        return list(self._lists[name][1])

    @staticmethod
    def _parsed(path: Path) -> list[Swatch]:
        kept = []
        try:
            for item in json.loads(path.read_text(encoding="utf-8")):
                kept.append(Swatch(str(item["name"]), parse_target(str(item["color"])).color))
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise FileError(f"'{path}' cannot be read ({error}): mend it, or delete it.") from None
        return kept

    def _save(self, name: str, swatches: list[Swatch]) -> None:
        items = [{"name": swatch.text, "color": swatch.written} for swatch in swatches]
        text = json.dumps(items, indent=1, ensure_ascii=False) + "\n"
        swatch_files.replace_file(self._writable() / name, text.encode())


def _same(one: Swatch, other: Swatch) -> bool:
    return one.text == other.text and one.written == other.written


def _file_name(name: str) -> str:
    plain = "".join(c if c.isalnum() or c in " -_.()" else "_" for c in name).strip(" .")
    return plain[:80] or "swatches"
