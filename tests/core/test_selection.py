"""Which model a region gets, and what must hold whatever it is."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyehouse.core import analyze, mixture, transfer
from dyehouse.core.interreflection import bounced
from dyehouse.core.picture import Picture
from dyehouse.core.selection import choose, noise_across, steadied
from dyehouse.core.stability import Noise

WHITE = np.ones(3)
RED, PALE = np.array([0.43, 0.06, 0.1]), np.array([0.6, 0.45, 0.42])
TARGET = np.array([0.05, 0.3, 0.2])
TUNGSTEN = np.array([1.83, 0.86, 0.27])
MODELS = ("body", "dichromatic", "regularized", "bounce", "lights", "metal")


def scene(body, *, gloss=0.0, bounce=0.0, second=0.0, noise=0.0, size=96, seed=0):
    """Shading from top to bottom; a highlight at the left, a fold at the right, a lamp from below."""
    y, x = np.mgrid[:size, :size] / (size - 1)
    lamp = (second * y)[..., None]
    light = (0.35 + 0.5 * (1 - y))[..., None] + lamp * TUNGSTEN
    photo = light * body + gloss * np.exp(-(((x - 0.25) / 0.05) ** 2))[..., None]
    photo += bounce * np.exp(-(((x - 0.75) / 0.1) ** 2))[..., None] * bounced(body, 0.6)
    photo += np.random.default_rng(seed).normal(0, noise, photo.shape) if noise else 0
    return photo.astype(np.float32)


@pytest.mark.parametrize(
    ("model", "body", "parts"),
    [
        ("dichromatic", RED, {"gloss": 0.4}),
        ("dichromatic", RED, {"gloss": 0.4, "noise": 0.002}),
        ("dichromatic", RED, {}),
        ("bounce", RED, {"bounce": 1.0}),
        ("bounce", PALE, {"bounce": 0.5}),
        ("bounce", PALE, {"bounce": 0.5, "noise": 0.003}),
        ("bounce", PALE, {"bounce": 0.5, "gloss": 0.4}),
        ("regularized", PALE, {"gloss": 0.4, "noise": 0.01}),
        ("lights", RED, {"gloss": 0.4, "second": 0.6}),
        ("metal", RED, {"second": 0.6}),
        ("body", np.full(3, 0.4), {"gloss": 0.4, "noise": 0.004}),
    ],
)
def test_the_model_is_that_of_the_scene_whatever_the_seed(model, body, parts):
    for seed in range(4):
        photo = scene(body, seed=seed, **parts)
        top = photo[2, 48].astype(float) if "second" in parts else body
        evidence = choose(Picture(photo), top, WHITE, None)
        assert evidence.mixture.model == model, evidence.figures
        assert all(np.isfinite(value) for value in evidence.figures.values())


def test_plain_scenes_get_the_plain_models_pixels():
    photo = scene(RED, gloss=0.4, noise=0.002)
    auto, plain = (analyze(photo, WHITE, RED, None, model) for model in ("auto", "dichromatic"))
    assert auto.extra is None
    np.testing.assert_array_equal(auto.recolor(TARGET), plain.recolor(TARGET))


@pytest.mark.parametrize("model", MODELS)
def test_a_model_that_is_asked_for_is_taken(model):
    analysis = analyze(scene(RED, gloss=0.4), WHITE, RED, None, model)
    assert analysis.model == analysis.report["model"] == model
    assert analysis.mixture.model in mixture.MODELS


def test_what_is_not_explained_is_said():
    for parts in ({"gloss": 0.4, "second": 0.6}, {"second": 0.6}):
        photo = scene(RED, **parts)
        analysis = analyze(photo, WHITE, photo[2, 48].astype(float))
        assert any("more than one color" in text for text in analysis.warnings)
    assert analyze(scene(RED, gloss=0.4), WHITE, RED).warnings == ()


def test_texture_of_two_colors_is_no_noise():
    rng = np.random.default_rng(0)
    ground = rng.normal(0.3, 0.002, (90, 60, 3))
    cloth = np.where(rng.random((90, 60, 1)) < 0.5, RED, 0.5 * RED + 0.2) + rng.normal(0, 0.002, (90, 60, 3))
    photo = np.concatenate([ground, cloth], axis=1).astype(np.float32)
    mask = np.zeros((90, 120))
    mask[:, 60:] = 1
    noise = noise_across(Picture(photo), RED, WHITE)
    assert noise.at(np.array(0.4)) < 0.006


def rounded(codes):
    return Picture(np.clip(np.round(codes), 0, 255).astype(np.uint8), transfer.SRGB)


def test_rounding_to_codes_is_noise_and_what_compression_leaves_is_more():
    smooth = scene(RED, size=128)
    codes = 255 * transfer.SRGB.encode(smooth)
    # Blocks of 8 x 8 that keep no more than their mean, as a JPEG leaves of smooth colors.
    blocks = codes.reshape(16, 8, 16, 8, 3).mean(axis=(1, 3)).repeat(8, axis=0).repeat(8, axis=1)
    blocks += np.random.default_rng(0).choice([-1, 1], (16, 16, 1)).repeat(8, axis=0).repeat(8, axis=1)
    light = np.array(0.4)
    exact, stepped, flat = (
        noise_across(p, RED, WHITE).at(light) for p in (Picture(smooth), rounded(codes), rounded(blocks))
    )
    step = float(np.mean(np.diff(transfer.SRGB.decode(np.array([118.0, 119.0]) / 255))))
    assert exact < 1e-4
    assert 0.2 * step < stepped < 1.5 * step
    assert flat > 1.5 * stepped


@pytest.mark.parametrize("bits", [5, 8])
@pytest.mark.parametrize("curve", [transfer.SRGB, transfer.LINEAR], ids=["srgb", "linear"])
def test_codes_are_noise_in_a_float_picture_too(bits, curve):
    smooth = scene(RED, gloss=0.2, size=128)
    top = 2**bits - 1
    decoded = Picture(np.asarray(curve.decode(np.round(curve.encode(smooth) * top) / top), np.float32))
    light = np.array(0.45)
    step = np.diff(curve.decode(np.round(curve.encode(np.array([0.4])) * top + [[0], [1]]) / top), axis=0).item()
    assert noise_across(Picture(smooth), RED, WHITE).at(light) < 1e-4
    assert 0.1 * step < noise_across(decoded, RED, WHITE).at(light) < step
    assert choose(decoded, RED, WHITE, None).mixture.model not in ("lights", "metal")


@pytest.mark.parametrize("channel", range(3))
@pytest.mark.parametrize("error", [-0.3, -0.15, 0.15, 0.3])
def test_a_wrong_white_is_no_other_light_and_no_metal(channel, error):
    white = WHITE.copy()
    white[channel] += error
    for gloss in (0.4, 0.02):
        photo = scene(RED, gloss=gloss, size=128)
        photo += np.float32(gloss / 4) * np.linspace(0, 1, 128, dtype=np.float32)[:, None]
        evidence = choose(Picture(photo), RED, white, None)
        assert evidence.mixture.model in ("dichromatic", "bounce"), evidence.figures


def test_a_ground_of_one_code_is_no_compression():
    codes = 255 * transfer.SRGB.encode(scene(RED, size=128, noise=0.004))
    cut_out = np.concatenate([codes, np.full((128, 256, 3), 240.0)], axis=1)
    plain, with_ground = (noise_across(rounded(c), RED, WHITE).at(np.array(0.4)) for c in (codes, cut_out))
    assert with_ground == pytest.approx(plain, rel=0.2)


def test_noise_is_averaged_out_of_the_body_color_and_texture_is_not():
    rng = np.random.default_rng(1)
    noise = Noise(0.02, 0.0)
    flat = np.tile(0.7 * RED, (31, 31, 1)) + rng.normal(0, 0.02, (31, 31, 3))
    fibers = flat + 0.15 * (rng.random((31, 31, 1)) < 0.4)
    read = 0.7 * RED + [0.0, 0.012, -0.008]
    for photo, averaged in ((flat, True), (fibers, False)):
        steady, left = steadied(Picture(photo.astype(np.float32)), read, WHITE, None, (15, 15), noise)
        assert (np.abs(steady - 0.7 * RED).max() < 0.008) == averaged
        assert (left < 0.02 / np.linalg.norm(read) / 4) == averaged
        assert np.linalg.norm(steady - read) < 0.012 or averaged


def test_a_second_light_under_much_noise_is_not_modelled_but_flagged():
    photo = scene(RED, gloss=0.4, second=0.6, noise=0.03, size=160)
    analysis = analyze(photo, WHITE, photo[1:4, 70:90].mean(axis=(0, 1)).astype(float))
    assert analysis.model == "regularized"
    assert analysis.evidence.hidden
    assert analysis.predicted(TARGET).flagged
    one_light = analyze(scene(RED, gloss=0.4, noise=0.03, size=160), WHITE, 0.8 * RED)
    assert not one_light.evidence.hidden


@pytest.mark.slow
def test_looking_costs_little_beside_one_recolor():
    photo = np.tile(scene(RED, gloss=0.4, noise=0.002, size=200), (10, 10, 1))
    ratios = []
    for _ in range(9):
        spent = []
        for model in ("dichromatic", "auto"):
            start = time.perf_counter()
            analysis = analyze(photo, WHITE, RED, None, model)
            analysis.recolor(TARGET)
            spent.append(time.perf_counter() - start)
        ratios.append(spent[1] / spent[0])
    assert analysis.model == "dichromatic"
    assert np.median(ratios) <= 1.5


# --- what must hold for every model ---------------------------------------------------------------------------


def glossy_photo():
    return scene(PALE, gloss=0.3, bounce=0.3, noise=0.004)


@pytest.mark.parametrize("model", [*MODELS, "auto"])
@pytest.mark.parametrize("exposure", [0.25, 4.0])
def test_exposure_does_not_matter(model, exposure):
    photo = glossy_photo()
    one = analyze(photo, WHITE, PALE, None, model)
    other = analyze(photo * np.float32(exposure), WHITE * exposure, PALE * exposure, None, model)
    assert other.model == one.model
    np.testing.assert_allclose(other.recolor(exposure * TARGET) / exposure, one.recolor(TARGET), atol=2e-3)


@pytest.mark.parametrize("model", [m for m in (*MODELS, "auto") if m != "lights"])  # lamps know red from blue
@pytest.mark.parametrize("order", [[1, 2, 0], [2, 1, 0]])
def test_channels_may_be_permuted_with_the_white(model, order):
    photo, white = glossy_photo() * np.float32([1, 0.8, 0.5]), np.array([1, 0.8, 0.5])
    one = analyze(photo, white, PALE * white, None, model)
    other = analyze(np.ascontiguousarray(photo[..., order]), white[order], (PALE * white)[order], None, model)
    assert other.model == one.model
    np.testing.assert_allclose(other.recolor(TARGET[order]), one.recolor(TARGET)[..., order], atol=2e-3)


@settings(deadline=None, max_examples=25)
@given(
    st.sampled_from(MODELS),
    st.lists(st.floats(0.01, 0.9), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
)
def test_a_small_step_in_color_never_jumps(model, target, step):
    analysis = _cached(model)
    near = np.array(target) + 1e-4 * np.array(step)
    change = np.abs(analysis.recolor(near) - analysis.recolor(target)).max()
    assert change < 1e-4 * 60


def _cached(model, kept={}):  # noqa: B006, the analyses of the test above
    if model not in kept:
        kept[model] = analyze(scene(RED, gloss=0.3, bounce=0.3, noise=0.004), WHITE, RED, None, model)
    return kept[model]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("body", [RED, PALE], ids=["red", "pale"])
def test_darker_pixels_of_the_same_chroma_never_become_brighter(model, body):
    # Every column is one chroma, from a dark pixel to a bright one.
    chroma = scene(body, gloss=0.3, bounce=0.3)[48]
    photo = (np.linspace(0.1, 1, 90)[:, None, None] * chroma[None]).astype(np.float32)
    light = analyze(photo, WHITE, body, None, model).recolor(TARGET) @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    assert (np.diff(light, axis=0) > -1e-4).all()
