"""Alarms: the first stays in front, being seen is not being cured."""

from __future__ import annotations

from console.session.alarms import Alarms, Priority, acknowledged, cleared, foremost, raised
from profiles.problem import Problem

FAULT, LINK = Problem(code="machine.fault"), Problem(code="link.lost")


def both() -> Alarms:
    return raised(raised((), FAULT, Priority.HIGH, 1.0), LINK, Priority.HIGH, 2.0)


def test_the_first_alarm_stays_in_front_of_its_flood() -> None:
    front = foremost(raised(both(), LINK, Priority.HIGH, 3.0))
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
