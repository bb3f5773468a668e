"""What the screens advise while the machine does not answer: no restart where they come back by themselves."""

from __future__ import annotations

import pytest

from console.session.station.alarms import Priority, raised
from console.session.station.state import Activity, StationState, StopState
from console.text.catalogue import load
from console.tui.application.lost_lines import lost_step
from profiles.problem import Problem
from tests.tui.run_stage import shown, state
from tests.tui.stage import LANGUAGES


def lost(code: str, *, stopped: bool) -> StationState:
    """Return the moment after a poll failed: nothing is known yet of how long it lasts."""
    stop = StopState(reason=code, killed=False, sent_s=99.0, delivered=False) if stopped else None
    return state(activity=Activity.LOST, stop=stop, alarms=raised((), Problem(code=code), Priority.HIGH, 99.0))


@pytest.mark.parametrize("code", ["link.silent", "link.not_in_step"])
def test_a_controller_that_is_silent_is_asked_again_and_no_restart_is_advised(code: str) -> None:
    now = lost(code, stopped=True)
    said = lost_step(load("en"), now)
    assert "stop is sent again until it does" in said and said.endswith("when it answers, press F2.")
    assert "restart" not in said + shown(now).words


@pytest.mark.parametrize("stopped", [True, False])
def test_where_nothing_is_tried_again_the_way_is_to_quit(stopped: bool) -> None:
    """The connection is gone and is not opened again."""
    assert lost_step(load("en"), lost("link.lost", stopped=stopped)).endswith("quit with ^Q and restart.")


def test_a_machine_that_has_never_answered_is_asked_again() -> None:
    said = lost_step(load("en"), lost("link.not_in_step", stopped=False))
    assert "opens the link again and asks" in said and said.endswith("^Q quits.")


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_alarm_of_a_silent_controller_names_no_restart_either(language: str) -> None:
    said = load(language).problem(Problem(code="link.not_in_step", value="0.3 s"))
    assert "0.3 s" in said and "restart" not in said and "다시 시작" not in said
