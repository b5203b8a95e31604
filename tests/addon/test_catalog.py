"""Catalogs from the panel give the files of `dyehouse batch`, in a Python beside this one."""

import threading
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse.addon.operators import catalog, modal
from dyehouse.batch import files
from dyehouse.batch.cli import main
from dyehouse.core.colorspace import SRGB

pytestmark = pytest.mark.usefixtures("blender")


def made(folder: Path) -> dict[str, bytes]:
    found = (p for p in folder.rglob("*") if p.is_file() and p.suffix != ".jsonl")
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in found}


def test_the_same_files_as_the_command_line(table: Path, tmp_path: Path) -> None:
    assert main(["batch", str(table), "--out", str(tmp_path / "one"), "--workers", "0", "--quiet"]) == 0
    two = tmp_path / "two"
    assert bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(two)) == {"FINISHED"}
    assert made(two) == made(tmp_path / "one")
    assert len(made(two)) == 6
    outcome = catalog.outcome()
    assert outcome.sentence == "3 done, 0 kept, 0 need a person, 0 failed, of 3"
    assert outcome.page == two / "index.html"
    with pytest.raises(RuntimeError, match="exists already"):
        bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(two))
    (two / "a-red.png").unlink()
    assert bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(two), existing="RESUME") == {"FINISHED"}
    assert catalog.outcome().sentence.startswith("1 done, 2 kept")


def test_the_scene_s_settings_hold_for_what_is_not_given(table: Path, tmp_path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    asked = bpy.context.scene.dyehouse_catalog
    asked.jobs, asked.output, asked.max_error = "//catalog.csv", "//finished", 0.001
    assert bpy.ops.dyehouse.check_batch() == {"FINISHED"}
    assert catalog.outcome().sentence == "2 photos, 3 results: all good"
    assert not (tmp_path / "finished").exists()
    assert bpy.ops.dyehouse.run_batch() == {"FINISHED"}
    assert "3 need a person" in catalog.outcome().sentence
    assert len(list((tmp_path / "finished" / "needs-a-person").iterdir())) == 3


def test_one_bad_photo_does_not_stop_the_others(table: Path, tmp_path: Path) -> None:
    (tmp_path / "b.png").write_bytes(b"no picture")
    with pytest.raises(RuntimeError, match=r"row 3.*b\.png' is no picture"):
        bpy.ops.dyehouse.check_batch(jobs=str(table), output=str(tmp_path / "out"))
    assert bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(tmp_path / "out")) == {"FINISHED"}
    outcome = catalog.outcome()
    assert "2 done" in outcome.sentence
    assert "1 failed" in outcome.sentence
    assert "b.png" in outcome.problems[0]


def test_every_problem_is_told_and_nothing_written(table: Path, tmp_path: Path) -> None:
    table.write_text("photo,reference,colorways\n" + "c.png,30 20,navy=blurple\n" * 20)
    with pytest.raises(RuntimeError) as told:
        bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(tmp_path / "out"))
    assert "20 problems, nothing written" in str(told.value)
    assert "row 2" in str(told.value)
    assert "... and 12 more" in str(told.value)
    assert not (tmp_path / "out").exists()
    with pytest.raises(RuntimeError, match="needs a recipe or a table"):
        bpy.ops.dyehouse.run_batch()


def test_a_stopped_catalog_goes_on_later(table: Path, tmp_path: Path) -> None:
    lines = ["photo,reference,colorways"]
    codes = np.full((300, 400, 3), (200, 90, 40), np.uint8)
    for number in range(12):
        files.write(tmp_path / f"p{number}.png", codes, files.Photo(Path(), codes, SRGB))
        lines.append(f"p{number}.png,30 20,navy=#1F4E79 | red=#A02818")
    table.write_text("\n".join(lines) + "\n")
    out = tmp_path / "out"
    job = catalog._Job([str(table), "--out", str(out)])
    outcome: list[BaseException] = []

    def work() -> None:
        try:
            job.work()
        except modal.Stopped as stopped:
            outcome.append(stopped)

    thread = threading.Thread(target=work)
    thread.start()
    deadline = time.monotonic() + 120
    while not job.progress()[0] and time.monotonic() < deadline:
        time.sleep(0.01)
    job.stop()
    thread.join(120)
    assert outcome, "it was not stopped"
    done = job.progress()[0]
    assert 1 <= done < 24
    assert f"{done} done" in job.rest()
    assert not list(out.rglob(".dyehouse-*"))
    assert bpy.ops.dyehouse.run_batch(jobs=str(table), output=str(out), existing="RESUME") == {"FINISHED"}
    assert catalog.outcome().sentence == f"{24 - done} done, {done} kept, 0 need a person, 0 failed, of 24"
