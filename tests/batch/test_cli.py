"""The command line, on real files: what it writes, what it says, and how it fails."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

from dyehouse.batch import files
from dyehouse.batch.cli import main
from dyehouse.core import Picture, analyze, gamut, transfer
from dyehouse.core.colorspace import SPACES
from dyehouse.core.neighborhood import dilate, erode

TARGET = (0.06, 0.14, 0.42)
TARGET_TEXT = "rgb(0.06,0.14,0.42)"
ADOBE_RGB, LINEAR_SRGB = SPACES["adobe-rgb"], SPACES["linear-srgb"]


@pytest.fixture
def run(capsys):
    """Run a command in this process; returns (exit code, stdout, stderr)."""

    def call(*arguments):
        capsys.readouterr()
        code = main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return call


def write_exr(path, pixels, kind="half"):
    height, width, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(width, height, channels, kind)
    output = OpenImageIO.ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(np.ascontiguousarray(pixels, np.float32))
    assert output.close()
    return path


def read_pixels(path):
    """Pixels as OpenImageIO delivers them, alpha as stored."""
    hints = OpenImageIO.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)
    source = OpenImageIO.ImageInput.open(str(path), hints)
    pixels = source.read_image(source.spec().format)
    source.close()
    return pixels


@pytest.fixture
def shop(tmp_path, product):
    """A folder with a photo of a glossy ball, its mask, and the ball's scene."""
    scene = product(size=64, noise=0.002)
    scene.codes = transfer.encode(scene.image, transfer.SRGB, np.uint8)
    scene.cover = (scene.mask * 255).astype(np.uint8)
    scene.cover[30, 4:8] = 100  # soft somewhere
    scene.folder = tmp_path
    scene.photo, scene.mask_file = tmp_path / "ball.png", tmp_path / "mask.png"
    Image.fromarray(scene.codes).save(scene.photo)
    Image.fromarray(scene.cover).save(scene.mask_file)
    scene.click = f"{scene.matte[0]},{scene.matte[1]}"
    return scene


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def core_result(picture, reference, mask, curve, dtype):
    """What the core makes of it: analyze, recolor in floats, encode."""
    result = analyze(picture, reference=reference, mask=mask).recolor(TARGET)
    if np.dtype(dtype).kind != "u":
        return result.astype(dtype)
    flat = result.reshape(-1, 3).copy()
    gamut.fit_to_gamut(flat)
    return transfer.encode(flat.reshape(result.shape), curve, dtype)


# --- recolor: the pixels ----------------------------------------------------------------------------------------


def test_8_bit_png_is_what_the_core_makes(run, shop):
    out = shop.folder / "out.png"
    code, said, err = run(
        "recolor", shop.photo, "--reference", shop.click, "--mask", shop.mask_file, "--target", TARGET_TEXT, "-o", out
    )
    assert (code, err) == (0, "")
    assert str(out) in said
    expected = core_result(Picture(shop.codes, transfer.SRGB), shop.matte, shop.cover, transfer.SRGB, np.uint8)
    ours = np.array(Image.open(out))
    np.testing.assert_array_equal(ours, expected)
    np.testing.assert_array_equal(ours[shop.cover == 0], shop.codes[shop.cover == 0])
    assert np.abs(ours[shop.cover == 255].astype(int) - shop.codes[shop.cover == 255]).mean() > 20


@pytest.mark.parametrize("extension", ["png", "tif"])
@pytest.mark.parametrize("channels", [3, 4])
def test_16_bit_is_what_the_core_makes_and_alpha_is_kept(run, shop, extension, channels):
    photo, out = shop.folder / f"deep.{extension}", shop.folder / f"out.{extension}"
    pixels = np.zeros((64, 64, channels), np.uint16)
    pixels[..., :3] = transfer.encode(shop.image, transfer.SRGB, np.uint16)
    pixels[..., 3:] = np.linspace(1000, 65535, 64)[:, None, None]
    files.write(photo, pixels, files.Photo(Path(), pixels, SPACES["srgb"]))
    arguments = ("--reference", shop.click, "--mask", shop.mask_file, "--target", TARGET_TEXT)
    assert run("recolor", photo, *arguments, "-o", out)[0] == 0
    ours = read_pixels(out)
    assert (ours.dtype, ours.shape) == (np.uint16, pixels.shape)
    expected = core_result(Picture(pixels, transfer.SRGB), shop.matte, shop.cover, transfer.SRGB, np.uint16)
    np.testing.assert_array_equal(ours[..., :3], expected)
    np.testing.assert_array_equal(ours[..., 3:], pixels[..., 3:])


