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

The search computes many gains side by side: opened loops, margins and compliance at once. A notch filter, with its
gain at rest taken out, counts as a part of the plant. A proposal is in whole numbers, as the controller takes
them. One factor g multiplies every frequency of the controller: Kd by g, Kp by g^2, Ki by g^3, with the velocity
feedforward equal to Kd; a design has another shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Complexes, Floats, complexes, floats
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
from profiles.axis.sampled_loop import AxisPlant, SampledLoop
from profiles.axis.servo_gains import (
    PidGains,
    gains_from_variables,
    notch_settings,
    present_settings,
    shown_names,
    variables_from_gains,
    with_variables,
)
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
LOBE_ORDERS, PEAK_FRACTION = (1, 2, 3), 0.25
LEAST_ANCHOR_PER_S = 300.0  # crossover of a rigid axis about which gains are tried at least, 1/s

_LEAST_TURN_RAD = 0.25 * np.pi  # a stable loop turns by 90 to 180 deg, an unstable one back
_FASTER = np.geomspace(0.15, 2.6, 30)  # Kd over the present one
_KP_OVER_KD = np.geomspace(20.0, 300.0, 11)  # 1/s
_KI_OVER_KP = floats([0.2, 2.0, 5.0, 10.0, 15.0, 20.0])  # 1/s
MOST_SETTINGS = {30: 32_767, 31: 32_767, 32: 32_767, 33: 8_388_607}
"""The largest value of Ix30 to Ix33 that is written; 2^23 of Ix33 are a gain of 1 in a servo period."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidates:
    """Gains side by side, shape (n,)."""

    kp: Floats
    ki: Floats
    kd: Floats

    @classmethod
    def from_gains(cls, gains: PidGains) -> Candidates:
        """Return one, alone; a filter of it is left out."""
        kp, ki, kd = gains.kp_v_per_m, gains.ki_v_per_m_s, gains.kd_v_s_per_m
        return cls(kp=floats([kp]), ki=floats([ki]), kd=floats([kd]))

    def select_candidates(self, chosen: NDArray[np.bool_]) -> Candidates:
        """Return those that are chosen."""
        return Candidates(kp=self.kp[chosen], ki=self.ki[chosen], kd=self.kd[chosen])

    def gains(self, place: int) -> PidGains:
        """Return one of them, the velocity feedforward equal to its Kd."""
        kd = float(self.kd[place])
        return PidGains(
            kp_v_per_m=float(self.kp[place]),
            ki_v_per_m_s=float(self.ki[place]),
            kd_v_s_per_m=kd,
            velocity_feedforward_v_s_per_m=kd,
        )


def all_candidates(loop: SampledLoop, every: int = 1) -> Candidates:
    """Return gains about the present ones, each `every`-th Kd and Kp; about usual ones where those are softer."""
    anchor = max(loop.gains.at_rest.kd_v_s_per_m, LEAST_ANCHOR_PER_S / loop.plant.acceleration_per_v)
    faster, over_kd, over_kp = np.meshgrid(_FASTER[::every], _KP_OVER_KD[::every], _KI_OVER_KP, indexing="ij")
    kd = floats(anchor * faster.ravel())
    kp = floats(kd * over_kd.ravel())
    return Candidates(kp=kp, ki=floats(kp * over_kp.ravel()), kd=kd)


def open_loop_responses(found: Candidates, plant: Complexes, hz: Floats, period_s: float) -> Complexes:
    """Return L, shape (n, points)."""
    slope = (1.0 - np.exp(-2j * np.pi * hz * period_s)) / period_s
    control = found.kp[:, None] + found.ki[:, None] / slope + found.kd[:, None] * slope
    return complexes(control * plant)


def sensitivity(
    found: Candidates, plant: Complexes, hz: Floats, period_s: float, sd: Floats | None = None
) -> Floats:
    """Return the largest 1 / |1 + L| of each, shape (n,), less 1.96 of the plant's relative `sd`."""
    loops = open_loop_responses(found, plant, hz, period_s)
    distance = np.abs(1.0 + loops)
    if sd is not None:
        distance = np.maximum(distance - 1.96 * sd * np.abs(loops), 1e-6)
    return floats((1.0 / distance).max(axis=1, initial=0.0))


