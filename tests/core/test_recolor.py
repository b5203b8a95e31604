"""The one path from pixels to recolored pixels: regions, bands, threads, codes, gamut shares."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import Picture, analyze, transfer
from dyehouse.core.errors import ImageError
from dyehouse.core.picture import BAND_PIXELS
from dyehouse.core.recolor import Recoloring, RegionMatrix, recolor

RNG = np.random.default_rng(7)
M1 = np.array([[0.2, 0.5, 0.1], [0.3, 0.1, 0.2], [0.6, 0.1, 0.3]])
M2 = np.array([[0.7, 0.0, 0.2], [0.1, 0.2, 0.3], [0.0, 0.5, 0.1]])
CURVES = [transfer.SRGB, transfer.ADOBE_RGB, transfer.REC_2020, transfer.PROPHOTO, transfer.LINEAR]


def blob(height, width, y, x, radius, soft=3.0):
    rows, columns = np.mgrid[:height, :width]
    return np.clip((radius - np.hypot(rows - y, columns - x)) / soft + 0.5, 0, 1)


# --- what it computes -----------------------------------------------------------------------------------------


def test_whole_picture_is_one_matrix_product():
    image = RNG.random((37, 53, 3), dtype=np.float32)
    result, shares = recolor(Picture(image), [RegionMatrix(M1)])
    np.testing.assert_allclose(result, np.einsum("ij,yxj->yxi", M1, image.astype(float)), atol=1e-6)
    assert (result.dtype, result.shape) == (np.float32, (37, 53, 3))
    assert shares.pixels == 37 * 53


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 30), st.integers(1, 30), st.integers(0, 99))
def test_mask_blends_by_coverage(height, width, seed):
    rng = np.random.default_rng(seed)
    image = rng.random((height, width, 3), dtype=np.float32)
    mask = np.clip(rng.random((height, width)) * 3 - 1, 0, 1)
    result, shares = recolor(Picture(image), [RegionMatrix(M1, mask)])
    expected = (1 - mask[..., None]) * image + mask[..., None] * (image @ M1.T)
    np.testing.assert_allclose(result, expected, atol=1e-5)
    np.testing.assert_array_equal(result[mask == 0], image[mask == 0])
    assert shares.pixels == np.count_nonzero(mask)


def test_two_adjacent_soft_regions_in_one_pass():
    # Masks that sum to 1 along their common border: each gives its share, and nothing of the old color is left.
    image = RNG.random((40, 60, 3), dtype=np.float32)
    ramp = np.broadcast_to(np.clip((np.arange(60) - 27) / 6, 0, 1), (40, 60))
    result, shares = recolor(Picture(image), [RegionMatrix(M1, 1 - ramp), RegionMatrix(M2, ramp)])
    expected = (1 - ramp[..., None]) * (image @ M1.T) + ramp[..., None] * (image @ M2.T)
    np.testing.assert_allclose(result, expected, atol=1e-5)
    assert shares.pixels == 40 * 60


def test_a_later_region_lies_over_an_earlier_one():
    image = RNG.random((40, 60, 3), dtype=np.float32)
    low, high = blob(40, 60, 20, 25, 15), blob(40, 60, 20, 38, 12)
    result, _ = recolor(Picture(image), [RegionMatrix(M1, low), RegionMatrix(M2, high)])
    np.testing.assert_allclose(result[high == 1], (image @ M2.T)[high == 1], atol=1e-5)
    # Where the upper one covers in part, the lower one gets what is left, as far as it asks.
    seen = np.minimum(low, 1 - high)[..., None]
    expected = image + high[..., None] * (image @ M2.T - image) + seen * (image @ M1.T - image)
    np.testing.assert_allclose(result, expected, atol=1e-5)
    # The whole picture below a region.
    both, _ = recolor(Picture(image), [RegionMatrix(M1), RegionMatrix(M2, high)])
    expected = (1 - high[..., None]) * (image @ M1.T) + high[..., None] * (image @ M2.T)
    np.testing.assert_allclose(both, expected, atol=1e-5)
    over, _ = recolor(Picture(image), [RegionMatrix(M2, high), RegionMatrix(M1)])
    np.testing.assert_allclose(over, image @ M1.T, atol=1e-5)


def test_regions_far_apart_are_independent():
    image = RNG.random((60, 200, 3), dtype=np.float32)
    a, b = blob(60, 200, 30, 30, 20), blob(60, 200, 30, 160, 20)
    both, _ = recolor(Picture(image), [RegionMatrix(M1, a), RegionMatrix(M2, b)])
    first, _ = recolor(Picture(image), [RegionMatrix(M1, a)])
    second, _ = recolor(Picture(image), [RegionMatrix(M2, b)])
    np.testing.assert_allclose(both[:, :90], first[:, :90], atol=1e-6)
    np.testing.assert_allclose(both[:, 90:], second[:, 90:], atol=1e-6)


def test_no_region_and_an_empty_one_leave_the_picture():
    image = RNG.random((20, 30, 3), dtype=np.float32)
    for regions in ([], [RegionMatrix(M1, np.zeros((20, 30)))]):
        result, shares = recolor(Picture(image), regions)
        np.testing.assert_array_equal(result, image)
        assert shares.pixels == 0
        assert shares.out_of_gamut == 0


# --- corrections ----------------------------------------------------------------------------------------------

WIDE = np.hstack([M1, [[0.5, -0.2], [0.1, 0.4], [0.0, 0.3]]])


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("threads", [1, 3])
def test_corrections_are_further_channels_of_the_pixel(dtype, masked, threads):
    height, width = 9 * BAND_PIXELS // 401 + 5, 401  # some bands, and odd
    image = RNG.random((height, width, 3), dtype=np.float32)
    extra = RNG.normal(0, 0.1, (height, width, 2)).astype(dtype)
    extra[: height // 2] = 0  # bands without any
    mask = blob(height, width, 300, 200, 150, soft=20) if masked else np.ones((height, width))
    region = RegionMatrix(WIDE, mask if masked else None, extra=extra)
    result, shares = recolor(Picture(image), [region], threads=threads)
    whole = np.concatenate([image, extra], axis=2).astype(float) @ WIDE.T
    np.testing.assert_allclose(result, image + mask[..., None] * (whole - image), atol=1e-5)
    assert shares.pixels == np.count_nonzero(mask)


def test_corrections_of_zero_change_no_bit():
    image = RNG.random((60, 70, 3), dtype=np.float32)
    none = np.zeros((60, 70, 2), np.float32)
    for mask in (None, blob(60, 70, 30, 35, 20)):
        plain, _ = recolor(Picture(image), [RegionMatrix(M1, mask)])
        result, _ = recolor(Picture(image), [RegionMatrix(WIDE, mask, extra=none)])
        np.testing.assert_array_equal(result, plain)


def test_corrections_of_overlapping_regions():
    image, extra = RNG.random((40, 60, 3), dtype=np.float32), RNG.random((40, 60, 2), dtype=np.float32)
    low, high = blob(40, 60, 20, 25, 15), blob(40, 60, 20, 38, 12)
    result, _ = recolor(Picture(image), [RegionMatrix(WIDE, low, extra=extra), RegionMatrix(M2, high)])
    seen = np.minimum(low, 1 - high)[..., None]
    corrected = np.concatenate([image, extra], axis=2) @ WIDE.T
    expected = image + high[..., None] * (image @ M2.T - image) + seen * (corrected - image)
    np.testing.assert_allclose(result, expected, atol=1e-5)


def test_corrections_count_by_coverage_where_the_edge_is_unmixed(product):
    scene = product()
    scene.mask = blob(96, 96, 48, 48, 40, soft=6)
    plain = analyze(scene.image, reference=scene.body, mask=scene.mask).region((0.05, 0.3, 0.2))
    extra = RNG.random((96, 96, 1), dtype=np.float32)
    column = np.array([[0.2], [0.1], [-0.1]])
    assert plain.edge is not None
    corrected = RegionMatrix(np.hstack([plain.matrix, column]), plain.mask, plain.edge, extra)
    added = recolor(Picture(scene.image), [corrected])[0] - recolor(Picture(scene.image), [plain])[0]
    np.testing.assert_allclose(added, scene.mask[..., None] * extra * column[:, 0], atol=1e-6)


def test_corrections_reach_codes_and_their_gamut():
    image = np.full((40, 40, 3), 0.3, np.float32)
    codes = transfer.encode(image, transfer.SRGB, np.uint8)
    extra = np.zeros((40, 40, 1), np.float32)
    extra[:10] = 1.0
    region = RegionMatrix(np.hstack([np.eye(3), [[0.2], [0.8], [0.0]]]), extra=extra)
    result, shares = recolor(Picture(codes, transfer.SRGB), [region], curve=transfer.SRGB, dtype=np.uint8)
    assert shares.out_of_gamut == pytest.approx(0.25)
    np.testing.assert_array_equal(result[10:], codes[10:])
    assert (result[:10, :, 1] > codes[:10, :, 1]).all()


# --- bands and threads ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("masked", [False, True])
def test_threads_give_the_same_bits(dtype, masked):
    height, width = 9 * BAND_PIXELS // 401 + 5, 401  # some bands, and odd
    image = RNG.random((height, width, 3), dtype=np.float32)
    curve = None if dtype == np.float32 else transfer.SRGB
    pixels = image if curve is None else transfer.encode(image, curve, dtype)
    regions = [RegionMatrix(M1), RegionMatrix(M2, blob(height, width, 300, 200, 150))]
    picture = Picture(pixels, curve)
    if masked:
        regions = regions[1:]
    one, count = recolor(picture, regions, curve=curve, dtype=dtype, threads=1)
    for threads in (2, 3, 7, None):
        many, shares = recolor(picture, regions, curve=curve, dtype=dtype, threads=threads)
        np.testing.assert_array_equal(many, one)
        assert shares == count
    # And in one piece: the upper half alone.
    half = height // 2
    upper = Picture(pixels[:half], curve)
    cut = [RegionMatrix(r.matrix, None if r.mask is None else r.mask[:half]) for r in regions]
    np.testing.assert_array_equal(recolor(upper, cut, curve=curve, dtype=dtype)[0], one[:half])


def test_soft_edges_across_band_borders(product):
    # The same product once and many times below each other: edges must land in their own rows.
    scene = product(size=160)
    scene.mask = blob(160, 160, 80, 80, 68, soft=6)
    times = 9 * BAND_PIXELS // 160**2 + 1
    tall = np.tile(scene.image, (times, 1, 1))
    target = (0.05, 0.3, 0.2)
    one = analyze(scene.image, reference=scene.body, mask=scene.mask).recolor(target)
    many = analyze(tall, reference=scene.body, mask=np.tile(scene.mask, (times, 1))).recolor(target)
    for k in range(times):
        np.testing.assert_allclose(many[160 * k : 160 * (k + 1)], one, atol=1e-6)


# --- codes ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("masked", [False, True])
def test_identity_returns_every_code(curve, dtype, masked):
    top = np.iinfo(dtype).max
    grey = np.arange(top + 1).astype(dtype).reshape(-1, 256)
    pixels = np.stack([grey, grey[::-1], RNG.permuted(grey)], axis=2)
    mask = np.clip(RNG.random(grey.shape) * 2 - 0.5, 0, 1) if masked else None
    result, shares = recolor(Picture(pixels, curve), [RegionMatrix(np.eye(3), mask)], curve=curve, dtype=dtype)
    np.testing.assert_array_equal(result, pixels)
    assert result.dtype == dtype
    assert shares.out_of_gamut == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32])
def test_pixels_outside_the_region_keep_their_bits(dtype):
    curve = transfer.SRGB
    values = (
        RNG.random((90, 120, 3)) if np.dtype(dtype).kind == "f" else RNG.integers(0, np.iinfo(dtype).max, (90, 120, 3))
    )
    pixels = values.astype(dtype)
    if dtype == np.float32:
        pixels[0, 0] = [-0.5, 7.25, 1e-30]
    mask = blob(90, 120, 40, 60, 20)
    result, _ = recolor(Picture(pixels, curve), [RegionMatrix(M1, mask)], curve=curve, dtype=dtype)
    np.testing.assert_array_equal(result[mask == 0], pixels[mask == 0])
    assert (result[mask == 1] != pixels[mask == 1]).mean() > 0.9


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("curve", CURVES)
def test_codes_are_the_encoded_result_in_linear_light(dtype, curve):
    top = np.iinfo(dtype).max
    pixels = RNG.integers(0, top, (50, 60, 3), endpoint=True).astype(dtype)
    matrix = M1 / M1.sum(axis=1, keepdims=True)  # stays inside 0..1
    result, _ = recolor(Picture(pixels, curve), [RegionMatrix(matrix)], curve=curve, dtype=dtype)
    exact = curve.encode(curve.decode(pixels / top) @ matrix.T) * top
    assert np.abs(result - exact).max() < 0.85
    assert np.abs(result - exact).mean() < 0.3


def test_other_dtype_and_curve_out_than_in():
    codes = RNG.integers(0, 256, (20, 30, 3)).astype(np.uint8)
    mask = blob(20, 30, 10, 15, 7)
    linear = transfer.SRGB.decode(codes / 255)
    expected = linear + mask[..., None] * (linear @ M1.T - linear)
    picture = Picture(codes, transfer.SRGB)
    floats, _ = recolor(picture, [RegionMatrix(M1, mask)])
    np.testing.assert_allclose(floats, expected, atol=1e-6)
    halves, _ = recolor(picture, [RegionMatrix(M1, mask)], dtype=np.float16)
    np.testing.assert_allclose(halves, expected, atol=5e-4)
    deep, _ = recolor(picture, [RegionMatrix(M1, mask)], curve=transfer.ADOBE_RGB, dtype=np.uint16)
    np.testing.assert_allclose(deep / 65535, transfer.ADOBE_RGB.encode(np.clip(expected, 0, 1)), atol=3e-5)


@pytest.mark.parametrize("layout", ["fortran", "strided", "reversed", "alpha"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_codes_of_any_layout_and_unchanged_input(layout, dtype):
    pixels = (RNG.random((41, 33, 3)) * (1 if dtype == np.float32 else np.iinfo(dtype).max)).astype(dtype)
    store = np.zeros((82, 66, 4), dtype)
    store[::2, ::2, :3] = pixels
    view = {
        "fortran": np.asfortranarray(pixels),
        "strided": store[::2, ::2, :3],
        "reversed": np.ascontiguousarray(pixels[::-1, ::-1, ::-1])[::-1, ::-1, ::-1],
        "alpha": np.ascontiguousarray(store[::2, ::2]),
    }[layout]
    before, kept_mask = view.copy(), (mask := blob(41, 33, 20, 16, 12)).copy()
    curve = None if dtype == np.float32 else transfer.SRGB
    for regions in ([RegionMatrix(M1)], [RegionMatrix(M1, mask), RegionMatrix(M2, mask[::-1])]):
        plain, _ = recolor(Picture(pixels, curve), regions, curve=curve, dtype=dtype)
        ours, _ = recolor(Picture(view, curve), regions, curve=curve, dtype=dtype)
        np.testing.assert_allclose(ours, plain, atol=1e-6 if dtype == np.float32 else 0)
        np.testing.assert_array_equal(view, before)
        np.testing.assert_array_equal(mask, kept_mask)


# --- where it goes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("masked", [False, True])
def test_in_place(dtype, channels, masked):
    curve = None if dtype == np.float32 else transfer.SRGB
    pixels = (RNG.random((300, 401, channels)) * (1 if dtype == np.float32 else np.iinfo(dtype).max)).astype(dtype)
    regions = [RegionMatrix(M1, blob(300, 401, 150, 200, 120) if masked else None)]
    wanted, _ = recolor(Picture(pixels.copy(), curve), regions, curve=curve, dtype=dtype)
    alpha = pixels[..., 3:].copy()
    result, _ = recolor(Picture(pixels, curve), regions, curve=curve, dtype=dtype, out=pixels)
    assert result is pixels
    np.testing.assert_array_equal(pixels[..., :3], wanted)
    np.testing.assert_array_equal(pixels[..., 3:], alpha)


@pytest.mark.parametrize("masked", [False, True])
def test_into_a_given_array(masked):
    image = RNG.random((60, 70, 3), dtype=np.float32)
    regions = [RegionMatrix(M1, blob(60, 70, 30, 35, 20) if masked else None)]
    wanted, _ = recolor(Picture(image), regions)
    for out in (
        np.full((60, 70, 3), np.nan, np.float32),
        np.full((60, 70, 4), 5, np.float32),
        np.full((120, 140, 3), 5, np.float32)[::2, ::2],
    ):
        result, _ = recolor(Picture(image), regions, out=out)
        assert result is out
        np.testing.assert_array_equal(out[..., :3], wanted)
        assert (out[..., 3:] == 5).all()


def test_analysis_recolors_into_a_given_array(product):
    scene = product()
    analysis = analyze(scene.image, mask=scene.mask)
    out = np.empty_like(scene.image)
    assert analysis.recolor((0.1, 0.2, 0.3), out=out) is out
    np.testing.assert_array_equal(out, analysis.recolor((0.1, 0.2, 0.3)))


# --- gamut ----------------------------------------------------------------------------------------------------


def test_float_output_is_never_clipped():
    image = (RNG.random((20, 30, 3)) * 4 - 1).astype(np.float32)
    matrix = np.array([[3, -1, 0], [-2, 1, 0.5], [0, 0.5, -1.5]])
    for dtype in (np.float16, np.float32):
        result, shares = recolor(Picture(image), [RegionMatrix(matrix)], dtype=dtype)
        np.testing.assert_allclose(result, image @ matrix.T, rtol=2e-3, atol=5e-3)
        assert result.min() < -3
        assert result.max() > 3
        assert shares.out_of_gamut == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_share_out_of_gamut(dtype):
    # A quarter of the region lies outside: those pixels that are doubled beyond 1.
    image = np.full((40, 40, 3), 0.3, np.float32)
    image[:10] = [0.8, 0.2, 0.2]
    result, shares = recolor(Picture(image), [RegionMatrix(2 * np.eye(3))], curve=transfer.SRGB, dtype=dtype)
    assert shares.pixels == 1600
    assert shares.out_of_gamut == pytest.approx(0.25)
    assert len(np.unique(result[:10].reshape(-1, 3), axis=0)) == 1
    # (1.6, 0.4, 0.4) keeps its luminance, 0.6551: 1 in red, and paler.
    linear = transfer.SRGB.decode(result[0, 0] / np.iinfo(dtype).max)
    assert linear @ [0.2126, 0.7152, 0.0722] == pytest.approx(0.2126 * 1.6 + 0.7874 * 0.4, abs=0.01)
    assert result[0, 0, 0] == np.iinfo(dtype).max


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-50, 50), min_size=9, max_size=9), st.sampled_from([np.uint8, np.uint16]))
def test_codes_never_wrap(matrix, dtype):
    pixels = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, (8, 9, 3), endpoint=True).astype(dtype)
    m = np.array(matrix).reshape(3, 3)
    result, _ = recolor(Picture(pixels, transfer.SRGB), [RegionMatrix(m)], curve=transfer.SRGB, dtype=dtype)
    exact = transfer.decode(pixels, transfer.SRGB).astype(float) @ m.T
    # Far above white is white and far below black is black: a wrapped code would be anything.
    assert (result[(exact > 1.01).all(axis=-1)] == np.iinfo(dtype).max).all()
    assert (result[(exact < -0.01).all(axis=-1)] == 0).all()
    inside = (exact > 0.001).all(axis=-1) & (exact < 0.999).all(axis=-1)
    wanted = transfer.SRGB.encode(exact[inside]) * np.iinfo(dtype).max
    assert np.abs(result[inside] - wanted).max(initial=0) < 1


# --- bad pixels -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_bad_pixels_are_refused(bad, dtype):
    image = RNG.random((50, 60, 3), dtype=np.float32)
    image[30, 40, 1] = bad
    for regions in ([RegionMatrix(M1)], [RegionMatrix(M1, blob(50, 60, 25, 30, 22))]):
        with pytest.raises(ImageError, match="NaN or infinite"):
            recolor(Picture(image), regions, curve=transfer.SRGB, dtype=dtype)


def test_a_converted_picture_is_not_changed():
    image = RNG.random((30, 40, 3), dtype=np.float32)
    before = image.copy()
    result, _ = recolor(Picture(image), [RegionMatrix(M1)], convert=M2)
    np.testing.assert_array_equal(image, before)
    np.testing.assert_allclose(result, image @ M1.T @ M2.T, atol=1e-5)


def test_huge_ordinary_numbers_are_no_error():
    image = np.full((4, 5, 3), 1e25, np.float32)
    result, _ = recolor(Picture(image), [RegionMatrix(M1)])
    np.testing.assert_allclose(result, image @ M1.T.astype(np.float32), rtol=1e-5)


# --- row by row -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
def test_rows_are_done_as_far_as_it_tells(threads, masked, dtype):
    height, width = 20 * BAND_PIXELS // 401, 401
    pixels = (RNG.random((height, width, 3)) * (255 if dtype == np.uint8 else 1)).astype(dtype)
    curve = transfer.SRGB if dtype == np.uint8 else None
    mask = blob(height, width, height // 2, 200, 180) if masked else None
    arguments = {"curve": curve, "dtype": dtype, "threads": threads}
    wanted, shares = recolor(Picture(pixels, curve), [RegionMatrix(M1, mask)], **arguments)
    out = np.full_like(pixels, 77)
    job = Recoloring(Picture(pixels, curve), [RegionMatrix(M1, mask)], out=out, **arguments)
    told = []
    for done in job.rows():
        np.testing.assert_array_equal(out[:done], wanted[:done])
        told.append(done)
    assert told == sorted(told)
    assert told[-1] == height
    assert len(told) > 1
    assert job.out is out
    assert job.shares == shares


@pytest.mark.parametrize("threads", [1, 3])
def test_bad_pixels_are_refused_row_by_row_too(threads):
    image = RNG.random((20 * BAND_PIXELS // 401, 401, 3), dtype=np.float32)
    image[-1, -1, 2] = np.nan
    job = Recoloring(Picture(image), [RegionMatrix(M1)], threads=threads)
    with pytest.raises(ImageError, match="NaN or infinite"):
        list(job.rows())
