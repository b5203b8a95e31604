"""What a designer saw and wrote in Blender's window is what the core makes of the same picks."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dyehouse.batch import files, photo
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

pytestmark = pytest.mark.slow  # minutes of drawing in software


@pytest.fixture
def left(outcome_of: Callable[[str, str], Any]) -> Path:
    """The folder with what the designer left."""
    return outcome_of("designer", "a_product_is_recolored_with_the_mouse").folder


def expected(folder: Path, target: str) -> np.ndarray:
    """(height, width, 3) codes that the core makes for the picks and a target."""
    asked = json.loads((folder / "asked.json").read_text())
    pixels = {key: tuple(asked[key]) for key in ("click", "reference")}
    more = {key: tuple(map(tuple, asked[key])) for key in ("added", "removed")}
    region = Region(target=parse_target(target), mask="click", **pixels, **more)
    opened = files.read(folder / "photo.png")
    prepared = photo.look(opened, Recipe((region,), white=tuple(asked["white"])))
    return photo.recolored(opened, prepared, folder / "expected.png")[0][..., :3]


def test_the_preview_on_the_screen_is_the_core_within_one_code(left: Path) -> None:
    red, green, blue = json.loads((left / "asked.json").read_text())["dragged"]
    codes = expected(left, f"rgb({red!r}, {green!r}, {blue!r})")
    difference = np.abs(np.load(left / "preview.npy").astype(int) - codes)
    assert difference.max() <= 1


def test_every_colorway_was_written_as_the_core_writes_it(left: Path) -> None:
    colorways = json.loads((left / "asked.json").read_text())["colorways"]
    for name, target in colorways.items():
        written = files.read(left / f"photo-{name}.png").pixels[..., :3].astype(int)
        difference = np.abs(written - expected(left, target))
        # Blender's numpy is another build, which rounds some sums the other way.
        assert difference.max() <= 1
        assert np.mean(difference > 0) < 1e-3
