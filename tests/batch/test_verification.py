"""Delivered against asked: figures by colour-science, files by other writers, and files that are wrong on purpose."""

import colour
import numpy as np
import pytest
from PIL import Image

from dyehouse.batch import files, photo, verification
from dyehouse.batch.cli import main
from dyehouse.core.colorspace import SPACES
from dyehouse.core.errors import DyehouseError, FileError
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

from .catalogs import catalog, journal_of

NAVY, TEAL = parse_target("#1F4E79"), parse_target("lab(50, -30, -5)")
D65 = np.array([0.3127, 0.3290])


def lab_of_codes(codes):
    linear = colour.models.eotf_sRGB(np.asarray(codes) / 255)
    return colour.XYZ_to_Lab(SPACES["srgb"].to_xyz @ linear, D65)


def test_figures_of_a_patch(tmp_path):
    picture = np.full((60, 80, 3), (40, 80, 120), np.uint8)
    Image.fromarray(picture).save(tmp_path / "patch.png")
    found = verification.verify(tmp_path / "patch.png", (30, 20), NAVY)
    asked, delivered = lab_of_codes((0x1F, 0x4E, 0x79)), lab_of_codes((40, 80, 120))
    np.testing.assert_allclose((found.asked, found.delivered), (asked, delivered), atol=1e-4)
    assert found.ciede2000 == pytest.approx(colour.delta_E(asked, delivered, method="CIE 2000"), abs=1e-4)
    assert found.cmc[0] == pytest.approx(colour.delta_E(asked, delivered, method="CMC", l=2, c=1), abs=1e-4)
    assert found.cmc[1] == pytest.approx(colour.delta_E(asked, delivered, method="CMC", l=1, c=1), abs=1e-4)
    assert f"Delivered {found.ciede2000:.1f} of the asked color" in found.sentence
    assert found.limit == 0
    assert found.as_dict()["target"] == "#1F4E79"


def test_specks_at_the_pixel_do_not_count(tmp_path):
    picture = np.full((60, 80, 3), (0x1F, 0x4E, 0x79), np.uint8)
    picture[20, 30] = 255
    Image.fromarray(picture).save(tmp_path / "patch.png")
    assert verification.verify(tmp_path / "patch.png", (30, 20), NAVY).ciede2000 < 1e-6


def test_what_cannot_be_verified(tmp_path):
    Image.fromarray(np.zeros((6, 8, 3), np.uint8)).save(tmp_path / "x.png")
    with pytest.raises(DyehouseError, match="outside the picture"):
        verification.verify(tmp_path / "x.png", (8, 2), NAVY)
    with pytest.raises(FileError, match="does not exist"):
        verification.verify(tmp_path / "y.png", (1, 1), NAVY)


@pytest.fixture
def opened(product, tmp_path):
    """Open a photo of the product, with or without alpha."""

    def make(scene, name="in.png", alpha=None):
        codes = np.rint(colour.models.eotf_inverse_sRGB(np.clip(scene.image, 0, 1)) * 65535).astype(np.uint16)
        if alpha is not None:
            codes = np.dstack([codes, np.rint(alpha * 65535).astype(np.uint16)])
        path = tmp_path / name
        files.write(path, codes, files.Photo(tmp_path / "none", codes, SPACES["srgb"]))
        return files.read(path)

    return make


@pytest.mark.parametrize("name", ["out.png", "out.jpg", "out.tif", "out.exr", "out.webp"])
@pytest.mark.parametrize("how", ["pixel", "region"])
def test_written_files_deliver(product, opened, tmp_path, name, how):
    scene = product(size=200)
    source = opened(scene)
    region = Region(TEAL, reference=scene.matte) if how == "pixel" else Region(TEAL, mask=scene.mask)
    prepared = photo.look(source, Recipe((region,)))
    expected = verification.expect(source, prepared)
    written, _ = photo.save(source, prepared, tmp_path / name, reuse=True)
    (found,) = expected.check(written)
    assert found.pixels >= 25
    assert found.target == "lab(50, -30, -5)"
    assert found.ciede2000 < (0.6 if name in ("out.jpg", "out.webp") else 0.25)


def test_a_file_in_another_color_is_told(product, opened, tmp_path):
    scene = product(size=200, noise=0.0005)
    source = opened(scene)
    region = Region(TEAL, mask=scene.mask, reference=scene.matte)
    expected = verification.expect(source, photo.look(source, Recipe((region,))))
    # The product truly in navy, made without our recolor, where teal was asked.
    x, y = scene.matte
    navy = scene.in_color(NAVY.to_linear(SPACES["srgb"]) / scene.shading[y, x], np.ones(3))
    codes = np.rint(colour.models.eotf_inverse_sRGB(np.clip(navy, 0, 1)) * 255).astype(np.uint8)
    Image.fromarray(codes).save(tmp_path / "navy.png")
    (found,) = expected.check(tmp_path / "navy.png")
    asked = colour.XYZ_to_Lab(SPACES["srgb"].to_xyz @ TEAL.to_linear(SPACES["srgb"]), D65)
    truth = colour.delta_E(asked, lab_of_codes((0x1F, 0x4E, 0x79)), method="CIE 2000")
    assert found.ciede2000 == pytest.approx(truth, abs=0.5)
    Image.fromarray(codes[:50]).save(tmp_path / "cut.png")
    with pytest.raises(FileError, match="less than was written"):
        expected.check(tmp_path / "cut.png")


