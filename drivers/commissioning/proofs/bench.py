"""The test rig of all commissioning tests: a client that heeds stops and owner, corrections, clean-up."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.clock import Clock
from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.checked_configuration import CheckedConfiguration
from drivers.commissioning.stop_record import PriorMotion, StopMethod, needed_stops
from drivers.controller import Controller
from drivers.errors import ControllerError, DriverError
from drivers.lathe.stop import StopPath
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.errors import ErrorCode
from drivers.pmac.reserved import OWNER
from drivers.pmac.status import decode
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

REASON = "doctor"  # the reason recorded for a stop
PARTS = 32  # positions in registers are in 1/(Ix08 x 32) count
RULES = tuple(
    "servo_rate compensation_edge table_zero delete_order source_delay roll_over pvt_rounding heartbeat".split()
)
SETTLE_S = 0.05  # some background cycles, after which settings take effect
POLL_S = 0.01


@dataclass(kw_only=True)
class ProofRig:
    """One controller, killed at the beginning; `corrected` are the motors that were given a table here.

    `owner` is the number of the testing console, None where nobody else can reach the controller. Once another
    one is read, `ousted` is set: what moves by command of the rig (`moving`) is stopped, and nothing else is
    sent. `owner_seen` is called with the new owner. What is sent "unless stopped" raises StoppedError, or
    `owner.ousted`, before; every method raises DriverError when the link breaks or the controller refuses.
    """

    client: Controller
    stop: StopPath
    clock: Clock
    judged: CheckedConfiguration
    owner: float | None = None
    owner_seen: Callable[[float], None] = lambda _: None
    corrected: set[int] = field(default_factory=set)
    moving: bool = False
    ousted: bool = False

    @property
    def dialect(self) -> Dialect:
        """The family of the controller."""
        return self.judged.dialect

    @property
    def spare(self) -> int:
        """The M-variable that tests point at registers; its definition is restored."""
        return self.dialect.highest_index

    def motor(self, name: str) -> int:
        """Return the motor of an axis."""
        return next(axis.motor for axis in self.judged.axes if axis.name == name)

    def see_owner(self, held: float) -> None:
        """Process the owner that was read; after a stop of what the rig moves, raises `owner.ousted`."""
        if self.owner is None or held == self.owner:
            return
        self.ousted = True
        if self.moving:
            self.stop.stop(REASON)
        self.owner_seen(held)
        where, value, limit = self.client.link.address, f"{held:.0f}", f"{self.owner:.0f}"
        raise DriverError(Problem(code="owner.ousted", where=where, value=value, limit=limit))

    def refuse_ousted(self) -> None:
        """Query who owns the machine; raise `owner.ousted` if that is another console."""
        self.see_owner(self.client.numbers(f"P{OWNER}", again=True)[0])

    def tell(self, *lines: str) -> None:
        """Send lines that answer nothing and move nothing, unless stopped."""
        self.refuse_ousted()
        for line in lines:
            self.stop.check()
            self.client.request(line, lines=0)

    def move(self, line: str) -> None:
        """Send a line that moves or energises, unless stopped. A stop that overtook it is sent again after it."""
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
        """Send lines that restore what was used; refused lines are skipped, another's machine is left alone."""
        for line in () if self.ousted else lines:
            with suppress(ControllerError):
                self.client.request(line, lines=0)

    def refuses(self, line: str) -> bool:
        """Whether the controller rejects a line as it should: with ERR003."""
        self.stop.check()
        try:
            self.client.request(line, lines=0)
        except ControllerError as error:
            return error.error_number == ErrorCode.DATA_ERROR
        return False

    def settle(self, seconds: float = SETTLE_S) -> None:
        """Let time pass, unless stopped; a stop ends the wait, and so does a lost link or machine."""
        end = self.clock.now_s() + seconds
        while (left := end - self.clock.now_s()) > 0.0:
            self.stop.check()
            self.clock.wait(min(left, SETTLE_S))
            self.refuse_ousted()
        self.stop.check()

    def position(self, motor: int) -> float:
        """Return the position of a motor, counts."""
        return self.client.numbers(f"#{motor}P", again=True)[0]

    def flags(self, motor: int) -> frozenset[str]:
        """Return the status of a motor."""
        (digits,) = self.client.query(f"#{motor}?", again=True)
        return decode(digits, self.dialect.motor_bits)

    def correction(self, motor: int) -> float:
        """Return what compensation adds to a motor, counts."""
        self._point_at_correction(motor)
        parts = PARTS * (self.judged.value(self.dialect.motor_index(motor, 8)) or 1.0)
        return self.client.numbers(f"M{self.spare}", again=True)[0] / parts

    def clear_correction(self, motor: int) -> None:
        """Set the correction to 0 directly, which is permitted while I51 is 0."""
        self._point_at_correction(motor)
        self.client.request(f"M{self.spare}=0", lines=0)

    def define(self, table: CompensationTable) -> None:
        """Send a table."""
        self.corrected.add(table.definition.target)
        for line in table_lines(table):
            self.stop.check()
            self.client.request(line, lines=0)

    def delete(self, *motors: int) -> None:
        """Switch compensation off, clear the corrections and delete tables, those of low motors first."""
        self.client.request("I51=0", lines=0)
        for motor in sorted(self.corrected):
            self.clear_correction(motor)
        self.corrected.clear()
        for motor in sorted(motors):
            self.client.request(f"#{motor}DELETE COMP", lines=0)

    def put_back(self, restoring: Iterable[str]) -> None:
        """Restore the controller, at last by lines, unless it is another console's; what it refuses is skipped."""
        if self.ousted:
            return
        self.give_back("I51=0", "ENDGATHER", "DELETE GATHER")
        for motor in sorted(axis.motor for axis in self.judged.axes):
            with suppress(ControllerError):
                self.clear_correction(motor)
                self.client.request(f"#{motor}DELETE COMP", lines=0)
        for line in restoring:
            self.client.request(line, lines=0)

    def _point_at_correction(self, motor: int) -> None:
        register = self.dialect.registers["compensation"]
        address = register.address + (motor - 1) * register.stride
        self.client.request(f"M{self.spare}->{register.space}:${address:X}", lines=0)


def proof(name: str, *, holds: bool, found: str, wanted: str) -> Check:
    """Return the result of a test."""
    return Check(Group.PROOFS, f"proof_{name}", severity(holds), found=found, wanted=wanted)


def stop_name(way: StopMethod, origin: PriorMotion) -> str:
    """Return the name of a stop test."""
    return f"stop_{way}_{origin}"


def names_of(machine: MachineProfile) -> tuple[str, ...]:
    """Return the names of all tests of a machine."""
    stops = {(way, origin) for way, origin, _ in needed_stops(machine)}
    return (
        *RULES,
        *(stop_name(way, origin) for origin in PriorMotion for way in StopMethod if (way, origin) in stops),
    )


def list_missing_tests(names: Iterable[str]) -> list[Check]:
    """Return the tests still to be done."""
    return [Check(Group.PROOFS, f"unproven_{name}", Severity.NOTICE) for name in names]
