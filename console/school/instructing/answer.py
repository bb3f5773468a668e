"""The answer to an order, and its form on the line: one JSON object a line."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from profiles.problem import Problem
from profiles.strict_values import from_json, record


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of an order: lines to print, or the problem why nothing was done.

    `age_s` is how old a picture of the screen is.
    """

    lines: tuple[str, ...] = ()
    problem: Problem | None = None
    age_s: float = 0.0


def written(answer: Answer) -> bytes:
    """Return the line of an answer, with its end."""
    return json.dumps(asdict(answer)).encode("ascii") + b"\n"


def read_answer(line: bytes) -> Answer:
    """Return the answer in a line. Raises ValueError: there is none in it."""
    try:
        return record(Answer, from_json(line))
    except (AttributeError, TypeError) as error:
        raise ValueError("no answer") from error
