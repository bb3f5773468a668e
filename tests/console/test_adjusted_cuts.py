"""A cut whose override or trim the operator changes while it runs: judged as any, and the part shows it."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.data.measured_part import CutPart, MadeWith, made_with, parts_made
from console.session.learning.part_learning import learning_of
from console.session.station.commands import (
    Adjust,
    Command,
    EndCut,
    HoldFeed,
    Measure,
    Recover,
    ResumeFeed,
    Retract,
    Start,
)
from console.session.station.progress import CutProgress, CutStage, Synchronisation
from console.session.station.state import Activity, MeasuredPart
from drivers.cutting.bounds import Adjustable
from drivers.cutting.planning import Strategy
from drivers.errors import LinkError
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from profiles.traces import Trace
from tests.console.floor import Floor, codes, experiment_1, in_turn, order, set_up_once

FASTER = Adjust(what=Adjustable.OVERRIDE, steps=1)
SLOWER = Adjust(what=Adjustable.OVERRIDE, steps=-1)
MORE = Adjust(what=Adjustable.GAIN, steps=1)
LATER = Adjust(what=Adjustable.PHASE, steps=1)


@pytest.fixture
def floor(tmp_path: Path, in_copies: None) -> Floor:
    return set_up_once(tmp_path)


def cut_of(floor: Floor) -> CutProgress:
    assert floor.state.cut is not None
    return floor.state.cut


def phase_deg(cut: CutProgress) -> float | None:
    return None if cut.phase is None else cut.phase.error_deg


def press(floor: Floor, turn: float, *commands: Command) -> None:
    """Press keys at a turn of the cut."""
    floor.when(lambda _: in_turn(floor, turn), lambda: order(floor, *commands))


def armed(floor: Floor, strategy: Strategy = Strategy.PVT, length_mm: float = 1.5) -> None:
    floor.arm(experiment_1(length_mm), strategy)
    assert floor.state.armed is not None, floor.state.refusals


def percent(floor: Floor) -> float:
    """The override of the controller."""
    return floor.sim.controller.systems[1].time_base.percent


def another_host(floor: Floor, line: str) -> None:
    port = floor.sim.connect()
    port.receive(f"{line}\r".encode("latin-1"))
    floor.sim.attend(port)


def events(floor: Floor, kind: str) -> list[dict[str, object]]:
    floor.station.close("quit")
    with sqlite3.connect(floor.context.records / "records.sqlite3") as record:
        rows = record.execute("SELECT data FROM events WHERE kind = ? ORDER BY number", (kind,)).fetchall()
    return [json.loads(data) for (data,) in rows]


def ront_um(floor: Floor) -> float:
    floor.do(Measure())
    assert floor.state.measured is not None
    return floor.state.measured.result.ront_um


@pytest.mark.parametrize(
    "strategy",
    [Strategy.PVT, *(pytest.param(each, marks=pytest.mark.long) for each in (Strategy.CAM, Strategy.NONE))],
)
@pytest.mark.long
def test_spindle_and_feed_slow_down_together(floor: Floor, strategy: Strategy) -> None:
    """At 96 % the lobe is as before by the angle; the servo leaves what another frequency means, no more."""
    seen: list[CutProgress] = []
    overrides: list[float] = []
    floor.looks.append(lambda snapshot: overrides.append(snapshot.override_percent))
    floor.looks.append(lambda _: seen.append(cut_of(floor)) if in_turn(floor, 0.0) else None)
    armed(floor, strategy, 2.0)
    press(floor, 8.0, SLOWER, SLOWER, SLOWER, SLOWER)
    state = floor.do(Start())
    assert state.cut_done and codes(state) == [] and state.refusals == ()
    cut = state.cut
    assert cut is not None and cut.figures is not None
    assert (cut.turn, cut.adjusted.override_percent) == (40.0, 100)
    assert min(overrides) == pytest.approx(96.0) and percent(floor) == 100.0
    slow = [each for each in seen if each.turn > 30.0 and not each.holding]
    assert slow[0].speed_rpm == pytest.approx(960.0, abs=1.0)
    assert slow[0].left_s == pytest.approx((40.0 - slow[0].turn) * 0.06 / 0.96, abs=0.01)
    assert 960.0 < cut.figures.spindle_speed_rpm < 1000.0
    left_um = 55.0 if strategy is Strategy.NONE else 0.0
    # Half of the tolerance of 5 um, and what the strategy leaves at 100 %.
    assert left_um - 0.3 < ront_um(floor) < left_um + 2.6


@pytest.mark.long
def test_an_override_beyond_its_band_is_refused_with_the_number(floor: Floor) -> None:
    """Presses between two polls do not pass the bound either."""
    found: list[tuple[str, str]] = []

    def ask(*commands: Command) -> Callable[[], None]:
        def act() -> None:
            for command in commands:
                assert not floor.station.post(command)
                found.append((floor.state.refusals[0].code, floor.state.refusals[0].limit))

        return act

    for command in (SLOWER, MORE):
        ask(command)()
    armed(floor)
    assert floor.state.armed is not None
    bounds = floor.state.armed.bounds
    assert 100 - bounds.low_percent == bounds.high_percent - 100 == 5
    ask(FASTER)()  # armed, not running
    floor.when(lambda _: floor.state.cut is not None and floor.state.cut.stage is CutStage.RUN_UP, ask(FASTER))
    press(floor, 3.0, *[FASTER] * 9)
    floor.when(lambda _: in_turn(floor, 6.0), ask(FASTER))
    most: list[float] = []
    floor.looks.append(lambda snapshot: most.append(snapshot.override_percent))
    assert floor.do(Start()).cut_done and max(most) == pytest.approx(105.0)
    early, bound = ("cut.adjust_early", ""), ("cut.override_bound_inverse", "95 … 105 %")
    assert found == [*[("session.nothing_to_adjust", "")] * 3, early, bound]


@pytest.mark.parametrize(
    ("strategy", "command", "code"),
    [
        (Strategy.TIMEBASE, SLOWER, "cut.no_override"),
        (Strategy.CAM, MORE, "cut.no_trim"),
        (Strategy.NONE, LATER, "cut.no_trim"),
    ],
)
@pytest.mark.long
def test_what_a_strategy_cannot_is_refused(floor: Floor, strategy: Strategy, command: Command, code: str) -> None:
    found: list[str] = []

    def ask() -> None:
        assert not floor.station.post(command)
        found.extend(problem.code for problem in floor.state.refusals)

    armed(floor, strategy, 1.0)
    floor.when(lambda _: in_turn(floor, 2.0), ask)
    assert floor.do(Start()).cut_done and found == [code]


def test_another_override_than_ours_stops_the_cut(floor: Floor) -> None:
    armed(floor)
    press(floor, 5.0, SLOWER, SLOWER)
    floor.when(lambda _: in_turn(floor, 10.0), lambda: another_host(floor, "&1%90"))
    state = floor.do(Start())
    assert state.activity is Activity.STOPPED
    (problem,) = [alarm.problem for alarm in state.alarms if alarm.problem.code == "cut.override"]
    assert problem.limit == "98 %"


def test_after_a_stop_or_a_lost_console_under_an_override_arming_is_at_real_time(floor: Floor) -> None:
    another_host(floor, "&1%97")
    floor.idle()
    armed(floor)
    floor.idle()
    assert floor.state.armed is not None and percent(floor) == 100.0
    press(floor, 5.0, SLOWER, SLOWER)
    floor.when(lambda _: in_turn(floor, 10.0), lambda: floor.stop.stop("space"))
    state = floor.do(Start())
    assert state.activity is Activity.STOPPED and state.stop is not None and state.stop.tool_in_part
    assert percent(floor) == 98.0  # nothing of ours is sent after a stop but what the operator asks for
    assert not floor.station.post(FASTER)
    floor.do(Recover(), Retract())
    floor.idle()
    assert percent(floor) == 100.0
    assert events(floor, "override_restored")[0]["percent"] == 97.0


def test_a_link_that_is_lost_under_an_override_stays_in_its_band(
    floor: Floor, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose() -> None:
        def fails(*_: object) -> bytes:
            raise LinkError(Problem(code="link.lost"))

        monkeypatch.setattr(floor.link, "receive", fails)
        monkeypatch.setattr(floor.link, "send", fails)

    armed(floor)
    press(floor, 5.0, SLOWER)
    floor.when(lambda _: in_turn(floor, 10.0), lose)
    state = floor.do(Start())
    assert state.activity is Activity.LOST
    assert not floor.station.post(SLOWER)
    floor.sim.wait(0.1)
    assert percent(floor) == 99.0


@pytest.mark.parametrize("commands", [(SLOWER, SLOWER, SLOWER), (MORE, LATER)])
@pytest.mark.long
def test_a_changed_cut_is_held_and_resumed_as_any(floor: Floor, commands: tuple[Command, ...]) -> None:
    found: list[str] = []
    left_s: list[float] = []

    def held(_: object) -> bool:
        cut = floor.state.cut
        if cut is not None and cut.held_left_s is not None:
            left_s.append(cut.held_left_s)
        return floor.state.paused

    def resume() -> None:
        assert not floor.station.post(commands[0])
        found.extend(problem.code for problem in floor.state.refusals)
        order(floor, ResumeFeed())

    armed(floor)
    press(floor, 4.0, *commands)
    press(floor, 8.0, HoldFeed())
    floor.when(held, resume)
    state = floor.do(Start())
    assert state.cut_done and codes(state) == []
    assert found == ["cut.adjust_held"]
    pace = 0.97 if commands[0] is SLOWER else 1.0
    assert left_s[0] == pytest.approx(600.0 / pace, abs=0.2)
    assert state.cut is not None and state.cut.tool_error_peak_um < 4.0


def test_f7_ends_a_cut_under_an_override_and_returns_to_real_time(floor: Floor) -> None:
    armed(floor)
    press(floor, 4.0, SLOWER, SLOWER)
    press(floor, 8.0, EndCut())
    state = floor.do(Start())
    assert state.activity is Activity.READY and codes(state) == [] and not state.cut_done
    assert percent(floor) == 100.0
    assert not floor.station.post(SLOWER)


def third_harmonic(measured: MeasuredPart) -> complex:
    """c of Re(c exp(3j angle)) of a part, um, by the angle from jaw 1."""
    angle = np.radians(measured.trace.angle_deg - measured.jaw_1_deg)
    return complex(2.0 * np.mean(measured.trace.deviation_um * np.exp(-3j * angle)))


@pytest.mark.parametrize("strategy", [Strategy.PVT, pytest.param(Strategy.TIMEBASE, marks=pytest.mark.long)])
def test_a_trim_is_in_the_part_to_the_number_and_the_angle(floor: Floor, strategy: Strategy) -> None:
    """A path 1.04 times as high and 2 degrees later takes 27.5 um 1.04 cos 3(a - 2) off a lobe 27.5 um cos 3a."""
    moments: list[CutProgress] = []
    floor.looks.append(lambda _: moments.append(cut_of(floor)) if in_turn(floor, 20.0) else None)
    armed(floor, strategy, 2.4)
    press(floor, 1.5, *[MORE] * 4, *[LATER] * 4)
    state = floor.do(Start())
    assert state.cut_done and codes(state) == [] and state.refusals == ()
    # The needle shows the trim; a tool that is where it was trimmed to is in synchronisation.
    assert {moment.synchronisation for moment in moments} == {Synchronisation.IN_SYNC}
    phases_deg = [phase_deg(moment) for moment in moments if moment.stage is CutStage.CUT]
    assert phases_deg[-1] == pytest.approx(2.0, abs=0.1)
    last = moments[-1].adjusted
    assert (last.trim.gain_percent, last.trim.phase_deg) == (4.0, 2.0)
    assert last.applied == last.trim
    floor.do(Measure())
    assert floor.state.measured is not None
    assert abs(third_harmonic(floor.state.measured) - 27.5 * (1.0 - 1.04 * np.exp(-6j * np.pi / 180.0))) < 0.15


@pytest.mark.long
def test_a_trim_takes_the_phase_back_that_an_override_has_cost(floor: Floor) -> None:
    """Slower, the servo lags by less than what was inverted: the tool is early."""
    phases_deg: dict[str, float | None] = {}

    def keep(name: str) -> Callable[[], None]:
        return lambda: phases_deg.update({name: phase_deg(cut_of(floor))})

    armed(floor, length_mm=3.5)
    press(floor, 3.0, *[SLOWER] * 4)
    floor.when(lambda _: in_turn(floor, 30.0), keep("slower"))
    press(floor, 31.0, LATER)
    floor.when(lambda _: in_turn(floor, 65.0), keep("trimmed"))
    assert floor.do(Start()).cut_done
    slower, trimmed = phases_deg["slower"], phases_deg["trimmed"]
    assert slower is not None and trimmed is not None
    assert -0.8 < slower < -0.4
    assert trimmed - slower == pytest.approx(0.5, abs=0.1)


def test_a_trim_beyond_its_bound_is_refused_with_the_number(floor: Floor) -> None:
    found: list[tuple[str, str]] = []

    def ask() -> None:
        for command in (MORE, LATER):
            assert not floor.station.post(command)
            found.append((floor.state.refusals[0].code, floor.state.refusals[0].limit))

    armed(floor)
    press(floor, 3.0, *[MORE] * 10, *[LATER] * 10)
    floor.when(lambda _: in_turn(floor, 8.0), ask)
    state = floor.do(Start())
    assert state.cut_done and codes(state) == []
    assert found == [("cut.trim_bound", "-10 … 10 %"), ("cut.trim_bound", "-5 … 5 deg")]


def test_a_trim_of_another_host_is_no_planned_cut(floor: Floor) -> None:
    armed(floor)
    press(floor, 3.0, MORE)
    floor.when(lambda _: in_turn(floor, 8.0), lambda: another_host(floor, "P53=1.05"))
    state = floor.do(Start())
    assert "cut.trim_differs" in codes(state) and not state.cut_done


def test_a_trim_beyond_what_was_judged_is_put_back_by_the_program(floor: Floor) -> None:
    armed(floor)
    floor.when(lambda _: in_turn(floor, 5.0), lambda: another_host(floor, "P53=3 P54=90"))
    state = floor.do(Start())
    assert state.cut_done and codes(state) == []
    assert ront_um(floor) < 0.5


@pytest.mark.long
def test_the_record_has_each_change_and_how_the_part_was_made(floor: Floor) -> None:
    armed(floor)
    press(floor, 3.0, SLOWER, MORE)
    press(floor, 9.0, LATER)
    assert floor.do(Start()).cut_done
    changes = events(floor, "adjusted")
    assert [(each["what"], each["value"]) for each in changes] == [
        ("override", 99.0),
        ("gain", 1.0),
        ("phase", 0.5),
    ]
    assert [each["phase_deg"] for each in events(floor, "trimmed")] == [0.0, 0.5]
    (cut,) = events(floor, "cut")
    assert str(cut["changed"]).startswith("override 99 %, gain +1 %, phase +0.5 deg, changed from Z 0.")


def test_a_part_that_was_changed_teaches_nothing_and_says_what_it_was(tmp_path: Path) -> None:
    """By its record as by the header of its trace: both keep it."""
    made = MadeWith(compensation="none", strategy="pvt", stage="full", inverted="model", changed="gain +1 %")
    assert parts_made([("cut", json.dumps(made.event()), "")]) == [made]
    plain = replace(made, changed="")
    assert "changed" in made.header() and "changed" not in plain.header()
    assert made_with({}, made.header(), []).changed == "gain +1 %"
    machine, loaded = load_machine("lee-2001-lathe"), load_job("lee-2001-experiment-1")
    trace = Trace(angle_deg=np.arange(0.0, 360.0), deviation_um=np.zeros(360), meta={})
    found = learning_of(loaded, loaded.job.name, CutPart(made=made), trace, machine, tmp_path)
    assert [(problem.code, problem.value) for problem in found.reasons] == [
        ("learned.changed_in_cut", "gain +1 %")
    ]
