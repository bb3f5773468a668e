"""The blocks of docs/paper.md that are computed: between `<!-- NAME -->` and `<!-- end -->`.

`GOLDENS=write pytest -n 0 tests/acceptance` writes them anew (see `tests.golden_text`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from console.cli.measured.comparison import Row, reason_lines, rows
from console.text.catalogue import load
from profiles.paper.record import Record
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
