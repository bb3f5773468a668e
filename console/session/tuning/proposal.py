"""Proposed gains of the tool: for the axis behind all measured responses of this machine, whatever their gains.

Where something bends, a notch filter is proposed with them if that is stiffer than gains alone. The first one is
safe however the controller reads its coefficients; once a test has shown how, the next one need not be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from console.session.tuning.air_proof import find_missing_proofs
from console.session.tuning.bounds import (
    hidden_problems,
    margin_problems,
    swept_to_the_end,
    unmeasured_problem,
    unseen_problems,
)
from console.session.tuning.known_loop import KnownLoop, known_loop
from console.session.tuning.notch_evidence import NO_FIRMWARE, misread
from drivers.identification.tool_gains import ToolLoop
from profiles.axis.loop_design import GainProposal, designed_gains, unseen_hz
from profiles.axis.notch import SignConvention
from profiles.axis.notch_design import design_with_notch
from profiles.axis.servo_gains import PidGains, error_limit_um
from profiles.axis.stiffness import LobeStiffness, lobe_stiffness, tripping_friction_n
from profiles.machine import MachineProfile
from profiles.problem import Problem

LOBE_HZ = 50.0  # three jaws at 1000 rpm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainFacts:
    """A proposal, None where there is none, with the reasons; `known` is what it rests on.

    `stiffness` is the compliance of the present loop and of the proposed one, `trips_n` the dry friction that
    trips each on reversal; `friction_n` is that of the axis with its half-width for 95 %, None where unmeasured.
    `notes` say what a filter is for, or why there is none.
    """

    proposal: GainProposal | None
    known: KnownLoop
    reasons: tuple[Problem, ...] = ()
    stiffness: tuple[LobeStiffness, LobeStiffness] | None = None
    trips_n: tuple[float, float] = (0.0, 0.0)
    friction_n: tuple[float, float] | None = None
    notes: tuple[Problem, ...] = ()


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
    machine: MachineProfile,
    read: ToolLoop | None,
    data: Path,
    firmware: tuple[str, str] = NO_FIRMWARE,
    *,
    simulated: bool,
    lobe_hz: float = LOBE_HZ,
) -> GainFacts:
    """Return the proposal for the loop that was read; ProfileError where the profile lacks a gain."""
    here = machine if read is None else read.apply_to(machine)
    known = known_loop(here, data, firmware, simulated=simulated)
    facts = with_figures(machine, _design_gains(here, known, lobe_hz), lobe_hz)
    found, stiffness = facts.proposal, facts.stiffness
    if found is None or stiffness is None or stiffness[1].most_um_per_n <= stiffness[0].most_um_per_n:
        return facts
    if any(margin_problems(found.before)) or find_missing_proofs(
        data, here, found.present, known.loop, simulated=simulated
    ):
        return facts
    value, limit = (f"{each.most_um_per_n:.2f} um/N" for each in stiffness)
    reasons = (Problem(code="trial.stiff_already", value=value, limit=limit),)
    return GainFacts(proposal=None, known=known, reasons=reasons, friction_n=facts.friction_n)


def _design_gains(here: MachineProfile, known: KnownLoop, lobe_hz: float) -> GainFacts:
    fit = known.fit
    if fit is None or not fit.holds:
        return GainFacts(proposal=None, known=known, reasons=(unmeasured_problem(known),))
    alone = designed_gains(here, known.loop, fit, lobe_hz)
    proposal, notes = _with_filter(here, known, lobe_hz, alone)
    if proposal is None:
        return GainFacts(proposal=None, known=known, reasons=(Problem(code="trial.no_design"),))
    reasons = hidden_problems(here, known, replace(known.loop, gains=proposal.gains))
    if reasons and swept_to_the_end(here, known):
        # Until more is measured: the stiffest that no hidden mode meets.
        notes = reasons
        proposal = designed_gains(
            here, known.loop, fit, lobe_hz, allowed=lambda gains: unseen_hz(known.loop, gains, fit) is None
        )
        reasons = () if proposal is not None else (*reasons, Problem(code="trial.no_design"))
    return GainFacts(proposal=None if reasons else proposal, known=known, reasons=reasons, notes=notes)


def _with_filter(
    here: MachineProfile, known: KnownLoop, lobe_hz: float, alone: GainProposal | None
) -> tuple[GainProposal | None, tuple[Problem, ...]]:
    """Return gains with a notch filter where they are stiffer, else gains alone; and what is to be said of it.

    What is proposed does not depend on the gains in the controller: a filter that may meet a hidden mode is passed
    over also where they have more gain.
    """
    fit, reading = known.fit, known.reading
    if fit is None or not fit.plant.modes:
        return alone, ()
    if reading not in (None, SignConvention.STATED):
        return alone, (Problem(code="trial.other_reading", value=misread(reading, here.tool.motor)),)
    proven, passed_over = reading is SignConvention.STATED, list[PidGains]()

    def allowed(gains: PidGains) -> bool:
        if unseen_hz(known.loop, gains, fit) is None:
            return True
        passed_over.append(gains)
        return False

    found = design_with_notch(here, known.loop, fit, lobe_hz, alone, proven=proven, allowed=allowed)
    if found is not None:
        return found, () if proven else (Problem(code="trial.first_notch"),)
    if passed_over:
        return alone, unseen_problems(here, known, passed_over[0])
    return alone, (Problem(code="trial.no_notch" if proven else "trial.no_safe_notch"),)
