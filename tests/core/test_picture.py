"""Pictures and masks as the core takes them."""

import numpy as np
import pytest

from dyehouse.core import transfer
from dyehouse.core.errors import ImageError, MaskError
from dyehouse.core.picture import Picture, above, as_mask, as_weights, bands, block_means, strips

RNG = np.random.default_rng(0)
CODES = RNG.integers(0, 256, (9, 11, 4), np.uint8)


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.ones((4, 4), np.float32), "shape"),
        (np.ones((4, 4, 2), np.float32), "shape"),
        (np.ones((1, 4, 4, 3), np.float32), "shape"),
        (np.ones((0, 4, 3), np.float32), "no pixels"),
        (np.ones((4, 0, 3), np.float32), "no pixels"),
        (np.ones((4, 4, 3), np.int32), "dtype int32"),
        (np.ones((4, 4, 3), bool), "dtype bool"),
        (np.ones((4, 4, 3), complex), "dtype complex128"),
        (np.ones((4, 4, 3), np.uint32), "dtype uint32"),
        (np.ones((4, 4, 3), np.uint8), "uint8 codes: decode"),
        (np.ones((4, 4, 3), np.uint16), "uint16 codes: decode"),
        ("picture", "shape"),
        (None, "shape"),
        ([[[1, 2, 3], [1, 2]]], "Picture"),
    ],
)
def test_arrays_that_are_no_pictures(pixels, words):
    with pytest.raises(ImageError, match=words):
        Picture(pixels)


def test_linear_parts_and_single_pixels():
    picture = Picture(CODES, transfer.SRGB)
    expected = transfer.SRGB.decode(CODES[..., :3] / 255)
    assert picture.shape == (9, 11)
    np.testing.assert_allclose(picture.linear(), expected, atol=1e-6)
    np.testing.assert_allclose(picture.linear(slice(2, 5), slice(3, 4)), expected[2:5, 3:4], atol=1e-6)
    rows, columns = np.array([8, 0, 3]), np.array([10, 0, 2])
    np.testing.assert_allclose(picture.at(rows, columns), expected[rows, columns], atol=1e-6)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_floats_are_taken_as_they_are(dtype):
    values = np.array([[[-0.5, 0.25, 7.5], [0, 1, 0.125]]], dtype)
    linear = Picture.of(values).linear()
    assert linear.dtype == np.float32
    np.testing.assert_array_equal(linear, values)
    assert Picture.of(picture := Picture(values)) is picture


def test_sample_is_a_regular_grid_of_about_the_number_asked_for():
    image = RNG.random((100, 200, 3), dtype=np.float32)
    known = {tuple(p) for p in image.reshape(-1, 3)}
    for most in (50, 1000, 20_000, 10**6):
        sample = Picture(image).sample(most)
        assert 0.3 * min(most, 20_000) <= len(sample) <= min(most * 1.5, 20_000)
        assert {tuple(p) for p in sample} <= known
    # The whole height and width is covered, not the top left.
    ramp = np.broadcast_to(np.linspace(0, 1, 100, dtype=np.float32)[:, None, None], (100, 200, 3))
    assert Picture(ramp).sample(200).mean() == pytest.approx(0.5, abs=0.1)


def test_sample_keeps_to_the_inside_of_the_mask():
    image = np.zeros((80, 90, 3), np.float32)
    image[20:60, 30:70] = 0.5
    mask = np.zeros((80, 90))
    mask[18:62, 28:72] = 0.5
    mask[20:60, 30:70] = 1
    for most in (10, 500, 10**6):
        sample = Picture(image).sample(most, mask)
        assert len(sample) > 0
        assert (sample == 0.5).all()
    single = np.zeros((80, 90), bool)
    single[41, 47] = True
    np.testing.assert_array_equal(Picture(image).sample(10, as_mask(single, (80, 90))), [[0.5] * 3])


