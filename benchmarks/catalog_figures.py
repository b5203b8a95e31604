"""Pictures of docs/catalog.md: `uv run python -m dyehouse.benchmarks.catalog_figures`; needs a Chromium.

Makes the catalog that the page begins with, of the two photographs of the demo.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from ..batch import demo
from ..batch.cli import main as dyehouse

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"


def main() -> None:
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        raise SystemExit("The picture of the page needs a Chromium: install one.")
    with tempfile.TemporaryDirectory() as place:
        shop = Path(place)
        demo.run(shop, quiet=True)
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
