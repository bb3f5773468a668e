"""Why a key of the page Inspect cannot do its work now."""

from __future__ import annotations

from console.tui.pages.learning_keys import why_not_accepted, why_not_reverted
from console.tui.ui_context import View, refusal
from profiles.problem import Problem

LOOKS = frozenset(
    f"inspect.{name}" for name in ("circle", "filter", "larger", "smaller", "whole", "view", "beside")
)
"""Actions that show the measured part in another way; they need one."""

_OF_CHOOSER = ("up", "down", "page_up", "page_down", "first", "last", "path", "state", "direction", "mark")


def inspect_reasons(action: str, view: View) -> tuple[Problem, ...]:  # noqa: C901 - one branch a case
    """Return why an action cannot be done, empty where it can; the trace chooser is closed."""
    state, work, part = view.state, view.work, view.state.measured
    match action.removeprefix("inspect."):
        case "measure":
            return _against_measuring(view)
        case "accept":
            return why_not_accepted(part, work)
        case "revert":
            return why_not_reverted(work)
        case "offset" if part is not None and part.tool_offset_um is not None:
            return refusal(state, action)
        case "offset" if part is not None and part.size_doubt is not None:
            return (part.size_doubt,)
        case "offset":
            code = "trace.no_part" if part is None else "offset.no_size"
            return (Problem(code=code, limit="# radius_mm: R"),)
        case "import" if work is None:
            return (Problem(code="screen.nothing_to_cut"),)
        case "import" if state.moving:
            return (Problem(code="machine.moving"),)
        case _ if action in LOOKS and part is None:
            return (Problem(code="trace.no_part"),)
        case "export" if part is None:
            return (Problem(code="trace.no_part"),)
        case name if name in _OF_CHOOSER:
            return (Problem(code="screen.traces_closed"),)
    return ()


def _against_measuring(view: View) -> tuple[Problem, ...]:
    if not view.state.simulated:
        return (Problem(code="session.no_gauge"),)
    if view.state.moving:
        return (Problem(code="machine.moving"),)
    return () if view.state.cut_done else (Problem(code="session.nothing_cut"),)
