"""Verify everything before the first motion, in one go. Nothing is written and nothing moves.

The safety devices that the profile declares are checked as far as the controller sees them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from drivers.commissioning.card_state import CardState, read_state, state_checks
from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.checked_configuration import CheckedConfiguration, JudgedAxis, digits, length, speed
from drivers.commissioning.comparison import stated_settings
from drivers.commissioning.configuration import ControllerConfiguration
from drivers.commissioning.gains import gain_checks
from drivers.commissioning.reading import number_in, of_motors, read_configuration
from drivers.commissioning.rules import card_rules, motor_rules
from drivers.controller import Controller
from drivers.errors import DriverError
from drivers.lathe.motion import LINK_LATENCY_MS
from drivers.lathe.safety import FORM, NOT_FITTED, WIRED, inputs_of
from drivers.pmac.dialect import Dialect
from drivers.pmac.reserved import END_FLAG, WATCHDOG_TIMER
from drivers.pmac.trajectory.jog import SHORTEST_RAMP_MS, JogSettings, change_speed
from profiles.findings import Severity
from profiles.machine import MachineProfile, Safety, is_signature


def _check_fitted_devices(safety: Safety) -> Iterator[Check]:
    for device, fitted in safety.devices.items():
        if fitted == WIRED:
            yield Check(Group.SAFETY, "device_wired", Severity.OK, device)
        elif fitted == NOT_FITTED and is_signature(safety.signed_by):
            yield Check(Group.SAFETY, "device_signed", Severity.NOTICE, device, found=safety.signed_by)
        elif fitted == NOT_FITTED:
            yield Check(Group.SAFETY, "device_unsigned", Severity.REFUSAL, device)
        else:
            wanted = f"{WIRED} | {NOT_FITTED}"
            yield Check(Group.SAFETY, "device_unknown", Severity.REFUSAL, device, found=fitted, wanted=wanted)


def _check_inputs(client: Controller, safety: Safety) -> Iterator[Check]:
    try:
        inputs = inputs_of(safety)
    except DriverError as error:
        for problem in error.problems:
            yield Check(Group.SAFETY, "input_unreadable", Severity.REFUSAL, found=problem.value, wanted=FORM)
        return
    items = list(dict.fromkeys(each.item for each in inputs))
    answers = client.query(*items, again=True) if items else ()
    words = {item: int(number_in(text, client.link.address)) for item, text in zip(items, answers, strict=True)}
    for each in inputs:
        word, wanted = words[each.item], str(each.good)
        found = str(word >> each.bit & 1)
        yield Check(Group.SAFETY, "input", severity(each.is_good(word)), each.device, found=found, wanted=wanted)


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What was read, and its checks, in the order in which they are shown."""

    judged: CheckedConfiguration
    state: CardState
    checks: tuple[Check, ...]


def verify(client: Controller, machine: MachineProfile, dialect: Dialect) -> Verification:
    """Read what concerns the machine, and judge it.

    Raises:
        RefusedError: `controller.entering`.
        DriverError: the link broke, or the controller answers something unexpected.
    """
    judged = CheckedConfiguration(configuration=read_of_machine(client, machine, dialect), machine=machine)
    state, safety = read_state(client, dialect), machine.safety
    checks = [
        *checks_of(judged),
        *state_checks(state, judged),
        *_check_fitted_devices(safety),
        *_check_inputs(client, safety),
    ]
    return Verification(judged=judged, state=state, checks=in_order(checks))


def read_of_machine(client: Controller, machine: MachineProfile, dialect: Dialect) -> ControllerConfiguration:
    """Read what concerns a machine, for its checks; errors as for `verify`."""
    return read_configuration(client, dialect, of_motors(dialect, machine.motors, (END_FLAG, WATCHDOG_TIMER)))


@dataclass(frozen=True, slots=True)
class StoppingDistance:
    """From the press of the stop key to rest."""

    time_ms: float
    counts: float


def after_abort(speed_counts_per_ms: float, rate: float, late_ms: float) -> StoppingDistance:
    """Return the distance at Ix15 = `rate`; a rate of 0 never stops a motor."""
    if rate <= 0.0:
        return StoppingDistance(math.inf, math.inf)
    way = speed_counts_per_ms * late_ms + speed_counts_per_ms**2 / (2.0 * rate)
    return StoppingDistance(late_ms + speed_counts_per_ms / rate, way)


