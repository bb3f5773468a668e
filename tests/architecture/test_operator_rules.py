"""Every rule of the operator has a row in its page, and every test that a row names exists."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "operator-rules.md").read_text(encoding="utf-8")
COUNTS = {"J": 14, "S": 7, "A": 10, "C": 8, "M": 9, "U": 5, "R": 6, "X": 4, "L": 4}
ROWS = re.findall(r"(?m)^\| ([A-Z]\d+) \| (.+?) \| (.+) \|$", PAGE)
NAMED = re.compile(r"`([\w/]+\.py)(?:::(\w+))?`")
WITHOUT = ("*not met*", "*not here*", "*in part*")


@cache
def defined_in(name: str) -> frozenset[str]:
    tree = ast.parse((ROOT / "tests" / name).read_text(encoding="utf-8"))
    return frozenset(
        each.name for each in ast.walk(tree) if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)
    )


def test_every_rule_has_one_row() -> None:
    rules = [f"{letter}{number}" for letter, count in COUNTS.items() for number in range(1, count + 1)]
    assert [rule for rule, _, _ in ROWS] == rules


def test_every_named_test_exists() -> None:
    missing = []
    for rule, _, shown in ROWS:
        for name, test in NAMED.findall(shown):
            if name.startswith("console/"):
                path = ROOT / "tests" / name
                if not test and not path.exists() and (ROOT / name).exists():
                    continue  # a module of the console
            if not (ROOT / "tests" / name).exists() or (test and test not in defined_in(name)):
                missing.append(f"{rule}: {name}::{test}")
    assert missing == []


def test_a_rule_without_a_test_says_why() -> None:
    silent = [
        rule
        for rule, _, shown in ROWS
        if not any(test for _, test in NAMED.findall(shown)) and not shown.startswith(WITHOUT)
    ]
    assert silent == []
