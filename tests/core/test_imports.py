"""What is imported when: the core needs numpy only, and `--help` not even that."""

import json
import subprocess
import sys

import pytest

PROBE = """
import json, sys
BLOCKED = {"bpy", "colour", "OpenImageIO", "scipy", "rich", "rawpy", "PIL", "skimage", "cv2", "matplotlib", "imageio"}

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ImportError(name + " is blocked")

sys.meta_path.insert(0, Finder())
before = set(sys.modules)
%s
added = {name.partition(".")[0] for name in set(sys.modules) - before}
print(json.dumps(sorted(n for n in added if n not in sys.stdlib_module_names)))
"""


def imported(code):
    done = subprocess.run([sys.executable, "-c", PROBE % code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def test_core_needs_numpy_only():
    assert imported("import dyehouse.core") == {"dyehouse", "numpy"}


def test_all_of_the_core_works_with_numpy_only():
    code = """
import pkgutil, importlib, dyehouse.core
for module in pkgutil.iter_modules(dyehouse.core.__path__):
    importlib.import_module("dyehouse.core." + module.name)
import numpy as np
from dyehouse.core import Picture, analyze
from dyehouse.core.recipe import Recipe, Region, prepare
from dyehouse.core.swatches import parse_target
image = np.tile(np.array([0.5, 0.1, 0.05], np.float32), (20, 20, 1))
result = analyze(image).recolor((0.1, 0.2, 0.3))
assert np.allclose(result, (0.1, 0.2, 0.3), atol=1e-5)
recipe = Recipe((Region(parse_target("lab(50,-20,10)"), click=(5, 5)),), white="D65", illuminant="FL11")
prepare(Picture(image), recipe).regions()
"""
    assert imported(code) == {"dyehouse", "numpy"}


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["recolor", "--help"],
        ["inspect", "--help"],
        ["verify", "--help"],
        ["swatches", "--help"],
        ["--version"],
    ],
)
def test_help_imports_neither_numpy_nor_openimageio(arguments):
    code = f"""
from dyehouse.batch.cli import main
try:
    main({arguments!r})
except SystemExit as stop:
    assert stop.code == 0
"""
    assert imported(code) == {"dyehouse"}


def test_package_itself_imports_nothing():
    assert imported("import dyehouse") == {"dyehouse"}


def test_no_module_of_the_core_names_the_other_rooms():
    code = """
import pkgutil, importlib, dyehouse.core
for module in pkgutil.iter_modules(dyehouse.core.__path__):
    importlib.import_module("dyehouse.core." + module.name)
assert not [n for n in sys.modules if n.startswith(("dyehouse.batch", "dyehouse.addon"))]
"""
    assert imported(code) == {"dyehouse", "numpy"}
