"""CMYK by the tables of a profile, against LittleCMS through Pillow."""

import io
import struct

import numpy as np
import pytest
from PIL import Image, ImageCms

from dyehouse.core import swatch_files
from dyehouse.core.errors import FileError
from dyehouse.core.swatch_files.printer import inks_as, profile_inks

GRID = 9


def lab_of(inks):
    """A made-up press: smooth, with inks that darken and turn."""
    c, m, y, k = np.moveaxis(np.asarray(inks, float), -1, 0)
    light = (1 - 0.35 * c) * (1 - 0.45 * m) * (1 - 0.1 * y) * (1 - 0.9 * k)
    return np.stack(
        [100 * light, (70 * m - 35 * c - 5 * y) * light**0.5, (80 * y - 45 * c - 5 * m) * light**0.5], axis=-1
    )


def profile(bits, space=b"CMYK", pcs=b"Lab ", kind=None, tag=b"A2B1"):
    """A version 2 output profile with curves of squares and roots, which cancel."""
    steps = np.linspace(0, 1, GRID)
    nodes = np.stack(np.meshgrid(steps, steps, steps, steps, indexing="ij"), axis=-1)
    lab = lab_of(nodes)
    top = 65280 if bits == 16 else 255
    codes = np.stack([lab[..., 0] / 100 * top, *((lab[..., i] + 128) / 255 * top for i in (1, 2))], axis=-1)
    full = 65535 if bits == 16 else 255
    curve = np.rint(np.linspace(0, 1, 256) * full)
    dtype = ">u2" if bits == 16 else "u1"
    table = (kind or (b"mft2" if bits == 16 else b"mft1")) + bytes(4) + bytes([4, 3, GRID, 0])
    table += struct.pack(">9i", *(65536 if i % 4 == 0 else 0 for i in range(9)))
    table += struct.pack(">2H", 256, 256) if bits == 16 else b""
    table += np.tile(curve, 4).astype(dtype).tobytes() + np.rint(codes).astype(dtype).tobytes()
    table += np.tile(curve, 3).astype(dtype).tobytes()
    table += bytes(-len(table) % 4)
    text = b"test\0"
    tags = {
        b"desc": b"desc" + bytes(4) + struct.pack(">I", len(text)) + text + bytes(78),
        b"cprt": b"text" + bytes(4) + text,
        b"wtpt": b"XYZ " + bytes(4) + struct.pack(">3i", 63190, 65536, 54061),
        tag: table,
    }
    start, entries, bodies = 132 + 12 * len(tags), b"", b""
    for name, body in tags.items():
        entries += struct.pack(">4sII", name, start + len(bodies), len(body))
        bodies += body + bytes(-len(body) % 4)
    head = struct.pack(">I4sI4s4s4s", start + len(bodies), b"", 0x02400000, b"prtr", space, pcs)
    head += struct.pack(">6H4s", 2026, 1, 1, 0, 0, 0, b"acsp") + bytes(24) + struct.pack(">I", 1)
    head += struct.pack(">3i", 63190, 65536, 54061)
    return head + bytes(128 - len(head)) + struct.pack(">I", len(tags)) + entries + bodies


def by_littlecms(data, inks):
    source = ImageCms.ImageCmsProfile(io.BytesIO(data))
    transform = ImageCms.buildTransform(
        source, ImageCms.createProfile("LAB"), "CMYK", "LAB", ImageCms.Intent.RELATIVE_COLORIMETRIC
    )
    picture = Image.fromarray(np.rint(inks * 255).astype(np.uint8)[None], "CMYK")
    lab = np.asarray(ImageCms.applyTransform(picture, transform))[0].astype(float)
    return np.stack([lab[:, 0] / 2.55, *((lab[:, i] + 128) % 256 - 128 for i in (1, 2))], axis=-1)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.filterwarnings("ignore:.*mode.*:DeprecationWarning")
def test_as_littlecms_has_it(bits):
    inks = np.random.default_rng(0).integers(0, 256, (300, 4)) / 255
    data = profile(bits)
    ours = profile_inks(data)(inks)
    # Theirs is rounded to whole numbers, and interpolates between tetrahedra.
    assert np.abs(ours - by_littlecms(data, inks)).max() < 1.2
    assert np.abs(ours - lab_of(inks)).max() < (1.5 if bits == 8 else 1.0)


def test_exact_at_the_nodes():
    steps = np.linspace(0, 1, GRID)
    inks = np.random.default_rng(1).choice(steps, (50, 4))
    np.testing.assert_allclose(profile_inks(profile(16))(inks), lab_of(inks), atol=0.01)


def test_a_swatch_file_with_its_printer(tmp_path):
    (tmp_path / "press.icc").write_bytes(profile(16))
    data = b"\0\1\0\1" + b"\0\2" + struct.pack(">4H", 0, 32767, 65535, 65535)
    (swatch,) = swatch_files.parse(data, ".aco", "x", inks_as(tmp_path / "press.icc")).swatches
    np.testing.assert_allclose(swatch.to_lab(), lab_of([1, 0.5, 0, 0]), atol=0.5)
    assert inks_as("plain") == "plain"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "not one from CMYK to Lab"),
        (profile(16, space=b"RGB "), "not one from CMYK"),
        (profile(16, pcs=b"XYZ "), "not one from CMYK"),
        (profile(16, kind=b"mAB "), "no table of 8 or 16 bits"),
        (profile(16, tag=b"B2A1"), "no table of 8 or 16 bits"),
        (profile(16)[:5000], "is damaged"),
    ],
)
def test_other_profiles(data, said):
    with pytest.raises(FileError, match=said):
        profile_inks(data)


def test_no_profile(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        inks_as(tmp_path / "none.icc")
