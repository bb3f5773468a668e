"""Plan a cut from a job on a machine: a strategy's program, simulated before it is sent."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

from drivers.cutting.corrected_motion import with_spindle, with_table
from drivers.cutting.findings import clock_findings, cut_findings, leaving_findings, speed_rpm, steady_moves
from drivers.cutting.strategy import BY_TABLE, TRIMMED, TURNED_BY_OTHERS, PlannedProgram, PlanningInput, Strategy
from drivers.errors import DriverError
from drivers.identification.nominal import nominal_response, path_response
from drivers.pmac.axes import DEFINITIONS_KEY, read_definitions
from drivers.pmac.check import CheckedProgram, run_through
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.language.errors import PmacError
from drivers.pmac.program_text import ProgramText, read_program
from drivers.pmac.programs.pvt import fits_whole_milliseconds
from drivers.pmac.programs.setup import SERVO, CutBand, CutSetup, cut_setup
from drivers.pmac.settings import settings_with
from profiles.axis.response import AMPLIFICATION_LIMIT, ServoResponse
from profiles.axis.servo import sampled_response
from profiles.axis.stiffness import held_back_um
from profiles.compensations.learning import coefficient_of
from profiles.compensations.path import AlongCut, CutPath, LobedPath, invert, path_problems, target_path
from profiles.compensations.push import predicted_push_um
from profiles.findings import Finding, Severity
from profiles.job import Job
from profiles.lobe.along import NO_MIDDLE, along_cut, along_findings, oval_over_ring
from profiles.machine import MachineProfile
from profiles.problem import Problem, refusal_error

__all__ = ["CutBand", "CutPlan", "Strategy", "first_spindle_counts", "nominal_command", "plan_cut"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPlan(PlannedProgram):
    """A planned cut, known before anything moves: `command` is what it commands the tool to cut `target`.

    `checked` is the whole motion of the program, move by move, with what a compensation table adds to it and with
    a spindle that is not the program's own. A `trimmed` cut is corrected by the host while it cuts; one `in_air`
    touches no part.
    """

    strategy: Strategy
    target: LobedPath
    command: LobedPath
    setup: CutSetup
    program: ProgramText
    spindle_speed_rpm: float
    segment_ms: float
    duration_s: float
    findings: tuple[Finding, ...]
    checked: CheckedProgram = field(repr=False, compare=False)
    trimmed: bool = False
    in_air: bool = False

    @property
    def spindle_start(self) -> float:
        """The spindle position at the start, counts from its index."""
        return self.setup.spindle_start

    @property
    def carriage_start(self) -> float:
        """The carriage position at the start, clear of the part, counts."""
        return self.setup.carriage_start


def plan_cut(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    ts_ms: int | None = None,
    *,
    from_turn: int = 0,
    watchdog: str = "",
    path: CutPath | None = None,
    response: ServoResponse | None = None,
    air_mm: float = 0.0,
    trimmed: bool = False,
    before: CutBand | None = None,
) -> CutPlan:
    """Plan a cut. `ts_ms` is the TS of the `paper` strategy in whole ms, None as printed.

    `response` is the servo response that an inverting strategy inverts: of its own path, by default that of the
    machine profile. `path` was learned for this cut and carries its own command, so it needs no response. A cut
    in air runs `air_mm` further out. A `trimmed` cut accepts corrections from the host while it cuts, see
    `cam_trim`. `before` is what was cut of the blank already.

    The spindle begins `from_turn` whole turns away from its index, so that it need not unwind all turns since
    homing. `watchdog` is a condition that the program checks before each turn, such as that a timer of the host
    has not expired.

    Raises:
        ProblemError: the job cannot be turned into a program at all (`program.too_fast`, `program.too_long`,
            `program.no_zero_row`, `program.not_turned`, `program.no_overtones`, `program.no_trim`), a path that is
            none of this job (`path.harmonics`, `path.beyond`), a lobe that nothing tells along the cut
            (`rule.along_middle`), its servo cannot be inverted
            (`response.amplified`, `response.outside_band`, `response.too_sparse`), or the controller would refuse
            it (`program.refused`).
    """
    _refuse_other_axes(machine)
    if trimmed:
        _refuse_untrimmed(machine, strategy)
    if path is not None:
        _refuse_beyond(path, job, machine, strategy)
    if strategy.traits.inverts and not air_mm:
        _refuse_unfollowed(job, machine)
    start = from_turn * machine.spindle.counts_per_rev + first_spindle_counts(job, machine, strategy)
    # In air the tool is on the path mid-cut throughout.
    middle = AlongCut(half_length_mm=job.cut_length_mm / 2.0) if air_mm else AlongCut()
    along = along_cut(job, machine) if strategy.traits.inverts and not air_mm else middle
    command = _command(job, machine, strategy, path, response, along)
    target = target_path(job) if path is None else path.target
    target, command = (
        replace(target, along=along, axial=() if air_mm else target.axial),
        replace(
            command,
            along=along if path is None else _along_learned(along, path, job, machine, strategy),
            axial=() if air_mm else command.axial,
            push_um=0.0 if air_mm else command.push_um,
        ),
    )
    if not strategy.traits.by_table:
        target, command = target.fold_axial(), command.fold_axial()
    planning = PlanningInput(
        job=job,
        machine=machine,
        dialect=DIALECTS[machine.controller.family],
        setup=cut_setup(job, machine, start, watchdog, air_mm=air_mm, before=before),
        target=target,
        command=command,
        ts_ms=ts_ms,
        trimmed=trimmed,
    )
    _refuse_followed(machine, strategy)
    made = strategy.traits.make(planning)
    program = _read(made.text, planning.dialect)
    if watchdog:  # nobody renews it in a simulated run
        unwatched = strategy.traits.make(replace(planning, setup=replace(planning.setup, watchdog="")))
        checked = _check_program(unwatched, _read(unwatched.text, planning.dialect), planning)
    else:
        checked = _check_program(made, program, planning)
    return _assemble_plan(planning, strategy, made, program, checked, in_air=air_mm > 0.0)


def _refuse_other_axes(machine: MachineProfile) -> None:
    """Refuse axes that are not as the programs have them: tool X, spindle Y or none, carriage Z; in counts."""
    tool, spindle, carriage = machine.tool.motor, machine.spindle.motor, machine.carriage.motor
    found = {each.motor: str(each) for each in read_definitions(machine.controller.axis_definitions)}
    wanted = {tool: "X", **({spindle: "Y"} if spindle in found else {}), carriage: "Z"}
    for motor in sorted({*wanted, *found}):
        there, target = (f"#{motor}->{each.get(motor, '0')}" for each in (found, wanted))
        if there != target:
            raise refusal_error("value.out_of_range", key=DEFINITIONS_KEY, value=there, limit=target)


def _assemble_plan(
    planning: PlanningInput,
    strategy: Strategy,
    made: PlannedProgram,
    program: ProgramText,
    checked: CheckedProgram,
    *,
    in_air: bool,
) -> CutPlan:
    job, machine = planning.job, planning.machine
    loop = steady_moves(program, checked, machine)
    rpm = speed_rpm(loop, checked, machine)
    largest_um = planning.command.largest_um if strategy.traits.inverts else 0.0
    return CutPlan(
        strategy=strategy,
        target=planning.target,
        command=planning.command,
        setup=planning.setup,
        program=program,
        spindle_speed_rpm=rpm,
        segment_ms=loop[-1].used_times.tm_ms,
        duration_s=checked.duration_ms / 1000.0,
        findings=(
            *cut_findings(loop, checked, machine, job, rpm, largest_um),
            *(leaving_findings(job, planning.target) if strategy.traits.follows_lobe else ()),
            *(clock_findings(machine) if made.clock else ()),
        ),
        checked=checked,
        trimmed=planning.trimmed,
        in_air=in_air,
        **{each.name: getattr(made, each.name) for each in fields(PlannedProgram)},
    )


def first_spindle_counts(job: Job, machine: MachineProfile, strategy: Strategy) -> float:
    """Return where the spindle begins a cut planned from turn 0, in counts from its index."""
    begins_at = strategy.traits.begins_at
    return 0.0 if begins_at is None else begins_at(job, machine)


def nominal_command(
    job: Job, machine: MachineProfile, strategy: Strategy, response: ServoResponse | None = None
) -> LobedPath:
    """Return the command with which the loop makes the path that the job wants.

    `response` is that of the path of this strategy, by default the one of the machine profile.
    Raises ProfileError: `response.amplified`, `response.outside_band`, `response.too_sparse`.
    """
    inverted = path_response(strategy, machine) if response is None else response
    turns_hz = job.spindle_speed_rpm / 60.0
    wanted = replace(target_path(job), push_um=predicted_push_um(job, machine))
    return invert(wanted, lambda lobes: inverted.invertible(lobes * turns_hz))


def _command(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    path: CutPath | None,
    response: ServoResponse | None,
    along: AlongCut,
) -> LobedPath:
    if not strategy.traits.inverts:
        return target_path(job) if path is None else path.target
    command = nominal_command(job, machine, strategy, response) if path is None else path.command
    if not strategy.traits.by_table:
        _refuse_unsegmented(replace(command, along=along), job, machine, strategy)
    # What was learned from a trace knows the lobe alone.
    return replace(command, push_um=command.push_um or predicted_push_um(job, machine))


def _along_learned(
    along: AlongCut, path: CutPath, job: Job, machine: MachineProfile, strategy: Strategy
) -> AlongCut:
    """Return the change along the cut of a learned command: what it has beside the inverse of its target stays.

    That makes up for dry friction, which does not grow with the lobe. Of a program of segments, whose lobe has one
    phase, its part in phase with the command counts.
    """
    orders, even = [], []
    for order, powers in along.orders:
        target, command = (coefficient_of(each, order) for each in (path.target, path.command))
        inverse = target / nominal_response(strategy, machine, order * job.spindle_speed_rpm / 60.0)
        even.append((order, command - inverse))
        share = 1.0 if strategy.traits.by_table or not command else (inverse / command).real
        orders.append((order, tuple(share * each for each in powers)))
    return replace(along, orders=tuple(orders), even=tuple(even) if strategy.traits.by_table else ())


def _refuse_followed(machine: MachineProfile, strategy: Strategy) -> None:
    if machine.spindle.drive != SERVO and strategy not in TURNED_BY_OTHERS:
        value, limit = machine.spindle.drive, ", ".join(TURNED_BY_OTHERS)
        raise DriverError(Problem(code="program.not_turned", key="spindle.drive", value=value, limit=limit))


def _read(text: str, dialect: Dialect) -> ProgramText:
    try:
        return read_program(text, motor_count=dialect.motor_count)
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", value=str(error))) from error


def _check_program(made: PlannedProgram, program: ProgramText, planning: PlanningInput) -> CheckedProgram:
    machine, setup, dialect = planning.machine, planning.setup, planning.dialect
    start = {
        machine.tool.motor: made.tool_start,
        machine.spindle.motor: setup.spindle_start,
        machine.carriage.motor: setup.carriage_start,
    }
    try:
        settings = settings_with(machine.controller.variables, dialect)
        checked = run_through(program, settings, read_definitions(made.axis_definitions), start, dialect)
    except PmacError as error:
        raise DriverError(Problem(code="program.refused", value=str(error))) from error
    period_ms = machine.controller.servo_period_ms
    rate = planning.job.spindle_speed_rpm * machine.spindle.counts_per_rev / 60_000.0
    if made.clock is not None:
        # The spindle leads the time that the controller knows by the cycle that it takes to read it.
        checked = with_spindle(checked, machine.spindle.motor, rate, rate * period_ms, made.clock.stretch)
    elif machine.spindle.motor not in checked.motors:
        checked = with_spindle(checked, machine.spindle.motor, rate)
    return checked if made.table is None else with_table(checked, made.table, period_ms)


def _refuse_unsegmented(command: LobedPath, job: Job, machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse a command that segments of whole milliseconds cannot make; name the speed that would be allowed."""
    tables = ", ".join(BY_TABLE)
    others = sorted(command.powers_um().keys() - {0, command.lobes})
    if others:
        value = ", ".join(map(str, others))
        raise DriverError(Problem(code="program.no_overtones", key=strategy, value=value, limit=tables))
    if fits_whole_milliseconds(command, job.lobe_frequency_hz):
        return
    slower_rpm = math.floor(job.spindle_speed_rpm)
    while slower_rpm > 1 and not _fits_at(job, machine, command.along, slower_rpm):
        slower_rpm -= 1
    value, limit = f"{job.spindle_speed_rpm:g} rpm", f"<= {slower_rpm} rpm"
    raise DriverError(Problem(code="program.too_fast", key="spindle_speed_rpm", value=value, limit=limit))


