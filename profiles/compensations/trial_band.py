"""The trial band: a narrow band at the free end is cut first and indicated while the part is still clamped.

A part that will be round stands in the jaws as the mirror of its lobe: a clamped band that is round springs back.
So the band should show its path W with the sign turned. What it shows, -s, is of tool and process: of the motion
W - e of the tool, e its error by its own scale, the fraction g arrives (1 - g is lost as the edge ploughs), and a
blank that gives way leaves of its form what it does not. g comes from the lobe; every other order becomes
W + (W - e - s) / g. What springs back, and the error of the spindle, which the dial follows as the tool does, it
cannot show: those are of the fingerprint and of the released part. A path that parts have taught makes up
for the loss already: of it g W is to arrive.

The dial is read once round each way. Its play p flattens what stands out, which takes 2.7 % of a lobe of 24 um at
3 um of play: so the shown path is fitted through a dial with play, and the play that fits best is taken.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats, floats
from profiles.compensations.learning import SIGNIFICANT
from profiles.compensations.path import AlongCut, CutPath, LobedPath, axial_um
from profiles.fingerprint.deflection import ONCE, OVAL, SUPPOSED_READINGS
from profiles.fingerprint.lobe_filter import LobeFilter, MeasuredCoefficient
from profiles.fingerprint.readings import ClampReadings
from profiles.job import Job
from profiles.least_squares import Fit, fit, harmonic_columns, phasors
from profiles.problem import refusal_error

LENGTH_MM, LEFT_MM = 1.2, 0.02
"""Length of the band, and what it leaves on the radius: the whole cut cleans it. Choices."""

LEAST_LENGTHS, MOST_LEFT = 3.0, 0.4  # cut lengths over that of the band; fraction of the depth that it leaves
READING_SD_UM = 0.7  # of one reading, as supposed of a dial of 1 um; its weight is that of some residuals
PRIOR_UM = 2.0  # of an order that is not the lobe, before it was seen; assumed
MOST_PLAY_UM, PLAY_STEP_UM, PLAY_ROUNDS = 6.0, 0.25, 4
LEAST_ARRIVED, MOST_ARRIVED, MOST_TURNED_DEG = 0.6, 1.2, 15.0
"""Of the lobe's path, and degrees of the lobe: beyond it is no process, but a dial, an angle or another part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BandReadings:
    """Readings on a clamped band in the order in which they were taken: spindle angles, deg, um outwards.

    `graduation_um` is that of the dial, None where it is not stated.
    """

    angle_deg: tuple[float, ...]
    shown_um: tuple[float, ...]
    graduation_um: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownPath:
    """The motion that a band shows: coefficients into the work, um by order, with the error of each component."""

    coefficients_um: Mapping[int, complex]
    sd_um: float
    play_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BandFinding:
    """What a band shows: `arrived` is s / (W - e) at the lobe with the error of each component.

    `wanted_um` is W, `off_um` e by order. `push_um` is what the cut pushes the tool at its entry,
    at the whole depth, beyond what the path makes up for.
    """

    arrived: complex
    arrived_sd: float
    wanted_um: Mapping[int, complex]
    off_um: Mapping[int, complex]
    shown: ShownPath
    push_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BandCorrection:
    """What a band makes of a path: the lobe of this part becomes `of_this` times itself, the mean one `of_mean`.

    The fraction `arrives` of a path arrives in the surface; the stylus is `stylus_deg` of spindle past its mark.
    `missing_um` is what the part would lack of the other orders, `added_um` what the target gets for it.
    """

    of_this: complex
    of_mean: complex
    arrives: float
    stylus_deg: float
    missing_um: Mapping[int, complex]
    added_um: Mapping[int, complex]
    sd_um: float
    play_um: float
    push_um: float

    def event(self) -> dict[str, object]:
        """Return the correction as it is recorded."""
        missing = [{"n": n, "cos_um": c.real, "sin_um": -c.imag} for n, c in sorted(self.missing_um.items())]
        numbers = ("arrives", "stylus_deg", "sd_um", "play_um", "push_um")
        return {"missing": missing, **{name: getattr(self, name) for name in numbers}}


