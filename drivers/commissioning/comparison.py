"""Compare a configuration with the machine profile, and with another configuration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

from drivers.commissioning.amounts import amount
from drivers.commissioning.backup_text import setting_text
from drivers.commissioning.check import Check, Group
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.judged import Judged, same
from drivers.commissioning.setting_names import named
from profiles.findings import Severity
from profiles.machine import MachineProfile

_Entry = TypeVar("_Entry")


def stated_settings(judged: Judged) -> list[Check]:
    """Return each setting that differs from the profile, and one line for each group that does not."""
    checks: list[Check] = []
    held: dict[tuple[Group, str], int] = {}
    for index, wanted in judged.wanted.items():
        of = named(index, judged.dialect)
        found = judged.value(index)
        if found is not None and same(found, wanted):
            place = judged.group_of(of), judged.subject_of(of)
            held[place] = held.get(place, 0) + 1
            continue
        factory = found is not None and same(found, judged.dialect.factory.get(index, 0.0))
        code = "factory" if factory else "differs"
        words = amount(wanted, of, judged.machine)
        checks.append(judged.told(code, Severity.REFUSAL, index, wanted=words))
    checks += [
        Check(
            group=group, code="settings_hold", severity=Severity.OK, subject=subject, facts={"count": str(count)}
        )
        for (group, subject), count in held.items()
    ]
    return checks


def differences(before: Configuration, now: Configuration, machine: MachineProfile) -> list[Check]:
    """Return what differs in `now` from `before`; what ordinary work changes is left out."""
    checks = [
        Check(
            group=Group.CARD,
            code="changed",
            severity=Severity.REFUSAL,
            facts={"what_changed": what},
            found=new,
            wanted=old,
        )
        for what, old, new in (
            ("TYPE", before.kind, now.kind),
            ("VERSION", before.version, now.version),
        )
        if old != new
    ]
    checks += _settings(before, now, machine)
    checks += _entries("#{}->", Group.SYSTEM, *(_axes(each) for each in (before, now)))
    checks += _entries("M{}->", Group.PROGRAMS, before.pointers, now.pointers)
    checks += _buffers("PLC", before.plcs, now.plcs)
    checks += _buffers("PROG", before.programs, now.programs)
    tables = [
        {motor: f"{t.definition} {t.sha256[:12]}" for motor, t in each.tables.items()} for each in (before, now)
    ]
    checks += _entries("#{} COMP", Group.PROGRAMS, tables[0], tables[1])
    first = now.dialect.conversion_table.first_address
    words = [{first + line: f"${word:X}" for line, word in enumerate(each.conversion)} for each in (before, now)]
    checks += _entries("Y:${:X}", Group.CARD, words[0], words[1])
    return checks


def _settings(before: Configuration, now: Configuration, machine: MachineProfile) -> Iterator[Check]:
    judged = Judged(configuration=now, machine=machine)
    for index in sorted(before.standing.keys() | now.standing.keys()):
        old, new = before.standing.get(index), now.standing.get(index)
        if old is not None and new is not None and same(old, new):
            continue
        of = named(index, now.dialect)
        wanted = "-" if old is None else amount(old, of, machine)
        typed = "" if old is None else f"I{index}={setting_text(index, old, now.dialect)}"
        yield judged.told("setting_changed", Severity.REFUSAL, index, wanted=wanted, facts={"typed": typed})


def _axes(configuration: Configuration) -> dict[int, str]:
    return {motor: f"&{axis.system} {axis.text}" for motor, axis in configuration.axes.items()}


def _entries(form: str, group: Group, before: Mapping[int, _Entry], now: Mapping[int, _Entry]) -> Iterator[Check]:
    for key in sorted(before.keys() | now.keys()):
        old, new = before.get(key), now.get(key)
        if old != new:
            found, wanted = ("-" if each is None else str(each) for each in (new, old))
            what = form.format(key)
            yield Check(
                group=group,
                code="changed",
                severity=Severity.REFUSAL,
                facts={"what_changed": what},
                found=found,
                wanted=wanted,
            )


def _buffers(
    kind: str, before: Mapping[int, tuple[str, ...]], now: Mapping[int, tuple[str, ...]]
) -> Iterator[Check]:
    """Yield the first differing line of each buffer."""
    for number in sorted(before.keys() | now.keys()):
        old, new = before.get(number, ()), now.get(number, ())
        if old == new:
            continue
        place = next(
            (i for i, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]),
            min(len(old), len(new)),
        )
        found, wanted = (each[place] if place < len(each) else "-" for each in (new, old))
        yield Check(
            group=Group.PROGRAMS,
            code="changed",
            severity=Severity.REFUSAL,
            facts={"what_changed": f"{kind} {number}:{place + 1}"},
            found=found,
            wanted=wanted,
        )
