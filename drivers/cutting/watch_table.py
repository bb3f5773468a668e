"""The table of what shapes a cut beside its path: read when it begins, all through its feed, and at its end.

It has the settings that are compared at arming, the axis definitions, the words of the encoder conversion table,
the bias and correction of each motor, the M-definitions and the constants of the program. What the program itself
sets is as it was, or as the program has it. Left out are the words of a time base in use and the correction of a
table, which change with the spindle. What was allowed to deviate from the profile has to stay as it was.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, cycle, islice

from drivers.commissioning.checked_configuration import stated_settings_of
from drivers.commissioning.configuration import passing_settings
from drivers.commissioning.reading import of_motors
from drivers.commissioning.setting_names import OTHER, name_setting
from drivers.controller import Controller
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect, SettingScope
from drivers.pmac.expected_replies import number_of
from drivers.pmac.heartbeat.arming import PERMISSION
from drivers.pmac.program_constants import IN_THE_CUT, RELATIVE, assigned_numbers, pointers_of
from drivers.pmac.program_load import LoadedProgram
from drivers.pmac.program_text import ProgramText
from profiles.machine import MachineProfile
from profiles.problem import Problem

SHAPING = frozenset((*range(2, 10), 29, *range(30, 40), 63, 67, 68, 69))
"""Ixnn of a motor that shape its path most: encoder, scale, following, loop, notch, friction, output limit."""

SERVO_PERIOD, TIME_BASE = 10, (92, 93, 94, 95)
VALUES_AN_ITEM = 8
_END = " &1"
"""After the query of a definition: what follows it on the line could be read as a new one. A line that begins with
it would be part of the value that renews the watchdog; polls address system 1 as well.
"""
MOST_VALUES, MOST_ASKED = 32, 200  # values and characters of one line


@dataclass(frozen=True, slots=True)
class WatchItem:
    """A query, such as `I130..133`, and the names of its answers; all of them in one where there is one name."""

    query: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CutWatchTable:
    """The items of a cut: `first` are read more often than the `later` ones.

    What the program itself sets a setting to is in `own`, by name.
    """

    first: tuple[WatchItem, ...]
    later: tuple[WatchItem, ...]
    own: Mapping[str, frozenset[float]] = field(default_factory=dict)

    @property
    def items(self) -> tuple[WatchItem, ...]:
        """All of them."""
        return (*self.first, *self.later)

    @property
    def schedule(self) -> tuple[WatchItem, ...]:
        """One whole turn of the table: the next of what shapes the path most comes after every other item."""
        return tuple(item for pair in zip(cycle(self.first), self.later) for item in pair)


def watch_table(machine: MachineProfile, loaded: LoadedProgram, *, tables_on: bool = False) -> CutWatchTable:
    """Return what is watched while a program runs on a machine; no corrections where `tables_on` move them."""
    dialect, program, tool = loaded.dialect, loaded.program, machine.tool.motor
    motors = (tool, machine.spindle.motor, machine.carriage.motor)
    stated = stated_settings_of(machine, dialect)
    every = set(chain.from_iterable(of_motors(dialect, motors).settings))
    known = {index for index in every if name_setting(index, dialect).name.key != OTHER}
    lines = [motor - 1 for motor in motors if motor <= len(dialect.conversion_table.channels)]
    conversion, words = dialect.conversion_table.first_setting, tuple[str, ...]()
    if conversion is not None:
        known |= {conversion + line for line in lines}
    else:
        words = tuple(f"Y:${dialect.conversion_table.first_address + line:X}" for line in lines)
    settings = {*known, *stated} - passing_settings(dialect) - {PERMISSION}
    others = {
        dialect.motor_index(motor, 0) for motor in dialect.numbers(SettingScope.MOTOR) if motor not in motors
    }
    shaping = _find_shaping_settings(dialect, tool)
    registers = {motor: _registers(dialect, program, motor, tables_on=tables_on) for motor in motors}
    axes = [f"#{each.motor}->" for each in read_definitions(machine.controller.axis_definitions)]
    constants = [int(each.name[1:]) for each in loaded.constants if each.kept]
    return CutWatchTable(
        first=(
            *_ranges("I", settings & shaping),
            *(WatchItem(f"RH{word}", (word,)) for word in (*registers[tool], *words)),
            *(WatchItem(f"{axis}{_END}", (axis,)) for axis in axes),
        ),
        later=(
            *(WatchItem(f"RH{word}", (word,)) for motor in motors[1:] for word in registers[motor]),
            *_ranges("P", constants),
            *_ranges("I", settings - shaping - others),
            *_ranges("I", others, step=100),
            *(WatchItem(f"{name}->{_END}", (f"{name}->",)) for name in pointers_of(program)),
        ),
        own=assigned_numbers(program),
    )


def _find_shaping_settings(dialect: Dialect, tool: int) -> set[int]:
    """Return the settings that shape the path of the tool's motor."""
    shaping = {dialect.motor_index(tool, number) for number in SHAPING}
    shaping |= {SERVO_PERIOD, *(dialect.system_index(1, number) for number in TIME_BASE)}
    conversion = dialect.conversion_table.first_setting
    return shaping if conversion is None else {*shaping, conversion + tool - 1}


