"""The check of sign and angle by the cutting force, as the run record and `--json` have it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace

from profiles.compensations.force_null import AGREES_DEG, MIRRORED_DEG, SURE, ForceNull
from profiles.job import Job
from profiles.problem import Problem
from profiles.strict_values import StrictReader, from_json

FORCE = "force_null"


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
    values = asdict(found).items()
    return {FORCE: {name: [each.real, each.imag] if isinstance(each, complex) else each for name, each in values}}


def force_of(data: str) -> ForceNull | None:
    """Return the check that an event has; None where it has none, or a damaged one."""
    try:
        found: ForceNull = _ForceReader().read(ForceNull, from_json(data)[FORCE])
    except (ValueError, TypeError, KeyError):
        return None
    return found


class _ForceReader(StrictReader):
    """Reads every field, a complex number as a pair."""

    complete = True

    def __init__(self) -> None:
        super().__init__()
        self.plain = {**self.plain, complex: lambda pair: complex(*self.read(tuple[float, float], pair))}
