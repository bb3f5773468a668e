"""Rules for the controller, what is stored on it, its coordinate system and motors, independent of the profile."""

from __future__ import annotations

import math
from collections.abc import Iterator

from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.checked_configuration import (
    CheckedConfiguration,
    JudgedAxis,
    digits,
    is_same_number,
    length,
)
from drivers.commissioning.setting_names import GAIN_NUMBERS
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import FamilySetting, SettingScope
from drivers.pmac.reserved import END_FLAG, HEARTBEAT_PLC, PLCS, WATCHDOG_TIMER
from drivers.pmac.settings import PARTS_PER_COUNT, servo_cycle_ms
from profiles.findings import Severity

BACKGROUND_PLCS = 0b10  # bit of I5: PLC 1 to 31 may run
WATCHDOG_MS = 100.0  # a controller without a background cycle must shut down within this time

_SHOWN_OF_CARD = (8, 52)
NEVER_ZERO = (11, 12, 15, 16, 17, 19, 22, 28, 69)  # Ixnn of which 0 means no limit, no motion or no force
LOBE_AMPLITUDE_UM, LOBE_FREQUENCY_HZ = 27.5, 50.0  # the fastest lobe: half of 55 um, three per turn at 1000 rpm
LEAST_PROGRAM_SPEED = 200.0
"""counts/ms, of tool and spindle: what a program segment needs so as not to be stretched."""

LEAST_FATAL_ERROR_UM = 50.0

TRAVEL_SWITCHES_OFF, FAULT_INPUT_OFF, KILL_MODE = 1 << 17, 1 << 20, 0b11 << 21
"""Bits of the flag setting; a kill mode of 00 kills every motor of the controller."""

CLOSES_AT_POWER_UP = 1  # bit of Ix80
_SHOWN_NUMBERS = (2, 3, 4, 10, 24, 25, *GAIN_NUMBERS, 63, 67, *range(70, 84))


def card_rules(judged: CheckedConfiguration) -> list[Check]:
    """Return the checks of the controller, its coordinate system and its buffers."""
    of_card = (_family, _clocks, _permissions, _unexpected_motors)
    rules = (*of_card, _axes, _system, _conversion, _buffers, _pointers)
    return [check for rule in rules for check in rule(judged)]


def _family(judged: CheckedConfiguration) -> Iterator[Check]:
    card, wanted = judged.configuration, judged.machine.controller.family
    found = f"{card.kind}, {card.version}"
    yield Check(Group.CARD, "family", severity(card.family == wanted), found=found, wanted=wanted)


def _clocks(judged: CheckedConfiguration) -> Iterator[Check]:
    """Check the servo period and the real-time interrupt, on which all program times rest."""
    cycle_ms, wanted_ms = servo_cycle_ms(judged.value(10) or 0.0), judged.machine.controller.servo_period_ms
    facts, wanted = {"period": f"{cycle_ms * 1000.0:.3f} us"}, f"{wanted_ms * 1000.0:.3f} us"
    yield judged.about("servo_time", severity(is_same_number(cycle_ms, wanted_ms)), 10, wanted, facts)
    for number in _SHOWN_OF_CARD:
        if judged.value(number) is not None:
            yield judged.about("shown", Severity.NOTICE, number)
    watchdog = judged.dialect.watchdog
    if watchdog.number is not None:
        trip_ms = (judged.value(watchdog.number) or float(watchdog.count)) * cycle_ms
        judgement = severity(trip_ms <= WATCHDOG_MS * 1.01, Severity.WARNING)
        facts, wanted = {"time": f"{digits(trip_ms)} ms"}, f"{WATCHDOG_MS / cycle_ms:.0f}"
        yield judged.about("watchdog", judgement, watchdog.number, wanted, facts)


