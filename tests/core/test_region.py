"""The region that a click means: on two real photographs, and on pictures made here."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image
from scipy import ndimage

from dyehouse.core import Picture, transfer
from dyehouse.core.errors import MaskError, ReferenceColorError
from dyehouse.core.reference import white_at
from dyehouse.core.region import label, region_at, region_from_clicks


def iou(a, b):
    a, b = a > 127, b > 127
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)


# --- labels ---------------------------------------------------------------------------------------------------

masks = st.tuples(st.integers(1, 25), st.integers(1, 25)).flatmap(lambda shape: arrays(bool, shape))


def same_partition(ours, theirs, count):
    """Whether two labelings number the same parts, in whatever order."""
    pairs = {(int(a), int(b)) for a, b in zip(ours.ravel(), theirs.ravel(), strict=True)}
    inside = {p for p in pairs if p != (0, 0)}
    return len(inside) == count == len({a for a, _ in inside}) == len({b for _, b in inside}) and all(
        a and b for a, b in inside
    )


@settings(deadline=None, max_examples=200)
@given(masks)
def test_label_finds_the_parts_that_scipy_finds(mask):
    before = mask.copy()
    ours, count = label(mask)
    theirs, expected = ndimage.label(mask)
    assert count == expected
    assert ours.shape == mask.shape
    assert same_partition(ours, theirs, count)
    np.testing.assert_array_equal(mask, before)


@pytest.mark.parametrize("density", [0.1, 0.5, 0.59, 0.65, 0.9, 1.0])
def test_label_on_large_noise(density):
    # Around 0.59 parts percolate: they are as winding as they get.
    mask = np.random.default_rng(1).random((300, 400)) < density
    ours, count = label(mask)
    theirs, expected = ndimage.label(mask)
    assert count == expected
    assert same_partition(ours, theirs, count)


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_label_on_a_spiral_and_a_comb(turned):
    spiral = np.zeros((61, 61), bool)
    for k in range(0, 30, 4):
        spiral[k, k : 61 - k] = spiral[k : 61 - k, 60 - k] = spiral[60 - k, k : 61 - k] = True
        spiral[k + 4 : 61 - k, k] = True
        spiral[k + 4, k : k + 5] = True
    comb = np.zeros((40, 81), bool)
    comb[:, ::2] = True
    comb[39] = True
    for mask in (spiral, comb):
        mask = np.rot90(mask, turned)
        assert label(mask)[1] == ndimage.label(mask)[1] == 1


# --- the two photographs --------------------------------------------------------------------------------------
# Positions (x, y) read off the photographs by eye, at twice their size with a grid.

SUIT = [
    (100, 350), (75, 250), (90, 240), (140, 285), (170, 312), (200, 330), (215, 345), (150, 330), (110, 400),
    (60, 390), (35, 420), (45, 440), (60, 445), (90, 440), (118, 452), (80, 485), (100, 470), (150, 440), (190, 440),
    (215, 405), (225, 440), (218, 480), (300, 312), (285, 320), (320, 300), (320, 262), (330, 285), (340, 320),
    (312, 250), (225, 365), (80, 330), (130, 320), (40, 400), (70, 420),
]  # fmt: skip
NOT_SUIT = {
    "skin": [(220, 120), (200, 140), (240, 140), (220, 165), (190, 115), (225, 180), (210, 95)],
    "hair and background": [(180, 50), (285, 80), (120, 60), (330, 150), (120, 150), (330, 30), (350, 260)],
    "flag": [(20, 80), (75, 160), (85, 190), (30, 260), (40, 200), (10, 430), (8, 250), (50, 30), (15, 330), (65, 190)],
    "patch": [(165, 370), (150, 385), (195, 395), (170, 355), (180, 410), (145, 395), (160, 400)],
    "name tag": [(300, 360), (290, 365), (315, 365)],
    "collar": [(130, 180), (280, 250), (210, 220), (240, 280)],
    "straps": [(243, 380), (266, 400), (265, 470), (249, 460)],
    "helmet and shuttle": [(400, 440), (358, 440), (440, 370), (320, 420), (400, 150), (425, 100), (450, 310)],
}  # fmt: skip

SAUCER = [
    (120, 250), (100, 200), (110, 170), (130, 155), (150, 120), (130, 112), (100, 230), (110, 290), (130, 310),
    (160, 325), (190, 320), (135, 190), (150, 240), (170, 270), (180, 300), (220, 360), (260, 355), (300, 350),
    (340, 355), (380, 335), (420, 300), (440, 270), (450, 230), (430, 200), (430, 160), (410, 180), (400, 220),
    (455, 200), (420, 260), (410, 150),
]  # fmt: skip
NOT_SAUCER = {
    "table": [
        (20, 200), (30, 300), (40, 350), (60, 150), (70, 120), (55, 100), (100, 90), (130, 60), (145, 40), (500, 60),
        (550, 100), (492, 150), (500, 250), (550, 350), (470, 350), (500, 380), (450, 385), (100, 385), (60, 385),
        (130, 385), (100, 345), (30, 390), (400, 20), (460, 30), (590, 390), (60, 250), (20, 130), (520, 200),
    ],
    "background": [(20, 20), (60, 30), (30, 60)],
    "cup": [(280, 40), (330, 60), (200, 60), (180, 110), (395, 110), (280, 200)],
    "coffee": [(280, 160), (250, 170), (330, 150), (300, 110)],
    "spoon": [(350, 270), (412, 85), (345, 255)],
}  # fmt: skip


@pytest.fixture(scope="module")
def astronaut(astronaut_file):
    return np.array(Image.open(astronaut_file).convert("RGB"))


@pytest.fixture(scope="module")
def coffee(coffee_file):
    return np.array(Image.open(coffee_file).convert("RGB"))


@pytest.fixture(scope="module")
def suit(astronaut):
    return region_at(Picture(astronaut, transfer.SRGB), (100, 350))


@pytest.fixture(scope="module", params=["white of the cup", "no white"])
def saucer(coffee, request):
    picture = Picture(coffee, transfer.SRGB)
    return region_at(picture, (120, 250), white_at(picture, (395, 90)) if "cup" in request.param else None)


def check(mask, inside, outside):
    assert mask.dtype == np.uint8
    missed = [p for p in inside if mask[p[1], p[0]] < 128]
    assert not missed
    leaked = {name: [p for p in points if mask[p[1], p[0]] > 127] for name, points in outside.items()}
    assert not {name: points for name, points in leaked.items() if points}


def share(mask, left, top, right, bottom):
    return (mask[top:bottom, left:right] / 255).mean()


def test_one_click_selects_the_suit(suit):
    assert sum(len(points) for points in NOT_SUIT.values()) >= 25
    check(suit, SUIT, NOT_SUIT)


def test_the_suit_does_not_leak(suit):
    assert share(suit, 150, 20, 300, 185) < 0.002  # face and hair
    assert share(suit, 0, 0, 60, 230) < 0.002  # flag
    assert share(suit, 0, 230, 14, 512) < 0.002
    assert share(suit, 365, 0, 512, 330) < 0.002  # shuttle
    assert share(suit, 370, 330, 512, 512) < 0.002  # helmet
    y, x = np.mgrid[:512, :512]
    assert (suit[np.hypot(x - 171, y - 386) < 33] / 255).mean() < 0.02  # patch
    assert share(suit, 284, 345, 324, 372) < 0.05  # name tag
    # And it is nearly all there: this box is suit alone, with its seams and folds.
    assert share(suit, 130, 300, 230, 340) > 0.98
    assert share(suit, 60, 345, 120, 440) > 0.97


def test_one_click_selects_the_saucer(saucer):
    assert len(NOT_SAUCER["table"]) >= 25
    check(saucer, SAUCER, NOT_SAUCER)


def test_the_saucer_does_not_leak(saucer):
    assert share(saucer, 0, 0, 60, 400) < 0.005  # the table on all sides
    assert share(saucer, 0, 0, 110, 90) < 0.005
    assert share(saucer, 490, 0, 600, 400) < 0.005
    assert share(saucer, 0, 330, 90, 400) < 0.01
    assert share(saucer, 445, 350, 600, 400) < 0.01
    assert share(saucer, 210, 30, 380, 180) < 0.01  # inside of the cup
    assert share(saucer, 100, 160, 160, 300) > 0.97
    assert share(saucer, 410, 150, 450, 280) > 0.97


@pytest.mark.parametrize("click", [(170, 312), (300, 312), (150, 440), (60, 390), (225, 440), (320, 300)])
def test_any_click_on_the_suit_selects_it(astronaut, suit, click):
    again = region_at(Picture(astronaut, transfer.SRGB), click)
    assert iou(again, suit) > 0.85
    check(again, [click], {k: v for k, v in NOT_SUIT.items() if k in ("skin", "flag", "patch")})


@pytest.mark.parametrize("click", [(430, 200), (110, 170), (300, 350), (160, 325)])
def test_any_click_on_the_saucer_selects_it(coffee, saucer, click):
    again = region_at(Picture(coffee, transfer.SRGB), click)
    assert iou(again, saucer) > 0.85


def test_exposure_does_not_matter(astronaut, suit):
    linear = transfer.decode(astronaut, transfer.SRGB)
    # Not of codes but of light, which is what changes; the top is no longer clipped then, but for the reference.
    for exposure in (0.5, 1, 4):
        darker = region_at(Picture(linear * np.float32(exposure)), (100, 350))
        assert iou(darker, suit) > 0.95


def test_twice_the_size_is_the_same_region(astronaut, suit):
    large = np.array(Image.fromarray(astronaut).resize((1024, 1024), Image.Resampling.BICUBIC))
    mask = region_at(Picture(large, transfer.SRGB), (200, 700))
    assert mask.shape == (1024, 1024)
    assert iou(mask.reshape(512, 2, 512, 2).mean(axis=(1, 3)), suit) > 0.92
    check(mask, [(2 * x, 2 * y) for x, y in SUIT], {k: [(2 * x, 2 * y) for x, y in v] for k, v in NOT_SUIT.items()})


def test_the_edge_is_soft_and_thin(suit):
    soft = (suit > 0) & (suit < 255)
    assert 0.005 < soft.mean() < 0.1
    # Nowhere wider than some pixels: eroding the soft part by 3 leaves next to nothing.
    assert ndimage.binary_erosion(soft, iterations=3).mean() < 1e-3


# --- pictures made here ---------------------------------------------------------------------------------------


def test_a_ball_is_selected_blind_to_shading_and_gloss(product):
    for body in ((0.42, 0.09, 0.05), (0.05, 0.12, 0.45), (0.1, 0.4, 0.12)):
        scene = product(body, size=200, noise=0.001)
        mask = region_at(Picture(scene.image), scene.matte)
        assert iou(mask, scene.mask * 255) > 0.97
        highlight = np.unravel_index(np.argmax(scene.gloss), scene.gloss.shape)
        assert mask[highlight] == 255


def test_under_colored_light_with_its_white(product):
    white = np.array([1.2, 1.0, 0.5])
    scene = product(np.array((0.1, 0.4, 0.12)) * white, white, size=200, noise=0.001)
    assert iou(region_at(Picture(scene.image), scene.matte, white), scene.mask * 255) > 0.97


def test_cover_on_a_known_soft_outline():
    y, x = np.mgrid[:120, :130].astype(float)
    cover = np.clip((40 - np.hypot(x - 65, y - 60)) / 2 + 0.5, 0, 1)[..., None]
    image = cover * np.array([0.5, 0.1, 0.06]) + (1 - cover) * np.array([0.1, 0.3, 0.5])
    mask = region_at(Picture(image.astype(np.float32)), (65, 60)) / 255
    assert np.abs(mask - cover[..., 0]).max() < 0.15
    assert np.abs(mask - cover[..., 0]).mean() < 0.005


def two_squares(gap):
    image = np.full((200, 300, 3), [0.2, 0.25, 0.5], np.float32)
    image[50:150, 30:130] = [0.5, 0.1, 0.05]
    image[50:150, 130 + gap : 230 + gap] = [0.5, 0.1, 0.05]
    return Picture(image)


def test_narrow_gaps_are_bridged_and_wide_ones_are_not():
    narrow = region_at(two_squares(2), (80, 100))
    assert narrow[100, 200] == 255
    assert narrow[100, 131] < 128  # the gap itself is not the product
    wide = region_at(two_squares(40), (80, 100))
    assert wide[100, 80] == 255
    assert wide[100, 220] == 0


def test_another_color_touching_is_left_out():
    image = np.full((100, 150, 3), [0.5, 0.1, 0.05], np.float32)
    image[:, 75:] = [0.5, 0.3, 0.05]
    left, right = region_at(Picture(image), (30, 50)), region_at(Picture(image), (120, 50))
    assert (left[:, :73] == 255).all()
    assert (left[:, 77:] == 0).all()
    assert (right[:, 77:] == 255).all()
    assert (right[:, :73] == 0).all()


def test_tolerance_widens():
    # A body color that turns slowly in hue from left to right.
    angle = np.linspace(0, np.pi / 2, 300)
    color = np.stack([0.3 + 0.2 * np.cos(angle), 0.1 + 0.3 * np.sin(angle), np.full(300, 0.05)], axis=1)
    picture = Picture(np.broadcast_to(color.astype(np.float32), (60, 300, 3)))
    sizes = [np.count_nonzero(region_at(picture, (20, 30), tolerance=t) > 127) for t in (0.5, 1, 2)]
    assert sizes[0] < sizes[1] < sizes[2] < 60 * 300


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (2, 2), (5, 4)])
def test_tiny_pictures(shape):
    picture = Picture(np.tile(np.array([0.5, 0.2, 0.1], np.float32), (*shape, 1)))
    mask = region_at(picture, (shape[1] - 1, shape[0] - 1))
    assert mask.shape == shape
    assert (mask == 255).all()


@pytest.mark.parametrize("color", [(0.3, 0.3, 0.3), (0.301, 0.3, 0.299), (0.7, 0.7, 0.7)])
def test_grey_products(color):
    image = np.full((80, 90, 3), [0.15, 0.1, 0.4], np.float32)
    image[20:60, 20:70] = color
    mask = region_at(Picture(image), (45, 40))
    assert (mask[24:56, 24:66] > 127).all()
    assert (mask[:16] == 0).all()


def test_input_is_not_modified(product):
    scene = product(white=(1.2, 1.0, 0.5))
    image, white = scene.image.copy(), scene.white.copy()
    region_at(Picture(scene.image), scene.matte, scene.white)
    np.testing.assert_array_equal(scene.image, image)
    np.testing.assert_array_equal(scene.white, white)


# --- bad clicks -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("click", [(-1, 5), (5, -1), (96, 5), (5, 96), (-0.5, 3)])
def test_click_outside(product, click):
    with pytest.raises(ReferenceColorError, match="lies outside the picture of 96 x 96"):
        region_at(Picture(product().image), click)


@pytest.mark.parametrize("click", [(np.nan, 5), (5, np.inf)])
def test_click_that_is_no_pixel(product, click):
    with pytest.raises(ReferenceColorError, match="Click"):
        region_at(Picture(product().image), click)


def test_click_on_black(product):
    scene = product()
    scene.image[:20, :20] = 0
    with pytest.raises(MaskError, match=r"Click \(8, 9\) is on black"):
        region_at(Picture(scene.image), (8, 9))


@pytest.mark.parametrize("tolerance", [0, -1, np.nan])
def test_bad_tolerance(product, tolerance):
    scene = product()
    with pytest.raises(MaskError, match=r"Tolerance .* is not above zero"):
        region_at(Picture(scene.image), scene.matte, tolerance=tolerance)


def test_click_on_a_pixel_that_is_not_finite(product):
    scene = product()
    scene.image[40, 41] = np.nan
    with pytest.raises((MaskError, ReferenceColorError), match="finite"):
        region_at(Picture(scene.image), (41, 40))


# --- several clicks -------------------------------------------------------------------------------------------


def two_materials():
    """Red beside yellow on blue, with soft outlines."""
    y, x = np.mgrid[:120, :200].astype(float)
    cover = np.clip(np.minimum(np.minimum(x - 30, 170 - x), np.minimum(y - 30, 90 - y)) / 2 + 0.5, 0, 1)[..., None]
    left = np.clip((100 - x) / 2 + 0.5, 0, 1)[..., None]
    product = left * np.array([0.5, 0.1, 0.05]) + (1 - left) * np.array([0.45, 0.35, 0.04])
    image = cover * product + (1 - cover) * np.array([0.1, 0.3, 0.5])
    return Picture(image.astype(np.float32)), cover[..., 0]


def test_an_added_click_adds_its_material_without_a_seam():
    picture, cover = two_materials()
    both = region_from_clicks(picture, (50, 60), [(150, 60)])
    assert (both[40:80, 40:160] == 255).all()  # over the seam at 100 too
    assert np.abs(both / 255 - cover).max() < 0.2
    assert np.abs(both / 255 - cover).mean() < 0.005
    np.testing.assert_array_equal(region_from_clicks(picture, (50, 60)), region_at(picture, (50, 60)))


def test_a_removed_click_takes_its_material_away():
    picture, _ = two_materials()
    red = region_from_clicks(picture, (50, 60), [(150, 60)], [(140, 70)])
    alone = region_at(picture, (50, 60))
    assert (red[:, 104:] == 0).all()
    assert iou(red, alone) > 0.99


def test_a_removed_click_takes_out_a_part_that_a_jump_brought():
    picture = two_squares(2)
    assert region_at(picture, (80, 100))[100, 200] == 255
    blue = region_from_clicks(picture, (10, 10), [(80, 100)], [(200, 100)])
    assert blue[100, 80] == blue[100, 200] == 0
    assert blue[10, 10] == 255


def test_clicks_on_the_suit_and_the_flag(astronaut, suit):
    picture = Picture(astronaut, transfer.SRGB)
    patch = region_at(picture, (165, 370))
    with_patch = region_from_clicks(picture, (100, 350), [(165, 370)])
    assert (suit[(with_patch < 128) & (patch < 128)] < 128).mean() > 0.995
    assert with_patch[370, 165] == 255
    again = region_from_clicks(picture, (100, 350), [(165, 370)], [(165, 370)])
    assert again[370, 165] == 0
    check(again, [(100, 350), (170, 312)], {k: v for k, v in NOT_SUIT.items() if k in ("skin", "flag")})


def test_nothing_left_of_a_region(product):
    scene = product(size=200, noise=0.001)
    with pytest.raises(MaskError, match="leave nothing of the region: drop one"):
        region_from_clicks(Picture(scene.image), scene.matte, removed=[scene.matte])


def test_every_click_is_checked(product):
    scene = product()
    for clicks in ({"added": [(500, 3)]}, {"removed": [(500, 3)]}):
        with pytest.raises(ReferenceColorError, match=r"Click \(500, 3\) lies outside"):
            region_from_clicks(Picture(scene.image), scene.matte, **clicks)
