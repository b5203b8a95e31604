"""ICC profiles: read as the spaces they are, written so that another engine agrees, refused when not understood."""

import io
import struct

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageCms

from dyehouse.batch import icc
from dyehouse.core import transfer
from dyehouse.core.colorspace import SPACES, RGBSpace
from dyehouse.core.errors import FileError

# Colorants and white of the profile "sRGB IEC61966-2.1" of 1998, as its tags hold them.
HP_COLORANTS = [(0.43607, 0.22249, 0.01392), (0.38515, 0.71687, 0.09708), (0.14307, 0.06061, 0.71410)]
D65_WHITE = (0.95045, 1.0, 1.08905)


def fixed(*values):
    return struct.pack(f">{len(values)}i", *(round(v * 65536) for v in values))


def xyz(*values):
    return b"XYZ " + bytes(4) + fixed(*values)


def curv(*values):
    return b"curv" + bytes(4) + struct.pack(f">I{len(values)}H", len(values), *values)


def para(function, *values):
    return b"para" + bytes(4) + struct.pack(">HH", function, 0) + fixed(*values)


def profile(colorants=HP_COLORANTS, curves=None, white=D65_WHITE, space=b"RGB ", pcs=b"XYZ ", **more):
    """A version 2 display profile, built here by the layout of the standard alone."""
    curves = [curves or curv()] * 3 if not isinstance(curves, list) else curves
    tags = {"wtpt": xyz(*white)}
    tags |= {f"{c}XYZ": xyz(*v) for c, v in zip("rgb", colorants, strict=True)}
    tags |= {f"{c}TRC": v for c, v in zip("rgb", curves, strict=True)}
    tags |= more
    tags = {name: body for name, body in tags.items() if body is not None}
    table, data = b"", b""
    for name, body in tags.items():
        table += struct.pack(">4sII", name.encode(), 132 + 12 * len(tags) + len(data), len(body))
        data += body + bytes(-len(body) % 4)
    size = 132 + len(table) + len(data)
    head = struct.pack(">I4sI4s4s4s12s4s", size, b"", 0x02100000, b"mntr", space, pcs, b"", b"acsp")
    return head.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + data


HP_CURVE = curv(*(round(65535 * float(v)) for v in transfer.SRGB.decode(np.arange(1024) / 1023)))


@pytest.mark.parametrize("name", SPACES)
def test_written_profile_is_read_as_the_same_space(name):
    assert icc.parse(icc.write_profile(SPACES[name])) is SPACES[name]


@pytest.mark.parametrize("name", ["srgb", "display-p3", "adobe-rgb", "prophoto", "rec2020"])
def test_littlecms_turns_a_written_profile_into_the_same_srgb(name):
    space = SPACES[name]
    codes = np.random.default_rng(3).integers(60, 200, (16, 16, 3), dtype=np.uint8)
    linear = space.curve.decode(codes / 255) @ (space.to_xyz).T
    adapted = linear @ icc.bradford(space.white, SPACES["srgb"].white).T
    expected = SPACES["srgb"].curve.encode(adapted @ SPACES["srgb"].from_xyz.T) * 255
    inside = ((expected > 0) & (expected < 255)).all(axis=2)
    engine = ImageCms.profileToProfile(
        Image.fromarray(codes),
        ImageCms.ImageCmsProfile(io.BytesIO(icc.write_profile(space))),
        ImageCms.createProfile("sRGB"),
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
    )
    assert inside.sum() > 100
    assert np.abs(np.asarray(engine)[inside] - expected[inside]).max() < 1.6


def test_littlecms_own_srgb_profile_is_srgb():
    assert icc.parse(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()) is SPACES["srgb"]


def test_classic_srgb_profile_with_1024_samples_is_srgb():
    assert icc.parse(profile(curves=HP_CURVE)) is SPACES["srgb"]


def test_srgb_with_a_d50_white_and_no_chad_is_still_srgb():
    assert icc.parse(profile(curves=HP_CURVE, white=icc.PCS_WHITE)) is SPACES["srgb"]


@pytest.mark.parametrize("gamma", [1.8, 2.2, 2.4])
def test_plain_power_on_srgb_primaries_is_not_srgb(gamma):
    space = icc.parse(profile(curves=curv(round(gamma * 256))))
    assert space is not SPACES["srgb"]
    assert space.curve.decode(0.5) == pytest.approx(0.5**gamma, abs=2e-3)
    assert space.white == pytest.approx(D65_WHITE, abs=1e-3)
    assert space.to_xyz == pytest.approx(SPACES["srgb"].to_xyz, abs=2e-3)


