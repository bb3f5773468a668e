"""The position of the cut on the machine, in counts as the program uses them; the console's mark in its programs.

A controller keeps no comments, so a program that the console writes for a while and erases again begins with a
message in a branch that is never taken: a name, and for each line behind it three digits of the checksum up to
there. So whatever a lost link has left, in whole or in part, is known by it, whichever console wrote it; a program
of another host is not, nor one of ours that was changed.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.text import format_line, format_number
from drivers.pmac.programs import hold
from profiles.axis.stiffness import relaxation_ms
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError

APPROACH_MM = 0.5  # Approach distance before the part, in which the tool settles on its path

MOST_MOVES = 100_000
"""Maximum number of moves of a cut that are planned and checked; more would be hours at the lathe."""

END_FLAG = "M26"  # A host sets this to 1 to end a cut early, at the end of a turn; every program checks it

TURNS_CUT, FINISHED = "P43", "P44"
"""Progress variables of every program: the turns that it has begun, and 1 once it has reached its last line.

Both are 0 when it is loaded. A program that is ended from outside never reaches its last line, or does so with
fewer turns. Nor is it complete where P45, which counts its segments a second time, differs: it was resumed
elsewhere.
"""

END_MARKS = f"""\
{TURNS_CUT}=0 ; turns of the cut
{FINISHED}=0 ; 1 at the end of the program
P45=0 ; its segments, counted a second time
"""

SERVO = "servo"  # A spindle whose loop the controller closes; any other is only followed
ROUNDING_TURNS = 1e-6  # A cut that exceeds whole turns by less than this does not need another turn
_NEVER, _END = "IF(1=0)", "ENDIF"
_NAMED = re.compile(r'SEND"trilobe ((?:[0-9A-F]{3})*)"')
_DIGITS = 3


LATE_TURNS = 2.0
"""Behind the end of a band the push begins late rather than early: what is cut too deep there stays."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CutBand:
    """A band at the face of a blank that was cut before: its length, and the depth that is left of it, mm."""

    length_mm: float
    left_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CutSetup:
    """A job on a homed machine.

    `surface` is the tool position (counts) at which the tip touches the blank; the axis of the tool counts towards
    the work. `carriage_start` is clear of the part, `carriage_counts` the distance from there to the end of the
    cut, `carriage_middle` the middle of the cut. `spindle_start` is the spindle position when the program begins,
    in counts from its index. `watchdog` is a condition of the controller's language that has to hold for the cut
    to continue, such as that a host's timer has not run out; empty is without. In `relaxation_ms` the integrator
    takes over 63 % of a force on the tool, infinite without one; `land_turns` are the turns that cut a place. Over
    `recut_turns` behind the face the blank was cut before, to a fraction `recut_depth` of the depth.
    """

    surface: float
    retracted: float
    depth: float
    carriage_start: float
    carriage_counts: float
    carriage_per_turn: float
    carriage_middle: float
    spindle_start: float
    counts_per_turn: int
    tool_count_um: float
    relaxation_ms: float = math.inf
    land_turns: float = 1.0
    watchdog: str = ""
    recut_turns: float = 0.0
    recut_depth: float = 0.0

    @property
    def go_on(self) -> str:
        """The condition checked before each turn: no request to end the cut, and no watchdog timeout."""
        return f"{END_FLAG}=0" + (f" AND {self.watchdog}" if self.watchdog else "")

    @property
    def turns(self) -> float:
        """Turns from the start of the feed to the end of the cut."""
        return self.carriage_counts / self.carriage_per_turn

    @property
    def carriage_face(self) -> float:
        """Carriage position with the middle of the tool at the face of the part, counts."""
        return 2.0 * self.carriage_middle - (self.carriage_start + self.carriage_counts)

    @property
    def turns_clear(self) -> float:
        """Turns of the feed before the tool reaches the face of the part."""
        return (self.carriage_face - self.carriage_start) / self.carriage_per_turn

    @property
    def whole_turns(self) -> int:
        """The same in whole turns: a program ends its cut at the end of one."""
        return math.ceil(self.turns - ROUNDING_TURNS)


