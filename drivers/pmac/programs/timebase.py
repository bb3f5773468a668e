"""The cut on the spindle's time base: PVT segments on a triggered external time base, started at the index.

The spindle counts advance the program's time, so that the tool is where the spindle angle requires at any speed.
The spindle is not an axis of the coordinate system: the controller jogs it, or something else turns it. The scale
factor 131072 / RTIF is an integer, so the speed at which programmed times are true is only near that of the job,
and a turn takes accordingly. While the spindle stands, no time passes and nothing of the program moves: such a cut
is ended by an abort and a jog of the tool, which do not depend on this time base.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.master.time_base import (
    FASTEST_SLEW,
    TimeBaseEntry,
    TimeBaseTrigger,
    nearest_factor,
    real_time_counts_per_ms,
)
from drivers.pmac.programs.along import with_along
from drivers.pmac.programs.push import with_push
from drivers.pmac.programs.pvt import LOBE_PATH, path_values, pvt_timing
from drivers.pmac.programs.setup import SERVO, CutSetup
from drivers.pmac.settings import settings_with
from drivers.pmac.trajectory.jog import change_speed, jog_settings
from drivers.pmac.variables import VariableStore
from profiles.compensations.path import LobedPath
from profiles.job import Job
from profiles.machine import MachineProfile

PROGRAM_NUMBER = 4

SETTLE_MS = 500  # Settling time of the spindle speed after its ramp
JOG_MS = 100  # Time for the controller to execute a jog command; after it Ix22 may be restored
TRIGGER_STATE = "M199"  # M-variable of the time base state, as in the manual's example

_SOURCE, _SLEW, _JOG_SPEED = 93, 94, 22
"""Ix93, the time base source, Ix94, its maximum rate of change, and Ix22 of the spindle."""

KEPT_SOURCE, KEPT_SLEW, KEPT_JOG_SPEED = "P40", "P41", "P42"  # The settings before the program changed them


@dataclass(frozen=True, slots=True, kw_only=True)
class SpindleClock:
    """The time base of a cut: its two lines of the conversion table, and its rate at the speed of the cut.

    `programmed_rpm` is the speed at which programmed times are true; `stretch` is the ratio of actual to
    programmed times at the speed of the job.
    """

    entry: TimeBaseEntry
    counts_per_ms: float
    programmed_rpm: float
    stretch: float


def spindle_clock(job: Job, machine: MachineProfile, dialect: Dialect) -> SpindleClock:
    """Return the time base of a job, after the factory's lines of the conversion table."""
    turn_counts = machine.spindle.counts_per_rev
    target = _spindle_counts_per_ms(job, machine)
    factor = nearest_factor(target)
    counts_per_ms = float(real_time_counts_per_ms(factor))
    table = dialect.conversion_table
    entry = TimeBaseEntry(
        line=len(table.setup),
        source=table.channels[machine.spindle.motor - 1],
        factor=factor,
        trigger=TimeBaseTrigger.FROZEN,
        pmac2_encoder=table.first_setting is not None,
    )
    return SpindleClock(
        entry=entry,
        counts_per_ms=counts_per_ms,
        programmed_rpm=60_000.0 * counts_per_ms / turn_counts,
        stretch=counts_per_ms / target,
    )


def timebase_program(
    job: Job, machine: MachineProfile, setup: CutSetup, command: LobedPath, dialect: Dialect
) -> str:
    """Return the text of the program, after the lines that set up the time base.

    `command` is the commanded tool position by spindle angle; it must fit whole milliseconds. The cut starts with
    the tool retracted and the carriage clear of the part, and ends with the tool retracted.

    Raises ProblemError: `program.too_long`.
    """
    clock = spindle_clock(job, machine, dialect)
    programmed = replace(job, spindle_speed_rpm=clock.programmed_rpm)
    timing = pvt_timing(programmed, setup, command)
    # The first segment, without motion, is the one that the controller plays while it waits for the index.
    first_spindle = clock.counts_per_ms * (timing.segment_ms + timing.approach_ms)
    values = {
        **path_values(programmed, setup, command, timing, first_spindle),
        **_clock_values(machine, clock, dialect),
        "y": "",
        "hz": format_number(job.lobe_frequency_hz),
        "rpm": format_number(job.spindle_speed_rpm),
        "counts": format_number(_spindle_counts_per_ms(job, machine)),
        "run_up": run_up_ms(job, machine, dialect),
        "program": PROGRAM_NUMBER,
    }
    turned = machine.spindle.drive == SERVO
    head = _HEAD.replace("{spindle_up}", _SPINDLE_UP if turned else "")
    text = (
        head + LOBE_PATH + _END + (_SPINDLE_DOWN if turned else "") + "IF(P45=P25 AND P26=1) P44=1\nENDIF\nCLOSE\n"
    )
    text = with_along(text, command, setup, programmed, timing.segment_ms)
    return with_push(text, programmed, setup, command.push_um, timing.segment_ms).format(**values)


