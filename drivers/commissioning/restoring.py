"""Send a backup to a controller, delete the programs that it does not have, and report what still differs.

A limit that is 0 in the backup is not sent: 0 is no limit. Where the controller has another value it keeps that,
and it is one of the differences. Nothing is saved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from drivers.commissioning.backup import DELETE_GATHER, NO_LIMIT, Backup, is_no_limit, typed_lines
from drivers.commissioning.card_state import read_state
from drivers.commissioning.check import Check, Group
from drivers.commissioning.comparison import differences
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.gains import refuse_unready
from drivers.controller import Controller
from drivers.errors import DriverError, RefusedError
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.expressions import HIGHEST_PLC
from drivers.pmac.language.text import format_number
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

Seen = Callable[[int], None]
"""Takes the number of lines that were sent."""

MOST_VALUES = 20  # differing values of P, Q and M that are named one by one


def refuse_other_family(found: Configuration, dialect: Dialect, where: str) -> None:
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


def refuse_hidden(now: Configuration, where: str) -> None:
    """Make sure that no password hides a program: it could be neither backed up nor replaced.

    Raises RefusedError: `controller.restore_locked`.
    """
    if now.locked:
        raise RefusedError(Problem(code="controller.restore_locked", where=where, value=", ".join(now.locked)))


def restore_lines(text: str, backup: Backup, now: Configuration) -> tuple[str, ...]:
    """Return the lines that bring a controller from the state `now` to that of a backup."""
    wanted = "\n".join(line for line in text.splitlines() if not line.endswith(NO_LIMIT))
    return (*_removals(backup.configuration, now), *typed_lines(wanted))


def kept_limits(wanted: Configuration, now: Configuration) -> tuple[str, ...]:
    """Return the limits that are 0 in the backup and that the controller therefore keeps."""
    dialect = now.dialect
    return tuple(
        f"I{index}"
        for index, value in sorted(now.settings.items())
        if value != 0.0 and index in wanted.settings and is_no_limit(index, wanted.settings[index], dialect)
    )


def _removals(wanted: Configuration, now: Configuration) -> Iterator[str]:
    """Yield the lines that delete what the backup does not have; first they disable all PLCs: none may write."""
    yield f"DISABLE PLC 0..{HIGHEST_PLC}"
    for number in sorted(now.programs.keys() - wanted.programs.keys()):
        yield from _emptied(f"OPEN PROG{number}")
    for number in sorted(now.plcs.keys() - wanted.plcs.keys()):
        yield from _emptied(f"OPEN PLC{number}")
    if wanted.values is None:
        return  # such a backup has neither entries of tables nor kinematic programs
    for system, kind in sorted(now.kinematics.keys() - wanted.kinematics.keys()):
        yield from _emptied(f"&{system}OPEN {kind}")
    if now.tables and not wanted.entries:
        yield DELETE_GATHER
        yield from (f"#{motor}DELETE COMP" for motor in sorted(now.tables))
    yield "&1#1"


def _emptied(opening: str) -> tuple[str, str, str]:
    """Return the lines that erase a program, as the manuals do it (Software Reference, CLEAR)."""
    return (opening, "CLEAR", "CLOSE")


def restore(client: Controller, dialect: Dialect, lines: tuple[str, ...], seen: Seen = lambda sent: None) -> None:
    """Send the lines, each once; the caller has a backup of what there was before.

    Raises:
        RefusedError: as `refuse_busy`; nothing was sent.
        DriverError: with `controller.restored_in_part`: the link broke, or a line was refused, and none was sent
            after it.
    """
    refuse_busy(client, dialect)
    sent = 0

    def counted() -> Iterator[str]:
        nonlocal sent
        for line in lines:
            seen(sent)
            yield line
            sent += 1

    try:
        client.download(counted())
    except DriverError as error:
        value, limit = str(sent), str(len(lines))
        partly = Problem(code="controller.restored_in_part", where=client.link.address, value=value, limit=limit)
        raise DriverError(*error.problems, partly) from error


def left_differing(wanted: Configuration, now: Configuration, machine: MachineProfile) -> list[Check]:
    """Return what differs from the backup: all that `differences` compares, kinematic programs and values."""
    found = differences(wanted, now, machine)
    if wanted.values is None or now.values is None:
        return found
    for system, kind in sorted(wanted.kinematics.keys() | now.kinematics.keys()):
        old, new = (each.kinematics.get((system, kind), ()) for each in (wanted, now))
        if old != new:
            found.append(_changed(f"&{system} {kind}", " ".join(new) or "-", " ".join(old) or "-"))
    before, after = wanted.values, now.values
    names = [
        name for name in sorted(before.keys() | after.keys()) if before.get(name, 0.0) != after.get(name, 0.0)
    ]
    found += [
        _changed(name, format_number(after.get(name, 0.0)), format_number(before.get(name, 0.0)))
        for name in names[:MOST_VALUES]
    ]
    if len(names) > MOST_VALUES:
        facts = {"more": str(len(names) - MOST_VALUES)}
        found.append(Check(Group.PROGRAMS, "more_values", Severity.REFUSAL, facts=facts))
    return found


def _changed(what: str, found: str, wanted: str) -> Check:
    facts = {"what_changed": what}
    return Check(Group.PROGRAMS, "changed", Severity.REFUSAL, facts=facts, found=found, wanted=wanted)
