"""Recipes: what a user asks for, translated into the method's numbers."""

import colour
import numpy as np
import pytest

from dyehouse.core import DyehouseError, Picture, transfer
from dyehouse.core.colorspace import SPACES, SRGB
from dyehouse.core.errors import MaskError, RecipeError, ReferenceColorError, TargetError, WhiteError
from dyehouse.core.recipe import Colorway, Recipe, Region, prepare, with_colorway, with_target
from dyehouse.core.recolor import recolor
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Swatch, parse_target

RED = parse_target("#a02818")
RGB = parse_target("rgb(0.06, 0.14, 0.42)")
XY = {"D65": (0.3127, 0.3290), "A": (0.44758, 0.40745), "D50": (0.3457, 0.3585)}


def one(target=RED, **region):
    return (Region(target, **region),)


def grey(value, name):
    return Swatch.from_spectrum(Spectrum(np.array([380.0, 780.0]), np.full(2, value), name))


# --- the white ------------------------------------------------------------------------------------------------


def test_no_white_is_balanced_unless_the_photo_brings_its_own(product):
    picture = Picture(product().image)
    plain = prepare(picture, Recipe(one()))
    np.testing.assert_array_equal(plain.white, [1, 1, 1])
    assert plain.white_source == "taken as balanced"
    own = prepare(picture, Recipe(one()), photo_white=(0.9, 1.0, 0.7))
    np.testing.assert_array_equal(own.white, [0.9, 1.0, 0.7])
    assert "camera" in own.white_source
    asked = prepare(picture, Recipe(one(), white=(1.1, 1.0, 0.9)), photo_white=(0.9, 1.0, 0.7))
    np.testing.assert_array_equal(asked.white, [1.1, 1.0, 0.9])


def test_white_from_a_pixel_of_a_card(product):
    scene = product(white=(1.1, 1.0, 0.6), noise=0)
    scene.image[:10, :10] = 0.18 * scene.white
    for recipe in (Recipe(one(), white=(4, 5), gray=0.18), Recipe(one(), white=(4.4, 5.3), gray=0.18)):
        prepared = prepare(Picture(scene.image), recipe)
        np.testing.assert_allclose(prepared.white, scene.white, rtol=1e-5)
        assert "pixel (4, 5)" in prepared.white_source
    full = prepare(Picture(scene.image), Recipe(one(), white=(4, 5)))
    np.testing.assert_allclose(full.white, 0.18 * scene.white, rtol=1e-5)


@pytest.mark.parametrize("name", XY)
@pytest.mark.parametrize("space", ["srgb", "acescg"])
def test_white_from_an_illuminants_name(product, name, space):
    prepared = prepare(Picture(product().image), Recipe(one(), white=name), space=SPACES[space])
    x, y = XY[name]
    expected = SPACES[space].from_xyz @ np.array([x / y, 1, (1 - x - y) / y])
    # The illuminant's chromaticity from its spectrum agrees with the rounded one to the fourth digit.
    np.testing.assert_allclose(prepared.white, expected, atol=3e-3)
    assert prepared.white @ SPACES[space].to_xyz[1] == pytest.approx(1, abs=1e-9)
    assert name in prepared.white_source


def test_white_from_a_temperature(product):
    # A daylight of 6504 K is D65; 2856 K is a black body: illuminant A.
    picture = Picture(product().image)
    for text, name in (("6504K", "D65"), ("2856 K", "A")):
        by_name = prepare(picture, Recipe(one(), white=name)).white
        np.testing.assert_allclose(prepare(picture, Recipe(one(), white=text)).white, by_name, atol=5e-3)


def test_white_from_highlights(product):
    light = SRGB.from_xyz @ colour.xy_to_XYZ(colour.temperature.CCT_to_xy_CIE_D(5000))
    scene = product(np.array((0.08, 0.35, 0.1)) * light, light, size=200, noise=0.001)
    prepared = prepare(Picture(scene.image), Recipe(one(mask=scene.mask), white="highlights"))
    cosine = prepared.white @ light / np.linalg.norm(prepared.white) / np.linalg.norm(light)
    assert np.degrees(np.arccos(cosine)) < 2.5
    assert "highlights (confidence" in prepared.white_source


