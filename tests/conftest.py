"""Pictures whose truth is known by construction, and the two real photographs."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]

# Before any test imports bpy: Blender shall neither read nor write what is the user's.
_profile = tempfile.mkdtemp(prefix="dyehouse-blender-")
atexit.register(shutil.rmtree, _profile, ignore_errors=True)
os.environ["BLENDER_USER_RESOURCES"] = _profile


@dataclass
class Product:
    """A glossy, shaded ball on a grey ground, in scene-linear RGB."""

    image: np.ndarray
    mask: np.ndarray  # 1 on the product, 0 beside it
    shading: np.ndarray
    gloss: np.ndarray
    body: np.ndarray  # V, where shading is 1 and gloss 0
    white: np.ndarray  # W
    matte: tuple[int, int]  # a pixel of shading 1 without gloss

    def in_color(self, body: np.ndarray, white: np.ndarray) -> np.ndarray:
        """The same product without noise in another color and light."""
        return self.shading[..., None] * body + self.gloss[..., None] * white


@pytest.fixture
def product() -> Callable[..., Product]:
    """A factory of products."""

    def make(
        body=(0.42, 0.09, 0.05), white=(1.0, 1.0, 1.0), *, size=96, noise=0.002, gloss=1.0, ground=0.35, seed=0
    ) -> Product:
        v, w = np.asarray(body, float), np.asarray(white, float)
        y, x = np.mgrid[:size, :size] / (size - 1) * 2 - 1
        inside = np.hypot(x, y) < 0.85
        height = np.sqrt(np.clip(0.85**2 - x**2 - y**2, 0, None)) / 0.85
        # Light from the top left: shading by Lambert, at 1 where the surface faces the light; a lobe of gloss there.
        facing = np.clip((-0.5 * x / 0.85 - 0.5 * y / 0.85 + 0.7071 * height), 0, 1)
        shading = np.where(inside, 0.12 + 0.88 * facing, 0.0)
        lobe = np.where(inside, gloss * 0.7 * np.exp(-((1 - facing) / 0.02)), 0.0)
        image = shading[..., None] * v + lobe[..., None] * w
        image[~inside] = ground * w
        image += np.random.default_rng(seed).normal(0, noise, image.shape) if noise else 0.0
        dull = np.where(inside & (lobe < 1e-4), shading, 0)
        row, column = np.unravel_index(np.argmax(dull), dull.shape)
        return Product(image.astype(np.float32), inside.astype(float), shading, lobe, v, w, (int(column), int(row)))

    return make


def photo_of_skimage(name: str) -> Path:
    """The file of a photo that scikit-image carries."""
    found = find_spec("skimage")
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent / "data" / name


@pytest.fixture(scope="session")
def astronaut_file() -> Path:
    return photo_of_skimage("astronaut.png")


@pytest.fixture(scope="session")
def coffee_file() -> Path:
    return photo_of_skimage("coffee.png")


@pytest.fixture(scope="session")
def build_extension() -> Callable[[Path, Path], Path]:
    """`tools/build_extension.py`: from a folder with the extension's source to the zip in another folder."""

    def build(source: Path, out: Path) -> Path:
        tool = [sys.executable, str(ROOT / "tools" / "build_extension.py"), "--source", str(source), "--out", str(out)]
        done = subprocess.run(tool, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return Path(done.stdout.strip())

    return build


@pytest.fixture(scope="session")
def package(build_extension: Callable[[Path, Path], Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built extension."""
    return build_extension(ROOT, tmp_path_factory.mktemp("package"))


@pytest.fixture(scope="session")
def previous_package(build_extension: Callable[[Path, Path], Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension built from the same files under a lower version number."""
    source = tmp_path_factory.mktemp("previous")
    manifest = (ROOT / "blender_manifest.toml").read_text()
    for path in tomllib.loads(manifest)["build"]["paths"]:
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / path, source / path)
    older = re.sub(r'^version = ".*"$', 'version = "0.0.1"', manifest, flags=re.MULTILINE)
    (source / "blender_manifest.toml").write_text(older)
    return build_extension(source, source)
