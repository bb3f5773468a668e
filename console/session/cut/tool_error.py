"""Fit the error of the tool against its plan, from all polls of the feed: mean, slope, decay, harmonics.

Model of the error e_i, um, infeed positive, at the spindle angle t_i (turns) and the place z_i along the cut:

e_i = mean + slope z_i + sum_k d_k D_k(t_i) + sum_n Re(c_n exp(2 pi j n t_i))

z runs from -1/2 to 1/2 over the stretch, so `slope_um` is the change over the whole of it. D_k decays over some
turns from the first poll on, and has no mean: `mean_um` is the mean of all polls. Nothing is compared with other
turns: an error that is the same from the first turn to the last is in `mean_um` and the harmonics.

Neighbouring polls are not independent. With the correlation r of neighbouring residuals, M polls count as
M (1 - r) / (1 + r), and the standard errors grow by the root of that ratio.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from profiles.arrays import Floats
from profiles.least_squares import Fit, fit, harmonic_columns, harmonic_slice, phasors

ENTRY_TURNS = (3.0, 12.0)  # a tool that meets the part yields over so many turns: guides, then loop
LEAST_POLLS = 16
POLLS_A_TERM = 2.0
MOST_ORDER = 15
SURE = 2.0
"""Coverage factor: standard errors on either side, 95 %."""

WORTH_TELLING = 3.0  # standard errors from which a harmonic is more than scatter
MOST_CONDITION = 50.0  # beyond it two terms are nearly the same at the polled angles


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolError:
    """Error of the tool over a cut, um, and the standard error of each figure (`_se_um`).

    `slope_um` is the change from the first poll to the last, the decay apart; `decay_um` what of the error at the
    first poll decays. `orders` are amplitudes with phase, Re(c exp(j n angle)). `polls` were fitted, and count as
    `independent`.
    """

    mean_um: float
    mean_se_um: float
    slope_um: float
    slope_se_um: float
    decay_um: float
    decay_se_um: float
    orders: Mapping[int, complex]
    orders_se_um: Mapping[int, float]
    polls: int
    independent: float

    @property
    def counted(self) -> tuple[int, ...]:
        """Orders of 2 and more that stand out from the scatter; of once a turn the part is only eccentric."""
        return tuple(
            n for n, each in self.orders.items() if n >= 2 and abs(each) > WORTH_TELLING * self.orders_se_um[n]
        )

    @property
    def roundness_um(self) -> float:
        """Height, peak to peak, of all counted orders together: what the tool takes of the roundness."""
        angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
        height = sum(
            (np.real(self.orders[n] * np.exp(1j * n * angle)) for n in self.counted), np.zeros_like(angle)
        )
        return float(np.ptp(height))

    @property
    def roundness_within_um(self) -> float:
        """Uncertainty of `roundness_um`; without a counted order that of the least certain one."""
        errors = [self.orders_se_um[n] for n in self.counted]
        worst = max((each for n, each in self.orders_se_um.items() if n >= 2), default=math.inf)
        return 2.0 * SURE * (math.hypot(*errors) if errors else worst)

    @property
    def size_um(self) -> float:
        """Largest error of the diameter along the stretch: twice the mean error with half of the slope."""
        return 2.0 * (abs(self.mean_um) + 0.5 * abs(self.slope_um))

    @property
    def size_within_um(self) -> float:
        """Uncertainty of `size_um`."""
        return 2.0 * SURE * math.hypot(self.mean_se_um, 0.5 * self.slope_se_um)


def fit_tool_error(turns: Floats, places: Floats, error_um: Floats, lobes: int) -> ToolError | None:
    """Return the error of a tool from its polls, shape (M,) each; None where they do not support the `lobes`.

    `places` are along the cut, in any unit. As many orders are fitted as there are polls for, from 1 up, and not
    those that so few angles cannot tell from each other.
    """
    if len(turns) < LEAST_POLLS or np.ptp(places) == 0.0:
        return None
    from_first = np.abs(turns - turns[0])
    slope = (places - places.mean()) / np.ptp(places)
    decays = [np.exp(-from_first / over) for over in ENTRY_TURNS if from_first[-1] >= 4.0 * over]
    trends = [slope, *(each - each.mean() for each in decays)]
    most = min(MOST_ORDER, int((len(turns) / POLLS_A_TERM - 1 - len(trends)) // 2))
    for last in range(most, max(lobes, 2) - 1, -1):
        orders = range(1, last + 1)
        found = fit(harmonic_columns(2.0 * np.pi * turns, orders, *trends), error_um)
        if found.condition < MOST_CONDITION:
            return _told(found, trends, orders)
    return None


def _told(found: Fit, trends: list[Floats], orders: range) -> ToolError:
    left, count = found.residuals, len(found.residuals)
    squares = float(left @ left)
    alike = min(max(float(left[1:] @ left[:-1]) / squares, 0.0), 0.95) if squares > 0.0 else 0.0
    independent = count * (1.0 - alike) / (1.0 + alike)
    wider = math.sqrt(count / independent)

    def se_along(*terms: tuple[int, float]) -> float:
        direction = np.zeros(len(found.coefficients))
        for place, weight in terms:
            direction[place] = weight
        return wider * found.sd_along(direction)

    begins = [(2 + number, float(each[0] - each[-1])) for number, each in enumerate(trends[1:])]
    pairs = {n: harmonic_slice(place, len(trends)) for place, n in enumerate(orders)}
    return ToolError(
        mean_um=float(found.coefficients[0]),
        mean_se_um=se_along((0, 1.0)),
        slope_um=float(found.coefficients[1]),
        slope_se_um=se_along((1, 1.0)),
        decay_um=sum(weight * float(found.coefficients[place]) for place, weight in begins),
        decay_se_um=se_along(*begins),
        orders=phasors(found.coefficients, orders, len(trends)),
        orders_se_um={
            n: max(se_along((pair.start, 1.0)), se_along((pair.start + 1, 1.0))) for n, pair in pairs.items()
        },
        polls=count,
        independent=independent,
    )
