"""What all pages work with: the words, the colours, the machine's control, and the job in hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.session.station.control import Control
from console.session.station.state import Activity, StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.keymap import PageName
from console.tui.theme import Palette
from profiles.problem import Problem
from profiles.store import LoadedMachine

Moment = tuple[Activity, bool, bool]
"""What the machine does, whether a cut is armed, whether a stop is in force: what most answers speak of."""


class UiContext:
    """One for the whole program. `work` is replaced, never changed; `said` is the answer to the last key.

    `go` shows another page. `data` is the operator's folder. `jog` is the action that asked for the last jog step.
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
        """Say what stays true whatever the machine does, as for what it is being stopped, until the next key."""
        self._said, self._said_at = (problem,), None

    def forget_stale_answer(self, state: StationState) -> None:
        """An answer that was given to another state of the machine may not be true any more."""
        if self._said_at is not None and self._said_at != _moment(state):
            self._said, self._said_at = (), None


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a page shows at one tick: the newest state, the work, and machine time to tell ages by."""

    state: StationState
    work: Work | None
    now_s: float


def _moment(state: StationState) -> Moment:
    return state.activity, state.armed is not None, state.stop is not None
