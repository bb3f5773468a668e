"""Rules for the controller, the coordinate system and what is stored on it, independent of the profile."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.commissioning.amounts import digits
from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.judged import Judged, same
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Scope, Setting
from drivers.pmac.reserved import END_FLAG, HEARTBEAT_PLC, WATCHDOG_TIMER
from drivers.pmac.settings import servo_cycle_ms
from profiles.findings import Severity

BACKGROUND_PLCS = 0b10  # bit of I5: PLC 1 to 31 may run
WATCHDOG_MS = 100.0  # a controller without a background cycle must shut down within this time

_SHOWN = (8, 52)


def card_rules(judged: Judged) -> list[Check]:
    """Return the checks of the controller, its coordinate system and its buffers."""
    of_card = (_family, _clocks, _permissions, _unexpected_motors)
    rules = (*of_card, _axes, _system, _conversion, _buffers, _pointers)
    return [check for rule in rules for check in rule(judged)]


def _family(judged: Judged) -> Iterator[Check]:
    card, wanted = judged.configuration, judged.machine.controller.family
    found = f"{card.kind}, {card.version}"
    yield Check(Group.CARD, "family", severity(card.family == wanted), found=found, wanted=wanted)


def _clocks(judged: Judged) -> Iterator[Check]:
    """Check the servo period and the real-time interrupt, on which all program times rest."""
    cycle_ms, wanted_ms = servo_cycle_ms(judged.value(10) or 0.0), judged.machine.controller.servo_period_ms
    facts, wanted = {"period": f"{cycle_ms * 1000.0:.3f} us"}, f"{wanted_ms * 1000.0:.3f} us"
    yield judged.about("servo_time", severity(same(cycle_ms, wanted_ms)), 10, wanted, facts)
    for number in _SHOWN:
        if judged.value(number) is not None:
            yield judged.about("shown", Severity.NOTICE, number)
    watchdog = judged.dialect.watchdog
    if watchdog.number is not None:
        trip_ms = (judged.value(watchdog.number) or float(watchdog.count)) * cycle_ms
        judgement = severity(trip_ms <= WATCHDOG_MS * 1.01, Severity.WARNING)
        facts, wanted = {"time": f"{digits(trip_ms)} ms"}, f"{WATCHDOG_MS / cycle_ms:.0f}"
        yield judged.about("watchdog", judgement, watchdog.number, wanted, facts)


def _permissions(judged: Judged) -> Iterator[Check]:
    plcs = bool(int(judged.value(5) or 0.0) & BACKGROUND_PLCS)
    yield judged.about("plcs", severity(plcs, Severity.WARNING), 5, "2, 3")
    yield judged.about("compensation", severity(not judged.value(51)), 51, "0")
    if judged.value(15):
        yield judged.about("radians", Severity.REFUSAL, 15, "0")
    index = judged.dialect.index(Setting.SEGMENT_MS, 1)
    yield judged.about("segments", severity(not judged.value(index)), index, "0 ms")


def _unexpected_motors(judged: Judged) -> Iterator[Check]:
    ours, dialect = {axis.motor for axis in judged.axes}, judged.dialect
    others = [dialect.motor_index(motor, 0) for motor in dialect.numbers(Scope.MOTOR) if motor not in ours]
    active = ", ".join(f"I{index}" for index in others if judged.value(index))
    yield Check(Group.CARD, "strange_motors", severity(not active), found=active or "0", wanted="0")


def _axes(judged: Judged) -> Iterator[Check]:
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


def _system(judged: Judged) -> Iterator[Check]:
    if judged.of_system(92):
        yield judged.about("blending_off", Severity.REFUSAL, judged.dialect.system_index(1, 92), "0")
    table = judged.dialect.conversion_table
    led = 0 <= int(judged.of_system(93)) - table.first_address < table.lines
    code = "led_by_master" if led else "own_time"
    yield judged.about(code, severity(not led), judged.dialect.system_index(1, 93))
    activation = judged.dialect.system_activation
    if activation is not None:
        yield judged.about("timers_run", Severity.OK, activation)


def _conversion(judged: Judged) -> Iterator[Check]:
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


def _buffers(judged: Judged) -> Iterator[Check]:
    card = judged.configuration
    foreign = [f"PLC {number}" for number in sorted(card.plcs) if number != HEARTBEAT_PLC]
    found = ", ".join((*foreign, *card.locked))
    yield Check(Group.PROGRAMS, "plc_texts", severity(not found, Severity.WARNING), found=found or "-")
    there = HEARTBEAT_PLC in card.plcs
    code = "heartbeat_there" if there else "heartbeat_missing"
    yield Check(Group.PROGRAMS, code, Severity.NOTICE, found=f"PLC {HEARTBEAT_PLC}")
    for motor, table in sorted(card.tables.items()):
        found = f"{table.definition}, {table.entry_count}, sha256 {table.sha256[:12]}"
        yield Check(Group.PROGRAMS, "table", Severity.NOTICE, subject=f"motor {motor}", found=found)


def _pointers(judged: Judged) -> Iterator[Check]:
    """Check that a cut's end flag is a plain value, and that the watchdog counts down or is not set up."""
    pointers = judged.configuration.pointers
    flag, timer = pointers.get(END_FLAG), pointers.get(WATCHDOG_TIMER)
    name = f"M{END_FLAG}->"
    yield Check(Group.PROGRAMS, "hold_flag", severity(flag is None), variable=name, found=flag or "*", wanted="*")
    timers = [f"{space}:${address:X}" for space, address in judged.dialect.timer_words]
    if timer is not None and timers and not any(timer.startswith(f"{word},") for word in timers):
        name, wanted = f"M{WATCHDOG_TIMER}->", ", ".join(timers)
        yield Check(Group.PROGRAMS, "lease_timer", Severity.WARNING, variable=name, found=timer, wanted=wanted)
