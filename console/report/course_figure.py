"""A quantity over the turns of a cut, and the parts of a job one after the other, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from console.report.drawing import (
    ACCENT,
    DASHED,
    GREY,
    INK,
    Axes,
    circle,
    frame,
    label,
    line,
    path,
    picture,
    ticks,
)
from console.report.markup import Markup
from console.session.learning.job_chart import JobChart
from profiles.arrays import Floats

MOST_DOTS = 500
"""Samples that are drawn one by one; of more, the lowest and the highest of each stretch."""

STRETCHES = 200


def course_figure(
    name: str,
    title: str,
    description: str,
    names: tuple[str, str],
    turn: Floats,
    value: Floats,
    *,
    nominal: float,
    least_reach: float,
    joined: bool,
) -> Markup:
    """Return a quantity of M samples over the turns, shape (M,) each.

    A dashed line is at its nominal value, and the scale reaches at least so far from there. Samples are `joined`
    where they are close enough to be a course, else dots.
    """
    low = min(float(value.min()), nominal - least_reach)
    high = max(float(value.max()), nominal + least_reach)
    room = 0.05 * (high - low)
    last = max(float(turn[-1]), float(turn[0]) + 1.0)
    beside = 0.02 * (last - float(turn[0]))
    axes = Axes(x_range=(float(turn[0]) - beside, last + beside), y_range=(low - room, high + room))
    drawn = frame(axes, names, ticks(*axes.x_range, 8), ticks(*axes.y_range))
    drawn.append(axes.level(nominal, GREY, 1.5, DASHED))
    if joined:
        points = [axes.point_at(*pair) for pair in zip(turn.tolist(), value.tolist(), strict=True)]
        drawn.append(path(points, ACCENT))
    else:
        drawn += _samples(axes, turn, value)
    return picture(name, axes.size, title, description, *drawn)


def _samples(axes: Axes, turn: Floats, value: Floats) -> list[Markup]:
    if turn.size <= MOST_DOTS:
        pairs = zip(turn.tolist(), value.tolist(), strict=True)
        return [circle(axes.point_at(*pair), 1.8, fill=ACCENT) for pair in pairs]
    drawn = []
    for stretch in np.array_split(np.arange(turn.size), STRETCHES):
        x = float(turn[stretch].mean())
        low, high = float(value[stretch].min()), float(value[stretch].max())
        drawn.append(line(axes.point_at(x, low), axes.point_at(x, high), ACCENT, 1.5))
    return drawn


def chart_figure(
    name: str,
    title: str,
    description: str,
    names: tuple[str, str],
    chart: JobChart,
    own: Sequence[int],
) -> Markup:
    """Return parts in the order of manufacture; `own` are the places of this run."""
    values, limit, limits = chart.values_um, chart.upper_um, chart.limits
    high = max(*values, limit or 0.0, 0.0 if limits is None else limits.upper)
    axes = Axes(x_range=(0.5, len(values) + 0.5), y_range=(0.0, 1.08 * high or 1.0))
    x_ticks = [x for x in ticks(1.0, max(2.0, float(len(values))), 10) if x == round(x) and x <= len(values)]
    drawn = frame(axes, names, x_ticks, ticks(*axes.y_range))
    if limits is not None:
        drawn.append(axes.level(limits.mean, GREY, 1.0))
        drawn += [axes.level(each, GREY, 1.0, "2 3") for each in (limits.lower, limits.upper) if each > 0.0]
    if limit is not None:
        drawn.append(axes.level(limit, INK, 1.5, DASHED))
    points = [axes.point_at(place + 1.0, value) for place, value in enumerate(values)]
    drawn.append(path(points, GREY, 1.0))
    for place, point in enumerate(points):
        mine = place in own
        drawn.append(circle(point, 4.0 if mine else 2.5, fill=ACCENT if mine else "#fff", stroke=INK))
        if place in chart.places_beyond_limits:
            drawn.append(label((point[0], point[1] - 8.0), "!"))
    return picture(name, axes.size, title, description, *drawn)
