"""Wrench torque to chucking force and back, by the calibration of the machine, with the window of the part."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.align.asked import Answer, Asked, Question, entry_row, number_of
from console.tui.lines import BLANK, Line, Piece, dim, line, wrapped
from console.tui.theme import Token
from profiles.chucking.advice import ForceSpan, Stands, force_span
from profiles.chucking.holding import Holding, Wrench, holding_of, torque_or_none_n_m

_LARGEST_TORQUE_N_M = 1000.0


def force_range(question: Question) -> tuple[float, float]:
    """Return what may be typed: up to the chuck's own maximum, as force or as torque."""
    most_n = question.machine.chuck.max_force_n
    if question.asked is Asked.FORCE:
        return 0.0, most_n
    wrench = holding_of(question.machine).wrench
    most = None if wrench is None else torque_or_none_n_m(wrench, most_n)
    return 0.0, _LARGEST_TORQUE_N_M if most is None else most


def force_answer(question: Question) -> Answer:
    """Return the typed torque (N m) or force (N)."""
    return number_of(question, str(question.asked), *force_range(question), decimals=1)


def force_lines(text: Catalogue, question: Question, width: int) -> list[Line]:
    """Return the panel: the job's force, its window, and what the entry comes to; nothing is changed by it."""
    holding, job = holding_of(question.machine), question.job
    rows: list[Line] = [entry_row(text(f"align_page.{question.asked}"), question)]
    if job is None:
        return rows
    span, wrench = force_span(job, question.machine), holding.wrench
    ends = {name: _both(wrench, force_n) for name, force_n in (("least", span.least_n), ("most", span.most_n))}
    rows += [
        line(dim(text("align_page.force_job", both=_both(wrench, job.chucking_force_n)))),
        line(dim(text("align_page.force_least", least=ends["least"]))),
        line(dim(text("align_page.force_most", most=ends["most"]))),
    ]
    if wrench is None:
        return [*rows, *wrapped(text("align_page.no_wrench"), width, Token.WARNING)]
    answer = force_answer(question)
    if answer.value is None or answer.problems:
        return [*rows, BLANK]
    force_n = answer.value
    if question.asked is Asked.TORQUE:
        force_n = wrench.offset_n + wrench.force_per_torque_n_per_n_m * answer.value
    return [*rows, BLANK, *_result(text, holding, wrench, span, force_n, width)]


def _result(
    text: Catalogue, holding: Holding, wrench: Wrench, span: ForceSpan, force_n: float, width: int
) -> list[Line]:
    torque = torque_or_none_n_m(wrench, force_n)
    if torque is None:
        return wrapped(text("align_page.no_torque", force=f"{force_n:.0f} N"), width, Token.WARNING)
    scatter_n = ((force_n * holding.force_sd_fraction) ** 2 + wrench.line_sd_n(torque) ** 2) ** 0.5
    stands = span.stands(force_n)
    mark: Piece = ("✓ ", Token.OK) if stands is Stands.INSIDE else ("! ", Token.WARNING)
    return [
        line(("→ ", Token.OK), (f"{torque:.2f} N m = {force_n:.0f} N", Token.STRONG), dim(f" ±{scatter_n:.0f} N")),
        *[(mark, *rest) for rest in wrapped(text(f"align_page.stands_{stands}"), width - 2)],
    ]


def _both(wrench: Wrench | None, force_n: float) -> str:
    """Return a force with its torque, where the wrench gives it."""
    torque = None if wrench is None else torque_or_none_n_m(wrench, force_n)
    return f"{force_n:.0f} N" if torque is None else f"{force_n:.0f} N ({torque:.1f} N m)"
