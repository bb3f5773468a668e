"""Which PLCs run: I5, the switches of each, and where one begins that is switched on again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.plcs.plc import PlcSwitches, background_order, foreground_runs, power_up
from tests.drivers.plc_bench import PlcBench

ALL = frozenset(range(32))
numbers = st.frozensets(st.integers(0, 31))


@pytest.mark.parametrize(
    ("i5", "foreground", "background"), [(0, False, 0), (1, True, 0), (2, False, 31), (3, True, 31)]
)
def test_i5_permits_the_foreground_and_the_background(i5: float, foreground: bool, background: int) -> None:
    """Software Reference, I5: the table of its four values."""
    assert foreground_runs(i5, ALL, ALL) is foreground
    assert len(background_order(i5, ALL, ALL)) == background


@given(numbers, numbers)
def test_what_is_stored_and_on_runs_in_the_order_of_the_numbers(
    enabled: frozenset[int], stored: frozenset[int]
) -> None:
    order = background_order(2, enabled, stored)
    assert list(order) == [number for number in range(1, 32) if number in enabled and number in stored]
    assert foreground_runs(1, enabled, stored) is (0 in enabled and 0 in stored)


def test_at_power_up_every_plc_that_there_is_is_on_and_at_its_top() -> None:
    switches = power_up([3, 1, 0])
    assert switches.enabled == switches.at_top == {0, 1, 3}


def test_one_that_is_on_already_goes_on_where_it_is() -> None:
    switches = PlcSwitches().enable([1, 2]).scanned(1)
    assert switches.at_top == {2}
    assert switches.enable([1, 2, 3]) == PlcSwitches(frozenset({1, 2, 3}), frozenset({2, 3}))


def test_off_and_on_again_between_two_scans_begins_at_the_top() -> None:
    switches = PlcSwitches().enable([5]).scanned(5).disable([5])
    assert switches == PlcSwitches()
    assert switches.enable([5]).at_top == {5}


@given(st.lists(st.tuples(st.sampled_from(["enable", "disable", "scan"]), st.integers(0, 31)), max_size=30))
def test_only_what_is_on_can_be_at_its_top(steps: list[tuple[str, int]]) -> None:
    switches = PlcSwitches()
    fresh: dict[int, bool] = {}
    for what, number in steps:
        if what == "enable":
            switches = switches.enable([number])
            fresh.setdefault(number, True)
        elif what == "disable":
            switches = switches.disable([number])
            fresh.pop(number, None)
        elif number in fresh:
            switches = switches.scanned(number)
            fresh[number] = False
        assert switches.enabled == set(fresh)
        assert switches.at_top == {n for n, top in fresh.items() if top}


def test_a_plc_inside_a_while_begins_at_its_top_when_it_is_switched_on_again() -> None:
    bench = PlcBench("P1=P1+1\nWHILE(1=1)\nP2=P2+1\nENDWHILE")
    switches = PlcSwitches().enable([7])

    def background() -> None:
        nonlocal switches
        for number in background_order(2, switches.enabled, {7}):
            if number in switches.at_top:
                bench.run.restart()
            switches = switches.scanned(number)
            bench.scan()

    for _ in range(3):
        background()
    switches = switches.disable([7])
    background()
    assert (bench.value("P1"), bench.value("P2")) == (1, 3)
    switches = switches.enable([7])
    background()
    assert (bench.value("P1"), bench.value("P2")) == (2, 4)
