"""What happens to colors that the output cannot hold."""

import colour
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import colorimetry, gamut
from dyehouse.core.colorspace import SPACES, SRGB

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
values = st.one_of(st.floats(-3, 5, width=32), st.floats(0, 1, width=32), st.sampled_from([-1e-3, 1.001, -1e6, 1e6]))
pictures = st.lists(st.tuples(values, values, values), min_size=1, max_size=30).map(lambda p: np.array(p, np.float32))
ordinary = settings(deadline=None, max_examples=150)


def fitted(pixels):
    out = np.array(pixels, np.float32)
    count = gamut.fit_to_gamut(out)
    return out, count


@ordinary
@given(pictures)
def test_everything_ends_up_inside_and_what_was_inside_stays(pixels):
    out, count = fitted(pixels)
    outside = gamut.out_of_gamut(pixels)
    assert count == np.count_nonzero(outside)
    assert np.isfinite(out).all()
    assert (out >= -gamut.TOLERANCE).all()
    assert (out <= 1 + gamut.TOLERANCE).all()
    np.testing.assert_array_equal(out[~outside], pixels[~outside])
    # What was moved is inside exactly, but for the last float digit.
    assert (out[outside] >= -1e-6).all()
    assert (out[outside] <= 1 + 1e-6).all()


@ordinary
@given(st.lists(st.tuples(*[st.floats(-2, 3, width=32)] * 3), min_size=1, max_size=30))
def test_pixels_move_straight_to_the_grey_of_their_luminance(pixels):
    pixels = np.array(pixels, np.float64)
    out, _ = fitted(pixels)
    grey = np.clip(pixels @ WEIGHTS, 0, 1)[:, None]
    before, after = pixels - grey, out - grey
    # On the segment: parallel, same side, not longer. Hue and luminance stay.
    np.testing.assert_allclose(np.cross(before, after), 0, atol=1e-4)
    assert (np.sum(before * after, axis=1) >= -1e-5).all()
    assert (np.linalg.norm(after, axis=1) <= np.linalg.norm(before, axis=1) + 1e-5).all()
    held = (pixels @ WEIGHTS > 0) & (pixels @ WEIGHTS < 1)
    np.testing.assert_allclose((out @ WEIGHTS)[held], (pixels @ WEIGHTS)[held], atol=2e-3)


@ordinary
@given(st.tuples(*[st.floats(-2, 3, width=32)] * 3))
def test_no_more_chroma_is_given_up_than_needed(pixel):
    pixels = np.array([pixel], np.float32)
    if gamut.out_of_gamut(pixels)[0] and 0.001 < pixels[0] @ WEIGHTS < 0.999:
        out, _ = fitted(pixels)
        assert min(out.min(), 1 - out.max()) == pytest.approx(0, abs=1e-4)  # on the border


def test_by_hand():
    # Luminance of (1.5, 0.5, 0.5) is 0.5 + 0.2126: the way to grey 0.7126 ends where red is 1.
    out, count = fitted([[1.5, 0.5, 0.5], [0.2, 0.3, 0.4]])
    share = (1 - 0.7126) / (1.5 - 0.7126)
    np.testing.assert_allclose(out[0], [1, 0.7126 - 0.2126 * share, 0.7126 - 0.2126 * share], atol=1e-6)
    assert count == 1


def test_brighter_than_white_is_white_and_darker_than_black_is_black():
    out, count = fitted([[3, 2, 1.5], [1e30, 1e30, 1e30], [-0.5, -0.2, -0.1], [-1e30, -1e30, -1e30]])
    np.testing.assert_allclose(out, [[1] * 3, [1] * 3, [0] * 3, [0] * 3], atol=1e-6)
    assert count == 4


def test_continuous_across_the_border():
    # From inside to outside in fine steps, through faces: the only jump is where the tolerance ends. There the pixel
    # comes back by the tolerance across the face, and the other channels in proportion to the way to grey.
    steps = np.linspace(-0.2, 0.2, 4001)
    for start, axis in (((1.0, 0.4, 0.3), 0), ((0.0, 0.4, 0.3), 0), ((0.2, 1.0, 0.2), 1), ((0.5, 0.6, 0.0), 2)):
        line = np.repeat(np.array([start]), len(steps), axis=0)
        line[:, axis] += steps
        out, _ = fitted(line)
        way = np.abs(np.array(start) - np.array(start) @ WEIGHTS)
        jump = gamut.TOLERANCE * (way.max() / way[axis])
        assert np.abs(np.diff(out, axis=0)).max() < 1.1 * jump + 5e-4