def cut_setup(
    job: Job,
    machine: MachineProfile,
    spindle_start: float = 0.0,
    watchdog: str = "",
    *,
    air_mm: float = 0.0,
    before: CutBand | None = None,
) -> CutSetup:
    """Place a job on a machine by the machine's own geometry: tool radius at home, jaw faces, overhang.

    An air cut is the same, with everything `air_mm` further out. `before` was cut of the blank already.
    """
    tool, carriage = machine.tool, machine.carriage
    surface = (tool.home_radius_mm - job.radius_mm - air_mm) * tool.counts_per_mm
    face_mm = carriage.jaw_face_mm - job.overhang_mm
    clear_mm = APPROACH_MM + 0.5 * tool.wiper_land_mm
    return CutSetup(
        surface=surface,
        retracted=surface - tool.retract_mm * tool.counts_per_mm,
        depth=job.depth_of_cut_mm * tool.counts_per_mm,
        carriage_start=(face_mm - clear_mm) * carriage.counts_per_mm,
        carriage_counts=(clear_mm + job.cut_length_mm) * carriage.counts_per_mm,
        carriage_middle=(face_mm + 0.5 * job.cut_length_mm) * carriage.counts_per_mm,
        carriage_per_turn=job.feed_mm_per_rev * carriage.counts_per_mm,
        spindle_start=spindle_start,
        counts_per_turn=machine.spindle.counts_per_rev,
        tool_count_um=tool.count_um,
        relaxation_ms=relaxation_ms(machine),
        land_turns=tool.wiper_land_mm / job.feed_mm_per_rev,
        watchdog=watchdog,
        recut_turns=0.0
        if before is None
        else (before.length_mm + 0.5 * tool.wiper_land_mm) / job.feed_mm_per_rev + LATE_TURNS,
        recut_depth=0.0 if before is None else before.left_mm / job.depth_of_cut_mm,
    )


def cut_values(job: Job, setup: CutSetup, segment_ms: int) -> dict[str, object]:
    """Return the values that the templates of every segmented program share."""
    return {
        "job": job.name,
        "rpm": format_number(job.spindle_speed_rpm),
        "out": format_number(setup.retracted),
        "z": format_number(setup.carriage_start),
        "turns": setup.whole_turns,
        "segment": segment_ms,
        "flag": END_FLAG,
        "end_marks": END_MARKS,
        "go_on": setup.go_on,
        "no_hold": hold.BEGIN,
        "not_held": hold.NOT_HELD,
        "most_held": hold.most_held(segment_ms),
    }


def refuse_endless(moves: float) -> None:
    """Refuse a cut with an unreasonable number of moves. Raises ProblemError: `program.too_long`."""
    if moves > MOST_MOVES:
        raise ProblemError(
            Problem(code="program.too_long", key="cut_length_mm", value=f"{moves:.3g}", limit=f"<= {MOST_MOVES}")
        )


def sign_program(text: str) -> str:
    """Return the text of one program, OPEN to CLOSE with lines before, with its signature behind its CLEAR."""
    before, clear, rest = text.rpartition("\nCLEAR\n")
    code = (line.partition(";")[0].strip() for line in rest.rpartition("CLOSE")[0].splitlines())
    body = [format_line(parse_line(line)) for line in code if line]
    name = f'SEND"trilobe {_checksums(body)}"'
    return "".join((before, clear, "\n".join((_NEVER, name, _END, rest))))


def is_signed(listing: Sequence[str]) -> bool:
    """Whether the listing of a program, in any form of I9, is one from `sign_program`, or its beginning."""
    try:
        lines = [format_line(parse_line(line)) for line in without_end(listing)]
    except PmacError:
        return False
    head, body = lines[:3], lines[3:]
    named = _NAMED.fullmatch(head[1]) if len(head) > 1 else None
    if named is None or head[0] != _NEVER:
        return head in ([], [_NEVER])  # ended before its name: too little to be anybody's
    known = _checksums(body)
    return named[1].startswith(known) and (not body or head[2] == _END)


def _checksums(lines: Sequence[str]) -> str:
    text = ("\n".join(lines[: count + 1]) for count in range(len(lines)))
    return "".join(f"{zlib.crc32(each.encode('ascii', 'replace')) % 16**_DIGITS:0{_DIGITS}X}" for each in text)
