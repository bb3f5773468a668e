"""Status words of motors, coordinate system and controller, bit by bit, by the tables of the family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.controller import Controller
from drivers.errors import out_of_step
from drivers.lathe.snapshot import AxisName
from drivers.pmac.dialect import Dialect
from drivers.pmac.status import BITS_PER_WORD, BitTable
from profiles.machine import MachineProfile

_DIGITS = BITS_PER_WORD // 4


@dataclass(frozen=True, slots=True)
class StatusBit:
    """One bit: its word from 1, its place, its name in the tables of the family, "" for none, and its state."""

    word: int
    bit: int
    name: str
    is_set: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusWords:
    """What one query returned: `subject` is tool, spindle, carriage, system or controller; `item` the query."""

    subject: str
    item: str
    digits: str
    bits: tuple[StatusBit, ...]


def status_items(machine: MachineProfile, dialect: Dialect) -> tuple[tuple[str, str, BitTable], ...]:
    """Return subject, query and table of bits of each status."""
    return (
        *((name, f"#{motor}?", dialect.motor_bits) for name, motor in zip(AxisName, machine.motors, strict=True)),
        ("system", "&1??", dialect.system_bits),
        ("controller", "???", dialect.global_bits),
    )


def read_status(client: Controller, machine: MachineProfile, dialect: Dialect) -> tuple[StatusWords, ...]:
    """Read all of them in one query. Raises DriverError: `link.out_of_step`, or as `Controller.query`."""
    items = status_items(machine, dialect)
    found = client.query(*(item for _, item, _ in items))
    return decode_replies(items, found, client.link.address)


def decode_replies(
    items: Sequence[tuple[str, str, BitTable]], found: Sequence[str], where: str = ""
) -> tuple[StatusWords, ...]:
    """Return the words of some replies. Raises LinkError: `link.out_of_step`, no hexadecimal digits."""
    try:
        return tuple(
            StatusWords(subject=subject, item=item, digits=text.strip(), bits=_bits(text.strip(), table))
            for (subject, item, table), text in zip(items, found, strict=True)
        )
    except ValueError as error:
        raise out_of_step(where, "?", str(error)) from error


def _bits(digits: str, table: BitTable) -> tuple[StatusBit, ...]:
    """Return every bit that has a name or is set, in the order of the words, highest first."""
    names = {place: name for name, place in table.items()}
    bits = []
    for number, start in enumerate(range(0, len(digits), _DIGITS), start=1):
        word = int(digits[start : start + _DIGITS], 16)
        for bit in reversed(range(BITS_PER_WORD)):
            name, is_set = names.get((number, bit), ""), bool(word >> bit & 1)
            if name or is_set:
                bits.append(StatusBit(number, bit, name, is_set))
    return tuple(bits)
