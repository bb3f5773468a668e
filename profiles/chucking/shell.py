"""How far N jaws press a tube in along its whole length: a thin shell with the ends, wall and jaws that it has.

Each harmonic n of the radius bends as a cylindrical shell by itself: u = U(z) cos n a, v = V(z) sin n a,
w = W(z) cos n a with the strains of Love and Sanders, cubic Hermite elements along the axis, free at both ends.
How the jaws hold has two limits: straight jaws keep W constant over the length that they hold, jaws that give way
press on it evenly. Pressures add, and with them what they do: a fraction of the force is as of straight jaws and
the rest is even. Lengths in mm, z from the jaw faces, positive towards the free end.

Sanders, NASA TR R-24 (1959): e_x = u', e_a = (v,a + w)/R, g = v' + u,a/R; k_x = -w'', k_a = (v,a - w,aa)/R^2,
2 k_xa = (-2 w',a + 3/2 v' - u,a/(2 R))/R.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats, read_only

FIRST_ELEMENT, GROWTH, LAST_ELEMENT = 0.12, 1.6, 1.5
"""Length of the element at a jaw face or an end, in sqrt(R t), the growth to the next, and the longest."""

LEAST_LENGTH = 0.01
"""Of a part of the mesh, in sqrt(R t): elements much shorter than others cost digits."""

_GAUSS_AT, _GAUSS_WEIGHT = (each / 2 for each in np.polynomial.legendre.leggauss(4))
U, V, W = (np.array([first, first + 1, first + 6, first + 7]) for first in (0, 2, 4))
"""Values and slopes of U, V, W at the two nodes of an element, each node having six."""
_ELEMENT = np.concatenate([U, V, W])


@dataclass(frozen=True, slots=True, kw_only=True)
class Shell:
    """A tube from the rear edge of its jaws to its free end.

    The jaws hold `grip_mm` behind z = `grip_end_mm`, which is 0 unless they are bell-mouthed (then negative).
    `turned_mm` is what was taken off the radius from `turned_from_mm` to the free end.
    """

    radius_mm: float
    wall_mm: float
    grip_mm: float
    overhang_mm: float
    poisson: float
    grip_end_mm: float = 0.0
    turned_mm: float = 0.0
    turned_from_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bending:
    """W(z) of each harmonic for a load of 1 on all jaws together, in R^2/D of the unturned wall, by nodes along z.

    `straight` and `even` have shape (2, harmonic, node): value, and slope per mm, for the two ways of holding.
    """

    z_mm: Floats
    straight: Floats
    even: Floats

    def at(self, z_mm: ArrayLike, straight_fraction: float) -> Floats:
        """Return W, shape (harmonic, z), at places of the part."""
        value, slope = straight_fraction * self.straight + (1 - straight_fraction) * self.even
        i, shapes = within(self.z_mm, floats(z_mm))
        ends = np.stack([value[:, i], slope[:, i], value[:, i + 1], slope[:, i + 1]])
        return floats(np.einsum("zs,shz->hz", shapes, ends))


def within(nodes_mm: Floats, z_mm: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return the element of each place, and the four shape functions there."""
    z_mm = np.clip(z_mm, nodes_mm[0], nodes_mm[-1])
    i = np.clip(np.searchsorted(nodes_mm, z_mm, side="right") - 1, 0, len(nodes_mm) - 2)
    length = nodes_mm[i + 1] - nodes_mm[i]
    return i, _hermite((z_mm - nodes_mm[i]) / length, length)[0]


@lru_cache(maxsize=256)
def bending(shell: Shell, harmonics: tuple[int, ...]) -> Bending:
    """Return how far the jaws press the shell in, by harmonics n >= 2.

    Converged to 0.005 of the value at the jaws for harmonics with a length along the axis of three walls and more.
    """
    z = mesh(shell)
    held = np.flatnonzero(z <= shell.grip_end_mm + 1e-9)
    value, slope = 6 * np.arange(len(z)) + W[0], 6 * np.arange(len(z)) + W[1]
    fixed = np.concatenate([value[held], slope[held]])
    even, one = np.zeros(6 * len(z)), np.zeros(6 * len(z))
    one[value[held]] = 1.0
    for i, length in enumerate(np.diff(z[held])):
        even[6 * i + W] += length / (z[held[-1]] - z[0]) * np.array([0.5, length / 12, 0.5, -length / 12])
    pressed, straight = [], []
    for stiffness in stiffness_of(shell, harmonics, z):
        pressed.append(solve_band(stiffness, even))
        # Held straight, W is 1 and does not slope in the jaws; the load is what that takes.
        reaction = -_times(stiffness, one)
        reaction[fixed] = one[fixed]
        moved = solve_band(with_fixed(stiffness, fixed), reaction)
        straight.append(moved / _times(stiffness, moved)[value[held]].sum())
    return Bending(
        z_mm=read_only(z),
        straight=read_only([[each[of] for each in straight] for of in (value, slope)]),
        even=read_only([[each[of] for each in pressed] for of in (value, slope)]),
    )


def solve_band(stiffness: Floats, forces: Floats) -> Floats:
    """Return the motions under forces, by the lower half of the band of a stiffness."""
    from scipy.linalg import solveh_banded

    return floats(solveh_banded(stiffness, forces, lower=True))


