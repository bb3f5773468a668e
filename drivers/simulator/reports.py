"""What the card answers about motors, coordinate systems and itself."""

from __future__ import annotations

from drivers.pmac.dialect import PMAC
from drivers.pmac.execution import FEEDRATE_AXES
from drivers.pmac.language.text import format_number
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.status import encode
from drivers.simulator.controller import Controller
from drivers.simulator.motor import Motor


def position(motor: Motor) -> str:
    """Actual position in counts."""
    return format_number(motor.encoder)


def velocity(motor: Motor) -> str:
    """Actual velocity in counts per servo cycle."""
    return format_number(motor.encoder_step)


def following_error(motor: Motor) -> str:
    """Following error in counts, to a thousandth."""
    return format_number(round(motor.following_error, 3))


def motor_status(controller: Controller, motor: Motor) -> str:
    """Twelve digits of `?`."""
    system = controller.system_of(motor.number)
    in_program = system is not None and system.moving
    conditions = {
        "activated": motor.activated,
        "open_loop": not motor.enabled,
        "move_timer_active": in_program or motor.jogging,
        "integration_mode": motor.variable(34) != 0.0,
        "desired_velocity_zero": motor.velocity == 0.0,
        "abort_deceleration": motor.aborting,
        "home_search": motor.homing,
        "assigned": system is not None,
        "amplifier_enabled": motor.enabled,
        "home_complete": motor.home_complete,
        "fatal_following_error": motor.fatal_error,
        "warning_following_error": _warning(motor),
        "in_position": motor.in_position and not in_program,
    }
    number = system.number - 1 if system is not None else 0
    return encode((name for name, holds in conditions.items() if holds), PMAC.motor_bits, (0, number << 20))


def system_status(controller: Controller, number: int) -> str:
    """Twelve digits of `??`."""
    system = controller.systems[number]
    motors = system.motors
    conditions = {
        **{f"{axis.lower()}_incremental": axis in system.modes.incremental for axis in "XYZ"},
        **{f"{axis.lower()}_feedrate": axis in FEEDRATE_AXES for axis in "XYZ"},
        "by_move_time": system.modes.by_move_time,
        "continuous_motion": system.running,
        "running_program": system.running,
        "runtime_error": system.runtime_error,
        "fatal_following_error": any(motor.fatal_error for motor in motors),
        "warning_following_error": any(_warning(motor) for motor in motors),
        "in_position": bool(motors) and not system.moving and all(motor.in_position for motor in motors),
        "pvt_or_spline": system.modes.mode == "PVT",
        "rapid": system.modes.mode == "PVT",
    }
    return encode((name for name, holds in conditions.items() if holds), PMAC.system_bits)


def global_status(controller: Controller) -> str:
    """Twelve digits of `???`."""
    names = ["this_card_addressed"]
    if controller.open_buffer is not None:
        names.append("motion_buffer_open")
    return encode(names, PMAC.global_bits)


def _warning(motor: Motor) -> bool:
    limit = motor.variable(12)
    return motor.enabled and limit > 0.0 and abs(motor.following_error) * PARTS_PER_COUNT > limit
