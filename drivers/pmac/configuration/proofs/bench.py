"""What every proof uses: a client that heeds stops, the correction of a motor, tables that are taken away."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.clock import Clock
from drivers.errors import ControllerError
from drivers.pmac.client import PmacClient
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.configuration.check import Check, Group, Outcome
from drivers.pmac.configuration.judged import Judged
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.language.text import format_constant
from drivers.pmac.reserved import MARKER
from drivers.pmac.status import decode
from drivers.stop import StopPath
from drivers.stop_record import Origin, Way, needed_stops
from profiles.machine import MachineProfile

PARTS = 32
"""Positions in registers are in 1/(Ix08 x 32) count."""

RULES = (
    "servo_rate",
    "compensation_edge",
    "table_zero",
    "delete_order",
    "source_delay",
    "roll_over",
    "pvt_rounding",
    "lease",
)
"""What there is to prove of the card alone."""

SETTLE_S = 0.05
"""Some background cycles, after which what was set is in force."""

POLL_S = 0.01


CHANNELS = 2
"""What is gathered at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Before:
    """What is used and put back: the definition of the spare M-variable, and the settings of gathering."""

    pointer: str
    settings: Mapping[int, float]


@dataclass(kw_only=True)
class ProofBench:
    """One card, killed at the beginning; `tables` are the motors that were given a table here."""

    client: PmacClient
    stop: StopPath
    clock: Clock
    judged: Judged
    corrected: set[int] = field(default_factory=set)

    @property
    def dialect(self) -> Dialect:
        """The family of the card."""
        return self.judged.dialect

    @property
    def spare(self) -> int:
        """The M-variable that proofs point at registers; its definition is put back."""
        return self.dialect.highest_index

    def motor(self, name: str) -> int:
        """Return the motor of an axis."""
        return next(axis.motor for axis in self.judged.axes if axis.name == name)

    def tell(self, *lines: str) -> None:
        """Send lines that answer nothing, unless somebody has stopped.

        Raises:
            StoppedError: nothing was sent.
            DriverError: the card refuses, or does not answer.
        """
        for line in lines:
            self.stop.check()
            self.client.request(line, lines=0)

    def move(self, line: str) -> None:
        """Send a line that goes on moving. A stop that overtook it on the way is sent again behind it.

        Raises:
            StoppedError: before or behind it.
            DriverError: the card refuses, or does not answer.
        """
        self.stop.check()
        self.client.request(line, lines=0)
        if self.stop.reason is not None:
            self.stop.repeat()
        self.stop.check()

    def refuses(self, line: str) -> bool:
        """Whether the card refuses a line as it should: with ERR003."""
        self.stop.check()
        try:
            self.client.request(line, lines=0)
        except ControllerError as error:
            return error.error_number == ErrorCode.DATA_ERROR
        return False

    def settle(self, seconds: float = SETTLE_S) -> None:
        """Let time pass; a stop ends it, and so does a link that is gone while something may move.

        Raises:
            StoppedError: somebody has stopped.
            LinkError: the link broke.
        """
        end = self.clock.now_s() + seconds
        while (left := end - self.clock.now_s()) > 0.0:
            self.stop.check()
            self.clock.wait(min(left, SETTLE_S))
            self.client.query(f"P{MARKER}", again=True)
        self.stop.check()

    def position(self, motor: int) -> float:
        """Return where a motor is, counts."""
        return self.client.numbers(f"#{motor}P", again=True)[0]

    def flags(self, motor: int) -> frozenset[str]:
        """Return the status of a motor."""
        (digits,) = self.client.query(f"#{motor}?", again=True)
        return decode(digits, self.dialect.motor_bits)

    def correction(self, motor: int) -> float:
        """Return what compensation adds to a motor, counts."""
        self._point_at_correction(motor)
        return self.client.numbers(f"M{self.spare}", again=True)[0] / self._parts(motor)

    def clear_correction(self, motor: int) -> None:
        """Make the correction 0 by hand, as may be done while I51 is 0."""
        self._point_at_correction(motor)
        self.client.request(f"M{self.spare}=0", lines=0)

    def define(self, table: CompensationTable) -> None:
        """Send a table."""
        self.corrected.add(table.definition.target)
        for line in table_lines(table):
            self.stop.check()
            self.client.request(line, lines=0)

    def delete(self, *motors: int) -> None:
        """Switch compensation off, make the corrections 0 and delete tables, those of low motors first."""
        self.client.request("I51=0", lines=0)
        for motor in sorted(self.corrected):
            self.clear_correction(motor)
        self.corrected.clear()
        for motor in sorted(motors):
            self.client.request(f"#{motor}DELETE COMP", lines=0)

    def put_back(self, before: Before) -> None:
        """Leave the card as it was found; what the card refuses of that is left."""
        motors = [axis.motor for axis in self.judged.axes]
        lines = ["I51=0", "ENDGATHER", "DELETE GATHER"]
        for line in lines:
            with suppress(ControllerError):
                self.client.request(line, lines=0)
        for motor in sorted(motors):
            with suppress(ControllerError):
                self.clear_correction(motor)
                self.client.request(f"#{motor}DELETE COMP", lines=0)
        self.client.request(f"M{self.spare}->{before.pointer}", lines=0)
        for index, value in before.settings.items():
            self.client.request(f"I{index}={format_constant(value)}", lines=0)

    def _point_at_correction(self, motor: int) -> None:
        register = self.dialect.registers["compensation"]
        address = register.address + (motor - 1) * register.stride
        self.client.request(f"M{self.spare}->{register.space}:${address:X}", lines=0)

    def _parts(self, motor: int) -> float:
        index = self.dialect.motor_index(motor, 8)
        return PARTS * (self.judged.value(index) or 1.0)


def proof(name: str, *, holds: bool, found: str, wanted: str, subject: str = "") -> Check:
    """Return what came of a proof."""
    outcome = Outcome.HOLDS if holds else Outcome.FAILS
    return Check(
        group=Group.PROOFS, code=f"proof_{name}", outcome=outcome, subject=subject, found=found, wanted=wanted
    )


def stop_name(way: Way, origin: Origin) -> str:
    """Return what the proof of a stop is called."""
    return f"stop_{way}_{origin}"


def names_of(machine: MachineProfile) -> tuple[str, ...]:
    """Return everything that there is to prove of a machine."""
    stops = {(way, origin) for way, origin, _ in needed_stops(machine)}
    return (*RULES, *(stop_name(way, origin) for origin in Origin for way in Way if (way, origin) in stops))


def unproven(names: Iterable[str]) -> list[Check]:
    """Return what has not been proven yet."""
    return [Check(group=Group.PROOFS, code=f"unproven_{name}", outcome=Outcome.NOTED) for name in names]
