"""docs/paper.md says what is computed: its blocks between `<!-- NAME -->` and `<!-- end -->`, and its script."""

from __future__ import annotations

import contextlib
import io
import math
import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import pytest

from console.cli.measured.comparison import ACCEPTANCE, Row, count_agreements, head, reason_lines, rows, title
from console.screens.paper_figures import figure_lines
from console.text.catalogue import load
from profiles.paper.record import Record, Section, lee_2001
from profiles.paper.reproduction import sections
from tests.golden_text import writing

DOCUMENT = Path(__file__).parents[2] / "docs" / "paper.md"
BLOCK = re.compile(r"^<!-- (?P<name>[\w. ]+) -->\n(?P<body>.*?)<!-- end -->$", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"[+-]?\d+(?:\.\d+)?(?:e[+-]\d+)?")
TEXT = load("en")
SHARE, FLOOR = 0.05, 0.005


def blocks() -> dict[str, str]:
    """The computed blocks by name, as they stand in the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    return {match["name"]: match["body"] for match in BLOCK.finditer(text)}


def table_lines(head: Row, records: Sequence[Record]) -> list[str]:
    """A table for people who read the document, with the reasons below it."""
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows(records, TEXT))]
    told = [f"- {reason}" for reason in reason_lines(records, TEXT)]
    return [lines[0], "|---|---:|---:|---:|---|", *lines[1:], *(["", *told] if told else [])]


def compare_block(name: str, lines: Sequence[str], *, measured: bool = False) -> None:
    """Fail where a block says another thing than what was computed, after writing it where that is asked for.

    What was `measured` on the lathe may be off by `SHARE` or by `FLOOR` in its unit, each number by itself:
    friction and rounding make a whole count of what differs in the last digit from one computer to the next.
    """
    now = "\n" + "\n".join(line.rstrip() for line in lines) + "\n\n"
    assert "reproduce." not in now, "a sentence is missing"
    kept = blocks().get(name)
    assert kept is not None, f"docs/paper.md has no block {name}"
    if now == kept:
        return
    if writing():
        text = DOCUMENT.read_text(encoding="utf-8")
        written = BLOCK.sub(lambda m: f"<!-- {name} -->\n{now}<!-- end -->" if m["name"] == name else m[0], text)
        DOCUMENT.write_text(written, encoding="utf-8")
        pytest.fail(f"block {name} was written: look at it, then run without GOLDENS", pytrace=False)
    if not (measured and alike(now, kept)):
        assert now == kept


def alike(now: str, kept: str) -> bool:
    """Whether two texts are the same but for small differences of their numbers."""
    if NUMBER.sub("#", now) != NUMBER.sub("#", kept):
        return False
    pairs = zip(NUMBER.findall(now), NUMBER.findall(kept), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=SHARE, abs_tol=FLOOR) for a, b in pairs)


SECTIONS = ("chuck", "servo", "parts", "slips")
FIGURES = ("fig3", "fig4", "fig5a", "fig5b", "fig6", "fig11.gain", "fig11.phase", "fig12", "prog1", "fig16")
COLUMNS = 90
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


@cache
def computed() -> dict[str, Section]:
    return {section.name: section for section in sections(lee_2001())}


def test_the_tables_and_the_figures_are_what_comes_out_and_no_block_is_left_that_nobody_computes() -> None:
    known = {f"table {name}" for name in SECTIONS} | {f"number {number}" for number in range(1, 13)}
    known |= {f"figure {name}" for name in FIGURES} | {"counted"}
    assert set(blocks()) == known
    assert {figure.name for section in computed().values() for figure in section.figures} == set(FIGURES)
    assert set(computed()) == {*SECTIONS, ACCEPTANCE}
    failed = []
    counts = ("counted", [count_agreements([*computed().values()], TEXT) + "."])
    for name, lines in (counts, *tables(), *figures()):
        try:
            compare_block(name, lines)
        except (AssertionError, pytest.fail.Exception) as difference:
            failed.append(f"{name}: {difference}")
    assert not failed, "\n".join(failed)


def tables() -> Iterator[tuple[str, list[str]]]:
    for name in SECTIONS:
        section = computed()[name]
        yield f"table {name}", table_lines(head(section, TEXT), section.records)


def figures() -> Iterator[tuple[str, list[str]]]:
    """All figures of a name stand in one block."""
    for name in FIGURES:
        lines = []
        for figure in (each for section in computed().values() for each in section.figures if each.name == name):
            lines += [f"{title(figure, TEXT)}:", "", "```", *figure_lines(figure, TEXT, COLUMNS), "```", ""]
        yield f"figure {name}", lines[:-1]


def test_each_script_prints_what_stands_below_it() -> None:
    fenced = FENCED.findall(DOCUMENT.read_text(encoding="utf-8"))
    places = [i for i, (language, _) in enumerate(fenced) if language == "python"]
    assert len(places) == 2
    for place in places:
        script, printed = fenced[place][1], fenced[place + 1][1]
        imported = re.findall(r"^(?:from|import) (\w+)", script, re.MULTILINE)
        assert set(imported) <= {"profiles", "cmath", "math", "numpy"}
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(script, "docs/paper.md", "exec"), {})
        assert said.getvalue() == printed


def test_each_number_of_the_lathe_is_compared_by_itself() -> None:
    """Not against the largest of its line: 0.06 may not stand where 0.14 comes out."""
    row = "| lobe in cut 3 | <= 0.5 um | {} um |"
    assert alike(row.format("0.1411"), row.format("0.1450"))
    assert not alike(row.format("0.1411"), row.format("0.06087"))
    assert f"{100 * SHARE:g} %" in DOCUMENT.read_text(encoding="utf-8")
    assert f"by {FLOOR:g} of their unit" in DOCUMENT.read_text(encoding="utf-8")
