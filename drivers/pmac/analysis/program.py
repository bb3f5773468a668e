"""Check a program as a whole: what any program text makes a machine do, and the findings.

Besides its moves: its flow (endless loops, waits for a host, run-time errors), and its TA and TS as an operator
would change them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from drivers.pmac.analysis.explanation import (
    KEPT_ENOUGH,
    ZigZag,
    explain,
    find_zigzag,
    rounding_findings,
    timing_findings,
)
from drivers.pmac.analysis.findings import FindingCode, ProgramFinding, Sentence, Subject, Value, finding, moves
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis, analyse_moves
from drivers.pmac.analysis.start import StartPositions, start_counts, start_of
from drivers.pmac.analysis.synchronism import synchronism_findings
from drivers.pmac.analysis.tables import table_findings
from drivers.pmac.analysis.timeline import SAME_COUNTS, Timeline
from drivers.pmac.analysis.units import shown_length
from drivers.pmac.analysis.walk import LoopExit, WalkEnding, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import TableOrderError
from drivers.pmac.dialect import DIALECTS, FamilySetting
from drivers.pmac.language.evaluate import BY_ZERO, NO_VALUE, REMAINDER_BY_ZERO
from drivers.pmac.language.syntax import Number, Program, Set, Statement
from drivers.pmac.preprocessor import Include
from drivers.pmac.program_text import OnLine, ProgramText, RefusedLine, read_program
from drivers.pmac.requests import HomeRequest, TriggerRequest
from drivers.pmac.settings import settings_with
from profiles.findings import Severity, worst
from profiles.machine import MachineProfile

_ROUNDING = 1e-9


def _flow_findings(subject: Subject, refused: Iterable[RefusedLine]) -> list[ProgramFinding]:
    """Return hidden behaviour of a program, and the lines that the controller refuses."""
    walk = subject.walk
    findings = refused_findings(refused)
    if walk.error is not None:
        lines = (subject.place_of(walk.steps[-1].program, walk.steps[-1].line),)
        error, number = str(walk.error), int(walk.error.code)
        findings.append(finding(FindingCode.RUN_TIME_ERROR, lines, error=error, number=number))
    for each in walk.substitutes:
        place = subject.place_of(each.program, each.line) if each.program else each.line
        findings.append(_without_result(place, each.detail))
    findings += [_endless(subject, left) for left in walk.left]
    if walk.ending is WalkEnding.TOO_LONG:
        findings.append(finding(FindingCode.TOO_LONG, steps=len(walk.steps)))
    if not subject.moves:
        findings.append(finding(FindingCode.NO_MOTION))
    return findings


def _without_result(place: int, detail: str) -> ProgramFinding:
    if detail == BY_ZERO:
        return finding(FindingCode.DIVIDED_BY_ZERO, (place,), error=detail)
    what = "x%0" if detail == REMAINDER_BY_ZERO else detail.removesuffix(NO_VALUE)
    return finding(FindingCode.NO_RESULT, (place,), error=detail, what=what)


def refused_findings(refused: Iterable[RefusedLine]) -> list[ProgramFinding]:
    """Return the lines of a text that the controller refuses, as findings."""
    return [_line_refused_finding(line) for line in refused]


_ABSENT = (
    ("LEARN", "LEARN"),
    ("PRELUDE", "PRELUDE"),
    ("DISPLAY", r".*DISP(LAY)?[\d,.]*[IPQM]\d"),
    ("CC0 to CC3", r"CC[0-3]"),
    ("CCR", "CCR"),
    ("TSELECT", r"TSEL(ECT)?"),
    ("TINIT", "TINIT"),
    ("ADIS, AROT, IDIS, IROT", r"(A|I)(DIS|ROT)"),
    ("altered destination (!)", r"[A-CU-Z]*!"),
    ("rotary buffers (ROT)", r"((OPEN|DEF(INE)?|DEL(ETE)?)(BIN)?|)ROT(ARY)?(\d|$)"),
    ("compiled PLCs (PLCC)", r".*PLCC\d"),
    ("DEFINE of TBUF, TCOMP, BLCOMP, TRACE", r"DEF(INE)?(TBUF|TCOMP|BLCOMP|TRACE)"),
    ("LOCK, UNLOCK", r"(UN)?LOCK[\dP]"),
    ("SETPHASE", "SETPHASE"),
    ("further words of the MACRO ring", r"STN|MACRO(SLV|STASCII|MST|AUX|ASCII)|MS(\$\$\$|SAV)|MFLUSH"),
    ("TIME, TODAY, UPDATE", r"TIME=?|TODAY|UPDATE"),
    ("LIST LINK", "LISTLINK"),
)
_FOUND = re.compile(r", found (.+)$")


def absent_word(text: str, detail: str) -> str:
    """Return the word because of which a line was refused, "" where it is none of those.

    `detail` is the reason of the refusal: it ends with what was found where a word was expected.
    """
    found = _FOUND.search(detail)
    for part in (found[1] if found else "", text):
        typed = "".join(part.split()).upper()
        for name, pattern in _ABSENT:
            if re.match(pattern, typed):
                return name
    return ""


def _line_refused_finding(line: RefusedLine) -> ProgramFinding:
    values: dict[str, Value] = {"error": str(line.error), "number": int(line.error.code), "text": line.text}
    if isinstance(line.error, TableOrderError):
        return finding(
            FindingCode.TABLE_ORDER, (line.place,), **values, motor=line.error.motor, lower=line.error.lower
        )
    word = absent_word(line.text, line.error.detail)
    if word:
        return finding(FindingCode.WORD_ABSENT, (line.place,), **values, word=word)
    return finding(FindingCode.LINE_REFUSED, (line.place,), **values)


def _endless(subject: Subject, left: LoopExit) -> ProgramFinding:
    """Report a loop: one that moves is an endless cut; one that does not waits for an input."""
    loop, steps = left.circle.loop, subject.walk.steps
    first, last = (loop.first, loop.last) if loop is not None else (left.line, left.line)
    lines = (subject.place_of(subject.walk.number, first),)
    # The pass in which the flag is set is also completed.
    passes = sum(step.place == steps[left.step].place for step in steps[: left.step + 1])
    values: dict[str, Value] = {"passes": passes, "repeats": left.circle.period is not None}
    if not left.flags:
        return finding(FindingCode.ENDLESS_WITHOUT_FLAG, lines, **values)
    flags = ", ".join(f"{kind}{index}={value:g}" for (kind, index), value in left.flags.items())
    moving = any(first <= steps[move.step].main_line <= last for move in subject.moves)
    return finding(
        FindingCode.ENDLESS_LOOP if moving else FindingCode.WAITS_FOR_FLAG, lines, **values, flags=flags
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramCheck:
    """The behaviour of a program from `start`. The worst findings come first.

    `places` are the lines of the text, from 1, of the moves.
    """

    number: int
    start: StartPositions
    motors: tuple[int, ...]
    moves: tuple[MoveAnalysis, ...]
    places: tuple[int, ...]
    duration_ms: float
    findings: tuple[ProgramFinding, ...]
    explanation: tuple[Sentence, ...]

    @property
    def worst(self) -> Severity:
        """The worst severity found."""
        return worst(self.findings)


def check_program(
    text: str,
    machine: MachineProfile,
    ta_ms: float | None = None,
    ts_ms: float | None = None,
    start: Mapping[str, float] | None = None,
    include: Include | None = None,
    on_line: OnLine = lambda line: None,
) -> ProgramCheck:
    """Check a text on a machine; `ta_ms` and `ts_ms` replace those of the text.

    `start` are axis positions (user units); without them a comment of the text gives them, or all is at home.
    `include` returns the text of a file that the text includes, `on_line` reads a line outside of the buffers.

    Raises:
        PmacError: the controller refuses the program as a whole.
        DriverError: `program.start_axis`, `program.start_too_far`.
    """
    refused, dialect = list[RefusedLine](), DIALECTS[machine.controller.family]
    kinematic = dialect.kinematics is not None
    as_typed = read_program(text, refused, dialect.motor_count, include, kinematic=kinematic, on_line=on_line)
    read = _with_times(as_typed, ta_ms, ts_ms)
    # The axes of the machine, replaced by those of the text; each motor has one definition.
    own = () if read.undefines else read_definitions(machine.controller.axis_definitions)
    definitions = {definition.motor: definition for definition in (*own, *read.definitions)}.values()
    begins = start_of(text, definitions, start)
    walked = walk(
        read,
        _settings(machine, ta_ms, ts_ms),
        tuple(definitions),
        start_counts(definitions, begins),
        counts_per_turn={machine.spindle.motor: float(machine.spindle.counts_per_rev)},
        dialect=dialect,
    )
    timeline, place_of = Timeline(walked.pieces), partial(_place, read)
    moves = analyse_moves(walked, timeline)
    subject = Subject(machine=machine, walk=walked, timeline=timeline, moves=moves, place_of=place_of)
    zigzag = find_zigzag(subject)
    findings = [*_flow_findings(subject, refused), *_all_findings(subject, read, zigzag)]
    return ProgramCheck(
        number=read.number,
        start=begins,
        motors=walked.motors,
        moves=moves,
        places=tuple(place_of(move.program, move.line) for move in moves),
        duration_ms=timeline.ends_ms,
        findings=tuple(sorted(findings, key=lambda finding: finding.severity.rank, reverse=True)),
        explanation=explain(subject, zigzag),
    )


def path_findings(subject: Subject, zigzag: ZigZag | None) -> list[ProgramFinding]:
    """Return the problems of the motors' paths."""
    findings = [*_lost_strokes(subject), *_one_sided(subject, zigzag), *_straight_circles(subject)]
    # The end of a program is known only when it was followed to its end.
    return [*findings, *_end(subject)] if subject.walk.ending is WalkEnding.FINISHED else findings


