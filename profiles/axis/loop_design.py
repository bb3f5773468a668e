"""Gains for the work of this tool: stiff against forces, within margins on every plant that may be the true one.

Kp, Ki and Kd are varied each for itself, the velocity feedforward equal to Kd. Of the gains that leave the fitted
plant the margins asked for, and each plant within the confidence of the fit those that are usual, the ones are
proposed that yield least to what a lobed cut pushes with: friction and uneven depth, at the lobe and, falling with
the order, at twice and three times it; a quarter of the largest compliance at any frequency counts beside that,
for a tool that turns round slowly. Of gains within a tenth of the best those whose integrator recovers fastest.

Where responses were measured, the gains have to hold there as well by the measured plant alone, without any model:
|1 + L| at each point, less its uncertainty. Between the points and beyond them a mode may hide: one of the
fraction c at f0 changes the plant at f by c / |(f0/f)^2 - 1 + 2 j z f0/f|. What the points would not have shown
must not move 1 + L by more than 0.7 of it at resonance, L c / (2 z), with the least damping z of a machine
(`unseen_hz`): such a loop is still stable.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.gain_proposal import GainProposal, rounded_proposal
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    is_stable,
    loop_margins,
)
from profiles.axis.plant_fit import PlantFit
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.servo_gains import PidGains
from profiles.machine import MachineProfile

DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY = 2.5, 1.8
"""Of the fitted plant; its phase margin, and all margins of the other plants, are those that are usual."""

_FASTER = np.geomspace(0.15, 2.6, 30)  # Kd over the present one
_KP_OVER_KD = np.geomspace(20.0, 300.0, 11)  # 1/s
_KI_OVER_KP = floats([0.2, 2.0, 5.0, 10.0, 15.0, 20.0])  # 1/s
_POINTS = 260
_MOST_TRIED = 60
_AS_STIFF = 1.1
LOBE_ORDERS, PEAK_SHARE = (1, 2, 3), 0.25
LEAST_DAMPING = 0.02  # assumed least damping ratio of what may bend: bolted steel has 1 to 5 %
HIDDEN_CHANGE = 0.7
SURE_SD = 0.05  # of a measured plant; where friction makes it less certain, the fit alone counts
LEAST_MODE_HZ = 80.0  # below it nothing of a tool slide bends (choice)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Candidates:
    """Gains side by side, shape (n,)."""

    kp: Floats
    ki: Floats
    kd: Floats

    def only(self, chosen: np.typing.NDArray[np.bool_]) -> _Candidates:
        return _Candidates(kp=self.kp[chosen], ki=self.ki[chosen], kd=self.kd[chosen])


def designed_gains(
    machine: MachineProfile, loop: SampledLoop, fit: PlantFit, lobe_hz: float
) -> GainProposal | None:
    """Return the stiffest gains within the margins on a fitted plant and its neighbours; None: there are none.

    `machine` has the variables of the loop, `loop` its gains and the fitted plant.
    """
    hz = floats(np.geomspace(0.5, 0.999 * loop.nyquist_hz, _POINTS))
    found = _all(loop.gains)
    for plant, most in ((fit.plant, DESIGN_SENSITIVITY), *((each, MOST_SENSITIVITY) for each in fit.others)):
        response = replace(loop, plant=plant).plant_response(hz)
        found = found.only(_sensitivity(found, response, hz, loop.period_s) <= most)
    found = found.only(
        _phase_margin_deg(found, loop.plant_response(hz), hz, loop.period_s) >= LEAST_PHASE_MARGIN_DEG
    )
    sure = fit.sd <= SURE_SD
    at_points = _sensitivity(found, fit.measured[sure], fit.hz[sure], loop.period_s, fit.sd[sure])
    found = found.only(at_points <= MOST_SENSITIVITY)
    stiffness = _yields(found, loop, hz, lobe_hz)
    before = loop_margins(loop)
    for place in _in_order(stiffness, found.ki)[:_MOST_TRIED]:
        gains = _gains(found, int(place))
        proposal = rounded_proposal(machine, loop, gains, before)
        if proposal is not None and holds_everywhere(loop, proposal.gains, proposal.after, fit):
            return proposal
    return None


def holds_everywhere(loop: SampledLoop, gains: PidGains, margins: LoopMargins, fit: PlantFit) -> bool:
    """Whether gains have the margins on the fitted plant, on its neighbours, and at every measured point."""
    if not _within(margins, DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY):
        return False
    if measured_sensitivity(loop, gains, fit) > MOST_SENSITIVITY:
        return False
    return all(usual(replace(loop, plant=plant, gains=gains)) for plant in fit.others)


def unseen_hz(loop: SampledLoop, gains: PidGains, fit: PlantFit) -> float | None:
    """Return where a mode that the measured points would not show could make these gains oscillate; None: nowhere.

    The frequency with the least room, from half the crossover on.
    """
    tuned = replace(loop, gains=gains, plant=replace(fit.plant, modes=()))
    hz = floats(np.geomspace(1.0, 0.999 * loop.nyquist_hz, 4 * _POINTS))
    opened = tuned.opened(hz)
    above = np.abs(opened) < 1.0
    crossover_hz = float(hz[above].min()) if above.any() else float(hz[-1])
    ratio = hz[:, None] / fit.hz
    shown = np.maximum(fit.misfit, 1.96 * fit.sd)
    hidden = (shown * np.abs(ratio**2 - 1.0 + 2j * LEAST_DAMPING * ratio)).min(axis=1)
    change = np.abs(opened) * hidden / (2.0 * LEAST_DAMPING) / np.abs(1.0 + opened)
    judged = np.where(hz >= max(0.5 * crossover_hz, LEAST_MODE_HZ), change, 0.0)
    place = int(np.argmax(judged))
    return float(hz[place]) if judged[place] > HIDDEN_CHANGE else None


def softer(loop: SampledLoop, gains: PidGains) -> bool:
    """Whether gains leave the loop no more gain than the present ones from half its crossover on."""
    hz = floats(np.geomspace(1.0, 0.999 * loop.nyquist_hz, _POINTS))
    now, then = np.abs(loop.opened(hz)), np.abs(replace(loop, gains=gains).opened(hz))
    crossover_hz = float(hz[now < 1.0].min()) if (now < 1.0).any() else float(hz[-1])
    return bool((then <= 1.001 * now)[hz >= 0.5 * crossover_hz].all())


def usual(loop: SampledLoop) -> bool:
    """Whether a loop is stable and has a usual sensitivity peak."""
    return is_stable(loop) and loop_margins(loop).sensitivity_peak <= MOST_SENSITIVITY


def measured_sensitivity(loop: SampledLoop, gains: PidGains, fit: PlantFit) -> float:
    """Return the largest |1 / (1 + L)| at the measured points, by the measured plant less its uncertainty."""
    one = _Candidates(
        kp=floats([gains.kp_v_per_m]), ki=floats([gains.ki_v_per_m_s]), kd=floats([gains.kd_v_s_per_m])
    )
    sure = fit.sd <= SURE_SD
    return float(_sensitivity(one, fit.measured[sure], fit.hz[sure], loop.period_s, fit.sd[sure])[0])


def _within(margins: LoopMargins, gain: float, sensitivity: float) -> bool:
    phase, more, less = margins.phase_margin_deg, margins.gain_margin, margins.gain_reduction
    return (
        margins.stable
        and more is not None
        and more >= gain
        and phase is not None
        and phase >= LEAST_PHASE_MARGIN_DEG
        and (less is None or less <= 1.0 / LEAST_GAIN_MARGIN)
        and margins.sensitivity_peak <= sensitivity
    )


def _in_order(compliance: Floats, ki: Floats) -> list[int]:
    """Return places by compliance, but of those about as stiff as the best the largest Ki first."""
    if not compliance.size:
        return []
    alike = compliance <= _AS_STIFF * compliance.min()
    keys = np.lexsort((compliance, np.where(alike, -ki, 0.0), ~alike))
    return [int(place) for place in keys]


def _all(present: PidGains) -> _Candidates:
    faster, over_kd, over_kp = np.meshgrid(_FASTER, _KP_OVER_KD, _KI_OVER_KP, indexing="ij")
    kd = floats(present.kd_v_s_per_m * faster.ravel())
    kp = floats(kd * over_kd.ravel())
    return _Candidates(kp=kp, ki=floats(kp * over_kp.ravel()), kd=kd)


def _gains(found: _Candidates, place: int) -> PidGains:
    kd = float(found.kd[place])
    return PidGains(
        kp_v_per_m=float(found.kp[place]),
        ki_v_per_m_s=float(found.ki[place]),
        kd_v_s_per_m=kd,
        velocity_feedforward_v_s_per_m=kd,
    )


def _opened(found: _Candidates, plant: Complexes, hz: Floats, period_s: float) -> Complexes:
    """Return L, shape (n, points)."""
    slope = (1.0 - np.exp(-2j * np.pi * hz * period_s)) / period_s
    control = found.kp[:, None] + found.ki[:, None] / slope + found.kd[:, None] * slope
    return complexes(control * plant)


def _sensitivity(
    found: _Candidates, plant: Complexes, hz: Floats, period_s: float, sd: Floats | None = None
) -> Floats:
    """Return the largest 1 / |1 + L| of each, shape (n,), less 1.96 of the plant's relative `sd`."""
    opened = _opened(found, plant, hz, period_s)
    distance = np.abs(1.0 + opened)
    if sd is not None:
        distance = np.maximum(distance - 1.96 * sd * np.abs(opened), 1e-6)
    return floats((1.0 / distance).max(axis=1, initial=0.0))


