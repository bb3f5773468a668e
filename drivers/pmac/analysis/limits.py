"""Findings about limits: those in the controller's variables, and those of the machine itself."""

from __future__ import annotations

import math
from collections.abc import Callable

from drivers.pmac.analysis.findings import Code, ProgramFinding, finding
from drivers.pmac.analysis.moves import MotorMove
from drivers.pmac.analysis.subject import Subject

_ROUNDING = 1e-9


def limit_findings(subject: Subject) -> list[ProgramFinding]:
    """Return what exceeds a limit; 0 in a variable is no limit."""
    findings: list[ProgramFinding] = []
    for index, motor in enumerate(subject.walk.motors):
        findings += _position(subject, index, motor)
        findings += _velocity(subject, index, motor)
    return [*findings, *_tool(subject), *_spindle(subject), *_jaws(subject)]


def _position(subject: Subject, index: int, motor: int) -> list[ProgramFinding]:
    """Check Ix13 and Ix14, the software limits: the controller stops everything there."""
    lowest, highest = subject.timeline.extent(index, 0.0, subject.timeline.ends_ms)
    findings = []
    for number, reached, beyond in ((13, highest, 1.0), (14, lowest, -1.0)):
        limit = subject.setting(motor, number)
        if limit and beyond * (reached - limit) > _ROUNDING * abs(limit):
            first = [move for move in subject.moves if beyond * (move.motors[index].target - limit) > 0.0][:1]
            lines, name = subject.lines(first), f"I{motor}{number}"
            found = finding(Code.BEYOND_LIMIT, lines, motor=motor, variable=name, counts=reached, limit=limit)
            findings.append(found)
    return findings


def _velocity(subject: Subject, index: int, motor: int) -> list[ProgramFinding]:
    """Check Ix16, which does not limit every mode."""
    limit = subject.setting(motor, 16)
    speeds = [(move.motors[index].peaks.velocity, move) for move in subject.moves if move.mode != "RAPID"]
    fast = [(speed, move) for speed, move in speeds if _over(speed, limit)]
    if not fast:
        return []
    most, lines = max(speed for speed, _ in fast), subject.lines(move for _, move in fast)
    variable = f"I{motor}16"
    return [finding(Code.TOO_FAST, lines, motor=motor, variable=variable, counts_per_ms=most, limit=limit)]


def _tool(subject: Subject) -> list[ProgramFinding]:
    if subject.tool is None:
        return []
    tool, index = subject.machine.tool, subject.tool
    per_mm = tool.counts_per_mm

    def acceleration_m_per_s2(motor: MotorMove) -> float:
        return 1000.0 * motor.peaks.acceleration / per_mm

    def force_n(motor: MotorMove) -> float:
        speed_mm_per_s = 1000.0 * motor.peaks.velocity / per_mm
        damping_n = tool.damping_n_s_per_m * speed_mm_per_s / 1000.0
        return tool.moving_mass_kg * acceleration_m_per_s2(motor) + damping_n

    fastest = tool.encoder_max_acceleration_m_per_s2
    return [
        *_above(subject, index, Code.ACCELERATION_OVER_ENCODER, acceleration_m_per_s2, fastest),
        *_above(subject, index, Code.FORCE_OVER_DRIVE, force_n, tool.peak_force_n),
        *_travel(subject, index, per_mm, (tool.travel_min_mm, tool.travel_max_mm)),
    ]


def _spindle(subject: Subject) -> list[ProgramFinding]:
    if subject.spindle is None:
        return []
    spindle, index = subject.machine.spindle, subject.spindle

    def speed_rpm(motor: MotorMove) -> float:
        return subject.rpm(motor.peaks.velocity)

    def torque_n_m(motor: MotorMove) -> float:
        return spindle.inertia_kg_m2 * motor.peaks.acceleration / spindle.counts_per_rev * 1e6 * math.tau

    return [
        *_above(subject, index, Code.SPEED_OVER_SPINDLE, speed_rpm, spindle.max_speed_rpm),
        *_above(subject, index, Code.TORQUE_OVER_SPINDLE, torque_n_m, spindle.peak_torque_n_m),
    ]


def _jaws(subject: Subject) -> list[ProgramFinding]:
    """Check that the carriage with the tool on it stays clear of the jaws."""
    if subject.carriage is None:
        return []
    carriage = subject.machine.carriage
    nearest_mm = carriage.jaw_face_mm - carriage.jaw_clearance_mm
    limits = (carriage.travel_min_mm, min(nearest_mm, carriage.travel_max_mm))
    return _travel(subject, subject.carriage, carriage.counts_per_mm, limits)


def _travel(subject: Subject, index: int, per_mm: float, limits_mm: tuple[float, float]) -> list[ProgramFinding]:
    """Check the machine's mechanical ends, where the controller's limits do not come first."""
    findings = []
    motor, ends = subject.walk.motors[index], subject.timeline.extent(index, 0.0, subject.timeline.ends_ms)
    for limit_mm, reached, beyond in zip(limits_mm, ends, (-1.0, 1.0), strict=True):
        reached_mm = reached / per_mm
        guarded = subject.setting(motor, 13 if beyond > 0.0 else 14)
        caught = guarded and beyond * (reached - guarded) > 0.0
        if beyond * (reached_mm - limit_mm) > _ROUNDING and not caught:
            targets = ((move.motors[index].target / per_mm, move) for move in subject.moves)
            first = [move for target_mm, move in targets if beyond * (target_mm - limit_mm) > 0.0][:1]
            lines = subject.lines(first)
            findings.append(finding(Code.BEYOND_TRAVEL, lines, motor=motor, mm=reached_mm, limit_mm=limit_mm))
    return findings


def _above(
    subject: Subject, index: int, code: Code, quantity: Callable[[MotorMove], float], limit: float
) -> list[ProgramFinding]:
    high = [move for move in subject.moves if _over(quantity(move.motors[index]), limit)]
    if not high:
        return []
    worst = max(quantity(move.motors[index]) for move in high)
    return [finding(code, subject.lines(high), motor=subject.walk.motors[index], value=worst, limit=limit)]


def _over(value: float, limit: float) -> bool:
    return 0.0 < limit < value * (1.0 - _ROUNDING)
