"""`dyehouse batch` on real files: the same pixels as one photo at a time, and what goes wrong without stopping it."""

import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dyehouse.batch.catalog import Run, Settings
from dyehouse.batch.cli import main
from dyehouse.batch.jobs import gather

from .catalogs import RECIPE, catalog, files_of, journal_of, photo


@pytest.fixture
def run(capsys):
    """Run `dyehouse batch` in this process; returns (exit code, stdout, stderr)."""

    def call(*arguments, command="batch", workers="0"):
        capsys.readouterr()
        extra = ["--workers", workers] if command == "batch" else []
        code = main([command, *[str(a) for a in arguments], *extra])
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.fixture
def shop(tmp_path, product):
    """A folder with three photos and their table."""
    return catalog(tmp_path / "shop", product)


# --- what it writes -------------------------------------------------------------------------------------------


def test_the_same_pixels_as_the_command_for_one_photo(run, shop, tmp_path, product):
    out = tmp_path / "out"
    code, said, err = run(shop, "--out", out)
    assert (code, err) == (0, "")
    assert "6 done, 0 kept, 0 need a person, 0 failed, of 6" in said
    names = [f"ball{k}-{color}.png" for k in range(3) for color in ("navy", "green")]
    sheets = [f"sheets/ball{k}.jpg" for k in range(3)]
    assert set(files_of(out)) == {*names, *sheets, "index.html"}
    x, y = product((0.41, 0.09, 0.05), size=64, seed=1).matte
    alone = tmp_path / "alone.png"
    arguments = (shop.parent / "photos" / "ball1.png", "--click", f"{x},{y}", "--target", "#1F4E79", "-o", alone)
    assert run(*arguments, command="recolor")[0] == 0
    assert (out / "ball1-navy.png").read_bytes() == alone.read_bytes()


def test_a_recipe_file_is_the_same_in_recolor_and_batch(run, tmp_path, product):
    scene = product(size=64)
    photo(tmp_path / "photos" / "ball.png", scene)
    recipe = tmp_path / "ball.toml"
    recipe.write_text(
        RECIPE.format(name="ball.png", x=scene.matte[0], y=scene.matte[1])
        + '[output]\npattern = "{photo}-{colorway}.jpg"\nquality = 70\n'
    )
    assert run(recipe, "--out", tmp_path / "out")[0] == 0
    for colorway in ("navy", "green"):
        single = tmp_path / f"{colorway}.jpg"
        arguments = (tmp_path / "photos" / "ball.png", "--recipe", recipe, "--colorway", colorway, "-o", single)
        assert run(*arguments, command="recolor")[0] == 0
        assert (tmp_path / "out" / f"ball-{colorway}.jpg").read_bytes() == single.read_bytes()
    code, said, _ = run(tmp_path / "photos" / "ball.png", "--recipe", recipe, "--colorway", "navy", command="inspect")
    assert code == 0
    assert "#1F4E79" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--colorway", "navi"], "Colorway 'navi' is not in .*did you mean 'navy'"),
        ([], "has several colorways: choose one with --colorway navy, green"),
        (["--colorway", "navy", "--click", "1,2"], "--click and --recipe contradict each other"),
        (["--colorway", "navy", "--white", "D65"], "--white and --recipe contradict each other"),
    ],
)
def test_recolor_with_a_recipe_says_what_is_wrong(run, tmp_path, product, arguments, words):
    scene = product(size=64)
    photo(tmp_path / "photos" / "ball.png", scene)
    recipe = tmp_path / "ball.toml"
    recipe.write_text(RECIPE.format(name="ball.png", x=scene.matte[0], y=scene.matte[1]))
    given = (tmp_path / "photos" / "ball.png", "--recipe", recipe, "-o", tmp_path / "o.png", *arguments)
    code, _, err = run(*given, command="recolor")
    assert code == 2
    assert re.search(words, err)
    assert not (tmp_path / "o.png").exists()


