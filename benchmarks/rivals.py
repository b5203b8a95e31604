"""Other ways to put a product into another color, done as fairly as they can be.

Every rival takes a `Task` and returns the whole picture with the region recolored. All of them know the region
exactly. What else they are given is theirs to use: those that shift hue and saturation, and Blender's nodes, are set so
that the reference pixel meets the target exactly; those that match statistics see the true picture of the target, of
which the dichromatic model sees one pixel.

- Reinhard et al., "Color transfer between images", IEEE Comput. Graphics Appl. 21 (5), 34-41 (2001). As Xin & Shen
  used it: the object only, its mean moved, the mean taken where there is no highlight; and with the spread matched
  too, as the original does.
- color-matcher (Hahne), the package, with its default settings; of the group `bench`.
- Hue, saturation and value shifted in display codes, as a photo editor does.
- Blender's nodes Hue/Saturation and Mix Color, in linear light as Blender has them; `through_blender` runs the nodes
  themselves, and a test holds the formulas here to them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..core import dichromatic, transfer

COLOR_MATCHER = ("reinhard", "mkl", "mvgd", "hm", "hm-mkl-hm", "hm-mvgd-hm")
"""Methods of color-matcher; its "default" is "mkl"."""

_LARGEST_GLOSS = 0.02
"""Surface reflection, in parts of the white, from which a pixel counts as highlight when means are taken."""


@dataclass(frozen=True, eq=False)
class Task:
    """One picture, and the color its product shall have.

    Attributes
    ----------
    picture
        (H, W, 3) scene-linear RGB.
    region
        (H, W) bool: the product.
    reference, target
        (3,) linear RGB that the reference pixel has and shall have.
    example
        (H, W, 3) linear RGB of the product truly in the target color, for methods that match a picture.
    white
        (3,) linear RGB of a white diffuser.
    """

    picture: NDArray
    region: NDArray[np.bool_]
    reference: NDArray
    target: NDArray
    example: NDArray
    white: NDArray

    def with_pixels(self, pixels: NDArray) -> NDArray[np.float64]:
        """Return the picture with others in the region's place."""
        done = np.array(self.picture, np.float64)
        done[self.region] = pixels
        return done

    def matte(self) -> NDArray[np.bool_]:
        """(H, W): the region without highlights, which the paper's authors chose by hand."""
        _, gloss = dichromatic.fit(self.picture, self.reference, self.white)
        return self.region & (gloss < _LARGEST_GLOSS)


# --- Reinhard et al. --------------------------------------------------------------------------------------
_LMS = np.array([[0.3811, 0.5783, 0.0402], [0.1967, 0.7244, 0.0782], [0.0241, 0.1288, 0.8444]])
"""Linear RGB to LMS, Eq. (4) of Reinhard et al."""

_OPPONENT = np.diag(1 / np.sqrt([3.0, 6.0, 2.0])) @ np.array([[1.0, 1, 1], [1, 1, -2], [1, -1, 0]])
"""Logarithm of LMS to l, alpha, beta, Eq. (6)."""


def to_lab(rgb: NDArray) -> NDArray[np.float64]:
    """Linear RGB (..., 3) to Ruderman's l, alpha, beta; nothing is darker than 1e-4."""
    return np.log10(np.maximum(rgb @ _LMS.T, 1e-4)) @ _OPPONENT.T


def from_lab(lab: NDArray) -> NDArray[np.float64]:
    """Invert `to_lab`."""
    return 10 ** (lab @ np.linalg.inv(_OPPONENT).T) @ np.linalg.inv(_LMS).T


def reinhard(task: Task, spread: bool = False) -> NDArray[np.float64]:
    """Transfer the color of the true picture's object in l, alpha, beta.

    This is done in linear light, as those axes were derived; in display codes it is worse on plastic.

    Parameters
    ----------
    task
        What to do.
    spread
        Match the standard deviations also, Eq. (11) of Reinhard et al.; Xin & Shen moved the mean only.
    """
    matte = task.matte()
    old, new = to_lab(task.picture[matte]), to_lab(task.example[matte])
    factor = new.std(axis=0) / old.std(axis=0) if spread else 1.0
    return task.with_pixels(
        from_lab((to_lab(task.picture[task.region]) - old.mean(axis=0)) * factor + new.mean(axis=0))
    )


