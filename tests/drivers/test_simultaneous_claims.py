"""Consoles that claim a machine at once, and programs that are known as their own."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from itertools import permutations
from random import Random
from threading import Semaphore, Thread

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import DriverError, RefusedError
from drivers.identification.excitation import PROGRAM, PvtPath, axis_word
from drivers.identification.health import HealthRequest, health_text
from drivers.identification.identify import identify
from drivers.lathe.console_role import NOBODY, ConsoleRole
from drivers.lathe.ownership import HIGHEST, OWNER_ITEM, Ownership, exchange_line
from drivers.link.base import Link
from drivers.link.memory import MemoryLink
from drivers.link.passing import PassingLink
from drivers.pmac.client import LINE_LIMIT, PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.programs.setup import is_signed, sign_program
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.commissioned import Stand, ready
from tests.drivers.families import ON_ONE
from tests.drivers.families import machine as machine
from tests.drivers.test_identification_refused import PVT

TIMEOUT_S = 20.0


class TurnLink(PassingLink):
    """A link whose lines wait for their turn. All that happens between two lines of one host happens at once."""

    def __init__(self, link: Link) -> None:
        super().__init__(link)
        self.gated = self.over = False
        self._may_go, self._waits = Semaphore(0), Semaphore(0)

    def send(self, data: bytes) -> None:
        if self.gated and data.endswith(b"\r"):
            self._waits.release()
            assert self._may_go.acquire(timeout=TIMEOUT_S)
        super().send(data)

    def next_line(self) -> None:
        """Let one line out, and wait until its host has come to the next one, or to its end."""
        self._may_go.release()
        self.wait()

    def wait(self) -> None:
        assert self._waits.acquire(timeout=TIMEOUT_S)

    def ended(self) -> None:
        self.over = True
        self._waits.release()


class Turns:
    """Hosts that do something at once, line by line, in the order that `run` is given."""

    def __init__(self, links: Iterable[TurnLink]) -> None:
        self._links = tuple(links)

    def run(self, acts: Iterable[Callable[[], object]], order: Iterable[int]) -> None:
        """Begin what each host does, and let their lines out in this order of hosts; then the rest, in turn."""
        threads = []
        for link, act in zip(self._links, acts, strict=True):
            link.gated, link.over = True, False
            threads.append(Thread(target=self._work, args=(link, act)))
            threads[-1].start()
            link.wait()
        turns = iter(order)
        while waiting := [link for link in self._links if not link.over]:
            turn = next(turns, None)
            link = waiting[0] if turn is None else self._links[turn]
            if not link.over:
                link.next_line()
        for link, thread in zip(self._links, threads, strict=True):
            thread.join(TIMEOUT_S)
            link.gated = False

    @staticmethod
    def _work(link: TurnLink, act: Callable[[], object]) -> None:
        try:
            act()
        finally:
            link.ended()


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
    return [each.number for each in consoles if each.standing is ConsoleRole.OWNER]


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


def test_who_leaves_wipes_nobodys_number_out(floor: Floor) -> None:
    for order in sorted(set(permutations((0, 0, 1, 1, 2, 2)))):
        leaving, *claiming = consoles = floor.consoles(3)
        leaving.claim()
        floor.at_once([leaving.release, *(each.claim for each in claiming)], order)
        assert owners(consoles) == ([floor.holder] if floor.holder else []), order
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
    assert (console.standing, floor.holder) == (ConsoleRole.OWNER, console.number)


@given(
    held=st.one_of(st.sampled_from([0, 1, 4711, HIGHEST]), st.integers(0, HIGHEST)),
    sought=st.one_of(st.sampled_from([0, 1, 4711, HIGHEST]), st.integers(0, HIGHEST)),
    number=st.integers(1, HIGHEST),
)
def test_the_line_exchanges_what_it_was_told_alone(six: Floor, held: int, sought: int, number: int) -> None:
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
    assert (console.standing, floor.holder) == (ConsoleRole.OWNER, console.number)


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


# What an interrupted measurement leaves in the controller is taken over; what is somebody else's stays.

CODE = st.lists(st.sampled_from(["P1=1", "X(P1*2)", "PVT4", "DWELL20", "M26=0 P2=.50", "N10X1"]), max_size=12)


def body(text: str) -> list[str]:
    """What stands between CLEAR and CLOSE, without comments: an own reading of the text."""
    code = re.search(r"CLEAR\n(.*)\nCLOSE", text, re.DOTALL)
    assert code is not None
    return [line.split(";")[0].strip() for line in code[1].splitlines()]


@given(code=CODE, cut=st.integers(0, 15))
def test_a_program_is_known_in_whole_and_in_part(code: list[str], cut: int) -> None:
    lines = body(sign_program("\n".join(["P9=1", "CLOSE", "OPEN PROG 998", "CLEAR", *code, "CLOSE"])))
    assert lines[3:] == code
    assert is_signed([*lines, "RETURN"]) and is_signed([*lines[:cut], "RETURN"])


@given(code=CODE, place=st.integers(0, 11), other=st.sampled_from(["P1=2", "X0", "P3=3"]))
def test_a_changed_or_longer_program_is_not_ours(code: list[str], place: int, other: str) -> None:
    lines = body(sign_program("\n".join(["CLOSE", "OPEN PROG 998", "CLEAR", *code, "CLOSE"])))
    assert not is_signed([*lines, other])
    if place < len(code):
        assert not is_signed([*lines[: 3 + place], other, *lines[4 + place :]])
    assert not is_signed([*code, other])
    assert not is_signed([*lines[:3], other]), "our name over something short is not ours either"


def test_the_longest_of_our_programs_has_room_for_its_signature(machine: MachineProfile) -> None:
    moves = HealthRequest(step_um=3.0)
    text = health_text(machine, axis_word(machine, machine.tool.motor), moves, 0.0)
    assert max(map(len, text.splitlines())) < LINE_LIMIT and is_signed(body(text))


def left_whole(made: Stand) -> None:
    made.tell(*PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text.splitlines())


def left_in_part(made: Stand) -> None:
    made.tell("OPEN PROG998", "CLEAR", *body(PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text)[:6])
    made.tell("CLOSE")


@ON_ONE
@pytest.mark.parametrize("leave", [left_whole, left_in_part])
def test_what_a_lost_link_left_is_erased(machine: MachineProfile, leave: Callable[[Stand], None]) -> None:
    made = ready(machine)
    leave(made)
    assert made.sim.controller.programs[PROGRAM]
    assert identify(made.rig, PVT, made.origin, "D").points
    assert not made.sim.controller.programs[PROGRAM]


@ON_ONE
def test_one_line_more_is_somebody_s(machine: MachineProfile) -> None:
    made = ready(machine)
    text = PvtPath(made.rig.machine, 3.0).sweep(20.0, 5).text.removesuffix("CLOSE\n")
    made.tell(*text.splitlines(), "P900=1", "CLOSE")
    with pytest.raises(RefusedError) as refused:
        identify(made.rig, PVT, made.origin, "D")
    assert [problem.code for problem in refused.value.problems] == ["identify.in_use"]
    assert made.sim.controller.programs[PROGRAM]
