"""The page Align: what it shows of the machine, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from console.session.cut.alignment import Alignment
from console.session.station.commands import GoTo
from console.session.station.jogging import Steps
from console.session.station.state import Activity, StationState, StopState
from console.session.work import edit_field
from console.text.catalogue import load
from console.tui.keymap import PageName
from console.tui.lines import plain_text
from console.tui.pages.align import AlignPage
from console.tui.pages.jog_lines import JogView, jaw_words, jog_lines, jog_panel
from console.tui.ui_context import View
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.lobe.lobe_origin import without_lobe
from profiles.store import load_machine
from tests.tui import align_stage
from tests.tui.align_stage import IN_PART, NEAR, NO_JAW, OFF, OTHER, VALID, look, shown, state, words_of
from tests.tui.page_stage import run_apart, shown_in_turn, too_wide
from tests.tui.scenes import console_at
from tests.tui.stage import (
    CLAMPED,
    LANGUAGES,
    MACHINE,
    ON,
    SIZES,
    FixedControl,
    PageStage,
    experiment,
    grid,
    ui_for,
)

STOPPING = StopState(reason="space", killed=False, sent_s=99.9)


STATES = {
    "nothing done": state(Alignment()),
    "jaw not found": state(NO_JAW),
    "jaw off": state(VALID),
    "all done": state(VALID, seen=NEAR),
    "lost": state(VALID, activity=Activity.LOST),
    "tool in part": state(OTHER, snapshot=IN_PART),
    "in part and off": state(OTHER, snapshot=look(OFF | {"home_complete"}, carriage_mm=172.0)),
}


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [*SIZES, (60, 18)])
def test_no_row_is_wider_than_the_terminal(size: tuple[int, int], language: str) -> None:
    pages = shown_in_turn(AlignPage, STATES, "align.enable", size=size, language=language)
    assert too_wide(pages, size, "align_page.") == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_positions_have_their_units_in_every_language(language: str) -> None:
    text = shown(state(), language=language).text
    # 76 mm less 50 mm, 41200 counts of 1 um, 350 counts of 360/10000 degrees after one whole turn.
    assert "R 26.0000 mm" in text
    assert "41.200 mm" in text
    assert "12.60 °" in text
    assert "0.6 um" in text


@pytest.mark.parametrize(
    ("counts", "written"), [(-66.0, " -13.2 um"), (-2000.0, " -400.0 um"), (-7000.0, " -1.400 mm")]
)
def test_a_following_error_stands_apart_from_its_position(counts: float, written: str) -> None:
    for language in LANGUAGES:
        assert f"R 26.0000 mm{written}" in " ".join(
            shown(state(snapshot=look(error=counts)), language=language).text.split()
        )


@pytest.mark.parametrize("language", LANGUAGES)
def test_before_home_no_axis_is_said_to_be_anywhere(language: str) -> None:
    homing = Alignment(settings=(), drives_on=True, clamping=CLAMPED)
    text = shown(state(homing, snapshot=look(ON - {"home_complete"})), language=language).text
    # R 26.0000 mm, 41.200 mm and 12.60 degrees are counts from wherever the axes stood; the error is what it is.
    assert not any(value in text for value in ("26.0000", "41.200", "12.60"))
    assert "– 0.6 um ○" in " ".join(text.split())


def test_each_axis_is_somewhere_as_soon_as_it_was_homed() -> None:
    seen = look()
    partly = replace(seen, spindle=replace(seen.spindle, flags=seen.spindle.flags - {"home_complete"}))
    text = shown(state(Alignment(settings=()), snapshot=partly)).text
    assert "R 26.0000 mm" in text
    assert "12.60" not in text


@pytest.mark.parametrize(("language", "name"), [("en", "force, total = 2000 N"), ("ko", "척킹력, 합계 = 2000 N")])
def test_a_value_of_the_job_has_the_name_that_set_up_gives_it(language: str, name: str) -> None:
    work = experiment()
    harder = replace(work, job=replace(work.job, chucking_force_n=2000.0))
    page = shown(state(Alignment(settings=()), snapshot=look(OFF)), work=harder, language=language, size=(160, 48))
    assert name in words_of(page.text)
    assert "chucking_force_n" not in page.text


NARROW, WIDE = (80, 24), (100, 30)
PAST_STOP = state(
    Alignment(settings=(), clamping=CLAMPED), activity=Activity.STOPPED, stop=replace(STOPPING, rest_s=99.95)
)


@pytest.mark.parametrize(
    ("now", "size", "words", "without"),
    [
        (state(VALID), NARROW, ("R 26.5000 mm", "12.60 °  08:45", "3 jaws", "R 76.500 mm  08:46", "D 52 "), ""),
        (state(VALID), WIDE, ("Alignment: valid", "1314 N  08:40", "12.60 °, 3 jaws  08:45"), ""),
        (state(VALID), WIDE, ("R 76.500 mm, D 52  08:46",), ""),
        (state(snapshot=replace(look(), asked_s=97.0)), NARROW, ("STALE: last poll 3 s ago",), ""),
        (state(), NARROW, ("✓ 4 homed", "● 5 jaw 1", "○ 6 touch-off", "until jaw 1 reaches the mark"), "STALE"),
        (state(), WIDE, ("◂",), ""),
        (state(VALID, simulated=False, seen=None), NARROW, ("in phase",), ""),
        (PAST_STOP, NARROW, ("F2 resets",), "Hands"),
    ],
)
def test_the_page_says_what_is_the_case(
    now: StationState, size: tuple[int, int], words: tuple[str, ...], without: str
) -> None:
    text = shown(now, size=size).text
    assert [each for each in words if each not in text] == []
    assert not without or without not in text


def test_nothing_known_is_shown_as_nothing() -> None:
    page = shown(state(Alignment(), snapshot=None, seen=None), "align.step")
    assert "R " not in page.text.split("Jog")[0]
    assert "–" in page.text
    assert (page.orders, page.said) == ([], ["screen.nothing_known"])


@pytest.mark.parametrize(
    ("changes", "step"), [({"jaws": "2"}, "○ 5 jaw 1"), ({"diameter_mm": "60"}, "○ 6 touch-off")]
)
def test_another_chuck_or_diameter_is_not_ticked(changes: dict[str, str], step: str) -> None:
    """Experiment 1 was aligned; a job with other jaws or another diameter is opened."""
    other = experiment()
    for key, value in changes.items():
        other = edit_field(other, key, value)
    page = shown(state(VALID), work=other)
    assert "Alignment: not valid" in page.text
    assert "● 2 clamped" in page.text and step in page.text


def test_what_is_seen_is_told_as_simulated() -> None:
    text = shown(state(), size=(100, 30)).text
    assert "SIM jaw 1 is 12.34° past the mark" in text
    assert "SIM gap from tool to part 0.250 mm" in text
    # In 24 rows that of the present step.
    assert ("past the mark" in shown(state()).text, "SIM gap" in shown(state()).text) == (True, False)
    found = shown(state(VALID)).text
    assert ("past the mark" in found, "SIM gap" in found) == (False, True)
    touching = shown(state(seen=WorkshopView(jaw_1_past_mark_deg=-0.5, tool_gap_mm=-0.002)), size=(100, 30)).text
    assert "0.50° before the mark" in touching
    assert "touches, 0.002 mm deep" in touching
    just = shown(state(VALID, seen=WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=0.0))).text
    assert "touches, 0.000 mm deep" in just


def test_a_tool_in_its_own_scratch_is_not_said_to_touch() -> None:
    scratched = WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=0.0, collisions=("standing_part",))
    found = replace(VALID, touch_off=None)
    page = shown(state(found, snapshot=look(carriage_mm=172.0), seen=scratched))
    assert "in a scratch it has made" in page.text
    assert "touch off there" in page.next_step and "Enter takes" not in page.next_step


def test_a_real_machine_has_no_simulated_view() -> None:
    page = shown(state(simulated=False, seen=None), size=(100, 30))
    assert "SIM" not in page.text
    assert "indicator" in page.text
    assert "seen" not in page.text


def test_the_clamping_names_blank_and_force_and_why() -> None:
    text = " ".join(shown(state(Alignment(settings=()), snapshot=look(OFF)), size=(160, 48)).text.split())
    assert "D 52.000 mm" in text
    assert "1314 N total" in text
    assert "the 55.0 um lobe" in text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("past_deg", "phrase"), [(0.4, "in phase"), (12.34, "all readings taken")])
def test_in_phase_is_claimed_only_where_jaw_1_was_taken_at_the_mark(
    past_deg: float, phrase: str, language: str
) -> None:
    # The spindle stands where jaw 1 was taken, so that what is seen now is what was seen then.
    taken = state(VALID, seen=WorkshopView(jaw_1_past_mark_deg=past_deg, tool_gap_mm=0.25))
    page = shown(taken, language=language)
    assert ("12.34°" in words_of(page.text)) is (past_deg > 1.0)
    if language == "en":
        assert phrase in page.text
        assert ("in phase" in page.text) is (past_deg <= 1.0)
        assert page.next_step.startswith("Aligned.") is (past_deg <= 1.0)


def test_without_a_known_lobe_nothing_is_in_phase() -> None:
    work = experiment()
    plain_job = replace(work, job=replace(without_lobe(work.job), roundness_tolerance_um=5.0))
    seen = WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=0.25)
    for now in (state(VALID, simulated=False, seen=None), state(VALID, seen=seen)):
        text = shown(now, work=plain_job).text
        assert "✓ all readings taken" in text and "in phase" not in text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("simulated", [True, False])
def test_which_arrow_moves_which_way_is_the_last_that_goes(simulated: bool, language: str) -> None:
    """Also with a step that is too long, and under an alarm of three lines; what is left out is marked."""
    text, machine = load(language), load_machine(MACHINE).machine
    now = state(VALID) if simulated else state(VALID, simulated=False, seen=None)
    jog = JogView(
        machine=machine,
        state=now,
        steps=Steps(mm=4),
        axis=AxisName.TOOL,
        made=0,
        asked=0,
        now_s=100.0,
        left_s=30.0,
    )
    every, marks = jog_lines(text, jog, 45, None), set[str]()
    for height in range(3, len(every) + 1):
        rows, mark = jog_panel(text, jog, 45, height)
        assert len(rows) <= height
        shown_words = plain_text(rows)
        for arrow in ("↑", "↓", "←", "→", "PgUp"):
            assert arrow in shown_words, (height, arrow)
        assert bool(mark) is (set(filter(None, every)) - set(rows) != set())
        assert "[10.000]" in shown_words or height < 5
        marks.add(mark)
    assert marks == {"", text("panel.more")}
    page = shown(now, language=language, size=(80, 22))
    assert "↑" in page.text and text("panel.more") in page.text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"activity": Activity.STOPPING, "stop": STOPPING}, "Stopping"),
        ({"activity": Activity.HOMING}, "Moving"),
        ({"activity": Activity.LOST}, "does not answer"),
        ({"activity": Activity.LOST, "stop": STOPPING}, "does not answer"),
    ],
)
def test_no_advice_for_hands_while_something_may_move(changes: dict[str, Any], phrase: str, language: str) -> None:
    off = state(Alignment(settings=(), clamping=CLAMPED), snapshot=look(OFF), **changes)
    page = shown(off, language=language)
    assert not any(word in page.text + page.next_step for word in ("F4", "Hands", "Enter", "손을"))
    if language == "en":
        assert phrase in words_of(page.text)
        assert phrase in page.next_step


def test_of_a_lost_machine_nothing_is_shown_as_known() -> None:
    moving = look(ON - {"desired_velocity_zero"})
    page = shown(state(VALID, activity=Activity.LOST, snapshot=moving), size=(100, 30))
    assert "STALE" in page.text
    assert "MOVING" not in page.text
    assert "? 3 drives on" in page.text
    assert "? 4 homed" in page.text
    assert "Alignment: unknown" in page.text
    assert "R 26.5000 mm 0.6 um ? ?" in " ".join(page.text.split())
    assert "SIM jaw" not in page.text


async def test_showing_the_same_again_paints_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ui = ui_for(FixedControl(state()), Path("/nowhere"), work=experiment())
    page, painted = AlignPage(ui), []
    view = View(state=state(), work=ui.work, now_s=100.0)
    async with PageStage(page, view).run_test(size=(80, 18)) as pilot:
        await pilot.pause()
        page.show(view)
        for sheet in page.query("Sheet"):
            monkeypatch.setattr(sheet, "refresh", lambda *_, **__: painted.append(1))
        page.show(view)
    assert painted == []


@pytest.mark.parametrize(
    ("past_deg", "counts_per_rev", "said"),
    [
        (0.0, 10_000, "jaw 1 is at the mark"),
        (0.02, 10_000, "jaw 1 is at the mark"),
        (-0.02, 10_000, "jaw 1 is at the mark"),
        (0.03, 10_000, "0.03°"),
        (-0.03, 10_000, "0.03°"),
        (0.01, 1_000_000, "0.01°"),
        (0.09, 2_000, "jaw 1 is at the mark"),
        (0.10, 2_000, "0.10°"),
    ],
)
def test_jaw_1_is_at_the_mark_where_no_whole_count_is_nearer(
    past_deg: float, counts_per_rev: int, said: str
) -> None:
    """Half a count is 0.018 deg with 10000 counts a turn, 0.09 with 2000; what is seen is rounded to 0.01."""
    machine = load_machine(MACHINE).machine
    spindle = replace(machine.spindle, encoder_lines_per_rev=counts_per_rev // 4, counts_per_line=4)
    seen = WorkshopView(jaw_1_past_mark_deg=past_deg, tool_gap_mm=None)
    assert said in jaw_words(load("en"), seen, replace(machine, spindle=spindle))


# A typed target on the page Align: nothing moves while it is typed, and F6 alone goes there.


READY = align_stage.state(VALID, snapshot=look(carriage_mm=150.0))
STOPPED = StopState(reason="space", killed=False, sent_s=99.0, rest_s=99.5)


@dataclass(frozen=True)
class Typed:
    orders: list[object]
    stops: list[str]
    said: list[str]
    text: str


def typed(data: Path, *keys: str, now: StationState = READY, then: StationState | None = None) -> Typed:
    """Press keys on the whole console, 0.9 s apart; look at the end, with `then` as the machine."""

    async def run() -> Typed:
        async with console_at(data / str(len(list(data.iterdir()))), PageName.ALIGN, now) as (app, pilot, control):
            for n, key in enumerate(keys):
                control.at(100.0 + 0.9 * n)
                await pilot.press(key)
                await pilot.pause()
            control.state = then or control.state
            for _ in range(2):
                app.tick()
                await pilot.pause()
            return Typed(list(control.orders), control.stops, [each.code for each in app.ui.key_answer], grid(app))

    return run_apart(run)


@pytest.mark.parametrize("number", ["166.0", "166,0"])
@pytest.mark.first(1)
def test_a_target_is_shown_as_it_is_understood_and_f6_goes_there(number: str, tmp_path: Path) -> None:
    before = typed(tmp_path, "j", "g", *number)
    assert before.orders == []
    assert "→ 166.000 mm" in before.text
    # 16 mm at 10 mm/s, and 0.1 s of acceleration.
    assert "16.000 mm toward the chuck, 1.7 s" in before.text
    assert "-5.000 to 198.000" in before.text
    after = typed(tmp_path, "j", "g", *number, "f6")
    assert after.orders == [GoTo(axis=AxisName.CARRIAGE, target=166.0)]


@pytest.mark.long
def test_g_again_asks_for_c_which_goes_the_shorter_way(tmp_path: Path) -> None:
    # A turn and 12.6 degrees.
    page = typed(tmp_path, "j", "g", "g", "3", "5", "0")
    assert "22.60 ° against the cut" in page.text
    assert typed(tmp_path, "j", "g", "g", "3", "5", "0", "f6").orders == [
        GoTo(axis=AxisName.SPINDLE, target=350.0)
    ]
    assert "Go to" not in typed(tmp_path, "g", "g", "g").text


@pytest.mark.parametrize(
    ("keys", "code"),
    [
        (("g", "9", "0", "f6"), "screen.jog_not_enabled"),
        (("j", "f6"), "screen.nothing_typed"),
        (("j", "g", "f6"), "screen.nothing_typed"),
        (("j", "g", "9", "9", "9", "f6"), "machine.target_out_of_range"),
        (("j", "g", "1", ",", "0", "0", "0", "f6"), "value.ambiguous"),
        (("j", "g", "-", "f6"), "value.not_number"),
        (("j", "g", "1", "0", "enter"), "screen.f6_goes"),
        (("j", "g", "1", "0", "up"), "screen.entry_open"),
        (("j", "g", "1", "0", "f4"), "screen.entry_open"),
    ],
)
@pytest.mark.first(3)
def test_what_is_not_a_target_moves_nothing(keys: tuple[str, ...], code: str, tmp_path: Path) -> None:
    page = typed(tmp_path, *keys)
    assert (page.orders, page.stops, page.said) == ([], [], [code])


def test_a_target_in_the_part_is_refused_while_it_is_typed(tmp_path: Path) -> None:
    # The tip at R 26.0: at the surface of the part, whose face is at 170 mm.
    at_part = replace(VALID, touch_off=replace(VALID.touch_off, zero_radius_mm=76.0))  # type: ignore[type-var]
    page = typed(tmp_path, "j", "g", "1", "7", "5", "f6", now=replace(READY, alignment=at_part))
    assert (page.orders, page.said) == ([], ["machine.tool_in_the_way"])
    assert "✗" in page.text
    assert "the tool is, or would come, too near the part" in " ".join(page.text.split())


@pytest.mark.parametrize(
    "then",
    [
        replace(READY, stop=STOPPED, activity=Activity.STOPPED),
        replace(READY, activity=Activity.LOST),
        replace(READY, activity=Activity.HOMING),
    ],
)
@pytest.mark.first(1)
def test_an_entry_ends_with_a_stop_a_lost_machine_and_a_motion(then: StationState, tmp_path: Path) -> None:
    assert "Go to Z" in typed(tmp_path, "j", "g", "9").text
    assert "Go to Z" not in typed(tmp_path, "j", "g", "9", then=then).text


def test_space_stops_in_an_entry_too(tmp_path: Path) -> None:
    assert typed(tmp_path, "j", "g", "9", "space").stops == ["space"]


def test_without_drives_or_zeros_no_target_means_anything() -> None:
    off = align_stage.state(replace(VALID, drives_on=False), snapshot=look(OFF))
    assert shown(off, "align.goto").said == ["alignment.drives_off"]
    unhomed = align_stage.state(replace(VALID, homed=False), snapshot=look(ON - {"home_complete"}))
    assert shown(unhomed, "align.goto").said == ["alignment.not_homed"]


def test_what_moves_shows_how_long_it_still_takes() -> None:
    going = align_stage.state(VALID, activity=Activity.JOGGING, ends_s=104.2)
    assert "MOVING, 4 s left" in shown(going).text
    homing = align_stage.state(VALID, activity=Activity.HOMING, snapshot=look(ON | {"home_search"}))
    assert "HOMING X" in shown(homing).text
    searching = replace(homing, ends_s=180.4, ends_at_most=True)
    assert "HOMING X, at most 80 s" in shown(searching).text
    assert "left" not in shown(align_stage.state(VALID, ends_s=104.2)).text.split("Jog, step")[0]
