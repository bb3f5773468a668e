"""One page on its stage: what comes of a state of the machine and some keys, or of a scene that is played."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from rich.cells import cell_len
from textual.pilot import Pilot

from console.session.station.commands import Command
from console.session.station.state import Activity, StationState
from console.session.work import Work
from console.tui.keymap import PageName
from console.tui.page import Page
from console.tui.ui_context import UiContext, View
from tests.tui.stage import FRAME_ROWS, FixedControl, PageStage, experiment, grid, ui_for

Result = TypeVar("Result")
READY = StationState(activity=Activity.READY)

NEXT_STEP_CELLS = 77
"""What the row of the next step has room for on 80 columns."""


@dataclass(frozen=True)
class Shown:
    """What came of some keys."""

    text: str
    next_step: str
    orders: Sequence[Command]
    stops: Sequence[str]
    said: Sequence[str]

    @property
    def words(self) -> str:
        """The text of the left panels, then that of the right ones, without line breaks and frames."""
        rows = [row.strip("│").partition("││") for row in self.text.splitlines()]
        return " ".join(" ".join([row[0] for row in rows] + [row[2] for row in rows]).split())


def run_apart(act: Callable[[], Coroutine[Any, Any, Result]]) -> Result:
    """Run something in a loop of its own, also within a test that is a coroutine itself."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(lambda: asyncio.run(act())).result()


def shown_on(
    page_class: type[Page],
    now: StationState,
    *actions: str,
    size: tuple[int, int] = (80, 24),
    language: str = "en",
    work: Work | None = None,
    no_job: bool = False,
    then_s: float = 0.0,
    then: StationState | None = None,
    leave: bool = False,
) -> Shown:
    """Show a state at 100 s, press keys, let `then_s` pass and `then` come, and look at the page."""
    control = FixedControl(now)
    job = None if no_job else work or experiment()
    ui = ui_for(control, Path("/nowhere"), language, job)
    page = page_class(ui)
    view = View(state=now, work=job, now_s=100.0)

    async def run() -> str:
        app = PageStage(page, view)
        async with app.run_test(size=(size[0], size[1] - FRAME_ROWS)) as pilot:
            await pilot.pause()
            for action in actions:
                page.act(action)
                await pilot.pause()
            if leave:
                page.leave()
            for _ in range(2):
                page.show(replace(view, state=then or now, work=ui.work, now_s=100.0 + then_s))
                await pilot.pause()
            return grid(app)

    text = run_apart(run)
    return Shown(
        text=text,
        next_step="".join(words for words, _ in page.next_step(view)),
        orders=control.orders,
        stops=control.stops,
        said=[problem.code for problem in ui.key_answer],
    )


def shown_in_turn(
    page_class: type[Page],
    states: Mapping[str, StationState],
    *actions: str,
    size: tuple[int, int] = (80, 24),
    language: str = "en",
) -> dict[str, Shown]:
    """Show one state after the other on the same page, press keys in each, and look at the page."""
    control = FixedControl(StationState())
    job = experiment()
    ui = ui_for(control, Path("/nowhere"), language, job)
    page = page_class(ui)
    seen: dict[str, Shown] = {}

    async def run() -> None:
        app = PageStage(page, View(state=control.state, work=job, now_s=100.0))
        async with app.run_test(size=(size[0], size[1] - FRAME_ROWS)) as pilot:
            for name, now in states.items():
                page.leave()
                control.state, control.orders, ui.key_answer = now, [], ()
                view = View(state=now, work=job, now_s=100.0)
                page.show(view)
                await pilot.pause()
                for action in actions:
                    page.act(action)
                for _ in range(2):
                    page.show(view)
                    await pilot.pause()
                next_step = "".join(words for words, _ in page.next_step(view))
                said = _codes(ui)
                seen[name] = Shown(grid(app), next_step, control.orders, control.stops, said)

    run_apart(run)
    return seen


def _codes(ui: UiContext) -> list[str]:
    return [problem.code for problem in ui.key_answer]


def too_wide(shown: Mapping[str, Shown], size: tuple[int, int], texts: str) -> list[str]:
    """Name the states in which a page does not fit the terminal, or shows a key of these texts for its words."""
    wrong = []
    for name, page in shown.items():
        rows = page.text.splitlines()
        if len(rows) > size[1] - FRAME_ROWS:
            wrong.append(f"{name}: {len(rows)} rows")
        wrong += [f"{name}: {row}" for row in rows if cell_len(row) > size[0]]
        if cell_len(page.next_step) > NEXT_STEP_CELLS:
            wrong.append(f"{name}: {page.next_step}")
        if texts in page.text + page.next_step:
            wrong.append(f"{name}: a key stands for its words")
    return wrong


class PageScene:
    """A page while a scene is played on it; `gone` are the pages that it went to."""

    page_class: type[Page]

    def __init__(self, data: Path, work: Work | None, language: str, state: StationState) -> None:
        self.control = FixedControl(state)
        self.ui = ui_for(self.control, data, language, work)
        self.gone: list[PageName] = []
        self.ui.go = self.gone.append
        self.page = self.page_class(self.ui)
        self.app = PageStage(self.page, self.view)
        self.pilot: Pilot[None]

    @property
    def view(self) -> View:
        return View(state=self.control.state, work=self.ui.work, now_s=100.0)

    async def act(self, *actions: str) -> None:
        for action in actions:
            self.page.act(action)
            await self.pilot.pause()
        await self.show()

    async def show(self) -> None:
        self.page.show(self.view)
        await self.pilot.pause()

    @property
    def text(self) -> str:
        return grid(self.app)

    @property
    def codes(self) -> list[str]:
        return [problem.code for problem in self.ui.key_answer]

    @property
    def next_step(self) -> str:
        return "".join(piece for piece, _ in self.page.next_step(self.view))


Played = TypeVar("Played", bound=PageScene)


@asynccontextmanager
async def on_page(
    stage_class: type[Played],
    data: Path,
    *,
    work: Work | None = None,
    language: str = "en",
    size: tuple[int, int] = (80, 18),
    state: StationState = READY,
) -> AsyncIterator[Played]:
    """Show the page of a scene; it is there until the block ends."""
    stage = stage_class(data, work, language, state)
    async with stage.app.run_test(size=size) as pilot:
        stage.pilot = pilot
        await pilot.pause()
        yield stage
