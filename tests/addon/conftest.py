"""The extension inside Blender's Python module, in a scratch profile."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from dyehouse.batch import files
from dyehouse.batch import photo as photos
from dyehouse.core import transfer
from dyehouse.core.colorspace import SRGB, space_named

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


@pytest.fixture
def blender() -> Iterator[None]:
    """An empty .blend, the add-on registered."""
    from dyehouse import addon

    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon.register()
    yield
    addon.unregister()


class Photos:
    """Photos of a glossy, shaded disk on a gray ground, in files of many kinds."""

    HEIGHT, WIDTH = 48, 64
    MATTE = (22, 26)  # x, y of a matte pixel of the disk
    KINDS: ClassVar[dict[str, tuple[type, int, str]]] = {  # dtype, channels, color space
        "8-bit.png": (np.uint8, 3, "srgb"),
        "8-bit-alpha.png": (np.uint8, 4, "srgb"),
        "8-bit.jpg": (np.uint8, 3, "srgb"),
        "8-bit.tif": (np.uint8, 3, "srgb"),
        "16-bit.png": (np.uint16, 3, "srgb"),
        "16-bit.tif": (np.uint16, 3, "srgb"),
        "16-bit-alpha.png": (np.uint16, 4, "srgb"),
        "half.exr": (np.float16, 3, "linear-srgb"),
        "float.exr": (np.float32, 3, "linear-srgb"),
        "float-alpha.exr": (np.float32, 4, "linear-srgb"),
        "adobe.jpg": (np.uint8, 3, "adobe-rgb"),
        "p3.png": (np.uint8, 3, "display-p3"),
        "acescg.exr": (np.float32, 3, "acescg"),
    }

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def coverage(self) -> NDArray[np.float32]:
        """(height, width) of the disk, 0..1."""
        y, x = np.mgrid[: self.HEIGHT, : self.WIDTH]
        return np.clip(18.5 - np.hypot(x - 30, y - 24), 0, 1).astype(np.float32)

    def linear(self) -> NDArray[np.float32]:
        """(height, width, 3) scene-linear RGB."""
        y, x = np.mgrid[: self.HEIGHT, : self.WIDTH]
        shade, gloss = 0.3 + 0.6 * x / self.WIDTH, 0.3 * np.exp(-(((x - 40) ** 2 + (y - 16) ** 2) / 12))
        disk = self.coverage()[..., None]
        product = shade[..., None] * (0.40, 0.10, 0.06) + gloss[..., None]
        noise = np.random.default_rng(0).normal(0, 0.003, (self.HEIGHT, self.WIDTH, 3))
        return (disk * product + (1 - disk) * 0.35 + noise).clip(0).astype(np.float32)

    def file(self, name: str) -> Path:
        """The photo in a file of a kind of KINDS."""
        if (self.folder / name).exists():
            return self.folder / name
        dtype, channels, space_name = self.KINDS[name]
        space, pixels = space_named(space_name), self.linear()
        pixels = transfer.encode(pixels, space.curve, dtype)
        if channels == 4:
            alpha = np.clip(self.coverage() + 0.25, 0, 1)
            if pixels.dtype.kind == "f":
                pixels = pixels * alpha[..., None]
            pixels = np.concatenate([pixels, photos.converted(alpha, dtype)[..., None]], axis=2)
        return files.write(
            self.folder / name, pixels, files.Photo(Path(), pixels, space, premultiplied=pixels.dtype.kind == "f")
        )

    def image(self, name: str = "8-bit.png") -> bpy.types.Image:
        """The same, loaded."""
        return bpy.data.images.load(str(self.file(name)))


@pytest.fixture
def photo(tmp_path: Path) -> Photos:
    """A maker of photos."""
    return Photos(tmp_path)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """A table of two photos, the first in two colorways."""
    codes = np.full((40, 60, 3), (200, 90, 40), np.uint8)
    for name in ("a", "b"):
        files.write(tmp_path / f"{name}.png", codes, files.Photo(Path(), codes, SRGB))
    path = tmp_path / "catalog.csv"
    path.write_text("photo,reference,colorways\na.png,30 20,navy=#1F4E79 | red=#A02818\nb.png,30 20,navy=#1F4E79\n")
    return path
