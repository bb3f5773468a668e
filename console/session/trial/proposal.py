"""Proposed gains of the tool: for the axis behind all measured responses of this machine, whatever their gains.

What may be applied is bounded by the margins of the sampled loop with that axis and its delay: those that are
usual (`profiles.axis.margins`). Gains that give the loop more gain than it has need responses in which no
flexible mode can hide that they would make oscillate (`profiles.axis.loop_design`). A proposal asks for more.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.identified import responses_of
from drivers.identification.result import IdentifiedResponse, unfit_problems
from drivers.identification.tool_loop import ToolLoop
from profiles.axis.gain_proposal import MOST_SETTINGS, GainProposal
from profiles.axis.loop_design import designed_gains, softer, unseen_hz
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    loop_margins,
)
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import SampledLoop, loop_of
from profiles.axis.servo_gains import error_limit_um, gains_from_variables
from profiles.axis.stiffness import LobeStiffness, lobe_stiffness, tripping_friction_n
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOST_RESPONSES = 20
LEAST_COHERENCE = 0.95
LOBE_HZ = 50.0  # three jaws at 1000 rpm
SLOW_SWEEP = "--frequencies 25,30,40,50,60,70,80,95 --amplitude 50"
FAST_SWEEP = "--frequencies 60,75,90,105,120,135,150,165,180,195,210,225 --amplitude 35 --periods 60"
"""What a design needs: two amplitudes, by which friction shows, and frequencies at which modes do."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownLoop:
    """The present loop with the axis that is known: `fit` is None, and `date` "", where it is the profile's."""

    loop: SampledLoop
    fit: PlantFit | None = None
    date: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainFacts:
    """A proposal, None where there is none, with the reasons; `known` is what it rests on.

    `stiffness` is the compliance of the present loop and of the proposed one, `trips_n` the dry friction that
    trips each on reversal; `friction_n` is that of the axis with its half-width for 95 %, None where unmeasured.
    """

    proposal: GainProposal | None
    known: KnownLoop
    reasons: tuple[Problem, ...] = ()
    stiffness: tuple[LobeStiffness, LobeStiffness] | None = None
    trips_n: tuple[float, float] = (0.0, 0.0)
    friction_n: tuple[float, float] | None = None


def with_figures(machine: MachineProfile, facts: GainFacts, lobe_hz: float = LOBE_HZ) -> GainFacts:
    """Return the facts with stiffness and friction."""
    tool, fit, loop = machine.tool, facts.known.fit, facts.known.loop
    thrust, found = tool.loop_gain_n_per_v, facts.proposal
    friction = None if fit is None else (thrust * fit.friction_v, 1.96 * thrust * fit.friction_sd_v)
    if found is None:
        return replace(facts, friction_n=friction)
    both = lobe_stiffness(loop, thrust, lobe_hz), lobe_stiffness(replace(loop, gains=found.gains), thrust, lobe_hz)
    limit_um = error_limit_um(machine)
    trips = tripping_friction_n(both[0], limit_um), tripping_friction_n(both[1], limit_um)
    return replace(facts, friction_n=friction, stiffness=both, trips_n=trips)


def gain_facts(
    machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool, lobe_hz: float = LOBE_HZ
) -> GainFacts:
    """Return the proposal for the loop that was read; ProfileError where the profile lacks a gain."""
    facts = _designed(machine, read, data, simulated=simulated, lobe_hz=lobe_hz)
    return with_figures(machine, facts, lobe_hz)


def _designed(
    machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool, lobe_hz: float
) -> GainFacts:
    here = machine if read is None else read.on(machine)
    known = known_loop(here, data, simulated=simulated)
    fit = known.fit
    if fit is None or not fit.holds:
        return GainFacts(proposal=None, known=known, reasons=(_unmeasured(known),))
    proposal = designed_gains(here, known.loop, fit, lobe_hz)
    if proposal is None:
        return GainFacts(proposal=None, known=known, reasons=(Problem(code="trial.no_design"),))
    reasons = _hidden(known, replace(known.loop, gains=proposal.gains))
    return GainFacts(proposal=None if reasons else proposal, known=known, reasons=reasons)


def known_loop(here: MachineProfile, data: Path, *, simulated: bool) -> KnownLoop:
    """Return the loop of a machine with the axis behind its kept responses, of other gains as well.

    Raises ProfileError: the profile lacks a gain, or the folder cannot be read.
    """
    loop, points, date = loop_of(here), list[LoopPoint](), ""
    for kept in responses_of(data, here.name, MOST_RESPONSES):
        found = kept.response
        if found is None or found.path.traits.late_cycles(here):  # it would have the age of its source as a delay
            continue
        measured_with = _with_gains(here, found.origin.gains)
        if unfit_problems(found, measured_with, found.path, simulated=simulated):
            continue
        points += _points(measured_with, found)
        date = date or found.date
    fit = fitted_plant(loop, points)
    if fit is None:
        return KnownLoop(loop=loop)
    return KnownLoop(loop=replace(loop, plant=fit.plant), fit=fit, date=date)


