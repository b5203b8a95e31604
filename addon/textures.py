"""Textures as photos, tile by tile, and back to images.

A texture means what Blender's setting for it says, as the renderer has it, whatever its file tells. UDIM tiles are
photos of one product: white, reference and model are found in one of them and hold for all.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..batch import files
from ..batch import photo as photos
from ..batch.files import Photo
from ..core.analysis import Analysis
from ..core.colorspace import LINEAR_SRGB, SPACES, SRGB, RGBSpace
from ..core.compositing import Edge
from ..core.errors import DyehouseError, FileError, ImageError, MaskError
from ..core.picture import Picture, as_mask, as_weights
from ..core.recipe import Prepared, Recipe
from ..core.recolor import Recoloring, RegionMatrix
from . import images, nodes

FIRST_TILE = 1001


def space_of(image: bpy.types.Image) -> str:
    """Name of the texture's RGB space, a key of `core.colorspace.SPACES`.

    Raises
    ------
    ImageError
        If it holds no color, or in a space that is not known.
    """
    told = image.colorspace_settings.name
    if told == "Non-Color":
        raise ImageError(
            f"Image '{image.name}' is Non-Color data such as a normal map: choose the base color texture, or set the "
            "image's color space."
        )
    if told not in images.SPACE_NAMES:
        known = ", ".join(images.SPACE_NAMES)
        raise ImageError(f"Image '{image.name}' has the color space '{told}': convert it to one of {known}.")
    return images.SPACE_NAMES[told]


def loaders(image: bpy.types.Image, folder: Path, name: str | None) -> dict[int, Callable[[], Photo]]:
    """Functions that give the texture's tiles as photos, by tile number; only this call touches Blender.

    Parameters
    ----------
    image
        The texture; without tiles, its picture counts as tile 1001.
    folder
        For tiles that Blender alone holds; must last until the functions are called.
    name
        What the pixels mean, a key of `core.colorspace.SPACES`; None for masks, where it does not matter.

    Raises
    ------
    ImageError
        If the image has no pixels.
    """
    if image.source != "TILED":
        path = images.file_of(image) or _unpacked(image, folder).get(FIRST_TILE)
        images.shape_of(image)
        return {FIRST_TILE: images.file_loader(path, name) if path else images.loader(image)}
    paths = _unpacked(image, folder) or _tile_files(image) or _saved(image, folder)
    return {number: images.file_loader(path, name) for number, path in sorted(paths.items())}


def _unpacked(image: bpy.types.Image, folder: Path) -> dict[int, Path]:
    """Files of the image's packed tiles; none if it is not packed, or was painted on since."""
    found: dict[int, Path] = {}
    if image.is_dirty or not image.packed_file:
        return found
    for packed in image.packed_files:
        number = packed.tile_number if image.source == "TILED" else FIRST_TILE
        found[number] = folder / f"{image.session_uid}.{number}{Path(packed.filepath or image.name).suffix}"
        found[number].write_bytes(packed.packed_file.data)
    return found


def _tile_files(image: bpy.types.Image) -> dict[int, Path]:
    """Files of the image's tiles; none if it was painted on since they were written."""
    if image.is_dirty or not image.filepath:
        return {}
    pattern = bpy.path.abspath(image.filepath, library=image.library)
    found = {tile.number: Path(tile_path(pattern, tile.number)) for tile in image.tiles}
    for path in found.values():
        if not path.is_file():
            raise ImageError(f"Image '{image.name}' has lost its file '{path}': find it with File > External Data.")
    return found


def tile_path(pattern: str, number: int) -> str:
    """Fill the <UDIM> or <UVTILE> of a file name in."""
    u, v = (number - 1001) % 10 + 1, (number - 1001) // 10 + 1
    return pattern.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{u}_v{v}")


def _saved(image: bpy.types.Image, folder: Path) -> dict[int, Path]:
    """Tiles that were generated or painted on, saved: their pixels cannot be read otherwise."""
    path, kind = image.filepath_raw, image.file_format
    suffix, image.file_format = (".exr", "OPEN_EXR") if image.is_float else (".png", "PNG")
    pattern = str(folder / f"{image.session_uid}.<UDIM>{suffix}")
    try:
        with bpy.context.temp_override(edit_image=image):
            bpy.ops.image.save_as(filepath=pattern, copy=True, save_as_render=False, check_existing=False)
    except RuntimeError:
        raise ImageError(f"Image '{image.name}' has tiles without pixels: fill or load them first.") from None
    finally:
        image.filepath_raw, image.file_format = path, kind
    return {tile.number: Path(tile_path(pattern, tile.number)) for tile in image.tiles}


