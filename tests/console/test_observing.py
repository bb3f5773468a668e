"""Two consoles with a station each: what an observer may do and is shown, how control changes hands."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.session.cut.alignment import JawAngle, TouchOff, clamping_of, problems
from console.session.data.measured_part import MadeWith
from console.session.station.commands import (
    ApplyGains,
    Approach,
    Arm,
    AskTruth,
    CheckHealth,
    ClearTables,
    Command,
    ConfirmClamping,
    CorrectTouchOff,
    DisableDrives,
    Disarm,
    EnableDrives,
    Forget,
    GoTo,
    Home,
    IdentifyTool,
    Indicate,
    Jog,
    Measure,
    MeasureTurned,
    NoteSkim,
    ReadLoop,
    Recover,
    Retract,
    RevertGains,
    Start,
    TakeControl,
    TakeFingerprint,
    TakeFlank,
    TakeJaw,
    TakeTouchOff,
    TakeTrace,
    Verify,
)
from console.session.station.handlers import HANDLERS
from console.session.station.link.onlookers import Onlookers
from console.session.station.link.opening import OpenMachine
from console.session.station.link_thread import LinkThread
from console.session.station.machine_control import MachineControl
from console.session.station.state import Activity, ArmedCut, StationState
from console.session.terminal_place import UNKNOWN, remote_client, signed_host
from console.text.catalogue import load
from console.tui.frame import observing, onlookers
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.console_role import BY_SSH, ConsoleRole
from drivers.lathe.ownership import BYTES
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_machine
from tests.console.consoles import MACHINE, STOPS, WithStation, logged, station_of
from tests.console.floor import experiment_1, known
from tests.console.test_link_thread import SOON_S, wait_until

JOB = experiment_1()
REFUSED: tuple[Command, ...] = (
    ConfirmClamping(job=JOB),
    EnableDrives(),
    DisableDrives(),
    Home(),
    Approach(job=JOB),
    Jog(axis=AxisName.TOOL, distance=-1.0),
    GoTo(axis=AxisName.CARRIAGE, target=1.0),
    TakeFingerprint(job=JOB, readings=None),
    TakeFlank(),
    NoteSkim(),
    TakeJaw(),
    TakeTouchOff(radius_mm=JOB.radius_mm),
    Forget(),
    ApplyGains(settings=(("I130", 500.0),), shown=()),
    RevertGains(),
    CheckHealth(step_um=25.0),
    IdentifyTool(path=Strategy.PVT),
    Arm(job=JOB, job_sha256="0" * 64, strategy=Strategy.PVT),
    Disarm(),
    Start(),
    Retract(),
    ClearTables(),
    Measure(),
    MeasureTurned(),
    TakeTrace(path=Path("part.csv"), sha256="", job=JOB, loaded=None, answers={}),
    CorrectTouchOff(),
    AskTruth(),
    Indicate(places=8),
)


@pytest.fixture
def sim() -> SimulatedLathe:
    return SimulatedLathe(load_machine(MACHINE).machine)


@pytest.fixture
def owner(sim: SimulatedLathe, tmp_path: Path) -> WithStation:
    return station_of(sim, tmp_path / "here")


@pytest.fixture
def observer(owner: WithStation, tmp_path: Path) -> WithStation:
    """It comes second, from another computer."""
    return station_of(owner.sim, tmp_path / "there")


@pytest.fixture
def ready(owner: WithStation) -> WithStation:
    """The owner with its drives on, homed."""
    owner.do(EnableDrives(), Home())
    return owner


def in_a_jog(owner: WithStation, act: Callable[[], object], way_mm: float = 5.0) -> None:
    """Jog the carriage of the owner out, and do something once in the middle of it."""
    done: list[object] = []

    def look(snapshot: Snapshot) -> None:
        if snapshot.moving and not done:
            done.append(None)
            act()

    owner.looks.append(look)
    owner.do(Jog(axis=AxisName.CARRIAGE, distance=way_mm))
    assert done


def armed(sim: SimulatedLathe, owner: WithStation) -> ArmedCut:
    plan = plan_cut(JOB, owner.context.machine, Strategy.PVT)
    alignment = owner.state.alignment
    made = MadeWith(compensation="none", strategy="pvt", stage="full", inverted="model")
    until_s = sim.now_s() + 10.0
    return ArmedCut(job=JOB, strategy=Strategy.PVT, plan=plan, alignment=alignment, until_s=until_s, made=made)


def test_a_second_console_looks_on_and_says_why(
    sim: SimulatedLathe, owner: WithStation, observer: WithStation, tmp_path: Path
) -> None:
    assert (owner.state.standing, owner.alarms) == (ConsoleRole.OWNER, [])
    beside = station_of(sim, tmp_path / "here")  # of the same computer
    for each, why in ((observer, "owner.held"), (beside, "owner.beside")):
        assert (each.state.standing, each.alarms) == (ConsoleRole.OBSERVER, [why])
        state = each.look()
        assert state.holder == owner.number
        assert state.activity is Activity.READY and state.snapshot is not None
        assert state.alignment.settings == (), "an observer compares the controller with its profile, too"


def test_every_order_but_four_is_refused_to_an_observer(owner: WithStation, observer: WithStation) -> None:
    assert {type(order) for order in REFUSED} | {Verify, Recover, TakeControl, ReadLoop} == set(HANDLERS)
    observer.hear()
    for order in REFUSED:
        assert not observer.station.post(order)
        assert observer.refusals == ["owner.observer"]
        observer.look()
    said = observer.hear()
    assert b"=" not in said and b"J" not in said and not set(said) & set(STOPS)
    assert owner.look().snapshot is not None and owner.alarms == []


@pytest.mark.parametrize("reason", ["quit", "SIGHUP"])
def test_an_observer_sees_what_the_owner_does_and_disturbs_it_neither_silent_nor_by_leaving(
    ready: WithStation, observer: WithStation, reason: str
) -> None:
    seen: list[bool] = []

    def look(_: Snapshot) -> None:
        state = observer.look()
        assert state.snapshot is not None
        seen.append(state.snapshot.moving)
        # It moves, but not for this console: leaving it needs no stop, and no key is one by chance.
        assert not state.may_move and not state.controls

    observer.station.beat()  # from now on its screen is silent
    ready.looks.append(look)
    in_a_jog(ready, observer.hear, way_mm=30.0)
    assert True in seen and not set(observer.hear()) & set(STOPS)
    assert observer.alarms == ["owner.held"] and ready.alarms == []
    ready.looks.remove(look)
    in_a_jog(ready, lambda: observer.station.close(reason))
    assert observer.hear() == b""
    assert ready.refusals == [] and ready.alarms == []
    snapshot = ready.lathe.snapshot()
    assert snapshot.loops_closed and snapshot.owner == ready.number


def test_the_stop_of_an_observer_stops_and_it_may_go_on_looking(ready: WithStation, observer: WithStation) -> None:
    start = known(ready.state.snapshot)

    def stop() -> None:
        observer.look()
        observer.hear()
        observer.stop.stop("space")
        assert observer.hear() == b"\x01", "every loop is closed: it ramps down"

    in_a_jog(ready, stop, way_mm=50.0)
    assert ready.state.activity is Activity.STOPPED and ready.state.stop is not None
    assert "machine.not_arrived" in ready.alarms
    end = ready.lathe.snapshot()
    # 10 mm/s, a look 0.1 s after the start, a ramp of some tenths of a second: nowhere near the 50 mm.
    assert end.at_rest and end.carriage.position - start.carriage.position < 5_000.0
    state = observer.look()
    assert state.activity is Activity.STOPPED and state.stop is not None and state.stop.rest_s is not None
    observer.hear()
    assert observer.do(Recover()).activity is Activity.READY
    assert observer.state.stop is None and b"=" not in observer.hear()
    assert observer.refusals == []


def test_an_observer_that_stops_at_rest_changes_nothing(ready: WithStation, observer: WithStation) -> None:
    observer.look()
    observer.stop.stop("escape")
    assert observer.look().activity is Activity.READY
    assert observer.refusals == ["session.stopped_at_rest"]
    assert ready.look().activity is Activity.READY and ready.alarms == []
    in_a_jog(ready, observer.look)
    assert ready.refusals == [] and ready.alarms == []


def test_at_rest_the_machine_is_taken_over(ready: WithStation, observer: WithStation, tmp_path: Path) -> None:
    state = observer.do(TakeControl())
    assert (state.standing, state.holder) == (ConsoleRole.OWNER, observer.number)
    assert observer.on_the_card == observer.number
    assert observer.alarms == [] and state.alignment.settings == () and state.alignment.jaw is None
    assert logged(tmp_path / "there") == [
        f"tcp:lathe:1025 taken over: console {ready.number} -> console {observer.number}"
    ]
    # The drives are on, as the other one has left them, and the axes are homed.
    assert state.alignment.drives_on and state.alignment.homed
    observer.do(DisableDrives(), EnableDrives())
    in_a_jog(observer, lambda: None)
    assert observer.refusals == [] and observer.alarms == []


def test_in_motion_a_take_over_is_refused(ready: WithStation, observer: WithStation) -> None:
    observer.hear()
    in_a_jog(ready, lambda: observer.do(TakeControl()))
    assert observer.refusals == ["owner.moving"]
    assert observer.state.standing is ConsoleRole.OBSERVER and observer.on_the_card == ready.number
    said = observer.hear()
    assert b"=" not in said and not set(said) & set(STOPS)
    assert ready.refusals == [] and ready.alarms == []


def test_who_was_ousted_sends_only_stops(sim: SimulatedLathe, ready: WithStation, observer: WithStation) -> None:
    ready.context.tell(armed=armed(sim, ready))
    observer.do(TakeControl())
    state = ready.look()
    assert (state.standing, state.holder, state.armed) == (ConsoleRole.OUSTED, observer.number, None)
    for _ in range(3):
        ready.look()
    (alarm,) = ready.state.alarms
    assert (alarm.problem.code, alarm.count, alarm.problem.value) == ("owner.ousted", 1, str(observer.number))
    ready.hear()
    for order in REFUSED:
        assert not ready.station.post(order)
        assert ready.refusals == ["owner.observer"]
        ready.look()
    said = ready.hear()
    assert b"=" not in said and b"J" not in said and not set(said) & set(STOPS)
    ready.station.close("quit")
    assert not set(ready.hear()) & set(STOPS), "the drives are not its own any more"
    assert observer.on_the_card == observer.number and observer.lathe.snapshot().loops_closed


def test_a_start_taken_over_does_not_go(sim: SimulatedLathe, ready: WithStation, observer: WithStation) -> None:
    """The order was taken, and then the other console was faster."""
    ready.context.tell(armed=armed(sim, ready))
    assert ready.station.post(Start())
    observer.do(TakeControl())
    ready.hear()
    ready.look()
    assert ready.state.cut is None or ready.state.armed is None
    said = ready.hear()
    assert b"B2R" not in said and b"J=" not in said
    assert not observer.lathe.snapshot().program_running


def test_who_takes_the_machine_back_finds_nothing_aligned(ready: WithStation, observer: WithStation) -> None:
    """The other one may have changed anything meanwhile: part, jaws, tool."""
    on = ready.state.alignment.on
    found = {
        "clamping": clamping_of(JOB, at="08:40"),
        "jaw": JawAngle(angle_deg=12.0, jaws=JOB.jaws, at="08:45", on=on),
        "touch_off": TouchOff(zero_radius_mm=76.0, diameter_mm=JOB.diameter_mm, at="08:46", on=on),
    }
    ready.context.tell(alignment=replace(ready.state.alignment, **found))  # type: ignore[arg-type]
    assert [problem.code for problem in problems(ready.look().alignment, JOB)] == []
    observer.do(TakeControl())
    ready.look()
    ready.do(TakeControl())
    assert ready.state.standing is ConsoleRole.OWNER and "owner.ousted" not in ready.alarms
    assert [problem.code.partition(".")[2] for problem in problems(ready.state.alignment, JOB)] == [
        *("handed_over", "no_clamping", "no_jaw", "no_touch_off")
    ]
    observer.look()
    assert observer.state.standing is ConsoleRole.OUSTED and observer.alarms == ["owner.ousted"]
    in_a_jog(ready, observer.look)
    assert ready.refusals == []


def test_the_machine_of_an_owner_that_has_left_is_taken_at_once(owner: WithStation, observer: WithStation) -> None:
    owner.station.close("quit")
    assert observer.look().holder == 0
    assert observer.do(TakeControl()).standing is ConsoleRole.OWNER
    assert observer.on_the_card == observer.number


@pytest.mark.parametrize("who", ["observer", "owner"])
def test_a_fault_of_the_console_itself_opens_the_loops_of_ones_own_machine_alone(
    owner: WithStation, observer: WithStation, who: str, monkeypatch: MonkeyPatch
) -> None:
    console = owner if who == "owner" else observer

    def fails() -> None:
        raise MemoryError

    monkeypatch.setattr(console.station, "step", fails)
    monkeypatch.setattr(console.station, "connect", lambda: True)
    console.hear()
    opened = OpenMachine(station=console.station, stop=console.stop, close=lambda: None)
    link = LinkThread("a lathe", False, lambda: opened, give_up=lambda _: None)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity is Activity.LOST)
    link.end("over")
    assert link.join(SOON_S)
    assert bool(set(console.hear()) & set(STOPS)) is (who == "owner")


def looks(console: WithStation, times: int = 8) -> None:
    for _ in range(times):
        console.sim.wait(0.3)
        console.look()


def test_an_observer_is_shown_name_computer_and_since_when(tmp_path: Path) -> None:
    """Rule R2: one console controls, with name, computer and time; the others see that."""
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    kim = station_of(sim, tmp_path / "here", name="kim")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee)
    by = known(lee.state.held_by)
    assert (by.number, by.name) == (kim.number, "kim")
    assert by.host == socket.gethostname().partition(".")[0][:15]
    now = datetime.now(UTC)
    assert abs(60 * by.minute - now.timestamp()) < 120.0
    shown = observing(load("en"), lee.state, now)
    assert "kim@" in shown and f"since {datetime.fromtimestamp(60 * by.minute, UTC):%H:%M}" in shown
    tomorrow = observing(load("en"), lee.state, now + timedelta(days=1))
    assert f"{now:%Y-%m-}" in tomorrow
    kim.hear()
    looks(kim)
    assert kim.look().held_by is None and b"P1012" not in kim.hear()
    lee.do(TakeControl())
    looks(kim)
    looks(lee)
    after = known(kim.state.held_by)
    assert after.name == "lee"
    (alarm,) = kim.state.alarms  # as on the first row, and raised once
    assert (alarm.problem.code, alarm.count) == ("owner.ousted", 1)
    assert f"({after.name}@{after.host})" in load("en").problem(alarm.problem)
    assert f"{after.name}@{after.host}" in observing(load("en"), kim.state, now)
    assert lee.look().held_by is None


def test_a_console_that_does_not_sign_is_shown_by_its_number(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    silent = station_of(sim, tmp_path / "here")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee, 30)
    assert lee.state.held_by is None and str(silent.number) in observing(load("en"), lee.state, datetime.now(UTC))
    lee.hear()
    looks(lee)
    assert b"P1012" not in lee.hear(), "it is not asked for ever"


def test_the_console_in_control_counts_who_looks_on(tmp_path: Path) -> None:
    """Processes, because a lock of a process does not keep out its own."""
    address, asked, ended = "tcp:lathe:1025", os.pipe(), os.pipe()
    observer = os.fork()
    if not observer:
        there = Onlookers(tmp_path, address)
        there._looks_on = True
        there.see()
        os.write(asked[1], b"x")
        os.read(ended[0], 1)
        os._exit(0)
    here = Onlookers(tmp_path, address)
    assert os.read(asked[0], 1)
    here.see()
    seen = here.count
    os.write(ended[1], b"x")
    os.waitpid(observer, 0)
    here.see()
    assert (seen, here.count) == (1, 0)
    here._looks_on = True
    here.see()
    assert here.count == 0
    shown = onlookers(load("en"), StationState(onlookers=1))
    assert "1 console looks on" in str(shown) and onlookers(load("en"), StationState()) == ()


def test_when_the_console_in_control_has_gone_the_alarm_of_it_ends_and_t_is_named(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    kim = station_of(sim, tmp_path)
    lee = station_of(sim, tmp_path)
    looks(lee)
    assert "owner.beside" in lee.alarms
    kim.station.close("quit")
    looks(lee)
    assert lee.alarms == ["owner.free"] and "press t" in load("en").problem(lee.state.alarms[0].problem)
    assert "owner.beside" not in [alarm.problem.code for alarm in lee.state.alarms]
    lee.do(TakeControl())
    assert "owner.free" not in lee.alarms


@pytest.mark.parametrize(
    ("environment", "client"),
    [
        ({}, ""),
        ({"SSH_CONNECTION": "192.168.1.7 51234 192.168.1.2 22"}, "192.168.1.7"),
        ({"SSH_CLIENT": "192.168.1.7 51234 22", "SSH_TTY": "/dev/pts/3"}, "192.168.1.7"),
        ({"SSH_CONNECTION": "fe80::1%eth0 51234 fe80::2%eth0 22"}, "fe80::1"),
        ({"SSH_CONNECTION": "::ffff:10.0.0.9 51234 ::ffff:10.0.0.1 22"}, "10.0.0.9"),
        # From the computer itself: whoever sits there, sits there.
        ({"SSH_CONNECTION": "127.0.0.1 51234 127.0.0.1 22", "SSH_TTY": "/dev/pts/3"}, ""),
        ({"SSH_CONNECTION": "::1 51234 ::1 22"}, ""),
        ({"SSH_CONNECTION": "::ffff:127.0.0.1 51234 ::ffff:127.0.0.1 22"}, ""),
        ({"SSH_TTY": "/dev/pts/3"}, UNKNOWN),
        ({"SSH_CONNECTION": "nonsense"}, UNKNOWN),
    ],
)
def test_a_terminal_is_here_or_where_ssh_comes_from(environment: dict[str, str], client: str) -> None:
    assert remote_client(environment) == client


def test_what_is_signed_fits_and_tells_ssh_from_a_computer() -> None:
    assert signed_host("", "lathe2") == "lathe2"
    assert signed_host("192.168.100.107", "lathe2") == "192.168.100.107"
    assert signed_host("2001:db8:85a3::8a2e:370:7334", "lathe2") == signed_host(UNKNOWN, "lathe2") == BY_SSH
    assert len("192.168.100.107") <= BYTES


@pytest.mark.parametrize(
    ("client", "shown"),
    [
        ("192.168.100.107", "kim from 192.168.100.107 by SSH has control"),
        (UNKNOWN, "kim from ? by SSH has control"),
    ],
)
def test_where_control_comes_from(tmp_path: Path, monkeypatch: MonkeyPatch, client: str, shown: str) -> None:
    begin = MachineControl.__init__

    def far(self: MachineControl, *given: object, **named: object) -> None:
        begin(self, *given, **(named | ({"client": client} if named.get("name") == "kim" else {})))  # type: ignore[arg-type]

    monkeypatch.setattr(MachineControl, "__init__", far)
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    station_of(sim, tmp_path / "here", name="kim")
    lee = station_of(sim, tmp_path / "there", name="lee")
    looks(lee)
    assert shown in observing(load("en"), lee.state, datetime.now(UTC))
