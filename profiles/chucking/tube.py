"""The lobe of a clamped tube over angle and length, and the deflection of its wall under the tool.

Lengths are in mm from the jaw faces, positive towards the free end; deviations of the part in um, positive where
it is high.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.shell import Shell, bending
from profiles.chucking.wall import compliance
from profiles.materials import Material

MULTIPLES = 5  # harmonics of the lobe that are summed: the sixth has less than a thousandth of the first
HALF_LOBE_ANGLES = 61


@dataclass(frozen=True, slots=True, kw_only=True)
class Tube:
    """A tube that ends in the jaws: `overhang_mm` in front of jaws of `grip_mm`.

    They hold as straight jaws with `straight_fraction` of their force, evenly with the rest, and not at all over
    `bell_mouth_mm` behind their faces. `turned_mm` is off the radius from `turned_from_mm` to the free end.
    """

    outside_mm: float
    wall_mm: float
    grip_mm: float
    overhang_mm: float
    material: Material
    straight_fraction: float = 1.0
    bell_mouth_mm: float = 0.0
    turned_mm: float = 0.0
    turned_from_mm: float = 0.0

    @property
    def shell(self) -> Shell:
        """The part as a shell with its middle surface."""
        return Shell(
            radius_mm=(self.outside_mm - self.wall_mm) / 2,
            wall_mm=self.wall_mm,
            grip_mm=self.grip_mm - self.bell_mouth_mm,
            overhang_mm=self.overhang_mm,
            poisson=self.material.poisson,
            grip_end_mm=-self.bell_mouth_mm,
            turned_mm=self.turned_mm,
            turned_from_mm=self.turned_from_mm,
        )


def pressed_um_per_n(tube: Tube, jaws: int, harmonics: tuple[int, ...], z_mm: ArrayLike) -> Floats:
    """Return how far each harmonic is pressed in by 1 N on each jaw, shape (harmonic, z).

    N F R / (pi D) times the w of `Bending.at`; N F R^3 (1 - nu^2) / (pi E I (n^2 - 1)^2) where the part ends at
    straight jaws, I = L t^3 / 12 of their length.
    """
    return jaws * _scale_um(tube) * bending(tube.shell, harmonics).at(z_mm, tube.straight_fraction)


def axial_fraction(tube: Tube, harmonic: int, z_mm: ArrayLike) -> Floats:
    """Return f(z), the harmonic of the lobe relative to that at the jaw faces, in the shape of `z_mm`."""
    z = floats(z_mm)
    pressed = pressed_um_per_n(tube, 1, (harmonic,), [0.0, *z.ravel()])[0]
    return floats(pressed[1:] / pressed[0]).reshape(z.shape)


def spring_back_um(
    tube: Tube, jaws: int, force_per_jaw_n: float, *, angle_from_jaw_deg: ArrayLike, z_mm: ArrayLike
) -> Floats:
    """Return the deviation of the released tube, shape (Z, angle), mean 0 over a turn, high at the jaws.

    The harmonics are n = N, 2N, ... `angle_from_jaw_deg` has one axis; so has `z_mm`.
    """
    harmonics = tuple(jaws * multiple for multiple in range(1, MULTIPLES + 1))
    waves = np.cos(np.outer(harmonics, np.radians(floats(angle_from_jaw_deg))))
    return floats(force_per_jaw_n * pressed_um_per_n(tube, jaws, harmonics, z_mm).T @ waves)


def wall_compliance_um_per_n(tube: Tube, jaws: int, angle_from_jaw_deg: ArrayLike, z_mm: ArrayLike) -> Floats:
    """Return the radial motion of the part under 1 N on the tool, shape (Z, angle).

    Its wall moves between the jaws, where less is cut, so the part is LOW at the jaws; away from them its wall
    moves at every angle, and it bends as a whole.
    """
    angle, z = floats(angle_from_jaw_deg).tolist(), floats(z_mm).tolist()
    return _scale_um(tube) * compliance(tube.shell, jaws, tuple(angle), tuple(z))


def _scale_um(tube: Tube) -> float:
    """Return R / (pi D) for 1 N, D = E t^3 / (12 (1 - nu^2)) of the unturned wall."""
    material = tube.material
    rigidity = material.youngs_modulus_n_per_mm2 * tube.wall_mm**3 / (12 * (1 - material.poisson**2))
    return 1000 * tube.shell.radius_mm / (math.pi * rigidity)


def half_lobe_deg(jaws: int) -> Floats:
    """Return angles from a jaw to the middle between two: by symmetry this covers everything."""
    return np.linspace(0.0, 180.0 / jaws, HALF_LOBE_ANGLES)