def _phase_margin_deg(found: _Candidates, plant: Complexes, hz: Floats, period_s: float) -> Floats:
    """Return the phase margin of each where its gain last falls through 1, between the points of the grid."""
    opened = _opened(found, plant, hz, period_s)
    size, rows = np.log(np.abs(opened)), np.arange(opened.shape[0])
    last = np.minimum(hz.size - 2 - np.argmax(size[:, ::-1] > 0.0, axis=1) + 1, hz.size - 2)
    high, low = size[rows, last], size[rows, last + 1]
    part = np.where(high > low, high / np.maximum(high - low, 1e-12), 0.0)
    turned = np.angle(-opened[rows, last]) * (1.0 - part) + np.angle(-opened[rows, last + 1]) * part
    return floats(np.degrees(np.abs(turned)))


def _yields(found: _Candidates, loop: SampledLoop, hz: Floats, lobe_hz: float) -> Floats:
    """Return how far each yields to the forces of a lobed cut, in units of its own."""
    if not found.kp.size:
        return floats([])
    orders = floats([n for n in LOBE_ORDERS if n * lobe_hz < loop.nyquist_hz])
    at_lobe = _compliance(found, loop, lobe_hz * orders) / orders
    return floats(at_lobe.sum(axis=1) + PEAK_SHARE * _compliance(found, loop, hz).max(axis=1))


def _compliance(found: _Candidates, loop: SampledLoop, hz: Floats) -> Floats:
    """Return the compliance of each at each frequency, shape (n, points), in units of its own."""
    s, plant = 2j * np.pi * hz, loop.plant
    free = np.abs(1.0 / (s * (s + plant.damping_per_s)))
    opened = _opened(found, loop.plant_response(hz), hz, loop.period_s)
    return floats(free / np.abs(1.0 + opened))
