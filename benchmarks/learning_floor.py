"""What a perfect controller of a simulated lathe leaves on a part, by formulas of our own: mid-cut, and along it.

It knows all that repeats, at every Z, and its tool follows any path. It does not know this clamping's force, nor
the form of this blank, which a part that gives way copies, nor what the spindle does not repeat from turn to
turn; and the gauge has its noise. Lobe, second harmonic and the oval of an unequal jaw are proportional to the
force that holds the part at speed (docs/plant.md).
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass
from random import Random

import numpy as np
from numpy.typing import NDArray

from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.spindle import STRAY_FRACTION, STRAY_PER_TURN
from drivers.simulator.plant.tip_load import material_of
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.workshop import MEASURED
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import MINIMUM_ZONE, PartSection, evaluate_cylinder

CLAMPINGS = 40
POINTS, GAUGE_POINTS = 720, 3600
FILTER_UPR = 50.0
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Floor:
    """Medians over parts, um: RONt mid-cut, RONt of the worst of five sections, and CYLt (MZCY)."""

    ront_um: float
    worst_um: float
    cylt_um: float


def floor_of(job: Job, machine: MachineProfile, plant: str, seed: int, clamping_sd_percent: float | None) -> Floor:
    """Return what a perfect controller leaves on parts of one lathe."""
    true = plant_named(plant, machine, seed, clamping_sd_percent)
    blank = true.blank(job)
    more_um_pp = true.blank(job, 1.01).lobe_um_pp - blank.lobe_um_pp
    per_force = 100.0 * more_um_pp / blank.lobe_um_pp if blank.lobe_um_pp else 0.0
    angle = np.arange(POINTS) * 2.0 * math.pi / POINTS
    places_mm = [fraction * job.cut_length_mm for fraction in MEASURED]
    shapes = [
        blank.spring_back_um(np.degrees(angle) + blank.jaw_1_deg, blank.middle_mm + past_mm)
        - blank.shift_um * np.cos(angle)
        for past_mm in places_mm
    ]
    copied = copied_fraction(true, job, angle)
    chance, blanks = Random(f"floor {seed}"), Random(f"floor blanks {seed}")
    noise, found = np.random.default_rng(seed), []
    for _ in range(CLAMPINGS):
        force, form = chance.gauss(0.0, true.clamping_force_spread), form_um(true, blanks, angle)
        sections = []
        for past_mm, shape in zip(places_mm, shapes, strict=True):
            phases = [chance.uniform(0.0, 2.0 * math.pi) for _ in STRAY_PER_TURN]
            stray = sum(np.sin(rate * angle + phase) for rate, phase in zip(STRAY_PER_TURN, phases, strict=True))
            toward = 0.25 * STRAY_FRACTION * true.radial_error_um_pp * stray + copied * form
            left = per_force * force * shape + true.process_gain * toward
            left = left + noise.normal(0.0, true.gauge_noise_um * math.sqrt(POINTS / GAUGE_POINTS), POINTS)
            sections.append(PartSection(z_mm=-past_mm, angle_deg=np.degrees(angle), deviation_um=left))
        whole = evaluate_cylinder(sections, radius_mm=job.finished_radius_mm, filter_upr=FILTER_UPR)
        middle = min(whole.sections, key=lambda each: abs(each.z_mm))
        found.append((middle.ront_um, whole.worst.ront_um, whole.cylinder(MINIMUM_ZONE).cylt_um))
    ront_um, worst_um, cylt_um = (statistics.median(each) for each in zip(*found, strict=True))
    return Floor(ront_um=ront_um, worst_um=worst_um, cylt_um=cylt_um)


def copied_fraction(true: TrueParameters, job: Job, angle: Floats) -> Floats:
    """Return which fraction of a blank's form stays on the part: c k / (1 + c k), with c where the tool is.

    The force grows by k with each um of depth; between two of the N jaws the part is softer than at them. Angles
    are from jaw 1, in radians.
    """
    main_n = cutting_force(material_of(job), 1.0, job.feed_mm_per_rev, edge_n_per_mm=true.edge_n_per_mm).main_n
    n_per_um = true.passive_fraction * main_n / 1000.0
    softer = true.work_compliance_um_per_n * (1.0 - true.softer_between_jaws * np.cos(job.jaws * angle))
    return np.asarray(softer * n_per_um / (1.0 + softer * n_per_um))


def form_um(true: TrueParameters, blanks: Random, angle: Floats) -> Floats:
    """Return the surface of a blank as it is drawn: oval and run-out, at any angles."""
    oval, off = (blanks.uniform(0.0, 2.0 * math.pi) for _ in range(2))
    oval_um = 0.5 * true.blank_oval_um_pp * np.cos(2.0 * angle - oval)
    return np.asarray(oval_um + 0.5 * true.blank_run_out_um * np.cos(angle - off))
