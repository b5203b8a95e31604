"""What `dyehouse swatches` tells: libraries, the swatches in them, and their looks under other lights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..core import builtin_libraries, metamerism
from ..core.library import Library
from ..core.swatch_book import find
from ..core.swatch_files.printer import inks_as
from ..core.swatches import Swatch, parse_target


def libraries() -> dict[str, Any]:
    """The built-in libraries, as plain values."""
    found = [builtin_libraries.builtin(name) for name in builtin_libraries.NAMES]
    return {"libraries": [{"name": lib.name, "swatches": len(lib), "notes": list(lib.notes)} for lib in found]}


def choose(
    place: str, search: str = "", nearest: str | None = None, count: int | None = None, cmyk: str | None = None
) -> tuple[Library, list[float] | None]:
    """Open a library and take some of its swatches.

    Parameters
    ----------
    place
        Name, file or folder; or one swatch of it after a #.
    search
        Words of the names.
    nearest
        A color in any of the forms of targets: the nearest first.
    count
        How many; None for all, or ten of the nearest.
    cmyk
        What CMYK of a file means: a profile, or "plain".

    Returns
    -------
    library
        Those swatches in their groups, and the notes of the whole.
    differences
        CIEDE2000 of each from `nearest`.
    """
    where, _, name = place.partition("#")
    library = find(where, inks=inks_as(cmyk) if cmyk else None)
    if name:
        return Library.of(library.name, [library.named(name)], library.notes), None
    chosen = library.search(search)
    differences = None
    if nearest is not None:
        order, away = library.nearest(parse_target(nearest), len(library))
        wanted = set(chosen)
        pairs = [(int(k), float(d)) for k, d in zip(order, away, strict=True) if int(k) in wanted][: count or 10]
        chosen, differences = [k for k, _ in pairs], [d for _, d in pairs]
    return library.subset(chosen[:count]), differences


def report(
    library: Library, differences: list[float] | None, under: Sequence[str] = (), against: str | None = None
) -> dict[str, Any]:
    """Swatches as plain values, with their looks under lights and their metamerism against another swatch."""
    rows: list[dict[str, Any]] = []
    items = zip(library.group_names, library.swatches, library.lab, library.display_colors, strict=True)
    for group, swatch, lab, codes in items:
        row = {
            "name": swatch.text,
            "group": group,
            "kind": swatch.kind,
            "lab_d50": [round(float(value), 4) for value in lab],
            "srgb": Swatch.from_srgb(codes).text,
            "color": swatch.written,
        }
        rows.append(row | _metamerism(swatch, under, against))
    if differences is not None:
        rows = [row | {"ciede2000": round(d, 4)} for row, d in zip(rows, differences, strict=True)]
    return {"library": library.name, "notes": list(library.notes), "swatches": rows}


def _metamerism(swatch: Swatch, under: Sequence[str], against: str | None) -> dict[str, Any]:
    if not under and against is None:
        return {}
    if unknown := metamerism.cannot_be_known(swatch):
        return {"unknown": unknown}
    lights = under or metamerism.LIGHTS
    found: dict[str, Any] = {}
    if under:
        looks = metamerism.under_lights(swatch, lights)
        found["looks"] = [
            {
                "light": look.light,
                "lab": [round(float(value), 4) for value in look.lab],
                "srgb": Swatch.from_srgb(look.display).text,
                "shift_ciede2000": round(look.shift, 4),
            }
            for look in looks
        ]
    if against is not None:
        other = parse_target(against)
        indices = [metamerism.special_index(other, swatch, light) for light in lights if light != "D65"]
        found["metamerism"] = [{"test": i.test, "index": i.value, "sentence": i.sentence} for i in indices]
    return found


def in_words(figures: dict[str, Any]) -> str:
    """The report for people."""
    if "libraries" in figures:
        return "\n".join(
            f"{lib['name']:26}{lib['swatches']:6}  {' '.join(lib['notes'])}" for lib in figures["libraries"]
        )
    lines = [f"Note: {note}" for note in figures["notes"]]
    for row in figures["swatches"]:
        L, a, b = row["lab_d50"]
        away = f"  {row['ciede2000']:6.2f} away" if "ciede2000" in row else ""
        lines.append(f"{row['srgb']}  Lab {L:6.2f} {a:7.2f} {b:7.2f}{away}  {row['name']}  ({row['kind']})")
        for look in row.get("looks", []):
            L, a, b = look["lab"]
            lines.append(
                f"  {look['srgb']}  Lab {L:6.2f} {a:7.2f} {b:7.2f}  under {look['light']}, shift "
                f"{look['shift_ciede2000']:.2f}"
            )
        lines += [f"  {index['sentence']}" for index in row.get("metamerism", [])]
        lines += [f"  {row['unknown']}"] if "unknown" in row else []
    lines += [f"Note: {note}" for note in figures.get("losses", [])]
    lines += [f"Wrote {figures['output']}"] if "output" in figures else []
    return "\n".join(lines)
