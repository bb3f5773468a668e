"""What an instructor may type: an order, or a refusal that names what is possible; nothing else."""

from __future__ import annotations

import json
import shlex

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.cli.commands import build
from console.school.instructing.order import FASTEST, SLOWEST, Answer, Do, read_answer, read_order, written
from console.session.errors import SessionError
from console.text.catalogue import load
from profiles.problem import Problem

WORD = st.sampled_from(("inject", "speed", "pause", "return", "log", "help", "hang", "for=3", "2", '"', "'", "\\"))


@given(st.text() | st.lists(WORD | st.text(max_size=5), max_size=5).map(" ".join))
def test_a_line_is_an_order_or_is_refused(line: str) -> None:
    try:
        order = read_order(line)
    except SessionError as error:
        (problem,) = error.problems
        assert problem.code in ("instruct.unknown", "instruct.speed", "instruct.name")
    else:
        assert SLOWEST <= order.speed <= FASTEST
        assert order.line.isprintable()
        assert order.do is not Do.FAULT or shlex.split(order.line) == shlex.split(line)


@pytest.mark.parametrize(
    ("line", "do"),
    [
        ("inject hang for=3", Do.FAULT),
        ("speed 2", Do.SPEED),
        ("speed x0.5", Do.SPEED),
        ("checkpoint", Do.CHECKPOINT),
        ("return before-cut", Do.RETURN),
        ("screen", Do.SCREEN),
    ],
)
def test_orders(line: str, do: Do) -> None:
    assert read_order(line).do is do


@pytest.mark.parametrize("line", ["", "spindle 500", "speed", "speed 5", "speed nan", "speed 0", "checkpoint a/b"])
def test_refused_lines(line: str) -> None:
    with pytest.raises(SessionError):
        read_order(line)


def test_only_what_changes_the_lathe_is_kept_from_the_trainee() -> None:
    hidden = {
        line for line in ("inject hang", "clear", "power-cycle", "active", "list") if read_order(line).is_fault
    }
    assert hidden == {"inject hang", "clear", "power-cycle"}


@given(st.lists(st.text()), st.none() | st.builds(Problem, code=st.text(), value=st.text()))
def test_an_answer_arrives_as_it_was_given(lines: list[str], problem: Problem | None) -> None:
    answer = Answer(lines=tuple(lines), problem=problem)
    line = written(answer)
    assert line.count(b"\n") == 1
    assert read_answer(line) == answer


@given(st.recursive(st.none() | st.integers() | st.text(), lambda inner: st.dictionaries(st.text(), inner)))
def test_what_is_no_answer_is_not_taken_for_one(value: object) -> None:
    with pytest.raises(ValueError, match="answer"):
        read_answer(json.dumps({"lines": value}).encode())


@pytest.mark.parametrize("typed", ["--data /d speed 2", "speed 2 --data /d", "speed --data /d 2"])
def test_options_stand_wherever_they_are_typed(typed: str) -> None:
    options = build(load("en")).parse_args(["instruct", "tcp:127.0.0.1:4444", *typed.split()])
    assert (options.words, options.data) == (["speed", "2"], "/d")
