"""A trim on a tool that friction holds back: it converges as on a free one, and stays within its bounds."""

from __future__ import annotations

import cmath

import numpy as np
import pytest

from profiles.compensations.learning import trimmed
from profiles.compensations.trim_response import TrimResponse

NOMINAL = cmath.rect(0.9, -0.6)


def left_um(true: complex, batches: int, *, adapts: bool, jump_at: int = -1) -> list[float]:
    """Return the error of each batch of a cut whose tool follows a trim by `true`; it comes into the part once."""
    rng, response, trim, found = np.random.default_rng(4), TrimResponse(nominal=NOMINAL), 0j, []
    disturbance = 2.0 + 1.0j
    for batch in range(batches):
        if batch == jump_at:
            disturbance += 3.0
        error = disturbance - true * trim + complex(*rng.normal(0.0, 0.05, 2))
        response = response.seen(trim, error)
        trim = trimmed(trim, error, response.value if adapts else NOMINAL, 0.7, 100.0)
        found.append(abs(error))
    return found


def test_a_tool_that_is_held_back_to_a_third_is_trimmed_within_a_few_batches() -> None:
    held_back = 0.35 * NOMINAL * cmath.rect(1.0, 0.3)
    slow, quick = (left_um(held_back, 7, adapts=adapts) for adapts in (False, True))
    assert slow[-1] > 0.3, "0.75 of the error is left by each batch"
    assert quick[-1] < 0.15


@pytest.mark.parametrize("jump_at", [2, 4])
def test_a_tool_that_follows_is_trimmed_as_before_also_where_it_comes_into_the_part(jump_at: int) -> None:
    found = left_um(NOMINAL, jump_at + 5, adapts=True, jump_at=jump_at)
    assert found[jump_at] > 2.0 and found[-1] < 0.15


def test_the_response_stays_within_bounds_whatever_a_batch_shows() -> None:
    rng = np.random.default_rng(5)
    response = TrimResponse(nominal=NOMINAL)
    for _ in range(200):
        response = response.seen(complex(*rng.normal(0.0, 5.0, 2)), complex(*rng.normal(0.0, 5.0, 2)))
        factor = response.value / NOMINAL
        assert 0.3 - 1e-9 <= abs(factor) <= 1.5 + 1e-9
        assert abs(cmath.phase(factor)) <= 1.048
