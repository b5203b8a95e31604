import numpy as np
import pytest

from dyehouse.benchmarks.camera import Camera, tone

GRAY = np.full((200, 200, 3), 0.25)
RAMP = np.broadcast_to(np.linspace(0, 1, 4096)[None, :, None], (4, 4096, 3))
IDEAL = {"electrons": np.inf}


@pytest.mark.parametrize(
    ("bits", "dtype", "levels"), [(8, np.uint8, 256), (12, np.uint16, 4096), (16, np.uint16, 4096)]
)
def test_bits_are_the_number_of_levels(bits, dtype, levels):
    codes = Camera(bits=bits, curve="linear", **IDEAL).shoot(RAMP)
    assert codes.dtype == dtype
    assert len(np.unique(codes)) == levels
    assert codes.max() == np.iinfo(dtype).max


@pytest.mark.parametrize("curve", ["linear", "srgb"])
@pytest.mark.parametrize("exposure", [0.5, 1.0])
def test_a_noiseless_picture_is_the_scene_up_to_its_steps(curve, exposure):
    camera = Camera(bits=16, curve=curve, exposure=exposure, **IDEAL)
    np.testing.assert_allclose(camera.photograph(RAMP), RAMP, atol=4e-5)


def test_noise_has_the_variance_of_counted_electrons_and_reading():
    camera = Camera(electrons=2000.0, read_noise=20.0, seed=3)
    noise = camera.expose(GRAY) - GRAY
    expected = np.sqrt(0.25 * 2000 + 20**2) / 2000
    assert noise.std() == pytest.approx(expected, rel=0.01)
    assert abs(noise.mean()) < 4 * expected / np.sqrt(noise.size)


def test_more_light_is_less_relative_noise():
    def relative(exposure):
        return Camera(exposure=exposure, curve="linear", bits=16).photograph(GRAY).std()

    assert relative(2.0) < 0.8 * relative(1.0)


def test_the_same_seed_takes_the_same_picture():
    np.testing.assert_array_equal(Camera(seed=1).shoot(GRAY), Camera(seed=1).shoot(GRAY))
    assert np.any(Camera(seed=1).shoot(GRAY) != Camera(seed=2).shoot(GRAY))


def test_light_beyond_the_range_is_clipped():
    codes = Camera(exposure=2.0, **IDEAL).shoot(np.array([[[0.6, 0.4, -0.02]]]))
    assert codes[0, 0, 0] == 255
    assert 200 < codes[0, 0, 1] < 255
    assert codes[0, 0, 2] == 0


def test_a_tone_curve_keeps_the_ends_and_breaks_proportion():
    np.testing.assert_allclose(tone(np.array([0.0, 0.5, 1.0])), [0.0, 0.5, 1.0])
    steps = tone(np.linspace(0, 1, 101))
    assert np.all(np.diff(steps) > 0)
    assert (steps[51] - steps[49]) / 0.02 == pytest.approx(1.35, rel=1e-3)
    dark, bright = Camera(curve="tone", **IDEAL).photograph(np.array([[[0.1], [0.2]]]) * np.ones(3))[0, :, 0]
    assert bright / dark > 2.2


def test_jpeg_costs_more_at_lower_quality():
    scene = np.random.default_rng(0).uniform(0.1, 0.6, (64, 64, 3))

    def error(quality):
        return np.abs(Camera(jpeg=quality, **IDEAL).photograph(scene) - scene).mean()

    assert error(30) > error(95) > np.abs(Camera(**IDEAL).photograph(scene) - scene).mean()


def test_jpeg_without_subsampling_keeps_fine_color():
    scene = np.full((64, 64, 3), (0.5, 0.1, 0.1))
    scene[:, ::2] = (0.1, 0.1, 0.5)

    def error(subsampling):
        return np.abs(Camera(jpeg=95, subsampling=subsampling, **IDEAL).photograph(scene) - scene).mean()

    assert error("4:4:4") < 0.2 * error("4:2:0")


@pytest.mark.parametrize("wrong", [{"bits": 10}, {"bits": 16, "jpeg": 90}])
def test_impossible_cameras_are_refused(wrong):
    with pytest.raises(ValueError, match="bits"):
        Camera(**wrong)
