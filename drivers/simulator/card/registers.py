"""The memory of the simulated controller: registers of motors and systems, plain words elsewhere.

A register's value is computed when it is read, so that reads do not slow the motion. Registers of position are in
1/(Ix08 x 32) count, those of velocity in 1/(Ix09 x 32) count per servo cycle.
"""

from __future__ import annotations

import math
import struct
import sys
from collections.abc import Callable, Mapping
from typing import Final

from drivers.pmac.gathering.gather import decode_float, encode_float
from drivers.pmac.memory import WORD_BITS, PassingWord, Pointer
from drivers.pmac.variables import VariableWords
from drivers.simulator.card import reports
from drivers.simulator.card.buffers import StoredBuffers
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.countdown import Countdown
from drivers.simulator.card.motor import Motor

PARTS: Final = 32.0  # of a count, and that Ix08 (or Ix09) times
WORD = (1 << WORD_BITS) - 1
DOUBLE_BITS = 2 * WORD_BITS
_HALF = 0xFFFF
OUTPUT_BIT = 1 << 8  # the 16 bits of an output are the upper ones of its word
Value = Callable[[SimulatedController, int], float]  # computes the register of a motor or a system, by its number


def _of_motor(value: Callable[[Motor], float]) -> Value:
    return lambda controller, number: value(controller.motors[number])


def _position(counts: Callable[[Motor], float]) -> Value:
    return _of_motor(lambda motor: counts(motor) * motor.variable(8) * PARTS)


_desired = _position(lambda motor: motor.desired)
_velocity = _of_motor(lambda motor: motor.encoder_step * motor.variable(9) * PARTS)


def _phase_period(controller: SimulatedController, _: int) -> float:
    clock = controller.dialect.phase_clock
    if clock is None:
        return 0.0
    return controller.servo_period_ms * clock.counts_per_ms / (controller.variables.i(clock.divider) + 1.0)


READERS: Mapping[str, Value] = {
    "commanded": _desired,
    "actual": _position(lambda motor: motor.encoder),
    "bias": _position(lambda motor: motor.bias),
    "master": _position(lambda motor: motor.superimposed),
    "compensation": _position(lambda motor: motor.correction),
    "target": _desired,
    "following_error": _position(lambda motor: motor.following_error),
    "velocity": _velocity,
    "filtered_velocity": _velocity,
    "output": _of_motor(lambda motor: round(getattr(motor.axis, "output_bits", 0.0)) * OUTPUT_BIT),
    "variable_jog": _of_motor(lambda motor: motor.variable_jog),
    "home_capture": _of_motor(lambda motor: motor.home_capture),
    "motor_status_1": lambda controller, number: reports.motor_words(controller, controller.motors[number])[0],
    "motor_status_2": lambda controller, number: reports.motor_words(controller, controller.motors[number])[1],
    "system_status_1": lambda controller, number: reports.system_words(controller, number)[0],
    "system_status_2": lambda controller, number: reports.system_words(controller, number)[1],
    "system_status_3": lambda controller, number: reports.system_words(controller, number)[2],
    "global_status_1": lambda controller, _: reports.global_words(controller)[0],
    "global_status_2": lambda controller, _: reports.global_words(controller)[1],
    "phase_period": _phase_period,
}
"""All registers; which of them a family has, and where, is in its dialect."""


def _passed_positions(motor: Motor, counts: list[float]) -> list[float]:
    scale = motor.variable(8)
    return [each * scale * PARTS for each in counts]


def _passed_commands(motor: Motor) -> list[float]:
    return _passed_positions(motor, motor.replay.commands)


def _following_errors(motor: Motor) -> list[float]:
    replay, superimposed, scale = motor.replay, motor.superimposed, motor.variable(8)
    encoders = replay.encoders
    if not motor.enabled:
        return [0.0] * len(encoders)
    commands, corrections = replay.commands, replay.corrections
    return [
        (commands[at] + corrections[at] + superimposed - encoders[at]) * scale * PARTS
        for at in range(len(encoders))
    ]


def _velocities(motor: Motor) -> list[float]:
    scale = motor.variable(9)
    return [step * scale * PARTS for step in motor.replay.encoder_steps]