def _lost_strokes(subject: Subject) -> list[ProgramFinding]:
    """Find moves that reverse short of both ends: for each commanded distance, the most frequent actual one."""
    grouped: dict[tuple[int, float], list[tuple[MoveAnalysis, MotorMove]]] = {}
    for before, move in pairwise(subject.moves):
        for index, motor in enumerate(move.motors):
            if motor.turns and before.motors[index].turns and before.blended:
                grouped.setdefault((index, _round_counts(abs(motor.commanded))), []).append((move, motor))
    findings = []
    for (index, stroke), found in grouped.items():
        made = [_round_counts(abs(motor.made)) for _, motor in found]
        usual = max(set(made), key=made.count)
        if stroke > SAME_COUNTS and usual < KEPT_ENOUGH * stroke:
            findings.append(_stroke_lost_finding(subject, index, stroke, usual, [move for move, _ in found]))
    return findings


def _stroke_lost_finding(
    subject: Subject, index: int, stroke: float, made: float, found: list[MoveAnalysis]
) -> ProgramFinding:
    motor = subject.walk.motors[index]
    return finding(
        FindingCode.STROKE_LOST,
        subject.lines(found),
        motor=motor,
        stroke_counts=stroke,
        made_counts=made,
        **shown_length(subject.machine, motor, stroke),
        made_length=shown_length(subject.machine, motor, made)["length"],
        kept_percent=100.0 * made / stroke,
        moves=len(found),
    )


