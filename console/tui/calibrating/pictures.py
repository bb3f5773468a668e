"""Plots of a calibration of the chuck: the fit with its 95 % limits and its points, and the residuals."""

from __future__ import annotations

import numpy as np

from console.tui.calibrating.chuck_facts import ChuckFacts
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Mark, Series, TracePicture
from console.tui.theme import Token
from console.units import METRIC, Units
from profiles.arrays import Floats, floats
from profiles.calibration.deflection import DeflectionFit
from profiles.calibration.wrench import WrenchFit

POINT, OUTLIER = "•", "✗"
_CURVE = 60
Pictures = tuple[TracePicture, TracePicture]


def pictures(facts: ChuckFacts, units: Units = METRIC) -> Pictures:
    """Return the fit, and the residuals; empty ones where there is nothing to draw."""
    if isinstance(facts.fit, WrenchFit):
        return _wrench(facts.fit, facts)
    if isinstance(facts.fit, DeflectionFit) and facts.measured is not None:
        return _deflection(facts.fit, facts, units)
    return TracePicture(), TracePicture()


def _wrench(fit: WrenchFit, facts: ChuckFacts) -> Pictures:
    """Force over torque: the line, its limits, those of one clamping, and the clampings."""
    torque = np.linspace(0.0 if not fit.intercept_ci else fit.lowest_n_m, fit.highest_n_m, _CURVE)
    bands = [fit.line_n(float(each)) for each in torque]
    inside = torque[torque >= fit.lowest_n_m]
    of_one = [fit.force_n(float(each)) for each in inside]
    series = [
        Series(x=inside, y=[band.low for band in of_one], token=Token.DIM, dashed=True),
        Series(x=inside, y=[band.high for band in of_one], token=Token.DIM, dashed=True),
        Series(x=torque, y=[band.value for band in bands], token=Token.AFTER),
    ]
    highest = max(band.high for band in of_one)
    x, y, left = floats([]), floats([]), floats([])
    if facts.measured is not None:
        x, y = facts.measured.columns["torque_n_m"], facts.measured.columns["force_n"]
        left = floats(y - fit.intercept_n - fit.slope_n_per_n_m * x)
        highest = max(highest, float(y.max()))
    x_limits = nice_limits(0.0, fit.highest_n_m)
    of_fit = TracePicture(
        series=series,
        x_limits=x_limits,
        y_limits=nice_limits(0.0, highest),
        y_unit="N",
        x_unit="N m",
        marks=_marks(x, y, fit.outliers),
    )
    return of_fit, _residuals(x, left, fit.outliers, "N", "N m", x_limits)


def _deflection(fit: DeflectionFit, facts: ChuckFacts, units: Units) -> Pictures:
    """Measured deflection over the fitted one; on the line they are the same."""
    assert facts.measured is not None  # ensured by the caller
    size, unit = units.size("um"), units.unit("um")
    modelled = floats(fit.deflections_um(facts.measured.columns) / size)
    y = floats(facts.measured.columns["deflection_um"] / size)
    limits = nice_limits(0.0, float(max(modelled.max(), y.max())))
    of_fit = TracePicture(
        series=[Series(x=limits, y=limits, token=Token.AFTER)],
        x_limits=limits,
        y_limits=limits,
        y_unit=unit,
        x_unit=unit,
        marks=_marks(modelled, y, fit.outliers),
    )
    return of_fit, _residuals(modelled, floats(y - modelled), fit.outliers, unit, unit, limits)


def _residuals(
    x: Floats, left: Floats, outliers: tuple[int, ...], y_unit: str, x_unit: str, x_limits: tuple[float, float]
) -> TracePicture:
    if not x.size:
        return TracePicture()
    most = max(float(np.abs(left).max()), 1e-9)
    return TracePicture(
        series=[Series(x=x_limits, y=(0.0, 0.0), token=Token.RING)],
        x_limits=x_limits,
        y_limits=nice_limits(-most, most),
        y_unit=y_unit,
        x_unit=x_unit,
        marks=_marks(x, left, outliers),
    )


def _marks(x: Floats, y: Floats, outliers: tuple[int, ...]) -> list[Mark]:
    out = np.isin(np.arange(x.size), outliers)
    marks = [Mark(x=x[~out], y=y[~out], sign=POINT, token=Token.BEFORE)]
    return [*marks, Mark(x=x[out], y=y[out], sign=OUTLIER, token=Token.WARNING)]