@pytest.mark.parametrize(
    "white", [(0, 1, 1), (1, -1, 1), (np.nan, 1, 1), (1.0,), (1, 1, 1, 1), "D65x", "moonlight", ""]
)
def test_bad_whites(product, white):
    with pytest.raises(WhiteError):
        prepare(Picture(product().image), Recipe(one(), white=white))


@pytest.mark.parametrize("white", [(-1, 3), (96, 3), (np.nan, 3.0), (3.0, np.inf)])
def test_white_pixels_outside(product, white):
    with pytest.raises(DyehouseError, match="White"):
        prepare(Picture(product().image), Recipe(one(), white=white))


@pytest.mark.parametrize("gray", [0, -0.1, 1.1, np.nan, 18])
def test_bad_gray(product, gray):
    with pytest.raises(RecipeError, match=r"a grey card has 0\.18"):
        prepare(Picture(product().image), Recipe(one(), white=(3, 3), gray=gray))


def test_white_equal_to_the_reference(product):
    scene = product(noise=0)
    for recipe in (
        Recipe(one(reference=tuple(scene.body)), white=tuple(scene.body)),
        Recipe(one(reference=scene.matte), white=scene.matte),
    ):
        with pytest.raises(DyehouseError, match="the same color"):
            prepare(Picture(scene.image), recipe)


def test_a_balanced_photo_of_a_white_product_is_no_error():
    # W = (1, 1, 1) is then assumed and not given, and the product may well have that color.
    prepared = prepare(Picture(np.full((9, 9, 3), 1.5, np.float32)), Recipe(one(reference=(1.0, 1.0, 1.0))))
    assert prepared.analyses[0].model == "body"


# --- the new light --------------------------------------------------------------------------------------------


def test_no_illuminant_leaves_the_light(product):
    prepared = prepare(Picture(product().image), Recipe(one(), white=(0.9, 1.0, 0.7)))
    np.testing.assert_array_equal(prepared.target_white, prepared.white)


@pytest.mark.parametrize("space", ["srgb", "prophoto"])
def test_illuminant_by_name_keeps_the_luminance(product, space):
    recipe = Recipe(one(), white=(0.5, 0.6, 0.4), illuminant="A")
    prepared = prepare(Picture(product().image), recipe, space=SPACES[space])
    luminance = SPACES[space].to_xyz[1]
    assert prepared.target_white @ luminance == pytest.approx(luminance @ [0.5, 0.6, 0.4], rel=1e-9)
    xyz = SPACES[space].to_xyz @ prepared.target_white
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), XY["A"], atol=5e-4)


def test_illuminant_by_rgb_is_taken_as_it_is(product):
    prepared = prepare(Picture(product().image), Recipe(one(), illuminant=(1.2, 0.9, 0.5)))
    np.testing.assert_array_equal(prepared.target_white, [1.2, 0.9, 0.5])


@pytest.mark.parametrize("bad", ["moonlight", (0, 1, 1), (1, 1), (np.nan, 1, 1)])
def test_bad_illuminants(product, bad):
    with pytest.raises(WhiteError):
        prepare(Picture(product().image), Recipe(one(), illuminant=bad))


def test_no_target_and_a_new_light_is_von_kries(product):
    scene = product(white=(0.9, 1.0, 0.7), noise=0.01)
    new = np.array([1.2, 0.9, 0.5])
    recipe = Recipe((Region(),), white=(0.9, 1.0, 0.7), illuminant=tuple(new))
    prepared = prepare(Picture(scene.image), recipe)
    np.testing.assert_allclose(prepared.target(), prepared.analyses[0].reference * new / scene.white, rtol=1e-9)
    result, _ = recolor(Picture(scene.image), prepared.regions())
    np.testing.assert_allclose(result, scene.image * new / scene.white, atol=1e-5)


# --- what the target means ------------------------------------------------------------------------------------