class _Opened:
    """The tiles of a texture, opened to be recolored.

    Only the constructors and `close` touch Blender; the rest may run in another thread.
    """

    def __init__(self, image: bpy.types.Image) -> None:
        self.name, self.tiled, self.space = image.name, image.source == "TILED", space_of(image)
        self._folder = tempfile.TemporaryDirectory(prefix="dyehouse-")
        self.folder = Path(self._folder.name)
        try:
            self._photos = loaders(image, self.folder, self.space)
        except DyehouseError:
            self.close()
            raise

    @property
    def tiles(self) -> list[int]:
        """Numbers of the tiles."""
        return list(self._photos)

    def check(self, output: Path) -> None:
        """Check that the tiles can be written to files, before any work is done.

        Raises
        ------
        FileError
            If they cannot be.
        """
        _places(self.tiles, output, self.tiled)

    def close(self) -> None:
        """Remove the temporary files."""
        self._folder.cleanup()

    def bake(self, watch: Callable[[float], None] = lambda share: None) -> dict[int, Baked]:
        """Recolor every tile.

        Parameters
        ----------
        watch
            Called now and then with the share that is done, 0 to 1; what it raises stops the work.
        """
        found = {}
        for k, number in enumerate(self.tiles):
            watch(k / len(self.tiles))
            found[number] = self._bake_tile(number, partial(self._watch_tile, watch, k))
        return found

    def _watch_tile(self, watch: Callable[[float], None], k: int, share: float) -> None:
        """Tell how far all is from how far a tile is; a third of its time was gone before."""
        watch((k + 0.3 + 0.7 * share) / len(self.tiles))

    def _bake_tile(self, number: int, watch: Callable[[float], None]) -> Baked:
        raise NotImplementedError

    def _path(self, number: int, photo: Photo) -> Path:
        return self.folder / f"baked.{number}{'.png' if photo.pixels.dtype.kind == 'u' else '.exr'}"


