"""Bars of the harmonics of one part or two, on a logarithmic scale."""

from __future__ import annotations

import math
from collections.abc import Sequence

from console.report.drawing import ACCENT, GREY, PALE, Axes, frame, label, picture
from console.report.markup import Markup, element
from profiles.roundness import RoundnessResult

LEAST_UM = 0.01
"""Foot of the bars: below it a harmonic is no more than noise of the gauge."""


def harmonics_figure(
    name: str,
    title: str,
    description: str,
    names: tuple[str, str],
    orders: Sequence[int],
    parts: Sequence[tuple[RoundnessResult, bool]],
) -> Markup:
    """Return the bars of some orders; `parts` are results, each with whether it is the product."""
    largest = max((each.amplitude_um(n) for each, _ in parts for n in orders), default=0.0)
    decades = max(2, math.ceil(math.log10(max(largest, LEAST_UM) / LEAST_UM)))
    axes = Axes(x_range=(orders[0] - 0.7, orders[-1] + 0.7), y_range=(0.0, float(decades)))
    drawn = frame(axes, names, [float(n) for n in orders], ())
    drawn += _decades(axes, decades)
    wide = axes.width / (len(orders) + 0.4) * 0.8 / max(len(parts), 1)
    for place, (result, product) in enumerate(parts):
        for n in orders:
            height = math.log10(max(result.amplitude_um(n), LEAST_UM) / LEAST_UM)
            (x, y), (_, foot) = axes.at(float(n), height), axes.at(float(n), 0.0)
            left = x + wide * (place - 0.5 * len(parts))
            drawn.append(_bar(left, y, wide - 1.0, foot - y, product=product))
    return picture(name, axes.size, title, description, *drawn)


def _decades(axes: Axes, decades: int) -> list[Markup]:
    drawn = []
    for decade in range(decades + 1):
        left, height = axes.at(axes.x_range[0], float(decade))
        drawn += [axes.level(float(decade), PALE, 0.75)]
        drawn += [label((left - 6.0, height + 4.0), f"{LEAST_UM * 10**decade:g}", "end")]
    return drawn


def _bar(left: float, top: float, width: float, height: float, *, product: bool) -> Markup:
    fill, stroke = (ACCENT, ACCENT) if product else ("#fff", GREY)
    return element(
        "rect", x=left, y=top, width=width, height=max(height, 0.0), fill=fill, stroke=stroke, stroke_width=1
    )