def _permissions(judged: CheckedConfiguration) -> Iterator[Check]:
    plcs = bool(int(judged.value(5) or 0.0) & BACKGROUND_PLCS)
    yield judged.about("plcs", severity(plcs, Severity.WARNING), 5, "2, 3")
    yield judged.about("compensation", severity(not judged.value(51)), 51, "0")
    if judged.value(15):
        yield judged.about("radians", Severity.REFUSAL, 15, "0")
    index = judged.dialect.index(FamilySetting.SEGMENT_MS, 1)
    yield judged.about("segments", severity(not judged.value(index)), index, "0 ms")


def _unexpected_motors(judged: CheckedConfiguration) -> Iterator[Check]:
    ours, dialect = {axis.motor for axis in judged.axes}, judged.dialect
    others = [dialect.motor_index(motor, 0) for motor in dialect.numbers(SettingScope.MOTOR) if motor not in ours]
    active = ", ".join(f"I{index}" for index in others if judged.value(index))
    yield Check(Group.CARD, "unexpected_motors", severity(not active), found=active or "0", wanted="0")


def _axes(judged: CheckedConfiguration) -> Iterator[Check]:
    wanted = {each.motor: str(each) for each in read_definitions(judged.machine.controller.axis_definitions)}
    found = {
        motor: axis.text if axis.system == 1 else f"&{axis.system} {axis.text}"
        for motor, axis in judged.configuration.axes.items()
    }
    for motor in sorted(wanted.keys() | found.keys()):
        there, target = found.get(motor, "0"), wanted.get(motor, "0")
        yield Check(
            Group.SYSTEM, "axis", severity(there == target), variable=f"#{motor}->", found=there, wanted=target
        )


def _system(judged: CheckedConfiguration) -> Iterator[Check]:
    if judged.of_system(92):
        yield judged.about("blending_off", Severity.REFUSAL, judged.dialect.system_index(1, 92), "0")
    table = judged.dialect.conversion_table
    led = 0 <= int(judged.of_system(93)) - table.first_address < table.lines
    code = "led_by_master" if led else "own_time"
    yield judged.about(code, severity(not led), judged.dialect.system_index(1, 93))
    activation = judged.dialect.system_activation
    if activation is not None:
        yield judged.about("timers_run", Severity.OK, activation)


def _conversion(judged: CheckedConfiguration) -> Iterator[Check]:
    """Check that the machine's motors have their own encoders, converted as by factory default."""
    table, words = judged.dialect.conversion_table, judged.configuration.conversion
    for axis in judged.axes:
        line = axis.motor - 1
        if line >= len(table.channels):
            continue
        if table.first_setting is None:
            word, where = (words[line] if line < len(words) else 0), f"Y:${table.first_address + line:X}"
        else:
            index = table.first_setting + line
            word, where = int(judged.value(index) or 0.0), f"I{index}"
        yield Check(
            axis.group,
            "encoder",
            severity(word == table.channels[line], Severity.WARNING),
            subject=axis.name,
            variable=where,
            found=f"${word:X}",
            wanted=f"${table.channels[line]:X}",
        )


def _buffers(judged: CheckedConfiguration) -> Iterator[Check]:
    card = judged.configuration
    foreign = [f"PLC {number}" for number in sorted(card.plcs) if number not in PLCS]
    found = ", ".join((*foreign, *card.locked))
    yield Check(Group.PROGRAMS, "plc_texts", severity(not found, Severity.WARNING), found=found or "-")
    there = HEARTBEAT_PLC in card.plcs
    code = "heartbeat_there" if there else "heartbeat_missing"
    yield Check(Group.PROGRAMS, code, Severity.NOTICE, found=f"PLC {HEARTBEAT_PLC}")
    for motor, table in sorted(card.tables.items()):
        found = f"{table.definition}, {table.entry_count}, sha256 {table.sha256[:12]}"
        yield Check(Group.PROGRAMS, "table", Severity.NOTICE, subject=f"motor {motor}", found=found)


