"""Alarms: the first stays in front; states, numbers and rates of a session, the log, and the time of the link."""

from __future__ import annotations

import threading
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session import alarm_notes
from console.session.alarm_notes import AlarmNotes
from console.session.program_log import FILE, FOLDER
from console.session.station.alarms import (
    CONDITIONS,
    Alarms,
    Priority,
    acknowledge_alarms,
    acknowledge_shown_alarms,
    clear_alarms,
    foremost,
    raise_alarm,
    recover_alarms,
    unacknowledged_alarms,
    with_faults,
)
from console.session.station.history.alarm_history import (
    PAST_MOST,
    RAISES_MOST,
    AlarmChange,
    AlarmHistory,
    AlarmState,
    Instant,
    follow_alarms,
)
from console.session.station.history.session_log import LogEntry, LogKind
from console.session.station.state import StationState
from console.session.station.watches import KEPT_S, LinkTime, rounded_up_ms
from console.tui.application.logged_control import LoggedControl
from profiles.problem import Problem
from tests.console.floor import known
from tests.tui.stage import FixedControl

FAULT, LINK = Problem(code="machine.fault"), Problem(code="link.lost")


def both() -> Alarms:
    return raise_alarm(raise_alarm((), FAULT, Priority.HIGH, 1.0), LINK, Priority.HIGH, 2.0)


def test_the_first_that_stands_and_was_not_seen_is_in_front() -> None:
    link_is_back = clear_alarms(raise_alarm((), LINK, Priority.HIGH, 1.0), LINK.code)
    fault_seen = acknowledge_alarms(raise_alarm((), FAULT, Priority.HIGH, 1.0))
    for alarms, front in (
        (raise_alarm(both(), LINK, Priority.HIGH, 3.0), FAULT),  # the first of a flood
        (link_is_back, LINK),
        (raise_alarm(link_is_back, FAULT, Priority.HIGH, 2.0), FAULT),  # what is so before what is over
        (raise_alarm(fault_seen, LINK, Priority.LOW, 2.0), LINK),  # what was not seen before what was
        ((), None),
    ):
        found = foremost(alarms)
        assert (found and found.problem) == front
    (again,) = raise_alarm(fault_seen, FAULT, Priority.HIGH, 5.0)
    assert (again.count, again.acknowledged, again.at_s) == (2, False, 1.0), "it wants attention again"


def test_an_alarm_stays_until_its_cause_went_and_it_was_seen() -> None:
    assert [alarm.problem for alarm in acknowledge_alarms(both())] == [FAULT, LINK]
    gone = clear_alarms(both(), "machine.fault")
    assert [alarm.active for alarm in gone] == [False, True]
    assert [alarm.problem for alarm in acknowledge_alarms(gone)] == [LINK]
    assert clear_alarms(acknowledge_alarms(both()), "machine.fault", "link.lost") == ()


def test_only_what_was_on_the_screen_is_acknowledged_one_after_the_other() -> None:
    """The number beside the row counts down to none; an alarm may come between the row and the key."""
    alarms, fronts = both(), []
    while waiting := unacknowledged_alarms(alarms):
        front = known(foremost(alarms))
        fronts.append((front.problem.code, len(waiting)))
        alarms = acknowledge_shown_alarms(alarms)
    assert fronts == [("machine.fault", 2), ("link.lost", 1)] and acknowledge_shown_alarms(()) == ()
    assert unacknowledged_alarms(acknowledge_shown_alarms(both(), (FAULT, LINK))) == (), (
        "the list of messages shows all of them"
    )
    later = raise_alarm(raise_alarm((), LINK, Priority.LOW, 1.0), FAULT, Priority.HIGH, 2.0)
    assert [alarm.acknowledged for alarm in acknowledge_shown_alarms(later, (LINK,))] == [True, False]


def test_over_the_way_back_from_a_stop_conditions_stand_and_events_are_over() -> None:
    condition, event = Problem(code="owner.ousted"), Problem(code="machine.not_arrived")
    assert condition.code in CONDITIONS and event.code not in CONDITIONS
    alarms = raise_alarm(raise_alarm((), condition, Priority.HIGH, 1.0), event, Priority.HIGH, 2.0)
    assert recover_alarms(acknowledge_alarms(alarms)) == acknowledge_alarms(alarms)[:1]
    assert [alarm.active for alarm in recover_alarms(alarms)] == [True, False]


TOOL, LIMIT = "tool: amplifier_fault", "carriage: positive_limit"


def told(alarms: Alarms) -> list[tuple[str, str, bool, bool]]:
    return [(a.problem.key, a.problem.value, a.active, a.acknowledged) for a in alarms]