def _clock_values(machine: MachineProfile, clock: SpindleClock, dialect: Dialect) -> dict[str, object]:
    """Return the template values about the time base and the spindle."""
    address, motor = clock.entry.address(dialect), machine.spindle.motor
    released = read_definitions(released_definitions(machine)[1])
    # The last two lines point the coordinate system at it: the program does that.
    entry_lines = clock.entry.commands(dialect)[:-2]
    return {
        "programmed": f"{clock.programmed_rpm:.6g}",
        "factor": clock.entry.factor,
        "release": "".join(f"&1#{each.motor}->0 ; turned apart from the program\n" for each in released),
        "entry": "\n".join(entry_lines),
        "trigger": TRIGGER_STATE,
        "place": f"Y:${address - 1:X},20,4",
        "address": address,
        "source": f"I{dialect.system_index(1, _SOURCE)}",
        "slew": f"I{dialect.system_index(1, _SLEW)}",
        "fastest": FASTEST_SLEW,
        "frozen": int(TimeBaseTrigger.FROZEN),
        "armed": int(TimeBaseTrigger.ARMED),
        "speed": f"I{dialect.motor_index(motor, _JOG_SPEED)}",
        "motor": motor,
        "jog": JOG_MS,
        "kept_source": KEPT_SOURCE,
        "kept_slew": KEPT_SLEW,
        "kept_speed": KEPT_JOG_SPEED,
    }


def _spindle_counts_per_ms(job: Job, machine: MachineProfile) -> float:
    return job.spindle_speed_rpm * machine.spindle.counts_per_rev / 60_000.0


def run_up_ms(job: Job, machine: MachineProfile, dialect: Dialect) -> int:
    """Return how long the spindle takes from rest to a steady speed when the controller jogs it."""
    variables = VariableStore(settings_with(machine.controller.variables, dialect), dialect)
    speed = _spindle_counts_per_ms(job, machine)
    ramp = change_speed(0.0, 0.0, speed, jog_settings(variables, machine.spindle.motor))
    return math.ceil(sum(piece.duration_ms for piece in ramp)) + SETTLE_MS


def released_definitions(machine: MachineProfile) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the axis definitions that stay, and those of the spindle that must be removed for this cut."""
    mine: list[str] = []
    others: list[str] = []
    for text in machine.controller.axis_definitions:
        spindles = [each.motor for each in read_definitions((text,))] == [machine.spindle.motor]
        (mine if spindles else others).append(text)
    return tuple(others), tuple(mine)


def restoring_lines(machine: MachineProfile, dialect: Dialect) -> tuple[str, ...]:
    """Return the lines that undo the changes of the program and its set-up; everything has to be at rest."""
    source, slew = (f"I{dialect.system_index(1, number)}" for number in (_SOURCE, _SLEW))
    _, mine = released_definitions(machine)
    return (f"{source}={KEPT_SOURCE}", f"{slew}={KEPT_SLEW}", *(f"&1{text}" for text in mine))


_HEAD = """\
; {job}: the lobe at {hz} Hz on the spindle's time, PVT segments of {segment} ms. x tool, z carriage; in counts.
; Programmed times are true at {programmed} rpm (scale factor {factor}); the cut is at {rpm} rpm.
; Between the points the cubics are within {error} um of the sinusoid.
{release}{entry}
{trigger}->{place} ; {frozen} no time passes, {armed} it waits for the index, then it passes with the spindle
{kept_source}={source} ; the card's own time base
{kept_slew}={slew}
P11={mean} ; tool at the mean depth
P12={amplitude} ; amplitude at the points: the wanted one over the gain of the servo
P13={step_deg} ; lobe angle of one segment, deg
P14={start_deg} ; lobe angle at the start, ahead by the lag of the servo and the cycle that the clock is old, deg
P15={slope} ; greatest tool speed at the points, counts/s
P18={feed_step} ; carriage counts in one segment
P19={feed_speed} ; carriage speed, counts/s
P20={out} ; tool retracted
P21={z} ; carriage clear of the part
P23={turns} ; turns of the cut
P24={ramp} ; segments in which the amplitude grows
P32={turn} ; segments in one turn
{along_values}{push_values}{end_marks}CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the cut at the end of a turn
{no_trim}{no_hold}{push_begin}IF({kept_source}!={address}) ; there is a time base to go back to, or nothing moves
{spindle_up}{trigger}={frozen} ; no time passes
{slew}={fastest} ; nothing of the spindle's counts is lost
{source}={address} ; the spindle is the clock
DWELL{jog} ; on the card's time, until the clock stands
PVT{segment} ; played while the index is waited for
X(P20):0 Z(P21):0
{trigger}={armed} ; time begins at the index
PVT{approach} ; the tool goes to its mean depth, clear of the part
X(P11):0 Z(P21):0
"""

_SPINDLE_UP = """\
{kept_speed}={speed}
{speed}={counts} ; {rpm} rpm
CMD"#{motor}J+"
DWELL{jog}
{speed}={kept_speed}
DWELL{run_up} ; the spindle runs up
"""

_END = """\
DWELL0
P26=0
IF({source}={address}) P26=1 ; the spindle was the clock to the end
{trigger}={frozen}
{source}={kept_source} ; the card's own time base again
DWELL{jog}
{slew}={kept_slew}
"""

_SPINDLE_DOWN = """\
CMD"#{motor}J/"
DWELL{jog}
"""
