"""The virtual laboratory: the same product truly in another color, measured at every pixel.

A photo cannot show one mug in two colors; a render can. `render` gives linear RGB of a scene of `sample_blends` in
any color under any light, `measure` its spectra, as the paper's spectroradiometer did, to be seen by any camera
under any light by Eq. (11).

Light is linear, so every group of lights (key, fill) is rendered once in white and colored afterwards. What has
been rendered is kept, by the content of the scene, the settings and Blender's version, in the folder that the
environment variable ``DYEHOUSE_CACHE`` names, else in the user's cache folder.

As a command, it renders a contact sheet::

    uv run --group blender python -m dyehouse.benchmarks.laboratory [NAME ...] [--fast] --out SHEET.png
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import OpenImageIO
from numpy.typing import ArrayLike, NDArray

from dyehouse.core import spectra, transfer
from dyehouse.core.neighborhood import erode
from dyehouse.sample_blends import make_scenes

type Light = str | float | spectra.Spectrum
"""Anything that `spectra.illuminant` takes."""

type RGB = tuple[float, float, float]

type Illuminant = ArrayLike | Mapping[str, ArrayLike]
"""Linear RGB of all lights (3,), or of every light group by its name."""

BANDS: NDArray[np.float64] = np.linspace(400.0, 700.0, 31)
"""Wavelengths of the spectral mode, in nm: those of the paper's figures."""


@dataclass(frozen=True)
class Settings:
    """How a scene is rendered.

    Attributes
    ----------
    size
        Pixels on a side.
    samples
        Paths for each pixel. Noise falls with their square root.
    seed
        Of the paths. The same for every color, so that noise is largely common to them.
    threads
        For Cycles; changes the time, not the picture.
    """

    size: int = 256
    samples: int = 128
    seed: int = 0
    threads: int = 1


FULL = Settings()
FAST = Settings(size=96, samples=48)
"""Quick renders, for tests."""


@dataclass(frozen=True, eq=False)
class View:
    """What is known about a scene besides its light.

    Attributes
    ----------
    mask
        (H, W) float32: how much of each pixel the dyed material covers.
    masks
        The same for every material of the scene, by name.
    interior
        (H, W) bool: pixels of nothing but the product, 3 pixels (of 256) away from its edge.
    reference
        (x, y): a matte, well-lit pixel.
    lights
        Linear RGB color of every light group, as the scene has it.
    shares
        What every light group adds to white at the reference; they sum to 1.
    dye
        (3,) reflectance the scene is saved with.
    colors
        The scene's other color properties.
    """

    mask: NDArray[np.float32]
    masks: dict[str, NDArray[np.float32]]
    interior: NDArray[np.bool_]
    reference: tuple[int, int]
    lights: dict[str, RGB]
    shares: dict[str, float]
    dye: RGB
    colors: dict[str, RGB]

    def white(self, illuminant: Illuminant | None = None) -> NDArray[np.float64]:
        """(3,): a perfect white diffuser at the reference, up to the exposure; `illuminant` as for `render`."""
        colors = _by_group(illuminant, self.lights)
        return np.sum([share * colors[group] for group, share in self.shares.items()], axis=0)


# --- RGB --------------------------------------------------------------------------------------------------
def view(scene: str, settings: Settings = FULL, **parameters: Any) -> View:
    """Masks and the reference pixel of a scene.

    Parameters
    ----------
    scene
        Its name in `make_scenes.SCENES`, or the path of a .blend that carries the same custom properties.
    settings
        How to render.
    parameters
        For the function that builds the scene.
    """
    facts = _facts(scene, tuple(sorted(parameters.items())))
    masks = _exposure(scene, parameters, facts.dye, settings).masks
    mask = masks[facts.product]
    reach = max(1, round(3 * settings.size / 256))
    x, y = (min(int(fraction * settings.size), settings.size - 1) for fraction in facts.reference)
    interior = erode(mask > 0.999, reach)
    return View(mask, masks, interior, (x, y), facts.lights, facts.shares, facts.dye, facts.colors)


