"""The predicted band: what a cut will leave on the part, its uncertainty, and its sources.

An inverse leaves E |1 - T / T_hat| of a lobe E; with T within a disc of radius r around T_hat that is at most r
E. What has not been measured on a machine is assumed: in a model the dry friction of its tool, and always its
spindle error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.cutting.strategy import DEFAULT_STRATEGY, Strategy
from drivers.identification.nominal import path_response
from drivers.preview.preview import PartialPreview, ProgramPrediction
from profiles.axis.response import ServoResponse
from profiles.axis.stiffness import ASSUMED_FRICTION_N, friction_um_pp
from profiles.chucking.grip import lobe_um_per_n
from profiles.chucking.held_part import held_part
from profiles.chucking.holding import holding_of
from profiles.cutting_process import cutting_process
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

NORMAL_95 = 1.959964  # standard deviations that contain 95 % of a normal distribution
ASSUMED_SPINDLE_UM_PP = 2.0  # of an unmeasured spindle, copied to the part: 1 to 2 um are usual


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """The roundness left with a strategy, um p-p, `low_um` to `high_um`, and its contributions, each in um p-p.

    `servo_um` is the uncertainty of the inverted response, `clamping_um` the scatter of the lobe between
    clampings, both at 95 %. `cutting_um` is the tool deflection by the force of the uneven cut, None for a
    material without data: it occurs in every part, with its own phase. `spindle_um` is the radial error of the
    spindle.

    `friction_um` is, in a model, the motion lost to `assumed_friction_n`. Where the response was identified
    nothing is assumed (None): it is how much friction may change the response, because the tool swings further,
    or less, than it did then.

    Independent or assumed contributions are combined as a root sum of squares: the band excludes all of them at
    their maximum in one part. Deflection by the cut and known friction are added.
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
        """The minimum that may be left."""
        return max(self.after_um - self._reach_um, 0.0)

    @property
    def high_um(self) -> float:
        """The maximum that may be left."""
        return self.after_um + self._reach_um


def predicted_band(seen: PartialPreview, strategy: Strategy) -> Band | None:
    """Return the band of a strategy, None where it cannot be planned."""
    made, job, machine = seen.predictions.get(strategy), seen.job, seen.machine
    if made is None:
        return None
    inverting = strategy.traits.inverts
    path = strategy if inverting else DEFAULT_STRATEGY
    response = seen.response if strategy is seen.strategy else path_response(path, machine)
    holding = holding_of(machine)
    scatter_um = lobe_um_per_n(job, machine) * holding.force_sd_fraction * job.chucking_force_n
    frequency_hz = job.lobe_frequency_hz if inverting else made.lobe_frequency_hz
    return Band(
        after_um=made.ront_um,
        servo_um=response.relative_95(frequency_hz) * float(np.ptp(made.path_um)),
        clamping_um=NORMAL_95 * scatter_um,
        cutting_um=_cutting_um(job, machine, strategy),
        friction_um=_friction_um(seen, path, response, made),
        assumed_friction_n=ASSUMED_FRICTION_N if response.amplitude_um is None else None,
    )


def _friction_um(seen: PartialPreview, path: Strategy, response: ServoResponse, made: ProgramPrediction) -> float:
    """Return the motion lost to the assumed friction in a model, p-p.

    Where the response was identified: the change of friction's effect from its amplitude a to that of the cut,
    A. Its fraction of a response goes with 1 / amplitude. At most, all deviation from the model is friction:
    |T_model / T_hat - 1| |1 - a / A|.
    """
    path_um, amplitude_um = float(np.ptp(made.path_um)), 0.5 * made.stroke_um
    if response.amplitude_um is None:
        return friction_um_pp(seen.machine, made.lobe_frequency_hz, ASSUMED_FRICTION_N, path_um)
    frequency_hz = seen.job.lobe_frequency_hz
    model = path_response(path, seen.machine).response_at(frequency_hz)
    off = abs(model / response.response_at(frequency_hz) - 1.0)
    return off * abs(1.0 - response.amplitude_um / amplitude_um) * path_um if amplitude_um else 0.0


def _cutting_um(job: Job, machine: MachineProfile, strategy: Strategy) -> float | None:
    """Return the tool deflection in a cut as uneven as the lobe, p-p; a tool at constant depth cuts evenly."""
    if not strategy.traits.follows_lobe:
        return 0.0
    try:
        part = held_part(job, machine)
    except ProfileError:
        return None
    return 2.0 * cutting_process(part, machine, job.lobe_error_um_pp).lobed_motion_um
