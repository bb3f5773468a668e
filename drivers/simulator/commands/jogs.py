"""Move single motors: jogs, home searches, phasing, open loop and kill."""

from __future__ import annotations

from collections.abc import Callable

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner
from drivers.pmac.trajectory.frame import FARTHEST_COUNTS
from drivers.simulator.card.motor import Motor
from drivers.simulator.context import Context, Handler, Reading, Step, act, signed_constant


def _free_motor(context: Context) -> Motor:
    """Return the addressed motor. Raises PmacError: 013 not activated, 001 a program moves it."""
    motor = context.active_motor
    context.controller.refuse_in_control(motor.number)
    return motor


_Target = Callable[[Motor], float]


def _jog(scanner: Scanner, reading: Reading) -> Step:
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
    return _of_motor(lambda motor: motor.jog_to(_reached(target(motor)), past_trigger))


def _jog_by(distance: _Target, past_trigger: float | None, *, from_actual: bool) -> Step:
    def act(motor: Motor) -> None:
        counts = distance(motor)
        _reached((motor.encoder if from_actual else motor.desired) + counts)
        motor.jog_by(counts, from_actual=from_actual, past_trigger=past_trigger)

    return _of_motor(act)


def _amount(scanner: Scanner) -> _Target | None:
    """Return a constant, or with `*` the motor's variable jog register; None when there is neither."""
    if scanner.accept("*"):
        return lambda motor: motor.variable_jog
    counts = signed_constant(scanner)
    return None if counts is None else lambda motor: counts


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


def _open_loop(scanner: Scanner, reading: Reading) -> Step:
    percent = signed_constant(scanner)
    if percent is None:
        raise scanner.refusal("an output in percent as in O10")
    return lambda context: _free_motor(context).open_loop(percent)


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
