"""A thin ring under N jaws: its bending and its stress.

N equal inward loads W on a ring of mean radius R = (OD - t)/2 and second moment I = L t^3 / 12 (Timoshenko/Roark
ring, bending only; good for a wall below a fifth of the radius). What is turned round while the ring is clamped
shows the deflection after release: HIGH at the jaws. Lengths in mm, forces in N on one jaw, deflections in um.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from profiles.materials import Material

THIN_WALL = 0.2  # wall over outer radius below which a part is a ring that bends, and above which it is a bar


@dataclass(frozen=True, slots=True, kw_only=True)
class Ring:
    """A ring of rectangular section; `length_mm` is along the axis."""

    outside_mm: float
    wall_mm: float
    length_mm: float
    material: Material

    @property
    def mean_radius_mm(self) -> float:
        """Radius of the neutral line."""
        return (self.outside_mm - self.wall_mm) / 2

    @property
    def bending_stiffness_n_mm2(self) -> float:
        """E I of the section."""
        return self.material.youngs_modulus_n_per_mm2 * self.length_mm * self.wall_mm**3 / 12

    @property
    def scale_um_per_n(self) -> float:
        """W R^3 / (E I) for one newton, which the coefficients of the formulas multiply."""
        return 1000 * self.mean_radius_mm**3 / self.bending_stiffness_n_mm2


def is_thin(wall_mm: float, radius_mm: float) -> bool:
    """Whether a part bends as a ring rather than acting as a bar."""
    return wall_mm / radius_mm < THIN_WALL


def ring_coefficients(jaws: int) -> tuple[float, float, float]:
    """Return the factors of W R^3 / (E I): inward at a jaw, outward between two, and both together (p-p).

    With h = pi/N, s = sin h, c = cos h: ((h + s c)/(2 s^2) - 1/h)/2 and (1/h - 1/(2 s) - h c/(2 s^2))/2.
    """
    h = math.pi / jaws
    s, c = math.sin(h), math.cos(h)
    at_jaw = ((h + s * c) / (2 * s * s) - 1 / h) / 2
    between = (1 / h - 1 / (2 * s) - h * c / (2 * s * s)) / 2
    return at_jaw, between, at_jaw + between


def fourier_coefficient(jaws: int, harmonic: int) -> float:
    """Return the amplitude of cos(harmonic angle) in W R^3 / (E I): N / (pi (n^2 - 1)^2) for n = N, 2N, ..."""
    return jaws / (math.pi * (harmonic**2 - 1) ** 2)


def spring_back_um_pp(ring: Ring, jaws: int, force_per_jaw_n: float) -> float:
    """Return the peak-to-peak error of the released ring."""
    return ring_coefficients(jaws)[2] * ring.scale_um_per_n * force_per_jaw_n


def bending_stress_mpa(ring: Ring, jaws: int, force_per_jaw_n: float) -> float:
    """Return the bending stress under a jaw, where it is largest: moment W R (1/h - cot h) / 2 over L t^2 / 6.

    W. C. Young and R. G. Budynas, Roark's Formulas for Stress and Strain, 7th edition, table 9.2, case 7.
    """
    h = math.pi / jaws
    moment_n_mm = force_per_jaw_n * ring.mean_radius_mm / 2 * (1 / h - 1 / math.tan(h))
    return 6 * moment_n_mm / (ring.length_mm * ring.wall_mm**2)


def jaw_stress_mpa(ring: Ring, jaws: int, force_per_jaw_n: float) -> float:
    """Return the largest stress under a jaw, in compression outside: of the bending and of the hoop force.

    The hoop force W cot(h) / 2 over L t: 3 % more for the rings of the paper, 30 % for a thick one in six jaws.
    """
    hoop_n = force_per_jaw_n / (2 * math.tan(math.pi / jaws))
    return bending_stress_mpa(ring, jaws, force_per_jaw_n) + hoop_n / (ring.length_mm * ring.wall_mm)
