"""The deflection of one clamping from readings finger-tight and at full force.

At each place the difference of the two readings is what the full force did: whatever repeats with the angle (the
form of the blank, its run-out, the error of the spindle) is in both and drops out. The deflection is written as
what springs back, high where the jaws press, like the lobe of a released part.

It cannot separate: the force that finger-tight has already; a part that shifts or turns in the jaws as they close,
beyond once a turn; and whatever an indicator that was moved between the two would show.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats, floats
from profiles.fingerprint.readings import LEAST_PLACES, ClampReadings
from profiles.job import Job
from profiles.least_squares import fit, harmonic_columns, phasors, student
from profiles.problem import Problem, ProfileError

OVAL = 2
ONCE = 1  # a part that shifts as the jaws close
STEADY = 8.0  # largest condition of a fit whose places separate its orders
MOST_OVAL = 0.05
"""Of an oval that is in the lobe of a fit without one: a choice. A jaw that presses 10 % harder makes an oval of
0.4, 0.8 and 2.7 of the lobe with three, four and six jaws, and eight places at six jaws show it as their lobe."""

SUPPOSED_SD_UM = 1.5
"""Of a difference where no graduation is stated: two readings of a dial of 1 um, and its play."""

REPEATS = 1.0  # of a graduation: with how much of it a reading repeats, one standard deviation
SUPPOSED_READINGS = 6.0
"""How many degrees of freedom what is supposed of the dial counts for, beside the residuals of the fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deflection:
    """The deflection of one clamping, as what springs back: coefficients in um by order, in spindle angle.

    `sd_um` are the standard errors of one component, of `freedom` degrees of freedom. `reading_sd_um` is that of a
    difference. `upright`: the places do not show the angle of the lobe, which was taken at the angle where it was
    expected: only its component there is known.
    """

    coefficients_um: Mapping[int, complex]
    sd_um: Mapping[int, float]
    freedom: float
    reading_sd_um: float
    places: int
    upright: bool = False

    def limit_um(self, order: int) -> float:
        """Return the 95 % half-width of the amplitude of an order."""
        return student(self.freedom) * self.sd_um[order]


def deflection_of(readings: ClampReadings, job: Job) -> Deflection:
    """Return the deflection that readings show; `job` has jaw 1 where it is.

    Raises `ProfileError`: `clamping.dependent`, the places do not show the lobe.
    """
    angle = spindle_rad(readings, job)
    sign = -1.0 if readings.inward else 1.0
    sprung_um = -sign * (floats(readings.full_um) - floats(readings.finger_um))
    lobes, places = job.jaws, readings.places
    for orders in _models(lobes):
        columns = harmonic_columns(angle, orders)
        if columns.shape[1] >= places or fit(columns, sprung_um).condition > STEADY:
            continue
        of_lobe = 1 + 2 * orders.index(lobes)
        if OVAL in orders or _oval_in(columns, angle, slice(of_lobe, of_lobe + 2)) <= MOST_OVAL:
            return _build_deflection(readings, columns, sprung_um, orders, places)
    return _upright(readings, angle, sprung_um, job)


def _models(lobes: int) -> Sequence[tuple[int, ...]]:
    """Return the orders to fit, the most first: without those that leak into the lobe nothing is certain."""
    beside = (ONCE,) if lobes == OVAL else (ONCE, OVAL)
    return ((*beside, lobes, 2 * lobes), (*beside, lobes), (ONCE, lobes))


def places_needed(lobes: int) -> int:
    """Return how many places, evenly from a jaw on, show the height of a lobe; one more shows its angle, too."""
    return max(LEAST_PLACES, 2 * lobes)


def _oval_in(columns: Floats, angle: Floats, of_lobe: slice) -> float:
    """Return how much of an oval these places would show as the lobe, in a fit that has no oval of its own."""
    shown = np.linalg.pinv(columns)[of_lobe] @ harmonic_columns(angle, (OVAL,))[:, 1:]
    return float(np.linalg.norm(shown, 2))


def _build_deflection(
    readings: ClampReadings, columns: Floats, sprung_um: Floats, orders: Sequence[int], places: int
) -> Deflection:
    found = fit(columns, sprung_um)
    sd_um, freedom = reading_sd_um(readings, found.residuals, found.freedom)
    per_order = [found.cofactors[1 + 2 * k : 3 + 2 * k, 1 + 2 * k : 3 + 2 * k] for k in range(len(orders))]
    return Deflection(
        coefficients_um=phasors(found.coefficients, orders),
        sd_um={n: sd_um * math.sqrt(float(np.trace(c)) / 2.0) for n, c in zip(orders, per_order, strict=True)},
        freedom=freedom,
        reading_sd_um=sd_um,
        places=places,
    )


def _upright(readings: ClampReadings, angle: Floats, sprung_um: Floats, job: Job) -> Deflection:
    """Fit the lobe at its expected angle alone: places at and between the jaws show nothing of its angle."""
    past = job.jaws * (angle - math.radians(job.lobe_phase_deg))
    columns = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle), np.cos(past)], axis=1)
    found = fit(columns, sprung_um)
    oval = 0.0 if job.jaws == OVAL else _oval_in(columns, angle, slice(3, 4))
    if found.condition > STEADY or oval > MOST_OVAL:
        value, limit = f"{job.jaws}/rev", f">= {places_needed(job.jaws)}"
        raise ProfileError(Problem(code="clamping.dependent", key=str(readings.places), value=value, limit=limit))
    sd_um, freedom = reading_sd_um(readings, found.residuals, found.freedom)
    there = np.exp(-1j * job.jaws * math.radians(job.lobe_phase_deg))
    return Deflection(
        coefficients_um={job.jaws: complex(float(found.coefficients[3]) * there)},
        sd_um={job.jaws: sd_um * math.sqrt(float(found.cofactors[3, 3]))},
        freedom=freedom,
        reading_sd_um=sd_um,
        places=readings.places,
        upright=True,
    )


def spindle_rad(readings: ClampReadings, job: Job) -> Floats:
    """Return the spindle angles of the readings; `job` has jaw 1 where it is."""
    turned = (-1.0 if readings.against else 1.0) * floats(readings.angle_deg)
    return np.radians(turned + (job.jaw_1_deg if readings.from_jaw_1 else 0.0))


def reading_sd_um(readings: ClampReadings, residuals: Floats, freedom: int) -> tuple[float, float]:
    """Return the standard deviation of a difference, from what is known of the dial and from the residuals."""
    graduation = readings.graduation_um
    supposed = SUPPOSED_SD_UM if graduation is None else REPEATS * math.sqrt(2.0) * graduation
    together = SUPPOSED_READINGS + freedom
    squares = SUPPOSED_READINGS * supposed**2 + float(residuals @ residuals)
    return math.sqrt(squares / together), together
