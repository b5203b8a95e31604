"""The swatch book in Blender: one book for the session, what the browser shows of it, and icons of colors."""

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import bpy
import bpy.utils.previews
from bpy.props import EnumProperty, IntProperty, PointerProperty, StringProperty

if TYPE_CHECKING:
    from ..core.swatch_book import Book, Hit
    from ..core.swatches import Swatch

PACKAGE = __package__.rpartition(".")[0]
PER_PAGE = 40
_ICON_SIZE = 16
_MOST_ICONS = 4000
_MOST_HITS = 2000

_books: "list[Book]" = []
_icons: list[Any] = []
_found: dict[tuple[object, ...], "list[Hit]"] = {}
# Kept alive: Blender does not hold on to the strings of a computed list.
_names: list[tuple[str, str, str]] = []

LISTS = (
    ("LIBRARY", "Library", "Swatches of the library, or of all, whose names have the words"),
    ("NEAREST", "Nearest", "Swatches nearest to the target by CIEDE2000"),
    ("FAVORITES", "Favorites", "Swatches that are marked"),
    ("RECENT", "Recent", "Swatches that were used last"),
)


def book() -> "Book":
    """The user's swatch book, made when it is first needed."""
    if not _books:
        from ..core.swatch_book import Book

        _books.append(Book(folder()))
    return _books[0]


def folder() -> str:
    """The folder of the user's libraries: in the extension's own folder."""
    try:
        return bpy.utils.extension_path_user(PACKAGE, path="swatches")
    except ValueError:  # run from a checkout, not installed as an extension
        return bpy.utils.user_resource("DATAFILES", path="dyehouse/swatches")


def changed() -> None:
    """Tell that the book has other swatches than before."""
    _found.clear()


def _libraries(_self: object, _context: object) -> list[tuple[str, str, str]]:
    named = [("ALL", "All Libraries", "Every library of the swatch book")]
    named += [(name, name, "Your own" if book().is_own(name) else "Built in") for name in book().names]
    if named != _names:
        _names[:] = named
    return _names


def _first_page(self: "DyehouseBrowser", _context: object) -> None:
    self.page = 0


class DyehouseBrowser(bpy.types.PropertyGroup):
    """What the swatch browser shows; not saved."""

    listing: EnumProperty(name="Show", items=LISTS, update=_first_page)
    library: EnumProperty(name="Library", items=_libraries, update=_first_page)
    search: StringProperty(
        name="Search", description="Words of the swatch's name", options={"TEXTEDIT_UPDATE"}, update=_first_page
    )
    page: IntProperty(name="Page", min=0)
    palette: StringProperty(name="Palette", description="Palette of this .blend, to make a library of")


def browser() -> DyehouseBrowser:
    """State of the browser."""
    return bpy.context.window_manager.dyehouse_browser


def shown(target: "Swatch | None") -> "list[Hit]":
    """All swatches that the browser lists now, for the target of the active region."""
    from ..core.errors import DyehouseError
    from ..core.swatch_book import Hit

    state = browser()
    library = None if state.library == "ALL" else state.library
    if state.listing in {"FAVORITES", "RECENT"}:
        kept = book().favorites if state.listing == "FAVORITES" else book().recent
        return [Hit("", index, swatch) for index, swatch in enumerate(kept)]
    asked = target.text if target and state.listing == "NEAREST" else state.search
    key = (state.listing, library, asked)
    if key not in _found:
        _found.clear()
        try:
            if state.listing == "NEAREST":
                _found[key] = book().nearest(target, library, PER_PAGE) if target else []
            else:
                _found[key] = book().search(state.search, library, _MOST_HITS)
        except DyehouseError as error:
            book().problems.append(str(error))
            _found[key] = []
    return _found[key]


def icon_of(swatch: "Swatch") -> int:
    """Icon id of a swatch's color; 0 in background, where Blender draws none."""
    return icon_of_color(codes_of(swatch))


@lru_cache(maxsize=4096)
def codes_of(swatch: "Swatch") -> tuple[float, ...]:
    """SRGB codes 0..1 to show a swatch by: found once, and not for forty swatches whenever the panel is drawn."""
    from ..core.library import Library

    return tuple(Library.of("", [swatch]).display_colors[0])


def icon_of_color(codes: tuple[float, ...]) -> int:
    """Icon id of sRGB codes 0..1."""
    import numpy as np

    if not _icons:
        _icons.append(bpy.utils.previews.new())
    made = _icons[0]
    name = "".join(f"{round(255 * float(code)):02X}" for code in codes[:3])
    if name not in made:
        if len(made) >= _MOST_ICONS:
            made.clear()
        preview = made.new(name)
        preview.icon_size = preview.image_size = (_ICON_SIZE, _ICON_SIZE)
        tile = np.tile(np.array([*codes[:3], 1], np.float32), _ICON_SIZE * _ICON_SIZE)
        preview.icon_pixels_float.foreach_set(tile)
        preview.image_pixels_float.foreach_set(tile)
    return made[name].icon_id


def register() -> None:
    """Keep the browser's state with the window manager, which no .blend saves."""
    bpy.utils.register_class(DyehouseBrowser)
    bpy.types.WindowManager.dyehouse_browser = PointerProperty(type=DyehouseBrowser, options={"SKIP_SAVE"})


def unregister() -> None:
    """Drop the state, the book and the icons."""
    del bpy.types.WindowManager.dyehouse_browser
    bpy.utils.unregister_class(DyehouseBrowser)
    while _icons:
        bpy.utils.previews.remove(_icons.pop())
    _books.clear()
    _found.clear()
    _names.clear()
