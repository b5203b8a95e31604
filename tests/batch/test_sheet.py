"""Contact sheets."""

import numpy as np
import pytest

from dyehouse.batch.sheet import contact_sheet, resized


def flat(height, width, color):
    return np.full((height, width, 3), color, np.uint8)


def test_resized_keeps_proportions_and_flat_colors():
    small = resized(flat(300, 450, (200, 30, 90)), 150)
    assert small.shape == (100, 150, 3)
    assert small.dtype == np.uint8
    assert np.abs(small.astype(int) - (200, 30, 90)).max() <= 1
    assert resized(flat(20, 10, 5), 40).shape == (80, 40, 3)
    assert resized(flat(1, 1000, 5), 100).shape == (1, 100, 3)


def test_resized_filters():
    # Fine stripes become their mean and do not alias.
    stripes = flat(200, 200, 0)
    stripes[:, ::2] = 200
    small = resized(stripes, 50)
    assert np.abs(small[5:-5, 5:-5].astype(int) - 100).max() < 6


def test_resized_takes_views_and_leaves_them():
    large = np.random.default_rng(0).integers(0, 255, (60, 80, 4), np.uint8)
    before = large.copy()
    np.testing.assert_array_equal(resized(large[..., :3], 40), resized(np.ascontiguousarray(large[..., :3]), 40))
    np.testing.assert_array_equal(large, before)


@pytest.mark.parametrize("width", [100, 380])
def test_every_picture_is_on_the_sheet_in_its_row(width):
    colors = [(200, 30, 30), (30, 200, 30), (30, 30, 200), (200, 200, 30)]
    rows = [
        [("one", flat(60, 120, colors[0])), ("two", flat(60, 120, colors[1])), ("three", flat(60, 120, colors[2]))],
        [("four", flat(200, 100, colors[3]))],
    ]
    sheet = contact_sheet(rows, width)
    assert sheet.dtype == np.uint8
    found = []
    for color in colors:
        y, x = np.nonzero((np.abs(sheet.astype(int) - color) <= 1).all(axis=-1))
        height = width // 2 if color != colors[3] else 2 * width
        assert len(y) == width * height
        assert (y.max() - y.min() + 1, x.max() - x.min() + 1) == (height, width)
        found.append((y.min(), x.min()))
    # The first three side by side, in order; the fourth below the first.
    assert found[0][0] == found[1][0] == found[2][0]
    assert found[0][1] < found[1][1] < found[2][1]
    assert found[3][0] > found[0][0] + width // 2
    assert found[3][1] == found[0][1]
    # Paper all round.
    for border in (sheet[:5], sheet[-5:], sheet[:, :5], sheet[:, -5:]):
        assert (border == border[0, 0]).all()


def test_labels_are_written_below_their_pictures():
    labelled, without = (contact_sheet([[(text, flat(50, 100, (220, 40, 40)))]], 200) for text in ("navy #1F4E79", ""))
    differ = np.nonzero((labelled != without).any(axis=(1, 2)))[0]
    assert len(differ) > 5
    bottom = np.nonzero((np.abs(labelled.astype(int) - (220, 40, 40)) <= 1).all(axis=2).any(axis=1))[0].max()
    assert differ.min() > bottom
