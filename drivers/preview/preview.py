"""The full preview of a job, computed before anything is sent: each strategy's program and its result."""

from __future__ import annotations

import gc
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np

from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy
from drivers.identification.nominal import loop_response, nominal_response
from drivers.pmac.programs.push import left_of_push
from drivers.pmac.programs.setup import APPROACH_MM
from drivers.preview.outlook import Demand, Outlook, Response, demands_of, outlook, response_of
from drivers.preview.program_prediction import (
    TURN_POINTS,
    FloatArray,
    PlannedTurns,
    ProgramPrediction,
    SurfacePrediction,
    known_loop,
    left_by,
    predict,
    predict_following,
)
from profiles.arrays import floats, read_only
from profiles.axis.response import ResponseSource, ServoResponse
from profiles.axis.servo import drive_need
from profiles.compensations.path import CutPath, LobedPath, PathHarmonic, free_state_lobe
from profiles.job import NO_LOBE, Job
from profiles.lobe.along import shape_along
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.problem import ProblemError

SECTIONS = 13
POINTS = 240  # of a turn
LEAD_TURNS = 1  # in which what the servo did before has died away


def predict_whole(
    job: Job, machine: MachineProfile, plan: CutPlan, response: ServoResponse | None = None
) -> ProgramPrediction:
    """Predict what a planned cut makes of the part, mid-cut as `predict` does, and over its whole length.

    A cut in air leaves the part as it is, and has no `surface`.
    """
    turns = PlannedTurns(machine, plan)
    made = predict(job, machine, plan, response, turns)
    if plan.in_air:
        return made
    made = replace(made, surface=_predict_surface(job, machine, plan, response, turns))
    need = drive_need(machine, 0.5 * made.largest_stroke_um, made.lobe_frequency_hz)
    return replace(made, demands=demands_of(machine, need))


def with_lobe(surface: SurfacePrediction, instead: LobedPath, job: Job) -> SurfacePrediction:
    """Return what is left of a part whose lobe mid-cut is another than that of its job.

    Order N changes along the cut as predicted, other orders do not; beside that each has its axial terms.
    """
    more = instead.plus({job.jaws: -free_state_lobe(job).harmonics[0].coefficient})
    residual_um, mean_um = surface.residual_um.copy(), surface.mean_um.copy()
    for harmonic in more.harmonics:
        factor = surface.lobe_factor if harmonic.lobes == job.jaws else np.ones_like(surface.z_mm)
        residual_um += np.outer(factor, harmonic.at_um(surface.angle_deg))
    s, angle = 2.0 * (middle_mm(job) - surface.z_mm) / job.cut_length_mm, np.radians(surface.angle_deg)
    for term in instead.axial:
        wave = (term.coefficient * np.exp(1j * term.lobes * angle)).real
        if term.lobes:
            residual_um += np.outer(s**term.power, wave)
        else:
            mean_um += term.cos_um * s**term.power
    return replace(surface, residual_um=read_only(residual_um), mean_um=read_only(mean_um))


