"""The lobe error of a job as a number that is true: none where there is none yet."""

from __future__ import annotations

from console.units import METRIC, Units
from profiles.job import NO_LOBE, Job

NOT_YET = "–"
_LEAST_UM = 0.05  # below it one decimal would read 0.0


def lobe_number(job: Job, units: Units = METRIC) -> str:
    """Return the lobe error p-p in these units: a dash where it is not known, never 0.0 for a small one."""
    if job.lobe_error_source == NO_LOBE:
        return NOT_YET
    if 0.0 < job.lobe_error_um_pp < _LEAST_UM:
        return f"< {units.figure(0.1, 'um', 1)}"
    return units.figure(job.lobe_error_um_pp, "um", 1)