@pytest.mark.parametrize(("kind", "dtype"), [("half", np.float16), ("float", np.float32)])
def test_exr_is_what_the_core_makes_and_is_not_clipped(run, shop, kind, dtype):
    image = (shop.image * 3).astype(dtype).astype(np.float32)  # far above 1
    photo, out = write_exr(shop.folder / "a.exr", image, kind), shop.folder / "out.exr"
    arguments = ("--reference", shop.click, "--mask", shop.mask_file, "--target", "rgb(0.06,0.14,-0.02)")
    assert run("recolor", photo, *arguments, "-o", out)[0] == 0
    expected = analyze(image, reference=shop.matte, mask=shop.cover).recolor((0.06, 0.14, -0.02))
    ours = read_pixels(out)
    assert ours.dtype == dtype
    np.testing.assert_array_equal(ours, expected.astype(dtype))
    assert ours.max() > 1.5
    assert ours.min() < 0


def test_exr_with_alpha_stays_premultiplied(run, shop):
    # Light is linear: a product behind a soft alpha is recolored in what it shows of itself.
    alpha = np.clip(np.linspace(-0.2, 1.4, 64), 0, 1)[None, :, None] * np.ones((64, 1, 1))
    image = np.concatenate([shop.image * alpha, alpha], axis=2).astype(np.float32)
    photo, out = write_exr(shop.folder / "a.exr", image, "float"), shop.folder / "out.exr"
    arguments = ("--reference", "0.42,0.09,0.05", "--target", TARGET_TEXT, "--residual", "drop")
    assert run("recolor", photo, *arguments, "-o", out)[0] == 0
    ours = read_pixels(out)
    np.testing.assert_array_equal(ours[..., 3:], image[..., 3:])
    straight = analyze(shop.image, reference=(0.42, 0.09, 0.05)).recolor(TARGET, residual="drop")
    np.testing.assert_allclose(ours[..., :3], straight * alpha, atol=1e-5)


def test_alpha_of_8_bits_is_kept_and_can_be_the_mask(run, shop):
    rgba = np.dstack([shop.codes, shop.cover])
    photo, out = shop.folder / "cut.png", shop.folder / "out.png"
    Image.fromarray(rgba).save(photo)
    assert run("recolor", photo, "--mask", "alpha", "--target", TARGET_TEXT, "-o", out)[0] == 0
    ours = np.array(Image.open(out))
    np.testing.assert_array_equal(ours[..., 3], shop.cover)
    expected = analyze(Picture(rgba, transfer.SRGB), mask=shop.cover > 0)
    region = expected.recolor(TARGET)
    flat = region.reshape(-1, 3).copy()
    gamut.fit_to_gamut(flat)
    np.testing.assert_array_equal(ours[..., :3], transfer.encode(flat, transfer.SRGB, np.uint8).reshape(64, 64, 3))


def test_one_click_selects_and_recolors(run, shop):
    out = shop.folder / "out.png"
    assert run("recolor", shop.photo, "--click", shop.click, "--target", TARGET_TEXT, "-o", out)[0] == 0
    ours = np.array(Image.open(out))
    changed = (ours != shop.codes).any(axis=-1)
    inside = shop.mask == 1
    assert changed[inside].mean() > 0.9
    assert changed[~inside].mean() < 0.02
    # The ball is blue now, but its highlight is not.
    y, x = shop.matte[1], shop.matte[0]
    assert ours[y, x, 2] > 1.5 * ours[y, x, 0]


def test_own_color_writes_the_same_picture(run, shop):
    out = shop.folder / "out.png"
    code, said, _ = run("inspect", shop.photo, "--reference", shop.click, "--target", "#000", "--json")
    color = json.loads(said)["regions"][0]["reference"]
    own = "rgb(" + ",".join(f"{v:.9g}" for v in color) + ")"
    assert run("recolor", shop.photo, "--reference", shop.click, "--target", own, "-o", out)[0] == code == 0
    np.testing.assert_array_equal(np.array(Image.open(out)), shop.codes)


