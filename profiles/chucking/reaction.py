"""Eqs 1 to 3 of the paper: the reaction of the chuck as a Fourier series, and the depth of cut that follows.

Eq 1: F(t) = N a0 q_0 / 2 + N sum q_n (a_n cos n N w t + b_n sin n N w t), with q_0 = r/R and q_n = (r/R)^(p_n).
Eq 2: M x'' + B x' + K x = F.
Steady state with all harmonics, W_n = n N w, D_n = sqrt((K - M W_n^2)^2 + (B W_n)^2),
psi_n = atan2(B W_n, K - M W_n^2):

    x = N a0 q_0 / (2 K) + sum N q_n (a_n cos(W_n t - psi_n) + b_n sin(W_n t - psi_n)) / D_n

The change of the depth of cut is x(R) - x(r). Eq 3 as printed is the first harmonic at resonance,
(N w)^2 = K / M. The paper writes (r/R)^(2n) in Eq 1 and (r/R)^N in Eq 3; a harmonic field of order m decays as
r^m, so that p_n = N n is consistent, and the exponent stays a parameter. Forces in N, x in um, + into the work.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """Chuck and part as one mass on a spring. `a_n` begins with a0, `b_n` with b1; even symmetry makes b_n 0.

    `exponent` is p_1 of (r/R)^(p_n), p_n = n p_1; None is the number of jaws.
    """

    mass_kg: float
    damping_n_s_per_m: float
    stiffness_n_per_m: float
    jaws: int
    a_n: tuple[float, ...]
    b_n: tuple[float, ...] = ()
    exponent: float | None = None

    @property
    def decay_exponent(self) -> float:
        """p_1, the power of r/R with which the first harmonic decays towards the axis."""
        return self.jaws if self.exponent is None else self.exponent


@dataclass(frozen=True, slots=True, kw_only=True)
class ForcedHarmonic:
    """One harmonic of the steady state: cos_um cos(n N angle) + sin_um sin(n N angle), lag included.

    `dynamic_n_per_m` is D_n, `lag_rad` is psi_n.
    """

    n: int
    dynamic_n_per_m: float
    lag_rad: float
    cos_um: float
    sin_um: float

    @property
    def amplitude_um(self) -> float:
        """Half of the peak-to-peak motion."""
        return math.hypot(self.cos_um, self.sin_um)


def forced_harmonics(
    reaction: Reaction, spindle_speed_rpm: float, radius_ratio: float = 1.0
) -> tuple[ForcedHarmonic, ...]:
    """Return the steady state of Eq 2 under Eq 1, harmonic by harmonic from n = 1; `radius_ratio` is r/R."""
    return tuple(
        _harmonic(reaction, n, spindle_speed_rpm, radius_ratio)
        for n in range(1, max(len(reaction.a_n) - 1, len(reaction.b_n)) + 1)
    )


def _harmonic(reaction: Reaction, n: int, rpm: float, radius_ratio: float) -> ForcedHarmonic:
    omega = n * reaction.jaws * 2 * math.pi * rpm / 60
    spring = reaction.stiffness_n_per_m - reaction.mass_kg * omega**2
    dash = reaction.damping_n_s_per_m * omega
    stiffness, lag = math.hypot(spring, dash), math.atan2(dash, spring)
    even_n = reaction.a_n[n] if n < len(reaction.a_n) else 0.0
    odd_n = reaction.b_n[n - 1] if n <= len(reaction.b_n) else 0.0
    scale = 1e6 * reaction.jaws * radius_ratio ** (n * reaction.decay_exponent) / stiffness
    return ForcedHarmonic(
        n=n,
        dynamic_n_per_m=stiffness,
        lag_rad=lag,
        cos_um=scale * (even_n * math.cos(lag) - odd_n * math.sin(lag)),
        sin_um=scale * (even_n * math.sin(lag) + odd_n * math.cos(lag)),
    )


def eq3_um(reaction: Reaction, spindle_speed_rpm: float, angle_deg: ArrayLike, radius_ratio: float) -> Floats:
    """Return Eq 3 as printed, valid at resonance and for the first harmonic only.

    N a0 (1 - r/R) / (2 K) + (1 - (r/R)^p) (a1 sin N w t - b1 cos N w t) / (w B). Far below its resonance, where
    chucks work, it overstates the lobe by 1 / (2 zeta) and turns it by a quarter of a lobe.
    """
    phase = reaction.jaws * np.radians(floats(angle_deg))
    omega = 2 * math.pi * spindle_speed_rpm / 60
    mean = reaction.jaws * reaction.a_n[0] * (1 - radius_ratio) / (2 * reaction.stiffness_n_per_m)
    b1 = reaction.b_n[0] if reaction.b_n else 0.0
    lobe = (reaction.a_n[1] * np.sin(phase) - b1 * np.cos(phase)) / (omega * reaction.damping_n_s_per_m)
    return floats(1e6 * (mean + lobe * (1 - radius_ratio**reaction.decay_exponent)))


def amplification(frequency_ratio: float, damping_ratio: float) -> tuple[float, float]:
    """Return (gain over the static deflection, lag in deg) of one mode at f / f_n."""
    spring, dash = 1 - frequency_ratio**2, 2 * damping_ratio * frequency_ratio
    return 1 / math.hypot(spring, dash), math.degrees(math.atan2(dash, spring))
