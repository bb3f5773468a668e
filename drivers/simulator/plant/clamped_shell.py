"""The true shape along Z of a tube in the jaws: a thin shell by finite differences, on jaws that give way.

Not the method of the predictions (`profiles.chucking.shell`): u between nodes and v, w at nodes 0.5 mm apart, with
the energy of Love and Sanders; jaws are springs on the surface that they hold, and press less towards their faces.
Lengths in mm, z from the jaw faces to the free end; harmonics n >= 2 of a turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Strain = list[tuple[int, int, float | Floats]]
"""Terms at a node: how many nodes on, 0 to 2 for u, v or w there, and the factor."""

STEP_MM = 0.5
_ROWS = 9  # half the band and the diagonal: w'' reaches two nodes, of three values each


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampedShell:
    """A tube of mean radius `radius_mm`, `overhang_mm` in front of jaws of `grip_mm`.

    `jaw_stiffness` is that of the jaws' surface relative to the bending of the wall by the first harmonic, 1 where
    both give way alike; `open_fraction` is how much less they press in at their faces than at their rear edge.
    """

    radius_mm: float
    wall_mm: float
    grip_mm: float
    overhang_mm: float
    poisson: float
    jaw_stiffness: float
    open_fraction: float = 0.0

    def pressed(
        self, harmonics: tuple[int, ...], turned_mm: float = 0.0, turned_from_mm: float = 0.0
    ) -> PressedShape:
        """Return how far each harmonic is pressed in by a force of pi R D on it.

        `turned_mm` is off the wall from `turned_from_mm` to the free end.
        """
        from scipy.linalg import solveh_banded

        steps = round(self.grip_mm / STEP_MM), max(round(self.overhang_mm / STEP_MM), 2)
        z = np.concatenate(
            [np.linspace(-self.grip_mm, 0.0, steps[0] + 1), np.linspace(0.0, self.overhang_mm, steps[1] + 1)[1:]]
        )
        behind = np.clip((z - turned_from_mm) / STEP_MM + 0.5, 0.0, 1.0)  # half of it where the step is at a node
        wall = 1.0 - behind * turned_mm / self.wall_mm
        first = harmonics[0]
        spring = self.jaw_stiffness * (first**2 - 1) ** 2 / self.radius_mm**4
        weight = np.gradient(z)
        weight[[0, -1]] *= 0.5
        inside = np.where(z <= 0.0, weight, 0.0)
        inside[steps[0]] *= 0.5
        inward = 1.0 + self.open_fraction * (-z / self.grip_mm - 1.0)
        found = []
        for n in harmonics:
            band = _stiffness(n, z, wall, self.radius_mm, self.wall_mm, self.poisson, weight)
            band[0, 2::3] += spring * inside
            load = np.zeros(band.shape[1])
            load[2::3] = spring * inside * inward
            w = solveh_banded(band, load, lower=True)[2::3]
            found.append(w / (spring * inside * (inward - w)).sum())
        return PressedShape(z_mm=z, w=np.array(found))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressedShape:
    """The motion of each harmonic along z, shape (harmonic, z)."""

    z_mm: Floats
    w: Floats


def _stiffness(n: int, z: Floats, wall: Floats, radius: float, thick: float, nu: float, weight: Floats) -> Floats:
    """Return the stiffness of one harmonic in D as a lower band; values of a node are u after it, v and w."""
    band = np.zeros((_ROWS, 3 * len(z)))
    step = np.diff(z)
    stretch, last = 12.0 / thick**2, len(z) - 1
    inner, ends, gaps = np.arange(1, last), np.array([0, last]), np.arange(last)
    mean = 0.5 * (wall[:-1] + wall[1:])
    near = 0.5 * (step[:-1] + step[1:])
    u, v, w = 0, 1, 2
    hoop: Strain = [(0, v, n / radius), (0, w, 1.0 / radius)]
    ring: Strain = [(0, v, n / radius**2), (0, w, n * n / radius**2)]
    along: Strain = [(-1, u, -1.0 / near), (0, u, 1.0 / near)]
    curved: Strain = [
        (-1, w, -1.0 / (near * step[:-1])),
        (0, w, 1.0 / (near * step[:-1]) + 1.0 / (near * step[1:])),
        (1, w, -1.0 / (near * step[1:])),
    ]
    shear: Strain = [(0, u, -n / radius), (0, v, -1.0 / step), (1, v, 1.0 / step)]
    twist: Strain = [
        (0, u, n / (2.0 * radius**2)),
        (0, v, -1.5 / (radius * step)),
        (1, v, 1.5 / (radius * step)),
        (0, w, -2.0 * n / (radius * step)),
        (1, w, 2.0 * n / (radius * step)),
    ]
    for first, second, factor in ((along, hoop, stretch * wall[inner]), (curved, ring, wall[inner] ** 3)):
        by = factor * weight[inner]
        _add(band, inner, first, first, by)
        _add(band, inner, second, second, by)
        _add(band, inner, first, second, nu * by)
        _add(band, inner, second, first, nu * by)
    # At the free ends nothing pulls or bends along z: plane stress round the axis.
    flat = (1.0 - nu**2) * weight[ends]
    _add(band, ends, hoop, hoop, stretch * wall[ends] * flat)
    _add(band, ends, ring, ring, wall[ends] ** 3 * flat)
    half = 0.5 * (1.0 - nu) * step
    _add(band, gaps, shear, shear, stretch * mean * half)
    _add(band, gaps, twist, twist, mean**3 * half)
    band[0, 3 * last] = 1.0  # there is no u after the last node
    return band


def _add(band: Floats, nodes: NDArray[np.intp], first: Strain, second: Strain, by: Floats) -> None:
    """Add first x second of each node to the lower half of a band."""
    for at, value, factor in first:
        for at2, value2, factor2 in second:
            below = 3 * (at - at2) + value - value2
            if below >= 0:
                band[below, 3 * (nodes + at2) + value2] += by * factor * factor2
