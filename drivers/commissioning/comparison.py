"""Compare a configuration with the machine profile, and with another configuration."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from typing import TypeVar

from drivers.commissioning.backup import setting_text
from drivers.commissioning.check import Check, Group
from drivers.commissioning.checked_configuration import (
    CheckedConfiguration,
    amount,
    is_same_number,
    stated_settings_of,
)
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.reading import read_settings
from drivers.commissioning.setting_names import name_setting
from drivers.controller import Controller
from drivers.pmac.axes import read_definitions
from drivers.pmac.buffer_text import BufferKind, same_line
from drivers.pmac.dialect import Dialect, SettingScope
from drivers.pmac.language.text import format_number
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

_Key = TypeVar("_Key", int, str, tuple[int, str])


def profile_problems(
    client: Controller, wanted: MachineProfile, dialect: Dialect, motors: frozenset[int]
) -> tuple[Problem, ...]:
    """Return every setting and axis definition that differs, and every unexpected active motor, in a few requests.

    TA, TS and F of the coordinate system are left out: they are what the last program left behind.
    Raises DriverError: the link broke, or the controller refused to answer.
    """
    stated = stated_settings_of(wanted, dialect)
    definitions = read_definitions(wanted.controller.axis_definitions)
    problems = list(setting_problems(client, stated))
    found = client.query(*(f"&1#{each.motor}->" for each in definitions), again=True)
    others = [
        dialect.motor_index(motor, 0) for motor in dialect.numbers(SettingScope.MOTOR) if motor not in motors
    ]
    active = {index: value for index, value in read_settings(client, others).items() if value != 0.0}
    for each, text in zip(definitions, found, strict=True):
        if text.strip() != str(each):
            key = f"#{each.motor}->"
            problems.append(Problem(code="controller.setting", key=key, value=text, limit=str(each)))
    for index, value in active.items():
        text = format_number(value)
        problems.append(Problem(code="controller.unexpected_motor", key=f"I{index}", value=text, limit="0"))
    return tuple(problems)


def setting_problems(client: Controller, stated: Mapping[int, float]) -> tuple[Problem, ...]:
    """Read I-variables and return those that differ from what is stated; raises as `profile_problems`."""
    return tuple(
        Problem(
            code="controller.setting",
            key=f"I{index}",
            value=format_number(value),
            limit=format_number(stated[index]),
        )
        for index, value in read_settings(client, stated).items()
        if not is_same_number(value, stated[index])
    )


def stated_settings(judged: CheckedConfiguration) -> list[Check]:
    """Return each setting that differs from the profile, and one line for each group that does not."""
    checks: list[Check] = []
    held: Counter[tuple[Group, str]] = Counter()
    for index, wanted in judged.stated_settings.items():
        of, found = name_setting(index, judged.dialect), judged.value(index)
        if found is not None and is_same_number(found, wanted):
            held[judged.place_of(of)] += 1
            continue
        factory = found is not None and is_same_number(found, judged.dialect.factory.get(index, 0.0))
        code = "factory" if factory else "differs"
        checks.append(judged.about(code, Severity.REFUSAL, index, wanted=amount(wanted, of, judged.machine)))
    for (group, subject), count in held.items():
        facts = {"count": str(count)}
        checks.append(Check(group, "settings_hold", Severity.OK, subject=subject, facts=facts))
    return checks


def differences(
    before: ControllerConfiguration, now: ControllerConfiguration, machine: MachineProfile
) -> list[Check]:
    """Return what differs in `now` from `before`; what ordinary work changes is left out."""
    both, first = (before, now), now.dialect.conversion_table.first_address
    cards = ({"TYPE": each.kind, "VERSION": each.version} for each in both)
    axes = ({motor: f"&{a.system} {a.text}" for motor, a in each.axes.items()} for each in both)
    tables = ({motor: f"{t.definition} {t.sha256[:12]}" for motor, t in each.tables.items()} for each in both)
    sizes = ({"UBUFFER": str(len(each.user_buffer or ()))} for each in both)
    words = ({first + line: f"${word:X}" for line, word in enumerate(each.conversion)} for each in both)
    return [
        *_entries("{}", Group.CARD, *cards),
        *_settings(before, now, machine),
        *_entries("#{}->", Group.SYSTEM, *axes),
        *_entries("M{}->", Group.PROGRAMS, before.pointers, now.pointers),
        *buffer_changes(BufferKind.PLC, before.plcs, now.plcs),
        *buffer_changes(BufferKind.PROGRAM, before.programs, now.programs),
        *_entries("#{} COMP", Group.PROGRAMS, *tables),
        *_entries("Y:${:X}", Group.CARD, *words),
        *(() if None in (before.user_buffer, now.user_buffer) else _entries("{}", Group.PROGRAMS, *sizes)),
        *(() if now.misplaced_buffer is None else [_misplaced_check(now.misplaced_buffer)]),
    ]


def _misplaced_check(problem: Problem) -> Check:
    found, wanted, code = problem.value, problem.limit, "user_buffer_misplaced"
    return Check(Group.PROGRAMS, code, Severity.REFUSAL, variable=problem.key, found=found, wanted=wanted)


def _settings(
    before: ControllerConfiguration, now: ControllerConfiguration, machine: MachineProfile
) -> Iterator[Check]:
    judged = CheckedConfiguration(configuration=now, machine=machine)
    for index in sorted(before.standing.keys() | now.standing.keys()):
        old, new = before.standing.get(index), now.standing.get(index)
        if old is not None and new is not None and is_same_number(old, new):
            continue
        wanted = "-" if old is None else amount(old, name_setting(index, now.dialect), machine)
        typed = "" if old is None else f"I{index}={setting_text(index, old, now.dialect)}"
        yield judged.about("setting_changed", Severity.REFUSAL, index, wanted=wanted, facts={"typed": typed})


def _entries(form: str, group: Group, before: Mapping[_Key, str], now: Mapping[_Key, str]) -> Iterator[Check]:
    for key in sorted(before.keys() | now.keys()):
        old, new = before.get(key, "-"), now.get(key, "-")
        if old != new:
            yield changed_check(group, form.format(key), new, old)


def buffer_changes(
    kind: BufferKind, before: Mapping[int, tuple[str, ...]], now: Mapping[int, tuple[str, ...]]
) -> Iterator[Check]:
    """Yield the first line of each buffer that does something else, by the name of the buffer."""
    for number in sorted(before.keys() | now.keys()):
        for line, (old, new) in enumerate(
            zip_longest(before.get(number, ()), now.get(number, ()), fillvalue="-"), start=1
        ):
            if not same_line(kind, new, old):
                yield changed_check(Group.PROGRAMS, f"{kind.buffer_name(number)}:{line}", new, old)
                break


def changed_check(group: Group, what: str, found: str, wanted: str) -> Check:
    """Return the check of one entry that differs, by its name."""
    facts = {"what_changed": what}
    return Check(group, "changed", Severity.REFUSAL, facts=facts, found=found, wanted=wanted)