def test_two_regions_in_one_pass(run, shop, product):
    other = product((0.05, 0.3, 0.12), size=64, noise=0.002)
    codes = np.concatenate([shop.codes, transfer.encode(other.image, transfer.SRGB, np.uint8)], axis=1)
    photo = shop.folder / "two.png"
    Image.fromarray(codes).save(photo)
    left, right = f"{shop.click}", f"{other.matte[0] + 64},{other.matte[1]}"
    a, b = f"click={left} target={TARGET_TEXT}", f"click={right} target=#D9A820"
    results = {}
    for name, regions in {"both": (a, b), "a": (a,), "b": (b,)}.items():
        options = [x for r in regions for x in ("--region", r)]
        code, said, err = run("recolor", photo, *options, "-o", shop.folder / f"{name}.png", "--json")
        assert (code, err) == (0, "")
        assert len(json.loads(said)["regions"]) == len(regions)
        results[name] = np.array(Image.open(shop.folder / f"{name}.png"))
    np.testing.assert_array_equal(results["both"][:, :64], results["a"][:, :64])
    np.testing.assert_array_equal(results["both"][:, 64:], results["b"][:, 64:])
    assert (results["a"][:, :64] != codes[:, :64]).any(axis=-1).mean() > 0.4
    assert (results["b"][:, 64:] != codes[:, 64:]).any(axis=-1).mean() > 0.4


def test_region_options_fall_back_to_the_common_ones(run, shop):
    direct, common = shop.folder / "direct.png", shop.folder / "common.png"
    options = ("--reference", shop.click, "--target", TARGET_TEXT, "--residual", "keep")
    assert run("recolor", shop.photo, *options, "-o", direct)[0] == 0
    region = f"reference={shop.click} residual=keep"
    assert run("recolor", shop.photo, "--target", TARGET_TEXT, "--region", region, "-o", common)[0] == 0
    assert direct.read_bytes() == common.read_bytes()


def test_new_light_alone(run, shop):
    out = shop.folder / "evening.exr"
    photo = write_exr(shop.folder / "a.exr", shop.image, "float")
    assert run("recolor", photo, "--illuminant", "1.2,0.9,0.5", "-o", out)[0] == 0
    np.testing.assert_allclose(read_pixels(out), shop.image * np.float32([1.2, 0.9, 0.5]), atol=1e-5)


def test_white_card_and_color_space(run, shop):
    # The same light in another encoding gives the same light.
    linear = np.clip(shop.image, 0, 1)
    linear[:8, :8] = 0.18
    light = transfer.encode(linear, ADOBE_RGB.curve, np.uint16)
    photo, out = shop.folder / "a.tif", shop.folder / "out.tif"
    files.write(photo, light, files.Photo(Path(), light, SPACES["srgb"]))
    options = ("--white", "4,4", "--gray", "0.18", "--reference", shop.click, "--mask", shop.mask_file)
    code, said, _ = run(
        "recolor", photo, *options, "--target", TARGET_TEXT, "--color-space", "adobe-rgb", "-o", out, "--json"
    )
    report = json.loads(said)
    assert code == 0
    np.testing.assert_allclose(report["white"], [1, 1, 1], atol=2e-3)
    assert "pixel (4, 4)" in report["white_source"]
    assert report["color_space"] == "Adobe RGB (1998)"
    again = files.read(out)
    assert again.space.name == "Adobe RGB (1998)"
    ours = transfer.decode(again.pixels, again.space.curve)
    inside = shop.cover == 255
    wanted = analyze(linear, reference=shop.matte, mask=shop.cover).recolor(TARGET)
    settled = inside & (wanted.max(axis=-1) < 0.95) & (wanted.min(axis=-1) > 0)
    assert np.abs(ours - wanted)[settled].max() < 4e-3


