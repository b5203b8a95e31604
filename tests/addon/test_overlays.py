"""Maps over the picture: the core's numbers in perceptually ordered colors."""

import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from dyehouse.addon import background, overlays, preview
from dyehouse.core import gamut, recolor
from dyehouse.core.colorimetry import linear_to_lab
from dyehouse.core.colorspace import SRGB
from dyehouse.core.transfer import decode

pytestmark = pytest.mark.usefixtures("blender")


@pytest.fixture
def photo(coffee_file: Path) -> bpy.types.Image:
    image = bpy.data.images.load(str(coffee_file))
    region = image.dyehouse.regions.add()
    region.click, region.target.color, region.model = (150, 220), (0.02, 0.1, 0.3), "dichromatic"
    return image


def until[T](ask: object) -> T:
    """What a function gives once it gives something and nothing is at work."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        found = ask()
        if found is not None and not background.busy():
            return found
        time.sleep(0.01)
    raise TimeoutError


def settled(image: bpy.types.Image) -> preview.Shown:
    return until(lambda: preview.shown(image)[0])


def made(kind: str, image: bpy.types.Image) -> overlays.Map:
    return until(lambda: overlays.map_of(kind, 0, preview.shown(image)[0]))


def test_the_colors_are_viridis() -> None:
    # matplotlib's viridis at 0, 1/4, 1/2, 3/4 and 1.
    known = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]) / 255
    np.testing.assert_allclose(overlays.viridis(np.linspace(0, 1, 5)), known, atol=0.03)
    np.testing.assert_array_equal(overlays.viridis(np.array([-1.0, 2.0])), overlays.viridis(np.array([0.0, 1.0])))


def test_the_colors_are_ordered_by_lightness() -> None:
    codes = overlays.viridis(np.linspace(0, 1, 100))
    lightness = linear_to_lab(decode(codes.astype(np.float32), SRGB.curve), SRGB)[:, 0]
    steps = np.diff(lightness)
    assert steps.min() > 0
    assert steps.max() < 3 * np.median(steps)


@pytest.mark.parametrize("kind", ["A", "B", "RESIDUAL", "ERROR"])
def test_a_map_is_the_numbers_of_the_core(photo: bpy.types.Image, kind: str) -> None:
    now = settled(photo)
    prepared = now.look.prepared
    analysis = prepared.analyses[0]
    values = {
        "A": lambda: analysis.A,
        "B": lambda: analysis.B,
        "RESIDUAL": lambda: analysis.residual,
        "ERROR": lambda: analysis.predicted_error(prepared.target(0), prepared.target_white),
    }[kind]()
    colors = made(kind, photo).colors
    expected = decode(overlays.viridis(values / overlays.SCALES[kind].top), SRGB.curve)
    np.testing.assert_allclose(colors[..., :3], expected, atol=1e-5)
    np.testing.assert_allclose(colors[..., 3], analysis.mask / 255, atol=1e-6)
    assert np.ptp(values[analysis.mask > 0]) > 0


def test_out_of_gamut(photo: bpy.types.Image) -> None:
    photo.dyehouse.regions[0].target.text = "rgb(1, -0.2, 0.9)"
    now = settled(photo)
    found = made("GAMUT", photo)
    regions = now.look.prepared.regions()
    expected = gamut.out_of_gamut(recolor.recolor(now.look.prepared.analyses[0].picture, regions)[0])
    expected &= now.look.prepared.analyses[0].mask > 0
    marked = found.colors[..., 3] > 0
    assert expected.mean() > 0.05
    assert (marked != expected).mean() < 1e-4
    share = np.count_nonzero(expected) / np.count_nonzero(now.look.prepared.analyses[0].mask)
    assert found.words == f"{share:.1%} of the product outside sRGB"


def test_out_of_the_gamut_of_the_files(photo: bpy.types.Image) -> None:
    photo.dyehouse.regions[0].target.text = "color(display-p3 0.0 0.75 0.3)"
    shares = {}
    for space in ("PHOTO", "display-p3", "rec2020"):
        photo.dyehouse.output_space = space
        settled(photo)
        shares[space] = float(made("GAMUT", photo).words.split("%")[0])
    assert shares["PHOTO"] > 20 + shares["display-p3"]
    assert shares["display-p3"] >= shares["rec2020"]
    assert made("GAMUT", photo).words.endswith("outside Rec.2020")


def test_only_maps_of_the_target_follow_it(photo: bpy.types.Image) -> None:
    settled(photo)
    before = {kind: made(kind, photo) for kind in ("A", "ERROR")}
    photo.dyehouse.regions[0].target.color = (0.5, 0.02, 0.02)
    assert overlays.map_of("A", 0, settled(photo)) is before["A"]
    after = made("ERROR", photo)
    assert np.abs(after.colors - before["ERROR"].colors).max() > 0.05


def test_the_maps_of_a_large_photo_are_every_so_many_pixels(photo: bpy.types.Image) -> None:
    analysis = settled(photo).look.prepared.analyses[0]
    small = analysis.thinned(3)
    np.testing.assert_allclose(small.A, analysis.A[::3, ::3], atol=1e-6)
    np.testing.assert_allclose(small.B, analysis.B[::3, ::3], atol=1e-6)
    np.testing.assert_allclose(small.residual, analysis.residual[::3, ::3], atol=1e-6)
    assert analysis.thinned(1) is analysis


def test_clicking_shows_the_region(photo: bpy.types.Image) -> None:
    assert preview.overlay_of(photo) == "NONE"
    preview.selecting.add(photo.session_uid)
    assert preview.overlay_of(photo) == "REGION"
