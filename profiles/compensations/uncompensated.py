"""A part without its compensation: whether its lobe is where it was expected, and whether it was better so."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_conditions import found_on_a_part
from profiles.problem import Problem

IN_PLACE_DEG = 30.0
"""Tolerance of its position in degrees of lobe: a choice. That is half of what makes a
part worse than none, 10 degrees of spindle with three jaws; dry friction of 3 N makes 12 of it at 50 Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncompensated:
    """A part as it would have been: coefficients in um, positive outwards, of the lobe alone.

    `whole_um` is what all of the path would leave, `without_um` what no compensation would, `expected_um` the
    lobe by job and jaw 1; `sd_um` is the standard error of each. `found`: seen on a part before.
    """

    whole_um: complex
    without_um: complex
    expected_um: complex
    sd_um: float
    lobes: int
    found: bool

    @property
    def off_deg(self) -> float:
        """How far past its expected position the lobe is, degrees of spindle, if the tool followed its path."""
        if not self.expected_um or not self.without_um:
            return 0.0
        return -math.degrees(cmath.phase(self.without_um / self.expected_um)) / self.lobes

    @property
    def in_place(self) -> bool:
        """Whether the lobe stands where it was expected."""
        return self.lobes * abs(self.off_deg) <= IN_PLACE_DEG

    @property
    def plain_um(self) -> float:
        """The amplitude of the lobe without compensation."""
        return abs(self.expected_um if self.found else self.without_um)

    def reasons(self) -> tuple[Problem, ...]:
        """Return why nothing may be learned from the part: its compensation makes it worse than none would."""
        if self.found and self.in_place:
            return ()
        if abs(self.whole_um) - self.plain_um <= self._noise_um or self._trivial:
            return ()
        value, limit = f"{2 * abs(self.whole_um):.1f} um", f"{2 * self.plain_um:.1f} um"
        return (Problem(code="learned.worse", key=f"{self.off_deg:+.0f} deg", value=value, limit=limit),)

    def warnings(self) -> tuple[Problem, ...]:
        """Return what the operator should know before this learning step is kept."""
        if self.in_place or self._trivial or self.reasons():
            return ()
        limit = f"± {IN_PLACE_DEG / self.lobes:.0f} deg"
        return (Problem(code="learned.lobe_elsewhere", value=f"{self.off_deg:+.0f} deg", limit=limit),)

    @property
    def _noise_um(self) -> float:
        return SIGNIFICANT * math.hypot(self.sd_um, REPEATS_SD_UM)

    @property
    def _trivial(self) -> bool:
        return min(abs(self.without_um - self.whole_um), self.plain_um) <= 2.0 * self._noise_um


def uncompensated(left_um: complex, sd_um: float, path_um: complex, fraction: float, job: Job) -> Uncompensated:
    """Compare a part that has `left_um` of its lobe, cut with `fraction` of `path_um`."""
    without_um = left_um + fraction * path_um
    return Uncompensated(
        whole_um=without_um - path_um,
        without_um=without_um,
        expected_um=free_state_lobe(job).harmonics[0].coefficient,
        sd_um=sd_um,
        lobes=job.jaws,
        found=found_on_a_part(job),
    )
