"""A card on the wire with PLCs in it, let run for whole background cycles."""

from __future__ import annotations

from drivers.pmac.dialect import Dialect
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire

BLOCK = 11
"""Servo cycles of a background cycle of the bundled machine."""

SMALL = 1e-6
"""Of a servo cycle, so that a background cycle is never missed by a rounding."""


def plc_card(machine: MachineProfile, dialect: Dialect, i5: int = 2) -> Wire:
    card = wire(machine, dialect)
    card.tell(f"I5={i5}")
    return card


def run_for(card: Wire, background_cycles: int = 1) -> None:
    """Let background cycles pass; what a host has sent before is executed at the end of the first."""
    before = card.card.cycles
    for _ in range(background_cycles):
        card.sim.wait((BLOCK + SMALL) * card.card.servo_period_ms / 1000.0)
    assert card.card.cycles - before == BLOCK * background_cycles


def store(card: Wire, number: int, text: str, *, on: bool = True) -> None:
    """Type a PLC, and switch it on."""
    lines = [line.strip() for line in text.strip().splitlines()]
    card.tell(f"OPEN PLC {number} CLEAR", *lines, "CLOSE")
    if on:
        card.tell(f"ENABLE PLC {number}")


def values(card: Wire, names: str) -> list[float]:
    return [float(said) for said in card.ask(names)]


def reset(card: Wire, word: str = "$$$") -> None:
    """Reset the card, whose handshake is then another one, and set it to ours."""
    card.raw(f"{word}\r")
    card.raw("\x18I3=2 I4=0 I6=1\r")
