"""Paper and own results for JSON, unrounded."""

from __future__ import annotations

from console.cli.measured.reproduce_lines import reason_line
from console.text.catalogue import Catalogue
from profiles.paper.record import Figure, Record, Section


def section_fields(section: Section, text: Catalogue) -> dict[str, object]:
    """Return a section with its records and figures."""
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
        "tolerance": record.tolerance,
        "ours": record.ours,
        "unit": record.unit,
        "difference": record.difference,
        "holds": record.holds,
        "basis": record.basis.value,
        "why": reason_line(record, text) if record.why else None,
    }


def _figure_fields(figure: Figure) -> dict[str, object]:
    return {
        "name": figure.name,
        "at": figure.at,
        "x_unit": figure.x_unit,
        "y_unit": figure.y_unit,
        "curves": [{"name": c.name, "x": c.x.tolist(), "y": c.y.tolist()} for c in figure.curves],
    }
