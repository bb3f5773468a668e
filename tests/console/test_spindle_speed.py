"""How fast the spindle turns, by arithmetic: counts, 10 000 a turn, over time."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.station.progress import SpindleWatch
from drivers.lathe.snapshot import AxisState, Snapshot

HOMED = frozenset({"home_complete"})


def look(at_s: float, counts: float, flags: frozenset[str] = HOMED) -> Snapshot:
    rest = AxisState(position=0.0, following_error=0.0, flags=flags)
    spindle = AxisState(position=counts, following_error=0.0, flags=flags)
    return Snapshot(
        asked_s=at_s,
        at_s=at_s,
        tool=rest,
        spindle=spindle,
        carriage=rest,
        program_running=False,
        runtime_error=False,
    )


def test_a_quarter_of_a_second_and_a_tenth_of_a_turn_are_24_rpm() -> None:
    watch = SpindleWatch(10_000)
    assert watch.see(look(100.0, 350.0)) is None
    assert watch.see(look(100.25, 1350.0)) == pytest.approx(24.0)


@given(st.floats(-3000.0, 3000.0), st.lists(st.floats(0.01, 0.3), min_size=2, max_size=60))
def test_a_steady_speed_is_told_whatever_the_looks(rpm: float, pauses_s: list[float]) -> None:
    watch, at_s, told = SpindleWatch(10_000), 0.0, None
    for pause_s in pauses_s:
        at_s += pause_s
        told = watch.see(look(at_s, rpm / 60.0 * 10_000.0 * at_s))
    assert told == pytest.approx(rpm, abs=1e-6)


def test_after_a_second_what_was_before_is_forgotten() -> None:
    watch = SpindleWatch(10_000)
    watch.see(look(0.0, 0.0))
    watch.see(look(0.5, 80_000.0))
    assert watch.see(look(1.6, 80_000.0)) is None
    assert watch.see(look(1.7, 80_000.0)) == 0.0


def test_the_same_look_twice_says_nothing_new() -> None:
    watch = SpindleWatch(10_000)
    watch.see(look(0.0, 0.0))
    assert watch.see(look(0.0, 0.0)) is None


def test_a_new_zero_is_no_turn_of_the_spindle() -> None:
    watch = SpindleWatch(10_000)
    watch.see(look(0.0, 7300.0, frozenset()))
    watch.see(look(0.1, 7300.0, frozenset()))
    assert watch.see(look(0.2, 0.0)) is None
    assert watch.see(look(0.3, 0.0)) == 0.0


def test_what_is_forgotten_is_not_told_of() -> None:
    watch = SpindleWatch(10_000)
    watch.see(look(0.0, 0.0))
    watch.see(look(0.5, 80_000.0))
    watch.forget()
    assert watch.see(look(0.6, 80_000.0)) is None
    assert watch.see(look(0.7, 80_000.0)) == 0.0
