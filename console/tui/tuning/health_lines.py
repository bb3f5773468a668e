"""Text and picture of the health tests: their trend, one with its figures, and what a test is about to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from console.session.data.health import KeptHealth
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim, fitted, hanging, line, to_the_right, wrapped
from console.tui.plot.frame import nice_limits
from console.tui.plot.trace_view import Series, TracePicture
from console.tui.theme import Token
from console.tui.tuning.problem_lines import problem_lines
from drivers.identification.health_result import FIGURES, HealthResult, figures_of, model_figures_of
from profiles.files import printable

NOTHING = "–"
DATE = len("2001-11-30 14:05")
TREND = ("rise_ms", "overshoot_percent", "settling_ms", "rms_um", "sine_gain", "sine_phase_deg")
VALUE_WIDTH, LABEL_WIDTH = 10, 24


def trend_lines(
    tests: Sequence[KeptHealth], selected: int, text: Catalogue, width: int, height: int
) -> list[Line]:
    """Return one row for each test, the newest first, below the names of the figures."""
    if not tests:
        return wrapped(text("tune_page.no_tests"), width, Token.DIM)
    heads = "".join(to_the_right(text(f"tune_page.trend.{key}"), VALUE_WIDTH) for key in TREND)
    lines: list[Line] = [line(dim(fitted(f"  {' ' * DATE}{heads}", width)))]
    room = max(height - 1, 1)
    first = max(min(selected - room // 2, len(tests) - room), 0)
    for place, test in list(enumerate(tests))[first : first + room]:
        mark = ("▶ ", Token.ACTION) if place == selected else dim("  ")
        lines.append((mark, (fitted(_trend_row(test, text), max(width - 2, 0)), Token.TEXT)))
    return lines


def _trend_row(test: KeptHealth, text: Catalogue) -> str:
    if test.result is None:
        return f"{printable(test.file.name, 30)}  {text('tune_page.unreadable')}"
    found = figures_of(test.result)
    values = (f"{found[key]:.4g}" if key in found else NOTHING for key in TREND)
    date = printable(test.result.date.replace("T", " ")[:DATE])
    return fitted(date, DATE) + "".join(to_the_right(value, VALUE_WIDTH) for value in values)


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
        own, *others = (f"{each[key]:.4g}" if key in each else NOTHING for each in (found, model, last))
        lines.append(
            line(
                dim(fitted(text(f"health.{key}"), label)),
                to_the_right(own, VALUE_WIDTH),
                dim("".join(to_the_right(value, VALUE_WIDTH) for value in others)),
            )
        )
    legend = line(
        ("── ", Token.AFTER), text("tune_page.this_test"), dim("   ┄┄ "), dim(text("tune_page.other_lines"))
    )
    return [*lines, legend]


def other_gain_lines(test: KeptHealth, stated: Mapping[str, float], text: Catalogue, width: int) -> list[Line]:
    """Return which gains of a test are not those of the profile, with those in brackets; nothing where none."""
    gains = {} if test.result is None else test.result.origin.gains
    names = [
        f"{name} {value:g} ({stated[name]:g})" for name, value in gains.items() if stated.get(name, value) != value
    ]
    shown = text("tune_page.other_gains", names=", ".join(names))
    return hanging(("! ", Token.WARNING), shown, width) if names else []


def step_picture(test: HealthResult | None, before: HealthResult | None) -> TracePicture:
    """Return the step: commanded, measured, and of the test before."""
    if test is None or not test.times_ms:
        return TracePicture()
    series = [Series(x=test.times_ms, y=test.reference_um, token=Token.COMMAND, dashed=True)]
    if before is not None and before.step_um == test.step_um:
        series.append(Series(x=before.times_ms, y=before.position_um, token=Token.DIM, dashed=True))
    series.append(Series(x=test.times_ms, y=test.position_um, token=Token.AFTER))
    low = min(*test.position_um, *test.reference_um)
    high = max(*test.position_um, *test.reference_um)
    limits = (test.times_ms[0], test.times_ms[-1])
    return TracePicture(series=series, x_limits=limits, y_limits=nice_limits(low, high), y_unit="um", x_unit="ms")


def armed_lines(kind: str, text: Catalogue, width: int, *, step_um: float, left_s: float) -> list[Line]:
    """Return what F6 will move, and how long it may still be pressed."""
    lines = hanging(("! ", Token.WARNING), text(f"tune_page.will.{kind}", step=f"{step_um:g}"), width)
    lines += hanging(dim("  "), text("tune_page.will.stop"), width)
    return [*lines, *hanging(("▶ ", Token.ACTION), text("tune_page.will.start", seconds=f"{left_s:.0f}"), width)]
