"""Catalogs from the panel: `dyehouse batch` in a Python beside Blender, with processes of its own on all cores.

In Blender itself the window would wait for the threads that work, and Blender cannot be started again as a worker.
"""

import contextlib
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# What that Python runs. The end of its input, which is also the end of Blender, is to it what Ctrl-C is in a terminal.
_PROGRAM = """
import _thread, importlib, json, os, sys, threading
def watch():
    while os.read(0, 1):
        pass
    _thread.interrupt_main()
places, package, *arguments = sys.argv[1:]
sys.path += [place for place in json.loads(places) if place not in sys.path]
main = importlib.import_module(package + ".batch.cli").main
threading.Thread(target=watch, daemon=True).start()
try:
    sys.exit(main(arguments))
except BrokenPipeError:  # Blender is gone
    os._exit(1)
"""

# Exit code of a command that was stopped.
_STOPPED = 130

# Results that an outcome names; the page of the run has them all.
_NAMED = 8


@dataclass(frozen=True)
class Outcome:
    """What came of a check or a run.

    Attributes
    ----------
    summary
        Counts, as `dyehouse batch --json` prints them; empty where nothing was run.
    problems
        Sentences: what is wrong with what was asked for, or with photos that failed.
    """

    summary: dict[str, Any]
    problems: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The counts in words."""
        found = self.summary
        if "photos" in found:
            return f"{found['photos']} photos, {found['results']} results: all good"
        if not found:
            return f"{len(self.problems)} problem{'s' * (len(self.problems) != 1)}, nothing written"
        text = f"{found['done']} done, {found['kept']} kept, {found['needs_a_person']} need a person"
        return f"{text}, {found['failed']} failed, of {found['results']}"

    @property
    def named(self) -> tuple[str, ...]:
        """The first problems, and how many there are beside them."""
        more = len(self.problems) - _NAMED
        return self.problems[:_NAMED] + ((f"... and {more} more",) if more > 0 else ())

    @property
    def page(self) -> Path | None:
        """The page of the run, if it was written."""
        from ..batch.catalog import PAGE

        page = Path(self.summary["out"]) / PAGE if "out" in self.summary else None
        return page if page and page.is_file() else None


def results(jobs: str) -> int:
    """How many results a recipe or a table asks for."""
    from ..batch.jobs import gather

    return sum(len(job.wants) for job in gather([jobs])[0])


class Child:
    """`dyehouse` with these arguments in another Python.

    Raises
    ------
    FileError
        If that Python cannot be started.
    """

    def __init__(self, *arguments: str) -> None:
        from ..core.errors import FileError

        package = Path(__file__).resolve().parents[1]
        places = json.dumps([str(package.parent), *sys.path])
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-X", "utf8", "-c", _PROGRAM, places, package.name, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                encoding="utf-8",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
        except OSError as error:
            raise FileError(
                f"Python '{sys.executable}' cannot be started ({error.strerror}): run dyehouse batch in a terminal."
            ) from None

    def stop(self) -> None:
        """Have it finish what is under way, and end; in any thread."""
        if self._process.stdin:
            with contextlib.suppress(OSError):
                self._process.stdin.close()

    def outcome(self, note: Callable[[], None]) -> Outcome | None:
        """Read what it prints until it ends; `note` is called for each result. None if it was stopped before.

        Raises
        ------
        FileError
            If it broke down.
        """
        from ..core.errors import FileError

        summary: dict[str, Any] = {}
        problems = []
        with self._process:
            for line in self._process.stdout or ():
                said = json.loads(line)
                if "error" in said:
                    problems.append(": ".join(filter(None, [said.get("where"), said["error"]])))
                elif "output" in said:
                    if said["status"] == "failed":
                        problems.append(f"{said['source']}: '{said['output']}' failed: {said['reason']}")
                    note()
                else:
                    summary = said.get("summary", said)
        if summary or problems:
            return Outcome(summary, tuple(problems))
        if self._process.returncode == _STOPPED:
            return None
        code = self._process.returncode
        raise FileError(
            f"The catalog broke down (code {code}): the console, or dyehouse batch in a terminal, says why."
        )
