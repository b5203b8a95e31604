"""Swatch files: bytes to a `Library` and back, one module for each format.

Every module has ``read(data, name, inks)`` and, where it can write, ``write(library)``, which also says in words what
the format could not hold.
"""

from __future__ import annotations

import importlib
import secrets
from pathlib import Path

from ..errors import DyehouseError, FileError
from ..library import Group, Library
from .reading import Inks

# By extension: the module, and whether it writes.
FORMATS = {
    ".ase": ("ase", True),
    ".aco": ("aco", True),
    ".gpl": ("gpl", True),
    ".cxf": ("cxf", True),
    ".csv": ("table", True),
    ".tsv": ("table", False),
    ".txt": ("cgats", True),
    ".it8": ("cgats", True),
    ".ti3": ("cgats", False),
    ".cgats": ("cgats", True),
    ".mxf": ("cxf", False),
}
WRITABLE = tuple(extension for extension, (_, writes) in FORMATS.items() if writes)

# A million swatches are not a swatch file.
LARGEST_FILE = 64 << 20


def read(path: str | Path, inks: Inks | None = None) -> Library:
    """Read a swatch file, or a folder of them as one library.

    Parameters
    ----------
    path
        A file of one of the kinds of `FORMATS` by its extension, or a folder, whose files become groups; files of the
        folder that cannot be read are told of in the notes.
    inks
        What CMYK means: see :data:`reading.Inks`, and `printer.inks_as` for a profile. Without it CMYK swatches are
        left out, and a note says so.

    Raises
    ------
    FileError
        If it cannot be read; the message has the place in the file.
    """
    path = Path(path)
    if path.is_dir():
        return _read_folder(path, inks)
    if path.suffix.lower() not in FORMATS:
        raise FileError(f"'{path}' is no swatch file by its extension: use one of {', '.join(FORMATS)}.")
    try:
        size = path.stat().st_size
        data = path.read_bytes() if size <= LARGEST_FILE else b""
    except FileNotFoundError:
        raise FileError(f"'{path}' does not exist: check the name.") from None
    except OSError as error:
        raise FileError(f"'{path}' cannot be read ({error.strerror}): check its permissions.") from None
    if size > LARGEST_FILE:
        raise FileError(f"'{path}' has {size >> 20} MB, too much for a swatch file: give another one.")
    return parse(data, path.suffix, path.stem, inks)


def parse(data: bytes, extension: str, name: str, inks: Inks | None = None) -> Library:
    """Read the bytes of a swatch file; parameters and errors as for `read`."""
    module, _ = FORMATS[extension.lower()]
    return importlib.import_module(f".{module}", __package__).read(data, name, inks)


def _read_folder(folder: Path, inks: Inks | None) -> Library:
    groups, notes = [], []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in FORMATS or not path.is_file():
            continue
        try:
            library = read(path, inks)
        except DyehouseError as error:
            notes.append(str(error))
            continue
        notes += [f"{path.name}: {note}" for note in library.notes]
        groups += [Group(f"{path.name} {group.name}".strip(), group.swatches) for group in library.groups]
    if not groups:
        reason = f" ({notes[0]})" if notes else ""
        raise FileError(f"The folder '{folder}' has no swatch file{reason}: put one of {', '.join(FORMATS)} into it.")
    return Library(folder.name, tuple(groups), tuple(notes))


def encode(library: Library, extension: str) -> tuple[bytes, list[str]]:
    """Bytes of a swatch file, and in words what it could not hold.

    Raises
    ------
    FileError
        If there is no such format, or it cannot be written.
    """
    module, writes = FORMATS.get(extension.lower(), ("", False))
    if not writes:
        raise FileError(f"Swatches cannot be written as '{extension}': use one of {', '.join(WRITABLE)}.")
    data, notes = importlib.import_module(f".{module}", __package__).write(library)
    return data, notes


def write(path: str | Path, library: Library, *, force: bool = False) -> list[str]:
    """Write a library as a swatch file of the kind of its extension; returns what it could not hold, in words.

    Raises
    ------
    FileError
        If it exists and `force` is not given, or cannot be written; then no file has changed.
    """
    path = Path(path)
    data, notes = encode(library, path.suffix)
    if path.exists() and not force:
        raise FileError(f"'{path}' exists already: choose another name, or overwrite it with --force.")
    replace_file(path, data)
    return notes


def replace_file(path: Path, data: bytes) -> None:
    """Put bytes into a file, all of them or none."""
    temporary = path.with_name(f".dyehouse-{secrets.token_hex(6)}")
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        raise FileError(f"'{path}' could not be written ({error.strerror}): check the disk and folder.") from None
    finally:
        temporary.unlink(missing_ok=True)
