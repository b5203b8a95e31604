"""`dyehouse swatches` and `dyehouse verify`."""

import json

import numpy as np
import pytest
from PIL import Image

from dyehouse.batch.cli import main
from dyehouse.core import spectra, swatch_files
from dyehouse.core.library import Library
from dyehouse.core.swatches import Swatch, parse_target


def run(capsys, *arguments):
    status = main(list(arguments))
    out = capsys.readouterr()
    return status, out.out, out.err


def figures(capsys, *arguments):
    status, out, _ = run(capsys, *arguments, "--json")
    assert status == 0
    return json.loads(out)


def test_built_in_libraries_are_listed(capsys):
    status, out, _ = run(capsys, "swatches")
    assert status == 0
    assert "ColorChecker" in out
    assert {lib["name"] for lib in figures(capsys, "swatches")["libraries"]} >= {"CSS", "HLC"}


def test_search_and_nearest(capsys):
    found = figures(capsys, "swatches", "CSS", "--search", "blue slate", "--nearest", "#483d8b")["swatches"]
    assert found[0]["name"] == "darkslateblue"
    assert found[0]["ciede2000"] == pytest.approx(0, abs=1e-3)
    assert len(found) == 3
    assert len(figures(capsys, "swatches", "HLC", "--nearest", "#483d8b")["swatches"]) == 10


def test_conversion_tells_what_is_lost(capsys, tmp_path):
    path = str(tmp_path / "red.ase")
    status, out, _ = run(capsys, "swatches", "ColorChecker#red", "-o", path)
    assert status == 0
    assert "written as Lab under D50" in out
    assert swatch_files.read(path).swatches[0].text == "red"
    status, _, err = run(capsys, "swatches", "CSS", "-o", path)
    assert status == 2
    assert "exists already" in err
    assert run(capsys, "swatches", "CSS", "-o", path, "--force")[0] == 0


def test_other_lights_and_metamerism(capsys, tmp_path):
    _, out, _ = run(capsys, "swatches", "ColorChecker#red", "--under", "D65,A", "--against", "ColorChecker Ohta#red")
    assert "under A, shift" in out
    assert "Metamerism index" in out
    _, out, _ = run(capsys, "swatches", "CSS#red", "--under", "A")
    assert "cannot be known" in out


def test_plain_inks(capsys, tmp_path):
    data = b"\0\1\0\1" + b"\0\2" + b"\0\0\xff\xff\xff\xff\xff\xff"
    (tmp_path / "x.aco").write_bytes(data)
    status, _, err = run(capsys, "swatches", str(tmp_path / "x.aco"))
    assert status == 2
    assert "profile of its printer" in err
    (row,) = figures(capsys, "swatches", str(tmp_path / "x.aco"), "--cmyk", "plain")["swatches"]
    assert row["srgb"] == "#00FFFF"


def test_verify(capsys, tmp_path):
    path = str(tmp_path / "x.png")
    Image.fromarray(np.full((40, 50, 3), (40, 80, 120), np.uint8)).save(path)
    status, out, _ = run(capsys, "verify", path, "--reference", "20,20", "--target", "#1F4E79")
    assert status == 0
    assert out.startswith("Delivered ")
    assert "CMC(2:1)" in out
    found = figures(capsys, "verify", path, "--reference", "20,20", "--target", "#285078")
    assert found["ciede2000"] == pytest.approx(0, abs=1e-6)
    assert run(capsys, "verify", path, "--reference", "20,20", "--target", "#1F4E79", "--within", "0.5")[0] == 1
    assert run(capsys, "verify", path, "--reference", "20,20", "--target", "#285078", "--within", "0.5")[0] == 0
    assert run(capsys, "verify", path, "--reference", "20", "--target", "#285078")[0] == 2


def test_verify_a_swatch_of_a_file_under_a_light(capsys, tmp_path):
    red = Swatch.from_spectrum(spectra.chart()["red"], "Red")
    swatch_files.write(tmp_path / "lab.cxf", Library.of("x", [red, parse_target("#123456")]))
    from dyehouse.core.colorspace import SRGB

    codes = np.rint(255 * SRGB.curve.encode(np.clip(red.to_linear(SRGB, "D50"), 0, 1))).astype(np.uint8)
    path = str(tmp_path / "x.png")
    Image.fromarray(np.full((40, 50, 3), codes, np.uint8)).save(path)
    target = f"{tmp_path}/lab.cxf#Red"
    under = figures(capsys, "verify", path, "--reference", "2,2", "--target", target, "--illuminant", "D50")
    assert under["ciede2000"] < 0.4
    assert figures(capsys, "verify", path, "--reference", "2,2", "--target", target)["ciede2000"] > 2


def test_recolor_verifies_what_it_wrote(capsys, tmp_path, product):
    scene = product(size=120)
    codes = np.rint(255 * np.clip(scene.image, 0, 1) ** (1 / 2.2)).astype(np.uint8)
    Image.fromarray(codes).save(tmp_path / "in.png")
    x, y = scene.matte
    common = ("recolor", str(tmp_path / "in.png"), "--reference", f"{x},{y}", "--target", "#1F4E79", "-o")
    (check,) = figures(capsys, *common, str(tmp_path / "a.png"))["verification"]
    assert check["ciede2000"] < 0.6
    _, out, _ = run(capsys, *common, str(tmp_path / "b.jpg"))
    assert "Verified   Delivered" in out
    assert figures(capsys, *common, str(tmp_path / "c.png"), "--no-verify")["verification"] == []
