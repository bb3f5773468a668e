"""What all pages work with: the words, the colours, the machine's control, and the job in hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from console.session.control import Control
from console.session.state import StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.keymap import PageName
from console.tui.theme import Palette
from profiles.problem import Problem
from profiles.store import LoadedMachine


class Desk:
    """One for the whole program. `work` is replaced, never changed; `said` is the answer to the last key.

    `go` shows another page. `data` is the operator's folder.
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
        self.said: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a page shows at one tick: the newest state, the work, and machine time to tell ages by."""

    state: StationState
    work: Work | None
    now_s: float
