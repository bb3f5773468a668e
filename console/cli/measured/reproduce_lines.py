"""Paper and own results as rows and lines for people."""

from __future__ import annotations

from collections.abc import Sequence

from console.text.catalogue import Catalogue
from console.text.columns import broken
from profiles.paper.record import Basis, Figure, Record, Relation, Section

ACCEPTANCE = "acceptance"
YES, NO = "✓", "✗"
BY_CONSTRUCTION = "≡"
_SIGNS = {Relation.NEAR: "", Relation.AT_MOST: "≤ ", Relation.ABOVE: "> ", Relation.OTHER: "≠ "}
_REASON_COLUMNS = 100
_EXACT = 1e-6
"""Tolerances up to this are only for rounding, and not shown."""

Row = tuple[str, str, str, str, str]


def head(section: Section, text: Catalogue) -> Row:
    """Return the column titles; for the acceptance numbers the first is the expected value."""
    said = text("reproduce.head.target" if section.name == ACCEPTANCE else "reproduce.head.paper")
    what, ours, difference = (text(f"reproduce.head.{name}") for name in ("what", "ours", "difference"))
    return what, said, ours, difference, ""


def rows(records: Sequence[Record], text: Catalogue) -> list[Row]:
    """Return subject, paper, ours, difference and verdict for each record."""
    return [_row(record, text) for record in records]


def reason_lines(records: Sequence[Record], text: Catalogue) -> list[str]:
    """Return why our number differs, each reason once, with the first row that needs it."""
    first = {record.why: record for record in reversed(records) if record.why}
    asked = dict.fromkeys(record.why for record in records if record.why)
    return [f"{name(first[why], text).strip()} – {reason_line(first[why], text)}" for why in asked]


def section_lines(section: Section, text: Catalogue) -> list[str]:
    """Return the reasons of a section as lines of a terminal."""
    lines = []
    for reason in reason_lines(section.records, text):
        first, *further = broken(reason, _REASON_COLUMNS)
        lines += [f"  · {first}", *(f"    {line}" for line in further)]
    return lines


def name(record: Record, text: Catalogue) -> str:
    """Return the subject of a record."""
    sentence = text(f"reproduce.row.{record.name}", at=word(record.at, text))
    return f"{record.number:>2}  {sentence}" if record.number else sentence


def title(figure: Figure, text: Catalogue) -> str:
    """Return the title of a figure."""
    return text(f"reproduce.figure.{figure.name}", at=word(figure.at, text))


def word(name: str, text: Catalogue) -> str:
    """Return a catalogue word in this language; a value such as "10 Hz" stays unchanged."""
    return text(f"reproduce.word.{name}") if name.isidentifier() else name


def reason_line(record: Record, text: Catalogue) -> str:
    """Return why our number differs."""
    return text(f"reproduce.why.{record.why}", **record.facts)


def _row(record: Record, text: Catalogue) -> Row:
    off = record.difference
    unit = f" {record.unit}" if record.unit else ""
    expected = "–" if record.expected is None else f"{_SIGNS[record.relation]}{record.expected:.4g}{unit}"
    return (
        name(record, text),
        expected,
        f"{record.ours:z.4g}{unit}",
        "" if off is None else _off(off, record.tolerance),
        mark(record),
    )


def mark(record: Record) -> str:
    """Return the mark of a comparison's verdict; a fitted one is in brackets."""
    if record.holds is None:
        return ""
    if not record.holds:
        return f"({NO})" if record.basis is Basis.FITTED else NO
    return {Basis.COMPUTED: YES, Basis.FITTED: f"({YES})", Basis.CONSTRUCTION: BY_CONSTRUCTION}[record.basis]


def counted(sections: Sequence[Section], text: Catalogue) -> str:
    """Return how many comparisons with the paper agree; inconclusive ones are counted apart."""
    judged = [r for s in sections if s.name != ACCEPTANCE for r in s.records if r.holds is not None]
    own = [record.holds for record in judged if record.basis is Basis.COMPUTED]
    return text(
        "reproduce.compared",
        held=sum(each is True for each in own),
        all=len(own),
        construction=sum(record.basis is Basis.CONSTRUCTION for record in judged),
        fitted=sum(record.basis is Basis.FITTED for record in judged),
    )


def _off(difference: float, tolerance: float) -> str:
    shown = "0" if abs(difference) <= 0.01 * max(tolerance, _EXACT) else f"{difference:+.3g}"
    return f"{shown} (± {tolerance:.2g})" if tolerance > _EXACT else shown
