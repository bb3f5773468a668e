"""Who controls a machine: claimed, given back, taken over at rest; the lock of one computer."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.errors import SessionError
from console.session.station.commands import EnableDrives, Home, Jog, Recover, TakeControl
from console.session.station.machine_control import FOREIGN, ConsoleLock, take_lock
from drivers.errors import RefusedError
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.simulator.machine import SimulatedLathe
from profiles.files import NOT_REGULAR
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.console.consoles import (
    ADDRESS,
    MACHINE,
    STOP_CHARACTERS,
    STOPS,
    OneConsole,
    console_of,
    logged,
    station_of,
)
from tests.console.floor import known

LATHE = load_machine(MACHINE).machine


@pytest.fixture
def sim() -> SimulatedLathe:
    return SimulatedLathe(LATHE)


def refused(error: pytest.ExceptionInfo[ProblemError]) -> tuple[str, str]:
    (problem,) = error.value.problems
    return problem.code, str(problem.value or "")


def dies(console: OneConsole) -> None:
    """As when its process is killed: nothing is said any more, and the kernel lets go of its lock."""
    lock = known(console.owning._lock)
    lock.close()


def jogs(console: OneConsole, meanwhile: list[object]) -> None:
    """Switch the drives on and jog the carriage by 5 mm; do these things at the first looks that see it move."""
    console.owning.claim()
    console.lathe.verify()
    console.lathe.enable()
    console.lathe.home()
    steps = iter(meanwhile)

    def look(seen: Snapshot) -> None:
        step = next(steps, None) if seen.moving else None
        if callable(step):
            step()

    console.looks.append(look)
    console.lathe.jog_by(AxisName.CARRIAGE, 5000.0)


def test_who_comes_first_controls_and_leaves_it_free(sim: SimulatedLathe, tmp_path: Path) -> None:
    """A simulated machine of one's own needs no lock, and nothing of it is kept."""
    alone = console_of(sim, LATHE, tmp_path, locking=False)
    alone.owning.claim()
    alone.owning.release()
    assert list(tmp_path.iterdir()) == []
    console = console_of(sim, LATHE, tmp_path)
    console.owning.claim()
    assert console.on_the_card == console.number
    console.owning.release()
    assert console.on_the_card == 0
    after = console_of(sim, LATHE, tmp_path)
    after.owning.claim()
    assert after.on_the_card == after.number != console.number
    assert logged(tmp_path) == []


def test_a_folder_that_takes_no_lock_lets_nobody_control_and_one_that_takes_no_log_does(
    sim: SimulatedLathe, tmp_path: Path
) -> None:
    (tmp_path / "locks").write_text("", encoding="ascii")
    console = console_of(sim, LATHE, tmp_path)
    with pytest.raises(SessionError) as error:
        console.owning.claim()
    assert error.value.problems[0].code == "lock.unwritable" and console.on_the_card == 0
    (tmp_path / "here" / "ownership.log").mkdir(parents=True)
    first, second = (console_of(sim, LATHE, tmp_path / name) for name in ("there", "here"))
    first.owning.claim()
    second.owning.take_control()
    assert second.on_the_card == second.number


def test_a_second_console_looks_on_and_writes_nothing(sim: SimulatedLathe, tmp_path: Path) -> None:
    first, second = (console_of(sim, LATHE, tmp_path) for _ in range(2))
    first.owning.claim()
    second.hear()
    with pytest.raises(RefusedError) as error:
        second.owning.claim()
    assert refused(error) == ("owner.beside", "")
    assert second.hear() == b""
    for order in (
        second.lathe.enable,
        second.lathe.switch_off,
        second.lathe.program.end_after_turn,
        second.lathe.program.tables_left,
    ):
        with pytest.raises(RefusedError) as error:
            order()
        assert refused(error)[0] in ("owner.held", "owner.observer")
    second.owning.release()
    assert first.on_the_card == first.number


def test_a_console_of_another_computer_is_not_replaced_unasked_dead_or_not(
    sim: SimulatedLathe, tmp_path: Path
) -> None:
    """Nobody here can tell a dead one there from one that is busy: it takes somebody who takes over."""
    first = console_of(sim, LATHE, tmp_path / "there")
    first.owning.claim()
    for dead in (False, True):
        if dead:
            dies(first)
        heir = console_of(sim, LATHE, tmp_path / "here")
        with pytest.raises(RefusedError) as error:
            heir.owning.claim()
        assert refused(error) == ("owner.held", str(first.number))
        heir.owning.release()
        assert first.on_the_card == first.number
    heir.owning.take_control()
    assert heir.on_the_card == heir.number
    assert logged(tmp_path / "here") == [
        f"tcp:lathe:1025 taken over: console {first.number} -> console {heir.number}"
    ]