def after_jog_stop(settings: JogSettings, late_ms: float) -> StoppingDistance:
    """Return the distance of a jog at its speed that is ended by J/."""
    pieces = change_speed(0.0, settings.speed, 0.0, settings)
    ramp_ms = sum(piece.duration_ms for piece in pieces)
    # A ramp is symmetrical about its middle, whatever its S-curve.
    return StoppingDistance(late_ms + ramp_ms, settings.speed * (late_ms + ramp_ms / 2.0))


def jog_settings_of(judged: CheckedConfiguration, axis: JudgedAxis) -> JogSettings:
    """Return the jog settings read from an axis; Ix20 and Ix21 both 0 count as 1 ms."""
    ta_ms, ts_ms = max(0.0, judged.of_motor(axis, 20)), max(0.0, judged.of_motor(axis, 21))
    return JogSettings(
        acceleration=judged.of_motor(axis, 19),
        ta_ms=ta_ms or (0.0 if ts_ms else SHORTEST_RAMP_MS),
        ts_ms=ts_ms,
        speed=abs(judged.of_motor(axis, 22)),
    )


def overruns(judged: CheckedConfiguration) -> list[Check]:
    """Return the stopping distance of each axis in mid-jog, by control-A and by J/."""
    return [_overrun(judged, axis) for axis in judged.driven_axes]


def _overrun(judged: CheckedConfiguration, axis: JudgedAxis) -> Check:
    machine = judged.machine
    late_ms = machine.controller.background_ms + LINK_LATENCY_MS
    settings = jog_settings_of(judged, axis)
    abort = after_abort(settings.speed, judged.of_motor(axis, 15), late_ms)
    jog = after_jog_stop(settings, late_ms)
    limit = _clearance_counts(machine, axis)
    return Check(
        Group.STOPS,
        "overrun",
        severity(max(abort.counts, jog.counts) <= limit),
        subject=axis.name,
        wanted=f"<= {length(limit, axis.motor, machine)}",
        facts={
            "speed": speed(settings.speed, axis.motor, machine),
            "abort_way": _way(abort, axis, machine),
            "jog_way": _way(jog, axis, machine),
            "ramp": _way(after_jog_stop(settings, late_ms=0.0), axis, machine),
        },
    )


def _way(stopping: StoppingDistance, axis: JudgedAxis, machine: MachineProfile) -> str:
    if math.isinf(stopping.counts):
        return "∞"
    return f"{length(stopping.counts, axis.motor, machine)}, {digits(stopping.time_ms / 1000.0)} s"


def _clearance_counts(machine: MachineProfile, axis: JudgedAxis) -> float:
    """Return the available stopping distance: to the work, one turn, to the jaws."""
    match axis.name:
        case "tool":
            return machine.tool.retract_mm * machine.tool.counts_per_mm
        case "spindle":
            return float(machine.spindle.counts_per_rev)
        case _:
            return machine.carriage.jaw_clearance_mm * machine.carriage.counts_per_mm


def checks_of(judged: CheckedConfiguration) -> list[Check]:
    """Return every check of a configuration alone, read from a controller or from a backup."""
    rules = [*card_rules(judged), *motor_rules(judged)]
    return [*_drop_repeated_checks(stated_settings(judged), rules), *gain_checks(judged), *overruns(judged)]


def _drop_repeated_checks(stated: list[Check], rules: list[Check]) -> list[Check]:
    """Return all checks; a setting that a rule also finds wrong appears once, in the words of the rule."""
    wrong = {check.variable: check for check in stated if check.severity is Severity.REFUSAL}
    # A rule with a wanted value covers its setting completely.
    covering = [
        check
        for check in rules
        if check.wanted and check.severity in (Severity.REFUSAL, Severity.WARNING) and check.variable in wrong
    ]
    names = {check.variable for check in covering}
    return [
        *(check for check in stated if check.variable not in names),
        *(check for check in rules if check not in covering),
        *(replace(check, severity=Severity.REFUSAL, wanted=wrong[check.variable].wanted) for check in covering),
    ]


def in_order(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return checks by group, in their order within a group."""
    groups = list(Group)
    return tuple(sorted(checks, key=lambda check: groups.index(check.group)))