def test_noise_of_the_picture_does_not_count():
    almost = np.array([[1 + gamut.TOLERANCE / 2, 0.5, -gamut.TOLERANCE / 2]], np.float32)
    out, count = fitted(almost)
    assert count == 0
    np.testing.assert_array_equal(out, almost)


def test_nothing():
    assert gamut.fit_to_gamut(np.empty((0, 3), np.float32)) == 0


def test_out_of_gamut_takes_any_shape():
    picture = np.full((4, 5, 3), 0.5, np.float32)
    picture[1, 2, 0] = 1.1
    picture[3, 4, 2] = -0.1
    assert [tuple(map(int, p)) for p in np.argwhere(gamut.out_of_gamut(picture))] == [(1, 2), (3, 4)]


def hues(linear, space, method):
    if method == "lab":
        return colorimetry.lab_to_lch(colorimetry.linear_to_lab(linear, space))
    xyz = linear @ (colorimetry.adaptation_matrix(space.white, SRGB.white) @ space.to_xyz).T
    return colorimetry.lab_to_lch(colour.XYZ_to_Oklab(xyz))


@pytest.mark.parametrize(
    "space", [SPACES[name] for name in ("srgb", "display-p3", "rec2020", "acescg")], ids=lambda s: s.name
)
@pytest.mark.parametrize("method", ["lab", "oklch"])
def test_nearest_keeps_the_hue_and_is_reproducible(space, method):
    rng = np.random.default_rng(2)
    colors = rng.uniform(-0.3, 1.3, (60, 3))
    found = gamut.nearest(colors, space, method)
    assert found.linear.min() >= -gamut.TOLERANCE
    assert found.linear.max() <= 1 + gamut.TOLERANCE
    before, after = hues(colors, space, method), hues(found.linear, space, method)
    moved = gamut.out_of_gamut(colors)
    np.testing.assert_array_equal(found.linear[~moved], colors[~moved])
    chromatic = moved & (after[:, 1] > 0.02 * before[:, 1]) & (before[:, 1] > (5 if method == "lab" else 0.02))
    assert chromatic.sum() > 20
    turned = (after - before)[chromatic, 2]
    assert np.abs((turned + 180) % 360 - 180).max() < 0.1
    expected = colour.delta_E(*(colorimetry.linear_to_lab(c, space) for c in (colors, found.linear)), method="CIE 2000")
    np.testing.assert_allclose(found.difference, expected, atol=1e-6)


@pytest.mark.parametrize("method", ["lab", "oklch"])
def test_no_reproducible_color_of_that_hue_is_nearer(method):
    # Against a search of the slice of that hue point by point.
    targets = [[60, -80, 20], [50, 0, -110], [99, 20, 90], [2, 30, -40], [40, 90, 60]]
    for target in colorimetry.lab_to_linear(np.array(targets), SRGB):
        found = gamut.nearest(target, SRGB, method)
        _, C, h = hues(target[None], SRGB, method)[0]
        grid = np.stack(np.meshgrid(np.linspace(0, 1, 161), np.linspace(0, 1, 161)), axis=-1).reshape(-1, 2)
        lch = np.column_stack([grid[:, 0] * (100 if method == "lab" else 1), grid[:, 1] * C, np.full(len(grid), h)])
        lab = colorimetry.lch_to_lab(lch)
        if method == "lab":
            linear = colorimetry.lab_to_linear(lab, SRGB)
        else:
            linear = colour.Oklab_to_XYZ(lab) @ SRGB.from_xyz.T
        held = linear[(linear.min(axis=1) >= 0) & (linear.max(axis=1) <= 1)]
        wanted = colorimetry.linear_to_lab(target, SRGB)
        best = colorimetry.delta_e_2000(wanted, colorimetry.linear_to_lab(held, SRGB)).min()
        assert found.difference <= best + 0.02
        assert found.difference > 1


def test_nearest_is_nearer_than_the_way_to_grey():
    colors = colorimetry.lab_to_linear(np.array([[60.0, -80, 20], [50, 0, -110], [40, 90, 60]]), SRGB)
    grey = colors.astype(np.float32)
    gamut.fit_to_gamut(grey)
    away = colorimetry.delta_e_2000(*(colorimetry.linear_to_lab(c, SRGB) for c in (colors, grey.astype(float))))
    assert (gamut.nearest(colors).difference < away).all()


def test_marking():
    picture = np.full((4, 5, 3), 0.5, np.float32)
    picture[1, 2, 0] = 1.1
    before = picture.copy()
    shown, share = gamut.marked(picture, (0, 1, 0))
    assert share == 1 / 20
    np.testing.assert_array_equal(shown[1, 2], [0, 1, 0])
    np.testing.assert_array_equal(np.delete(shown.reshape(-1, 3), 7, axis=0), 0.5)
    np.testing.assert_array_equal(picture, before)
