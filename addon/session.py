"""What has been computed from photos in this Blender session: opened photos and the looks at them.

Nothing here is saved. A look is found by what it depends on (the pixels, the footing of the recipe, the masks), so
undo, redo, a reloaded file or a changed setting need no bookkeeping: what is asked for next either is there or is
made. Everything is computed on plain arrays, in a thread of its own when `ready` is asked.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent

from . import background, images, masks, recipes, writing

if TYPE_CHECKING:
    from ..batch.files import Photo
    from ..core.analysis import Analysis
    from ..core.colorspace import RGBSpace
    from ..core.recipe import Prepared, Recipe


@dataclass(frozen=True, eq=False)
class Look:
    """A photo and what was found in it for a recipe.

    Attributes
    ----------
    photo
        As opened; for what the panel shows, with the color space of its files as `wanted`.
    prepared
        With the targets and the new light of the recipe that was asked for.
    key
        What the look depends on; equal keys mean the same maps and masks.
    regions
        Indices of the panel's regions that it is of, without those that are not picked yet.
    """

    photo: "Photo"
    prepared: "Prepared"
    key: tuple[object, ...]
    regions: tuple[int, ...] = ()

    def place(self, index: int) -> int | None:
        """Where a region of the panel is among the analyses; None if it is not picked yet."""
        return self.regions.index(index) if index in self.regions else None

    def analysis(self, index: int) -> "Analysis | None":
        """What was found for a region of the panel; None if that is not picked yet."""
        place = self.place(index)
        return None if place is None else self.prepared.analyses[place]


_photos: "background.Worker[Photo]" = background.Worker()
_looks: "background.Worker[Look]" = background.Worker()
_told: "background.Worker[tuple[str, ...]]" = background.Worker()
# Of each image, by its session_uid: the key of the look that was warned of last, and the warnings.
_told_last: dict[int, tuple[tuple[object, ...], tuple[str, ...]]] = {}


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
    recipe, indices = recipes.recipe_so_far(image)
    sources = masks.sources(image, True, indices)
    key = _key_in_hurry(image, recipe, sources)
    if key is None:
        return None
    found = _looks.ask(key, partial(_begin, image, recipe, sources, key))
    return None if found is None else _shown(image, _asking(found, recipe), indices)


def last(image: bpy.types.Image) -> Look | None:
    """The look for what the panel shows if there is one; nothing is begun."""
    from ..core.errors import DyehouseError

    try:
        recipe, indices = recipes.recipe_so_far(image)
        key = _key_in_hurry(image, recipe, masks.sources(image, True, indices))
        found = None if key is None else _looks.found(key)
    except (DyehouseError, OSError):
        return None
    return None if found is None else _shown(image, _asking(found, recipe), indices)


def warnings(image: bpy.types.Image, look: Look | None) -> Sequence[str]:
    """What may go wrong with what a look shows, in words: found in a thread, and till then the words of before."""
    if look is None:
        return ()
    told = _told.ask((look.key, look.prepared.recipe), lambda: lambda: tuple(look.prepared.warnings))
    if told is not None:
        _told_last[image.session_uid] = look.key, told
    key, words = _told_last.get(image.session_uid, (None, ()))
    return words if key == look.key else ()


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
    version = images.version_of(image, hurry=True)
    return None if version is None else _photos.ask(version, partial(images.loader, image))


def space_of(image: bpy.types.Image) -> "RGBSpace":
    """RGB space of the photo."""
    return photo_of(image).space


def forget() -> None:
    """Drop everything: another .blend is opened, or the extension is disabled."""
    _photos.forget()
    _looks.forget()
    _told.forget()
    _told_last.clear()


def _key(image: bpy.types.Image, recipe: "Recipe", sources: "Mapping[str, masks.Source]") -> tuple[object, ...]:
    covered = tuple((name, source.version) for name, source in sources.items())
    return images.version_of(image), recipe.footing(), covered


def _key_in_hurry(
    image: bpy.types.Image, recipe: "Recipe", sources: "Mapping[str, masks.Source]"
) -> tuple[object, ...] | None:
    """The same from `sources` in a hurry, None if pixels are still to be looked at."""
    version = images.version_of(image, hurry=True)
    covered = tuple((name, source.version) for name, source in sources.items())
    known = version is not None and all(source.version is not None for source in sources.values())
    return (version, recipe.footing(), covered) if known else None


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
    prepared = look_at(photo, recipe, read_mask=lambda name: loaders[name]())
    for analysis in prepared.analyses:  # what the window would wait for when it is drawn
        _ = analysis.mask, analysis.extra, analysis.report
    return Look(photo, prepared, key)


def _shown(image: bpy.types.Image, look: Look, indices: tuple[int, ...]) -> Look:
    return replace(look, photo=writing.in_space(look.photo, recipes.output_space(image)), regions=indices)


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
