"""The ladder of models against renders of the product truly in the other color, case by case, at quick size.

The bars are what was measured, with a small margin. They may only be tightened.
"""

import numpy as np
import pytest

from dyehouse.benchmarks import ladder
from dyehouse.benchmarks.camera import Camera
from dyehouse.benchmarks.laboratory import Settings
from dyehouse.benchmarks.ladder import BEST, CASES, METALS, NEUTRAL, PALE, Case, in_bands, measure, trials
from dyehouse.benchmarks.speed_accuracy import difference
from dyehouse.core.neighborhood import dilate

from .quick import COLORS, FAST

BARS = {  # case: CIEDE2000 of "auto", median and 95th percentile over the pairs; and the model it takes
    "glossy mug": (0.13, 0.60, "dichromatic"),
    "fabric on a cylinder": (0.135, 0.43, "dichromatic"),
    "cloth in deep folds": (0.03, 0.19, "bounce"),
    "clipped highlights": (0.13, 0.65, "dichromatic"),
    "recolored into tungsten light": (0.13, 0.64, "dichromatic"),
    "metal, gray surroundings": (0.006, 1.15, "bounce"),
    "metal, colored surroundings": (0.19, 9.6, "metal"),
}
"""Those whose renders the other tests need too."""


@pytest.fixture(scope="module", autouse=True)
def _two_colors(shared_renders):
    shared_renders.setattr(ladder, "COLORS", COLORS)


@pytest.mark.parametrize("title", BARS)
def test_a_case_stays_within_its_bars(title):
    case = next(c for c in CASES if c.title == title)
    figures, taken = measure(case, FAST)
    median, high, model = BARS[title]
    assert figures["auto"][0] <= median
    assert figures["auto"][1] <= high
    assert set(taken) == {model}


def pale(scene, names, **options):
    colors = PALE | NEUTRAL
    return Case(scene, scene, sources={name: colors[name] for name in names}, **options)


def test_pale_folds_are_ruined_by_the_plain_model_and_not_by_auto():
    for camera, bars in ((None, (0.1, 0.6)), (Camera(), (0.3, 1.3))):
        figures, taken = measure(pale("folds", ["pink"], camera=camera), FAST)
        assert set(taken) == {"bounce"}
        assert figures["dichromatic"][1] > 20
        assert figures["auto"][0] <= bars[0]
        assert figures["auto"][1] <= bars[1]


@pytest.mark.slow
def test_folds_of_a_saturated_spectrum_are_not_taken_for_metal():
    figures = in_bands("folds", Settings(size=128, samples=64), ("yellow", "blue"))
    assert figures["auto"][0] < 0.8 * figures[BEST][0]
    assert figures["auto"][1] < 0.8 * figures[BEST][1]


@pytest.mark.parametrize(
    ("scene", "names"), [("mug", ["white", "gray", "black"]), ("fabric_cylinder", ["gray"])], ids=["mug", "fabric"]
)
def test_almost_gray_through_a_camera_is_never_worse_than_body_alone(scene, names):
    figures, _ = measure(pale(scene, names, camera=Camera()), FAST)
    assert figures["auto"][0] <= max(2.0, figures["body"][0] * 1.01)
    assert figures["auto"][1] <= min(9.0, figures["body"][1] * 1.01)
    # The plain model is far worse, or refuses.
    assert not figures["dichromatic"][1] <= 3 * figures["auto"][1]


def test_noise_costs_little_on_a_pale_mug_made_strong():
    exact, noisy = (measure(pale("mug", ["pink"], camera=c), FAST)[0] for c in (None, Camera()))
    assert noisy["auto"][0] < noisy["dichromatic"][0] / 2
    assert noisy["auto"][1] < noisy["dichromatic"][1] / 3
    assert noisy["auto"][1] < noisy["body"][1]
    assert exact["auto"][1] < exact["dichromatic"][1] / 5


def test_a_noisy_photo_is_not_blotchy():
    # Spatial noise beside that of a photo that the same camera takes of the true product.
    camera = Camera()
    trial = next(t for t in trials(pale("mug", ["pink"], camera=camera), FAST) if t.target == "red")
    result = trial.recolored(trial.analysis("auto"))
    plain = trial.recolored(trial.analysis("dichromatic"))
    inside = trial.view.interior[:, 1:] & trial.view.interior[:, :-1]

    def grain(picture):
        # From pixel to pixel along the rows, beyond what the true picture changes there.
        step = difference(picture[:, 1:], picture[:, :-1]) - difference(trial.truth[:, 1:], trial.truth[:, :-1])
        return float(np.quantile(np.abs(step[inside]), 0.75))

    real = grain(camera.photograph(trial.truth))
    assert grain(result) < 1.5 * real
    assert grain(plain) > 1.5 * real


def test_clipped_highlights_have_no_hole_and_no_rim():
    # The beige mug, overexposed: its highlight is clipped in one channel after the other.
    exposure = 1.6
    for trial in trials(pale("mug", ["beige"], camera=Camera(exposure=exposure)), FAST):
        clipped = (trial.picture.linear() >= 1).any(axis=2) & trial.view.interior
        rim = dilate(clipped, 1) & trial.view.interior
        assert clipped.sum() > 20
        bright = np.minimum(trial.truth * np.float32(exposure), 1).mean(axis=2)
        x, y = trial.view.reference

        def darkest(model, trial=trial, rim=rim, bright=bright, at=(y, x)):
            seen = trial.analysis(model)
            target = seen.matte_target(exposure * trial.truth[at].astype(float))
            return (np.minimum(seen.recolor(target), 1).mean(axis=2) - bright)[rim]

        restored, body = darkest("auto"), darkest("body")
        assert abs(np.median(restored)) < 0.02
        assert restored.min() > body.min() + 0.03
        assert np.abs(restored).mean() < 0.6 * np.abs(body).mean()


def test_metal_has_a_gain_for_each_channel_in_colored_surroundings():
    figures, taken = measure(Case("", "metal", sources={"copper": METALS["copper"]}), FAST)
    assert set(taken) == {"metal"}
    assert figures["auto"][0] < figures["dichromatic"][0] / 10
    assert figures["auto"][1] < figures["dichromatic"][1] / 2


def test_copper_in_gray_surroundings_lights_itself_and_has_highlights_of_its_own_color():
    case = Case("", "metal", sources={"copper": METALS["copper"]}, parameters={"colored": False})
    figures, taken = measure(case, FAST)
    assert set(taken) == {"bounce"}
    assert figures["auto"][0] <= 0.3
    assert figures["auto"][1] <= 1.5
    assert figures["auto"][1] < figures[BEST][1] / 5


def test_auto_is_better_than_the_best_plain_model_where_light_met_the_cloth_twice():
    figures, _ = measure(next(c for c in CASES if c.title == "cloth in deep folds"), FAST)
    assert figures["auto"][1] < figures[BEST][1] / 2


@pytest.mark.parametrize(("scene", "source"), [("mug", "red"), ("folds", "blue"), ("fabric_cylinder", "red")])
def test_the_choice_is_the_same_for_every_noise(scene, source):
    colors = {source: COLORS[source]}
    chosen = set()
    for seed in range(5):
        case = Case("", scene, sources=colors, camera=Camera(seed=seed))
        chosen |= {trial.analysis("auto").model for trial in trials(case, FAST)}
    assert len(chosen) == 1
