"""What has been computed from photos in this Blender session: opened photos and the looks at them.

Nothing here is saved. A look is found by what it depends on (the pixels, the footing of the recipe, the masks), so
undo, redo, a reloaded file or a changed setting need no bookkeeping: what is asked for next either is there or is
made. Everything is computed on plain arrays, in a thread of its own when `ready` is asked.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from . import background, images, masks, recipes

if TYPE_CHECKING:
    from ..batch.files import Photo
    from ..core.colorspace import RGBSpace
    from ..core.recipe import Prepared, Recipe


@dataclass(frozen=True, eq=False)
class Look:
    """A photo and what was found in it for a recipe.

    Attributes
    ----------
    photo
        As opened.
    prepared
        With the targets and the new light of the recipe that was asked for.
    key
        What the look depends on; equal keys mean the same maps and masks.
    """

    photo: "Photo"
    prepared: "Prepared"
    key: tuple[object, ...]


_photos: "background.Worker[Photo]" = background.Worker()
_looks: "background.Worker[Look]" = background.Worker()


def look(
    image: bpy.types.Image, recipe: "Recipe | None" = None, sources: "Mapping[str, masks.Source] | None" = None
) -> Look:
    """Look at a photo now, for what the panel shows or for a given recipe.

    Parameters
    ----------
    image
        The photo.
    recipe
        What is asked for; None for what the panel shows.
    sources
        The recipe's masks by name; None for those of the image's regions.

    Raises
    ------
    DyehouseError
        If the image cannot be opened, or a setting cannot be used on it.
    """
    recipe = recipe or recipes.recipe_of(image)
    sources = masks.sources(image) if sources is None else sources
    key = _key(image, recipe, sources)
    return _asking(_looks.now(key, partial(_begin, image, recipe, sources, key)), recipe)


def begin(image: bpy.types.Image, recipe: "Recipe") -> Callable[[], Look]:
    """Return a function that gives the look, as :func:`look` does, in any thread; only this call touches Blender."""
    sources = masks.sources(image)
    key = _key(image, recipe, sources)
    found = _looks.found(key)
    if found is not None:
        return partial(_asking, found, recipe)
    make = _begin(image, recipe, sources, key)
    return lambda: _asking(_looks.now(key, lambda: make), recipe)


def ready(image: bpy.types.Image) -> Look | None:
    """The look for what the panel shows if it has been made; else it is begun, and the editors are drawn when it is.

    Raises
    ------
    DyehouseError
        If it cannot be made.
    """
    recipe, sources = recipes.recipe_of(image), masks.sources(image, hurry=True)
    key = _key(image, recipe, sources, hurry=True)
    found = _looks.ask(key, partial(_begin, image, recipe, sources, key))
    return None if found is None else _asking(found, recipe)


def last(image: bpy.types.Image) -> Look | None:
    """The look for what the panel shows if there is one; nothing is begun."""
    from ..core.errors import DyehouseError

    try:
        recipe, sources = recipes.recipe_of(image), masks.sources(image, hurry=True)
        found = _looks.found(_key(image, recipe, sources, hurry=True))
    except (DyehouseError, OSError):
        return None
    return None if found is None else _asking(found, recipe)


def busy() -> bool:
    """Whether a look is being made."""
    return _looks.busy()


def photo_of(image: bpy.types.Image) -> "Photo":
    """The opened photo.

    Raises
    ------
    DyehouseError
        If the image cannot be opened.
    """
    return _photos.now(images.version_of(image), partial(images.loader, image))


def photo_ready(image: bpy.types.Image) -> "Photo | None":
    """The opened photo if it has been opened; else it is begun, and the editors are drawn when it is.

    Raises
    ------
    DyehouseError
        If the image cannot be opened.
    """
    return _photos.ask(images.version_of(image, hurry=True), partial(images.loader, image))


def space_of(image: bpy.types.Image) -> "RGBSpace":
    """RGB space of the photo."""
    return photo_of(image).space


def forget() -> None:
    """Drop everything: another .blend is opened, or the extension is disabled."""
    _photos.forget()
    _looks.forget()


def _key(
    image: bpy.types.Image, recipe: "Recipe", sources: "Mapping[str, masks.Source]", hurry: bool = False
) -> tuple[object, ...]:
    covered = tuple((name, source.version) for name, source in sources.items())
    return images.version_of(image, hurry), recipe.footing(), covered


def _begin(
    image: bpy.types.Image, recipe: "Recipe", sources: "Mapping[str, masks.Source]", key: tuple[object, ...]
) -> Callable[[], Look]:
    """Gather what a look depends on, for a function that makes it without Blender."""
    shape = images.shape_of(image)
    known = _photos.found(key[0])
    loaders = {name: source.load(shape) for name, source in sources.items()}
    return partial(_look, key, recipe.footing(), (lambda: known) if known else images.loader(image), loaders)


def _look(
    key: tuple[object, ...],
    recipe: "Recipe",
    load: "Callable[[], Photo]",
    loaders: dict[str, Callable[[], Any]],
) -> Look:
    from ..batch.photo import look as look_at

    photo = _photos.now(key[0], lambda: load)
    return Look(photo, look_at(photo, recipe, read_mask=lambda name: loaders[name]()), key)


def _asking(look: Look, recipe: "Recipe") -> Look:
    return replace(look, prepared=look.prepared.asking(recipe))


@persistent
def _on_load(_path: str) -> None:
    forget()


@persistent
def _on_render(*_: object) -> None:
    images.count_render()


_HANDLERS = (("load_post", _on_load), ("render_complete", _on_render), ("render_cancel", _on_render))


def register() -> None:
    """Forget with each .blend that is opened, and know of each render."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister() -> None:
    """Forget all."""
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    forget()
