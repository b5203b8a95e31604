"""Picked colors survive another working space, undo, and the .blend on disk."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from dyehouse.addon import recipes
from dyehouse.core.colorimetry import linear_to_lab
from dyehouse.core.colorspace import LINEAR_SRGB
from dyehouse.core.recipe import Recipe

pytestmark = pytest.mark.usefixtures("blender")


def set_up(image: bpy.types.Image, photo: Any) -> None:
    bpy.ops.dyehouse.add_region(image=image.name)
    region = image.dyehouse.regions[0]
    region.click, region.target.color = photo.MATTE, (0.8, 0.1, 0.05)
    region.reference_source, region.reference_color = "COLOR", (0.3, 0.1, 0.1)
    bpy.ops.dyehouse.add_colorway(image=image.name, name="picked")
    bpy.ops.dyehouse.add_colorway(image=image.name, name="typed")
    region.target.text = "#AA2211"
    image.use_fake_user = True


def meant(recipe: Recipe) -> np.ndarray:
    swatches = [recipe.regions[0].target, *(colorway.targets[0] for colorway in recipe.colorways)]
    labs = [linear_to_lab(swatch.to_linear(LINEAR_SRGB, adaptation="bradford"), LINEAR_SRGB) for swatch in swatches]
    return np.array([*labs, np.array(recipe.regions[0].reference) * 100])


@pytest.mark.parametrize("space", ["ACEScg", "Linear Rec.2020"])
def test_another_working_space_keeps_the_colors(space: str, photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    set_up(image, photo)
    before = meant(recipes.recipe_of(image))
    button = tuple(image.dyehouse.colorways[0].targets[0].color)
    bpy.ops.wm.set_working_color_space(working_space=space, convert_colors=True)
    image = bpy.data.images["8-bit.png"]
    assert np.abs(meant(recipes.recipe_of(image)) - before).max() < 0.01
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    image = bpy.data.images["8-bit.png"]
    assert image.dyehouse.colors_in == space
    assert tuple(image.dyehouse.colorways[0].targets[0].color) != button
    assert np.abs(meant(recipes.recipe_of(image)) - before).max() < 0.01
    bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709", convert_colors=True)
    image = bpy.data.images["8-bit.png"]
    image.dyehouse.white_color = (1, 1, 1)  # whatever is picked next
    assert tuple(image.dyehouse.colorways[0].targets[0].color) == pytest.approx(button, abs=1e-5)
    assert np.abs(meant(recipes.recipe_of(image)) - before).max() < 0.01
