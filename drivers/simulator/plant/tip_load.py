"""The cutting force on the tool: the material at its tip in each servo cycle, and the resulting force.

The force is that of the fresh strip, which the feed brings under the tool: its depth is from the surface before
the tip, the blank or what an earlier pass has left, down to the tip. Rubbing of the land is neglected. The load on
spindle and tool is the main force of the law by which it is predicted, at the true edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from drivers.simulator.plant.spindle import RadialError
from profiles.cutting import cutting_force
from profiles.job import Job
from profiles.materials import MATERIALS, Material, material_or_none

ALUMINIUM = MATERIALS[0]  # wrought, not hardenable: the material assumed where a job names an unknown one
CELLS = 360  # number of angles round the part at which the surface is known
STRIP_MM = 0.1  # length of a ring of these along Z; it counts as cut when the leading edge has left it


def material_of(job: Job) -> Material:
    """Return the true material of a job's part."""
    return material_or_none(job.material) or ALUMINIUM


def cutting_force_n(
    depth_mm: float, feed_mm_per_rev: float, material: Material = ALUMINIUM, edge_n_per_mm: float = 0.0
) -> float:
    """Return the main force on a tool that stands square to the axis; `edge_n_per_mm` is that on no chip."""
    return cutting_force(material, depth_mm, feed_mm_per_rev, edge_n_per_mm=edge_n_per_mm).main_n


def cutting_torque_n_m(job: Job) -> float:
    """Return the torque of the cut of a job."""
    return cutting_force_n(job.depth_of_cut_mm, job.feed_mm_per_rev, material_of(job)) * job.radius_mm / 1000.0


Ahead = tuple[float, float]  # place in a servo cycle, extrapolated from the last one, and the step of that; counts


class MovingAxis(Protocol):
    """An axis in the loop of its motor: machine position at the last servo cycle, counts, and its last step."""

    true_position: float
    pace: float
    cycles_run: int


@dataclass(frozen=True, slots=True, kw_only=True)
class TipGeometry:
    """Relation of tip, part and counts: radius of the tip at machine zero, and land of the tool along Z."""

    home_radius_mm: float
    land_mm: float
    tool_counts_per_mm: float
    carriage_counts_per_mm: float
    spindle_counts_per_turn: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stock:
    """A clamped blank: `ends_mm` is its range along Z, `fraction` the passive force over the main one.

    `surface_mm` is its radius in `CELLS` places from the spindle index, `drifted_mm` how much further in the
    machine has brought the tip since it was cold. `yields_mm_per_n` is how the part gives way in these places;
    empty where it does not.
    """

    surface_mm: tuple[float, ...]
    ends_mm: tuple[float, float]
    material: Material
    fraction: float
    edge_n_per_mm: float
    drifted_mm: float = 0.0
    yields_mm_per_n: tuple[float, ...] = ()

    def passive_n_per_mm(self, feed_mm_per_turn: float) -> float:
        """Return the force on the tool per mm of depth, N: a `fraction` of the main one; none without feed."""
        if feed_mm_per_turn <= 0.0:
            return 0.0
        return self.fraction * cutting_force_n(1.0, feed_mm_per_turn, self.material, self.edge_n_per_mm)


