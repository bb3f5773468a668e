"""The page Run: what must hold, two acts to start, the cut as it goes, and how it ended."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.session.cut.alignment import JawAngle
from console.session.cut.cut_verdict import CutVerdict, ToolError
from console.session.cut.telemetry import PhaseLag, SpindleRipple
from console.session.station.commands import Arm, Disarm, EndCut, Start
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.session.work import edit_field, open_work, with_strategy
from console.text.catalogue import load
from console.tui.lines import plain_text
from console.tui.pages.cut_lines import bar, gauge, mean_error_um
from console.tui.pages.run import RunPage
from console.tui.pages.run_lines import input_lines
from drivers.cutting.bounds import CutChange, Trim
from drivers.cutting.planning import Strategy
from profiles.problem import Problem
from profiles.store import load_job, save_job
from tests.tui.page_stage import shown_in_turn, too_wide
from tests.tui.run_stage import (
    FIGURES,
    GUARDS,
    OFF,
    STATES,
    VALID,
    armed,
    cut,
    cutting,
    look,
    shown,
    state,
    stopped,
)
from tests.tui.stage import LANGUAGES, ON, SIZES, experiment, lathe


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [*SIZES, (60, 18)])
def test_no_row_is_wider_than_the_terminal(size: tuple[int, int], language: str) -> None:
    pages = shown_in_turn(RunPage, STATES, size=size, language=language)
    assert too_wide(pages, size, "run_page.") == []


@pytest.mark.parametrize("language", LANGUAGES)
def test_titles_and_stages_are_whole_at_80_columns(language: str) -> None:
    text = load(language)
    stages = {
        str(stage): cutting(stage=stage, phase=None, synchronisation=None)
        for stage in (CutStage.POSITION, CutStage.RUN_UP, CutStage.CUT, CutStage.PAUSED, CutStage.RETRACT)
    }
    for page in shown_in_turn(RunPage, {**STATES, **stages}, language=language).values():
        assert not [row for row in page.text.splitlines() if row.startswith("╭") and "…" in row]
    for stage, page in shown_in_turn(RunPage, stages, language=language).items():
        assert text(f"run_page.stage.{stage}") in page.text


def test_what_was_changed_of_a_cut_is_told_when_it_has_ended() -> None:
    """At the end the override is back at 100 %; the record keeps what the part was cut with."""
    changed = CutChange(override_percent=97, trim=Trim(gain_percent=4.0, phase_deg=-0.5), from_mm=3.14)
    ended = cut(CutStage.DONE, figures=FIGURES)
    page = shown(state(cut=replace(ended, changed=changed), cut_done=True))
    assert "Changed while it cut, from Z 3.1 mm on: speed 97 %, gain +4 %, phase -0.5° at the end" in page.words
    back = replace(changed, override_percent=100, trim=Trim())
    assert "as planned again" in shown(state(cut=replace(ended, changed=back), cut_done=True)).words
    assert "Changed" not in shown(state(cut=ended, cut_done=True)).text


def test_the_verdict_on_a_cut_is_told_with_what_the_tool_took_of_round_and_diameter() -> None:
    """Orders of 2 and 1 um: the crests of 3 and 6 per turn meet 3 um up; the least is 1.5 um down."""
    tool = ToolError(
        mean_um=-12.0,
        mean_se_um=0.1,
        slope_um=4.0,
        slope_se_um=0.2,
        decay_um=0.0,
        decay_se_um=0.0,
        orders={2: 0j, 3: 2.0 + 0j, 6: 1.0 + 0j},
        orders_se_um={2: 0.1, 3: 0.1, 6: 0.1},
        polls=160,
        independent=160.0,
    )
    verdict = CutVerdict(
        tool=tool, command=replace(tool, mean_um=0.0, slope_um=0.0, orders={}), round_limit_um=3.5
    )
    end = state(cut=cut(CutStage.DONE, figures=replace(FIGURES, verdict=verdict)), cut_done=True)
    page = shown(end, size=(80, 24)).text
    rows = [
        row.split("│")[1].split() for row in page.splitlines() if "against plan" in row or "tool: round" in row
    ]
    assert [" ".join(row) for row in rows] == ["cut against plan tool error", "tool: round/diam. 4.5 / 28.0 um"]
    assert "not proven" in shown(state(cut=cut(CutStage.DONE, figures=FIGURES), cut_done=True)).words


WIDE = (100, 30)


@pytest.mark.parametrize(
    ("now", "size", "words", "step"),
    [
        (
            state(replace(VALID, jaw=None)),
            (80, 24),
            ("✓ drives enabled", "✗ alignment valid", "jaw 1 is not found", "○ program"),
            "4",
        ),
        (state(), (80, 24), ("blank not cut yet",), ""),
        (STATES["held"], (80, 24), ("Cut ended after the turn; the tool is out.", "only partly cut"), ""),
        (
            state(armed=armed()),
            WIDE,
            (
                *("ARMED", "F6 starts within 9 s", "✓ program"),
                "tool out, carriage to Z 169.3 mm, spindle to its start",
            ),
            "F6",
        ),
        # 3 lobes at 1000.3 rpm; the tool stands 0.6 um less deep than wanted, so wanted is the smaller radius.
        (
            cutting(),
            (80, 24),
            (
                *("turn 83 of 160 · Z 4.2 of 8.0 mm · 5 s left", "52 %", "1000 rpm", "50.0 Hz", "R 25.9271 mm"),
                *("R 25.9265 mm", "-0.60 um", "1.40 um", "+0.08 °", "± 1.39°", "CUTTING"),
            ),
            "",
        ),
    ],
)
def test_the_page_says_what_is_the_case(
    now: StationState, size: tuple[int, int], words: tuple[str, ...], step: str
) -> None:
    page = shown(now, size=size)
    assert [each for each in words if each not in page.text + page.words] == []
    assert step in page.next_step


def test_the_summary_names_what_will_be_cut() -> None:
    page = shown(state(), size=(100, 30))
    for value in ("1314 N", "08:40", "0.100 mm", "0.050 mm/rev", "1000 rpm", "12.60 °", "R 76.000 mm"):
        assert value in page.text
    assert experiment().loaded.sha256[:6] in page.text
    assert "on radius" in page.text


def test_f5_arms_what_is_in_hand() -> None:
    work = with_strategy(experiment(), "paper")
    page = shown(state(), "run.arm", work=work)
    sha256 = work.loaded.sha256
    (order,) = page.orders
    assert isinstance(order, Arm)
    made = Arm(job=work.job, job_sha256=sha256, strategy=Strategy.PAPER, loaded=work.loaded)
    assert replace(order, valid_s=made.valid_s) == made


def test_a_job_whose_file_was_changed_since_it_was_opened_is_not_armed(tmp_path: Path) -> None:
    file = tmp_path / "ring.toml"
    save_job(experiment().job, file)
    work = open_work(load_job(str(file)), lathe())
    assert len(shown(state(), "run.arm", work=work).orders) == 1
    file.write_text(file.read_text(encoding="utf-8").replace("depth_of_cut_mm = ", "depth_of_cut_mm = 1"))
    page = shown(state(), "run.arm", work=work)
    assert (page.orders, page.said) == ([], ["job.changed_on_disk"])
    assert len(shown(state(), "run.arm", work=edit_field(work, "depth_of_cut_mm", "0.05")).orders) == 1
    file.unlink()
    assert len(shown(state(), "run.arm", work=work).orders) == 1


def test_an_edited_job_is_not_recorded_as_its_file() -> None:
    work = edit_field(experiment(), "depth_of_cut_mm", "0.05")
    page = shown(state(), "run.arm", work=work)
    (order,) = page.orders
    assert isinstance(order, Arm)
    assert order.job.depth_of_cut_mm == 0.05
    assert order.job_sha256 != work.loaded.sha256
    assert order.loaded is None
    assert "edited since" in page.text


def test_what_stands_in_the_way_is_said_and_nothing_armed() -> None:
    states = {
        "alignment.no_jaw": state(replace(VALID, jaw=None)),
        "alignment.drives_off": state(snapshot=look(OFF)),
        "screen.in_motion": state(snapshot=look(running=True)),
        "screen.axis_fault": state(snapshot=look(ON | {"amplifier_fault"})),
        "screen.axis_on_limit": state(snapshot=look(ON | {"positive_limit"})),
        "screen.part_is_cut": state(cut=cut(CutStage.DONE), cut_done=True),
        "screen.busy": state(activity=Activity.VERIFYING),
        "screen.stopped_first": stopped(),
        "screen.nothing_known": StationState(),
    }
    for code, page in shown_in_turn(RunPage, states, "run.arm").items():
        assert (page.orders, page.said[0]) == ([], code)


def test_a_job_that_does_not_fit_is_not_armed() -> None:
    work = edit_field(experiment(), "cut_length_mm", "29")
    page = shown(state(), "run.arm", work=work)
    assert (page.orders, page.said) == ([], ["rule.length_over_overhang"])
    assert "cut_length_mm" not in page.text
    assert "2 changes it" in page.next_step


def test_f6_starts_only_what_is_armed_f5_takes_it_back_and_enter_does_nothing() -> None:
    for now, action, orders, said in (
        (state(armed=armed()), "run.start", [Start()], []),
        (state(), "run.start", [], ["screen.not_armed"]),
        (state(armed=replace(armed(), until_s=99.0)), "run.start", [], ["screen.not_armed"]),
        (state(armed=armed()), "run.arm", [Disarm()], []),
    ):
        page = shown(now, action)
        assert (page.orders, page.said) == (orders, said)
    assert shown(state(), "run.take").orders == []
    nothing = shown(state(), "run.arm", no_job=True)
    assert (nothing.orders, nothing.said) == ([], ["screen.nothing_to_cut"])


def test_each_value_of_a_cut_has_its_row_and_its_bound() -> None:
    """Of a look that was asked for 0.23 s ago each value may be that old; a phase may be within its bound."""
    out = PhaseLag(error_deg=-1.5, within_deg=0.05)
    old = replace(cutting(), snapshot=replace(look(running=True), asked_s=99.77, at_s=99.9))
    shown_words: list[tuple[StationState, str]] = [
        (cutting(phase=out), "OUT -1.50 °"),
        (STATES["queued"], "synchronised               queued"),
        (STATES["waiting"], "waiting for index"),
        (STATES["cutting"], "in sync"),
        (STATES["sync lost"], "! SYNC LOST"),
        (STATES["nothing seen yet"], "synchronised                    –"),
        (cutting(), "ripple, p-p       1.18 ± 0.57 %"),
        (cutting(ripple=SpindleRipple(0.18, 0.56)), "ripple, p-p            < 0.74 %"),
        (cutting(ripple=None), "ripple, p-p                   –"),
        (cutting(), "Now, ≤ 0.1 s old"),
        (old, "Now, ≤ 0.3 s old"),
        (cutting(stage=CutStage.RETRACT, tool_error_um=-2000.0), "largest                 1.40 um"),
    ]
    pages = shown_in_turn(RunPage, {str(n): now for n, (now, _) in enumerate(shown_words)})
    for page, (_, words) in zip(pages.values(), shown_words, strict=True):
        assert words in page.text
    silent = {
        "OUT": (cutting(), cutting(phase=out, phase_limit_deg=2.3), cutting(phase=replace(out, within_deg=0.3))),
        "2000": (cutting(stage=CutStage.RETRACT, tool_error_um=-2000.0),),
    }
    for words, states in silent.items():
        found = shown_in_turn(RunPage, {str(n): now for n, now in enumerate(states)})
        assert not any(words in page.text for page in found.values()), words


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_lobe_that_is_nothing_to_the_part_has_no_limit(language: str) -> None:
    page = shown(
        cutting(phase=PhaseLag(error_deg=-35.0, within_deg=0.05), phase_limit_deg=None), language=language
    )
    assert "-35.00 °" in page.text and "OUT" not in page.text
    assert load(language)("run_page.no_limit", limit="") in page.text


@pytest.mark.parametrize("now", [state(), cutting()], ids=["before", "cutting"])
def test_what_the_controller_sees_of_the_safety_devices_is_shown(now: StationState) -> None:
    assert now.snapshot is not None
    assert not any(words in shown(now, size=(100, 30)).text for words in ("guard", "chuck closed"))
    seen = replace(now, snapshot=replace(now.snapshot, inputs={"chuck_closed": True, "guard": False}))
    assert "✗ guard  ✓ chuck closed" in shown(seen, size=(100, 30)).text


def test_in_little_room_what_is_not_well_stays() -> None:
    text, snapshot = load("en"), replace(look(), inputs={**GUARDS, "spindle_permit": False})
    assert len(input_lines(text, snapshot, 40, 9)) > 1
    assert plain_text(input_lines(text, snapshot, 40, 1)) == "✗ spindle permit"
    assert input_lines(text, snapshot, 40, 0) == []


def test_the_plots_follow_the_looks() -> None:
    def dots(text: str) -> int:
        return sum(1 for character in text if 0x2800 < ord(character) <= 0x28FF)

    none = cutting(angles_deg=np.empty(0), errors_um=np.empty(0))
    assert dots(shown(none).text) == 0
    assert dots(shown(cutting()).text) > 10
    assert "um/div" in shown(cutting(), size=(100, 30)).text


def test_the_mean_error_is_that_of_the_lobe() -> None:
    moment = cut()
    angles_deg, errors_um = mean_error_um(moment)
    assert len(angles_deg) == 36
    assert errors_um == pytest.approx(0.5 * np.sin(np.radians(3.0 * angles_deg)), abs=0.1)


def test_a_bar_is_full_only_at_the_end_and_a_gauge_shows_a_value_in_its_limits() -> None:
    assert (bar(0.99, 10), bar(1.0, 10)) == ("■" * 9 + "□", "■" * 10)
    marks = {0.0: "├───●───┤", 1.0: "├───┼──●┤", -1.0: "├●──┼───┤", 1.5: "├───┼───▶", -9.0: "◀───┼───┤"}
    assert {share: gauge(share, 9) for share in marks} == marks
    assert gauge(None, 9) == "├───┼───┤"


def test_hold_once_and_only_in_a_cut() -> None:
    assert shown(cutting(), "run.hold").orders == [EndCut()]
    held = shown(cutting(holding=True), "run.hold")
    assert (held.orders, held.said) == ([], ["screen.holding_already"])
    assert "ENDING" in held.text
    assert shown(state(), "run.hold").said == ["screen.nothing_to_hold"]


def test_after_the_cut_figures_the_phase_error_of_its_end_and_the_way_on() -> None:
    page = shown(STATES["done"])
    ended = STATES["done"].cut
    assert ended is not None and ended.phase is not None and ended.phase_limit_deg is not None
    for value in (
        "1000.0 rpm",
        "1.41 um",
        "0.44 um",
        "14.12 um",
        "9.02 um",
        "340",
        f"{ended.phase.error_deg:+.2f} °",
    ):
        assert value in page.text
    assert "not from the part" in page.words and page.next_step.startswith("6 ")
    assert "simulated" not in shown(replace(STATES["done"], simulated=False)).text
    late = replace(ended, path_phase=None, phase=replace(ended.phase, error_deg=9.0, within_deg=0.1))
    assert "! OUT +9.00 °" in shown(replace(STATES["done"], cut=late)).text
    assert shown(STATES["held"], "run.arm").orders, "a held cut is not done"
    assert "not cut yet" not in shown(state(replace(VALID, clamping=None))).text, "nothing is clamped"


def test_the_remedy_of_a_tool_out_of_phase_is_one_that_changes_its_phase() -> None:
    """Both are on the spindle: jaw 1 turns the lobe and the path alike, so it is no remedy."""
    for language, words in {"en": ("console identify", "learn"), "ko": ("console identify", "학습")}.items():
        said = load(language).problem(Problem(code="cut.out_of_phase", limit="± 1.4 deg"))
        assert all(word in said for word in words) and "jaw" not in said and "조 1" not in said


@pytest.mark.parametrize("stage", [CutStage.POSITION, CutStage.RUN_UP])
def test_before_the_tool_is_in_the_part_nothing_is_judged(stage: CutStage) -> None:
    page = shown(cutting(stage=stage, turn=40.0, tool_error_um=2000.0, phase=None, ripple=None))
    assert "%" not in page.text
    assert "turn 40" not in page.text
    assert "2000" not in page.text
    assert "following err           +12.30 um" in page.text


def test_the_next_step_tells_the_stage() -> None:
    words = {
        CutStage.POSITION: "Moving to the start",
        CutStage.RUN_UP: "The spindle accelerates",
        CutStage.CUT: "Cutting. After this turn, tool out: F4 holds",
        CutStage.RETRACT: "The tool retracts",
    }
    pages = shown_in_turn(RunPage, {str(stage): cutting(stage=stage) for stage in words})
    for page, expected in zip(pages.values(), words.values(), strict=True):
        assert page.next_step.startswith(expected)


def test_without_compensation_nothing_is_judged() -> None:
    page = shown(cutting(judged=False, phase=None, tool_error_um=27.6, tool_error_peak_um=28.1))
    assert "no compensation: not judged" in page.text
    assert "not known yet" not in page.text
    assert not any(value in page.text for value in ("27.6", "28.1"))
    end = shown(state(cut=cut(CutStage.DONE, figures=FIGURES, judged=False), cut_done=True))
    assert "no compensation: not judged" in end.text
    assert "1.41" not in end.text


def test_the_summary_is_of_what_was_armed() -> None:
    moved = replace(VALID, jaw=JawAngle(angle_deg=99.0, jaws=3, at="09:59"), touch_off=None)
    other = with_strategy(edit_field(experiment(), "chucking_force_n", "700"), "none")
    page = shown(state(moved, armed=armed()), work=other, size=(100, 30))
    for value in ("1314 N", "pvt", "12.60 °", "R 76.000 mm"):
        assert value in page.text
    for value in ("700 N", "99.00 °", "none, tool", other.loaded.sha256[:6]):
        assert value not in page.text


@pytest.mark.parametrize("language", LANGUAGES)
def test_all_that_moves_is_read_at_80_columns(language: str) -> None:
    """Carriage: 169.3 mm of its way; tool: 48 mm in from its zero at 76 mm."""
    page = shown(state(armed=armed()), language=language)
    for value in ("Z 169.3 mm", "R 28.000 mm", "1000 rpm"):
        assert value in page.words
    assert armed().plan.tool_start == 240_000.0


@pytest.mark.parametrize("language", LANGUAGES)
def test_no_fault_is_ticked_only_where_one_would_be_seen_and_the_key_for_that_is_named(language: str) -> None:
    text = load(language)
    on, off = (shown(state(snapshot=look(flags)), language=language).text for flags in (ON, OFF))
    check = text("run_page.check.no_fault")
    assert f"✓ {check}" in on and f"○ {check}: {text('run_page.by_drives')}" in off
    assert "(4)" in text("run_page.by_drives")


def test_a_hold_is_read_whole_at_80_columns() -> None:
    for language in LANGUAGES:
        page = shown(cutting(holding=True), language=language)
        assert "…" not in page.text
    assert "1000 rpm" in page.text
