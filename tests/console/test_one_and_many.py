"""A number is followed by the singular or the plural, in a language that has both."""

from __future__ import annotations

import pytest

from console.text.catalogue import load


@pytest.mark.parametrize(
    ("language", "count", "said"),
    [
        ("en", 0, "0 alarms"),
        ("en", 1, "1 alarm"),
        ("en", 2, "2 alarms"),
        ("ko", 1, "경보 (1)"),
        ("ko", 2, "경보 (2)"),
    ],
)
def test_one_alarm_is_no_plural(language: str, count: int, said: str) -> None:
    assert load(language)("messages.alarms", count=count) == said


def test_a_sentence_without_a_singular_is_said_of_one_too() -> None:
    assert load("en")("roundness.left_out", count=1) == "outliers excluded: 1"
