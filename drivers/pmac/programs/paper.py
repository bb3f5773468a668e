"""The paper's Prog. 1 for any job, corrected: docs/paper-program.md lists the changes and the reasons.

The core is as printed: two LINEAR moves for each lobe, TA10, TS and TM as the author wrote them, the tool moving
in by the whole lobe and back. The checker shows what a controller makes of it.
"""

from __future__ import annotations

import math

from drivers.pmac.language.text import format_number
from drivers.pmac.programs.setup import END_FLAG, END_MARKS, CutSetup
from drivers.pmac.trajectory.linear import Limits, LinearMove, effective_timing
from profiles.job import Job
from profiles.machine import MachineProfile

PROGRAM_NUMBER = 1
TA_MS = 10
DEFAULT_TS_MS = 10
RUN_UP_MS = 1000
RETRACT_MS = 200
RETRACT_COUNTS = 10_000

SETTLING_LOBES = 16
"""Lobes from rest after which a move follows one of its own kind: Ix17 depends on the velocity before."""


def segment_ms(job: Job, machine: MachineProfile, ts_ms: int) -> float:
    """Return the actual time of one of the two moves of a lobe in the steady cut, ms."""
    motors = (machine.spindle.motor, machine.tool.motor)
    variables = machine.controller.variables
    limits = Limits(
        velocity=tuple(variables[f"I{motor}16"] for motor in motors),
        acceleration=tuple(variables[f"I{motor}17"] for motor in motors),
    )
    turn, stroke = _counts_per_segment(job, machine), _stroke(job, machine)
    asked_ms = 1000.0 / (2.0 * job.lobe_frequency_hz)
    used_ms, before = asked_ms, (0.0, 0.0)
    for distance in ((turn, stroke), (turn, -stroke)) * SETTLING_LOBES:
        move = LinearMove(distance=distance, ta_ms=TA_MS, ts_ms=ts_ms, tm_ms=asked_ms)
        used_ms = effective_timing(move, before, limits).tm_ms
        before = (distance[0] / used_ms, distance[1] / used_ms)
    return used_ms


def spindle_start_counts(job: Job, machine: MachineProfile) -> float:
    """Return the spindle position required at the start, counts from the index, within one turn.

    The tool is furthest in one move after the loop begins, and the loop begins a whole number of lobes after the
    start: so the start is one move ahead of jaw 1 (Fig. 15 of the paper, in numbers).
    """
    per_turn = machine.spindle.counts_per_rev
    jaw_1 = job.lobe_phase_deg / 360.0 * per_turn
    return (jaw_1 - _counts_per_segment(job, machine)) % (per_turn / job.jaws)


def paper_program(job: Job, machine: MachineProfile, setup: CutSetup, ts_ms: int = DEFAULT_TS_MS) -> str:
    """Return the text of the program. It starts with the tool on the surface, clear of the part in Z."""
    used_ms = segment_ms(job, machine, ts_ms)
    lobes = math.ceil(1.2 * RUN_UP_MS / (2.0 * used_ms))
    per_turn = setup.counts_per_turn
    per_segment = setup.carriage_per_turn / (2 * job.jaws)
    number = format_number
    values = {
        "job": job.name,
        "rpm": number(job.spindle_speed_rpm),
        "lines": machine.spindle.encoder_lines_per_rev,
        "multiple": machine.spindle.counts_per_line,
        "per_turn": per_turn,
        "segments_a_turn": 2 * job.jaws,
        "hz": number(job.lobe_frequency_hz),
        "stroke": number(_stroke(job, machine)),
        "error": number(job.lobe_error_um_pp),
        "count_um": number(setup.tool_count_um),
        "depth": number(setup.depth),
        "feed": number(per_segment),
        "moves": 2 * job.jaws * setup.whole_turns,
        "run_up": number(2 * lobes),
        "run_up_ms": number(2 * lobes * used_ms),
        "ta": TA_MS,
        "ts": ts_ms,
        "retract": RETRACT_COUNTS,
        "retract_ms": RETRACT_MS,
        "retract_turn": number(RETRACT_MS / used_ms),
        "slow": RUN_UP_MS,
        "slow_ts": RUN_UP_MS // 4,
        "flag": END_FLAG,
        "end_marks": END_MARKS.replace(" ; ", " ; ours: "),
        "go_on": setup.go_on,
        "program": PROGRAM_NUMBER,
    }
    return _TEXT.format(**values)


def _counts_per_segment(job: Job, machine: MachineProfile) -> float:
    return machine.spindle.counts_per_rev / (2.0 * job.jaws)


def _stroke(job: Job, machine: MachineProfile) -> float:
    return job.lobe_error_um_pp / machine.tool.count_um


_TEXT = """\
; {job}: Prog. 1 of Lee and Lee (2001), mended. x tool, y spindle, z carriage; all in counts.
P100={rpm} ; spindle speed, rpm
P200={lines} ; encoder lines a turn
P300={per_turn}/{segments_a_turn} ; spindle counts in one move
P400=1000/(2*{hz}) ; time of one move, ms
P500={stroke} ; {error} um over {count_um} um a count
P600={feed} ; ours: carriage counts in one move
P610={moves} ; ours: moves to the end of the cut, whole turns
P620=P300*{run_up} ; ours: run-up, a whole number of lobes
P621={run_up_ms} ; ours: its time, ms
{end_marks}CLOSE
OPEN PROG {program}
CLEAR
LINEAR ; ours
INC
{flag}=0 ; ours: the host sets it to end the cut at the end of a turn
P630=0 P45=0 ; ours: moves done
P640=0 ; ours: moves to the end of the present turn
TA{ta} TS{ts} F50000
X{depth} ; depth of cut, clear of the part
DWELL0 ; ours: the run-up begins from rest
TA{slow} TS{slow_ts} TM(P621) Y(P620) ; ours: run-up
TA{ta} TS{ts} ; ours: back to the times of the cut
WHILE(P630<P640 OR {go_on} AND P630<P610) ; ours: the count of moves
IF(P630=P640) P640=P640+{segments_a_turn} ; ours
P630=P630+2 P45=P45+2 ; ours
P1=((P100*P200)/60*{multiple}) F(P1) Y(P300) TM(P400) X(P500) Z(P600) ; Z is ours
P1=((P100*P200)/60*{multiple}) F(P1) Y(P300) TM(P400) X(-P500) Z(P600)
ENDWHILE
P43=P630/{segments_a_turn} ; ours: turns of the cut
TA10 TS10 TM{retract_ms} X-{retract} Y(P300*{retract_turn}) ; printed X10000: 2 mm into the part
TM(P621) Y(P620) ; ours: the spindle turns on until the tool is out
TA{slow} TS{slow_ts} ; ours: and runs down
IF(P45=P630) P44=1 ; ours
CLOSE
"""
