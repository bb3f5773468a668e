"""Angle of jaw 1 from an indicator at the mark: both flanks of the jaw, three times, with the spread.

At each flank the spindle is turned until the indicator, at a fixed height, shows the same; the middle between the
two spindle angles is one result. Angles are degrees from the index, in [0, 360).
"""

from __future__ import annotations

from collections.abc import Sequence

from console.session.cut.telemetry import phase_limit_deg
from profiles.compensations.path import target_path
from profiles.job import Job
from profiles.problem import Problem

RESULTS = 3
READINGS = 2 * RESULTS
LEAST_APART_DEG = 0.5  # two readings closer together are of one flank
TURN_DEG = 360.0


def between_deg(start_deg: float, end_deg: float) -> float:
    """Return the shorter way from one angle to another, in [-180, 180)."""
    return (end_deg - start_deg + TURN_DEG / 2.0) % TURN_DEG - TURN_DEG / 2.0


def results_deg(flanks: Sequence[float]) -> tuple[float, ...]:
    """Return the middle of each complete pair of flanks."""
    pairs = zip(flanks[::2], flanks[1::2], strict=False)
    return tuple((first + between_deg(first, second) / 2.0) % TURN_DEG for first, second in pairs)


def mean_deg(results: Sequence[float]) -> float:
    """Return the mean of angles that are close together."""
    ways = [between_deg(results[0], each) for each in results]
    return (results[0] + sum(ways) / len(ways)) % TURN_DEG


def spread_deg(results: Sequence[float]) -> float:
    """Return the largest difference of two results."""
    ways = [between_deg(results[0], each) for each in results]
    return max(ways) - min(ways)


def reading_problem(flanks: Sequence[float], angle_deg: float, jaws: int) -> Problem | None:
    """Return why a reading cannot be the next one; None if it can.

    The second of a pair is at the other flank of the same jaw: less than half a pitch of the jaws away.
    """
    if len(flanks) >= READINGS:
        return Problem(code="alignment.flanks_complete", limit=str(READINGS))
    if len(flanks) % 2 == 0:
        return None
    apart_deg, most_deg = abs(between_deg(flanks[-1], angle_deg)), TURN_DEG / jaws / 2.0
    if LEAST_APART_DEG <= apart_deg < most_deg:
        return None
    limit = f"{LEAST_APART_DEG:g} … {most_deg:g}°"
    return Problem(code="alignment.flanks_apart", value=f"{apart_deg:.2f}°", limit=limit)


def allowed_spread_deg(job: Job) -> float | None:
    """Return the spread that the part allows: the phase error that leaves 0.8 of its roundness tolerance."""
    return phase_limit_deg(target_path(job), job.roundness_tolerance_um)


def spread_problem(flanks: Sequence[float], most_deg: float | None) -> Problem | None:
    """Return why the readings are not taken: too few, or too far apart for the part; None where they are."""
    if len(flanks) < READINGS:
        return Problem(code="alignment.flanks_incomplete", value=str(len(flanks)), limit=str(READINGS))
    spread = spread_deg(results_deg(flanks))
    if most_deg is None or spread <= most_deg:
        return None
    return Problem(code="alignment.spread_too_large", value=f"{spread:.2f}°", limit=f"<= {most_deg:.2f}°")
