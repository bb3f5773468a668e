"""The page Run after a stop, after a cut that was left, and while nothing is known of the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from console.session.cut.alignment import Alignment
from console.session.station.commands import (
    LEAST_ARMED_S,
    MOST_ARMED_S,
    Arm,
    Command,
    EndCut,
    HoldFeed,
    ResumeFeed,
    Retract,
)
from console.session.station.progress import AxisToGo, CutPhase, CutStage, PhaseLeft
from console.session.station.state import Activity, StationState
from console.session.work import edit_field
from console.text.catalogue import load
from console.tui.keymap import actions_of
from console.tui.lines import line, plain_text
from console.tui.pages.cut_lines import gauge
from console.tui.pages.fields import name_field
from console.tui.pages.run import RunPage, reading_s
from console.tui.pages.run_lines import summary_lines
from console.tui.run.error_band import band_series, error_band
from console.tui.ui_context import View
from drivers.cutting.feed_hold import HoldReport, HoldState
from drivers.cutting.program_reports import ProgramPlace
from drivers.lathe.snapshot import AxisName
from profiles.problem import Problem
from tests.tui.page_stage import shown_in_turn
from tests.tui.run_stage import (
    CUT_IN_PART,
    OFF,
    STATES,
    SURFACE_COUNTS,
    VALID,
    cut,
    cutting,
    frames_of,
    look,
    shown,
    state,
    stopped,
)
from tests.tui.stage import LANGUAGES, ON, REST, SIZES, FixedControl, experiment, ui_for

FRESH = state(Alignment(), snapshot=look(REST | {"open_loop"}, tool=0.0, carriage=0.0))
"""The controller was switched on a moment ago: nothing is homed, clamped or energised."""


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_cut_left_before_a_restart_of_the_controller_is_got_out_of_by_homing(language: str) -> None:
    """F8 on the path of a cut would need the zero that is lost; page 4 says the same."""
    early = (Problem(code="alignment.ended_early"),)
    left = replace(VALID, clamping=None, homed=False, lost=early)
    on, off = (
        shown(state(left, snapshot=look(flags), cut=cut()), language=language)
        for flags in (ON - {"home_complete"}, OFF - {"home_complete"})
    )
    words = load(language)
    assert on.next_step == words("run_page.next.home_out") and "F4" in on.next_step
    assert off.next_step == words("run_page.next.home_out_off") and off.next_step.count("F4") == 2
    at_home = state(replace(left, homed=True), snapshot=look(tool=0.0), cut=cut())
    assert shown(at_home, language=language).next_step == words("run_page.next.align"), "to clamp a new blank"


def test_a_stop_tells_how_it_ended_and_what_to_do() -> None:
    page = shown(STATES["stopped in the part"])
    assert "1.3 s" in page.text
    assert "IN OR AT THE PART" in page.text
    assert "F2 resets" in page.words
    assert "press F8 to retract the tool" in page.words
    assert "NOT YET" in shown(STATES["stopping"]).text
    killed = shown(STATES["killed in the part"])
    assert "! disabled" in killed.text
    assert "F8 cannot retract the tool" in killed.words


def test_retract_says_why_not() -> None:
    states = {
        "screen.stopped_first": stopped(tool_in_part=True, can_retract=True),
        "screen.in_motion": cutting(),
        "screen.tool_is_out": state(),
        "machine.retract_not_possible": state(snapshot=look(OFF, tool=SURFACE_COUNTS)),
        "alignment.drives_off": state(snapshot=look(OFF)),
        "machine.tool_unknown": FRESH,
        "machine.tool_unknown, nothing clamped": state(replace(VALID, clamping=None), snapshot=look(OFF)),
        "screen.busy": state(activity=Activity.ARMING, snapshot=look(tool=SURFACE_COUNTS)),
        "screen.nothing_known": StationState(),
    }
    for name, page in shown_in_turn(RunPage, states, "run.retract").items():
        assert (page.orders, page.said) == ([], [name.partition(",")[0]])


def test_retract_after_a_cut_that_was_left() -> None:
    left = state(snapshot=look(tool=SURFACE_COUNTS), cut=cut())
    page = shown(left, "run.retract")
    assert page.orders == [Retract()]
    assert "F8" in page.next_step
    assert "enables" in shown(replace(left, snapshot=look(OFF, tool=SURFACE_COUNTS))).next_step


def test_the_stop_panel_is_whole_when_it_is_first_seen() -> None:
    *_, frame = frames_of([cutting(), STATES["stopping"]])
    assert "Wait until standstill is confirmed" in frame
    assert not any(len(row.strip("│ ")) == 1 for row in frame.splitlines())


def test_a_stop_on_the_way_to_the_start_shows_no_values_of_a_cut() -> None:
    page = shown(STATES["stop on the way to the start"])
    assert "Last values" not in page.text
    assert "no cut was running" in page.text


def test_a_later_stop_does_not_bring_the_values_of_the_cut_back() -> None:
    """The station tells of a stop whether it ended the cut."""
    first, left = stopped(), state(cut=cut())
    second = stopped(sent_s=150.0, rest_s=151.0, of_cut=False)
    frames = frames_of([first, left, second])
    assert ["Last values" in frame for frame in frames] == [True, False, False]


def test_the_way_to_the_touch_off_is_no_cut() -> None:
    left = state(cut=cut())
    *_, frame = frames_of([left, replace(left, activity=Activity.APPROACHING)])
    assert "Before the start" in frame


def test_a_spindle_that_coasts_is_seen() -> None:
    killed = STATES["killed in the part"]
    assert "turning 24 rpm" in shown(replace(killed, spindle_rpm=24.0)).text
    for rpm in (None, 0.0, 0.9):
        assert "turns" not in shown(replace(killed, spindle_rpm=rpm)).text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", SIZES)
def test_a_blank_that_was_cut_in_part_is_not_called_uncut(size: tuple[int, int], language: str) -> None:
    """After F2: what was cut, and where the mark is, are what the next cut is decided by."""
    text = load(language)
    page = shown(STATES["cut in part"], size=size, language=language)
    assert text("run_page.check.fresh_blank") not in page.words
    assert text("run_page.check.touched_blank") in page.words
    assert text("problem.screen.part_is_touched", value="4.2", limit="8.0") in page.words
    assert text("problem.screen.part_is_marked", value="4.2") in page.words
    assert text("run_page.cut_to", z="4.2", length="8.0") in page.words
    assert page.next_step == text("run_page.next.arm_again")


def test_a_mark_beyond_the_last_poll_tells_how_far_the_part_is_cut() -> None:
    """After a lost link the last poll in the cut is from before it, the mark from after it."""
    words = shown(replace(STATES["cut in part"], marks_mm=(1.2, 5.4))).words
    assert "Z 5.4 of 8.0 mm" in words and "Z 4.2 of 8.0 mm" not in words
    text = load("en")
    assert text("run_page.cut_to", z="5.4", length="8.0") in words
    assert text("problem.screen.part_is_touched", value="5.4", limit="8.0") in words


def test_what_was_cut_in_part_is_told_may_be_armed_again_and_is_not_forgotten() -> None:
    """While a second cut goes to its start the progress of the first is gone."""
    assert [type(order) for order in shown(STATES["cut in part"], "run.arm").orders] == [Arm]
    again = shown(replace(STATES["stop on the way to the start"], stop=None, **CUT_IN_PART))
    assert "blank partly cut" in again.words
    for name in ("marked", "killed and marked"):
        assert "part cut to Z 4.2 of 8.0 mm" in shown(STATES[name]).words
    for stage in (CutStage.DONE, CutStage.HELD):
        page = shown(state(cut=cut(stage), cut_done=stage is CutStage.DONE, **CUT_IN_PART), size=(100, 30))
        assert "marked at Z 4.2 mm" in page.words


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ["marked", "killed and marked"])
def test_a_stop_in_mid_cut_says_that_the_part_is_marked(name: str, language: str) -> None:
    page, text = shown(STATES[name], language=language), load(language)
    assert text("run_page.marked", z="4.2") in page.words
    assert text("run_page.remedy.retract" if name == "marked" else "run_page.remedy.by_hand") in page.words
    unproven = replace(STATES[name], stop=replace(STATES[name].stop, rest_s=None))  # type: ignore[type-var]
    for other in (STATES["stopped in the part"], unproven):
        assert "4.2 mm" not in shown(other, language=language).text.partition("││")[0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_where_the_tool_stands_is_not_guessed_and_one_that_nothing_holds_is_not_called_clear(
    language: str,
) -> None:
    """A stop of a machine that nobody has homed: it may stand anywhere, in the part or out of it."""
    text = load(language)
    for can_retract, remedy in ((True, "unknown"), (False, "unknown_off")):
        page = shown(stopped(can_retract=can_retract), language=language)
        assert text("run_page.tool_unknown") in page.text and text(f"run_page.remedy.{remedy}") in page.words
        for guess in ("retract", "by_hand", "clear", "not_held"):
            assert text(f"run_page.remedy.{guess}") not in page.words
    for known, can_retract, words in (
        (True, False, "IN OR AT THE PART"),
        (None, False, "position not known"),
        (False, False, "not held (disabled)"),
        (False, True, "clear of the part"),
    ):
        page = shown(stopped(killed=not can_retract, tool_in_part=known, can_retract=can_retract))
        assert words in page.text
        assert ("nothing held" in page.text) is not can_retract


def test_a_cut_that_was_left_with_its_zeros_lost_is_not_said_to_stand_in_the_part() -> None:
    page = shown(state(snapshot=look(ON - {"home_complete"}, tool=0.0), cut=cut()))
    assert "unknown" in page.next_step and "F8" in page.next_step


def test_where_the_tool_is_goes_by_the_part_that_is_clamped() -> None:
    """A job with a smaller part is opened after a cut was left: the tool is where it is."""
    left = state(snapshot=look(tool=SURFACE_COUNTS), cut=cut())
    other = edit_field(experiment(), "diameter_mm", "40")
    page = shown(left, "run.retract", work=other)
    assert page.orders == [Retract()]
    assert "F8" in page.next_step
    beside = replace(left, snapshot=look(tool=SURFACE_COUNTS, carriage=160_000.0))
    assert shown(beside, "run.retract").said == ["screen.tool_is_out"]
    assert "F8" not in shown(beside).next_step


@pytest.mark.parametrize("stage", [CutStage.POSITION, CutStage.RUN_UP])
def test_a_cut_that_never_reached_the_part_was_not_left(stage: CutStage) -> None:
    touching = state(snapshot=look(tool=SURFACE_COUNTS), cut=cut(stage))
    assert "was left" not in shown(touching).next_step


def test_a_stop_that_did_not_arrive_is_said_first() -> None:
    for name in ("stop not delivered", "lost"):
        page = shown(STATES[name])
        assert page.words.split("──╮")[-1].strip().startswith("!!! the stop did NOT reach the controller")
        assert "machine's emergency stop" in page.words
    assert "NOT reach" not in shown(STATES["stopping"]).text


def test_lost_means_that_nothing_is_known_any_more() -> None:
    page = shown(STATES["lost"], "run.retract")
    assert "The machine state is unknown. The last poll is 12 s old." in page.words
    assert "Stale: 12 s ago" in page.text
    assert page.said == ["session.lost"]
    assert shown(replace(state(), activity=Activity.LOST), "run.arm").said == ["session.lost"]
    assert "no poll has succeeded" in shown(STATES["never found"]).words


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_times_of_a_stop_are_whole_at_80_columns(language: str) -> None:
    page = shown(stopped(taken_s=98.05, rest_s=110.3), language=language)
    assert "12.3 s, " in page.text and "0.05 s" in page.text
    label = load(language)("run_page.stop.rest")
    assert f"{label} " in page.text, "a label does not touch its value"
    still = load(language)("run_page.stop.still")
    assert still not in page.text, "no poll has told"
    known = shown(stopped(taken_s=98.05, still_s=98.5, rest_s=110.3), language=language)
    assert f"{still} " in known.text and "0.5 s" in known.text and "12.3 s, " in known.text


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_table_that_was_left_on_does_not_say_that_the_blank_was_not_clamped_for_this_job(language: str) -> None:
    text, work = load(language), experiment()
    left_on = replace(VALID, tables=(Problem(code="cut.table_on", key="I51", value="1"),))
    rows = plain_text(summary_lines(text, state(left_on), work, 100.0, 60))
    assert VALID.clamping is not None and VALID.clamping.at in rows
    assert text("run_page.not_of_job") not in rows
    of_another = replace(left_on, clamping=replace(VALID.clamping, diameter_mm=53.0))
    assert text("run_page.not_of_job") in plain_text(summary_lines(text, state(of_another), work, 100.0, 60))


# A moment of a cut on the page Run: phases that are left, way to go, line of the program, what repeats.


PHASES = (PhaseLeft(CutPhase.CUT, 4.6), PhaseLeft(CutPhase.RETRACT, 0.4), PhaseLeft(CutPhase.HOME, 0.85))
TO_GO = (AxisToGo(AxisName.CARRIAGE, 3.8),)
PLACE = ProgramPlace(program=2, text="X(P11+P12*COS(P27)):(-P15*SIN(P27))", line=31, lines=66)


def test_the_phases_that_are_left_the_way_with_its_units_and_the_line_are_shown() -> None:
    page = shown(cutting(phases=PHASES, to_go=TO_GO, place=PLACE))
    assert "cut 5 s · retract 1 s · home 1 s" in page.text
    assert "Z 3.80 mm" in page.text
    assert "PROG 2: 31 of 66  X(P11+P12*COS(P27))" in page.text
    assert "program line not reported yet" in shown(cutting(phases=PHASES)).text
    assert "PROG 2: ? of 66" in shown(cutting(place=replace(PLACE, line=None))).text, "a line that occurs twice"
    to_go = (AxisToGo(AxisName.CARRIAGE, 12.3), AxisToGo(AxisName.SPINDLE, 34.04), AxisToGo(AxisName.TOOL, 1.2))
    assert "Z 12.3 mm  C 34.0 °  X 1.20 mm" in shown(cutting(stage=CutStage.POSITION, to_go=to_go)).text


@pytest.mark.parametrize("lobes", [3, 4])
def test_what_repeats_is_told_from_what_is_random(lobes: int) -> None:
    """0.5 um that come with each turn, and noise of 0.2 um: the largest mean, and two standard deviations."""
    random = np.random.default_rng(lobes)
    angles_deg = random.uniform(0.0, 360.0, 4000)
    steady = 0.5 * np.sin(np.radians(lobes * angles_deg))
    band = error_band(cut(angles_deg=angles_deg, errors_um=steady + random.normal(0.0, 0.2, angles_deg.size)))
    assert band is not None
    assert band.repeats_um == pytest.approx(0.5, abs=0.08)
    assert band.random_um == pytest.approx(0.4, abs=0.05)


PAUSED = cutting(
    stage=CutStage.PAUSED,
    synchronisation=None,
    phases=PHASES,
    hold=HoldReport(asked=True, state=HoldState.HELD),
    hold_from_mm=-0.1,
    holds_mm=(4.2,),
    held_left_s=581.0,
)


HELD: list[tuple[StationState, str, list[Command], str]] = [
    (cutting(hold_from_mm=-0.1), "run.feed_hold", [HoldFeed()], ""),
    (PAUSED, "run.start", [ResumeFeed()], ""),
    (PAUSED, "run.one_turn", [ResumeFeed(one_turn=True)], ""),
    (PAUSED, "run.hold", [EndCut()], ""),
    (state(), "run.feed_hold", [], "session.nothing_to_hold"),
    (state(), "run.one_turn", [], "session.nothing_to_hold"),
    (cutting(), "run.feed_hold", [], "cut.no_hold"),
    (cutting(hold_from_mm=5.0), "run.feed_hold", [], "cut.hold_early"),
    (cutting(stage=CutStage.RUN_UP, hold_from_mm=-0.1), "run.feed_hold", [], "cut.hold_early"),
    (cutting(hold_from_mm=-0.1, hold=HoldReport(asked=True)), "run.feed_hold", [], "cut.hold_asked"),
    (cutting(hold_from_mm=-0.1, holding=True), "run.feed_hold", [], "screen.holding_already"),
    (cutting(hold_from_mm=-0.1), "run.one_turn", [], "cut.not_held"),
    (PAUSED, "run.feed_hold", [], "cut.hold_asked"),
    (PAUSED, "run.arm", [], "screen.in_motion"),
    (PAUSED, "run.retract", [], "screen.in_motion"),
]


@pytest.mark.parametrize("action", ["feed_hold", "start", "one_turn", "hold", "arm", "retract"])
def test_the_keys_of_a_held_cut_and_why_one_cannot_be_held_or_resumed(action: str) -> None:
    rows = [(now, orders, code) for now, key, orders, code in HELD if key == f"run.{action}"]
    pages = shown_in_turn(RunPage, {str(n): now for n, (now, *_) in enumerate(rows)}, f"run.{action}")
    for page, (_, orders, code) in zip(pages.values(), rows, strict=True):
        assert (page.orders, [*page.said, ""][0]) == (orders, code)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [(80, 24), (160, 48)])
def test_a_held_cut_says_what_it_waits_for_and_what_it_may_leave(size: tuple[int, int], language: str) -> None:
    page = shown(PAUSED, size=size, language=language)
    text = load(language)
    assert text("run_page.stage.paused") in page.text
    assert "9:41" in page.words
    assert "4.2 mm" in page.words
    assert page.next_step == text("run_page.next.paused")


def test_before_every_sector_has_samples_they_are_shown_themselves() -> None:
    few = cut(angles_deg=np.linspace(0.0, 100.0, 200), errors_um=np.zeros(200))
    assert error_band(few) is None
    (samples,), _ = band_series(few, None)
    assert samples.dots
    assert band_series(cut(judged=False), None)[0] == ()


def test_the_edges_of_the_band_differ_from_the_mean_without_colour() -> None:
    moment = cut()
    (upper, lower, mean), limits = band_series(moment, error_band(moment))
    assert (upper.dashed, lower.dashed, mean.dashed) == (True, True, False)
    assert limits[0] <= float(np.min(lower.y)) and float(np.max(upper.y)) <= limits[1]


def test_the_needle_of_the_phase_shows_how_well_it_is_known() -> None:
    assert gauge(0.5, 23, within=0.2) == "├──────────┼──══●══───┤"
    assert gauge(0.0, 13, within=0.4) == "├───══●══───┤"
    assert gauge(None, 7) == "├──┼──┤"
    assert gauge(1.4, 13, within=0.2).endswith("▶")


@pytest.mark.parametrize("language", LANGUAGES)
def test_an_arming_holds_for_as_long_as_its_summary_takes_to_read(language: str) -> None:
    page = shown(state(), "run.arm", language=language)
    (order,) = page.orders
    assert isinstance(order, Arm)
    assert 25.0 < order.valid_s < MOST_ARMED_S


def test_the_time_to_read_goes_with_the_letters() -> None:
    assert reading_s([line("x")]) == LEAST_ARMED_S
    assert reading_s([line("letters " * 60)]) == pytest.approx(5.0 + 420 / 12.0)
    assert reading_s([line("x" * 5000)]) == MOST_ARMED_S


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("now", [*STATES.values(), state(), stopped()])
def test_the_list_of_messages_has_every_reason_against_every_key(now: object, language: str) -> None:
    text, work = load(language), experiment()
    ui = ui_for(FixedControl(now), "/nowhere", language, work)  # type: ignore[arg-type]
    page, view = RunPage(ui), View(state=now, work=work, now_s=100.0)  # type: ignore[arg-type]
    told = " ".join(plain_text(page.in_full(view, 76)).split())
    for action in actions_of(page.name_):
        for problem in page.why_not(action.id, view):
            assert " ".join(text.problem(name_field(problem, text)).split()) in told, (action.id, problem)