def test_processes_threads_and_tasks_of_several_photos_give_the_same_files(run, shop, tmp_path):
    run(shop, "--out", tmp_path / "one")
    expected = files_of(tmp_path / "one")
    assert run(shop, "--out", tmp_path / "two", workers="2")[0] == 0
    assert run(shop, "--out", tmp_path / "three", "--per-task", "2")[0] == 0
    assert files_of(tmp_path / "two") == expected == files_of(tmp_path / "three")


def test_the_journal_tells_what_was_done(run, shop, tmp_path):
    run(shop, "--out", tmp_path / "out")
    entries = {entry["output"]: entry for entry in journal_of(tmp_path / "out")}
    entry = entries["ball0-navy.png"]
    assert entry["status"] == "done"
    assert entry["source"] == f"'{shop}', row 2"
    assert entry["sha256"] == files_of(tmp_path / "out")["ball0-navy.png"]
    assert set(entry) >= {"input", "settings", "model", "predicted_error", "warnings", "seconds", "colorway", "photo"}
    assert 0 <= entry["predicted_error"]["median"] <= entry["predicted_error"]["bound90"]
    assert entries["sheets/ball0.jpg"]["cells"] == ["ball0-navy.png", "ball0-green.png"]


def test_json_is_one_object_a_line(run, shop, tmp_path):
    code, said, err = run(shop, "--out", tmp_path / "out", "--json")
    *entries, last = [json.loads(line) for line in said.splitlines()]
    assert (code, err) == (0, "")
    assert sorted(entry["output"] for entry in entries) == sorted(
        n for n in files_of(tmp_path / "out") if "ball" in n[:4]
    )
    assert last["summary"]["done"] == 6
    assert last["summary"]["failed"] == 0


def test_quiet_is_quiet(run, shop, tmp_path):
    assert run(shop, "--out", tmp_path / "out", "--quiet") == (0, "", "")


def test_without_sheets(run, shop, tmp_path):
    run(shop, "--out", tmp_path / "out", "--no-sheets")
    assert len(files_of(tmp_path / "out")) == 6


def test_progress_without_rich(run, shop, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rich.progress", None)
    monkeypatch.setattr("dyehouse.batch.catalog._TELL_EVERY", 0.0)
    _, _, err = run(shop, "--out", tmp_path / "out")
    assert re.search(r"1 of 6, [\d.]+ a second, \d+ s left", err)
    assert re.search(r"6 of 6, [\d.]+ a second, 0 s left", err)


def test_progress_on_a_terminal(shop, tmp_path):
    ours, theirs = os.openpty()
    command = [sys.executable, "-m", "dyehouse", "batch", str(shop), "--out", str(tmp_path / "out"), "--workers", "0"]
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "120"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, text=True, env=environment) as process:
        os.close(theirs)
        shown = b""
        with contextlib.suppress(OSError):  # how a terminal says that the other end is closed
            while part := os.read(ours, 4096):
                shown += part
        said = process.stdout.read()
    os.close(ours)
    assert process.returncode == 0
    assert said.startswith("6 done")
    assert re.search(rb"Recoloring.*6/6.* a second.*0:00", shown, re.DOTALL)


# --- check ----------------------------------------------------------------------------------------------------


