"""What happens to a machine at rest: another host, a limit, a collision, a pause; nothing is cut on it."""

from __future__ import annotations

import json
import re
import sqlite3
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.session.cut.retracting import retracted_by_distance
from console.session.dated_input import PLACES, ROW, InputAge
from console.session.station.alarms import Priority, collision_problems
from console.session.station.commands import (
    Acknowledge,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    Home,
    Jog,
    Recover,
    Start,
)
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from drivers import clock
from drivers.clock import FROZEN_S, OLD_S, FreezeWatch
from drivers.cutting.strategy import Strategy
from drivers.lathe.snapshot import AxisName, AxisState
from drivers.pmac.client import PmacClient
from drivers.simulator.plant.workshop_view import CollisionKind
from profiles.store import load_machine
from tests.console.floor import Floor, experiment_1, known, open_floor, refused_codes
from tests.drivers.test_collisions import printed_program
from tests.drivers.test_limits_of_a_cut import polled
from tests.system.lathe_sites import compact

POLL_S = 0.1


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    """A machine that is aligned, at rest."""
    floor = open_floor(tmp_path)
    floor.set_up(experiment_1(1.5))
    looks(floor)
    return floor


def looks(floor: Floor, count: int = 5) -> None:
    for _ in range(count):
        floor.idle(POLL_S)


def another_sends(floor: Floor, line: bytes) -> None:
    floor.sim.connect().receive(line + b"\r")
    looks(floor)


def codes(floor: Floor) -> set[str]:
    return {alarm.problem.code for alarm in floor.state.alarms if alarm.active}


@pytest.mark.parametrize("line", [b"#1HMZ", b"#3HMZ", b"#2HMZ"])
def test_a_zero_that_another_host_sets_voids_home_jaw_1_and_touch_off(floor: Floor, line: bytes) -> None:
    floor.lathe.jog_by(AxisName.SPINDLE, 1234.0)
    looks(floor)
    another_sends(floor, line)
    alignment = floor.state.alignment
    assert "controller.zero_shifted" in codes(floor)
    assert (alignment.homed, alignment.jaw, alignment.touch_off) == (False, None, None)
    for _ in range(2):  # and it stays so, however often it is tried
        floor.arm(experiment_1(1.5), Strategy.CAM)
        assert floor.state.armed is None
    floor.do(Home())
    looks(floor, 1)
    assert floor.state.alignment.homed
    assert "controller.zero_shifted" not in codes(floor)


def test_a_zero_that_is_set_while_a_cut_is_armed_starts_nothing_ever(floor: Floor) -> None:
    floor.arm(experiment_1(1.5), Strategy.CAM)
    assert floor.state.armed is not None
    another_sends(floor, b"#1HMZ")
    for _ in range(2):
        floor.do(Start())
        assert floor.state.cut is None
    assert not floor.state.alignment.homed


def test_a_zero_that_is_set_with_the_drives_off_is_seen(floor: Floor) -> None:
    for line in (b"#1K#2K#3K", b"#3HMZ"):
        another_sends(floor, line)
    assert "controller.zero_shifted" in codes(floor)
    floor.do(EnableDrives())
    assert not floor.state.alignment.homed


@pytest.mark.parametrize(("line", "axis"), [(b"#3J^-8000", "carriage"), (b"#1J-", "tool"), (b"#2J+", "spindle")])
def test_an_axis_that_another_host_moves_is_stopped_and_has_no_home(floor: Floor, line: bytes, axis: str) -> None:
    another_sends(floor, line)
    looks(floor, 30)
    alarm = next(alarm for alarm in floor.state.alarms if alarm.problem.code == "machine.moves_unasked")
    assert axis in alarm.problem.key
    assert floor.state.activity is Activity.STOPPED
    assert floor.state.stop is not None and floor.state.stop.rest_s is not None
    floor.do(Recover())
    assert not floor.state.alignment.homed


def test_a_drive_that_another_host_switches_off_is_an_alarm_until_all_are(floor: Floor) -> None:
    another_sends(floor, b"#1K")
    alarm = next(alarm for alarm in floor.state.alarms if alarm.problem.code == "machine.opened_unasked")
    assert alarm.problem.key == "tool"
    another_sends(floor, b"#2K#3K")
    assert "machine.opened_unasked" not in codes(floor)


