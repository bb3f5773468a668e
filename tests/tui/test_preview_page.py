"""The page Preview, and the prediction that it shows: what is left on the part is what the machine leaves."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from console.session.cut.alignment import Alignment, JawAngle
from console.session.station.state import StationState
from console.session.work import Work
from console.text.catalogue import load
from console.tui.lines import plain_text, width_of
from console.tui.pages.preview import PreviewPage, path_series, roundness_traces
from console.tui.pages.preview_lines import (
    Margin,
    margin_lines,
    margins,
    program_lines,
    program_rows,
    strategy_lines,
)
from console.tui.theme import Token
from console.tui.ui_context import View
from console.units import METRIC
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.preview.outlook import outlook
from drivers.preview.preview import Preview, Program, preview, underway
from drivers.preview.program_prediction import ProgramPrediction, predict, predict_following
from profiles.axis.servo import sampled_response
from profiles.job import NO_LOBE
from profiles.problem import Problem
from profiles.store import load_job, load_machine
from tests.tui.page_stage import shown_on
from tests.tui.stage import (
    EXPERIMENT,
    FRAME_ROWS,
    LANGUAGES,
    MACHINE,
    SIZES,
    FixedControl,
    PageStage,
    experiment,
    grid,
    ui_for,
)

ROOMS = [(columns, rows - FRAME_ROWS) for columns, rows in SIZES]
SMALLEST_ROOM = (60, 12)


@cache
def seen(**changes: object) -> Preview:
    """The preview of experiment 1 with some values changed."""
    job = replace(load_job(EXPERIMENT).job, **changes)  # type: ignore[arg-type]
    return preview(job, load_machine(MACHINE).machine)


def previewed(strategy: str = "pvt", **changes: object) -> Work:
    made = seen(**changes)
    return replace(experiment(), job=made.job, preview=made, strategy=strategy)


def staged(
    work: Work | None, language: str = "en", state: StationState | None = None
) -> tuple[PageStage, PreviewPage]:
    state = state or StationState()
    page = PreviewPage(ui_for(FixedControl(state), Path("/nowhere"), language, work))
    return PageStage(page, View(state=state, work=work, now_s=0.0)), page


def shown(
    work: Work | None,
    size: tuple[int, int] = ROOMS[0],
    language: str = "en",
    acts: Iterable[str] = (),
    state: StationState | None = None,
) -> str:
    """The text on the terminal, after some keys of the page."""
    room = (size[0], size[1] + FRAME_ROWS)
    now = state or StationState()
    return shown_on(PreviewPage, now, *acts, size=room, language=language, work=work, no_job=work is None).text


def by_order(prediction: ProgramPrediction, n: int) -> complex:
    """The harmonic of the residual at equal angles, um; crest at jaw 1 is real and positive."""
    harmonic = np.exp(-1j * n * np.radians(prediction.angle_deg - 90.0))
    return complex(2.0 * np.mean(prediction.residual_um * harmonic))


@pytest.mark.parametrize(
    ("number", "ts_ms", "measured_um"), [(1, 10, 28.15), (1, 5, 43.36), (2, 10, 16.88), (2, 5, 26.01)]
)
def test_the_printed_program_leaves_what_the_simulated_machine_measures(
    number: int, ts_ms: int, measured_um: float
) -> None:
    """The closed loop, cut and released in the simulator, was measured: 28.2 um of 55 with the printed times."""
    job, machine = load_job(f"lee-2001-experiment-{number}").job, load_machine(MACHINE).machine
    made = predict(job, machine, plan_cut(job, machine, Strategy.PAPER, ts_ms))
    assert made.ront_um == pytest.approx(measured_um, abs=0.1)


def test_the_printed_program_keeps_its_share_of_the_stroke_times_the_servo() -> None:
    """A full S-curve zig-zag has 0.65702 of its stroke in the lobe and 0.00811 in the third of it."""
    made = seen().predictions[Strategy.PAPER]
    first, third = (complex(sampled_response(seen().machine, hz)) for hz in (25.0, 75.0))
    assert made.lobe_frequency_hz == pytest.approx(25.0)
    assert by_order(made, 3) == pytest.approx(27.5 * (1.0 - 0.65702 * first), abs=0.02)
    assert abs(by_order(made, 9)) == pytest.approx(27.5 * 0.00811 * abs(third), abs=0.02)
    assert made.stroke_um == pytest.approx(55.0 * 2.0 / 3.0, abs=0.01)
    assert made.mean_um == pytest.approx(127.5, abs=0.01)


@pytest.mark.parametrize(
    "changes",
    [{}, {"jaws": 4, "lobe_error_um_pp": 21.0, "lobe_phase_deg": 33.0, "spindle_speed_rpm": 640.0}],
    ids=["experiment", "other chuck"],
)
@pytest.mark.long
def test_the_inverse_leaves_what_its_cubics_miss_and_none_leaves_all(changes: dict[str, float]) -> None:
    predictions = seen(**changes).predictions
    error_um = seen(**changes).job.lobe_error_um_pp
    assert predictions[Strategy.PVT].ront_um < 0.1
    assert predictions[Strategy.NONE].ront_um == pytest.approx(error_um, abs=0.01)
    assert predictions[Strategy.NONE].stroke_um == pytest.approx(0.0, abs=1e-6)
    assert predictions[Strategy.PVT].mean_um == pytest.approx(100.0, abs=0.01)


def test_the_servo_turns_and_scales_a_sine_and_passes_a_depth() -> None:
    machine = seen().machine
    angle = np.radians(np.arange(720) / 2.0)
    response = complex(sampled_response(machine, 50.0))
    expected = 100.0 + 10.0 * abs(response) * np.cos(3.0 * angle + math.atan2(response.imag, response.real))
    assert predict_following(machine, 100.0 + 10.0 * np.cos(3.0 * angle), 1000.0) == pytest.approx(
        expected, abs=1e-6
    )


@pytest.mark.long
def test_what_cannot_be_planned_is_said_and_the_rest_is_shown() -> None:
    """At 3000 rpm of six jaws the lobe is at 300 Hz: too fast for segments of 1 ms."""
    made = seen(jaws=6, spindle_speed_rpm=3000.0)
    assert Strategy.PVT not in made.predictions
    assert Strategy.NONE in made.predictions
    text = shown(previewed("pvt", jaws=6, spindle_speed_rpm=3000.0), (160, 42))
    assert "✗ refused" in text
    assert "1 ms" in text


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", [*ROOMS, SMALLEST_ROOM])
async def test_every_strategy_with_what_it_leaves_is_on_the_page(room: tuple[int, int], language: str) -> None:
    app, page = staged(previewed("pvt"), language)
    async with app.run_test(size=room) as pilot:
        await pilot.pause()
        for strategy in ("pvt", "paper", "none"):
            page.show(replace(app.view, work=previewed(strategy)))
            await pilot.pause()
            rows = grid(app).split("\n")
            assert all(cell_len(row) <= room[0] for row in rows) and len(rows) <= room[1]
            for name, left in (("pvt", "2.0 um"), ("paper", "38.5 um"), ("none", "67.0 um")):
                row = next(row for row in rows if f" {name} " in row and left in row)
                assert ("▸" in row) == (name == strategy)


def test_the_plots_have_their_scale_and_keys() -> None:
    text = shown(previewed("paper"))
    for words in (
        "RONt, section at Z 26.0 mm",
        "Predicted RONt, worst section",
        "20 um/div",
        "jaw 1 at 90.0°",
        "(assumed)",
        "- - without",
        "── paper",
        "240",
        "360°",
    ):
        assert words in text
    assert "LSC, free, unfiltered" in text


@pytest.mark.long
def test_jaw_1_is_said_to_be_found_when_the_alignment_found_it() -> None:
    work = previewed(lobe_phase_deg=47.5)
    jaw = JawAngle(angle_deg=47.5, jaws=3, at="20 Nov 08:45")
    text = shown(work, (100, 24), state=StationState(alignment=Alignment(jaw=jaw)))
    assert "jaw 1 at 47.5°" in text
    assert "(found 20 Nov" in text
    assert "assumed" not in text
    older = replace(jaw, angle_deg=12.0)
    assert "(assumed)" in shown(work, (100, 24), state=StationState(alignment=Alignment(jaw=older)))


@pytest.mark.parametrize(
    ("language", "said"), [("en", "worst section Z 22.2 mm: "), ("ko", "최악 단면 Z 22.2 mm: ")]
)
def test_the_worst_section_is_named_beside_the_polar_plot(language: str, said: str) -> None:
    """What one amplitude leaves is largest at the jaws' side; below 2 um nothing is forecast."""
    assert f"{said}2.0 um" in shown(previewed("pvt"), language=language)
    assert f"{said}38.5 um" in shown(previewed("paper"), language=language)


