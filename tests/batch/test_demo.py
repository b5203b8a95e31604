"""The demo: two photographs, recolored, with all it names in its folder."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dyehouse.batch import demo
from dyehouse.batch.cli import main
from dyehouse.core.errors import FileError
from dyehouse.core.swatches import parse_target


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder, and what the demo says about it."""
    folder = tmp_path_factory.mktemp("demo") / "deep" / "er"
    return folder, demo.run(folder, quiet=True)


def pixels(path):
    return np.array(Image.open(path).convert("RGB")).astype(int)


def test_every_file_it_names_is_there_and_no_other(made):
    folder, said = made
    assert said["folder"] == str(folder.resolve())
    assert sorted(said["files"]) == sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    for name in ("astronaut", "coffee"):
        colorways = [f for f in said["reports"] if f.startswith(name)]
        assert len(colorways) == 4
        assert set(colorways) < set(said["files"])
        for part in ("A", "B", "residual", "error", "mask"):
            assert f"{name}-{part}.png" in said["files"]
    assert "contact-sheet.png" in said["files"]


@pytest.mark.parametrize("subject", demo.SUBJECTS, ids=lambda s: s.name)
def test_colorways_change_the_product_and_nothing_else(made, subject):
    folder, said = made
    before = pixels(demo.sample_photo(subject.file))
    mask = pixels(folder / f"{subject.name}-mask.png")[..., 0]
    assert 0.1 < (mask > 127).mean() < 0.5
    results = []
    for label, text in subject.colorways:
        name = f"{subject.name}-{label.replace(' ', '-')}.png"
        after = pixels(folder / name)
        assert after.shape == before.shape
        np.testing.assert_array_equal(after[mask == 0], before[mask == 0])
        assert np.abs(after - before)[mask == 255].mean() > 15
        # The product's usual hue is the target's: compare directions of chromaticity, lit part of the region.
        linear = (after[mask == 255] / 255) ** 2.2
        lit = linear[linear.sum(axis=1) > np.quantile(linear.sum(axis=1), 0.4)]
        seen = np.median(lit / lit.sum(axis=1, keepdims=True), axis=0) - 1 / 3
        target = np.clip(np.array(said["reports"][name]["regions"][0]["target_linear"]), 0, None)
        wanted = target / target.sum() - 1 / 3
        if np.linalg.norm(wanted) > 0.05:  # charcoal has no hue
            assert seen @ wanted / np.linalg.norm(seen) / np.linalg.norm(wanted) > 0.85
        assert said["reports"][name]["regions"][0]["target"] == str(parse_target(text))
        results.append(after)
    for k, one in enumerate(results):
        for other in results[:k]:
            assert np.abs(one - other)[mask == 255].mean() > 5


def test_contact_sheet_shows_all(made):
    folder, _ = made
    sheet = pixels(folder / "contact-sheet.png")
    assert sheet.shape[1] > 5 * 380
    # Both photographs in the first column: the sheet has much that is no paper, in two rows and five columns.
    ink = (np.abs(sheet - 250) > 3).any(axis=-1)
    assert 0.6 < ink.mean() < 1


def test_command_says_where_and_replaces_an_earlier_demo(tmp_path, capsys):
    folder = tmp_path / "shown"
    folder.mkdir()
    (folder / "contact-sheet.png").write_bytes(b"old")
    assert main(["demo", "--out", str(folder)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    wrote = re.search(r"Wrote (\d+) files to (.+); start with contact-sheet\.png", out)
    assert int(wrote[1]) == sum(path.is_file() for path in folder.rglob("*"))
    assert Path(wrote[2]) == folder.resolve()
    assert "public domain" in out
    assert "CC0" in out
    assert pixels(folder / "contact-sheet.png").shape[2] == 3


def test_catalog_is_that_of_the_guide_and_runs(made, tmp_path, capsys):
    folder, _ = made
    guide = (Path(demo.__file__).parents[1] / "docs" / "catalog.md").read_text()
    assert (folder / "suit.toml").read_text() in guide
    row = (folder / "catalog.csv").read_text().splitlines()[1].replace(",", " | ", 4)
    assert all(cell in guide.replace("\\|", "|") for cell in row.split(" | "))
    catalog = [str(folder / "suit.toml"), str(folder / "catalog.csv"), "--out", str(tmp_path / "finished")]
    assert main(["batch", *catalog, "--check"]) == 0
    assert main(["batch", *catalog, "--max-error", "6", "--allow-warnings", "--quiet"]) == 0
    assert len(list((tmp_path / "finished").glob("*.jpg"))) == 5
    assert capsys.readouterr().err == ""


def test_folder_that_cannot_be(tmp_path, capsys):
    (tmp_path / "file").write_text("not a folder")
    assert main(["demo", "--out", str(tmp_path / "file" / "demo"), "--json"]) == 2
    out, err = capsys.readouterr()
    assert "cannot be made" in json.loads(out)["error"]
    assert err.count("\n") == 1
    assert (tmp_path / "file").read_text() == "not a folder"


def test_photos_that_are_not_installed():
    with pytest.raises(FileError, match="pip install scikit-image"):
        demo.sample_photo("no such photo.png")
