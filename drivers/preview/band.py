"""What a cut will leave on the part, and how far from that it may come: the predicted band and its reasons.

An inverse leaves E |1 - T / T_hat| of a lobe E; with T within a disc of radius r around T_hat that is at most r E.
What nobody has measured of a machine is assumed: by a model the dry friction of its tool, and always its spindle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy
from drivers.identification.nominal import path_response
from drivers.preview.preview import Prediction, Underway
from profiles.axis.friction import ASSUMED_FRICTION_N, friction_um_pp
from profiles.axis.response import ServoResponse
from profiles.chucking.holding import holding_of
from profiles.chucking.job_grip import lobe_um_per_n
from profiles.cutting_process import cutting_process
from profiles.job import Job
from profiles.lobe.held_job import held_part
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

NORMAL_95 = 1.959964
"""How many standard deviations hold 95 % of a normal distribution."""

ASSUMED_SPINDLE_UM_PP = 2.0
"""Radial error of a spindle that nobody has measured, which the part keeps: 1 to 2 um are usual, an assumption."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The roundness that is left with a strategy, um p-p, `low_um` to `high_um`, and by what: each in um p-p.

    `servo_um` is how far the response may be from the one that was inverted, `clamping_um` how the lobe changes
    from clamping to clamping, both with 95 %. `cutting_um` is how the tool gives way to the force of the uneven
    cut, None for a material without numbers: it is there in every part, in a phase of its own. `spindle_um` is by
    how much the axis of the spindle may wander.

    `friction_um` is by a model what `assumed_friction_n` keeps the tool from. Where the response was identified
    nothing is assumed (None): it is what the response may differ for friction, because the tool swings further
    than it did then, or less.

    What is independent of the others, or assumed, is put together as a root of squares: that all of it is at its
    most in one part is not in the band. How the cut pushes the tool, and what is known of its friction, is added.
    """

    after_um: float
    servo_um: float
    clamping_um: float
    cutting_um: float | None
    friction_um: float
    assumed_friction_n: float | None
    spindle_um: float = ASSUMED_SPINDLE_UM_PP

    @property
    def _reach_um(self) -> float:
        assumed_um, known_um = self.friction_um, 0.0
        if self.assumed_friction_n is None:
            assumed_um, known_um = known_um, assumed_um
        independent_um = math.hypot(self.servo_um, self.clamping_um, self.spindle_um, assumed_um)
        return (self.cutting_um or 0.0) + known_um + independent_um

    @property
    def low_um(self) -> float:
        """The least that may be left."""
        return max(self.after_um - self._reach_um, 0.0)

    @property
    def high_um(self) -> float:
        """The most."""
        return self.after_um + self._reach_um


def predicted_band(seen: Underway, strategy: Strategy) -> Band | None:
    """Return the band of a strategy, None where it cannot be planned."""
    made, job, machine = seen.predictions.get(strategy), seen.job, seen.machine
    if made is None:
        return None
    inverting = strategy.traits.inverts
    path = strategy if inverting else DEFAULT_STRATEGY
    response = seen.response if strategy is seen.strategy else path_response(path, machine)
    holding = holding_of(machine)
    scatter_um = lobe_um_per_n(job, machine) * holding.force_sd_share * job.chucking_force_n
    frequency_hz = job.lobe_frequency_hz if inverting else made.lobe_frequency_hz
    return Band(
        after_um=made.ront_um,
        servo_um=response.relative_95(frequency_hz) * float(np.ptp(made.path_um)),
        clamping_um=NORMAL_95 * scatter_um,
        cutting_um=_cutting_um(job, machine, strategy),
        friction_um=_friction_um(seen, path, response, made),
        assumed_friction_n=ASSUMED_FRICTION_N if response.amplitude_um is None else None,
    )


def _friction_um(seen: Underway, path: Strategy, response: ServoResponse, made: Prediction) -> float:
    """Return by a model what the friction that is assumed keeps the tool from, p-p.

    Where the response was identified, what friction may change from its amplitude a to that of the cut, A. Its
    share of a response goes with 1 / amplitude. All that differs from the model may be friction, at most:
    |T_model / T_hat - 1| |1 - a / A|.
    """
    path_um, amplitude_um = float(np.ptp(made.path_um)), 0.5 * made.stroke_um
    if response.amplitude_um is None:
        return friction_um_pp(seen.machine, made.lobe_frequency_hz, ASSUMED_FRICTION_N, path_um)
    frequency_hz = seen.job.lobe_frequency_hz
    model = path_response(path, seen.machine).at(frequency_hz)
    off = abs(model / response.at(frequency_hz) - 1.0)
    return off * abs(1.0 - response.amplitude_um / amplitude_um) * path_um if amplitude_um else 0.0


def _cutting_um(job: Job, machine: MachineProfile, strategy: Strategy) -> float | None:
    """Return how the tool gives way to a cut as uneven as the lobe, p-p; one that keeps its depth cuts evenly."""
    if not strategy.traits.follows_lobe:
        return 0.0
    try:
        part = held_part(job, machine)
    except ProfileError:
        return None
    return 2.0 * cutting_process(part, machine, job.lobe_error_um_pp).lobed_motion_um
