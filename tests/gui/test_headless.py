"""The extension in a real Blender without a window: installed, upgraded, and the same results as outside."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB

pytestmark = pytest.mark.slow  # minutes of drawing in software

STATE = """
import sys
print("heavy", sorted({"numpy", "OpenImageIO", "rich"} & set(sys.modules)))
import bpy, addon_utils
NAME = "bl_ext.user_default.dyehouse"
if NAME in bpy.context.preferences.addons:
    print("version", ".".join(map(str, addon_utils.module_bl_info(sys.modules[NAME])["version"])))
"""


def test_the_command_line_installs_and_upgrades(
    command: Path, package: Path, previous_package: Path, tmp_path: Path, make_blender: Any
) -> None:
    blender = make_blender(command, tmp_path)
    scene = tmp_path / "scene.blend"
    make = (
        "import bpy\n"
        "image = bpy.data.images.new('photo', 8, 4)\n"
        "image.use_fake_user = True\n"
        "image.dyehouse.white_source, image.dyehouse.white_temperature = 'TEMPERATURE', 6100\n"
        f"bpy.ops.wm.save_as_mainfile(filepath={str(scene)!r})\n"
    )
    recall = (
        "import bpy\n"
        "settings = bpy.data.images['photo'].dyehouse\n"
        "print('settings', settings.white_source, settings.white_temperature)\n"
    )
    for zipped, version in ((previous_package, "0.0.1"), (package, package.stem.partition("-")[2])):
        done = blender.run("--command", "extension", "install-file", "-r", "user_default", "-e", zipped)
        assert done.returncode == 0, done.stdout + done.stderr
        # In a process of its own, as the user's next start is.
        done = blender.run("--background", "--python-exit-code", "1", "--python-expr", STATE)
        assert "heavy []\n" in done.stdout
        assert f"version {version}\n" in done.stdout
        if zipped is previous_package:
            done = blender.run("--background", "--python-exit-code", "1", "--python-expr", make)
            assert done.returncode == 0, done.stdout + done.stderr
    done = blender.run("--background", scene, "--python-exit-code", "1", "--python-expr", recall)
    assert "settings TEMPERATURE 6100.0\n" in done.stdout, done.stdout + done.stderr


def test_starting_prints_nothing_and_writes_nothing(blender: Any) -> None:
    def written() -> set[Path]:
        return {p for folder in (blender.profile, blender.home) for p in folder.rglob("*") if p.is_file()}

    before = written()
    done = blender.run("--background", "--python-expr", "print('started')")
    assert done.stderr == ""
    lines = {line for line in done.stdout.splitlines() if line and not line.startswith("Blender 5.2")}
    assert lines == {"started", "Blender quit"}
    assert not {p for p in written() - before if "__pycache__" not in p.parts}


def photos(folder: Path, coffee: Path) -> dict[str, Path]:
    """The coffee photo as 8-bit JPEG and PNG with alpha, as 16-bit TIFF and as float EXR."""
    codes = files.read(coffee).pixels[::2, ::2].copy()
    alpha = np.full((*codes.shape[:2], 1), 255, np.uint8)
    alpha[:40] = 100
    fine = (codes.astype(np.uint16) * 257 + np.arange(codes.shape[1], dtype=np.uint16)[:, None] % 200).clip(0, 65535)
    pictures = {
        "photo.jpg": codes,
        "alpha.png": np.concatenate([codes, alpha], -1),
        "fine.tif": fine.astype(np.uint16),
        "linear.exr": (codes.astype(np.float32) / 255) ** 2.2,
    }
    for name, picture in pictures.items():
        files.write(folder / name, picture, files.Photo(folder / name, picture, SRGB))
    return {name: folder / name for name in pictures}


OPERATOR = """
import sys
import bpy

source, target = sys.argv[-2:]
image = bpy.data.images.load(source)
done = bpy.ops.dyehouse.recolor(image=image.name, click="40,110", target="#1F4E79", output=target)
assert done == {"FINISHED"}, done
"""


@pytest.mark.parametrize("name", ["photo.jpg", "alpha.png", "fine.tif", "linear.exr"])
def test_all_front_ends_write_the_same(
    name: str, blender: Any, bare_blender: Any, coffee_file: Path, tmp_path: Path
) -> None:
    """Bit for bit under one numpy; another build of numpy rounds some sums the other way in the last bit."""
    source = photos(tmp_path, coffee_file)[name]
    asked = ["recolor", source, "--click", "40,110", "--target", "#1F4E79", "-o"]
    ending = ".png" if name.endswith("jpg") else source.suffix  # exact, so that pixels can be compared

    def output(made_by: str) -> Path:
        return tmp_path / f"{made_by}{ending}"

    operator = ["--background", "--python-exit-code", "1", "--python-expr", OPERATOR, "--", source]
    for done in (
        blender.python("-m", "dyehouse", *asked, output("command_line")),
        blender.run("--command", "dyehouse", *asked, output("blender_command")),
        blender.run(*operator, output("operator")),
        bare_blender.run(*operator, output("operator_without_openimageio")),
        subprocess.run([sys.executable, "-m", "dyehouse", *map(str, [*asked, output("here")])], check=True),
    ):
        assert done.returncode == 0, done.stdout + done.stderr

    expected = files.read(output("command_line")).pixels
    assert (files.read(source).pixels != expected).any()
    for made_by in ("blender_command", "operator", "operator_without_openimageio"):
        np.testing.assert_array_equal(files.read(output(made_by)).pixels, expected, err_msg=made_by)
    here, least = files.read(output("here")).pixels, 1e-6 if ending == ".exr" else 1
    np.testing.assert_allclose(here.astype(float), expected.astype(float), rtol=0, atol=least)
    if ending != ".exr":
        assert np.mean(here != expected) < 1e-3


@pytest.mark.parametrize("subcommand", ["recolor", "inspect"])
def test_the_command_says_that_it_needs_openimageio(
    subcommand: str, bare_blender: Any, coffee_file: Path, tmp_path: Path
) -> None:
    photo = shutil.copy(coffee_file, tmp_path / "photo.png")
    output = ["-o", tmp_path / "out.png"] if subcommand == "recolor" else []
    done = bare_blender.run(
        "--command", "dyehouse", subcommand, photo, "--click", "150,220", "--target", "#1F4E79", *output
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert "OpenImageIO" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["photo.png"]


def test_the_command_fails_as_the_command_line(blender: Any, tmp_path: Path) -> None:
    asked = ["recolor", tmp_path / "none.png", "--click", "1,1", "--target", "#1F4E79", "-o", tmp_path / "out.png"]
    done = blender.run("--command", "dyehouse", *asked)
    assert done.returncode == 2
    outside = subprocess.run(
        [sys.executable, "-m", "dyehouse", *map(str, asked)], capture_output=True, text=True, check=False
    )
    assert done.stderr == outside.stderr
    assert "none.png" in done.stderr
