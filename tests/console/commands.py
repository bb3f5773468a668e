"""What tests of commands have in common: the controller that they meet, and who answers their questions."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pytest import MonkeyPatch

from console.cli.machine.card_access import ConnectedController
from console.session.data.kept_files import data_folder
from console.session.dated_input import TypedLine
from drivers.lathe.ownership import Ownership
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.commissioned import Commissioned, commissioned, of_family

Console = Callable[..., Any]
JobFile = Callable[..., Path]

on_one = pytest.mark.parametrize("card", ["pmac"], indirect=True)
"""For what the command decides; that both families are proven, the other tests show."""


@pytest.fixture(params=["pmac", "turbo"])
def card(request: pytest.FixtureRequest, monkeypatch: MonkeyPatch) -> Commissioned:
    """The controller that the commands meet, on simulated time."""
    made = commissioned(of_family(load_machine("lee-2001-lathe").machine, request.param))
    _meet(made, monkeypatch, made.machine, lambda: made.client.connect(), address="memory", simulated=True)
    return made


def real(card: Commissioned, monkeypatch: MonkeyPatch, signed_for: str = "machine") -> None:
    """Let the commands take the card for one of iron, whose safety devices somebody has signed for."""
    machine = signed(card.machine, signed_for)
    _meet(card, monkeypatch, machine, lambda: ("1.17", "PMAC1, X1"), address="tcp:lathe:1", simulated=False)


def _meet(
    made: Commissioned,
    monkeypatch: MonkeyPatch,
    machine: MachineProfile,
    connect: Callable[[], tuple[str, str]],
    **facts: Any,
) -> None:
    @contextmanager
    def opened(*_: object) -> Iterator[ConnectedController]:
        version, kind = connect()
        here = {"client": made.client, "stop": made.stop, "clock": made.sim, "data": data_folder(None)}
        yield ConnectedController(machine=machine, version=version, kind=kind, **here, **facts)  # type: ignore[arg-type]

    monkeypatch.setattr("console.cli.machine.card_access.opened_card", opened)


def signed(machine: MachineProfile, signed_for: str) -> MachineProfile:
    return replace(machine, safety=replace(machine.safety, signed_for=signed_for))


def answers(monkeypatch: MonkeyPatch, text: str, *, late: bool = False) -> None:
    """Answer the next question of a command at a terminal; how old an answer is has tests at a real one."""
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stdin", terminal)

    def read_line(question: str) -> TypedLine:
        print(question, end="", file=sys.stderr)
        return TypedLine(text, late=late)

    monkeypatch.setattr("console.session.dated_input.read_line", read_line)


def occupied(card: Commissioned, why: str, program: int) -> bool:
    """Keep the machine from being written for this reason, or return False where it is another one."""
    if why == "drives":
        card.tell("#1J/")
    elif why == "owner":
        Ownership(card.client).claim()
    elif why == "gathering":
        card.tell("I20=1", "I21=$800028", "I19=1000", "DEFINE GATHER 10000", "GATHER")
    elif why == "password":
        card.tell(f"OPEN PROG {program} CLEAR", "X1", "CLOSE", "PASSWORD=Turn")
        card.sim.controller.password.locked = True
    else:
        return False
    return True
