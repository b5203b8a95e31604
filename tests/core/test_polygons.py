"""Filled curves: areas that geometry knows, and the rules of what is inside."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyehouse.core.polygons import Layer, bezier, fill, rasterize

SQUARE = [(2.5, 1.25), (7.75, 1.25), (7.75, 5.0), (2.5, 5.0)]


def square(x: float, y: float, half: float, clockwise: bool = True) -> np.ndarray:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half + (x, y)
    return corners if clockwise else corners[::-1]


def test_coverage_of_a_rectangle_is_its_area_in_each_pixel() -> None:
    filled = fill([SQUARE], (8, 10))
    across = np.array([0, 0, 0.5, 1, 1, 1, 1, 0.75, 0, 0])
    down = np.array([0, 0.75, 1, 1, 1, 0, 0, 0])
    assert (filled == down[:, None] * across).all()


@given(st.lists(st.tuples(st.floats(-20, 60), st.floats(-20, 60)), min_size=3, max_size=3))
def test_a_triangle_covers_its_area(corners: list[tuple[float, float]]) -> None:
    inside = np.clip(corners, 2, 38)
    a, b, c = inside
    area = abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]) / 2
    assert fill([inside], (40, 40)).sum() == pytest.approx(area, abs=0.26 * 40)
    assert fill([inside], (40, 40)).sum() == pytest.approx(fill([inside[::-1]], (40, 40)).sum())


def test_a_circle_of_curves_covers_its_area() -> None:
    k = 0.5522847498  # four cubic curves that are round within 0.03 percent
    ring = [
        ((1, -k), (1, 0), (1, k)),
        ((k, 1), (0, 1), (-k, 1)),
        ((-1, k), (-1, 0), (-1, -k)),
        ((-k, -1), (0, -1), (k, -1)),
    ]
    outline = bezier(np.array(ring) * 180 + 200)
    assert fill([outline], (400, 400)).sum() == pytest.approx(np.pi * 180**2, rel=1e-3)


def test_what_lies_outside_the_picture_is_cut_off() -> None:
    assert (fill([square(5, 5, 100)], (10, 12)) == 1).all()
    assert not fill([square(50, 5, 3)], (10, 12)).any()
    assert not fill([], (10, 12)).any()
    assert not fill([[(1, 1), (5, 5)]], (10, 12)).any()


@pytest.mark.parametrize(
    ("rule", "overlap", "hole", "island"), [("union", 1, 1, 1), ("nonzero", 1, 0, 1), ("evenodd", 0, 0, 0)]
)
def test_rules_where_outlines_overlap(rule: str, overlap: float, hole: float, island: float) -> None:
    assert fill([square(10, 10, 6), square(14, 14, 6)], (24, 24), rule)[12, 12] == overlap
    assert fill([square(12, 12, 8), square(12, 12, 3, clockwise=False)], (24, 24), rule)[12, 12] == hole
    assert fill([square(12, 12, 8), square(12, 12, 3)], (24, 24), rule)[12, 12] == island


def test_an_open_curve_is_closed_by_a_straight_line() -> None:
    points = np.array([[(x, y)] * 3 for x, y in SQUARE], float)
    assert (fill([bezier(points, closed=False)], (8, 10)) == fill([SQUARE], (8, 10))).all()


def test_layers() -> None:
    left, right = square(6, 8, 5), square(10, 8, 5)

    def at(*layers: Layer) -> list[int]:
        value = rasterize(layers, (16, 16))
        return [int(value[8, x]) for x in (3, 8, 13, 15)]

    one = Layer((left,))
    assert at(one) == [255, 255, 0, 0]
    assert at(Layer((left,), opacity=0.5)) == [128, 128, 0, 0]
    assert at(Layer((left,), inverted=True)) == [0, 0, 255, 255]
    assert at(one, Layer((right,), opacity=0.5)) == [255, 255, 128, 0]
    assert at(one, Layer((right,), blend="SUBTRACT")) == [255, 0, 0, 0]
    assert at(one, Layer((right,), blend="MUL")) == [0, 255, 0, 0]
    assert at(one, Layer((right,), blend="DIFFERENCE")) == [255, 0, 255, 0]
    assert at(one, Layer((right,), blend="REPLACE", opacity=0.5)) == [128, 255, 128, 0]
    assert at() == [0, 0, 0, 0]