def render(
    scene: str,
    reflectance: ArrayLike,
    illuminant: Illuminant | None = None,
    settings: Settings = FULL,
    *,
    diffuser: bool = False,
    colors: Mapping[str, ArrayLike] | None = None,
    **parameters: Any,
) -> NDArray[np.float32]:
    """Picture of a scene whose product has a given reflectance.

    Parameters
    ----------
    scene
        Its name in `make_scenes.SCENES`, or the path of a .blend that carries the same custom properties.
    reflectance
        (3,) linear RGB of the dyed material.
    illuminant
        (3,) linear RGB of all lights, or one for every light group by name; None: as the scene has them.
    settings
        How to render.
    diffuser
        Put a perfect white diffuser of the same shape in the product's place.
    colors
        Linear RGB for other color properties of the scene, such as a shoe's "sole".
    parameters
        For the function that builds the scene.

    Returns
    -------
    (H, W, 3) float32 linear RGB, first row on top, not clipped; 0.9 is a white diffuser that faces the key light.
    """
    rgb = np.asarray(reflectance, dtype=float)
    if rgb.shape != (3,):
        raise ValueError(f"render() takes a reflectance of three numbers, not {rgb.shape}: see measure().")
    others = {name: np.asarray(color, float).tolist() for name, color in (colors or {}).items()}
    exposure = _exposure(scene, parameters, rgb.tolist(), settings, diffuser, others)
    lights = _by_group(illuminant, _facts(scene, tuple(sorted(parameters.items()))).lights)
    return np.sum([exposure.light[group] * lights[group] for group in lights], axis=0, dtype=np.float32)


def _by_group(given: Illuminant | None, lights: Mapping[str, RGB]) -> dict[str, NDArray[np.float32]]:
    """One light color for each group."""
    by_name: Mapping[str, ArrayLike]
    if given is None:
        by_name = lights
    elif isinstance(given, Mapping):
        by_name = given
    else:
        by_name = dict.fromkeys(lights, given)
    if missing := lights.keys() - by_name.keys():
        raise ValueError(f"The scene has another light group that needs a color: {', '.join(sorted(missing))}.")
    return {group: np.asarray(by_name[group], np.float32) for group in lights}


# --- Spectra ----------------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Measurement:
    """Spectra at every pixel, under light of equal energy at every wavelength.

    Attributes
    ----------
    radiance
        (H, W, 31) float32 for each light group, at `BANDS`.
    tile
        The same of the white diffuser in the product's place; (H, W, 1) where it is equal at all wavelengths.
    shares
        See `View`.
    """

    radiance: dict[str, NDArray[np.float32]]
    tile: dict[str, NDArray[np.float32]]
    shares: dict[str, float]

    def factors(self, at: tuple[int, int] | None = None) -> NDArray[np.float32]:
        """Reflectance factors, R of Eq. (10), under the light of all groups together.

        Parameters
        ----------
        at
            Pixel (x, y) where the white tile is read, once for all, as the paper does; None: at every pixel its own,
            which takes the shape out.

        Returns
        -------
        (H, W, 31) float32.
        """
        tile = np.sum(list(self.tile.values()), axis=0)
        if at is not None:
            x, y = at
            tile = tile[y, x]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.sum(list(self.radiance.values()), axis=0, dtype=np.float32) / tile

    def seen_by(self, sensor: str, light: Light | Mapping[str, Light]) -> NDArray[np.float32]:
        """What a camera or the CIE observer makes of it, Eq. (11).

        Parameters
        ----------
        sensor
            A camera that `spectra.camera_sensitivities` knows, or an observer: "1931" or "1964".
        light
            Anything `spectra.illuminant` takes, or one for every light group by name.

        Returns
        -------
        (H, W, 3) float32 RGB of the camera, or XYZ; green (Y) is 1 for a white diffuser of radiance 1.
        """
        lights = zip(self.radiance.values(), self._lights(light), strict=True)
        seen = [image @ response(sensor, one).astype(np.float32) for image, one in lights]
        return np.sum(seen, axis=0, dtype=np.float32)

    def white(self, sensor: str, light: Light | Mapping[str, Light]) -> NDArray[np.float64]:
        """(3,): W of Eq. (31), the response to a white diffuser of radiance 1 in the light at the reference."""
        parts = [response(sensor, one).sum(axis=0) for one in self._lights(light)]
        return np.array(list(self.shares.values())) @ np.array(parts)

    def _lights(self, light: Light | Mapping[str, Light]) -> list[Light]:
        return [light[group] if isinstance(light, Mapping) else light for group in self.shares]