def with_fixed(stiffness: Floats, fixed: NDArray[np.intp]) -> Floats:
    """Return a stiffness by which these values are what stands for them on the right."""
    held = stiffness.copy()
    held[:, fixed] = 0.0
    for below in range(1, len(held)):
        held[below, fixed[fixed >= below] - below] = 0.0
    held[0, fixed] = 1.0
    return held


def _times(stiffness: Floats, moved: Floats) -> Floats:
    """Return the forces of motions."""
    force = stiffness[0] * moved
    for below, row in enumerate(stiffness[1:], start=1):
        force[below:] += row[:-below] * moved[:-below]
        force[:-below] += row[:-below] * moved[below:]
    return floats(force)


def mesh(shell: Shell) -> Floats:
    """Return the nodes: fine at the ends, at the end of the jaws, and where the wall becomes thinner.

    Lengths below `LEAST_LENGTH` change nothing that can be seen: jaws that short press along a line, and a part
    that ends so near to them ends there.
    """
    size = np.sqrt(shell.radius_mm * shell.wall_mm)
    corners = {shell.grip_end_mm - max(shell.grip_mm, LEAST_LENGTH * size), shell.grip_end_mm}
    if shell.overhang_mm - shell.grip_end_mm > LEAST_LENGTH * size:
        corners.add(shell.overhang_mm)
    if shell.turned_mm and shell.grip_end_mm < shell.turned_from_mm < max(corners):
        corners.add(shell.turned_from_mm)
    z = [min(corners)]
    for begin, end in zip(sorted(corners), sorted(corners)[1:], strict=False):
        sizes = [FIRST_ELEMENT * size]
        while sum(sizes) < (end - begin) / 2:
            sizes.append(min(sizes[-1] * GROWTH, LAST_ELEMENT * size))
        half = np.array([*sizes, *sizes[::-1]])
        z.extend(begin + np.cumsum(half) * (end - begin) / half.sum())
    return floats(z)


def _hermite(x: Floats, length: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the cubic shape functions at x = 0 to 1 of an element, and their two derivatives by z."""
    one = np.ones_like(x)
    value = [1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, length * (x**3 - x**2)]
    first = [(6 * x**2 - 6 * x) / length, 1 - 4 * x + 3 * x**2, (6 * x - 6 * x**2) / length, 3 * x**2 - 2 * x]
    second = [
        (12 * x - 6) / length**2,
        (6 * x - 4 * one) / length,
        (6 - 12 * x) / length**2,
        (6 * x - 2 * one) / length,
    ]
    return np.stack(value, -1), np.stack(first, -1), np.stack(second, -1)


def stiffness_of(shell: Shell, harmonics: tuple[int, ...], z: Floats) -> Floats:
    """Return the stiffness of each harmonic in D / R^2 of the unturned wall, shape (harmonic, 12, 6 nodes).

    [:, d, i] couples i with i + d, as `scipy.linalg.solveh_banded` has the lower half of a band.
    """
    radius, nu, length = shell.radius_mm, shell.poisson, np.diff(z)[:, None]
    value, first, second = _hermite(np.broadcast_to(_GAUSS_AT + 0.5, (len(length), 4)), length)
    # The strains are of second degree in n, so the stiffness is of the fourth.
    strain = np.zeros((3, len(length), 4, 6, 12))
    for degree, row, column, by in (
        (0, 0, 0, first),  # e_x
        (1, 1, 4, value / radius),  # e_a
        (0, 1, 8, value / radius),
        (1, 2, 0, -value / radius),  # g
        (0, 2, 4, first),
        (0, 3, 8, -second),  # k_x
        (1, 4, 4, value / radius**2),  # k_a
        (2, 4, 8, value / radius**2),
        (1, 5, 0, value / (2 * radius**2)),  # 2 k_xa
        (0, 5, 4, 1.5 * first / radius),
        (1, 5, 8, 2 * first / radius),
    ):
        strain[degree, ..., row, column : column + 4] += by
    plane = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    turned = (z[:-1] >= shell.turned_from_mm - 1e-9) & (z[:-1] >= shell.grip_end_mm - 1e-9)
    thinner = np.where(turned, 1 - shell.turned_mm / shell.wall_mm, 1.0)[:, None, None]
    elastic = np.zeros((len(length), 6, 6))
    elastic[:, :3, :3] = 12 / shell.wall_mm**2 * thinner * plane
    elastic[:, 3:, 3:] = thinner**3 * plane
    stress = (_GAUSS_WEIGHT * length * radius**2)[:, :, None, None] * (elastic[:, None] @ strain)
    at_points, of_points = (each.reshape(3, len(length), 24, 12) for each in (strain, stress))
    each = np.zeros((5, len(length), 12, 12))
    for i, j in np.ndindex(3, 3):
        each[i + j] += np.swapaxes(at_points[i], 1, 2) @ of_points[j]
    whole = np.zeros((5, 12, 6 * len(z)))
    below = _ELEMENT[:, None] - _ELEMENT[None, :]
    a, b = np.nonzero(below >= 0)
    for i in range(len(length)):
        whole[:, below[a, b], 6 * i + _ELEMENT[b]] += each[:, i, a, b]
    return floats(np.tensordot(np.vander(harmonics, 5, increasing=True), whole, axes=1))