@pytest.mark.parametrize("language", LANGUAGES)
def test_m_shows_the_map_in_place_of_path_and_margins_and_a_wide_page_has_all(language: str) -> None:
    text = load(language)
    title = text("preview_page.map", unit="mm")
    path, needs = (text(f"preview_page.{each}") for each in ("path", "margins"))
    for acts, there, gone in (
        ((), (path, needs), title),
        (("preview.map",), (title, "22.2▸", "▓/=  10 um/div"), path),
    ):
        seen_now = shown(previewed("paper"), language=language, acts=acts)
        assert all(words in seen_now for words in there) and gone not in seen_now
    assert path in shown(previewed("paper"), language=language, acts=("preview.map", "preview.map"))
    whole = shown(previewed("paper"), (160, 42), language)
    assert all(words in whole for words in (title, "22.2▸", path, needs))


def test_until_its_program_exists_and_without_a_lobe_no_section_is_named() -> None:
    work = previewed("paper")
    assert work.preview is not None
    early = underway(outlook(work.job, work.machine.machine, Strategy.PAPER), {})
    assert "worst section …" in shown(replace(work, preview=None, outlook=early))
    assert "worst section Z" not in shown(previewed("none", lobe_error_source=NO_LOBE, lobe_error_um_pp=0.0))


