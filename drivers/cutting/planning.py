"""From a job on a machine to a planned cut: the program of a strategy, run through before it is sent."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from drivers.cutting.corrected import with_spindle, with_table
from drivers.cutting.findings import clock_findings, cut_findings, leaving_findings, speed_rpm, steady_moves
from drivers.cutting.plan import CutPlan, Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response, path_response
from drivers.pmac.axes import read_definitions
from drivers.pmac.check import CheckedProgram, run_through
from drivers.pmac.compensation.table import CompensationTable
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.program_text import ProgramText, read_program
from drivers.pmac.programs.cam import cam_program, correction_register
from drivers.pmac.programs.cam_table import make_cam
from drivers.pmac.programs.paper import DEFAULT_TS_MS, paper_program, spindle_start_counts
from drivers.pmac.programs.pvt import fits_whole_milliseconds, pvt_program
from drivers.pmac.programs.setup import SERVO, CutSetup, cut_setup, refuse_endless
from drivers.pmac.programs.timebase import (
    SpindleClock,
    released_definitions,
    restoring_lines,
    spindle_clock,
    timebase_program,
)
from drivers.pmac.settings import settings_with
from profiles.axis.friction import held_back_um
from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.compensations.path import CutPath, LobedPath, invert, wanted_path
from profiles.compensations.path_bounds import path_problems
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem

__all__ = ["CutPlan", "Strategy", "first_spindle_counts", "nominal_command", "plan_cut"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Planning:
    """What is planned: a job on a machine, the place of the cut, and the path that the part wants."""

    job: Job
    machine: MachineProfile
    dialect: Dialect
    setup: CutSetup
    wanted: LobedPath
    command: LobedPath | None = None
    response: ServoResponse | None = None
    trimmed: bool = False
    in_air: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Made:
    """What a strategy makes of it; `clock` is the spindle where it is the clock of the program."""

    text: str
    tool_start: float
    definitions: tuple[str, ...]
    restore: tuple[str, ...] = ()
    table: CompensationTable | None = None
    correction_register: str = ""
    zero_row_z: float | None = None
    clock: SpindleClock | None = None


def plan_cut(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    ts_ms: int | None = None,
    *,
    from_turn: int = 0,
    lease: str = "",
    path: CutPath | None = None,
    response: ServoResponse | None = None,
    air_mm: float = 0.0,
    trimmed: bool = False,
) -> CutPlan:
    """Plan a cut. `ts_ms` is the TS of the `paper` strategy in whole ms, None as printed.

    `response` is what a strategy that inverts the servo inverts: of its own path, by default that of the machine
    profile. `path` is what was learned of this cut, with its own command; it needs none. A cut in air goes
    `air_mm` further out. One that is `trimmed` listens to the host while it cuts, see `cam_trim`.

    The spindle begins `from_turn` whole turns away from its index: an axis that was never turned back since its
    home has no reason to go all the way for one angle. `lease` is a condition that the program looks at before
    each turn, such as that a timer of the host has not run out.

    Raises:
        ProblemError: the job cannot be turned into a program at all (`program.too_fast`, `program.too_long`,
            `program.no_zero_row`, `program.not_turned`, `program.no_overtones`, `program.no_trim`), a path that
            is none of this job (`path.waves`, `path.beyond`), its servo cannot be inverted (`response.amplified`,
            `response.outside_band`, `response.too_sparse`), or the controller would refuse it (`program.refused`).
    """
    if trimmed:
        _refuse_untrimmed(machine, strategy)
    if path is not None:
        _refuse_beyond(path, job, machine, strategy)
    turned = float(from_turn * machine.spindle.counts_per_rev)
    planning = _Planning(
        job=job,
        machine=machine,
        dialect=DIALECTS[machine.controller.family],
        setup=cut_setup(job, machine, turned + first_spindle_counts(job, machine, strategy), lease, air_mm=air_mm),
        wanted=wanted_path(job) if path is None else path.wanted,
        command=None if path is None else path.command,
        response=response,
        trimmed=trimmed,
        in_air=air_mm > 0.0,
    )
    made = _make(planning, strategy, ts_ms)
    program = _read(made.text, planning.dialect)
    if lease:
        unleased = _make(_unleased(planning), strategy, ts_ms)
        checked = _checked(unleased, _read(unleased.text, planning.dialect), planning)
    else:
        checked = _checked(made, program, planning)
    return _judged(planning, strategy, made, program, checked)


def _judged(
    planning: _Planning, strategy: Strategy, made: _Made, program: ProgramText, checked: CheckedProgram
) -> CutPlan:
    """Return the plan with everything that is found against it."""
    job, machine = planning.job, planning.machine
    loop = steady_moves(program, checked, machine)
    rpm = speed_rpm(loop, checked, machine)
    return CutPlan(
        strategy=strategy,
        wanted=planning.wanted,
        setup=planning.setup,
        text=made.text,
        program=program,
        tool_start=made.tool_start,
        spindle_speed_rpm=rpm,
        segment_ms=loop[-1].used.tm_ms,
        duration_s=checked.duration_ms / 1000.0,
        findings=(
            *cut_findings(loop, checked, machine, job, rpm),
            *(() if strategy is Strategy.NONE else leaving_findings(job, planning.wanted)),
            *(clock_findings(machine) if made.clock else ()),
        ),
        checked=checked,
        axis_definitions=made.definitions,
        restore=made.restore,
        table=made.table,
        correction_register=made.correction_register,
        zero_row_z=made.zero_row_z,
        trimmed=planning.trimmed,
        in_air=planning.in_air,
    )


def first_spindle_counts(job: Job, machine: MachineProfile, strategy: Strategy) -> float:
    """Return where the spindle begins a cut that is planned from turn 0, in counts from its index."""
    return spindle_start_counts(job, machine) if strategy is Strategy.PAPER else 0.0


def _unleased(planning: _Planning) -> _Planning:
    """Return the same without a lease: nobody renews one while a program is run through."""
    return replace(planning, setup=replace(planning.setup, lease=""))


def _make(planning: _Planning, strategy: Strategy, ts_ms: int | None) -> _Made:
    return _paper(planning, ts_ms) if strategy is Strategy.PAPER else _MAKERS[strategy](planning)


def _paper(planning: _Planning, ts_ms: int | None) -> _Made:
    job, machine, setup = planning.job, planning.machine, planning.setup
    _refuse_followed(machine)
    refuse_endless(2 * job.jaws * setup.turns)
    text = paper_program(job, machine, setup, DEFAULT_TS_MS if ts_ms is None else ts_ms)
    return _Made(text=text, tool_start=setup.surface, definitions=machine.controller.axis_definitions)


def _none(planning: _Planning) -> _Made:
    return _by_pvt(planning, replace(planning.wanted, amplitude_um=0.0))


def _pvt(planning: _Planning) -> _Made:
    return _by_pvt(planning, _inverse(planning, Strategy.PVT))


def _by_pvt(planning: _Planning, command: LobedPath) -> _Made:
    _refuse_followed(planning.machine)
    return _Made(
        text=pvt_program(planning.job, planning.setup, command),
        tool_start=planning.setup.retracted,
        definitions=planning.machine.controller.axis_definitions,
    )


def _cam(planning: _Planning) -> _Made:
    job, machine, setup = planning.job, planning.machine, planning.setup
    cam = make_cam(machine, setup, _command(planning, Strategy.CAM))
    return _Made(
        text=cam_program(job, machine, setup, cam, planning.dialect, trimmed=planning.trimmed),
        tool_start=setup.retracted,
        definitions=machine.controller.axis_definitions,
        table=cam.table,
        correction_register=correction_register(machine),
        zero_row_z=cam.zero_z,
    )


def nominal_command(
    job: Job, machine: MachineProfile, strategy: Strategy, response: ServoResponse | None = None
) -> LobedPath:
    """Return the command that the loop turns into the path that the job wants.

    `response` is that of the path of this strategy, by default the one of the machine profile.

    Raises:
        ProfileError: `response.amplified`, `response.outside_band`, `response.too_sparse`.
    """
    inverted = path_response(strategy, machine) if response is None else response
    turns_hz = job.spindle_speed_rpm / 60.0
    return invert(wanted_path(job), lambda lobes: inverted.invertible(lobes * turns_hz))


def _command(planning: _Planning, strategy: Strategy) -> LobedPath:
    return planning.command or nominal_command(planning.job, planning.machine, strategy, planning.response)


def _timebase(planning: _Planning) -> _Made:
    """The time of a servo cycle is what the spindle has turned in the one before."""
    job, machine, setup, dialect = planning.job, planning.machine, planning.setup, planning.dialect
    command = _inverse(planning, Strategy.TIMEBASE)
    definitions, _ = released_definitions(machine)
    return _Made(
        text=timebase_program(job, machine, setup, command, dialect),
        tool_start=setup.retracted,
        definitions=definitions,
        restore=restoring_lines(machine, dialect),
        clock=spindle_clock(job, machine, dialect),
    )


_MAKERS: Mapping[Strategy, Callable[[_Planning], _Made]] = {
    Strategy.NONE: _none,
    Strategy.PVT: _pvt,
    Strategy.CAM: _cam,
    Strategy.TIMEBASE: _timebase,
}


def _refuse_followed(machine: MachineProfile) -> None:
    """Refuse a strategy that turns the spindle itself, where the card cannot.

    Raises:
        DriverError: `program.not_turned`.
    """
    if machine.spindle.drive != SERVO:
        value, limit = machine.spindle.drive, f"{Strategy.CAM}, {Strategy.TIMEBASE}"
        raise DriverError(Problem(code="program.not_turned", key="spindle.drive", value=value, limit=limit))


def _read(text: str, dialect: Dialect) -> ProgramText:
    """Take a program apart as the controller would.

    Raises:
        DriverError: `program.refused`.
    """
    try:
        return read_program(text, motor_count=dialect.motor_count)
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", value=str(error))) from error


def _checked(made: _Made, program: ProgramText, planning: _Planning) -> CheckedProgram:
    """Run a program through, with what is added to its motion and what turns beside it.

    Raises:
        DriverError: `program.refused`.
    """
    machine, setup, dialect = planning.machine, planning.setup, planning.dialect
    start = {
        machine.tool.motor: made.tool_start,
        machine.spindle.motor: setup.spindle_start,
        machine.carriage.motor: setup.carriage_start,
    }
    try:
        definitions = read_definitions(made.definitions)
        settings = settings_with(machine.controller.variables, dialect)
        checked = run_through(program, settings, definitions, start, dialect)
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", value=str(error))) from error
    period_ms = machine.controller.servo_period_ms
    rate = planning.job.spindle_speed_rpm * machine.spindle.counts_per_rev / 60_000.0
    if made.clock is not None:
        # The spindle is ahead of the time that the card has by the cycle that it takes to see it.
        checked = with_spindle(checked, machine.spindle.motor, rate, rate * period_ms, made.clock.stretch)
    elif machine.spindle.motor not in checked.motors:
        checked = with_spindle(checked, machine.spindle.motor, rate)
    return checked if made.table is None else with_table(checked, made.table, period_ms)


def _inverse(planning: _Planning, strategy: Strategy) -> LobedPath:
    """Return the command of segments of whole milliseconds.

    Raises:
        ProblemError: `program.too_fast` with the speed that would pass, `program.no_overtones`,
            `program.no_growth`; those of `nominal_command`.
    """
    job, machine = planning.job, planning.machine
    command = _command(planning, strategy)
    if command.overtones:
        value = ", ".join(str(wave.lobes) for wave in command.overtones)
        raise DriverError(Problem(code="program.no_overtones", key=strategy, value=value, limit=Strategy.CAM))
    if command.growth_per_mm:
        value = f"{100.0 * command.growth_per_mm:g} %/mm"
        raise DriverError(Problem(code="program.no_growth", key=strategy, value=value, limit=Strategy.CAM))
    if fits_whole_milliseconds(command, job.lobe_frequency_hz):
        return command
    slower_rpm = math.floor(job.spindle_speed_rpm)
    while slower_rpm > 1 and not _fits_at(job, machine, slower_rpm):
        slower_rpm -= 1
    value, limit = f"{job.spindle_speed_rpm:g} rpm", f"<= {slower_rpm} rpm"
    raise DriverError(Problem(code="program.too_fast", key="spindle_speed_rpm", value=value, limit=limit))


def _fits_at(job: Job, machine: MachineProfile, speed_rpm: float) -> bool:
    """Whether segments are short enough at another speed, by the profile: an identified band may end before."""
    frequency_hz = job.jaws * speed_rpm / 60.0
    response = nominal_response(Strategy.PVT, machine, frequency_hz)
    if abs(response) * AMPLIFICATION_LIMIT < 1.0:
        return False
    return fits_whole_milliseconds(invert(wanted_path(job), response), frequency_hz)


def _refuse_beyond(path: CutPath, job: Job, machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse a path that corrects another cut than this one.

    Raises:
        DriverError: `path.*`, everything by which it is too far off.
    """
    turns_hz = job.spindle_speed_rpm / 60.0
    problems = path_problems(
        path,
        wanted_path(job),
        lambda lobes: nominal_response(strategy, machine, lobes * turns_hz),
        lambda lobes: held_back_um(machine, job, lobes),
    )
    if problems:
        raise DriverError(*problems)


def _refuse_untrimmed(machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse to learn within a cut that does not listen: without a table, or on a spindle that others turn.

    Raises:
        DriverError: `program.no_trim`.
    """
    if strategy is not Strategy.CAM or machine.spindle.drive != SERVO:
        met = f"{strategy}, {machine.spindle.drive}"
        raise DriverError(Problem(code="program.no_trim", value=met, limit=f"{Strategy.CAM}, {SERVO}"))
