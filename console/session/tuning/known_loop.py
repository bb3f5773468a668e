"""The loop of the tool with the axis that is known: the one behind all measured responses, whatever their gains.

Responses that were measured with a notch filter count where the controller was seen to read its coefficients as
they are meant (`console.session.tuning.notch_evidence`), or where there are no others.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.data.identified_responses import responses_of
from console.session.tuning.notch_evidence import NO_FIRMWARE, seen_reading
from drivers.identification.excitation import CARRIER_UM, carrier_hz
from drivers.identification.result import IdentifiedResponse, unfit_problems
from profiles.axis.notch import SignConvention
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import SampledLoop, loop_of
from profiles.axis.servo_gains import complete_settings, gains_from_variables, with_variables
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

MOST_RESPONSES = 20
LEAST_COHERENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KnownLoop:
    """The present loop with the axis that is known: `fit` is None, and `date` "", where it is the profile's.

    With a fit that denies what has run the axis is the profile's, too.

    `reading` is how a test has shown that the controller reads a notch filter, None where none has. It is known by
    responses without one alone: `unfiltered` is whether the fit rests on such.
    """

    loop: SampledLoop
    fit: PlantFit | None = None
    date: str = ""
    reading: SignConvention | None = None
    unfiltered: bool = False


def known_loop(
    here: MachineProfile, data: Path, firmware: tuple[str, str] = NO_FIRMWARE, *, simulated: bool
) -> KnownLoop:
    """Return the loop of a machine with the axis behind its kept responses, of other gains as well.

    How a filter is read is known of one `firmware` (version and type), where that is given.

    Raises ProfileError: the profile lacks a gain, or the folder cannot be read.
    """
    loop = loop_of(here)
    plain, filtered, date = list[LoopPoint](), list[LoopPoint](), ""
    for kept in responses_of(data, here.name, MOST_RESPONSES):
        found = kept.response
        if found is None or found.path.traits.late_cycles(here):  # it would have the age of its source as a delay
            continue
        measured_with = with_variables(here, complete_settings(here, found.origin.gains))
        if unfit_problems(found, measured_with, found.path, simulated=simulated):
            continue
        points = _points(measured_with, found)
        if any(point.gains.notch for point in points):
            filtered += points
        else:
            plain += points
        date = date or found.date
    unfiltered = fitted_plant(loop, plain)
    fit = unfiltered or fitted_plant(loop, plain + filtered)
    if fit is None:
        return KnownLoop(loop=loop)
    reading = None
    if unfiltered is not None:  # an axis fitted with a filter may take another reading of it for its own
        reading = seen_reading(here, data, fit.plant, firmware, simulated=simulated)
    if filtered and plain and reading is SignConvention.STATED:
        fit = fitted_plant(loop, plain + filtered) or fit
    return KnownLoop(
        loop=loop if fit.denied else replace(loop, plant=fit.plant),
        fit=fit,
        date=date,
        reading=reading,
        unfiltered=unfiltered is not None,
    )


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
            carried_m_per_s=2e-6 * math.pi * CARRIER_UM * (carrier_hz(machine, point.frequency_hz) or 0.0),
        )
        for point in found.points
        if point.coherence >= LEAST_COHERENCE
    ]


def identified_friction(machine: MachineProfile, data: Path, *, simulated: bool) -> str:
    """Return friction and half-width for 95 % as text, "" where no response tells it from nothing."""
    try:
        fit = known_loop(machine, data, simulated=simulated).fit
    except ProfileError:  # what matters is the trip; the page Tune names the file that cannot be read
        return ""
    thrust = machine.tool.loop_gain_n_per_v
    if fit is None or fit.friction_v <= 1.96 * fit.friction_sd_v:
        return ""
    return f"{thrust * fit.friction_v:.1f} ± {1.96 * thrust * fit.friction_sd_v:.1f} N"
