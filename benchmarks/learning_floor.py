"""What a perfect controller of a simulated lathe leaves on a part, by formulas of our own.

It knows all that repeats, and its tool follows any path. It does not know this clamping's force, nor what the
spindle does not repeat from turn to turn; and the gauge has its noise. Lobe, second harmonic and the oval of an
unequal jaw are proportional to the force that holds the part at speed (docs/plant.md).
"""

from __future__ import annotations

import math
import statistics
from random import Random

import numpy as np

from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.spindle import STRAY_FRACTION, STRAY_PER_TURN
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.roundness import evaluate

CLAMPINGS = 100
POINTS, GAUGE_POINTS = 720, 3600
FILTER_UPR = 50.0


def floor_um(job: Job, machine: MachineProfile, plant: str, seed: int, clamping_sd_percent: float | None) -> float:
    """Return the median RONt of parts of a perfect controller on one lathe, um."""
    true = plant_named(plant, machine, seed, clamping_sd_percent)
    blank = true.blank(job)
    more_um_pp = true.blank(job, 1.01).lobe_um_pp - blank.lobe_um_pp
    per_force = 100.0 * more_um_pp / blank.lobe_um_pp if blank.lobe_um_pp else 0.0
    angle = np.arange(POINTS) * 2.0 * math.pi / POINTS
    lobe = 0.5 * blank.lobe_um_pp
    shape = lobe * (np.cos(job.jaws * angle) + blank.overtone * np.cos(2 * job.jaws * angle))
    shape += blank.oval_um * np.cos(2.0 * angle)
    chance, found = Random(f"floor {seed}"), []
    noise = np.random.default_rng(seed)
    for _ in range(CLAMPINGS):
        force = chance.gauss(0.0, true.clamping_force_spread)
        phases = [chance.uniform(0.0, 2.0 * math.pi) for _ in STRAY_PER_TURN]
        stray = sum(np.sin(rate * angle + phase) for rate, phase in zip(STRAY_PER_TURN, phases, strict=True))
        left = per_force * force * shape + 0.25 * STRAY_FRACTION * true.radial_error_um_pp * stray
        left = left + noise.normal(0.0, true.gauge_noise_um * math.sqrt(POINTS / GAUGE_POINTS), POINTS)
        found.append(evaluate(np.degrees(angle), left, FILTER_UPR, radius_mm=job.finished_radius_mm).ront_um)
    return statistics.median(found)
