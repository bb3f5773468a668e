"""One console at a time commands; who comes later looks on, and who was pushed aside finds out with a look."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from drivers.cutting.bounds import Trim
from drivers.errors import RefusedError
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.lathe import Lathe
from drivers.lathe.ownership import Ownership
from drivers.lathe.snapshot import AxisName
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.program_text import read_program
from drivers.pmac.reserved import ECHO, OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine


def console(sim: SimulatedLathe, seed: int) -> Ownership:
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    return Ownership(client, Random(seed))


@pytest.fixture
def sim(machine: MachineProfile) -> SimulatedLathe:
    return SimulatedLathe(machine)


def refusal(error: pytest.ExceptionInfo[RefusedError]) -> str:
    return error.value.problems[0].code


def test_the_first_owns_and_the_second_looks_on(sim: SimulatedLathe) -> None:
    first, second = console(sim, 1), console(sim, 2)
    first.claim()
    first.refuse_unless_owner()
    with pytest.raises(RefusedError) as refused:
        second.claim()
    assert refusal(refused) == "owner.held"
    assert refused.value.problems[0].value == str(first.number)
    with pytest.raises(RefusedError):
        second.refuse_unless_owner()
    assert first.standing is ConsoleRole.OWNER


def test_who_gives_it_back_leaves_it_free(sim: SimulatedLathe) -> None:
    first, second = console(sim, 1), console(sim, 2)
    first.claim()
    first.release()
    second.claim()
    assert (first.standing, second.standing) == (ConsoleRole.OBSERVER, ConsoleRole.OWNER)
    first.release()
    assert sim.controller.variables.get(VariableKind.P, OWNER) == second.number, "what is not ours stays"


def test_a_take_over_needs_rest_and_is_seen_by_who_was_pushed_aside(sim: SimulatedLathe) -> None:
    first, second = console(sim, 1), console(sim, 2)
    first.claim()
    with pytest.raises(RefusedError) as refused:
        second.take_control(at_rest=False)
    assert refusal(refused) == "owner.moving"
    assert second.take_control(at_rest=True) == first.number
    first.see(second.number)
    assert first.standing is ConsoleRole.OUSTED
    with pytest.raises(RefusedError) as refused:
        first.refuse_unless_owner()
    assert refusal(refused) == "owner.held"


def test_nobody_commands_who_has_not_asked_to_and_who_died_is_another_one(sim: SimulatedLathe) -> None:
    alone = console(sim, 1)
    with pytest.raises(RefusedError) as refused:
        alone.refuse_unless_owner()
    assert refusal(refused) == "owner.observer"
    console(sim, 1).claim()
    with pytest.raises(RefusedError):
        console(sim, 3).claim()


def lathe_of(sim: SimulatedLathe, machine: MachineProfile, *, claim: bool) -> tuple[Lathe, list[str]]:
    """Return a lathe with closed loops whose console may command or not, and what it sends beside its polls."""
    link = MemoryLink(sim.connect(), sim)
    client, sent = PmacClient(link, sim), list[str]()
    ownership = Ownership(client, Random(1))
    heartbeat = Heartbeat(client, sim, machine, owner_seen=ownership.see)
    lathe = Lathe(client, machine, sim, StopPath(link), heartbeat=heartbeat, ownership=ownership)
    lathe.connect()
    client.request("#1J/ #2J/ #3J/")
    if claim:
        lathe.claim()
    send = link.send

    def record(data: bytes) -> None:
        line = data.decode().strip()
        if line and line != lathe.poll_line:
            sent.append(line)
        send(data)

    link.send = record  # type: ignore[method-assign]
    return lathe, sent


COMMANDS: dict[str, Callable[[Lathe], object]] = {
    "load": lambda lathe: lathe.program.load(read_program("OPEN PROG 3\nCLEAR\nDWELL0\nCLOSE")),
    "start": lambda lathe: lathe.program.start(3, 0.0),
    "end after this turn": lambda lathe: lathe.program.end_after_turn(),
    "trim": lambda lathe: lathe.program.trim(1.0 + 0.0j),
    "override": lambda lathe: lathe.program.override.command(80),
    "feed hold": lambda lathe: lathe.program.hold.ask(),
    "live trim": lambda lathe: lathe.program.live_trim.ask(Trim(gain_percent=1.0)),
    "look for tables": lambda lathe: lathe.program.tables_left(),
    "switch tables off": lambda lathe: lathe.program.switch_tables_off(),
    "clear tables": lambda lathe: lathe.program.clear_tables(),
    "begin the witness": lambda lathe: lathe.begin_witness((0.0, 1.0)),
    "enable": lambda lathe: lathe.enable(),
    "disable": lambda lathe: lathe.switch_off(),
}


@ON_ONE
@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_an_observer_sends_no_command_of_a_cut(
    sim: SimulatedLathe, machine: MachineProfile, command: Callable[[Lathe], object]
) -> None:
    lathe, sent = lathe_of(sim, machine, claim=False)
    with pytest.raises(RefusedError) as refused:
        command(lathe)
    assert (refusal(refused), sent) == ("owner.observer", [])


@ON_ONE
def test_what_a_cut_has_changed_is_put_back_by_its_owner(sim: SimulatedLathe, machine: MachineProfile) -> None:
    """At the end of every cut: where nothing was changed, nothing is sent."""
    lathe, sent = lathe_of(sim, machine, claim=True)
    lathe.program.put_back()
    assert sent == []
    lathe.program.override.command(80)
    lathe.program.load(read_program("OPEN PROG 3\nCLEAR\nDWELL0\nCLOSE"), restore=("P12=34",))
    assert lathe.ownership is not None
    lathe.ownership.see(4711)
    sent.clear()
    with pytest.raises(RefusedError):
        lathe.program.put_back()
    assert sent == []
    lathe.ownership.standing = ConsoleRole.OWNER
    lathe.program.put_back()
    assert sent == ["&1%100", "P12=34"]
    lathe.program.override.command(80)
    lathe.program.put_back()
    assert sent[2:] == ["&1%80", "&1%100"]


def test_a_console_that_lost_control_starts_nothing(sim: SimulatedLathe, machine: MachineProfile) -> None:
    """What is read of the heartbeat right before a motion also says who owns the machine by then."""
    lathe, sent = lathe_of(sim, machine, claim=True)
    lathe.enable()
    here = lathe.snapshot().carriage.position
    send = lathe._client.link.send

    def take_over(data: bytes) -> None:
        if f"P{ECHO}".encode() in data:
            sim.controller.variables.set(VariableKind.P, OWNER, 4711.0)
        send(data)

    lathe._client.link.send = take_over  # type: ignore[method-assign]
    sent.clear()
    with pytest.raises(RefusedError) as refused:
        lathe.jog_to(AxisName.CARRIAGE, here + 500.0)
    assert refusal(refused) == "owner.held"
    assert not [line for line in sent if "J" in line]


@ON_ONE
def test_an_observer_says_that_it_has_stopped_the_machine(sim: SimulatedLathe, machine: MachineProfile) -> None:
    lathe, _ = lathe_of(sim, machine, claim=False)
    assert lathe.ownership is not None
    lathe.say_stopped()
    assert lathe.program.end().stopped_by == lathe.ownership.number