def test_the_place_of_a_dead_console_is_taken_and_logged(sim: SimulatedLathe, tmp_path: Path) -> None:
    dead, heir = (console_of(sim, LATHE, tmp_path) for _ in range(2))
    dead.owning.claim()
    dies(dead)
    heir.owning.claim()
    assert heir.on_the_card == heir.number
    said = f"in the place of a console that died: console {dead.number} -> console {heir.number}"
    assert logged(tmp_path) == [f"tcp:lathe:1025 {said}"]


def test_a_dead_console_is_not_replaced_while_what_it_moved_still_moves(
    sim: SimulatedLathe, tmp_path: Path
) -> None:
    """Its lease has not run out yet. Once the card has ended the jog and all rests, the next one gets in."""
    dead, heir = (console_of(sim, LATHE, tmp_path) for _ in range(2))

    def takes_its_place() -> None:
        dies(dead)
        with pytest.raises(RefusedError) as error:
            heir.owning.claim()
        assert refused(error)[0] == "owner.moving"
        sim.wait(1.0)
        heir.owning.claim()
        raise KeyboardInterrupt  # the dead one does nothing any more

    with pytest.raises(KeyboardInterrupt):
        jogs(dead, [takes_its_place])
    assert heir.on_the_card == heir.number
    snapshot = heir.lathe.snapshot()
    assert snapshot.at_rest and snapshot.lost


def test_a_third_that_took_it_is_not_taken_for_the_dead_one(sim: SimulatedLathe, tmp_path: Path) -> None:
    dead = console_of(sim, LATHE, tmp_path / "here")
    dead.owning.claim()
    dies(dead)
    third = console_of(sim, LATHE, tmp_path / "there")
    third.owning.take_control()
    heir = console_of(sim, LATHE, tmp_path / "here")
    with pytest.raises(RefusedError) as error:
        heir.owning.claim()
    assert refused(error) == ("owner.held", str(third.number))
    assert third.on_the_card == third.number


@pytest.mark.parametrize("here", [True, False], ids=["this computer", "another computer"])
def test_a_take_over_waits_for_rest(sim: SimulatedLathe, tmp_path: Path, here: bool) -> None:
    first = console_of(sim, LATHE, tmp_path)
    second = console_of(sim, LATHE, tmp_path if here else tmp_path / "there")
    kept: list[int] = []

    def asks() -> None:
        second.hear()
        with pytest.raises(RefusedError) as error:
            second.owning.take_control()
        assert refused(error)[0] == "owner.moving"
        assert b"=" not in second.hear()
        kept.append(second.on_the_card)

    jogs(first, [asks])
    assert kept == [first.number]
    second.owning.take_control()
    assert second.on_the_card == second.number
    first.lathe.snapshot()
    assert first.lathe.ownership is not None and first.lathe.ownership.standing is ConsoleRole.OUSTED


def test_who_was_pushed_aside_says_nothing_but_a_stop(sim: SimulatedLathe, tmp_path: Path) -> None:
    first, second = (console_of(sim, LATHE, tmp_path / name) for name in ("here", "there"))
    jogs(first, [])
    second.owning.take_control()
    first.lathe.snapshot()
    first.hear()
    first.lathe.program._to_restore = ("P1=1",)
    orders: tuple[Callable[[], object], ...] = (
        first.lathe.enable,
        first.lathe.switch_off,
        first.lathe.program.end_after_turn,
        first.lathe.program.tables_left,
        first.lathe.program.put_back,
    )
    for order in orders:
        with pytest.raises(RefusedError) as error:
            order()
        assert refused(error) == ("owner.held", str(second.number))
    said = first.hear()
    assert b"=" not in said and not set(said) & set(STOPS)
    motions: tuple[Callable[[], object], ...] = (
        first.lathe.home,
        lambda: first.lathe.jog_by(AxisName.CARRIAGE, -1000.0),
        lambda: first.lathe.program.start(2, 0.0),
    )
    for motion in motions:
        with pytest.raises(RefusedError) as error:
            motion()
        assert refused(error) == ("owner.held", str(second.number))
    said = first.hear()
    assert not any(word in said for word in (b"J", b"HM", b"R", *STOP_CHARACTERS))
    first.owning.release()
    assert second.on_the_card == second.number
    first.hear()
    first.stop.stop("operator")
    assert first.hear() in STOP_CHARACTERS


