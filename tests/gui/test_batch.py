"""`blender --command dyehouse batch` in a real Blender: the files of the command line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB

pytestmark = pytest.mark.slow  # minutes of drawing in software


@pytest.fixture
def table(tmp_path: Path, coffee_file: Path) -> Path:
    codes = files.read(coffee_file).pixels[::3, ::3].copy()
    lines = ["photo,click,colorways"]
    for k in range(3):
        picture = np.roll(codes, k, axis=1)
        files.write(tmp_path / f"cup{k}.png", picture, files.Photo(Path(), picture, SRGB))
        lines.append(f'cup{k}.png,"{27 + k},73",petrol=#17606E | navy=#1F4E79')
    path = tmp_path / "catalog.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def made(folder: Path) -> dict[str, bytes]:
    found = (p for p in folder.rglob("*") if p.is_file() and p.name != "dyehouse-journal.jsonl")
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in found}


def test_the_same_files_as_the_command_line(blender: Any, table: Path, tmp_path: Path) -> None:
    inside = blender.run("--command", "dyehouse", "batch", table, "--out", tmp_path / "inside", "--json")
    assert inside.returncode == 0, inside.stdout + inside.stderr
    entries = [json.loads(line) for line in inside.stdout.splitlines() if line.startswith("{")]
    assert entries[-1]["summary"]["done"] == 6
    outside = blender.python("-m", "dyehouse", "batch", table, "--out", tmp_path / "outside")
    assert outside.returncode == 0, outside.stdout + outside.stderr
    assert len(made(tmp_path / "inside")) == 10
    assert made(tmp_path / "inside") == made(tmp_path / "outside")
    again = blender.run("--command", "dyehouse", "batch", table, "--out", tmp_path / "inside", "--resume")
    assert "6 kept" in again.stdout


def test_without_openimageio_it_says_so(bare_blender: Any, table: Path, tmp_path: Path) -> None:
    done = bare_blender.run("--command", "dyehouse", "batch", table, "--out", tmp_path / "out")
    assert done.returncode in (1, 2)
    assert "OpenImageIO" in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    assert "fault" not in done.stderr
