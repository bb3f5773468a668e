"""Send a backup to a controller, delete the programs that it does not have, and report what still differs.

A limit that is 0 in the backup is not sent: 0 is no limit. Where the controller has another value it keeps that,
and it is one of the differences. Nothing is saved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from drivers.commissioning.backup import DELETE_GATHER, NO_LIMIT, Backup, is_no_limit, typed_lines
from drivers.commissioning.card_state import read_state
from drivers.commissioning.check import Check, Group
from drivers.commissioning.comparison import buffer_changes, changed_check, differences
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.gains import refuse_unready
from drivers.commissioning.reading import order_of
from drivers.commissioning.user_buffer import definition
from drivers.controller import Controller
from drivers.errors import DriverError, RefusedError
from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.expressions import HIGHEST_PLC
from drivers.pmac.language.text import format_number
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

Seen = Callable[[int, int], None]
"""Takes how many lines were sent, and of how many."""

MOST_VALUES = 20  # differing values of P, Q and M that are named one by one


def refuse_other_family(found: ControllerConfiguration, dialect: Dialect, where: str) -> None:
    """Make sure that a backup is of this family. Raises RefusedError: `controller.backup_family`."""
    if found.family != dialect.name:
        code, value, limit = "controller.backup_family", found.family, dialect.name
        raise RefusedError(Problem(code=code, where=where, value=value, limit=limit))


def refuse_other_controller(backup: Backup, kind: str, dialect: Dialect, where: str) -> None:
    """Make sure that a backup is from a controller of this family and type.

    Raises RefusedError: as `refuse_other_family`; `controller.backup_type`.
    """
    found = backup.configuration
    refuse_other_family(found, dialect, where)
    if found.kind.strip() != kind.strip():
        code = "controller.backup_type"
        raise RefusedError(Problem(code=code, where=where, value=found.kind, limit=kind.strip()))


def refuse_busy(client: Controller, dialect: Dialect) -> None:
    """Make sure that no motor is enabled, no program runs and nobody gathers data.

    Raises RefusedError: as `refuse_unready`; `controller.gathering`.
    """
    refuse_unready(client, dialect)
    if "gathering" in read_state(client, dialect).card:
        raise RefusedError(Problem(code="controller.gathering", where=client.link.address))


def refuse_hidden(now: ControllerConfiguration, where: str) -> None:
    """Make sure that no password hides a program: it could be neither backed up nor replaced.

    Raises RefusedError: `controller.restore_locked`.
    """
    if now.locked:
        raise RefusedError(Problem(code="controller.restore_locked", where=where, value=", ".join(now.locked)))


def refuse_other_memory(backup: Backup, now: ControllerConfiguration, where: str) -> None:
    """Make sure that the user buffer of the backup would lie at the same addresses in this controller.

    Raises RefusedError: `controller.user_buffer_end`.
    """
    wanted, here = backup.configuration.user_buffer, now.user_buffer
    if wanted and (here is None or here.stop != wanted.stop):
        code, value = "controller.user_buffer_end", "-" if here is None else f"${here.stop - 1:X}"
        raise RefusedError(Problem(code=code, where=where, value=value, limit=f"${wanted.stop - 1:X}"))


def restore_lines(text: str, backup: Backup, now: ControllerConfiguration) -> tuple[str, ...]:
    """Return the lines that bring a controller from the state `now` to that of a backup.

    A user buffer of the right size is not defined again: only its words are written.
    """
    wanted = "\n".join(line for line in text.splitlines() if not line.endswith(NO_LIMIT))
    standing = None if now.user_buffer is None else definition(len(now.user_buffer))
    lines = (line for line in typed_lines(wanted) if line != standing)
    return (*_removals(backup.configuration, now), *lines)


def kept_limits(wanted: ControllerConfiguration, now: ControllerConfiguration) -> tuple[str, ...]:
    """Return the limits that are 0 in the backup and that the controller therefore keeps."""
    dialect = now.dialect
    return tuple(
        f"I{index}"
        for index, value in sorted(now.settings.items())
        if value != 0.0 and index in wanted.settings and is_no_limit(index, wanted.settings[index], dialect)
    )


def _removals(wanted: ControllerConfiguration, now: ControllerConfiguration) -> Iterator[str]:
    """Yield the lines that delete what the backup does not have; first they disable all PLCs: none may write."""
    yield f"DISABLE PLC 0..{HIGHEST_PLC}"
    for number in sorted(now.programs.keys() - wanted.programs.keys()):
        yield from _erase_lines(f"OPEN PROG{number}")
    for number in sorted(now.plcs.keys() - wanted.plcs.keys()):
        yield from _erase_lines(f"OPEN PLC{number}")
    if wanted.values is None:
        return  # such a backup has neither entries of tables nor kinematic programs
    for system, kind in sorted(now.kinematics.keys() - wanted.kinematics.keys()):
        yield from _erase_lines(f"&{system}OPEN {kind}")
    unwanted = bool(now.user_buffer) and wanted.user_buffer is not None and not wanted.user_buffer
    if unwanted or (now.tables and not wanted.entries):
        yield DELETE_GATHER
        yield from (f"#{motor}DELETE COMP" for motor in sorted(now.tables))
    if unwanted:
        yield definition(0)
    yield "&1#1"


def _erase_lines(opening: str) -> tuple[str, str, str]:
    """Return the lines that erase a program, as the manuals do it (Software Reference, CLEAR)."""
    return (opening, "CLEAR", "CLOSE")


def restore(
    client: Controller, dialect: Dialect, lines: tuple[str, ...], seen: Seen = lambda sent, of: None
) -> None:
    """Send the lines, each once; the caller has a backup of what there was before.

    Raises:
        RefusedError: as `refuse_busy`; nothing was sent.
        DriverError: with `controller.restored_in_part`: the link broke, or a line was refused, and none was sent
            after it.
    """
    refuse_busy(client, dialect)
    sent = 0

    def counted(number: int, of: int) -> None:
        nonlocal sent
        sent = number
        seen(number, of)

    try:
        send_counted(client, lines, counted)
    except DriverError as error:
        value, limit = str(sent), str(len(lines))
        partly = Problem(code="controller.restored_in_part", where=client.link.address, value=value, limit=limit)
        raise DriverError(*error.problems, partly) from error


def send_counted(client: Controller, lines: tuple[str, ...], seen: Seen) -> None:
    """Send lines, each once; `seen` takes how many the controller has acknowledged. Raises as `download` does."""

    def counted() -> Iterator[str]:
        for number, line in enumerate(lines):
            seen(number, len(lines))
            yield line
        seen(len(lines), len(lines))

    client.download(counted())


def left_differing(
    wanted: ControllerConfiguration, now: ControllerConfiguration, machine: MachineProfile
) -> list[Check]:
    """Return what differs from the backup: all that `differences` compares, kinematic programs and values."""
    if wanted.user_buffer and wanted.user_words is None:
        wanted = replace(wanted, user_buffer=None)  # a backup without values does not define it
    found = differences(wanted, now, machine)
    if wanted.values is None or now.values is None:
        return found
    values = [*_differing_values(wanted.values, now.values), *_differing_words(wanted, now)]
    for kind in (BufferKind.FORWARD, BufferKind.INVERSE):
        of_kind = (
            {system: lines for (system, of), lines in each.kinematics.items() if of == kind}
            for each in (wanted, now)
        )
        found += buffer_changes(kind, *of_kind)
    found += values[:MOST_VALUES]
    if len(values) > MOST_VALUES:
        facts = {"more": str(len(values) - MOST_VALUES)}
        found.append(Check(Group.PROGRAMS, "more_values", Severity.REFUSAL, facts=facts))
    return found


def _differing_values(before: Mapping[str, float], now: Mapping[str, float]) -> Iterator[Check]:
    """Yield the values of P, Q and M that differ, by number; a missing one is 0."""
    for name in sorted(before.keys() | now.keys(), key=order_of):
        old, new = before.get(name, 0.0), now.get(name, 0.0)
        if old != new:
            yield changed_check(Group.PROGRAMS, name, format_number(new), format_number(old))


def _differing_words(wanted: ControllerConfiguration, now: ControllerConfiguration) -> Iterator[Check]:
    """Yield the words of the user buffer that differ, where it has the same place."""
    if wanted.user_buffer != now.user_buffer or not wanted.user_buffer:
        return
    place, before, after = wanted.user_buffer, wanted.user_words, now.user_words
    if before is not None and after is not None and before != after:
        old = before.name_words(place.start)
        for name, new in after.name_words(place.start).items():
            if old[name] != new:
                yield changed_check(Group.PROGRAMS, name, new, old[name])
