"""Proposed gains of the tool: from the newest measured response of the present loop, else from the profile."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from pathlib import Path

from console.session.data.identified import responses_of
from console.tui.tuning.loop_facts import MOST_RESPONSES
from drivers.identification.result import IdentifiedResponse, unfit_problems
from drivers.identification.tool_loop import ToolLoop
from profiles.arrays import complexes, floats
from profiles.axis.gain_proposal import GainProposal, identified_plant, proposed_gains
from profiles.axis.sampled_loop import AxisPlant, loop_of
from profiles.machine import MachineProfile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GainFacts:
    """A proposal, None where there is none; `date` is that of the response it rests on, "" for the profile."""

    proposal: GainProposal | None
    plant: AxisPlant
    date: str


def gain_facts(machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool) -> GainFacts:
    """Return the proposal for the loop that was read; ProfileError where the profile lacks a gain."""
    here = machine if read is None else read.on(machine)
    loop = loop_of(here)
    date = ""
    for kept in responses_of(data, here.name, MOST_RESPONSES):
        found = kept.response
        if found is None or found.path.traits.late_cycles(here):  # it would have the age of its source as a delay
            continue
        if unfit_problems(found, here, found.path, simulated=simulated):
            continue
        plant = _plant(here, found)
        if plant is not None:
            loop, date = loop_of(here, plant), found.date
            break
    return GainFacts(
        proposal=proposed_gains(here, loop),
        plant=loop.plant,
        date=date,
    )


def _plant(machine: MachineProfile, found: IdentifiedResponse) -> AxisPlant | None:
    points = sorted(found.points, key=lambda point: point.frequency_hz)
    response = complexes([cmath.rect(point.gain, math.radians(point.phase_deg)) for point in points])
    return identified_plant(loop_of(machine), floats([point.frequency_hz for point in points]), response)
