"""The next step on the page Inspect: cut, measure, keep what was learned, or the next part."""

from __future__ import annotations

from console.session.stages import without_half
from console.session.station.state import Activity, MeasuredPart, StationState
from console.tui.inspecting.plain_words import in_scatter, is_elsewhere, is_kept, jaw_explains
from console.tui.pages.lobe_lines import follows_lobe, is_taken
from console.tui.ui_context import View
from drivers.cutting.strategy import Strategy

_UNDER_WAY = {
    Activity.MEASURING: "next_wait",
    Activity.POSITIONING: "next_cutting",
    Activity.CUTTING: "next_cutting",
}
WORSE = ("learned.diverges",)  # reasons to revert
MADE_WORSE = "learned.worse"  # a reason to check the set-up: reverting would not help


def where(state: StationState) -> str:
    """Return the suffix for texts about measuring here, or elsewhere: only a simulated machine has a gauge."""
    return "" if state.simulated else "_outside"


def next_word(view: View) -> str:  # noqa: C901 - one branch a case
    """Return the word for what comes next: air, half, whole; learning; the next part."""
    state, part = view.state, view.state.measured
    if state.activity in _UNDER_WAY:
        return _UNDER_WAY[state.activity]
    if part is None:
        if state.cut is not None and state.cut.in_air and not state.cut_done:
            return "next_air" if view.work is None else f"next_air{without_half(Strategy(view.work.strategy))}"
        return ("next_measure" if state.cut_done else "next_cut") + where(state)
    if not part.strategy.traits.follows_lobe:
        return _lobe_word(part, view)
    learning = part.learning
    teaches, kept = learning is not None and not learning.reasons, is_kept(learning, view.work)
    codes = [] if learning is None else [reason.code for reason in learning.reasons]
    if MADE_WORSE in codes:
        return "next_made_worse"
    if any(code in WORSE for code in codes):
        return "next_worse"
    if part.is_half and state.force is not None and state.force.contradicts(part.job):
        return "next_force"
    if kept:
        return "next_half" if part.is_half else "next_kept"
    taught = None if learning is None or not teaches else learning.taught
    if taught is not None and is_elsewhere(taught):
        return "next_check_jaw"
    # Clamping scatter alone is no reason to stay, for a part that passes.
    stands_out = taught is not None and not in_scatter(taught)
    if part.is_half:
        return "next_half_learn" if stands_out else "next_half"
    if not fails(part):
        if stands_out:
            return "next_part_learn"
        if part.diameter_passes is False:
            return "next_diameter" if part.offset_taken else "next_offset"
        return "next_part"
    if taught is None:
        return "next_failed"
    if not stands_out:
        return "next_failed_scatter"
    return "next_failed_jaw" if jaw_explains(taught) else "next_failed_learn"


def _lobe_word(part: MeasuredPart, view: View) -> str:
    """Return the word after a part that was cut without compensation."""
    if is_taken(part.lobe, view.work):
        return "next_lobe_taken" if follows_lobe(view.work) else "next_lobe_plain"
    return "next_lobe" if part.lobe is not None and not part.lobe.reasons else "next_no_lobe"


def fails(part: MeasuredPart) -> bool:
    """Whether a part is out of its job's tolerance; one with half its compensation is not judged."""
    return not part.is_half and part.result.ront_um > part.job.roundness_tolerance_um