@pytest.mark.parametrize(("line", "axis"), [(b"I322=50", AxisName.CARRIAGE), (b"I121=5", AxisName.TOOL)])
def test_a_jog_that_another_host_made_faster_is_refused(floor: Floor, line: bytes, axis: AxisName) -> None:
    another_sends(floor, line)
    floor.do(Jog(axis=axis, distance=-0.5))
    (refused,) = floor.state.refusals
    assert (refused.code, refused.key) == ("controller.setting", line.partition(b"=")[0].decode())
    snapshot = known(floor.state.snapshot)
    assert snapshot.at_rest


def test_own_jogs_and_own_switching_are_no_deeds_of_another(floor: Floor) -> None:
    for axis, counts in ((AxisName.TOOL, -20.0), (AxisName.CARRIAGE, 3.0), (AxisName.SPINDLE, 500.0)):
        floor.lathe.jog_by(axis, counts)
        looks(floor)
    assert floor.state.alignment.homed
    assert codes(floor) == set()


OFF = Jog(axis=AxisName.CARRIAGE, distance=-1.0)


@pytest.fixture
def standing(tmp_path: Path) -> Floor:
    """The carriage is homed, and stands on its positive limit switch."""
    floor = open_floor(tmp_path)
    floor.do(DisableDrives(), EnableDrives(), Home(), Jog(axis=AxisName.CARRIAGE, distance=10.0))
    floor.sim.faults.ask("limit", {"motor": "carriage", "direction": "positive"})
    floor.idle()
    return floor


def test_a_limit_that_is_met_stops_the_machine_and_again_once_it_was_left(standing: Floor) -> None:
    assert standing.state.stop is not None
    assert [alarm.problem.value for alarm in standing.state.alarms] == ["carriage: positive_limit"]
    standing.idle()
    standing.do(Recover())
    before = standing.lathe.snapshot().carriage.position
    state = standing.do(OFF)
    assert state.stop is None and state.activity is Activity.READY, state.alarms
    assert standing.lathe.snapshot().carriage.position == pytest.approx(before - 1000.0, abs=2.0)
    standing.sim.faults.clear()
    assert standing.idle().stop is None
    standing.sim.faults.ask("limit", {"motor": "carriage", "direction": "positive"})
    assert standing.idle().stop is not None


def told(floor: Floor) -> list[tuple[str, str, int, bool]]:
    """The alarms: key, value, how often raised, whether acknowledged."""
    return [(a.problem.key, a.problem.value, a.count, a.acknowledged) for a in floor.state.alarms]


def test_a_limit_that_was_acknowledged_stays_so_until_it_is_left(standing: Floor) -> None:
    """The way back from the stop makes no new alarm of it: the machine still stands on the switch."""
    assert standing.station.post(Acknowledge())
    known = [("poll", "carriage: positive_limit", 1, True)]
    assert told(standing) == known
    standing.do(Recover())
    for _ in range(3):
        standing.idle()
        assert told(standing) == known
    standing.sim.faults.clear()
    standing.do(OFF)
    assert standing.idle().alarms == ()


@pytest.mark.parametrize("axis", ["tool", "carriage"])
def test_a_fault_of_an_amplifier_is_one_alarm_until_the_drives_are_on_again(tmp_path: Path, axis: str) -> None:
    """It ends a jog: the motion, the stop and the look behind it tell of one and the same thing."""
    floor = open_floor(tmp_path)
    floor.do(DisableDrives(), EnableDrives(), Home())

    def trip() -> None:
        floor.sim.faults.ask("amplifier-fault", {"motor": axis})

    floor.when(lambda look: "desired_velocity_zero" not in look.carriage.flags, trip)
    floor.do(Jog(axis=AxisName.CARRIAGE, distance=10.0))
    fault = f"{axis}: amplifier_fault"
    floor.idle()
    assert told(floor) == [("jog carriage", fault, 1, False)]
    assert floor.station.post(Acknowledge())
    floor.do(Recover())
    floor.idle()
    assert told(floor) == [("jog carriage", fault, 1, True)]
    floor.sim.faults.clear()
    floor.do(EnableDrives())
    assert floor.idle().alarms == ()


@pytest.mark.parametrize(
    ("homed", "at_mm", "target_mm"),
    [
        (True, 55.0, 35.0),  # by the retract distance
        (True, 5.0, 0.0),  # no further than its home
        (True, -0.5, -0.5),  # nor in again
        (False, 55.0, 35.0),
        (False, 5.0, -1.9),  # 0.1 mm short of the end of its travel
        (False, -1.95, -1.95),
    ],
)
def test_without_a_part_the_tool_retracts_onto_no_limit(homed: bool, at_mm: float, target_mm: float) -> None:
    machine = compact("pmac")
    machine = replace(machine, tool=replace(machine.tool, travel_min_mm=-2.0, retract_mm=20.0))
    counts = at_mm * machine.tool.counts_per_mm
    tool = AxisState(position=counts, following_error=0.0, flags=frozenset({"home_complete"} if homed else ()))
    found = retracted_by_distance(machine, polled(tool=tool))
    assert found / machine.tool.counts_per_mm == pytest.approx(target_mm)


