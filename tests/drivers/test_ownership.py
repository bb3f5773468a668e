"""One console at a time commands; who comes later looks on, and who was pushed aside finds out with a look."""

from __future__ import annotations

from random import Random

import pytest

from drivers.errors import RefusedError
from drivers.lathe.ownership import Ownership
from drivers.lathe.standing import Standing
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
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
    assert first.standing is Standing.OWNER


def test_who_gives_it_back_leaves_it_free(sim: SimulatedLathe) -> None:
    first, second = console(sim, 1), console(sim, 2)
    first.claim()
    first.release()
    second.claim()
    assert (first.standing, second.standing) == (Standing.OBSERVER, Standing.OWNER)
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
    assert first.standing is Standing.OUSTED
    with pytest.raises(RefusedError) as refused:
        first.refuse_unless_owner()
    assert refusal(refused) == "owner.held"


def test_nobody_commands_who_has_not_asked_to(sim: SimulatedLathe) -> None:
    alone = console(sim, 1)
    with pytest.raises(RefusedError) as refused:
        alone.refuse_unless_owner()
    assert refusal(refused) == "owner.observer"


def test_a_console_that_died_and_came_back_is_another_one(sim: SimulatedLathe) -> None:
    console(sim, 1).claim()
    with pytest.raises(RefusedError):
        console(sim, 3).claim()
