"""Text and picture of the health tests: their trend, one with its figures, and what a test is about to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from console.session.data.health import KeptHealth
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim, fit_text, hanging, line, to_the_right, wrap_line
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Series, TracePicture
from console.tui.rows import problem_lines
from console.tui.theme import Token
from console.units import METRIC, Units
from drivers.identification.health import FIGURES, HealthResult, figures_of, model_figures_of
from profiles.files import printable

NOTHING = "–"
DATE = len("2001-11-30 14:05")
TREND = ("rise_ms", "overshoot_percent", "settling_ms", "rms_um", "sine_gain", "sine_phase_deg")
VALUE_WIDTH, LABEL_WIDTH = 10, 24
CARRIAGE_WAY_MM = 50.0  # of an identification along the carriage, about


def trend_lines(
    tests: Sequence[KeptHealth], selected: int, text: Catalogue, width: int, height: int
) -> list[Line]:
    """Return one row for each test, the newest first, below the names of the figures."""
    if not tests:
        return wrap_line(text("tune_page.no_tests"), width, Token.DIM)
    heads = "".join(to_the_right(text(f"tune_page.trend.{key}"), VALUE_WIDTH) for key in TREND)
    lines: list[Line] = [line(dim(fit_text(f"  {' ' * DATE}{heads}", width)))]
    room = max(height - 1, 1)
    first = max(min(selected - room // 2, len(tests) - room), 0)
    for place, test in list(enumerate(tests))[first : first + room]:
        mark = ("▶ ", Token.ACTION) if place == selected else dim("  ")
        lines.append((mark, (fit_text(_trend_row(test, text), max(width - 2, 0)), Token.TEXT)))
    return lines


def _trend_row(test: KeptHealth, text: Catalogue) -> str:
    if test.result is None:
        return f"{printable(test.file.name, 30)}  {text('tune_page.unreadable')}"
    found = figures_of(test.result)
    values = (_figure(found, key, text) for key in TREND)
    date = printable(test.result.date.replace("T", " ")[:DATE])
    return fit_text(date, DATE) + "".join(to_the_right(value, VALUE_WIDTH) for value in values)


def figure_lines(test: KeptHealth | None, before: HealthResult | None, text: Catalogue, width: int) -> list[Line]:
    """Return the figures of a test beside those of the model, and of the test before."""
    if test is None:
        return []
    if test.result is None:
        return problem_lines(test.problems, text, width)
    found, model = figures_of(test.result), model_figures_of(test.result)
    last = {} if before is None else figures_of(before)
    label = max(min(LABEL_WIDTH, width - 3 * VALUE_WIDTH), 8)
    heads = "".join(
        to_the_right(text(f"health.column.{name}"), VALUE_WIDTH) for name in ("measured", "model", "before")
    )
    lines: list[Line] = [line(dim(" " * label + heads))]
    for key in FIGURES:
        own, *others = (_figure(each, key, text) for each in (found, model, last))
        lines.append(
            line(
                dim(fit_text(text(f"health.{key}"), label)),
                to_the_right(own, VALUE_WIDTH),
                dim("".join(to_the_right(value, VALUE_WIDTH) for value in others)),
            )
        )
    legend = line(
        ("── ", Token.AFTER), text("tune_page.this_test"), dim("   ┄┄ "), dim(text("tune_page.other_lines"))
    )
    return [*lines, legend]


def _figure(figures: Mapping[str, float], key: str, text: Catalogue) -> str:
    """Return a figure in the unit that its label names; a dash where it was not measured."""
    size = text.units.size("um") if key.endswith("_um") else 1.0
    return f"{figures[key] / size:.4g}" if key in figures else NOTHING


def other_gain_lines(test: KeptHealth, stated: Mapping[str, float], text: Catalogue, width: int) -> list[Line]:
    """Return which gains of a test are not those of the profile, with those in brackets; nothing where none."""
    gains = {} if test.result is None else test.result.origin.gains
    names = [
        f"{name} {value:g} ({stated[name]:g})" for name, value in gains.items() if stated.get(name, value) != value
    ]
    shown = text("tune_page.other_gains", names=", ".join(names))
    return hanging(("! ", Token.WARNING), shown, width) if names else []


def step_picture(test: HealthResult | None, before: HealthResult | None, units: Units = METRIC) -> TracePicture:
    """Return the step: commanded, measured, and of the test before."""
    if test is None or not test.times_ms:
        return TracePicture()
    size = units.size("um")

    def trace(tested: HealthResult, values_um: Sequence[float], token: Token, *, dashed: bool = False) -> Series:
        return Series(x=tested.times_ms, y=[each / size for each in values_um], token=token, dashed=dashed)

    series = [trace(test, test.reference_um, Token.COMMAND, dashed=True)]
    if before is not None and before.step_um == test.step_um:
        series.append(trace(before, before.position_um, Token.DIM, dashed=True))
    series.append(trace(test, test.position_um, Token.AFTER))
    low = min(*test.position_um, *test.reference_um)
    high = max(*test.position_um, *test.reference_um)
    limits = (test.times_ms[0], test.times_ms[-1])
    y_limits = nice_limits(low / size, high / size)
    return TracePicture(series=series, x_limits=limits, y_limits=y_limits, y_unit=units.unit("um"), x_unit="ms")


def kind_lines(kind: str, text: Catalogue, width: int, *, step_um: float) -> list[Line]:
    """Return what a test of this kind does, before one was made."""
    step, way = text.units.show(step_um, "um", 0), text.units.show(CARRIAGE_WAY_MM, "mm", 0)
    return wrap_line(text(f"tune_page.will.{kind}", step=step, way=way), width, Token.DIM)


def armed_lines(kind: str, text: Catalogue, width: int, *, step_um: float, left_s: float) -> list[Line]:
    """Return what F6 will move, and how long it may still be pressed."""
    step, way = text.units.show(step_um, "um", 0), text.units.show(CARRIAGE_WAY_MM, "mm", 0)
    lines = hanging(("! ", Token.WARNING), text(f"tune_page.will.{kind}", step=step, way=way), width)
    lines += hanging(dim("  "), text("tune_page.will.stop"), width)
    return [*lines, *hanging(("▶ ", Token.ACTION), text("tune_page.will.start", seconds=f"{left_s:.0f}"), width)]
