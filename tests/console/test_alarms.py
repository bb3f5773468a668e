"""Alarms: the first stays in front, being seen is not being cured."""

from __future__ import annotations

import pytest

from console.session.station.alarms import (
    CONDITIONS,
    Alarms,
    Priority,
    acknowledged,
    cleared,
    foremost,
    raised,
    recovered,
    seen,
    unseen,
    with_faults,
)
from profiles.problem import Problem

FAULT, LINK = Problem(code="machine.fault"), Problem(code="link.lost")


def both() -> Alarms:
    return raised(raised((), FAULT, Priority.HIGH, 1.0), LINK, Priority.HIGH, 2.0)


def test_the_first_alarm_stays_in_front_of_its_flood() -> None:
    front = foremost(raised(both(), LINK, Priority.HIGH, 3.0))
    assert front is not None and front.problem == FAULT


def test_what_is_so_comes_before_what_is_over() -> None:
    link_is_back = cleared(raised((), LINK, Priority.HIGH, 1.0), LINK.code)
    assert foremost(link_is_back) is not None
    front = foremost(raised(link_is_back, FAULT, Priority.HIGH, 2.0))
    assert front is not None and front.problem == FAULT


def test_one_that_comes_again_is_counted_and_wants_attention_again() -> None:
    (again,) = raised(acknowledged(raised((), FAULT, Priority.HIGH, 1.0)), FAULT, Priority.HIGH, 5.0)
    assert (again.count, again.acknowledged, again.at_s) == (2, False, 1.0)


def test_one_that_was_not_seen_comes_before_one_that_was() -> None:
    alarms = raised(acknowledged(raised((), FAULT, Priority.HIGH, 1.0)), LINK, Priority.LOW, 2.0)
    front = foremost(alarms)
    assert front is not None and front.problem == LINK


def test_being_seen_does_not_clear_what_is_still_so() -> None:
    assert [alarm.problem for alarm in acknowledged(both())] == [FAULT, LINK]


def test_an_alarm_whose_cause_went_stays_until_it_was_seen() -> None:
    gone = cleared(both(), "machine.fault")
    assert [alarm.active for alarm in gone] == [False, True]
    assert [alarm.problem for alarm in acknowledged(gone)] == [LINK]
    assert cleared(acknowledged(both()), "machine.fault", "link.lost") == ()


def test_no_alarm_is_nothing_to_show() -> None:
    assert foremost(()) is None


def test_one_alarm_is_acknowledged_and_the_next_comes_to_the_front() -> None:
    """Only what was in the row was seen; the number beside it counts down to none."""
    alarms, fronts = both(), []
    while waiting := unseen(alarms):
        front = foremost(alarms)
        assert front is not None
        fronts.append((front.problem.code, len(waiting)))
        alarms = seen(alarms)
    assert fronts == [("machine.fault", 2), ("link.lost", 1)]
    assert seen(()) == ()
    assert unseen(seen(both(), (FAULT, LINK))) == (), "the list of messages shows all of them"


def test_what_was_not_on_the_screen_is_not_acknowledged() -> None:
    """An alarm of a higher priority comes between the row and the key."""
    low = raised((), LINK, Priority.LOW, 1.0)
    alarms = seen(raised(low, FAULT, Priority.HIGH, 2.0), (LINK,))
    assert [alarm.acknowledged for alarm in alarms] == [True, False]


def test_over_the_way_back_from_a_stop_conditions_stand_and_events_are_over() -> None:
    condition, event = Problem(code="owner.ousted"), Problem(code="machine.not_arrived")
    assert condition.code in CONDITIONS and event.code not in CONDITIONS
    alarms = raised(raised((), condition, Priority.HIGH, 1.0), event, Priority.HIGH, 2.0)
    assert recovered(acknowledged(alarms)) == acknowledged(alarms)[:1]
    assert [alarm.active for alarm in recovered(alarms)] == [True, False]


TOOL, LIMIT = "tool: amplifier_fault", "carriage: positive_limit"


def told(alarms: Alarms) -> list[tuple[str, str, bool, bool]]:
    return [(a.problem.key, a.problem.value, a.active, a.acknowledged) for a in alarms]


def test_a_fault_is_told_once_as_long_as_it_stands() -> None:
    first = with_faults((), (TOOL,), 1.0)
    assert told(first) == [("rest", TOOL, True, False)]
    known = with_faults(acknowledged(first), (TOOL,), 2.0)
    assert told(known) == [("rest", TOOL, True, True)]
    assert with_faults(known, (), 3.0) == ()
    assert told(with_faults(first, (), 3.0)) == [("rest", TOOL, False, False)]


def test_a_fault_that_comes_to_another_wants_attention_again() -> None:
    one = acknowledged(with_faults((), (TOOL,), 1.0))
    two = with_faults(one, (TOOL, LIMIT), 2.0)
    assert told(two) == [("rest", f"{TOOL}, {LIMIT}", True, False)]
    # One of them goes: that is nothing to look at.
    assert told(with_faults(acknowledged(two), (LIMIT,), 3.0)) == [("rest", f"{TOOL}, {LIMIT}", True, True)]


@pytest.mark.parametrize("seen_before", [False, True])
def test_the_fault_that_stopped_a_motion_is_not_told_again_at_rest(seen_before: bool) -> None:
    stopped = raised((), Problem(code="machine.fault", key="program", value=TOOL), Priority.HIGH, 1.0)
    alarms = acknowledged(stopped) if seen_before else stopped
    after = with_faults(recovered(with_faults(alarms, (TOOL,), 2.0)), (TOOL,), 3.0)
    assert told(after) == [("program", TOOL, True, seen_before)]
    assert [alarm.problem.value for alarm in with_faults(after, (TOOL, LIMIT), 4.0)] == [TOOL, LIMIT]
