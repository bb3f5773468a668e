"""The grip at speed, and what the cut needs: the force rules after VDI 3106 and DIN EN 1550.

Forces are totals over all jaws, in N; F_sp0 is at rest, and the jaws grip from outside. At speed the mass of the
jaws takes F_c = sum(m r) (pi n / 30)^2 away. The usable grip is F_sp0 / S_sp - F_c; the cut needs
S_z F_spz of it. Plain numbers without heavy imports, because a form calls this at every key.
"""

from __future__ import annotations

import math

from profiles.cutting import CuttingForce

MOST_GRIP_LOSS = 0.67
"""Fraction of the force at rest that rotation may take (DIN EN 1550)."""

CUT_SAFETY = 1.5
"""S_z: safety factor of the grip over what the cut needs; at least 1.5."""


def centrifugal_loss_n(mass_radius_kg_m: float, spindle_speed_rpm: float) -> float:
    """Return F_c = M_c (pi n / 30)^2, M_c the sum of mass times radius of the jaws."""
    return mass_radius_kg_m * (math.pi * spindle_speed_rpm / 30) ** 2


def cut_grip_n(cut: CuttingForce, *, friction: float, overhang_mm: float, jaw_length_mm: float) -> float:
    """Return F_spz: the clamping force below which this cut would move the part.

    Turning and pushing act at the same contacts, hypot(F_c, F_f) / mu with the cut at the diameter that is held.
    The leverage of the overhang unloads a jaw edge below 4 P (1 + a/l), P = hypot(F_c, F_p); it comes on top.
    """
    slipping_n = math.hypot(cut.main_n, cut.feed_n) / friction
    lifting_n = 4 * cut.in_plane_n * (1 + overhang_mm / jaw_length_mm)
    return slipping_n + lifting_n


def least_force_n(cut_grip: float, loss: float, chuck_safety: float) -> float:
    """Return the least F_sp0 for a cut: S_sp (S_z F_spz + F_c), and at most 67 % of it lost. All in N."""
    return max(chuck_safety * (CUT_SAFETY * cut_grip + loss), loss / MOST_GRIP_LOSS)


def permitted_speed_rpm(force_n: float, cut_grip: float, mass_radius_kg_m: float, chuck_safety: float) -> float:
    """Return n_perm = (30/pi) sqrt((F_sp0/S_sp - S_z F_spz)/M_c); 0 where the force never holds the cut.

    With `chuck_safety` 1 it is the form of the chuck makers' manuals.
    """
    return speed_of_loss_rpm(force_n / chuck_safety - CUT_SAFETY * cut_grip, mass_radius_kg_m)


def most_loss_speed_rpm(force_n: float, mass_radius_kg_m: float) -> float:
    """Return the speed at which rotation takes 67 % of the force at rest."""
    return speed_of_loss_rpm(MOST_GRIP_LOSS * force_n, mass_radius_kg_m)


def speed_of_loss_rpm(loss_n: float, mass_radius_kg_m: float) -> float:
    """Return the speed of this loss, n = (30/pi) sqrt(F_c/M_c); 0 where nothing may be lost."""
    return 30 / math.pi * math.sqrt(max(loss_n, 0.0) / mass_radius_kg_m)
