"""Blender's images as photos, with OpenImageIO and without, and back."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO
import pytest

from dyehouse.addon import images, session, writing
from dyehouse.batch import files
from dyehouse.batch import photo as photos
from dyehouse.core.colorspace import LINEAR_SRGB, SRGB, space_named
from dyehouse.core.errors import DyehouseError, FileError, ImageError
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

pytestmark = pytest.mark.usefixtures("blender")

KINDS = [
    *("8-bit.png", "8-bit-alpha.png", "8-bit.jpg", "8-bit.tif", "16-bit.png", "16-bit.tif", "16-bit-alpha.png"),
    *("half.exr", "float.exr", "float-alpha.exr", "adobe.jpg", "p3.png", "acescg.exr"),
]


@pytest.fixture
def without_oiio(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Call it to have Blender alone read and write."""
    return lambda: monkeypatch.setattr(images, "reads_files", lambda: False)


def recipe_for(photo: Any) -> Recipe:
    return Recipe((Region(parse_target("lab(42, 10, -35)"), reference=photo.MATTE),))


@pytest.mark.parametrize("kind", KINDS)
def test_blender_alone_reads_the_same_photo(kind: str, photo: Any, without_oiio: Callable[[], None]) -> None:
    image = photo.image(kind)
    expected = images.photo_of(image)
    assert (expected.pixels == files.read(image.filepath).pixels).all()
    without_oiio()
    found = images.photo_of(image)
    assert found.pixels.dtype == expected.pixels.dtype
    assert (found.pixels == expected.pixels).all()
    assert found.space is expected.space
    assert (found.premultiplied, found.assumptions) == (expected.premultiplied, expected.assumptions)


@pytest.mark.parametrize("channels", ["Y", "Y,A", "R,G,B,A"])
@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_blender_alone_reads_gray_and_associated_alpha(
    channels: str, suffix: str, dtype: str, tmp_path: Path, without_oiio: Callable[[], None]
) -> None:
    names = channels.split(",")
    values = np.linspace(0.1, 0.9, 8 * 9 * len(names)).reshape(8, 9, len(names))
    if "A" in names:
        values[..., :-1] *= values[..., -1:]  # a TIFF is associated unless told otherwise
    pixels = np.rint(values * np.iinfo(dtype).max).astype(dtype)
    path = tmp_path / f"photo.{suffix}"
    spec = OpenImageIO.ImageSpec(9, 8, len(names), dtype)
    spec.channelnames, spec.alpha_channel = names, len(names) - 1 if "A" in names else -1
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(pixels)
    output.close()
    expected = files.read(path)
    without_oiio()
    found = images.photo_of(bpy.data.images.load(str(path)))
    assert found.pixels.dtype == dtype
    assert (found.pixels == expected.pixels).all()


