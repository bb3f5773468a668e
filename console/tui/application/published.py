"""What the screens publish on their feed: everything is read by reference, in the thread of the feed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.station.state import StationState
from profiles.problem import Problem
from profiles.store import LoadedMachine

if TYPE_CHECKING:
    from console.session.feed.observed import Observed
    from console.session.feed.server import FeedServer
    from console.session.station.link_thread import LinkThread
    from console.tui.ui_context import UiContext


class ScreenFeed:
    """The feed of the screens, from `launch`, after the first paint, to `close`."""

    def __init__(self, link: LinkThread, machine: LoadedMachine, data: Path) -> None:
        self._link, self._machine, self._data = link, machine.machine, data
        self._server: FeedServer | None = None

    def launch(self, ui: UiContext, state: Callable[[], StationState]) -> None:
        """Begin to publish; returns at once."""
        from console.session.feed.server import FeedServer  # not for the first paint

        self._server = FeedServer(self._data, lambda: self._observed(ui, state()))
        self._server.launch()

    def close(self) -> tuple[Problem, ...]:
        """End it; return why nothing was published, if so."""
        if self._server is None:
            return ()
        self._server.close()
        return self._server.problems

    def _observed(self, ui: UiContext, state: StationState) -> Observed:
        from console.session.feed.observed import Observed

        work, standing = ui.work, ui.log.alarms.standing
        return Observed(
            state=state,
            machine=self._machine,
            now_s=self._link.now_s(),
            job=None if work is None else work.job.name,
            run_id=self._link.run_id,
            parts=self._link.parts,
            numbers={(entry.problem.code, entry.problem.key): entry.number for entry in standing},
        )