def _registers(dialect: Dialect, program: ProgramText, motor: int, *, tables_on: bool) -> list[str]:
    """Return the words that add to the position of a motor; not what a table of the program corrects."""
    corrected = tables_on or any(table.definition.target == motor for table in program.tables)
    places = [dialect.registers[name] for name in ("bias", *(() if corrected else ("compensation",)))]
    return [
        f"{'Y' if each.space == 'D' else each.space}:${each.address + (motor - 1) * each.stride:X}"
        for each in places
    ]


def _ranges(kind: str, numbers: Collection[int], step: int = 1) -> Iterator[WatchItem]:
    """Yield queries of variables, those in a row together."""
    row: list[int] = []
    for number in (*sorted(numbers), None):
        if row and (number != row[-1] + step or len(row) == VALUES_AN_ITEM):
            form = f"..{row[-1]}" if step == 1 else f",{len(row)},{step}"
            yield WatchItem(f"{kind}{row[0]}{form if row[1:] else ''}", tuple(f"{kind}{each}" for each in row))
            row = []
        if number is not None:
            row.append(number)


def answers_of(items: Iterable[WatchItem], replies: Sequence[str]) -> Iterator[tuple[WatchItem, tuple[str, ...]]]:
    """Yield each item of a line with its answers."""
    rest = iter(replies)
    for item in items:
        yield item, tuple(islice(rest, len(item.names)))


def values_of(items: Iterable[WatchItem]) -> int:
    """Return how many lines the replies to some items have."""
    return sum(len(item.names) for item in items)


class CutWatch:
    """Reads the table in turn while a cut runs, and once more from the end of its feed."""

    def __init__(self, table: CutWatchTable, answers: Mapping[WatchItem, tuple[str, ...]]) -> None:
        """Take what the controller answered when the cut began."""
        self._table, self._answers = table, answers
        self._turn = deque(table.schedule)
        self._last: deque[WatchItem] | None = None

    def see_feed(self, *, over: bool) -> None:
        """Begin the last turn where the feed is over; a feed hold, which resumes it, is no end."""
        if not over:
            self._last = None
        elif self._last is None:
            self._last = deque(self._table.items)

    @property
    def at_end(self) -> bool:
        """Whether the last turn is being read."""
        return bool(self._last)

    def next_items(self, most_bytes: float, most_asked: int = MOST_ASKED) -> tuple[WatchItem, ...]:
        """Return the next items, at least one; all on one line, of so many characters, both ways so many bytes."""
        turn, found, asked, used, values = self._last or self._turn, list[WatchItem](), 0, 0, 0
        while turn and turn[0] not in found:
            item = turn[0]
            asked, used = asked + len(item.query) + 1, used + self.bytes_of(item)
            values += len(item.names)
            if found and (asked > most_asked or used > most_bytes or values > MOST_VALUES):
                break
            found.append(turn.popleft())
            if turn is self._turn:
                turn.append(item)
        return tuple(found)

    def bytes_of(self, item: WatchItem) -> int:
        """Return the bytes of a query and its answers."""
        return len(item.query) + 1 + sum(len(answer) + 1 for answer in self._answers[item])

    def see(self, items: Iterable[WatchItem], replies: Sequence[str]) -> Problem | None:
        """Compare the answers to some items with those at the beginning; return the first that differs."""
        for item, answers in answers_of(items, replies):
            for name, before, now in zip(item.names, self._answers[item], answers, strict=True):
                own = (f"{each:.10g}" for each in self._table.own.get(name, ()))
                if not any(_is_same_value(each, now.strip()) for each in (before.strip(), *own)):
                    return Problem(code=IN_THE_CUT, key=name, value=now.strip(), limit=before.strip())
        return None


def _is_same_value(before: str, now: str) -> bool:
    if before == now:
        return True
    try:
        return math.isclose(number_of(before), number_of(now), rel_tol=RELATIVE, abs_tol=RELATIVE)
    except ValueError:
        return False


def begin_watch(client: Controller, table: CutWatchTable) -> CutWatch:
    """Read the whole table. Raises DriverError: the link broke, or the controller refused to answer."""
    watch = CutWatch(table, dict.fromkeys(table.items, ()))
    watch.see_feed(over=True)
    found: dict[WatchItem, tuple[str, ...]] = {}
    while watch.at_end:
        items = watch.next_items(math.inf)
        line = " ".join(("&1", *(item.query for item in items)))
        found.update(answers_of(items, client.question(line, lines=values_of(items))))
    return CutWatch(table, found)
