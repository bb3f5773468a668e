"""The way out after a stop or a lost host: the tool clear of the part, and no table that adds to it."""

from __future__ import annotations

from console.session.cut.alignment import tables_told
from console.session.errors import SessionError, refuse
from drivers.clock import Clock
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.standstill import STILL_COUNTS, STILL_S
from profiles.machine import MachineProfile
from profiles.problem import Problem

HOME_COUNTS = 0.0
STILL_TIMEOUT_S = 3.0  # a just disabled axis may still settle; a spindle that coasts takes longer
OFF_THE_LIMIT_MM = 0.1  # our choice: a soft tool goes some hundredths beyond the end of a jog
CARRIAGE_ZERO_COUNTS = 0.0
"""Where the carriage stands ahead of every table, and each adds nothing."""


def retracted_by_distance(machine: MachineProfile, snapshot: Snapshot) -> float:
    """Return where the tool is clear by the retract distance, counts, where no part is known.

    No further out than its home, where it is clear of every part; without a home, than its travel allows, short
    of the limit: on it the controller would end the jog as a fault.
    """
    tool, here = machine.tool, snapshot.tool.position
    homed = "home_complete" in snapshot.tool.flags
    least = HOME_COUNTS if homed else (tool.travel_min_mm + OFF_THE_LIMIT_MM) * tool.counts_per_mm
    return max(here - tool.retract_mm * tool.counts_per_mm, min(least, here))


def retract_and_switch_tables_off(lathe: Lathe, target: float, zero_z: float = CARRIAGE_ZERO_COUNTS) -> bool:
    """Retract the tool to `target`, counts; return whether a table was on, and is off now.

    A stop leaves the compensation table of a cut on. Then the carriage moves to `zero_z`, counts, too, where the
    table adds nothing, and the table is switched off there. Without a home nobody knows where that is: the
    carriage stays, and a table that adds something stays on.

    Raises DriverError: as `Jogs.retract` and `CutProgram.switch_tables_off`. SessionError: what still adds to the
    tool.
    """
    lathe.retract(target)
    lathe.program.put_back()
    if not lathe.program.tables_left():
        return False
    if lathe.snapshot().homed:
        lathe.jog_to(AxisName.CARRIAGE, zero_z, settle=False)
    refuse(tables_told(lathe.program.switch_tables_off(), homed=lathe.snapshot().homed))
    return True


def clear_tables(lathe: Lathe, clock: Clock) -> None:
    """Clear what tables add to the tool where no home is known, with the drives killed and all at rest.

    Nothing moves. Raises DriverError: as `CutProgram.clear_tables`. SessionError: what still adds to the tool;
    `machine.moving`, something does not come to rest.
    """
    refuse_unless_still(lathe, clock)
    refuse(lathe.program.clear_tables())


def refuse_unless_still(lathe: Lathe, clock: Clock) -> None:
    """Refuse while anything turns: with open loops two polls prove rest, not the command."""
    deadline_s = clock.now_s() + STILL_TIMEOUT_S
    before = lathe.snapshot()
    while clock.now_s() < deadline_s:
        clock.wait(STILL_S)
        after = lathe.snapshot()
        if after.still(before, STILL_COUNTS):
            return
        before = after
    raise SessionError(Problem(code="machine.moving"))
