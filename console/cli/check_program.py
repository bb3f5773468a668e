"""`console check-program`: what a controller program will really do, move by move, before it is sent."""

from __future__ import annotations

import codecs
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

from console.cli.library import profile_of
from console.cli.move_table import move_tables
from console.cli.output import MARKS, PlainNumber, print_json
from console.text.catalogue import Catalogue
from console.text.columns import broken
from drivers.errors import DriverError
from drivers.pmac.analysis.findings import ProgramFinding, Sentence, Value
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.analysis.start import Source, Start
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.language.errors import PmacError
from drivers.pmac.trajectory.linear import Timing
from profiles.files import printable, read_regular_file
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import Problem

WIDTH = 80
CAP_BYTES = 1_000_000
"""As much program text as a controller keeps; each move costs a kilobyte while it is checked."""
MOST_RANGES = 4
"""Places that a finding names in its line; --json has them all."""

_MARKS_OF_ENCODINGS = (
    ("UTF-32", codecs.BOM_UTF32_LE),  # begins as UTF-16 does
    ("UTF-32", codecs.BOM_UTF32_BE),
    ("UTF-16", codecs.BOM_UTF16_LE),
    ("UTF-16", codecs.BOM_UTF16_BE),
)

_LEVELS = {Severity.REFUSAL: "fault", Severity.WARNING: "warning", Severity.NOTICE: "notice"}
"""How the JSON of a program names a severity."""


def main(options: Namespace, text: Catalogue) -> int:
    """Print what a program does; 1 when the controller or the machine would not put up with it."""
    machine = profile_of(options).machine
    checked = _checked(options, machine)
    if options.json:
        print_json(_fields(options, machine, checked, text))
    else:
        print("\n".join(_lines(options, machine, checked, text)))
    return 1 if checked.worst is Severity.REFUSAL else 0


def _checked(options: Namespace, machine: MachineProfile) -> ProgramCheck:
    """Read the file and check it.

    Raises:
        ProblemError: `file.unreadable`, `file.too_large`; `program.encoding`; `program.refused`, there is nothing
            to look at; `program.start_axis`, `program.start_too_far`.
    """
    content = read_regular_file(Path(options.file), cap_bytes=CAP_BYTES)
    encoding = _wide_encoding(content)
    if encoding is not None:
        raise DriverError(Problem(code="program.encoding", where=printable(options.file), value=encoding))
    # What is no UTF-8 stays a character that the controller does not take; in a comment it does no harm.
    text = content.decode("utf-8-sig", "replace")
    try:
        return check_program(text, machine, options.ta_ms, options.ts_ms, options.start)
    except PmacError as error:
        problem = Problem(code="program.refused", where=printable(options.file), value=str(error))
        raise DriverError(problem) from error


def _wide_encoding(content: bytes) -> str | None:
    """Return the name of an encoding with several bytes for each character of a program; None for all others."""
    for encoding, mark in _MARKS_OF_ENCODINGS:
        if content.startswith(mark):
            return encoding
    # No program has a NUL; what is ASCII has one in every second byte there, and none in the others.
    empty, other = sorted((content[place::2].count(0) for place in (0, 1)), reverse=True)
    return "UTF-16" if empty > len(content) // 4 and not other else None


def _lines(options: Namespace, machine: MachineProfile, checked: ProgramCheck, text: Catalogue) -> list[str]:
    facts = text(
        "check.head",
        file=printable(Path(options.file).name),
        number=checked.number,
        machine=machine.name,
        duration=checked.duration_ms / 1000.0,
    )
    head = [*broken(facts, WIDTH), *broken(_start(checked.start, text), WIDTH), ""]
    judged = _judged(checked, text)
    if not checked.moves:
        return [*head, *judged]
    tables = move_tables(machine, checked, text)
    # Who reads the first screen of a long text shall have read what matters.
    return [*head, *tables.lines, "", *judged] if tables.whole else [*head, *judged, "", *tables.lines]


def _start(start: Start, text: Catalogue) -> str:
    if start.source is Source.HOME:
        return text("check.start.home")
    if start.source is Source.OPERATOR:
        return text("check.start.operator", place=str(start))
    return text("check.start.comment", place=str(start), line=start.line)


def _judged(checked: ProgramCheck, text: Catalogue) -> list[str]:
    """Return the findings, then the explanation."""
    lines: list[str] = []
    for finding in checked.findings:
        lines += _item(f"{MARKS[finding.severity]} ", _finding(finding, text))
    if not checked.findings:
        lines += _item("✓ ", text("check.clean"))
    if checked.explanation:
        lines += ["", *broken(" ".join(_said(sentence, text) for sentence in checked.explanation), WIDTH)]
    return lines