def _one_sided(subject: Subject, zigzag: ZigZag | None) -> list[ProgramFinding]:
    """Find a zig-zag that starts from one of its ends: its middle is half a stroke off the starting point."""
    if zigzag is None or zigzag.index != subject.tool:
        return []
    first = zigzag.moves[0].motors[zigzag.index]
    values = {
        "begins_counts": zigzag.begins_at,
        "middle_counts": first.target - 0.5 * first.commanded,
        "deeper_um": subject.um(0.5 * first.commanded),
    }
    return [finding(FindingCode.ONE_SIDED, subject.lines(zigzag.moves), **values)]


def _straight_circles(subject: Subject) -> list[ProgramFinding]:
    """Find arcs that are made as LINEAR moves, because segmentation is off."""
    steps = subject.walk.steps
    found = [move for move in subject.moves if move.mode == "CIRCLE" and steps[move.step].segment_ms <= 0.0]
    if not found:
        return []
    variable = f"I{subject.walk.variables.dialect.index(FamilySetting.SEGMENT_MS)}"
    return [finding(FindingCode.CIRCLE_STRAIGHT, subject.lines(found), moves=len(found), variable=variable)]


def _end(subject: Subject) -> list[ProgramFinding]:
    """Check the tool's last move: positive is infeed, and after the cut only retraction is right."""
    tool = subject.tool
    if tool is None:
        return []
    return _plunge(subject, tool) or _left_deeper(subject, tool)


def _plunge(subject: Subject, tool: int) -> list[ProgramFinding]:
    commanded = [move for move in subject.moves if moves(move, tool)]
    if not subject.cut or commanded[-1].number <= subject.cut[-1].number:
        return []
    last = commanded[-1]
    motor = last.motors[tool]
    deepest = max(move.motors[tool].target for move in subject.cut)
    if motor.commanded <= 0.0 or motor.target <= deepest:
        return []
    per_mm = subject.machine.tool.counts_per_mm
    mm, deeper_mm = motor.commanded / per_mm, (motor.target - deepest) / per_mm
    return [finding(FindingCode.PLUNGE, subject.lines([last]), counts=motor.commanded, mm=mm, deeper_mm=deeper_mm)]


