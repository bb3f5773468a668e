"""How the tool follows a trim: the nominal response, corrected by what the batches of this cut have shown.

Dry friction holds a small motion back, more at one amplitude than at another. So a trim by the nominal response
may remove a third of an error instead of most of it. From batch to batch the error changes by -R dt, dt the
change of the trim: R is the nominal response times a factor, found by least squares, with what is expected of
friction as one observation more. It stays within bounds, so that a batch which something else has changed does no
harm.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

FACTOR_SD = 0.5  # of the factor from 1, before anything was seen; assumed
CHANGES_SD_UM = 0.3  # of an error from batch to batch, with the same trim; assumed
MOST_CHANGE_UM = 1.0  # of an error beyond what the nominal response explains: the tool has come into the part
LEAST_FACTOR, MOST_FACTOR, MOST_TURN_DEG = 0.3, 1.5, 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrimResponse:
    """The response of the tool to a trim at one order; `squares` and `products` are the sums of least squares.

    `trim_um` and `error_um` are those of the last batch, None before the first.
    """

    nominal: complex
    squares: float = (CHANGES_SD_UM / FACTOR_SD) ** 2
    products: complex = (CHANGES_SD_UM / FACTOR_SD) ** 2 + 0j
    trim_um: complex = 0j
    error_um: complex | None = None

    @property
    def value(self) -> complex:
        """The response, within its bounds of the nominal one."""
        factor = self.products / self.squares
        height = min(max(abs(factor), LEAST_FACTOR), MOST_FACTOR)
        most = math.radians(MOST_TURN_DEG)
        return self.nominal * cmath.rect(height, min(max(cmath.phase(factor), -most), most))

    def add_batch(self, trim_um: complex, error_um: complex) -> TrimResponse:
        """Return the response after a batch with this trim and this error."""
        after = replace(self, trim_um=trim_um, error_um=error_um)
        if self.error_um is None:
            return after
        moved, less = self.nominal * (trim_um - self.trim_um), self.error_um - error_um
        if abs(less) > MOST_FACTOR * abs(moved) + MOST_CHANGE_UM:
            return after
        return replace(
            after, squares=self.squares + abs(moved) ** 2, products=self.products + moved.conjugate() * less
        )
