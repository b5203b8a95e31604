"""The laboratory measures everything else, so it is measured against what must hold of any picture."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse import sample_blends
from dyehouse.benchmarks import laboratory
from dyehouse.benchmarks.laboratory import BANDS, Settings, measure, render, view
from dyehouse.core import spectra
from dyehouse.sample_blends import make_scenes

QUICK = Settings(size=64, samples=24)
GREEN = (0.061, 0.296, 0.067)
RED = (0.429, 0.037, 0.045)
SCENES = list(make_scenes.SCENES)
BLENDS = Path(sample_blends.__file__).parent


@pytest.fixture(scope="session", autouse=True)
def _cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("DYEHOUSE_CACHE", str(tmp_path_factory.mktemp("renders")))
        yield


def around(picture, pixel):
    x, y = pixel
    return picture[y - 2 : y + 3, x - 2 : x + 3].mean(axis=(0, 1))


# --- scenes
@pytest.mark.parametrize("name", SCENES)
def test_the_blend_file_holds_what_the_script_builds(name):
    built = laboratory.fingerprint(make_scenes.build(name))
    path = BLENDS / f"{name}.blend"
    assert path.stat().st_size < 400_000
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert laboratory.fingerprint(bpy.context.scene) == built
    assert tuple(bpy.context.scene["dye"]) == tuple(make_scenes.build(name)["dye"])


@pytest.mark.parametrize("name", SCENES)
def test_only_the_product_takes_the_dye(name):
    what = view(name, QUICK)
    change = render(name, RED, settings=QUICK) - render(name, GREEN, settings=QUICK)
    assert 0.05 < what.interior.mean() < 0.9
    x, y = what.reference
    assert what.interior[y, x]
    assert np.median(change[what.interior][:, 0]) > 0.02
    assert np.median(change[what.interior][:, 1]) < -0.02
    # Elsewhere there is only the light that the product throws on its surroundings.
    product, elsewhere = (np.abs(np.median(change[where], axis=0)).max() for where in (what.interior, what.mask == 0))
    assert elsewhere < 0.12 * product


@pytest.mark.parametrize("name", SCENES)
def test_masks_share_every_pixel_out(name):
    masks = view(name, QUICK).masks
    np.testing.assert_allclose(sum(masks.values()), 1.0, atol=2e-3)


def test_the_sneaker_has_two_colors_of_its_own():
    what = view("sneaker", QUICK)
    before = render("sneaker", GREEN, settings=QUICK)
    after = render("sneaker", GREEN, settings=QUICK, colors={"sole": RED})
    sole = what.masks["Sole"] > 0.999
    assert np.median((after - before)[sole][:, 1]) < -0.1
    assert np.median(np.abs(after - before)[what.interior]) < 0.01


# --- light
def test_a_white_diffuser_that_faces_the_key_light_is_0_9():
    scene = make_scenes.new_scene("card")
    card = np.array([[[x, 0.0, z] for z in (-5.0, 5.0)] for x in (-5.0, 5.0)])
    white = make_scenes.new_material(make_scenes.PRODUCT, make_scenes.matte)
    make_scenes.add_grid("Card", card, white)
    make_scenes.add_sun(scene, (0.0, -3.0, 0.0))
    make_scenes.add_camera(scene, (1.0, -4.0, 1.0), (0.0, 0.0, 0.0))
    properties = {"dye": (1.0, 0.5, 0.0), "diffuser": 0.0}
    light = laboratory._render(scene, properties, Settings(size=16, samples=16)).light["key"]
    np.testing.assert_allclose(light.mean(axis=(0, 1)), (0.9, 0.45, 0.0), rtol=2e-3)


def test_one_light_colors_the_whole_picture():
    neutral = render("mug", GREEN, settings=QUICK)
    tungsten = render("mug", GREEN, (1.35, 1.0, 0.55), settings=QUICK)
    np.testing.assert_allclose(tungsten, neutral * (1.35, 1.0, 0.55), rtol=1e-5)
    np.testing.assert_allclose(view("mug", QUICK).white((1.35, 1.0, 0.55)), (1.35, 1.0, 0.55), rtol=1e-6)


def test_two_lights_color_it_differently_from_place_to_place():
    white = render("two_lights", GREEN, settings=QUICK, diffuser=True)
    ratio = (white[..., 0] / white[..., 2])[view("two_lights", QUICK).interior]
    assert np.percentile(ratio, 95) > 2 * np.percentile(ratio, 5)
    mixed = render("mug_mixed", GREEN, settings=QUICK, diffuser=True)
    what = view("mug_mixed", QUICK)
    ratio = (mixed[..., 0] / mixed[..., 2])[what.interior]
    assert np.percentile(ratio, 95) < 1.3 * np.percentile(ratio, 5)
    red, _, blue = what.white()
    assert np.median(ratio) == pytest.approx(red / blue, rel=0.1)


def test_every_light_group_needs_a_color():
    with pytest.raises(ValueError, match="fill"):
        render("two_lights", GREEN, {"key": (1, 1, 1)}, settings=QUICK)


# --- color
def test_body_light_is_proportional_to_a_small_reflectance():
    once, twice = (render("folds", (r, r, r), settings=QUICK) for r in (0.01, 0.02))
    ratio = (twice / once)[view("folds", QUICK).interior]
    assert np.median(ratio) == pytest.approx(2.0, rel=0.01)


def test_gloss_is_the_same_whatever_the_dye():
    gloss = render("mug", (0, 0, 0), settings=QUICK)
    inside = view("mug", QUICK).interior
    body = [(render("mug", (r, r, r), settings=QUICK) - gloss)[inside] / r for r in (0.05, 0.1)]
    assert np.median(body[1] / body[0]) == pytest.approx(1.0, rel=0.02)
    assert np.percentile(gloss[inside], 99) > 10 * np.median(gloss[inside])


def test_deep_folds_are_more_saturated_than_their_ridges():
    def spread(depth):
        picture = render("folds", RED, settings=QUICK, depth=depth)[view("folds", QUICK, depth=depth).interior]
        saturation = picture[:, 0] / picture[:, 1]
        return np.percentile(saturation, 95) / np.percentile(saturation, 5)

    assert spread(0.16) > 1.3 * spread(0.01)


# --- spectra
@pytest.fixture(scope="module")
def blue():
    curve = spectra.chart("BabelColor Average")["blue"].at(BANDS)
    return curve, measure("folds", curve, QUICK, depth=0.01)


def test_a_flat_cloth_shows_the_reflectance_it_was_given(blue):
    curve, cloth = blue
    factor = around(cloth.factors(), view("folds", QUICK, depth=0.01).reference)
    np.testing.assert_allclose(factor / factor.mean(), curve / curve.mean(), rtol=0.06)


def test_what_a_sensor_sees_is_the_integral_of_11(blue):
    curve, cloth = blue
    reflectance = spectra.Spectrum(BANDS, curve)
    for sensor, light, true in (
        ("1931", "D65", spectra.to_xyz("D65", reflectance)),
        ("Nikon 5100", "A", spectra.to_camera("A", reflectance, "Nikon 5100")),
    ):
        seen = around(cloth.seen_by(sensor, light), view("folds", QUICK, depth=0.01).reference)
        np.testing.assert_allclose(seen / seen.sum(), true / true.sum(), atol=0.01)
    np.testing.assert_allclose(cloth.white("1931", "A"), spectra.to_xyz("A"), rtol=1e-3)


def test_the_white_tile_is_read_once_or_at_every_pixel():
    cloth = measure("fabric_cylinder", np.full(31, 0.3), QUICK)
    what = view("fabric_cylinder", QUICK)
    once, everywhere = (f[what.interior].mean(axis=1) for f in (cloth.factors(at=what.reference), cloth.factors()))
    x, y = what.reference
    np.testing.assert_allclose(cloth.factors(at=what.reference)[y, x], cloth.factors()[y, x], rtol=1e-5)
    # The shape is in the one and not in the other.
    assert once.std() / once.mean() > 2 * everywhere.std() / everywhere.mean()


def test_a_gray_scene_measures_gray_and_agrees_with_rgb():
    gray = measure("mug", np.full(31, 0.3), QUICK)
    radiance = gray.radiance["key"]
    np.testing.assert_allclose(radiance, radiance[..., :1] * np.ones(31), rtol=1e-4)
    np.testing.assert_allclose(radiance[..., :3], render("mug", (0.3,) * 3, settings=QUICK), rtol=1e-4)


@pytest.mark.parametrize("rgb", [(0.5, 0.5, 0.5), (0.75, 0.30, 0.06), (0.07, 0.25, 0.60)])
def test_made_up_spectra_are_reflectances_of_that_color(rgb):
    curve = laboratory.uplift(rgb)
    assert min(rgb) - 1e-9 <= curve.min() <= curve.max() <= max(rgb) + 1e-9
    assert curve[-1] == pytest.approx(rgb[0], abs=0.01)
    assert curve[0] == pytest.approx(rgb[2], abs=0.01)


@pytest.mark.parametrize("wrong", [(0.5, 0.5), np.full(31, 0.5)])
def test_rgb_takes_three_numbers(wrong):
    with pytest.raises(ValueError, match="three"):
        render("mug", wrong, settings=QUICK)


def test_spectra_take_31():
    with pytest.raises(ValueError, match="31"):
        measure("mug", (0.1, 0.2, 0.3), QUICK)


# --- cache
def files():
    return {path: path.stat().st_mtime_ns for path in laboratory.cache_folder().iterdir()}


def test_a_picture_is_rendered_once(monkeypatch, tmp_path):
    monkeypatch.setenv("DYEHOUSE_CACHE", str(tmp_path / "new" / "folder"))
    first = render("folds", GREEN, settings=QUICK)
    kept = files()
    again = render("folds", GREEN, (2.0, 1.0, 1.0), settings=Settings(QUICK.size, QUICK.samples, threads=2))
    assert len(kept) == 1
    assert files() == kept
    np.testing.assert_array_equal(again[..., 1:], first[..., 1:])
    for other in (
        {"reflectance": RED},
        {"settings": Settings(QUICK.size, QUICK.samples, seed=1)},
        {"settings": Settings(QUICK.size, 8)},
        {"depth": 0.05},
        {"diffuser": True},
    ):
        before = len(files())
        render(**{"scene": "folds", "reflectance": GREEN, "settings": QUICK} | other)
        assert len(files()) == before + 1


def test_a_fingerprint_follows_the_content_and_nothing_else():
    def of(name, change=None, **parameters):
        scene = make_scenes.build(name, **parameters)
        if change:
            change()
        return laboratory.fingerprint(scene)

    def move():
        bpy.data.objects["Key"].rotation_euler.x += 0.01

    def roughen():
        node = bpy.data.materials["Product"].node_tree.nodes["Principled BSDF"]
        node.inputs["Roughness"].default_value += 0.01

    def retouch():
        bpy.data.meshes["Mug"].vertices[0].co.z += 0.001

    def recolor():
        bpy.context.scene["dye"] = RED

    plain = of("mug")
    assert plain == of("mug") == of("mug", recolor) == of("near_white")
    assert len({plain, of("mug", move), of("mug", roughen), of("mug", retouch), of("mug", table=0.5)}) == 5


def test_the_contact_sheet_shows_every_scene(tmp_path):
    sheet = tmp_path / "sheet.png"
    laboratory.contact_sheet(["mug", "folds"], Settings(size=32, samples=4), sheet)
    image = bpy.data.images.load(str(sheet))
    assert tuple(image.size) == (32 * 6, 32)
