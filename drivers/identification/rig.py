"""A controller with its lathe, for identification: preconditions, and what is restored at the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.commissioning.reading import holds_another
from drivers.errors import ControllerError, RefusedError
from drivers.identification.excitation import PROGRAM
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_constant
from drivers.pmac.programs.cam import correction_register
from drivers.pmac.status import decode
from profiles.machine import MachineProfile
from profiles.problem import Problem

STANDING_S = 0.2  # interval between two polls of a spindle that must stand still
STANDS_COUNTS = 2.0  # tolerance for a spindle at standstill meanwhile: encoder dither


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """One lathe, with a heartbeat, the client of its controller and its clock."""

    client: PmacClient
    lathe: Lathe
    clock: Clock

    @property
    def machine(self) -> MachineProfile:
        """The profile of the machine, with the gains that are on trial."""
        return self.lathe.as_set

    @property
    def dialect(self) -> Dialect:
        """The family of the controller."""
        return self.client.dialect

    @property
    def where(self) -> str:
        """The address of the controller."""
        return self.client.link.address


def card_problems(rig: Rig) -> tuple[Problem, ...]:
    """Return why this controller cannot be used, whether its drives are enabled or not; nothing moves."""
    return (*rig.lathe.verify(), *rig.lathe.program.tables_left(), *_in_use(rig), *_spindle_turns(rig))


def refuse_unready(rig: Rig, problems: tuple[Problem, ...]) -> None:
    """Make sure that a request has no `problems`, and that everything but the drives is ready.

    Raises RefusedError: every reason why not; nothing has moved; DriverError: the link broke.
    """
    if found := problems or card_problems(rig):
        raise RefusedError(*found)


def standing_problems(rig: Rig) -> tuple[Problem, ...]:
    """Return why the first motion is refused: drives disabled, not homed, something moving, a fault."""
    snapshot = rig.lathe.snapshot()
    required = {
        "machine.not_enabled": snapshot.loops_closed,
        "machine.not_homed": is_homed(snapshot),
        "machine.moving": snapshot.at_rest,
    }
    missing = [Problem(code=code, where=rig.where) for code, holds in required.items() if not holds]
    faults = [Problem(code="machine.fault", key="identify", value=fault) for fault in snapshot.axis_faults]
    return (*missing, *faults)


def is_homed(snapshot: Snapshot) -> bool:
    """Whether tool and carriage are homed; the spindle only stands still, at any angle."""
    return snapshot.homed_axes >= {AxisName.TOOL, AxisName.CARRIAGE}


def _in_use(rig: Rig) -> Iterator[Problem]:
    """Find what somebody else uses: a program of that number, a running gather."""
    if holds_another(rig.client, PROGRAM):
        yield Problem(code="identify.in_use", where=rig.where, key=f"PROG {PROGRAM}")
    (digits,) = rig.client.query("???", again=True)
    if "gathering" in decode(digits.strip(), rig.dialect.global_bits):
        yield Problem(code="identify.in_use", where=rig.where, key="GATHER")


def _spindle_turns(rig: Rig) -> Iterator[Problem]:
    before = rig.lathe.snapshot().spindle.position
    rig.clock.wait(STANDING_S)
    after = rig.lathe.snapshot().spindle.position
    if abs(after - before) > STANDS_COUNTS:
        value, limit = f"{abs(after - before):.4g} counts", f"<= {STANDS_COUNTS:g} counts"
        yield Problem(code="identify.spindle_turns", key="spindle", value=value, limit=limit)


def put_back(rig: Rig, gathering: Mapping[int, float], *, table: bool, table_before: tuple[str, ...] = ()) -> None:
    """Delete the program, the gather buffer and the table, and restore the gather settings.

    What the controller refuses is left. With a `table` the correction is set to 0: at its zero, or with the drives
    killed; then `table_before` is sent, the lines of the table whose place it took.
    """
    lines = ["ENDGATHER", "DELETE GATHER", f"OPEN PROG{PROGRAM}", "CLEAR", "CLOSE"]
    if table:
        lines += ["I51=0", f"{correction_register(rig.machine)}=0", f"#{rig.machine.tool.motor}DELETE COMP"]
    lines += [f"I{index}={format_constant(value)}" for index, value in gathering.items()]
    for line in lines:
        with suppress(ControllerError):
            rig.client.request(line, lines=0)
    # All or none: entries behind a definition that was refused would be numbers for something else.
    with suppress(ControllerError):
        for line in table_before if table else ():
            rig.client.request(line, lines=0)