class Texture(_Opened):
    """A texture opened for a recipe.

    Parameters
    ----------
    image
        The texture.
    recipe
        What is asked for; a mask by name is looked up in `masks`.
    mask
        Mask image of the recipe's region, with the same tiles; None for what the recipe says.
    tile
        Tile that white, reference and clicks are in; 0 for the first.
    masks
        Further masks, by their name in the recipe: functions that give (height, width) coverage.

    Raises
    ------
    DyehouseError
        If the image, or the mask, cannot be used.
    """

    def __init__(
        self,
        image: bpy.types.Image,
        recipe: Recipe,
        mask: bpy.types.Image | None = None,
        tile: int = 0,
        masks: dict[str, Callable[[], NDArray]] | None = None,
    ) -> None:
        super().__init__(image)
        self.recipe, self._masks, self._mask_name = recipe, masks or {}, mask.name if mask else ""
        try:
            self._mask_tiles = None if mask is None else loaders(mask, self.folder, None)
            self.tile = tile or min(self._photos)
            if self.tile not in self._photos:
                known = ", ".join(map(str, self._photos))
                raise ImageError(f"Image '{image.name}' has no tile {tile}: it has {known}.")
            if self._mask_tiles is not None and set(self._mask_tiles) != set(self._photos):
                raise MaskError(f"Mask '{self._mask_name}' has other tiles than '{image.name}': give it the same ones.")
        except DyehouseError:
            self.close()
            raise

    def look(self, number: int) -> tuple[Photo, Prepared | None]:
        """One tile and what was found in it; None where the mask leaves it as it is.

        Raises
        ------
        DyehouseError
            If the tile cannot be read, or the recipe cannot be used on it.
        """
        if number == self.tile:
            return self._begun
        photo = self._photos[number]()
        mask = self._mask(number, photo)
        if mask is not None and not mask.any():
            return photo, None
        return photo, _on_the_same_footing(self.first, photo, mask)

    @property
    def first(self) -> Prepared:
        """What was found in the tile that white, reference and clicks are in."""
        return self._begun[1]

    @cached_property
    def _begun(self) -> tuple[Photo, Prepared]:
        photo, recipe = self._photos[self.tile](), self.recipe
        mask = self._mask(self.tile, photo)
        if mask is not None:
            recipe = replace(recipe, regions=tuple(replace(region, mask=mask) for region in recipe.regions))
        return photo, photos.look(photo, recipe, read_mask=lambda name: self._masks[name]())

    def _mask(self, number: int, photo: Photo) -> NDArray | None:

        if self._mask_tiles is not None:
            name = f"The mask '{self._mask_name}'" + (f", tile {number}," if len(self._photos) > 1 else "")
            return files.coverage(self._mask_tiles[number]().pixels, photo.pixels.shape, name)
        if len(self._photos) == 1:
            return None
        if any(r.mask == "click" or r.click is not None for r in self.recipe.regions):
            raise MaskError(f"A clicked region lies in one tile, and '{self.name}' has several: give a mask image.")
        if photo.pixels.shape[2] == 4 and any(r.mask == "alpha" for r in self.recipe.regions):
            return photo.pixels[..., 3] > 0
        return None

    def _bake_tile(self, number: int, watch: Callable[[float], None]) -> Baked:
        """Recolor a tile exactly as the command line does into a file."""
        photo, prepared = self.look(number)
        path = self._path(number, photo)
        if prepared is None:
            return _recolored(path, photo, [], watch)
        space, premultiplied = files.output_space(path, photo), files.output_premultiplied(path, photo)
        if images.reads_files():
            photos.save(photo, prepared, path, watch=watch)
            return Baked(path, None, space, premultiplied)
        return Baked(path, photos.recolored(photo, prepared, path, watch=watch)[0], space, premultiplied)

    def maps(self, index: int = 0, straight: bool = True) -> dict[str, dict[int, Baked]]:
        """Maps for the inputs of a recolor node, by input and tile; none for an input that needs none.

        Parameters
        ----------
        index
            Of the region.
        straight
            Whether the colors that reach the node are straight; else they are multiplied by alpha.
        """
        found: dict[str, dict[int, Baked]] = {"Mask": {}, "Edge Light": {}, "Correction": {}}
        mask = self.first.analyses[index].mask
        needed, kind = {"Mask"} if mask is not None else set(), np.uint8 if mask is None else mask.dtype
        for number in self.tiles:
            photo, prepared = self.look(number)
            analysis = prepared.analyses[index] if prepared else None
            for name, pixels in _maps(photo, analysis, straight, kind).items():
                found[name][number] = _map_file(self.folder / f"{name}.{number}", pixels)
                if name != "Mask" and pixels.any():
                    needed.add(name)
        return {name: found[name] for name in found if name in needed}


class Live(_Opened):
    """A texture opened for what its live recolor node is set to.

    Parameters
    ----------
    texture
        The Image Texture node.
    node
        The recolor node after it.

    Raises
    ------
    DyehouseError
        If the image, or an input of the node, cannot be used.
    """

    def __init__(self, texture: bpy.types.Node, node: bpy.types.Node) -> None:
        super().__init__(texture.image)
        self._straight = straight(texture)
        try:
            _, self._matrix = nodes.mixture_of(node)
            found = {name: nodes.map_of(node, name) for name in ("Mask", "Edge Light", "Correction")}
            self._maps = {name: loaders(image, self.folder, None) for name, image in found.items() if image}
        except DyehouseError:
            self.close()
            raise

    def _bake_tile(self, number: int, watch: Callable[[float], None]) -> Baked:

        photo = self._photos[number]()
        mask, edge = None, None
        if "Mask" in self._maps:
            mask = files.coverage(self._maps["Mask"][number]().pixels, photo.pixels.shape, "The mask of the live node")
        if (light := self._light("Edge Light", number, photo)) is not None:
            rows, columns = light.any(axis=2).nonzero()
            whole = Picture(photo.pixels, photo.space.curve).at(rows, columns)
            share = whole if mask is None else whole * as_weights(mask[rows, columns])[:, None]
            edge = Edge(rows, columns, light[rows, columns] + share)
        extra = self._light("Correction", number, photo)
        matrix = self._matrix if extra is not None else self._matrix[:, :3]
        return _recolored(self._path(number, photo), photo, [RegionMatrix(matrix, mask, edge, extra)], watch)

    def _light(self, name: str, number: int, photo: Photo) -> NDArray | None:
        if name not in self._maps:
            return None
        return _for_alpha(self._maps[name][number]().pixels[..., :3], photo, self._straight, not photo.premultiplied)


