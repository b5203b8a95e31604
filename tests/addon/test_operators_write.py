"""Writing what the panel shows, and all colorways."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from dyehouse.addon import images
from dyehouse.addon.operators import modal, write
from dyehouse.batch import files, verification
from dyehouse.batch.cli import main
from dyehouse.core.colorspace import SPACES
from dyehouse.core.swatches import parse_target

pytestmark = pytest.mark.usefixtures("blender")

TARGET = "lab(42, 10, -35)"


@pytest.fixture
def image(photo: Any) -> bpy.types.Image:
    """A photo with a region, a target and two colorways."""
    made = photo.image("8-bit.jpg")
    bpy.ops.dyehouse.add_region(image=made.name)
    region = made.dyehouse.regions[0]
    region.click, region.target.text = photo.MATTE, "#1F4E79"
    bpy.ops.dyehouse.add_colorway(image=made.name, name="navy")
    bpy.ops.dyehouse.add_colorway(image=made.name, name="violet")
    region.target.text = TARGET
    return made


def by_command_line(image: bpy.types.Image, output: Path, target: str, *options: str) -> bytes:
    asked = ["recolor", image.filepath, "--click", "22,26", "--target", target, "-o", str(output), "--no-verify"]
    assert main([*asked, *options]) == 0
    return output.read_bytes()


def test_what_is_shown_is_written(image: bpy.types.Image, tmp_path: Path) -> None:
    for index, target in ((1, TARGET), (0, "#1F4E79")):
        image.dyehouse.active_colorway = index
        output = tmp_path / f"{index}.jpg"
        assert bpy.ops.dyehouse.write_file(image=image.name, filepath=str(output)) == {"FINISHED"}
        assert output.read_bytes() == by_command_line(image, tmp_path / f"cli-{index}.jpg", target)
    image.dyehouse.quality = 60
    bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "low.jpg"))
    assert (tmp_path / "low.jpg").read_bytes() == by_command_line(
        image, tmp_path / "cli-low.jpg", "#1F4E79", "--quality", "60"
    )


def test_a_wider_color_space_is_written(image: bpy.types.Image, tmp_path: Path) -> None:
    image.dyehouse.output_space = "rec2020"
    assert bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "out.png")) == {"FINISHED"}
    expected = by_command_line(image, tmp_path / "cli.png", TARGET, "--output-space", "rec2020")
    assert (tmp_path / "out.png").read_bytes() == expected
    assert files.read(tmp_path / "out.png").space is SPACES["rec2020"]
    asked = {"click": "22,26", "target": TARGET, "output_space": "rec2020"}
    bpy.ops.dyehouse.recolor(image=image.name, output=str(tmp_path / "asked.png"), **asked)
    assert (tmp_path / "asked.png").read_bytes() == expected


def test_what_was_written_is_read_back_and_told(image: bpy.types.Image, tmp_path: Path) -> None:
    assert write.delivered(image) == []
    output = tmp_path / "out.png"
    assert bpy.ops.dyehouse.write_file(image=image.name, filepath=str(output)) == {"FINISHED"}
    (told,) = write.delivered(image)
    assert told.startswith("Delivered ")
    assert float(told.split()[1]) < 1
    # The file really has that color, and not the one that it had.
    found = verification.verify(output, (22, 26), parse_target(TARGET))
    before = verification.verify(bpy.path.abspath(image.filepath), (22, 26), parse_target(TARGET))
    assert found.ciede2000 < before.ciede2000 / 3


def test_a_new_image_is_written(image: bpy.types.Image, tmp_path: Path) -> None:
    assert bpy.ops.dyehouse.write_image(image=image.name) == {"FINISHED"}
    made = bpy.data.images["8-bit-violet"]
    by_command_line(image, tmp_path / "cli.png", TARGET)
    codes = np.rint(images.pixels_of(made)[..., :3] * 255)
    assert (codes == files.read(tmp_path / "cli.png").pixels).all()
    assert image.filepath.endswith("8-bit.jpg")


def test_all_colorways_are_written(image: bpy.types.Image, tmp_path: Path) -> None:
    pattern = str(tmp_path / "{photo} in {colorway}.png")
    image.dyehouse.colorways[1].name = "violet/red"  # no folder of that name is made
    assert bpy.ops.dyehouse.write_colorways(image=image.name, pattern=pattern) == {"FINISHED"}
    for name, target in (("navy", "#1F4E79"), ("violet-red", TARGET)):
        written = (tmp_path / f"8-bit in {name}.png").read_bytes()
        assert written == by_command_line(image, tmp_path / f"cli-{name}.png", target)
    assert write.progress() is None
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.write_colorways(image=image.name, pattern=pattern)
    assert bpy.ops.dyehouse.write_colorways(image=image.name, pattern=pattern, overwrite=True) == {"FINISHED"}


def test_double_slashes_mean_the_folder_of_the_blend_or_else_of_the_photo(
    image: bpy.types.Image, tmp_path: Path
) -> None:
    bpy.ops.dyehouse.write_colorways(image=image.name)
    assert (tmp_path / "8-bit-navy.png").exists()
    folder = tmp_path / "scenes"
    folder.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    bpy.ops.dyehouse.write_colorways(image=image.name)
    assert (folder / "8-bit-navy.png").exists()


def test_nothing_is_written_if_one_file_cannot_be(image: bpy.types.Image, tmp_path: Path) -> None:
    (tmp_path / "violet.png").write_text("precious")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RuntimeError, match=r"violet\.png' exists already"):
        bpy.ops.dyehouse.write_colorways(image=image.name, pattern=str(tmp_path / "{colorway}.png"))
    with pytest.raises(RuntimeError, match="would both be written"):
        bpy.ops.dyehouse.write_colorways(image=image.name, pattern=str(tmp_path / "same.png"))
    with pytest.raises(RuntimeError, match="is the source itself"):
        bpy.ops.dyehouse.write_file(image=image.name, filepath=image.filepath, overwrite=True)
    image.dyehouse.regions[0].target.text = "blurple"
    with pytest.raises(RuntimeError, match="blurple"):
        bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "new.png"))
    assert sorted(tmp_path.iterdir()) == before


def test_painted_pixels_do_not_overwrite_their_own_file(image: bpy.types.Image, tmp_path: Path) -> None:
    before = Path(image.filepath).read_bytes()
    image.pixels[0] = 0.5
    assert image.is_dirty
    with pytest.raises(RuntimeError, match="is the source itself"):
        bpy.ops.dyehouse.write_file(image=image.name, filepath=image.filepath, overwrite=True)
    assert Path(image.filepath).read_bytes() == before
    assert bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "out.png")) == {"FINISHED"}


def test_a_photo_without_target_or_colorway_says_so(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    with pytest.raises(RuntimeError, match="has no region"):
        bpy.ops.dyehouse.write_file(image=image.name, filepath=str(tmp_path / "out.png"))
    bpy.ops.dyehouse.add_region(image=image.name)
    region = image.dyehouse.regions[0]
    with pytest.raises(RuntimeError, match="not picked yet"):
        bpy.ops.dyehouse.write_image(image=image.name)
    region.click = photo.MATTE
    with pytest.raises(RuntimeError, match="has no colorway"):
        bpy.ops.dyehouse.write_colorways(image=image.name)
    region.target.used = False
    with pytest.raises(RuntimeError, match="no target color"):
        bpy.ops.dyehouse.write_image(image=image.name)


def test_stopping_leaves_whole_files_and_no_others(image: bpy.types.Image, tmp_path: Path) -> None:
    job = write.all_colorways(image, str(tmp_path / "{colorway}.tif"), overwrite=False, quality=95)
    assert job.finish(job.work())
    done, total, text = job.progress()
    assert (done, total) == (1, 2)
    assert "violet.tif" in text
    bpy.data.images.remove(image)  # the job does not need it any more
    job.stop()
    with pytest.raises(modal.Stopped):
        job.work()
    assert files.read(tmp_path / "navy.tif").pixels.shape[2] == 3
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".tif" or p.name.startswith(".")] == ["navy.tif"]


def test_stopping_within_a_file_leaves_none_of_it(image: bpy.types.Image, tmp_path: Path) -> None:
    job = write.all_colorways(image, str(tmp_path / "{colorway}.tif"), overwrite=False, quality=95)
    look = job._upright
    shares = []

    def watch(share: float) -> None:
        shares.append(share)
        job.stop()
        job.watch(share)

    job._options["watch"] = watch
    assert look()
    with pytest.raises(modal.Stopped):
        job.work()
    assert len(shares) == 1
    assert not [p for p in tmp_path.iterdir() if p.suffix == ".tif" or p.name.startswith(".")]
