"""What becomes of the path of the tool in the surface: the part gives way to the cut, and not all motion arrives.

The passive force presses the part away from the tool, between the jaws further than at them: with the compliance
c and k newtons for each mm that is cut, a tip at the depth d cuts d / (1 + c k), and leaves the rest. Of the
motion of tip and work against each other about its mean, only the process gain is found in the surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class CutProcess:
    """How one clamped part is cut.

    `gain` is the fraction of the motion that arrives. The part gives way by `compliance_mm_per_n` in the mean, by
    the fraction `softer_between` less at the jaws and more between them, to a passive force of `n_per_mm` for each
    mm of depth.
    """

    jaws: int = 3
    jaw_1_deg: float = 0.0
    gain: float = 1.0
    compliance_mm_per_n: float = 0.0
    softer_between: float = 0.0
    n_per_mm: float = 0.0

    @property
    def yields(self) -> bool:
        """Whether the part gives way to the cut."""
        return self.compliance_mm_per_n * self.n_per_mm > 0.0

    def compliance_at(self, turns: Floats) -> Floats:
        """Return the compliance before the tool, mm/N, at these turns of the spindle from its index."""
        past_jaw = 2.0 * math.pi * turns - math.radians(self.jaw_1_deg)
        softer = 1.0 - self.softer_between * np.cos(self.jaws * past_jaw)
        return np.asarray(self.compliance_mm_per_n * softer, dtype=np.float64)

    def compliances(self, places: int) -> tuple[float, ...]:
        """Return the compliance in so many places from the spindle index; nothing of a part that is rigid."""
        return tuple(self.compliance_at((np.arange(places) + 0.5) / places).tolist()) if self.yields else ()

    def left_mm(self, turns: Floats, depth_mm: Floats) -> Floats:
        """Return how much of the depth from the surface to the tip is not cut, because the part gives way."""
        given = self.compliance_at(turns) * self.n_per_mm
        return np.asarray(np.maximum(depth_mm, 0.0) * given / (1.0 + given), dtype=np.float64)

    def arrived_mm(self, radius_mm: Floats, cut: NDArray[np.bool_]) -> Floats:
        """Return the surface where it was `cut` to `radius_mm`, all round; elsewhere it is as it was."""
        if self.gain == 1.0 or not cut.any():
            return radius_mm
        mean_mm = float(radius_mm[cut].mean())
        return np.where(cut, mean_mm + self.gain * (radius_mm - mean_mm), radius_mm)


ALL_ARRIVES = CutProcess()
