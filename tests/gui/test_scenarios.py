"""Every scenario of `scenarios/`, in a real window."""

from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.slow  # minutes of drawing in software


def test_scenario(name: str, scenario: str, outcome_of: Callable[[str, str], Any]) -> None:
    outcome_of(name, scenario)


@pytest.mark.parametrize(
    ("file", "only"),
    [
        ("pick", "clicks_of_a_region_are_single_steps"),
        ("preview", "the_screen_shows_what_the_core_makes"),
        ("write", "all_colorways_are_written_in_a_thread"),
    ],
)
def test_without_openimageio(file: str, only: str, outcome_without_openimageio: Callable[[str, str], Any]) -> None:
    outcome_without_openimageio(file, only)
