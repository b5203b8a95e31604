"""Pictures of docs/catalog.md: `uv run python -m dyehouse.benchmarks.catalog_figures`; needs a Chromium.

Makes the catalog that the page begins with, of the two photographs of the demo.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from ..batch.cli import main as dyehouse
from ..batch.demo import sample_photo

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"
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


def main() -> None:
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("The picture of the page needs a Chromium: install one.")
    with tempfile.TemporaryDirectory() as place:
        shop = Path(place)
        (shop / "photos").mkdir()
        for name in ("astronaut.png", "coffee.png"):
            shutil.copy(sample_photo(name), shop / "photos")
        (shop / "suit.toml").write_text(RECIPE)
        (shop / "catalog.csv").write_text(TABLE)
        out = shop / "out"
        arguments = [str(shop / "suit.toml"), str(shop / "catalog.csv"), "--out", str(out), "--max-error", "6"]
        if dyehouse(["batch", *arguments, "--allow-warnings"]):
            raise SystemExit("the catalog failed")
        shutil.copy(out / "sheets" / "coffee.jpg", FIGURES / "catalog-sheet.jpg")
        picture = shop / "page.png"
        command = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        command += [f"--screenshot={picture}", "--window-size=1100,800", (out / "index.html").as_uri()]
        subprocess.run(command, check=True, capture_output=True)
        shutil.copy(picture, FIGURES / "catalog-page.png")


if __name__ == "__main__":
    main()
