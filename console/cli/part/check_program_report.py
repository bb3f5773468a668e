"""Checked program for people and for JSON: its summary, its moves, its findings, and its explanation."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from console.cli.output import fields_of
from console.text.catalogue import Catalogue
from console.text.checks import MARKS
from console.text.columns import table, wrap_text
from drivers.pmac.analysis.findings import ProgramFinding, Sentence, Value
from drivers.pmac.analysis.moves import Fold, MotorMove, MoveAnalysis, fold
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.start import StartPositions, StartSource
from drivers.pmac.analysis.timeline import NOTHING, SAME_COUNTS
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.preprocessor import LineNumber
from profiles.files import printable
from profiles.findings import Severity
from profiles.machine import MachineProfile

WIDTH = 80
MOST_RANGES = 4
"""Line ranges that a finding lists; --json has them all."""

_LEVELS = {Severity.REFUSAL: "fault", Severity.WARNING: "warning", Severity.NOTICE: "notice"}
"""JSON names of the severities in a program."""
Row = tuple[str, ...]

MOST_ROWS = 40
"""Rows of a table; --json has every move."""

_NOTHING = "-"

_WAYS = ("line", "times", "ta", "ts", "tm", "motor", "told", "made", "reached")
_PEAKS = ("line", "times", "motor", "velocity", "in_units", "acceleration", "jerk")

_DECIMALS = 9
"""Decimals of a number too small for the requested digits; what is still smaller is 0."""


def program_fields(
    options: Namespace, machine: MachineProfile, checked: ProgramCheck, text: Catalogue
) -> dict[str, object]:
    """Return the program with every move, finding and sentence: counts and ms, also in the units of the axes."""
    return {
        "file": options.file,
        "machine": machine.name,
        "program": checked.number,
        "start": {"source": checked.start.source.value, "positions": dict(checked.start.positions)},
        "ta_ms": options.ta_ms,
        "ts_ms": options.ts_ms,
        "duration_ms": checked.duration_ms,
        "moves": [_move(machine, move, place) for move, place in zip(checked.moves, checked.places, strict=True)],
        "findings": finding_fields(checked.findings, text),
        "explanation": [
            {"code": s.code.value, "values": dict(s.values), "text": _format_explanation(s, text)}
            for s in checked.explanation
        ],
    }


def _move(machine: MachineProfile, move: MoveAnalysis, place: int) -> dict[str, object]:
    return {
        "line": place,
        **fields_of(move, "mode", "by_move_time"),
        "commanded": asdict(move.asked),
        "effective": asdict(move.used),
        **fields_of(move, "begins_ms", "ends_ms", "blended"),
        "motors": [_motor(machine, motor) for motor in move.motors],
    }


def _motor(machine: MachineProfile, motor: MotorMove) -> dict[str, object]:
    peaks, unit = motor.peaks, unit_of(machine, motor.motor)
    lengths = fields_of(motor, "target", "commanded", "reached", "made", "lost")
    fields: dict[str, object] = {
        "motor": motor.motor,
        **{f"{name}_counts": counts for name, counts in lengths.items()},
        "turns": motor.turns,
        "velocity_counts_per_ms": peaks.velocity,
        "acceleration_counts_per_ms2": peaks.acceleration,
        "jerk_counts_per_ms3": peaks.jerk,
    }
    if unit is None:
        return fields
    in_units = {
        **{f"{name}_{unit.name}": counts * unit.per_count for name, counts in lengths.items()},
        f"velocity_{unit.velocity_unit}": peaks.velocity * unit.velocity,
        f"acceleration_{unit.acceleration_unit}": peaks.acceleration * unit.acceleration,
        f"jerk_{unit.jerk_unit}": None if peaks.jerk is None else peaks.jerk * unit.jerk,
    }
    return fields | {key.replace("/", "_per_"): value for key, value in in_units.items()}


class PlainNumber(float):
    """Number for people at a machine: its `g` format writes out what would get an exponent."""

    def __format__(self, spec: str) -> str:
        """Return the number in that format; a large one keeps all digits before the point."""
        shown = super().__format__(spec)
        if "e" not in shown:
            return shown
        sign = "+" if spec.startswith("+") else ""
        if "e+" in shown:
            return super().__format__(f"{sign}.0f")
        digits = super().__format__(f"{sign}.{_DECIMALS}f").rstrip("0").rstrip(".")
        return "0" if digits in ("0", "-0", "+0") else digits


def move_tables(machine: MachineProfile, checked: ProgramCheck, text: Catalogue) -> tuple[list[str], bool]:
    """Return the table of times and distances, and that of the peaks; and whether they are complete.

    Rows beyond `MOST_ROWS` are counted.
    """
    folds = fold(checked.moves)
    still: list[Row] = [(_NOTHING,) * 4]
    ways, more_ways = _limit_rows(_rows(checked, folds, _changed_times, _way, still))
    peaks, more_peaks = _limit_rows(_rows(checked, folds, lambda _: (), lambda motor: _peak(machine, motor), []))
    lines = [
        *table([_titles(_WAYS, text), *ways], numeric=(0, 1, 2, 3, 4, 6, 7, 8)),
        *_left_out(more_ways, text),
        "",
        *table([_titles(_PEAKS, text), *peaks], numeric=(0, 1, 3, 4, 5, 6)),
        *_left_out(more_peaks, text),
    ]
    return lines, not (more_ways or more_peaks)


def _titles(names: Sequence[str], text: Catalogue) -> Row:
    return tuple(text(f"check.column.{name}") for name in names)


def _left_out(rows: int, text: Catalogue) -> list[str]:
    return [text("check.left_out", count=rows)] if rows else []


def _limit_rows(moves: Iterator[list[Row]]) -> tuple[list[Row], int]:
    """Return the rows of the first moves, each with all of its rows, and how many rows are left out."""
    shown: list[Row] = []
    left_out = 0
    for rows in moves:
        if left_out or (shown and len(shown) + len(rows) > MOST_ROWS):
            left_out += len(rows)
        else:
            shown += rows
    return shown, left_out


def _rows(
    checked: ProgramCheck,
    folds: Sequence[Fold],
    of_move: Callable[[MoveAnalysis], Row],
    of_motor: Callable[[MotorMove], Row],
    still: list[Row],
) -> Iterator[list[Row]]:
    """Yield the rows of each move: one for each motor that it commands, or that moves in it; `still` for none."""
    for folded in folds:
        times = f"x {folded.times}" if folded.times > 1 else ""
        for move in folded.moves:
            head = (str(checked.places[move.number]), times, *of_move(move))
            moving = [m for m in move.motors if abs(m.commanded) > SAME_COUNTS or abs(m.made) > SAME_COUNTS]
            rows = [of_motor(motor) for motor in moving] or still
            yield [(("",) * len(head) if place else head) + row for place, row in enumerate(rows)]


def _changed_times(move: MoveAnalysis) -> Row:
    asked, used = move.asked, move.used
    pairs = ((asked.ta_ms, used.ta_ms), (asked.ts_ms, used.ts_ms), (asked.tm_ms, used.tm_ms))
    shown = [(_number(asked_ms), _number(used_ms)) for asked_ms, used_ms in pairs]
    return tuple(one if one == other else f"{one}>{other}" for one, other in shown)


def _way(motor: MotorMove) -> Row:
    return f"#{motor.motor}", _counts(motor.commanded), _counts(motor.made), _counts(motor.reached)


def _peak(machine: MachineProfile, motor: MotorMove) -> Row:
    unit, peaks = unit_of(machine, motor.motor), motor.peaks
    acceleration = (1.0, "c/ms2") if unit is None else (unit.acceleration, unit.acceleration_unit)
    jerk = (1.0, "c/ms3") if unit is None else (unit.jerk, unit.jerk_unit)
    return (
        f"#{motor.motor}",
        _number(peaks.velocity),
        _NOTHING if unit is None else _quantity(peaks.velocity, unit.velocity, unit.velocity_unit),
        _quantity(peaks.acceleration, *acceleration),
        _NOTHING if peaks.jerk is None else _quantity(peaks.jerk, *jerk),
    )


def _quantity(counts: float, per_count: float, unit: str) -> str:
    """Return a quantity in its unit; a value within the rounding of counts is 0."""
    return f"{_number(counts * per_count if abs(counts) > NOTHING else 0.0)} {unit}"


def _counts(value: float) -> str:
    return _number(value if abs(value) > SAME_COUNTS else 0.0)


def _number(value: float) -> str:
    """Return a number in five digits, without an exponent."""
    return f"{PlainNumber(value):.5g}"


def program_lines(
    options: Namespace, machine: MachineProfile, checked: ProgramCheck, text: Catalogue
) -> list[str]:
    """Return the head, the tables of the moves and the findings; these come first where a table is cut."""
    facts = text(
        "check.head",
        file=printable(Path(options.file).name),
        number=checked.number,
        machine=machine.name,
        duration=checked.duration_ms / 1000.0,
    )
    head = [*wrap_text(facts, WIDTH), *wrap_text(_start(checked.start, text), WIDTH), ""]
    judged = _describe_check(checked, text)
    if not checked.moves:
        return [*head, *judged]
    tables, whole = move_tables(machine, checked, text)
    # The first screen of a long text must show what matters.
    return [*head, *tables, "", *judged] if whole else [*head, *judged, "", *tables]


def _start(start: StartPositions, text: Catalogue) -> str:
    if start.source is StartSource.HOME:
        return text("check.start.home")
    if start.source is StartSource.OPERATOR:
        return text("check.start.operator", place=str(start))
    return text("check.start.comment", place=str(start), line=start.line)


def _describe_check(checked: ProgramCheck, text: Catalogue) -> list[str]:
    lines = finding_lines(checked.findings, text) or [f"✓ {text('check.clean')}"]
    if checked.explanation:
        explained = " ".join(_format_explanation(sentence, text) for sentence in checked.explanation)
        lines += ["", *wrap_text(explained, WIDTH)]
    return lines


def finding_lines(findings: Iterable[ProgramFinding], text: Catalogue) -> list[str]:
    """Return findings as sentences, each with its mark; long ones continue below."""
    lines: list[str] = []
    for finding in findings:
        first, *others = wrap_text(finding_sentence(finding, text), WIDTH - 2)
        lines += [f"{MARKS[finding.severity]} {first}", *(f"  {line}" for line in others)]
    return lines


def finding_fields(findings: Iterable[ProgramFinding], text: Catalogue) -> list[dict[str, object]]:
    """Return findings for JSON."""
    return [
        {
            "level": _LEVELS[finding.severity],
            "code": finding.code.value,
            "lines": list(finding.lines),
            "included": [_source(line) for line in finding.lines if _source(line)],
            "values": dict(finding.values),
            "text": finding_sentence(finding, text),
        }
        for finding in findings
    ]


def finding_sentence(finding: ProgramFinding, text: Catalogue) -> str:
    """Return a finding as a sentence, with the lines of the program that it is about."""
    sentence = text(f"check.finding.{finding.code}", **_printable_values(finding.values))
    if not finding.lines:
        return sentence
    key = "check.line" if len(finding.lines) == 1 else "check.lines"
    return f"{text(key, lines=_places(finding.lines, text))}: {sentence}"


def _places(lines: Sequence[int], text: Catalogue) -> str:
    """Return line numbers, consecutive ones as a range, up to a limit; those of included files with their own."""
    ranges: list[tuple[int, int]] = []
    for line in lines:
        if ranges and line == ranges[-1][1] + 1 and not (_source(line) or _source(ranges[-1][1])):
            ranges[-1] = (ranges[-1][0], line)
        else:
            ranges.append((line, line))
    shown = [_range(first, last, text) for first, last in ranges[:MOST_RANGES]]
    return ", ".join([*shown, "..."] if len(ranges) > MOST_RANGES else shown)


def _range(first: int, last: int, text: Catalogue) -> str:
    source = printable(_source(first))
    place = text("check.place", line=f"{first:d}-{last:d}" if last > first else f"{first:d}")
    return f"{place} ({source})" if source else place


def _source(line: int) -> str:
    """Return where a line of an included file is, "" for one of the text itself."""
    return line.source if isinstance(line, LineNumber) else ""


def _format_explanation(sentence: Sentence, text: Catalogue) -> str:
    return text(f"check.said.{sentence.code}", **_printable_values(sentence.values))


def _printable_values(values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: PlainNumber(value) if isinstance(value, float) else value for name, value in values.items()}
