"""A signal at any moment of a command: it stops the machine where that is ours, and is silent where it is not."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from console.session.errors import Interrupted
from console.session.signals import Interruption
from console.session.station.reaching import guard, leave
from drivers.errors import RefusedError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.standing import NOBODY, Standing
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import ProblemError
from profiles.store import load_machine
from tests.console.commands import Console, real
from tests.console.consoles import MACHINE, STOPS, OneConsole, console_of
from tests.drivers.commissioned import Commissioned

ANOTHER = 4711
MOST = 60
"""More than what a claim and a release hand to the link."""


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine(MACHINE).machine


class _Moments:
    """The signal comes at the n-th time that the link is used, before or behind what is done with it."""

    def __init__(self, console: OneConsole, at: int, come: Callable[[], object]) -> None:
        self.over = False
        self._left, self._come = at, come
        link = console.client.link
        for name in ("send", "receive"):
            setattr(link, name, self._watched(getattr(link, name)))

    def _watched(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def use(*words: object) -> object:
            self._pass()
            done = real(*words)
            self._pass()
            return done

        return use

    def _pass(self) -> None:
        self._left -= 1
        if self._left == 0:
            self.over = True
            self._come()


def works(console: OneConsole, interruption: Interruption) -> None:
    """What `console run` does with the machine, up to the point where something would move."""
    guard(interruption, console.lathe, console.sim.now_s)
    try:
        console.owning.claim()
        console.lathe.stop.check()
    finally:
        leave(console.lathe, console.owning)


@pytest.mark.parametrize("holder", [NOBODY, ANOTHER])
def test_there_is_no_moment_of_a_claim_in_which_a_signal_is_lost_or_stops_another(
    machine: MachineProfile, tmp_path: Path, holder: int
) -> None:
    sim, endings = SimulatedLathe(machine), set()
    for at in range(1, MOST):
        console = console_of(sim, machine, tmp_path / "here", locking=False)
        console.client.request(f"P1000={holder}")
        console.hear()
        interruption = Interruption()
        sent: list[tuple[Standing, bytes]] = []
        urgent = console.client.link.send_urgent

        def stops(data: bytes, console: OneConsole = console, sent: Any = sent, urgent: Any = urgent) -> None:
            assert console.lathe.ownership is not None
            sent.append((console.lathe.ownership.standing, data))
            urgent(data)

        console.client.link.send_urgent = stops  # type: ignore[method-assign]
        moments = _Moments(console, at, partial(interruption.end, "SIGTERM"))
        try:
            works(console, interruption)
        except Interrupted:
            endings.add("at once")
        except RefusedError:
            endings.add("refused")
            assert holder == ANOTHER
        except ProblemError as error:
            assert error.problems[0].code == "machine.stopped", error
            endings.add("stopped")
        else:
            endings.add("in the release")
        if not moments.over:
            break
        assert {standing for standing, _ in sent} <= {Standing.OWNER}
        assert holder == NOBODY or not sent
        assert int(sim.controller.variables.get(VariableKind.P, OWNER)) == holder, at
    else:
        raise AssertionError("a claim has more moments than that")
    assert endings >= ({"at once", "stopped", "in the release"} if holder == NOBODY else {"at once", "refused"})


def test_what_was_ours_and_still_moves_is_stopped_though_another_has_written_his_number(
    machine: MachineProfile, tmp_path: Path
) -> None:
    sim = SimulatedLathe(machine)
    console = console_of(sim, machine, tmp_path, locking=False)
    interruption = Interruption()
    guard(interruption, console.lathe, console.sim.now_s)
    console.owning.claim()
    console.lathe.verify()
    console.lathe.enable()

    def ousted(snapshot: Snapshot) -> None:
        if said or not snapshot.moving:
            return
        assert console.lathe.ownership is not None
        console.lathe.ownership.see(ANOTHER)
        console.hear()
        interruption.end("SIGINT")
        said.append(console.hear())

    said: list[bytes] = []
    console.looks.append(ousted)
    with pytest.raises(ProblemError) as ended:
        console.lathe.home()
    assert ended.value.problems[0].code in ("machine.stopped", "owner.ousted")
    assert set(said[0]) & set(STOPS)


def test_who_was_pushed_aside_at_rest_ends_without_a_word(machine: MachineProfile, tmp_path: Path) -> None:
    sim = SimulatedLathe(machine)
    first, second = (console_of(sim, machine, tmp_path / name, locking=False) for name in ("here", "there"))
    interruption = Interruption()
    guard(interruption, first.lathe, sim.now_s)
    first.owning.claim()
    second.owning.take_control()
    first.lathe.snapshot()
    first.hear()
    with pytest.raises(Interrupted):
        interruption.end("output closed")
    leave(first.lathe, first.owning)
    assert first.hear() == b""


def test_what_must_not_end_half_done_ends_behind_it() -> None:
    interruption, done = Interruption(), []
    with pytest.raises(Interrupted, match="SIGTERM"), interruption.holding():
        interruption.end("SIGTERM")
        done.append(True)
    assert done


@pytest.fixture
def at_a_line(card: Commissioned, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Let SIGTERM come when the card is sent a certain piece of text for the first time."""
    send = card.link.send
    waits: list[bytes] = []

    def heard(data: bytes) -> None:
        send(data)
        if waits and waits[0] in data:
            waits.clear()
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(card.link, "send", heard)
    yield waits.append
    assert not waits, "it was never sent"


def test_doctor_that_ends_while_it_asks_whose_the_machine_is_stops_nobody(
    console: Console, card: Commissioned, monkeypatch: pytest.MonkeyPatch, at_a_line: Callable[[bytes], None]
) -> None:
    real(card, monkeypatch)
    card.tell(f"P1000={ANOTHER}")
    at_a_line(b"P1000\r")
    card.line.heard = b""
    said = console("doctor", "--prove", "--yes")
    assert (said.code, "SIGTERM" in said.err) == (1, True)
    assert not set(card.line.heard) & set(STOPS)


def test_an_apply_is_not_left_half_done_and_gives_the_machine_back(
    console: Console, card: Commissioned, at_a_line: Callable[[bytes], None]
) -> None:
    card.tell("I130=600", "I131=600")
    at_a_line(b"I130=528")
    said = console("controller", "apply", "--yes")
    assert (said.code, "SIGTERM" in said.err) == (1, True)
    assert card.client.numbers("I130", "I131", "P1000") == (528.0, 4905.0, 0.0)