def test_of_many_consoles_in_any_order_one_controls(tmp_path: Path) -> None:
    """Claims, releases and take-overs at random: the number on the card is that of the one owner, or nobody's."""
    sim, chance = SimulatedLathe(LATHE), random.Random(2001)
    consoles = [console_of(sim, LATHE, tmp_path / str(n % 2)) for n in range(4)]
    owners: set[int] = set()
    for _ in range(60):
        each = chance.choice(consoles)
        act = chance.choice((each.owning.claim, each.owning.claim, each.owning.release, each.owning.take_control))
        try:
            act()
        except RefusedError:
            continue
        for other in consoles:
            other.lathe.snapshot()
        standing = [
            c.number for c in consoles if c.lathe.ownership and c.lathe.ownership.standing is ConsoleRole.OWNER
        ]
        held = each.on_the_card
        assert standing == ([held] if held else [])
        owners.add(held)
    assert len(owners) > 3


HANDLERS: dict[str, Callable[[Lathe], object]] = {
    "home": lambda lathe: lathe.home(),
    "jog": lambda lathe: lathe.jog_by(AxisName.CARRIAGE, -1000.0),
    "start": lambda lathe: lathe.program.start(2, 0.0),
}


@pytest.mark.parametrize("order", HANDLERS)
def test_a_refused_motion_leaves_no_lease_behind(tmp_path: Path, order: str) -> None:
    machine = load_machine(MACHINE).machine
    sim = SimulatedLathe(machine)
    first, second = (console_of(sim, machine, tmp_path / name) for name in ("here", "there"))
    jogs(first, [])
    second.owning.take_control()
    first.lathe.snapshot()
    first.hear()
    with pytest.raises(RefusedError):
        HANDLERS[order](first.lathe)
    for _ in range(4):
        sim.wait(0.1)
        first.lathe.snapshot()
    assert b"M70=" not in first.hear()


