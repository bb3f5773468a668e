"""A notch filter for a tool that bends, with the gains that it allows: stiffer than gains alone, or none.

Zeros are placed about the fitted mode and poles, damped more, at it or above; with each pair the gains are
searched as without a filter (`profiles.axis.loop_design`), with the same margins on the fitted plant, on its
neighbours and at the measured points. A filter counts where the gains with it yield at least a tenth less than
gains alone.

How a controller reads the signs of the coefficients is known by its manual alone until a test with a filter has
shown it. Until then the loop also has to be stable, with an Ms of at most 4 on the fitted plant, under each other
reading (`profiles.axis.notch.SignConvention`), so that a wrong one is seen in numbers and not in a tool that
oscillates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np

from profiles.arrays import Complexes, Floats, complexes
from profiles.axis.loop_design import (
    Candidates,
    GainProposal,
    all_candidates,
    holds_everywhere,
    in_order,
    limited_plants,
    phase_margin_deg,
    rounded_proposal,
    search_hz,
    seem_stable,
    sensitivity,
    yields,
)
from profiles.axis.margins import LEAST_PHASE_MARGIN_DEG, is_stable, loop_margins, sensitivity_peak
from profiles.axis.notch import OTHER_READINGS, Notch, SignConvention, placed_notch
from profiles.axis.plant_fit import PlantFit
from profiles.axis.sampled_loop import AxisPlant, SampledLoop
from profiles.axis.servo_gains import PidGains
from profiles.machine import MachineProfile

LEAST_STIFFER = 0.9  # of what gains alone yield; a filter that brings less is not worth its risk
MOST_SENSITIVITY_OTHERWISE = 4.0
"""Ms with the signs read otherwise: a gain margin of 1.33 and a phase margin of 14 deg at least."""

_ZERO_PLACES, _ZERO_RATIOS = (0.9, 1.0, 1.15), (0.05, 0.15, 0.3, 0.5)
_POLE_PLACES, _POLE_RATIOS = (1.0, 1.5, 2.0), (0.4, 0.6, 0.8, 1.0)
_POINTS = 50
_EVERY = 2  # of the gains that are tried without a filter
_MOST_EACH, _MOST_TRIED = 3, 30


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    """What is the same for each filter: frequencies, plants at them, gains, and how far gains alone yield."""

    loop: SampledLoop
    fit: PlantFit
    lobe_hz: float
    hz: Floats
    plants: tuple[tuple[Complexes, float], ...]
    candidates: Candidates
    most_yield: float
    allowed: Callable[[PidGains], bool]


def design_with_notch(
    machine: MachineProfile,
    loop: SampledLoop,
    fit: PlantFit,
    lobe_hz: float,
    alone: GainProposal | None,
    *,
    proven: bool,
    allowed: Callable[[PidGains], bool] = lambda _: True,
) -> GainProposal | None:
    """Return gains and a filter that are stiffer than gains alone; None: there are none, or nothing bends.

    `proven` is whether the controller was seen to read the coefficients as stated. What is not `allowed` is passed
    over for the next stiffest.
    """
    if not fit.plant.modes:
        return None
    search = _search(loop, fit, lobe_hz, alone, allowed)
    found = sorted(
        (
            (cost, gains)
            for notch in _notches(loop, fit, proven=proven)
            for cost, gains in _best(search, notch, proven=proven)
        ),
        key=lambda each: each[0],
    )
    before = loop_margins(loop)
    for _, gains in found[:_MOST_TRIED]:
        proposal = rounded_proposal(machine, loop, gains, before)
        if proposal is None or not allowed(proposal.gains):
            continue
        if not holds_everywhere(loop, proposal.gains, proposal.after, fit):
            continue
        if proven or fails_otherwise(loop, proposal.gains, (fit.plant, *fit.others)) is None:
            return proposal
    return None


def _search(
    loop: SampledLoop,
    fit: PlantFit,
    lobe_hz: float,
    alone: GainProposal | None,
    allowed: Callable[[PidGains], bool],
) -> _Search:
    hz = search_hz(loop, lobe_hz, _POINTS, fit.others)
    most = np.inf
    if alone is not None:
        most = LEAST_STIFFER * lobe_yield(replace(loop, gains=alone.gains), lobe_hz)
    return _Search(
        loop=loop,
        fit=fit,
        lobe_hz=lobe_hz,
        hz=hz,
        plants=limited_plants(loop, fit, hz),
        candidates=all_candidates(loop, _EVERY),
        most_yield=most,
        allowed=allowed,
    )


def _notches(loop: SampledLoop, fit: PlantFit, *, proven: bool) -> Iterator[Notch]:
    """Yield the filters about the fitted mode that are filters under each reading that is possible."""
    hz = fit.plant.modes[0].hz
    for above, zeros, below, poles in product(_ZERO_PLACES, _ZERO_RATIOS, _POLE_PLACES, _POLE_RATIOS):
        notch = placed_notch(above * hz, zeros, below * hz, poles, loop.period_s)
        readings = () if proven else OTHER_READINGS
        if notch.steady and all(notch.read_as(each).steady for each in readings):
            yield notch


def _best(search: _Search, notch: Notch, *, proven: bool) -> Iterator[tuple[float, PidGains]]:
    """Yield the stiffest allowed gains with a filter that hold on the grid, each with how far it yields."""
    period_s, hz = search.loop.period_s, search.hz
    found, filtered = search.candidates, notch.at_hz(hz, period_s) / notch.at_rest
    for place, (response, limit) in enumerate(search.plants):
        plant = complexes(filtered * response)
        found = found.select_candidates(sensitivity(found, plant, hz, period_s) <= limit)
        if place == 0:  # most gains are already not worth the rest
            found = found.select_candidates(
                yields(found, plant, search.loop, hz, search.lobe_hz) <= search.most_yield
            )
            found = found.select_candidates(phase_margin_deg(found, plant, hz, period_s) >= LEAST_PHASE_MARGIN_DEG)
            found = found.select_candidates(seem_stable(found, plant, hz, period_s))
        if not found.kp.size:
            return
    if not proven:
        found = _safe_otherwise(search, notch, found)
    plant = complexes(filtered * search.plants[0][0])
    cost = yields(found, plant, search.loop, hz, search.lobe_hz)
    ordered = (
        (place, replace(found.gains(place).scale_gains(1.0 / notch.at_rest), notch=notch))
        for place in in_order(cost, found.ki)
    )
    for place, gains in islice((each for each in ordered if search.allowed(each[1])), _MOST_EACH):
        yield float(cost[place]), gains


def fails_otherwise(loop: SampledLoop, gains: PidGains, plants: Sequence[AxisPlant]) -> SignConvention | None:
    """Return a reading under which a loop has not even the reduced margin; None where each has.

    It is asked for on the first plant; on the others the loop has to be stable.
    """
    for reading in OTHER_READINGS:
        read = replace(gains, notch=gains.notch.read_as(reading))
        loops = [replace(loop, gains=read, plant=plant) for plant in plants]
        steady = read.notch.steady and all(is_stable(each) for each in loops)
        if not steady or sensitivity_peak(loops[0]) > MOST_SENSITIVITY_OTHERWISE:
            return reading
    return None


def _safe_otherwise(search: _Search, notch: Notch, found: Candidates) -> Candidates:
    """Return the gains with which the loop has the reduced margin, and is stable on each plant, otherwise read."""
    period_s, hz = search.loop.period_s, search.hz
    limits = (MOST_SENSITIVITY_OTHERWISE, *(np.inf for _ in search.fit.others))
    for reading in OTHER_READINGS:
        filtered = notch.read_as(reading).at_hz(hz, period_s) / notch.at_rest
        for (plant, _), limit in zip(search.plants, limits, strict=True):
            if not found.kp.size:
                return found
            read = complexes(filtered * plant)
            if np.isfinite(limit):
                found = found.select_candidates(sensitivity(found, read, hz, period_s) <= limit)
            found = found.select_candidates(seem_stable(found, read, hz, period_s))
    return found


def lobe_yield(loop: SampledLoop, lobe_hz: float) -> float:
    """Return how far a loop yields to a lobed cut, in the units of `yields`."""
    hz, gains = search_hz(loop, lobe_hz, 10 * _POINTS), loop.gains
    plant = complexes(loop.plant_response(hz) * gains.notch.at_hz(hz, loop.period_s))
    return float(yields(Candidates.from_gains(gains), plant, loop, hz, lobe_hz)[0])