def _fits_at(job: Job, machine: MachineProfile, along: AlongCut, speed_rpm: float) -> bool:
    frequency_hz = job.jaws * speed_rpm / 60.0
    response = complex(sampled_response(machine, frequency_hz))
    if abs(response) * AMPLIFICATION_LIMIT < 1.0:
        return False
    return fits_whole_milliseconds(invert(replace(target_path(job), along=along), response), frequency_hz)


def _refuse_beyond(path: CutPath, job: Job, machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse a path that corrects a cut other than this one, with every deviation that is too large."""
    turns_hz = job.spindle_speed_rpm / 60.0
    problems = path_problems(
        path,
        replace(target_path(job), push_um=predicted_push_um(job, machine)),
        lambda lobes: nominal_response(strategy, machine, lobes * turns_hz),
        lambda lobes: held_back_um(machine, job, lobes),
        oval_over_ring(job, machine),
    )
    if problems:
        raise DriverError(*problems)


def _refuse_unfollowed(job: Job, machine: MachineProfile) -> None:
    """Refuse to follow a lobe of which the middle of the cut does not tell how it changes along it."""
    found = [each.problem for each in along_findings(job, machine) if each.severity is not Severity.OK]
    if problems := [problem for problem in found if problem.code == NO_MIDDLE]:
        raise DriverError(*problems)


def _refuse_untrimmed(machine: MachineProfile, strategy: Strategy) -> None:
    """Refuse to trim a cut that cannot be: without a table, or on an external spindle."""
    if strategy not in TRIMMED or machine.spindle.drive != SERVO:
        value, limit = f"{strategy}, {machine.spindle.drive}", ", ".join((*TRIMMED, SERVO))
        raise DriverError(Problem(code="program.no_trim", value=value, limit=limit))