def seem_stable(found: Candidates, plant: Complexes, hz: Floats, period_s: float) -> NDArray[np.bool_]:
    """Return whether 1 + L turns forward by some quarter turn or more from the lowest frequency to the highest.

    A loop of a plant that integrates, with all else stable, is unstable where it does not. Points must be close.
    """
    turned = np.unwrap(np.angle(1.0 + open_loop_responses(found, plant, hz, period_s)), axis=1)
    return np.asarray(turned[:, -1] - turned[:, 0] > _LEAST_TURN_RAD)


def phase_margin_deg(found: Candidates, plant: Complexes, hz: Floats, period_s: float) -> Floats:
    """Return the phase margin of each where its gain last falls through 1, between the points of the grid."""
    loops = open_loop_responses(found, plant, hz, period_s)
    size, rows = np.log(np.abs(loops)), np.arange(loops.shape[0])
    last = np.minimum(hz.size - 2 - np.argmax(size[:, ::-1] > 0.0, axis=1) + 1, hz.size - 2)
    high, low = size[rows, last], size[rows, last + 1]
    part = np.where(high > low, high / np.maximum(high - low, 1e-12), 0.0)
    turned = np.angle(-loops[rows, last]) * (1.0 - part) + np.angle(-loops[rows, last + 1]) * part
    return floats(np.degrees(np.abs(turned)))


def yields(found: Candidates, plant: Complexes, loop: SampledLoop, hz: Floats, lobe_hz: float) -> Floats:
    """Return how far each yields to the forces of a lobed cut, in units of its own.

    `plant` is the response at `hz`, whose points are close enough to read those of the lobe between them.
    """
    if not found.kp.size:
        return floats([])
    orders = [n for n in LOBE_ORDERS if n * lobe_hz < loop.nyquist_hz]
    s = 2j * np.pi * hz
    free = np.abs(1.0 / (s * (s + loop.plant.damping_per_s)))
    compliance = free / np.abs(1.0 + open_loop_responses(found, plant, hz, loop.period_s))
    at_lobe = [compliance[:, np.argmin(np.abs(hz - n * lobe_hz))] / n for n in orders]
    return floats(np.sum(at_lobe, axis=0) + PEAK_FRACTION * compliance.max(axis=1))


def search_hz(loop: SampledLoop, lobe_hz: float, points: int, others: Sequence[AxisPlant] = ()) -> Floats:
    """Return frequencies for a search: spread over all, at the lobe's, and close about each mode of each plant."""
    orders = [n * lobe_hz for n in LOBE_ORDERS if n * lobe_hz < loop.nyquist_hz]
    modes = {round(mode.hz, 3) for plant in (loop.plant, *others) for mode in plant.modes}
    parts = [np.geomspace(0.5, 0.999 * loop.nyquist_hz, points), np.array(orders)]
    parts += [hz * np.linspace(0.95, 1.05, 21) for hz in modes]
    found = np.unique(np.concatenate(parts))
    return floats(found[found < loop.nyquist_hz])


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProposal:
    """Proposed gains, as rounded to the whole numbers that the controller takes, and margins before and after.

    Both margins are those of the same plant. `factor` is that of Kd, None where the present gains have none, as
    with Ix30 = 0. `settings` are Ix30 to Ix33 and the notch filter Ix36 to Ix39 by name, `present` those of the
    machine.
    """

    factor: float | None
    gains: PidGains
    settings: dict[str, float]
    present: dict[str, float]
    before: LoopMargins
    after: LoopMargins

    @property
    def changes(self) -> tuple[tuple[str, float, float], ...]:
        """Names with present and proposed value; without the filter where neither has one."""
        shown = shown_names(self.settings, self.present)
        return tuple((name, self.present[name], self.settings[name]) for name in shown)


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
        notch=gains.notch,
    )
    return rounded_proposal(machine, loop, asked, before)


