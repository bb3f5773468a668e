"""The lobe of the part that is clamped now: the job's or the learned one, corrected by the fingerprint.

The jaws make the lobe, its multiples and the oval of a jaw that presses harder, all in proportion to the force.
So all of them are scaled with the lobe, and the multiples turn with it. What the spindle has of such an order is
scaled with them: it is small beside them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from profiles.axis.response import AMPLIFICATION_LIMIT
from profiles.chucking.grip import centrifugal_loss_n
from profiles.chucking.holding import holding_of
from profiles.chucking.ring import Ring, is_thin, spring_back_um_pp
from profiles.compensations.learning import SIGNIFICANT, SURE, coefficient_of
from profiles.compensations.optimal_gain import PRIOR_OTHERS_UM, PROCESS_LOSS_SD
from profiles.compensations.path import CutPath
from profiles.fingerprint.deflection import ONCE, OVAL, SUPPOSED_SD_UM, Deflection, deflection_of
from profiles.fingerprint.lobe_filter import ClampingScale, LobeFilter, MeasuredCoefficient, lobe_filter
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.materials import material_or_none
from profiles.problem import Problem, refusal_error

FINGER_FRACTION = 0.05  # of the full force that finger-tight has, where nobody has stated it; assumed
FINGER_SD = 0.01  # with which it repeats, over the full force; assumed
BESIDE_UM = 0.5  # of the order of the lobe that is of the spindle; assumed
MOST_DEVIATION = 0.5  # of a force from that of the job: beyond that it is another clamping, or another part


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingFingerprint:
    """The fingerprint of one clamping: `seen` as the lobe that all of its force at rest would make, um.

    `others` are the further orders that the jaws make, the same way.
    """

    seen: MeasuredCoefficient
    deflection: Deflection
    others: Mapping[int, MeasuredCoefficient]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingCorrection:
    """What a fingerprint makes of a path: orders are `added_um`, then the lobe becomes `ratio` times itself.

    `force_deviation` is by which fraction this clamping pulls more than the job says, `lobe_um` the lobe of this
    part with `sd_um`, the standard deviation of its amplitude. `weight` is the fraction of what was not known of
    that amplitude, as a variance, that the indicator has removed. `evaluate_readings` is what it has shown,
    `warnings` why that is hard to believe.
    """

    ratio: complex
    added_um: Mapping[int, complex]
    force_deviation: float
    lobe_um: complex
    sd_um: float
    weight: float
    felt: MeasuredCoefficient
    warnings: tuple[Problem, ...] = ()


def clamping_scale(job: Job, machine: MachineProfile) -> ClampingScale:
    """Return how the force of a clamping bends the part of a job.

    Raises `ProfileError`: `clamping.no_grip`, rotation takes all of the force.
    """
    force_n, loss_n = job.chucking_force_n, centrifugal_loss_n(job, machine)
    if loss_n >= force_n:
        raise refusal_error("clamping.no_grip", value=f"{force_n:.0f} N", limit=f"> {loss_n:.0f} N")
    at_speed = force_n / (force_n - loss_n)
    return ClampingScale(at_speed=at_speed, at_rest=at_speed, sd=holding_of(machine).force_sd_fraction)


def known_lobe(
    lobe_um: complex, job: Job, machine: MachineProfile, height_sd: float, turn_sd_deg: float
) -> LobeFilter:
    """Return what is known of the lobe of a job before any part: height and angle, each with its uncertainty."""
    scale = clamping_scale(job, machine)
    return lobe_filter(
        lobe_um,
        job.jaws,
        scale,
        height_sd=height_sd,
        turn_sd_deg=turn_sd_deg,
        beside_um=BESIDE_UM,
        lost_sd=PROCESS_LOSS_SD,
    )


def evaluate_readings(readings: ClampReadings, job: Job) -> ClampingFingerprint:
    """Return what readings say of the lobe of a job; it has jaw 1 where it is.

    Raises `ProfileError`: the places do not show the lobe; `clamping.finger_force`, finger-tight was no less.
    """
    finger = FINGER_FRACTION
    if readings.finger_force_n is not None:
        finger = readings.finger_force_n / job.chucking_force_n
        if finger >= MOST_DEVIATION:
            value, limit = f"{readings.finger_force_n:g} N", f"< {MOST_DEVIATION * job.chucking_force_n:.0f} N"
            raise refusal_error("clamping.finger_force", value=value, limit=limit)
    shown = deflection_of(readings, job)
    blank = (1.0 - finger) * blank_over_part(job)  # over the lobe that all of the force at rest would make
    found = {
        n: MeasuredCoefficient(
            value=c / blank, sd_um=math.hypot(shown.sd_um[n] / blank, FINGER_SD * abs(c / blank))
        )
        for n, c in shown.coefficients_um.items()
    }
    seen = found.pop(job.jaws)
    return ClampingFingerprint(
        seen=replace(seen, along=seen.value if shown.upright else None),
        deflection=shown,
        others={n: each for n, each in found.items() if n != ONCE},
    )


def expected_reading(known: LobeFilter, job: Job, places: int) -> MeasuredCoefficient:
    """Return what an indicator of 1 um at so many places, evenly round the part, most likely shows of a lobe."""
    value, blank = known.scale.at_rest * known.lobe_um, (1.0 - FINGER_FRACTION) * blank_over_part(job)
    of_dial_um = SUPPOSED_SD_UM * math.sqrt(2.0 / places) / blank
    return MeasuredCoefficient(value=value, sd_um=math.hypot(of_dial_um, FINGER_SD * abs(value)))


def blank_over_part(job: Job) -> float:
    """Return by how much a blank deflects, over the part that it becomes: a thicker ring bends less."""
    material = material_or_none(job.material)
    if material is None or not is_thin(job.wall_thickness_mm, job.radius_mm):
        return 1.0
    walls = (job.wall_thickness_mm, job.wall_thickness_mm - job.depth_of_cut_mm)
    outside = (job.diameter_mm, 2.0 * job.finished_radius_mm)
    if walls[1] <= 0.0:
        return 1.0
    bent = [
        spring_back_um_pp(Ring(outside_mm=d, wall_mm=t, length_mm=1.0, material=material), job.jaws, 1.0)
        for d, t in zip(outside, walls, strict=True)
    ]
    return bent[0] / bent[1]


def clamped_by(
    before: LobeFilter, found: ClampingFingerprint, path: CutPath, lobes: int
) -> tuple[LobeFilter, ClampingCorrection]:
    """Return the filter with a fingerprint, and what becomes of a path.

    Orders of the jaws that no part has taught yet are those of the fingerprint.
    Raises `ProfileError`: `clamping.not_like`, the deflection is not that of this clamping.
    """
    mean_um, at_rest = before.lobe_um, before.scale.at_rest
    _refuse_unlike(found.seen.value / (at_rest * mean_um) if mean_um else 1.0 + 0j, lobes)
    after = before.update_by_fingerprint(found.seen)
    ratio = after.this_um / mean_um if mean_um else 1.0 + 0j
    variance = before.sd_um**2
    return after, ClampingCorrection(
        ratio=ratio,
        added_um={
            n: _shown_um(each) / at_rest / ratio_of(n, lobes, ratio)
            for n, each in found.others.items()
            if not coefficient_of(path.target, n)
        },
        force_deviation=after.force_deviation,
        lobe_um=after.this_um,
        sd_um=after.sd_um,
        weight=1.0 - after.sd_um**2 / variance if variance else 0.0,
        felt=found.seen,
        warnings=warn_of_surprise(before, found, lobes),
    )


def warn_of_surprise(before: LobeFilter, found: ClampingFingerprint, lobes: int) -> tuple[Problem, ...]:
    """Return a warning where a fingerprint is further from what was known before than chance explains."""
    if not before.lobe_um or not found.seen.value:
        return ()
    off = before.surprise(found.seen)
    if off.of_height:
        shown_um = abs(found.deflection.coefficients_um[lobes])
        scale = 2.0 * shown_um / abs(found.seen.value)  # to the deflection of the blank, p-p, as it was read
        limit = f"{scale * off.expected_um:.1f} ± {SURE * scale * off.sd_um[0]:.1f} um p-p"
        key, value = f"{abs(off.off[0]):.1f}", f"{2.0 * shown_um:.1f} um p-p"
        return (Problem(code="clamping.surprise", key=key, value=value, limit=limit),)
    if off.of_angle:
        per_um = math.degrees(1.0 / off.expected_um) / lobes
        limit = f"± {SURE * per_um * off.sd_um[1]:.1f} deg"
        key, value = f"{abs(off.off[1]):.1f}", f"{-per_um * off.off[1] * off.sd_um[1]:+.1f} deg"
        return (Problem(code="clamping.surprise_turned", key=key, value=value, limit=limit),)
    return ()


def _refuse_unlike(shown: complex, lobes: int) -> None:
    if abs(shown - 1.0) > MOST_DEVIATION:
        key, value = f"{math.degrees(abs(cmath.phase(shown))) / lobes:.0f} deg", f"{abs(shown):.2f}"
        raise refusal_error("clamping.not_like", key=key, value=value, limit=f"{MOST_DEVIATION:g}")


def _shown_um(seen: MeasuredCoefficient) -> complex:
    """Return an order as it is most likely, of which little was known: 0 within the noise."""
    if abs(seen.value) <= SIGNIFICANT * seen.sd_um:
        return 0j
    return seen.value * PRIOR_OTHERS_UM**2 / (PRIOR_OTHERS_UM**2 + seen.sd_um**2)


def clamped_orders(path: CutPath, lobes: int) -> tuple[int, ...]:
    """Return the orders of a path that the jaws make."""
    orders = {harmonic.lobes for harmonic in path.target.harmonics}
    return tuple(sorted(n for n in orders if n % lobes == 0 or n == OVAL))


def ratio_of(order: int, lobes: int, ratio: complex) -> complex:
    """Return by what an order is multiplied where the lobe is by `ratio`: its height, and turned with it."""
    turns = order / lobes if order % lobes == 0 else 0.0
    return abs(ratio) * cmath.exp(1j * turns * cmath.phase(ratio))


def with_added(path: CutPath, added_um: Mapping[int, complex], response: Callable[[int], complex]) -> CutPath:
    """Return a path with these orders added to its target; the command follows by T.

    An order that the tool hardly follows is left out: its command would be many times its motion.
    """
    followed = {n: c for n, c in added_um.items() if abs(response(n)) * AMPLIFICATION_LIMIT >= 1.0}
    return CutPath(
        target=path.target.plus(followed),
        command=path.command.plus({n: c / response(n) for n, c in followed.items()}),
    )


def clamped_path(path: CutPath, lobes: int, ratio: complex, response: Callable[[int], complex]) -> CutPath:
    """Return the path for a clamping whose lobe is `ratio` times that of the path."""
    change = {
        n: (ratio_of(n, lobes, ratio) - 1.0) * coefficient_of(path.target, n) for n in clamped_orders(path, lobes)
    }
    return with_added(path, change, response)
