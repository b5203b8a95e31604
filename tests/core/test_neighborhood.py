"""Growing masks and mean colors nearby, against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from dyehouse.core.neighborhood import along_outline, dilate, erode, mean_at, window
from dyehouse.core.picture import Picture

masks = arrays(bool, st.tuples(st.integers(1, 24), st.integers(1, 150)))


@settings(deadline=None, max_examples=60)
@given(masks, st.integers(0, 9) | st.just(70))
def test_dilate_and_erode_as_scipy_does(mask: np.ndarray, radius: int) -> None:
    square = np.ones((2 * radius + 1, 2 * radius + 1), bool)
    before = mask.copy()
    assert (dilate(mask, radius) == ndimage.binary_dilation(mask, square)).all()
    assert (erode(mask, radius) == ndimage.binary_erosion(mask, square, border_value=1)).all()
    assert (along_outline(mask, radius) == dilate(mask, radius) & ~erode(mask, radius)).all()
    assert (mask == before).all()


@pytest.mark.parametrize("radius", [1, 3, 6])
def test_mean_of_the_wanted_pixels(radius: int) -> None:
    rng = np.random.default_rng(2)
    image = rng.random((30, 40, 3), dtype=np.float32)
    wanted = rng.random((30, 40)) < 0.3
    rows, columns = np.nonzero(rng.random((30, 40)) < 0.2)
    mean, found = mean_at(Picture(image), wanted, rows, columns, [window(radius)])
    for k, (y, x) in enumerate(zip(rows, columns, strict=True)):
        part = (slice(max(0, y - radius), y + radius + 1), slice(max(0, x - radius), x + radius + 1))
        inside = image[part][wanted[part]]
        assert found[k] == (len(inside) > 0)
        expected = inside.mean(axis=0) if len(inside) else np.zeros(3)
        assert mean[:, k] == pytest.approx(expected, abs=1e-6)


def test_a_wide_window_is_sampled_and_still_the_mean() -> None:
    image = np.full((200, 200, 3), (0.2, 0.4, 0.6), np.float32)
    mean, found = mean_at(Picture(image), np.ones((200, 200), bool), np.array([100]), np.array([100]), [window(60)])
    assert found[0]
    assert mean[:, 0] == pytest.approx([0.2, 0.4, 0.6], abs=1e-6)


def test_the_first_group_with_a_wanted_pixel_counts() -> None:
    image = np.zeros((9, 9, 3), np.float32)
    image[4, 6], image[4, 8] = 1, 5
    wanted = image[..., 0] > 0
    groups = [np.array([[0, 1], [1, 0]]), np.array([[0, 2]]), np.array([[0, 4]])]
    mean, found = mean_at(Picture(image), wanted, np.array([4, 0]), np.array([4, 8]), groups)
    assert found.tolist() == [True, False]
    assert mean.T.tolist() == [[1, 1, 1], [0, 0, 0]]
