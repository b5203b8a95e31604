"""Files: exact codes, the right light, what the file says carried over, and errors in words.

Pillow and tifffile make and check the files, so that the reader and the writer are never their own witness.
"""

import io
import os
import struct
import subprocess
import sys
import textwrap
import zlib

import numpy as np
import OpenImageIO
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, IptcImagePlugin, PngImagePlugin, TiffImagePlugin

from dyehouse.batch import files, icc
from dyehouse.core import transfer
from dyehouse.core.colorspace import SPACES
from dyehouse.core.errors import DyehouseError, FileError, ImageError, MaskError

RNG = np.random.default_rng(7)
RGB = RNG.integers(0, 256, (20, 30, 3), dtype=np.uint8)
RGBA = RNG.integers(0, 256, (20, 30, 4), dtype=np.uint8)
RGB16 = RNG.integers(0, 65536, (20, 30, 3), dtype=np.uint16)
FLOATS = RNG.normal(0.5, 2, (20, 30, 3)).astype(np.float32)
XMP = (
    b'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
    b'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
    b'xmlns:foo="http://example.org/foo/" xmlns:tiff="http://ns.adobe.com/tiff/1.0/" tiff:Orientation="6" '
    b'foo:bar="unknown to OpenImageIO"/></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
)
UPRIGHT_XMP = XMP.replace(b'Orientation="6"', b'Orientation="1"')
IPTC = b"".join(
    b"\x1c\x02" + struct.pack(">BH", number, len(text)) + text
    for number, text in ((5, b"Object name"), (80, b"By-line"), (120, b"Caption"))
)
PHOTOSHOP = b"8BIM\x04\x04\0\0" + struct.pack(">I", len(IPTC)) + IPTC + bytes(len(IPTC) % 2)
OUTPUTS = (".png", ".jpg", ".tif", ".webp")
PROFILE = icc.write_profile(SPACES["display-p3"])


def opened(path):
    """The picture as Pillow reads it, without a file left open."""
    image = Image.open(io.BytesIO(path.read_bytes()))
    image.load()
    return image


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def exif():
    block = Image.Exif()
    block[0x010F], block[0x0110], block[0x0112] = "Maker", "Model X", 6
    block[0x0132], block[0x8298] = "2024:01:02 03:04:05", "Somebody"
    inner = block.get_ifd(0x8769)
    inner[0x829A], inner[0x8827] = TiffImagePlugin.IFDRational(1, 125), 200
    inner[0x927C], inner[0xA434] = b"MAKERNOTE1234", "Lens 50mm"
    place = block.get_ifd(0x8825)
    place[1], place[2], place[3], place[4] = "N", (51.0, 30.0, 26.0), "W", (0.0, 7.0, 39.0)
    return block


def with_segment(path, marker, body):
    """Put a segment into a JPEG after its first one."""
    data = path.read_bytes()
    at = 4 + struct.unpack_from(">H", data, 4)[0]
    path.write_bytes(data[:at] + struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body + data[at:])


def with_chunk(path, name, body):
    """Put a chunk into a PNG after its header."""
    data = path.read_bytes()
    chunk = struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    path.write_bytes(data[:33] + chunk + data[33:])


def described(folder, extension):
    """A file with every kind of metadata its format has, turned by its orientation."""
    path = folder / f"source{extension}"
    image = Image.fromarray(RGB)
    if extension == ".jpg":
        image.save(path, quality=95, icc_profile=PROFILE, exif=exif(), xmp=XMP, dpi=(240, 240), comment=b"note")
        with_segment(path, 0xED, b"Photoshop 3.0\0" + PHOTOSHOP)
    elif extension == ".png":
        info = PngImagePlugin.PngInfo()
        info.add_text("Author", "Me")
        info.add_itxt("XML:com.adobe.xmp", XMP.decode())
        image.save(path, icc_profile=PROFILE, exif=exif(), pnginfo=info, dpi=(240, 240))
    elif extension == ".webp":
        image.save(path, icc_profile=PROFILE, exif=exif(), xmp=XMP, lossless=True)
    else:
        block = exif()
        block[700], block[33723], block[315] = XMP, IPTC, "Artist A"
        # Pillow writes these two into a TIFF only when they are plain dictionaries.
        for tag in (0x8769, 0x8825):
            block[tag] = dict(block.get_ifd(tag))
        image.save(path, icc_profile=PROFILE, exif=block, dpi=(240, 240))
    return path


# --- codes --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pixels", [RGB, RGBA])
@pytest.mark.parametrize("extension", [".png", ".tif", ".webp"])
def test_8_bit_codes_are_exact_both_ways(tmp_path, pixels, extension):
    source = tmp_path / f"in{extension}"
    options = {"lossless": True, "exact": True} if extension == ".webp" else {}
    Image.fromarray(pixels).save(source, **options)
    photo = files.read(source)
    assert photo.pixels.dtype == np.uint8
    assert not photo.premultiplied
    np.testing.assert_array_equal(photo.pixels, pixels)
    files.write(tmp_path / f"out{extension}", photo.pixels, photo)
    back = np.asarray(opened(tmp_path / f"out{extension}"))
    seen = pixels[..., 3] > 0 if pixels.shape[2] == 4 else np.ones(pixels.shape[:2], bool)
    np.testing.assert_array_equal(back[seen], pixels[seen])
    np.testing.assert_array_equal(back[..., 3:], pixels[..., 3:])