@pytest.fixture
def lathe_with_room(tmp_path: Path) -> Floor:
    """The printed program goes 8 mm along the part and needs the room of the whole lathe."""
    return open_floor(tmp_path, machine=load_machine("lee-2001-lathe"))


@pytest.fixture
def aligned(lathe_with_room: Floor) -> Floor:
    lathe_with_room.set_up(experiment_1(8.0))
    return lathe_with_room


def collisions_told(state: StationState) -> dict[str, tuple[int, bool]]:
    """The alarms of collisions: how often each was raised, and whether it was seen."""
    return {
        alarm.problem.code: (alarm.count, alarm.acknowledged)
        for alarm in state.alarms
        if alarm.problem.code.startswith("simulator.met_")
    }


def plunge(floor: Floor) -> StationState:
    """The printed program of the paper, to its literal last line: 2 mm further in. Another host runs it."""
    client = PmacClient(floor.link, floor.sim)
    floor.lathe.jog_to(AxisName.CARRIAGE, 174_000.0)
    client.download(printed_program())
    client.request("&1B1R")
    floor.idle(2.0)
    assert collisions_told(floor.state) == {}
    client.request("M26=1")
    for _ in range(40):
        state = floor.idle(0.1)
    assert state.snapshot is not None and state.snapshot.at_rest
    return state


@pytest.fixture
def too_late(monkeypatch: MonkeyPatch) -> None:
    """A console that does not stop what another host moves, which it would do within 0.1 s."""
    monkeypatch.setattr("console.session.station.station.unasked_motion", lambda snapshot: None)


@pytest.mark.long
@pytest.mark.usefixtures("too_late")
def test_the_last_line_of_the_printed_program_is_an_alarm_once_for_each_collision(aligned: Floor) -> None:
    state = plunge(aligned)
    # The spindle is being stopped when the tool goes in: more than 1 mm a turn first, and then none.
    met = ("simulator.met_infeed", "simulator.met_standing_part", "simulator.met_too_deep")
    assert collisions_told(state) == dict.fromkeys(met, (1, False))
    assert {alarm.priority for alarm in state.alarms} == {Priority.HIGH}
    for _ in ("controller.zero_shifted", met[0]):
        assert aligned.station.post(Acknowledge())
    assert sorted(seen for _, seen in collisions_told(aligned.state).values()) == [
        False,
        False,
        True,
    ]
    for _ in met[1:]:
        assert aligned.station.post(Acknowledge())
    # It has happened, whoever has seen it: it stays, and is not raised anew.
    assert collisions_told(aligned.idle(3.0)) == dict.fromkeys(met, (1, True))


@pytest.mark.long
@pytest.mark.usefixtures("too_late")
def test_a_new_blank_has_met_nothing_and_can_meet_again(aligned: Floor) -> None:
    plunge(aligned)
    for _ in aligned.state.alarms:
        assert aligned.station.post(Acknowledge())
    aligned.do(Home(), DisableDrives())
    assert collisions_told(aligned.do(ConfirmClamping(job=experiment_1(8.0)))) == {}
    aligned.set_up(experiment_1(8.0))
    again = set(collisions_told(plunge(aligned)))
    assert again == {"simulator.met_infeed", "simulator.met_standing_part", "simulator.met_too_deep"}


def test_a_collision_in_a_cut_is_told_before_its_end(monkeypatch: MonkeyPatch, tmp_path: Path) -> None:
    """A tool that takes nothing, put to an ordinary cut."""
    floor, job = open_floor(tmp_path), experiment_1(4.0)
    monkeypatch.setattr("drivers.simulator.plant.collision.TOOL_TAKES_MM", -0.05)
    floor.set_up(job)
    late_s: list[float] = []

    def look(_: object) -> None:
        if floor.state.activity is Activity.CUTTING and floor.sim.collisions and not collisions_told(floor.state):
            late_s.append(floor.sim.now_s() - floor.sim.collisions[0].time_ms / 1000.0)

    floor.looks.append(look)
    floor.arm(job)
    state = floor.do(Start())
    assert max(late_s) < 1.1
    assert floor.sim.now_s() - floor.sim.collisions[0].time_ms / 1000.0 > 3.0
    assert collisions_told(state) == {"simulator.met_too_deep": (1, False)}
    with sqlite3.connect(tmp_path / "records.sqlite3") as database:
        events = database.execute("SELECT data FROM events WHERE kind = 'collision'").fetchall()
    assert [json.loads(data)["met"] for (data,) in events] == ["too_deep"]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_kind_has_a_sentence_of_its_own_for_the_alarm_row(language: str) -> None:
    text = load(language)
    sentences = [text.problem(problem) for problem in collision_problems(CollisionKind)]
    assert len(set(sentences)) == len(CollisionKind)
    assert all(re.search("simulated|시뮬레이션", sentence) for sentence in sentences)


