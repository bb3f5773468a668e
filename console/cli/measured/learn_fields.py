"""Learned compensation for JSON, unrounded: the learning step of a part, and the versions of a job."""

from __future__ import annotations

import cmath
import math
from dataclasses import asdict

from console.session.learning.learning_steps import Taught
from profiles.compensations.learned import HoldsFor, LearnedCompensation, as_table
from profiles.compensations.next_version import Contraction


def lesson_fields(found: Taught) -> dict[str, object]:
    """Return a learning step; what cannot be determined from two parts is null."""
    lesson = found.lesson
    lobes = lesson.next.path.target.lobes
    return {
        "cut_with": asdict(found.made),
        "next": as_table(lesson.next),
        "learned_waves": list(lesson.learned),
        "expected": {
            "lobe_um_pp": lesson.expected_lobe_um_pp,
            "half_width_um_pp": lesson.expected_half_width_um_pp,
            "RONt_um": lesson.expected_ront_um,
        },
        "contraction": None if lesson.contraction is None else _contraction_fields(lesson.contraction, lobes),
        "contractions": [{"n": n, **_contraction_fields(c, n)} for n, c in sorted(lesson.contractions.items())],
    }


def version_fields(version: LearnedCompensation, asked: HoldsFor) -> dict[str, object]:
    """Return a version, and whether it applies to this cut."""
    return {**as_table(version), "holds": still_holds(version, asked)}


def _contraction_fields(contraction: Contraction, waves: int) -> dict[str, object]:
    share, late_deg = arrival(contraction, waves)
    return {
        "value": contraction.value,
        "half_width": contraction.half_width,
        "verdict": contraction.verdict.value,
        "arrives_share": share,
        "arrives_late_deg": late_deg,
    }


def arrival(contraction: Contraction, waves: int) -> tuple[float, float]:
    """Return the fraction of a harmonic of the path that reaches the part, and its lag in spindle degrees."""
    return abs(contraction.arrives), -math.degrees(cmath.phase(contraction.arrives)) / waves


def still_holds(version: LearnedCompensation, asked: HoldsFor) -> bool:
    """Whether job and machine are still those that it was learned for."""
    holds = version.holds_for
    return (holds.job_sha256, holds.machine_sha256) == (asked.job_sha256, asked.machine_sha256)