def test_check_writes_nothing_and_finds_everything(run, shop, tmp_path):
    shutil.copy(shop, shop.with_name("good.csv"))
    assert run(shop.with_name("good.csv"), "--out", tmp_path / "out", "--check")[:2] == (
        0,
        "3 photos, 6 results: all good\n",
    )
    (shop.parent / "photos" / "broken.png").write_bytes(b"\x89PNG no more")
    (shop.parent / "photos" / "empty.png").touch()
    (shop.parent / "loop.png").symlink_to(shop.parent / "loop.png")
    Image.new("L", (10, 10), 255).save(shop.parent / "small.png")
    shop.write_text(
        "photo,click,mask,target,output,compression\n"
        'photos/ball0.png,"99,1",,#fff\n'
        "photos/ball1.png,,small.png,#fff\n"
        "photos/ball2.png,,no.png,#fff\n"
        "photos/broken.png,,,#fff\n"
        "photos/empty.png,,,#fff\n"
        "loop.png,,,#fff\n"
        "photos,,,#fff\n"
        "photos/ball0.png,,alpha,#000\n"
        "photos/ball0.png,,,#000,a.tif,zipp\n"
    )
    code, _, err = run(shop, "--out", tmp_path / "out", "--check")
    assert code == 2
    for row, words in (
        (2, r"column 'click': click \(99, 1\) lies outside the photo of 64 x 64 pixels"),
        (3, r"column 'mask': .*small.png' is 10 x 10 pixels and photo .* 64 x 64: make it the size"),
        (4, r"column 'mask': .*no.png' cannot be read \(No such file"),
        (5, r"column 'photo': .*broken.png' is no picture, or is damaged"),
        (6, r"empty.png' is empty"),
        (7, r"loop.png' cannot be read \(Too many levels of symbolic links\)"),
        (8, r"photos' cannot be read \(Is a directory\)"),
        (9, r"column 'mask': .*ball0.png' has no alpha to take the mask from"),
        (10, r"column 'compression': The compression 'zipp' is not known for tiff: use none, lzw"),
    ):
        assert re.search(f"row {row}, .*{words}", err), (row, err)
    assert "9 problems, nothing written" in err
    rows = [int(found) for found in re.findall(r"row (\d+)", err)]
    assert rows == sorted(rows)
    assert not (tmp_path / "out").exists()
    said = run(shop, "--out", tmp_path / "out", "--check", "--json")[1]
    first, *others = [json.loads(line) for line in said.splitlines()]
    assert (first["file"], first["row"], first["column"]) == (str(shop), 2, "click")
    assert first["error"].startswith("click (99, 1) lies outside")
    assert len(others) == 8


def test_a_turned_photo_is_checked_upright(run, tmp_path, product):
    scene = product(size=64)
    codes = Image.fromarray((scene.image.clip(0, 1) * 255).astype(np.uint8)[:, :40])
    exif = Image.Exif()
    exif[0x0112] = 6
    codes.save(tmp_path / "turned.jpg", exif=exif)
    (tmp_path / "t.csv").write_text('photo,click,target\nturned.jpg,"60,30",#1F4E79\n')
    assert run(tmp_path / "t.csv", "--out", tmp_path / "out", "--check")[0] == 0
    (tmp_path / "t.csv").write_text('photo,click,target\nturned.jpg,"30,60",#1F4E79\n')
    assert "of 64 x 40 pixels" in run(tmp_path / "t.csv", "--out", tmp_path / "out", "--check")[2]


# --- what goes wrong ------------------------------------------------------------------------------------------


def test_one_bad_photo_does_not_stop_the_others(run, shop, tmp_path):
    shop.write_text(shop.read_text() + 'photos/no.png,,x=#fff\nphotos/ball0.png,"500,3",y=#fff\n')
    (shop.parent / "photos" / "ball1.png").write_bytes((shop.parent / "photos" / "ball1.png").read_bytes()[:999])
    code, said, err = run(shop, "--out", tmp_path / "out")
    assert code == 1
    assert "4 done, 0 kept, 0 need a person, 4 failed, of 8" in said
    assert re.search(r"row 5: 'no-x.png' failed: .*no.png' does not exist", err)
    assert re.search(r"row 6: 'ball0-y.png' failed: Click \(500, 3\) lies outside", err)
    assert re.search(r"row 3: 'ball1-navy.png' failed: .*ball1.png' is damaged or cut short", err)
    assert sorted(n for n in files_of(tmp_path / "out") if n.endswith(".png")) == [
        f"ball{k}-{c}.png" for k in (0, 2) for c in ("green", "navy")
    ]


