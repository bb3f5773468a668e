"""The deflection of a part in N jaws whose contacts stiffen with force, at a radial load in front of the jaws.

The jaws of one ring are those of `profiles.chucking.contact`: the clamping force F_c has pressed each together
by x0 = m F_c / k, with k ~ F_c^alpha and m = 1 / (1 - alpha). What a load P moves the part by in units of x0
depends on P / F_c, alpha and the angle alone, so that rows of any force are solved at once. A load at the distance
a in front of jaws of the length l is carried by two rings of half the stiffness and half the force each,
P (1 + a/l) in front and -P a/l behind, and the tip of the part moves by

u_tip = u_front (1 + a/l) - u_rear a/l,

plus the bending of the part as a cantilever, P a^3 / (3 E I) with I = pi d^4 / 64 (Timoshenko). Pure numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.contact import Contact, deflection


def contact_um(
    stiffness_n_per_um: ArrayLike,
    alpha: float,
    jaw_length_mm: float,
    *,
    jaws: int,
    force_per_jaw_n: ArrayLike,
    load_n: ArrayLike,
    past_jaw_deg: ArrayLike,
    overhang_mm: ArrayLike,
) -> Floats:
    """Return the radial deflection at the load from the contacts alone, um along the load; broadcast shapes.

    `stiffness_n_per_um` is k of one jaw at `force_per_jaw_n`; at least three jaws.
    """
    k, force, load, angle, lever = np.broadcast_arrays(
        *(floats(each) for each in (stiffness_n_per_um, force_per_jaw_n, load_n, past_jaw_deg, overhang_mm))
    )
    lever = lever / jaw_length_mm
    give_um = force / k / (1.0 - alpha)
    share = 2.0 * load / force  # each ring carries half of the force
    front = _ring(share * (1.0 + lever), angle, alpha, jaws)
    rear = _ring(-share * lever, angle, alpha, jaws)
    return floats(give_um * (front * (1.0 + lever) - rear * lever))


def bending_um(load_n: ArrayLike, overhang_mm: ArrayLike, diameter_mm: ArrayLike, youngs_gpa: float) -> Floats:
    """Return the deflection of a solid bar as a cantilever, um; broadcast shapes."""
    load, a, d = (floats(each) for each in (load_n, overhang_mm, diameter_mm))
    inertia_mm4 = math.pi * d**4 / 64
    return floats(load * a**3 / (3 * youngs_gpa * inertia_mm4))  # N mm^3 / (GPa mm^4) is um


def _ring(share: Floats, angle_deg: Floats, alpha: float, jaws: int) -> Floats:
    """Return the deflection of one ring along its load in units of x0; `share` is the load over a jaw's force."""
    unit = Contact(jaws=jaws, stiffness_n_per_um=1.0 / (1.0 - alpha), force_per_jaw_n=1.0, alpha=alpha)
    return deflection(unit, share, angle_deg).along_um
