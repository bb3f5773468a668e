"""A mass driven by a current amplifier: the slide of a linear motor, or the rotor of a spindle motor.

It is described in axis units, motor counts and DAC bits, so that one loop serves both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NO_DAMPING = 1e-6
"""Fraction of its speed that a mass loses in a servo cycle, below which the formulas with damping cancel out."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroOrderHold:
    """One servo cycle of a mass under a constant force, exact.

    With x in counts, v in counts/s and the force in DAC bits, at the end of the cycle
    x' = x + glide v + push_x force and v' = decay v + push_v force.
    """

    decay: float
    glide: float
    push_x: float
    push_v: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenMass:
    """A mass with viscous damping driven by a current amplifier, as in Eq 9 and Table 4 of the paper.

    `damping_per_s` is damping over mass, `acceleration_per_bit` in counts/s2. `friction` is the deceleration by
    Coulomb friction, in counts/s2, at any speed; at rest it holds against a force below it.
    """

    damping_per_s: float
    acceleration_per_bit: float
    peak_output_bits: float
    friction: float = 0.0

    def held(self, cycle_s: float) -> ZeroOrderHold:
        """Return its motion in a servo cycle of `cycle_s`, without the friction."""
        rate = self.damping_per_s
        if rate * cycle_s < NO_DAMPING:
            glide, push = cycle_s, 0.5 * cycle_s**2
        else:
            glide = -math.expm1(-rate * cycle_s) / rate
            push = (cycle_s - glide) / rate
        return ZeroOrderHold(
            decay=math.exp(-rate * cycle_s),
            glide=glide,
            push_x=push * self.acceleration_per_bit,
            push_v=glide * self.acceleration_per_bit,
        )


def linear_motor(
    *,
    mass_kg: float,
    damping_n_s_per_m: float,
    force_n_per_bit: float,
    peak_output_bits: float,
    counts_per_m: float,
    friction_n: float = 0.0,
) -> DrivenMass:
    """Return the slide of a linear motor."""
    return DrivenMass(
        damping_per_s=damping_n_s_per_m / mass_kg,
        acceleration_per_bit=force_n_per_bit / mass_kg * counts_per_m,
        peak_output_bits=peak_output_bits,
        friction=friction_n / mass_kg * counts_per_m,
    )


def rotary_motor(
    *,
    inertia_kg_m2: float,
    drag_n_m_s_per_rad: float,
    torque_n_m_per_bit: float,
    peak_output_bits: float,
    counts_per_turn: float,
    friction_n_m: float = 0.0,
) -> DrivenMass:
    """Return the rotor of a torque motor."""
    counts_per_rad = counts_per_turn / (2.0 * math.pi)
    return DrivenMass(
        damping_per_s=drag_n_m_s_per_rad / inertia_kg_m2,
        acceleration_per_bit=torque_n_m_per_bit / inertia_kg_m2 * counts_per_rad,
        peak_output_bits=peak_output_bits,
        friction=friction_n_m / inertia_kg_m2 * counts_per_rad,
    )
