"""UI context of all pages: the texts, the colours, the machine's control, and the open job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.session.station.commands import Control
from console.session.station.state import Activity, StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.keymap import PageName
from console.tui.theme import Palette
from profiles.problem import Problem
from profiles.store import LoadedMachine

Moment = tuple[Activity, bool, bool]
"""Activity of the machine, whether a cut is armed, whether a stop is in force: what most answers refer to."""


class UiContext:
    """The single UI context. `work` is replaced, never changed; `said` is the answer to the last key.

    `go` shows another page. `data` is the operator's folder. `jog` is the action that requested the last jog step.
    """

    def __init__(
        self,
        *,
        text: Catalogue,
        palette: Palette,
        control: Control,
        machine: LoadedMachine,
        data: Path,
        go: Callable[[PageName], None],
    ) -> None:
        self.text = text
        self.palette = palette
        self.control = control
        self.machine = machine
        self.data = data
        self.go = go
        self.work: Work | None = None
        self.jog: str | None = None
        self._said: tuple[Problem, ...] = ()
        self._said_at: Moment | None = None

    @property
    def said(self) -> tuple[Problem, ...]:
        """The answer to the last key."""
        return self._said

    @said.setter
    def said(self, problems: tuple[Problem, ...]) -> None:
        self._said, self._said_at = problems, _moment(self.control.state)

    def say_until_key(self, problem: Problem) -> None:
        """Show until the next key a text that holds in any state, such as why the machine is being stopped."""
        self._said, self._said_at = (problem,), None

    def forget_stale_answer(self, state: StationState) -> None:
        """Drop an answer that was given in another state of the machine: it may no longer be true."""
        if self._said_at is not None and self._said_at != _moment(state):
            self._said, self._said_at = (), None


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Input of a page at one tick: the newest state, the work, and machine time to compute ages."""

    state: StationState
    work: Work | None
    now_s: float


def _moment(state: StationState) -> Moment:
    return state.activity, state.armed is not None, state.stop is not None