def test_with_and_without_compensation_differ_by_more_than_colour() -> None:
    without, with_ = roundness_traces(seen(), Strategy.PAPER)
    assert (without.token, without.dashed) == (Token.BEFORE, True)
    assert (with_.token, with_.dashed) == (Token.AFTER, False)
    assert float(np.ptp(np.asarray(without.deviation_um))) == pytest.approx(55.0, abs=0.01)
    target, command = path_series(seen(), Strategy.PVT, 1.0)
    assert (target.dashed, command.dashed) == (False, True)
    assert float(np.ptp(np.asarray(command.y))) == pytest.approx(62.1, abs=0.1)
    assert len(roundness_traces(seen(), Strategy.NONE)) == 1


def test_margins_are_percent_and_both_values() -> None:
    """Table 2: 400 N continuous, 36.8 A; Ix16 is 100 mm/s; the sampled loop has 84.0 Hz (docs/tuning.md).

    The stroke is that where the lobe is largest: 1.23 times the 62.1 um mid-cut.
    """
    lines = plain_text(margin_lines(margins(seen(), Strategy.PVT, METRIC), load("en"), 60, 6)).split("\n")
    assert [line.split() for line in lines] == [
        [*"stroke □□□□□□□□□□□□□□□□□□□□□□□ 0.076 / 77.000 mm 0 %".split()],
        [*"velocity ■■■□□□□□□□□□□□□□□□□□□□□ 12.0 / 100.0 mm/s 12 %".split()],
        [*"accel. □□□□□□□□□□□□□□□□□□□□□□□ 3.8 / 250.0 m/s2 2 %".split()],
        [*"thrust, rms ■□□□□□□□□□□□□□□□□□□□□□□ 12.7 / 400.0 N 3 %".split()],
        [*"current □□□□□□□□□□□□□□□□□□□□□□□ 0.33 / 36.80 A 1 %".split()],
        [*"servo loop ■■■■■■■■■■■■■■□□□□□□□□□ 50.0 / 84.0 Hz 60 %".split()],
    ]


