"""Write gains and notch filter of the tool, drives disabled, each read back. Nothing is saved (SAVE)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from drivers.commissioning.checked_configuration import is_same_number
from drivers.commissioning.gains import Write, apply
from drivers.commissioning.reading import read_settings
from drivers.controller import Controller
from drivers.errors import DriverError
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_constant
from drivers.pmac.settings import servo_cycle_ms
from profiles.axis.servo_gains import NOTCH_NUMBERS, is_filter
from profiles.machine import MachineProfile
from profiles.problem import Problem

WRITTEN = (30, 31, 32, 33, *NOTCH_NUMBERS)
"""Ix30 to Ix33 and Ix36 to Ix39: what a proposal changes. Scales, integration mode, limits are never written."""
MODELLED = (8, 9, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39)
"""Ix08 and Ix09, the scales, the gains Ix30 to Ix35, and the notch filter Ix36 to Ix39."""

UNMODELLED = (60, 68)
"""Longer servo period, friction feedforward: 0, or the loop is another one than is computed."""

_SERVO_TIME = 10


def names_of(motor: int) -> tuple[str, ...]:
    """Return the names of the variables written for a motor, as in a profile."""
    return tuple(f"I{motor}{number}" for number in WRITTEN)


def indices_of(dialect: Dialect, motor: int) -> dict[str, int]:
    """Return the number of each I-variable that is written for a motor, by its name."""
    numbers = (dialect.motor_index(motor, number) for number in WRITTEN)
    return dict(zip(names_of(motor), numbers, strict=True))


def in_writing_order(found: Mapping[str, float], wanted: Mapping[str, float]) -> list[tuple[str, float]]:
    """Return names and values so that the loop is never more than both ends of the way, nor its filter unsteady.

    Where a coefficient of the filter changes, the overall gain Ix30 is 0 until all are written: with some of them
    the filter may have more gain at rest than both ends have, or the other sign. Else Ix30 goes first where it
    becomes less, and last where it does not. Of the two coefficients of the poles the one goes first that leaves
    them inside the unit circle beside the other, which is still the old one.
    """
    names = list(wanted)
    scale, (n1, n2, d1, d2) = names[0], names[-4:]
    steady = abs(found[d2]) < 1.0 and abs(wanted[d1]) < 1.0 + found[d2]
    ordered = [(name, wanted[name]) for name in (*names[1:-4], n1, n2, *((d1, d2) if steady else (d2, d1)))]
    last = (scale, wanted[scale])
    if any(wanted[name] != found[name] for name in (n1, n2, d1, d2)):
        return [(scale, 0.0), *ordered, last]
    return [last, *ordered] if wanted[scale] <= found[scale] else [*ordered, last]


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolLoop:
    """What was read, by the numbers of Ixx, and the servo period; `at` is the time of day of the reading."""

    motor: int
    values: tuple[tuple[int, float], ...]
    servo_period_ms: float
    at: str

    @property
    def names(self) -> Mapping[str, float]:
        """Return the values by the names that a profile has for them, such as I130."""
        return {f"I{self.motor}{number:02d}": value for number, value in self.values}

    @property
    def gains(self) -> Mapping[str, float]:
        """Return the gains as the model has them."""
        modelled = {f"I{self.motor}{number:02d}" for number in MODELLED}
        return {name: value for name, value in self.names.items() if name in modelled}

    @property
    def unmodelled_settings(self) -> tuple[str, ...]:
        """Return the names of settings that make the loop another one than is computed."""
        return tuple(name for name, value in self.names.items() if name not in self.gains and value != 0.0)

    def apply_to(self, machine: MachineProfile) -> MachineProfile:
        """Return a machine with these gains and this servo period instead of those of its profile."""
        variables = {**machine.controller.variables, **self.gains}
        controller = replace(machine.controller, variables=variables, servo_period_ms=self.servo_period_ms)
        return replace(machine, controller=controller)


def read_tool_loop(client: Controller, dialect: Dialect, motor: int, at: str) -> ToolLoop:
    """Read the loop of a motor. Raises DriverError: the link broke; ControllerError: it has not all of them."""
    indices = {number: dialect.motor_index(motor, number) for number in (*MODELLED, *UNMODELLED)}
    found = read_settings(client, (_SERVO_TIME, *indices.values()))
    return ToolLoop(
        motor=motor,
        values=tuple((number, found[index]) for number, index in indices.items()),
        servo_period_ms=servo_cycle_ms(found[_SERVO_TIME]),
        at=at,
    )


@dataclass(frozen=True, slots=True)
class ToolGains:
    """The gains of the tool in one controller."""

    client: PmacClient
    motor: int

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the variables written, as in a profile."""
        return names_of(self.motor)

    @property
    def indices(self) -> Mapping[str, int]:
        """The number of each I-variable by its name."""
        return indices_of(self.client.dialect, self.motor)

    def loop(self, at: str) -> ToolLoop:
        """Read the whole loop; errors as `read_tool_loop`."""
        return read_tool_loop(self.client, self.client.dialect, self.motor, at)

    def read(self) -> dict[str, float]:
        """Read the gains that are written. Raises DriverError: the link broke."""
        found = read_settings(self.client, self.indices.values())
        return {name: found[index] for name, index in self.indices.items()}

    def write(self, values: Mapping[str, float]) -> None:
        """Write each value that differs, read it back, and read all of them once more at the end.

        Where it ends early, Ix30 may be 0: a loop without force.

        Raises:
            RefusedError: `controller.drives_on`, `controller.program_running`; nothing was written.
            ControllerError: the controller refused a line; what was written before stands.
            DriverError: `controller.not_taken`, a value differs; nothing was sent after it.
            LinkError: the link broke; whether its last line was executed is unknown.
        """
        found = self.read()
        now, writes = dict(found), list[Write]()
        for name, value in in_writing_order(found, values):
            write = self._write(name, value, now[name])
            now[name] = value
            if write.wanted != write.found:
                writes.append(write)
        apply(self.client, self.client.dialect, writes)
        after = self.read()
        for name, value in values.items():
            if not is_same_number(after[name], value):
                each = self._write(name, value, after[name])
                raise DriverError(
                    Problem(code="controller.not_taken", key=each.line, value=each.found, limit=each.wanted)
                )

    def _write(self, name: str, value: float, found: float) -> Write:
        text, question = format_constant(value), f"I{self.indices[name]}"
        return Write(f"{question}={text}", question, text, format_constant(found))


def matches(found: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    """Whether every wanted gain was found; a filter that nobody wrote down is none, another gain is unknown."""
    return all(
        is_same_number(found[name], value) if name in found else is_filter(name) and value == 0.0
        for name, value in wanted.items()
    )
