"""Buffers of a text at a card: every program that the check accepts arrives, and is listed as it was read."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers.commissioning.downloadable import refusals
from drivers.commissioning.downloading import differing, planned, send
from drivers.pmac.dialect import Dialect
from drivers.pmac.program_text import ProgramText, read_program
from profiles.store import load_machine
from tests.drivers.commissioned import Commissioned, commissioned, of_family
from tests.drivers.made_programs import KINEMATIC, MOTION, PLCS, PREPROCESSED

FULL_AFTER = 40  # programs, after which the card is emptied: its memory ends


def texts(dialect: Dialect) -> Iterator[str]:
    """Each made program in a buffer of its kind."""
    yield from (f"OPEN PROG {100 + n % 50} CLEAR\n{body}\nCLOSE\n" for n, body in enumerate(MOTION))
    yield from (f"OPEN PLC {n % 19} CLEAR\n{body}\nCLOSE\n" for n, body in enumerate(PLCS))
    if dialect.kinematics is not None:
        yield from (f"&3 OPEN INVERSE CLEAR\n{body}\nCLOSE\n" for body in KINEMATIC)
        yield from (f"&2\nOPEN FORWARD CLEAR\n{body}\nCLOSE\n" for body in KINEMATIC)


def arrives(card: Commissioned, read: ProgramText) -> int:
    """Send the buffers of a text; return how many lines the card then lists, each as it was expected."""
    dialect, buffers = card.client.dialect, read.source.buffers
    changes = planned(card.client, dialect, buffers)
    send(card.client, dialect, changes, "text", lambda sent, of: None)
    for form in range(4):  # the last one is the full one
        card.client.request(f"I9={form}")
        assert differing(card.client, changes) == []
        assert not any(change.differs for change in planned(card.client, dialect, buffers)), f"I9={form}"
    count = 0
    for change in changes:
        question = change.buffer.kind.line("LIST", change.buffer.number)
        *listed, end = (line.strip() for line in card.client.question(question))
        assert end == "RETURN"
        # To the letter; that is more than is asked of another card, which may shorten words.
        assert [line.text for line in change.wanted] == listed
        count += len(listed)
    return count


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_every_program_that_the_check_accepts_arrives(family: str) -> None:
    card = commissioned(of_family(load_machine("lee-2001-lathe").machine, family))
    card.client.connect()
    dialect, count = card.client.dialect, 0
    for number, text in enumerate(texts(dialect)):
        read = read_program(text, motor_count=dialect.motor_count, needs_program=False)
        assert refusals(read.source, "text", "pmac") == (), text
        count += arrives(card, read)
        if number % FULL_AFTER == FULL_AFTER - 1:
            card.tell("DELETE ALL")
    assert count > 190


def test_names_are_replaced_before_anything_is_sent() -> None:
    card = commissioned(load_machine("lee-2001-lathe").machine)
    card.client.connect()
    for number, text in enumerate(PREPROCESSED, start=101):
        own = text.replace("PROG 1 ", f"PROG {number} ")
        if "PLC" in own:
            own = own.replace("CLOSE\nOPEN PROG", "CLOSE\n&1\nOPEN PROG")
        read = read_program(own)
        assert refusals(read.source, "text", "pmac") == ()
        arrives(card, read)
    heard = card.line.heard.decode("latin-1")
    assert "#d" not in heard and "#if" not in heard and "FOO" not in heard
    assert 'CMD"#1 J/"' in heard
