"""The extension inside Blender's Python module, in a scratch profile."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def extension(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The shipped files as a package of another name than `dyehouse`, registered."""
    import tomllib

    paths = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["build"]["paths"]
    folder = tmp_path_factory.mktemp("extensions")
    for path in paths:
        (folder / "installed_dyehouse" / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, folder / "installed_dyehouse" / path)
    sys.path.insert(0, str(folder))
    try:
        import installed_dyehouse

        yield installed_dyehouse
    finally:
        sys.path.remove(str(folder))
