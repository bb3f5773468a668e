"""The host's side: what a lease is on each family, when it is due, and the lines that carry it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.heartbeat.watch import LOSS_SEEN, NOTHING_GUARDED, Keeper
from drivers.pmac.heartbeat.watchdog import cycles_of, watchdog_condition, watchdog_line

FACTORY_I10 = 3_713_707


def test_a_lease_is_300_ms_of_servo_cycles_in_a_timer_of_the_family() -> None:
    """300 / (3713707 / 8388608) = 677.6, and not a cycle more than 300 ms."""
    assert watchdog_line(TURBO) == "I5111=677"
    assert watchdog_line(PMAC) == "M70=677"
    assert watchdog_line(TURBO, 2**23 / 10) == "I5111=3000"


def test_what_a_program_looks_at_is_the_same_timer() -> None:
    assert watchdog_condition(TURBO) == "I5111>0"
    assert watchdog_condition(PMAC) == "M70>0"


@given(st.floats(1e-3, 1e4), st.integers(1, 2**23 - 1))
def test_a_time_is_never_rounded_up(time_ms: float, i10: int) -> None:
    cycles = cycles_of(time_ms, i10)
    assert cycles * i10 / 2**23 <= time_ms * (1 + 1e-12)
    assert (cycles + 1) * i10 / 2**23 > time_ms * (1 - 1e-12)


def test_a_renewal_is_due_every_50_ms_and_the_first_one_at_once() -> None:
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.due_s(7.0) == 7.0
    assert keeper.renewed(7.0).due_s(7.02) == pytest.approx(7.05)


def test_a_lease_lapses_after_300_ms() -> None:
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.lapsed(0.0)
    assert not keeper.renewed(1.0).lapsed(1.29)
    assert keeper.renewed(1.0).lapsed(1.3)


def test_what_is_guarded_is_said_behind_the_lease_in_one_line() -> None:
    keeper = Keeper(dialect=TURBO, i10=FACTORY_I10)
    assert keeper.jog_line() == "I5111=677 P1003=1"
    assert keeper.cut_line(-10_000.0, 1300.0) == "P1005=-10000 P1007=2936 P1010=790 I5111=677 P1003=2"
    assert Keeper(dialect=PMAC, i10=FACTORY_I10).jog_line() == "M70=677 P1003=1"
    assert (NOTHING_GUARDED, LOSS_SEEN) == ("P1003=0", "P1004=0")


def test_a_line_is_short_enough_for_a_slow_port() -> None:
    """20 a second with their acknowledgements over 9600 baud, 960 characters a second: less than a quarter."""
    for dialect in (PMAC, TURBO):
        assert 20 * (len(watchdog_line(dialect)) + len("\r\x06")) < 960 / 4
