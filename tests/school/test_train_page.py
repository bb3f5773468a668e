"""The page Train: a lesson is ended by Enter, and its debrief says what counted, in both languages."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.school.schooling import follow_lesson
from console.school.training.attempt import Attempt, TraineeFindings
from console.school.training.happenings import Happening, HappeningKind, PartFact
from console.school.training.lesson import Item, lesson_of, load_lesson
from console.school.training.tries import tries
from console.school.words.debrief import happening_words
from console.session.station.commands import AskTruth, InjectFault
from console.text.catalogue import load
from console.tui.app import ConsoleApp
from console.tui.keymap import PageName
from drivers.simulator.faults.catalogue import CATALOGUE
from drivers.simulator.plant.workshop_view import Truth
from profiles.problem import Problem
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played, rows_of
from tests.tui.stage import LANGUAGES, FixedControl

TRUTH = Truth(jaw_1_deg=150.0, zero_radius_mm=29.0, reachable_um=2.0, nearest_jaws_mm=0.4, contact_mm_per_s=0.9)
FACTS = (
    Happening(at_s=30.0, what=HappeningKind.STEP, word="touched_off"),
    Happening(at_s=60.0, what=HappeningKind.FAULT, word="cut-cable for=10"),
    Happening(
        at_s=61.0, what=HappeningKind.ALARM, word="link.lost", problem=Problem(code="link.lost", value="cut")
    ),
    Happening(at_s=90.0, what=HappeningKind.STOP, word="space"),
    Happening(at_s=95.0, what=HappeningKind.MET, word="jaws"),
    Happening(at_s=99.0, what=HappeningKind.PART, word="24.10"),
)
Play = Callable[[ConsoleApp, Pilot[None], FixedControl], Awaitable[None]]


def tried(app: ConsoleApp, data: Path) -> Attempt:
    """A try with everything in it that can go wrong."""
    found = TraineeFindings(jaw_1_deg=155.0, zero_radius_mm=29.08, lobe_um_pp=55.0)
    part = PartFact(ront_um=24.1, tolerance_um=4.0, offset_um=80.0, diameter_passes=False, full=True)
    lesson = replace(load_lesson("thin-ring", data), minutes=3.0)
    begun = Attempt(lesson=lesson, began_s=app.ui.control.now_s() - 300.0, trainee="Kim", seed=1)
    return replace(begun, found=found, part=part, happened=FACTS)


def play(data: Path, scene: Play, language: str = "en") -> None:
    fill(data)
    begun = Scene(page=PageName.TRAIN, state=align_stage.state(), work=None)
    app, control = application(begun, data, language=language)

    async def run() -> None:
        async with played(app, begun, (80, 24)) as pilot:
            app.ui.attempt = tried(app, data)
            app.followers.append(lambda: follow_lesson(app.ui))
            app.tick()
            await scene(app, pilot, control)

    asyncio.run(run())
    assert app.fault is None


@pytest.mark.parametrize("language", LANGUAGES)
def test_enter_ends_the_lesson_and_every_item_is_told(tmp_path: Path, language: str) -> None:
    text = load(language)

    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        page = app._pages[PageName.TRAIN]
        page.act("train.end")
        assert [problem.code for problem in app.ui.key_answer] == ["training.end_again"] and not control.orders
        page.act("train.end")
        assert control.orders == [AskTruth()]
        control.state = replace(control.state, truth=TRUTH)
        app.tick()
        await pilot.pause()
        whole = " ".join(" ".join(piece for piece, _ in row) for row in page.in_full(app.ui.view, 200))
        for item in Item:
            if item not in (Item.DIAMETER, Item.REACTION, Item.ANSWER):
                assert text(f"debrief.{item}", value="", limit="").split()[0] in whole, item
        assert text("debrief.next.steps").split()[0] in whole, "what cost most"
        assert text("fault.cut-cable") in whole and "24.10" in whole and text.reason("space") in whole
        assert "link.lost" not in whole, "no raw identifiers"
        shown = "\n".join(rows_of(app))
        assert (text("debrief.title") in shown and "Score" in shown) or "점수" in shown
        assert page.why_not("train.end", app.ui.view)[0].code == "training.over"

    play(tmp_path, scene, language)
    (one,) = tries(tmp_path, "Kim")
    assert one.score < 50 and one.lesson == "thin-ring"


def test_a_try_that_cannot_be_kept_is_told_and_debriefed_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "training").write_text("in the way", encoding="utf-8")

    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        page = app._pages[PageName.TRAIN]
        page.act("train.end")
        page.act("train.end")
        control.state = replace(control.state, truth=TRUTH)
        app.tick()
        await pilot.pause()
        assert [problem.code for problem in app.ui.key_answer] == ["file.not_writable"]
        assert "Score" in "\n".join(rows_of(app))

    play(tmp_path, scene)


def test_without_a_lesson_there_is_nothing_to_end(tmp_path: Path) -> None:
    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        app.ui.attempt = None
        app._pages[PageName.TRAIN].act("train.end")
        assert [problem.code for problem in app.ui.key_answer] == ["training.none"] and not control.orders

    play(tmp_path, scene)


def test_the_list_has_the_best_score_of_each_lesson_and_tells_a_damaged_try(tmp_path: Path) -> None:
    folder = tmp_path / "training" / "Kim"

    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        page = app._pages[PageName.TRAIN]
        for _ in range(2):
            app.ui.attempt = tried(app, tmp_path)
            page.act("train.end")
            page.act("train.end")
            control.state = replace(control.state, truth=TRUTH)
            app.tick()
            page.leave()
        app.ui.attempt = None
        app.tick()
        await pilot.pause()
        assert "best 0" in " ".join("".join(piece for piece, _ in row) for row in page.in_full(app.ui.view, 60))
        next(folder.glob("*.json")).write_text("{", encoding="utf-8")
        page.leave()
        app.tick()
        assert [problem.code for problem in app.ui.key_answer] == ["training.unreadable"]

    play(tmp_path, scene)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_fault_has_words(language: str) -> None:
    text = load(language)
    for name in CATALOGUE:
        words = happening_words(Happening(at_s=0.0, what=HappeningKind.FAULT, word=f"{name} for=1"), text)
        assert f"fault.{name}" not in words and words


def test_a_fault_of_the_lesson_is_in_no_log(tmp_path: Path) -> None:
    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        assert app.ui.control.post(InjectFault(line="inject hang"))
        app.tick()
        assert not [entry for entry in app.ui.log.entries if entry.word == "InjectFault"]

    play(tmp_path, scene)


def test_while_a_question_is_due_the_key_row_has_its_keys(tmp_path: Path) -> None:
    words = {"title": "t", "goal": "g", "hints": ["h"], "question": "q", "answers": ["x", "y"]}
    asking = lesson_of({"minutes": 5, "steps": ["answered"], "answer": 1, "en": words, "ko": words}, "mine", "")
    rows: list[str] = []

    async def scene(app: ConsoleApp, pilot: Pilot[None], control: FixedControl) -> None:
        for attempt in (Attempt(lesson=asking, began_s=0.0, seed=1), tried(app, tmp_path)):
            app.ui.attempt = attempt
            app.tick()
            await pilot.pause()
            rows.append(rows_of(app)[-1])

    play(tmp_path, scene)
    assert "↑↓ choose  Enter answer" in rows[0]
    assert "Enter debrief" in rows[1]
