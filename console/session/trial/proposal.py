"""Proposed gains of the tool: from the newest measured response of the present loop, else from the profile.

What may be applied is bounded by the margins of the sampled loop with that plant and its delay: those that are
usual (`profiles.axis.margins`). A proposal asks for more.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.identified import responses_of
from drivers.identification.result import IdentifiedResponse, unfit_problems
from drivers.identification.tool_gains import MOST_VALUE
from drivers.identification.tool_loop import ToolLoop
from profiles.arrays import complexes, floats
from profiles.axis.gain_proposal import GainProposal, identified_plant, proposed_gains
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    loop_margins,
)
from profiles.axis.sampled_loop import AxisPlant, SampledLoop, loop_of
from profiles.machine import MachineProfile
from profiles.problem import Problem

MOST_RESPONSES = 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainFacts:
    """A proposal, None where there is none; `date` is that of the response it rests on, "" for the profile."""

    proposal: GainProposal | None
    plant: AxisPlant
    date: str


def gain_facts(machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool) -> GainFacts:
    """Return the proposal for the loop that was read; ProfileError where the profile lacks a gain."""
    here = machine if read is None else read.on(machine)
    loop, date = present_loop(here, data, simulated=simulated)
    return GainFacts(proposal=proposed_gains(here, loop), plant=loop.plant, date=date)


def present_loop(here: MachineProfile, data: Path, *, simulated: bool) -> tuple[SampledLoop, str]:
    """Return the loop of a machine with the plant of its newest response, and its date; "" for the profile.

    Raises ProfileError: the profile lacks a gain, or the folder cannot be read.
    """
    loop = loop_of(here)
    for kept in responses_of(data, here.name, MOST_RESPONSES):
        found = kept.response
        if found is None or found.path.traits.late_cycles(here):  # it would have the age of its source as a delay
            continue
        if unfit_problems(found, here, found.path, simulated=simulated):
            continue
        plant = _plant(here, found)
        if plant is not None:
            return loop_of(here, plant), found.date
    return loop, ""


def bound_problems(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], plant: AxisPlant
) -> tuple[Problem, ...]:
    """Return why gains must not be applied to the loop that was read: their margins, with the limits.

    Raises ProfileError: the profile lacks a gain.
    """
    if read.unmodelled:
        return (Problem(code="trial.unmodelled", key=", ".join(read.unmodelled)),)
    least = {name: 0 if name.endswith(("32", "33")) else 1 for name in settings}
    for name, value in settings.items():
        if not (least[name] <= value <= MOST_VALUE and float(value).is_integer()):
            limit = f"{least[name]}..{MOST_VALUE}"
            return (Problem(code="trial.range", key=name, value=f"{value:g}", limit=limit),)
    return tuple(_margin_problems(margins_with(machine, read, settings, plant)))


def margins_with(
    machine: MachineProfile, read: ToolLoop, settings: Mapping[str, float], plant: AxisPlant
) -> LoopMargins:
    """Return the margins of the loop that was read with other gains; ProfileError: the profile lacks a gain."""
    here = read.on(machine)
    controller = replace(here.controller, variables={**here.controller.variables, **settings})
    return loop_margins(loop_of(replace(here, controller=controller), plant))


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


def _plant(machine: MachineProfile, found: IdentifiedResponse) -> AxisPlant | None:
    points = sorted(found.points, key=lambda point: point.frequency_hz)
    response = complexes([cmath.rect(point.gain, math.radians(point.phase_deg)) for point in points])
    return identified_plant(loop_of(machine), floats([point.frequency_hz for point in points]), response)
