"""`dyehouse.recolor` and `dyehouse.inspect` give what the command line gives, and say why they do not."""

import json
import re
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from dyehouse.addon import images, scripting
from dyehouse.addon.operators.recolor import ARGUMENTS
from dyehouse.batch import files
from dyehouse.batch.cli import main, parser
from dyehouse.core import colorimetry, transfer
from dyehouse.core.colorspace import space_named

pytestmark = pytest.mark.usefixtures("blender")

TARGET = "lab(42, 10, -35)"
KINDS = [
    *("8-bit.png", "8-bit-alpha.png", "8-bit.jpg", "8-bit.tif", "16-bit.png", "16-bit.tif", "16-bit-alpha.png"),
    *("half.exr", "float.exr", "float-alpha.exr", "adobe.jpg", "p3.png", "acescg.exr"),
]


def by_command_line(source: str, output: Path, *options: str) -> bytes:
    assert main(["recolor", source, "--target", TARGET, "-o", str(output), "--force", "--no-verify", *options]) == 0
    return content(output)


def content(path: Path) -> bytes:
    """The bytes of a file, but for the time of day that the encoder leaves in a TIFF."""
    data = path.read_bytes()
    return re.sub(rb"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d", b"", data) if path.suffix == ".tif" else data


def codes_of(image: bpy.types.Image, like: files.Photo) -> np.ndarray:
    """What an image datablock holds, in the numbers of a file."""
    held = images.pixels_of(image)[..., : like.pixels.shape[2]]
    if like.pixels.dtype == np.uint8:
        assert not image.is_float
        return np.rint(held * 255).astype(np.uint8)
    linear, alpha = held[..., :3], held[..., 3:]
    if alpha.size and not like.premultiplied:
        linear = linear / np.maximum(alpha, 1e-6)
    working = images.working_space()
    adapt = colorimetry.adaptation_matrix(working.white, like.space.white, "bradford")
    if not np.allclose(working.to_xyz, like.space.to_xyz, atol=1e-6):
        linear = linear @ (like.space.from_xyz @ adapt @ working.to_xyz).T
    codes = transfer.encode(linear.astype(np.float32), like.space.curve, like.pixels.dtype)
    if alpha.size:
        top = np.iinfo(like.pixels.dtype).max if like.pixels.dtype.kind == "u" else 1
        codes = np.concatenate([codes, (np.rint(alpha * top) if top > 1 else alpha).astype(codes.dtype)], axis=2)
    return codes


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_and_a_new_image_have_the_pixels_of_the_command_line(kind: str, photo: Any, tmp_path: Path) -> None:
    image = photo.image(kind)
    output = tmp_path / f"by-blender{Path(kind).suffix}"
    x, y = photo.MATTE
    asked = {"image": image.name, "reference": f"{x},{y}", "white": "5,5", "gray": 0.35, "target": TARGET}
    if "alpha" in kind:
        asked["mask"] = "alpha"
    assert bpy.ops.dyehouse.recolor(**asked, output=str(output)) == {"FINISHED"}
    mask = ["--mask", "alpha"] if "alpha" in kind else []
    options = ["--reference", f"{x},{y}", "--white", "5,5", "--gray", "0.35", *mask]
    assert content(output) == by_command_line(image.filepath, tmp_path / f"cli{output.suffix}", *options)

    assert bpy.ops.dyehouse.recolor(**asked, result="in blender") == {"FINISHED"}
    written = files.read(output)
    if written.pixels.dtype == np.uint8 and kind.endswith("jpg"):
        lossless = tmp_path / "lossless.png"
        by_command_line(image.filepath, lossless, *options)
        written = files.read(lossless)
    held = codes_of(bpy.data.images["in blender"], written).astype(np.float64)
    if written.pixels.dtype.kind == "u":
        shown = written.pixels[..., 3] > 0 if written.pixels.shape[2] == 4 else ...
        assert (held[shown] == written.pixels[shown]).all()
    else:
        assert np.abs(held - written.pixels).max() < 2e-6 * max(1, np.abs(written.pixels).max())


@pytest.mark.parametrize("space", ["ACEScg", "Linear Rec.2020"])
def test_another_working_space_changes_no_file(space: str, photo: Any, tmp_path: Path) -> None:
    bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=False)
    assert images.working_space() is space_named(images.SPACE_NAMES[space])
    for kind in ("8-bit.png", "half.exr", "acescg.exr"):
        image = photo.image(kind)
        output = tmp_path / f"out{Path(kind).suffix}"
        click = f"{photo.MATTE[0]},{photo.MATTE[1]}"
        options = {"image": image.name, "click": click, "target": TARGET}
        assert bpy.ops.dyehouse.recolor(**options, output=str(output), overwrite=True) == {"FINISHED"}
        assert output.read_bytes() == by_command_line(
            image.filepath, tmp_path / f"cli{output.suffix}", "--click", click
        )
        assert bpy.ops.dyehouse.recolor(**options, result=f"new {kind}") == {"FINISHED"}
        written = files.read(output)
        held = codes_of(bpy.data.images[f"new {kind}"], written).astype(np.float64)
        limit = 0 if written.pixels.dtype == np.uint8 else 3e-3 if written.pixels.dtype == np.float16 else 2e-6
        assert np.abs(held - written.pixels).max() <= limit


