"""The cut with the lobe in a compensation table: the program holds the depth and feeds, the table adds the lobe.

The carriage moves back to a row of zeros, where the table is switched on, and forward again; so the amplitude
grows with Z, clear of the part. In the end it returns there, and the table is switched off when its register reads
0: its value at that moment would stay added to the tool. In between the tool is on the lobe at any spindle speed,
and also at standstill.
"""

from __future__ import annotations

import math

from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.programs import hold
from drivers.pmac.programs.cam_table import Cam
from drivers.pmac.programs.cam_trim import TRIM_VALUES, TRIMMED_CUT, trim_segment_ms, trim_values
from drivers.pmac.programs.push import with_push
from drivers.pmac.programs.pvt import HALF_RUN_UP_MS, OUT_SPEED_MM_S, RUN_DOWN, RUN_UP, SPINDLE_STEP
from drivers.pmac.programs.setup import SERVO, CutSetup, cut_values, refuse_endless
from profiles.job import Job
from profiles.machine import MachineProfile

PROGRAM_NUMBER = 3

SEGMENT_MS = 8  # Feed moves; each checks once for the end of a turn
Z_SPEED_MM_S = 10.0  # Carriage speed between the row of zeros and the part

Z_RAMP_MS = 100
SETTLE_MS = 200
LOOK_MS = 20
MOST_LOOKS = 25
"""Polls of the register, and the ms between them, until it reads 0; after that the table stays on."""

COMPENSATION = 69  # M-variable of a motor, Mx69, that the manuals suggest for its correction register


def correction_register(machine: MachineProfile) -> str:
    """Return the M-variable of the register that holds the correction of the tool."""
    return f"M{100 * machine.tool.motor + COMPENSATION}"


def register_definition(machine: MachineProfile, dialect: Dialect) -> str:
    """Return the line that points that variable at the register."""
    register = dialect.registers["compensation"]
    address = register.address + (machine.tool.motor - 1) * register.stride
    return f"{correction_register(machine)}->{register.space}:${address:X}"


def cam_program(
    job: Job, machine: MachineProfile, setup: CutSetup, cam: Cam, dialect: Dialect, *, trimmed: bool = False
) -> str:
    """Return the text of the program, after the lines that set up the table.

    It starts with the tool retracted and the carriage clear of the part, and ends in the row of zeros. One that is
    `trimmed` adds the harmonic of `cam_trim`; the controller must then turn the spindle.

    Raises ProblemError: `program.too_long`.
    """
    turn_ms = 60_000.0 / job.spindle_speed_rpm
    longest_ms = trim_segment_ms(job) if trimmed else SEGMENT_MS
    segment_ms = max(1, min(longest_ms, math.floor(turn_ms)))
    refuse_endless(setup.whole_turns * turn_ms / segment_ms)
    way_mm = (cam.mean - setup.retracted) * setup.tool_count_um / 1000.0
    approach_ms = math.ceil(1.5 * way_mm / OUT_SPEED_MM_S * 1000.0)
    out_segments = math.ceil(approach_ms / segment_ms)
    before = setup.counts_per_turn / turn_ms * (HALF_RUN_UP_MS + approach_ms)
    values = {
        **_table_values(machine, setup, cam, dialect),
        **_cut_values(job, setup, segment_ms),
        "before": format_number(before),
        "half": HALF_RUN_UP_MS,
        "approach": approach_ms,
        "out_segments": out_segments,
        "out_ms": out_segments * segment_ms,
        "program": PROGRAM_NUMBER,
        "hold_first": 0,
        **hold.hold_values(
            job.feed_mm_per_rev,
            turn_ms,
            segment_ms,
            approach_ms / segment_ms,
            setup.tool_count_um,
            setup.land_turns,
        ),
    }
    if trimmed:
        values |= trim_values(job, setup, segment_ms, setup.spindle_start + before)
    template = _TURNED if machine.spindle.drive == SERVO else _FOLLOWED
    text = with_push(_TRIMMED if trimmed else template, job, setup, cam.push_um, segment_ms)
    return text.format(**values)


def _cut_values(job: Job, setup: CutSetup, segment_ms: int) -> dict[str, object]:
    """Return the template values about turning and feeding."""
    number = format_number
    turn_ms = 60_000.0 / job.spindle_speed_rpm
    turns = segment_ms / turn_ms
    return {
        **cut_values(job, setup, segment_ms),
        "spindle_step": number(setup.counts_per_turn * turns),
        "spindle_speed": number(1000.0 * setup.counts_per_turn / turn_ms),
        "spindle_start": number(setup.spindle_start),
        "feed_step": number(setup.carriage_per_turn * turns),
        "feed_speed": number(1000.0 * setup.carriage_per_turn / turn_ms),
        "turn": number(turn_ms / segment_ms),
    }


def _table_values(machine: MachineProfile, setup: CutSetup, cam: Cam, dialect: Dialect) -> dict[str, object]:
    """Return the template values about the table and the way to its row of zeros."""
    back = setup.carriage_start - cam.zero_z
    return {
        "error": f"{cam.chord_error_um:.4f}",
        "bytes": cam.bytes_to_send,
        "tool": machine.tool.motor,
        "table": "\n".join(table_lines(cam.table)),
        "register": correction_register(machine),
        "definition": register_definition(machine, dialect),
        "mean": format_number(cam.mean),
        "zero_z": format_number(cam.zero_z),
        "z_ms": _way_ms(back, machine),
        "home_ms": _way_ms(back + setup.carriage_counts, machine),
        "z_ramp": Z_RAMP_MS,
        "z_s": Z_RAMP_MS // 4,
        "settle": SETTLE_MS,
        "look": LOOK_MS,
        "looks": MOST_LOOKS,
    }