def band_job(job: Job, factor: float) -> Job:
    """Return the job of the band; `factor` is its lobe over that in the middle of the cut.

    Raises `ProfileError`: `band.short`, `band.shallow`, the cut has no room for a band.
    """
    if job.cut_length_mm < LEAST_LENGTHS * LENGTH_MM:
        value, limit = f"{job.cut_length_mm:g} mm", f">= {LEAST_LENGTHS * LENGTH_MM:g} mm"
        raise refusal_error("band.short", key="cut_length_mm", value=value, limit=limit)
    if MOST_LEFT * job.depth_of_cut_mm < LEFT_MM:
        value, limit = f"{job.depth_of_cut_mm:g} mm", f">= {LEFT_MM / MOST_LEFT:g} mm"
        raise refusal_error("band.shallow", key="depth_of_cut_mm", value=value, limit=limit)
    return replace(
        job,
        cut_length_mm=LENGTH_MM,
        depth_of_cut_mm=job.depth_of_cut_mm - LEFT_MM,
        lobe_error_um_pp=job.lobe_error_um_pp * abs(factor),
    )


def band_middle_mm(job: Job) -> float:
    """Return the middle of the band, past the middle of the whole cut."""
    return 0.5 * (LENGTH_MM - job.cut_length_mm)


def band_path(path: CutPath, along: AlongCut, job: Job, inverse: complex) -> CutPath:
    """Return the path of the whole cut as it is in the middle of the band; `inverse` is 1 / T at the lobe.

    What a command has beside the inverse of its target makes up for friction, and does not shrink with the lobe.
    """
    at_mm = band_middle_mm(job)
    smaller_um = (float(along.factor(path.target.lobes, at_mm)) - 1.0) * path.target.harmonics[0].coefficient
    s = at_mm / (0.5 * job.cut_length_mm)

    def there(of: LobedPath, lobe_um: complex) -> LobedPath:
        change = {path.target.lobes: lobe_um, 0: complex(-1000.0 * LEFT_MM)}
        for (n, power), c in axial_um(of.axial).items():
            change[n] = change.get(n, 0j) + c * s**power
        mean_um = change.pop(0).real
        of_depth = 1.0 - LEFT_MM / job.depth_of_cut_mm
        return replace(of, axial=(), push_um=of.push_um * of_depth).plus(change, mean_um)

    return CutPath(target=there(path.target, smaller_um), command=there(path.command, smaller_um * inverse))


def shown_path(readings: BandReadings, lobes: int) -> ShownPath:
    """Return the motion that readings show.

    Raises `ProfileError`: `band.few_places`, they do not show the second harmonic of the lobe.
    """
    found, play_um = _fit_through_dial(readings.angle_deg, readings.shown_um, lobes)
    sd_um = READING_SD_UM if readings.graduation_um is None else max(READING_SD_UM, readings.graduation_um)
    squares = float(found.residuals @ found.residuals)
    of_one = math.sqrt((SUPPOSED_READINGS * sd_um**2 + squares) / (SUPPOSED_READINGS + found.freedom))
    return ShownPath(
        coefficients_um={n: -c for n, c in phasors(found.coefficients, _orders(lobes)).items() if n != ONCE},
        sd_um=of_one * math.sqrt(2.0 / len(readings.shown_um)),
        play_um=play_um,
    )


def without_play(readings: ClampReadings, lobes: int) -> ClampReadings:
    """Return the readings of a fingerprint as a dial without play shows them; unchanged if read one way alone."""
    if 2 * readings.places > len(readings.angle_deg):
        return readings
    columns = _columns(readings.angle_deg, lobes)

    def freed(shown_um: tuple[float, ...]) -> tuple[float, ...]:
        found, play_um = _fit_through_dial(readings.angle_deg, shown_um, lobes)
        surface = columns @ found.coefficients
        return tuple((floats(shown_um) - _through_dial(surface, play_um) + surface).tolist())

    return replace(readings, finger_um=freed(readings.finger_um), full_um=freed(readings.full_um))


def _orders(lobes: int) -> list[int]:
    return sorted({ONCE, OVAL, lobes, 2 * lobes})


def _columns(angle_deg: tuple[float, ...], lobes: int) -> Floats:
    return harmonic_columns(np.radians(floats(angle_deg)), _orders(lobes))


def _fit_through_dial(angle_deg: tuple[float, ...], shown_um: tuple[float, ...], lobes: int) -> tuple[Fit, float]:
    """Return the fit of the surface that readings in this order have, and the play of the dial, um."""
    columns, shown = _columns(angle_deg, lobes), floats(shown_um)
    places = len({round(each % 360.0, 6) for each in angle_deg})
    if places <= columns.shape[1]:
        raise refusal_error("band.few_places", value=str(places), limit=f">= {columns.shape[1] + 1}")
    best, best_um, squares = fit(columns, shown), 0.0, math.inf
    for play_um in np.arange(0.0, MOST_PLAY_UM + PLAY_STEP_UM, PLAY_STEP_UM).tolist():
        found = best
        for _ in range(PLAY_ROUNDS):
            surface = columns @ found.coefficients
            found = fit(columns, shown - (_through_dial(surface, play_um) - surface))
        left = float(found.residuals @ found.residuals)
        if left < squares:
            best, best_um, squares = found, play_um, left
    return best, best_um


