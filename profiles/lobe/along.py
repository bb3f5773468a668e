"""How the lobe and the mean of a cut change along it, as its compensation follows them.

The job states the lobe in the middle of the cut; along it each order has the shape of the model, by a polynomial.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from profiles.arrays import Floats, floats, read_only
from profiles.chucking.held_part import HeldPart, held_part
from profiles.chucking.tube import axial_fraction
from profiles.compensations.path import OVAL, AlongCut
from profiles.findings import Finding, Severity, judge_condition
from profiles.job import Job
from profiles.lobe.cut_error import LEAST_AXIAL_FRACTION, middle_mm
from profiles.machine import ONE_LOBE, MachineProfile
from profiles.problem import Problem, ProfileError

PLACES = 13  # twice as many as a polynomial passes through, so that they show what it leaves between
MOST_DEGREE = 6
FIT_UM = 0.05  # by which a polynomial may be off the model
NO_MIDDLE = "rule.along_middle"
MIDDLE_MARGIN = 1.1  # of another length of the cut, whose wall becomes thinner elsewhere
_POINTS = 48


class _AlongFit(NamedTuple):
    """The change along the cut, and by how much, um, it is off the model.

    `in_middle` and `largest` are the lobe mid-cut, and where in the cut it is largest, over that at the jaws.
    """

    along: AlongCut
    left_um: float = 0.0
    in_middle: float = 1.0
    largest: float = 1.0


def along_cut(job: Job, machine: MachineProfile) -> AlongCut:
    """Return the change along the cut: none of a bar, and of a lobe that is nearly none in its middle.

    There the lobe changes its sign, and any height fits what was found. None, too, where the chuck is said to
    press one lobe along Z, and of a part that cannot be held or cut.
    """
    part = _changing(job, machine)
    if part is not None:
        return _follow(part).along
    return AlongCut(half_length_mm=job.cut_length_mm / 2.0) if job.cut_length_mm > 0.0 else AlongCut()


@lru_cache(maxsize=16)
def _follow(part: HeldPart) -> _AlongFit:
    """Return the change of the lobe and the mean of a part along its cut."""
    job = part.job
    half_mm = job.cut_length_mm / 2.0
    s = chebyshev.chebpts2(PLACES)
    at_mm = middle_mm(job) - half_mm * s
    lobe_um, size_um = along_um(part, (*at_mm.tolist(), 0.0))
    middle_um, at_jaws_um = lobe_um[PLACES // 2], max(abs(float(lobe_um[-1])), 1e-12)
    mean_um, left_um = _powers(s, size_um[:-1], FIT_UM)
    in_middle, largest = (float(np.abs(each).max()) / at_jaws_um for each in (middle_um, lobe_um[:-1]))
    orders: tuple[tuple[int, tuple[float, ...]], ...] = ()
    if job.lobe_amplitude_um > 0.0 and in_middle >= LEAST_AXIAL_FRACTION:
        powers, left = _powers(s, lobe_um[:-1] / middle_um, FIT_UM / job.lobe_amplitude_um)
        orders, left_um = ((job.jaws, powers),), max(left_um, left * job.lobe_amplitude_um)
    along = AlongCut(half_length_mm=half_mm, orders=orders, mean_um=mean_um)
    return _AlongFit(along, left_um, in_middle, largest)


def along_findings(job: Job, machine: MachineProfile) -> tuple[Finding, ...]:
    """Return why a compensation cannot follow the lobe along the cut, or by how much it does not.

    Of `rule.along_middle`, a lobe that is nearly none mid-cut alone, only a plain cut can be planned: what was
    found there does not tell the rest. `rule.along_degree` is what the polynomial leaves. Both are warnings, and
    name the nearest lengths of the cut that pass.
    """
    part, key = _changing(job, machine), "cut_length_mm"
    if part is None or not job.lobe_amplitude_um:
        return ()
    found = _follow(part)
    if found.in_middle < LEAST_AXIAL_FRACTION <= found.largest:
        value, limit = f"{100.0 * found.in_middle:.2g} %", f">= {100.0 * LEAST_AXIAL_FRACTION:g} %"
        middle = Problem(code=NO_MIDDLE, key=key, value=value, limit=limit)
        middle = with_lengths(middle, _with_a_middle_mm(part, machine))
        return (judge_condition(False, middle, Severity.WARNING),)
    if found.left_um <= FIT_UM:
        return ()
    value, limit = f"{found.left_um:.2g} um", f"<= {FIT_UM:g} um"
    degree = Problem(code="rule.along_degree", key=key, value=value, limit=limit)

    def follows(length_mm: float) -> bool:
        return _follow(held_part(replace(job, cut_length_mm=length_mm), machine)).left_um <= FIT_UM

    degree = with_lengths(degree, longest_shorter_mm(job.cut_length_mm, follows))
    return (judge_condition(False, degree, Severity.WARNING),)


def with_lengths(problem: Problem, lengths_mm: Iterable[int]) -> Problem:
    """Return the problem with the nearest lengths of the cut that have none of this kind."""
    lengths = " / ".join(f"{mm} mm" for mm in lengths_mm)
    return replace(problem, limit=f"{problem.limit} ({lengths})" if lengths else problem.limit)


def _with_a_middle_mm(part: HeldPart, machine: MachineProfile) -> Iterator[int]:
    """Return the next shorter and the next longer cut, whole mm, whose middle has a lobe of this part."""
    job = part.job
    lengths_mm = np.arange(1, int(job.overhang_mm - machine.carriage.jaw_clearance_mm) + 1)
    lobe_um = np.abs(along_um(part, (*(job.overhang_mm - lengths_mm / 2.0).tolist(), 0.0))[0])
    passing = lengths_mm[lobe_um[:-1] >= MIDDLE_MARGIN * LEAST_AXIAL_FRACTION * lobe_um[-1]]
    yield from passing[passing < job.cut_length_mm][-1:].tolist()
    yield from passing[passing > job.cut_length_mm][:1].tolist()


def longest_shorter_mm(cut_length_mm: float, passes: Callable[[float], bool]) -> Iterator[int]:
    """Return the longest shorter cut, whole mm, that passes, by bisection."""
    least, beyond = 0, math.ceil(cut_length_mm)
    while beyond - least > 1:
        between = (least + beyond) // 2
        least, beyond = (between, beyond) if passes(float(between)) else (least, between)
    if least:
        yield least


def shape_along(job: Job, machine: MachineProfile, z_mm: Floats) -> tuple[Floats, Floats]:
    """Return what `along_cut` follows, at any places: the lobe over that mid-cut, and the excess of the radius.

    Shape (Z,), the second in um over mid-cut; 1 and 0 of a part that does not change along the cut.
    """
    part = _changing(job, machine)
    if part is None:
        return np.ones_like(z_mm), np.zeros_like(z_mm)
    lobe_um, size_um = along_um(part, (*z_mm.tolist(), middle_mm(job), 0.0))
    middle_um, at_jaws_um = lobe_um[-2:]
    scaled = job.lobe_amplitude_um > 0.0 and abs(middle_um) >= LEAST_AXIAL_FRACTION * abs(at_jaws_um)
    factor = lobe_um[:-2] / middle_um if scaled else np.ones_like(z_mm)
    return floats(factor), floats(size_um[:-2] - size_um[-2])


def largest_lobe(job: Job, machine: MachineProfile) -> tuple[float, float | None]:
    """Return the largest amplitude of the lobe along the cut, um, and its Z, mm; None where it is even."""
    along = along_cut(job, machine)
    if not along.orders:
        return job.lobe_amplitude_um, None
    past_mm = along.half_length_mm * np.linspace(-1.0, 1.0, 41)
    factors = np.abs(along.factor(job.jaws, past_mm))
    place = int(factors.argmax())
    return job.lobe_amplitude_um * float(factors[place]), middle_mm(job) - float(past_mm[place])


def holding_spread(job: Job, machine: MachineProfile) -> dict[str, tuple[float, float]]:
    """Return the lobe at both ends of the cut over that mid-cut, jaws' side first, by how the jaws hold.

    As the machine states it ("profile"), and in the two limits between which a chuck is ("straight", "even").
    Empty for a part whose lobe does not change along Z.
    """
    ways = {"profile": None, "straight": 1.0, "even": 0.0}
    found = {}
    for name, fraction in ways.items():
        chuck = machine.chuck if fraction is None else replace(machine.chuck, jaw_straight_fraction=fraction)
        along = along_cut(job, replace(machine, chuck=chuck))
        if along.orders:
            jaws_side, free_end = along.factor(job.jaws, [along.half_length_mm, -along.half_length_mm]).tolist()
            found[name] = (jaws_side, free_end)
    return found


def known_within(job: Job, machine: MachineProfile) -> tuple[float, ...]:
    """Return how well slope and curvature of the lobe along the cut are known, over the lobe in its middle.

    That is how far they are at most from those in the two limits of `holding_spread`; empty without a change.
    """
    ends = holding_spread(job, machine)
    if not ends:
        return ()
    ways = {name: ((jaws - free) / 2.0, (jaws + free) / 2.0 - 1.0) for name, (jaws, free) in ends.items()}
    own = ways.pop("profile")
    return tuple(max(abs(way[power] - own[power]) for way in ways.values()) for power in (0, 1))


def oval_over_ring(job: Job, machine: MachineProfile) -> float:
    """Return the oval mid-cut beside a lobe, over what a ring has beside it: it decays more slowly."""
    part, z_mm = held_part(job, machine), [middle_mm(job)]
    if not part.thin or job.jaws == OVAL or not 0.0 <= z_mm[0] <= job.overhang_mm:
        return 1.0
    oval, lobe = (float(axial_fraction(part.tube, n, z_mm)[0]) for n in (OVAL, job.jaws))
    return oval / abs(lobe) if abs(lobe) >= LEAST_AXIAL_FRACTION else 1.0


def _changing(job: Job, machine: MachineProfile) -> HeldPart | None:
    """Return the part, if it can be held and cut, and its lobe changes along Z."""
    try:
        part = held_part(job, machine)
    except ProfileError:
        return None
    whole = 0.0 < job.cut_length_mm <= job.overhang_mm and job.depth_of_cut_mm < job.wall_thickness_mm
    changes = machine.chuck.lobe_along != ONE_LOBE and part.thin and whole and part.per_jaw_n > 0.0
    return part if changes else None


@lru_cache(maxsize=16)
def along_um(part: HeldPart, z_mm: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Return the amplitude of order N, and the excess of the radius, um, at places of a part."""
    jaws, z = part.job.jaws, floats(z_mm)
    angle_deg = floats(np.arange(_POINTS) * (360.0 / jaws / _POINTS))
    error_um = np.sum(list(part.error_parts_um(angle_deg, z).values()), axis=0)
    lobe_um = 2.0 / _POINTS * error_um @ np.cos(jaws * np.radians(angle_deg))
    return read_only(lobe_um), read_only(part.size_um(z))


def _powers(s: Floats, values: Floats, most_off: float) -> tuple[tuple[float, ...], float]:
    """Return c1, c2, ... of the polynomial of least degree that is near enough to the change from the middle.

    And by how much it is off; that of `MOST_DEGREE` may be further off than `most_off`.
    """
    change = values - values[PLACES // 2]
    for degree in range(1, MOST_DEGREE + 1):
        columns = s[:, None] ** np.arange(1, degree + 1)
        found = np.linalg.lstsq(columns, change)[0]
        off = float(np.abs(columns @ found - change).max())
        if off <= most_off:
            break
    return tuple(found.tolist()), off
