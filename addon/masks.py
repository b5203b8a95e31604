"""What a region of the panel covers: its mask from whatever Blender has."""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import images

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..core.polygons import Layer
    from .properties import DyehouseRegion

# Masks that the core makes from the photo itself.
_OF_THE_PHOTO = {"WHOLE": None, "CLICK": "click", "ALPHA": "alpha"}


@dataclass(frozen=True)
class Source:
    """A mask that is not made from the photo.

    Attributes
    ----------
    version
        Changes whenever the mask does; None if it is not known yet, see `images.version_of`.
    load
        Called with the photo's (height, width), gives a function that gives the coverage, as
        `batch.files.read_mask` has it. Only the first call touches Blender; it raises a DyehouseError if there is
        nothing to load.
    file
        The file that holds exactly this coverage, if there is one.
    upright
        Whether that file is for the upright photo, and not for one that lies as it is stored.
    """

    version: tuple[object, ...] | None
    load: "Callable[[tuple[int, int]], Callable[[], NDArray]]"
    file: Path | None = None
    upright: bool = False


def asked(region: "DyehouseRegion", index: int) -> str | None:
    """Return the mask of a core region: its name there, which `sources` explains if it is Blender's."""
    if region.mask_source in _OF_THE_PHOTO:
        return _OF_THE_PHOTO[region.mask_source]
    return f"blender:{index}"


def sources(image: bpy.types.Image, hurry: bool = False, indices: Sequence[int] | None = None) -> dict[str, Source]:
    """The masks of an image's regions that are not made from the photo, by the names that `asked` gives them.

    Parameters
    ----------
    image
        The photo.
    hurry
        As for `images.version_of`.
    indices
        Of the regions; None for all.

    Raises
    ------
    MaskError
        If a region has none.
    """
    regions = image.dyehouse.regions
    wanted = [(k, regions[k]) for k in (range(len(regions)) if indices is None else indices)]
    return {f"blender:{k}": _source(region, hurry) for k, region in wanted if region.mask_source not in _OF_THE_PHOTO}


def missing(region: "DyehouseRegion") -> str:
    """What a region's mask still needs, in a sentence; empty if nothing."""
    given = {
        "IMAGE": {"mask image": region.mask_image},
        "SPLINE": {"spline mask": region.mask_spline},
        "FILE": {"mask file": region.mask_file},
        "CRYPTOMATTE": {"cryptomatte file": _matte_file(region), "names of objects or materials": region.matte_names},
    }
    for what, value in given.get(region.mask_source, {}).items():
        if not value:
            return f"Region '{region.name}' has no {what}: choose one, or click the product instead."
    return ""


def _source(region: "DyehouseRegion", hurry: bool) -> Source:
    from ..core.errors import MaskError

    if problem := missing(region):
        raise MaskError(problem)
    kind, library = region.mask_source, region.id_data.library
    if kind == "IMAGE":
        return of_image(region.mask_image, hurry)
    if kind == "SPLINE":
        return of_spline(region.mask_spline)
    if kind == "FILE":
        path = Path(bpy.path.abspath(region.mask_file, library=library))
        return of_file(path, images.orientation_of(region.id_data))
    path = Path(bpy.path.abspath(_matte_file(region), library=library))
    return of_matte(path, region.matte_names, region.matte_layer)


def _matte_file(region: "DyehouseRegion") -> str:
    return region.matte_file or getattr(region.id_data, "filepath", "")


def of_image(image: bpy.types.Image, hurry: bool = False) -> Source:
    """The mask that an image is: white where the product is."""
    file = images.file_of(image)

    def load(shape: tuple[int, int]) -> "Callable[[], NDArray]":
        found = images.coverage_loader(image, shape)
        return found if file else lambda: in_sixteen_bits(found())

    return Source(images.version_of(image, hurry), load, file)


def of_file(path: Path, orientation: int = 1) -> Source:
    """The mask in a file, for a photo that lies with an EXIF orientation; masks in files are of the upright one."""

    def load(shape: tuple[int, int]) -> "Callable[[], NDArray]":
        from ..batch import files

        found = images.mask_file_loader(path, shape if orientation < 5 else shape[::-1])
        return lambda: files.turned(found(), orientation, back=True)

    return Source((*_version(path), orientation), load, path, upright=True)


def _version(path: Path) -> tuple[object, ...]:
    state = path.stat() if path.is_file() else None
    return str(path), state and state.st_mtime_ns, state and state.st_size


# --- splines --------------------------------------------------------------------------------------------------


def of_spline(mask: bpy.types.Mask) -> Source:
    """A mask of Blender's mask editor, as it is in the current frame, without feather and unfilled splines."""
    layers = [_layer(layer) for layer in mask.layers if not layer.hide_render]

    def load(shape: tuple[int, int]) -> "Callable[[], NDArray]":
        return lambda: _filled(layers, shape)

    return Source(tuple((settings, *(curve.tobytes() for curve, _ in curves)) for settings, curves in layers), load)