def test_meaning_reference(product):
    prepared = prepare(Picture(product().image), Recipe(one(RGB)))
    np.testing.assert_allclose(prepared.target(), [0.06, 0.14, 0.42])
    hexed = prepare(Picture(product().image), Recipe(one(RED)))
    np.testing.assert_allclose(hexed.target(), SRGB.curve.decode(np.array([0xA0, 0x28, 0x18]) / 255), atol=1e-9)
    other = prepare(Picture(product().image), Recipe(one(RED))).target(0, RGB)
    np.testing.assert_allclose(other, [0.06, 0.14, 0.42])


def test_meaning_product_with_the_white_read_at_the_reference(product):
    # A grey dye of reflectance 0.25 under any light reads 0.25 of the white.
    white = (0.5, 0.6, 0.3)
    region = one(grey(0.25, "grey"), meaning="product")
    prepared = prepare(Picture(product().image), Recipe(region, white=white))
    np.testing.assert_allclose(prepared.target(), 0.25 * np.array(white), rtol=1e-3)
    relit = prepare(Picture(product().image), Recipe(region, white=white, illuminant=(1.2, 0.9, 0.5)))
    np.testing.assert_allclose(relit.target(), 0.25 * np.array([1.2, 0.9, 0.5]), rtol=1e-3)


def test_meaning_product_with_a_source_takes_the_exposure_from_it(product):
    # The product is a grey of 0.5 and reads 0.5 W x exposure; a dye of 0.2 must read 0.2 W x exposure.
    white = np.array([0.9, 1.0, 0.7])
    for exposure in (1.0, 0.3, 2.5):
        image = np.tile((0.5 * white * exposure).astype(np.float32), (20, 20, 1))
        region = one(grey(0.2, "new"), meaning="product", source=grey(0.5, "old"))
        prepared = prepare(Picture(image), Recipe(region, white=tuple(white)))
        np.testing.assert_allclose(prepared.target(), 0.2 * white * exposure, rtol=2e-3)


def test_source_equal_to_target_keeps_the_picture(product):
    scene = product(noise=0.002)
    cloth = Swatch.from_linear(scene.body) if hasattr(Swatch, "from_linear") else parse_target("rgb(0.42,0.09,0.05)")
    region = one(cloth, meaning="product", source=cloth, reference=tuple(0.6 * scene.body))
    prepared = prepare(Picture(scene.image), Recipe(region))
    np.testing.assert_allclose(prepared.target(), 0.6 * scene.body, rtol=1e-6)
    result, _ = recolor(Picture(scene.image), prepared.regions())
    np.testing.assert_allclose(result, scene.image, atol=1e-5)


def test_unknown_meaning(product):
    with pytest.raises(RecipeError, match="'shade' is not known: use one of reference, product"):
        prepare(Picture(product().image), Recipe(one(meaning="shade")))


# --- masks ----------------------------------------------------------------------------------------------------


def test_masks_of_every_kind(product):
    scene = product(size=200, noise=0.001)
    picture, files = Picture(scene.image), {"ball.png": (scene.mask * 255).astype(np.uint8)}
    x, y = scene.matte
    alpha = (scene.mask * 65535).astype(np.uint16)
    for region in (
        one(mask=scene.mask),
        one(mask="ball.png"),
        one(mask="alpha"),
        one(click=(x, y)),
        one(mask="click", reference=(x, y)),
        one(mask="click", click=(x, y), reference=tuple(scene.body)),
    ):
        prepared = prepare(picture, Recipe(region), alpha=alpha, read_mask=files.__getitem__)
        covered = prepared.analyses[0].mask
        top = np.iinfo(covered.dtype).max if covered.dtype.kind == "u" else 1
        assert np.abs(covered / top - scene.mask).mean() < 0.01
    assert prepare(picture, Recipe(one()), alpha=alpha).analyses[0].mask is None


def test_alpha_masks_whatever_shows(product):
    alpha = np.zeros((96, 96), np.uint8)
    alpha[10:50, 10:50], alpha[10:50, 50:60] = 255, 1
    mask = prepare(Picture(product().image), Recipe(one(mask="alpha")), alpha=alpha).analyses[0].mask
    np.testing.assert_array_equal(mask > 0, alpha > 0)
    assert len(np.unique(mask)) == 2


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ({"mask": "alpha"}, "has no alpha"),
        ({"mask": "click"}, "needs a pixel"),
        ({"mask": "click", "reference": (0.4, 0.1, 0.1)}, "needs a pixel"),
        ({"mask": "ball.png"}, "cannot be read here"),
        ({"mask": np.ones((5, 5))}, "picture's size"),
        ({"mask": np.zeros((96, 96))}, "selects nothing"),
    ],
)
def test_bad_masks(product, region, words):
    with pytest.raises(MaskError, match=words):
        prepare(Picture(product().image), Recipe(one(**region)))