@pytest.mark.parametrize("kind", [k for k in KINDS if "jpg" not in k])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr"])
def test_blender_alone_writes_the_same_pixels(
    kind: str, suffix: str, photo: Any, tmp_path: Path, without_oiio: Callable[[], None]
) -> None:
    source = files.read(photo.file(kind))
    prepared = photos.look(source, recipe_for(photo))
    expected, made = tmp_path / f"expected{suffix}", tmp_path / f"made{suffix}"
    writing.save(source, prepared, expected)
    without_oiio()
    if suffix == ".tif" and source.pixels.dtype.kind == "f":
        with pytest.raises(FileError, match="needs OpenImageIO"):
            writing.save(source, prepared, made)
        assert not made.exists()
        return
    bpy.context.scene.view_settings.exposure = 3  # of no concern
    writing.save(source, prepared, made)
    theirs, ours = files.read(expected), files.read(made)
    assert ours.pixels.dtype == theirs.pixels.dtype
    # Color that cannot be seen is lost in 16-bit PNG, which Blender divides by alpha.
    seen = theirs.pixels[..., 3] > 0 if theirs.pixels.shape[2] == 4 and suffix == ".png" else ...
    assert (ours.pixels[seen] == theirs.pixels[seen]).all()
    assert ours.premultiplied == theirs.premultiplied
    assert np.abs(ours.space.to_xyz - theirs.space.to_xyz).max() < 1e-6
    assert ours.metadata.blocks.icc == theirs.metadata.blocks.icc


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".webp"])
def test_blender_alone_keeps_the_same_metadata(
    suffix: str, photo: Any, tmp_path: Path, without_oiio: Callable[[], None]
) -> None:
    told = OpenImageIO.ImageBuf(str(photo.file("adobe.jpg")))
    for name, value in (("Artist", "A. Dyer"), ("IPTC:Caption", "a disk"), ("XResolution", 300), ("YResolution", 300)):
        told.specmod().attribute(name, value)
    assert told.write(str(tmp_path / "told.jpg"))
    image = bpy.data.images.load(str(tmp_path / "told.jpg"))
    image.dyehouse.color_space = "adobe-rgb"
    look = session.look(image, recipe_for(photo))
    writing.save(look.photo, look.prepared, tmp_path / f"expected{suffix}")
    without_oiio()
    session.forget()
    look = session.look(image, recipe_for(photo))
    writing.save(look.photo, look.prepared, tmp_path / f"made{suffix}")
    expected, made = (files.read(tmp_path / f"{name}{suffix}").metadata.blocks for name in ("expected", "made"))
    assert b"A. Dyer" in made.exif
    assert made.icc
    assert made == expected


def test_without_the_openimageio_module_at_all(photo: Any, tmp_path: Path) -> None:
    source, output = photo.file("16-bit.png"), tmp_path / "out.png"
    script = tmp_path / "script.py"
    script.write_text(f"""
import sys
class Hidden:
    def find_spec(self, name, *_):
        if name.split(".")[0] == "OpenImageIO":
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Hidden())
import bpy
from dyehouse import addon
addon.register()
image = bpy.data.images.load({str(source)!r})
asked = dict(image=image.name, reference="22,26", target="lab(42, 10, -35)")
assert bpy.ops.dyehouse.recolor(**asked, output={str(output)!r}) == {{"FINISHED"}}
assert bpy.ops.dyehouse.inspect(**asked) == {{"FINISHED"}}
assert "OpenImageIO" not in sys.modules
addon.unregister()
""")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    expected = photos.recolored(files.read(source), photos.look(files.read(source), recipe_for(photo)), output)[0]
    assert (files.read(output).pixels == expected).all()


# --- images that are in no file, or not any more ---------------------------------------------------------------


def test_packed_images_are_those_of_their_files(photo: Any, without_oiio: Callable[[], None]) -> None:
    for kind in ("8-bit.jpg", "16-bit.png", "half.exr"):
        image = photo.image(kind)
        expected = images.photo_of(image)
        image.pack()
        Path(image.filepath).unlink()
        packed = images.photo_of(image)
        assert (packed.pixels == expected.pixels).all()
        assert (packed.space, str(packed.path)) == (expected.space, image.name)
    without_oiio()
    assert (images.photo_of(image).pixels == expected.pixels).all()


def test_painted_and_generated_images_are_what_blender_holds(photo: Any) -> None:
    image = photo.image()
    before = images.version_of(image)
    pixels = images.pixels_of(image)
    pixels = np.concatenate([np.full_like(pixels[:4], 0.5), pixels[4:]])
    images.set_pixels(image, pixels)
    assert images.version_of(image) != before
    found = images.photo_of(image)
    assert (found.pixels[:4] == 128).all()
    assert (found.pixels[4:, :, :3] == files.read(image.filepath).pixels[4:]).all()
    floats = bpy.data.images.new("floats", 6, 5, float_buffer=True)
    values = np.linspace(-0.1, 3, 6 * 5 * 4, dtype=np.float32).reshape(5, 6, 4)
    values[..., 3] = 1
    images.set_pixels(floats, values)
    assert (images.photo_of(floats).pixels == values[..., :3]).all()
    assert images.photo_of(floats).space is LINEAR_SRGB


