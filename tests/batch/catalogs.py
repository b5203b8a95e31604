"""A small catalog on a real disk, for the tests of `dyehouse batch`."""

import hashlib
import json

import numpy as np
from PIL import Image

from dyehouse.core import transfer

RECIPE = """\
photo = "photos/{name}"
[[region]]
name = "ball"
click = [{x}, {y}]
[[colorway]]
name = "navy"
targets = {{ ball = "#1F4E79" }}
[[colorway]]
name = "green"
targets = {{ ball = "lab(45, -38, 16)" }}
"""


def photo(path, scene):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(transfer.encode(scene.image, transfer.SRGB, np.uint8)).save(path)
    return path


def catalog(folder, product, count=3, size=64):
    """Photos of a ball, each a little different, and a table of two colorways each; returns the table."""
    lines = ["photo,click,colorways"]
    for k in range(count):
        scene = product((0.42 - 0.01 * k, 0.09, 0.05), size=size, seed=k)
        photo(folder / "photos" / f"ball{k}.png", scene)
        x, y = scene.matte
        lines.append(f'photos/ball{k}.png,"{x},{y}",navy=#1F4E79 | green=#2E6B3A')
    table = folder / "catalog.csv"
    table.write_text("\n".join(lines) + "\n")
    return table


def files_of(folder):
    """Every file but the journal, whose seconds differ from run to run, by its hash."""
    return {
        p.relative_to(folder).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name != "dyehouse-journal.jsonl"
    }


def journal_of(folder):
    return [json.loads(line) for line in (folder / "dyehouse-journal.jsonl").read_text().splitlines()]