class TipLoad:
    """The force on the tool, servo cycle by servo cycle.

    The tool is run before the spindle and the carriage: within a block of cycles these are extrapolated at the
    pace of their last one, which is a hundredth of a degree at most in a cut.
    """

    def __init__(self, geometry: TipGeometry, wander: RadialError | None, push_per_n: float) -> None:
        """`push_per_n` is the acceleration of the slide by one newton, counts/s2."""
        self.force_n = 0.0
        self._geometry = geometry
        self._wander = wander
        self._push_per_n = push_per_n
        self._motors: tuple[MovingAxis, MovingAxis, MovingAxis] | None = None
        self._stock: Stock | None = None
        self._home_mm = geometry.home_radius_mm
        self._rings: dict[int, list[float]] = {}
        self._ring: int | None = None
        self._surface: list[float] = []
        self._fresh: list[float] = []
        self._part_mm_per_n: tuple[float, ...] = ()
        self._n_per_mm = 0.0
        self._turns = self._turn_step = 0.0
        self._cell: int | None = None
        self._path: list[tuple[Ahead, Ahead]] = []

    @property
    def led(self) -> bool:
        """Whether it samples each cycle of a stretch itself."""
        return bool(self._path)

    def lead(self, spindle: Sequence[Ahead], carriage: Sequence[Ahead]) -> None:
        """Look at each cycle of a stretch, through which spindle and carriage have been run before the tool.

        `begin` is called for each of its cycles.
        """
        self._path = list(zip(spindle, carriage, strict=True))[::-1]

    def watch(self, tool: MovingAxis, spindle: MovingAxis, carriage: MovingAxis) -> None:
        """Use these motors from now on."""
        self._motors = tool, spindle, carriage

    def watches(self) -> bool:
        """Whether it samples spindle and carriage in each block of servo cycles, because a blank is clamped."""
        return self._stock is not None

    def clamp(self, stock: Stock | None) -> None:
        """Clamp a blank, or remove it."""
        self._stock, self._ring, self._cell = stock, None, None
        if stock is not None:
            self._home_mm = self._geometry.home_radius_mm - stock.drifted_mm
            self._part_mm_per_n = stock.yields_mm_per_n
        self._rings.clear()

    def begin(self) -> None:
        """Begin a block of servo cycles: update the speed of the part, and the ring of the leading edge."""
        self._n_per_mm = 0.0
        if self._stock is None or self._motors is None:
            return
        tool, spindle, carriage = self._motors
        if self._path:
            (angle, turning), (place, feeding) = self._path.pop()
        else:
            angle, turning = _extrapolate_position(spindle, tool.cycles_run), spindle.pace
            place, feeding = _extrapolate_position(carriage, tool.cycles_run), carriage.pace
        geometry, stock = self._geometry, self._stock
        z_mm = place / geometry.carriage_counts_per_mm + 0.5 * geometry.land_mm
        self._turn_step = turning / geometry.spindle_counts_per_turn
        inside = stock.ends_mm[0] <= z_mm <= stock.ends_mm[1]
        self._enter(int(z_mm // STRIP_MM) if inside else None, stock)
        if inside and self._turn_step > 0.0:
            self._turns = angle / geometry.spindle_counts_per_turn
            feed_mm = feeding / geometry.carriage_counts_per_mm / self._turn_step
            self._n_per_mm = stock.passive_n_per_mm(feed_mm)
        if not self._n_per_mm:
            self._cell = None

    @property
    def acts(self) -> bool:
        """Whether there may be a force in the block that has begun; without, `push` is 0."""
        if not self._n_per_mm:
            self.force_n = 0.0
        return self._n_per_mm != 0.0

    def push(self, place: float) -> float:
        """Return the effect of the cut on the slide at a machine position (counts) in a cycle, counts/s2."""
        if not self._n_per_mm:
            self.force_n = 0.0
            return 0.0
        turns = self._turns
        self._turns = turns + self._turn_step
        tip_mm = self._home_mm - place / self._geometry.tool_counts_per_mm
        if self._wander is not None:
            tip_mm -= self._wander.at_mm(turns)
        cell = int(turns * CELLS // 1.0)
        depth_mm = self._surface[cell % CELLS] - tip_mm
        if self._part_mm_per_n and depth_mm > 0.0:
            depth_mm /= 1.0 + self._part_mm_per_n[cell % CELLS] * self._n_per_mm
            tip_mm = self._surface[cell % CELLS] - depth_mm
        self._leave(cell, tip_mm)
        self.force_n = self._n_per_mm * depth_mm if depth_mm > 0.0 else 0.0
        return -self._push_per_n * self.force_n

    def _leave(self, cell: int, tip_mm: float) -> None:
        """Cut the places that the tip has passed since the last cycle."""
        fresh = self._fresh
        for each in range(cell if self._cell is None else self._cell + 1, cell + 1):
            if tip_mm < fresh[each % CELLS]:
                fresh[each % CELLS] = tip_mm
        self._cell = cell

    def _enter(self, ring: int | None, stock: Stock) -> None:
        """Enter a ring: the surface cut in the last one is from now on the one before the tip."""
        if ring == self._ring:
            return
        if self._ring is not None:
            self._rings[self._ring] = self._fresh
        self._ring = ring
        if ring is not None:
            self._surface = self._rings.get(ring) or list(stock.surface_mm)
            self._fresh = list(self._surface)


def _extrapolate_position(axis: MovingAxis, cycle: int) -> float:
    """Return the position of an axis in a servo cycle, counts, extrapolated from its last one."""
    return axis.true_position + axis.pace * (cycle - axis.cycles_run + 1)
