"""The lathe and the two experiments of the paper (Tables 2 to 4 and 6), with the measured parts."""

from __future__ import annotations

from dataclasses import dataclass

from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

COMPENSATED_UM = (30.0, 14.0)  # RONt of the compensated parts, Fig 16
CONCLUDED_UM = 27.0  # what the 51 % of the conclusion would make of 55 um


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiments:
    """The machine and the jobs of experiment 1 and 2."""

    machine: MachineProfile
    jobs: tuple[Job, Job]

    @property
    def errors_um_pp(self) -> tuple[float, float]:
        """RONt of the parts without compensation, Fig 14: 55 and 33 um."""
        first, second = self.jobs
        return first.lobe_error_um_pp, second.lobe_error_um_pp


def lee_2001() -> Experiments:
    """Return them from the bundled profiles."""
    first, second = (load_job(f"lee-2001-experiment-{number}").job for number in (1, 2))
    return Experiments(machine=load_machine("lee-2001-lathe").machine, jobs=(first, second))
