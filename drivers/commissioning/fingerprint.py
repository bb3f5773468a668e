"""Detect what another host wrote between connecting and a cut, by comparing the controller's settings.

It reads everything that determines a motion: the settings of our motors, the controller and coordinate system 1,
axis definitions, PLCs, programs, tables and the conversion table. What the console itself writes does not count.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from drivers.commissioning.checked_configuration import amount, is_same_number
from drivers.commissioning.configuration import ControllerConfiguration, digest
from drivers.commissioning.reading import PROGRAM_NUMBERS, of_motors, read_configuration
from drivers.commissioning.setting_names import name_setting
from drivers.controller import Controller
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.expressions import HIGHEST_PLC
from drivers.pmac.reserved import END_FLAG, PLCS, STRATEGY_PROGRAMS
from profiles.machine import MachineProfile
from profiles.problem import Problem

SHOWN = 12  # digits of a hash that are shown


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerFingerprint:
    """What was read from one controller for one machine; `free` is its reported free memory (SIZE)."""

    machine: MachineProfile
    configuration: ControllerConfiguration
    free: str

    def as_defined(self, definitions: Collection[str]) -> ControllerFingerprint:
        """Return the fingerprint with only these axis definitions of the profile: a program removes the others."""
        taken = set(self.machine.controller.axis_definitions) - set(definitions)
        gone = {each.motor for each in read_definitions(taken)}
        axes = {motor: axis for motor, axis in self.configuration.axes.items() if motor not in gone}
        return replace(self, configuration=replace(self.configuration, axes=axes))

    @property
    def facts(self) -> tuple[Mapping[str, str], ...]:
        """Everything but the settings, part by part, by names such as `PLC 3` or `#1->`, as texts."""
        read = self.configuration
        first = read.dialect.conversion_table.first_address
        return (
            {"TYPE": read.kind, "VERSION": read.version},
            {
                **{f"#{motor}->": f"&{axis.system} {axis.text}" for motor, axis in read.axes.items()},
                **{f"M{index}->": text for index, text in read.pointers.items()},
            },
            {**_texts("PLC", read.plcs), **dict.fromkeys(read.locked, "PASSWORD")},
            _texts("PROG", read.programs),
            {
                f"#{motor} COMP": f"{table.definition}, {table.entry_count}, sha256 {table.sha256[:SHOWN]}"
                for motor, table in read.tables.items()
            },
            {f"Y:${first + line:X}": f"${word:X}" for line, word in enumerate(read.conversion)},
        )


def console_facts(machine: MachineProfile, dialect: Dialect) -> frozenset[str]:
    """Return what the console itself writes, as named in `ControllerFingerprint.facts`; settings as I-variables.

    These are its programs, its heartbeat, the table of a cam cut, and the two lines of the conversion table that a
    cut on the spindle's time uses. TA, TS, F and what is gathered are never compared.
    """
    table = dialect.conversion_table
    lines = range(len(table.setup), len(table.setup) + 2)
    if table.first_setting is None:
        places = [f"Y:${table.first_address + line:X}" for line in lines]
    else:
        places = [f"I{table.first_setting + line}" for line in lines]
    programs = (f"PROG {number}" for number in STRATEGY_PROGRAMS)
    plcs = (f"PLC {number}" for number in PLCS)
    return frozenset((*programs, *plcs, f"#{machine.tool.motor} COMP", *places))


def read_fingerprint(
    client: Controller, machine: MachineProfile, dialect: Dialect, since: ControllerFingerprint | None = None
) -> ControllerFingerprint:
    """Read what is compared before each cut; nothing is written.

    Finding the existing programs and tables takes longest. If the controller's free memory is the same as in
    `since`, they are taken from there, and only the contents of tables are read again.

    Raises:
        RefusedError: `controller.entering`.
        DriverError: the link broke, or the controller answers something unexpected.
    """
    (free,) = client.query("SIZE", again=True)
    known = since is not None and since.free == free
    extent = replace(
        of_motors(dialect, machine.motors, (END_FLAG,)),
        plcs=tuple(number for number in range(HIGHEST_PLC + 1) if number not in PLCS),
        programs=() if known else tuple(number for number in PROGRAM_NUMBERS if number not in STRATEGY_PROGRAMS),
        tables=tuple(since.configuration.tables) if since is not None and known else None,
        unlisted_table=machine.tool.motor,
    )
    read = read_configuration(client, dialect, extent)
    if since is not None and known:
        hidden = tuple(name for name in since.configuration.locked if name.startswith("PROG"))
        read = replace(read, programs=since.configuration.programs, locked=(*read.locked, *hidden))
    return ControllerFingerprint(machine=machine, configuration=read, free=free)


def fingerprint_problems(
    before: ControllerFingerprint, after: ControllerFingerprint, ours: frozenset[str]
) -> tuple[Problem, ...]:
    """Return everything that another host has changed, by name, with its present and previous value."""
    problems = []
    settings = changed_settings(before.configuration, after.configuration, after.machine)
    for name, was, found in (*settings, *_facts(before, after)):
        if name not in ours:
            code = "fingerprint.changed"
            if not (was and found):
                code = "fingerprint.gone" if was else "fingerprint.appeared"
            problems.append(Problem(code=code, key=name, value=found, limit=was))
    return tuple(problems)


def changed_settings(
    before: ControllerConfiguration, after: ControllerConfiguration, machine: MachineProfile
) -> Iterator[tuple[str, str, str]]:
    """Yield each setting that differs: its name, its value before and after."""
    old, new = before.standing, after.standing
    for index in sorted(old.keys() | new.keys()):
        values = old.get(index), new.get(index)
        if values[0] is None or values[1] is None or not is_same_number(values[0], values[1]):
            of = name_setting(index, after.dialect)
            was, found = ("" if value is None else amount(value, of, machine) for value in values)
            yield f"I{index}", was, found


def _facts(before: ControllerFingerprint, after: ControllerFingerprint) -> Iterator[tuple[str, str, str]]:
    for old, new in zip(before.facts, after.facts, strict=True):
        for name in sorted(old.keys() | new.keys(), key=lambda name: (len(name), name)):
            if old.get(name) != new.get(name):
                yield name, old.get(name, ""), new.get(name, "")


def _texts(kind: str, buffers: Mapping[int, Iterable[str]]) -> dict[str, str]:
    return {f"{kind} {number}": f"sha256 {digest(lines)[:SHOWN]}" for number, lines in buffers.items()}
