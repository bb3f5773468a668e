"""Retract of one machine without screens: the way out that F8 is on page Run."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from console.cli.library import SIM_LINK, machine_of
from console.cli.machine.tool_tests import reached_machine
from console.cli.output import confirm_motion, show, tell
from console.session.cut.alignment import NO_HOME_FOR_TABLE, Alignment, held_by, tables_told
from console.session.cut.retracting import clear_tables, retract_and_switch_tables_off, retracted_by_distance
from console.session.errors import SessionError, refuse, require
from console.session.signals import Interruption
from console.session.station.jogging import clears_tables
from console.session.station.machine_connection import guard, leave
from console.text.catalogue import Catalogue
from drivers.identification.rig import Rig
from drivers.lathe.lathe import Lathe
from drivers.lathe.lengths import Lengths
from drivers.lathe.safety import safety_problems
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.link.tracing import Tracing
from profiles.machine import MachineProfile
from profiles.problem import Problem


def retract(options: Namespace, interruption: Interruption, text: Catalogue) -> int:
    """Retract, and print where the axes stand; the machine is left at rest, drives off, released."""
    loaded = machine_of(options, SIM_LINK)
    options.sim = False
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"retract {loaded.machine.name}")
    try:
        with reached_machine(options, loaded, interruption, tracing, text) as (rig, owning, simulated):
            lathe = rig.lathe
            guard(interruption, lathe, rig.clock.now_s)
            lathe.connect()
            if lost := bool(lathe.snapshot().lost):
                print(text("retract.lost"), file=sys.stderr)
            # Nothing is sent and no control is taken before consent: the answer may take time.
            if not confirm_motion(options, loaded.machine.name, simulated, text):
                return 1
            owning.claim()
            try:
                clears = options.clear_tables or _only_switched_on(lathe)
                if clears:
                    cleared = _clear_tables(rig, lost=lost)
                else:
                    switched, last = _retract_axes(lathe, lost=lost)
            finally:
                leave(lathe, owning)
    finally:
        tell(tracing.problems, text)
    if clears:
        said = text("retract.tables_cleared" if cleared else "retract.no_tables")
        show(options, lambda: {"ended_by_controller": lost, "tables_cleared": cleared}, lambda: [said])
        return 0
    _show_places(options, loaded.machine, last, lost=lost, switched=switched, text=text)
    return 0


def _show_places(
    options: Namespace, machine: MachineProfile, last: Snapshot, *, lost: bool, switched: bool, text: Catalogue
) -> None:
    """Print where the axes stand after a retract, and whether a table was on."""
    lengths = Lengths(machine)
    places = {
        axis: lengths.format_position(axis, last.axis(axis).position)
        for axis in (AxisName.TOOL, AxisName.CARRIAGE)
    }
    show(
        options,
        lambda: {"ended_by_controller": lost, "tables_switched_off": switched, "at": dict(places)},
        lambda: [
            text("retract.done", tool=places[AxisName.TOOL], carriage=places[AxisName.CARRIAGE]),
            text("retract.tables_off" if switched else "retract.no_tables"),
        ],
    )


def _only_switched_on(lathe: Lathe) -> bool:
    """Whether F8 on page Run would clear tables in place of a retract, and they add nothing to the tool.

    What a table adds to it is cleared only for who asks for that.
    """
    tables = lathe.program.tables_left()
    return clears_tables(lathe.snapshot(), Alignment(tables=tables)) and not held_by(tables)


def _retract_axes(lathe: Lathe, *, lost: bool) -> tuple[bool, Snapshot]:
    """Enable the drives where the axes stand and retract; return whether a table was on, and where all stand now.

    Whoever agreed has read that the controller has `lost` its host: that acknowledges it.
    """
    before = lathe.snapshot()
    refuse(safety_problems(lathe.machine, before.inputs), lathe.verify())
    if not before.homed:
        told = tables_told(lathe.program.tables_left(), homed=False)
        refuse(each for each in told if each.code == NO_HOME_FOR_TABLE)
    require(before.homed, "machine.not_homed")  # else nobody knows where travel ends, and a table adds nothing
    lathe.confirm_nobody_inside()  # that is what was agreed to
    if lost:
        lathe.acknowledge_loss()
    lathe.enable()
    switched = retract_and_switch_tables_off(lathe, retracted_by_distance(lathe.machine, before))
    return switched, lathe.snapshot()


def _clear_tables(rig: Rig, *, lost: bool) -> bool:
    """Disable the drives and clear what tables add to the tool, where no home is known; whether there was any."""
    lathe = rig.lathe
    before = lathe.snapshot()
    require(before.at_rest, "machine.moving")
    if not lathe.program.tables_left():
        return False
    if before.homed:  # said before the drives are disabled, which the retract needs
        raise SessionError(Problem(code="tables.homed"))
    if lost:
        lathe.acknowledge_loss()
    if not before.loops_open:
        lathe.switch_off()
    clear_tables(lathe, rig.clock)
    return True
