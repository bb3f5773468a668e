"""Who controls a machine: claimed, given back, left by a dead console, taken over at rest; what is logged."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from console.session.errors import SessionError
from drivers.errors import RefusedError
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.standing import Standing
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.console.consoles import MACHINE, STOP_CHARACTERS, STOPS, OneConsole, console_of, logged


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine(MACHINE).machine


@pytest.fixture
def sim(machine: MachineProfile) -> SimulatedLathe:
    return SimulatedLathe(machine)


def refused(error: pytest.ExceptionInfo[ProblemError]) -> tuple[str, str]:
    (problem,) = error.value.problems
    return problem.code, str(problem.value or "")


def dies(console: OneConsole) -> None:
    """As when its process is killed: nothing is said any more, and the kernel lets go of its lock."""
    lock = console.owning._lock
    assert lock is not None
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


def test_who_comes_first_controls_and_leaves_the_machine_free(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    console = console_of(sim, machine, tmp_path)
    console.owning.claim()
    assert console.on_the_card == console.number
    console.owning.release()
    assert console.on_the_card == 0
    after = console_of(sim, machine, tmp_path)
    after.owning.claim()
    assert after.on_the_card == after.number != console.number
    assert logged(tmp_path) == []


def test_a_second_console_of_this_computer_looks_on_and_writes_nothing(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    first, second = (console_of(sim, machine, tmp_path) for _ in range(2))
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


def test_a_console_of_another_computer_is_told_by_its_number(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    first, second = (console_of(sim, machine, tmp_path / name) for name in ("here", "there"))
    first.owning.claim()
    with pytest.raises(RefusedError) as error:
        second.owning.claim()
    assert refused(error) == ("owner.held", str(first.number))
    second.owning.release()
    assert first.on_the_card == first.number


def test_the_place_of_a_dead_console_of_this_computer_is_taken_and_that_is_logged(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    dead, heir = (console_of(sim, machine, tmp_path) for _ in range(2))
    dead.owning.claim()
    dies(dead)
    heir.owning.claim()
    assert heir.on_the_card == heir.number
    said = f"in the place of a console that died: console {dead.number} -> console {heir.number}"
    assert logged(tmp_path) == [f"tcp:lathe:1025 {said}"]


def test_a_dead_console_is_not_replaced_while_what_it_moved_still_moves(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    """Its lease has not run out yet. Once the card has ended the jog and all rests, the next one gets in."""
    dead, heir = (console_of(sim, machine, tmp_path) for _ in range(2))

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


def test_a_dead_console_of_another_computer_is_not_replaced_unasked(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    """Nobody here can tell a dead one there from one that is busy: it takes somebody who takes over."""
    dead = console_of(sim, machine, tmp_path / "there")
    dead.owning.claim()
    dies(dead)
    heir = console_of(sim, machine, tmp_path / "here")
    with pytest.raises(RefusedError) as error:
        heir.owning.claim()
    assert refused(error)[0] == "owner.held"
    heir.owning.take_control()
    assert heir.on_the_card == heir.number
    assert logged(tmp_path / "here") == [
        f"tcp:lathe:1025 taken over: console {dead.number} -> console {heir.number}"
    ]


def test_who_came_to_a_machine_that_a_third_has_since_taken_does_not_take_it_for_the_dead_ones(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    dead = console_of(sim, machine, tmp_path / "here")
    dead.owning.claim()
    dies(dead)
    third = console_of(sim, machine, tmp_path / "there")
    third.owning.take_control()
    heir = console_of(sim, machine, tmp_path / "here")
    with pytest.raises(RefusedError) as error:
        heir.owning.claim()
    assert refused(error) == ("owner.held", str(third.number))
    assert third.on_the_card == third.number


@pytest.mark.parametrize("here", [True, False], ids=["this computer", "another computer"])
def test_a_take_over_waits_for_rest(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path, here: bool
) -> None:
    first = console_of(sim, machine, tmp_path)
    second = console_of(sim, machine, tmp_path if here else tmp_path / "there")
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
    assert first.lathe.ownership is not None and first.lathe.ownership.standing is Standing.OUSTED


def test_who_was_pushed_aside_says_nothing_more_to_the_card_but_a_stop(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    first, second = (console_of(sim, machine, tmp_path / name) for name in ("here", "there"))
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


def test_without_a_lock_nothing_is_kept_and_a_simulated_machine_of_ones_own_needs_none(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    console = console_of(sim, machine, tmp_path, locking=False)
    console.owning.claim()
    console.owning.release()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_takes_no_lock_lets_nobody_control(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    (tmp_path / "locks").write_text("", encoding="ascii")
    console = console_of(sim, machine, tmp_path)
    with pytest.raises(SessionError) as error:
        console.owning.claim()
    assert error.value.problems[0].code == "lock.unwritable"
    assert console.on_the_card == 0


def test_a_log_that_cannot_be_written_is_no_reason_not_to_take_over(
    sim: SimulatedLathe, machine: MachineProfile, tmp_path: Path
) -> None:
    (tmp_path / "ownership.log").mkdir()
    first, second = (console_of(sim, machine, tmp_path / name) for name in ("there", ""))
    first.owning.claim()
    second.owning.take_control()
    assert second.on_the_card == second.number


def test_of_many_consoles_in_any_order_one_controls(machine: MachineProfile, tmp_path: Path) -> None:
    """Claims, releases and take-overs at random: the number on the card is that of the one owner, or nobody's."""
    sim, chance = SimulatedLathe(machine), random.Random(2001)
    consoles = [console_of(sim, machine, tmp_path / str(n % 2)) for n in range(4)]
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
            c.number for c in consoles if c.lathe.ownership and c.lathe.ownership.standing is Standing.OWNER
        ]
        held = each.on_the_card
        assert standing == ([held] if held else [])
        owners.add(held)
    assert len(owners) > 3
