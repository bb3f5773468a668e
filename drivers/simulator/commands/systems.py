"""Run programs in a coordinate system and report its axes; move single motors: jogs, home searches, kill."""

from __future__ import annotations

import re
from collections.abc import Callable

from drivers.pmac.axes import AXIS_LETTERS
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.expressions import HIGHEST_PROGRAM, parse_expression
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.language.listing import addresses
from drivers.pmac.language.text import format_number
from drivers.pmac.trajectory.frame import FARTHEST_COUNTS
from drivers.simulator.card.coordinate import CoordinateSystem
from drivers.simulator.card.motor import Motor
from drivers.simulator.card.program_motion import Place
from drivers.simulator.context import Context, Handler, LineContext, Step, act, say, signed_constant

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


def _point(scanner: Scanner, reading: LineContext) -> Step:
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


def _override(scanner: Scanner, reading: LineContext) -> Step:
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

    def command(scanner: Scanner, reading: LineContext) -> Step:
        count = scanner.take_integer() if scanner.accept(",") else 1
        if count is None:
            raise scanner.refusal("a number of lines")
        return lambda context: _list_from(context, read(context.system), count)

    return command


def _list_from(context: Context, place: Place, count: int) -> None:
    program, first = place
    buffer = context.controller.programs.get(program, [])
    lines, starts = buffer[first : first + count], addresses(buffer)[first:]
    texts = [line.list_line(in_full=context.in_full) for line in lines]
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


def _free_motor(context: Context) -> Motor:
    """Return the addressed motor. Raises PmacError: 013 not activated, 001 a program moves it."""
    motor = context.active_motor
    context.controller.refuse_in_control(motor.number)
    return motor


_Target = Callable[[Motor], float]


def _jog(scanner: Scanner, reading: LineContext) -> Step:
    for sign, direction in (("+", 1), ("-", -1), ("/", 0)):
        if scanner.accept(sign):
            return _jog_speed(direction)
    if scanner.accept("="):
        target = _amount(scanner)
        return _of_motor(Motor.jog_back) if target is None else _jog_to(target, _past_trigger(scanner))
    for sign in (":", "^"):
        if scanner.accept(sign):
            distance = _amount(scanner)
            if distance is None:
                raise scanner.refusal("a distance as in J^1000")
            return _jog_by(distance, _past_trigger(scanner), from_actual=sign == "^")
    raise scanner.refusal("J+ J- J/ J= J: or J^")


def _of_motor(action: Callable[[Motor], object]) -> Step:
    def step(context: Context) -> None:
        action(_free_motor(context))

    return step


def _jog_speed(direction: int) -> Step:
    return _of_motor(lambda motor: motor.jog_speed(direction))


def _jog_to(target: _Target, past_trigger: float | None) -> Step:
    return _of_motor(lambda motor: motor.jog_to(_check_jog_target(target(motor)), past_trigger))


def _jog_by(distance: _Target, past_trigger: float | None, *, from_actual: bool) -> Step:
    def act(motor: Motor) -> None:
        counts = distance(motor)
        _check_jog_target((motor.encoder if from_actual else motor.desired) + counts)
        motor.jog_by(counts, from_actual=from_actual, past_trigger=past_trigger)

    return _of_motor(act)


def _amount(scanner: Scanner) -> _Target | None:
    """Return a constant, or with `*` the motor's variable jog register; None when there is neither."""
    if scanner.accept("*"):
        return lambda motor: motor.variable_jog
    counts = signed_constant(scanner)
    return None if counts is None else lambda motor: counts


def _check_jog_target(counts: float) -> float:
    """Return a jog target, checked as for programs. Raises PmacError: 003, beyond the range of the registers."""
    if not abs(counts) <= FARTHEST_COUNTS:
        raise PmacError(ErrorCode.DATA_ERROR, f"a jog to {counts:g} counts, {FARTHEST_COUNTS:g} at most")
    return counts


def _past_trigger(scanner: Scanner) -> float | None:
    """`^100` after a jog: stop at the trigger, then go that many counts past it."""
    if not scanner.accept("^"):
        return None
    counts = signed_constant(scanner)
    if counts is None:
        raise scanner.refusal("a distance past the trigger")
    return _check_jog_target(counts)


def _kill(context: Context) -> None:
    """Ignore a motor that is not activated: it is off already."""
    context.controller.refuse_in_control(context.motor_number)
    context.motor.kill()


def _open_loop(scanner: Scanner, reading: LineContext) -> Step:
    percent = signed_constant(scanner)
    if percent is None:
        raise scanner.refusal("an output in percent as in O10")
    return lambda context: _free_motor(context).open_loop(percent)


MOTOR_WORDS: dict[str, Handler] = {
    "J": _jog,
    **dict.fromkeys(("HM", "HOME"), act(lambda context: _free_motor(context).home())),
    **dict.fromkeys(("HMZ", "HOMEZ"), act(lambda context: _free_motor(context).home_zero())),
}

MOTOR_LETTERS: dict[str, Handler] = {
    "K": act(_kill),
    "O": _open_loop,
    "$": act(lambda context: _free_motor(context).phase()),
}