def test_clip_level():
    assert Picture(CODES, transfer.SRGB).clip_level == pytest.approx(1, abs=1e-5)
    assert Picture(CODES, transfer.SRGB).clip_level <= 1
    image = RNG.random((20, 20, 3), dtype=np.float32)
    assert Picture(image * 0.9).clip_level == np.inf  # nothing reaches the top
    assert Picture(image * 9).clip_level == np.inf  # nothing stops at 1
    image[3, 4] = 1
    assert Picture(np.minimum(image, 1)).clip_level == pytest.approx(1, abs=1e-5)


def test_bands_and_strips_cover_every_row_once():
    for height, width in ((1, 1), (7, 6000), (1000, 3), (50, 100_000)):
        for start in (0, 13):
            rows = [r for b in bands(height, width, start) for r in range(b.start, b.stop)]
            assert rows == list(range(start, start + height))
        assert [r for top, bottom in strips(height, width) for r in range(top, bottom)] == list(range(height))


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.uint16, np.float16, np.float32, np.float64])
def test_masks_of_every_kind_mean_the_same(dtype):
    drawn = RNG.random((6, 7)) < 0.5
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    mask = (drawn * top).astype(dtype)
    before = mask.copy()
    weights = as_weights(as_mask(mask, (6, 7)))
    assert weights.dtype == np.float32
    np.testing.assert_allclose(weights, drawn, atol=1e-6)
    np.testing.assert_array_equal(mask, before)


def test_half_coverage():
    assert as_weights(as_mask(np.full((1, 1), 51, np.uint8), (1, 1)))[0, 0] == pytest.approx(0.2)
    assert as_weights(as_mask(np.full((1, 1), 13107, np.uint16), (1, 1)))[0, 0] == pytest.approx(0.2)
    assert as_weights(as_mask([[0.2]], (1, 1)))[0, 0] == pytest.approx(0.2)
    assert as_mask(None, (1, 1)) is None


@pytest.mark.parametrize(
    ("mask", "words"),
    [
        (np.ones((7, 6)), "6 x 7 pixels and the picture is 7 x 6"),
        (np.ones((6, 7, 1)), "size"),
        (np.ones(42), "size"),
        (np.zeros((6, 7)), "selects nothing"),
        (np.zeros((6, 7), bool), "selects nothing"),
        (np.zeros((6, 7), np.uint8), "selects nothing"),
        (np.full((6, 7), np.nan), "outside 0..1"),
        (np.where(np.eye(6, 7), np.nan, 1), "outside 0..1"),
        (np.full((6, 7), 1.5), "outside 0..1"),
        (np.full((6, 7), np.inf), "outside 0..1"),
        (np.full((6, 7), -0.1), "outside 0..1"),
        (np.full((6, 7), 255.0), "outside 0..1"),
        (np.ones((6, 7), int), "dtype int64"),
        (np.ones((6, 7), np.uint32), "dtype uint32"),
        (np.ones((6, 7), complex), "dtype complex128"),
        ("mask.png", "dtype"),
    ],
)
def test_bad_masks(mask, words):
    with pytest.raises(MaskError, match=words):
        as_mask(mask, (6, 7))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("level", [0.004, 0.5, 0.95, 0.996])
def test_above_is_what_the_weights_say(dtype, level):
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1
    mask = (np.linspace(0, 1, 1000) * top).astype(dtype).reshape(8, 125)
    expected = mask.astype(np.float64) / top > level
    np.testing.assert_array_equal(above(mask, level), expected)


@pytest.mark.parametrize("step", [1, 2, 5, 7])
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_block_means(step, dtype):
    values = np.random.default_rng(1).random((37, 23, 2)).astype(dtype)
    rows, columns = 37 // step, 23 // step
    whole = values[: rows * step, : columns * step].astype(np.float64).reshape(rows, step, columns, step, 2)
    np.testing.assert_allclose(block_means(values, step), whole.mean(axis=(1, 3)), atol=1e-6)
