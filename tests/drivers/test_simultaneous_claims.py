"""Consoles that reach for a machine at the same moment, over lines of their own, in every order of what they say.

No look comes in between: what a console believes when its claim has ended must be so.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import permutations
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import DriverError, RefusedError
from drivers.lathe.ownership import HIGHEST, OWNER_ITEM, Ownership, exchange_line
from drivers.lathe.standing import NOBODY, Standing
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.families import machine as machine
from tests.drivers.turns import TurnLink, Turns

LINES = 3
"""More than a claim sends: who has ended waits for nobody."""


class Floor:
    """One card, and consoles that are made anew for each trial on the same lines."""

    def __init__(self, machine: MachineProfile, consoles: int) -> None:
        self.sim = SimulatedLathe(machine)
        self.links = [TurnLink(MemoryLink(self.sim.connect(), self.sim)) for _ in range(consoles)]
        self.clients = [PmacClient(link, self.sim) for link in self.links]
        for client in self.clients:
            client.connect()

    def consoles(self, count: int, held: int = NOBODY) -> list[Ownership]:
        """Return fresh consoles at a machine that somebody holds."""
        self.sim.controller.variables.set(VariableKind.P, OWNER, float(held))
        return [Ownership(client, Random(seed)) for seed, client in enumerate(self.clients[:count], 1)]

    def at_once(self, acts: list[Callable[[], object]], order: tuple[int, ...]) -> None:
        """Let each console do something, in this order of lines; a refusal is an end like any other."""

        def guarded(act: Callable[[], object]) -> Callable[[], None]:
            def work() -> None:
                with suppress(DriverError):
                    act()

            return work

        Turns(self.links[: len(acts)]).run([guarded(act) for act in acts], order)

    @property
    def holder(self) -> int:
        return int(self.sim.controller.variables.get(VariableKind.P, OWNER))


def owners(consoles: list[Ownership]) -> list[int]:
    return [each.number for each in consoles if each.standing is Standing.OWNER]


@pytest.fixture
def floor(machine: MachineProfile) -> Floor:
    return Floor(machine, 6)


@pytest.mark.parametrize("count", [2, 3])
def test_in_every_order_one_console_gets_the_machine_and_the_others_know(floor: Floor, count: int) -> None:
    turns = [number for number in range(count) for _ in range(LINES if count == 2 else 2)]
    for order in sorted(set(permutations(turns))):
        consoles = floor.consoles(count)
        floor.at_once([each.claim for each in consoles], order)
        assert owners(consoles) == [floor.holder], order
        assert {each.holder for each in consoles} == {floor.holder}, order


@settings(max_examples=15, deadline=None)
@given(order=st.permutations([number for number in range(6) for _ in range(LINES)]))
def test_of_six_at_once_one_gets_it(six: Floor, order: list[int]) -> None:
    consoles = six.consoles(6)
    six.at_once([each.claim for each in consoles], tuple(order))
    assert owners(consoles) == [six.holder]


@pytest.fixture(scope="module")
def six() -> Floor:
    from profiles.store import load_machine

    return Floor(load_machine("lee-2001-lathe").machine, 6)


def test_who_leaves_while_others_claim_wipes_nobodys_number_out(floor: Floor) -> None:
    for order in sorted(set(permutations((0, 0, 1, 1, 2, 2)))):
        leaving, *claiming = consoles = floor.consoles(3)
        leaving.claim()
        floor.at_once([leaving.release, *(each.claim for each in claiming)], order)
        assert owners(consoles) == ([floor.holder] if floor.holder else []), order


def test_who_leaves_a_machine_that_is_being_taken_over_does_not_free_it(floor: Floor) -> None:
    for order in sorted(set(permutations((0, 0, 1, 1, 2, 2)))):
        before, *takers = consoles = floor.consoles(3)
        before.claim()
        floor.at_once([before.release, *(partial(each.take_control, at_rest=True) for each in takers)], order)
        for each in takers:
            each.see(floor.holder)
        assert owners(consoles) == [floor.holder], order


def test_of_two_who_take_it_from_the_same_one_the_second_is_refused(floor: Floor) -> None:
    _, *takers = floor.consoles(3, held=4711)
    floor.at_once([lambda: None, *(partial(each.take_control, at_rest=True) for each in takers)], (1, 2, 1, 2))
    assert owners(takers) == [floor.holder] == [takers[0].number]


def test_a_claim_whose_answer_is_lost_is_known_by_asking(floor: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    (console, *_), link = floor.consoles(1), floor.links[0]
    real = link.receive
    swallowed: list[bytes] = []

    def receive(timeout_s: float) -> bytes:
        came = real(timeout_s)
        if f"{console.number}\r".encode() in came and not swallowed:
            swallowed.append(came)
            return b""
        return came

    monkeypatch.setattr(link, "receive", receive)
    console.claim()
    assert swallowed
    assert (console.standing, floor.holder) == (Standing.OWNER, console.number)


@given(
    held=st.one_of(st.sampled_from([0, 1, 4711, HIGHEST]), st.integers(0, HIGHEST)),
    sought=st.one_of(st.sampled_from([0, 1, 4711, HIGHEST]), st.integers(0, HIGHEST)),
    number=st.integers(1, HIGHEST),
)
def test_the_line_exchanges_what_it_was_told_and_nothing_else(
    six: Floor, held: int, sought: int, number: int
) -> None:
    six.consoles(0, held)
    (answer,) = six.clients[0].request(exchange_line(sought, number), lines=1)
    assert float(answer) == six.holder == (number if held == sought else held)


@pytest.mark.parametrize("garbage", [-7.0, 1.5e9 + 0.5])
def test_whatever_somebody_has_saved_there_is_taken_over_as_it_is(floor: Floor, garbage: float) -> None:
    (console,) = floor.consoles(1)
    floor.sim.controller.variables.set(VariableKind.P, OWNER, garbage)
    with pytest.raises(DriverError):
        console.claim()
    assert floor.clients[0].numbers(OWNER_ITEM) == (garbage,)
    console.take_control(at_rest=True)
    assert (console.standing, floor.holder) == (Standing.OWNER, console.number)


def test_a_claim_takes_no_longer_than_it_did(floor: Floor) -> None:
    (console,) = floor.consoles(1)
    began_s = floor.sim.now_s()
    console.claim()
    assert floor.sim.now_s() - began_s < 0.1


def test_a_claim_that_comes_second_names_who_was_first(floor: Floor) -> None:
    first, second = floor.consoles(2)
    refusals: list[RefusedError] = []

    def claims() -> None:
        try:
            second.claim()
        except RefusedError as error:
            refusals.append(error)

    floor.at_once([first.claim, claims], (0, 1, 0, 1))
    (problem,) = refusals[0].problems
    assert (problem.code, problem.value) == ("owner.held", str(first.number))