def test_adobe_rgb_as_its_profile_of_1998_holds_it():
    colorants = [(0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457)]
    assert icc.parse(profile(colorants, curv(563))) is SPACES["adobe-rgb"]


@pytest.mark.parametrize(
    ("curve", "function"),
    [
        (curv(), lambda x: x),
        (curv(512), lambda x: x**2),
        (curv(0, 65535), lambda x: x),
        (curv(0, 16384, 65535), lambda x: np.interp(x, [0, 0.5, 1], [0, 0.25, 1])),
        (para(0, 2.0), lambda x: x**2),
        (para(1, 2.0, 0.9, 0.1), lambda x: (0.9 * x + 0.1) ** 2),
        (para(2, 2.0, 1.0, 0.0, 0.0), lambda x: x**2),
        (para(2, 2.0, 0.8, 0.1, 0.05), lambda x: (0.8 * x + 0.1) ** 2 + 0.05),
        (
            para(3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045),
            lambda x: np.where(x < 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4),
        ),
        (para(4, 2.0, 0.9, 0.1, 0.2, 0.0, 0.0, 0.0), lambda x: (0.9 * x + 0.1) ** 2),
    ],
)
def test_every_kind_of_curve(curve, function):
    x = np.linspace(0, 1, 101)
    assert icc.parse(profile(curves=curve)).curve.decode(x) == pytest.approx(function(x), abs=2e-4)


def test_white_of_an_unnamed_space_comes_from_chad():
    space = RGBSpace("Odd", SPACES["srgb"].to_xyz, transfer.ParametricCurve(1.9))
    back = icc.parse(icc.write_profile(space))
    assert back.name == "Odd"
    assert back.to_xyz == pytest.approx(space.to_xyz, abs=1e-4)
    assert back.curve.decode(0.3) == pytest.approx(0.3**1.9, abs=1e-4)


def test_sampled_curve_survives_writing():
    samples = tuple(np.linspace(0, 1, 64) ** 1.7)
    space = RGBSpace("Sampled", SPACES["adobe-rgb"].to_xyz, transfer.SampledCurve(samples))
    assert icc.parse(icc.write_profile(space)).curve.decode(0.4) == pytest.approx(0.4**1.7, abs=2e-3)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "damaged"),
        (b"no profile" * 30, "damaged"),
        (profile()[:300], "cut short"),
        (profile(space=b"CMYK"), "'CMYK'"),
        (profile(space=b"GRAY"), "'GRAY'"),
        (profile(rXYZ=None, A2B0=b"mft2" + bytes(40)), "lookup tables"),
        (profile(rTRC=None), "something else"),
        (profile(pcs=b"Lab "), "XYZ"),
        (profile(curves=[curv(512), curv(460), curv(512)]), "different curve"),
        (profile([(0.5, 0.5, 0.5)] * 3), "add up"),
        (profile([tuple(icc.PCS_WHITE / 3)] * 3), "not three colors"),
        (profile(curves=curv(65535, 0)), "inverted"),
        (profile(curves=para(0, -1.0)), "inverted"),
        (profile(curves=curv(486), chad=b"sf32" + bytes(40)), "adaptation"),
        (profile(curves=curv(486), white=(0, 0, 0)), "white"),
    ],
)
def test_what_cannot_be_understood_is_refused_with_a_remedy(data, words):
    with pytest.raises(FileError, match=words) as caught:
        icc.parse(data)
    assert "--color-space" in str(caught.value)
    assert str(caught.value).count(".") <= 2


GOOD = icc.write_profile(SPACES["display-p3"].with_curve(transfer.ParametricCurve(2.1)))


@settings(max_examples=400, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), min_size=1, max_size=12),
    st.integers(0, len(GOOD)),
)
@example([(0, 0)], len(GOOD))
def test_damage_is_refused_or_gives_a_sound_space(changes, length):
    data = bytearray(GOOD)
    for place, value in changes:
        data[place] = value
    try:
        space = icc.parse(bytes(data[:length]))
    except FileError:
        return
    assert np.isfinite(space.to_xyz).all()
    assert np.isfinite(space.from_xyz).all()
    assert np.isfinite(space.curve.decode(np.linspace(0, 1, 9))).all()
    assert space.white[1] == pytest.approx(1)
    icc.description(bytes(data))