@pytest.mark.parametrize(
    ("name", "options"),
    [("out.jpg", ["--quality", "90"]), ("out.webp", []), ("out.tif", ["--compression", "lzw"]), ("out.exr", [])],
)
def test_other_formats(run, shop, name, options):
    out = shop.folder / name
    base = ("recolor", shop.photo, "--reference", shop.click, "--mask", shop.mask_file, "--target", TARGET_TEXT)
    assert run(*base, "-o", shop.folder / "plain.png")[0] == 0
    assert run(*base, *options, "-o", out)[0] == 0
    plain, ours = np.array(Image.open(shop.folder / "plain.png")), files.read(out)
    light = ours.space.curve.decode(ours.pixels / (255 if ours.pixels.dtype == np.uint8 else 1))
    wanted = transfer.decode(plain, transfer.SRGB)
    # Lossy formats blur the noisy picture a little; the others hold the codes, or their light in half floats.
    most = {"out.tif": 1e-6, "out.exr": 3e-3}.get(name, 0.01)
    assert np.abs(light[..., :3] - wanted).mean() < most


# --- what it says -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["recolor", "inspect"])
def test_json_report(run, shop, command):
    options = ["-o", shop.folder / "out.png"] if command == "recolor" else []
    code, said, err = run(
        command,
        shop.photo,
        "--reference",
        shop.click,
        "--mask",
        shop.mask_file,
        "--target",
        "#1F4E79",
        *options,
        "--json",
    )
    assert (code, err) == (0, "")
    report = json.loads(said)
    assert set(report) >= {
        "photo", "width", "height", "pixels", "color_space", "assumptions", "white", "white_source", "target_white",
        "out_of_gamut_share", "regions", "warnings",
    }  # fmt: skip
    assert (report["width"], report["height"], report["pixels"]) == (64, 64, "uint8")
    assert ("output" in report) == (command == "recolor")
    region = report["regions"][0]
    assert region["target"] == "#1F4E79"
    assert region["model"] == "dichromatic"
    assert region["reference_pixel"] == list(shop.matte)
    np.testing.assert_allclose(
        region["target_linear"], transfer.SRGB.decode(np.array([0x1F, 0x4E, 0x79]) / 255), atol=1e-6
    )
    analysis = analyze(Picture(shop.codes, transfer.SRGB), reference=shop.matte, mask=shop.cover)
    assert region["residual_mean"] == pytest.approx(analysis.report["residual_mean"])
    np.testing.assert_allclose(region["matrix"], analysis.matrix(region["target_linear"]), rtol=1e-6)


def test_inspect_writes_nothing_and_says_what_it_found(run, shop):
    before = contents(shop.folder)
    code, said, err = run("inspect", shop.photo, "--click", shop.click, "--target", "#1F4E79")
    assert (code, err) == (0, "")
    assert contents(shop.folder) == before
    for word in (
        "White",
        "Reference",
        "Target",
        "dichromatic",
        "noise gain",
        "Residual",
        "0.27",
        "Clipped",
        "Out of gamut",
    ):
        assert word in said


def test_inspect_and_recolor_agree_on_the_gamut(run, shop):
    # A strong blue: highlights and lit parts leave the space.
    options = ("--reference", shop.click, "--mask", shop.mask_file, "--target", "rgb(0.0,0.02,1.3)", "--json")
    _, inspected, _ = run("inspect", shop.photo, *options)
    _, recolored, _ = run("recolor", shop.photo, *options, "-o", shop.folder / "out.png")
    a, b = (json.loads(text)["out_of_gamut_share"] for text in (inspected, recolored))
    assert b > 0.05
    assert a == pytest.approx(b, abs=0.02)
    assert any("outside the color space" in w for w in json.loads(recolored)["warnings"])


def test_inspect_maps(run, shop):
    folder = shop.folder / "maps" / "deep"
    options = ("inspect", shop.photo, "--reference", shop.click, "--mask", shop.mask_file, "--target", TARGET_TEXT)
    code, said, _ = run(*options, "--maps", folder, "--json")
    assert code == 0
    maps = {Path(p).name: Path(p) for p in json.loads(said)["maps"]}
    assert set(maps) == {"A.png", "B.png", "residual.png", "error.png", "mask.png", "gamut.png"}
    assert set(folder.iterdir()) == set(maps.values())
    analysis = analyze(Picture(shop.codes, transfer.SRGB), reference=shop.matte, mask=shop.cover)
    a = np.array(Image.open(maps["A.png"]).convert("RGB"))[..., 0] / 255
    np.testing.assert_allclose(a, np.clip(analysis.A / 2, 0, 1), atol=0.003)
    residual = np.array(Image.open(maps["residual.png"]).convert("RGB"))[..., 0] / 255
    np.testing.assert_allclose(residual, np.clip(analysis.residual * 8, 0, 1), atol=0.003)
    cover = np.array(Image.open(maps["mask.png"]).convert("RGB"))[..., 0]
    np.testing.assert_array_equal(cover, shop.cover)
    # There already: left alone without --force.
    before = contents(shop.folder)
    code, _, err = run(*options, "--maps", folder)
    assert code == 2
    assert "exists already" in err
    assert contents(shop.folder) == before
    assert run(*options, "--maps", folder, "--force")[0] == 0


