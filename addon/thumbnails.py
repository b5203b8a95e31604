"""Small pictures of the colorways, as icons for the panel."""

from typing import TYPE_CHECKING, Any

import bpy
import bpy.utils.previews

from . import background, session

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..core.thumbnail import Proxy

_proxies: "background.Worker[Proxy]" = background.Worker()
_pictures: "background.Worker[list[NDArray]]" = background.Worker()
_icons: Any = None
# What the icons of each image show, so that they are filled only when that changes.
_shown: dict[int, "list[NDArray]"] = {}


def update(image: bpy.types.Image) -> None:
    """Bring the icons of an image's colorways up to date, or begin to make them; called before they are drawn."""
    made = None if bpy.app.background else _made(image)
    if made is not None and made is not _shown.get(image.session_uid):
        _shown[image.session_uid] = made
        for index, picture in enumerate(made):
            _fill(_icons.get(_name(image, index)) or _icons.new(_name(image, index)), picture)


def icon(image: bpy.types.Image, index: int) -> int:
    """Icon id of a colorway's picture, which stays while the picture changes; 0 if there is none yet."""
    found = _icons.get(_name(image, index))
    return found.icon_id if found else 0


def _name(image: bpy.types.Image, index: int) -> str:
    return f"{image.session_uid}-{index}"


def _made(image: bpy.types.Image) -> "list[NDArray] | None":
    """Pictures of all colorways, if they have been made."""
    from ..core.errors import DyehouseError

    try:
        look = session.last(image)
        if look is None or not look.prepared.recipe.colorways:
            return None
        proxy = _proxies.ask(look.key, lambda: lambda: _small(look))
        if proxy is None:
            return None
        return _pictures.ask((look.key, look.prepared.recipe), lambda: lambda: _all(proxy, look))
    except DyehouseError:  # the panel says it elsewhere
        return None


def _small(look: session.Look) -> "Proxy":
    from ..core.thumbnail import proxy_of

    return proxy_of(look.prepared)


def _all(proxy: "Proxy", look: session.Look) -> "list[NDArray]":
    from ..core.thumbnail import thumbnail

    prepared = look.prepared
    return [thumbnail(proxy, prepared.for_colorway(colorway)) for colorway in prepared.recipe.colorways]


def _fill(icon: Any, picture: "NDArray") -> None:
    """Put a picture into an icon, in the middle of a transparent square."""
    import numpy as np

    height, width = picture.shape[:2]
    side = max(height, width)
    square = np.zeros((side, side, 4), np.float32)
    top, left = (side - height) // 2, (side - width) // 2
    square[top : top + height, left : left + width] = 1
    square[top : top + height, left : left + width, :3] = picture / np.float32(255)
    pixels = np.ascontiguousarray(square[::-1]).ravel()
    icon.image_size = icon.icon_size = (side, side)
    icon.image_pixels_float.foreach_set(pixels)
    icon.icon_pixels_float.foreach_set(pixels)


def register() -> None:
    """Make room for the icons."""
    global _icons
    _icons = bpy.utils.previews.new()


def unregister() -> None:
    """Drop them."""
    bpy.utils.previews.remove(_icons)
    _shown.clear()
