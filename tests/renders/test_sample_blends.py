"""The sample scenes open with the add-on's panel ready to use, and a user's own scene can be measured like them."""

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse import addon, sample_blends
from dyehouse.addon import session
from dyehouse.benchmarks import laboratory
from dyehouse.core import transfer
from dyehouse.sample_blends import make_scenes

BLENDS = Path(sample_blends.__file__).parent
QUICK = laboratory.Settings(size=64, samples=24)


@pytest.fixture(scope="module", autouse=True)
def _addon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    addon.register()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYEHOUSE_CACHE", str(tmp_path_factory.mktemp("renders")))
        yield
    addon.unregister()
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.mark.parametrize("name", make_scenes.SCENES)
def test_the_panel_is_ready_to_use(name: str) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(BLENDS / f"{name}.blend"))
    photo = bpy.data.images["Photo"]
    assert bpy.data.scenes[0]["product"] == photo.dyehouse.regions[0].name
    assert photo.dyehouse.preview
    shown = [a.spaces.active.image for a in bpy.context.screen.areas if a.type == "IMAGE_EDITOR"]
    assert photo in shown
    look = session.look(photo)
    found = look.prepared.analyses[0]
    x, y = found.pixel
    assert found.mask[y, x] == 255
    # The reference is of the product's own color: the white is that of the picture, which a wrong one would tilt.
    assert np.ptp(look.photo.pixels[found.mask == 255], axis=0).max() > 20
    (first,) = look.prepared.regions()[:1]
    # The body color becomes the target, within a code: the models with maps are fits.
    recolored = transfer.encode(first.matrix[:, :3] @ found.reference, transfer.SRGB, np.uint8).astype(int)
    asked = transfer.encode(look.prepared.target(0), transfer.SRGB, np.uint8)
    assert np.abs(recolored - asked).max() <= 1
    paths = [image.filepath for image in bpy.data.images if image.packed_file]
    assert len(paths) >= 2
    assert all(path.startswith("//") for path in paths)


def test_a_scene_of_ones_own_is_rendered_by_its_path(tmp_path: Path) -> None:
    make_scenes.build("mug")
    own = tmp_path / "own cup.blend"
    make_scenes.save(own)
    dye = (0.061, 0.296, 0.067)
    ours = laboratory.render("mug", dye, settings=QUICK)
    assert np.array_equal(laboratory.render(str(own), dye, settings=QUICK), ours)
    assert len(list(laboratory.cache_folder().glob("own cup-*.npz"))) == 1
    assert np.array_equal(laboratory.view(str(own), QUICK).mask, laboratory.view("mug", QUICK).mask)


def test_a_scene_that_lacks_what_is_needed_is_refused(tmp_path: Path) -> None:
    scene = make_scenes.build("mug")
    del scene["reference_x"]
    own = tmp_path / "lacking.blend"
    make_scenes.save(own)
    with pytest.raises(ValueError, match="no scene property reference_x"):
        laboratory.view(str(own), QUICK)
