"""A lost link comes back in place: the console reads, moves nothing, claims nothing, and ends stopped."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from console.session.station.commands import (
    Approach,
    Arm,
    ConfirmClamping,
    EnableDrives,
    Home,
    Jog,
    Recover,
    Start,
    TakeControl,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.link_thread import CONNECT_AGAIN_S
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from console.tui.application.lost_lines import lost_step
from drivers.cutting.planning import Strategy
from drivers.lathe.console_role import NOBODY, ConsoleRole
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from tests.compact import compact_machine
from tests.console.consoles import STOP_CHARACTERS, TRIES, Cable, WithStation, cabled, until_back
from tests.console.floor import experiment_1

READ_ONLY = (b"J", b"HM", b"R\r", b"J=", b"A\r", b"M70=", b"P1000=", b"P1003=", b"ENABLE", b"\x01")
"""What would move, energise, claim or renew; a control-K is not among them."""

Site = tuple[SimulatedLathe, WithStation, Cable]


@pytest.fixture
def site(tmp_path: Path) -> Site:
    sim = SimulatedLathe(compact_machine().machine)
    console, cable = cabled(sim, tmp_path)
    return sim, console, cable


def held(state: StationState) -> dict[str, tuple[bool, str]]:
    assert state.lost_link is not None
    return {each.stamp: (each.holds, each.why) for each in state.lost_link.validity}


def cut_at(console: WithStation, cable: Cable, moving: AxisName) -> None:
    """Cut the cable at the first poll that sees this axis on its way."""
    done: list[Snapshot] = []

    def look(snapshot: Snapshot) -> None:
        if not done and "desired_velocity_zero" not in snapshot.axis(moving).flags:
            done.append(snapshot)
            cable.cut()

    console.looks.append(look)


def activity(console: WithStation) -> Activity:
    return console.state.activity


def harmless(said: bytes) -> bool:
    return not any(word in said for word in READ_ONLY)


def home(console: WithStation) -> None:
    console.do(EnableDrives(), Home())


def back(console: WithStation, cable: Cable) -> tuple[StationState, bytes]:
    """Mend the cable, and return the state and what was said on the way back."""
    console.hear()
    cable.mend()
    until_back(console)
    return console.state, console.hear()


def test_at_rest_it_comes_back_stopped_with_its_home(site: Site) -> None:
    """Rule R3: the true state, with what happened; rule A10: how old what is shown is."""
    sim, console, cable = site
    home(console)
    cable.cut()
    console.look()
    assert activity(console) is Activity.LOST and "link.lost" in console.alarms
    for _ in range(3):
        sim.wait(1.5)
        console.look()
    lost = console.state.lost_link
    assert lost is not None and lost.attempts >= 2 and lost.problem is not None
    assert lost.problem.code == "link.refused" and lost.back_s is None
    assert not console.station.post(Home()) and console.refusals == ["session.lost"]
    state, said = back(console, cable)
    assert state.activity is Activity.STOPPED and state.standing is ConsoleRole.OWNER
    assert harmless(said), said
    assert state.snapshot is not None and state.snapshot.loops_open and state.snapshot.homed
    none = dict.fromkeys(("jaw", "touch_off", "clamping"), (False, "none"))
    assert held(state) == {"home": (True, "home_kept"), **none}
    assert "link.lost" not in console.alarms
    console.do(Recover())
    assert activity(console) is Activity.READY and console.state.lost_link is None
    console.do(EnableDrives(), Jog(axis=AxisName.CARRIAGE, distance=1.0))
    assert console.state.activity is Activity.READY


def test_what_is_gone_for_ever_is_not_tried_again(site: Site) -> None:
    sim, console, cable = site
    assert console.context.reopening is not None
    console.context.reopening._over = lambda: True
    cable.cut()
    console.look()
    for _ in range(3):
        sim.wait(2.0)
        console.look()
    lost = console.state.lost_link
    assert lost is not None and lost.for_ever and lost.attempts == 0


@pytest.mark.parametrize("moving", [AxisName.TOOL, AxisName.CARRIAGE])
def test_in_mid_homing_the_controller_ends_it_and_home_is_void(site: Site, moving: AxisName) -> None:
    _, console, cable = site
    console.do(EnableDrives())
    cut_at(console, cable, moving)
    console.station.post(Home())
    console.station.step()
    assert console.state.activity is Activity.LOST and console.state.stop is not None
    state, said = back(console, cable)
    assert state.activity is Activity.STOPPED and harmless(said), said
    holds, why = held(state)["home"]
    assert not holds and why in ("home_lost", "home_none")
    assert state.snapshot is not None and state.snapshot.at_rest and state.snapshot.lost


def test_a_cable_that_is_back_at_once_does_not_let_the_motion_go_on(site: Site) -> None:
    """The watchdog of the lost motion still runs: it is not renewed, and the controller ends the motion."""
    sim, console, cable = site
    console.do(EnableDrives(), Home())

    def blink(snapshot: Snapshot) -> None:
        if "desired_velocity_zero" not in snapshot.carriage.flags and not cable.cuts:
            cable.cut()
            cable.mend()
            console.hear()

    console.looks.append(blink)
    console.station.post(Jog(axis=AxisName.CARRIAGE, distance=8.0))
    console.station.step()
    began_s = sim.now_s()
    until_back(console)
    assert harmless(console.hear()) and sim.now_s() - began_s < 5.0
    assert console.state.activity is Activity.STOPPED
    snapshot = console.state.snapshot
    assert snapshot is not None and snapshot.lost == 1, "a jog, ended by the controller"


def test_a_stop_that_was_pressed_meanwhile_is_delivered_first(site: Site) -> None:
    _, console, cable = site
    home(console)
    cable.cut()
    console.look()
    console.look()
    console.stop.stop("space")
    assert not console.stop.delivered
    state, said = back(console, cable)
    assert b"\x0b" in said and state.activity is Activity.STOPPED
    cable.cut()  # a link that is lost at rest after a stop comes back, too
    assert console.look().activity is Activity.LOST
    assert back(console, cable)[0].activity is Activity.STOPPED


@pytest.mark.parametrize("forgets", [False, True])
def test_a_controller_that_was_switched_off_has_lost_its_home(site: Site, forgets: bool) -> None:
    """P-variables are kept by a battery in some controllers: then the machine is still this console's."""
    sim, console, cable = site
    home(console)
    cable.cut()
    console.look()
    sim.power_cycle()
    if forgets:
        sim.controller.variables.set(VariableKind.P, OWNER, 0.0)
    state, said = back(console, cable)
    assert "controller.was_reset" in console.alarms
    assert held(state)["home"] == (False, "home_reset")
    assert harmless(said), said
    if not forgets:
        assert state.controls and state.activity is Activity.STOPPED
        console.do(Recover())
    else:
        assert not state.controls and state.holder == NOBODY, "nobody is claimed for in silence"
        assert b"\x0b" not in said and state.activity is Activity.READY
        alarms = console.alarms
        assert "owner.restarted" in alarms and "owner.ousted" not in alarms, "no other console had it"
        console.do(TakeControl())
        assert "owner.restarted" not in console.alarms
    assert console.state.controls and console.state.lost_link is None


