"""The lobe of a clamped tube over angle and length, and the deflection of its wall under the tool.

The jaws keep the length between them straight; in front of them each harmonic n = N, 2N, ... decays as a beam
on an elastic foundation, f''''/(4 beta^4) + f = 0, as if the tube continued beyond its free end. Lengths are in
mm from the jaw faces, positive towards the free end; deviations of the part in um, positive where it is high.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.ring import Ring, decay_per_mm, fourier_coefficient
from profiles.materials import Material

MULTIPLES = 8  # harmonics of the lobe that are summed: the ninth has less than a thousandth of the first
HALF_LOBE_ANGLES = 61


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A tube that ends in the jaws: held over `grip_mm`, `overhang_mm` in front of them."""

    outside_mm: float
    wall_mm: float
    grip_mm: float
    overhang_mm: float
    material: Material

    @property
    def gripped_ring(self) -> Ring:
        """The ring between the jaws alone."""
        return self._ring(self.grip_mm)

    def bending_ring(self, harmonic: int) -> Ring:
        """Return the ring that bends as the tube does at the jaws: the grip and the length bent with it.

        That is the integral of the f of `axial_fraction`, about 1/beta.
        """
        beta = decay_per_mm(self.gripped_ring, harmonic)
        x = beta * self.overhang_mm
        return self._ring(self.grip_mm + (1 - math.exp(-x) * math.cos(x)) / beta)

    def _ring(self, length_mm: float) -> Ring:
        return Ring(outside_mm=self.outside_mm, wall_mm=self.wall_mm, length_mm=length_mm, material=self.material)


def axial_fraction(tube: Tube, harmonic: int, z_mm: ArrayLike) -> Floats:
    """Return f(z), the lobe relative to that at the jaws, in the shape of `z_mm`; 1 between the jaws.

    f = exp(-beta z) (cos beta z + sin beta z): straight at the jaws, and nothing far away.
    """
    x = np.maximum(floats(z_mm), 0.0) * decay_per_mm(tube.gripped_ring, harmonic)
    return floats(np.exp(-x) * (np.cos(x) + np.sin(x)))


def spring_back_um(
    tube: Tube, jaws: int, force_per_jaw_n: float, *, angle_from_jaw_deg: ArrayLike, z_mm: ArrayLike
) -> Floats:
    """Return the deviation of the released tube, shape (Z, angle), mean 0 over a turn, high at the jaws.

    w = (N W R^3 / (pi E I)) sum f_n(z) cos(n angle) / (n^2 - 1)^2, n = N, 2N, ..., I = L t^3 / 12 with the length
    that each harmonic bends. `angle_from_jaw_deg` has one axis; so has `z_mm`.
    """
    angle = np.radians(floats(angle_from_jaw_deg))
    total = np.zeros((np.size(z_mm), angle.size))
    for n in (jaws * multiple for multiple in range(1, MULTIPLES + 1)):
        amplitude_um = fourier_coefficient(jaws, n) * tube.bending_ring(n).scale_um_per_n * force_per_jaw_n
        total += amplitude_um * np.outer(axial_fraction(tube, n, z_mm), np.cos(n * angle))
    return total


def wall_compliance_um_per_n(ring: Ring, jaws: int, angle_from_jaw_deg: ArrayLike) -> Floats:
    """Return the radial compliance of a ring on its jaws, in the shape of the angles.

    The ring is bent by the tool and by the reactions of N rigid jaws, and moves between them as a whole: the jaws
    do not move, and the forces balance. 0 at a jaw, largest between two: less is cut there, so its contribution to
    the part is LOW at the jaws. Two jaws hold it sideways by friction, whose bending is left out.
    """
    angles = floats(angle_from_jaw_deg)
    return floats(ring.scale_um_per_n * _on_jaws(jaws, angles.ravel())).reshape(angles.shape)


def _on_jaws(jaws: int, angle_deg: Floats) -> Floats:
    """Return the motion under the tool in units of R^3 / (E I), for one axis of angles."""
    jaw = 2 * math.pi * np.arange(jaws) / jaws
    seats = np.stack([np.cos(jaw), np.sin(jaw)], axis=1)
    matrix = np.block([[-_ring_deflection(jaw[:, None] - jaw[None, :]), seats], [seats.T, np.zeros((2, 2))]])
    flat = np.radians(angle_deg)
    tool = np.stack([np.cos(flat), np.sin(flat)])
    bent = _ring_deflection(jaw[:, None] - flat[None, :])
    # Sideways of two jaws the system is singular: the minimum-norm motion is none.
    found = np.linalg.lstsq(matrix, np.concatenate([-bent, tool]), rcond=None)[0]
    moved = (
        _ring_deflection(np.zeros(1)) - np.sum(bent * found[:jaws], axis=0) + np.sum(tool * found[jaws:], axis=0)
    )
    return floats(moved)


def half_lobe_deg(jaws: int) -> Floats:
    """Return angles from a jaw to the middle between two: by symmetry this covers everything."""
    return np.linspace(0.0, 180.0 / jaws, HALF_LOBE_ANGLES)


@cache
def half_lobe_compliance(jaws: int) -> Floats:
    """Return `wall_compliance_um_per_n` over half a lobe for a ring whose `scale_um_per_n` is 1; read only."""
    found = _on_jaws(jaws, half_lobe_deg(jaws))
    found.setflags(write=False)
    return found


def _ring_deflection(angle_rad: Floats) -> Floats:
    """Return the deflection at an angle from a unit load, in R^3 / (E I): sum cos(n a) / (pi (n^2 - 1)^2), n >= 2.

    The terms fall with the fourth power of n; forty are exact to a hundred-thousandth.
    """
    n = np.arange(2, 42)
    return np.asarray(np.cos(np.multiply.outer(angle_rad, n)) @ (1 / (math.pi * (n**2 - 1.0) ** 2)))