def test_empty_alpha(product):
    with pytest.raises(MaskError, match="selects nothing"):
        prepare(Picture(product().image), Recipe(one(mask="alpha")), alpha=np.zeros((96, 96), np.uint8))


@pytest.mark.parametrize("click", [(500, 3), (-1, 3), (np.nan, 3), (3, np.inf)])
def test_bad_clicks(product, click):
    with pytest.raises(ReferenceColorError, match="Click"):
        prepare(Picture(product().image), Recipe(one(click=click)))


# --- several regions, and what else may be wrong ---------------------------------------------------------------


def test_two_regions_in_one_pass(product):
    first, second = product((0.42, 0.09, 0.05), noise=0), product((0.05, 0.12, 0.45), noise=0)
    image = np.concatenate([first.image, second.image], axis=1)
    left = np.concatenate([first.mask, 0 * second.mask], axis=1)
    right = np.concatenate([0 * first.mask, second.mask], axis=1)
    green, yellow = (parse_target(t) for t in ("rgb(0.05,0.3,0.1)", "rgb(0.5,0.4,0.02)"))
    recipe = Recipe(
        (
            Region(green, reference=tuple(first.body), mask=left),
            Region(yellow, reference=tuple(second.body), mask=right),
        )
    )
    prepared = prepare(Picture(image), recipe)
    result, _ = recolor(Picture(image), prepared.regions())
    a, b = (result[:, :96], first), (result[:, 96:], second)
    for (ours, scene), target in ((a, (0.05, 0.3, 0.1)), (b, (0.5, 0.4, 0.02))):
        inside = scene.mask == 1
        np.testing.assert_allclose(ours[inside], scene.in_color(np.array(target), scene.white)[inside], atol=1e-5)
        np.testing.assert_array_equal(ours[~inside], scene.image[~inside])
    # Another colorway, without looking at the photo again.
    swapped, _ = recolor(Picture(image), prepared.regions([yellow, None]))
    inside = first.mask == 1
    wanted = first.in_color(np.array((0.5, 0.4, 0.02)), first.white)
    np.testing.assert_allclose(swapped[:, :96][inside], wanted[inside], atol=1e-5)
    np.testing.assert_array_equal(swapped[:, 96:], result[:, 96:])


def test_warnings_name_their_region_where_there_are_several(product):
    dull = product((0.4, 0.4, 0.4))
    regions = (Region(RED, reference=(0.4, 0.1, 0.05)), Region(RED, mask=dull.mask))
    prepared = prepare(Picture(dull.image), Recipe(regions))
    assert any(w.startswith("Region 2: ") for w in prepared.warnings)
    assert all(w.startswith(("Region 1: ", "Region 2: ")) for w in prepared.warnings)
    single = prepare(Picture(dull.image), Recipe(regions[1:]))
    assert not any(w.startswith("Region") for w in single.warnings)


def test_number_of_targets_must_match(product):
    prepared = prepare(Picture(product().image), Recipe(one()))
    with pytest.raises(RecipeError, match="2 targets are given for 1 regions"):
        prepared.regions([RED, RED])
    with pytest.raises(RecipeError, match="2 targets are given for 1 regions"):
        with_target(Recipe(one()), RED, RED)
    assert with_target(Recipe(one()), RGB).regions[0].target is RGB


def test_recipes_without_region_target_or_light(product):
    picture = Picture(product().image)
    with pytest.raises(RecipeError, match="no region"):
        prepare(picture, Recipe(()))
    with pytest.raises(TargetError, match="no target color and no new illuminant"):
        prepare(picture, Recipe())
    with pytest.raises(TargetError, match="Residual rule"):
        prepare(picture, Recipe(one(residual="most"))).regions()


