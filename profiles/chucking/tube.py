"""The lobe of a clamped tube over angle and length, and how far it gives way under the tool.

A unit force on the radius is a sum of harmonics n = 0, 1, 2, ... round the part; each bends the shell by itself
(`profiles.chucking.shell`), n = 1 as a beam. The jaws hold the part at places along their length. Nothing moves
there, on the radius, round the axis or along it: the chucking force keeps the part from sliding.
Lengths are in mm from the jaw faces, positive towards the free end; angles from jaw 1 in degrees; deviations of
the part in um, positive where it is high; compliances in um/N, positive away from the tool.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats, read_only
from profiles.chucking.shell import Shell, U, V, W, bending, mesh, solve_band, stiffness_of, with_fixed, within
from profiles.materials import Material

HARMONICS = 24  # more add a hundredth under the tool, and nothing to what depends on the angle
PLACES = 3
"""Places along each jaw where it holds the part."""


@lru_cache(maxsize=64)
def compliance(shell: Shell, jaws: int, angle_deg: tuple[float, ...], z_mm: tuple[float, ...]) -> Floats:
    """Return the radial motion under a unit force on the tool, in R / (pi D), shape (z, angle).

    The forces of the jaws are those with which nothing moves where they hold: what each of them and the tool bend,
    and a motion of the part as a whole, whose six forces are in balance.
    """
    held, places, tool = 3 * PLACES, _places_mm(shell), floats(z_mm)
    flexible, n = _flexibility(shell, z_mm), np.arange(HARMONICS)
    jaw, angle = 2 * math.pi * np.arange(jaws) / jaws, np.radians(angle_deg)
    round_axis = np.arange(held) % 3 == 1
    radial = np.zeros(len(tool), dtype=bool)
    of_jaws = _turned(flexible[:, :held, :held], np.multiply.outer(n, jaw[:, None] - jaw[None, :]), round_axis)
    of_tool = _turned(flexible[:, :held, held:], np.multiply.outer(n, jaw[:, None] - angle[None, :]), radial)
    size = held * jaws
    whole = np.stack([_whole(shell, direction, float(z), jaw) for z in places for direction in range(3)])
    matrix = np.zeros((size + 6, size + 6))
    matrix[:size, :size] = of_jaws.transpose(0, 2, 1, 3).reshape(size, size)
    matrix[:size, size:] = whole.reshape(size, 6)
    matrix[size:, :size] = matrix[:size, size:].T
    moved = np.stack([_whole(shell, 0, float(z), angle).T for z in tool])  # (z, 6, angle)
    moved = np.concatenate([of_tool.transpose(1, 0, 2, 3).reshape(len(tool), size, len(angle)), moved], axis=1)
    alone = np.einsum("nzz->z", flexible[:, held:, held:])
    # Sideways of two jaws alone nothing but friction holds the part.
    return read_only(alone[:, None] - np.sum(moved * np.linalg.solve(matrix, moved), axis=1))


def _places_mm(shell: Shell) -> Floats:
    return floats(np.linspace(shell.grip_end_mm - shell.grip_mm, shell.grip_end_mm, PLACES))


def _whole(shell: Shell, direction: int, z_mm: float, angle: Floats) -> Floats:
    """Return how a place moves (0 on the radius, 1 round the axis, 2 along it) with the part, shape (angle, 6).

    The part moves along the axis, round it, to two sides, and tilts to two sides about the jaw faces.
    """
    none, one, c, s = np.zeros_like(angle), np.ones_like(angle), np.cos(angle), np.sin(angle)
    if direction == 0:
        columns = [none, none, c, s, z_mm * c, z_mm * s]
    elif direction == 1:
        columns = [none, one, -s, c, -z_mm * s, z_mm * c]
    else:
        columns = [one, none, none, none, -shell.radius_mm * c, -shell.radius_mm * s]
    return np.stack(columns, axis=-1)


def _turned(flexible: Floats, angle: Floats, force_round_axis: NDArray[np.bool_]) -> Floats:
    """Return the sum over n of what forces at places do to each place, n times the angle `angle` before it.

    Of radial and axial forces and motions that is by the cosine; round the axis they have the sine of the others.
    """
    round_axis = np.arange(flexible.shape[1]) % 3 == 1
    by_sine = round_axis[:, None] != force_round_axis[None, :]
    sine = np.where(by_sine, np.where(round_axis[:, None], 1.0, -1.0), 0.0) * flexible
    even = np.einsum("nab,njk->abjk", np.where(by_sine, 0.0, flexible), np.cos(angle))
    return floats(even + np.einsum("nab,njk->abjk", sine, np.sin(angle)))


@lru_cache(maxsize=64)
def _flexibility(shell: Shell, tool_mm: tuple[float, ...]) -> Floats:
    """Return the motions of the shell by unit forces, of each harmonic: at the jaws' places, then under the tool.

    The directions of a place in the jaws are on the radius, round the axis, and along it. n = 0 and 1, which would
    move as a whole, are held at an end; forces in balance do not load it.
    """
    z = mesh(shell)
    last = 6 * (len(z) - 1)
    held_whole = {0: np.array([U[0], V[0]]), 1: np.array([W[0], last + W[0]])}
    rows = np.zeros((3 * PLACES + len(tool_mm), last + 6))
    for first, places, step in ((0, _places_mm(shell), 3), (3 * PLACES, floats(tool_mm), 1)):
        i, shapes = within(z, places)
        for direction, at in enumerate((W, V, U)[:step]):
            for k in range(len(places)):
                rows[first + step * k + direction, 6 * i[k] + at] = shapes[k]
    flexible = []
    for n, stiffness in enumerate(stiffness_of(shell, tuple(range(HARMONICS)), z)):
        forces = rows.T.copy()
        if n in held_whole:
            forces[held_whole[n]] = 0.0
            stiffness = with_fixed(stiffness, held_whole[n])
        flexible.append(forces.T @ solve_band(stiffness, forces) / (1 if n else 2))
    return read_only(flexible)


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
