"""The plant of the tool from a measured response, and gains for it with margins that are asked for. Numpy alone.

A measured response T of a loop with known gains gives its plant at each frequency, P = T / (F - T B). To these
points a / (s (s + b)) exp(-s d) behind hold and period is fitted by least squares of the relative error, weighted
by how much of the error of T reaches P. The proposal multiplies every frequency of the controller by one factor g:
Kd by g, Kp by g^2, Ki by g^3, with the velocity feedforward equal to Kd; g is the largest that has the margins.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Complexes, Floats
from profiles.axis.margins import LoopMargins, loop_margins
from profiles.axis.sampled_loop import AxisPlant, SampledLoop
from profiles.axis.servo_gains import PidGains, gains_from_variables, present_settings, variables_from_gains
from profiles.machine import MachineProfile

LEAST_POINTS = 3
ASKED_GAIN_MARGIN, ASKED_PHASE_MARGIN_DEG, ASKED_SENSITIVITY = 3.0, 55.0, 1.6
"""More than is usual: mass and loop gain may be off by a tenth each, and friction by more."""

FACTORS = np.geomspace(0.4, 3.0, 31)
_DELAYS_S = np.linspace(0.0, 2.0e-3, 401)
_MOST_SETTING = 32_767  # of Ix31 to Ix33


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProposal:
    """Proposed gains, as rounded to the whole numbers that the controller takes, and margins before and after.

    Both margins are those of the same plant. `settings` are Ix30 to Ix33 by name, `present` those of the machine.
    """

    factor: float
    gains: PidGains
    settings: dict[str, int]
    present: dict[str, float]
    plant: AxisPlant
    before: LoopMargins
    after: LoopMargins


def identified_plant(loop: SampledLoop, hz: Floats, response: Complexes) -> AxisPlant | None:
    """Return the plant that a loop with these gains had when it responded so; None for too few points."""
    if hz.size < LEAST_POINTS:
        return None
    forward, back = loop.forward(hz), loop.feedback(hz)
    measured = response / (forward - response * back)
    weight = np.abs((forward - response * back) / forward)
    s = 2j * np.pi * hz
    # What hold, period and sampling do to a plant, by the nominal one: nearly the same for any other.
    nominal = loop.plant
    sampled = loop.plant_response(hz) * s * (s + nominal.damping_per_s) / nominal.acceleration_per_v
    best: tuple[float, AxisPlant] | None = None
    for delay_s in _DELAYS_S:
        plain = measured / sampled * np.exp(s * delay_s)
        columns = np.stack([plain * s**2, plain * s], axis=1) * weight[:, None]
        design = np.concatenate([columns.real, columns.imag])
        target = np.concatenate([weight, np.zeros_like(weight)])
        (inverse, ratio), *_ = np.linalg.lstsq(design, target, rcond=None)
        left = float(np.sum((design @ np.array([inverse, ratio]) - target) ** 2))
        if inverse > 0.0 and (best is None or left < best[0]):
            damping = max(float(ratio / inverse), 0.0)
            plant = AxisPlant(
                acceleration_per_v=float(1.0 / inverse), damping_per_s=damping, delay_s=float(delay_s)
            )
            best = left, plant
    return None if best is None else best[1]


def proposed_gains(machine: MachineProfile, loop: SampledLoop) -> GainProposal | None:
    """Return a proposal for the plant of a loop; None where no factor has the margins, or none fits the variables.

    `machine` has the variables of the loop: scales, and what the gains are relative to.
    """
    before = loop_margins(loop)
    for factor in FACTORS[::-1]:
        found = scaled_gains(machine, loop, float(factor), before)
        if found is not None and _good(found.after):
            return found
    return None


def scaled_gains(
    machine: MachineProfile, loop: SampledLoop, factor: float, before: LoopMargins
) -> GainProposal | None:
    """Return the gains of one factor, whatever their margins; None where they do not fit the variables."""
    gains = loop.gains
    kd = factor * gains.kd_v_s_per_m
    asked = PidGains(
        kp_v_per_m=factor**2 * gains.kp_v_per_m,
        ki_v_per_m_s=factor**3 * gains.ki_v_per_m_s,
        kd_v_s_per_m=kd,
        velocity_feedforward_v_s_per_m=kd,
    )
    settings = variables_from_gains(machine, asked)
    numbers = [settings[f"I{machine.tool.motor}{number}"] for number in (31, 32, 33)]
    if max(numbers) > _MOST_SETTING:
        return None
    controller = replace(machine.controller, variables={**machine.controller.variables, **settings})
    rounded = gains_from_variables(replace(machine, controller=controller))
    shown = {name: value for name, value in settings.items() if not name.endswith(("34", "35"))}
    after = loop_margins(replace(loop, gains=rounded))
    return GainProposal(
        factor=factor,
        gains=rounded,
        settings=shown,
        present=present_settings(machine, shown),
        plant=loop.plant,
        before=before,
        after=after,
    )


def _good(margins: LoopMargins) -> bool:
    gain, phase = margins.gain_margin, margins.phase_margin_deg
    return (
        margins.stable
        and gain is not None
        and gain >= ASKED_GAIN_MARGIN
        and phase is not None
        and phase >= ASKED_PHASE_MARGIN_DEG
        and margins.sensitivity_peak <= ASKED_SENSITIVITY
    )
