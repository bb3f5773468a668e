"""Findings about the compensation tables of a text, and about the instants at which I51 switches them.

The correction jumps when I51 goes to 1: from the value in its register, zero at first or whatever the last I51 = 0
left in it, to the tables' value at the positions of their sources. The controller calculates up to two moves
ahead, so a moving source may be anywhere on them; one that the program does not move may be anywhere at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from drivers.pmac.analysis.findings import FindingCode, ProgramFinding, Subject, Value, finding
from drivers.pmac.analysis.timeline import SAME_COUNTS
from drivers.pmac.analysis.units import shown_length, unit_of
from drivers.pmac.analysis.watched_variables import COMPENSATION
from drivers.pmac.compensation.table import PARTS_PER_COUNT, CompensationTable, Whereabouts, correction_range
from drivers.pmac.language.evaluate import evaluate
from drivers.pmac.language.syntax import Assign, VariableKind
from drivers.pmac.program_text import ProgramText
from drivers.pmac.requests import CircleRequest, HomeRequest, LinearRequest, PvtRequest, SplineRequest

MOST_SWITCHES = 200
"""Maximum number of I51 changes that are checked: each may cost a walk through the whole of every table."""

_BLENDED = LinearRequest | CircleRequest | SplineRequest | PvtRequest
"""Requests during which the controller calculates ahead."""

_Range = tuple[float, float]  # The least and the greatest possible correction, counts


@dataclass(frozen=True, slots=True, kw_only=True)
class _Switching:
    """I51 goes `on` or off, before step number `step`, by line `place` of the file."""

    step: int
    on: bool
    place: int


def table_findings(subject: Subject, text: ProgramText) -> list[ProgramFinding]:
    """Return the problems of a text's tables, and the steps that they give their targets."""
    findings: list[ProgramFinding] = []
    complete: list[CompensationTable] = []
    for sent in text.tables:
        table, motor = sent.table, sent.definition.motor
        if table is None:
            entries, wanted = len(sent.entries), sent.definition.entry_count
            findings.append(
                finding(FindingCode.TABLE_UNFILLED, (sent.place,), motor=motor, entries=entries, wanted=wanted)
            )
            continue
        complete.append(table)
        # The manuals require a correction of zero at the source's zero.
        if not table.definition.rows and table.entries[-1]:
            target, entry = sent.definition.target, table.entries[-1]
            values = _length(subject, target, entry / PARTS_PER_COUNT)
            lines = (sent.last_place,)
            findings.append(
                finding(FindingCode.TABLE_LAST_ENTRY, lines, motor=motor, target=target, entry=entry, **values)
            )
    if complete:
        findings += _throws(subject, complete, _switchings(subject, text)[:MOST_SWITCHES])
    return findings


def _length(subject: Subject, motor: int, counts: float) -> dict[str, Value]:
    return {"counts": counts, **shown_length(subject.machine, motor, counts)}


def _switchings(subject: Subject, text: ProgramText) -> list[_Switching]:
    """Return every change of I51, beginning with the tables that are on before the program starts."""
    walk = subject.walk
    found = []
    if walk.compensated:
        place = max(_setting_place(subject, text), *(sent.last_place for sent in text.tables))
        found.append(_Switching(step=0, on=True, place=place))
    for switch in walk.switches:
        place = subject.place_of(switch.program, switch.line)
        found.append(_Switching(step=switch.step, on=switch.on, place=place))
    return found


def _setting_place(subject: Subject, text: ProgramText) -> int:
    """Return the line that sets I51 before the program; 0 where the machine does."""
    places = [
        place
        for place, line in zip(text.setting_places, text.settings, strict=True)
        for statement in line
        if isinstance(statement, Assign)
        and statement.target.kind is VariableKind.I
        and int(evaluate(statement.target.index, subject.walk.variables)) == COMPENSATION
    ]
    return places[-1] if places else 0


def _throws(
    subject: Subject, tables: Sequence[CompensationTable], switchings: Iterable[_Switching]
) -> list[ProgramFinding]:
    """Return, for each target and line, the greatest step."""
    moved = _find_moved_motors(subject)
    held: Mapping[int, _Range] = {}
    worst: dict[tuple[int, int], float] = {}
    for switching in switchings:
        now: dict[int, _Range] = {}
        for table in tables:
            sources = table.definition.sources
            low, high = correction_range(
                table, [_whereabouts(subject, source.motor, switching.step, moved) for source in sources]
            )
            below, above = now.get(table.definition.target, (0.0, 0.0))
            now[table.definition.target] = (below + low, above + high)
        if not switching.on:
            held = now
            continue
        for target, (low, high) in now.items():
            held_low, held_high = held.get(target, (0.0, 0.0))
            key = (target, switching.place)
            worst[key] = max(worst.get(key, 0.0), abs(high - held_low), abs(low - held_high))
    findings = []
    for (target, place), counts in worst.items():
        if counts * PARTS_PER_COUNT >= 1.0:
            known = unit_of(subject.machine, target) is not None
            code = FindingCode.TABLE_THROWS if known else FindingCode.TABLE_THROWS_OTHER
            findings.append(finding(code, (place,), motor=target, **_length(subject, target, counts)))
    return findings


def _whereabouts(subject: Subject, motor: int, step: int, moved: frozenset[int]) -> Whereabouts:
    """Return the possible motor positions when a line before a step is calculated."""
    walk = subject.walk
    if motor not in moved:
        return None
    index = walk.motors.index(motor)
    before = walk.steps[:step]
    if not before:
        return walk.start[index]
    if not isinstance(before[-1].request, _BLENDED):
        return before[-1].at[index]
    first = before[-2] if len(before) > 1 and isinstance(before[-2].request, _BLENDED) else before[-1]
    following = walk.steps[step] if step < len(walk.steps) else before[-1]
    # The ramp into a move ends the one before it.
    low, high = subject.timeline.extent(index, first.ramp_begins_ms(), following.ramp_begins_ms())
    return high if high - low <= SAME_COUNTS else (low, high)


def _find_moved_motors(subject: Subject) -> frozenset[int]:
    """Return the motors whose position the program determines: those that it moves or homes."""
    walk, timeline = subject.walk, subject.timeline
    moved = {
        motor for step in walk.steps if isinstance(step.request, HomeRequest) for motor in step.request.motors
    }
    for index, motor in enumerate(walk.motors):
        low, high = timeline.extent(index, 0.0, timeline.ends_ms)
        if high - low > SAME_COUNTS:
            moved.add(motor)
    return frozenset(moved & set(walk.motors))
