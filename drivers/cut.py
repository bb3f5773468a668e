"""A cut planned: the tool path that a job wants, the program that makes it, and what that program really does.

Strategies: `none` keeps the tool at its depth, `paper` is Prog. 1 of Lee and Lee (2001), `pvt` inverts the
servo at the lobe frequency. Findings carry codes `cut.*`; refusals stop the cut, warnings are told before it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import pairwise

from drivers.errors import DriverError
from drivers.pmac.axes import read_definitions
from drivers.pmac.check import CheckedMove, CheckedProgram, extent, loop_lines, run_through
from drivers.pmac.language.errors import PmacError
from drivers.pmac.program_text import ProgramText, read_program
from drivers.pmac.programs.paper import DEFAULT_TS_MS, paper_program, spindle_start_counts
from drivers.pmac.programs.pvt import fits_whole_milliseconds, pvt_program
from drivers.pmac.programs.setup import CutSetup, cut_setup, refuse_endless
from drivers.pmac.settings import PARTS_PER_COUNT, settings_with
from profiles.compensation import SMALLEST_RESPONSE, Sinusoid, invert, wanted_path
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.rules import Finding, Severity
from profiles.servo import following_error_um, sampled_response

LEAST_TURNS = 3.0
LEAST_CUT_S = 0.2
"""The shortest cut: so many turns, and so long, for the looks at the machine during it."""


STEADY_FEED = 0.999999
"""Share of the longest feed in a loop from which a move belongs to the steady cut."""


class Strategy(StrEnum):
    """How the tool is locked to the spindle."""

    NONE = "none"
    PAPER = "paper"
    PVT = "pvt"


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPlan:
    """Everything that is known before anything moves. Start positions are counts of tool, spindle, carriage.

    `checked` is the whole motion of the program, move by move.
    """

    strategy: Strategy
    wanted: Sinusoid
    setup: CutSetup
    text: str
    program: ProgramText
    tool_start: float
    spindle_start: float
    carriage_start: float
    spindle_speed_rpm: float
    segment_ms: float
    duration_s: float
    findings: tuple[Finding, ...]
    checked: CheckedProgram = field(repr=False, compare=False)


def plan_cut(
    job: Job, machine: MachineProfile, strategy: Strategy, ts_ms: int | None = None, *, from_turn: int = 0
) -> CutPlan:
    """Plan a cut. `ts_ms` is the TS of the `paper` strategy in whole ms, None as printed.

    The spindle begins `from_turn` whole turns away from its index: an axis that was never turned back since its
    home has no reason to go all the way for one angle.

    Raises:
        ProblemError: the job cannot be turned into a program at all (`program.too_fast`, `program.too_long`,
            `response.too_small`), or the controller would refuse it (`program.refused`).
    """
    wanted = wanted_path(job)
    turned = float(from_turn * machine.spindle.counts_per_rev)
    setup = cut_setup(job, machine, turned + first_spindle_counts(job, machine, strategy))
    if strategy is Strategy.PAPER:
        refuse_endless(2 * job.jaws * setup.turns)
        text = paper_program(job, machine, setup, DEFAULT_TS_MS if ts_ms is None else ts_ms)
        tool_start = setup.surface
    else:
        flat = replace(wanted, amplitude_um=0.0)
        command = _inverse(job, machine, wanted) if strategy is Strategy.PVT else flat
        text = pvt_program(job, setup, command)
        tool_start = setup.retracted
    program, checked = _checked(text, machine, _start(machine, setup, tool_start))
    loop = _steady_moves(program, checked, machine)
    speed_rpm = _speed_rpm(loop, checked, machine)
    return CutPlan(
        strategy=strategy,
        wanted=wanted,
        setup=setup,
        text=text,
        program=program,
        tool_start=tool_start,
        spindle_start=setup.spindle_start,
        carriage_start=setup.carriage_start,
        spindle_speed_rpm=speed_rpm,
        segment_ms=loop[-1].used.tm_ms,
        duration_s=checked.duration_ms / 1000.0,
        findings=(
            *_path_findings(loop, checked, machine, job, speed_rpm),
            *_limit_findings(checked, machine),
            *_jaw_findings(checked, machine),
            *_servo_findings(loop, checked, machine, job, speed_rpm),
            *_length_findings(job),
        ),
        checked=checked,
    )


def first_spindle_counts(job: Job, machine: MachineProfile, strategy: Strategy) -> float:
    """Return where the spindle begins a cut that is planned from turn 0, in counts from its index."""
    return spindle_start_counts(job, machine) if strategy is Strategy.PAPER else 0.0


def _checked(text: str, machine: MachineProfile, start: dict[int, float]) -> tuple[ProgramText, CheckedProgram]:
    """Read a program and run it through.

    Raises:
        DriverError: `program.refused`.
    """
    definitions = read_definitions(machine.controller.axis_definitions)
    try:
        program = read_program(text)
        return program, run_through(program, settings_with(machine.controller.variables), definitions, start)
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", value=str(error))) from error


def _inverse(job: Job, machine: MachineProfile, wanted: Sinusoid) -> Sinusoid:
    """Return the command of the `pvt` strategy.

    Raises:
        ProblemError: `program.too_fast` with the speed that would pass, `response.too_small`.
    """
    command = invert(wanted, complex(sampled_response(machine, job.lobe_frequency_hz)))
    if fits_whole_milliseconds(command, job.lobe_frequency_hz):
        return command
    slower_rpm = math.floor(job.spindle_speed_rpm)
    while slower_rpm > 1 and not _fits_at(job, machine, wanted, slower_rpm):
        slower_rpm -= 1
    value, limit = f"{job.spindle_speed_rpm:g} rpm", f"<= {slower_rpm} rpm"
    raise DriverError(Problem(code="program.too_fast", key="spindle_speed_rpm", value=value, limit=limit))


def _fits_at(job: Job, machine: MachineProfile, wanted: Sinusoid, speed_rpm: float) -> bool:
    frequency_hz = job.jaws * speed_rpm / 60.0
    response = complex(sampled_response(machine, frequency_hz))
    if abs(response) < SMALLEST_RESPONSE:
        return False
    return fits_whole_milliseconds(invert(wanted, response), frequency_hz)


def _start(machine: MachineProfile, setup: CutSetup, tool_start: float) -> dict[int, float]:
    return {
        machine.tool.motor: tool_start,
        machine.spindle.motor: setup.spindle_start,
        machine.carriage.motor: setup.carriage_start,
    }


def _steady_moves(
    program: ProgramText, checked: CheckedProgram, machine: MachineProfile
) -> tuple[CheckedMove, ...]:
    """Return the moves of the loop in which the carriage feeds, without those that lead into and out of it."""
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


def _speed_rpm(loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile) -> float:
    index = checked.motors.index(machine.spindle.motor)
    counts = loop[-1].record.target[index] - loop[0].record.target[index]
    minutes = sum(move.used.tm_ms for move in loop[1:]) / 60_000.0
    return counts / machine.spindle.counts_per_rev / minutes


def _path_findings(
    loop: tuple[CheckedMove, ...],
    checked: CheckedProgram,
    machine: MachineProfile,
    job: Job,
    speed_rpm: float,
) -> list[Finding]:
    """Stretched segments, the speed that they leave, and the stroke that blending eats."""
    findings = []
    asked, used = loop[-1].record.asked.tm_ms, loop[-1].used.tm_ms
    if used > asked * (1.0 + 1e-9):
        findings.append(_warning("cut.segment_stretched", "TM", f"{used:g} ms", f"{asked:g} ms"))
    if not math.isclose(speed_rpm, job.spindle_speed_rpm, rel_tol=1e-6):
        findings.append(
            _warning(
                "cut.speed_differs",
                "spindle_speed_rpm",
                f"{speed_rpm:.6g} rpm",
                f"{job.spindle_speed_rpm:g} rpm",
            )
        )
    index = checked.motors.index(machine.tool.motor)
    targets = [move.record.target[index] for move in loop]
    low, high = _stroke(loop, checked, machine)
    asked_um = (max(targets) - min(targets)) * machine.tool.count_um
    kept_um = (high - low) * machine.tool.count_um
    if asked_um > 0.0 and kept_um < 0.98 * asked_um:
        kept = f"{kept_um:.2f} um ({100.0 * kept_um / asked_um:.1f} %)"
        findings.append(_warning("cut.stroke_lost", "stroke", kept, f"{asked_um:.2f} um"))
    return findings


def _limit_findings(checked: CheckedProgram, machine: MachineProfile) -> list[Finding]:
    """Program velocities above Ix16 (which does not guard PVT) and targets beyond the software limits."""
    variables = machine.controller.variables
    findings = []
    for motor in checked.motors:
        fastest = variables[f"I{motor}16"]
        if checked.peak_velocity[motor] > fastest * (1.0 + 1e-9):
            value = f"{checked.peak_velocity[motor]:.4g} counts/ms"
            findings.append(_refusal("cut.too_fast", f"I{motor}16", value, f"<= {fastest:g} counts/ms"))
        high, low = variables[f"I{motor}13"], variables[f"I{motor}14"]
        if high and checked.highest[motor] > high:
            value = f"{checked.highest[motor]:.0f} counts"
            findings.append(_refusal("cut.beyond_travel", f"I{motor}13", value, f"<= {high:g} counts"))
        if low and checked.lowest[motor] < low:
            value = f"{checked.lowest[motor]:.0f} counts"
            findings.append(_refusal("cut.beyond_travel", f"I{motor}14", value, f">= {low:g} counts"))
    return findings


def _jaw_findings(checked: CheckedProgram, machine: MachineProfile) -> list[Finding]:
    """The carriage runs on while the tool goes out; even so it must stay clear of the jaws."""
    carriage = machine.carriage
    furthest_mm = checked.highest[carriage.motor] / carriage.counts_per_mm + 0.5 * machine.tool.wiper_land_mm
    allowed_mm = carriage.jaw_face_mm - carriage.jaw_clearance_mm
    if furthest_mm <= allowed_mm:
        return []
    return [_refusal("cut.near_jaws", "cut_length_mm", f"{furthest_mm:.2f} mm", f"<= {allowed_mm:g} mm")]


def _servo_findings(
    loop: tuple[CheckedMove, ...],
    checked: CheckedProgram,
    machine: MachineProfile,
    job: Job,
    speed_rpm: float,
) -> list[Finding]:
    """A path whose lag alone would trip the following-error limit must not be started.

    Whatever its shape, the path is taken as a sine of its own stroke at the lobe frequency.
    """
    low, high = _stroke(loop, checked, machine)
    amplitude_um = 0.5 * (high - low) * machine.tool.count_um
    error_um = following_error_um(machine, amplitude_um, job.jaws * speed_rpm / 60.0)
    key = f"I{machine.tool.motor}11"
    limit_um = machine.controller.variables[key] / PARTS_PER_COUNT * machine.tool.count_um
    if error_um < limit_um:
        return []
    return [_refusal("cut.following_error", key, f"{error_um:.1f} um", f"< {limit_um:g} um")]


def _length_findings(job: Job) -> list[Finding]:
    """A cut must last for some looks at the machine, or nobody can say how it went."""
    turns = max(LEAST_TURNS, 1.0 + LEAST_CUT_S * job.spindle_speed_rpm / 60.0)
    least_mm = turns * job.feed_mm_per_rev
    if job.cut_length_mm >= least_mm:
        return []
    return [_refusal("cut.too_short", "cut_length_mm", f"{job.cut_length_mm:g} mm", f">= {least_mm:.3g} mm")]


def _stroke(
    loop: tuple[CheckedMove, ...], checked: CheckedProgram, machine: MachineProfile
) -> tuple[float, float]:
    """Return the lowest and highest tool position of the steady cut, counts."""
    index = checked.motors.index(machine.tool.motor)
    return extent([piece for move in loop[1:] for piece in move.pieces], index)


def _warning(code: str, key: str, value: str, limit: str) -> Finding:
    return Finding(severity=Severity.WARNING, problem=Problem(code=code, key=key, value=value, limit=limit))


def _refusal(code: str, key: str, value: str, limit: str) -> Finding:
    return Finding(severity=Severity.REFUSAL, problem=Problem(code=code, key=key, value=value, limit=limit))