def response(sensor: str, light: Light) -> NDArray[np.float64]:
    """(31, 3): what each band of a spectrum at `BANDS` adds to the response of a sensor; see `Measurement.seen_by`."""
    bands = spectra.Spectrum(BANDS, np.eye(len(BANDS)))
    if sensor in ("1931", "1964"):
        return spectra.to_xyz(light, bands, sensor)
    return spectra.to_camera(light, bands, sensor)


def measure(scene: str, reflectance: ArrayLike, settings: Settings = FULL, **parameters: Any) -> Measurement:
    """Measure a scene whose product has a given spectral reflectance, three bands a render.

    Parameters
    ----------
    scene
        Its name in `make_scenes.SCENES`, or the path of a .blend that carries the same custom properties.
    reflectance
        (31,) of the dyed material at `BANDS`, in 0..1.
    settings
        How to render.
    parameters
        For the function that builds the scene.
    """
    curve = np.asarray(reflectance, dtype=float)
    if curve.shape != BANDS.shape:
        raise ValueError(f"measure() takes a reflectance at {len(BANDS)} wavelengths, not {curve.shape}.")
    facts = _facts(scene, tuple(sorted(parameters.items())))
    others = {name: uplift(rgb) for name, rgb in facts.colors.items()}

    def bands(values: NDArray[np.float64], diffuser: bool) -> dict[str, NDArray[np.float32]]:
        parts: dict[str, list[NDArray[np.float32]]] = {group: [] for group in facts.lights}
        for start in range(0, len(values), 3):
            chosen = np.minimum(np.arange(start, start + 3), len(values) - 1)  # the last render repeats a band
            here = {name: curve[chosen].tolist() for name, curve in others.items()}
            exposure = _exposure(scene, parameters, values[chosen].tolist(), settings, diffuser, here)
            for group in facts.lights:
                parts[group].append(exposure.light[group][..., : len(values) - start])
        return {group: np.concatenate(part, axis=-1) for group, part in parts.items()}

    # Among neutral surroundings the white tile is the same at all wavelengths: one band is enough.
    tile = bands(np.ones(31 if others else 1), diffuser=True)
    return Measurement(bands(curve, diffuser=False), tile, facts.shares)


def uplift(rgb: ArrayLike) -> NDArray[np.float64]:
    """Make up a smooth reflectance (31,) in 0..1 for a linear RGB color of the surroundings.

    The three channels are held over their parts of the spectrum, joined by smooth steps at 490 and 590 nm; they add
    up to one, so gray stays flat.
    """

    def step(edge: float) -> NDArray[np.float64]:
        return 0.5 + 0.5 * np.tanh((BANDS - edge) / 25.0)

    basis = np.stack([step(590.0), step(490.0) - step(590.0), 1 - step(490.0)])
    return np.asarray(rgb, dtype=float) @ basis


# --- Rendering and what is kept of it ---------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class _Exposure:
    """Light of each group, rendered in white, and the coverage of each material."""

    light: dict[str, NDArray[np.float32]]
    masks: dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class _Facts:
    """What a scene says about itself, without a render."""

    fingerprint: str
    product: str
    reference: tuple[float, float]
    lights: dict[str, RGB]
    shares: dict[str, float]
    dye: RGB
    colors: dict[str, RGB]