def _item(mark: str, sentence: str) -> list[str]:
    first, *others = broken(sentence, WIDTH - len(mark))
    return [mark + first, *(" " * len(mark) + line for line in others)]


def _finding(finding: ProgramFinding, text: Catalogue) -> str:
    sentence = text(f"check.finding.{finding.code}", **_shown(finding.values))
    if not finding.lines:
        return sentence
    key = "check.line" if len(finding.lines) == 1 else "check.lines"
    return f"{text(key, lines=_places(finding.lines))}: {sentence}"


def _places(lines: Sequence[int]) -> str:
    """Return line numbers, those that follow each other as a range, and not too many of them."""
    ranges: list[tuple[int, int]] = []
    for line in lines:
        if ranges and line == ranges[-1][1] + 1:
            ranges[-1] = (ranges[-1][0], line)
        else:
            ranges.append((line, line))
    shown = [f"{first}-{last}" if last > first else f"{first}" for first, last in ranges[:MOST_RANGES]]
    return ", ".join([*shown, "..."] if len(ranges) > MOST_RANGES else shown)


def _said(sentence: Sentence, text: Catalogue) -> str:
    return text(f"check.said.{sentence.code}", **_shown(sentence.values))


def _shown(values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: PlainNumber(value) if isinstance(value, float) else value for name, value in values.items()}


def _fields(
    options: Namespace, machine: MachineProfile, checked: ProgramCheck, text: Catalogue
) -> dict[str, object]:
    return {
        "file": options.file,
        "machine": machine.name,
        "program": checked.number,
        "start": {"source": checked.start.source.value, "positions": dict(checked.start.positions)},
        "ta_ms": options.ta_ms,
        "ts_ms": options.ts_ms,
        "duration_ms": checked.duration_ms,
        "moves": [_move(machine, move, place) for move, place in zip(checked.moves, checked.places, strict=True)],
        "findings": [
            {
                "level": _LEVELS[finding.severity],
                "code": finding.code.value,
                "lines": list(finding.lines),
                "values": dict(finding.values),
                "text": _finding(finding, text),
            }
            for finding in checked.findings
        ],
        "explanation": [
            {"code": s.code.value, "values": dict(s.values), "text": _said(s, text)} for s in checked.explanation
        ],
    }


def _move(machine: MachineProfile, move: MoveAnalysis, place: int) -> dict[str, object]:
    return {
        "line": place,
        "mode": move.mode,
        "by_move_time": move.by_move_time,
        "commanded": _times(move.asked),
        "effective": _times(move.used),
        "begins_ms": move.begins_ms,
        "ends_ms": move.ends_ms,
        "blended": move.blended,
        "motors": [_motor(machine, motor) for motor in move.motors],
    }


def _times(timing: Timing) -> dict[str, float]:
    return {"ta_ms": timing.ta_ms, "ts_ms": timing.ts_ms, "tm_ms": timing.tm_ms}


def _motor(machine: MachineProfile, motor: MotorMove) -> dict[str, object]:
    peaks = motor.peaks
    lengths = {
        "target": motor.target,
        "commanded": motor.commanded,
        "reached": motor.reached,
        "made": motor.made,
        "lost": motor.lost,
    }
    fields: dict[str, object] = {
        "motor": motor.motor,
        **{f"{name}_counts": counts for name, counts in lengths.items()},
        "turns": motor.turns,
        "velocity_counts_per_ms": peaks.velocity,
        "acceleration_counts_per_ms2": peaks.acceleration,
        "jerk_counts_per_ms3": peaks.jerk,
    }
    return fields | _in_units(machine, motor.motor, lengths, motor)


def _in_units(
    machine: MachineProfile, number: int, lengths: Mapping[str, float], motor: MotorMove
) -> dict[str, object]:
    unit = unit_of(machine, number)
    if unit is None:
        return {}
    peaks = motor.peaks

    def key(name: str, unit_name: str) -> str:
        return f"{name}_{unit_name.replace('/', '_per_')}"

    return {
        **{key(name, unit.name): counts * unit.per_count for name, counts in lengths.items()},
        key("velocity", unit.velocity_unit): peaks.velocity * unit.velocity,
        key("acceleration", unit.acceleration_unit): peaks.acceleration * unit.acceleration,
        key("jerk", unit.jerk_unit): None if peaks.jerk is None else peaks.jerk * unit.jerk,
    }
