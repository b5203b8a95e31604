"""The pictures of the README and the docs: `uv run python -m dyehouse.benchmarks.figures`.

Makes docs/figures/before-after.jpg, colorways.jpg and maps.jpg from the demo.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..batch import demo, files
from ..batch.sheet import contact_sheet
from ..core.colorspace import SRGB

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"


def _picture(path: Path) -> NDArray[np.uint8]:
    return np.ascontiguousarray(files.read(path).pixels[..., :3])


def _write(name: str, pixels: NDArray[np.uint8]) -> None:
    FIGURES.mkdir(parents=True, exist_ok=True)
    files.write(FIGURES / name, pixels, files.Photo(Path(), pixels, SRGB), force=True, quality=88)
    print(f"docs/figures/{name}")


def main() -> None:
    """Run the demo and lay its pictures out."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        demo.run(folder, quiet=True)
        photos = {s.name: _picture(demo.sample_photo(s.file)) for s in demo.SUBJECTS}
        _write("colorways.jpg", _picture(folder / "contact-sheet.png"))
        pairs = []
        for subject in demo.SUBJECTS:
            label = subject.colorways[0][0]
            after = _picture(folder / f"{subject.name}-{label}.png")
            pairs.append([("photo", photos[subject.name]), (f"the same photo in {label}", after)])
        _write("before-after.jpg", _side_by_side(pairs))
        rows = []
        for subject in demo.SUBJECTS:
            labels = {
                "mask": "region of one click",
                "A": "A: body reflection",
                "B": "B: surface reflection, x 2",
                "residual": "residual, x 8",
                "error": "predicted error, 0 to 10",
            }
            cells = [(text, _picture(folder / f"{subject.name}-{map_}.png")) for map_, text in labels.items()]
            rows.append([("photo", photos[subject.name]), *cells])
        _write("maps.jpg", contact_sheet(rows, width=300))


def _side_by_side(pairs: list[list[tuple[str, NDArray[np.uint8]]]]) -> NDArray[np.uint8]:
    """Two before/after pairs next to each other, of one height."""
    height = 440
    sheets = [contact_sheet([pair], width=round(height * pair[0][1].shape[1] / pair[0][1].shape[0])) for pair in pairs]
    tall = max(s.shape[0] for s in sheets)
    return np.concatenate([np.pad(s, ((0, tall - s.shape[0]), (0, 0), (0, 0)), mode="edge") for s in sheets], axis=1)


if __name__ == "__main__":
    main()
