"""Save Recipe and Load Recipe: the command line makes of the file what the panel writes."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO
import pytest

from dyehouse.addon import images, recipes
from dyehouse.batch import files
from dyehouse.batch.cli import main
from dyehouse.core.recipe_file import read_recipe

pytestmark = pytest.mark.usefixtures("blender")


def set_up(image: bpy.types.Image, click: tuple[int, int]) -> None:
    """Settings that differ from the usual ones."""
    for name in ("Shirt", "Ground"):
        bpy.ops.dyehouse.add_region(image=image.name, name=name)
    settings = image.dyehouse
    shirt, ground = settings.regions
    shirt.click, shirt.reference, shirt.reference_source = click, click, "PIXEL"
    shirt.tolerance, shirt.model, shirt.residual, shirt.meaning = 1.3, "dichromatic", "keep", "product"
    shirt.source, shirt.target.text = "#AA5544", "lab(42, 10, -35)"
    shirt.target.swatch_name = "Violet 7"
    more = shirt.more_clicks.add()
    more.pixel, more.removes = (4, 4), True
    ground.mask_source, ground.reference_source = "WHOLE", "COLOR"
    ground.reference_color, ground.target.color = (0.35, 0.34, 0.36), (0.2, 0.5, 0.3)
    settings.white_source, settings.white_pixel, settings.gray = "PIXEL", (6, 5), 0.35
    settings.light_source, settings.light_illuminant = "ILLUMINANT", "A"
    settings.observer, settings.adaptation = "1964", "bradford"
    settings.output_pattern, settings.quality = "//out/{photo}_{colorway}.jpg", 88
    settings.output_space = "display-p3"
    bpy.ops.dyehouse.add_colorway(image=image.name, name="one")
    ground.target.used = False
    bpy.ops.dyehouse.add_colorway(image=image.name, name="two")


def written(image: bpy.types.Image, path: Path) -> bytes:
    bpy.ops.dyehouse.write_file(image=image.name, filepath=str(path))
    return path.read_bytes()


def by_command_line(recipe: Path, photo: str, output: Path, *options: str) -> bytes:
    assert main(["recolor", photo, "--recipe", str(recipe), "-o", str(output), "--no-verify", *options]) == 0
    return output.read_bytes()


def test_every_setting_comes_back(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    set_up(image, photo.MATTE)
    path = tmp_path / "shirt.toml"
    assert bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(path)) == {"FINISHED"}
    asked = recipes.recipe_of(image)
    before = written(image, tmp_path / "before.png")

    image.dyehouse.regions.clear()
    image.dyehouse.colorways.clear()
    for name in (
        "white_source",
        "light_source",
        "observer",
        "adaptation",
        "output_pattern",
        "quality",
        "output_space",
        "gray",
    ):
        image.dyehouse.property_unset(name)
    assert bpy.ops.dyehouse.load_recipe(image=image.name, filepath=str(path)) == {"FINISHED"}
    assert recipes.recipe_of(image) == asked
    assert image.dyehouse.regions[0].target.swatch_name == "Violet 7"
    assert (image.dyehouse.output_pattern, image.dyehouse.quality) == ("//out/{photo}_{colorway}.jpg", 88)
    assert image.dyehouse.output_space == "display-p3"
    assert written(image, tmp_path / "after.png") == before
    assert by_command_line(path, image.filepath, tmp_path / "cli.png") == before
    again = tmp_path / "again.toml"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(again))
    assert again.read_text() == path.read_text()


def test_each_colorway_is_that_of_the_command_line(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    set_up(image, photo.MATTE)
    path = tmp_path / "shirt.toml"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(path))
    bpy.ops.dyehouse.write_colorways(image=image.name, pattern=str(tmp_path / "{colorway}.png"))
    for name in ("one", "two"):
        expected = by_command_line(path, image.filepath, tmp_path / f"cli-{name}.png", "--colorway", name)
        assert (tmp_path / f"{name}.png").read_bytes() == expected


def test_masks_of_blender_become_files(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    painted = bpy.data.images.new("painted", photo.WIDTH, photo.HEIGHT, float_buffer=True, is_data=True)
    images.set_pixels(painted, np.repeat(photo.coverage()[..., None] * 0.777, 4, axis=2))
    mask = bpy.data.masks.new("outline")
    spline = mask.layers.new().splines.new()
    spline.use_cyclic = True
    spline.points.add(2)
    for point, xy in zip(spline.points, ((0.7, 0.7), (0.9, 0.7), (0.8, 0.4)), strict=True):
        point.co = point.handle_left = point.handle_right = xy
    for name, source in (("Disk", "IMAGE"), ("Corner", "SPLINE")):
        bpy.ops.dyehouse.add_region(image=image.name, name=name)
        image.dyehouse.regions[-1].mask_source = source
    image.dyehouse.regions[0].mask_image, image.dyehouse.regions[1].mask_spline = painted, mask
    path = tmp_path / "r.toml"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(path))
    assert [region.mask for region in read_recipe(path).recipe.regions] == ["r-Disk-mask.png", "r-Corner-mask.png"]
    before = written(image, tmp_path / "before.png")
    assert by_command_line(path, image.filepath, tmp_path / "cli.png") == before
    bpy.ops.dyehouse.load_recipe(image=image.name, filepath=str(path))
    assert [region.mask_source for region in image.dyehouse.regions] == ["FILE", "FILE"]
    assert written(image, tmp_path / "after.png") == before
    path.unlink()
    image.dyehouse.regions[0].mask_source, image.dyehouse.regions[0].mask_image = "IMAGE", painted
    with pytest.raises(RuntimeError, match=r"mask\.png' exists already"):
        bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(path))
    assert not path.exists()


@pytest.mark.parametrize("orientation", range(2, 9))
def test_a_photo_that_lies_on_its_side(orientation: int, photo: Any, tmp_path: Path) -> None:
    codes = files.read(photo.file("8-bit.png")).pixels
    path = str(tmp_path / "lying.jpg")
    spec = OpenImageIO.ImageSpec(photo.WIDTH, photo.HEIGHT, 3, "uint8")
    spec.attribute("Orientation", orientation)
    output = OpenImageIO.ImageOutput.create(path)
    assert output.open(path, spec)
    assert output.write_image(codes)
    output.close()
    image = bpy.data.images.load(path)
    set_up(image, photo.MATTE)
    image.dyehouse.output_space = "PHOTO"  # as the new image has it
    upright = files.turned(np.rint(photo.coverage() * 255).astype(np.uint8), orientation)[..., None].repeat(3, axis=2)
    files.write(tmp_path / "mask.png", upright, files.Photo(Path(), upright, files.SRGB))
    ground = image.dyehouse.regions[1]
    ground.mask_source, ground.mask_file = "FILE", str(tmp_path / "mask.png")
    recipe = tmp_path / "r.toml"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(recipe))
    expected = by_command_line(recipe, path, tmp_path / "cli.png")
    assert written(image, tmp_path / "ours.png") == expected
    assert files.read(tmp_path / "cli.png").pixels.shape[:2] == upright.shape[:2]
    bpy.ops.dyehouse.load_recipe(image=image.name, filepath=str(recipe))
    assert tuple(image.dyehouse.regions[0].click) == photo.MATTE
    bpy.ops.dyehouse.write_colorways(image=image.name, pattern=str(tmp_path / "{colorway}.png"))
    assert (tmp_path / "one.png").read_bytes() == by_command_line(
        recipe, path, tmp_path / "cli-one.png", "--colorway", "one"
    )
    bpy.ops.dyehouse.write_image(image=image.name, result="made")
    made = images.pixels_of(bpy.data.images["made"])[..., :3] * 255
    assert made.shape[:2] == (photo.HEIGHT, photo.WIDTH)
    difference = np.abs(np.rint(made) - files.turned(files.read(tmp_path / "ours.png").pixels, orientation, back=True))
    assert np.quantile(difference, 0.99) <= 1  # regions are found from top left to bottom right


def test_what_cannot_be_saved_or_loaded_is_said(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    set_up(image, photo.MATTE)
    image.dyehouse.regions[1].name = "Shirt"
    with pytest.raises(RuntimeError, match="Two regions are named 'Shirt'"):
        bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(tmp_path / "r.toml"))
    image.dyehouse.regions[1].name = "Ground"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(tmp_path / "r.toml"))
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(tmp_path / "r.toml"))
    (tmp_path / "bad.toml").write_text('[[region]]\ntarget = "blurple"\n')
    before = recipes.recipe_of(image)
    for name, words in (("bad.toml", "blurple"), ("missing.toml", "cannot be read")):
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.dyehouse.load_recipe(image=image.name, filepath=str(tmp_path / name))
    assert recipes.recipe_of(image) == before


def test_a_recipe_opens_its_own_photo(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    set_up(image, photo.MATTE)
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(tmp_path / "r.toml"))
    bpy.data.images.remove(image)
    assert bpy.ops.dyehouse.load_recipe(filepath=str(tmp_path / "r.toml")) == {"FINISHED"}
    assert bpy.data.images["8-bit.png"].dyehouse.regions[0].name == "Shirt"


def test_measured_lights_beside_the_blend(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "lamp.csv").write_text("".join(f"{nm}, {nm / 500}\n" for nm in range(380, 781, 10)))
    bpy.ops.dyehouse.pick_region(image=image.name, pixel=photo.MATTE)
    image.dyehouse.white_source, image.dyehouse.white_illuminant = "ILLUMINANT", "//lamp.csv"
    image.dyehouse.light_source, image.dyehouse.light_illuminant = "ILLUMINANT", "//lamp.csv"
    before = written(image, tmp_path / "ours.png")
    recipe = tmp_path / "r.toml"
    bpy.ops.dyehouse.save_recipe(image=image.name, filepath=str(recipe))
    assert by_command_line(recipe, str(photo.file("8-bit.png")), tmp_path / "cli.png") == before
    image.dyehouse.white_source = "BALANCED"
    assert written(image, tmp_path / "other.png") != before