def test_existing_output_needs_force(run, shop):
    out = shop.folder / "out.png"
    out.write_bytes(b"precious")
    options = ("recolor", shop.photo, "--reference", shop.click, "--target", TARGET_TEXT, "-o", out)
    code, _, err = run(*options)
    assert code == 2
    assert "--force" in err
    assert out.read_bytes() == b"precious"
    assert run(*options, "--force")[0] == 0
    assert np.array(Image.open(out)).shape == (64, 64, 3)


def test_glossy_click_is_warned_of(run, shop, product):
    scene = product(size=160, noise=0.001)
    photo = shop.folder / "glossy.png"
    Image.fromarray(transfer.encode(scene.image, transfer.SRGB, np.uint8)).save(photo)
    y, x = np.unravel_index(np.argmin(np.where(scene.mask == 1, np.abs(scene.gloss - 0.2), 9)), scene.mask.shape)
    _, said, _ = run("inspect", photo, "--reference", f"{x},{y}", "--target", TARGET_TEXT)
    assert re.search(r"Warning: The reference pixel is glossy \(about \d+% of the white\)", said)


@pytest.mark.parametrize("how", [["--spill"], ["--region", "spill=yes"]])
def test_spill_recolors_the_rim_that_a_tight_mask_leaves(run, shop, how):
    tight = shop.folder / "tight.png"
    Image.fromarray(erode(shop.mask == 1, 2).astype(np.uint8) * 255).save(tight)
    asked = [shop.photo, "--click", shop.click, "--mask", tight, "--target", TARGET_TEXT]
    made = {}
    for name, more in (("plain", []), ("spilled", how)):
        run("recolor", *asked, *more, "-o", shop.folder / f"{name}.png")
        made[name] = np.asarray(Image.open(shop.folder / f"{name}.png"))[..., :3]
    rim = (shop.mask == 1) & ~erode(shop.mask == 1, 2)
    assert (made["plain"][rim] == shop.codes[rim]).all()
    assert (made["spilled"][rim] != shop.codes[rim]).any(axis=1).mean() > 0.9
    far = ~dilate(shop.mask == 1, 6)
    assert np.abs(made["spilled"][far].astype(int) - shop.codes[far]).max() <= 3


# --- bad input: exit code 2, one sentence, nothing changed ------------------------------------------------------


def fails(run, folder, *arguments):
    """Run a command that must fail; returns the sentence."""
    before = contents(folder)
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert contents(folder) == before, "something was written or changed"
    sentence = err.removesuffix("\n")
    assert re.fullmatch(r"dyehouse: [A-Z'][^\n]*\.", sentence), err
    assert "Traceback" not in err
    assert len(sentence) < 500
    return sentence


def a_tiff(path, pixels):
    files.write(path, pixels, files.Photo(Path(), pixels, SPACES["srgb"]))


def make_missing(path, shop):
    return "does not exist"


def make_empty(path, shop):
    path.write_bytes(b"")
    return "is empty"


