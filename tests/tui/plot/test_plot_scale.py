"""Axes carry round numbers."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.tui.plot.frame import coarser, label, nice_limits, proper_limits, step_125, ticks

spans = st.tuples(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6)).map(lambda pair: (pair[0], pair[0] + pair[1]))


def is_round(step: float) -> bool:
    mantissa = step / 10.0 ** math.floor(math.log10(step) + 1e-9)
    return any(math.isclose(mantissa, each, rel_tol=1e-6) for each in (1.0, 2.0, 5.0))


@pytest.mark.parametrize(
    ("at_least", "step"), [(13.75, 20.0), (20.0, 20.0), (1.0, 1.0), (0.11, 0.2), (5.1, 10.0), (3e-4, 5e-4)]
)
def test_a_step_is_the_next_round_number(at_least: float, step: float) -> None:
    assert step_125(at_least) == pytest.approx(step)


@given(st.floats(1e-9, 1e9))
def test_a_step_reaches_and_is_not_wasteful(at_least: float) -> None:
    step = step_125(at_least)
    assert is_round(step)
    assert at_least * (1.0 - 1e-6) <= step <= 2.5 * at_least * (1.0 + 1e-6)


def test_a_coarser_step_is_the_next_round_one() -> None:
    steps = [0.1]
    while steps[-1] < 99.0:
        steps.append(coarser(steps[-1]))
    assert steps == pytest.approx([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])


@given(spans, st.integers(2, 12))
def test_ticks_are_few_and_inside(limits: tuple[float, float], most: int) -> None:
    low, high = limits
    found = ticks(limits, most)
    assert 2 <= len(found) <= most
    slack = 1e-6 * (high - low)
    assert all(low - slack <= tick <= high + slack for tick in found)
    assert list(found) == sorted(found)


def test_ticks_of_a_tool_stroke() -> None:
    assert ticks((70.0, 130.0), 4) == (80.0, 100.0, 120.0)
    assert ticks((-3.3, 2.7), 2) == (-2.0, 2.0)


def test_limits_hold_still_while_data_wander() -> None:
    assert nice_limits(-1.82, 1.97) == nice_limits(-1.71, 1.93) == (-2.0, 2.0)
    assert nice_limits(72.5, 127.5) == (60.0, 140.0)


@given(st.floats(allow_nan=True, allow_infinity=True), st.floats(-1e3, 1e3))
def test_limits_always_leave_room(low: float, high: float) -> None:
    for limits in (proper_limits((low, high)), proper_limits((high, high))):
        assert limits[0] < limits[1]
        assert all(map(math.isfinite, limits))


@pytest.mark.parametrize(("value", "text"), [(-0.0, "0"), (0.1 + 0.2, "0.3"), (100000.0, "100000"), (-2.0, "-2")])
def test_labels_are_short(value: float, text: str) -> None:
    assert label(value) == text
