"""Several materials in one region are told apart; shading, gloss, noise and fibers of one material are not."""

import numpy as np
import pytest

from dyehouse.core import analyze
from dyehouse.core.materials import find_materials
from dyehouse.core.picture import Picture


def two(first, second, noise=0.003, size=96):
    """Two shaded halves."""
    y, x = np.mgrid[:size, :size] / size
    image = np.where((x < 0.6)[..., None], first, second) * (0.3 + 0.7 * y)[..., None]
    return (image + np.random.default_rng(0).normal(0, noise, image.shape)).astype(np.float32)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((0.5, 0.1, 0.06), (0.06, 0.2, 0.5)),
        ((0.5, 0.1, 0.06), (0.6, 0.45, 0.05)),
        ((0.06, 0.3, 0.1), (0.5, 0.5, 0.48)),
    ],
)
def test_two_materials_are_found_where_they_are(first, second):
    image = two(first, second)
    found = find_materials(Picture(image), np.ones(3), np.ones((96, 96)))
    assert len(found) == 2
    assert found[0].share == pytest.approx(0.6, abs=0.1)
    assert {m.click[0] < 57.6 for m in found} == {True, False}
    for material in found:
        x, y = material.click
        np.testing.assert_allclose(material.color, image[y - 1 : y + 2, x - 1 : x + 2].mean(axis=(0, 1)), atol=0.02)


@pytest.mark.parametrize("body", [(0.42, 0.09, 0.05), (0.05, 0.12, 0.45), (0.6, 0.42, 0.05), (0.4, 0.4, 0.4)])
@pytest.mark.parametrize("white", [(1, 1, 1), (1.1, 1.0, 0.6)])
def test_a_glossy_shaded_ball_is_one(product, body, white):
    scene = product(np.array(body) * white, white, noise=0.003, gloss=1.5)
    assert len(find_materials(Picture(scene.image), scene.white, scene.mask)) == 1


def test_fibers_are_no_material():
    image = two((0.5, 0.1, 0.06), (0.5, 0.1, 0.06))
    image[np.random.default_rng(0).random((96, 96)) < 0.25] = [0.4, 0.4, 0.4]
    assert len(find_materials(Picture(image), np.ones(3), np.ones((96, 96)))) == 1


def test_nothing_to_see():
    assert find_materials(Picture(np.zeros((9, 9, 3), np.float32)), np.ones(3)) == []


def test_a_large_picture_is_looked_at_on_a_grid():
    image = np.kron(two((0.5, 0.1, 0.06), (0.06, 0.2, 0.5)), np.ones((6, 6, 1), np.float32))
    found = find_materials(Picture(image), np.ones(3))
    assert len(found) == 2
    assert all(0 <= x < 576 and 0 <= y < 576 for x, y in (m.click for m in found))


def test_the_user_is_told_with_a_remedy():
    image, mask = two((0.5, 0.1, 0.06), (0.06, 0.2, 0.5)), np.zeros((96, 96))
    mask[4:-4, 4:-4] = 1
    [said] = [w for w in analyze(image, reference=(20, 60), mask=mask).warnings if "materials" in w]
    assert "2 materials" in said
    assert "region of its own" in said
    half = mask.copy()
    half[:, 55:] = 0
    assert not any("materials" in w for w in analyze(image, reference=(20, 60), mask=half).warnings)
