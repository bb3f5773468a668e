"""The page Inspect: before and after on one scale, every figure as a number, nothing claimed that is not so."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len

from console.session.guide.rows import INSPECT, row_of
from console.session.guide.situation import Situation
from console.session.station.commands import Measure
from console.session.station.state import Activity, MeasuredPart, StationState
from console.text.catalogue import load
from console.tui.inspection.comparison import compare_parts
from console.tui.keymap import PageName
from console.tui.lines import plain_text
from console.tui.pages.inspect import InspectPage
from console.tui.pages.inspect_lines import harmonic_lines, judged_line, phase_from_jaw_deg, result_lines
from console.tui.plot.polar_view import PolarView
from console.tui.theme import Token
from console.tui.ui_context import View
from drivers.cutting.planning import Strategy
from profiles.metrology.conformity import DecisionRule, FigureUncertainty, JudgedFigure, ToleranceKind
from profiles.metrology.cylindricity import PartSection, evaluate_cylinder
from profiles.metrology.uncertainty import UncertaintyBudget
from profiles.roundness import evaluate
from profiles.traces import Trace
from tests.tui.page_stage import shown_on
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, FixedControl, PageStage, experiment, grid, lathe, ui_for

ROOMS = [(columns, rows - FRAME_ROWS) for columns, rows in SIZES]
SMALLEST_ROOM = (60, 12)
Waves = Sequence[tuple[int, float, float]]
"""Undulations a turn, amplitude in um, angle of a crest in deg."""


def part(
    strategy: Strategy,
    harmonics: Waves,
    *,
    jaw_1_deg: float = 90.0,
    filter_upr: float | None = 50.0,
    **changes: object,
) -> MeasuredPart:
    """A part that was measured off centre, by 5 um at 1 rad, and 3 um too large."""
    angle_deg = np.arange(3600) / 10.0
    angle = np.radians(angle_deg)
    deviation_um = 3.0 + 5.0 * np.cos(angle - 1.0)
    for n, amplitude_um, crest_deg in harmonics:
        deviation_um = deviation_um + amplitude_um * np.cos(n * (angle - np.radians(crest_deg)))
    job = replace(experiment().job, lobe_phase_deg=jaw_1_deg, **changes)  # type: ignore[arg-type]
    return MeasuredPart(
        job=job,
        strategy=strategy,
        trace=Trace(angle_deg=angle_deg, deviation_um=deviation_um),
        result=evaluate(angle_deg, deviation_um, filter_upr, state="free"),
        jaw_1_deg=jaw_1_deg,
    )


BEFORE = part(Strategy.NONE, [(3, 27.5, 90.0)], filter_upr=None)
AFTER = part(Strategy.PVT, [(3, 1.0, 102.0), (6, 0.2, 0.0), (2, 0.3, 4.0)], filter_upr=None)
PRINTED = part(Strategy.PAPER, [(3, 14.0, 80.0)], filter_upr=None)
BOTH = StationState(measured=AFTER, uncompensated=BEFORE)


def staged(state: StationState, language: str = "en") -> tuple[PageStage, InspectPage, FixedControl]:
    control = FixedControl(state)
    page = InspectPage(ui_for(control, Path("/nowhere"), language, experiment()))
    return PageStage(page, View(state=state, work=experiment(), now_s=0.0)), page, control


def shown(state: StationState, room: tuple[int, int] = ROOMS[0], language: str = "en") -> str:
    return shown_on(InspectPage, state, size=(room[0], room[1] + FRAME_ROWS), language=language).text


def results(state: StationState, height: int = 20) -> list[str]:
    seen = compare_parts(state)
    assert seen is not None
    return plain_text(result_lines(seen, True, load("en"), 40, height)).split("\n")


def harmonics(state: StationState, height: int = 20) -> list[str]:
    seen = compare_parts(state)
    assert seen is not None
    return plain_text(harmonic_lines(seen, load("en"), 40, height)).split("\n")


def test_a_machine_without_a_gauge_is_not_said_to_measure() -> None:
    bare = StationState(cut_done=True)
    assert "measures it" in shown(bare)
    outside = shown(replace(bare, simulated=False))
    assert "measures it" not in outside and "no gauge" in outside


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", [*ROOMS, SMALLEST_ROOM])
def test_the_page_holds_both_parts_and_the_verdict(room: tuple[int, int], language: str) -> None:
    text = shown(BOTH, room, language)
    rows = text.split("\n")
    assert len(rows) <= room[1]
    assert all(cell_len(row) <= room[0] for row in rows)
    for figure in ("55.00", "RONt LSC ▸", "95.", "3: ", "PASS" if language == "en" else "합격"):
        assert figure in text
    assert load(language)("inspect_page.simulated") in text
    assert load(language)("state.free") in text


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
def test_what_a_stop_may_have_left_is_told_with_the_verdict(room: tuple[int, int], language: str) -> None:
    text = load(language)
    told = text("inspect_page.marked", z="4.2, 6.0")
    marked = StationState(measured=replace(AFTER, marks_mm=(4.23, 6.0)), uncompensated=BEFORE)
    page = shown(marked, room, language)
    words = " ".join(" ".join(row.split("│")[-2] for row in page.splitlines() if row.count("│") > 2).split())
    assert told in words
    assert "PASS" in page or "합격" in page
    assert text("inspect_page.simulated") in page
    assert "4.2" not in shown(BOTH, room, language)
    before = shown(StationState(cut_done=True, marks_mm=(4.23, 6.0)), room, language)
    assert told in " ".join(before.split())


def test_the_table_has_the_parameters_of_both_traces() -> None:
    """A pure cosine of 27.5 um: peak and valley 27.5, rms 27.5 over the root of 2, whatever its centre was."""
    rows = results(BOTH)
    assert rows[0].split() == ["um", "before", "after"]
    assert [row.split()[:-1] for row in rows[1:8]] == [
        ["RONt", "LSC", "▸", "55.00"],
        ["RONt", "MZC", "55.00"],
        ["RONt", "MCC", "55.00"],
        ["RONt", "MIC", "55.00"],
        ["RONp", "27.50"],
        ["RONv", "27.50"],
        ["RONq", "19.45"],
    ]
    after = [float(row.split()[-1]) for row in rows[1:8]]
    assert after[:4] == pytest.approx([circle.ront_um for circle in AFTER.result.circles], abs=0.005)
    assert after[0] == pytest.approx(AFTER.result.ront_um, abs=0.005)
    assert after[6] == pytest.approx(((1.0 + 0.04 + 0.09) / 2.0) ** 0.5, abs=0.005)
    assert [row.split()[-2:] for row in rows[8:10]] == [["55.00", "2.00"], ["+0.0°", "+12.0°"]]
    gained = 100.0 * (1.0 - AFTER.result.ront_um / 55.0)
    assert rows[10].split() == ["improvement", f"{gained:.1f}", "%"]
    assert "Simulated, not machined." in rows


def test_multiples_of_the_jaws_stand_in_front_peak_to_peak() -> None:
    rows = harmonics(BOTH)
    assert [row.split() for row in rows[1:4]] == [
        ["3", "/", "rev", "55.00", "2.00"],
        ["6", "/", "rev", "0.00", "0.40"],
        ["9", "/", "rev", "0.00", "0.00"],
    ]
    assert rows[4].split()[-2:] == ["+0.0°", "+12.0°"]
    assert rows[5].split() == ["2", "/", "rev", "0.00", "0.60"]
    assert [int(row.split()[0]) for row in rows[5:]] == [2, 4, 5, 7, 8, 10, 11, 12, 13, 14, 15]


def test_a_six_jaw_chuck_has_its_own_harmonics_in_front() -> None:
    state = StationState(measured=part(Strategy.NONE, [(6, 4.0, 60.0)], jaws=6, jaw_1_deg=60.0))
    assert [row.split()[0] for row in harmonics(state)[1:3]] == ["6", "12"]


@pytest.mark.parametrize(("crest_deg", "phase_deg"), [(91.0, 1.0), (89.0, -1.0), (210.0, 0.0), (150.0, 60.0)])
def test_the_phase_is_the_nearest_crest_from_jaw_1(crest_deg: float, phase_deg: float) -> None:
    seen = compare_parts(StationState(measured=part(Strategy.NONE, [(3, 10.0, crest_deg)])))
    assert seen is not None
    found = phase_from_jaw_deg(seen.before, 3)
    assert found is not None
    assert abs(found) <= 60.0 + 1e-6
    assert math.remainder(found - phase_deg, 120.0) == pytest.approx(0.0, abs=0.01)


def test_a_lobe_that_is_gone_has_no_phase() -> None:
    state = StationState(measured=part(Strategy.PVT, [(3, 0.01, 0.0), (2, 1.0, 0.0)]), uncompensated=BEFORE)
    assert harmonics(state)[4].split()[-2:] == ["+0.0°", "–"]


@pytest.mark.parametrize(("amplitude_um", "mark"), [(2.4, "✓ PASS"), (2.6, "✗ FAIL")])
def test_the_verdict_is_a_mark_a_word_and_both_numbers(amplitude_um: float, mark: str) -> None:
    rows = results(StationState(measured=part(Strategy.PVT, [(3, amplitude_um, 0.0)], filter_upr=None)))
    assert f"{mark}: {2 * amplitude_um:.2f} um of 5.00 um" in rows


def test_a_part_whose_cut_is_not_proven_is_neither_good_nor_bad() -> None:
    unproven = replace(part(Strategy.PVT, [(3, 2.4, 0.0)], filter_upr=None), proven=False)
    rows = results(StationState(measured=unproven))
    assert "? not proven: 4.80 um of 5.00 um" in rows
    assert not [row for row in rows if "PASS" in row or "FAIL" in row]


def test_without_a_measured_part_before_it_is_the_job_that_speaks() -> None:
    state = StationState(measured=PRINTED)
    assert results(state)[1].split() == ["RONt", "LSC", "▸", "55.00", "28.00"]
    assert results(state)[5].split() == ["RONp", "–", "14.00"]
    assert results(state)[10].split() == ["against", "the", "job", "49.1", "%"]
    assert harmonics(state)[1].split()[-2:] == ["55.00", "28.00"]
    assert harmonics(state)[4].split()[-2:] == ["–", "-10.0°"]
    for room in ROOMS:
        assert "- - from the job, not measured" in shown(state, room)


def test_a_part_of_another_job_is_no_before() -> None:
    other = part(Strategy.NONE, [(3, 20.0, 90.0)], spindle_speed_rpm=500.0)
    seen = compare_parts(StationState(measured=AFTER, uncompensated=other))
    assert seen is not None
    assert seen.before.result is None


def test_a_part_that_was_clamped_anew_is_turned_to_the_same_jaw() -> None:
    """The same lobe, high at jaw 1, with the jaw at another place: both traces are high at the mark."""
    before = part(Strategy.NONE, [(3, 27.5, 33.0)], jaw_1_deg=33.0)
    seen = compare_parts(StationState(measured=AFTER, uncompensated=before))
    assert seen is not None
    assert seen.before.result is not None
    high_deg = float(seen.before.angle_deg[seen.before.profile_um.argmax()])
    assert (high_deg - 90.0) % 120.0 == pytest.approx(0.0, abs=0.05)
    assert phase_from_jaw_deg(seen.before, 3) == pytest.approx(0.0, abs=0.01)


def test_an_uncompensated_part_has_no_after() -> None:
    rows = results(StationState(measured=BEFORE, uncompensated=BEFORE))
    assert rows[1].split() == ["RONt", "LSC", "▸", "55.00", "–"]
    assert not any("improvement" in row for row in rows)
    assert any("✗ FAIL: 55.00 um of 5.00 um" in row for row in rows)


def test_what_is_drawn_is_centred_filtered_and_said_to_be() -> None:
    filtered = part(Strategy.PVT, [(3, 1.0, 90.0), (400, 5.0, 0.0)])
    seen = compare_parts(StationState(measured=filtered))
    assert seen is not None
    assert seen.after is not None
    assert float(np.ptp(seen.after.profile_um)) == pytest.approx(2.0, abs=0.02)
    assert "free · LSC · 1-50 UPR" in shown(StationState(measured=filtered))
    assert "free · LSC · unfiltered" in shown(BOTH)


async def test_both_traces_are_on_one_scale_that_is_named_at_every_size_until_the_next_blank() -> None:
    app, page, _ = staged(StationState(cut_done=True))
    page.show(app.view)
    async with app.run_test(size=ROOMS[0]) as pilot:
        await pilot.pause()
        page.show(replace(app.view, state=BOTH))
        for size in ((1, 1), (60, 3), (60, 12), (200, 60), (80, 18)):
            await pilot.resize_terminal(*size)
            await pilot.pause()
        assert "✓ PASS" in grid(app)
        await pilot.resize_terminal(*ROOMS[1])
        await pilot.pause()
        assert page.query_one(PolarView).scale_um_per_division == 20.0
        for words in ("- - before, measured", "── after, measured, pvt", "20 um/div", "jaw 1 at 90.0°"):
            assert words in grid(app)
        page.show(replace(app.view, state=replace(BOTH, measured=None)))
        await pilot.pause()
        assert "PASS" not in grid(app)


@pytest.mark.parametrize(
    ("state", "action", "orders", "codes"),
    [
        (StationState(cut_done=True, activity=Activity.READY), "measure", [Measure()], []),
        (StationState(), "measure", [], ["session.nothing_cut"]),
        (BOTH, "measure", [], ["session.nothing_cut"]),
        (StationState(cut_done=True, activity=Activity.RETRACTING), "measure", [], ["machine.moving"]),
        (StationState(cut_done=True, simulated=False), "measure", [], ["session.no_gauge"]),
        (StationState(measured=AFTER, activity=Activity.READY), "offset", [], ["offset.no_size"]),
        (BOTH, "next", [], []),
    ],
)
def test_m_measures_the_part_that_was_cut_o_needs_a_size_and_enter_moves_nothing(
    state: StationState, action: str, orders: list[object], codes: list[str]
) -> None:
    _, page, control = staged(state)
    gone: list[PageName] = []
    page.ui.go = gone.append
    page.act(f"inspect.{action}")
    assert (control.orders, [problem.code for problem in page.ui.key_answer]) == (orders, codes)
    assert gone == ([PageName.ALIGN] if action == "next" else [])


@pytest.mark.parametrize("language", LANGUAGES)
def test_before_anything_is_measured_the_page_says_what_to_do(language: str) -> None:
    text = load(language)
    for state, key in ((StationState(), "how_cut"), (StationState(cut_done=True), "how_measure")):
        page = " ".join(shown(state, (160, 42), language).split())
        assert text("inspect_page.nothing") in page
        assert " ".join(text(f"inspect_page.{key}").split()) in page


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("state", "key"),
    [
        (StationState(), "5"),
        (StationState(cut_done=True), "m"),
        (StationState(measured=BEFORE), "Enter"),
        (BOTH, "Enter"),
        (StationState(measured=PRINTED), "Enter"),
        (StationState(activity=Activity.MEASURING), ""),
    ],
)
def test_the_next_step_is_one_row_and_names_its_key(state: StationState, key: str, language: str) -> None:
    _, page, _ = staged(state, language)
    words = plain_text([page.next_step(View(state=state, work=None, now_s=0.0))])
    assert key in words
    assert 0 < cell_len(words) <= 77


def test_a_failed_part_is_not_only_coloured() -> None:
    seen = compare_parts(StationState(measured=PRINTED))
    assert seen is not None
    lines = result_lines(seen, True, load("en"), 40, 20)
    (fail,) = [line for line in lines if line and line[0][1] is Token.WARNING]
    assert plain_text([fail]).startswith("✗ FAIL")


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", [*ROOMS, SMALLEST_ROOM])
def test_the_diameter_and_the_tool_offset_are_beside_the_roundness(room: tuple[int, int], language: str) -> None:
    sized = replace(AFTER, diameter_mm=51.8711, tool_offset_um=35.44)
    text = shown(StationState(measured=sized, uncompensated=BEFORE), room, language)
    assert "51.871 +35.4 um" in text
    assert "51.871" not in shown(BOTH, room, language)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
def test_the_form_over_the_length_is_beside_the_roundness(room: tuple[int, int], language: str) -> None:
    """A cone of 2 um with a lobe of 8 um p-p at its jaws: CYLt, and the section that is least round."""
    angle = np.arange(0.0, 360.0)
    sections = [
        PartSection(z_mm=z, angle_deg=angle, deviation_um=0.5 * z + lobe * np.cos(np.radians(3 * angle)))
        for z, lobe in ((22.0, 4.0), (24.0, 1.0), (26.0, 0.5))
    ]
    whole = evaluate_cylinder(sections, filter_upr=None)
    seen = shown(StationState(measured=replace(AFTER, whole=whole)), room, language)
    assert "CYLt MZCY" in seen and f"{whole.cylinder('MZCY').cylt_um:.2f}" in seen
    assert "22.0" in seen and "8.00" in seen
    assert "CYLt" not in shown(StationState(measured=AFTER), room, language), "of one section nothing is said"


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
def test_a_part_that_is_round_in_its_middle_only_fails(room: tuple[int, int], language: str) -> None:
    """12 um p-p at Z 22 against 5 um, and twice its taper of 3 um against 4 um of diameter; CYLt passes."""
    job = replace(AFTER.job, cylindricity_tolerance_um=40.0, diameter_tolerance_um=4.0)
    angle, ends = np.arange(0.0, 360.0), ((22.0, 6.0, -1.0), (26.0, 1.0, 1.0), (30.0, -3.0, 3.0))
    sections = [
        PartSection(z_mm=z, angle_deg=angle, deviation_um=3.0 + r + lobe * np.cos(np.radians(3 * angle)))
        for z, lobe, r in ends
    ]
    whole = evaluate_cylinder(sections, filter_upr=None)
    sized = replace(AFTER, job=job, whole=whole, section_z_mm=26.0, diameter_mm=job.finished_diameter_mm)
    text = load(language)
    failed = (
        ("✗ ", "fail", {"value": "12.00", "limit": "5.00", "at": text("inspect_page.at", z="22.0")}),
        ("✓ ", "cylindricity_pass", {"value": f"{whole.cylt_um:.2f}", "limit": "40.00"}),
        ("✗ ", "diameter_fail", {"value": "51.806", "limit": "4", "at": text("inspect_page.at", z="30.0")}),
    )
    if room == ROOMS[0]:  # each row keeps the section that it is of
        failed = (
            ("✗ ", "fail_brief", {"value": "12.00", "limit": "5", "z": "22.0"}),
            failed[1],
            ("✗ ", "diameter_fail_brief", {"value": "51.806", "limit": "4", "z": "30.0"}),
        )
    cut = None if room == ROOMS[-1] else 18  # in little room a row has at least its beginning
    seen = shown(StationState(measured=sized), room, language)
    for mark, key, facts in failed:
        assert (mark + text(f"inspect_page.{key}", **facts)) in seen
    assert text("judged.section_at", z="26.0")[:10] not in seen
    one = StationState(measured=replace(sized, whole=None, diameter_mm=None))
    seen = shown(one, room, language)
    assert f"? {text('inspect_page.cylindricity_open')}"[:cut] in seen
    assert text("judged.section_at", z="26.0")[:cut] in seen
    now = Situation(state=one, work=experiment(), machine=lathe().machine)
    assert row_of(INSPECT, now).word == "inspect.no_length", "it is not said to pass"


@pytest.mark.parametrize("activity", [Activity.POSITIONING, Activity.CUTTING])
@pytest.mark.parametrize("measured", [None, AFTER], ids=["first", "next"])
def test_while_a_cut_runs_no_other_is_asked_for(activity: Activity, measured: MeasuredPart | None) -> None:
    for simulated in (True, False):
        state = StationState(activity=activity, measured=measured, simulated=simulated)
        now = Situation(state=state, work=experiment(), machine=lathe().machine)
        assert row_of(INSPECT, now).word == "inspect.cutting"


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("kind", [ToleranceKind.ROUNDNESS, ToleranceKind.DIAMETER])
@pytest.mark.parametrize("value_um", [2.0, 123.45])
def test_a_verdict_keeps_its_section_in_the_room_of_80_columns(
    kind: ToleranceKind, value_um: float, language: str
) -> None:
    figure = JudgedFigure(kind=kind, value_um=value_um, limit_um=10.0, z_mm=29.5)
    (row,) = [plain_text([judged_line(figure, 46.95, load(language), 32)])]
    assert "Z 29.5" in row and "…" not in row


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", [*ROOMS, SMALLEST_ROOM])
def test_a_verdict_has_its_u_and_is_open_where_not_proven(room: tuple[int, int], language: str) -> None:
    words = {"en": ("PASS", "NOT PROVEN"), "ko": ("합격", "증명 안 됨")}[language]
    for u_um, word in zip((0.3, None), words, strict=True):
        said = FigureUncertainty(rule=DecisionRule.ISO_2017, roundness_um=u_um)
        budget = UncertaintyBudget(gauge="a gauge", rows=(), expanded=said)
        page = shown(StationState(measured=replace(AFTER, budget=budget), uncompensated=BEFORE), room, language)
        assert (word in page, "±0.30" in page) == (True, u_um is not None)