@lru_cache(maxsize=256)
def _facts(scene: str, parameters: tuple[tuple[str, Any], ...]) -> _Facts:
    built = _build(scene, dict(parameters))
    groups = [group.name for group in built.view_layers[0].lightgroups]
    return _Facts(
        fingerprint=fingerprint(built),
        product=built["product"],
        reference=(built["reference_x"], built["reference_y"]),
        lights={group: tuple(built[f"{group}_light"]) for group in groups},
        shares={group: built[f"{group}_share"] for group in groups},
        dye=tuple(built["dye"]),
        colors={name: tuple(built[name]) for name in built.get("colors", "").split()},
    )


# Property of the open scene: which one it is.
_OPEN = "laboratory"


def _build(scene: str, parameters: Mapping[str, Any]) -> bpy.types.Scene:
    """Open a scene: one of ours by its name, or a .blend that carries the same custom properties."""
    opened = _opened(scene) if scene.endswith(".blend") else make_scenes.build(scene, **parameters)
    opened[_OPEN] = repr((scene, tuple(sorted(parameters.items()))))
    return opened


def _opened(scene: str) -> bpy.types.Scene:
    bpy.ops.wm.open_mainfile(filepath=str(Path(scene).resolve()))
    opened = bpy.context.scene
    groups = [group.name for group in opened.view_layers[0].lightgroups]
    needed = ["dye", "product", "reference_x", "reference_y"]
    needed += [f"{group}_{what}" for group in groups for what in ("light", "share")]
    missing = [name for name in needed if name not in opened]
    if missing or not groups:
        lacking = f"has no scene property {', '.join(missing)}" if missing else "has no light group"
        raise ValueError(f"'{scene}' {lacking}: sample_blends/make_scenes.py tells what a scene carries.")
    return opened


def cache_folder() -> Path:
    """Folder that keeps the renders; made if it is not there."""
    if given := os.environ.get("DYEHOUSE_CACHE"):
        folder = Path(given)
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData/Local")) / "dyehouse" / "cache"
    elif sys.platform == "darwin":
        folder = Path.home() / "Library/Caches/dyehouse"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dyehouse"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _exposure(
    scene: str,
    parameters: Mapping[str, Any],
    dye: Sequence[float],
    settings: Settings,
    diffuser: bool = False,
    colors: Mapping[str, Sequence[float]] | None = None,
) -> _Exposure:
    """Fetch a render from the cache, or make it."""
    key = (scene, tuple(sorted(parameters.items())))
    facts = _facts(*key)
    how = {name: value for name, value in asdict(settings).items() if name != "threads"}
    # A white diffuser is white whatever the dye, and shall be rendered once.
    dye = (1.0, 1.0, 1.0) if diffuser else dye
    properties = {"dye": list(dye), "diffuser": float(diffuser)}
    properties |= {name: list(color) for name, color in (facts.colors | dict(colors or {})).items()}
    recipe = json.dumps([facts.fingerprint, bpy.app.version_string, how, properties], sort_keys=True)
    path = cache_folder() / f"{Path(scene).stem}-{hashlib.sha256(recipe.encode()).hexdigest()[:24]}.npz"
    if not path.exists():
        if bpy.context.scene.get(_OPEN) != repr(key):  # many colors of a scene build it once
            _build(scene, parameters)
        exposure = _render(bpy.context.scene, properties, settings)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".tmp", delete=False) as file:
            arrays: dict[str, Any] = {f"light/{name}": image for name, image in exposure.light.items()}
            arrays |= {f"mask/{name}": image for name, image in exposure.masks.items()}
            np.savez_compressed(file, **arrays)
        Path(file.name).replace(path)  # at once: another process may be looking for it
        return exposure
    with np.load(path) as data:
        parts: dict[str, dict[str, NDArray[np.float32]]] = {"light": {}, "mask": {}}
        for name in data.files:
            kind, _, rest = name.partition("/")
            parts[kind][rest] = data[name]
    return _Exposure(parts["light"], parts["mask"])