def _left_deeper(subject: Subject, tool: int) -> list[ProgramFinding]:
    """Find a tool that ends further in than it started, whichever motion did it."""
    walk = subject.walk
    deeper = walk.steps[-1].at[tool] - walk.start[tool]
    if deeper <= SAME_COUNTS:
        return []
    commanded = [move.step for move in subject.moves if moves(move, tool)]
    homed = [
        place
        for place, step in enumerate(walk.steps)
        if isinstance(step.request, TriggerRequest)
        or (isinstance(step.request, HomeRequest) and walk.motors[tool] in step.request.motors)
    ]
    last = walk.steps[max(commanded + homed)]
    lines = (subject.place_of(last.program, last.line),)
    return [finding(FindingCode.ENDS_DEEPER, lines, counts=deeper, mm=deeper / subject.machine.tool.counts_per_mm)]


def _round_counts(counts: float) -> float:
    """Return a distance without arithmetic rounding, so that like distances are equal."""
    return float(f"{counts:.9g}")


def limit_findings(subject: Subject) -> list[ProgramFinding]:
    """Return what exceeds a limit; 0 in a variable is no limit."""
    findings: list[ProgramFinding] = []
    for index, motor in enumerate(subject.walk.motors):
        findings += _position(subject, index, motor)
        findings += _velocity(subject, index, motor)
    return [*findings, *_tool(subject), *_spindle(subject), *_jaws(subject)]


def _position(subject: Subject, index: int, motor: int) -> list[ProgramFinding]:
    """Check Ix13 and Ix14, the software limits: the controller stops everything there."""
    lowest, highest = subject.timeline.extent(index, 0.0, subject.timeline.ends_ms)
    findings = []
    for number, reached, beyond in ((13, highest, 1.0), (14, lowest, -1.0)):
        limit = subject.setting(motor, number)
        if limit and beyond * (reached - limit) > _ROUNDING * abs(limit):
            first = [move for move in subject.moves if beyond * (move.motors[index].target - limit) > 0.0][:1]
            lines, name = subject.lines(first), f"I{motor}{number}"
            found = finding(
                FindingCode.BEYOND_LIMIT, lines, motor=motor, variable=name, counts=reached, limit=limit
            )
            findings.append(found)
    return findings


def _velocity(subject: Subject, index: int, motor: int) -> list[ProgramFinding]:
    """Check Ix16, which does not limit every mode."""
    limit = subject.setting(motor, 16)
    speeds = [(move.motors[index].peaks.velocity, move) for move in subject.moves if move.mode != "RAPID"]
    fast = [(speed, move) for speed, move in speeds if _over(speed, limit)]
    if not fast:
        return []
    most, lines = max(speed for speed, _ in fast), subject.lines(move for _, move in fast)
    variable = f"I{motor}16"
    return [finding(FindingCode.TOO_FAST, lines, motor=motor, variable=variable, counts_per_ms=most, limit=limit)]


def _tool(subject: Subject) -> list[ProgramFinding]:
    if subject.tool is None:
        return []
    tool, index = subject.machine.tool, subject.tool
    per_mm = tool.counts_per_mm

    def acceleration_m_per_s2(motor: MotorMove) -> float:
        return 1000.0 * motor.peaks.acceleration / per_mm

    def force_n(motor: MotorMove) -> float:
        speed_mm_per_s = 1000.0 * motor.peaks.velocity / per_mm
        damping_n = tool.damping_n_s_per_m * speed_mm_per_s / 1000.0
        return tool.moving_mass_kg * acceleration_m_per_s2(motor) + damping_n

    fastest = tool.encoder_max_acceleration_m_per_s2
    return [
        *_find_values_above(subject, index, FindingCode.ACCELERATION_OVER_ENCODER, acceleration_m_per_s2, fastest),
        *_find_values_above(subject, index, FindingCode.FORCE_OVER_DRIVE, force_n, tool.peak_force_n),
        *_travel(subject, index, per_mm, (tool.travel_min_mm, tool.travel_max_mm)),
    ]