@pytest.mark.parametrize("pixels", [RGB16, FLOATS, FLOATS.astype(np.float16)], ids=lambda p: p.dtype.name)
def test_deep_tiff_is_exact_both_ways(tmp_path, pixels):
    tifffile.imwrite(tmp_path / "in.tif", pixels, photometric="rgb")
    photo = files.read(tmp_path / "in.tif")
    assert photo.pixels.dtype == pixels.dtype
    np.testing.assert_array_equal(photo.pixels, pixels)
    files.write(tmp_path / "out.tif", photo.pixels, photo, compression="none")
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "out.tif"), pixels)


def test_16_bit_png_is_exact_both_ways(tmp_path):
    photo = files.Photo(tmp_path / "none", RGB16, SPACES["srgb"])
    files.write(tmp_path / "a.png", RGB16, photo)
    head = (tmp_path / "a.png").read_bytes()[:33]
    assert head[24] == 16
    again = files.read(tmp_path / "a.png")
    np.testing.assert_array_equal(again.pixels, RGB16)
    high = np.asarray(opened(tmp_path / "a.png").convert("RGB"))
    np.testing.assert_array_equal(high, RGB16 >> 8)


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_exr_is_exact_and_premultiplied(tmp_path, dtype):
    pixels = RNG.normal(0.5, 2, (9, 7, 4)).astype(dtype)
    photo = files.Photo(tmp_path / "none", pixels, SPACES["acescg"], premultiplied=True)
    files.write(tmp_path / "a.exr", pixels, photo)
    buffer = OpenImageIO.ImageBuf(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(buffer.get_pixels("float"), pixels.astype(np.float32))
    again = files.read(tmp_path / "a.exr")
    assert again.premultiplied
    assert again.pixels.dtype == dtype
    assert again.space is SPACES["acescg"]
    assert again.assumptions == ()
    np.testing.assert_array_equal(again.pixels, pixels)


def test_tiff_with_multiplied_alpha_is_straight_here_and_as_it_was_in_the_file(tmp_path):
    alpha = RGBA[..., 3:].astype(int)
    stored = np.concatenate([RGBA[..., :3] * alpha // 255, alpha], axis=2).astype(np.uint8)
    tifffile.imwrite(tmp_path / "in.tif", stored, photometric="rgb", extrasamples=["assocalpha"])
    photo = files.read(tmp_path / "in.tif")
    opaque = alpha[..., 0] > 200
    assert np.abs(photo.pixels[opaque].astype(int) - RGBA[opaque]).max() <= 2
    files.write(tmp_path / "out.tif", photo.pixels, photo, compression="none")
    with tifffile.TiffFile(tmp_path / "out.tif") as out:
        np.testing.assert_array_equal(out.asarray(), stored)
        assert out.pages[0].extrasamples == (1,)


def test_a_jpeg_stays_close_and_keeps_full_chroma(tmp_path):
    y, x = np.mgrid[0:48, 0:64]
    smooth = np.stack([x * 3, y * 4, 255 - x * 2], axis=2).astype(np.uint8)
    photo = files.Photo(tmp_path / "none", smooth, SPACES["srgb"])
    files.write(tmp_path / "a.jpg", smooth, photo)
    with opened(tmp_path / "a.jpg") as image:
        assert {tuple(part[1:3]) for part in image.layer} == {(1, 1)}
        assert np.abs(np.asarray(image).astype(int) - smooth).max() < 8
    files.write(tmp_path / "b.jpg", smooth, photo, quality=40)
    assert (tmp_path / "b.jpg").stat().st_size < (tmp_path / "a.jpg").stat().st_size


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (257, 3)])
@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".exr", ".webp"])
def test_small_sizes_and_odd_names(tmp_path, size, extension):
    pixels = np.full((*size, 3), 128, np.uint8)
    photo = files.Photo(tmp_path / "none", pixels, SPACES["srgb"])
    path = files.write(tmp_path / f"зелёный 椅子 a b{extension}", pixels, photo)
    assert files.read(path).pixels.shape == (*size, 3)
    assert names_in(tmp_path) == [path.name]


# --- kinds of pictures --------------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", [".png", ".tif"])
def test_palette_is_read_as_its_colors(tmp_path, extension):
    colors = np.array([[0, 0, 0], [255, 0, 0], [0, 255, 0], [255, 255, 255]], np.uint8)
    index = RNG.integers(0, 4, (8, 9), dtype=np.uint8)
    image = Image.frombytes("P", (9, 8), index.tobytes())
    image.putpalette(colors.tobytes())
    image.save(tmp_path / f"a{extension}")
    # Pillow writes a TIFF palette of 255 as 0xFF00, a code less than full.
    read = files.read(tmp_path / f"a{extension}").pixels.astype(int)
    assert np.abs(read - colors[index]).max() <= (1 if extension == ".tif" else 0)


def test_palette_with_a_transparent_color_has_alpha(tmp_path):
    image = Image.frombytes("P", (2, 1), b"\0\1")
    image.putpalette([10, 20, 30, 40, 50, 60])
    image.save(tmp_path / "a.png", transparency=0)
    assert files.read(tmp_path / "a.png").pixels.tolist() == [[[10, 20, 30, 0], [40, 50, 60, 255]]]


@pytest.mark.parametrize("extension", [".png", ".tif", ".jpg"])
def test_grey_becomes_three_equal_channels_and_says_so(tmp_path, extension):
    grey = np.arange(64, dtype=np.uint8).reshape(8, 8) * 3
    Image.fromarray(grey).save(tmp_path / f"a{extension}", quality=100)
    photo = files.read(tmp_path / f"a{extension}")
    assert any("greyscale" in note for note in photo.assumptions)
    assert photo.pixels.shape == (8, 8, 3)
    assert np.abs(photo.pixels.astype(int) - grey[..., None]).max() <= (1 if extension == ".jpg" else 0)


