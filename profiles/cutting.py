"""The force of a cut, how it copies an earlier error, and the width of cut at which it chatters.

Forces in N, lengths in mm, stiffness in N/um unless a name says otherwise. Kienzle's law with the groups of
VDI 3323; below a chip of 0.02 mm the force of the edge comes in. All of it is good to about 50 % for the small
cuts of finishing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from profiles.materials import Material

PASSIVE_FRACTION = 0.4  # radial force over main cutting force: 0.3 to 0.5 for a sharp tool square to the axis
FEED_FRACTION = 0.4  # axial force over main cutting force; no better value is known for a finishing cut
THIN_CHIP_MM = 0.02
EDGE_N_PER_MM = 7.5  # edge force at zero chip thickness, per mm of width: the middle of 5 to 10
NEAR_A_MODE = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingForce:
    """Main (tangential), passive (radial, pushes tool and part apart) and axial force; all positive, in N."""

    main_n: float
    passive_n: float
    feed_n: float

    @property
    def in_plane_n(self) -> float:
        """The force on the part across its axis: main and passive force together."""
        return math.hypot(self.main_n, self.passive_n)


def cutting_force(
    material: Material,
    depth_mm: float,
    feed_mm_per_rev: float,
    *,
    passive_fraction: float = PASSIVE_FRACTION,
    edge_n_per_mm: float = EDGE_N_PER_MM,
) -> CuttingForce:
    """Return F_c = kc1.1 b h^(1 - mc) and its components, of a tool square to the axis: b = ap, h = f.

    Below `THIN_CHIP_MM` the force of the edge is added, growing from nothing there to all of it at no feed.
    """
    main_n: float = material.kc1_n_per_mm2 * depth_mm * feed_mm_per_rev ** (1 - material.chip_exponent)
    main_n += edge_n_per_mm * depth_mm * max(0.0, 1 - feed_mm_per_rev / THIN_CHIP_MM)
    return CuttingForce(main_n=main_n, passive_n=passive_fraction * main_n, feed_n=FEED_FRACTION * main_n)


def radial_cutting_stiffness_n_per_mm2(material: Material, feed_mm_per_rev: float) -> float:
    """Return K_r: the additional passive force per mm of chip thickness and mm of width.

    Taken as the secant kc1.1 h^-mc of Kienzle's law, times the passive fraction.
    """
    return float(PASSIVE_FRACTION * material.kc1_n_per_mm2 * feed_mm_per_rev**-material.chip_exponent)


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorCopying:
    """How far a cut copies earlier errors: mu = Ks / k of the loop of tool, part and chuck in series."""

    stiffness_ratio: float

    def fraction_left(self) -> float:
        """Return the fraction of an earlier error left after a pass: mu / (1 + mu)."""
        return self.stiffness_ratio / (1 + self.stiffness_ratio)


def copying(cut_n_per_um: float, loop_n_per_um: float) -> ErrorCopying:
    """Return the copying of a cut of stiffness dF_p / d ap in a loop of the other stiffness, both N/um."""
    return ErrorCopying(stiffness_ratio=cut_n_per_um / loop_n_per_um)


def chatter_limit_mm(stiffness_n_per_um: float, damping_ratio: float, radial_n_per_mm2: float) -> float:
    """Return the width of cut below which no lobe of one mode chatters: b = 2 k zeta (1 + zeta) / K_r."""
    return 2000 * stiffness_n_per_um * damping_ratio * (1 + damping_ratio) / radial_n_per_mm2


def nearest_mode(lobe_frequency_hz: float, modes_hz: Sequence[float]) -> tuple[int, float] | None:
    """Return (multiple, mode in Hz) of the first of 1, 2, 3 times the lobe within 10 % of a mode, else None."""
    for multiple in (1, 2, 3):
        for mode_hz in modes_hz:
            if abs(multiple * lobe_frequency_hz / mode_hz - 1) <= NEAR_A_MODE:
                return multiple, mode_hz
    return None
