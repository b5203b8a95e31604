"""Transfer curves against colour-science, and every code there and back."""

import colour
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import transfer as t

CURVES = {
    "linear": t.LINEAR,
    "srgb": t.SRGB,
    "adobe-rgb": t.ADOBE_RGB,
    "rec2020": t.REC_2020,
    "prophoto": t.PROPHOTO,
    "gamma 2.2": t.ParametricCurve(2.2),
    "sampled": t.SampledCurve(tuple(np.linspace(0, 1, 1024) ** 2.1)),
}
every_curve = pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
integers = pytest.mark.parametrize("dtype", [np.uint8, np.uint16])

# Our curves are those of the standards' texts; colour-science's names for them.
THEIRS = {
    "srgb": ("sRGB", {}),
    "adobe-rgb": ("Adobe RGB (1998)", {}),
    "rec2020": ("ITU-R BT.2020", {"is_12_bits_system": True}),
    "prophoto": ("ROMM RGB", {"bit_depth": 16}),
}


@pytest.mark.parametrize("name", THEIRS)
def test_curves_agree_with_colour_science(name):
    theirs, options = THEIRS[name]
    light, codes = np.linspace(0, 1, 20001), np.linspace(0, 1, 20001)
    if name == "adobe-rgb":
        encoded, decoded = (
            colour.models.RGB_COLOURSPACE_ADOBE_RGB1998.cctf_encoding(light),
            colour.models.RGB_COLOURSPACE_ADOBE_RGB1998.cctf_decoding(codes),
        )
        tolerance = 1e-6
    elif name == "rec2020":
        # The 12-bit constants of table 4 are 1.0993 and 0.0181; ours are the exact ones to which they are rounded,
        # and on a scale of 4095 the two agree to a fifth of a code.
        encoded = colour.models.oetf_BT2020(light, **options)
        decoded = colour.models.oetf_inverse_BT2020(codes, **options)
        tolerance = 5e-5
    else:
        encoded = colour.cctf_encoding(light, function=theirs, **options)
        decoded = colour.cctf_decoding(codes, function=theirs, **options)
        tolerance = 1e-6
    np.testing.assert_allclose(CURVES[name].encode(light), encoded, atol=tolerance)
    np.testing.assert_allclose(CURVES[name].decode(codes), decoded, atol=tolerance)


def test_rec2020_against_its_own_formula_with_exact_constants():
    # ITU-R BT.2020-2, table 4, with alpha and beta from the two conditions stated there: the pieces meet in value
    # and in slope.
    alpha, beta = 1.09929682680944, 0.018053968510807
    assert 4.5 * beta == pytest.approx(alpha * beta**0.45 - (alpha - 1), abs=1e-12)
    assert 0.45 * alpha * beta**-0.55 == pytest.approx(4.5, abs=1e-9)
    light = np.linspace(0, 1, 5001)
    printed = np.where(light < beta, 4.5 * light, alpha * light**0.45 - (alpha - 1))
    np.testing.assert_allclose(t.REC_2020.encode(light), printed, atol=1e-9)
    np.testing.assert_allclose(t.REC_2020.decode(printed), light, atol=1e-9)


def test_known_values():
    assert t.SRGB.decode(0.5) == pytest.approx(0.21404114, abs=1e-8)  # IEC 61966-2-1
    assert t.SRGB.decode(10 / 255) == pytest.approx(10 / 255 / 12.92)
    assert t.ADOBE_RGB.decode(0.5) == pytest.approx(0.5**2.19921875)
    assert t.PROPHOTO.decode(0.5) == pytest.approx(0.5**1.8)
    assert t.PROPHOTO.decode(1 / 64) == pytest.approx(1 / 1024)


@every_curve
def test_curve_and_inverse_outside_zero_to_one_too(curve):
    light = np.concatenate([np.linspace(-0.5, 1, 3001), [1e-7, 1e-4, -1e-4]])
    np.testing.assert_allclose(curve.decode(curve.encode(light)), light, atol=2e-6)
    assert curve.decode(0.0) == 0
    assert curve.encode(0.0) == 0
    assert curve.decode(1.0) == pytest.approx(1, abs=1e-9)
    if not isinstance(curve, t.SampledCurve):
        np.testing.assert_allclose(curve.decode(curve.encode([1.5, 4, 100])), [1.5, 4, 100], rtol=1e-9)
        assert curve.decode(1.2) > 1.1


@every_curve
@settings(deadline=None, max_examples=60)
@given(x=st.floats(-3, 3))
def test_odd_symmetry(curve, x):
    assert float(curve.decode(-x)) == -float(curve.decode(x))
    assert float(curve.encode(-x)) == -float(curve.encode(x))


@every_curve
def test_curves_rise(curve):
    steps = np.diff(curve.decode(np.linspace(-1, 1, 4001)))
    assert (steps > 0).all()