def _layer(layer: Any) -> "tuple[tuple[Any, ...], list[tuple[NDArray, bool]]]":
    """Settings of a mask layer, and the points of its splines: (n, 3, 2) in mask space, and whether it is closed."""
    import numpy as np

    curves = [
        (np.array([(p.handle_left, p.co, p.handle_right) for p in spline.points]), bool(spline.use_cyclic))
        for spline in layer.splines
        if spline.use_fill and len(spline.points) > 1
    ]
    # What the two solvers of Blender make of overlapping outlines.
    holes = "evenodd" if layer.fill_solver == "SWEEP_LINE" else "nonzero"
    rule = holes if layer.use_fill_holes else "union"
    return (rule, layer.alpha, layer.invert, layer.blend), curves


def _filled(layers: list, shape: tuple[int, int]) -> "NDArray[np.uint8]":
    from ..core.polygons import Layer, bezier, rasterize

    def made(settings: tuple[Any, ...], curves: list) -> "Layer":
        rule, opacity, inverted, blend = settings
        outlines = tuple(bezier(_in_pixels(curve, shape), closed) for curve, closed in curves)
        return Layer(outlines, rule, opacity, inverted, blend)

    return rasterize([made(*layer) for layer in layers], shape)


def _in_pixels(points: "NDArray", shape: tuple[int, int]) -> "NDArray":
    """Mask space is a square around the picture, y up; the shorter side of the picture lies in its middle."""
    height, width = shape
    side = max(height, width)
    return (points - 0.5) * (side, -side) + (width / 2, height / 2)


# --- cryptomatte ----------------------------------------------------------------------------------------------


def of_matte(path: Path, names: str, layer: str = "") -> Source:
    """What objects or materials of a render cover, from its cryptomatte passes.

    Parameters
    ----------
    path
        The render.
    names
        Separated by commas.
    layer
        Such as "ViewLayer.CryptoObject"; empty for the first that has the names.
    """
    wanted = [name.strip() for name in names.split(",") if name.strip()]

    def load(shape: tuple[int, int]) -> "Callable[[], NDArray]":
        if images.reads_files():
            return lambda: _matte(path, wanted, layer, shape)
        covered = _composited(path, wanted, layer, shape)
        return lambda: covered

    return Source((*_version(path), names, layer), load)


def _matte(path: Path, names: list[str], layer: str, shape: tuple[int, int]) -> "NDArray[np.float32]":
    from ..batch import cryptomatte
    from ..core.errors import MaskError

    covered = cryptomatte.matte(path, names, layer)
    if covered.shape != shape:
        raise MaskError(
            f"The cryptomatte '{path}' is {covered.shape[1]} x {covered.shape[0]} pixels and the photo "
            f"{shape[1]} x {shape[0]}: take the one of the same render."
        )
    return in_sixteen_bits(covered)


def in_sixteen_bits(coverage: "NDArray") -> "NDArray":
    """Coverage that a 16-bit file of it holds exactly, so that a saved recipe gives the same pixels."""
    import numpy as np

    if coverage.dtype == np.uint8:
        return coverage
    return np.rint(coverage * np.float32(65535)).astype(np.uint16).astype(np.float32) / np.float32(65535)


def _composited(path: Path, names: list[str], layer: str, shape: tuple[int, int]) -> "NDArray[np.float32]":
    """The same without OpenImageIO: Blender's compositor has a node for it, whose result must go through a file."""
    from ..batch import cryptomatte, exr
    from ..core.errors import FileError

    if not path.is_file():
        raise FileError(f"'{path}' does not exist: give the file of a render with cryptomatte passes.")
    header = exr.Header(path)
    found = cryptomatte.told_names({name: header.getattribute(name) for name in header.attributes}, path)
    layer = cryptomatte.chosen(found, names, layer, path)
    scene = bpy.data.scenes.new("Dyehouse")
    tree = bpy.data.node_groups.new("Dyehouse", "CompositorNodeTree")
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        _compose(scene, tree, image, layer, ", ".join(names))
        return in_sixteen_bits(_rendered(scene, shape))
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.node_groups.remove(tree)
        bpy.data.images.remove(image)


def _compose(scene: Any, tree: Any, image: bpy.types.Image, layer: str, names: str) -> None:
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    scene.compositing_node_group = tree
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.image = "IMAGE", image
    node.layer_name, node.matte_id = layer, names
    tree.links.new(node.outputs["Matte"], tree.nodes.new("NodeGroupOutput").inputs[0])


def _rendered(scene: Any, shape: tuple[int, int]) -> "NDArray[np.float32]":
    """What the compositor of a scene makes, (height, width)."""
    settings = scene.render.image_settings
    settings.media_type, settings.file_format = "IMAGE", "OPEN_EXR"
    settings.color_depth, settings.color_mode = "32", "RGB"
    scene.render.resolution_y, scene.render.resolution_x = shape
    scene.render.resolution_percentage, scene.render.use_file_extension = 100, False
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "matte.exr")
        bpy.ops.render.render(write_still=True, scene=scene.name)
        return images.file_loader(Path(scene.render.filepath), None)().pixels[..., 0]