def test_masks_of_blender_are_those_of_files(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    painted = bpy.data.images.new("painted", photo.WIDTH, photo.HEIGHT, is_data=True)
    codes = np.rint(photo.coverage() * 255).astype(np.uint8)
    images.set_pixels(painted, np.repeat(codes[..., None] / np.float32(255), 4, axis=2))
    by_hand = np.repeat(codes[..., None], 3, axis=2)
    file = files.write(tmp_path / "mask.png", by_hand, files.Photo(Path(), by_hand, space_named("srgb")))
    expected = by_command_line(image.filepath, tmp_path / "cli.png", "--mask", str(file))
    for number, mask in enumerate(({"mask_image": "painted"}, {"mask": str(file)})):
        output = tmp_path / f"{number}.png"
        bpy.ops.dyehouse.recolor(image=image.name, target=TARGET, output=str(output), **mask)
        assert output.read_bytes() == expected
    with pytest.raises(RuntimeError, match="More than one mask"):
        bpy.ops.dyehouse.recolor(image=image.name, target=TARGET, mask_image="painted", mask=str(file))


def test_several_regions(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    lines = ["click=22,26 target=#1F4E79", "click=4,4 target='lab(60, 2, 2)'"]
    output = tmp_path / "two.png"
    bpy.ops.dyehouse.recolor(image=image.name, regions="\n".join(lines), output=str(output))
    options = [part for line in lines for part in ("--region", line)]
    assert main(["recolor", image.filepath, *options, "-o", str(tmp_path / "cli.png"), "--no-verify"]) == 0
    assert output.read_bytes() == (tmp_path / "cli.png").read_bytes()


def test_inspect_gives_the_figures_of_the_command_line(
    photo: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    image = photo.image()
    bpy.ops.dyehouse.inspect(image=image.name, click="22,26", target=TARGET, maps=str(tmp_path / "maps"))
    told = json.loads(bpy.data.texts["Dyehouse Report"].as_string())
    capsys.readouterr()
    assert main(["inspect", image.filepath, "--click", "22,26", "--target", TARGET, "--json"]) == 0
    assert {k: v for k, v in told.items() if k != "maps"} == json.loads(capsys.readouterr().out)
    assert len(told["maps"]) == 5
    report = tmp_path / "report.json"
    bpy.ops.dyehouse.inspect(image=image.name, click="22,26", target=TARGET, output=str(report))
    assert json.loads(report.read_text())["regions"][0]["model"] == told["regions"][0]["model"]
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.inspect(image=image.name, click="22,26", target=TARGET, output=str(report))


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"image": "no such"}, "no image 'no such'"),
        ({"image": ""}, "no image here"),
        ({"target": ""}, "no target color"),
        ({"target": "blurple"}, "'blurple'"),
        ({"reference": "900,900"}, "outside"),
        ({"click": "somewhere"}, "'somewhere'"),
        ({"white": "moonshine"}, "'moonshine'"),
        ({"mask": "no-such-file.png"}, "does not exist"),
        ({"mask_image": "no such"}, "no image 'no such'"),
        ({"mask_spline": "no such"}, "no mask 'no such'"),
        ({"mask_objects": "Cup"}, "cryptomatte"),
        ({"output": "out.xyz"}, "extension"),
        ({"output": "/no/such/folder/out.png"}, "does not exist"),
        ({"regions": "color=red"}, "color=red"),
    ],
)
def test_bad_input_ends_with_a_sentence(asked: dict[str, str], words: str, photo: Any) -> None:
    usual = {"image": photo.image().name, "target": TARGET}
    if not asked.keys() & {"mask", "mask_image", "mask_spline", "mask_objects", "click", "reference", "regions"}:
        usual["click"] = "22,26"
    before = len(bpy.data.images)
    with pytest.raises(RuntimeError, match=words) as raised:
        bpy.ops.dyehouse.recolor(**usual | asked)
    assert "Traceback" not in str(raised.value)
    assert len(bpy.data.images) == before


def test_files_are_not_overwritten_unasked_and_the_source_never(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    asked = {"image": image.name, "click": "22,26", "target": TARGET}
    before = Path(image.filepath).read_bytes()
    for overwrite in (False, True):
        with pytest.raises(RuntimeError, match="is the source itself"):
            bpy.ops.dyehouse.recolor(**asked, output=image.filepath, overwrite=overwrite)
    other = tmp_path / "other.png"
    other.write_text("precious")
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.recolor(**asked, output=str(other))
    assert other.read_text() == "precious"
    assert bpy.ops.dyehouse.recolor(**asked, output=str(other), overwrite=True) == {"FINISHED"}
    assert files.read(other).pixels.shape == (photo.HEIGHT, photo.WIDTH, 3)
    assert Path(image.filepath).read_bytes() == before


def test_every_option_of_the_command_line_is_an_argument() -> None:
    asked = vars(parser().parse_args(["inspect", "photo"])).keys() - scripting._NO_RECIPE
    assert asked <= set(ARGUMENTS)
    assert set(ARGUMENTS) - asked == {"mask_image", "mask_spline", "mask_objects", "regions"}