def test_a_fault_is_told_once_as_long_as_it_stands() -> None:
    first = with_faults((), (TOOL,), 1.0)
    known = with_faults(acknowledge_alarms(first), (TOOL,), 2.0)
    assert (told(first), told(known)) == ([("rest", TOOL, True, False)], [("rest", TOOL, True, True)])
    assert with_faults(known, (), 3.0) == ()
    assert told(with_faults(first, (), 3.0)) == [("rest", TOOL, False, False)]
    two = with_faults(known, (TOOL, LIMIT), 2.0)
    assert told(two) == [("rest", f"{TOOL}, {LIMIT}", True, False)], "another one wants attention again"
    # One of them goes: that is nothing to look at.
    assert told(with_faults(acknowledge_alarms(two), (LIMIT,), 3.0)) == [("rest", f"{TOOL}, {LIMIT}", True, True)]


@pytest.mark.parametrize("seen_before", [False, True])
def test_the_fault_that_stopped_a_motion_is_not_told_again_at_rest(seen_before: bool) -> None:
    stopped = raise_alarm((), Problem(code="machine.fault", key="program", value=TOOL), Priority.HIGH, 1.0)
    alarms = acknowledge_alarms(stopped) if seen_before else stopped
    after = with_faults(recover_alarms(with_faults(alarms, (TOOL,), 2.0)), (TOOL,), 3.0)
    assert told(after) == [("program", TOOL, True, seen_before)]
    assert [alarm.problem.value for alarm in with_faults(after, (TOOL, LIMIT), 4.0)] == [TOOL, LIMIT]


NOON = datetime(2026, 1, 2, 12, 0, 0)
RECORD = Problem(code="record.lost")


def clock(now_s: float) -> datetime:
    """Noon is machine time 0."""
    return NOON + timedelta(seconds=now_s)


def after(*steps: tuple[float, Alarms], history: AlarmHistory | None = None) -> AlarmHistory:
    history = history or AlarmHistory()
    for now_s, alarms in steps:
        history, _ = follow_alarms(history, alarms, Instant(now_s=now_s, clock=clock(now_s)))
    return history


def up(*problems: tuple[Problem, float], on: Alarms = ()) -> Alarms:
    for problem, at_s in problems:
        on = raise_alarm(on, problem, Priority.HIGH, at_s)
    return on


def test_alarms_have_numbers_in_the_order_in_which_they_came_and_their_own_time_of_day() -> None:
    history = after(
        (30.0, up((FAULT, 10.0), (LINK, 20.0))),
        (31.0, up((FAULT, 10.0), (LINK, 20.0), (RECORD, 31.0))),
    )
    assert [(each.number, each.problem, each.raised) for each in history.standing] == [
        (1, FAULT, clock(10.0)),
        (2, LINK, clock(20.0)),
        (3, RECORD, clock(31.0)),
    ]


def test_the_states_of_an_alarm_from_new_to_past() -> None:
    new = up((FAULT, 10.0))
    seen, ended = acknowledge_alarms(new), clear_alarms(new, "machine.fault")
    assert [after((10.0, new)).list_entries[0].state] == [AlarmState.NEW]
    assert after((10.0, new), (12.0, seen)).list_entries[0].state is AlarmState.ACKNOWLEDGED
    history = after((10.0, new), (12.0, seen), (15.0, clear_alarms(seen, "machine.fault")))
    (entry,) = history.past
    assert history.standing == ()
    assert (entry.state, entry.acknowledged, entry.ended) == (AlarmState.PAST, clock(12.0), clock(15.0))
    assert after((10.0, new), (15.0, ended)).standing[0].state is AlarmState.RETURNED, "it ended unseen"
    (entry,) = after((10.0, new), (15.0, ended), (20.0, acknowledge_alarms(ended))).past
    assert (entry.ended, entry.acknowledged) == (clock(15.0), clock(20.0))
    (entry,) = after((10.0, new), (12.0, seen), (40.0, up((FAULT, 40.0), on=seen))).standing
    assert (entry.number, entry.state, entry.alarm.count, entry.again) == (1, AlarmState.NEW, 2, clock(40.0))
    history = after((10.0, new), (50.0, up((FAULT, 49.0))))  # it left and came while nobody looked
    assert [each.number for each in history.list_entries] == [2, 1] and history.past[0].is_past


def test_the_first_of_those_that_come_together_is_first_out_whatever_their_order_in_the_state() -> None:
    flood = (*up((LINK, 11.0)), *up((FAULT, 10.0)), *up((RECORD, 60.0)))
    history = after((60.0, flood))
    assert {each.problem: (each.number, each.group) for each in history.standing} == {
        FAULT: (1, 1),
        LINK: (2, 1),
        RECORD: (3, 3),
    }
    assert [history.group_of(each) for each in history.standing] == [2, 2, 1]