def _way_ms(counts: float, machine: MachineProfile) -> int:
    return math.ceil(counts / machine.carriage.counts_per_mm / Z_SPEED_MM_S * 1000.0)


_SET_UP = """\
; {job}: the lobe by a compensation table. x tool, {spindle_words}z carriage; all in counts.
; The straight lines between the entries are within {error} um of the sinusoid; {bytes} bytes of entries.
ENDGATHER
DELETE GATHER
#{tool} DELETE COMP
{table}
{definition} ; what the table adds to the tool
P11={mean} ; tool at the mean depth, with the constant of the table
{spindle_values}P18={feed_step} ; carriage counts in one segment
P19={feed_speed} ; carriage speed, counts/s, at {rpm} rpm
P20={out} ; tool retracted
P21={z} ; carriage clear of the part, the amplitude is whole
P23={turns} ; turns of the cut
P32={turn} ; segments in one turn
P35={zero_z} ; carriage in the row of zeros
{push_values}{end_marks}CLOSE
OPEN PROG {program}
CLEAR
{flag}=0 ; the host sets it to end the cut at the end of a turn
{push_begin}IF(I51=0 AND {register}=0) ; nothing is added to the tool, or nothing moves
ABS
LINEAR TA{z_ramp} TS{z_s} TM{z_ms} ; to the row of zeros
X(P20) Z(P35)
DWELL{settle}
I51=1 ; the table is on, and adds nothing here
TM{z_ms} Z(P21) ; the amplitude grows
DWELL0
"""

_CUT = """\
PVT{segment}
P25=0 P45=0
P30=0 ; turns begun
P31=0 ; the segment in which the present turn ends
{loop}WHILE(P25<P31 OR {go_on}{not_held} AND P30<P23)
IF(P25!<P31)
P30=P30+1
P31=P30*P32-0.5{held}
{one_turn}ENDIF
P25=P25+1 P45=P45+1
{cut}ENDWHILE
P43=P30 ; turns of the cut
P29=P21+P18*{fed} ; carriage at the end of the cut
{out_begins}P33=0
IF(P30>0) P33=P19
PVT{approach} ; the tool goes out, the carriage comes to rest
"""

_END = """\
DWELL0
LINEAR TA{z_ramp} TS{z_s} TM{home_ms} ; back to the row of zeros
Z(P35)
DWELL{settle}
P34=0
WHILE({register}!=0 AND P34<{looks})
P34=P34+1
DWELL{look}
ENDWHILE
IF({register}=0) I51=0 ; the table is off; what the register holds would stay added
IF(P45=P25) P44=1
ENDIF
CLOSE
"""


def _move(y: str, fed: str) -> str:
    return f"{{push@{fed}}}X(P11{{pushed}}):0{y} Z(P21+P18*{fed}):(P19)\n"


# The same in other words: a line that is reported by its text alone is then known by its number.
_BACK_ON_PATH = "{push@(P25-P49)}X(P11" + hold.LIFTED + "{pushed}):0{y} Z(P21+(P25-P49)*P18):(P19)\n"

_HELD_CUT = {
    "cut": _move(SPINDLE_STEP, "(P25-P49)"),
    "loop": hold.LOOP,
    "not_held": " AND {not_held}",
    "held": "+P49",
    "one_turn": hold.ONE_TURN,
    "fed": "(P25-P49)",
    "out_begins": hold.OUT,
}
"""The turns of a cut that can be held; only one whose spindle the program turns comes back to the same angle."""

_STEADY_CUT = dict.fromkeys(_HELD_CUT, "") | {"cut": _move("", "P25"), "fed": "P25"}


def _filled(template: str, pieces: dict[str, str]) -> str:
    for name, piece in pieces.items():
        template = template.replace(f"{{{name}}}", piece)
    return template


_SET_UP_TURNED = _SET_UP.replace("{spindle_words}", "y spindle, ").replace(
    "{spindle_values}",
    """\
P16={spindle_step} ; spindle counts in one segment
P17={spindle_speed} ; spindle speed, counts/s
P22={spindle_start} ; spindle at the start
P28=P22+{before} ; spindle at the first segment
""",
)

_OUT = (
    """\
P25=P25+{hold_out} P45=P45+{hold_out}
X(P20):0 Y(P28+P16*P25):(P17) Z(P29+P33*{approach}/3000):0
"""
    + hold.HELD.replace("{lift}", hold.LIFT.replace("{fed}", "P25-P49"))
    .replace("{enter}", hold.ENTER_ON_TABLE)
    .replace("{cut}", _BACK_ON_PATH)
    + """\
P30=P28+P16*P25
P29=P29+P33*{approach}/3000
"""
)

_TURNED = (
    _SET_UP_TURNED.replace("{push_begin}", "{no_hold}{push_begin}")
    + RUN_UP
    + _filled(_CUT, _HELD_CUT)
    + _OUT.replace("{out_ms}", "{approach}").replace("{y}", SPINDLE_STEP)
    + RUN_DOWN
    + _END
)

_TRIMMED = (
    _SET_UP_TURNED.replace("CLOSE\nOPEN PROG", TRIM_VALUES + "CLOSE\nOPEN PROG")
    + RUN_UP
    + TRIMMED_CUT
    + RUN_DOWN
    + _END
)

_FOLLOWED = (
    _SET_UP.replace("{spindle_words}", "").replace("{spindle_values}", "")
    + """\
PVT{approach} ; the tool goes to its mean depth, clear of the part
X(P11):0 Z(P21):0
"""
    + _filled(_CUT, _STEADY_CUT)
    + """\
P29=P29+P33*{approach}/3000
X(P20):0 Z(P29):0
"""
    + _END
)
