"""Finding swatches by name and by color."""

import colour
import numpy as np
import pytest

from dyehouse.core.errors import TargetError
from dyehouse.core.library import Group, Library
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Swatch, parse_target

NAVY, SKY, BRICK = (
    Swatch(name, parse_target(text).color)
    for name, text in (("Navy Blue", "#1F4E79"), ("Sky", "#7FB2E5"), ("Brick", "lab(42, 55, 35)"))
)
LIBRARY = Library("Season", (Group("Blues", (NAVY, SKY)), Group("Reds", (BRICK,))))


def test_indices_count_over_all_groups():
    assert LIBRARY.swatches == (NAVY, SKY, BRICK)
    assert LIBRARY.group_names == ("Blues", "Blues", "Reds")
    assert len(LIBRARY) == 3


@pytest.mark.parametrize(
    ("text", "found"),
    [("navy", [0]), ("BLUE", [0, 1]), ("blue sk", [1]), ("", [0, 1, 2]), ("green", []), ("reds", [2])],
)
def test_search(text, found):
    assert LIBRARY.search(text) == found


def test_names():
    assert LIBRARY.named(" navy blue ") == NAVY
    assert LIBRARY.named("Reds/brick") == BRICK
    with pytest.raises(TargetError, match="no swatch 'navi blue': it has Navy Blue"):
        LIBRARY.named("navi blue")


def test_subset_keeps_the_groups():
    part = LIBRARY.subset([2, 0])
    assert [(g.name, g.swatches) for g in part.groups] == [("Reds", (BRICK,)), ("Blues", (NAVY,))]


@pytest.fixture(scope="module")
def large():
    rng = np.random.default_rng(4)
    lab = rng.uniform((5, -60, -60), (95, 60, 60), (10_000, 3))
    return Library.of("Large", [Swatch.from_lab(color, name=f"Swatch {k}") for k, color in enumerate(lab)])


def test_nearest_as_colour_science_finds_it(large):
    for target in (NAVY, BRICK, Swatch.from_lab((50, 0, 0))):
        indices, differences = large.nearest(target, 7)
        theirs = colour.delta_E(np.broadcast_to(target.to_lab(), large.lab.shape), large.lab, method="CIE 2000")
        np.testing.assert_array_equal(indices, np.argsort(theirs)[:7])
        np.testing.assert_allclose(differences, np.sort(theirs)[:7], atol=1e-6)


def test_a_swatch_is_nearest_to_itself(large):
    indices, differences = large.nearest(large.swatches[123], 1)
    assert list(indices) == [123]
    assert differences[0] == pytest.approx(0, abs=1e-6)
    assert len(large.nearest(NAVY, 20_000)[0]) == 10_000


def test_many_spectra_at_once_are_what_they_are_one_by_one():
    rng, nm = np.random.default_rng(0), np.arange(380.0, 731, 10)
    swatches = [Swatch.from_spectrum(Spectrum(nm, rng.uniform(0, 1, 36)), f"{k}") for k in range(50)]
    swatches.insert(7, NAVY)
    library = Library.of("Spectra", swatches)
    np.testing.assert_allclose(library.lab, [s.to_lab() for s in swatches], rtol=0, atol=1e-9)


def test_display_colors_are_codes():
    np.testing.assert_allclose(LIBRARY.display_colors[0], np.array([0x1F, 0x4E, 0x79]) / 255, atol=1e-5)
    beyond = Library.of("Beyond", [parse_target("lab(60, -120, 40)"), parse_target("lab(99, 20, 90)")])
    assert beyond.display_colors.min() >= 0
    assert beyond.display_colors.max() <= 1
    assert beyond.linear_colors.min() < 0