def _predict_surface(
    job: Job, machine: MachineProfile, plan: CutPlan, response: ServoResponse | None, turns: PlannedTurns
) -> SurfacePrediction:
    # From end to end, but for the half land at the edges that the tool covers in part.
    reach_mm = 0.5 * (job.cut_length_mm - max(plan.setup.land_turns, 1.0) * job.feed_mm_per_rev)
    past_mm = np.linspace(reach_mm, -reach_mm, SECTIONS)
    z_mm = middle_mm(job) - past_mm
    setup = plan.setup
    angle_deg, path_um = _cut_by_sections(job, machine, plan, response, turns, past_mm)
    ends = (setup.carriage_face, setup.carriage_start + (setup.turns - 2.0) * setup.carriage_per_turn)
    _, first_and_last_um = turns.from_carriage((*ends, setup.carriage_middle), 1, POINTS)
    factor, larger_um = shape_along(job, machine, z_mm)
    left_um = np.outer(factor, free_state_lobe(job).at_um(angle_deg)) - np.maximum(path_um, 0.0)
    mean_um = left_um.mean(axis=1)
    residual_um, size_um = left_um - mean_um[:, None], mean_um + larger_um
    return SurfacePrediction(
        z_mm=read_only(z_mm),
        angle_deg=read_only(angle_deg),
        residual_um=read_only(residual_um),
        mean_um=read_only(size_um - size_um[SECTIONS // 2]),
        lobe_factor=read_only(factor),
        stroke_um=float(np.ptp(first_and_last_um, axis=1).max()),
    )


def _cut_by_sections(
    job: Job,
    machine: MachineProfile,
    plan: CutPlan,
    response: ServoResponse | None,
    turns: PlannedTurns,
    past_mm: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return spindle angles (angle,), and the depth to which each section is cut, (Z, angle), um."""
    setup = plan.setup
    half_turns = 0.5 * max(setup.land_turns, 1.0)  # a land shorter than the feed still cuts a turn
    length = LEAD_TURNS + math.ceil(2.0 * half_turns)
    centres = setup.carriage_middle + past_mm * machine.carriage.counts_per_mm
    begins = centres - (half_turns + LEAD_TURNS) * setup.carriage_per_turn
    begins = np.minimum(begins, setup.carriage_start + (setup.turns - length) * setup.carriage_per_turn)
    angles_deg, command_um = turns.from_carriage(begins.tolist(), length, POINTS)
    known = known_loop(job, machine, plan, response)
    path_um = predict_following(machine, command_um, plan.spindle_speed_rpm, known, length)
    fed = np.arange(length * POINTS) / POINTS
    if plan.command.push_um:
        from_face = (begins - setup.carriage_start) / setup.carriage_per_turn - APPROACH_MM / job.feed_mm_per_rev
        since_ms = turns.turn_ms * (from_face[:, None] + fed)
        path_um = path_um - plan.command.push_um * left_of_push(setup, turns.turn_ms, since_ms)
    away = begins[:, None] + fed * setup.carriage_per_turn - centres[:, None]
    cuts = (np.abs(away) <= (half_turns + 0.5 / POINTS) * setup.carriage_per_turn) & (fed >= LEAD_TURNS)

    turn_by_turn = np.where(cuts, path_um, -np.inf).reshape(-1, length, POINTS)
    rows = zip(angles_deg, turn_by_turn.max(axis=1), strict=True)
    # Each row began its turn elsewhere.
    at_deg = floats(np.arange(POINTS) * (360.0 / POINTS))
    return at_deg, floats([np.interp(at_deg, angle_deg, row, period=360.0) for angle_deg, row in rows])


__all__ = ["Demand", "ProgramPrediction", "Response"]  # beside what is defined here
_TURN_DEG: FloatArray = np.linspace(0.0, 360.0, TURN_POINTS, endpoint=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramInput:
    """The input of one program, see `drivers.cutting.planning.plan_cut`."""

    job: Job
    machine: MachineProfile
    strategy: Strategy
    response: ServoResponse | None = None
    path: CutPath | None = None
    air_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """The outcome of a strategy's program: the plan and what it leaves, or why there is none.

    The thousands of moves of the plan are left out; their result is in `prediction`.
    """

    plan: CutPlan | ProblemError
    prediction: ProgramPrediction | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PartialPreview(Outlook):
    """A job on a machine while its programs are simulated: the outlook, and every finished program.

    `strategies` has the outcome of each, `predictions` those that can be planned.
    """

    strategies: dict[Strategy, CutPlan | ProblemError]
    predictions: dict[Strategy, ProgramPrediction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview(PartialPreview):
    """The complete preview of a job on a machine, without motion: the outlook, and every program."""


def preview(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy = DEFAULT_STRATEGY,
    response: ServoResponse | None = None,
    *,
    path: CutPath | None = None,
) -> Preview:
    """Compute the preview of a job; `response` is that of the path of `strategy`, by default by the profile.

    `path` was learned for a cut with `strategy` and carries its own command.
    Raises ProblemError: as `outlook`, the axis cannot follow at this speed at all.
    """
    seen = outlook(job, machine, strategy, response, path=path)
    programs = {each.strategy: program_of(each) for each in all_asked(job, machine, strategy, response, path)}
    return complete_preview(seen, programs)


def all_asked(
    job: Job,
    machine: MachineProfile,
    strategy: Strategy,
    response: ServoResponse | None,
    path: CutPath | None,
    air_mm: float = 0.0,
) -> tuple[ProgramInput, ...]:
    """Return the inputs of the programs of all strategies; the last three are for `strategy` alone."""
    return tuple(
        ProgramInput(job=job, machine=machine, strategy=each, response=response, path=path, air_mm=air_mm)
        if each is strategy
        else ProgramInput(job=job, machine=machine, strategy=each)
        for each in Strategy
    )


def program_of(asked: ProgramInput) -> Program:
    """Plan one program, simulate it, and predict the residual."""
    job, machine, response = asked.job, asked.machine, asked.response
    # The moves would trigger one full garbage collection after the other, during which no key is handled. They
    # need none: they contain no reference cycles.
    collected = gc.isenabled()
    gc.disable()
    try:
        plan = plan_cut(job, machine, asked.strategy, path=asked.path, response=response, air_mm=asked.air_mm)
    except ProblemError as error:
        return Program(plan=error, prediction=None)
    else:
        prediction = predict_whole(job, machine, plan, response)
        return Program(plan=replace(plan, checked=replace(plan.checked, moves=())), prediction=prediction)
    finally:
        if collected:
            gc.enable()


def underway(seen: Outlook, programs: Mapping[Strategy, Program]) -> PartialPreview:
    """Return an outlook with the finished programs, in the order of the strategies."""
    made = {each: programs[each] for each in Strategy if each in programs}
    return PartialPreview(
        **{field.name: getattr(seen, field.name) for field in fields(Outlook)},
        strategies={each: program.plan for each, program in made.items()},
        predictions={each: p.prediction for each, p in made.items() if p.prediction is not None},
    )


def complete_preview(seen: Outlook, programs: Mapping[Strategy, Program]) -> Preview:
    """Return an outlook with all programs."""
    complete = underway(seen, programs)
    return Preview(**{field.name: getattr(complete, field.name) for field in fields(Preview)})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedForm:
    """A cut at the speed of the job, with the nominal or the identified axis.

    The arrays have the shape (TURN_POINTS,), as those of a program, so that plots of both look alike.
    `angle_deg` are spindle angles, `command_um` is the commanded infeed there, `residual_um` the
    deviation of the released part, positive where it is high, mean 0. `response` is that of the loop at
    `lobe_frequency_hz`, `largest_stroke_um` is the tool travel of a turn, peak to peak, where along the cut it is
    largest, and `demands` are the needs of a sine with that.
    """

    angle_deg: FloatArray
    command_um: FloatArray
    residual_um: FloatArray
    lobe_frequency_hz: float
    response: Response
    demands: dict[str, Demand]
    largest_stroke_um: float


def surface_left(seen: PartialPreview, strategy: Strategy) -> SurfacePrediction | None:
    """Return what a strategy leaves along the part, None until its program exists, and where no lobe is known.

    Of a path learned from a part it is what is left of the lobe of that part.
    """
    made = seen.predictions.get(strategy)
    if made is None or made.surface is None or seen.job.lobe_error_source == NO_LOBE:
        return None
    if seen.taught is None or strategy is not seen.strategy:
        return made.surface
    left = seen.taught.lobe
    return with_lobe(made.surface, seen.target.plus({left.lobes: left.coefficient}), seen.job)


def worst_section(seen: PartialPreview, strategy: Strategy) -> tuple[float, float] | None:
    """Return Z, mm, and roundness, um p-p, of the section that a strategy leaves least round; None as above.

    What a measured part has more than its lobe mid-cut is taken to be left everywhere.
    """
    surface = surface_left(seen, strategy)
    if surface is None:
        return None
    ront_um, more_um = surface.ront_um, 0.0
    if seen.taught is not None and seen.taught.ront_um is not None and strategy is seen.strategy:
        more_um = max(seen.taught.ront_um - float(ront_um[ront_um.size // 2]), 0.0)
    return float(surface.z_mm[surface.worst]), float(ront_um[surface.worst]) + more_um


def closed_form(seen: Outlook, strategy: Strategy) -> ClosedForm | None:
    """Predict a strategy; return None where only its program can tell.

    Of a lobe E the inverse of T_hat leaves E |1 - T / T_hat| (inverse feedforward at the lobe frequency), a plain
    cut all of it.
    """
    if not strategy.traits.follows_lobe:
        command = replace(seen.target, amplitude_um=0.0, overtones=(), axial=())
    elif strategy.traits.inverts and strategy is seen.strategy:
        command = seen.command
    else:
        return None
    job, machine = seen.job, seen.machine
    path_um = np.full(TURN_POINTS, command.mean_um)
    identified = strategy is seen.strategy and seen.response.source is ResponseSource.IDENTIFIED
    for harmonic in command.harmonics:
        frequency_hz = harmonic.lobes * job.spindle_speed_rpm / 60.0
        if identified and harmonic.lobes == job.jaws:
            answer = seen.response.response_at(frequency_hz)
        else:
            answer = nominal_response(strategy, machine, frequency_hz)
        path_um += PathHarmonic.from_coefficient(harmonic.lobes, answer * harmonic.coefficient).at_um(_TURN_DEG)
    response = seen.sampled
    if identified:
        response = response_of(job, loop_response(strategy, machine, seen.response, job.lobe_frequency_hz))
    # The command belongs to the angle that the controller read, which the spindle has left since.
    late_deg = (
        strategy.traits.late_cycles(machine) * machine.controller.servo_period_ms * job.spindle_speed_rpm * 0.006
    )
    half_mm, feed_mm = command.along.half_length_mm, job.feed_mm_per_rev
    whole_turns_mm = (0.5 * feed_mm - half_mm, 0.0, half_mm - 1.5 * feed_mm)  # those of which a program is sampled
    stroke_um = max(float(np.ptp(command.at_um(_TURN_DEG, each))) for each in whole_turns_mm)
    return ClosedForm(
        angle_deg=_TURN_DEG,
        command_um=command.at_um(_TURN_DEG - late_deg),
        residual_um=left_by(job, _TURN_DEG, path_um),
        lobe_frequency_hz=job.lobe_frequency_hz,
        response=response,
        demands=demands_of(machine, drive_need(machine, 0.5 * stroke_um, job.lobe_frequency_hz)),
        largest_stroke_um=stroke_um,
    )
