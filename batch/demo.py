"""`dyehouse demo`: two real photographs, several colorways each, from one click; and a small catalog to try."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import FileError
from ..core.recipe import Recipe, Region, with_target
from ..core.swatches import parse_target
from . import files, inspection, photo, sheet


@dataclass(frozen=True)
class Subject:
    """A photo of the demo: its file in scikit-image, and what is picked in it."""

    name: str
    file: str
    about: str
    click: tuple[int, int]
    white: tuple[int, int] | None
    colorways: tuple[tuple[str, str], ...]


SUBJECTS = (
    Subject(
        "astronaut",
        "astronaut.png",
        "Eileen Collins, NASA, public domain",
        click=(100, 350),
        white=None,
        colorways=(
            ("navy", "#1F4E79"),
            ("bottle green", "lab(42, -38, 16)"),
            ("mustard", "#D9A820"),
            ("plum", "lch(32, 42, 335)"),
        ),
    ),
    Subject(
        "coffee",
        "coffee.png",
        "Rachel Michetti, CC0",
        click=(120, 250),
        white=(395, 90),
        colorways=(
            ("petrol", "#17606E"),
            ("leaf green", "lab(45, -40, 25)"),
            ("cobalt", "lch(30, 55, 290)"),
            ("charcoal", "#2B2D2F"),
        ),
    ),
)

# The catalog that docs/catalog.md begins with.
RECIPE = """\
photo = "photos/astronaut.png"

[[region]]
name = "suit"
click = [100, 350]

[[colorway]]
name = "navy"
targets = { suit = "#1F4E79" }

[[colorway]]
name = "bottle green"
targets = { suit = "lab(42, -38, 16)" }

[output]
pattern = "{photo}-{colorway}.jpg"
"""
TABLE = """\
photo,click,white,colorways,output
photos/coffee.png,120 250,395 90,petrol=#17606E | leaf green=lab(45 -40 25) | charcoal=#2B2D2F,{photo}-{colorway}.jpg
"""


def sample_photo(name: str) -> Path:
    """Find a photo that comes with scikit-image.

    Raises
    ------
    FileError
        If scikit-image is not installed.
    """
    found = find_spec("skimage")
    path = Path(found.origin).parent / "data" / name if found and found.origin else None
    if path is None or not path.is_file():
        raise FileError("The demo's photos come with scikit-image, which is not installed: pip install scikit-image.")
    return path


def run(folder: Path, *, quiet: bool = False) -> dict[str, Any]:
    """Make the demo's pictures, maps, contact sheet and catalog.

    Parameters
    ----------
    folder
        Where to; made if need be. Files of an earlier demo are replaced.
    quiet
        Print nothing.

    Returns
    -------
    The folder, the files in it, and a report for each photo, as plain values.
    """
    try:
        (folder / "photos").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder '{folder}' cannot be made ({error.strerror}): choose another one.") from None
    rows, written, reports = [], [], {}
    for subject in SUBJECTS:
        started = time.perf_counter()
        opened = files.read(sample_photo(subject.file))
        region = Region(target=parse_target(subject.colorways[0][1]), click=subject.click)
        recipe = Recipe((region,), white=subject.white)
        prepared = photo.look(opened, recipe)
        cells = [("photo", opened.pixels[..., :3])]
        for label, text in subject.colorways:
            swatch = parse_target(text)
            output = folder / f"{subject.name}-{label.replace(' ', '-')}.png"
            pixels, shares = photo.recolored(opened, prepared, output, [swatch])
            written.append(files.write(output, pixels, opened, force=True))
            cells.append((f"{label}  {text}", np.ascontiguousarray(pixels[..., :3])))
            reports[output.name] = inspection.with_shares(inspection.report(opened, _asking(prepared, swatch)), shares)
        written += inspection.write_maps(prepared, folder, force=True, prefix=f"{subject.name}-")
        rows.append(cells)
        if not quiet:
            first = next(r for name, r in reports.items() if name.startswith(subject.name))["regions"][0]
            print(
                f"{subject.name} ({subject.about}): one click at {subject.click} selects "
                f"{first['covered_share']:.0%} of the picture; model {first['model']}, mean residual "
                f"{first['residual_mean']:.2f} of 255; {len(subject.colorways)} colorways in "
                f"{time.perf_counter() - started:.1f} s"
            )
    overview = sheet.contact_sheet(rows)
    target = folder / "contact-sheet.png"
    files.write(target, overview, files.Photo(Path(), overview, files.SRGB), force=True)
    written += [target, *_catalog(folder)]
    if not quiet:
        print(f"Wrote {len(written)} files to {folder.resolve()}; start with {target.name}")
    return {
        "folder": str(folder.resolve()),
        "files": [path.relative_to(folder).as_posix() for path in written],
        "reports": reports,
    }


def _catalog(folder: Path) -> list[Path]:
    """Write the photos, a recipe for one of them and a table for the other."""
    photos = [folder / "photos" / subject.file for subject in SUBJECTS]
    recipe, table = folder / "suit.toml", folder / "catalog.csv"
    try:
        for path in photos:
            shutil.copyfile(sample_photo(path.name), path)
        recipe.write_text(RECIPE)
        table.write_text(TABLE)
    except OSError as error:
        raise FileError(f"'{folder}' could not be written ({error.strerror}): check the disk and folder.") from None
    return [*photos, recipe, table]


def _asking(prepared: photo.Prepared, swatch: photo.Swatch) -> photo.Prepared:
    """The same analysis under a recipe with another target, for its report."""
    return photo.Prepared(
        with_target(prepared.recipe, swatch),
        prepared.space,
        prepared.white,
        prepared.target_white,
        prepared.analyses,
        prepared.white_source,
    )
