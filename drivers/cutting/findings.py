"""Findings about a planned cut before it is made: codes `cut.*`; refusals stop it, warnings are only reported.

The steady cut excludes the lead-in and lead-out moves; its speed and stroke are judged.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from drivers.commissioning.checked_configuration import length, speed
from drivers.pmac.check import CheckedMove, CheckedProgram, loop_lines
from drivers.pmac.motor_settings import MotorSettings
from drivers.pmac.program_text import ProgramText
from drivers.pmac.programs.setup import SERVO
from drivers.pmac.trajectory.cubics import motion_of
from profiles.axis.servo import following_error_um
from profiles.compensations.path import LobedPath
from profiles.findings import Finding, Severity
from profiles.job import Job
from profiles.lobe.along import largest_lobe
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import LEAST_CHIP_MM

STEADY_FEED = 0.999999  # fraction of the longest feed in a loop from which a move belongs to the steady cut


def steady_moves(
    program: ProgramText, checked: CheckedProgram, machine: MachineProfile
) -> tuple[CheckedMove, ...]:
    """Return the moves of the loop in which the carriage feeds, without lead-in and lead-out."""
    lines = loop_lines(program.program)
    index = checked.motors.index(machine.carriage.motor)
    steps = [
        (after.record.target[index] - before.record.target[index], after)
        for before, after in pairwise(checked.moves)
        if after.record.line in lines
    ]
    furthest = max(step for step, _ in steps)
    moves = [move for step, move in steps if step > STEADY_FEED * furthest]
    tail = max(2, len(moves) // 4)
    return tuple(moves[-tail - 1 : -1])


def speed_rpm(loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile) -> float:
    """Return the speed of the spindle in the steady cut."""
    index = checked.motors.index(machine.spindle.motor)
    counts = loop[-1].record.target[index] - loop[0].record.target[index]
    minutes = sum(move.used_times.tm_ms for move in loop[1:]) / 60_000.0
    return counts / machine.spindle.counts_per_rev / minutes


def stroke(loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile) -> tuple[float, float]:
    """Return the lowest and highest tool position of the steady cut, counts."""
    index = checked.motors.index(machine.tool.motor)
    return motion_of([piece for move in loop[1:] for piece in move.pieces], index).extent()


LEAVING_STEP_DEG = 0.5  # sampling round the part: sees at least 97 % of the highest harmonic, 50 UPR
LEAVING_PLACES = 9  # along the cut
LEAST_TURNS = 3.0
LEAST_CUT_S = 0.2  # the shortest cut, in turns and in time, so that the machine can be polled during it


def cut_findings(
    loop: tuple[CheckedMove, ...],
    checked: CheckedProgram,
    machine: MachineProfile,
    job: Job,
    speed_rpm: float,
    largest_um: float = 0.0,
) -> tuple[Finding, ...]:
    """Return all findings; `loop` are the moves of the steady cut, `largest_um` an amplitude before them."""
    low, high = stroke(loop, checked, machine)
    stroke_um = (high - low) * machine.tool.count_um
    return (
        *_path_findings(loop, checked, machine, job, speed_rpm, stroke_um),
        *_limit_findings(checked, machine),
        *_jaw_findings(checked, machine),
        *_servo_findings(machine, job, speed_rpm, max(0.5 * stroke_um, largest_um)),
        *_length_findings(job),
    )


def leaving_findings(job: Job, target: LobedPath) -> tuple[Finding, ...]:
    """Check that a path keeps the edge cutting, at every angle and over the length of the cut.

    The part comes out at the depth of the job, whatever mean a learned path commands for that. Where the tool
    leaves the surface it removes nothing, and the material stays on the part.
    """
    angle_deg = np.arange(0.0, 360.0, LEAVING_STEP_DEG)
    past_mm = 0.5 * job.cut_length_mm * np.linspace(-1.0, 1.0, LEAVING_PLACES)
    path_um = [float(np.min(target.at_um(angle_deg, each))) - target.mean_um for each in past_mm.tolist()]
    place = int(np.argmin(path_um))
    least_um, z_mm = 1000.0 * job.depth_of_cut_mm + path_um[place], middle_mm(job) - float(past_mm[place])
    if least_um >= 1000.0 * LEAST_CHIP_MM:
        return ()
    needed_mm = math.ceil(round((job.depth_of_cut_mm + LEAST_CHIP_MM - least_um / 1000.0) * 1e4, 6)) / 1e4
    at = f" (Z {z_mm:.1f} mm)" if target.along.orders or target.along.mean_um else ""
    value, limit = f"{least_um:.2f} um{at}", f">= {needed_mm:.6g} mm"
    return (_refusal("cut.leaves_part", "depth_of_cut_mm", value, limit),)


def clock_findings(machine: MachineProfile) -> tuple[Finding, ...]:
    """Return why a program would start after the index that it waits for: I11 elapses on its own time base."""
    delay_ms = machine.controller.variables.get("I11", 0.0)
    return (_refusal("cut.clock_late", "I11", f"{delay_ms:g} ms", "= 0 ms"),) if delay_ms else ()


def _path_findings(
    loop: tuple[CheckedMove, ...],
    checked: CheckedProgram,
    machine: MachineProfile,
    job: Job,
    speed_rpm: float,
    kept_um: float,
) -> list[Finding]:
    """Find stretched segments, the speed that results, and the stroke lost to blending."""
    findings = []
    asked, used = loop[-1].record.asked.tm_ms, loop[-1].used_times.tm_ms
    if used > asked * (1.0 + 1e-9):
        findings.append(_warning("cut.segment_stretched", "TM", f"{used:g} ms", f"{asked:g} ms"))
    if not math.isclose(speed_rpm, job.spindle_speed_rpm, rel_tol=1e-6):
        value, limit = f"{speed_rpm:.6g} rpm", f"{job.spindle_speed_rpm:g} rpm"
        findings.append(_warning("cut.speed_differs", "spindle_speed_rpm", value, limit))
    index = checked.motors.index(machine.tool.motor)
    targets = [move.record.target[index] for move in loop]
    asked_um = (max(targets) - min(targets)) * machine.tool.count_um
    if asked_um > 0.0 and kept_um < 0.98 * asked_um:
        kept = f"{kept_um:.2f} um ({100.0 * kept_um / asked_um:.1f} %)"
        findings.append(_warning("cut.stroke_lost", "stroke", kept, f"{asked_um:.2f} um"))
    return findings


def _limit_findings(checked: CheckedProgram, machine: MachineProfile) -> list[Finding]:
    """Find program velocities above Ix16 (which does not guard PVT) and targets beyond the software limits."""
    variables = machine.controller.variables
    findings = []
    for motor in checked.motors:
        if motor == machine.spindle.motor and machine.spindle.drive != SERVO:
            continue
        fastest = variables[f"I{motor}16"]
        if checked.peak_velocity[motor] > fastest * (1.0 + 1e-9):
            value = speed(checked.peak_velocity[motor], motor, machine)
            findings.append(_refusal("cut.too_fast", f"I{motor}16", value, f"<= {speed(fastest, motor, machine)}"))
        for number, sign, extent, above in (
            ("13", "<=", checked.highest, 1.0),
            ("14", ">=", checked.lowest, -1.0),
        ):
            end, furthest = variables[f"I{motor}{number}"], extent[motor]
            if end and above * (furthest - end) > 0.0:
                value, limit = (length(each, motor, machine) for each in (furthest, end))
                findings.append(_refusal("cut.beyond_travel", f"I{motor}{number}", value, f"{sign} {limit}"))
    return findings


def _jaw_findings(checked: CheckedProgram, machine: MachineProfile) -> list[Finding]:
    """Check that the carriage, which keeps moving while the tool retracts, stays clear of the jaws."""
    carriage = machine.carriage
    furthest_mm = checked.highest[carriage.motor] / carriage.counts_per_mm + 0.5 * machine.tool.wiper_land_mm
    allowed_mm = carriage.jaw_face_mm - carriage.jaw_clearance_mm
    if furthest_mm <= allowed_mm:
        return []
    return [_refusal("cut.near_jaws", "cut_length_mm", f"{furthest_mm:.2f} mm", f"<= {allowed_mm:g} mm")]


def _servo_findings(machine: MachineProfile, job: Job, speed_rpm: float, amplitude_um: float) -> list[Finding]:
    """Judge the following error of the path, taken as a sine of its own amplitude at the lobe frequency."""
    error_um = following_error_um(machine, amplitude_um, job.jaws * speed_rpm / 60.0)
    key = f"I{machine.tool.motor}11"
    limit_um = MotorSettings(machine, machine.tool.motor).error_limit_counts * machine.tool.count_um
    if error_um < limit_um:
        return []
    z_mm = largest_lobe(job, machine)[1]
    value = f"{error_um:.1f} um" + ("" if z_mm is None else f" (Z {z_mm:.1f} mm)")
    return [_refusal("cut.following_error", key, value, f"< {limit_um:g} um")]


def _length_findings(job: Job) -> list[Finding]:
    """Check that a cut lasts for a few polls of the machine; otherwise its result cannot be judged."""
    turns = max(LEAST_TURNS, 1.0 + LEAST_CUT_S * job.spindle_speed_rpm / 60.0)
    least_mm = turns * job.feed_mm_per_rev
    if job.cut_length_mm >= least_mm:
        return []
    return [_refusal("cut.too_short", "cut_length_mm", f"{job.cut_length_mm:g} mm", f">= {least_mm:.3g} mm")]


def _warning(code: str, key: str, value: str, limit: str) -> Finding:
    return Finding(severity=Severity.WARNING, problem=Problem(code=code, key=key, value=value, limit=limit))


def _refusal(code: str, key: str, value: str, limit: str) -> Finding:
    return Finding(severity=Severity.REFUSAL, problem=Problem(code=code, key=key, value=value, limit=limit))
