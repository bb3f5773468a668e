"""The loop of the tool as numbers for the page Tune: its response and margins, and the responses kept of it."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.session.data.identified import responses_of
from console.session.tuning.known_loop import MOST_RESPONSES
from drivers.commissioning.judged import differing_settings
from drivers.identification.result import IdentifiedResponse, unfit_problems
from drivers.identification.tool_gains import ToolLoop
from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.margins import LoopMargins, loop_margins
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import PidGains, gains_from_variables
from profiles.machine import MachineProfile
from profiles.paper.table_5 import FREQUENCIES_HZ, PHASE_ERROR_RAD, measured_gains
from profiles.problem import Problem

PAPER_MACHINE = "lee-2001-lathe"  # the machine of Table 5
LOWEST_HZ, POINTS = 1.0, 300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """A response at frequencies in Hz; a lag is a negative phase."""

    hz: Floats
    gain_db: Floats
    phase_deg: Floats

    @classmethod
    def of(cls, hz: Floats, response: Complexes) -> Curve:
        """Return the curve of a complex response, its phase continuous."""
        gain_db = 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))
        return cls(hz=hz, gain_db=floats(gain_db), phase_deg=floats(np.degrees(np.unwrap(np.angle(response)))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenResponse:
    """A kept response: its points, and why it is not one of the loop that was read; or why it cannot be read."""

    file: Path
    found: IdentifiedResponse | None
    curve: Curve | None
    problems: tuple[Problem, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopFacts:
    """The loop with the gains that were read, or with those of the profile where `read` is None.

    `differing` are the variables in which the two differ: what the profile has, what was read.
    """

    read: ToolLoop | None
    gains: PidGains
    period_ms: float
    margins: LoopMargins
    model: Curve
    responses: tuple[SeenResponse, ...]
    paper: Curve | None
    differing: Mapping[str, tuple[float, float]]


def loop_facts(machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool) -> LoopFacts:
    """Return everything that is shown of the loop; ProfileError where the profile lacks a gain."""
    here = machine if read is None else read.on(machine)
    loop = loop_of(here)
    hz = floats(np.geomspace(LOWEST_HZ, 0.98 * loop.nyquist_hz, POINTS))
    return LoopFacts(
        read=read,
        gains=gains_from_variables(here),
        period_ms=here.controller.servo_period_ms,
        margins=loop_margins(loop),
        model=Curve.of(hz, loop.closed(hz)),
        responses=tuple(_seen(data, here, simulated=simulated)),
        paper=paper_curve() if machine.name == PAPER_MACHINE else None,
        differing=differing_settings(machine, {} if read is None else read.gains),
    )


def paper_curve() -> Curve:
    """Return Table 5 as points: a loss of the peak-to-peak value, the reading that a simple loop can produce."""
    gain_db = 20.0 * np.log10(measured_gains())
    return Curve(
        hz=floats(FREQUENCIES_HZ), gain_db=floats(gain_db), phase_deg=floats(-np.degrees(PHASE_ERROR_RAD))
    )


def _seen(data: Path, machine: MachineProfile, *, simulated: bool) -> Iterator[SeenResponse]:
    for kept in responses_of(data, machine.name, MOST_RESPONSES):
        found, problems, curve = kept.response, kept.problems, None
        if found is not None:
            problems = unfit_problems(found, machine, found.path, simulated=simulated)
            points = sorted(found.points, key=lambda point: point.frequency_hz)
            phasors = complexes([cmath.rect(point.gain, math.radians(point.phase_deg)) for point in points])
            curve = Curve.of(floats([point.frequency_hz for point in points]), phasors)
        yield SeenResponse(file=kept.file, found=found, curve=curve, problems=problems)
