"""A key that changes the job: the page has the new numbers at the next tick, the programs come one by one."""

from __future__ import annotations

import asyncio
import queue
import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from console.session.cut.alignment import Alignment, JawAngle
from console.session.station.state import Activity
from console.session.work import Work, edit_field, open_work, undone, with_strategy
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from console.tui.lines import plain_text
from console.tui.pages.preview_lines import margin_lines, margins, strategy_lines
from console.tui.previewing import Previewer
from console.units import METRIC
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.preview import preview as session_preview
from drivers.preview.outlook import outlook
from drivers.preview.preview import preview
from profiles.compensations.path import CutPath
from profiles.store import load_job, load_machine
from tests.tui.scenes import Scene, application, rows_of
from tests.tui.scenes import machine as state_of
from tests.tui.stage import EXPERIMENT, MACHINE

STRETCH_S = 20.0
"""So long a test waits for the other thread at most, on a machine that is busy."""


class Planner:
    """Plans in the place of `plan_cut`, each program only when it is let; knows what was begun."""

    def __init__(self) -> None:
        self._begun: queue.Queue[tuple[float, Strategy]] = queue.Queue()
        self._gate = threading.Semaphore(0)
        self._over = False
        self.count = 0

    def __call__(self, job: Any, machine: Any, strategy: Strategy, **more: Any) -> CutPlan:
        self.count += 1
        self._begun.put((job.spindle_speed_rpm, strategy))
        assert self._gate.acquire(timeout=STRETCH_S)
        if self._over:
            raise RuntimeError("the test is over")
        return plan_cut(job, machine, strategy, **more)

    def begun(self) -> tuple[float, Strategy]:
        """Wait for the next one that is begun: speed of its job, and strategy."""
        return self._begun.get(timeout=STRETCH_S)

    def let(self, programs: int = 1) -> None:
        """Let so many be planned."""
        self._gate.release(programs)

    def end(self) -> None:
        """Let no thread outlive its test."""
        self._over = True
        self.let(1000)
        for thread in threading.enumerate():
            if thread.name == "preview":
                thread.join(STRETCH_S)


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> Iterator[Planner]:
    planner = Planner()
    monkeypatch.setattr(session_preview, "plan_cut", planner)
    yield planner
    planner.end()


def short() -> Work:
    """Experiment 1 over one millimetre."""
    loaded = load_job(EXPERIMENT)
    return open_work(replace(loaded, job=replace(loaded.job, cut_length_mm=1.0)), load_machine(MACHINE))


def at_speed(work: Work, rpm: float) -> Work:
    return edit_field(work, "spindle_speed_rpm", f"{rpm:g}")


def ticked(previewer: Previewer, work: Work) -> Work:
    """The work after two ticks: the first shows what is known, the second lets the other thread begin."""
    for _ in range(2):
        work = previewer.refresh_work(work, Alignment())
    return work


def finished(previewer: Previewer, work: Work) -> Work:
    """The work when the other thread has no more to do."""
    thread = previewer._thread
    assert thread is not None
    thread.join(STRETCH_S)
    return ticked(previewer, work)


def there(work: Work) -> list[str]:
    assert work.outlook is not None
    return [each.value for each in Strategy if each in work.outlook.strategies]


async def test_the_page_has_the_new_numbers_while_the_programs_are_still_computed(
    tmp_path: Path, planner: Planner
) -> None:
    app, _ = application(Scene(page=PageName.PREVIEW, state=state_of(Activity.READY)), tmp_path)
    async with app.run_test(size=(100, 30)) as pilot:
        await pilot.pause()
        app.ui.work = short()
        await pilot.press("3")
        await settle(app, pilot)
        assert planner.begun() == (1000.0, Strategy.PVT)
        app.ui.work = at_speed(app.ui.work, 800.0)
        app.tick()
        await pilot.pause()
        early = "\n".join(rows_of(app))
        planner.let(1000)
        app.tick()
        thread = app._previewer._thread
        assert thread is not None
        await asyncio.to_thread(thread.join, STRETCH_S)
        await settle(app, pilot)
        late, work = "\n".join(rows_of(app)), app.ui.work
    text = load("en")
    # 800 rpm and 3 jaws are 40 Hz; the loop has 84.0 Hz (docs/tuning.md).
    assert "servo at 40.0 Hz" in early
    assert "40.0 / 84.0 Hz" in early
    assert "20 um/div" in early
    assert text("preview_page.next_wait") in early
    rows = [row for row in early.split("\n") for name in Strategy if f" {name} " in row and "… um" in row]
    assert len(rows) == len(Strategy)
    assert text("preview_page.checking") in early
    # Then every figure is that of the program, where its place was kept.
    made = preview(work.job, work.machine.machine)
    for strategy, prediction in made.predictions.items():
        assert prediction.surface is not None
        assert re.search(rf" {strategy} .* {max(prediction.surface.ront_um.max(), 2.0):.1f} um│", late)
    assert "40.0 / 84.0 Hz  48 %" in late
    assert "…" not in re.sub(r"\d … \d", "", late), "but for the force window, which is a range"
    assert text("preview_page.next_wait") not in late


async def settle(app: ConsoleApp, pilot: Pilot[None]) -> None:
    for _ in range(4):
        app.tick()
        await pilot.pause()


