"""Checked program as lines for people: its summary, its moves, its findings, and its explanation."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

from console.cli.finding_lines import MARKS
from console.cli.part.move_lines import move_tables
from console.cli.part.plain_number import PlainNumber
from console.text.catalogue import Catalogue
from console.text.columns import broken
from drivers.pmac.analysis.findings import ProgramFinding, Sentence, Value
from drivers.pmac.analysis.program import ProgramCheck
from drivers.pmac.analysis.start import Source, Start
from profiles.files import printable
from profiles.machine import MachineProfile

WIDTH = 80
MOST_RANGES = 4
"""Line ranges that a finding lists; --json has them all."""


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
    head = [*broken(facts, WIDTH), *broken(_start(checked.start, text), WIDTH), ""]
    judged = _judged(checked, text)
    if not checked.moves:
        return [*head, *judged]
    tables = move_tables(machine, checked, text)
    # The first screen of a long text must show what matters.
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
        lines += _item(f"{MARKS[finding.severity]} ", finding_line(finding, text))
    if not checked.findings:
        lines += _item("✓ ", text("check.clean"))
    if checked.explanation:
        lines += [
            "",
            *broken(" ".join(explanation_line(sentence, text) for sentence in checked.explanation), WIDTH),
        ]
    return lines


def _item(mark: str, sentence: str) -> list[str]:
    first, *others = broken(sentence, WIDTH - len(mark))
    return [mark + first, *(" " * len(mark) + line for line in others)]


def finding_line(finding: ProgramFinding, text: Catalogue) -> str:
    """Return a finding as a sentence, with the lines of the program that it is about."""
    sentence = text(f"check.finding.{finding.code}", **_shown(finding.values))
    if not finding.lines:
        return sentence
    key = "check.line" if len(finding.lines) == 1 else "check.lines"
    return f"{text(key, lines=_places(finding.lines))}: {sentence}"


def _places(lines: Sequence[int]) -> str:
    """Return line numbers, consecutive ones as a range, up to a limit."""
    ranges: list[tuple[int, int]] = []
    for line in lines:
        if ranges and line == ranges[-1][1] + 1:
            ranges[-1] = (ranges[-1][0], line)
        else:
            ranges.append((line, line))
    shown = [f"{first}-{last}" if last > first else f"{first}" for first, last in ranges[:MOST_RANGES]]
    return ", ".join([*shown, "..."] if len(ranges) > MOST_RANGES else shown)


def explanation_line(sentence: Sentence, text: Catalogue) -> str:
    """Return a sentence of the explanation."""
    return text(f"check.said.{sentence.code}", **_shown(sentence.values))


def _shown(values: Mapping[str, Value]) -> dict[str, Value]:
    return {name: PlainNumber(value) if isinstance(value, float) else value for name, value in values.items()}
