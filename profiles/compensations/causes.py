"""Why a compensated part is not round: what the harmonics of its residual say, largest first.

With the lobe L that a part would have without compensation, the path P and the fraction s of it in the cut, it
has r = L - s c P, where c is what arrives of the path: 1 if the tool follows it. The intention is L = P and c = 1.
The residual beyond the intended (1 - s) P is e; the tool, off its path in the cut by t, makes -t of it, and
explains no more than is left. One number
each explains the rest where:

- the lobe stands elsewhere, by d of spindle: L = P exp(-j N d), so that |L| = |P|;
- the tool moves the wrong way: c = -1, e = 2 s P;
- the lobe has another height, or the path arrives by a fraction only: e / P is real. A trace alone cannot tell
  these two apart; a force is off by a quarter at most, so beyond that the path is named.

Of the orders that are no multiple of the jaws the chuck makes none if its jaws press alike. A harder jaw
adds w_n exp(-j n angle of the jaw) to each order, most of it to two undulations per revolution, with a maximum at
that jaw; an oval blank has its maximum anywhere.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from profiles.compensations.learning import REPEATS_SD_UM, SIGNIFICANT, fit_harmonics
from profiles.compensations.next_version import AppliedPath
from profiles.compensations.part_harmonics import PartHarmonics
from profiles.compensations.path import OVAL, PathHarmonic
from profiles.job import Job

MOST_ORDER = 15
LEAST_OF_RONT = 0.15
"""Fraction of RONt, peak to peak, from which a harmonic is worth naming."""

LEAST_NAMED_UM = 0.05
"""Height, peak to peak, that is not shown as 0.0: what has less is no cause."""

SAME_HEIGHT = 0.2
"""Relative difference of height up to which a lobe that stands elsewhere is the same lobe."""

IN_LINE_DEG = 12.0
"""Phase of e / P, in degrees of the harmonic, up to which it is real: 4 degrees of spindle with three jaws."""

CERTAIN_SD = 2.0
"""Standard deviations from which a lobe certainly stands elsewhere; it is named where that explains the most."""

MOST_OF_FORCE = 0.25
WRONG_WAY = 2.0
"""e / (s P) of a tool that moves the wrong way; anything nearer to it than to 1 counts."""

AT_JAW_DEG = 10.0


class CauseKind(StrEnum):
    """What a part of the residual most likely comes from."""

    TOOL = "tool"
    ANGLE = "angle"
    SIGN = "sign"
    ARRIVES = "arrives"
    FORCE = "force"
    LOBE = "lobe"
    UNPLACED = "unplaced"
    OVERTONE = "overtone"
    JAW = "jaw"
    OVAL = "oval"
    HARMONIC = "harmonic"
    NOISE = "noise"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One cause, and how much of the residual it explains, um p-p.

    `value` is for an angle degrees of spindle (the lobe is so far past the expected position, `sd` its standard
    deviation), for a path the fraction of it that arrives, for a force the relative difference of the lobe, for a
    jaw or an oval how far past the nearest jaw, `jaw`, its maximum is, deg. `order` is that of the harmonic.
    """

    kind: CauseKind
    um_pp: float
    order: int = 0
    value: float = 0.0
    sd: float = 0.0
    jaw: int = 0


def causes(
    part: PartHarmonics, cut: AppliedPath, job: Job, *, tool_um: complex = 0j, placed: bool = True
) -> tuple[Cause, ...]:
    """Return why a part of this job, cut in this way, is not round, the largest first; at least one.

    `tool_um` is the tool against its path in the cut at the order of the lobe, infeed positive, 0 where it was
    not observed. Where the part is not `placed`, its angles are not known at the spindle, and nothing is said that
    rests on them.
    """
    ront_um, seen = part.ront_um(), seen_orders(part)
    lobe = _of_lobe(part, cut, job, tool_um) if placed else _height_cause(part, job)
    others = _of_others(part, job, seen)
    if tool_um and placed:
        left_um = min(abs(tool_um), abs(_left_um(part, cut, job)))
        others.append(Cause(kind=CauseKind.TOOL, um_pp=2.0 * left_um, order=job.jaws))
    if not placed:
        others = [replace(each, kind=CauseKind.OVAL) if each.kind is CauseKind.JAW else each for each in others]
    found = [each for each in (lobe, *others) if each is not None]
    standing = [each for each in found if each.um_pp >= max(LEAST_OF_RONT * ront_um, LEAST_NAMED_UM)]
    if not standing:
        return (Cause(kind=CauseKind.NOISE, um_pp=ront_um),)
    return tuple(sorted(standing, key=lambda each: each.um_pp, reverse=True))


