"""The refusals of the controller: the ERRnnn numbers it reports, and the exceptions that carry them."""

from __future__ import annotations

from enum import IntEnum


class ErrorCode(IntEnum):
    """ERRnnn as the controller prints it (PMAC Software Reference, I6)."""

    NOT_WHILE_RUNNING = 1
    PASSWORD = 2
    DATA_ERROR = 3
    ILLEGAL_CHARACTER = 4
    NO_BUFFER_OPEN = 5
    NO_ROOM = 6
    BUFFER_IN_USE = 7
    MACRO_COMMUNICATION = 8
    STRUCTURE = 9
    BOTH_LIMITS_SET = 10
    MOVE_NOT_COMPLETED = 11
    OPEN_LOOP = 12
    NOT_ACTIVATED = 13
    NO_MOTORS = 14
    NO_PROGRAM = 15
    BAD_STRUCTURE_RUNNING = 16
    OFF_STOPPED_POSITION = 17
    PHASE_REFERENCE = 18
    MOVES_STORED = 19


class PmacError(Exception):
    """A refusal by the controller's rules: the number of ERRnnn, and the cause in readable form."""

    def __init__(self, code: int, detail: str = "") -> None:
        super().__init__(code, detail)
        self.code = code
        self.detail = detail

    def __str__(self) -> str:
        number = f"ERR{self.code:03d}"
        return f"{number}: {self.detail}" if self.detail else number


class EvaluationError(PmacError):
    """A calculation without a usable result: an overflow, or one for which the controller has a substitute."""


class NoResultError(EvaluationError):
    """A division by zero, SQRT(-1) or LN(0): the controller continues with a substitute."""