def test_grey_with_alpha_and_one_bit(tmp_path):
    Image.fromarray(RGBA[..., :2]).save(tmp_path / "a.png")
    np.testing.assert_array_equal(files.read(tmp_path / "a.png").pixels, RGBA[..., [0, 0, 0, 1]])
    Image.fromarray(RGB[..., 0] > 100).save(tmp_path / "b.png")
    np.testing.assert_array_equal(files.read(tmp_path / "b.png").pixels[..., 0], (RGB[..., 0] > 100) * 255)


def test_grey_profile_is_left_out_and_said(tmp_path):
    grey = bytearray(PROFILE)
    grey[16:20] = b"GRAY"
    Image.fromarray(RGB[..., 0]).save(tmp_path / "a.png", icc_profile=bytes(grey))
    photo = files.read(tmp_path / "a.png")
    assert any("grey profile" in note for note in photo.assumptions)
    files.write(tmp_path / "b.png", photo.pixels, photo)
    assert "icc_profile" not in opened(tmp_path / "b.png").info


@pytest.mark.parametrize("extension", [".jpg", ".tif"])
def test_cmyk_is_refused_with_the_remedy(tmp_path, extension):
    Image.fromarray(RGB).convert("CMYK").save(tmp_path / f"a{extension}")
    with pytest.raises(FileError, match="CMYK: convert it to RGB"):
        files.read(tmp_path / f"a{extension}")


def test_lab_and_odd_sample_types_are_refused(tmp_path):
    tifffile.imwrite(tmp_path / "lab.tif", RGB, photometric="cielab")
    with pytest.raises(FileError, match="CIELAB"):
        files.read(tmp_path / "lab.tif")
    tifffile.imwrite(tmp_path / "int.tif", RGB.astype(np.int16), photometric="rgb")
    with pytest.raises(FileError, match="int16"):
        files.read(tmp_path / "int.tif")