def _of_lobe(part: PartHarmonics, cut: AppliedPath, job: Job, tool_um: complex) -> Cause | None:
    """Return the cause of the residual lobe beyond the tool's own error, None if it is noise.

    It explains no more than the residual: the tool may have hidden a part of it.
    """
    lobes, path_um = job.jaws, cut.path.target.harmonics[0].coefficient
    left_um = _left_um(part, cut, job)
    off_um, seen_sd_um = left_um + tool_um, _seen_sd_um(part, job)
    um_pp = 2.0 * min(abs(off_um), abs(left_um))
    if abs(off_um) <= SIGNIFICANT * seen_sd_um or not path_um:
        return None
    whole_um, ratio = path_um + off_um, off_um / path_um
    in_line = abs(math.remainder(math.degrees(cmath.phase(ratio)), 180.0)) <= IN_LINE_DEG
    if in_line:
        return _in_line(ratio.real, cut.fraction, lobes, um_pp)
    higher, turned_rad = abs(whole_um / path_um) - 1.0, -cmath.phase(whole_um / path_um)
    if abs(higher) <= SAME_HEIGHT:
        sd_rad = seen_sd_um / abs(whole_um)  # of the trace: the force of a clamping turns nothing
        if abs(turned_rad) <= CERTAIN_SD * sd_rad or 2.0 * abs(math.sin(0.5 * turned_rad)) < abs(higher):
            return _in_line(higher, cut.fraction, lobes, um_pp)
        deg, sd_deg = (math.degrees(each) / lobes for each in (turned_rad, sd_rad))
        return Cause(kind=CauseKind.ANGLE, um_pp=um_pp, order=lobes, value=deg, sd=sd_deg)
    return Cause(kind=CauseKind.LOBE, um_pp=um_pp, order=lobes)


def _left_um(part: PartHarmonics, cut: AppliedPath, job: Job) -> complex:
    """Return the lobe that is left beyond what a part of the path should leave: no cause explains more."""
    return part.coefficients_um[job.jaws] - cut.spared_um[job.jaws]


def _height_cause(part: PartHarmonics, job: Job) -> Cause | None:
    """Return the residual lobe by its height alone, None if it is noise."""
    left_um = abs(part.coefficients_um[job.jaws])
    if left_um <= SIGNIFICANT * _seen_sd_um(part, job):
        return None
    return Cause(kind=CauseKind.UNPLACED, um_pp=2.0 * left_um, order=job.jaws)


def _seen_sd_um(part: PartHarmonics, job: Job) -> float:
    return math.hypot(part.sd_um[job.jaws], REPEATS_SD_UM)


def _in_line(ratio: float, fraction: float, lobes: int, um_pp: float) -> Cause:
    """Return the cause of a residual that is `ratio` of the path, in phase with it or against."""
    if ratio < -1.0:  # the lobe itself is inverted: it stands half a period further on
        return Cause(kind=CauseKind.ANGLE, um_pp=um_pp, order=lobes, value=180.0 / lobes)
    if ratio > (1.0 + WRONG_WAY) / 2.0 * fraction:
        return Cause(kind=CauseKind.SIGN, um_pp=um_pp, order=lobes)
    if ratio > MOST_OF_FORCE * fraction:
        return Cause(kind=CauseKind.ARRIVES, um_pp=um_pp, order=lobes, value=1.0 - ratio / fraction)
    return Cause(kind=CauseKind.FORCE, um_pp=um_pp, order=lobes, value=ratio)


def _of_others(part: PartHarmonics, job: Job, seen: Mapping[int, complex]) -> list[Cause]:
    return [
        _of_order(n, coefficient, job)
        for n, coefficient in seen.items()
        if n not in (1, job.jaws) and abs(coefficient) > SIGNIFICANT * part.sd_um[job.jaws]
    ]


def _of_order(n: int, coefficient: complex, job: Job) -> Cause:
    um_pp = 2.0 * abs(coefficient)
    if n % job.jaws == 0:
        return Cause(kind=CauseKind.OVERTONE, um_pp=um_pp, order=n)
    if n != OVAL:
        return Cause(kind=CauseKind.HARMONIC, um_pp=um_pp, order=n)
    jaw, off_deg = _nearest_jaw(PathHarmonic.from_coefficient(n, coefficient).phase_deg, job)
    kind = CauseKind.JAW if abs(off_deg) <= AT_JAW_DEG else CauseKind.OVAL
    return Cause(kind=kind, um_pp=um_pp, order=n, value=off_deg, jaw=jaw)


def _nearest_jaw(phase_deg: float, job: Job) -> tuple[int, float]:
    """Return the jaw next to a maximum of an oval, which has two, and how far past it that is, deg."""
    period_deg = 360.0 / OVAL
    off_deg = {
        jaw: math.remainder(phase_deg - job.jaw_1_deg - (jaw - 1) * 360.0 / job.jaws, period_deg)
        for jaw in range(1, job.jaws + 1)
    }
    jaw = min(off_deg, key=lambda each: abs(off_deg[each]))
    return jaw, off_deg[jaw]


def seen_orders(part: PartHarmonics) -> Mapping[int, complex]:
    """Return the harmonics of the part up to `MOST_ORDER`, at spindle angles."""
    spindle_deg = (-1.0 if part.against_spindle else 1.0) * part.angle_deg + part.begins_deg
    return fit_harmonics(spindle_deg, part.deviation_um, range(1, MOST_ORDER + 1)).coefficients_um