def test_the_programs_come_one_by_one_that_of_the_chosen_strategy_first(planner: Planner) -> None:
    previewer = Previewer()
    work = ticked(previewer, with_strategy(short(), "timebase"))
    assert there(work) == []
    assert planner.begun()[1] is Strategy.TIMEBASE
    planner.let()
    planner.begun()
    work = ticked(previewer, work)
    assert there(work) == ["timebase"]
    assert work.preview is None
    planner.let(len(Strategy) - 1)
    work = finished(previewer, work)
    assert sorted(there(work)) == sorted(Strategy)
    assert work.preview is work.outlook
    assert ticked(previewer, work) is work


def test_a_key_in_the_middle_gives_the_old_question_up(planner: Planner) -> None:
    previewer = Previewer()
    work = ticked(previewer, short())
    assert planner.begun() == (1000.0, Strategy.PVT)
    work = ticked(previewer, at_speed(work, 900.0))
    planner.let(2)
    assert planner.begun() == (900.0, Strategy.PVT)
    # What was under way is remembered: going back, the chosen program is there at once.
    work = ticked(previewer, undone(work))
    assert there(work) == ["pvt"]


def test_nothing_is_computed_twice(planner: Planner) -> None:
    """Through all strategies with the key c, to another job and back: ten programs, five of each job."""
    planner.let(1000)
    previewer = Previewer()
    first = finished(previewer, ticked(previewer, short()))
    second = finished(previewer, ticked(previewer, at_speed(first, 900.0)))
    for work in (second, undone(second)):
        for strategy in Strategy:
            # One tick, and all is there.
            seen = previewer.refresh_work(with_strategy(work, strategy), Alignment())
            assert seen.preview is not None
            assert seen.preview.strategy == strategy
            assert seen.preview.job == work.job
    assert planner.count == 2 * len(Strategy)


def test_a_learned_path_asks_for_one_program_more(planner: Planner) -> None:
    planner.let(1000)
    previewer = Previewer()
    work = finished(previewer, ticked(previewer, with_strategy(short(), "cam")))
    assert work.preview is not None
    made = work.preview
    path = CutPath(target=made.target, command=made.command.plus({3: 2.0 + 0.0j}))
    for _ in range(2):
        work = previewer.refresh_work(work, Alignment(), path=path)
    assert work.outlook is not None
    assert work.outlook.command == path.command
    assert there(work) == [name for name in Strategy if name != "cam"]
    thread = previewer._thread
    assert thread is not None
    thread.join(STRETCH_S)
    work = previewer.refresh_work(work, Alignment(), path=path)
    assert work.preview is not None
    assert work.preview.predictions[Strategy.CAM].ront_um > made.predictions[Strategy.CAM].ront_um + 1.0
    assert planner.count == len(Strategy) + 1


def test_an_axis_that_cannot_be_inverted_says_so_at_once(planner: Planner) -> None:
    previewer = Previewer()
    work = edit_field(at_speed(short(), 5000.0), "jaws", "6")
    work = ticked(previewer, work)
    assert [problem.code for problem in work.preview_problems] == ["response.amplified"]
    assert (work.outlook, work.preview, planner.count) == (None, None, 0)


def test_a_fault_is_told_and_the_next_job_is_answered(planner: Planner, monkeypatch: pytest.MonkeyPatch) -> None:
    previewer = Previewer()
    with monkeypatch.context() as patch:
        patch.setattr(session_preview, "plan_cut", lambda *_, **__: 1 / 0)
        work = finished(previewer, ticked(previewer, short()))
    assert [(problem.code, problem.value) for problem in work.preview_problems] == [
        ("session.fault", "ZeroDivisionError: division by zero")
    ]
    planner.let(1000)
    assert finished(previewer, ticked(previewer, at_speed(work, 900.0))).preview is not None


def test_jaw_1_found_by_the_alignment_turns_the_lobe_at_once(planner: Planner) -> None:
    previewer, work = Previewer(), short()
    turned = previewer.refresh_work(work, Alignment(jaw=JawAngle(angle_deg=12.0, jaws=3, at="2 Jan 08:45")))
    assert turned.outlook is not None
    assert turned.outlook.job.jaw_1_deg == pytest.approx(12.0)


@pytest.mark.parametrize("strategy", list(Strategy))
def test_nothing_on_the_page_jumps_when_a_program_is_there(strategy: Strategy) -> None:
    """Before and after, the same rows of the same width; of the needs only those of the printed program differ."""
    job = replace(short().job, cut_length_mm=2.0)
    text, machine = load("en"), load_machine(MACHINE).machine
    late = preview(job, machine, strategy)
    early = session_preview.underway(outlook(job, machine, strategy), {})
    needs = [
        plain_text(margin_lines(margins(seen, strategy, METRIC), text, 60, 6)).split("\n")
        for seen in (early, late)
    ]
    rows = [plain_text(strategy_lines(seen, strategy, text, 60, 10)).split("\n") for seen in (early, late)]
    if strategy is Strategy.PAPER:
        assert all("…" in row for row in needs[0])
        assert [len(row) for row in needs[0]] == [len(row) for row in needs[1]]
    else:
        before, after = ([re.sub(r"[\d.]+", "#", row) for row in each] for each in needs)
        assert before == after
    assert [len(row) for row in rows[0]] == [len(row) for row in rows[1]]
    assert sum("…" in row for row in rows[0]) >= len(Strategy)
    assert not any("…" in row for row in rows[1])
