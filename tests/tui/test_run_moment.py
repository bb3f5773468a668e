"""A moment of a cut on the page Run: phases that are left, way to go, line of the program, what repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from console.session.station.commands import (
    LEAST_ARMED_S,
    MOST_ARMED_S,
    Arm,
    Command,
    EndCut,
    HoldFeed,
    ResumeFeed,
)
from console.session.station.progress import AxisToGo, CutPhase, CutStage, PhaseLeft
from console.session.station.state import StationState
from console.text.catalogue import load
from console.tui.keymap import actions_of
from console.tui.lines import line, plain
from console.tui.pages.cut_lines import gauge
from console.tui.pages.fields import named
from console.tui.pages.run import RunPage, reading_s
from console.tui.run.error_band import band_series, error_band
from console.tui.ui_context import View
from drivers.cutting.feed_hold import HoldReport, HoldState
from drivers.cutting.program_reports import ProgramPlace
from drivers.lathe.snapshot import AxisName
from tests.tui.run_stage import STATES, cut, cutting, shown, state, stopped
from tests.tui.stage import LANGUAGES, FixedControl, experiment, ui_for

PHASES = (PhaseLeft(CutPhase.CUT, 4.6), PhaseLeft(CutPhase.RETRACT, 0.4), PhaseLeft(CutPhase.HOME, 0.85))
TO_GO = (AxisToGo(AxisName.CARRIAGE, 3.8),)
PLACE = ProgramPlace(program=2, text="X(P11+P12*COS(P27)):(-P15*SIN(P27))", line=31, lines=66)


def test_the_phases_that_are_left_the_way_and_the_line_are_shown() -> None:
    page = shown(cutting(phases=PHASES, to_go=TO_GO, place=PLACE))
    assert "cut 5 s · retract 1 s · home 1 s" in page.text
    assert "Z 3.80 mm" in page.text
    assert "PROG 2: 31 of 66  X(P11+P12*COS(P27))" in page.text
    assert "program line not reported yet" in shown(cutting(phases=PHASES)).text


def test_each_axis_has_its_unit_on_the_way_to_the_start() -> None:
    to_go = (AxisToGo(AxisName.CARRIAGE, 12.3), AxisToGo(AxisName.SPINDLE, 34.04), AxisToGo(AxisName.TOOL, 1.2))
    page = shown(cutting(stage=CutStage.POSITION, to_go=to_go))
    assert "Z 12.3 mm  C 34.0 °  X 1.20 mm" in page.text


def test_a_line_that_occurs_twice_has_no_number() -> None:
    assert "PROG 2: ? of 66" in shown(cutting(place=replace(PLACE, line=None))).text


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


@pytest.mark.parametrize(
    ("now", "action", "orders"),
    [
        (cutting(hold_from_mm=-0.1), "run.feed_hold", [HoldFeed()]),
        (PAUSED, "run.start", [ResumeFeed()]),
        (PAUSED, "run.one_turn", [ResumeFeed(one_turn=True)]),
        (PAUSED, "run.hold", [EndCut()]),
    ],
)
def test_the_keys_of_a_held_cut(now: StationState, action: str, orders: list[Command]) -> None:
    assert shown(now, action).orders == orders


@pytest.mark.parametrize(
    ("now", "action", "code"),
    [
        (state(), "run.feed_hold", "session.nothing_to_hold"),
        (state(), "run.one_turn", "session.nothing_to_hold"),
        (cutting(), "run.feed_hold", "cut.no_hold"),
        (cutting(hold_from_mm=5.0), "run.feed_hold", "cut.hold_early"),
        (cutting(stage=CutStage.RUN_UP, hold_from_mm=-0.1), "run.feed_hold", "cut.hold_early"),
        (cutting(hold_from_mm=-0.1, hold=HoldReport(asked=True)), "run.feed_hold", "cut.hold_asked"),
        (cutting(hold_from_mm=-0.1, holding=True), "run.feed_hold", "screen.holding_already"),
        (cutting(hold_from_mm=-0.1), "run.one_turn", "cut.not_held"),
        (PAUSED, "run.feed_hold", "cut.hold_asked"),
        (PAUSED, "run.arm", "screen.in_motion"),
        (PAUSED, "run.retract", "screen.in_motion"),
    ],
)
def test_why_a_cut_cannot_be_held_or_resumed(now: StationState, action: str, code: str) -> None:
    page = shown(now, action)
    assert (page.orders, page.said[0]) == ([], code)


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
    told = " ".join(plain(page.in_full(view, 76)).split())
    for action in actions_of(page.name_):
        for problem in page.why_not(action.id, view):
            assert " ".join(text.problem(named(problem, text)).split()) in told, (action.id, problem)
