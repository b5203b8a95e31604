"""A real Blender with the built extension in a scratch profile: in the background, and in windows on a virtual display.

Blender is the one that `tools/setup-debian-blender.sh` makes: `DYEHOUSE_BLENDER` names its `blender` command, or it is
on PATH, or in the cache folder that the script takes by itself. Without one the tests here are skipped.
"""

import ast
import os
import re
import shutil
import signal
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SCENARIOS = HERE / "scenarios"
# Blender only prints what goes wrong in a panel's draw, a timer or a handler.
PRINTED_ERROR = re.compile(r"^(Traceback \(most recent|Error: Python|.*Python script error|.*Warning:).*", re.MULTILINE)
OUTCOME = re.compile(r"^gui: begin (\w+)$(.*?)^gui: (passed|failed) \1$(.*?)(?=^gui: |\Z)", re.MULTILINE | re.DOTALL)


def find_blender() -> Path | str:
    """The `blender` command, or why there is none."""
    cache = (
        Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dyehouse" / "blender" / "bin" / "blender"
    )
    named = os.environ.get("DYEHOUSE_BLENDER")
    candidates = [Path(named)] if named else [Path(p) for p in [shutil.which("blender")] if p] + [cache]
    for command in candidates:
        if command.is_file() and (command.parent / "blender-root").is_file():
            if os.geteuid() != 0:
                return f"{command} needs root"
            return command.resolve()
    return f"no Blender with a window in {', '.join(map(str, candidates))}; run tools/setup-debian-blender.sh as root"


@dataclass
class Outcome:
    """What a run of scenarios left."""

    folder: Path  # the scratch folder, with whatever the scenarios wrote
    log: str
    failures: dict[str, str | None] = field(default_factory=dict)  # scenario -> None when passed, else why

    def check(self, scenario: str) -> None:
        """Fail as the scenario failed."""
        if scenario not in self.failures:
            pytest.fail(f"Blender ended before {scenario}:\n{self.log[-4000:]}", pytrace=False)
        if why := self.failures[scenario]:
            pytest.fail(f"{why}\n(files and screenshot: {self.folder})", pytrace=False)


