"""The force of the cut on the tool against Kienzle's tables, and what it meets on the second pass."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from drivers.simulator.plant.tip_load import ALUMINIUM, CELLS, Stock, TipGeometry, TipLoad
from profiles.cutting import cutting_force
from profiles.materials import material_named

CYCLE_S = 3_713_707 / 8_388_608_000
RADIUS_MM, HOME_MM, COUNTS_PER_MM = 26.0, 76.0, 5000.0
TURN_COUNTS, Z_COUNTS_PER_MM, LAND_MM = 10_000.0, 1000.0, 0.4
BLOCK = 11

Depth = Callable[[float], float]
"""Depth of the tip below the blank, mm, at so many turns."""


@dataclass
class Axis:
    """An axis as the motor of it is seen."""

    true_position: float = 0.0
    pace: float = 0.0
    cycles_run: int = 0


class Cutting:
    """A blank of 30 mm under a tool that does what it is told, from its free end on."""

    def __init__(self, share: float = 1.0, edge_n_per_mm: float = 0.0, feed_mm: float = 0.05) -> None:
        geometry = TipGeometry(
            home_radius_mm=HOME_MM,
            land_mm=LAND_MM,
            tool_counts_per_mm=COUNTS_PER_MM,
            carriage_counts_per_mm=Z_COUNTS_PER_MM,
            spindle_counts_per_turn=TURN_COUNTS,
        )
        self.load = TipLoad(geometry, None, push_per_n=2.0)
        self.tool, self.spindle, self.carriage = Axis(), Axis(), Axis()
        self.load.watch(self.tool, self.spindle, self.carriage)
        self.stock = Stock(
            surface_mm=(RADIUS_MM,) * CELLS,
            ends_mm=(170.0, 200.0),
            material=ALUMINIUM,
            fraction=share,
            edge_n_per_mm=edge_n_per_mm,
        )
        self.load.clamp(self.stock)
        self.turn_step = 1000.0 / 60.0 * CYCLE_S
        self.feed_mm = feed_mm

    def clamp(self, form_mm: Depth) -> None:
        """Clamp another blank, whose surface is this much further out at a turn of the spindle."""
        surface_mm = tuple(RADIUS_MM + form_mm((cell + 0.5) / CELLS) for cell in range(CELLS))
        self.load.clamp(replace(self.stock, surface_mm=surface_mm))

    def passes(self, depth_mm: Depth, turns: float, z_mm: float = 170.0) -> tuple[np.ndarray, np.ndarray]:
        """Turn so far from a place on; return turns and forces (N) of every cycle in which the edge is inside."""
        start = math.ceil(self.spindle.true_position / TURN_COUNTS)
        at, forces = [], []
        self.spindle.pace = self.turn_step * TURN_COUNTS
        self.carriage.pace = self.turn_step * self.feed_mm * Z_COUNTS_PER_MM
        for block in range(round(turns / self.turn_step / BLOCK)):
            turned = start + block * BLOCK * self.turn_step
            self.spindle.true_position = (turned - self.turn_step) * TURN_COUNTS
            z = z_mm - 0.5 * LAND_MM + (turned - start - self.turn_step) * self.feed_mm
            self.carriage.true_position = z * Z_COUNTS_PER_MM
            self.load.begin()
            for cycle in range(BLOCK):
                now = turned + cycle * self.turn_step
                self.load.push((HOME_MM - RADIUS_MM + depth_mm(now)) * COUNTS_PER_MM)
                at.append(now)
                forces.append(self.load.force_n)
            for axis in (self.tool, self.spindle, self.carriage):
                axis.cycles_run += BLOCK
            self.spindle.true_position = (turned + (BLOCK - 1) * self.turn_step) * TURN_COUNTS
        inside = slice(BLOCK, None)
        return np.array(at)[inside], np.array(forces)[inside]


def lobed(turns: np.ndarray, forces: np.ndarray) -> tuple[float, complex]:
    """The mean, and the wave three times a turn, by least squares."""
    angle = 6.0 * np.pi * turns
    columns = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    mean, cosine, sine = np.linalg.lstsq(columns, forces, rcond=None)[0]
    return float(mean), complex(cosine, -sine)


@pytest.mark.parametrize(
    ("depth_mm", "feed_mm", "force_n"),
    [(0.10, 0.05, 7.40), (0.10, 0.10, 12.45), (0.06, 0.05, 4.44), (0.06, 0.10, 7.47), (0.1275, 0.10, 15.87)],
)
def test_the_force_is_the_share_of_the_tables(depth_mm: float, feed_mm: float, force_n: float) -> None:
    """Wrought aluminium, 700 N/mm2 and 0.25: 0.4 of it; a chip of 0.02 mm and more does not feel the edge."""
    _, forces = Cutting(0.4, 7.0, feed_mm).passes(lambda _: depth_mm, 4.0)
    assert forces == pytest.approx(0.4 * force_n, abs=0.005)


@pytest.mark.parametrize(("feed_mm", "edge"), [(0.02, 0.0), (0.01, 0.5), (0.005, 0.75)])
def test_the_edge_comes_in_on_a_thin_chip_as_it_is_predicted(feed_mm: float, edge: float) -> None:
    """7 N/mm on a chip of no thickness, half of it at 0.01 mm, where Kienzle has 700 x 0.1 x 0.01^0.75 N."""
    _, forces = Cutting(0.4, 7.0, feed_mm).passes(lambda _: 0.1, 4.0)
    assert forces == pytest.approx(0.4 * (700.0 * 0.1 * feed_mm**0.75 + 7.0 * 0.1 * edge), abs=0.005)
    predicted = cutting_force(material_named("Al"), 0.1, feed_mm, passive_fraction=0.4, edge_n_per_mm=7.0)
    assert forces == pytest.approx(predicted.passive_n, abs=1e-6)


def test_a_lobed_path_has_a_lobed_force() -> None:
    """124.5 N for each mm at a feed of 0.1 mm: 55 um peak to peak are 6.85 N, three times a turn."""
    turns, forces = Cutting(feed_mm=0.1).passes(lambda t: 0.1 + 0.0275 * math.sin(6 * math.pi * t), 12.0)
    mean_n, harmonic = lobed(turns, forces)
    assert abs(harmonic) == pytest.approx(3.42, abs=0.02)
    assert mean_n == pytest.approx(12.45, abs=0.02)


def test_a_second_pass_at_the_same_depth_meets_next_to_nothing() -> None:
    cutting = Cutting()

    def path(turns: float) -> float:
        return 0.1 + 0.0275 * math.sin(6.0 * math.pi * turns)

    _, first = cutting.passes(path, 20.0)
    _, second = cutting.passes(path, 12.0)
    assert first.mean() == pytest.approx(7.40, abs=0.02)
    # The tip moves by up to 1.4 um from a place of the surface to the next.
    assert np.abs(second).max() < 0.12


def test_a_second_pass_meets_what_the_first_has_left() -> None:
    """A round pass 30 um deeper over a lobe of 20 um: 74 N/mm on 30 um on the average, and on 10 um of wave."""
    cutting = Cutting()
    cutting.passes(lambda t: 0.1 + 0.01 * math.cos(6 * math.pi * t), 20.0)
    turns, forces = cutting.passes(lambda _: 0.13, 12.0)
    mean_n, harmonic = lobed(turns, forces)
    assert mean_n == pytest.approx(0.030 * 74.0, rel=0.02)
    assert harmonic == pytest.approx(-0.010 * 74.0, rel=0.05, abs=0.03)


@pytest.mark.parametrize(
    ("depth_mm", "z_mm", "feed_mm"), [(-0.01, 170.0, 0.05), (0.1, 160.0, 0.05), (0.1, 170.0, 0.0)]
)
def test_without_a_chip_there_is_no_force(depth_mm: float, z_mm: float, feed_mm: float) -> None:
    """Beside the surface, before the free end, and without a feed."""
    _, forces = Cutting(feed_mm=feed_mm).passes(lambda _: depth_mm, 3.0, z_mm)
    assert not forces.any()


def test_it_pushes_the_tool_out_and_nothing_when_the_part_is_gone() -> None:
    cutting = Cutting()
    cutting.passes(lambda _: 0.1, 3.0)
    cutting.load.begin()
    assert cutting.load.push((HOME_MM - RADIUS_MM + 0.1) * COUNTS_PER_MM) == pytest.approx(-2.0 * 7.40, abs=0.01)
    cutting.load.clamp(None)
    cutting.load.begin()
    assert cutting.load.push((HOME_MM - RADIUS_MM + 0.1) * COUNTS_PER_MM) == 0.0
