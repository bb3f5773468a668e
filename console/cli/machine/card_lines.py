"""Identification of the connected controller, for people and for JSON."""

from __future__ import annotations

from console.cli.machine.card_access import Card
from console.text.catalogue import Catalogue


def card_line(card: Card, text: Catalogue) -> str:
    """Return the line that identifies the controller."""
    mark = f"{text('sim')}  " if card.simulated else ""
    return mark + text(
        "card.head", machine=card.machine.name, address=card.address, kind=card.kind, version=card.version
    )


def card_fields(card: Card) -> dict[str, object]:
    """Return the machine with its controller."""
    return {
        "machine": card.machine.name,
        "address": card.address,
        "simulated": card.simulated,
        "type": card.kind,
        "version": card.version,
    }
