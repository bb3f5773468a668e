"""External time base: trajectory time from the counts of a master, frozen, armed and running."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO
from drivers.pmac.master.time_base import (
    UNITS_PER_MS,
    TimeBaseEntry,
    Trigger,
    TriggeredTimeBase,
    entry_of,
    increment_units,
    nearest_factor,
    parts_of,
)
from drivers.pmac.settings import servo_cycle_ms


@pytest.mark.parametrize(("counts_per_ms", "factor"), [(128, 1024), (163.84, 800), (256, 512), (204.8, 640)])
def test_the_scale_factors_of_the_manuals(counts_per_ms: float, factor: int) -> None:
    assert nearest_factor(counts_per_ms) == factor


@pytest.mark.parametrize("counts_per_ms", [128, 163.84, 256])
def test_at_the_real_time_frequency_the_time_base_is_100_percent(counts_per_ms: float) -> None:
    factor = nearest_factor(counts_per_ms)
    # A thousand servo cycles of a master at that speed: the time of the trajectory is the time of the clock.
    cycle_ms = servo_cycle_ms(3_713_707)
    parts = [int(cycle * cycle_ms * counts_per_ms * 32) for cycle in range(1001)]
    units = sum(increment_units(factor, new - old) for old, new in pairwise(parts))
    assert units / UNITS_PER_MS == pytest.approx(1000 * cycle_ms, abs=1 / (32 * counts_per_ms))


@given(st.integers(1, 2**23 - 1), st.lists(st.integers(-(2**10), 2**10), max_size=50))
def test_no_count_of_the_master_is_lost_below_saturation(factor: int, changes: list[int]) -> None:
    small = [change for change in changes if abs(2 * factor * change) < 2**23]
    total = sum(increment_units(factor, change) for change in small)
    assert Fraction(total, 2**23) == Fraction(factor, 2**17) * Fraction(sum(small), 32)


def test_a_thirty_second_of_a_count_is_seen_and_less_is_not() -> None:
    assert increment_units(1024, parts_of(1.0)) == UNITS_PER_MS / 128
    assert increment_units(1024, parts_of(1 / 32)) == UNITS_PER_MS / 4096
    assert increment_units(1024, parts_of(1 / 33)) == 0


def test_a_servo_cycle_gives_less_than_1_ms() -> None:
    # RTIF 32 counts/ms at 2.25 kHz is full at 72 counts/ms, 32 counts a cycle.
    factor = nearest_factor(32)
    assert increment_units(factor, parts_of(31.0)) == UNITS_PER_MS * 31 / 32
    assert increment_units(factor, parts_of(32.0)) == increment_units(factor, parts_of(50.0)) == 2**23 - 1
    assert increment_units(factor, parts_of(-50.0)) == -UNITS_PER_MS


def test_a_frozen_time_base_stands_and_an_armed_one_waits() -> None:
    base = TriggeredTimeBase(state=Trigger.RUNNING, factor=800, counts=1000)
    base, units = replace(base, state=Trigger.FROZEN).step(1072)
    assert (base.state, units) == (Trigger.FROZEN, 0)
    base, units = base.step(1144, captured=1100)
    assert (base.state, units) == (Trigger.FROZEN, 0)
    base, units = replace(base, state=Trigger.ARMED).step(1216)
    assert (base.state, units) == (Trigger.ARMED, 0)


def test_time_begins_exactly_at_the_captured_count() -> None:
    # 4096 lines at 600 rpm, 163.84 counts/ms: 45 deg behind the index are 2048 counts, 12.5 ms.
    base = TriggeredTimeBase(state=Trigger.ARMED, factor=800, counts=16_300)
    base, units = base.step(16_390, captured=16_384)
    assert base.state is Trigger.RUNNING
    assert units / UNITS_PER_MS == 6 / 163.84
    elapsed = units
    for counts in [*range(16_462, 16_384 + 2048, 72), 16_384 + 2048]:
        base, units = base.step(counts)
        elapsed += units
    assert elapsed / UNITS_PER_MS == 12.5


def test_a_time_base_that_is_set_running_by_hand_does_not_jump() -> None:
    base, _ = TriggeredTimeBase(state=Trigger.FROZEN, factor=800).step(50_000)
    _, units = replace(base, state=Trigger.RUNNING).step(50_010)
    assert units / UNITS_PER_MS == 10 / 163.84


def test_the_set_up_lines_of_the_manuals() -> None:
    untriggered = TimeBaseEntry(line=9, source=0x723, factor=512)
    assert untriggered.commands(PMAC) == ["WY:$729,$400723,512", "I193=$72A", "I194=8388607"]
    triggered = TimeBaseEntry(line=10, source=0xC00C, factor=800, trigger=Trigger.RUNNING)
    assert triggered.commands(PMAC)[:2] == ["WY:$72A,$A0C00C,800", "I193=$72B"]
    turbo = TimeBaseEntry(line=8, source=0x3504, factor=512)
    assert turbo.commands(TURBO) == ["I8008=$403504", "I8009=512", "I5193=$350A", "I5194=8388607"]
    assert turbo.commands(TURBO, system=2)[2:] == ["I5293=$350A", "I5294=8388607"]


def test_a_triggered_entry_on_turbo_says_which_kind_of_encoder_circuit() -> None:
    entry = TimeBaseEntry(line=8, source=0x78018, factor=512, trigger=Trigger.FROZEN, pmac2_encoder=True)
    assert f"{entry.word():06X}" == "9F8018"  # 9, bit 19, and the address below it


@pytest.mark.parametrize(
    "entry",
    [
        TimeBaseEntry(line=9, source=0x723, factor=512),
        TimeBaseEntry(line=10, source=0xC00C, factor=800, trigger=Trigger.ARMED),
        TimeBaseEntry(line=8, source=0x78018, factor=512, trigger=Trigger.FROZEN, pmac2_encoder=True),
    ],
)
def test_an_entry_is_read_back_from_its_words(entry: TimeBaseEntry) -> None:
    assert entry_of(entry.line, entry.word(), entry.factor) == entry


def test_an_encoder_makes_no_time_base() -> None:
    assert entry_of(0, 0xC000, 0) is None
