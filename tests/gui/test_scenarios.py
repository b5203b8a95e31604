"""Every scenario of `scenarios/`, in a real window."""

from collections.abc import Callable
from typing import Any


def test_scenario(name: str, scenario: str, outcome_of: Callable[[str, str], Any]) -> None:
    outcome_of(name, scenario)
