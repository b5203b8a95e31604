"""Every scenario of `scenarios/`, in a real window."""

from collections.abc import Callable
from typing import Any

import pytest

pytestmark = pytest.mark.slow  # minutes of drawing in software


def test_scenario(name: str, scenario: str, outcome_of: Callable[[str, str], Any]) -> None:
    outcome_of(name, scenario)