def test_a_bar_is_full_only_at_all_of_the_limit() -> None:
    def bar(need: float) -> str:
        margin = Margin(name="loop", need=need, limit=100.0, decimals=1, unit="Hz")
        return plain_text(margin_lines([margin], load("en"), 45, 1))

    assert "□" in bar(99.0)
    assert "□" not in bar(100.0)


@pytest.mark.long
def test_a_lobe_above_the_bandwidth_is_marked_not_only_coloured() -> None:
    fast = seen(spindle_speed_rpm=2000.0)
    lines = margin_lines(margins(fast, Strategy.PVT, METRIC), load("en"), 60, 6)
    assert plain_text(lines).split("\n")[-1].endswith("100.0 / 84.0 Hz 119 %!")
    assert (" 119 %", Token.WARNING) in lines[-1]


def test_a_plain_cut_needs_nothing_of_the_drive() -> None:
    lines = plain_text(margin_lines(margins(seen(), Strategy.NONE, METRIC), load("en"), 60, 6)).split("\n")
    assert all("  0 %" in line for line in lines[:-1])


def test_servo_and_inverse_are_told_at_the_frequency_that_is_reached() -> None:
    """The sampled loop at 50 Hz has 0.886 and 0.902 rad (51.7 deg) of lag, a third of it in spindle angle."""
    text = plain_text(strategy_lines(seen(), Strategy.PVT, load("en"), 60, 12))
    assert "servo at 50.0 Hz" in text
    assert "x0.886  -51.7°" in text
    assert "x1.129, lead 17.2° spindle" in text
    paper = plain_text(strategy_lines(seen(), Strategy.PAPER, load("en"), 60, 24))
    assert "servo at 25.0 Hz" in paper
    assert "not inverted" in paper
    assert "127.5 um" in paper
    assert "blending leaves 36.67 um" in paper


async def test_the_charts_come_with_the_preview_c_steps_through_the_strategies_and_every_size_is_survived() -> (
    None
):
    app, page = staged(experiment())
    page.show(app.view)
    async with app.run_test(size=ROOMS[0]) as pilot:
        await pilot.pause()
        page.ui.work = previewed("pvt")
        page.show(replace(app.view, work=page.ui.work))
        await pilot.pause()
        assert "jaw 1 at 90.0°" in grid(app)
        first, *rest = Strategy
        for strategy in (*rest, first):
            page.act("preview.strategy")
            await pilot.pause()
            (row,) = [row for row in grid(app).split("\n") if "▸" in row]
            assert page.ui.work is not None and page.ui.work.strategy == row.split()[1] == strategy
        page.show(replace(app.view, work=previewed("paper")))
        for size in ((1, 1), (2, 2), (60, 3), (60, 12), (200, 60), (80, 18)):
            await pilot.resize_terminal(*size)
            await pilot.pause()
        assert "38.5 um" in grid(app)


@pytest.mark.parametrize("language", LANGUAGES)
def test_without_a_preview_the_page_says_why(language: str) -> None:
    text = load(language)
    assert text("preview_page.no_job") in shown(None, language=language)
    work = experiment()
    assert text("preview_page.computing") in shown(work, language=language)
    problem = Problem(code="response.too_small", value="0.01", limit=">= 0.05")
    refused = shown(replace(work, preview_problems=(problem,)), (160, 42), language)
    assert f"✗ {text.problem(problem)}" in refused


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_next_step_is_one_row_and_names_its_key(language: str) -> None:
    app, page = staged(previewed(), language)
    problem = Problem(code="response.too_small")
    steps = {
        "1": replace(app.view, work=None),
        "2": replace(app.view, work=replace(experiment(), preview_problems=(problem,))),
        "4": app.view,
        "c": replace(app.view, work=previewed("pvt", jaws=6, spindle_speed_rpm=3000.0)),
    }
    for key, view in steps.items():
        words = plain_text([page.next_step(view)])
        assert key in words
        assert cell_len(words) <= 77
    assert cell_len(plain_text([page.next_step(replace(app.view, work=experiment()))])) <= 77


