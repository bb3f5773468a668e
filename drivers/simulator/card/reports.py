"""The controller's reports on motors, coordinate systems and itself."""

from __future__ import annotations

from drivers.pmac.buffer_text import BufferKind
from drivers.pmac.dialect import FamilySetting
from drivers.pmac.language.text import format_number
from drivers.pmac.status import pack
from drivers.simulator.card.controller import SimulatedController
from drivers.simulator.card.jog_motion import TriggerStage
from drivers.simulator.card.motor import Motor

VELOCITY_STEP = 0.1  # resolution of V and control-V, in counts per servo cycle
_BLENDING_OFF = 92
_SEGMENTED = ("LINEAR", "CIRCLE1", "CIRCLE2")
_SYSTEM_BIT = 20
_AXIS_BIT = 16

_MODES = {
    "PVT": ("pvt_or_spline", "rapid"),
    "RAPID": ("rapid",),
    "SPLINE1": ("pvt_or_spline", "circle_or_spline"),
    "SPLINE2": ("pvt_or_spline", "circle_or_spline"),
    "CIRCLE1": ("circle_or_spline",),
    "CIRCLE2": ("circle_or_spline", "rapid"),
}


def position(controller: SimulatedController, motor: Motor) -> str:
    """Actual position in counts."""
    return _in_steps(motor.position, controller.dialect.position_step)


def velocity(motor: Motor) -> str:
    """Actual velocity in counts per servo cycle."""
    return _in_steps(motor.reported_velocity, VELOCITY_STEP)


def following_error(motor: Motor) -> str:
    """Following error in counts, to a thousandth."""
    return format_number(round(motor.following_error, 3))


def motor_words(controller: SimulatedController, motor: Motor) -> tuple[int, ...]:
    """The two words of `?`."""
    system = controller.system_of(motor.number)
    travel, jog = motor.travel, motor.jog
    warning, in_position = motor.judge_error()
    conditions = {
        "activated": motor.activated,
        "negative_limit": travel.negative,
        "positive_limit": travel.positive,
        "following_enabled": int(motor.variable(6)) & 1 == 1,
        "following_offset": motor.offset_following,
        "open_loop": not motor.enabled,
        "move_timer_active": motor.program_timer or motor.jogging,
        "integration_mode": motor.variable(34) != 0.0,
        "dwell": system is not None and system.motion.dwelling,
        "desired_velocity_zero": motor.enabled and motor.velocity == 0.0,
        "abort_deceleration": jog.aborting,
        "home_search": jog.stage is TriggerStage.SEARCHING,
        "assigned": system is not None,
        "amplifier_enabled": motor.amplifier_enabled,
        "stopped_on_limit": travel.stopped,
        "home_complete": motor.home_complete,
        "trigger_move": jog.stage is not None,
        "amplifier_fault": motor.amplifier_fault,
        "fatal_following_error": motor.fatal_error,
        "warning_following_error": warning,
        "in_position": in_position,
    }
    dialect = controller.dialect
    first, second = pack(conditions, dialect.motor_bits)
    if system is not None:
        axis = dialect.axis_codes.get(system.frame.definitions[motor.number].axis, 0)
        second |= (system.number - 1) << _SYSTEM_BIT | axis << _AXIS_BIT
    return first, second


def system_words(controller: SimulatedController, number: int) -> tuple[int, ...]:
    """The words of `??`, two or three of them."""
    system = controller.systems[number]
    motors, motion, modes = system.frame.motors, system.motion, system.modes
    variables = controller.variables
    continuous = system.running and not motion.single_step and not variables.system(number, _BLENDING_OFF)
    interpolating = not (motion.dwelling or motion.homing)
    segmented = modes.mode in _SEGMENTED and variables.setting(FamilySetting.SEGMENT_MS, number) > 0.0
    judged = [motor.judge_error() for motor in motors]
    conditions = {
        **{f"{axis.lower()}_incremental": True for axis in modes.incremental},
        **{f"{axis.lower()}_feedrate": True for axis in modes.feedrate_axes},
        "radius_incremental": modes.radius_incremental,
        "by_move_time": modes.by_move_time,
        "continuous_request": continuous,
        "continuous_motion": continuous and interpolating,
        "single_step": motion.single_step,
        "running_program": system.running,
        "runtime_error": motion.runtime_error,
        "circle_radius_error": motion.radius_error,
        "amplifier_fault": any(motor.amplifier_fault for motor in motors),
        "fatal_following_error": any(motor.fatal_error for motor in motors),
        "warning_following_error": any(warning for warning, _ in judged),
        "end_of_block_stop": system.end_of_block_stop,
        "program_hold": system.program_hold,
        "resume_error": system.resume_error,
        "pre_jog": any(motor.jog.pre_jog for motor in motors),
        "segmented_move": segmented and system.moving and interpolating,
        "in_position": bool(motors) and not system.moving and all(settled for _, settled in judged),
        **dict.fromkeys(_MODES.get(modes.mode, ()), True),
    }
    dialect = controller.dialect
    return pack(conditions, dialect.system_bits, dialect.system_words)


def global_words(controller: SimulatedController, *, all_cards: bool = False) -> tuple[int, ...]:
    """The two words of `???`."""
    opened = controller.open_buffer
    conditions = {
        "all_cards_addressed": all_cards,
        "this_card_addressed": not all_cards,
        "gathering": controller.gather.running,
        "compensation_on": bool(controller.variables.i(51) and controller.tables.tables),
        "watchdog": controller.watchdog_tripped,
        "motion_buffer_open": opened is not None and opened.kind is not BufferKind.PLC,
        "plc_buffer_open": opened is not None and opened.kind is BufferKind.PLC,
    }
    return pack(conditions, controller.dialect.global_bits)


def _in_steps(value: float, step: float) -> str:
    return format_number(round(round(value / step) * step, 5))
