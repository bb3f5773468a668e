"""One line of the instructor as a value, and its answer, which is a JSON object on a line. Pure."""

from __future__ import annotations

import json
import math
import re
import shlex
from dataclasses import asdict, dataclass
from enum import StrEnum

from console.session.errors import SessionError
from profiles.files import printable
from profiles.problem import Problem
from profiles.strict_values import from_json, record


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderReply:
    """What came of an order: lines to print, or the problem why nothing was done.

    `age_s` is how old a picture of the screen is.
    """

    lines: tuple[str, ...] = ()
    problem: Problem | None = None
    age_s: float = 0.0


def encode_answer(answer: OrderReply) -> bytes:
    """Return the line of an answer, with its end."""
    return json.dumps(asdict(answer)).encode("ascii") + b"\n"


def read_answer(line: bytes) -> OrderReply:
    """Return the answer in a line. Raises ValueError: there is none in it."""
    try:
        return record(OrderReply, from_json(line))
    except (AttributeError, TypeError) as error:
        raise ValueError("no answer") from error


LONGEST_LINE = 2000  # bytes, without its end
SLOWEST, FASTEST = 0.25, 4.0  # times real time
NAME = "1"  # of a checkpoint that was given none
_NAME = re.compile(r"[\w.-]{1,20}")

WORDS = (
    "list",
    "help NAME",
    "inject NAME [KEY=VALUE ...]",
    "active",
    "clear",
    "power-cycle",
    "collisions",
    "speed X",
    "pause",
    "resume",
    "checkpoint [NAME]",
    "return [NAME]",
    "checkpoints",
    "screen",
    "log",
)
"""Every order."""


class OrderKind(StrEnum):
    """What is ordered. `FAULT` is a line that the simulated lathe answers."""

    FAULT = "fault"
    SPEED = "speed"
    PAUSE = "pause"
    RESUME = "resume"
    CHECKPOINT = "checkpoint"
    RETURN = "return"
    CHECKPOINTS = "checkpoints"
    SCREEN = "screen"
    LOG = "log"


CHANGES = ("inject", "clear", "power-cycle")
"""First words of lines for the simulated lathe after which it is another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstructorOrder:
    """An order as it was typed, with what its kind needs: a speed, the name of a checkpoint."""

    do: OrderKind
    line: str
    speed: float = 1.0
    name: str = NAME

    @property
    def is_fault(self) -> bool:
        """Whether it changes the lathe in a way that a trainee has to find."""
        return self.do is OrderKind.FAULT and self.line.split()[0] in CHANGES

    @property
    def is_seen(self) -> bool:
        """Whether it does something that the trainee sees anyhow."""
        return self.do in (
            OrderKind.SPEED,
            OrderKind.PAUSE,
            OrderKind.RESUME,
            OrderKind.CHECKPOINT,
            OrderKind.RETURN,
        )


def read_order(line: str) -> InstructorOrder:
    """Return the order in a line.

    Raises SessionError: `instruct.unknown`; `instruct.speed`, out of its range; `instruct.name` of a checkpoint.
    """
    if len(line.encode("utf-8", "replace")) > LONGEST_LINE or not line.isprintable():
        raise _unknown(line)
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise _unknown(line) from error
    said = line.strip()
    match words:
        case ["list" | "active" | "clear" | "power-cycle" | "collisions"] | ["help", _] | ["inject", _, *_]:
            # In one form, whatever quotes were typed: the simulated lathe splits it again.
            return InstructorOrder(do=OrderKind.FAULT, line=shlex.join(words))
        case ["speed", value]:
            return InstructorOrder(do=OrderKind.SPEED, line=said, speed=_parse_speed(value))
        case ["pause" | "resume" | "screen" | "log" | "checkpoints" as word]:
            return InstructorOrder(do=OrderKind(word), line=said)
        case ["checkpoint" | "return" as word, *names] if len(names) <= 1:
            return InstructorOrder(do=OrderKind(word), line=said, name=_name(names[0]) if names else NAME)
        case _:
            raise _unknown(line)


def _parse_speed(word: str) -> float:
    try:
        speed = float(word.removeprefix("x"))
    except ValueError:
        speed = math.nan
    if not SLOWEST <= speed <= FASTEST:
        limit = f"{SLOWEST:g} - {FASTEST:g}"
        raise SessionError(Problem(code="instruct.speed", value=printable(word, 40), limit=limit))
    return speed


def _name(word: str) -> str:
    if not _NAME.fullmatch(word):
        raise SessionError(Problem(code="instruct.name", value=printable(word, 40)))
    return word


def _unknown(line: str) -> SessionError:
    limit = " | ".join(WORDS)
    return SessionError(Problem(code="instruct.unknown", value=printable(line.strip(), 40), limit=limit))