# The program view shows the exact text, every character of it, with the checker's findings on top.


ROOM = (80, 18)


@cache
def seen_program() -> Preview:
    return preview(load_job(EXPERIMENT).job, load_machine(MACHINE).machine)


def text_of(strategy: Strategy) -> str:
    plan = seen_program().strategies[strategy]
    assert isinstance(plan, CutPlan)
    return plan.text


def shown_program(*acts: str, strategy: Strategy = Strategy.PAPER, language: str = "en") -> str:
    work = replace(experiment(), preview=seen_program(), strategy=strategy.value)
    return shown(work, ROOM, language, acts)


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
    said = plain_text(program_rows(seen_program(), Strategy.PAPER, load("en"), 200)).split("\n")
    assert said[0].startswith("! the controller stretches each segment to 20 ms")
    assert said[1] == "! the spindle will turn at 500 rpm, not at the job's 1000 rpm"
    assert said[2].startswith("! blending leaves 36.67 um (66.7 %)")
    assert plain_text(program_rows(seen_program(), Strategy.PVT, load("en"), 200)).startswith("✓ no findings")


@pytest.mark.parametrize("language", LANGUAGES)
def test_p_shows_the_program_and_takes_it_away(language: str) -> None:
    text = load(language)
    program = shown_program("preview.program", language=language)
    assert "P100=1000" in program
    assert text("preview_page.program", strategy="paper") in program
    assert all(cell_len(row) == ROOM[0] for row in program.split("\n"))
    charts = shown_program("preview.program", "preview.program", language=language)
    assert "P100=1000" not in charts
    assert text("preview_page.scale", value="20") in charts


@pytest.mark.long
def test_up_and_down_go_through_all_of_it_and_no_further() -> None:
    numbers: set[int] = set()
    for down in range(5):
        rows = shown_program("preview.program", *["preview.down"] * down).split("\n")
        numbers |= {int(found[1]) for row in rows if (found := re.match(r"│ *(\d+) ", row))}
    assert numbers == set(range(1, len(text_of(Strategy.PAPER).splitlines()) + 1))
    last = shown_program("preview.program", *["preview.down"] * 9)
    assert "rows 30-45 of 45" in last
    assert shown_program("preview.program", *["preview.down"] * 9, "preview.up") != last
    assert shown_program("preview.program", *["preview.down"] * 3, *["preview.up"] * 9) == shown_program(
        "preview.program"
    )


def test_a_program_that_is_still_made_is_not_shown_as_one_without_findings() -> None:
    early = underway(seen_program(), {})
    said = plain_text(program_rows(early, Strategy.PVT, load("en"), 80))
    assert load("en")("preview_page.checking") in said
    assert "no findings" not in said


async def test_it_stays_where_it_was_scrolled_to_when_another_program_is_there() -> None:
    made = seen_program()
    paper = Program(plan=made.strategies[Strategy.PAPER], prediction=made.predictions[Strategy.PAPER])
    early = underway(made, {Strategy.PAPER: paper})
    work = replace(experiment(), outlook=early, strategy="paper")
    app, page = staged(work)
    async with app.run_test(size=ROOM) as pilot:
        await pilot.pause()
        for action in ("preview.program", "preview.down"):
            page.act(action)
            await pilot.pause()
        before = grid(app)
        page.show(replace(app.view, work=replace(work, outlook=made, preview=made)))
        await pilot.pause()
        assert "rows 9-24 of" in before and grid(app) == before


def test_another_strategy_begins_at_its_top() -> None:
    text = shown_program(
        "preview.program", "preview.down", "preview.strategy", "preview.strategy", strategy=Strategy.PAPER
    )
    assert "Program pvt" in text
    assert "✓ no findings" in text
