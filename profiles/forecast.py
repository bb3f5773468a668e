"""What is forecast of a part that is still to be cut: never less than a real lathe leaves.

A calculation ends where the model ends. Spindle, material and gauge leave some 2 um on any lathe, and what lies
below that is known once the part is measured. Calculated values stay as they are in records and in JSON; whatever
tells a person how round a part will be goes through `forecast_um`.
"""

from __future__ import annotations

LEAST_FORECAST_UM = 2.0


def forecast_um(calculated_um: float) -> float:
    """Return the roundness to forecast for a calculated one, um p-p."""
    return max(calculated_um, LEAST_FORECAST_UM)


def is_below_forecast(calculated_um: float) -> bool:
    """Whether less is calculated than may be forecast, which then is to be said."""
    return calculated_um < LEAST_FORECAST_UM
