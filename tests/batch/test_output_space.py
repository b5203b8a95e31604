"""Output in another space than the photo's: the same colors, and room for more."""

import colour
import numpy as np
import pytest

from dyehouse.batch import files, photo, verification
from dyehouse.batch.cli import main
from dyehouse.core.colorspace import SPACES, SRGB
from dyehouse.core.picture import Picture
from dyehouse.core.recipe import Recipe, Region
from dyehouse.core.swatches import parse_target

THEIRS = {
    "display-p3": "Display P3",
    "rec2020": "ITU-R BT.2020",
    "acescg": "ACEScg",
    "adobe-rgb": "Adobe RGB (1998)",
    "srgb": "sRGB",
}
GREEN = parse_target("color(display-p3 0.0 0.75 0.3)")


@pytest.fixture
def source(product, tmp_path):
    """A photo of the product, in codes of 16 bits or in linear floats."""

    def make(kind):
        scene = product(size=120)
        image = np.clip(scene.image, 0, 1)
        path = tmp_path / f"in.{'exr' if kind == 'floats' else 'png'}"
        pixels = image if kind == "floats" else np.rint(SRGB.curve.encode(image) * 65535).astype(np.uint16)
        space = SPACES["linear-srgb"] if kind == "floats" else SRGB
        files.write(path, pixels, files.Photo(tmp_path / "none", pixels, space))
        return scene, files.read(path)

    return make


def recolored(opened, scene, path, space, target):
    prepared = photo.look(opened, Recipe((Region(target, mask=scene.mask, model="dichromatic"),)))
    opened.wanted = SPACES[space] if space else None
    expected = verification.expect(opened, prepared)
    written, shares = photo.save(opened, prepared, path)
    (check,) = expected.check(written)
    back = files.read(written)
    return back, Picture(back.pixels, back.space.curve).linear().astype(float), shares, check


@pytest.mark.parametrize("space", THEIRS)
@pytest.mark.parametrize("kind", ["codes", "floats"])
@pytest.mark.parametrize("name", ["out.tif", "out.exr", "out.png"])
def test_the_same_colors_in_another_space(source, tmp_path, space, kind, name):
    scene, opened = source(kind)
    own, plain, _, _ = recolored(opened, scene, tmp_path / f"own-{name}", None, parse_target("#4E7979"))
    back, linear, _, check = recolored(opened, scene, tmp_path / name, space, parse_target("#4E7979"))
    whites = [colour.XYZ_to_xy(s.white) for s in (own.space, back.space)]
    np.testing.assert_allclose(whites[1], colour.RGB_COLOURSPACES[THEIRS[space]].whitepoint, atol=2e-4)
    converted = colour.RGB_to_RGB(
        plain,
        colour.RGB_COLOURSPACES["sRGB"],
        colour.RGB_COLOURSPACES[THEIRS[space]],
        chromatic_adaptation_transform="Bradford",
    )
    np.testing.assert_allclose(linear, converted, atol=4e-4)
    assert np.abs(back.space.to_xyz - SPACES[space].to_xyz).max() < 2e-3
    assert back.pixels.dtype == own.pixels.dtype
    assert check.ciede2000 < 0.3


def test_a_wider_space_holds_what_the_photo_s_own_does_not(source, tmp_path):
    scene, opened = source("codes")
    _, _, narrow_shares, narrow = recolored(opened, scene, tmp_path / "narrow.png", None, GREEN)
    back, _, wide_shares, wide = recolored(opened, scene, tmp_path / "wide.png", "display-p3", GREEN)
    assert back.space is SPACES["display-p3"]
    assert narrow.limit > 3
    assert narrow.ciede2000 > 3
    assert wide.limit == 0
    assert wide.ciede2000 < 0.1
    assert narrow_shares.out_of_gamut > 0.9 > wide_shares.out_of_gamut


def test_floats_in_acescg_are_never_cut(source, tmp_path):
    scene, opened = source("floats")
    _, linear, shares, check = recolored(
        opened, scene, tmp_path / "x.exr", "acescg", parse_target("rgb(-0.2, 0.9, -0.1)")
    )
    assert shares.out_of_gamut == 0
    assert check.ciede2000 < 0.1
    assert linear[scene.mask > 0].min() < 0 or linear.max() > 1


def test_command_line(tmp_path, source, capsys):
    _, opened = source("codes")
    output = tmp_path / "out.jpg"
    common = ["recolor", str(opened.path), "--click", "60,60", "--target", "#1F4E79", "-o", str(output)]
    assert main([*common, "--output-space", "display-p3"]) == 0
    assert files.read(output).space is SPACES["display-p3"]
    capsys.readouterr()
    assert main([*common, "--output-space", "moon", "--force"]) == 2
    assert "'moon' is not known" in capsys.readouterr().err


def test_a_catalog_writes_each_result_in_its_own_space(source, tmp_path):
    source("codes")
    (tmp_path / "p3.toml").write_text('[[region]]\nreference = [60, 60]\n[output]\noutput_space = "display-p3"\n')
    (tmp_path / "t.csv").write_text(
        "photo,recipe,reference,target,output_space,output\n"
        "in.png,,60 60,#1F8E59,rec2020,wide.png\nin.png,p3.toml,,#1F8E59,,p3.png\nin.png,,60 60,#1F8E59,,own.png\n"
    )
    assert main(["batch", str(tmp_path / "t.csv"), "--out", str(tmp_path / "out"), "--workers", "0", "--quiet"]) == 0
    asked = ["recolor", str(tmp_path / "in.png"), "--reference", "60,60", "--target", "#1F8E59"]
    for name, options in (
        ("wide", ["--output-space", "rec2020"]),
        ("p3", ["--output-space", "display-p3"]),
        ("own", []),
    ):
        assert main([*asked, *options, "-o", str(tmp_path / f"{name}.png")]) == 0
        assert (tmp_path / "out" / f"{name}.png").read_bytes() == (tmp_path / f"{name}.png").read_bytes(), name
    assert main([*asked[:2], "--recipe", str(tmp_path / "p3.toml"), "-o", str(tmp_path / "again.png")]) == 2
    (tmp_path / "p3.toml").write_text(
        '[[region]]\nreference = [60, 60]\ntarget = "#1F8E59"\n[output]\noutput_space = "display-p3"\n'
    )
    assert main([*asked[:2], "--recipe", str(tmp_path / "p3.toml"), "-o", str(tmp_path / "again.png")]) == 0
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "p3.png").read_bytes()


def test_a_catalog_says_what_space_is_not_known(tmp_path, capsys):
    (tmp_path / "t.csv").write_text("photo,click,target,output_space\nin.png,1 1,#000,wide\n")
    assert main(["batch", str(tmp_path / "t.csv"), "--out", str(tmp_path / "out"), "--check"]) == 2
    assert "column 'output_space'" in capsys.readouterr().err
