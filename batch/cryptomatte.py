"""Mattes of objects or materials from the cryptomatte passes of a render (Psyop, "Cryptomatte Specification" 1.2)."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import FileError, MaskError


def names_in(path: str | Path) -> dict[str, dict[str, str]]:
    """Names of what can be selected.

    Returns
    -------
    Per layer, such as ``ViewLayer.CryptoObject``: each name with its id, a hexadecimal number.

    Raises
    ------
    FileError
        If the file cannot be read or has no cryptomatte.
    """
    with _opened(path) as source:
        return _names(source, path)


def matte(path: str | Path, names: Sequence[str], layer: str = "") -> NDArray[np.float32]:
    """Read how much of each pixel some objects or materials cover.

    Parameters
    ----------
    path
        Multilayer or multipart EXR.
    names
        Of objects, materials or assets, as in :func:`names_in`.
    layer
        One of :func:`names_in`; empty for the first that has all the names.

    Returns
    -------
    (height, width) float32 coverage, 0..1.

    Raises
    ------
    FileError
        If the file cannot be read or has no cryptomatte.
    MaskError
        If it has no such layer or name.
    """
    with _opened(path) as source:
        found = _names(source, path)
        layer = chosen(found, names, layer, path)
        ids = np.array([int(found[layer][name], 16) for name in names], np.uint32).view(np.float32)
        covered = sum(_covered(ranks, ids) for ranks in _ranks(source, layer))
    if not isinstance(covered, np.ndarray):
        raise FileError(f"'{path}' names the cryptomatte layer {layer} but has no pixels of it: render it again.")
    return np.clip(covered, 0, 1)


@contextmanager
def _opened(path: str | Path) -> Iterator[Any]:
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(str(path)) if Path(path).is_file() else None
    if source is None:
        OpenImageIO.geterror()
        raise FileError(f"'{path}' cannot be read as an EXR: give the file of a render with cryptomatte passes.")
    try:
        yield source
    finally:
        source.close()


def _names(source: Any, path: str | Path) -> dict[str, dict[str, str]]:
    return told_names({a.name: a.value for a in source.spec(0).extra_attribs}, path)


def told_names(attributes: Mapping[str, Any], path: str | Path) -> dict[str, dict[str, str]]:
    """What the attributes of an EXR name, as :func:`names_in`; errors as there."""
    keys = [key for key in attributes if key.startswith("cryptomatte/") and key.endswith("/name")]
    layers = {attributes[key]: attributes.get(f"{key[:-4]}manifest") for key in keys}
    if not layers:
        raise FileError(f"'{path}' has no cryptomatte: render it with a Cryptomatte pass into a multilayer EXR.")
    try:
        return {layer: json.loads(manifest or "") for layer, manifest in layers.items()}
    except ValueError:
        raise FileError(f"'{path}' does not list the names of its cryptomatte: render it with them inside.") from None


def chosen(found: Mapping[str, Mapping[str, str]], names: Sequence[str], layer: str, path: str | Path) -> str:
    """The layer that is meant, which has all the names; parameters and errors as for :func:`matte`."""
    layer = layer or next((known for known in found if found[known].keys() >= set(names)), next(iter(found)))
    if layer not in found:
        raise MaskError(f"'{path}' has no cryptomatte layer '{layer}': use one of {', '.join(found)}.")
    for name in names:
        if name not in found[layer]:
            near = difflib.get_close_matches(name, found[layer]) or sorted(found[layer])[:10]
            raise MaskError(f"Layer {layer} of '{path}' has no '{name}': use one of {', '.join(near)}.")
    return layer


def _ranks(source: Any, layer: str) -> Iterator[NDArray[np.float32]]:
    """Each level of a layer, (height, width, 4): id, coverage, id, coverage."""
    part = 0
    while source.seek_subimage(part, 0):  # Blender writes one part for each pass
        channels = list(source.spec().channelnames)
        matched = (re.match(rf"({re.escape(layer)}\d\d)\.", channel) for channel in channels)
        for level in sorted({m[1] for m in matched if m}):
            index = {c.rsplit(".", 1)[1].lower()[0]: i for i, c in enumerate(channels) if c.startswith(f"{level}.")}
            pixels = source.read_image(part, 0, min(index.values()), max(index.values()) + 1, "float")
            if pixels is None:
                raise FileError(f"Layer {level} of the EXR is damaged ({source.geterror()}): render it again.")
            yield pixels[..., [index[c] - min(index.values()) for c in "rgba"]]
        part += 1
    source.geterror()  # that there is no further part is no error


def _covered(ranks: NDArray[np.float32], ids: NDArray[np.float32]) -> NDArray[np.float32]:
    first, second = (np.where(np.isin(ranks[..., k], ids), ranks[..., k + 1], 0) for k in (0, 2))
    return np.asarray(first + second, np.float32)
