"""The operator's orders on a simulated machine: a whole part, and everything that comes in between."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.session.station.commands import (
    Approach,
    ConfirmClamping,
    DisableDrives,
    EnableDrives,
    EndCut,
    Forget,
    Home,
    Jog,
    Measure,
    Recover,
    Retract,
    Start,
    TakeTouchOff,
)
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from drivers.cutting.planning import Strategy
from drivers.errors import LinkError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.language.errors import ErrorCode, PmacError
from profiles.problem import Problem
from tests.console.floor import LOGGED, Floor, experiment_1, in_turn, known, open_floor


@pytest.fixture
def floor(tmp_path: Path) -> Floor:
    return open_floor(tmp_path)


def codes(state: StationState) -> list[str]:
    return [problem.code for problem in state.refusals]


def hold(floor: Floor) -> None:
    assert floor.station.post(EndCut())


def test_an_aligned_part_comes_out_round_is_recorded_and_is_not_in_the_chuck_any_more(aligned: Floor) -> None:
    job = experiment_1()
    ways: list[Activity] = []
    aligned.looks.append(lambda _: ways.append(aligned.state.activity))
    aligned.do(Approach(job=job))
    assert Activity.APPROACHING in ways and Activity.POSITIONING not in ways
    assert aligned.state.refusals == ()
    aligned.arm(job)
    ways.clear()
    state = aligned.do(Start())
    assert Activity.POSITIONING in ways and Activity.APPROACHING not in ways
    assert state.cut is not None and state.cut.stage is CutStage.DONE and state.cut_done
    assert state.cut.figures is not None and state.cut.figures.spindle_speed_rpm == pytest.approx(1000.0, abs=0.5)
    before = aligned.do(Measure())
    # 0.05 deg of jaw angle is 0.14 um of 55, one thousandth of a millimetre of touch-off is none of roundness.
    assert before.measured is not None and before.measured.result.ront_um < 0.3
    assert aligned.state.alignment.clamping is None
    with sqlite3.connect(aligned.context.records / "records.sqlite3") as database:
        kinds = [kind for (kind,) in database.execute("SELECT kind FROM events ORDER BY number")]
        runs = database.execute("SELECT job, simulated, strategy FROM runs").fetchall()
    database.close()
    assert [kind for kind in kinds if kind not in LOGGED] == ["armed", "started", "cut", "measured"]
    assert runs == [("lee-2001-experiment-1", 1, "pvt")]
    aligned.do(EnableDrives(), Approach(job=job))
    after = known(aligned.idle().seen)
    assert after.tool_gap_mm is None
    # The chuck is the same, so jaw 1 is where it was: the spindle has not been turned.
    assert before.seen is not None
    assert after.jaw_1_past_mark_deg == pytest.approx(before.seen.jaw_1_past_mark_deg, abs=0.02)


@pytest.mark.long
def test_without_alignment_of_the_phase_the_lobe_stays(aligned: Floor) -> None:
    """The true angle of jaw 1 belongs to the plant: taken 60 deg off, the tool doubles the lobe."""
    jaw = known(aligned.state.alignment.jaw)
    wrong = replace(jaw, angle_deg=(jaw.angle_deg + 60.0) % 360.0)
    aligned.context.tell(alignment=replace(aligned.state.alignment, jaw=wrong))
    aligned.arm(experiment_1())
    aligned.do(Start())
    measured = known(aligned.do(Measure()).measured)
    assert measured.result.ront_um == pytest.approx(2 * 55.0, rel=0.01)


@pytest.mark.long
def test_a_part_cut_without_compensation_is_kept_as_the_one_before_and_not_judged(aligned: Floor) -> None:
    aligned.arm(experiment_1(), Strategy.NONE)
    cut = known(aligned.do(Start()).cut)
    assert not cut.judged and cut.phase is None
    assert aligned.state.alarms == ()
    state = aligned.do(Measure())
    assert state.uncompensated is state.measured
    assert state.measured is not None and state.measured.result.ront_um == pytest.approx(55.0, rel=0.01)


def test_a_start_that_comes_too_late_moves_nothing(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    before = aligned.idle().snapshot
    state = aligned.idle(10.5)
    assert state.armed is None and codes(state) == ["session.arm_expired"]
    state = aligned.do(Start())
    assert codes(state) == ["session.not_armed"]
    # The tool still creeps the last micrometres into its position.
    assert before is not None and state.snapshot is not None and state.snapshot.still(before, 100.0)


@pytest.mark.parametrize(
    ("line", "code"),
    [("%90", "session.arm_override"), ("#2K#1K#3K", "session.arm_realigned")],
)
def test_what_is_changed_by_another_host_disarms_at_once(aligned: Floor, line: str, code: str) -> None:
    """One that sets the feed override or opens the loops, while the summary is being read."""
    assert aligned.arm(experiment_1(), valid_s=60.0).armed is not None
    aligned.sim.connect().receive(f"{line}\r".encode())
    state = aligned.idle(0.02)
    assert state.armed is None and code in codes(state)
    aligned.idle(1.0)
    assert codes(aligned.do(Start())) == ["session.not_armed"]


def test_a_stop_in_mid_cut_and_the_way_back(aligned: Floor) -> None:
    """The speed is told over the last second; the way to rest is no part of it once rest is proven."""
    job = experiment_1()
    aligned.arm(job)
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: aligned.stop.stop("space"))
    speeds: list[float | None] = []
    aligned.looks.append(lambda _: speeds.append(aligned.state.spindle_rpm))
    state = aligned.do(Start())
    assert max(speed for speed in speeds if speed is not None) == pytest.approx(1000.0, abs=3.0)
    assert state.activity is Activity.STOPPED and state.stop is not None
    assert state.stop.reason == "space" and state.stop.rest_s is not None
    assert state.stop.tool_in_part and state.stop.can_retract and not state.cut_done
    assert not aligned.station.post(Retract())
    assert codes(aligned.state) == ["session.stopped"]
    for _ in range(10):
        now = aligned.idle(0.1)
        assert now.stop is not None and now.stop.rest_s is not None
        assert now.spindle_rpm is None or abs(now.spindle_rpm) < 1.0
    state = aligned.do(Recover())
    assert state.activity is Activity.READY and state.stop is None
    aligned.do(DisableDrives())
    other = replace(job, diameter_mm=35.0)
    assert codes(aligned.do(ConfirmClamping(job=other))) == ["machine.tool_in_part"], "another job on the screen"
    aligned.do(EnableDrives(), Retract())
    assert aligned.state.refusals == () and not aligned.state.alarms
    aligned.arm(job)
    assert aligned.do(Start()).cut_done
    measured = known(aligned.do(Measure()).measured)
    assert measured.result.ront_um < 0.3


@pytest.mark.long
def test_a_stop_in_mid_cut_says_where_it_marked_the_part(floor: Floor) -> None:
    """The part goes on turning before a tool that stands still; another cut at the same depth does not reach that.

    The part is measured in the middle of its 2 mm, where this stop comes. The path is 100 ± 27.5 um deep: of the
    lobe that it mirrors, the tool has taken away what is less deep than where it stood.
    """
    job = experiment_1(2.0)
    floor.set_up(job)
    floor.arm(job)
    half_done = 1.0 / job.feed_mm_per_rev - 0.6
    floor.when(lambda _: in_turn(floor, half_done), lambda: floor.stop.stop("space"))
    state = floor.do(Start())
    assert state.stop is not None and state.stop.of_cut and state.snapshot is not None
    # The face is 30 mm before the jaws at 40 mm; the carriage has 1000 counts a mm.
    assert state.marks_mm == (state.stop.mark_mm,)
    assert state.stop.mark_mm == pytest.approx(state.snapshot.carriage.position / 1000.0 - 10.0)
    assert state.stop.mark_mm == pytest.approx(1.0, abs=0.1)
    assert floor.context.plan is not None
    stood_um = 0.2 * (state.snapshot.tool.position - floor.context.plan.setup.surface)
    floor.do(Recover(), Retract())
    floor.arm(job)
    assert floor.do(Start()).marks_mm == state.marks_mm
    measured = known(floor.do(Measure()).measured)
    assert measured.marks_mm == state.marks_mm
    assert measured.result.ront_um == pytest.approx(min(max(stood_um - 72.5, 0.0), 55.0), abs=1.5)
    assert floor.do(ConfirmClamping(job=job)).marks_mm == ()


@pytest.mark.long
def test_a_hold_and_a_stop_beside_the_part_leave_no_mark(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: hold(aligned))
    assert aligned.do(Start()).marks_mm == ()
    aligned.arm(experiment_1())
    aligned.when(lambda s: s.program_running, lambda: aligned.stop.stop("space"))
    state = aligned.do(Start())
    assert state.stop is not None and state.marks_mm == () and state.stop.mark_mm is None


@pytest.mark.long
def test_another_stop_belongs_to_what_the_first_one_ended(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: aligned.stop.stop("space"))
    first = aligned.do(Start())
    aligned.stop.stop("escape")
    again = aligned.idle()
    assert first.stop is not None and again.stop is not None
    assert again.stop.rest_s is not None and first.stop.rest_s is not None
    assert again.stop.rest_s > first.stop.rest_s
    assert again.stop.of_cut and len(again.marks_mm) == 1
    aligned.do(Recover())
    aligned.idle(2.0)
    aligned.stop.stop("space")
    later = aligned.idle()
    assert later.stop is None and later.stops > first.stops


def test_a_hold_leaves_whole_turns_the_tool_out_and_no_tool_error(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: hold(aligned))
    state = aligned.do(Start())
    assert state.activity is Activity.READY and (state.refusals, state.alarms, state.stop) == ((), (), None)
    cut = known(state.cut)
    assert cut.stage is CutStage.HELD and not state.cut_done and 20.0 < cut.turn < 30.0
    assert cut.figures is not None and cut.figures.tool_error_um < 3.0 and cut.tool_error_peak_um < 3.0
    snapshot = known(state.snapshot)
    assert snapshot.at_rest and snapshot.homed and snapshot.loops_closed


def test_an_order_is_refused_while_another_is_carried_out(floor: Floor) -> None:
    floor.do(EnableDrives())
    answers: list[bool] = []
    floor.when(lambda s: s.moving, lambda: answers.append(floor.station.post(DisableDrives())))
    state = floor.do(Home())
    assert answers == [False]
    assert state.alignment.homed and state.alignment.drives_on


def test_a_screen_that_is_silent_in_a_cut_stops_the_machine(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    aligned.station.beat()
    state = aligned.do(Start())
    assert state.stop is not None and state.stop.reason == "screen"
    assert [alarm.problem.code for alarm in state.alarms] == ["session.screen_silent"]


def test_what_is_refused_before_anything_is_aligned(floor: Floor) -> None:
    state = floor.arm(experiment_1())
    assert state.armed is None
    assert codes(state) == [
        *("alignment.no_clamping", "alignment.drives_off", "alignment.not_homed"),
        *("alignment.no_jaw", "alignment.no_touch_off"),
    ]
    other = replace(experiment_1(), chucking_force_n=1400.0)
    assert codes(floor.do(ConfirmClamping(job=other))) == ["rule.force_differs"]
    assert floor.state.alignment.clamping is None
    floor.do(EnableDrives())
    assert codes(floor.do(ConfirmClamping(job=experiment_1()))) == ["alignment.drives_on"], "hands and drives"
    assert codes(floor.do(Jog(axis=AxisName.TOOL, distance=0.1))) == ["alignment.not_homed"]
    assert floor.state.stop is None


def test_a_stop_at_rest_is_proven_and_taken_back(floor: Floor) -> None:
    floor.stop.stop("escape")
    state = floor.idle()
    assert state.activity is Activity.STOPPED and state.stop is not None and state.stop.rest_s is not None
    assert floor.do(Recover()).activity is Activity.READY


def test_what_is_refused_and_kept_once_all_is_aligned(aligned: Floor) -> None:
    state = aligned.do(Jog(axis=AxisName.CARRIAGE, distance=1000.0))
    assert codes(state) == ["machine.beyond_travel"]
    assert state.stop is None and state.alignment.drives_on
    assert aligned.arm(experiment_1()).armed is not None
    assert aligned.do(Jog(axis=AxisName.TOOL, distance=-2.0)).armed is None, "any other order takes it back"
    assert codes(aligned.do(Start())) == ["session.not_armed"]
    aligned.idle(1.0)
    # A step toward the work ends at the part that is clamped.
    assert codes(aligned.do(Jog(axis=AxisName.TOOL, distance=2.5))) == ["machine.step_too_long"]
    assert codes(aligned.do(Jog(axis=AxisName.TOOL, distance=1.9))) == []
    state = aligned.do(TakeTouchOff(radius_mm=experiment_1().diameter_mm))
    assert codes(state) == ["alignment.touch_off_far"]
    aligned.do(Jog(axis=AxisName.CARRIAGE, distance=-10.0))
    assert codes(aligned.do(TakeTouchOff(radius_mm=experiment_1().radius_mm))) == ["alignment.beside_part"]
    alignment = aligned.do(DisableDrives()).alignment
    assert not alignment.drives_on and alignment.jaw is not None and alignment.homed
    alignment = aligned.do(Forget()).alignment
    assert alignment.touch_off is None and alignment.jaw is not None
    assert aligned.do(Forget()).alignment.jaw is None


def test_with_the_zeros_gone_the_alignment_says_why(aligned: Floor) -> None:
    for motor in aligned.sim.controller.motors.values():
        motor.home_complete = False
    alignment = aligned.idle().alignment
    assert (alignment.homed, alignment.jaw, alignment.touch_off) == (False, None, None)
    assert [problem.code for problem in alignment.lost] == ["alignment.home_lost"]


def test_leaving_in_mid_motion_stops_and_switches_off(floor: Floor) -> None:
    floor.do(EnableDrives())
    floor.station.close("SIGHUP")
    snapshot = floor.lathe.snapshot()
    assert snapshot.at_rest and snapshot.loops_open


def test_an_axis_fault_stops_everything(aligned: Floor) -> None:
    aligned.arm(experiment_1())

    def trip() -> None:
        aligned.sim.controller.motors[1].fatal_error = True

    aligned.when(lambda _: in_turn(aligned, 20.0), trip)
    state = aligned.do(Start())
    assert state.stop is not None and not state.cut_done
    assert "machine.fault" in [alarm.problem.code for alarm in state.alarms]


def test_what_is_seen_at_the_chuck_is_not_needed_for_the_machine(aligned: Floor) -> None:
    def blind(_: Snapshot) -> None:
        aligned.context.shop = None

    aligned.looks.append(blind)
    assert aligned.idle().activity is Activity.READY


@pytest.mark.long
def test_a_second_part_begins_from_the_nearest_turn(aligned: Floor) -> None:
    """The first cut leaves the spindle some eighty turns on; nobody wants it turned back."""
    job = experiment_1()
    aligned.arm(job)
    aligned.do(Start(), Measure(), ConfirmClamping(job=job), EnableDrives())
    aligned.arm(job)
    turns = [aligned.lathe.snapshot().spindle.position / 10_000.0]
    aligned.looks.append(lambda s: turns.append(s.spindle.position / 10_000.0))
    state = aligned.do(Start())
    assert state.cut_done and turns[0] > 50.0
    assert min(turns) > turns[0] - 1.0
    measured = known(aligned.do(Measure()).measured)
    assert measured.result.ront_um < 0.3


def test_drives_are_switched_on_all_or_none(floor: Floor, monkeypatch: MonkeyPatch) -> None:
    def refuse(_: int) -> None:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, "for the test")

    monkeypatch.setattr(floor.sim.controller.motors[2], "jog_speed", refuse)
    state = floor.do(EnableDrives())
    assert codes(state) == ["controller.err001"]
    assert floor.lathe.snapshot().loops_open


def test_hands_wait_for_a_spindle_that_runs_out(aligned: Floor) -> None:
    aligned.arm(experiment_1())
    aligned.when(lambda _: in_turn(aligned, 20.0), lambda: aligned.stop.kill("f9"))
    state = aligned.do(Start())
    assert state.stop is not None and state.stop.killed
    assert state.stop.rest_s is not None and state.stop.rest_s - state.stop.sent_s > 5.0


def gone(*_: object) -> bytes:
    raise LinkError(Problem(code="link.lost", value="unplugged"))


def unplug(floor: Floor, monkeypatch: MonkeyPatch) -> None:
    for name in ("send", "receive", "send_urgent"):
        monkeypatch.setattr(floor.link, name, gone)


@pytest.mark.parametrize("in_motion", [False, True])
def test_a_link_that_is_gone_is_told_once(aligned: Floor, monkeypatch: MonkeyPatch, in_motion: bool) -> None:
    """Of a machine that is lost in motion nothing is known but that it may move."""
    aligned.arm(experiment_1())
    if in_motion:
        aligned.when(lambda _: in_turn(aligned, 20.0), lambda: unplug(aligned, monkeypatch))
    else:
        unplug(aligned, monkeypatch)
    state = aligned.do(Start())
    assert state.activity is Activity.LOST and state.stop is not None and not state.stop.delivered
    assert not in_motion or (state.may_move and not state.moving and state.is_stale(state.at_s))
    for _ in range(20):
        state = aligned.idle(0.1)
    assert state.activity is Activity.LOST and [alarm.count for alarm in state.alarms] == [1]
    assert not aligned.station.post(Recover())


def test_a_fault_of_the_console_stops_the_machine_and_leaves_the_thread_alive(aligned: Floor) -> None:
    def broken(_: Snapshot) -> None:
        raise ZeroDivisionError("for the test")

    aligned.looks.append(broken)
    aligned.station.step()
    assert aligned.state.activity is not Activity.READY
    assert "session.fault" in [alarm.problem.code for alarm in aligned.state.alarms]
    aligned.looks.clear()
    assert aligned.idle().activity is Activity.STOPPED


@pytest.mark.parametrize("turned_deg", [5.0, -5.0])
def test_a_tool_off_its_path_is_an_alarm_with_what_that_leaves(aligned: Floor, turned_deg: float) -> None:
    """The path that is judged by is turned by 5 deg behind the back of the program."""
    state = aligned.arm(experiment_1())
    armed = known(state.armed)
    target = replace(armed.plan.target, phase_deg=armed.plan.target.phase_deg + turned_deg)
    aligned.context.tell(armed=replace(armed, plan=replace(armed.plan, target=target)))
    state = aligned.do(Start())
    found = {alarm.problem.code: alarm.problem for alarm in state.alarms}
    told = found["cut.tool_leads" if turned_deg > 0.0 else "cut.out_of_phase"]
    # 55 um of three lobes cut 5 deg beside them leave 2 * 55 um * sin(7.5 deg); 4 um are allowed, 1.39 deg.
    assert (told.value, told.limit) == ("5.0 deg", "± 1.4 deg")
    assert float(told.key.removesuffix(" um")) == pytest.approx(14.4, abs=0.3)
