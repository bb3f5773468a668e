"""A console that did not run for a while, on a lathe whose time is stepped: nothing begins, nothing is armed."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from console.session.dated_input import PLACES, ROW, InputAge
from console.session.station.commands import Jog, Start
from console.session.station.state import Activity, StationState
from drivers import clock
from drivers.clock import FROZEN_S, OLD_S, FreezeWatch
from drivers.lathe.snapshot import AxisName
from tests.console.floor import Floor, experiment_1

JOG = Jog(axis=AxisName.CARRIAGE, distance=-1.0)


def codes(state: StationState) -> list[str]:
    return [problem.code for problem in state.refusals]


@dataclass
class Froze:
    """A watch that has seen a pause of so many seconds."""

    froze_s: float = 0.0

    def forget(self) -> None:
        self.froze_s = 0.0


def freezes_in(floor: Floor, monkeypatch: pytest.MonkeyPatch, at_poll: int, for_s: float = 3.0) -> None:
    """Let the process be frozen at a poll within the next command."""
    watch, polls = Froze(), [0]
    monkeypatch.setattr(floor.stop, "freezes", watch)

    def look(_: object) -> None:
        polls[0] += 1
        if polls[0] == at_poll:
            watch.froze_s = for_s

    floor.looks.append(look)


def test_of_an_approach_nothing_further_begins(aligned: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    assert aligned.arm(experiment_1()).armed is not None
    freezes_in(aligned, monkeypatch, at_poll=20)
    state = aligned.do(Start())
    assert state.activity is not Activity.CUTTING and not state.cut_done
    said = [*codes(state), *(alarm.problem.code for alarm in state.alarms)]
    assert "session.frozen" in said
    assert state.snapshot is not None and state.snapshot.at_rest


def test_what_froze_before_a_command_does_not_count(aligned: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(aligned.stop, "freezes", Froze(froze_s=30.0))
    assert codes(aligned.do(JOG)) == []


def test_a_cut_that_was_armed_meanwhile_is_disarmed(aligned: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    freezes_in(aligned, monkeypatch, at_poll=1)
    state = aligned.arm(experiment_1())
    assert state.armed is None and codes(state) == ["session.frozen"]


def test_an_idle_machine_that_was_not_polled_is_disarmed(aligned: Floor) -> None:
    assert aligned.arm(experiment_1(), valid_s=60.0).armed is not None
    aligned.sim.wait(FROZEN_S + 0.5)
    aligned.station.step()
    assert aligned.state.armed is None and codes(aligned.state) == ["session.frozen"]


def test_a_command_that_waited_is_not_carried_out(aligned: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    assert aligned.station.post(JOG)
    monkeypatch.setattr(aligned.station, "_posted_s", aligned.station._posted_s - OLD_S - 0.1)
    before = aligned.lathe.snapshot().carriage.position
    aligned.station.step()
    assert codes(aligned.state) == ["session.frozen"]
    assert aligned.lathe.snapshot().carriage.position == pytest.approx(before, abs=2.0)


def test_the_watch_sees_a_pause_whoever_looks_first(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(clock, "boot_s", lambda: now[0])
    monkeypatch.setattr("threading.Thread.start", lambda thread: None)
    watch = FreezeWatch()
    now[0] += FROZEN_S - 0.1
    assert watch.froze_s == 0.0
    now[0] += 22.0
    assert (watch.froze_s, watch.froze_s) == (22.0, 22.0)
    watch.forget()
    assert (watch.froze_s, watch.woke_from_s(0.5)) == (0.0, 22.0)
    now[0] += 0.6
    assert watch.woke_from_s(0.5) == 0.0


def test_an_answer_dates_only_what_comes_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Questions and answers by hand: what came before the answer was typed at an unknown time."""
    now = [50.0]
    monkeypatch.setattr("console.session.dated_input.boot_s", lambda: now[0])
    age = InputAge()
    asks = age.question(now[0])
    assert asks is not None and age.late_s() is not None and age.late_s(moves=False) is None
    age.asked(asks[0], now[0])
    now[0] += 0.3
    age.emptied(now[0])
    assert age.answered(ROW, asks[0], now[0]) and age.late_s() is None
    assert age.round_trip_s == pytest.approx(0.3)
    now[0] += OLD_S
    age.emptied(now[0])
    assert age.late_s() == pytest.approx(OLD_S + 0.3), "nothing was heard since"
    assert not age.answered(ROW, asks[0], now[0]), "an answer counts once"


def test_no_answer_is_taken_for_that_of_a_later_question() -> None:
    age, at_s = InputAge(), 0.0
    for _ in range(PLACES):
        asks = age.question(at_s)
        assert asks is not None
        age.asked(asks[0], at_s)
        at_s += 1.0
    assert age.question(at_s) is None
