"""Which controller a command speaks with, for people and for JSON."""

from __future__ import annotations

from console.cli.machine.card_access import Card
from console.text.catalogue import Catalogue


def card_line(card: Card, text: Catalogue) -> str:
    """Return the line that says which controller this is."""
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