def test_a_lost_file_is_told_and_found_again(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    expected = images.photo_of(image).pixels
    path = Path(image.filepath)
    path.rename(tmp_path / "elsewhere.png")
    image.reload()
    for _ in range(2):
        with pytest.raises(ImageError, match="has lost its file"):
            session.look(image, recipe_for(photo))
    image.filepath = str(tmp_path / "elsewhere.png")
    assert (session.look(image, recipe_for(photo)).photo.pixels == expected).all()


def test_a_reloaded_file_is_looked_at_again(photo: Any) -> None:
    image = photo.image()
    first = session.look(image, recipe_for(photo))
    assert session.look(image, recipe_for(photo)).photo is first.photo
    path = Path(image.filepath)
    codes = np.ascontiguousarray(files.read(path).pixels[:, ::-1])
    files.write(path.with_name("flipped.png"), codes, files.Photo(Path(), codes, SRGB))
    path.with_name("flipped.png").replace(path)
    os.utime(path, ns=(1, 1))
    image.reload()
    assert (session.look(image, recipe_for(photo)).photo.pixels == codes).all()


def test_linked_images_are_recolored_but_not_set(photo: Any, tmp_path: Path) -> None:
    photo.image()
    bpy.data.images["8-bit.png"].use_fake_user = True
    bpy.data.images["8-bit.png"].filepath = "//8-bit.png"
    library = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(library))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.images = ["8-bit.png"]
    (image,) = (i for i in bpy.data.images if i.library)
    assert images.file_of(image) == tmp_path / "8-bit.png"
    output = tmp_path / "out.png"
    asked = {"image": image.name, "click": "22,26", "target": "#1F4E79"}
    assert bpy.ops.dyehouse.recolor(**asked, output=str(output)) == {"FINISHED"}
    with pytest.raises(RuntimeError, match=r"linked from 'library\.blend'"):
        bpy.ops.dyehouse.add_region(image=image.name)
    with pytest.raises(RuntimeError, match="source itself"):
        bpy.ops.dyehouse.recolor(**asked, output=str(tmp_path / "8-bit.png"), overwrite=True)


def test_a_renamed_image_keeps_its_settings(photo: Any, tmp_path: Path) -> None:
    image = photo.image()
    bpy.ops.dyehouse.add_region(image=image.name)
    image.dyehouse.regions[0].click, image.dyehouse.regions[0].target.text = photo.MATTE, "#1F4E79"
    image.name, image.use_fake_user = "Ärmel", True
    assert bpy.ops.dyehouse.write_file(image="Ärmel", filepath=str(tmp_path / "out.png")) == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    settings = bpy.data.images["Ärmel"].dyehouse
    assert settings.regions[0].target.text == "#1F4E79"
    bpy.data.images.remove(bpy.data.images["Ärmel"])
    with pytest.raises(RuntimeError, match="no image 'Ärmel'"):
        bpy.ops.dyehouse.write_file(image="Ärmel", filepath=str(tmp_path / "out.png"))


@pytest.mark.parametrize(("source", "words"), [("TILED", "UDIM"), ("MOVIE", "movie"), ("SEQUENCE", "sequence")])
def test_what_is_no_photo_is_told(source: str, words: str, photo: Any) -> None:
    image = photo.image()
    image.source = source
    with pytest.raises(DyehouseError, match=words):
        images.photo_of(image)


def test_a_space_that_blender_does_not_know_becomes_light(photo: Any) -> None:
    codes = np.full((4, 5, 3), (200, 90, 40), np.uint8)
    image = images.new_image("prophoto", codes, space_named("prophoto"), premultiplied=False)
    assert image.is_float
    xyz = space_named("prophoto").to_xyz @ space_named("prophoto").curve.decode(codes[0, 0] / 255)
    held = images.pixels_of(image)[0, 0, :3]
    from dyehouse.core import colorimetry

    adapt = colorimetry.adaptation_matrix(space_named("prophoto").white, LINEAR_SRGB.white, "bradford")
    assert np.abs(LINEAR_SRGB.from_xyz @ adapt @ xyz - held).max() < 1e-4