def _pointers(judged: CheckedConfiguration) -> Iterator[Check]:
    """Check that a cut's end flag is a plain value, and that the watchdog counts down or is not set up."""
    pointers = judged.configuration.pointers
    flag, timer = pointers.get(END_FLAG), pointers.get(WATCHDOG_TIMER)
    name = f"M{END_FLAG}->"
    yield Check(Group.PROGRAMS, "hold_flag", severity(flag is None), variable=name, found=flag or "*", wanted="*")
    timers = [f"{space}:${address:X}" for space, address in judged.dialect.timer_words]
    if timer is not None and timers and not any(timer.startswith(f"{word},") for word in timers):
        name, wanted = f"M{WATCHDOG_TIMER}->", ", ".join(timers)
        yield Check(Group.PROGRAMS, "heartbeat_timer", Severity.WARNING, variable=name, found=timer, wanted=wanted)


def motor_rules(judged: CheckedConfiguration) -> list[Check]:
    """Return the checks of each axis."""
    rules = (_no_limit, _errors, _travel, _speeds, _flags, _power)
    return [
        *(check for axis in judged.driven_axes for rule in rules for check in rule(judged, axis)),
        *_tool(judged),
        *(check for axis in judged.axes for check in _not_stated(judged, axis)),
    ]


def _index(judged: CheckedConfiguration, axis: JudgedAxis, number: int) -> int:
    return judged.dialect.motor_index(axis.motor, number)