def test_a_console_that_slept_through_a_take_over_leaves_the_new_owner_alone(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    asleep, other = station_of(sim, tmp_path / "here"), station_of(sim, tmp_path / "there")
    asleep.do(EnableDrives(), Home())
    slept: list[Snapshot] = []

    def sleep(snapshot: Snapshot) -> None:
        if snapshot.moving and not slept:
            slept.append(snapshot)
            sim.wait(2.0)  # its motion is ended by the card meanwhile
            other.do(TakeControl(), Recover())
            other.client.request("M70=9000 P1003=1 #3J=60000")
            asleep.hear()

    asleep.looks.append(sleep)
    asleep.do(Jog(axis=AxisName.CARRIAGE, distance=40.0))
    said = asleep.hear()
    assert slept and not [stop for stop in STOPS if stop in said], said
    assert b"P1003=0" not in said and b"M70=" not in said
    assert "heartbeat.lapsed" in [alarm.problem.code for alarm in asleep.state.alarms]
    assert other.lathe.snapshot().moving


def test_a_home_search_that_somebody_else_stops_is_told_at_once(tmp_path: Path) -> None:
    sim = SimulatedLathe(load_machine(MACHINE).machine)
    ready, other = station_of(sim, tmp_path / "here"), station_of(sim, tmp_path / "there")
    ready.do(EnableDrives())
    began_s: list[float] = []

    def stop(snapshot: Snapshot) -> None:
        if snapshot.moving and not began_s:
            began_s.append(sim.now_s())
            other.look()
            other.stop.stop("space")

    ready.looks.append(stop)
    ready.do(Home())
    assert sim.now_s() - began_s[0] < 10.0
    assert "machine.home_ended" in [alarm.problem.code for alarm in ready.state.alarms]


HOLDS_AND_DIES = """
import os, signal, sys
from pathlib import Path
from console.session.station.machine_control import take_lock
lock = take_lock(Path(sys.argv[1]), sys.argv[2])
lock.keep(4711)
print("held", flush=True)
sys.stdin.read()
"""


def taken(data: Path, address: str = ADDRESS) -> ConsoleLock:
    lock = known(take_lock(data, address))
    return lock


def lock_file(data: Path) -> Path:
    (path,) = (data / "locks").iterdir()
    return path


def test_a_second_console_does_not_get_it_before_the_first_lets_go(tmp_path: Path) -> None:
    """How a machine is spoken to makes no other machine of it; a shorter number leaves nothing of a longer one."""
    first = taken(tmp_path)
    assert first.last_number == 0 and take_lock(tmp_path, ADDRESS) is None
    for number in (2**31 - 1, 7):
        first.keep(number)
    first.close()
    second = taken(tmp_path)
    assert second.last_number == 7
    second.close()
    lock = taken(tmp_path, "ethernet:lathe?stop=reserved")
    assert take_lock(tmp_path, "ethernet:lathe") is None
    lock.close()


def test_a_console_that_was_killed_has_let_go_and_left_its_number(tmp_path: Path) -> None:
    words = [sys.executable, "-c", HOLDS_AND_DIES, str(tmp_path), ADDRESS]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert take_lock(tmp_path, ADDRESS) is None
        process.kill()
        process.wait()
        assert taken(tmp_path).last_number == 4711


def test_machines_at_other_addresses_and_other_users_have_locks_of_their_own(tmp_path: Path) -> None:
    locks = [
        taken(tmp_path / "one"),
        taken(tmp_path / "two"),
        *(taken(tmp_path, at) for at in ("serial:/dev/ttyUSB0", "tcp:[::1]:1025", "serial:../../x")),
    ]
    assert {path.parent for path in (tmp_path / "locks").rglob("*")} == {tmp_path / "locks"}
    for lock in locks:
        lock.close()


@given(content=st.binary(max_size=40))
def test_whatever_is_in_it_is_a_number_or_none(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    data = tmp_path_factory.mktemp("data")
    taken(data).close()
    lock_file(data).write_bytes(content)
    lock = taken(data)
    lock.close()
    assert lock.last_number >= 0
    assert lock.last_number == 0 or str(lock.last_number) in content.decode("latin-1")


@pytest.mark.parametrize("in_the_way", ["locks", f"locks/{ADDRESS.replace(':', '_')}.lock"])
def test_a_lock_that_cannot_be_written_is_told(tmp_path: Path, in_the_way: str) -> None:
    blocked = tmp_path / in_the_way
    blocked.parent.mkdir(exist_ok=True)
    if in_the_way == "locks":
        blocked.write_text("", encoding="ascii")
    else:
        blocked.mkdir()
    with pytest.raises(SessionError) as refusal:
        take_lock(tmp_path, ADDRESS)
    (problem,) = refusal.value.problems
    assert problem.code == "lock.unwritable"
    assert os.fspath(tmp_path) in str(problem.where)


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_whatever_the_umask_the_lock_and_its_folders_are_the_users_alone(tmp_path: Path, umask: int) -> None:
    data = tmp_path / "share" / "trilobe"
    before = os.umask(umask)
    try:
        taken(data).close()
    finally:
        os.umask(before)
    assert {path.stat().st_mode & 0o777 for path in (data.parent, data, data / "locks")} == {0o700}
    assert lock_file(data).stat().st_mode & 0o777 == 0o600


def test_the_file_of_another_user_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lock = taken(tmp_path)
    lock.keep(4711)
    lock.close()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(SessionError):
        take_lock(tmp_path, ADDRESS)
    assert lock_file(tmp_path).read_text(encoding="ascii") == "4711\n"


@pytest.mark.parametrize("kind", ["symbolic link", "dangling link", "hard link", "pipe", "linked folder"])
def test_what_somebody_has_put_in_its_place_is_refused_and_stays_as_it_is(tmp_path: Path, kind: str) -> None:
    victim, data = tmp_path / "victim", tmp_path / "data"
    place = data / "locks" / f"{ADDRESS.replace(':', '_')}.lock"
    victim.write_text("what matters\n", encoding="ascii")
    (data if kind == "linked folder" else place.parent).mkdir(parents=True)
    match kind:
        case "symbolic link":
            place.symlink_to(victim)
        case "dangling link":
            place.symlink_to(tmp_path / "made by the lock")
        case "hard link":
            os.link(victim, place)
        case "pipe":
            os.mkfifo(place)
        case _:
            (tmp_path / "elsewhere").mkdir()
            place.parent.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(SessionError) as refusal:
        take_lock(data, ADDRESS)
    (problem,) = refusal.value.problems
    assert (problem.code, problem.value) == ("lock.unwritable", NOT_REGULAR if kind == "pipe" else FOREIGN)
    assert victim.read_text(encoding="ascii") == "what matters\n"
    assert not (tmp_path / "made by the lock").exists()
    assert not (tmp_path / "elsewhere").exists() or list((tmp_path / "elsewhere").iterdir()) == []
