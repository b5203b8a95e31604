"""What makes a sample scene ready for the add-on's panel: a picture of it, its masks, and the settings for it.

The pictures are the laboratory's renders, packed into the .blend as 8-bit PNG, so that opening the file shows the
product in the Image Editor with its region, reference and white set and a target to play with.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from ..benchmarks import laboratory
from ..core import transfer

SIZE = 256
_TARGET = (0.02, 0.13, 0.30)
_BRIGHTEST = 0.8
_RENDER = laboratory.Settings(size=SIZE, samples=128)


def take(scene: str) -> tuple[NDArray[np.float32], laboratory.View]:
    """Picture of a scene in its own color, exposed so that the reference is not clipped, and what is known of it."""
    view = laboratory.view(scene, _RENDER)
    picture = laboratory.render(scene, view.dye, settings=_RENDER)
    x, y = view.reference
    return picture * min(1.0, _BRIGHTEST / float(picture[y, x].max())), view


def add(scene: bpy.types.Scene, picture: NDArray[np.float32], view: laboratory.View) -> None:
    """Pack the picture and its masks into the open file, with the panel's settings, shown in an Image Editor.

    Parameters
    ----------
    scene
        The open scene.
    picture, view
        From `take`.
    """
    photo = _packed("Photo", transfer.encode(picture, transfer.SRGB, np.uint8))
    asked = photo.dyehouse
    asked.white_source = "COLOR"
    asked.white_color = view.white()
    wanted = [scene["product"], *(name.title() for name in view.colors if name.title() in view.masks)]
    masks = {
        name: _packed(f"{name} Mask", np.round(view.masks[name][..., None] * 255).astype(np.uint8)) for name in wanted
    }
    _add_regions(asked, masks, view.reference)
    asked.preview = True
    asked.view = "SPLIT"
    _show(photo)


def _add_regions(asked: bpy.types.PropertyGroup, masks: Mapping[str, bpy.types.Image], at: tuple[int, int]) -> None:
    for number, (name, mask) in enumerate(masks.items()):
        region = asked.regions.add()
        region.name, region.mask_source, region.mask_image = name, "IMAGE", mask
        region.target.color = _TARGET
        if number == 0:
            region.reference_source, region.reference = "PIXEL", at
        else:
            region.target.used = False


def _packed(name: str, codes: NDArray[np.uint8]) -> bpy.types.Image:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.png"
        buffer = OpenImageIO.ImageBuf(np.ascontiguousarray(codes))
        buffer.write(str(path))
        image = bpy.data.images.load(str(path))
        if codes.shape[2] == 1:
            image.colorspace_settings.name = "Non-Color"
        image.pack()
    image.name, image.use_fake_user = name, True
    image.filepath_raw = f"//{name}.png"
    for packed in image.packed_files:
        packed.filepath = image.filepath_raw
    return image


def _show(photo: bpy.types.Image) -> None:
    """Turn the largest area of the first workspace's screen into an Image Editor with the sidebar open."""
    area = max(bpy.context.screen.areas, key=lambda each: each.width * each.height)
    area.type = "IMAGE_EDITOR"
    space = area.spaces.active
    space.image, space.show_region_ui = photo, True
