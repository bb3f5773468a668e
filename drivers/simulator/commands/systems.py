"""Run programs in a coordinate system, and report its axes."""

from __future__ import annotations

import re
from collections.abc import Callable

from drivers.pmac.axes import AXIS_LETTERS
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.text import format_line, format_number
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.commands.handler import LINE_WORK, Handler, say
from drivers.simulator.context import Context

LABELS = 100_000
"""The fraction after a program number is a label in units of 1/100000: `B1.1` is label N10000."""

_PRESET_WORK = 30
"""Cost in variables read: the positions of every axis are recomputed."""

_PRESET = re.compile(r"[A-CU-Z]=")


def set_axis(scanner: Scanner, context: Context) -> bool:
    """`X=5`: preset the axis to 5, without a move; False when there is no such command at the cursor."""
    if not _PRESET.match(scanner.rest):
        return False
    axis = scanner.take_word(AXIS_LETTERS)
    scanner.expect("=")
    value = context.expression(scanner)
    assert axis is not None
    context.system.set_axis(axis, value)
    context.work += _PRESET_WORK
    return True


def _point(scanner: Scanner, context: Context) -> None:
    number = scanner.take_number()
    if number is None:
        raise scanner.refusal("a program number as in B1")
    program, label = divmod(round(number * LABELS), LABELS)
    if not 1 <= program <= HIGHEST_PROGRAM:
        raise PmacError(ErrorCode.DATA_ERROR, f"program {program}, 1 to {HIGHEST_PROGRAM}")
    context.system.point(program, label or None)


def _run(_: Scanner, context: Context) -> None:
    _refuse_open_buffer(context)
    context.controller.start_program(context.system_number)


def _step(_: Scanner, context: Context) -> None:
    _refuse_open_buffer(context)
    context.controller.step_program(context.system_number)


def _refuse_open_buffer(context: Context) -> None:
    if context.controller.open_buffer is not None:
        raise PmacError(ErrorCode.NO_PROGRAM, "a program buffer is open")


def _do(action: Callable[[CoordinateSystem], object]) -> Handler:
    def command(_: Scanner, context: Context) -> None:
        action(context.system)

    return command


def _override(scanner: Scanner, context: Context) -> None:
    percent = scanner.take_number()
    if percent is None:
        context.lines.append(format_number(context.system.override_percent))
    else:
        context.system.set_override(percent)


def _counter(context: Context) -> str:
    return _place(context.system.program_counter())


def _executing(context: Context) -> str:
    return _place(context.system.executing())


def _place(place: tuple[int, int]) -> str:
    return f"P{place[0]}:{place[1]}"


def _list_place(read: Callable[[CoordinateSystem], tuple[int, int]]) -> Handler:
    """`LIST PC` and `LIST PC,3`: the place, and that many lines of the program from there."""

    def command(scanner: Scanner, context: Context) -> None:
        count = scanner.take_integer() if scanner.accept(",") else 1
        if count is None:
            raise scanner.refusal("a number of lines")
        program, first = place = read(context.system)
        buffer = context.controller.programs.get(program)
        lines = buffer.lines[first : first + count] if buffer is not None else []
        context.work += len(lines) * LINE_WORK
        context.lines.extend(f"P{program}:{first + n}:{format_line(line)}" for n, line in enumerate(lines))
        if not lines:
            context.lines.append(_place(place))

    return command


WORDS: dict[str, Handler] = {
    "PC": say(_counter),
    "PE": say(_executing),
    "PR": say(lambda _: "0"),
    "PMATCH": _do(lambda system: system.match_positions()),
    "LISTPC": _list_place(lambda system: system.program_counter()),
    "LISTPE": _list_place(lambda system: system.executing()),
    "%": _override,
    "/": _do(lambda system: system.stop_at_block()),
    "\\": _do(lambda system: system.quick_hold()),
}

LETTERS: dict[str, Handler] = {
    "B": _point,
    "R": _run,
    "S": _step,
    "H": _do(lambda system: system.hold()),
    "Q": _do(lambda system: system.quit()),
    "A": _do(lambda system: system.abort()),
    "Z": _do(lambda system: system.zero_axes()),
}
