"""The cut with the lobe in a compensation table: the program holds the depth and feeds, the table adds the lobe.

The carriage moves back to a row of zeros, where the table is switched on, and forward again; so the amplitude
grows with Z, clear of the part. In the end it returns there, and the table is switched off when its register reads
0: its value at that moment would stay added to the tool. In between the tool is on the lobe at any spindle speed,
and also at standstill.

Each row of the table runs over the spindle angle, the amplitude changes with Z. The rows are evenly spaced over
the whole travel of Z, so that no position rolls over into another one. Those before the part are zeros; from one
of them to the next the amplitude grows to its full value, clear of the part; after the cut they are zeros again.
The table holds the cam less its value at spindle zero; the program adds that constant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from drivers.pmac.compensation.table import PARTS_PER_COUNT, CompensationTable, TableDefinition, TableSource
from drivers.pmac.compensation.table_text import table_lines
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_number
from drivers.pmac.programs import hold
from drivers.pmac.programs.cam_trim import TRIM_VALUES, TRIMMED_CUT, trim_segment_ms, trim_values
from drivers.pmac.programs.push import with_push
from drivers.pmac.programs.pvt import HALF_RUN_UP_MS, RUN_DOWN, RUN_UP, SPINDLE_STEP
from drivers.pmac.programs.setup import SERVO, CutSetup, cut_values, refuse_endless
from profiles.compensations.path import PLACES_ALONG, LobedPath, chord_error, chord_scale
from profiles.job import Job
from profiles.lobe.moving_out import out_ms
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

PROGRAM_NUMBER = 3

SEGMENT_MS = 8  # Feed moves; each checks once for the end of a turn
Z_SPEED_MM_S = 10.0  # Carriage speed between the row of zeros and the part

Z_RAMP_MS = 100
SETTLE_MS = 200
LOOK_MS = 20
MOST_LOOKS = 25
"""Polls of the register, and the ms between them, until it reads 0; after that the table stays on."""

COMPENSATION = 69  # M-variable of a motor, Mx69, that the manuals suggest for its correction register
CHORD_LIMIT_UM = 0.05  # Permitted deviation of the linear interpolation from the sinusoid
ROW_LIMIT_UM = 0.1  # Permitted deviation of the linear interpolation from row to row
ROW_MM = 10.0  # Approximate Z distance over which the amplitude grows
ROWS_IN_FRONT = 2  # Least number of row spacings before the part: one of zeros, one in which the amplitude grows
LEAST_ROW_MM = 0.5  # A shorter spacing leaves no place to stand in the row of zeros
INSIDE_MM = 0.2  # Distance of the carriage from the last row of zeros while the table is switched


def correction_register(machine: MachineProfile) -> str:
    """Return the M-variable of the register that holds the correction of the tool."""
    return f"M{100 * machine.tool.motor + COMPENSATION}"


def register_definition(machine: MachineProfile, dialect: Dialect) -> str:
    """Return the line that points that variable at the register."""
    register = dialect.registers["compensation"]
    address = register.address + (machine.tool.motor - 1) * register.stride
    return f"{correction_register(machine)}->{register.space}:${address:X}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cam:
    """A table with the data that the program needs; positions in counts.

    `mean` is the program's tool position, the table's constant included. Up to `zero_z` the carriage is in a row
    of zeros, from `full_z` on the amplitude is full. `chord_error_um` is the error of the linear interpolation.
    `push_um` is that of the command.
    """

    table: CompensationTable
    mean: float
    zero_z: float
    full_z: float
    chord_error_um: float
    push_um: float = 0.0

    @property
    def bytes_to_send(self) -> int:
        """Length of the entries as text, each with its space or line end."""
        return sum(len(str(entry)) + 1 for entry in self.table.entries)


def make_cam(machine: MachineProfile, setup: CutSetup, command: LobedPath) -> Cam:
    """Return the table that makes the tool follow `command` (um from the surface, infeed) by the spindle's angle.

    Raises ProblemError: `program.no_zero_row`, there is no room before the part.
    """
    columns, per_mm = column_count(command), machine.carriage.counts_per_mm
    spacing, front, full, rows = _rows(machine, setup, command)
    definition = TableDefinition(
        motor=machine.tool.motor,
        sources=(
            TableSource(machine.spindle.motor, setup.counts_per_turn),
            TableSource(machine.carriage.motor, rows * spacing),
        ),
        target=machine.tool.motor,
        columns=columns,
        rows=rows,
    )
    past_mm = (spacing * np.arange(front, full + 1) - setup.carriage_middle) / per_mm
    held = float(_corners_um(command, columns, 0.0, 0.0)[0])
    added = np.zeros((rows + 1, columns + 1))
    # The program adds a constant; a row with harmonics of another amplitude has the difference.
    for row, place_mm in enumerate(past_mm.tolist(), start=front):
        added[row] = _corners_um(command, columns, place_mm, spacing / per_mm) - held
    entries = np.rint(PARTS_PER_COUNT * added / setup.tool_count_um).astype(int).ravel()
    return Cam(
        table=definition.fill_table([int(entry) for entry in entries[1:]]),
        mean=setup.surface + (command.mean_um + held) / setup.tool_count_um,
        zero_z=(front - 1) * spacing - INSIDE_MM * per_mm,
        full_z=front * spacing,
        chord_error_um=_chord_error_um(command, columns),
        push_um=command.push_um,
    )


def column_count(command: LobedPath) -> int:
    """Return the fewest columns, the same number for each lobe, that keep the chord error within its limit."""
    columns = 4 * max(command.powers_um())
    columns += -columns % command.lobes
    while _chord_error_um(command, columns) > CHORD_LIMIT_UM:
        columns += command.lobes
    return columns


def _chord_error_um(command: LobedPath, columns: int) -> float:
    return sum(
        float(np.abs(polyval(PLACES_ALONG, powers)).max()) * chord_error(columns / order)
        for order, powers in command.powers_um().items()
        if order
    )


def _corners_um(command: LobedPath, columns: int, past_mm: float, row_mm: float) -> NDArray[np.float64]:
    """Return what is added to the mean mid-cut at the columns of a turn, both ends included, in a row at a place.

    The harmonics are scaled up to compensate the chords.
    """
    angle = 2.0 * math.pi * np.arange(columns + 1) / columns
    s, row = past_mm / command.along.half_length_mm, row_mm / command.along.half_length_mm
    corners = np.full(columns + 1, -command.mean_um)
    for order, powers in command.powers_um().items():
        scale = chord_scale(columns / order) if order else 1.0
        corners += scale * np.real(_on_rows(powers, s, row) * np.exp(1j * order * angle))
        if order:
            corners += scale * command.along.beyond_um(order, np.degrees(angle), past_mm)
    return corners


def _row_mm(command: LobedPath) -> float:
    """Return the distance of rows between which straight lines are `ROW_LIMIT_UM` off the change along the cut.

    Over a distance d that is d^2 f'' / 8, of which `_on_rows` leaves half.
    """
    bent_um = [np.abs(polyval(PLACES_ALONG, polyder(powers, 2))) for powers in command.powers_um().values()]
    most_um = float(np.sum(bent_um, axis=0).max())
    return command.along.half_length_mm * math.sqrt(16.0 * ROW_LIMIT_UM / most_um) if most_um else math.inf


def _on_rows(powers: Sequence[complex], s: float, row: float) -> complex:
    """Return a polynomial in s at a row, so that straight lines from row to row are off to either side alike."""
    return complex(polyval(s, powers) - row**2 / 16.0 * polyval(s, polyder(powers, 2)))


def _rows(machine: MachineProfile, setup: CutSetup, command: LobedPath) -> tuple[int, int, int, int]:
    """Return the spacing in counts, the first and the last row of full amplitude, and the number of spacings.

    Raises ProblemError: `program.no_zero_row`.
    """
    carriage = machine.carriage
    row_mm = min(ROW_MM, _row_mm(command))
    front = max(ROWS_IN_FRONT, math.ceil(setup.carriage_start / (row_mm * carriage.counts_per_mm) - 0.5))
    spacing = math.floor(setup.carriage_start / front)
    least = LEAST_ROW_MM * carriage.counts_per_mm
    if spacing < least:
        here_mm = setup.carriage_start / carriage.counts_per_mm
        value, limit = f"{here_mm:.2f} mm", f">= {ROWS_IN_FRONT * LEAST_ROW_MM:g} mm"
        raise ProblemError(Problem(code="program.no_zero_row", key="overhang_mm", value=value, limit=limit))
    # The carriage keeps feeding for some turns while the tool retracts.
    end = setup.carriage_start + setup.carriage_counts + setup.carriage_per_turn
    full = math.ceil(end / spacing) + 1
    travel = (carriage.travel_max_mm - carriage.travel_min_mm) * carriage.counts_per_mm
    return spacing, front, full, max(full + 1, math.ceil(travel / spacing) + 1)


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
    approach_ms = math.ceil(out_ms(way_mm))
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


def _fill_template(template: str, pieces: dict[str, str]) -> str:
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
    + _fill_template(_CUT, _HELD_CUT)
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
    + _fill_template(_CUT, _STEADY_CUT)
    + """\
P29=P29+P33*{approach}/3000
X(P20):0 Z(P29):0
"""
    + _END
)
