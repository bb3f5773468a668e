"""Rules for the controller, the coordinate system and what is stored on it, independent of the profile."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.commissioning.amounts import digits
from drivers.commissioning.check import Check, Group
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
    return [
        _family(judged),
        *_clocks(judged),
        *_permissions(judged),
        _unexpected_motors(judged),
        *_axes(judged),
        *_system(judged),
        *_conversion(judged),
        *_buffers(judged),
        *_pointers(judged),
    ]


def _family(judged: Judged) -> Check:
    found, wanted = judged.configuration.family, judged.machine.controller.family
    told = f"{judged.configuration.kind}, {judged.configuration.version}"
    severity = Severity.OK if found == wanted else Severity.REFUSAL
    return Check(Group.CARD, "family", severity, found=told, wanted=wanted)


def _clocks(judged: Judged) -> Iterator[Check]:
    """Check the servo period and the real-time interrupt, on which all program times rest."""
    cycle_ms, wanted_ms = servo_cycle_ms(judged.value(10) or 0.0), judged.machine.controller.servo_period_ms
    severity = Severity.OK if same(cycle_ms, wanted_ms) else Severity.REFUSAL
    facts = {"period": f"{cycle_ms * 1000.0:.3f} us"}
    yield judged.about("servo_time", severity, 10, wanted=f"{wanted_ms * 1000.0:.3f} us", facts=facts)
    for number in _SHOWN:
        if judged.value(number) is not None:
            yield judged.about("shown", Severity.NOTICE, number)
    watchdog = judged.dialect.watchdog
    if watchdog.number is not None:
        cycles = judged.value(watchdog.number) or float(watchdog.count)
        trip_ms = cycles * cycle_ms
        severity = Severity.OK if trip_ms <= WATCHDOG_MS * 1.01 else Severity.WARNING
        wanted = f"{WATCHDOG_MS / cycle_ms:.0f}"
        yield judged.about(
            "watchdog", severity, watchdog.number, wanted=wanted, facts={"time": f"{digits(trip_ms)} ms"}
        )


def _permissions(judged: Judged) -> Iterator[Check]:
    plcs = int(judged.value(5) or 0.0) & BACKGROUND_PLCS
    yield judged.about("plcs", Severity.OK if plcs else Severity.WARNING, 5, wanted="2, 3")
    compensated = judged.value(51) or 0.0
    yield judged.about("compensation", Severity.REFUSAL if compensated else Severity.OK, 51, wanted="0")
    if judged.value(15):
        yield judged.about("radians", Severity.REFUSAL, 15, wanted="0")
    index = judged.dialect.index(Setting.SEGMENT_MS, 1)
    segmented = judged.value(index) or 0.0
    yield judged.about("segments", Severity.REFUSAL if segmented else Severity.OK, index, wanted="0 ms")


def _unexpected_motors(judged: Judged) -> Check:
    ours = {axis.motor for axis in judged.axes}
    others = [motor for motor in judged.dialect.numbers(Scope.MOTOR) if motor not in ours]
    names = [
        f"I{judged.dialect.motor_index(m, 0)}" for m in others if judged.value(judged.dialect.motor_index(m, 0))
    ]
    severity = Severity.REFUSAL if names else Severity.OK
    return Check(Group.CARD, "strange_motors", severity, found=", ".join(names) or "0", wanted="0")


def _axes(judged: Judged) -> Iterator[Check]:
    wanted = {each.motor: str(each) for each in read_definitions(judged.machine.controller.axis_definitions)}
    found = {motor: axis.text for motor, axis in judged.configuration.axes.items() if axis.system == 1}
    elsewhere = {motor: axis for motor, axis in judged.configuration.axes.items() if axis.system != 1}
    for motor in sorted(wanted.keys() | found.keys() | elsewhere.keys()):
        is_there, is_wanted = found.get(motor, "0"), wanted.get(motor, "0")
        if motor in elsewhere:
            is_there = f"&{elsewhere[motor].system} {elsewhere[motor].text}"
        severity = Severity.OK if is_there == is_wanted else Severity.REFUSAL
        variable = f"#{motor}->"
        yield Check(Group.SYSTEM, "axis", severity, variable=variable, found=is_there, wanted=is_wanted)


def _system(judged: Judged) -> Iterator[Check]:
    index = judged.dialect.system_index(1, 92)
    if judged.of_system(92):
        yield judged.about("blending_off", Severity.REFUSAL, index, wanted="0")
    source = judged.dialect.system_index(1, 93)
    table = judged.dialect.conversion_table
    line = int(judged.of_system(93)) - table.first_address
    led = 0 <= line < table.lines
    yield judged.about("led_by_master" if led else "own_time", Severity.REFUSAL if led else Severity.OK, source)
    activation = judged.dialect.system_activation
    if activation is not None:
        yield judged.about("timers_run", Severity.OK, activation)


def _conversion(judged: Judged) -> Iterator[Check]:
    """Check that the machine's motors have their own encoders, converted as by factory default."""
    table = judged.dialect.conversion_table
    first = table.first_setting
    for axis in judged.axes:
        line = axis.motor - 1
        if line >= len(table.channels):
            continue
        if first is None:
            words = judged.configuration.conversion
            word, where = (words[line] if line < len(words) else 0), f"Y:${table.first_address + line:X}"
        else:
            word, where = int(judged.value(first + line) or 0.0), f"I{first + line}"
        severity = Severity.OK if word == table.channels[line] else Severity.WARNING
        yield Check(
            axis.group,
            "encoder",
            severity,
            subject=axis.name,
            variable=where,
            found=f"${word:X}",
            wanted=f"${table.channels[line]:X}",
        )


def _buffers(judged: Judged) -> Iterator[Check]:
    configuration = judged.configuration
    foreign = [f"PLC {number}" for number in sorted(configuration.plcs) if number != HEARTBEAT_PLC]
    foreign += list(configuration.locked)
    severity = Severity.WARNING if foreign else Severity.OK
    yield Check(Group.PROGRAMS, "plc_texts", severity, found=", ".join(foreign) or "-")
    there = HEARTBEAT_PLC in configuration.plcs
    yield Check(
        Group.PROGRAMS,
        "heartbeat_there" if there else "heartbeat_missing",
        Severity.NOTICE,
        found=f"PLC {HEARTBEAT_PLC}",
    )
    for motor, table in sorted(configuration.tables.items()):
        found = f"{table.definition}, {table.entry_count}, sha256 {table.sha256[:12]}"
        yield Check(Group.PROGRAMS, "table", Severity.NOTICE, subject=f"motor {motor}", found=found)


def _pointers(judged: Judged) -> Iterator[Check]:
    """Check that a cut's end flag is a plain value, and that the watchdog counts down or is not set up."""
    pointers, dialect = judged.configuration.pointers, judged.dialect
    flag = pointers.get(END_FLAG)
    severity = Severity.OK if flag is None else Severity.REFUSAL
    name = f"M{END_FLAG}->"
    yield Check(Group.PROGRAMS, "hold_flag", severity, variable=name, found=flag or "*", wanted="*")
    timer = pointers.get(WATCHDOG_TIMER)
    timers = [f"{space}:${address:X}" for space, address in dialect.timer_words]
    if timer is not None and timers and not any(timer.startswith(f"{word},") for word in timers):
        name, wanted = f"M{WATCHDOG_TIMER}->", ", ".join(timers)
        yield Check(Group.PROGRAMS, "lease_timer", Severity.WARNING, variable=name, found=timer, wanted=wanted)
