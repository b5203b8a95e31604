"""Colorways and the targets of the regions: what is chosen in the list is shown, and what is changed is kept in it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .properties import DyehousePhoto, DyehouseTarget

_copying: list[bool] = []


def copying() -> bool:
    """Whether targets are being set from each other, and not by the user."""
    return bool(_copying)


@contextmanager
def quiet() -> Iterator[None]:
    """Set targets without setting others by them."""
    _copying.append(True)
    try:
        yield
    finally:
        _copying.pop()


def chosen(settings: "DyehousePhoto") -> None:
    """Give the regions the targets of the active colorway; regions that it has none for keep their color."""
    if not 0 <= settings.active_colorway < len(settings.colorways):
        return
    targets = settings.colorways[settings.active_colorway].targets
    for index, region in enumerate(settings.regions):
        if index < len(targets):
            copy(targets[index], region.target)
        else:
            _set_used(region.target, False)


def changed(target: "DyehouseTarget") -> None:
    """Keep a region's changed target in the active colorway, or show a change in the active colorway."""
    if _copying:
        return
    settings = target.id_data.dyehouse
    if not 0 <= settings.active_colorway < len(settings.colorways):
        return
    colorway = settings.colorways[settings.active_colorway]
    for index, region in enumerate(settings.regions):
        if target == region.target:
            keep(settings)
        elif index < len(colorway.targets) and target == colorway.targets[index]:
            copy(target, region.target)


def keep(settings: "DyehousePhoto") -> None:
    """Store the regions' targets in the active colorway."""
    targets = settings.colorways[settings.active_colorway].targets
    for index, region in enumerate(settings.regions):
        copy(region.target, targets[index] if index < len(targets) else targets.add())
    while len(targets) > len(settings.regions):
        targets.remove(len(targets) - 1)


def fill(settings: "DyehousePhoto") -> None:
    """Give every colorway a target for each region, that keeps its color where there was none."""
    for colorway in settings.colorways:
        while len(colorway.targets) < len(settings.regions):
            _set_used(colorway.targets.add(), False)


def copy(source: "DyehouseTarget", target: "DyehouseTarget") -> None:
    """Make a target the same as another one."""
    _set_used(target, source.used)
    with quiet():
        if target.text != source.text:
            target.text = source.text
        if not source.text and tuple(target.color) != tuple(source.color):
            target.color = source.color
        target.swatch_name = source.swatch_name


def _set_used(target: "DyehouseTarget", used: bool) -> None:
    with quiet():
        if target.used != used:
            target.used = used