def map_images(texture: Texture, index: int, straight: bool) -> dict[str, bpy.types.Image]:
    """Images of the maps of a texture; parameters as for :meth:`Texture.maps`."""
    return {
        name: stored(f"{texture.name} {name}", tiles, texture.tiled, "Non-Color")
        for name, tiles in texture.maps(index, straight).items()
    }


def straight(texture: bpy.types.Node) -> bool:
    """Whether Cycles and EEVEE give the colors of an Image Texture node straight, not multiplied by alpha."""
    return texture.outputs["Alpha"].is_linked or texture.image.alpha_mode in {"CHANNEL_PACKED", "NONE"}


def _on_the_same_footing(first: Prepared, photo: Photo, mask: NDArray | None) -> Prepared:
    """Return what was found in one tile, for another one."""
    picture = Picture(photo.pixels, photo.space.curve)
    selection = as_mask(mask, picture.shape)
    analyses = tuple(replace(analysis, picture=picture, selection=selection) for analysis in first.analyses)
    return replace(first, analyses=analyses)


def _recolored(path: Path, photo: Photo, regions: list[RegionMatrix], watch: Callable[[float], None]) -> Baked:

    space, premultiplied = files.output_space(path, photo), files.output_premultiplied(path, photo)
    out = np.empty(photo.pixels.shape, files.output_dtype(path, photo))
    job = Recoloring(Picture(photo.pixels, photo.space.curve), regions, curve=space.curve, dtype=out.dtype, out=out)
    for row in job.rows():
        watch(row / len(out))
    if out.shape[2] == 4:
        out[..., 3] = photos.converted(photo.pixels[..., 3], out.dtype)
        if premultiplied and not photo.premultiplied:
            out[..., :3] *= out[..., 3:]
    return written(path, out, photo, space, premultiplied)


def _maps(photo: Photo, analysis: Analysis | None, straight: bool, kind: DTypeLike) -> dict[str, NDArray]:
    """(height, width, 3): coverage, the product's light along its outline beyond that, and corrections."""
    shape = photo.pixels.shape[:2]
    mask: NDArray = np.zeros(shape, kind)
    light, correction = np.zeros((2, *shape, 3), np.float32)
    if analysis is not None:
        mask = np.full(shape, 255, np.uint8) if analysis.mask is None else analysis.mask
        if (edge := analysis.edge) is not None:
            at = edge.rows, edge.columns
            light[at] = edge.share - as_weights(mask[at])[:, None] * analysis.picture.at(*at)
        if analysis.extra is not None:
            rows = [analysis.mixture.coefficient(term)[3:] for term in nodes.CORRECTED]
            correction = analysis.extra @ np.stack(rows).T.astype(np.float32)
    return {
        "Mask": np.repeat((mask if mask.dtype == np.uint8 else as_weights(mask))[..., None], 3, axis=2),
        "Edge Light": _for_alpha(light, photo, not photo.premultiplied, straight),
        "Correction": _for_alpha(correction, photo, not photo.premultiplied, straight),
    }


def _for_alpha(light: NDArray, photo: Photo, straight: bool, wanted: bool) -> NDArray:
    """Light of a photo with alpha, brought from straight to multiplied by it or back."""
    if photo.pixels.shape[2] == 3 or straight == wanted:
        return light
    alpha = photos.converted(photo.pixels[..., 3:], np.float32)
    return light * alpha if straight else np.divide(light, alpha, out=np.zeros_like(light), where=alpha > 0)


def _map_file(path: Path, pixels: NDArray) -> Baked:
    """Numbers in a file that Blender shall take as Non-Color."""
    space = SRGB if pixels.dtype.kind == "u" else LINEAR_SRGB
    path = path.with_name(f"{path.name}.{'png' if pixels.dtype.kind == 'u' else 'exr'}")
    return written(path, pixels, Photo(path, pixels, space), space)


def coverage_image(mask: bpy.types.Image) -> bpy.types.Image:
    """A mask image as Blender's Non-Color data, which is how the core takes its codes."""
    with tempfile.TemporaryDirectory(prefix="dyehouse-") as folder:
        tiles = {}
        for number, load in loaders(mask, Path(folder), None).items():
            pixels = load().pixels
            coverage = files.coverage(pixels, pixels.shape, f"The mask '{mask.name}'")
            tiles[number] = _map_file(Path(folder) / f"mask.{number}", np.repeat(coverage[..., None], 3, axis=2))
        return stored(f"{mask.name} Mask", tiles, mask.source == "TILED", "Non-Color")


