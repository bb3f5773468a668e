"""The paper beside our results, and the twelve acceptance numbers: computed, cut and printed."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from console.cli.measured.reproduce_fields import section_fields
from console.cli.measured.reproduce_lines import ACCEPTANCE, counted, head, rows, section_lines, title
from console.cli.output import print_json
from console.session.reproduction.numbers import NUMBERS
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.paper.experiments import Experiments, lee_2001
from profiles.paper.record import Figure, Record, Section
from profiles.paper.reproduction import sections

Draw = Callable[[Figure], list[str]]
"""Render a figure as lines of text."""


def reproduce(options: Namespace, text: Catalogue, draw: Draw | None) -> int:
    """Print the comparison, with figures where `draw` is given; 1 where an acceptance number is missed.

    Raises:
        ProblemError: the simulated lathe did not do what was planned.
    """
    paper = lee_2001()
    on_the_lathe = () if options.quick else _on_the_lathe(paper, options, text)
    found = [_with(section, on_the_lathe) for section in sections(paper)]
    held = _held(found, NUMBERS if options.quick else ())
    if options.json:
        print_json({"sections": [section_fields(each, text) for each in found], "acceptance": held})
    else:
        print("\n".join(_lines(found, held, text, draw)))
    return 0 if all(held.values()) else 1


def _on_the_lathe(paper: Experiments, options: Namespace, text: Catalogue) -> tuple[Record, ...]:
    """Cut what has to be cut; announce each slow number on stderr."""
    records: list[Record] = []
    for number, measure in NUMBERS.items():
        if not options.json:
            print(text("reproduce.cutting", number=number), file=sys.stderr)
        records += measure(paper)
    return tuple(records)


def _with(section: Section, further: Sequence[Record]) -> Section:
    """Return the acceptance section including the numbers from the lathe; other sections unchanged."""
    if section.name != ACCEPTANCE:
        return section
    records = sorted((*section.records, *further), key=lambda record: record.number)
    return replace(section, records=tuple(records))


def _held(found: Sequence[Section], incomplete: Collection[int]) -> dict[int, bool]:
    """Return whether each complete acceptance number is met."""
    held: dict[int, bool] = {}
    for record in (record for section in found for record in section.records if record.number):
        if record.number not in incomplete:
            held[record.number] = held.get(record.number, True) and record.holds is not False
    return dict(sorted(held.items()))


def _lines(found: Sequence[Section], held: dict[int, bool], text: Catalogue, draw: Draw | None) -> list[str]:
    lines = [text("reproduce.title")]
    for section in found:
        lines += ["", text(f"reproduce.section.{section.name}")]
        lines += table([head(section, text), *rows(section.records, text)], numeric=(1, 2, 3))
        lines += section_lines(section, text)
        for figure in section.figures if draw else ():
            lines += ["", title(figure, text), *(draw(figure) if draw else ())]
    missing = [str(number) for number in range(1, 13) if number not in held]
    lines += ["", counted(found, text), text("reproduce.marks")]
    lines += [text("reproduce.held", held=sum(held.values()), all=len(held))]
    return [*lines, text("reproduce.left_out", numbers=", ".join(missing))] if missing else lines
