"""The diameter of a skim cut: what it makes of the tool tip, beside the touch-off that there was."""

from __future__ import annotations

from console.session.station.jogging import TOUCH_OFF_BAND_MM
from console.text.catalogue import Catalogue
from console.tui.align.asked import Answer, Question, entry_row, number_of, range_of
from console.tui.lines import BLANK, Line, dim, line, wrapped
from console.tui.theme import Token


def diameter_range(question: Question) -> tuple[float, float]:
    """Return what may be typed: about the diameter that was clamped."""
    clamping = question.alignment.clamping
    nominal_mm = 0.0 if clamping is None else clamping.diameter_mm
    return nominal_mm - 2.0 * TOUCH_OFF_BAND_MM, nominal_mm + 2.0 * TOUCH_OFF_BAND_MM


def diameter_answer(question: Question) -> Answer:
    """Return the measured diameter, mm."""
    return number_of(question, "diameter_mm", *diameter_range(question))


def zero_radius_mm(question: Question, diameter_mm: float) -> float | None:
    """Return the radius of the tip at position zero that follows; None without a noted skim cut."""
    at_counts = question.alignment.skim_counts
    return None if at_counts is None else diameter_mm / 2.0 + at_counts / question.machine.tool.counts_per_mm


def diameter_lines(text: Catalogue, question: Question, width: int) -> list[Line]:
    """Return the panel of the entry: the range, what follows, and the difference to what is known."""
    low, high = range_of(question, *diameter_range(question))
    rows = [
        entry_row(text("align_page.measured"), question),
        line(dim(text("align_page.range", low=f"D {low}", high=high))),
        BLANK,
    ]
    answer = diameter_answer(question)
    if answer.value is not None and not answer.problems:
        zero_mm = zero_radius_mm(question, answer.value)
        if zero_mm is not None:
            rows += [
                line(("→ ", Token.OK), (f"D {text.units.show(answer.value, 'mm', 3)}", Token.STRONG)),
                line(text("align_page.tool_zero", radius=f"R {text.units.show(zero_mm, 'mm', 4)}")),
                *_compared(text, question, zero_mm, width),
            ]
    return rows


def _compared(text: Catalogue, question: Question, zero_mm: float, width: int) -> list[Line]:
    touched = question.alignment.touch_off
    before_mm = question.machine.tool.home_radius_mm if touched is None else touched.zero_radius_mm
    word = "by_profile" if touched is None else "by_touch_off"
    off_um = 1000.0 * (zero_mm - before_mm)
    off = text.units.show(off_um, "um", 1, "+")
    return wrapped(text(f"align_page.{word}", radius=f"R {text.units.show(before_mm, 'mm', 4)}", off=off), width)
