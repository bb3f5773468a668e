"""What a coordinate system and its motors have to be like before a program may move them."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.trajectory.pieces import Vector
from drivers.simulator.motor import Motor
from drivers.simulator.program_motion import ProgramMotion

OFF_BY_COUNTS = 1.0 / 32.0
"""How far a motor may be off the place where a program was stopped; the card reads a count no finer."""


def refuse_unfit(motors: Sequence[Motor]) -> None:
    """Make sure that there are motors, all activated, in closed loop, and free to go at least one way.

    Raises:
        PmacError: 014, 013, 012, 010, in this order.
    """
    if not motors:
        raise PmacError(ErrorCode.NO_MOTORS, "no motor has an axis")
    for motor in motors:
        if not motor.activated:
            raise PmacError(ErrorCode.NOT_ACTIVATED, f"#{motor.number}")
    for motor in motors:
        if not motor.enabled:
            raise PmacError(ErrorCode.OPEN_LOOP, f"#{motor.number}")
    for motor in motors:
        if motor.positive_limit and motor.negative_limit:
            raise PmacError(ErrorCode.BOTH_LIMITS_SET, f"#{motor.number}")


def refuse_moving(motion: ProgramMotion) -> None:
    """Make sure that no program moves the axes.

    Raises:
        PmacError: 001, one does.
    """
    if motion.running or motion.moving:
        raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"&{motion.system} is moving")


def refuse_busy(motion: ProgramMotion, motors: Sequence[Motor]) -> None:
    """Make sure that nothing moves the motors, a program or a jog.

    Raises:
        PmacError: 011, a program that was stopped is not yet at rest; 001, anything else moves them.
    """
    if motion.moving and not motion.running and motion.resumable:
        raise PmacError(ErrorCode.MOVE_NOT_COMPLETED, f"&{motion.system} is not yet at rest")
    refuse_moving(motion)
    for motor in motors:
        if motor.jogging:
            raise PmacError(ErrorCode.NOT_WHILE_RUNNING, f"#{motor.number} is moving")


def refuse_moved(motors: Sequence[Motor], stopped: Vector) -> None:
    """Make sure that every motor is still where a program was stopped, in counts.

    Raises:
        PmacError: 017, one is not, or moves.
    """
    for motor, position in zip(motors, stopped, strict=True):
        if motor.jogging or abs(motor.desired - position) > OFF_BY_COUNTS:
            raise PmacError(ErrorCode.OFF_STOPPED_POSITION, f"#{motor.number} was stopped at {position:g} counts")