PASSED: Mapping[str, Callable[[Motor], list[float]]] = {
    "commanded": _passed_commands,
    "target": _passed_commands,
    "actual": lambda motor: _passed_positions(motor, motor.replay.encoders),
    "compensation": lambda motor: _passed_positions(motor, motor.replay.corrections),
    "following_error": _following_errors,
    "velocity": _velocities,
    "filtered_velocity": _velocities,
}
"""The registers of motors that are known in each cycle of a stretch, all at once: those gathered again and again.

The values are those of `READERS` for the motor, shown as it was after each cycle.
"""


class CardMemory:
    """X and Y words of 24 bits, together a D word of 48, or a floating-point L word with 36 bits of mantissa.

    A write to a register is lost, except for the variable jog position, the bias and the correction. Some words
    may be timers, and some set up the encoder conversion table.
    """

    def __init__(self, controller: SimulatedController) -> None:
        self._controller = controller
        dialect = controller.dialect
        # The name and the motor or system number of each register, by its space and address.
        self._registers = {
            (register.space, register.address + (number - 1) * register.stride): (name, number)
            for name, register in dialect.registers.items()
            for number in dialect.numbers(register.scope)
        }
        self._timer_places = frozenset(dialect.timer_words)
        self._timers = Countdown(dialect.timer_words, lambda: controller.cycles)
        self._words: dict[tuple[str, int], int] = {}
        self._variables = VariableWords(controller.variables)
        self._buffers = StoredBuffers(controller)
        self._numbers: dict[tuple[str, int, int], float] = {}

    def read(self, pointer: Pointer) -> float:
        """Return the value that a definition points at."""
        match pointer.space:
            case "X" | "Y":
                width = pointer.width
                part = self.word(pointer.space, pointer.address) >> pointer.offset & (1 << width) - 1
                return float(_sign_value(part, width) if pointer.signed else part)
            case "P":
                return float(self._words.get(("P", pointer.address), 0))
            case "D":
                return float(_sign_value(self.double(pointer.address), DOUBLE_BITS))
            case "DP":
                return float(_sign_value(self._halves(pointer.address), 32))
            case "F":
                value: float = struct.unpack(">f", self._halves(pointer.address).to_bytes(4, "big"))[0]
                return value if math.isfinite(value) else 0.0
            case "L":
                held = self._registers.get(("L", pointer.address))
                if held is not None:
                    return self._read_register(held)
                variable = self._variables.variable_at(pointer.address)
                if variable is not None:
                    return self._controller.variables.get(*variable)
                return _floating(self.word("X", pointer.address) << WORD_BITS | self.word("Y", pointer.address))
            case _:
                return self._numbers.get((pointer.space, pointer.address, pointer.offset), 0.0)

    def write(self, pointer: Pointer, value: float) -> None:
        """Store a value; non-integers are rounded, bits that do not fit are lost."""
        match pointer.space:
            case "X" | "Y":
                mask = _mask(pointer.width) << pointer.offset
                kept = self.word(pointer.space, pointer.address) & ~mask
                self.set_word(
                    pointer.space, pointer.address, kept | _register_integer(value) << pointer.offset & mask
                )
            case "P":
                self._words["P", pointer.address] = _register_integer(value) & WORD
            case "D":
                self.set_double(pointer.address, _register_integer(value))
            case "DP":
                self._set_halves(pointer.address, _register_integer(value))
            case "F":
                self._set_halves(pointer.address, int.from_bytes(_single(value), "big"))
            case "L":
                self._write_floating(pointer.address, value)
            case _:
                self._numbers[pointer.space, pointer.address, pointer.offset] = value

    def _write_floating(self, address: int, value: float) -> None:
        name, number = self._registers.get(("L", address), ("", 0))
        variable = self._variables.variable_at(address)
        if name == "variable_jog":
            self._controller.motors[number].variable_jog = value
        elif variable is not None:
            self._controller.variables.set(*variable, value)
        else:
            bits = encode_float(value) if math.isfinite(value) else 0
            self.set_word("X", address, bits >> WORD_BITS)
            self.set_word("Y", address, bits)

    def bits_of(self, pointer: Pointer) -> Callable[[], int] | None:
        """Return what reads the bits of a register in D, without finding it again each time."""
        held = self._registers.get(("D", pointer.address)) if pointer.space == "D" else None
        if held is None:
            return None
        name, number = held
        value, controller, mask = READERS[name], self._controller, _mask(DOUBLE_BITS)
        return lambda: _register_integer(value(controller, number)) & mask

    def passing(self, pointer: Pointer) -> PassingWord | None:
        """Return how to read a register of a motor in each servo cycle of a stretch; None for other words."""
        held = self._registers.get((pointer.space, pointer.address))
        whole = pointer.space == "D" or pointer.width == WORD_BITS
        if held is None or held[0] not in PASSED or not whole:
            return None
        name, number = held
        now, passed, controller = READERS[name], PASSED[name], self._controller
        motor = controller.motors[number]
        return PassingWord(number, lambda: now(controller, number), lambda: passed(motor))

    def word(self, space: str, address: int) -> int:
        """Return an unsigned 24-bit word; `space` is X or Y."""
        # Timers first, which are nothing else: the heartbeat PLC reads them in each of its scans.
        place = space, address
        if place in self._timer_places:
            return _register_integer(self._timers.read(place)) & WORD
        held = self._registers.get(place)
        if held is not None:
            return _register_integer(self._read_register(held)) & WORD
        line = self._controller.conversion.line_at(address)
        if line is not None:
            conversion = self._controller.conversion
            return conversion.word(line) if space == "Y" else conversion.result(line)
        definition = self._variables.word(space, address)
        if definition is not None:
            return definition
        stored = self._buffers.word(space, address)
        if stored is not None:
            return stored
        if ("D", address) in self._registers:
            return self.double(address) >> (WORD_BITS if space == "X" else 0) & WORD
        return self._words.get(place, 0)

    def set_word(self, space: str, address: int, value: int) -> None:
        """Store the lowest 24 bits."""
        line = self._controller.conversion.line_at(address)
        if (space, address) in self._timers:
            self._timers.write((space, address), float(_sign_value(value & WORD, WORD_BITS)))
        elif line is not None and space == "Y":
            self._controller.conversion.set_word(line, value)
        elif not self._variables.set_word(space, address, value & WORD):
            self._words[space, address] = value & WORD

    def double(self, address: int) -> int:
        """Return the X word and the Y word, together 48 bits, unsigned."""
        held = self._registers.get(("D", address))
        if held is not None:
            return _register_integer(self._read_register(held)) & _mask(DOUBLE_BITS)
        return self.word("X", address) << WORD_BITS | self.word("Y", address)

    def set_double(self, address: int, value: int) -> None:
        """Store the lowest 48 bits."""
        name, number = self._registers.get(("D", address), ("", 0))
        if name in ("bias", "compensation"):
            motor = self._controller.motors[number]
            scale = motor.variable(8) * PARTS
            counts = _sign_value(value & _mask(DOUBLE_BITS), DOUBLE_BITS) / scale if scale else 0.0
            motor.bias, motor.correction = (counts, motor.correction) if name == "bias" else (motor.bias, counts)
            return
        self.set_word("X", address, value >> WORD_BITS)
        self.set_word("Y", address, value)

    def _read_register(self, register: tuple[str, int]) -> float:
        name, number = register
        return READERS[name](self._controller, number)

    def _halves(self, address: int) -> int:
        return (self.word("X", address) & _HALF) << 16 | self.word("Y", address) & _HALF

    def _set_halves(self, address: int, value: int) -> None:
        self.set_word("X", address, value >> 16 & _HALF)
        self.set_word("Y", address, value & _HALF)


def _floating(bits: int) -> float:
    """Return the number in an L word; one that is too large is the largest."""
    try:
        return decode_float(bits)
    except OverflowError:
        return -sys.float_info.max if bits >> (DOUBLE_BITS - 1) else sys.float_info.max


def _mask(bits: int) -> int:
    return (1 << bits) - 1


def _sign_value(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def _single(value: float) -> bytes:
    try:
        return struct.pack(">f", value)
    except OverflowError:
        return struct.pack(">f", math.copysign(3.4e38, value))


def _register_integer(value: float) -> int:
    """Return the integer that a register holds for a value; 0 for one that is not finite."""
    return math.floor(value + 0.5) if math.isfinite(value) else 0