def _render(scene: bpy.types.Scene, properties: Mapping[str, Any], settings: Settings) -> _Exposure:
    for name, value in properties.items():
        scene[name] = value
    groups = [group.name for group in scene.view_layers[0].lightgroups]
    for group in groups:
        scene[f"{group}_light"] = (1.0, 1.0, 1.0)
    scene.update_tag()
    scene.cycles.samples, scene.cycles.seed = settings.samples, settings.seed
    r = scene.render
    r.resolution_x = r.resolution_y = settings.size
    r.resolution_percentage = 100
    r.threads_mode, r.threads = "FIXED", settings.threads
    r.use_persistent_data = True  # only colors change from render to render
    image = r.image_settings
    image.media_type, image.file_format, image.color_depth = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER", "32"
    with tempfile.TemporaryDirectory() as folder, _silence():
        r.filepath = str(Path(folder) / "render.exr")
        bpy.ops.render.render(write_still=True)
        return _read(r.filepath, groups)


def _read(path: str, groups: Sequence[str]) -> _Exposure:
    """Read light groups and cryptomatte of a multilayer EXR file; Blender writes each pass as a part."""
    channels: dict[str, NDArray[np.float32]] = {}
    file = OpenImageIO.ImageBuf(path)
    manifest = next(a.value for a in file.spec().extra_attribs if a.name.endswith("/manifest"))
    for part in range(file.nsubimages):
        pass_ = OpenImageIO.ImageBuf(path, part, 0)
        pixels = np.asarray(pass_.get_pixels("float"))
        channels |= {n.split(".", 1)[1]: pixels[..., i] for i, n in enumerate(pass_.spec().channelnames)}
    light = {g: np.stack([channels[f"Combined_{g}.{c}"] for c in "RGB"], axis=-1) for g in groups}
    masks = {}
    for material, ident in json.loads(str(manifest)).items():
        number = np.array([int(ident, 16)], np.uint32).view(np.float32)[0]
        cover = np.zeros(next(iter(light.values())).shape[:2], np.float32)
        for level in (name[:-2] for name in channels if name.startswith("Crypto") and name.endswith(".r")):
            for who, how_much in ("rg", "ba"):
                cover += np.where(channels[f"{level}.{who}"] == number, channels[f"{level}.{how_much}"], 0)
        if cover.any():
            masks[material] = cover.clip(0, 1)
    return _Exposure(light, masks)


@contextmanager
def _silence() -> Iterator[None]:
    """Keep Blender, which prints from C, from printing a line for each render."""
    sys.stdout.flush()
    kept = os.dup(1)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(null)


# --- The content of a scene -------------------------------------------------------------------------------
_PLAIN = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}
_LOOKS = {
    *("location_absolute", "select", "width", "height", "label", "show_options", "show_preview", "show_texture"),
    *("filepath", "samples", "seed", "resolution_x", "resolution_y", "resolution_percentage", "threads"),
    *("threads_mode", "use_persistent_data", "use_nodes", "name_full", "tag", "use_fake_user"),
}
"""Properties that change nothing in the picture, or that `Settings` sets."""


def _plain(thing: Any, *, without: set[str] | None = None) -> dict[str, Any]:
    """Simple, writable properties of a piece of Blender data."""
    found = {}
    for p in thing.bl_rna.properties:
        if p.type not in _PLAIN or p.is_readonly or p.identifier in _LOOKS | (without or set()):
            continue
        value = getattr(thing, p.identifier)
        is_array = getattr(p, "is_array", False)
        found[p.identifier] = np.ravel(value).tolist() if is_array else str(value)
    return found


def _tree(tree: bpy.types.NodeTree) -> list[Any]:
    nodes = [
        (
            node.bl_idname,
            _plain(node, without={"location", "name"}),
            [str(_value(socket)) for socket in node.inputs],
            [str(_value(socket)) for socket in node.outputs],
        )
        for node in tree.nodes
    ]
    order = {node.name: i for i, node in enumerate(tree.nodes)}
    links = [
        (order[k.from_node.name], k.from_socket.identifier, order[k.to_node.name], k.to_socket.identifier)
        for k in tree.links
    ]
    return [nodes, sorted(links)]


