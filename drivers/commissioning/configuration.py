"""The configuration of a controller as one value: everything that stays while nothing moves.

Values of P, Q and M belong to programs and PLCs: a backup has them, no comparison looks at them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from drivers.commissioning.user_buffer import UserWords
from drivers.pmac.dialect import DIALECTS, Dialect, SettingScope
from drivers.pmac.variables import MODAL_NUMBERS
from profiles.problem import Problem

HOST_SETTINGS = (3, 4, 6, 63, 64)  # handshake, checksums, errors, echo, marks: set by every host when it connects


@dataclass(frozen=True, slots=True)
class AxisEntry:
    """The axis definition of a motor, such as `2000X+10`, and its coordinate system."""

    system: int
    text: str


@dataclass(frozen=True, slots=True)
class TableEntry:
    """A compensation table: the arguments of DEFINE COMP, the number of entries, and their hash (sha256)."""

    definition: str
    entry_count: int
    sha256: str


@dataclass(frozen=True, kw_only=True)
class ControllerConfiguration:
    """What was read from one controller; mappings are by number.

    `pointers` are the M-variables with a definition. `conversion` are the set-up words of the encoder
    conversion table, of families in which these are not I-variables. `locked` names what a password hides, such as
    `PLC 3`. `entries` are those of the compensation tables, `values` those of P, Q and M that are not 0, by names
    such as `P7` and `&2Q5`; None where they were not asked for. `kinematics` are the programs INVERSE and FORWARD
    by coordinate system, where values were asked for. `user_buffer` are its addresses,
    empty where it has no words; None where they were not asked for or the controller does not tell.
    `no_programs` are the numbers beside the usual ones under which no program was found.
    `misplaced_buffer` is why it is None where the controller reports a place that it cannot have.
    `user_words` are the words there, None where there are none or values were not asked for.
    """

    family: str
    kind: str
    version: str
    settings: Mapping[int, float]
    axes: Mapping[int, AxisEntry] = field(default_factory=dict)
    pointers: Mapping[int, str] = field(default_factory=dict)
    plcs: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    programs: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    tables: Mapping[int, TableEntry] = field(default_factory=dict)
    conversion: tuple[int, ...] = ()
    locked: tuple[str, ...] = ()
    entries: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    values: Mapping[str, float] | None = None
    kinematics: Mapping[tuple[int, str], tuple[str, ...]] = field(default_factory=dict)
    user_buffer: range | None = None
    misplaced_buffer: Problem | None = None
    no_programs: tuple[int, ...] = ()

    user_words: UserWords | None = None

    @property
    def sought_programs(self) -> tuple[int, ...]:
        """The numbers under which whoever compares or restores has to look for programs, beside the usual ones."""
        return tuple(sorted({*self.programs, *self.no_programs}))

    @property
    def dialect(self) -> Dialect:
        """The family as data."""
        return DIALECTS[self.family]

    @cached_property
    def standing(self) -> Mapping[int, float]:
        """The settings that ordinary work does not change, by number."""
        passing = passing_settings(self.dialect)
        return {index: value for index, value in self.settings.items() if index not in passing}

    @property
    def fingerprint(self) -> str:
        """Return the hash (sha256) of what ordinary work does not change; programs are not included."""
        return digest(
            [self.family, self.kind, self.version]
            + [f"I{index}={value!r}" for index, value in sorted(self.standing.items())]
            + [f"#{motor}->{axis}" for motor, axis in sorted(self.axes.items())]
            + [f"M{index}->{text}" for index, text in sorted(self.pointers.items())]
            + [f"PLC{number} {line}" for number, lines in sorted(self.plcs.items()) for line in lines]
            + [f"COMP{motor} {table}" for motor, table in sorted(self.tables.items())]
            + [f"{word}" for word in self.conversion]
        )


def passing_settings(dialect: Dialect) -> frozenset[int]:
    """Return the settings that ordinary work changes: the host's own, gathering, modal values, timers."""
    gather = dialect.gathering
    passing = {gather.period, *gather.masks}
    passing |= set(range(gather.first_source, gather.first_source + gather.source_count))
    for system in dialect.numbers(SettingScope.SYSTEM):
        passing |= {dialect.system_index(system, number) for number in MODAL_NUMBERS}
    return fleeting_settings(dialect) | passing


def fleeting_settings(dialect: Dialect) -> frozenset[int]:
    """Return the settings that are not part of a configuration: the host's own, timers, what only reports."""
    systems = dialect.numbers(SettingScope.SYSTEM)
    timers = {dialect.system_index(system, number) for system in systems for number in dialect.timer_numbers}
    reported = () if dialect.user_buffer is None else (dialect.user_buffer.setting,)
    return frozenset({*HOST_SETTINGS, *timers, *(each for each in reported if each is not None)})


def digest(lines: Iterable[str]) -> str:
    """Return the hash (sha256, hexadecimal) of lines."""
    return hashlib.sha256("".join(f"{line}\n" for line in lines).encode("utf-8")).hexdigest()