def test_a_console_that_took_the_machine_meanwhile_is_left_alone(site: Site, tmp_path: Path) -> None:
    """Rule R2: a take-over is respected, by the stop that nobody took, too."""
    sim, console, cable = site
    console.do(EnableDrives(), Home())
    cable.cut()
    console.look()
    other, _ = cabled(sim, tmp_path / "there")
    other.do(TakeControl(), Jog(axis=AxisName.CARRIAGE, distance=1.0))
    console.hear()
    cable.mend()
    until_back(console)
    state, said = console.state, console.hear()
    assert state.standing is ConsoleRole.OUSTED and state.holder == other.number
    assert harmless(said) and b"\x0b" not in said, said
    assert state.activity is Activity.READY and state.stop is None
    assert "owner.ousted" in console.alarms
    assert held(state)["home"] == (True, "home_kept")
    other.do(Jog(axis=AxisName.CARRIAGE, distance=-1.0))
    assert other.state.activity is Activity.READY and other.state.stop is None
    sim.wait(2.0)
    console.stop.stop("space")  # an observer may stop
    console.look()
    said = console.hear()
    assert any(stop in said for stop in STOP_CHARACTERS)
    assert console.refusals == ["session.stopped_at_rest"]


def test_an_observer_looks_on_again(site: Site, tmp_path: Path) -> None:
    sim, console, _ = site
    observer, cable = cabled(sim, tmp_path / "there")
    assert observer.state.standing is ConsoleRole.OBSERVER
    cable.cut()
    observer.look()
    assert activity(observer) is Activity.LOST
    state, said = back(observer, cable)
    assert state.activity is Activity.READY and state.lost_link is None
    assert harmless(said) and state.stop is None
    assert console.look().activity is Activity.READY


def armed(console: WithStation) -> None:
    """Clamp, home, take jaw 1 and the touch-off wherever the axes are, and arm."""
    job = experiment_1()
    console.do(ConfirmClamping(job=job), EnableDrives(), Home(), TakeJaw(), Approach(job=job))
    console.do(Jog(axis=AxisName.TOOL, distance=0.5))
    for _ in range(5):  # steps are short where the surface may be
        console.do(Jog(axis=AxisName.TOOL, distance=0.1))
    console.do(TakeTouchOff(radius_mm=job.radius_mm))
    assert console.refusals == []
    console.do(Arm(job=job, job_sha256="0" * 64, strategy=Strategy.PVT))
    assert console.state.armed is not None, console.state.refusals


