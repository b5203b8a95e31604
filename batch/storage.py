"""Where files are: paths of this machine, or URLs of any file system that fsspec knows (s3, gs, https, memory, ...).

Pictures are decoded and encoded in files of this machine, so what is at a URL is copied here and back. fsspec is the
extra `cloud`, imported when the first URL is met.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import tempfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from ..core.errors import FileError

# Stores in which a file appears only when it is complete.
_WHOLE = ("s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oss", "memory")


def is_url(path: str) -> bool:
    """Tell a URL from a path of this machine."""
    return "://" in path


def name_of(path: str) -> str:
    """Last part of a path or URL."""
    return PurePosixPath(path.split("?")[0]).name if is_url(path) else Path(path).name


def join(folder: str, name: str) -> str:
    """Path or URL of a file in a folder."""
    return f"{folder.rstrip('/')}/{name}" if is_url(folder) else str(Path(folder) / name)


def exists(path: str) -> bool:
    """Tell whether there is a file (or anything else) at a path or URL."""
    if not is_url(path):
        return os.path.lexists(path)
    with _in_words(path):
        filesystem, inside = _filesystem(path)
        return bool(filesystem.exists(inside))


def listing(folder: str) -> set[str]:
    """Names, relative to a folder and with ``/``, of all files in it and below; none if it is not there."""
    if not is_url(folder):
        return {
            (Path(place) / name).relative_to(folder).as_posix() for place, _, names in os.walk(folder) for name in names
        }
    with _in_words(folder):
        filesystem, inside = _filesystem(folder)
        root = inside.rstrip("/") + "/"
        return {found.removeprefix(root) for found in filesystem.find(inside)} if filesystem.exists(inside) else set()


def glob(pattern: str) -> list[str]:
    """Paths that a pattern with ``*``, ``?`` or ``[...]`` stands for, sorted; others stand for themselves."""
    signs = "*[" if pattern.startswith(("http://", "https://")) else "*?["  # there, ? begins a query
    if not any(sign in pattern for sign in signs) or (not is_url(pattern) and os.path.lexists(pattern)):
        return [pattern]
    if is_url(pattern):
        with _in_words(pattern):
            filesystem, inside = _filesystem(pattern)
            return sorted(filesystem.unstrip_protocol(found) for found in filesystem.glob(inside))
    path = Path(pattern)
    anchor = Path(path.anchor)
    return sorted(str(found) for found in anchor.glob(str(path.relative_to(anchor))) if not found.is_dir())


@contextlib.contextmanager
def local(path: str) -> Iterator[Path]:
    """Give a file as one of this machine, for as long as the context lasts.

    Raises
    ------
    FileError
        If it is at a URL and cannot be fetched.
    """
    if not is_url(path):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory(prefix="dyehouse-") as folder:
        copy = Path(folder) / (name_of(path) or "file")
        with _in_words(path):
            filesystem, inside = _filesystem(path)
            filesystem.get_file(inside, str(copy))
        yield copy


@contextlib.contextmanager
def arriving(path: str) -> Iterator[Path]:
    """Give a place to write a file to that goes to a path or URL when the context ends without an error.

    Raises
    ------
    FileError
        If it cannot be put there; then nothing is.
    """
    if not is_url(path):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory(prefix="dyehouse-") as folder:
        copy = Path(folder) / name_of(path)
        yield copy
        with _in_words(path):
            filesystem, inside = _filesystem(path)
            parent = filesystem._parent(inside)
            filesystem.makedirs(parent, exist_ok=True)
            if _protocol(path) in _WHOLE:
                filesystem.put_file(str(copy), inside)
            else:
                beside = f"{parent}/.dyehouse-{secrets.token_hex(6)}"
                filesystem.put_file(str(copy), beside)
                filesystem.mv(beside, inside)


def remove(path: str) -> None:
    """Remove a file, if it is there.

    Raises
    ------
    FileError
        If it is at a URL and cannot be removed.
    """
    if not is_url(path):
        Path(path).unlink(missing_ok=True)
        return
    with _in_words(path):
        filesystem, inside = _filesystem(path)
        if filesystem.exists(inside):
            filesystem.rm_file(inside)


def digest(path: str | Path) -> str:
    """SHA-256 of a file of this machine; empty if it cannot be read."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def digest_at(path: str) -> str:
    """SHA-256 of a file at a path or URL; empty if there is none."""
    try:
        with local(path) as copy:
            return digest(copy)
    except FileError:
        return ""


def _protocol(url: str) -> str:
    return url.partition("://")[0].split("::")[-1]


def _filesystem(url: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise FileError(f"'{url}' is a URL, which needs fsspec: install it with: pip install 'fsspec[http]'") from None
    filesystem, inside = url_to_fs(url)
    return filesystem, inside


@contextlib.contextmanager
def _in_words(url: str) -> Iterator[None]:
    """Say in a sentence what a remote file system throws, which may be anything."""
    try:
        yield
    except FileError:
        raise
    except FileNotFoundError:
        raise FileError(f"'{url}' does not exist: check the URL.") from None
    except ImportError as error:
        raise FileError(f"'{url}' needs a package that is not installed ({error}): install it.") from None
    except Exception as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        raise FileError(f"'{url}' cannot be reached ({reason}): check the URL, the network and your rights.") from None