def test_missing_mask_and_bad_colorway_of_one_photo(run, shop, tmp_path):
    shop.write_text("photo,mask,target,colorway\nphotos/ball0.png,no.png,#fff,a\nphotos/ball1.png,,#1F4E79,b\n")
    code, _, err = run(shop, "--out", tmp_path / "out")
    assert code == 1
    assert re.search(r"row 2: 'ball0-a.png' failed: .*no.png' does not exist", err)
    assert (tmp_path / "out" / "ball1-b.png").exists()


def test_a_bad_table_stops_before_anything(run, shop, tmp_path):
    shop.write_text(shop.read_text() + "photos/ball0.png,,z=snow\n")
    code, _, err = run(shop, "--out", tmp_path / "out")
    assert code == 2
    assert "row 5, column 'colorways': Target 'snow'" in err
    assert not (tmp_path / "out").exists()


def test_outputs_are_never_overwritten_unasked(run, shop, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "ball0-navy.png").write_bytes(b"mine")
    code, _, err = run(shop, "--out", out)
    assert code == 2
    assert "ball0-navy.png' exists already: give --resume to go on, or --force" in err
    assert files_of(out) == {"ball0-navy.png": files_of(out)["ball0-navy.png"]}
    assert run(shop, "--out", out, "--force")[0] == 0
    assert (out / "ball0-navy.png").read_bytes() != b"mine"
    shutil.rmtree(out / "sheets")
    for name in files_of(out):
        (out / name).unlink()
    assert "holds an earlier run: give --resume" in run(shop, "--out", out)[2]


def test_a_page_of_someone_else_s_is_not_overwritten(run, shop, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    (out / "index.html").write_text("mine")
    code, _, err = run(shop, "--out", out)
    assert code == 2
    assert "index.html' exists already: give --resume" in err
    assert run(shop, "--out", out, "--no-sheets")[0] == 0
    assert (out / "index.html").read_text() == "mine"
    assert run(shop, "--out", out, "--force")[0] == 0
    assert "mine" not in (out / "index.html").read_text()


@pytest.mark.parametrize("content", ["photo,target\na.png,#fff\n", '{"photo": "a.png", "output": "b.png"}\n', "no end"])
def test_what_is_no_journal_is_left_alone(run, shop, tmp_path, content):
    table = tmp_path / "table.csv"
    table.write_text(content)
    code, _, err = run(shop, "--out", tmp_path / "out", "--journal", table, "--force")
    assert code == 2
    assert "table.csv' is no journal of Dyehouse" in err
    assert table.read_text() == content


def test_only_unfinished_files_of_a_run_are_removed(run, tmp_path, product):
    scene = product(size=64)
    mine = photo(tmp_path / ".dyehouse-photo.png", scene)
    (tmp_path / ".dyehouse-0123456789ab.png").write_bytes(b"half")
    x, y = scene.matte
    (tmp_path / "t.csv").write_text(f'photo,click,target,output\n{mine.name},"{x},{y}",#1F4E79,a.png\n')
    assert run(tmp_path / "t.csv", "--out", tmp_path)[0] == 0
    assert {path.name for path in tmp_path.glob(".dyehouse-*")} == {mine.name}


@pytest.mark.parametrize("pattern", ["./ball1.png", ".//ball1.png", "x/../ball1.png", r".\ball1.png"])
def test_no_other_spelling_of_a_name_reaches_an_input(run, tmp_path, product, pattern):
    table = catalog(tmp_path / "shop", product, 2)
    before = files_of(tmp_path / "shop" / "photos")
    table.write_text(f"photo,mask,target,output\nphotos/ball0.png,photos/ball1.png,#1F4E79,{pattern}\n")
    assert run(table, "--out", tmp_path / "shop" / "photos", "--force")[0] == 2
    assert files_of(tmp_path / "shop" / "photos") == before


@pytest.mark.parametrize("option", ["--force", "--resume"])
def test_inputs_are_never_touched(run, tmp_path, product, option):
    table = catalog(tmp_path / "shop", product, 1)
    before = files_of(tmp_path)
    table.write_text("photo,target,output\nphotos/ball0.png,#1F4E79,{photo}.png\n")
    code, _, err = run(table, "--out", tmp_path / "shop" / "photos", option)
    assert code == 2
    assert "is a file that the run reads" in err
    os.link(tmp_path / "shop" / "photos" / "ball0.png", tmp_path / "other.png")  # one file of two names
    table.write_text("photo,target,output\n../other.png,#1F4E79,ball0.png\n")
    assert "is a file that the run reads" in run(table, "--out", tmp_path / "shop" / "photos", option)[2]
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "shop" / "photos")
    assert run(table, "--out", link, option)[0] == 2
    assert files_of(tmp_path)["shop/photos/ball0.png"] == before["shop/photos/ball0.png"]