@dataclass(frozen=True, eq=False)
class Baked:
    """Pixels of a picture on their way into an image.

    Attributes
    ----------
    path
        A file that may hold them.
    pixels
        What is still to be written there by Blender itself; None if the file is written.
    space
        What they mean.
    premultiplied
        Whether they are multiplied by alpha.
    """

    path: Path
    pixels: NDArray | None
    space: RGBSpace
    premultiplied: bool = False


def written(path: Path, pixels: NDArray, photo: Photo, space: RGBSpace, premultiplied: bool = False) -> Baked:
    """Write a picture if that needs no Blender, else leave it to `stored`."""
    if not images.reads_files():
        return Baked(path, pixels, space, premultiplied)
    files.write(path, pixels, photo)
    return Baked(path, None, space, premultiplied)


def stored(
    name: str, tiles: dict[int, Baked], tiled: bool, told: str | None = None, output: Path | None = None
) -> bpy.types.Image:
    """Make an image of finished tiles.

    Parameters
    ----------
    name
        Of the new image.
    tiles
        By tile number.
    tiled
        Whether the image has tiles; then `output` must have <UDIM> or <UVTILE> in its name.
    told
        Color space to set; None for that of the tiles.
    output
        File to write; None to pack the image into the .blend.

    Raises
    ------
    FileError
        If a file is there already, or cannot be written.
    """
    first = min(tiles)
    for number, tile in tiles.items():
        if tile.pixels is not None:
            tiles[number] = _written_by_blender(tile)
    paths = {number: tile.path for number, tile in tiles.items()}
    if output is not None:
        paths = _moved(paths, output, tiled)
    image = bpy.data.images.load(str(paths[first]), check_existing=False)
    if tiled:
        image.source = "TILED"
        pattern = output.name if output else paths[first].name.replace(str(first), "<UDIM>")
        image.filepath_raw = str(paths[first].with_name(pattern))
        known = {tile.number for tile in image.tiles}
        for number in sorted(set(paths) - known):
            image.tiles.new(number)
    image.name = name
    image.colorspace_settings.name = told or _told(tiles[first].space)
    if output is None:
        image.pack()
        image.filepath_raw = f"//{name}{'.<UDIM>' if tiled else ''}{paths[first].suffix}"
        for packed in image.packed_files:
            packed.filepath = tile_path(image.filepath_raw, packed.tile_number)
    elif bpy.data.filepath:
        image.filepath_raw = bpy.path.relpath(image.filepath_raw)
    return image


def _told(space: RGBSpace) -> str:
    """Blender's name of a space."""
    for name, key in images.SPACE_NAMES.items():
        known = SPACES[key]
        if known is space or (known.curve == space.curve and (abs(known.to_xyz - space.to_xyz) < 1e-6).all()):
            return name
    return "sRGB"


def _places(numbers: Iterable[int], output: Path, tiled: bool) -> dict[int, Path]:
    """Files of the tiles, none of which is there yet."""
    if tiled and tile_path(output.name, FIRST_TILE) == output.name:
        raise FileError(f"'{output}' names one file for several tiles: put <UDIM> into the name.")
    places = {number: Path(tile_path(str(output), number)) for number in numbers}
    for place in places.values():
        files.check_output(place)
    return places


def _moved(paths: dict[int, Path], output: Path, tiled: bool) -> dict[int, Path]:
    suffix = next(iter(paths.values())).suffix
    if output.suffix.lower() != suffix:
        raise FileError(f"'{output}' cannot hold these pixels exactly: let its name end in {suffix}.")
    places = _places(paths, output, tiled)
    for number, place in places.items():
        shutil.move(paths[number], place)
    return places


def _written_by_blender(tile: Baked) -> Baked:
    """Write a picture without OpenImageIO: 8 bits as they are, all else as floats."""
    assert tile.pixels is not None
    image = images.new_image(tile.path.stem, tile.pixels, tile.space, tile.premultiplied)
    try:
        if not image.is_float:
            image.filepath_raw, image.file_format = str(tile.path), "PNG"
            image.save()
            return replace(tile, pixels=None)
        path = tile.path.with_suffix(".exr")
        shutil.move(images.saved_render(image), path)
        return Baked(path, None, images.working_space(), True)
    finally:
        bpy.data.images.remove(image)
