"""Text of the page Run about override and trim of a running cut; the one that + and - change is in brackets."""

from __future__ import annotations

from rich.cells import cell_len

from console.session.station.adjustment import adjust_refusal
from console.session.station.commands import Adjust
from console.session.station.progress import CutProgress
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.lines import Line, fit_text, line, wrap_line
from console.tui.theme import Token
from drivers.cutting.bounds import AS_PLANNED, STEPS, Adjustable, Bounds, CutAdjustment, CutChange
from profiles.problem import Problem

PENDING = "…"  # behind a trim that the controller has not reported to be in its path


def list_adjustables(bounds: Bounds) -> list[Adjustable]:
    """Return what may be changed of a cut, in the order in which the key chooses it."""
    return [each for each in Adjustable if not bounds.refusal_code(each)]


def adjust_line(text: Catalogue, cut: CutProgress, chosen: Adjustable, width: int) -> list[Line]:
    """Return override and trim in one line; nothing where a cut allows neither."""
    pieces: list[tuple[str, Token]] = []
    for each in list_adjustables(cut.adjusted.bounds):
        words = text(f"run_page.adjust.{each}", value=_format_adjustment(cut.adjusted, each))
        if pieces:
            pieces.append(("  ", Token.TEXT))
        pieces.append((f"[{words}]", Token.STRONG) if each is chosen else (words, Token.TEXT))
    if not pieces:
        return []
    whole = "".join(piece for piece, _ in pieces)
    return [line(*pieces) if cell_len(whole) <= width else line(fit_text(whole, width))]


def adjust_in_full(text: Catalogue, cut: CutProgress, chosen: Adjustable, width: int) -> list[Line]:
    """Return what may be changed, by how much, and what bounds it; or why nothing may."""
    bounds = cut.adjusted.bounds
    rows: list[Line] = []
    for each in Adjustable:
        words = text(f"run_page.adjust.{each}", value=_format_adjustment(cut.adjusted, each))
        if bounds.refusal_code(each):
            continue
        low, high = bounds.range_of(each)
        limit = text(f"run_page.adjust.range.{each}", low=f"{low:g}", high=f"{high:g}", step=f"{STEPS[each]:g}")
        rows += wrap_line(f"{words}: {limit}", width, Token.STRONG if each is chosen else Token.TEXT)
    if not rows:
        return []
    return [*rows, *wrap_line(text("run_page.adjust.keys"), width, Token.DIM)]


def adjust_reasons(action: str, asked: Adjust, state: StationState) -> tuple[Problem, ...]:
    """Return why the keys of override and trim do nothing now."""
    cut = state.cut
    if action == "run.choose" and state.activity is Activity.CUTTING and cut is not None:
        return (
            ()
            if list_adjustables(cut.adjusted.bounds)
            else (Problem(code=cut.adjusted.bounds.refusal_code(asked.what)),)
        )
    refused = adjust_refusal(asked, state)
    return () if refused is None else (refused,)


def armed_bounds(text: Catalogue, bounds: Bounds) -> str:
    """Return by how much an armed cut may be changed while it runs."""
    words = [
        text(f"run_page.adjust.bound.{each}", low=f"{low:g}", high=f"{high:g}")
        for each in list_adjustables(bounds)
        for low, high in (bounds.range_of(each),)
    ]
    return ", ".join(words) or text("run_page.adjust.none")


def changed_lines(text: Catalogue, changed: CutChange | None, width: int) -> list[Line]:
    """Return what the operator has changed of a cut that has ended; nothing where nothing was."""
    if changed is None:
        return []
    last = CutAdjustment(override_percent=changed.override_percent, trim=changed.trim, applied=changed.trim)
    words = [
        text(f"run_page.adjust.{each}", value=_format_adjustment(last, each))
        for each in Adjustable
        if last.value_of(each) != AS_PLANNED.value_of(each)
    ]
    what = ", ".join(words) or text("run_page.adjust.as_planned")
    z = text.units.figure(changed.from_mm, "mm", 1)
    return wrap_line(text("run_page.adjust.was_changed", z=z, what=what), width, Token.WARNING)


def _format_adjustment(adjusted: CutAdjustment, what: Adjustable) -> str:
    value = adjusted.value_of(what)
    if what is Adjustable.OVERRIDE:
        return f"{value:g}"
    pending = PENDING if adjusted.applied != adjusted.trim else ""
    return f"{value:+g}{pending}" if what is Adjustable.GAIN else f"{value:+.1f}{pending}"
