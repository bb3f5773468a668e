"""The alarms of a session: numbers, states, the first of a group, what is over, the rate; all of it bounded."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta

from console.session.station.alarms import Alarms, Priority, acknowledged, cleared, raised
from console.session.station.history.alarm_history import (
    PAST_MOST,
    RAISES_MOST,
    AlarmHistory,
    AlarmState,
    Change,
    Instant,
    followed,
)
from profiles.problem import Problem

NOON = datetime(2026, 1, 2, 12, 0, 0)
FAULT, LINK, RECORD = (Problem(code=code) for code in ("machine.fault", "link.lost", "record.lost"))


def clock(now_s: float) -> datetime:
    """Noon is machine time 0."""
    return NOON + timedelta(seconds=now_s)


def after(*steps: tuple[float, Alarms], history: AlarmHistory | None = None) -> AlarmHistory:
    history = history or AlarmHistory()
    for now_s, alarms in steps:
        history, _ = followed(history, alarms, Instant(now_s=now_s, clock=clock(now_s)))
    return history


def up(*problems: tuple[Problem, float], on: Alarms = ()) -> Alarms:
    for problem, at_s in problems:
        on = raised(on, problem, Priority.HIGH, at_s)
    return on


def test_alarms_have_numbers_in_the_order_in_which_they_came_and_their_own_time_of_day() -> None:
    history = after(
        (30.0, up((FAULT, 10.0), (LINK, 20.0))), (31.0, up((FAULT, 10.0), (LINK, 20.0), (RECORD, 31.0)))
    )
    assert [(each.number, each.problem, each.raised) for each in history.standing] == [
        (1, FAULT, clock(10.0)),
        (2, LINK, clock(20.0)),
        (3, RECORD, clock(31.0)),
    ]


def test_an_alarm_is_new_then_acknowledged_then_over() -> None:
    new = up((FAULT, 10.0))
    seen = acknowledged(new)
    assert [after((10.0, new)).listed[0].state] == [AlarmState.NEW]
    assert after((10.0, new), (12.0, seen)).listed[0].state is AlarmState.ACKNOWLEDGED
    history = after((10.0, new), (12.0, seen), (15.0, cleared(seen, "machine.fault")))
    assert history.standing == ()
    (entry,) = history.past
    assert (entry.state, entry.acknowledged, entry.ended) == (AlarmState.PAST, clock(12.0), clock(15.0))


def test_one_that_ended_unseen_has_returned_and_is_gone_when_it_is_acknowledged() -> None:
    new = up((FAULT, 10.0))
    ended = cleared(new, "machine.fault")
    assert after((10.0, new), (15.0, ended)).standing[0].state is AlarmState.RETURNED
    history = after((10.0, new), (15.0, ended), (20.0, acknowledged(ended)))
    assert history.standing == ()
    assert (history.past[0].ended, history.past[0].acknowledged) == (clock(15.0), clock(20.0))


def test_the_first_of_those_that_come_together_is_first_out_whatever_their_order_in_the_state() -> None:
    flood = (*up((LINK, 11.0)), *up((FAULT, 10.0)), *up((RECORD, 60.0)))
    history = after((60.0, flood))
    assert {each.problem: (each.number, each.group) for each in history.standing} == {
        FAULT: (1, 1),
        LINK: (2, 1),
        RECORD: (3, 3),
    }
    assert [history.group_of(each) for each in history.standing] == [2, 2, 1]


def test_one_that_comes_again_keeps_its_number_and_is_new_again() -> None:
    seen = acknowledged(up((FAULT, 10.0)))
    history = after((10.0, up((FAULT, 10.0))), (12.0, seen), (40.0, up((FAULT, 40.0), on=seen)))
    (entry,) = history.standing
    assert (entry.number, entry.state, entry.alarm.count, entry.again) == (1, AlarmState.NEW, 2, clock(40.0))


def test_one_that_left_and_came_again_is_another_alarm_even_if_nobody_looked_in_between() -> None:
    history = after((10.0, up((FAULT, 10.0))), (50.0, up((FAULT, 49.0))))
    assert [each.number for each in history.listed] == [2, 1]
    assert history.past[0].is_past


def test_every_change_is_reported_once() -> None:
    new = up((FAULT, 10.0))
    found = []
    history = AlarmHistory()
    ended = cleared(new, "machine.fault")
    for alarms in (new, new, ended, ended, acknowledged(ended)):
        history, changes = followed(history, alarms, Instant(now_s=10.0, clock=NOON))
        found += [change for change, _ in changes]
    assert found == [Change.RAISED, Change.ENDED, Change.ACKNOWLEDGED]


def test_the_rate_counts_every_raise_and_more_than_ten_in_ten_minutes_are_a_flood() -> None:
    """ISA-18.2: a flood begins above ten alarms in ten minutes."""
    history, alarms = AlarmHistory(), up((FAULT, 0.0))
    for now_s in range(11):
        alarms = alarms if now_s == 0 else up((FAULT, float(now_s)), on=alarms)
        history = after((float(now_s), alarms), history=history)
        assert history.is_flood(float(now_s)) is (now_s == 10)
    assert (history.rate(605.0, 600.0), history.rate(605.0, 3600.0)) == (6, 11)
    assert not history.is_flood(605.0)
    assert history.most_frequent(1) == ((FAULT, 11),)


def test_a_day_of_alarms_takes_no_more_memory_than_the_newest_ones() -> None:
    history, last = AlarmHistory(), 2 * RAISES_MOST
    for n in range(last + 1):
        history = after((10.0 * n, up((Problem(code="link.lost", key=str(n)), 10.0 * n))), history=history)
    assert (len(history.past), len(history.raises)) == (PAST_MOST, RAISES_MOST)
    assert history.past[-1].number == last
    assert history.standing[0].number == last + 1


def test_an_alarm_with_an_impossible_time_does_not_break_the_list() -> None:
    """A recording may be somebody else's."""
    for at_s in (float("nan"), float("inf"), -1e300):
        (alarm,) = up((FAULT, 0.0))
        assert after((10.0, (replace(alarm, at_s=at_s),))).standing[0].raised == clock(10.0)