def _through_dial(surface_um: Floats, play_um: float) -> Floats:
    """Return what a dial with play shows of a surface that passes it; it begins in the middle of its play."""
    shown, found = float(surface_um[0]), []
    for pushed in surface_um.tolist():
        shown = min(max(shown, pushed - 0.5 * play_um), pushed + 0.5 * play_um)
        found.append(shown)
    return floats(found)


def wanted_at(target: LobedPath, past_middle_mm: float) -> dict[int, complex]:
    """Return what a target has of each order at a place of its cut, um."""
    s = past_middle_mm / target.along.half_length_mm
    powers = target.powers_um().items()
    return {n: sum((c * s**power for power, c in enumerate(each)), 0j) for n, each in powers if n}


def find_on_band(
    shown: ShownPath, wanted_um: Mapping[int, complex], off_um: Mapping[int, complex], lobes: int, push_um: float
) -> BandFinding:
    """Return what a band shows of tool and process: `wanted_um` is its path there, `off_um` the tool's error.

    Raises `ProfileError`: `band.not_like`, so much of the lobe is no matter of tool and process.
    """
    done_um = wanted_um[lobes] - off_um.get(lobes, 0j)
    arrived = shown.coefficients_um[lobes] / done_um
    turned_deg = abs(math.degrees(cmath.phase(arrived)))
    if not (LEAST_ARRIVED <= abs(arrived) <= MOST_ARRIVED and turned_deg <= MOST_TURNED_DEG):
        limit = f"{LEAST_ARRIVED:g} ... {MOST_ARRIVED:g}, <= {MOST_TURNED_DEG / lobes:g} deg"
        value = f"{abs(arrived):.2f}, {turned_deg / lobes:.1f} deg"
        raise refusal_error("band.not_like", key=f"{lobes}/rev", value=value, limit=limit)
    return BandFinding(
        arrived=arrived,
        arrived_sd=shown.sd_um / abs(done_um),
        wanted_um=wanted_um,
        off_um=off_um,
        shown=shown,
        push_um=push_um,
    )


def correct_by_band(
    before: LobeFilter, found: BandFinding, felt: Collection[int], lobes: int
) -> tuple[LobeFilter, BandCorrection]:
    """Return the filter with what a band has shown, and what becomes of a path.

    The orders that are `felt` were taken from a fingerprint, by the same stylus.
    """
    after = before.update_by_band(MeasuredCoefficient(value=found.arrived, sd_um=found.arrived_sd))
    stylus, shown, missing = cmath.phase(after.turn) / lobes, found.shown, {}
    for n in shown.coefficients_um.keys() - {lobes}:
        turn = cmath.exp(1j * n * stylus)
        arrives = (
            1.0 / turn if n in felt else before.arrives
        )  # a path that parts have taught makes up for the loss
        wanted_um = arrives * found.wanted_um.get(n, 0j)
        missing[n] = wanted_um - found.off_um.get(n, 0j) - shown.coefficients_um[n] / turn
    weight = PRIOR_UM**2 / (PRIOR_UM**2 + shown.sd_um**2)
    certain = {n: c for n, c in missing.items() if abs(c) > SIGNIFICANT * shown.sd_um}
    return after, BandCorrection(
        of_this=after.this_um / after.arrives / (before.this_um / before.arrives),
        of_mean=after.path_um / before.path_um,
        arrives=after.arrives,
        stylus_deg=-math.degrees(stylus),
        missing_um=missing,
        added_um={n: weight * c / after.arrives for n, c in certain.items()},
        sd_um=shown.sd_um,
        play_um=shown.play_um,
        push_um=found.push_um,
    )


def refuse_uncleaned(before: CutPath, after: CutPath) -> None:
    """Refuse a change of the path that the rest of the depth does not clean off the band: `band.uncleaned`."""
    old, new = before.target.powers_um(), after.target.powers_um()
    moved_um = sum(abs(new[n][0] - old.get(n, (0j,))[0]) for n in new)
    if not moved_um < 1000.0 * LEFT_MM:
        raise refusal_error("band.uncleaned", value=f"{moved_um:.1f} um", limit=f"< {1000.0 * LEFT_MM:g} um")
