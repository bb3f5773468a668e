"""Run programs in a coordinate system, and report its axes."""

from __future__ import annotations

import re
from collections.abc import Callable

from drivers.pmac.axes import AXIS_LETTERS
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM, parse_expression
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import addresses
from drivers.pmac.language.text import format_number
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.program_motion import Place
from drivers.simulator.context import Context, Handler, Reading, Step, act, say

LABELS = 100_000  # the fraction after a program number is a label in units of 1/100000: `B1.1` is label N10000
_PRESET_WORK = 30  # cost in variables read: the positions of every axis are recomputed
_PRESET = re.compile(r"[A-CU-Z]=")


def set_axis(scanner: Scanner) -> Step | None:
    """`X=5`: preset the axis to 5, without a move; None when there is no such command at the cursor."""
    if not _PRESET.match(scanner.rest):
        return None
    axis = scanner.take_word(AXIS_LETTERS)
    scanner.expect("=")
    expression = parse_expression(scanner)
    assert axis is not None

    def step(context: Context) -> None:
        context.system.set_axis(axis, context.value(expression))
        context.work += _PRESET_WORK

    return step


def _point(scanner: Scanner, reading: Reading) -> Step:
    number = scanner.take_number()
    if number is None:
        raise scanner.refusal("a program number as in B1")
    program, label = divmod(round(number * LABELS), LABELS)
    if not 1 <= program <= HIGHEST_PROGRAM:
        raise PmacError(ErrorCode.DATA_ERROR, f"program {program}, 1 to {HIGHEST_PROGRAM}")
    return lambda context: context.system.point(program, label or None)


def _start(start: Callable[[CoordinateSystem], None]) -> Handler:
    def action(context: Context) -> None:
        if context.controller.open_buffer is not None:
            raise PmacError(ErrorCode.NO_PROGRAM, "a program buffer is open")
        start(context.system)

    return act(action)


def _override(scanner: Scanner, reading: Reading) -> Step:
    """`%50` sets the override, `%` reports the present time base."""
    percent = scanner.take_number()
    if percent is None:
        return lambda context: context.lines.append(format_number(context.system.time_base.percent))
    return lambda context: context.system.set_override(percent)


def _place(context: Context, place: Place) -> str:
    """Return the program and the address of a line in it, as LIST PROG has it."""
    program, line = place
    return f"P{program}:{addresses(context.controller.programs.get(program, [])[:line])[-1]}"


def _list_place(read: Callable[[CoordinateSystem], Place]) -> Handler:
    """`LIST PC` and `LIST PC,3`: the place, and that many lines of the program from there."""

    def command(scanner: Scanner, reading: Reading) -> Step:
        count = scanner.take_integer() if scanner.accept(",") else 1
        if count is None:
            raise scanner.refusal("a number of lines")
        return lambda context: _list_from(context, read(context.system), count)

    return command


def _list_from(context: Context, place: Place, count: int) -> None:
    program, first = place
    buffer = context.controller.programs.get(program, [])
    lines, starts = buffer[first : first + count], addresses(buffer)[first:]
    texts = [line.listed(in_full=context.in_full) for line in lines]
    context.list_lines([f"P{program}:{start}:{text}" for start, text in zip(starts, texts, strict=False)])
    if not lines:
        context.lines.append(_place(context, place))


WORDS: dict[str, Handler] = {
    "PC": say(lambda context: _place(context, context.system.program_counter())),
    "PE": say(lambda context: _place(context, context.system.executing())),
    "PR": say(lambda _: "0"),
    "MOVETIME": say(lambda context: format_number(round(context.system.motion.left_ms, 3))),
    "PMATCH": act(lambda context: context.system.match_positions()),
    "LISTPC": _list_place(CoordinateSystem.program_counter),
    "LISTPE": _list_place(CoordinateSystem.executing),
    "%": _override,
    "/": act(lambda context: context.system.stop_at_block()),
    "\\": act(lambda context: context.system.quick_hold()),
}


def _close_loops(context: Context) -> None:
    """`E`: close the loops of all motors of the system where they stand. Raises PmacError: 001, 013, 014."""
    system, motors = context.system, context.system.frame.motors
    if system.running or system.moving:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{system.number}")
    if not motors:
        raise PmacError(ErrorCode.NO_MOTORS, f"&{system.number}")
    for motor in motors:
        if not motor.activated:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"motor {motor.number}")
    for motor in motors:
        motor.enable()


LETTERS: dict[str, Handler] = {
    "B": _point,
    "R": _start(CoordinateSystem.run),
    "S": _start(CoordinateSystem.step),
    "H": act(lambda context: context.system.hold()),
    "Q": act(lambda context: context.system.quit()),
    "A": act(lambda context: context.system.abort()),
    "E": act(_close_loops),
    "Z": act(lambda context: context.system.zero_axes()),
}
