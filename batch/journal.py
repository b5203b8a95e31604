"""The journal of a run: a line of JSON for each result, from which a run that was stopped goes on."""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from ..core.errors import FileError

# Seconds to wait for the workers of a run that has just been killed.
_PATIENCE = 20.0

# How every entry begins, also one that was cut off.
_BEGINNING = b'{"output": '


class Journal(Mapping[str, dict[str, Any]]):
    """The journal of one output folder, open for appending and locked against other runs.

    A mapping from outputs to their last entries, which stay in the file: of a hundred thousand results only the names
    are in memory.

    Parameters
    ----------
    path
        The file; made if it is not there.

    Raises
    ------
    FileError
        If it cannot be read or written, is something else than a journal, or another run is using it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file: IO[bytes] = path.open("a+b")
        except OSError as error:
            raise FileError(f"The journal '{path}' cannot be written ({error.strerror}): check the folder.") from None
        try:
            _lock(self._file, path, alone=True)
        except FileError:
            self._file.close()
            raise
        self._places: dict[str, int] = {}
        self._file.seek(0)
        self._end, line = 0, b"\n"
        for line in self._file:
            with contextlib.suppress(ValueError, KeyError, TypeError):  # cut off when the machine stopped
                entry = json.loads(line)
                if "status" in entry:
                    self._places[entry["output"]] = self._end
            self._end += len(line)
        if self._end and not self._places and not (line.startswith(_BEGINNING) and self._end == len(line)):
            self._file.close()
            raise FileError(f"'{path}' is no journal of Dyehouse: give another file, or remove it.")
        if not line.endswith(b"\n"):
            self._end += self._file.write(b"\n")

    def __getitem__(self, output: str) -> dict[str, Any]:
        self._file.seek(self._places[output])
        entry: dict[str, Any] = json.loads(self._file.readline())
        return entry

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def share(self) -> None:
        """Let the workers of this run in, too."""
        _lock(self._file, self.path, alone=False)

    def add(self, entries: Iterable[dict[str, Any]]) -> None:
        """Append entries; they are on the disk when this returns.

        Raises
        ------
        FileError
            If they cannot be written.
        """
        lines, places = [], {}
        for entry in entries:
            places[entry["output"]] = self._end
            lines.append(json.dumps(entry, ensure_ascii=False).encode(errors="surrogateescape") + b"\n")
            self._end += len(lines[-1])
        try:
            self._file.write(b"".join(lines))
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise FileError(
                f"The journal '{self.path}' cannot be written ({error.strerror}): make room, then go on with --resume."
            ) from None
        self._places |= places

    def close(self) -> None:
        """Close the file and give up the lock."""
        with contextlib.suppress(OSError):  # what could not be written has been told already
            self._file.close()


def hold(path: str) -> IO[bytes] | None:
    """Share the lock of a journal from another process, for as long as the returned file is open."""
    try:
        file = Path(path).open("rb")  # noqa: SIM115, it stays open
    except OSError:
        return None
    _lock(file, Path(path), alone=False)
    return file


def _lock(file: IO[bytes], path: Path, *, alone: bool) -> None:
    try:
        import fcntl
    except ImportError:  # Windows refuses to replace files that another run has open
        return
    kind = fcntl.LOCK_EX if alone else fcntl.LOCK_SH
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            fcntl.flock(file, kind | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > until:
                raise FileError(f"Another run is writing to '{path.parent}': wait for it, or stop it.") from None
            time.sleep(0.05)
        except OSError:  # a file system without locks
            return
