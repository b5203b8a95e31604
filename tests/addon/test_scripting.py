"""The module for scripts, and the examples of docs/blender.md as they stand there."""

import re
import shutil
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import dyehouse
from dyehouse import addon
from dyehouse.addon import images, scripting
from dyehouse.batch import files
from dyehouse.batch.cli import main
from dyehouse.core import errors
from dyehouse.core.errors import DyehouseError
from dyehouse.core.swatches import Swatch

pytestmark = pytest.mark.usefixtures("blender")

EXAMPLES = re.findall(
    r"```python\n(.*?)```", (Path(__file__).resolve().parents[2] / "docs" / "blender.md").read_text(), re.DOTALL
)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package under the name that it has as an extension."""
    name = "bl_ext.user_default.dyehouse"
    for part, module in (
        ("", dyehouse), (".addon", addon), (".addon.scripting", scripting), (".core", dyehouse.core),
        (".core.errors", errors),
    ):  # fmt: skip
        monkeypatch.setitem(sys.modules, name + part, module)


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("number", range(3))
def test_the_examples_run_as_written(
    number: int, photo: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, kind in (("shirt.jpg", "8-bit.jpg"), ("shoe.png", "8-bit.png"), ("bag.png", "16-bit.png")):
        shutil.move(photo.file(kind), tmp_path / name)
    (tmp_path / "broken.png").write_bytes((tmp_path / "bag.png").read_bytes()[:2000])
    assert len(EXAMPLES) == 3
    before = {path.name for path in tmp_path.iterdir()}
    exec(compile(EXAMPLES[number].replace("/photos", str(tmp_path)), "docs/blender.md", "exec"), {})
    made = {path.name for path in tmp_path.iterdir()} - before
    told = capsys.readouterr().out
    if number == 0:
        assert "shirt-recolored (64, 48)" in told
        assert made == {"shirt-red.jpg"}
    elif number == 1:
        assert made == {f"{stem}-{name}.tif" for stem in ("shoe", "bag") for name in ("petrol", "sand")}
        assert re.search("broken.png: .*broken.png' is damaged", told)
    else:
        assert made == {"shoe petrol.png", "shoe sand.png", "shoe.toml"}
        options = ["--recipe", str(tmp_path / "shoe.toml"), "--colorway", "sand", "-o", str(tmp_path / "out.png")]
        assert main(["recolor", str(tmp_path / "shoe.png"), *options, "--no-verify"]) == 0
        assert (tmp_path / "out.png").read_bytes() == (tmp_path / "shoe sand.png").read_bytes()


def test_values_and_texts_mean_the_same(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    as_texts = {"reference": "22,26", "white": "5,5", "gray": 0.35, "mask": "click", "tolerance": 1.3}
    as_values = as_texts | {"reference": (22, 26), "white": (5, 5)}
    written = []
    for number, (target, asked) in enumerate(
        (
            ("rgb(0.02, 0.1, 0.3)", as_texts),
            ((0.02, 0.1, 0.3), as_values),
            (Swatch.from_linear((0.02, 0.1, 0.3)), as_values),
        )
    ):
        written.append(scripting.recolor(image, target, **asked, output=tmp_path / f"{number}.png").read_bytes())
    assert len(set(written)) == 1
    figures = scripting.inspect(image.name, "rgb(0.02, 0.1, 0.3)", **as_values)
    assert figures["regions"][0]["reference_pixel"] == [22, 26]


def test_masks_of_every_kind(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    codes = np.rint(photo.coverage() * 255).astype(np.uint8)
    pixels = np.repeat(codes[..., None], 3, axis=2)
    file = files.write(tmp_path / "mask of mine.png", pixels, files.Photo(Path(), pixels, files.SRGB))
    loaded = bpy.data.images.load(str(file))
    made = [
        images.pixels_of(scripting.recolor(image, "#1F4E79", mask=mask))
        for mask in (codes, photo.coverage() * 255 // 1 / 255, file, str(file), loaded, f"image:{loaded.name}")
    ]
    for other in (made[0], *made[2:]):
        assert (other == made[0]).all()
    two = {"regions": [{"mask": file, "target": "#1F4E79"}, {"click": (4, 4), "target": (0.2, 0.1, 0.1)}]}
    both = images.pixels_of(scripting.recolor(image, **two))
    assert (both[24, 30] == made[0][24, 30]).all()
    assert np.abs(both[4, 4] - made[0][4, 4]).max() > 0.1
    with pytest.raises(DyehouseError, match="is 8 x 8"):
        scripting.recolor(photo.image("8-bit.jpg"), "#1F4E79", mask=bpy.data.images.new("small", 8, 8))


def test_the_same_photo_is_looked_at_once(photo: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from dyehouse.batch import photo as photos

    looks, look = [], photos.look
    monkeypatch.setattr(photos, "look", lambda *a, **o: looks.append(1) or look(*a, **o))
    image = photo.image()
    for target in ("#1F4E79", "#AA2211", "lab(60, 2, 2)"):
        scripting.recolor(image, target, click=(22, 26))
    assert len(looks) == 1
    scripting.recolor(image, "#1F4E79", click=(22, 27))
    assert len(looks) == 2


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({}, "no target color"),
        ({"target": "#1F4E79", "colour": 1}, "'colour' is not understood"),
        ({"target": "#1F4E79", "recipe": "x.toml"}, "'recipe' is not understood"),
        ({"target": (1, 2)}, "'rgb"),
        ({"target": "#1F4E79", "regions": [{"color": "red"}]}, "color=red"),
        ({"target": "#1F4E79", "mask": "spline:none"}, "no mask 'none'"),
        ({"target": "#1F4E79", "output": "out.xyz"}, "extension"),
    ],
)
def test_what_cannot_be_used_is_told(asked: dict[str, Any], words: str, photo: Any) -> None:
    with pytest.raises(DyehouseError, match=words):
        scripting.recolor(photo.image(), **asked)
    with pytest.raises(DyehouseError, match="no image 'none'"):
        scripting.inspect("none", **asked)


def test_what_the_panel_shows_is_written(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    bpy.ops.dyehouse.add_region(image=image.name)
    image.dyehouse.regions[0].click, image.dyehouse.regions[0].target.text = (22, 26), "#1F4E79"
    path = scripting.write(image, tmp_path / "out.png")
    scripting.recolor(image, "#1F4E79", click=(22, 26), output=tmp_path / "same.png")
    assert path.read_bytes() == (tmp_path / "same.png").read_bytes()
    with pytest.raises(DyehouseError, match="exists already"):
        scripting.write(image, path)