# --- Hue, saturation, value -------------------------------------------------------------------------------
def to_hsv(rgb: NDArray) -> NDArray[np.float64]:
    """RGB (..., 3) to hue 0..1, saturation, value; channels below zero count as zero."""
    rgb = np.maximum(rgb, 0.0)
    value, low = rgb.max(axis=-1), rgb.min(axis=-1)
    chroma = value - low
    r, g, b = np.moveaxis(rgb, -1, 0)
    safe = np.where(chroma > 0, chroma, 1.0)
    hue = np.select(
        [chroma <= 0, value == r, value == g], [0.0, (g - b) / safe % 6, (b - r) / safe + 2], (r - g) / safe + 4
    )
    return np.stack([hue / 6, np.where(value > 0, chroma / np.where(value > 0, value, 1.0), 0.0), value], axis=-1)


def from_hsv(hsv: NDArray) -> NDArray[np.float64]:
    """Invert `to_hsv`."""
    hue, saturation, value = np.moveaxis(hsv, -1, 0)[..., None]
    # Distance of the hue from red, green, blue in sixths of the circle: full up to 1, none from 2 on.
    away = np.abs((hue * 6 - [0, 2, 4] + 3) % 6 - 3)
    return value * (1 - saturation * (1 - np.clip(2 - away, 0, 1)))


def shift_hsv(rgb: NDArray, hue: float, saturation: float, value: float, most: float = np.inf) -> NDArray[np.float64]:
    """Turn the hue by a part of the circle, multiply saturation and value.

    Blender lets saturation grow beyond 1 and then cuts channels below zero; photo editors stop at `most` 1.
    """
    h, s, v = np.moveaxis(to_hsv(rgb), -1, 0)
    return np.maximum(from_hsv(np.stack([(h + hue) % 1, np.minimum(s * saturation, most), v * value], axis=-1)), 0)


def hsv_setting(reference: NDArray, target: NDArray) -> tuple[float, float, float]:
    """Hue, saturation and value for `shift_hsv` that turn one color into another."""
    old, new = to_hsv(reference), to_hsv(target)
    return float((new[0] - old[0]) % 1), float(new[1] / old[1]), float(new[2] / old[2])


def _codes(linear: NDArray) -> NDArray[np.float64]:
    return transfer.SRGB.encode(np.clip(np.asarray(linear, np.float64), 0.0, 1.0))


def _light(codes: NDArray) -> NDArray[np.float64]:
    return transfer.SRGB.decode(np.clip(codes, 0.0, 1.0))


def hue_shift(task: Task) -> NDArray[np.float64]:
    """Shift hue, saturation and value in display codes, as a photo editor does."""
    setting = hsv_setting(_codes(task.reference), _codes(task.target))
    return task.with_pixels(_light(shift_hsv(_codes(task.picture[task.region]), *setting, most=1.0)))


# --- Blender's nodes --------------------------------------------------------------------------------------
def blender_hue_saturation(task: Task) -> NDArray[np.float64]:
    """Apply the node Hue/Saturation/Value, set so that the reference meets the target."""
    return task.with_pixels(shift_hsv(task.picture[task.region], *hsv_setting(task.reference, task.target)))


def mix_color(rgb: NDArray, color: NDArray) -> NDArray[np.float64]:
    """Blend mode Color: hue and saturation of `color`, value of the picture."""
    hue, saturation, _ = to_hsv(color)
    value = to_hsv(rgb)[..., 2]
    return from_hsv(np.stack([np.full_like(value, hue), np.full_like(value, saturation), value], axis=-1))


def blender_mix_color(task: Task) -> NDArray[np.float64]:
    """Apply the node Mix Color in mode Color, and a gain so that the reference meets the target."""
    gain = task.target.max() / task.reference.max()
    return task.with_pixels(mix_color(task.picture[task.region], task.target) * gain)


def blender_mix_multiply(task: Task) -> NDArray[np.float64]:
    """Apply the node Mix Color in mode Multiply, by the color that takes the reference to the target."""
    return task.with_pixels(task.picture[task.region] * (task.target / task.reference))


