"""Check a program as a whole: what any program text makes a machine do, and the findings.

Besides its moves: its flow (endless loops, waits for a host, run-time errors), and its TA and TS as an operator
would change them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from drivers.pmac.analysis.explanation import ZigZag, explain, find_zigzag
from drivers.pmac.analysis.findings import Code, ProgramFinding, Sentence, Value, finding
from drivers.pmac.analysis.limits import limit_findings
from drivers.pmac.analysis.moves import MoveAnalysis, analyse_moves
from drivers.pmac.analysis.path import path_findings
from drivers.pmac.analysis.start import Start, start_counts, start_of
from drivers.pmac.analysis.subject import Subject
from drivers.pmac.analysis.synchronism import synchronism_findings
from drivers.pmac.analysis.tables import table_findings
from drivers.pmac.analysis.timeline import Timeline
from drivers.pmac.analysis.timing import rounding_findings, timing_findings
from drivers.pmac.analysis.walk import Ending, Left, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.compensation.table import TableOrderError
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.language.arithmetic import BY_ZERO, NO_VALUE, REMAINDER_BY_ZERO
from drivers.pmac.language.syntax import Number, Program, Set, Statement
from drivers.pmac.preprocessor import Include
from drivers.pmac.program_text import OnLine, ProgramText, RefusedLine, read_program
from drivers.pmac.settings import settings_with
from profiles.findings import Severity, worst
from profiles.machine import MachineProfile


def _flow_findings(subject: Subject, refused: Iterable[RefusedLine]) -> list[ProgramFinding]:
    """Return hidden behaviour of a program, and the lines that the controller refuses."""
    walk = subject.walk
    findings = refused_findings(refused)
    if walk.error is not None:
        lines = (subject.place_of(walk.steps[-1].program, walk.steps[-1].line),)
        error, number = str(walk.error), int(walk.error.code)
        findings.append(finding(Code.RUN_TIME_ERROR, lines, error=error, number=number))
    for each in walk.substitutes:
        place = subject.place_of(each.program, each.line) if each.program else each.line
        findings.append(_without_result(place, each.detail))
    findings += [_endless(subject, left) for left in walk.left]
    if walk.ending is Ending.TOO_LONG:
        findings.append(finding(Code.TOO_LONG, steps=len(walk.steps)))
    if not subject.moves:
        findings.append(finding(Code.NO_MOTION))
    return findings


def _without_result(place: int, detail: str) -> ProgramFinding:
    if detail == BY_ZERO:
        return finding(Code.DIVIDED_BY_ZERO, (place,), error=detail)
    what = "x%0" if detail == REMAINDER_BY_ZERO else detail.removesuffix(NO_VALUE)
    return finding(Code.NO_RESULT, (place,), error=detail, what=what)


def refused_findings(refused: Iterable[RefusedLine]) -> list[ProgramFinding]:
    """Return the lines of a text that the controller refuses, as findings."""
    return [_refused(line) for line in refused]


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


def _refused(line: RefusedLine) -> ProgramFinding:
    values: dict[str, Value] = {"error": str(line.error), "number": int(line.error.code), "text": line.text}
    if isinstance(line.error, TableOrderError):
        return finding(Code.TABLE_ORDER, (line.place,), **values, motor=line.error.motor, lower=line.error.lower)
    word = absent_word(line.text, line.error.detail)
    if word:
        return finding(Code.WORD_ABSENT, (line.place,), **values, word=word)
    return finding(Code.LINE_REFUSED, (line.place,), **values)


def _endless(subject: Subject, left: Left) -> ProgramFinding:
    """Report a loop: one that moves is an endless cut; one that does not waits for an input."""
    loop, steps = left.circle.loop, subject.walk.steps
    first, last = (loop.first, loop.last) if loop is not None else (left.line, left.line)
    lines = (subject.place_of(subject.walk.number, first),)
    # The pass in which the flag is set is also completed.
    passes = sum(step.place == steps[left.step].place for step in steps[: left.step + 1])
    values: dict[str, Value] = {"passes": passes, "repeats": left.circle.period is not None}
    if not left.flags:
        return finding(Code.ENDLESS_WITHOUT_FLAG, lines, **values)
    flags = ", ".join(f"{kind}{index}={value:g}" for (kind, index), value in left.flags.items())
    moving = any(first <= steps[move.step].main_line <= last for move in subject.moves)
    return finding(Code.ENDLESS_LOOP if moving else Code.WAITS_FOR_FLAG, lines, **values, flags=flags)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramCheck:
    """The behaviour of a program from `start`. The worst findings come first.

    `places` are the lines of the text, from 1, of the moves.
    """

    number: int
    start: Start
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
