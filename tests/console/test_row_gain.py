"""A row that gained nothing says so, in both languages; nobody is told of a gain that chance may be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from console.session.learning.row_result import LearnedPart, LearnResult
from console.text.catalogue import load


def part(ront_um: float) -> LearnedPart:
    return SimpleNamespace(roundness=SimpleNamespace(ront_um=ront_um), grown=(), trim_short={}, clamped=None)  # type: ignore[return-value]


def row(parts: tuple[LearnedPart, ...]) -> LearnResult:
    none: Any = None
    of: dict[str, Any] = {"simulated": True, "after": None, "collisions": (), "parts": parts}
    return LearnResult(plan=none, before=none, floor=none, figures=none, **of)


def said(*ront_um: float) -> list[tuple[str, str, str, str]]:
    parts = tuple(map(part, ront_um))
    return [(each.code, each.key, each.value, each.limit) for each in row(parts).warnings]


@pytest.mark.parametrize(
    ("ront_um", "told"),
    [
        ((2.1, 1.9, 2.3), [("learning.no_gain", "3", "2.3 um", "2.1 um")]),
        ((2.1, 1.2, 1.9), [("learning.no_gain", "3", "1.9 um", "2.1 um")]),
        ((18.4, 5.0, 3.0), []),
        ((1.5, 0.9), []),
        ((4.0,), []),
    ],
)
def test_a_last_part_that_is_not_rounder_is_no_gain(
    ront_um: tuple[float, ...], told: list[tuple[str, str, str, str]]
) -> None:
    assert said(*ront_um) == told


@pytest.mark.parametrize(("language", "words"), [("en", "gained nothing"), ("ko", "나아진 것이 없습니다")])
def test_it_is_said_with_both_figures(language: str, words: str) -> None:
    parts = tuple(map(part, (2.1, 2.3)))
    (problem,) = row(parts).warnings
    sentence = load(language).problem(problem)
    assert words in sentence and "2.1 um" in sentence and "2.3 um" in sentence
