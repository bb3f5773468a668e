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

from collections.abc import Callable
from dataclasses import replace
from itertools import islice

import numpy as np

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.gain_candidates import (
    Candidates,
    GainProposal,
    all_candidates,
    phase_margin_deg,
    rounded_proposal,
    search_hz,
    sensitivity,
    yields,
)
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    is_stable,
    loop_margins,
    sensitivity_peak,
)
from profiles.axis.plant_fit import PlantFit
from profiles.axis.sampled_loop import SampledLoop
from profiles.axis.servo_gains import PidGains
from profiles.machine import MachineProfile

DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY = 2.5, 1.8
"""Of the fitted plant; its phase margin, and all margins of the other plants, are those that are usual."""

_POINTS = 260
_MOST_TRIED = 60
_AS_STIFF = 1.1
LEAST_DAMPING = 0.02  # assumed least damping ratio of what may bend: bolted steel has 1 to 5 %
HIDDEN_CHANGE = 0.7
SURE_SD = 0.05  # of a measured plant; where friction makes it less certain, the fit alone counts
LEAST_MODE_HZ = 80.0  # below it nothing of a tool slide bends (choice)


def designed_gains(
    machine: MachineProfile,
    loop: SampledLoop,
    fit: PlantFit,
    lobe_hz: float,
    allowed: Callable[[PidGains], bool] = lambda _: True,
) -> GainProposal | None:
    """Return the stiffest gains within the margins on a fitted plant and its neighbours; None: there are none.

    `machine` has the variables of the loop, `loop` its gains and the fitted plant. What is not `allowed` is passed
    over for the next stiffest.
    """
    hz = search_hz(loop, lobe_hz, _POINTS)
    found = all_candidates(loop)
    for response, most in limited_plants(loop, fit, hz):
        found = found.only(sensitivity(found, response, hz, loop.period_s) <= most)
    response = loop.plant_response(hz)
    found = found.only(phase_margin_deg(found, response, hz, loop.period_s) >= LEAST_PHASE_MARGIN_DEG)
    sure = fit.sd <= SURE_SD
    at_points = sensitivity(found, fit.measured[sure], fit.hz[sure], loop.period_s, fit.sd[sure])
    found = found.only(at_points <= MOST_SENSITIVITY)
    before = loop_margins(loop)
    ordered = (found.gains(place) for place in in_order(yields(found, response, loop, hz, lobe_hz), found.ki))
    for gains in islice((each for each in ordered if allowed(each)), _MOST_TRIED):
        proposal = rounded_proposal(machine, loop, gains, before)
        if proposal is None or not allowed(proposal.gains):
            continue
        if holds_everywhere(loop, proposal.gains, proposal.after, fit):
            return proposal
    return None


def limited_plants(loop: SampledLoop, fit: PlantFit, hz: Floats) -> tuple[tuple[Complexes, float], ...]:
    """Return the response of the fitted plant and of each neighbour, each with the largest Ms it may have."""
    limits = ((fit.plant, DESIGN_SENSITIVITY), *((each, MOST_SENSITIVITY) for each in fit.others))
    return tuple((replace(loop, plant=plant).plant_response(hz), most) for plant, most in limits)


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
    return is_stable(loop) and sensitivity_peak(loop) <= MOST_SENSITIVITY


def measured_sensitivity(loop: SampledLoop, gains: PidGains, fit: PlantFit) -> float:
    """Return the largest |1 / (1 + L)| at the measured points, by the measured plant less its uncertainty."""
    sure = fit.sd <= SURE_SD
    hz, measured = fit.hz[sure], fit.measured[sure]
    if gains.notch:
        measured = complexes(measured * gains.notch.at_hz(hz, loop.period_s))
    return float(sensitivity(Candidates.of(gains), measured, hz, loop.period_s, fit.sd[sure])[0])


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


def in_order(compliance: Floats, ki: Floats) -> list[int]:
    """Return places by compliance, but of those about as stiff as the best the largest Ki first."""
    if not compliance.size:
        return []
    alike = compliance <= _AS_STIFF * compliance.min()
    keys = np.lexsort((compliance, np.where(alike, -ki, 0.0), ~alike))
    return [int(place) for place in keys]