class Blender:
    """One Blender with the extension installed and enabled in a scratch profile."""

    def __init__(self, command: Path, scratch: Path, package: Path | None = None, hide: str = "") -> None:
        self.command, self.profile = command, scratch / "profile"
        self.home = scratch / "home"
        self.seen = scratch.parent  # all that the tests make is below it
        self.home.mkdir(parents=True)
        if hide:
            startup = self.profile / "scripts" / "startup" / "hide.py"
            startup.parent.mkdir(parents=True)
            startup.write_text(
                f"import sys\nsys.modules[{hide!r}] = None\ndef register(): pass\ndef unregister(): pass\n"
            )
        if package is not None:
            self.install(package)

    def environment(self) -> dict[str, str]:
        """Variables under which Blender reads and writes nothing of the user's."""
        kept = {k: v for k, v in os.environ.items() if k != "DISPLAY"}  # never a window on the user's own display
        wanted = os.environ.get("DYEHOUSE_SCREENSHOTS")
        pictures = str(Path(wanted).resolve()) if wanted else ""
        return kept | {
            "BLENDER_USER_RESOURCES": str(self.profile),
            "BLENDER_HOME": str(self.home),
            "BLENDER_BIND": f"{self.seen}:{HERE}:{pictures}:{os.environ.get('BLENDER_BIND', '')}",
            "DYEHOUSE_SCREENSHOTS": pictures,
        }

    def python(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """Run the Python that this Blender uses, outside Blender, with the repo as the package `dyehouse`."""
        (self.home / "dyehouse").unlink(missing_ok=True)
        (self.home / "dyehouse").symlink_to(ROOT)
        path = f"PYTHONPATH={self.home}"
        return self._run(self.command.parent / "blender-root", "env", path, "python3", *arguments)

    def run(self, *arguments: str | Path, timeout: float = 300) -> subprocess.CompletedProcess[str]:
        """Run Blender with these arguments."""
        return self._run(self.command, *arguments, timeout=timeout)

    def _run(self, *arguments: str | Path, timeout: float = 300) -> subprocess.CompletedProcess[str]:
        """Run a command; one that does not end is killed with all that it started."""
        process = subprocess.Popen(
            [*map(str, arguments)],
            env=self.environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            out, err = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
            err += f"\nkilled after {timeout:g} s"
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    def install(self, package: Path) -> None:
        """Install and enable a built extension for good, and turn off what would cover the editors."""
        code = (
            "import bpy\n"
            f"bpy.ops.extensions.package_install_files(filepath={str(package)!r}, repo='user_default', "
            "enable_on_install=True)\n"
            "view = bpy.context.preferences.view\n"
            "view.show_splash = view.show_tooltips = False\n"
            "view.smooth_view = 0\n"
            "bpy.context.preferences.filepaths.use_auto_save_temporary_files = False\n"
            "bpy.ops.wm.save_userpref()\n"
        )
        done = self.run("--background", "--python-exit-code", "1", "--python-expr", code)
        assert done.returncode == 0, done.stdout + done.stderr

    def window(self, file: Path, scenarios: list[str], folder: Path) -> Outcome:
        """Run scenarios of a file in one window, with real mouse events."""
        code = (
            "import sys\n"
            "sys.dont_write_bytecode = True\n"
            f"sys.path.insert(0, {str(HERE)!r})\n"
            "import gui_kit\n"
            f"gui_kit.run({str(file)!r}, {str(folder)!r}, {scenarios!r})\n"
        )
        size = ["--no-window-focus", "--window-geometry", "0", "0", "1600", "1000"]
        done = self.run(*size, "--python-exit-code", "1", "--python-expr", code, timeout=360 + 120 * len(scenarios))
        log = done.stdout + done.stderr
        (folder / "blender.log").write_text(log)
        outcome = Outcome(folder, log)
        for name, during, end, after in OUTCOME.findall(done.stdout):
            printed = PRINTED_ERROR.search(during)
            if end == "failed":
                outcome.failures[name] = after + (done.stderr and f"\nBlender printed:\n{done.stderr}")
            else:
                outcome.failures[name] = f"Blender printed:\n{during}" if printed else None
        if PRINTED_ERROR.search(done.stderr):  # cannot be told to whom it belongs
            outcome.failures = dict.fromkeys(outcome.failures, f"Blender printed:\n{done.stderr}") | {
                name: why for name, why in outcome.failures.items() if why
            }
        return outcome


@pytest.fixture(scope="session")
def command() -> Path:
    """Blender's command; without one, skip."""
    found = find_blender()
    if isinstance(found, str):
        pytest.skip(f"NOT TESTED IN A REAL BLENDER: {found}")
    return found


@pytest.fixture(scope="session")
def make_blender() -> type[Blender]:
    """The class, for a test that wants a profile of its own."""
    return Blender


@pytest.fixture(scope="session")
def blender(command: Path, package: Path, tmp_path_factory: pytest.TempPathFactory) -> Blender:
    """Blender with the extension."""
    return Blender(command, tmp_path_factory.mktemp("blender"), package)


@pytest.fixture(scope="session")
def bare_blender(command: Path, package: Path, tmp_path_factory: pytest.TempPathFactory) -> Blender:
    """Blender with the extension and without the OpenImageIO module."""
    return Blender(command, tmp_path_factory.mktemp("bare-blender"), package, hide="OpenImageIO")


def names(file: Path) -> list[str]:
    """The scenarios of a file: its public generator functions, read without running it."""
    tree = ast.parse(file.read_text())
    return [
        node.name
        for node in tree.body
        if isinstance(node, ast.FunctionDef)
        and not node.name.startswith("_")
        and any(isinstance(inner, ast.Yield | ast.YieldFrom) for inner in ast.walk(node))
    ]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make one test of every scenario of every file."""
    if "scenario" in metafunc.fixturenames:
        found = [(file.stem, scenario) for file in sorted(SCENARIOS.glob("*.py")) for scenario in names(file)]
        metafunc.parametrize(("name", "scenario"), found)


type OutcomeOf = Callable[[str, str], Outcome]


@pytest.fixture(scope="session")
def outcome_of(
    blender: Blender, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, coffee_file: Path
) -> OutcomeOf:
    """A function from a file's and a scenario's name to what it left, having passed.

    All scenarios of the file that this session asks for run once, in one window.
    """
    params = [getattr(item, "callspec", None) and item.callspec.params for item in request.session.items]
    asked = [(p["name"], p["scenario"]) for p in params if p and "scenario" in p]
    return _runner(blender, asked, tmp_path_factory, coffee_file)


@pytest.fixture(scope="session")
def outcome_without_openimageio(
    bare_blender: Blender, tmp_path_factory: pytest.TempPathFactory, coffee_file: Path
) -> OutcomeOf:
    """The same in a Blender without the OpenImageIO module, one scenario after the other."""
    return _runner(bare_blender, [], tmp_path_factory, coffee_file)


def _runner(
    blender: Blender,
    asked: list[tuple[str, str]],
    tmp_path_factory: pytest.TempPathFactory,
    coffee_file: Path,
) -> OutcomeOf:
    outcomes: dict[tuple[str, str], Outcome] = {}

    def run(name: str, scenario: str) -> Outcome:
        if (name, scenario) not in outcomes:
            file = SCENARIOS / f"{name}.py"
            batch = [other for other in names(file) if (name, other) in asked or other == scenario]
            folder = tmp_path_factory.mktemp(name)
            shutil.copy(coffee_file, folder / "photo.png")
            outcomes.update(dict.fromkeys([(name, other) for other in batch], blender.window(file, batch, folder)))
        outcome = outcomes[name, scenario]
        outcome.check(scenario)
        return outcome

    return run