JOG = Jog(axis=AxisName.CARRIAGE, distance=-1.0)


@dataclass
class Froze:
    """A watch that has seen a pause of so many seconds."""

    froze_s: float = 0.0

    def forget(self) -> None:
        self.froze_s = 0.0


def freezes_in(floor: Floor, monkeypatch: MonkeyPatch, at_poll: int, for_s: float = 3.0) -> None:
    """Let the process be frozen at a poll within the next command."""
    watch, polls = Froze(), [0]
    monkeypatch.setattr(floor.stop, "freezes", watch)

    def look(_: object) -> None:
        polls[0] += 1
        if polls[0] == at_poll:
            watch.froze_s = for_s

    floor.looks.append(look)


def test_of_an_approach_nothing_further_begins(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    assert aligned.arm(experiment_1()).armed is not None
    freezes_in(aligned, monkeypatch, at_poll=20)
    state = aligned.do(Start())
    assert state.activity is not Activity.CUTTING and not state.cut_done
    said = [*refused_codes(state), *(alarm.problem.code for alarm in state.alarms)]
    assert "session.frozen" in said
    assert state.snapshot is not None and state.snapshot.at_rest


def test_what_froze_before_a_command_does_not_count(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setattr(aligned.stop, "freezes", Froze(froze_s=30.0))
    assert refused_codes(aligned.do(JOG)) == []


def test_a_cut_that_was_armed_meanwhile_is_disarmed(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    freezes_in(aligned, monkeypatch, at_poll=1)
    state = aligned.arm(experiment_1())
    assert state.armed is None and refused_codes(state) == ["session.frozen"]


def test_an_idle_machine_that_was_not_polled_is_disarmed(aligned: Floor) -> None:
    assert aligned.arm(experiment_1(), valid_s=60.0).armed is not None
    aligned.sim.wait(FROZEN_S + 0.5)
    aligned.station.step()
    assert aligned.state.armed is None and refused_codes(aligned.state) == ["session.frozen"]


def test_a_command_that_waited_is_not_carried_out(aligned: Floor, monkeypatch: MonkeyPatch) -> None:
    assert aligned.station.post(JOG)
    monkeypatch.setattr(aligned.station, "_posted_s", aligned.station._posted_s - OLD_S - 0.1)
    before = aligned.lathe.snapshot().carriage.position
    aligned.station.step()
    assert refused_codes(aligned.state) == ["session.frozen"]
    assert aligned.lathe.snapshot().carriage.position == pytest.approx(before, abs=2.0)


def test_the_watch_sees_a_pause_whoever_looks_first(monkeypatch: MonkeyPatch) -> None:
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


def test_an_answer_dates_only_what_comes_after_it(monkeypatch: MonkeyPatch) -> None:
    """Questions and answers by hand: what came before the answer was typed at an unknown time."""
    now = [50.0]
    monkeypatch.setattr("console.session.dated_input.boot_s", lambda: now[0])
    age = InputAge()
    asks = known(age.question(now[0]))
    assert age.late_s() is not None and age.late_s(moves=False) is None
    age.note_question(asks[0], now[0])
    now[0] += 0.3
    age.note_emptied_input(now[0])
    assert age.take_cursor_report(ROW, asks[0], now[0]) and age.late_s() is None
    assert age.round_trip_s == pytest.approx(0.3)
    now[0] += OLD_S
    age.note_emptied_input(now[0])
    assert age.late_s() == pytest.approx(OLD_S + 0.3), "nothing was heard since"
    assert not age.take_cursor_report(ROW, asks[0], now[0]), "an answer counts once"


def test_no_answer_is_taken_for_that_of_a_later_question() -> None:
    age, at_s = InputAge(), 0.0
    for _ in range(PLACES):
        asks = known(age.question(at_s))
        age.note_question(asks[0], at_s)
        at_s += 1.0
    assert age.question(at_s) is None
