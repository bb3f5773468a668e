"""What every proof uses: a client that heeds stops and the owner, the correction of a motor, tables taken away."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.clock import Clock
from drivers.commissioning.check import Check, Group
from drivers.commissioning.judged import Judged
from drivers.commissioning.stop_record import Origin, Way, needed_stops
from drivers.controller import Controller
from drivers.errors import ControllerError, DriverError
from drivers.lathe.stop import StopPath
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.language.text import format_constant
from drivers.pmac.reserved import OWNER
from drivers.pmac.status import decode
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

REASON = "doctor"
"""Why the machine is stopped."""

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
class TestRig:
    """One card, killed at the beginning; `corrected` are the motors that were given a table here.

    `owner` is the number of the console that proves, None where nobody else can reach the card. Once another one
    is read, `ousted` is set: what moves by order of the bench (`moving`) is stopped, and nothing else goes out.
    `owner_seen` is told whose it is then.
    """

    client: Controller
    stop: StopPath
    clock: Clock
    judged: Judged
    owner: float | None = None
    owner_seen: Callable[[float], None] = lambda _: None
    corrected: set[int] = field(default_factory=set)
    moving: bool = False
    ousted: bool = False

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

    def see_owner(self, held: float) -> None:
        """Take in what was read of whose the machine is.

        Raises:
            DriverError: `owner.ousted`; what the bench moves was stopped before.
        """
        if self.owner is None or held == self.owner:
            return
        self.ousted = True
        if self.moving:
            self.stop.stop(REASON)
        self.owner_seen(held)
        where, value, limit = self.client.link.address, f"{held:.0f}", f"{self.owner:.0f}"
        raise DriverError(Problem(code="owner.ousted", where=where, value=value, limit=limit))

    def refuse_ousted(self) -> None:
        """Ask whose the machine is.

        Raises:
            DriverError: `owner.ousted`; the link broke.
        """
        self.see_owner(self.client.numbers(f"P{OWNER}", again=True)[0])

    def tell(self, *lines: str) -> None:
        """Send lines that answer nothing and move nothing, unless somebody has stopped or taken the machine.

        Raises:
            StoppedError: nothing was sent.
            DriverError: `owner.ousted`, nothing was sent; the card refuses, or does not answer.
        """
        self.refuse_ousted()
        for line in lines:
            self.stop.check()
            self.client.request(line, lines=0)

    def move(self, line: str) -> None:
        """Send a line that moves or energises. A stop that overtook it on the way is sent again behind it.

        Raises:
            StoppedError: before or behind it.
            DriverError: `owner.ousted`, nothing was sent; the card refuses, or does not answer.
        """
        self.refuse_ousted()
        self.stop.check()
        self.moving = True
        self.client.send(line, check=self.stop.check, moves=True)
        if self.stop.reason is not None:
            self.stop.repeat()
        self.client.reply(line, lines=0)
        if self.stop.reason is not None:
            self.stop.repeat()
        self.stop.check()

    def give_back(self, *lines: str) -> None:
        """Send lines that put back what was used; what the card refuses is left. Of another's machine all is.

        Raises:
            LinkError: the link broke.
        """
        for line in () if self.ousted else lines:
            with suppress(ControllerError):
                self.client.request(line, lines=0)

    def refuses(self, line: str) -> bool:
        """Whether the card refuses a line as it should: with ERR003."""
        self.stop.check()
        try:
            self.client.request(line, lines=0)
        except ControllerError as error:
            return error.error_number == ErrorCode.DATA_ERROR
        return False

    def settle(self, seconds: float = SETTLE_S) -> None:
        """Let time pass; a stop ends it, and so does a link or a machine that is gone while something may move.

        Raises:
            StoppedError: somebody has stopped.
            DriverError: `owner.ousted`; the link broke.
        """
        end = self.clock.now_s() + seconds
        while (left := end - self.clock.now_s()) > 0.0:
            self.stop.check()
            self.clock.wait(min(left, SETTLE_S))
            self.refuse_ousted()
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
        """Leave the card as it was found, unless it is another's; what the card refuses of that is left."""
        if self.ousted:
            return
        motors = [axis.motor for axis in self.judged.axes]
        self.give_back("I51=0", "ENDGATHER", "DELETE GATHER")
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
    severity = Severity.OK if holds else Severity.REFUSAL
    return Check(
        group=Group.PROOFS, code=f"proof_{name}", severity=severity, subject=subject, found=found, wanted=wanted
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
    return [Check(group=Group.PROOFS, code=f"unproven_{name}", severity=Severity.NOTICE) for name in names]
