"""The program view shows the exact text, every character of it, with the checker's findings on top."""

from __future__ import annotations

import asyncio
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui.lines import plain, width_of
from console.tui.pages.preview import PreviewPage
from console.tui.pages.preview_lines import program_lines, program_rows
from console.tui.theme import Token
from console.tui.ui_context import View
from drivers.cutting.planning import CutPlan, Strategy
from drivers.preview.preview import Preview, Program, preview, underway
from profiles.store import load_job, load_machine
from tests.tui.stage import EXPERIMENT, LANGUAGES, MACHINE, FixedControl, PageStage, experiment, grid, ui_for

ROOM = (80, 18)


@cache
def seen() -> Preview:
    return preview(load_job(EXPERIMENT).job, load_machine(MACHINE).machine)


def text_of(strategy: Strategy) -> str:
    plan = seen().strategies[strategy]
    assert isinstance(plan, CutPlan)
    return plan.text


def shown(*acts: str, strategy: Strategy = Strategy.PAPER, language: str = "en") -> str:
    state = StationState()
    work = replace(experiment(), preview=seen(), strategy=strategy.value)
    page = PreviewPage(ui_for(FixedControl(state), Path("/nowhere"), language, work))
    app = PageStage(page, View(state=state, work=work, now_s=0.0))

    async def play() -> str:
        async with app.run_test(size=ROOM) as pilot:
            await pilot.pause()
            for action in acts:
                page.act(action)
                await pilot.pause()
            return grid(app)

    return asyncio.run(play())


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize("width", [24, 58, 78, 158])
def test_nothing_of_the_program_is_left_out(strategy: Strategy, width: int) -> None:
    lines = program_lines(text_of(strategy), width)
    assert all(width_of(pieces) <= width for pieces in lines)
    assert joined(lines) == text_of(strategy).rstrip("\n").split("\n")


@given(st.lists(st.text("XYZ1;() ", max_size=40), min_size=1, max_size=12), st.integers(6, 30))
def test_any_text_can_be_read_back_from_its_rows(rows: list[str], width: int) -> None:
    rows = [*rows, "END"]
    assert joined(program_lines("\n".join(rows), width)) == rows


def joined(lines: list[tuple[tuple[str, Token], ...]]) -> list[str]:
    """The program as a reader puts it together: a row without a number belongs to the one before."""
    read: list[str] = []
    for head, *rest in lines:
        said = "".join(text for text, _ in rest)
        if head[0].strip():
            assert int(head[0]) == len(read) + 1
            read.append(said)
        else:
            read[-1] += said
    return read


def test_what_is_not_sent_is_dim() -> None:
    (line,) = program_lines("P100=1000 ; spindle speed, rpm", 60)
    assert [(text, token) for text, token in line if text.strip()] == [
        ("1 ", Token.DIM),
        ("P100=1000 ", Token.TEXT),
        ("; spindle speed, rpm", Token.DIM),
    ]


def test_the_findings_of_the_checker_stand_on_top_in_words() -> None:
    said = plain(program_rows(seen(), Strategy.PAPER, load("en"), 200)).split("\n")
    assert said[0].startswith("! the controller stretches each segment to 20 ms")
    assert said[1] == "! the spindle will turn at 500 rpm, not at the job's 1000 rpm"
    assert said[2].startswith("! blending leaves 36.67 um (66.7 %)")
    assert plain(program_rows(seen(), Strategy.PVT, load("en"), 200)).startswith("✓ no findings")


@pytest.mark.parametrize("language", LANGUAGES)
def test_p_shows_the_program_and_takes_it_away(language: str) -> None:
    text = load(language)
    program = shown("preview.program", language=language)
    assert "P100=1000" in program
    assert text("preview_page.program", strategy="paper") in program
    assert all(cell_len(row) == ROOM[0] for row in program.split("\n"))
    charts = shown("preview.program", "preview.program", language=language)
    assert "P100=1000" not in charts
    assert text("preview_page.scale", value="20") in charts


@pytest.mark.long
def test_up_and_down_go_through_all_of_it_and_no_further() -> None:
    numbers: set[int] = set()
    for down in range(5):
        rows = shown("preview.program", *["preview.down"] * down).split("\n")
        numbers |= {int(found[1]) for row in rows if (found := re.match(r"│ *(\d+) ", row))}
    assert numbers == set(range(1, len(text_of(Strategy.PAPER).splitlines()) + 1))
    last = shown("preview.program", *["preview.down"] * 9)
    assert "rows 30-45 of 45" in last
    assert shown("preview.program", *["preview.down"] * 9, "preview.up") != last
    assert shown("preview.program", *["preview.down"] * 3, *["preview.up"] * 9) == shown("preview.program")


def test_a_program_that_is_still_made_is_not_shown_as_one_without_findings() -> None:
    early = underway(seen(), None, {})
    said = plain(program_rows(early, Strategy.PVT, load("en"), 80))
    assert load("en")("preview_page.checking") in said
    assert "no findings" not in said


def test_it_stays_where_it_was_scrolled_to_when_another_program_is_there() -> None:
    paper = Program(plan=seen().strategies[Strategy.PAPER], prediction=seen().predictions[Strategy.PAPER])
    early = underway(seen(), seen().eq9_loop, {Strategy.PAPER: paper})
    work = replace(experiment(), outlook=early, strategy="paper")
    page = PreviewPage(ui_for(FixedControl(StationState()), Path("/nowhere"), "en", work))
    app = PageStage(page, View(state=StationState(), work=work, now_s=0.0))

    async def play() -> tuple[str, str]:
        async with app.run_test(size=ROOM) as pilot:
            await pilot.pause()
            for action in ("preview.program", "preview.down"):
                page.act(action)
                await pilot.pause()
            before = grid(app)
            page.show(replace(app.view, work=replace(work, outlook=seen(), preview=seen())))
            await pilot.pause()
            return before, grid(app)

    before, after = asyncio.run(play())
    assert "rows 9-24 of" in before
    assert after == before


def test_another_strategy_begins_at_its_top() -> None:
    text = shown(
        "preview.program", "preview.down", "preview.strategy", "preview.strategy", strategy=Strategy.PAPER
    )
    assert "Program pvt" in text
    assert "✓ no findings" in text
