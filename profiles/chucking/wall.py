"""How far a clamped tube gives way under the tool: its wall between the jaws, and its bending as a whole.

A unit force on the radius is a sum of harmonics n = 0, 1, 2, ... round the part; each bends the shell by itself
(`profiles.chucking.shell`), n = 1 as a beam. The jaws hold the part at places along their length. Nothing moves
there, on the radius, round the axis or along it: the chucking force keeps the part from sliding. Lengths in mm, z
from the jaw faces; angles from jaw 1 in degrees; compliances in um/N, positive away from the tool.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats, floats, read_only
from profiles.chucking.shell import Shell, U, V, W, mesh, solve_band, stiffness_of, with_fixed, within

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