def rounded_proposal(
    machine: MachineProfile, loop: SampledLoop, asked: PidGains, before: LoopMargins
) -> GainProposal | None:
    """Return gains as the whole numbers that the controller takes; None where they do not fit the variables."""
    motor = machine.tool.motor
    settings: dict[str, float] = {**variables_from_gains(machine, asked), **notch_settings(machine, asked.notch)}
    if any(settings[f"I{motor}{number}"] > most for number, most in MOST_SETTINGS.items()):
        return None
    rounded = gains_from_variables(with_variables(machine, settings))
    shown = {name: value for name, value in settings.items() if not name.endswith(("34", "35"))}
    after = loop_margins(replace(loop, gains=rounded))
    kd, present_kd = rounded.at_rest.kd_v_s_per_m, loop.gains.at_rest.kd_v_s_per_m
    return GainProposal(
        factor=kd / present_kd if present_kd else None,
        gains=rounded,
        settings=shown,
        present=present_settings(machine, shown),
        before=before,
        after=after,
    )


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
        found = found.select_candidates(sensitivity(found, response, hz, loop.period_s) <= most)
    response = loop.plant_response(hz)
    found = found.select_candidates(phase_margin_deg(found, response, hz, loop.period_s) >= LEAST_PHASE_MARGIN_DEG)
    sure = fit.sd <= SURE_SD
    at_points = sensitivity(found, fit.measured[sure], fit.hz[sure], loop.period_s, fit.sd[sure])
    found = found.select_candidates(at_points <= MOST_SENSITIVITY)
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
    if not _meets_margins(margins, DESIGN_GAIN_MARGIN, DESIGN_SENSITIVITY):
        return False
    if measured_sensitivity(loop, gains, fit) > MOST_SENSITIVITY:
        return False
    return all(is_usual_loop(replace(loop, plant=plant, gains=gains)) for plant in fit.others)


def unseen_hz(loop: SampledLoop, gains: PidGains, fit: PlantFit) -> float | None:
    """Return where a mode that the measured points would not show could make these gains oscillate; None: nowhere.

    The frequency with the least room, from half the crossover on.
    """
    tuned = replace(loop, gains=gains, plant=replace(fit.plant, modes=()))
    hz = floats(np.geomspace(1.0, 0.999 * loop.nyquist_hz, 4 * _POINTS))
    opened = tuned.open_loop(hz)
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
    now, then = np.abs(loop.open_loop(hz)), np.abs(replace(loop, gains=gains).open_loop(hz))
    crossover_hz = float(hz[now < 1.0].min()) if (now < 1.0).any() else float(hz[-1])
    return bool((then <= 1.001 * now)[hz >= 0.5 * crossover_hz].all())


def is_usual_loop(loop: SampledLoop) -> bool:
    """Whether a loop is stable and has a usual sensitivity peak."""
    return is_stable(loop) and sensitivity_peak(loop) <= MOST_SENSITIVITY


def measured_sensitivity(loop: SampledLoop, gains: PidGains, fit: PlantFit) -> float:
    """Return the largest |1 / (1 + L)| at the measured points, by the measured plant less its uncertainty."""
    sure = fit.sd <= SURE_SD
    hz, measured = fit.hz[sure], fit.measured[sure]
    if gains.notch:
        measured = complexes(measured * gains.notch.at_hz(hz, loop.period_s))
    return float(sensitivity(Candidates.from_gains(gains), measured, hz, loop.period_s, fit.sd[sure])[0])


def _meets_margins(margins: LoopMargins, gain: float, sensitivity: float) -> bool:
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
