"""What is told of the link stands still while nothing is the matter, and never tells less than it was."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.session.station.watches import KEPT_S, LinkTime, rounded_up_ms

ANSWERS_S = st.lists(st.floats(0.0002, 0.09), min_size=2, max_size=60)
POLL_S = 0.5
"""Exact in binary, and ten of them are the time that is kept."""


@given(ANSWERS_S)
def test_it_tells_the_longest_answer_of_the_last_seconds_rounded_up(answers_s: list[float]) -> None:
    link = LinkTime()
    for number, answer_s in enumerate(answers_s):
        told_ms = link.see(number * POLL_S, answer_s)
        recent = [
            each for place, each in enumerate(answers_s[: number + 1]) if (number - place) * POLL_S <= KEPT_S
        ]
        assert told_ms == rounded_up_ms(1000.0 * max(recent))


@pytest.mark.parametrize(
    ("answer_ms", "told_ms"),
    [(0.2, 1.0), (1.0, 1.0), (1.1, 2.0), (4.9, 5.0), (5.1, 10.0), (11.0, 20.0), (480.0, 500.0)],
)
def test_figures_are_one_two_and_five(answer_ms: float, told_ms: float) -> None:
    assert rounded_up_ms(answer_ms) == told_ms


@given(st.lists(st.floats(0.0021, 0.0049), min_size=50, max_size=50))
def test_answers_that_scatter_are_one_figure(answers_s: list[float]) -> None:
    link = LinkTime()
    told = [link.see(number * POLL_S, answer_s) for number, answer_s in enumerate(answers_s)]
    assert all(before == after for before, after in pairwise(told))