def test_every_region_by_its_own_pixels(product, opened, tmp_path):
    scene = product(size=200)
    source = opened(scene)
    left = scene.mask * (np.arange(200) < 100)
    regions = (Region(NAVY, mask=scene.mask, reference=scene.matte), Region(TEAL, mask=left))
    prepared = photo.look(source, Recipe(regions))
    expected = verification.expect(source, prepared, [None, NAVY])
    for area, _, _ in expected.asked[:1]:
        assert (left[area.rows, area.columns] == 0).all()  # what lies under the second region is not looked at
    written, _ = photo.save(source, prepared, tmp_path / "out.png", [None, NAVY])
    found = expected.check(written)
    assert [f.target for f in found] == ["#1F4E79"] * len(found)
    assert len(found) >= 1
    assert all(f.ciede2000 < 0.3 for f in found)


def test_the_first_rows_that_have_enough_matte_pixels_are_looked_at(product, opened):
    scene = product(size=400, noise=0.0)
    scene.image[scene.mask == 1] = scene.body  # matte all over
    source = opened(scene)
    expected = verification.expect(source, photo.look(source, Recipe((Region(TEAL, mask=scene.mask),))))
    ((area, _, _),) = expected.asked
    first = np.flatnonzero(scene.mask.any(axis=1))[0]
    assert len(area.rows) == 400
    assert first <= area.rows.min() <= area.rows.max() < first + 60
    assert (scene.mask[area.rows, area.columns] == 1).all()


def test_another_light_and_no_target(product, opened, tmp_path):
    scene = product(size=200)
    source = opened(scene)
    prepared = photo.look(source, Recipe((Region(mask=scene.mask),), white="D65", illuminant="A"))
    expected = verification.expect(source, prepared)
    written, _ = photo.save(source, prepared, tmp_path / "out.exr")
    (found,) = expected.check(written)
    assert found.target is None
    assert found.ciede2000 < 0.3


@pytest.mark.parametrize("name", ["out.png", "out.exr"])
def test_transparent_pixels_are_left_out(product, opened, tmp_path, name):
    scene = product(size=200)
    alpha = np.where(np.arange(200) < 100, 1.0, 0.5) * np.ones((200, 1))
    source = opened(scene, alpha=alpha)
    prepared = photo.look(source, Recipe((Region(TEAL, mask=scene.mask),)))
    expected = verification.expect(source, prepared)
    assert (expected.asked[0][0].columns < 100).all()
    written, _ = photo.save(source, prepared, tmp_path / name)
    (found,) = expected.check(written)
    assert found.ciede2000 < 0.3


def test_a_color_outside_the_file_says_how_near_it_can_come(product, opened, tmp_path):
    scene = product(size=200)
    source = opened(scene)
    prepared = photo.look(source, Recipe((Region(parse_target("lab(60, -90, 20)"), mask=scene.mask),)))
    expected = verification.expect(source, prepared)
    for name in ("out.png", "out.exr"):
        written, _ = photo.save(source, prepared, tmp_path / name)
        (found,) = expected.check(written)
        if name == "out.png":
            assert 3 < found.limit < found.ciede2000
            assert "nearest color that the file can hold" in found.sentence
        else:
            assert found.limit == 0
            assert found.ciede2000 < 0.5


def test_the_journal_of_a_catalog_tells_what_was_delivered(tmp_path, product):
    table = catalog(tmp_path / "shop", product, count=1)
    assert main(["batch", str(table), "--out", str(tmp_path / "out"), "--workers", "1", "--quiet"]) == 0
    entries = journal_of(tmp_path / "out")
    delivered = [check for entry in entries for check in entry.get("verification", [])]
    assert {check["target"] for check in delivered} == {"#1F4E79", "#2E6B3A"}
    assert all(check["ciede2000"] < 1 for check in delivered)


def test_a_catalog_that_verifies_nothing(tmp_path, product):
    table = catalog(tmp_path / "shop", product, count=1)
    out = tmp_path / "out"
    assert main(["batch", str(table), "--out", str(out), "--workers", "0", "--quiet", "--no-verify"]) == 0
    assert [entry["verification"] for entry in journal_of(out) if entry["status"] == "done"] == [[], []]
    assert "delivered" not in (out / "index.html").read_text()
