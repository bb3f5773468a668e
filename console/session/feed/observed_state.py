"""What a feed observes: references to immutable values, taken in the thread of the feed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

from console.session.cut.cut_verdict import CutVerdict
from console.session.station.state import StationState

if TYPE_CHECKING:
    from console.session.work import Work
    from profiles.machine import MachineProfile

SCREENS, RUN = "screens", "run"
"""What runs: the screens, or `console run`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownCut:
    """How far a cut is, by its status polls."""

    stage: str
    turn: float
    turns: float
    left_s: float
    tool_error_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ObservedState:
    """One moment. `now_s` is machine time.

    `parts` counts what this session has cut to the end, `run_id` is the record of the current run. `numbers` are
    those of the page Alarms, by code and key of an alarm, `work` is what the screens have open. `cut` and
    `verdict` are those of `console run`, whose state has none.
    """

    state: StationState
    machine: MachineProfile
    now_s: float
    program: str = SCREENS
    job: str | None = None
    run_id: str | None = None
    parts: int = 0
    numbers: Mapping[tuple[str, str], int] = field(default_factory=lambda: MappingProxyType({}))
    cut: ShownCut | None = None
    verdict: CutVerdict | None = None
    work: Work | None = None

    @property
    def judgement(self) -> str | None:
        """The judgement of the last cut that has ended, until the next begins, whoever follows it."""
        cut = self.state.cut
        figures = None if cut is None else cut.figures
        verdict = self.verdict if figures is None else figures.verdict
        return None if verdict is None else verdict.judgement.value

    @property
    def shown_cut(self) -> ShownCut | None:
        """The cut, whoever follows it."""
        cut = self.state.cut
        if self.cut is not None or cut is None:
            return self.cut
        stage, error_um = str(cut.stage), cut.tool_error_um
        return ShownCut(stage=stage, turn=cut.turn, turns=cut.turns, left_s=cut.left_s, tool_error_um=error_um)
