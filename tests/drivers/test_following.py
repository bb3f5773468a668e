"""Position following: a pair of gears of whole teeth, of which nothing gets lost."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.master.time_base import (
    Following,
    FollowingMode,
    FollowingSetup,
    in_counts,
    parts_of,
    register_change,
)

ROLL = 2**24


def setup(teeth: int = 96, own_teeth: int = 96, mode: FollowingMode = FollowingMode.NORMAL) -> FollowingSetup:
    return FollowingSetup(mode=mode, master=0x720, teeth=teeth, own_teeth=own_teeth)


@pytest.mark.parametrize(
    ("dialect", "settings", "mode", "master"),
    [
        (PMAC, {105: 0x721, 106: 0}, FollowingMode.OFF, 0x721),
        (PMAC, {105: 0x721, 106: 1}, FollowingMode.NORMAL, 0x721),
        (PMAC, {105: 0x10721, 106: 1}, FollowingMode.OFFSET, 0x721),
        (PMAC, {105: 0x10721, 106: 0}, FollowingMode.OFF, 0x721),
        (TURBO, {105: 0x3502, 106: 0}, FollowingMode.OFF, 0x3502),
        (TURBO, {105: 0x3502, 106: 1}, FollowingMode.NORMAL, 0x3502),
        (TURBO, {105: 0x3502, 106: 2}, FollowingMode.OFF, 0x3502),
        (TURBO, {105: 0x3502, 106: 3}, FollowingMode.OFFSET, 0x3502),
        (TURBO, {}, FollowingMode.OFF, 0),
    ],
)
def test_where_each_family_keeps_the_mode(
    dialect: Dialect, settings: dict[int, float], mode: FollowingMode, master: int
) -> None:
    read = FollowingSetup.of_motor(1, {**settings, 107: -30, 108: 96}, dialect)
    kept_out = settings.get(105, 0) >= 0x10000 or settings.get(106, 0) >= 2
    assert read == FollowingSetup(mode=mode, master=master, teeth=-30, own_teeth=96, offset=kept_out)


@given(st.integers(-(2**23), 2**23 - 1), st.integers(1, 1000), st.lists(st.integers(-4000, 4000), max_size=40))
def test_the_motor_goes_by_the_exact_ratio(teeth: int, own_teeth: int, changes: list[int]) -> None:
    gears, register = setup(teeth, own_teeth), 0
    following = Following(master_parts=0)
    travelled = 0
    for change in changes:
        register = (register + change) % ROLL
        following, increment = following.step(gears, register)
        travelled += increment
    assert travelled == following.followed
    master_counts = Fraction(sum(changes), 32)
    assert Fraction(following.followed, own_teeth * 32) == master_counts * Fraction(teeth, own_teeth)


def test_one_third_turn_for_each_turn_leaves_nothing_after_three() -> None:
    following, gears = Following(master_parts=0), setup(32, 96)
    for turn in range(1, 4):
        following, increment = following.step(gears, parts_of(1000.0 * turn))
        assert in_counts(increment, gears) == pytest.approx(1000 / 3)
    assert in_counts(following.followed, gears) == 1000.0


def test_the_ratio_may_change_while_it_runs_and_keeps_what_was_followed() -> None:
    following, _ = Following(master_parts=0).step(setup(96), parts_of(100))
    following, increment = following.step(setup(-192), parts_of(150))
    assert in_counts(increment, setup()) == -100.0
    assert in_counts(following.followed, setup()) == 0.0


def test_it_begins_without_a_jump_where_the_master_is() -> None:
    following, increment = Following(master_parts=0).step(setup(mode=FollowingMode.OFF), parts_of(5000))
    assert (increment, following.followed) == (0, 0)
    _, increment = following.step(setup(), parts_of(5001))
    assert in_counts(increment, setup()) == 1.0


@given(st.integers(0, ROLL - 1), st.integers(-(2**23), 2**23 - 1))
def test_the_register_of_the_master_rolls_over(old: int, change: int) -> None:
    assert register_change((old + change) % ROLL, old) == change


def test_only_whole_thirty_seconds_of_a_count_are_seen() -> None:
    assert [parts_of(counts) for counts in (1.0, 0.5, 0.04, 0.02, -0.01)] == [32, 16, 1, 0, -1]