def test_a_link_out_of_the_output_folder(run, tmp_path, product):
    table = catalog(tmp_path / "shop", product, 1)
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out" / "x").symlink_to(tmp_path / "elsewhere")
    table.write_text("photo,target,output\nphotos/ball0.png,#1F4E79,x/{photo}.png\n")
    code, _, err = run(table, "--out", tmp_path / "out")
    assert code == 1
    assert "leads out of the output folder by a link" in err
    assert not list((tmp_path / "elsewhere").iterdir())


@pytest.fixture
def disk(tmp_path):
    """Mounts a small disk; gives its folder."""
    place = tmp_path / "disk"

    def mount(options):
        place.mkdir()
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)], capture_output=True)
        if done.returncode:
            pytest.skip("no right to mount a small disk")
        return place

    yield mount
    if os.path.ismount(place):
        subprocess.run(["umount", str(place)], check=True)


def test_read_only_output(run, shop, tmp_path, disk):
    (tmp_path / "file").write_text("a file")
    code, _, err = run(shop, "--out", tmp_path / "file")
    assert code == 2
    assert "cannot be made (File exists): choose another one" in err
    out = disk("size=1m,ro")
    for folder in (out, out / "new"):
        code, _, err = run(shop, "--out", folder)
        assert code == 2
        assert re.search(r"is not writable|cannot be made \(Read-only", err)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--workers", "-1"], "--workers -1 is too few"),
        (["--per-task", "0"], "--per-task 0 is too few"),
        (["--max-error", "nan"], "is no color difference"),
        (["--resume", "--force"], "contradict each other"),
        (["--recipe", "no.toml"], "cannot be read"),
    ],
)
def test_bad_options(shop, tmp_path, capsys, options, words):
    assert main(["batch", str(shop), "--out", str(tmp_path / "out"), *options]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_very_long_and_non_ascii_names(run, tmp_path, product):
    scene = product(size=64)
    long = "ß" * 110
    for name in (long, "鞋 größe %41 #1"):
        photo(tmp_path / f"{name}.png", scene)
    x, y = scene.matte
    rows = [f'"{n}.png","{x},{y}",été=#1F4E79' for n in (long, "鞋 größe %41 #1")]
    (tmp_path / "t.csv").write_text("photo,click,colorways\n" + "\n".join(rows) + "\n")
    assert run(tmp_path / "t.csv", "--out", tmp_path / "out")[0] == 0
    assert {f"{long}-été.png", "鞋 größe %41 #1-été.png"} <= set(files_of(tmp_path / "out"))
    page = (tmp_path / "out" / "index.html").read_text()
    assert "%E9%9E%8B%20gr%C3%B6%C3%9Fe%20%2541%20%231-%C3%A9t%C3%A9.png" in page


# --- the gate -------------------------------------------------------------------------------------------------


def test_the_gate_sets_aside_with_a_reason(run, shop, tmp_path):
    out = tmp_path / "out"
    code, said, _ = run(shop, "--out", out, "--max-error", "0")
    assert code == 0
    assert "0 done, 0 kept, 6 need a person" in said
    assert set(files_of(out)) >= {"needs-a-person/ball0-navy.png"}
    assert "ball0-navy.png" not in files_of(out)
    entry = journal_of(out)[0]
    assert entry["status"] == "needs a person"
    assert re.search(r"the predicted error is .* more than 0", entry["reason"])
    # A wider gate lets them through, and what was set aside goes.
    code, said, _ = run(shop, "--out", out, "--max-error", "50", "--allow-warnings", "--resume")
    assert "6 done" in said
    assert not [name for name in files_of(out) if name.startswith("needs")]
    # So does making all anew, in either direction: a result is in one place.
    for gate, place in (("0", "needs-a-person/ball0-navy.png"), ("50", "ball0-navy.png")):
        assert run(shop, "--out", out, "--force", "--max-error", gate, "--allow-warnings")[0] == 0
        assert [name for name in files_of(out) if name.endswith("ball0-navy.png")] == [place]


def test_the_gate_reads_warnings(run, tmp_path, product):
    photo(tmp_path / "grey.png", product((0.4, 0.4, 0.4), size=64))
    (tmp_path / "t.csv").write_text("photo,target\ngrey.png,#1F4E79\n")
    _, said, _ = run(tmp_path / "t.csv", "--out", tmp_path / "out", "--max-error", "100")
    assert "1 need a person" in said
    assert journal_of(tmp_path / "out")[0]["reason"]
    _, said, _ = run(tmp_path / "t.csv", "--out", tmp_path / "all", "--max-error", "100", "--allow-warnings")
    assert "1 done" in said


# --- going on -------------------------------------------------------------------------------------------------


def test_resume_does_only_what_is_missing_or_changed(run, shop, tmp_path, product):
    out = tmp_path / "out"
    run(shop, "--out", out)
    expected = files_of(out)
    assert "6 kept" in run(shop, "--out", out, "--resume")[1]
    assert files_of(out) == expected

    (out / "ball0-navy.png").unlink()
    (out / "ball1-green.png").write_bytes(b"spoilt")
    (out / "sheets" / "ball2.jpg").unlink()
    stamps = {name: (out / name).stat().st_mtime_ns for name in ("ball0-green.png", "ball2-navy.png")}
    _, said, _ = run(shop, "--out", out, "--resume")
    assert "2 done, 4 kept" in said
    assert files_of(out) == expected
    assert {name: (out / name).stat().st_mtime_ns for name in stamps} == stamps

    shop.write_text(shop.read_text().replace("green=#2E6B3A", "green=#2E6B3B"))
    assert "3 done, 3 kept" in run(shop, "--out", out, "--resume")[1]


def test_resume_sees_changed_inputs_whatever_the_clock_says(run, shop, tmp_path, product):
    out = tmp_path / "out"
    run(shop, "--out", out)
    changed = shop.parent / "photos" / "ball1.png"
    stamp = changed.stat().st_mtime
    photo(changed, product((0.3, 0.2, 0.05), size=64))
    os.utime(changed, (stamp - 1e6, stamp - 1e6))  # the clock was set back
    _, said, _ = run(shop, "--out", out, "--resume")
    assert "2 done, 4 kept" in said


def test_resume_after_more_colorways(run, shop, tmp_path):
    out, whole = tmp_path / "out", tmp_path / "whole"
    run(shop, "--out", out)
    shop.write_text(shop.read_text().replace("green=#2E6B3A", "green=#2E6B3A | sand=#C8B88A"))
    assert "3 done, 6 kept" in run(shop, "--out", out, "--resume")[1]
    run(shop, "--out", whole)
    assert files_of(out) == files_of(whole)


def test_a_torn_journal_and_unfinished_files(run, shop, tmp_path):
    out = tmp_path / "out"
    run(shop, "--out", out)
    expected = files_of(out)
    journal = out / "dyehouse-journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:-1]) + lines[-1][:40])
    (out / ".dyehouse-0123456789ab.png").write_bytes(b"half")
    assert run(shop, "--out", out, "--resume")[0] == 0
    assert files_of(out) == expected
    assert "6 kept" in run(shop, "--out", out, "--resume")[1]


def test_two_runs_in_one_folder(run, shop, tmp_path, monkeypatch):
    monkeypatch.setattr("dyehouse.batch.journal._PATIENCE", 0.2)
    jobs, _ = gather([str(shop)])
    first = Run(jobs, Settings(str(tmp_path / "out"), workers=0))
    code, _, err = run(shop, "--out", tmp_path / "out", "--resume")
    assert code == 2
    assert "Another run is writing to" in err
    assert len(list(first.entries())) == 6


def test_stop_finishes_what_is_under_way(shop, tmp_path, run):
    jobs, _ = gather([str(shop)])
    going = Run(jobs, Settings(str(tmp_path / "out"), workers=0))
    seen = []
    for entry in going.entries():
        seen.append(entry["output"])
        going.stop.asked = True
    assert 2 <= len(seen) < 6
    assert set(seen) <= set(files_of(tmp_path / "out"))
    assert "kept" in run(shop, "--out", tmp_path / "out", "--resume")[1]
    run(shop, "--out", tmp_path / "whole")
    assert files_of(tmp_path / "out") == files_of(tmp_path / "whole")


def started(table, out, *options):
    command = [sys.executable, "-m", "dyehouse", "batch", str(table), "--out", str(out), "--json", *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(process):
    """Wait for a process; returns (exit code, the lines of stdout that were not read yet, stderr)."""
    with process:
        lines, err = process.stdout.read().splitlines(), process.stderr.read()
    return process.returncode, lines, err


def kill(process):
    process.kill()
    finish(process)


def test_ctrl_c_ends_cleanly(tmp_path, product):
    table = catalog(tmp_path / "shop", product, 12, size=200)
    process = started(table, tmp_path / "out", "--workers", "2")
    first = json.loads(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    code, lines, err = finish(process)
    *entries, last = [json.loads(line) for line in lines]
    assert (code, err) == (130, "")
    assert last["summary"]["stopped"] == "stopped: go on with --resume"
    outputs = {first["output"], *(entry["output"] for entry in entries)}
    assert len(outputs) < 24
    assert {n for n in files_of(tmp_path / "out") if n.startswith("ball")} == outputs
    assert not list((tmp_path / "out").rglob(".dyehouse-*"))


def test_a_full_disk_midway(run, tmp_path, product, disk):
    table = catalog(tmp_path / "shop", product, 6, size=256)
    small = disk("size=300k")
    code, said, err = run(table, "--out", small / "out")
    assert code == 2
    assert "make room, then go on with --resume" in said + err
    done = [n for n in files_of(small / "out") if n.endswith(".png")]
    assert 0 < len(done) < 12
    for name in done:
        with Image.open(small / "out" / name) as picture:
            picture.load()
    assert not list((small / "out").rglob(".dyehouse-*"))
    subprocess.run(["mount", "-o", "remount,size=30m", str(small)], check=True)
    assert run(table, "--out", small / "out", "--resume")[0] == 0
    run(table, "--out", tmp_path / "whole")
    assert files_of(small / "out") == files_of(tmp_path / "whole")


# --- killed ---------------------------------------------------------------------------------------------------


def descendants(pid):
    children = Path(f"/proc/{pid}/task/{pid}/children")
    for child in children.read_text().split() if children.exists() else ():
        yield int(child)
        yield from descendants(int(child))


def test_a_worker_killed_midway_is_replaced(tmp_path, product):
    table = catalog(tmp_path / "shop", product, 6, size=128)
    process = started(table, tmp_path / "out", "--workers", "2")
    process.stdout.readline()
    # The fork server and the resource tracker have no photo open; the workers are the fork server's children.
    workers = [p for p in descendants(process.pid) if b"forkserver" in Path(f"/proc/{p}/cmdline").read_bytes()]
    os.kill(max(workers), signal.SIGKILL)
    code, lines, err = finish(process)
    assert code == 0, err
    assert json.loads(lines[-1])["summary"]["done"] == 12
    whole = tmp_path / "whole"
    assert finish(started(table, whole))[0] == 0
    assert files_of(tmp_path / "out") == files_of(whole)


def noted(out):
    """Results that the journal knows of, also if its last line is cut off."""
    journal = out / "dyehouse-journal.jsonl"
    lines = journal.read_bytes().split(b"\n")[:-1] if journal.exists() else ()
    return {entry["output"] for entry in map(json.loads, lines) if entry["status"] == "done"}


def check_what_a_kill_leaves(out):
    """Every file is whole, the journal's are there, and no more are lost than those of the photos in flight."""
    made = {path.name for path in out.glob("ball*")}
    for name in made:
        with Image.open(out / name) as picture:
            picture.load()
    assert noted(out) <= made
    assert len(made - noted(out)) <= 2 * 2 * 2  # two workers, each with a photo and another ahead, of two colorways


@pytest.mark.slow
def test_killed_at_twenty_moments_and_resumed(tmp_path, product):
    table = catalog(tmp_path / "shop", product, 10, size=500)
    whole, out = tmp_path / "whole", tmp_path / "out"
    begun = time.perf_counter()
    undisturbed = started(table, whole, "--workers", "2")
    undisturbed.stdout.readline()
    first = time.perf_counter() - begun
    assert finish(undisturbed)[0] == 0
    moments = np.random.default_rng().uniform(0.8 * first, time.perf_counter() - begun, 20)
    print("killed after", *moments, "s")  # shown if it fails
    killed = []
    for k, moment in enumerate(moments):
        shutil.rmtree(out, ignore_errors=True)
        # Every other time the run that goes on is killed as well.
        for options in ((), ("--resume",))[: 1 + k % 2]:
            process = started(table, out, "--workers", "2", *options)
            time.sleep(moment)
            if process.poll() is None:
                killed.append(len(noted(out)))
            kill(process)
            check_what_a_kill_leaves(out)
        before = noted(out)
        code, lines, err = finish(started(table, out, "--workers", "2", "--resume"))
        assert code == 0, err
        assert json.loads(lines[-1])["summary"]["kept"] == len(before)
        assert files_of(out) == files_of(whole)
    # Some were killed while they worked, or the test shows nothing.
    assert sum(0 < count < 20 for count in killed) >= 5


def test_killed_once_and_resumed(tmp_path, product):
    table = catalog(tmp_path / "shop", product, 5, size=128)
    out = tmp_path / "out"
    process = started(table, out, "--workers", "2")
    process.stdout.readline()
    kill(process)
    check_what_a_kill_leaves(out)
    before = noted(out)
    assert before
    code, lines, err = finish(started(table, out, "--resume"))
    assert code == 0, err
    summary = json.loads(lines[-1])["summary"]
    assert (summary["kept"], summary["done"]) == (len(before), 10 - len(before))
    assert finish(started(table, tmp_path / "whole"))[0] == 0
    assert files_of(tmp_path / "out") == files_of(tmp_path / "whole")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
def test_memory_does_not_grow_with_the_photos(tmp_path, product):
    table = catalog(tmp_path / "shop", product, 18, size=640)
    process = started(table, tmp_path / "out", "--workers", "2")

    def peak():
        """Greatest memory so far of the run and its workers, in bytes."""
        found = 0
        for pid in (process.pid, *descendants(process.pid)):
            with contextlib.suppress(OSError):  # it has just ended
                kilobytes = re.findall(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())
                found += 1024 * sum(map(int, kilobytes))
        return found

    with process:
        peaks = [peak() for _ in range(36) if process.stdout.readline()]
        process.stdout.read(), process.stderr.read()
    assert process.returncode == 0
    # Twelve more photos come: were they kept, if only as they are in their files, they would be twelve of these.
    assert max(peaks) - peaks[12] < 4 * (640 * 640 * 3)


def test_the_journal_cannot_be_written(shop, tmp_path):
    command = [sys.executable, "-m", "dyehouse", "batch", str(shop), "--out", str(tmp_path / "o"), "--journal", "/no/x"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "journal '/no/x' cannot be written" in done.stderr
