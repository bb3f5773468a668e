"""Predict what one program leaves of the whole part: the motion that it was checked with against the part's lobe.

The tool's path at each section is that of the program, move by move, through the response of the servo. The lobe
of the part is that of its shell at the same Z, at places to which nothing of the compensation was fitted. A place
is cut by each turn in which the land of the tool covers it, and is left by the one that goes furthest in. The push
of the cut and what the path does against it are taken to cancel.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from drivers.cutting.planning import CutPlan
from drivers.pmac.programs.push import left_of_push
from drivers.pmac.programs.setup import APPROACH_MM
from drivers.preview.outlook import demands_of
from drivers.preview.program_prediction import (
    FloatArray,
    PlannedTurns,
    ProgramPrediction,
    SurfacePrediction,
    known_loop,
    predict,
    predict_following,
)
from profiles.arrays import floats, read_only
from profiles.axis.response import ServoResponse
from profiles.axis.servo import drive_need
from profiles.compensations.path import LobedPath, free_state_lobe
from profiles.job import Job
from profiles.lobe.along import shape_along
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile

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
