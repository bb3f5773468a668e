"""Move single motors: jogs, home searches, phasing, open loop and kill."""

from __future__ import annotations

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.trajectory.frame import FARTHEST_COUNTS
from drivers.simulator.card.motor import Motor
from drivers.simulator.context import Context, Handler, act, signed_constant


def _free_motor(context: Context) -> Motor:
    """Return the addressed motor. Raises PmacError: 013 not activated, 001 a program moves it."""
    motor = context.active_motor
    context.controller.refuse_in_control(motor.number)
    return motor


def _jog(scanner: Scanner, context: Context) -> None:
    motor = _free_motor(context)
    for sign, direction in (("+", 1), ("-", -1), ("/", 0)):
        if scanner.accept(sign):
            motor.jog_speed(direction)
            return
    if scanner.accept("="):
        target = _amount(scanner, motor)
        if target is not None:
            motor.jog_to(_reached(target), _past_trigger(scanner))
        else:
            motor.jog_back()
    elif scanner.accept(":"):
        distance = _distance(scanner, motor)
        _reached(motor.desired + distance)
        motor.jog_by(distance, past_trigger=_past_trigger(scanner))
    elif scanner.accept("^"):
        distance = _distance(scanner, motor)
        _reached(motor.encoder + distance)
        motor.jog_by(distance, from_actual=True, past_trigger=_past_trigger(scanner))
    else:
        raise scanner.refusal("J+ J- J/ J= J: or J^")


def _distance(scanner: Scanner, motor: Motor) -> float:
    distance = _amount(scanner, motor)
    if distance is None:
        raise scanner.refusal("a distance as in J^1000")
    return distance


def _amount(scanner: Scanner, motor: Motor) -> float | None:
    """Return a constant, or with `*` the motor's variable jog register; None when there is neither."""
    return motor.variable_jog if scanner.accept("*") else signed_constant(scanner)


def _reached(counts: float) -> float:
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
    return _reached(counts)


def _kill(context: Context) -> None:
    """Ignore a motor that is not activated: it is off already."""
    context.controller.refuse_in_control(context.motor_number)
    context.motor.kill()


def _open_loop(scanner: Scanner, context: Context) -> None:
    percent = signed_constant(scanner)
    if percent is None:
        raise scanner.refusal("an output in percent as in O10")
    _free_motor(context).open_loop(percent)


WORDS: dict[str, Handler] = {
    "J": _jog,
    **dict.fromkeys(("HM", "HOME"), act(lambda context: _free_motor(context).home())),
    **dict.fromkeys(("HMZ", "HOMEZ"), act(lambda context: _free_motor(context).home_zero())),
}

LETTERS: dict[str, Handler] = {
    "K": act(_kill),
    "O": _open_loop,
    "$": act(lambda context: _free_motor(context).phase()),
}