def bound_problems(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], known: KnownLoop
) -> tuple[Problem, ...]:
    """Return why gains must not be applied to the loop that was read: their margins, with the limits, and modes.

    No mode is looked for where they are no more than those that were read, or those of the profile.

    Raises ProfileError: the profile lacks a gain.
    """
    if read.unmodelled:
        return (Problem(code="trial.unmodelled", key=", ".join(read.unmodelled)),)
    least = {name: 0 if name.endswith(("32", "33")) else 1 for name in settings}
    for name, value in settings.items():
        most = MOST_SETTINGS[int(name[-2:])]
        if not (least[name] <= value <= most and float(value).is_integer()):
            limit = f"{least[name]}..{most}"
            return (Problem(code="trial.range", key=name, value=f"{value:g}", limit=limit),)
    tuned = replace(known.loop, gains=gains_from_variables(_with_gains(read.on(machine), settings)))
    stated = replace(known.loop, gains=gains_from_variables(machine))
    hidden = () if softer(stated, tuned.gains) else _hidden(known, tuned)
    return *_margin_problems(loop_margins(tuned)), *hidden


def margins_with(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], known: KnownLoop
) -> LoopMargins:
    """Return the margins of the loop that was read with other gains; ProfileError: the profile lacks a gain."""
    return loop_margins(replace(known.loop, gains=gains_from_variables(_with_gains(read.on(machine), settings))))


def _hidden(known: KnownLoop, tuned: SampledLoop) -> tuple[Problem, ...]:
    """Return why more gain may meet a flexible mode that nothing has shown; none for gains that are not more."""
    fit = known.fit
    if softer(known.loop, tuned.gains):
        return ()
    if fit is None or not fit.holds:
        return (_unmeasured(known),)
    hz = unseen_hz(known.loop, tuned.gains, fit)
    if hz is None:
        return ()
    value, limit = f"{hz:.0f} Hz", f"{fit.hz.min():.4g} … {fit.hz.max():.4g} Hz"
    return (Problem(code="trial.unseen", key=FAST_SWEEP, value=value, limit=limit),)


def _unmeasured(known: KnownLoop) -> Problem:
    """Return that no response tells what the axis is, or that none of its models is what was measured."""
    fit = known.fit
    if fit is None:
        return Problem(code="trial.unmeasured", key=SLOW_SWEEP, value=FAST_SWEEP)
    value, limit = f"{100 * fit.worst:.0f} %", f"<= {100 * fit.allowed:.0f} %"
    return Problem(code="trial.misfit", where=f"{fit.worst_hz:.4g} Hz", value=value, limit=limit)


def _margin_problems(margins: LoopMargins) -> Iterator[Problem]:
    if not margins.stable:
        yield Problem(code="trial.unstable")
        return
    gain, phase, reduction = margins.gain_margin, margins.phase_margin_deg, margins.gain_reduction
    if gain is None or gain < LEAST_GAIN_MARGIN:
        yield Problem(code="trial.gain_margin", value=_number(gain), limit=f">= {LEAST_GAIN_MARGIN:g}")
    if reduction is not None and reduction > 1.0 / LEAST_GAIN_MARGIN:
        limit = f"<= {1.0 / LEAST_GAIN_MARGIN:g}"
        yield Problem(code="trial.gain_reduction", value=_number(reduction), limit=limit)
    if phase is None or phase < LEAST_PHASE_MARGIN_DEG:
        value = _number(phase)
        yield Problem(code="trial.phase_margin", value=f"{value} deg", limit=f">= {LEAST_PHASE_MARGIN_DEG:g} deg")
    if margins.sensitivity_peak > MOST_SENSITIVITY:
        value, limit = f"{margins.sensitivity_peak:.3g}", f"<= {MOST_SENSITIVITY:g}"
        yield Problem(code="trial.sensitivity", value=value, limit=limit)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _points(machine: MachineProfile, found: IdentifiedResponse) -> list[LoopPoint]:
    """Return the points of a response that belong together, with the gains that they were measured with."""
    gains = gains_from_variables(machine)
    return [
        LoopPoint(
            gains=gains,
            hz=point.frequency_hz,
            response=cmath.rect(point.gain, math.radians(point.phase_deg)),
            gain_ci=point.gain_ci,
            amplitude_um=point.amplitude_um,
        )
        for point in found.points
        if point.coherence >= LEAST_COHERENCE
    ]


def _with_gains(machine: MachineProfile, gains: Mapping[str, float]) -> MachineProfile:
    controller = replace(machine.controller, variables={**machine.controller.variables, **gains})
    return replace(machine, controller=controller)
