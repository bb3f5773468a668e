"""Small functions that draw: lines, texts, axes with ticks, as inline SVG. Lengths are in units of the picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from console.report.markup import Attribute, Markup, element

INK, GREY, PALE, ACCENT = "#1a1a1a", "#6b6b6b", "#c9c9c9", "#0b3d91"
DASHED = "6 4"
FONT = 13
_STEPS = (1.0, 2.0, 5.0, 10.0)

Point = tuple[float, float]


def picture(name: str, size: tuple[float, float], title: str, description: str, *parts: str) -> Markup:
    """Return a drawing that a screen reader can read out; `name` is the beginning of its ids."""
    width, height = size
    return element(
        "svg",
        element("title", title, id=f"{name}-title"),
        element("desc", description, id=f"{name}-desc"),
        *parts,
        viewBox=f"0 0 {width:g} {height:g}",
        role="img",
        aria_labelledby=f"{name}-title {name}-desc",
        font_size=FONT,
    )


def figure(drawing: Markup, caption: str, style: str | None = None) -> Markup:
    """Return a drawing with its caption; it is never split over pages."""
    return element("figure", drawing, element("figcaption", caption), class_=style)


def line(start: Point, end: Point, stroke: str = PALE, width: float = 1.0, dash: str | None = None) -> Markup:
    """Return a straight line."""
    (x1, y1), (x2, y2) = start, end
    return element("line", x1=x1, y1=y1, x2=x2, y2=y2, stroke=stroke, stroke_width=width, stroke_dasharray=dash)


def path(
    points: Iterable[Point],
    stroke: str = INK,
    width: float = 1.5,
    dash: str | None = None,
    *,
    closed: bool = False,
) -> Markup:
    """Return a line through points; what is not a number leaves a gap."""
    data, pen = [], "M"
    for x, y in points:
        if not (math.isfinite(x) and math.isfinite(y)):
            pen = "M"
            continue
        data.append(f"{pen}{x:.2f} {y:.2f}")
        pen = "L"
    if closed and data:
        data.append("Z")
    shape = "".join(data)
    return element("path", d=shape, fill="none", stroke=stroke, stroke_width=width, stroke_dasharray=dash)


def circle(centre: Point, radius: float, **attributes: Attribute) -> Markup:
    """Return a circle."""
    return element("circle", cx=centre[0], cy=centre[1], r=radius, **attributes)


def label(at: Point, words: str, anchor: str = "middle", fill: str = INK, **attributes: Attribute) -> Markup:
    """Return a text; a white rim keeps it readable on lines."""
    return element(
        "text",
        words,
        x=at[0],
        y=at[1],
        text_anchor=anchor,
        fill=fill,
        stroke="#fff",
        stroke_width=3,
        paint_order="stroke",
        **attributes,
    )


def step_125(least: float) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that is not below a value above 0."""
    power = 10.0 ** math.floor(math.log10(least))
    return next(step * power for step in _STEPS if step * power >= least * (1.0 - 1e-9))


def ticks(low: float, high: float, most: int = 6) -> tuple[float, ...]:
    """Return round values within a range, at most as many."""
    step = step_125((high - low) / most)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return tuple(step * place for place in range(first, last + 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """A frame in a picture, and the ranges of its two axes."""

    left: float = 62.0
    top: float = 10.0
    width: float = 398.0
    height: float = 150.0
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Size of the picture, with room for numbers and names."""
        return self.left + self.width + 12.0, self.top + self.height + 40.0

    def point_at(self, x: float, y: float) -> Point:
        """Return the place of a point."""
        (x_low, x_high), (y_low, y_high) = self.x_range, self.y_range
        return (
            self.left + self.width * (x - x_low) / (x_high - x_low),
            self.top + self.height * (y_high - y) / (y_high - y_low),
        )

    def level(self, y: float, stroke: str, width: float = 1.5, dash: str | None = None) -> Markup:
        """Return a line across the frame."""
        return line(self.point_at(self.x_range[0], y), self.point_at(self.x_range[1], y), stroke, width, dash)


def frame(axes: Axes, names: tuple[str, str], x_ticks: Sequence[float], y_ticks: Sequence[float]) -> list[Markup]:
    """Return grid, numbers and the names of the axes."""
    bottom, drawn = axes.top + axes.height, []
    for y in y_ticks:
        left, height = axes.point_at(axes.x_range[0], y)
        drawn += [axes.level(y, PALE, 0.75), label((left - 6.0, height + 4.0), f"{y:zg}", "end")]
    for x in x_ticks:
        place, _ = axes.point_at(x, axes.y_range[0])
        drawn += [
            line((place, bottom), (place, bottom + 4.0), GREY),
            label((place, bottom + 17.0), f"{x:zg}"),
        ]
    drawn.append(
        element(
            "rect",
            x=axes.left,
            y=axes.top,
            width=axes.width,
            height=axes.height,
            fill="none",
            stroke=GREY,
        )
    )
    drawn.append(label((axes.left + axes.width / 2.0, bottom + 34.0), names[0]))
    middle = axes.top + axes.height / 2.0
    drawn.append(label((13.0, middle), names[1], transform=f"rotate(-90 13 {middle:g})"))
    return drawn
