"""The check of sign and angle by the cutting force, as the run record and `--json` have it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from profiles.compensations.force_null import AGREES_DEG, MIRRORED_DEG, SURE, ForceNull, ForceNullReason, Sign
from profiles.job import Job
from profiles.problem import Problem
from profiles.strict_values import from_json, number, text, whole_number

FORCE = "force_null"
_COMPLEX = ("force_n", "right_n", "wrong_n", "ratio")
_NUMBERS = ("force_sd_n", "mean_n", "turned_deg", "turned_sd_deg")
_COUNTS = ("lobes", "air_turns", "cut_turns")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceCheck:
    """What the force of a half-stage cut said of a `job`, with jaw 1 where it was found for that cut."""

    job: Job
    found: ForceNull

    def is_of(self, job: Job) -> bool:
        """Whether it is of a cut of this job with jaw 1 there; a jaw that was found is assumed no more."""
        return replace(job, assumed=()) == replace(self.job, assumed=())

    def concerns(self, job: Job) -> bool:
        """Whether it says anything of a cut of this job, wherever its jaw 1 was found since."""
        return self.is_of(replace(job, lobe_phase_deg=self.job.lobe_phase_deg))

    def contradicts(self, job: Job) -> Problem | None:
        """Return what it says against the full stage of a job with jaw 1 where it is now, None for nothing.

        It stands until the job is another one, the half stage is cut again, or jaw 1 is found where the force
        has it.
        """
        if not self.concerns(job):
            return None
        return against_full(self.found, job.lobe_phase_deg - self.job.lobe_phase_deg)


def against_full(found: ForceNull | None, jaw_moved_deg: float = 0.0) -> Problem | None:
    """Return `force.wrong_sign`, `force.turned` or None; jaw 1 was found `jaw_moved_deg` further on since."""
    if found is None or not found.alarms:
        return None
    left_deg = math.remainder(found.turned_deg - jaw_moved_deg, 360.0 / found.lobes)
    if found.lobes * abs(left_deg) <= AGREES_DEG:
        return None
    return Problem(
        code="force.wrong_sign" if found.lobes * abs(left_deg) >= MIRRORED_DEG else "force.turned",
        value=f"{left_deg:+.0f} ± {SURE * found.turned_sd_deg:.0f} deg",
        limit=f"± {AGREES_DEG / found.lobes:.0f} deg",
    )


def force_event(found: ForceNull | None) -> dict[str, object]:
    """Return the check as fields, nothing without one; forces in N, angles in deg, complex numbers as pairs."""
    if found is None:
        return {}
    pairs = {name: [getattr(found, name).real, getattr(found, name).imag] for name in _COMPLEX}
    plain = {name: getattr(found, name) for name in (*_NUMBERS, *_COUNTS)}
    return {FORCE: {"sign": found.sign.value, "why": found.why.value, **pairs, **plain}}


def force_of(data: str) -> ForceNull | None:
    """Return the check that an event has; None where it has none, or a damaged one."""
    try:
        said = from_json(data)[FORCE]
        return _read(said) if isinstance(said, Mapping) else None
    except (ValueError, TypeError, KeyError):
        return None


def _read(said: Mapping[str, object]) -> ForceNull:
    values: dict[str, complex] = {}
    for name in _COMPLEX:
        pair = said[name]
        if not isinstance(pair, list):
            raise TypeError(name)
        real, imaginary = (number(each) for each in pair)
        values[name] = complex(real, imaginary)
    lobes, air_turns, cut_turns = (whole_number(said[name]) for name in _COUNTS)
    force_sd_n, mean_n, turned_deg, turned_sd_deg = (number(said[name]) for name in _NUMBERS)
    return ForceNull(
        sign=Sign(text(said["sign"])),
        why=ForceNullReason(text(said["why"])),
        lobes=lobes,
        force_n=values["force_n"],
        right_n=values["right_n"],
        wrong_n=values["wrong_n"],
        ratio=values["ratio"],
        force_sd_n=force_sd_n,
        mean_n=mean_n,
        turned_deg=turned_deg,
        turned_sd_deg=turned_sd_deg,
        air_turns=air_turns,
        cut_turns=cut_turns,
    )
