"""A stiff bar between N jaws whose contacts stiffen with load: why its compliance depends on the angle.

Linear springs k on N >= 3 jaws are equally stiff in every direction, and make no lobes. A contact f = C x^m
(m = 1/(1 - alpha), k ~ F^alpha) does: for small loads P pushed at an angle phi from a jaw, N = 3,

u = 2 P/(3 k) (1 - eps cos 3 phi), eps = alpha P / (6 F_c)

stiffest when a jaw is opposite to the force (Fig 3 of the paper). The tool pushes from the other side of the part:
a tool at angle theta pushes at theta + 180 deg. Forces in N, F_c on one jaw; k in N/um; deflections in um.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats
from profiles.materials import Material

# Tangential over normal stiffness of a contact that does not slide, 2 (1 - nu)/(2 - nu), for metals.
MINDLIN_RATIO = 0.8
_STEPS, _HALVINGS, _EXACT = 60, 30, 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """The contacts of one chuck: `stiffness_n_per_um` is that of one jaw at `force_per_jaw_n`.

    `tangential_ratio` is the tangential over the normal stiffness; without it two jaws hold nothing sideways.
    """

    jaws: int
    stiffness_n_per_um: float
    force_per_jaw_n: float
    alpha: float = 0.5
    tangential_ratio: float = 0.0

    @property
    def exponent(self) -> float:
        """The m of f = C x^m."""
        return 1 / (1 - self.alpha)

    @property
    def approach_um(self) -> float:
        """The compression of each contact by the clamping force: m F_c / k."""
        return self.exponent * self.force_per_jaw_n / self.stiffness_n_per_um


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BarDeflection:
    """The deflection of the bar along the load and across it; `lifted` where a jaw loses contact."""

    along_um: Floats
    across_um: Floats
    lifted: NDArray[np.bool_]


def stiffness_at(reference_n_per_um: float, reference_n: float, force_n: float, alpha: float) -> float:
    """Return the stiffness of a contact at another force: k ~ F^alpha."""
    return float(reference_n_per_um * (force_n / reference_n) ** alpha)


def deflection(contact: Contact, load_n: ArrayLike, angle_from_jaw_deg: ArrayLike) -> BarDeflection:
    """Solve for the equilibrium of all jaws under loads pushed at angles; the two shapes are broadcast.

    The sum over the jaws of F_c (1 + u n_i / x0)_+^m n_i, and of the tangential springs, balances the load. A
    negative load pulls. Newton's method on the elastic energy, which is convex, with halved steps.
    """
    loads, angles = np.broadcast_arrays(floats(load_n), np.radians(floats(angle_from_jaw_deg)))
    way = np.stack([np.cos(angles.ravel()), np.sin(angles.ravel())], axis=1)
    moved, contacts = _balance(contact, way * loads.ravel()[:, None] / contact.force_per_jaw_n)
    along = contact.approach_um * np.sum(moved * way, axis=1)
    across = contact.approach_um * (way[:, 0] * moved[:, 1] - way[:, 1] * moved[:, 0])
    lifted = np.any(contacts <= 0, axis=1)
    return BarDeflection(
        along_um=along.reshape(loads.shape),
        across_um=across.reshape(loads.shape),
        lifted=lifted.reshape(loads.shape),
    )


def _balance(contact: Contact, push: Floats) -> tuple[Floats, Floats]:
    """Return the motion in units of the approach, shape (cases, 2), and 1 + u n_i of each jaw, (cases, N)."""
    jaw = 2 * math.pi * np.arange(contact.jaws) / contact.jaws
    normal = np.stack([np.cos(jaw), np.sin(jaw)], axis=1)
    side = np.stack([-np.sin(jaw), np.cos(jaw)], axis=1)
    m = contact.exponent
    # Where only one jaw still has contact, nothing else would hold the bar sideways.
    sideways = contact.tangential_ratio * m * side.T @ side + 1e-12 * np.eye(2)

    def energy(moved: Floats) -> Floats:
        closed = np.maximum(1 + moved @ normal.T, 0.0)
        spent = np.sum(closed ** (m + 1), axis=1) / (m + 1) + 0.5 * np.sum((moved @ sideways) * moved, axis=1)
        return np.asarray(spent - np.sum(push * moved, axis=1))

    moved = np.zeros_like(push)
    for _ in range(_STEPS):
        closed = np.maximum(1 + moved @ normal.T, 0.0)
        missing = push - closed**m @ normal - moved @ sideways
        if np.max(np.abs(missing), initial=0.0) < _EXACT:
            break
        curvature = m * np.einsum("cj,jx,jy->cxy", closed ** (m - 1), normal, normal) + sideways
        step = np.linalg.solve(curvature, missing[..., None])[..., 0]
        moved = moved + _downhill_fraction(energy, moved, step)[:, None] * step
    return moved, 1 + moved @ normal.T


def _downhill_fraction(energy: Callable[[Floats], Floats], moved: Floats, step: Floats) -> Floats:
    fraction = np.ones(len(moved))
    before = energy(moved)
    for _ in range(_HALVINGS):
        worse = energy(moved + fraction[:, None] * step) > before + _EXACT
        if not worse.any():
            break
        fraction = np.where(worse, fraction / 2, fraction)
    return fraction


def overhung_deflection(
    contact: Contact, lever: float, load_n: ArrayLike, angle_from_jaw_deg: ArrayLike
) -> BarDeflection:
    """Return the deflection of a stiff bar at a load in front of jaws; `lever` is a/l, overhang over jaw length.

    The front edge of the jaws carries P (1 + a/l), the rear edge -P a/l, each with half of every jaw's stiffness
    and force: u = u_f + (u_f - u_r) a/l. For small loads its mean is 4 P/(3 k) ((1 + a/l)^2 + (a/l)^2) with three
    jaws.
    """
    edge = replace(
        contact, stiffness_n_per_um=contact.stiffness_n_per_um / 2, force_per_jaw_n=contact.force_per_jaw_n / 2
    )
    load = floats(load_n)
    front = deflection(edge, load * (1 + lever), angle_from_jaw_deg)
    rear = deflection(edge, -load * lever, angle_from_jaw_deg)
    return BarDeflection(
        along_um=front.along_um + (front.along_um - rear.along_um) * lever,
        across_um=front.across_um + (front.across_um - rear.across_um) * lever,
        lifted=front.lifted | rear.lifted,
    )


def cantilever_um(
    material: Material, diameter_mm: float, overhang_mm: ArrayLike, load_n: float, *, bore_mm: float = 0.0
) -> Floats:
    """Return P a^3 / (3 E I), I = pi (d^4 - bore^4)/64: the bending of a bar in front of the jaws, for each a."""
    second_moment_mm4 = math.pi * (diameter_mm**4 - bore_mm**4) / 64
    a = floats(overhang_mm)
    return np.asarray(1000 * load_n * a**3 / (3 * material.youngs_modulus_n_per_mm2 * second_moment_mm4))