def test_every_change_is_reported_once() -> None:
    new = up((FAULT, 10.0))
    found = []
    history = AlarmHistory()
    ended = clear_alarms(new, "machine.fault")
    for alarms in (new, new, ended, ended, acknowledge_alarms(ended)):
        history, changes = follow_alarms(history, alarms, Instant(now_s=10.0, clock=NOON))
        found += [change for change, _ in changes]
    assert found == [AlarmChange.RAISED, AlarmChange.ENDED, AlarmChange.ACKNOWLEDGED]


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


AT = datetime(2026, 3, 1, 12, 0, 0)
LOST = Problem(code="link.lost", where="tcp:lathe:1", value="the cable is cut")


def entry(kind: LogKind, number: int = 7) -> LogEntry:
    return LogEntry(at=AT, kind=kind, problem=LOST, number=number)


def test_an_alarm_and_its_end_are_in_the_log_of_the_program(tmp_path: Path) -> None:
    notes = AlarmNotes(tmp_path, "lathe 3", simulated=True)
    notes([entry(LogKind.RAISED), entry(LogKind.ACKNOWLEDGED), LogEntry(at=AT, kind=LogKind.STOPPED, word="key")])
    notes([entry(LogKind.ENDED)])
    notes.close()
    raised, ended = (tmp_path / FOLDER / FILE).read_text(encoding="utf-8").splitlines()
    assert " WARNING " in raised and " INFO " in ended
    assert f"alarm 7 raised  SIM lathe 3  {LOST}  [link.lost · tcp:lathe:1" in raised
    assert "alarm 7 ended  SIM lathe 3" in ended


def test_without_an_alarm_there_is_neither_a_log_nor_a_thread(tmp_path: Path) -> None:
    notes = AlarmNotes(tmp_path, "lathe", simulated=False)
    before = threading.active_count()
    notes([LogEntry(at=AT, kind=LogKind.COMMAND, word="Jog")])
    assert threading.active_count() == before
    notes.close()
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_does_not_answer_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stuck, over = threading.Event(), threading.Event()

    def noted(*_: object, **__: object) -> None:
        stuck.wait(30.0)
        over.set()

    monkeypatch.setattr(alarm_notes, "note", noted)
    monkeypatch.setattr(alarm_notes, "CLOSE_S", 0.05)
    notes = AlarmNotes(tmp_path, "lathe", simulated=False)
    notes([entry(LogKind.RAISED, number) for number in range(1000)])
    notes.close()
    assert not over.is_set(), "it was waited for"
    stuck.set()


def test_the_screens_hand_over_each_alarm_once_when_it_comes_and_when_it_ends() -> None:
    handed: list[LogEntry] = []
    control = FixedControl(StationState())
    logged = LoggedControl(control, lambda: AT, handed.extend)
    quiet = control.state
    standing = raise_alarm(quiet.alarms, LOST, Priority.HIGH, 1.0)
    for alarms in (
        quiet.alarms,
        standing,
        standing,
        clear_alarms(standing, LOST.code),
        clear_alarms(standing, LOST.code),
    ):
        logged.follow_state(replace(quiet, alarms=alarms), (), typed=False)
    assert [(each.kind, each.number) for each in handed] == [(LogKind.RAISED, 1), (LogKind.ENDED, 1)]


ANSWERS_S = st.lists(st.floats(0.0002, 0.09), min_size=2, max_size=60)
POLL_S = 0.5
"""Exact in binary, and ten of them are the time that is kept."""


@given(ANSWERS_S)
def test_it_tells_the_longest_answer_of_the_last_seconds_rounded_up(answers_s: list[float]) -> None:
    link = LinkTime()
    for number, answer_s in enumerate(answers_s):
        told_ms = link.see(number * POLL_S, answer_s)
        recent = [
            each for place, each in enumerate(answers_s[: number + 1]) if (number - place) * POLL_S <= KEPT_S
        ]
        assert told_ms == rounded_up_ms(1000.0 * max(recent))


@pytest.mark.parametrize(
    ("answer_ms", "told_ms"),
    [(0.2, 1.0), (1.0, 1.0), (1.1, 2.0), (4.9, 5.0), (5.1, 10.0), (11.0, 20.0), (480.0, 500.0)],
)
def test_figures_are_one_two_and_five(answer_ms: float, told_ms: float) -> None:
    assert rounded_up_ms(answer_ms) == told_ms


@given(st.lists(st.floats(0.0021, 0.0049), min_size=50, max_size=50))
def test_answers_that_scatter_are_one_figure(answers_s: list[float]) -> None:
    link = LinkTime()
    told = [link.see(number * POLL_S, answer_s) for number, answer_s in enumerate(answers_s)]
    assert all(before == after for before, after in pairwise(told))
