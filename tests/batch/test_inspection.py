"""What a recolor found and would do: figures, words and maps."""

import json
from pathlib import Path

import colour
import numpy as np
import pytest

from dyehouse.batch import files, inspection, photo
from dyehouse.core import transfer
from dyehouse.core.colorspace import SPACES
from dyehouse.core.errors import FileError
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.recolor import Shares
from dyehouse.core.swatches import parse_target

BLUE = parse_target("#1F4E79")


@pytest.fixture
def looked_at(product):
    """Return a photo of a ball, what was made of it, and the scene, for regions and further options."""

    def make(*regions, color=(0.42, 0.09, 0.05), **options):
        scene = product(color, size=64, noise=0.002)
        source = files.Photo(
            Path("ball.png"), transfer.encode(scene.image, transfer.SRGB, np.uint8), SPACES["srgb"], assumptions=("A.",)
        )
        regions = regions or (Region(BLUE, reference=scene.matte, mask=scene.mask),)
        return source, photo.look(source, Recipe(regions, **options)), scene

    return make


def test_report_is_plain_values(looked_at):
    source, prepared, scene = looked_at()
    report = inspection.with_shares(inspection.report(source, prepared), Shares(100, 0.25))
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["photo"] == "ball.png"
    assert report["assumptions"] == ["A."]
    assert report["out_of_gamut_share"] == 0.25
    region = report["regions"][0]
    assert region["covered_share"] == pytest.approx(scene.mask.mean(), abs=1e-6)
    assert region["meaning"] == "reference"
    np.testing.assert_allclose(region["matrix"], prepared.analyses[0].matrix(prepared.target()))
    assert region["recolor_noise_gain"] == pytest.approx(np.linalg.svd(region["matrix"])[1].max())


def test_report_of_a_grey_product_is_json(looked_at):
    source, prepared, _ = looked_at(Region(BLUE, reference=(0.4, 0.4, 0.4)), color=(0.4, 0.4, 0.4))
    report = inspection.with_shares(inspection.report(source, prepared), Shares(1, 0.0))
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["regions"][0]["noise_gain"] is None
    assert "infinite" in inspection.in_words(report)


def test_change_is_the_color_difference_of_colour_science(looked_at):
    source, prepared, _ = looked_at()
    region = inspection.with_shares(inspection.report(source, prepared), Shares(1, 0.0))["regions"][0]
    labs = [
        colour.XYZ_to_Lab(SPACES["srgb"].to_xyz @ np.array(region[key]), (0.3127, 0.3290))
        for key in ("reference", "target_linear")
    ]
    assert region["change_ciede2000"] == pytest.approx(colour.delta_E(*labs, method="CIE 2000"), abs=1e-3)


@pytest.mark.parametrize(("share", "warned"), [(0.0, False), (0.0005, False), (0.02, True)])
def test_gamut_is_warned_of_from_one_in_a_thousand(looked_at, share, warned):
    source, prepared, _ = looked_at()
    report = inspection.with_shares(inspection.report(source, prepared), Shares(1000, share))
    assert any("outside the color space" in w for w in report["warnings"]) == warned


def test_words(looked_at):
    source, prepared, scene = looked_at()
    report = inspection.with_shares(inspection.report(source, prepared), Shares(1000, 0.02))
    words = inspection.in_words(report)
    for part in (
        "ball.png: 64 x 64, uint8, sRGB",
        str(scene.matte),
        "#1F4E79",
        "dichromatic",
        "0.27",
        "Note: A.",
        "2.00%",
    ):
        assert part in words
    assert "Region 1" not in words
    assert "New light" not in words
    assert "Warning: " in words
    brief = inspection.in_words(report | {"output": "out.png"}, brief=True)
    assert len(brief) < len(words)
    assert "Wrote out.png" in brief
    assert "Warning: " in brief


def test_words_of_two_regions_and_a_new_light(looked_at):
    _, _, scene = looked_at()
    two = (Region(BLUE, reference=scene.matte, mask=scene.mask), Region(BLUE, reference=(0.3, 0.1, 0.1)))
    source, prepared, _ = looked_at(*two, illuminant="A")
    words = inspection.in_words(inspection.with_shares(inspection.report(source, prepared), Shares(1, 0.0)))
    assert "Region 1" in words
    assert "Region 2" in words
    assert "New light" in words


def test_maps_of_two_regions_have_numbers(looked_at, tmp_path):
    _, _, scene = looked_at()
    two = (Region(BLUE, reference=scene.matte, mask=scene.mask), Region(BLUE, reference=(0.3, 0.1, 0.1)))
    _, prepared, _ = looked_at(*two)
    written = inspection.write_maps(prepared, tmp_path / "new" / "maps", prefix="ball-")
    names = {p.name for p in written}
    assert names == {
        "ball-1-A.png", "ball-1-B.png", "ball-1-residual.png", "ball-1-error.png", "ball-1-mask.png",
        "ball-2-A.png", "ball-2-B.png", "ball-2-residual.png", "ball-2-error.png",
        "ball-1-gamut.png", "ball-2-gamut.png",
    }  # fmt: skip
    assert {p.name for p in (tmp_path / "new" / "maps").iterdir()} == names
    error = files.read(tmp_path / "new" / "maps" / "ball-1-error.png").pixels
    expected = prepared.analyses[0].predicted_error(prepared.target(0))
    np.testing.assert_allclose(error[..., 0] / 255, np.clip(expected / 10, 0, 1), atol=0.003)


def test_maps_where_there_can_be_no_folder(looked_at, tmp_path):
    _, prepared, _ = looked_at()
    (tmp_path / "file").write_text("not a folder")
    for folder in (tmp_path / "file", tmp_path / "file" / "maps"):
        with pytest.raises(FileError, match="cannot be made"):
            inspection.write_maps(prepared, folder)
    assert (tmp_path / "file").read_text() == "not a folder"
