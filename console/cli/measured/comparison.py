"""The paper beside our results, and the twelve acceptance numbers: computed, cut and printed."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from console.cli.output import fields_of, show
from console.session.reproduction.numbers import NUMBERS
from console.text.catalogue import Catalogue
from console.text.columns import table, wrap_text
from profiles.paper.record import Basis, Experiments, Figure, Record, Relation, Section, lee_2001
from profiles.paper.reproduction import sections

ACCEPTANCE = "acceptance"
YES, NO = "✓", "✗"
BY_CONSTRUCTION = "≡"
_SIGNS = {Relation.NEAR: "", Relation.AT_MOST: "≤ ", Relation.ABOVE: "> ", Relation.OTHER: "≠ "}
_REASON_COLUMNS = 100
_EXACT = 1e-6
"""Tolerances up to this are only for rounding, and not shown."""

Row = tuple[str, str, str, str, str]
Draw = Callable[[Figure], list[str]]
"""Render a figure as lines of text."""


def reproduce(options: Namespace, text: Catalogue, draw: Draw | None) -> int:
    """Print the comparison, with figures where `draw` is given; 1 where an acceptance number is missed."""
    paper = lee_2001()
    on_the_lathe = [] if options.quick else _on_the_lathe(paper, options, text)
    found = [_extend_section(section, on_the_lathe) for section in sections(paper)]
    held = _check_acceptance_numbers(found, NUMBERS if options.quick else ())
    show(
        options,
        lambda: {"sections": [_section_fields(each, text) for each in found], "acceptance": held},
        lambda: _lines(found, held, text, draw),
    )
    return 0 if all(held.values()) else 1


def _on_the_lathe(paper: Experiments, options: Namespace, text: Catalogue) -> list[Record]:
    """Cut what has to be cut; announce each slow number on stderr."""
    records: list[Record] = []
    for number, measure in NUMBERS.items():
        if not options.json:
            print(text("reproduce.cutting", number=number), file=sys.stderr)
        records += measure(paper)
    return records


def _extend_section(section: Section, further: Sequence[Record]) -> Section:
    """Return the acceptance section including the numbers from the lathe; other sections unchanged."""
    if section.name != ACCEPTANCE:
        return section
    records = sorted((*section.records, *further), key=lambda record: record.number)
    return replace(section, records=tuple(records))


def _check_acceptance_numbers(found: Sequence[Section], incomplete: Collection[int]) -> dict[int, bool]:
    records = [record for section in found for record in section.records]
    numbers = sorted({record.number for record in records} - {0, *incomplete})
    return {n: all(each.holds is not False for each in records if each.number == n) for n in numbers}


def _section_fields(section: Section, text: Catalogue) -> dict[str, object]:
    return {
        "name": section.name,
        "records": [_record_fields(each, text) for each in section.records],
        "figures": [_figure_fields(each) for each in section.figures],
    }


def _record_fields(record: Record, text: Catalogue) -> dict[str, object]:
    return {
        "name": record.name,
        "at": record.at,
        "number": record.number or None,
        "expected": record.expected,
        "relation": record.relation.value,
        **fields_of(record, "tolerance", "ours", "unit", "difference", "holds"),
        "basis": record.basis.value,
        "why": _reason(record, text) if record.why else None,
    }


def _figure_fields(figure: Figure) -> dict[str, object]:
    return {
        **fields_of(figure, "name", "at", "x_unit", "y_unit"),
        "curves": [{"name": c.name, "x": c.x.tolist(), "y": c.y.tolist()} for c in figure.curves],
    }


def _lines(found: Sequence[Section], held: dict[int, bool], text: Catalogue, draw: Draw | None) -> list[str]:
    lines = [text("reproduce.title")]
    for section in found:
        lines += ["", text(f"reproduce.section.{section.name}")]
        lines += table([head(section, text), *rows(section.records, text)], numeric=(1, 2, 3))
        lines += _reasons(section, text)
        if draw:
            for figure in section.figures:
                lines += ["", title(figure, text), *draw(figure)]
    missing = [str(number) for number in range(1, 13) if number not in held]
    lines += ["", count_agreements(found, text), text("reproduce.marks")]
    lines += [text("reproduce.held", held=sum(held.values()), all=len(held))]
    return [*lines, text("reproduce.left_out", numbers=", ".join(missing))] if missing else lines


def head(section: Section, text: Catalogue) -> Row:
    """Return the column titles; for the acceptance numbers the first is the expected value."""
    said = text("reproduce.head.target" if section.name == ACCEPTANCE else "reproduce.head.paper")
    what, ours, difference = (text(f"reproduce.head.{name}") for name in ("what", "ours", "difference"))
    return what, said, ours, difference, ""


def rows(records: Sequence[Record], text: Catalogue) -> list[Row]:
    """Return subject, paper, ours, difference and verdict for each record."""
    found: list[Row] = []
    for record in records:
        unit, off = f" {record.unit}" if record.unit else "", record.difference
        expected = "–" if record.expected is None else f"{_SIGNS[record.relation]}{record.expected:.4g}{unit}"
        difference = "" if off is None else _format_difference(off, record.tolerance)
        found.append((_name(record, text), expected, f"{record.ours:z.4g}{unit}", difference, _mark(record)))
    return found


def reason_lines(records: Sequence[Record], text: Catalogue) -> list[str]:
    """Return why our number differs, each reason once, with the first row that needs it."""
    first = {record.why: record for record in reversed(records) if record.why}
    asked = dict.fromkeys(record.why for record in records if record.why)
    return [f"{_name(first[why], text).strip()} – {_reason(first[why], text)}" for why in asked]


def _reasons(section: Section, text: Catalogue) -> list[str]:
    lines = []
    for reason in reason_lines(section.records, text):
        first, *further = wrap_text(reason, _REASON_COLUMNS)
        lines += [f"  · {first}", *(f"    {line}" for line in further)]
    return lines


def _name(record: Record, text: Catalogue) -> str:
    sentence = text(f"reproduce.row.{record.name}", at=word(record.at, text))
    return f"{record.number:>2}  {sentence}" if record.number else sentence


def title(figure: Figure, text: Catalogue) -> str:
    """Return the title of a figure."""
    return text(f"reproduce.figure.{figure.name}", at=word(figure.at, text))


def word(name: str, text: Catalogue) -> str:
    """Return a catalogue word in this language; a value such as "10 Hz" stays unchanged."""
    return text(f"reproduce.word.{name}") if name.isidentifier() else name


def _reason(record: Record, text: Catalogue) -> str:
    return text(f"reproduce.why.{record.why}", **record.facts)


def _mark(record: Record) -> str:
    """Return the mark of a verdict; in brackets if it is fitted, rests on a reading, or is one of rivals."""
    if record.holds is None:
        return ""
    mark = YES if record.holds else NO
    if record.basis in (Basis.FITTED, Basis.READING, Basis.RIVAL):
        return f"({mark})"
    return BY_CONSTRUCTION if record.holds and record.basis is Basis.CONSTRUCTION else mark


def count_agreements(sections: Sequence[Section], text: Catalogue) -> str:
    """Return how many comparisons with the paper agree; inconclusive ones are counted apart."""
    judged = [r for s in sections if s.name != ACCEPTANCE for r in s.records if r.holds is not None]
    own = [record.holds for record in judged if record.basis is Basis.COMPUTED]
    return text(
        "reproduce.compared",
        held=sum(each is True for each in own),
        all=len(own),
        construction=sum(record.basis is Basis.CONSTRUCTION for record in judged),
        fitted=sum(record.basis is Basis.FITTED for record in judged),
        reading=sum(record.basis is Basis.READING for record in judged),
        rival=sum(record.basis is Basis.RIVAL for record in judged),
    )


def _format_difference(difference: float, tolerance: float) -> str:
    shown = "0" if abs(difference) <= 0.01 * max(tolerance, _EXACT) else f"{difference:+.3g}"
    return f"{shown} (± {tolerance:.2g})" if tolerance > _EXACT else shown
