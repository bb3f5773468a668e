"""The watchdog: a countdown timer of the controller that the host keeps from running out, and its registers.

It is read by the heartbeat PLC, in the background, and by the loop of a cutting program.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.memory import WORD_BITS, Pointer
from drivers.pmac.settings import servo_cycle_ms
from profiles.machine import MachineProfile

WATCHDOG_MS = 300.0  # Watchdog timeout after one renewal
PERIOD_MS = 50.0  # Time between two renewals: five may be lost or late
MARGIN_MS = 20.0  # Remaining time when the PLC acts: with background cycles up to this, 300 ms are kept
SYSTEM = 1  # The coordinate system whose timers are used, where they belong to one; it is always activated
SERVO_PERIOD = 10  # I10: the servo period in 1/8388608 ms

ENDING = 1006  # P-variable: 1 while the PLC is about to end something
GRACE = 1007  # P-variable: servo cycles that a cut has to retract its tool by itself, before it is aborted
CLOSED = 1008  # P-variable: the loops that are closed, 1 tool, 2 spindle, 4 carriage
TAKE_OUT = 1009  # P-variable: 1 when the tool must be retracted from the part
RUN_DOWN = 1010  # P-variable: additional servo cycles, once the tool is out, for the cut to come to its end

TOOL, SPINDLE, CARRIAGE = 1, 2, 4  # The bits of `CLOSED`

RUNNING = 1000
OPEN_LOOP = {TOOL: 1001, SPINDLE: 1002, CARRIAGE: 1003}
AMPLIFIER = {TOOL: 1004, SPINDLE: 1005, CARRIAGE: 1006}
TOOL_STILL, TOOL_IN_MOVE = 1007, 1008
TOOL_ACTUAL, TOOL_BIAS, TOOL_TARGET = 1009, 1010, 1011
SPINDLE_STILL, SPINDLE_ABORTING = 1012, 1013
TOOL_HOMED = 1014
"""M-variables: status bits, and registers of the tool in 1/(Ix08 x 32) count, except its target in counts."""


class GuardedActivity(IntEnum):
    """What the watchdog guards."""

    NOTHING = 0
    JOG = 1
    CUT = 2


@dataclass(frozen=True, slots=True)
class Timer:
    """A variable that counts down one per servo cycle; `pointer` is its required definition, None: built in."""

    name: str
    pointer: Pointer | None = None


def watchdog_timer(dialect: Dialect, place: int = 0) -> Timer:
    """Return the timer of the watchdog: the first that the family has."""
    if dialect.timer_numbers:
        return Timer(f"I{dialect.system_index(SYSTEM, dialect.timer_numbers[place])}")
    space, address = dialect.timer_words[place]
    pointer = Pointer(space=space, address=address, width=WORD_BITS, signed=True)
    return Timer(f"M{reserved.WATCHDOG_TIMER + place}", pointer)


def wait_timer(dialect: Dialect) -> Timer:
    """Return the timer that the PLC waits by: the second one."""
    return watchdog_timer(dialect, 1)


def cycles_of(time_ms: float, i10: float) -> int:
    """Return the servo cycles that fit into a time; `i10` is the value of I10."""
    return math.floor(time_ms / servo_cycle_ms(i10))


def watchdog_line(dialect: Dialect, i10: float | None = None) -> str:
    """Return the line that renews the watchdog; `i10` is the controller's value, None the factory's."""
    cycles = cycles_of(WATCHDOG_MS, dialect.factory[SERVO_PERIOD] if i10 is None else i10)
    return f"{watchdog_timer(dialect).name}={cycles}"


def watchdog_condition(dialect: Dialect) -> str:
    """Return the loop condition with which a cutting program ends by itself without a host."""
    return f"{watchdog_timer(dialect).name}>0"


def motors(machine: MachineProfile) -> dict[int, int]:
    """Return the motors that the controller moves, by their bit: a spindle on an inverter is not one of them."""
    axes = dict(zip((TOOL, SPINDLE, CARRIAGE), machine.motors, strict=True))
    if machine.spindle.drive != "servo":
        del axes[SPINDLE]
    return axes


def definitions(machine: MachineProfile, dialect: Dialect) -> dict[int, Pointer | None]:
    """Return the pointer of each M-variable of the heartbeat; None: it is a plain value."""
    tool, spindle = machine.tool.motor, machine.spindle.motor
    found: dict[int, Pointer | None] = {reserved.END_FLAG: None}
    for timer in (watchdog_timer(dialect), wait_timer(dialect)):
        if timer.pointer is not None:
            found[int(timer.name[1:])] = timer.pointer

    def motor_bit(motor: int, name: str) -> Pointer:
        word, bit = dialect.motor_bits[name]
        return register_pointer(dialect, motor, f"motor_status_{word}", bit)

    word, bit = dialect.system_bits["running_program"]
    found[RUNNING] = register_pointer(dialect, SYSTEM, f"system_status_{word}", bit)
    for axis, motor in motors(machine).items():
        found[OPEN_LOOP[axis]] = motor_bit(motor, "open_loop")
        found[AMPLIFIER[axis]] = motor_bit(motor, "amplifier_enabled")
    found[TOOL_STILL] = motor_bit(tool, "desired_velocity_zero")
    found[TOOL_IN_MOVE] = motor_bit(tool, "move_timer_active")
    found[TOOL_ACTUAL] = register_pointer(dialect, tool, "actual")
    found[TOOL_BIAS] = register_pointer(dialect, tool, "bias")
    found[TOOL_TARGET] = register_pointer(dialect, tool, "variable_jog")
    found[TOOL_HOMED] = motor_bit(tool, "home_complete")
    if SPINDLE in motors(machine):
        found[SPINDLE_STILL] = motor_bit(spindle, "desired_velocity_zero")
        found[SPINDLE_ABORTING] = motor_bit(spindle, "abort_deceleration")
    return dict(sorted(found.items()))


def definition_lines(machine: MachineProfile, dialect: Dialect) -> Iterator[str]:
    """Yield the lines that define them."""
    for number, pointer in definitions(machine, dialect).items():
        yield f"M{number}->{'*' if pointer is None else pointer}"


def register_pointer(dialect: Dialect, owner: int, name: str, bit: int | None = None) -> Pointer:
    """Return a register of a motor or coordinate system, or one bit of it."""
    register = dialect.registers[name]
    address = register.address + (owner - 1) * register.stride
    if bit is None:
        return Pointer(space=register.space, address=address)
    return Pointer(space=register.space, address=address, offset=bit, width=1)