def test_first_page_of_a_tiff_and_said(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.stack([RGB, RGB // 2, RGB // 3]), photometric="rgb")
    photo = files.read(tmp_path / "a.tif")
    np.testing.assert_array_equal(photo.pixels, RGB)
    assert any("only the first" in note for note in photo.assumptions)


@pytest.mark.parametrize("options", [{"planarconfig": "separate"}, {"bigtiff": True}, {"byteorder": ">"}])
def test_other_layouts_of_tiff(tmp_path, options):
    stored = np.moveaxis(RGB16, 2, 0) if "planarconfig" in options else RGB16
    tifffile.imwrite(tmp_path / "a.tif", stored, photometric="rgb", software="Byte order", **options)
    photo = files.read(tmp_path / "a.tif")
    np.testing.assert_array_equal(photo.pixels, RGB16)
    files.write(tmp_path / "b.tif", photo.pixels, photo)
    with tifffile.TiffFile(tmp_path / "b.tif") as out:
        assert out.pages[0].software == "Byte order"
        np.testing.assert_array_equal(out.asarray(), RGB16)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("extension", [".exr", ".tif"])
def test_pixels_that_are_no_numbers_are_refused_with_their_place(tmp_path, bad, extension):
    pixels = FLOATS.copy()
    pixels[4, 9, 1] = pixels[7, 2, 0] = bad
    photo = files.Photo(tmp_path / "none", pixels, SPACES["linear-srgb"])
    files.write(tmp_path / f"a{extension}", pixels, photo)
    with pytest.raises(ImageError, match=r"2 of them, the first at 9,4"):
        files.read(tmp_path / f"a{extension}")


def write_exr(path, names, pixels, **attributes):
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], len(names), "float")
    spec.channelnames = names
    for name, value in attributes.items():
        spec.attribute(name, *value) if isinstance(value, tuple) else spec.attribute(name, value)
    out = OpenImageIO.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    assert out.close()


def test_layered_exr_gives_the_combined_picture(tmp_path):
    layers = RNG.random((4, 5, 8)).astype(np.float32)
    names = ["V.Combined.R", "V.Combined.G", "V.Combined.B", "V.Combined.A", "V.Dif.R", "V.Dif.G", "V.Dif.B", "V.Z"]
    write_exr(tmp_path / "a.exr", names, layers)
    photo = files.read(tmp_path / "a.exr")
    np.testing.assert_array_equal(photo.pixels, layers[..., :4])
    assert any("layers" in note for note in photo.assumptions)


def test_exr_without_color_names_what_it_holds(tmp_path):
    write_exr(tmp_path / "a.exr", ["Z", "N.x"], np.ones((4, 5, 2), np.float32))
    with pytest.raises(FileError, match=r"(Z, N\.x|N\.x, Z)"):
        files.read(tmp_path / "a.exr")


# --- color spaces -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["srgb", "display-p3", "adobe-rgb", "prophoto", "rec2020", "linear-srgb"])
@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp"])
def test_icc_profile_gives_the_space_and_survives(tmp_path, name, extension):
    profile = icc.write_profile(SPACES[name])
    Image.fromarray(RGB).save(tmp_path / f"a{extension}", icc_profile=profile)
    photo = files.read(tmp_path / f"a{extension}")
    assert photo.space is SPACES[name]
    assert photo.assumptions == ()
    for out in (".png", ".jpg", ".tif", ".webp"):
        files.write(tmp_path / f"b{out}", photo.pixels, photo, force=True)
        assert opened(tmp_path / f"b{out}").info["icc_profile"] == profile


def test_large_profile_goes_through_several_jpeg_segments(tmp_path):
    profile = PROFILE + bytes(100_000)
    Image.fromarray(RGB).save(tmp_path / "a.jpg", icc_profile=profile)
    photo = files.read(tmp_path / "a.jpg")
    files.write(tmp_path / "b.jpg", photo.pixels, photo)
    assert opened(tmp_path / "b.jpg").info["icc_profile"] == profile


@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp"])
def test_no_profile_is_srgb_by_a_stated_assumption(tmp_path, extension):
    Image.fromarray(RGB).save(tmp_path / f"a{extension}")
    photo = files.read(tmp_path / f"a{extension}")
    assert photo.space is SPACES["srgb"]
    assert photo.assumptions == ("No color profile in the file: taken as sRGB.",)
    files.write(tmp_path / f"b{extension}", photo.pixels, photo)
    assert "icc_profile" not in opened(tmp_path / f"b{extension}").info


def test_override_wins_and_its_profile_replaces_the_old_one(tmp_path):
    Image.fromarray(RGB).save(tmp_path / "a.png", icc_profile=PROFILE)
    photo = files.read(tmp_path / "a.png", "adobe-rgb")
    assert photo.space is SPACES["adobe-rgb"]
    files.write(tmp_path / "b.png", photo.pixels, photo)
    assert files.read(tmp_path / "b.png").space is SPACES["adobe-rgb"]
    with pytest.raises(ImageError, match="'beige' is not known"):
        files.read(tmp_path / "a.png", "beige")


def test_unknown_profile_is_an_error_that_the_override_cures(tmp_path):
    odd = bytearray(PROFILE)
    odd[16:20] = b"CMYK"
    Image.fromarray(RGB).save(tmp_path / "a.png", icc_profile=bytes(odd))
    with pytest.raises(FileError, match="--color-space"):
        files.read(tmp_path / "a.png")
    assert files.read(tmp_path / "a.png", "srgb").space is SPACES["srgb"]


@pytest.mark.parametrize(
    ("code", "name"),
    [((1, 13), "srgb"), ((12, 13), "display-p3"), ((9, 14), "rec2020"), ((9, 8), "linear-rec2020")],
)
def test_cicp_of_a_png(tmp_path, code, name):
    Image.fromarray(RGB).save(tmp_path / "a.png", icc_profile=icc.write_profile(SPACES["adobe-rgb"]))
    with_chunk(tmp_path / "a.png", b"cICP", bytes([*code, 0, 1]))
    photo = files.read(tmp_path / "a.png")
    assert photo.space is SPACES[name]
    files.write(tmp_path / "b.png", photo.pixels, photo)
    assert b"cICP" + bytes([*code, 0, 1]) in (tmp_path / "b.png").read_bytes()
    files.write(tmp_path / "b.tif", photo.pixels, photo)
    assert files.read(tmp_path / "b.tif").space is SPACES[name]


@pytest.mark.parametrize("code", [(9, 16, 0, 1), (9, 18, 0, 1), (9, 13, 9, 1), (200, 1, 0, 1)])
def test_hdr_and_odd_cicp_are_refused(tmp_path, code):
    Image.fromarray(RGB).save(tmp_path / "a.png")
    with_chunk(tmp_path / "a.png", b"cICP", bytes(code))
    with pytest.raises(FileError, match="not supported"):
        files.read(tmp_path / "a.png")


def test_gamma_and_chromaticities_of_a_png(tmp_path):
    Image.fromarray(RGB).save(tmp_path / "a.png")
    p3 = (31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000)
    with_chunk(tmp_path / "a.png", b"cHRM", struct.pack(">8I", *p3))
    with_chunk(tmp_path / "a.png", b"gAMA", struct.pack(">I", 100000))
    assert files.read(tmp_path / "a.png").space is SPACES["linear-p3"]
    Image.fromarray(RGB).save(tmp_path / "b.png")
    with_chunk(tmp_path / "b.png", b"gAMA", struct.pack(">I", 45455))
    photo = files.read(tmp_path / "b.png")
    assert photo.space is SPACES["srgb"]
    assert len(photo.assumptions) == 2


@pytest.mark.parametrize(("value", "name"), [(1, "srgb"), (2, "adobe-rgb")])
def test_color_space_of_exif(tmp_path, value, name):
    block = Image.Exif()
    block.get_ifd(0x8769)[0xA001] = value
    Image.fromarray(RGB).save(tmp_path / "a.jpg", exif=block)
    photo = files.read(tmp_path / "a.jpg")
    assert photo.space is SPACES[name]
    assert photo.assumptions == ()


def test_exr_color_attributes(tmp_path):
    pixels = np.ones((3, 4, 3), np.float32)
    cases = {
        "linear-rec2020": {"chromaticities": ("float[8]", (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329))},
        "acescg": {"colorInteropID": "lin_ap1_scene"},
        "linear-srgb": {"colorInteropID": "lin_rec709_scene"},
    }
    for name, attributes in cases.items():
        write_exr(tmp_path / "a.exr", ["R", "G", "B"], pixels, **attributes)
        photo = files.read(tmp_path / "a.exr")
        assert (photo.space, photo.assumptions) == (SPACES[name], ())
        files.write(tmp_path / "b.exr", pixels, photo, force=True)
        assert files.read(tmp_path / "b.exr").space is SPACES[name]
    write_exr(tmp_path / "a.exr", ["R", "G", "B"], pixels)
    photo = files.read(tmp_path / "a.exr")
    assert photo.space is SPACES["linear-srgb"]
    assert "taken as linear Rec.709" in photo.assumptions[0]


def test_float_tiff_without_profile_is_linear_by_a_stated_assumption(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", FLOATS, photometric="rgb")
    photo = files.read(tmp_path / "a.tif")
    assert photo.space is SPACES["linear-srgb"]
    assert "linear Rec.709" in photo.assumptions[0]


# --- orientation and metadata -------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_orientation_comes_upright(tmp_path, extension, orientation):
    block = Image.Exif()
    block[0x0112] = orientation
    flat = np.kron(RNG.integers(0, 256, (2, 3, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    options = {"lossless": True} if extension == ".webp" else {}
    Image.fromarray(flat).save(tmp_path / f"a{extension}", exif=block, quality=100, subsampling=0, **options)
    turns = {
        1: flat,
        2: flat[:, ::-1],
        3: flat[::-1, ::-1],
        4: flat[::-1],
        5: flat.transpose(1, 0, 2),
        6: np.rot90(flat, -1),
        7: flat[::-1, ::-1].transpose(1, 0, 2),
        8: np.rot90(flat, 1),
    }
    photo = files.read(tmp_path / f"a{extension}")
    assert photo.pixels.shape == turns[orientation].shape
    assert np.abs(photo.pixels.astype(int) - turns[orientation]).max() <= 3
    files.write(tmp_path / f"b{extension}", photo.pixels, photo)
    again = opened(tmp_path / f"b{extension}")
    assert again.getexif().get(0x0112, 1) == 1
    assert again.size == turns[orientation].shape[1::-1]


@pytest.mark.parametrize("into", [".png", ".jpg", ".tif", ".webp"])
@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp"])
def test_metadata_survives(tmp_path, extension, into):
    photo = files.read(described(tmp_path, extension))
    assert photo.pixels.shape == (30, 20, 3)
    out = files.write(tmp_path / f"out{into}", photo.pixels, photo)
    image = opened(out)
    image.load()
    block = image.getexif()
    assert (block[0x010F], block[0x0110], block.get(0x0112, 1)) == ("Maker", "Model X", 1)
    assert block[0x8298] == "Somebody"
    inner, place = block.get_ifd(0x8769), block.get_ifd(0x8825)
    assert inner[0x829A] == pytest.approx(1 / 125)
    assert (inner[0x8827], inner[0x927C], inner[0xA434]) == (200, b"MAKERNOTE1234", "Lens 50mm")
    assert place[2] == (51.0, 30.0, 26.0)
    xmp = image.info["xmp"]
    assert (xmp.encode() if isinstance(xmp, str) else xmp) == UPRIGHT_XMP
    assert image.info["icc_profile"] == PROFILE
    if into != ".webp" and extension != ".webp":
        assert image.info["dpi"] == pytest.approx((240, 240), abs=0.01)
    if extension in (".jpg", ".tif") and into in (".jpg", ".tif"):
        found = IptcImagePlugin.getiptcinfo(image)
        assert (found[2, 5], found[2, 80], found[2, 120]) == (b"Object name", b"By-line", b"Caption")
    if (extension, into) == (".png", ".png"):
        assert image.info["Author"] == "Me"
    if (extension, into) == (".jpg", ".jpg"):
        assert image.info["comment"] == b"note"
    if (extension, into) == (".tif", ".tif"):
        assert block[315] == "Artist A"


def test_blocks_are_not_doubled(tmp_path):
    photo = files.read(described(tmp_path, ".jpg"))
    for extension, marks in {
        ".jpg": (b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/", b"ICC_PROFILE\0", b"Photoshop 3.0"),
        ".png": (b"eXIf", b"XML:com.adobe.xmp", b"iCCP", b"pHYs"),
        ".webp": (b"VP8X", b"EXIF", b"XMP ", b"ICCP"),
    }.items():
        data = files.write(tmp_path / f"out{extension}", photo.pixels, photo).read_bytes()
        assert [data.count(mark) for mark in marks] == [1] * 4


def test_thumbnail_of_the_old_color_goes(tmp_path):
    # IFD0 with an orientation, then IFD1 with a JPEG thumbnail, laid out by EXIF 4.5.
    thumbnail = b"\xff\xd8THUMBNAIL\xff\xd9"
    ifd0 = struct.pack("<HHHIHHI", 1, 0x0112, 3, 1, 8, 0, 26)
    ifd1 = struct.pack("<HHHIIHHIII", 2, 0x0201, 4, 1, 56, 0x0202, 4, 1, len(thumbnail), 0)
    block = (b"II*\0" + struct.pack("<I", 8) + ifd0 + ifd1).ljust(56, b"\0") + thumbnail
    Image.fromarray(RGB).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + block)
    assert b"THUMBNAIL" in (tmp_path / "a.jpg").read_bytes()
    photo = files.read(tmp_path / "a.jpg")
    assert photo.pixels.shape == (30, 20, 3)
    out = files.write(tmp_path / "b.jpg", photo.pixels, photo)
    assert b"THUMBNAIL" not in out.read_bytes()
    assert opened(out).getexif()[0x0112] == 1


def test_exr_attributes_and_windows_survive(tmp_path):
    pixels = np.ones((3, 4, 3), np.float32)
    spec = OpenImageIO.ImageSpec(4, 3, 3, "half")
    spec.x, spec.y, spec.full_width, spec.full_height = 2, 1, 10, 8
    spec.attribute("owner", "me")
    spec.attribute("myNumber", 7)
    spec.attribute("compression", "piz")
    out = OpenImageIO.ImageOutput.create("a.exr")
    assert out.open(str(tmp_path / "a.exr"), spec)
    assert out.write_image(pixels)
    assert out.close()
    photo = files.read(tmp_path / "a.exr")
    files.write(tmp_path / "b.exr", photo.pixels, photo)
    again = OpenImageIO.ImageBuf(str(tmp_path / "b.exr")).spec()
    assert (again.x, again.y, again.full_width, again.full_height) == (2, 1, 10, 8)
    assert again.get_int_attribute("myNumber") == 7
    assert again.get_string_attribute("compression") == "piz"
    assert str(again.format) == "half"


@pytest.mark.parametrize("compression", ["none", "lzw", "zip", "packbits"])
def test_tiff_keeps_its_compression(tmp_path, compression):
    pil = {"none": "raw", "lzw": "tiff_lzw", "zip": "tiff_adobe_deflate", "packbits": "packbits"}[compression]
    Image.fromarray(RGB).save(tmp_path / "a.tif", compression=pil)
    photo = files.read(tmp_path / "a.tif")
    files.write(tmp_path / "b.tif", photo.pixels, photo)
    assert opened(tmp_path / "b.tif").info["compression"] == pil


# --- conversions --------------------------------------------------------------------------------------------


def test_what_to_make_for_each_kind_of_output(tmp_path):
    eight = files.Photo(tmp_path / "a", RGB, SPACES["srgb"])
    deep = files.Photo(tmp_path / "a", RGB16, SPACES["adobe-rgb"])
    light = files.Photo(tmp_path / "a", FLOATS, SPACES["acescg"], premultiplied=True)
    kinds = (".jpg", ".webp", ".png", ".tif", ".exr")
    names = [[files.output_dtype(f"x{k}", p).name for k in kinds] for p in (eight, deep, light)]
    assert names == [
        ["uint8", "uint8", "uint8", "uint8", "float16"],
        ["uint8", "uint8", "uint16", "uint16", "float32"],
        ["uint8", "uint8", "uint16", "float32", "float32"],
    ]
    assert files.output_space("x.exr", eight) is SPACES["linear-srgb"]
    assert files.output_space("x.exr", deep).curve == transfer.LINEAR
    assert files.output_space("x.png", deep) is SPACES["adobe-rgb"]
    assert files.output_space("x.tif", light) is SPACES["acescg"]
    assert files.output_space("x.png", light).curve == transfer.SRGB
    assert [files.output_premultiplied(f"x{k}", light) for k in kinds] == [False, False, False, True, True]
    assert [files.output_premultiplied(f"x{k}", eight) for k in kinds] == [False, False, False, False, True]


def test_linear_float_to_integer_carries_a_profile_of_its_primaries(tmp_path):
    photo = files.Photo(tmp_path / "a", np.abs(FLOATS), SPACES["acescg"])
    space = files.output_space("x.png", photo)
    codes = transfer.encode(photo.pixels, space.curve, np.uint16)
    files.write(tmp_path / "x.png", codes, photo)
    again = files.read(tmp_path / "x.png")
    np.testing.assert_array_equal(again.pixels, codes)
    assert again.space.to_xyz == pytest.approx(SPACES["acescg"].to_xyz, abs=1e-3)
    assert again.space.curve == transfer.SRGB


def test_16_bit_to_jpeg_is_rounded_to_8(tmp_path):
    photo = files.Photo(tmp_path / "a", np.full((8, 8, 3), 40000, np.uint16), SPACES["srgb"])
    files.write(tmp_path / "x.jpg", photo.pixels, photo, quality=100)
    assert np.abs(np.asarray(opened(tmp_path / "x.jpg")).astype(int) - round(40000 / 257)).max() <= 1


def test_codes_to_exr_become_light(tmp_path):
    photo = files.Photo(tmp_path / "a", RGBA, SPACES["srgb"])
    files.write(tmp_path / "x.exr", RGBA, photo)
    again = files.read(tmp_path / "x.exr").pixels.astype(np.float64)
    alpha = RGBA[..., 3:] / 255
    expected = SPACES["srgb"].curve.decode(RGBA[..., :3] / 255) * alpha
    assert again == pytest.approx(np.concatenate([expected, alpha], axis=2), abs=5e-4)


def test_jpeg_refuses_transparency_but_not_an_opaque_alpha(tmp_path):
    photo = files.Photo(tmp_path / "a", RGBA, SPACES["srgb"])
    with pytest.raises(FileError, match="transparency"):
        files.write(tmp_path / "x.jpg", RGBA, photo)
    opaque = RGBA.copy()
    opaque[..., 3] = 255
    files.write(tmp_path / "x.jpg", opaque, photo)
    assert names_in(tmp_path) == ["x.jpg"]


# --- errors -------------------------------------------------------------------------------------------------


def test_missing_folder_empty_and_foreign_files(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("This is no picture.")
    (tmp_path / "folder.png").mkdir()
    for name, words in {
        "nothing.png": "does not exist",
        "empty.png": "is empty",
        "text.png": "no picture of a known kind",
        "folder.png": "is a folder",
    }.items():
        with pytest.raises(FileError, match=words):
            files.read(tmp_path / name)


@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp", ".exr"])
@pytest.mark.parametrize("part", [0.02, 0.5, 0.97])
def test_truncated_files_are_refused(tmp_path, extension, part):
    noise = RNG.integers(0, 256, (200, 200, 3), dtype=np.uint8)
    files.write(tmp_path / f"a{extension}", noise, files.Photo(tmp_path / "none", noise, SPACES["srgb"]))
    data = (tmp_path / f"a{extension}").read_bytes()
    (tmp_path / f"b{extension}").write_bytes(data[: int(len(data) * part)])
    with pytest.raises(FileError, match="damaged or cut short"):
        files.read(tmp_path / f"b{extension}")


def test_contents_and_not_the_name_decide(tmp_path):
    Image.fromarray(RGB).save(tmp_path / "a.png")
    (tmp_path / "a.png").rename(tmp_path / "a.jpg")
    np.testing.assert_array_equal(files.read(tmp_path / "a.jpg").pixels, RGB)


def test_existing_files_and_the_source_are_safe(tmp_path):
    source = tmp_path / "a.png"
    Image.fromarray(RGB).save(source)
    photo = files.read(source)
    before = source.read_bytes()
    (tmp_path / "link.png").symlink_to(source)
    os.link(source, tmp_path / "hard.png")
    for name in ("a.png", "link.png", "hard.png"):
        for force in (False, True):
            with pytest.raises(FileError, match="the source itself"):
                files.write(tmp_path / name, photo.pixels, photo, force=force)
    Image.fromarray(RGB).save(tmp_path / "b.png")
    with pytest.raises(FileError, match=r"exists already.*--force"):
        files.write(tmp_path / "b.png", photo.pixels, photo)
    files.write(tmp_path / "b.png", 255 - photo.pixels, photo, force=True)
    np.testing.assert_array_equal(np.asarray(opened(tmp_path / "b.png")), 255 - RGB)
    assert source.read_bytes() == before


def test_outputs_that_cannot_be(tmp_path):
    (tmp_path / "dir.png").mkdir()
    for path, words in {
        tmp_path / "a.bmp": "known extension",
        tmp_path / "a.dng": "RAW",
        tmp_path / "no" / "a.png": "does not exist: create it",
        tmp_path / "dir.png": "is a folder",
    }.items():
        with pytest.raises(FileError, match=words):
            files.check_output(path)
    photo = files.Photo(tmp_path / "none", RGB, SPACES["srgb"])
    with pytest.raises(FileError, match="quality"):
        files.write(tmp_path / "a.jpg", RGB, photo, quality=0)
    with pytest.raises(FileError, match="compression 'magic'"):
        files.write(tmp_path / "a.tif", RGB, photo, compression="magic")
    with pytest.raises(FileError, match="too large for a WEBP"):
        files.write(tmp_path / "a.webp", np.zeros((1, 16384, 3), np.uint8), photo)
    assert names_in(tmp_path) == ["dir.png"]


@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp", ".exr"])
def test_when_there_is_no_room_nothing_is_left_and_nothing_changed(tmp_path, extension):
    # A limit on the size of files stands in for a full disk: it needs no rights. It holds for a whole process.
    script = textwrap.dedent(
        """
        import resource, sys
        import numpy as np
        from dyehouse.batch import files
        from dyehouse.core.colorspace import SRGB
        from dyehouse.core.errors import FileError
        noise = np.random.default_rng(0).integers(0, 256, (400, 400, 3), dtype=np.uint8)
        photo = files.Photo(files.Path("none"), noise, SRGB)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
        try:
            files.write(sys.argv[1], noise, photo, force=True)
        except FileError as error:
            print(error)
        """
    )
    target = tmp_path / f"a{extension}"
    target.write_bytes(b"what was here")
    run = subprocess.run([sys.executable, "-c", script, target], capture_output=True, text=True, timeout=60)
    assert "could not be written" in run.stdout, run.stderr
    assert names_in(tmp_path) == [target.name]
    assert target.read_bytes() == b"what was here"
    assert run.returncode == 0


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([".png", ".jpg", ".tif", ".webp"]),
    st.lists(st.tuples(st.integers(0, 1 << 20), st.integers(0, 255)), min_size=1, max_size=8),
)
def test_damaged_files_are_refused_in_words_or_read_and_written_whole(tmp_path_factory, extension, changes):
    folder = tmp_path_factory.mktemp("damage")
    path = described(folder, extension)
    data = bytearray(path.read_bytes())
    for place, value in changes:
        data[place % len(data)] = value
    path.write_bytes(data)
    try:
        photo = files.read(path)
        for into in OUTPUTS:
            out = files.write(folder / f"out{into}", photo.pixels[..., :3], photo)
            assert files.read(out, "srgb").pixels.shape[:2] == photo.pixels.shape[:2]
    except DyehouseError as error:
        assert "\n" not in str(error)  # noqa: PT017


# --- masks and maps -----------------------------------------------------------------------------------------


def test_masks_are_codes_or_alpha(tmp_path):
    grey = RGB[..., 0]
    Image.fromarray(grey).save(tmp_path / "grey.png")
    np.testing.assert_array_equal(files.read_mask(tmp_path / "grey.png", grey.shape), grey)
    Image.fromarray(np.stack([grey] * 3, axis=2)).save(tmp_path / "rgb.png")
    np.testing.assert_array_equal(files.read_mask(tmp_path / "rgb.png", grey.shape), grey)
    cut = np.full((20, 30, 4), 255, np.uint8)
    cut[..., 3] = grey
    Image.fromarray(cut).save(tmp_path / "alpha.png")
    np.testing.assert_array_equal(files.read_mask(tmp_path / "alpha.png", grey.shape), grey)
    tifffile.imwrite(tmp_path / "deep.tif", RGB16[..., 0])
    deep = files.read_mask(tmp_path / "deep.tif", grey.shape)
    assert deep.dtype == np.float32
    assert deep == pytest.approx(RGB16[..., 0] / 65535)


def test_masks_that_do_not_fit(tmp_path):
    Image.fromarray(RGB).save(tmp_path / "color.png")
    with pytest.raises(MaskError, match="colored"):
        files.read_mask(tmp_path / "color.png", (20, 30))
    with pytest.raises(MaskError, match="30 x 20 pixels and the photo 20 x 30"):
        files.read_mask(tmp_path / "color.png", (30, 20, 3))
    block = Image.Exif()
    block[0x0112] = 6
    Image.fromarray(RGB[..., 0]).save(tmp_path / "turned.png", exif=block)
    np.testing.assert_array_equal(files.read_mask(tmp_path / "turned.png", (30, 20)), np.rot90(RGB[..., 0], -1))


def test_maps(tmp_path):
    values = np.linspace(0, 2, 12, dtype=np.float32).reshape(3, 4)
    files.write_map(tmp_path / "m.exr", values)
    np.testing.assert_array_equal(files.read(tmp_path / "m.exr").pixels[..., 0], values)
    files.write_map(tmp_path / "m.png", values, scale=2)
    np.testing.assert_array_equal(np.asarray(opened(tmp_path / "m.png"))[..., 1], np.floor(values * 127.5 + 0.5))
    with pytest.raises(FileError, match="EXR or a PNG"):
        files.write_map(tmp_path / "m.jpg", values)


# --- RAW ----------------------------------------------------------------------------------------------------


def write_dng(path, light, neutral):
    """A DNG of a camera whose sensor sees linear Rec.709, under a light that makes white look `neutral`."""
    camera = np.asarray(light) * np.asarray(neutral)
    cfa = np.empty(camera.shape[:2])
    for (row, column), channel in {(0, 0): 0, (0, 1): 1, (1, 0): 1, (1, 1): 2}.items():
        cfa[row::2, column::2] = camera[row::2, column::2, channel]
    matrix = [v for x in SPACES["srgb"].from_xyz.ravel() for v in (round(x * 10000), 10000)]
    white = [v for x in neutral for v in (round(x * 10000), 10000)]
    tags = [
        (33421, "H", 2, (2, 2)),
        (33422, "B", 4, bytes([0, 1, 1, 2])),
        (50706, "B", 4, bytes([1, 4, 0, 0])),
        (50707, "B", 4, bytes([1, 1, 0, 0])),
        (50708, "s", 0, "Dyehouse test camera"),
        (50721, "2i", 9, matrix),
        (50728, "2I", 3, white),
        (50778, "H", 1, 21),
        (50714, "H", 1, 0),
        (50717, "H", 1, 65535),
        (271, "s", 0, "Dyehouse"),
    ]
    codes = (cfa * 65535 + 0.5).astype(np.uint16)
    tifffile.imwrite(path, codes, photometric=32803, extratags=tags, metadata=None)


@pytest.mark.parametrize("color", [(0.4, 0.4, 0.4), (0.5, 0.2, 0.1), (0.1, 0.3, 0.6)])
def test_raw_is_developed_to_the_light_it_saw(tmp_path, color):
    write_dng(tmp_path / "a.dng", np.full((64, 48, 3), color), (0.5, 1.0, 0.8))
    photo = files.read(tmp_path / "a.dng")
    assert photo.space is SPACES["linear-srgb"]
    assert photo.pixels.dtype == np.uint16
    assert photo.pixels.shape == (64, 48, 3)
    assert photo.pixels[32, 24] / 65535 == pytest.approx(color, abs=2e-4)
    assert photo.white == (1.0, 1.0, 1.0)
    wide = files.read(tmp_path / "a.dng", "linear-rec2020")
    expected = SPACES["rec2020"].from_xyz @ SPACES["srgb"].to_xyz @ color
    assert wide.pixels[32, 24] / 65535 == pytest.approx(expected, abs=3e-4)
    assert files.output_space("a.jpg", photo) is SPACES["srgb"]


def test_raw_keeps_its_camera_and_damaged_raw_is_refused(tmp_path):
    write_dng(tmp_path / "a.dng", np.full((64, 48, 3), 0.3), (0.5, 1.0, 0.8))
    photo = files.read(tmp_path / "a.dng")
    codes = transfer.encode(transfer.decode(photo.pixels, transfer.LINEAR), transfer.SRGB, np.uint8)
    files.write(tmp_path / "a.jpg", codes, photo)
    assert opened(tmp_path / "a.jpg").getexif()[271] == "Dyehouse"
    (tmp_path / "b.cr2").write_bytes(b"no raw file" * 100)
    with pytest.raises(FileError, match="damaged or cut short"):
        files.read(tmp_path / "b.cr2")
    with pytest.raises(FileError, match="linear-rec2020"):
        files.read(tmp_path / "a.dng", "adobe-rgb")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turning_and_back(orientation: int) -> None:
    picture = np.arange(6 * 4).reshape(6, 4)
    upright = files.turned(picture, orientation)
    assert (files.turned(upright, orientation, back=True) == picture).all()
    for y, x in np.ndindex(6, 4):
        there = files.turned_point((x, y), picture.shape, orientation)
        assert upright[there[1], there[0]] == picture[y, x]
        assert files.turned_point(there, upright.shape, orientation, back=True) == (x, y)


@pytest.mark.parametrize("suffix", sorted(files.OUTPUT_KINDS))
@pytest.mark.parametrize("rows", [1, 33, 70, 500])
def test_some_rows_from_the_top(tmp_path, suffix, rows):
    y, x = np.mgrid[:70, :50]
    codes = np.stack([3 * y, 4 * x, (x + y)], axis=-1).astype(np.uint8)
    path = tmp_path / f"picture{suffix}"
    files.write(path, codes, files.Photo(tmp_path, codes, files.SRGB))
    np.testing.assert_array_equal(files.read(path, rows=rows).pixels, files.read(path).pixels[:rows])


def test_some_rows_of_a_turned_photo_are_all_of_it(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.new("RGB", (40, 20), (200, 10, 10)).save(tmp_path / "turned.jpg", exif=exif)
    assert files.read(tmp_path / "turned.jpg", rows=5).pixels.shape == (40, 20, 3)