def _value(socket: bpy.types.NodeSocket) -> Any:
    value: Any = getattr(socket, "default_value", None)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def fingerprint(scene: bpy.types.Scene) -> str:
    """Hash of what a scene shows: shapes, places, materials, lights, camera and settings of Cycles.

    Colors that are custom properties of the scene are left out: they are what is varied.
    """
    content: list[Any] = [_plain(scene.cycles), _plain(scene.render)]
    for thing in sorted(scene.objects, key=lambda each: each.name):
        content += [thing.name, np.ravel(thing.matrix_basis).tolist(), thing.lightgroup]
        content += [(m.type, _plain(m)) for m in thing.modifiers]
        data = thing.data
        content.append(_plain(data))
        if isinstance(data, bpy.types.Mesh):
            for attribute in sorted(data.attributes, key=lambda each: each.name):
                field = {"FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "INT": ("value", 1)}
                if attribute.data_type in field and not attribute.name.startswith("."):
                    name, width = field[attribute.data_type]
                    values = np.empty(len(attribute.data) * width, np.float32)
                    attribute.data.foreach_get(name, values)
                    content.append((attribute.name, hashlib.sha256(values.tobytes()).hexdigest()))
            corners = np.empty(len(data.loops), np.int32)
            data.loops.foreach_get("vertex_index", corners)
            content.append(hashlib.sha256(corners.tobytes()).hexdigest())
            content += [slot.name for slot in data.materials]
        elif isinstance(data, bpy.types.Light):
            content.append(_tree(data.node_tree))
    for material in sorted(bpy.data.materials, key=lambda each: each.name):
        content += [material.name, _tree(material.node_tree)]
    if scene.world:
        content += [scene.world.lightgroup, _tree(scene.world.node_tree)]
    content += [_tree(group) for group in bpy.data.node_groups]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


# --- Contact sheet ----------------------------------------------------------------------------------------
_SHEET_COLORS = ((0.0395, 0.0467, 0.305), (0.799, 0.571, 0.0137))


def contact_sheet(names: Sequence[str], settings: Settings, out: Path) -> None:
    """Write a picture of scenes: as saved, in two colors, with the mask and the reference pixel marked."""
    rows = []
    for name in names:
        start = time.perf_counter()
        what = view(name, settings)
        picture = render(name, what.dye, settings=settings)
        x, y = what.reference
        spot = max(1, settings.size // 128)
        marked = picture * (0.35 + 0.65 * what.mask[..., None])
        marked[max(0, y - spot) : y + spot + 1, max(0, x - spot) : x + spot + 1] = (1.0, 0.0, 1.0)
        rows.append(np.hstack([marked, *(render(name, c, settings=settings) for c in _SHEET_COLORS)]))
        print(f"{name}: {time.perf_counter() - start:.1f} s", flush=True)
    across = min(3, len(rows))
    rows += [np.zeros_like(rows[0])] * (-len(rows) % across)
    sheet = np.vstack([np.hstack(rows[i : i + across]) for i in range(0, len(rows), across)])
    codes = transfer.encode(sheet, transfer.SRGB, np.uint8)
    OpenImageIO.ImageBuf(codes).write(str(out))


def main(arguments: Sequence[str] | None = None) -> None:
    """Render a contact sheet."""
    parser = argparse.ArgumentParser(description="Render a contact sheet of the sample scenes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes (default: all)")
    parser.add_argument("--fast", action="store_true", help="small and rough")
    parser.add_argument("--out", type=Path, required=True, help="the picture to write")
    options = parser.parse_args(arguments)
    contact_sheet(options.names or list(make_scenes.SCENES), FAST if options.fast else FULL, options.out)


if __name__ == "__main__":
    main()