def _no_limit(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    for number in NEVER_ZERO:
        if judged.of_motor(axis, number) <= 0.0:
            yield judged.about("no_limit", Severity.REFUSAL, _index(judged, axis, number), wanted="> 0")


def _errors(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    fatal, warning = judged.of_motor(axis, 11), judged.of_motor(axis, 12)
    if 0.0 < fatal <= warning:
        wanted = f"< {digits(fatal)} /16 counts"
        yield judged.about("warning_late", Severity.WARNING, _index(judged, axis, 12), wanted=wanted)
    least = LEAST_FATAL_ERROR_UM / judged.machine.tool.count_um
    if axis.name == "tool" and 0.0 < fatal < least * PARTS_PER_COUNT:
        wanted = f">= {digits(least * PARTS_PER_COUNT)} /16 counts ({digits(LEAST_FATAL_ERROR_UM / 1000.0)} mm)"
        yield judged.about("trips_early", Severity.WARNING, _index(judged, axis, 11), wanted=wanted)
    if judged.of_motor(axis, 6) != 0.0:
        yield judged.about("following_on", Severity.REFUSAL, _index(judged, axis, 6), wanted="0")


def _travel(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    high, low = judged.of_motor(axis, 13), judged.of_motor(axis, 14)
    if axis.name == "spindle":
        if not high and not low:
            yield judged.about("turns_freely", Severity.NOTICE, _index(judged, axis, 13))
        return
    part = judged.machine.tool if axis.name == "tool" else judged.machine.carriage
    lowest, highest = part.travel_min_mm * part.counts_per_mm, part.travel_max_mm * part.counts_per_mm
    limits = ((13, high, "<=", highest, high > highest), (14, low, ">=", lowest, low < lowest))
    for number, value, sign, end, beyond in limits:
        wanted = f"{sign} {digits(end)} counts ({length(end, axis.motor, judged.machine)})"
        if value == 0.0:
            yield judged.about("no_limit", Severity.REFUSAL, _index(judged, axis, number), wanted=wanted)
        elif beyond:
            yield judged.about("beyond_travel", Severity.REFUSAL, _index(judged, axis, number), wanted=wanted)


def _speeds(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    program_speed = judged.of_motor(axis, 16)
    if axis.name != "carriage" and 0.0 < program_speed < LEAST_PROGRAM_SPEED:
        facts = {"rpm": digits(program_speed * 60_000.0 / judged.machine.spindle.counts_per_rev)}
        code = "slow_spindle" if axis.name == "spindle" else "slow_tool"
        wanted = f">= {digits(LEAST_PROGRAM_SPEED)} counts/ms"
        yield judged.about(code, Severity.REFUSAL, _index(judged, axis, 16), wanted=wanted, facts=facts)
    if judged.of_motor(axis, 20) <= 0.0 and judged.of_motor(axis, 21) <= 0.0:
        yield judged.about("divides_by_zero", Severity.REFUSAL, _index(judged, axis, 20), wanted="> 0 ms")
    if judged.of_motor(axis, 23) == 0.0:
        yield judged.about("never_homes", Severity.REFUSAL, _index(judged, axis, 23), wanted="≠ 0 counts/ms")


def _flags(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    index = judged.dialect.index(FamilySetting.FLAG_MODE, axis.motor)
    flags = int(judged.value(index) or 0.0)
    if not flags & KILL_MODE:
        yield judged.about("kills_all", Severity.WARNING, index)
    if flags & TRAVEL_SWITCHES_OFF and axis.name != "spindle":
        yield judged.about("switches_off", Severity.WARNING, index)
    if flags & FAULT_INPUT_OFF:
        yield judged.about("fault_input_off", Severity.WARNING, index)


def _power(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    if int(judged.of_motor(axis, 80)) & CLOSES_AT_POWER_UP:
        yield judged.about("closes_at_power_up", Severity.REFUSAL, _index(judged, axis, 80), wanted="0")
    commutates = judged.of_motor(axis, 1) != 0.0
    code = "commutates" if commutates else "amplifier_commutates"
    yield judged.about(code, Severity.NOTICE, _index(judged, axis, 1))
    if judged.of_motor(axis, 63) == 0.0 and judged.of_motor(axis, 33) != 0.0:
        yield judged.about("integrator_off", Severity.WARNING, _index(judged, axis, 63), wanted="> 0")
    output = judged.of_motor(axis, 2)
    others = [other for other in judged.driven_axes if other.motor < axis.motor]
    if output and any(judged.of_motor(other, 2) == output for other in others):
        yield judged.about("shared_output", Severity.REFUSAL, _index(judged, axis, 2))


def _tool(judged: CheckedConfiguration) -> Iterator[Check]:
    axis, tool = judged.axes[0], judged.machine.tool
    radians_per_ms = math.tau * LOBE_FREQUENCY_HZ / 1000.0
    needed = LOBE_AMPLITUDE_UM / tool.count_um * radians_per_ms**2
    thrust = tool.peak_force_n / tool.moving_mass_kg * tool.counts_per_mm / 1000.0
    for number, least in ((15, needed), (17, 0.0)):
        rate = judged.of_motor(axis, number)
        if 0.0 < rate < least:
            wanted = f">= {digits(least)} counts/ms2"
            yield judged.about("soft_abort", Severity.REFUSAL, _index(judged, axis, number), wanted=wanted)
        if rate > thrust:
            wanted = f"<= {digits(thrust)} counts/ms2"
            yield judged.about("beyond_thrust", Severity.WARNING, _index(judged, axis, number), wanted=wanted)
    most = tool.peak_current_a / tool.amplifier_gain_a_per_v / tool.v_per_bit
    if judged.of_motor(axis, 69) > most:
        wanted = f"<= {math.floor(most)} bits ({digits(tool.peak_current_a)} A)"
        yield judged.about("too_much_current", Severity.REFUSAL, _index(judged, axis, 69), wanted=wanted)


def _not_stated(judged: CheckedConfiguration, axis: JudgedAxis) -> Iterator[Check]:
    """Report what the profile does not state: addresses, flags, filter limits, commutation. Never written."""
    indices = (_index(judged, axis, number) for number in _SHOWN_NUMBERS)
    shown = [
        judged.about("shown", Severity.NOTICE, index)
        for index in indices
        if index not in judged.stated_settings and judged.value(index)
    ]
    if shown:
        found = ", ".join(f"{check.variable} = {check.found}" for check in shown)
        yield Check(axis.group, "not_stated", Severity.NOTICE, subject=axis.name, found=found)