def test_unknown_adaptation_is_an_error_for_the_user(product):
    with pytest.raises(DyehouseError, match="'vonkries' is not known"):
        prepare(Picture(product().image), Recipe(one(parse_target("lab(50,30,20)")), adaptation="vonkries")).target()


def test_eight_bit_pictures_too(product):
    scene = product(noise=0.001)
    codes = transfer.encode(scene.image, transfer.SRGB, np.uint8)
    prepared = prepare(Picture(codes, transfer.SRGB), Recipe(one(RGB, mask=scene.mask, reference=tuple(scene.body))))
    result, _ = recolor(Picture(codes, transfer.SRGB), prepared.regions())
    wanted = scene.in_color(np.array([0.06, 0.14, 0.42]), scene.white)
    inside = (scene.mask == 1) & (wanted.max(axis=-1) < 0.9)
    assert np.abs(result - wanted)[inside].max() < 0.03


# --- colorways ------------------------------------------------------------------------------------------------


def test_a_colorway_is_a_recipe_with_its_targets(product):
    first, second = product((0.42, 0.09, 0.05)), product((0.05, 0.12, 0.45))
    picture = Picture(np.concatenate([first.image, second.image], axis=1))
    left = np.concatenate([first.mask, 0 * second.mask], axis=1)
    right = np.concatenate([0 * first.mask, second.mask], axis=1)
    navy = Colorway("navy", (RGB, None))
    recipe = Recipe((Region(RED, mask=left), Region(RED, mask=right)), colorways=(navy,))
    prepared = prepare(picture, recipe).for_colorway(navy)
    alone = prepare(picture, with_colorway(recipe, navy))
    assert [r.target for r in prepared.recipe.regions] == [RGB, None]
    result, _ = recolor(picture, prepared.regions())
    np.testing.assert_array_equal(result, recolor(picture, alone.regions())[0])
    # A region without a target stays as it is to the last bit.
    np.testing.assert_array_equal(result[:, 96:], second.image)
    assert np.abs(result[:, :96] - first.image).max() > 0.1


def test_a_recipe_may_leave_its_targets_to_colorways(product):
    scene = product()
    recipe = Recipe((Region(reference=scene.matte),), colorways=(Colorway("red", (RED,)),))
    prepared = prepare(Picture(scene.image), recipe)
    result, _ = recolor(Picture(scene.image), prepared.for_colorway(recipe.colorways[0]).regions())
    wanted, _ = recolor(Picture(scene.image), prepare(Picture(scene.image), with_target(recipe, RED)).regions())
    np.testing.assert_array_equal(result, wanted)


def test_a_colorway_that_does_not_fit(product):
    recipe = Recipe(one(), colorways=(Colorway("navy", (RED, RED)),))
    with pytest.raises(RecipeError, match="Colorway 'navy': 2 targets are given for 1 regions"):
        prepare(Picture(product().image), recipe)


def test_warnings_name_a_region_by_its_name(product):
    dull = product((0.4, 0.4, 0.4))
    regions = (Region(RED, reference=(0.4, 0.1, 0.05)), Region(RED, mask=dull.mask, name="lid"))
    prepared = prepare(Picture(dull.image), Recipe(regions))
    assert any(w.startswith("Region 'lid': ") for w in prepared.warnings)
    assert all(w.startswith(("Region 1: ", "Region 'lid': ")) for w in prepared.warnings)


def test_more_clicks_make_one_region():
    image = np.full((100, 150, 3), [0.2, 0.25, 0.5], np.float32)
    image[:, :50], image[:, 100:] = [0.5, 0.1, 0.05], [0.5, 0.3, 0.05]
    red, blue, yellow = (20, 50), (75, 50), (130, 50)

    def covered(**clicks):
        mask = prepare(Picture(image), Recipe(one(**clicks))).analyses[0].mask
        return [mask[y, x] == 255 for x, y in (red, blue, yellow)]

    assert covered(click=red) == [True, False, False]
    assert covered(click=red, added=(yellow,)) == [True, False, True]
    assert covered(reference=red, mask="click", added=(blue, yellow), removed=(blue,)) == [True, False, True]
