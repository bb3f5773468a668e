"""Statements that only calculate, one after the other, executed in one go: what a program does again and again.

A block is entered at its first instruction, and left where a condition does not hold, or before the first
statement that does more than calculate. Its text is written when it has been entered a number of times: what runs
once is not worth it. Until then, and where Python cannot have it, its statements are executed one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NoReturn

from drivers.pmac.language import syntax
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.evaluate import Variables, refusal
from drivers.pmac.language.python_text import PythonText

WORTH = 10  # times that something is executed as it is before it is written
LONGEST = 100  # instructions of a block

_FAULTS = PmacError, ArithmeticError, ValueError

Left = tuple[int, int]
"""The instruction that follows a block, and the last one that was executed in it."""

Enter = Callable[[Variables], Left | None]
"""Executes a block from its first instruction on; None, with nothing done, until it is written."""


class Blocks:
    """The blocks of one program or PLC, `enter` by their first instructions; None where none begins.

    `failed` is told the instruction in which a calculation has failed.
    """

    def __init__(
        self,
        instructions: Sequence[object],
        jumps: Sequence[int],
        python: PythonText,
        failed: Callable[[int], None],
    ) -> None:
        """Take `jumps`, see `structure.Code`."""
        self.enter: list[Enter | None] = [None] * len(instructions)
        self._instructions, self._jumps = instructions, jumps
        self._python = python
        self._failed = failed
        for first in _beginnings(instructions, jumps):
            self.enter[first] = self._cold(first)

    def _cold(self, first: int) -> Enter:
        entered = 0

        def enter(_: Variables) -> None:
            nonlocal entered
            entered += 1
            if entered == WORTH:
                self.enter[first] = self._written_block(first)

        return enter

    def _written_block(self, first: int) -> Enter | None:
        end = first
        most = min(first + LONGEST, len(self._instructions))
        while end < most and _calculates(self._instructions[end]):
            end += 1
        lines = ["def block(values):", f"    at = {first}", "    try:"]
        for place in range(first, end):
            lines += [f"        {line}" for line in self._lines(place, self._instructions[place])]
        lines += [f"        return {end}, {end - 1}"]
        lines += ["    except faults as fault: failed(at, fault)"]
        found = self._python.execute_text(lines, {"failed": self._fail, "faults": _FAULTS})
        return None if found is None else found["block"]

    def _lines(self, place: int, statement: object) -> list[str]:
        match statement:
            case syntax.While() | syntax.If():
                condition = self._python.condition(statement.condition)
                return [f"at = {place}", f"if not ({condition}): return {self._jumps[place]}, {place}"]
            case syntax.Assign():
                return [f"at = {place}", *self._python.assignment(statement)]
        return []

    def _fail(self, place: int, fault: Exception) -> NoReturn:
        self._failed(place)
        if isinstance(fault, ArithmeticError | ValueError):
            raise refusal(fault) from fault
        raise fault


def _calculates(statement: object) -> bool:
    match statement:
        case syntax.Assign():
            return not statement.synchronous
        case syntax.While() | syntax.If() | syntax.EndIf() | syntax.Label():
            return True
    return False


def _beginnings(instructions: Sequence[object], jumps: Sequence[int]) -> set[int]:
    """Return the instructions at which a block can be entered: where a jump leads, or after another statement."""
    after = {place + 1 for place, statement in enumerate(instructions) if not _calculates(statement)}
    labels = {place for place, statement in enumerate(instructions) if isinstance(statement, syntax.Label)}
    found = {0, *jumps} | after | labels
    return {place for place in found if 0 <= place < len(instructions) and _calculates(instructions[place])}