def through_blender(picture: NDArray, kind: str, **inputs: object) -> NDArray[np.float32]:
    """Run a picture through a node of Blender's compositor.

    Parameters
    ----------
    picture
        (H, W, 3) linear RGB.
    kind
        "hue_saturation", or a blend mode of Mix Color in small letters ("color", "multiply").
    inputs
        Values of the node's inputs by name, spaces as _: Hue, Saturation, Value; or B for the color to mix with.

    Returns
    -------
    (H, W, 3) float32.
    """
    import bpy
    import OpenImageIO

    height, width = picture.shape[:2]
    scene = bpy.data.scenes.new("Rival")  # beside the open scene, which the laboratory may be using
    tree = bpy.data.node_groups.new("Rival", "CompositorNodeTree")
    image = bpy.data.images.new("Rival", width, height, alpha=True, float_buffer=True)
    try:
        pixels = np.ones((height, width, 4), np.float32)
        pixels[..., :3] = picture[::-1]
        image.pixels.foreach_set(pixels.ravel())
        image.update_tag()
        source = tree.nodes.new("CompositorNodeImage")
        source.image = image
        if kind == "hue_saturation":
            node = tree.nodes.new("CompositorNodeHueSat")
            sockets, result = {s.name: s for s in node.inputs}, node.outputs[0]
            entry = sockets["Image"]
        else:
            node = tree.nodes.new("ShaderNodeMix")
            node.data_type, node.blend_type = "RGBA", kind.upper()
            sockets = {s.name: s for s in node.inputs if s.enabled}
            sockets["Factor"].default_value = 1.0
            entry, result = sockets["A"], next(s for s in node.outputs if s.enabled)
        for name, value in inputs.items():
            sockets[name].default_value = value
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.links.new(source.outputs["Image"], entry)
        tree.links.new(result, tree.nodes.new("NodeGroupOutput").inputs[0])
        scene.compositing_node_group = tree
        r = scene.render
        r.compositor_device, r.compositor_precision = "CPU", "FULL"
        r.resolution_x, r.resolution_y, r.resolution_percentage = width, height, 100
        settings = r.image_settings
        settings.media_type, settings.file_format = "IMAGE", "OPEN_EXR"
        settings.color_depth, settings.color_mode = "32", "RGBA"
        with tempfile.TemporaryDirectory() as folder:
            r.filepath = str(Path(folder) / "out.exr")
            bpy.ops.render.render(write_still=True, scene=scene.name)
            done = OpenImageIO.ImageBuf(r.filepath).get_pixels("float")
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.node_groups.remove(tree)
        bpy.data.images.remove(image)
    return np.asarray(done, np.float32)[..., :3]


# --- color-matcher ----------------------------------------------------------------------------------------
def color_matcher(task: Task, method: str) -> NDArray[np.float64]:
    """Match the object's display codes to those of the true picture with the package color-matcher.

    Parameters
    ----------
    task
        What to do.
    method
        One of `COLOR_MATCHER`.
    """
    from color_matcher import ColorMatcher

    old, new = (_codes(picture[task.region])[:, None, :] for picture in (task.picture, task.example))
    matched = ColorMatcher(src=old, ref=new, method=method).main()
    return task.with_pixels(_light(np.real(matched).reshape(-1, 3)))


type Rival = Callable[[Task], NDArray[np.float64]]

PLAIN: dict[str, Rival] = {
    "Reinhard, mean": reinhard,
    "Reinhard, mean and spread": lambda task: reinhard(task, spread=True),
    "hue shift (display codes)": hue_shift,
    "Blender Hue/Saturation": blender_hue_saturation,
    "Blender Mix Color": blender_mix_color,
    "Blender Mix Multiply": blender_mix_multiply,
}
"""Rivals that need nothing but this package, by name."""

PACKAGED: dict[str, Rival] = {
    f"color-matcher {method}": lambda task, method=method: color_matcher(task, method)  # type: ignore[misc]
    for method in COLOR_MATCHER
}
"""Rivals that need color-matcher, by name."""

RIVALS = PLAIN | PACKAGED