@pytest.mark.parametrize("slow", [False, True])
def test_only_a_tool_that_stood_in_the_part_has_marked_it(site: Site, slow: bool) -> None:
    """The program takes the tool out at the end of its turn; where it cannot, the controller aborts it."""
    sim, console, cable = site
    armed(console)

    def look(snapshot: Snapshot) -> None:
        cut = console.state.cut
        if not cable.cuts and cut is not None and cut.stage is CutStage.CUT and cut.turn > 3.0:
            if slow:  # too slow to end its turn within the grace of the machine profile
                other = sim.connect()
                other.receive(b"&1%1\r")
                sim.attend(other)
            cable.cut()

    console.looks.append(look)
    console.station.post(Start())
    console.station.step()
    assert console.state.activity is Activity.LOST and len(console.state.marks_mm) == 1
    cable.mend()
    until_back(console)
    state = console.state
    assert state.stop is not None and state.stop.tool_in_part is False
    assert (state.marks_mm != ()) == slow


def test_a_stop_no_longer_says_that_the_drives_hold_once_a_reset_has_opened_them(site: Site) -> None:
    sim, console, _ = site
    console.do(EnableDrives(), Home())
    cut_short(console)
    stop = console.state.stop
    assert console.state.activity is Activity.STOPPED and stop is not None and stop.can_retract
    sim.power_cycle()
    console.look()
    stop = console.state.stop
    assert console.state.activity is Activity.STOPPED and "controller.was_reset" in console.alarms
    assert stop is not None and not stop.can_retract and stop.tool_in_part is not False


def cut_short(console: WithStation) -> None:
    """Stop a jog on its way."""

    def look(snapshot: Snapshot) -> None:
        if snapshot.moving:
            console.stop.stop("space")

    console.looks.append(look)
    console.station.post(Jog(axis=AxisName.CARRIAGE, distance=5.0))
    console.station.step()
    console.looks.pop()
    console.look()


def test_a_reset_in_mid_cut_leaves_the_last_values_of_the_cut_and_its_mark(site: Site) -> None:
    """A controller that was reset reports positions from zero on: a tool in the part would look retracted."""
    sim, console, _ = site
    armed(console)
    resets: list[float] = []

    def look(_: Snapshot) -> None:
        cut = console.state.cut
        if not resets and cut is not None and cut.stage is CutStage.CUT and cut.turn > 3.0:
            resets.append(cut.tool_radius_mm)
            sim.power_cycle()

    console.looks.append(look)
    console.do(Start())
    state = console.state
    assert "controller.was_reset" in console.alarms and state.activity is Activity.STOPPED
    assert state.cut is not None and state.cut.stage is CutStage.CUT
    assert state.cut.tool_radius_mm == resets[0]
    assert state.touched is not None and state.stop is not None and state.stop.tool_in_part is None
    (mark_mm,) = state.marks_mm
    assert mark_mm == pytest.approx(state.cut.z_mm, abs=0.1)


def asked_until(console: WithStation, condition: Callable[[], bool]) -> None:
    """Ask a machine that has never answered, as the link thread does."""
    moment = threading.Event()
    for _ in range(TRIES):
        if condition():
            return
        console.station.connect()
        moment.wait(0.001)  # an attempt has a thread of its own, in real time
        console.sim.wait(CONNECT_AGAIN_S)
    raise AssertionError(console.state)


@pytest.mark.parametrize("dead", [1, 3])
def test_a_connection_that_was_accepted_and_never_answers_is_opened_again(dead: int, tmp_path: Path) -> None:
    """Half of it is dead: the other side, restarted meanwhile, knows nothing of it."""
    sim = SimulatedLathe(compact_machine().machine)
    console, cable = cabled(sim, tmp_path, dead=dead)
    assert activity(console) is Activity.LOST and console.alarms == ["link.silent"]
    asked_until(console, lambda: activity(console) is Activity.READY)
    assert cable.made == dead + 1 and console.alarms == [] and console.state.lost_link is None
    assert not console.lathe.has_moved and harmless(console.hear().partition(b"P1000=")[0])


def test_while_it_is_opened_again_it_is_said_how_often_and_why(tmp_path: Path) -> None:
    console, cable = cabled(SimulatedLathe(compact_machine().machine), tmp_path, dead=TRIES)
    cable.cut()
    asked_until(console, lambda: console.state.lost_link is not None and console.state.lost_link.attempts > 1)
    lost = console.state.lost_link
    assert lost is not None and lost.problem is not None and lost.problem.code == "link.refused"
    said = lost_step(load("en"), console.state)
    assert "opens the link again" in said and f"attempts: {lost.attempts}" in said


def test_a_stop_while_it_is_opened_again_is_in_force_once_it_is(tmp_path: Path) -> None:
    console, _ = cabled(SimulatedLathe(compact_machine().machine), tmp_path, dead=1)
    console.stop.stop("space")
    asked_until(console, lambda: bool(console.state.controller))
    console.look()
    assert activity(console) is Activity.STOPPED and not console.station.post(EnableDrives())