@every_curve
@integers
def test_every_code_comes_back(curve, dtype):
    codes = np.arange(np.iinfo(dtype).max + 1).astype(dtype)
    light = t.decode(codes, curve)
    assert light.dtype == np.float32
    np.testing.assert_allclose(light, curve.decode(codes / np.iinfo(dtype).max), rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(t.encode(light, curve, dtype), codes)


@every_curve
@integers
def test_every_code_comes_back_through_encoder_and_decoder(curve, dtype):
    count = np.iinfo(dtype).max + 1
    codes = np.arange(3 * count).reshape(-1, 3).astype(dtype)  # wraps round: every code, in every channel
    scratch, out = np.empty(codes.shape, np.float32), np.empty((count // 256, 256, 3), dtype)
    light = t.Decoder(curve, dtype).into(codes, scratch)
    np.testing.assert_array_equal(light, t.decode(codes, curve))
    t.Encoder(curve, dtype).into(light, out)
    np.testing.assert_array_equal(out.reshape(-1, 3), codes)


def test_decoder_on_odd_sizes_and_unaligned_codes():
    store = np.arange(3 * 22 + 1, dtype=np.uint8)
    for codes in (store[:63].reshape(-1, 3), store[1:67].reshape(-1, 3), store[:66].reshape(-1, 3)[::2]):
        out = np.empty(codes.shape, np.float32)
        got = t.Decoder(t.SRGB, np.uint8).into(codes, out)
        np.testing.assert_allclose(got, t.SRGB.decode(codes / 255), atol=1e-7)


@every_curve
@integers
def test_encoding_is_within_the_bound_it_claims(curve, dtype):
    top = np.iinfo(dtype).max
    rng = np.random.default_rng(0)
    light = np.concatenate([np.linspace(0, 1, 100_001), rng.random(200_000) ** 4, 10 ** rng.uniform(-7, 0, 100_000)])
    light = light[: len(light) // 3 * 3].astype(np.float32)
    exact = curve.encode(light.astype(np.float64)) * top
    claimed = 0.9 if isinstance(curve, t.SampledCurve) else 0.8
    assert np.abs(t.encode(light, curve, dtype) - exact).max() <= claimed
    out = np.empty((1, len(light) // 3, 3), dtype)
    t.Encoder(curve, dtype).into(light.copy().reshape(-1, 3), out)
    np.testing.assert_array_equal(out.ravel(), t.encode(light, curve, dtype))


@every_curve
@integers
def test_encoding_rises(curve, dtype):
    codes = t.encode(np.linspace(-0.1, 1.1, 300_001, dtype=np.float32), curve, dtype).astype(int)
    assert (np.diff(codes) >= 0).all()
    assert codes[0] == 0
    assert codes[-1] == np.iinfo(dtype).max


@every_curve
@integers
def test_light_out_of_range_is_clipped_and_never_wraps(curve, dtype):
    light = np.array([-1e30, -1, -1e-9, 1 + 1e-6, 2, 1e9, 1e30, -np.inf, np.inf, np.nan], np.float32)
    top = np.iinfo(dtype).max
    with np.errstate(all="raise"):
        codes = t.encode(light, curve, dtype)
    np.testing.assert_array_equal(codes, [0, 0, 0, top, top, top, top, 0, top, 0])


@every_curve
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_float_codes_are_not_clamped(curve, dtype):
    light = np.array([[-0.25, 0.0, 0.18], [0.5, 1.0, 0.75]], np.float32)
    codes = t.encode(light, curve, dtype)
    assert codes.dtype == dtype
    assert codes.min() < 0
    back = t.decode(codes, curve)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, light, atol=3e-3 if dtype == np.float16 else 1e-5)
    if not isinstance(curve, t.SampledCurve):
        assert t.encode(np.array([4.0], np.float32), curve, dtype)[0] > 1


def test_input_is_not_modified_by_decode_and_encode():
    light = np.linspace(-0.1, 1.2, 30, dtype=np.float32).reshape(-1, 3)
    before = light.copy()
    for dtype in (np.uint8, np.uint16, np.float32):
        codes = t.encode(light, t.SRGB, dtype)
        np.testing.assert_array_equal(light, before)
        kept = codes.copy()
        t.decode(codes, t.SRGB)
        np.testing.assert_array_equal(codes, kept)


def test_tables_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        t.decode_table(t.SRGB, np.uint8)[0] = 1


def test_sampled_curve_with_flat_parts():
    curve = t.SampledCurve((0.0, 0.0, 0.5, 0.5, 1.0))
    assert curve.decode(0.25) == 0
    np.testing.assert_allclose(curve.decode([0.375, 0.875]), [0.25, 0.75])
    np.testing.assert_allclose(curve.decode(curve.encode([0, 0.25, 0.5, 0.75, 1])), [0, 0.25, 0.5, 0.75, 1])