def _spindle(subject: Subject) -> list[ProgramFinding]:
    if subject.spindle is None:
        return []
    spindle, index = subject.machine.spindle, subject.spindle

    def speed_rpm(motor: MotorMove) -> float:
        return subject.rpm(motor.peaks.velocity)

    def torque_n_m(motor: MotorMove) -> float:
        return spindle.inertia_kg_m2 * motor.peaks.acceleration / spindle.counts_per_rev * 1e6 * math.tau

    return [
        *_find_values_above(subject, index, FindingCode.SPEED_OVER_SPINDLE, speed_rpm, spindle.max_speed_rpm),
        *_find_values_above(subject, index, FindingCode.TORQUE_OVER_SPINDLE, torque_n_m, spindle.peak_torque_n_m),
    ]


def _jaws(subject: Subject) -> list[ProgramFinding]:
    """Check that the carriage with the tool on it stays clear of the jaws."""
    if subject.carriage is None:
        return []
    carriage = subject.machine.carriage
    nearest_mm = carriage.jaw_face_mm - carriage.jaw_clearance_mm
    limits = (carriage.travel_min_mm, min(nearest_mm, carriage.travel_max_mm))
    return _travel(subject, subject.carriage, carriage.counts_per_mm, limits)


def _travel(subject: Subject, index: int, per_mm: float, limits_mm: tuple[float, float]) -> list[ProgramFinding]:
    """Check the machine's mechanical ends, where the controller's limits do not come first."""
    findings = []
    motor, ends = subject.walk.motors[index], subject.timeline.extent(index, 0.0, subject.timeline.ends_ms)
    for limit_mm, reached, beyond in zip(limits_mm, ends, (-1.0, 1.0), strict=True):
        reached_mm = reached / per_mm
        guarded = subject.setting(motor, 13 if beyond > 0.0 else 14)
        caught = guarded and beyond * (reached - guarded) > 0.0
        if beyond * (reached_mm - limit_mm) > _ROUNDING and not caught:
            targets = ((move.motors[index].target / per_mm, move) for move in subject.moves)
            first = [move for target_mm, move in targets if beyond * (target_mm - limit_mm) > 0.0][:1]
            lines = subject.lines(first)
            findings.append(
                finding(FindingCode.BEYOND_TRAVEL, lines, motor=motor, mm=reached_mm, limit_mm=limit_mm)
            )
    return findings


def _find_values_above(
    subject: Subject, index: int, code: FindingCode, quantity: Callable[[MotorMove], float], limit: float
) -> list[ProgramFinding]:
    high = [move for move in subject.moves if _over(quantity(move.motors[index]), limit)]
    if not high:
        return []
    worst = max(quantity(move.motors[index]) for move in high)
    return [finding(code, subject.lines(high), motor=subject.walk.motors[index], value=worst, limit=limit)]


def _over(value: float, limit: float) -> bool:
    return 0.0 < limit < value * (1.0 - _ROUNDING)


def _all_findings(subject: Subject, text: ProgramText, zigzag: ZigZag | None) -> list[ProgramFinding]:
    """Return what the rules find in the moves and settings of a program."""
    found = rounding_findings(subject, text) + table_findings(subject, text) + limit_findings(subject)
    found += timing_findings(subject) + path_findings(subject, zigzag) + synchronism_findings(subject)
    return found


def _settings(machine: MachineProfile, ta_ms: float | None, ts_ms: float | None) -> dict[int, float]:
    """Return the I-variables; the times also apply to a program that names none."""
    dialect = DIALECTS[machine.controller.family]
    settings = settings_with(machine.controller.variables, dialect)
    for number, ms in ((87, ta_ms), (88, ts_ms)):
        if ms is not None:
            settings[dialect.system_index(1, number)] = float(ms)
    return settings


def _place(text: ProgramText, program: int, line: int) -> int:
    """Return the line of the text, from 1, of a line of a program."""
    places = text.places.get(program, ())
    return places[line] if line < len(places) else 0


def _with_times(text: ProgramText, ta_ms: float | None, ts_ms: float | None) -> ProgramText:
    """Return the programs with other values in their TA and TS words; None leaves them as they are."""
    times = {word: Number(float(ms)) for word, ms in (("TA", ta_ms), ("TS", ts_ms)) if ms is not None}

    def other(statement: Statement) -> Statement:
        if isinstance(statement, Set) and statement.word in times:
            return Set(statement.word, times[statement.word])
        return statement

    def changed(program: Program) -> Program:
        return tuple(tuple(other(statement) for statement in line) for line in program)

    subprograms = {number: changed(program) for number, program in text.subprograms.items()}
    return replace(text, program=changed(text.program), subprograms=subprograms)
