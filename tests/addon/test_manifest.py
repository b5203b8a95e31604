"""The extension holds what it runs, and nothing else."""

import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
PATHS = MANIFEST["build"]["paths"]
# Only the command line outside Blender uses it.
NOT_SHIPPED = {"batch/demo.py"}


def test_every_module_is_listed_and_every_listed_file_exists() -> None:
    modules = {
        p.relative_to(ROOT).as_posix() for room in ("core", "batch", "addon") for p in (ROOT / room).rglob("*.py")
    }
    tables = {p.relative_to(ROOT).as_posix() for p in (ROOT / "core" / "tables").iterdir()}
    expected = (modules | tables) - NOT_SHIPPED
    assert expected == {p for p in PATHS if "/" in p}
    assert all((ROOT / p).is_file() for p in PATHS)


def test_platform_rules() -> None:
    assert MANIFEST["version"] == version("dyehouse")
    for text in (MANIFEST["tagline"], *MANIFEST["permissions"].values()):
        assert len(text) <= 64
        assert not text.endswith(".")
    assert "blender" not in MANIFEST["name"].lower()
    assert set(MANIFEST["permissions"]) == {"files"}


@pytest.fixture
def shipped(tmp_path: Path) -> Path:
    """The extension's files alone, under another package name, as Blender installs them."""
    package = tmp_path / "extensions" / "some_name"
    for path in PATHS:
        (package / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, package / path)
    return package.parent


def test_the_shipped_files_recolor_a_photo(shipped: Path, tmp_path: Path) -> None:
    codes = np.full((40, 60, 3), (200, 90, 40), np.uint8)
    source, output = tmp_path / "in.png", tmp_path / "out.png"
    files.write(source, codes, files.Photo(source, codes, SRGB))
    code = (
        "import sys\n"
        f"sys.path.insert(0, {str(shipped)!r})\n"
        "from some_name.batch.cli import main\n"
        f"status = main(['recolor', {str(source)!r}, '--reference', '30,20', '--target', '#1F4E79', '-o', "
        f"{str(output)!r}])\n"
        "assert not any(name == 'dyehouse' or name.startswith('dyehouse.') for name in sys.modules)\n"
        "sys.exit(status)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (files.read(output).pixels == (0x1F, 0x4E, 0x79)).all()