def make_truncated(path, shop):
    path.write_bytes(shop.photo.read_bytes()[: shop.photo.stat().st_size // 2])
    return "damaged or cut short"


def make_text(path, shop):
    path.write_text("this is no picture\n" * 50)
    return "is no picture"


def make_folder(path, shop):
    path.mkdir()
    return "is a folder"


def make_zero_size(path, shop):
    # A PNG whose header says 0 x 0.
    data = bytearray(shop.photo.read_bytes())
    import zlib

    data[16:24] = bytes(8)
    data[29:33] = zlib.crc32(data[12:29]).to_bytes(4)
    path.write_bytes(data)
    return "damaged or cut short"


def make_black(path, shop):
    Image.new("RGB", (20, 20)).save(path)
    return "black"


def make_white(path, shop):
    Image.new("RGB", (20, 20), (255, 255, 255)).save(path)
    return "clipped"


@pytest.mark.parametrize(
    "make",
    [make_missing, make_empty, make_truncated, make_text, make_folder, make_zero_size, make_black, make_white],
    ids=lambda f: f.__name__[5:],
)
@pytest.mark.parametrize("command", ["recolor", "inspect"])
def test_photos_that_are_none(run, shop, make, command):
    photo = shop.folder / "bad.png"
    words = make(photo, shop)
    options = ["-o", shop.folder / "out.png"] if command == "recolor" else []
    assert words in fails(run, shop.folder, command, photo, "--target", "#123456", *options)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", [0, 3])
def test_exr_with_pixels_that_are_no_numbers(run, shop, bad, channel):
    image = np.concatenate([shop.image, np.ones((64, 64, 1), np.float32)], axis=2)
    image[7, 9, channel] = bad
    photo = write_exr(shop.folder / "bad.exr", image)
    sentence = fails(run, shop.folder, "recolor", photo, "--target", TARGET_TEXT, "-o", shop.folder / "out.exr")
    assert "NaN or infinite" in sentence
    assert "9,7" in sentence


def test_one_pixel_is_a_picture(run, tmp_path):
    Image.new("RGB", (1, 1), (160, 60, 40)).save(tmp_path / "one.png")
    for options in ((), ("--reference", "0,0"), ("--click", "0,0")):
        out = tmp_path / "out.png"
        code, _, err = run("recolor", tmp_path / "one.png", *options, "--target", "#1F4E79", "-o", out, "--force")
        assert (code, err) == (0, "")
        assert np.array(Image.open(out)).tolist() == [[[0x1F, 0x4E, 0x79]]]


def test_hundred_megapixels(run, tmp_path):
    # Uniform, and so a small file.
    photo, out = tmp_path / "large.png", tmp_path / "out.png"
    spec = OpenImageIO.ImageSpec(12500, 8000, 3, "uint8")
    spec.attribute("png:compressionLevel", 1)
    output = OpenImageIO.ImageOutput.create(str(photo))
    assert output.open(str(photo), spec)
    rows = np.broadcast_to(np.array([160, 60, 40], np.uint8), (500, 12500, 3)).copy()
    for top in range(0, 8000, 500):
        assert output.write_scanlines(top, top + 500, 0, rows)
    assert output.close()
    code, said, err = run("recolor", photo, "--reference", "12000,7900", "--target", "#1F4E79", "-o", out, "--json")
    assert (code, err) == (0, "")
    assert json.loads(said)["regions"][0]["reference_pixel"] == [12000, 7900]
    source = OpenImageIO.ImageInput.open(str(out))
    assert (source.spec().width, source.spec().height) == (12500, 8000)
    for top in (0, 7000):
        part = source.read_scanlines(top, top + 10, 0, 0, 3, "uint8")
        assert (part == [0x1F, 0x4E, 0x79]).all()
    source.close()


MASKS = {
    "fully masked out": (np.zeros((64, 64), np.uint8), "selects nothing"),
    "another size": (np.full((32, 64), 255, np.uint8), "64 x 32 pixels and the photo 64 x 64"),
    "colored": (np.dstack([np.full((64, 64), v, np.uint8) for v in (255, 0, 0)]), "is colored"),
}


@pytest.mark.parametrize("name", MASKS)
def test_bad_masks(run, shop, name):
    pixels, words = MASKS[name]
    mask = shop.folder / "bad-mask.png"
    Image.fromarray(pixels).save(mask)
    arguments = ("recolor", shop.photo, "--target", "#123456", "--mask", mask, "-o", shop.folder / "out.png")
    assert words in fails(run, shop.folder, *arguments)


BAD_OPTIONS = [
    (["--reference", "64,5"], "lies outside the picture of 64 x 64"),
    (["--reference=-1,5"], "lies outside"),
    (["--reference", "nan,5"], "Reference"),
    (["--reference", "inf,5"], "Reference"),
    (["--reference", "5"], "is not understood"),
    (["--reference", "a,b"], "is not understood"),
    (["--reference", "1,2,3,4"], "is not understood"),
    (["--reference", ""], "is not understood"),
    (["--reference", "0,0,0"], "is black"),
    (["--reference", "0,0", "--mask", "MASK"], "is outside the mask"),
    (["--click", "64,5"], "lies outside"),
    (["--click", "nan,5"], "Click"),
    (["--click", "5,inf"], "Click"),
    (["--click", "1,2,3"], "is not understood"),
    (["--click", "30,30", "--tolerance", "0"], "is not above zero"),
    (["--click", "30,30", "--tolerance", "nan"], "is not above zero"),
    (["--mask", "missing.png"], "does not exist"),
    (["--mask", "alpha"], "has no alpha"),
    (["--mask", "click"], "needs a pixel"),
    (["--white", "1,0,1"], "zero or negative"),
    (["--white", "1,1,-0.5"], "zero or negative"),
    (["--white", "nan,1,1"], "White"),
    (["--white", "64,5"], "lies outside"),
    (["--white", "nan,5"], "White"),
    (["--white", "5,inf"], "White"),
    (["--white", "0.2,0.1,0.05", "--reference", "0.2,0.1,0.05"], "the same color"),
    (["--white", "moonlight"], "is not known"),
    (["--white", "3,3", "--gray", "0"], "grey card"),
    (["--white", "3,3", "--gray", "nan"], "grey card"),
    (["--white", "highlights", "--mask", "DULL"], "few|highlights"),
    (["--illuminant", "moonlight"], "is not known"),
    (["--illuminant", "0,1,1"], "zero or negative"),
    (["--illuminant", "3,4"], "is not understood"),
    (["--target", "reddish"], "reddish"),
    (["--target", "#12345"], "#12345"),
    (["--target", "lab(50,20)"], "lab"),
    (["--target", "rgb(nan,0,0)"], "rgb|finite|number"),
    (["--target", "missing.csv"], "missing.csv"),
    (["--target", ""], "target"),
    (["--model", "wood"], "is not known"),
    (["--model", "dichromatic", "--reference", "0.3,0.3,0.3"], "color of the white"),
    (["--residual", "most"], "fade, keep, drop"),
    (["--residual", "1.5"], "fade, keep, drop"),
    (["--residual", "nan"], "fade, keep, drop"),
    (["--camera", "box"], "box"),
    (["--color-space", "cmyk"], "is not known"),
    (["--quality", "0"], "1..100"),
    (["--quality", "101"], "1..100"),
    (["--compression", "zip"], "takes no compression"),
    (["--meaning", "product", "--source", "reddish"], "reddish"),
    (["--region", "target"], "KEY=VALUE"),
    (["--region", "color=red"], "KEY=VALUE"),
    (["--region", "target='#123456"], "quotes"),
    (["--region", "tolerance=wide"], "is not a number"),
    (["--region", "meaning=shade"], "is not known"),
]


@pytest.mark.parametrize(("options", "words"), BAD_OPTIONS, ids=lambda v: " ".join(v) if isinstance(v, list) else "")
def test_bad_options(run, shop, options, words):
    dull = shop.folder / "dull.png"
    cover = np.zeros((64, 64), np.uint8)
    cover[2:5, 2:5] = 255
    Image.fromarray(cover).save(dull)
    options = [{"MASK": str(shop.mask_file), "DULL": str(dull)}.get(o, o) for o in options]
    target = [] if "--target" in options else ["--target", "#123456"]
    arguments = ["recolor", shop.photo, *target, *options, "-o", shop.folder / "out.png"]
    assert re.search(words, fails(run, shop.folder, *arguments), re.IGNORECASE)


def test_reference_on_clipped_and_black_pixels(run, shop):
    codes = shop.codes.copy()
    codes[20:30, 20:30], codes[40:50, 40:50] = 255, 0
    photo = shop.folder / "spots.png"
    Image.fromarray(codes).save(photo)
    base = ("recolor", photo, "--target", "#123456", "-o", shop.folder / "out.png")
    assert "is clipped" in fails(run, shop.folder, *base, "--reference", "25,25")
    assert "is black" in fails(run, shop.folder, *base, "--reference", "45,45")
    assert "is on black" in fails(run, shop.folder, *base, "--click", "45,45")
    assert "clipped" in fails(run, shop.folder, *base, "--white", "25,25")
    assert "black in a channel" in fails(run, shop.folder, *base, "--white", "45,45")


def test_nothing_asked_for(run, shop):
    sentence = fails(run, shop.folder, "recolor", shop.photo, "-o", shop.folder / "out.png")
    assert "no target color and no new illuminant" in sentence


def test_outputs_that_cannot_be(run, shop):
    (shop.folder / "there.png").mkdir()
    base = ("recolor", shop.photo, "--target", "#123456", "--force", "-o")
    cases = {
        shop.folder / "nowhere" / "out.png": "does not exist",
        shop.photo / "out.png": "does not exist|not a folder",
        shop.folder / "there.png": "is a folder",
        shop.folder / "out.gif": "known extension",
        shop.folder / "out": "known extension",
        shop.folder / "out.nef": "cannot be written",
        shop.folder / ("x" * 300 + ".png"): "could not be written|too long",
        shop.photo: "is the source itself",
        shop.folder / "." / "ball.png": "is the source itself",
    }
    for out, words in cases.items():
        assert re.search(words, fails(run, shop.folder, *base, out)), out


def test_output_that_is_a_link_to_the_source(run, shop):
    link, hard = shop.folder / "link.png", shop.folder / "hard.png"
    link.symlink_to(shop.photo)
    hard.hardlink_to(shop.photo)
    for out in (link, hard):
        sentence = fails(run, shop.folder, "recolor", shop.photo, "--target", "#123456", "--force", "-o", out)
        assert "is the source itself" in sentence


def test_errors_in_json(run, shop):
    code, out, err = run("recolor", shop.photo, "--target", "reddish", "-o", shop.folder / "out.png", "--json")
    assert code == 2
    assert err.startswith("dyehouse: ")
    assert json.loads(out)["error"] == err.removeprefix("dyehouse: ").rstrip("\n")


@pytest.mark.parametrize(
    "arguments", [[], ["dye"], ["recolor"], ["recolor", "a.png"], ["inspect", "a.png", "--gray", "x"]]
)
def test_usage_errors_have_exit_code_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert "usage: dyehouse" in capsys.readouterr().err


def test_help_has_examples(capsys):
    for arguments in (["--help"], ["recolor", "--help"], ["inspect", "--help"]):
        with pytest.raises(SystemExit) as stop:
            main(arguments)
        assert stop.value.code == 0
        said = capsys.readouterr().out
        assert "examples:" in said
        assert "--target" in said


# --- as a process of its own --------------------------------------------------------------------------------------


def process(*arguments, **options):
    command = [sys.executable, "-m", "dyehouse", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def test_as_a_process(shop):
    out = shop.folder / "out.png"
    done = process("recolor", shop.photo, "--click", shop.click, "--target", "#1F4E79", "-o", out)
    assert (done.returncode, done.stderr) == (0, "")
    assert f"Wrote {out}" in done.stdout
    assert np.array(Image.open(out)).shape == (64, 64, 3)
    again = process("recolor", shop.photo, "--click", shop.click, "--target", "#1F4E79", "-o", out)
    assert again.returncode == 2
    assert again.stdout == ""
    assert re.fullmatch(r"dyehouse: '.*' exists already: .*\.\n", again.stderr)


def test_relative_paths(shop):
    done = process("recolor", "ball.png", "--mask", "mask.png", "--target", "#1F4E79", "-o", "o.png", cwd=shop.folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert (shop.folder / "o.png").is_file()


def test_full_disk(shop):
    # A limit on the size of files stands in for a full disk: it needs no rights, and holds for the process.
    noise = np.random.default_rng(0).integers(60, 200, (200, 200, 3), np.uint8)
    photo, out = shop.folder / "noise.png", shop.folder / "out.png"
    Image.fromarray(noise).save(photo)
    out.write_bytes(b"precious")
    before = contents(shop.folder)
    code = (
        "import resource, signal, sys\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "from dyehouse.batch.cli import main\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    options = ["recolor", str(photo), "--target", "#1F4E79", "--reference", "0.4,0.2,0.1", "-o", str(out), "--force"]
    done = subprocess.run([sys.executable, "-c", code, *options], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert re.fullmatch(
        r"dyehouse: '.*out\.png' could not be written \(.*\): check the disk and folder\.\n", done.stderr
    )
    assert contents(shop.folder) == before
