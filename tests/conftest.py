"""Settings for every test: property tests are the same in each run unless exploration is asked for.

HYPOTHESIS_PROFILE=explore draws new examples each time; what it finds belongs into an @example.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

# No deadline and no health check of speed: a loaded machine is not a defect.
EXPLORE = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("explore", EXPLORE)
settings.register_profile("steady", EXPLORE, derandomize=True, database=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Real terminals first: they mostly wait, beside each other, and the rest fills up what they leave."""
    items.sort(key=lambda item: item.get_closest_marker("system") is None)
