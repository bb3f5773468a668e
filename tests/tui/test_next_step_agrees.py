"""The row of the next step says what the page above it says, and asks for nothing that is done already."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rich.cells import cell_len

from console.session.cut.alignment import Alignment
from console.session.station.progress import CutStage
from console.session.station.state import Activity, MeasuredPart, StationState
from console.session.work import Work, with_strategy
from console.text.catalogue import load
from console.tui.lines import plain
from console.tui.pages.align import AlignPage
from console.tui.pages.inspect import InspectPage
from console.tui.pages.learn_lines import learn_lines
from console.tui.pages.preview import PreviewPage
from console.tui.pages.run import RunPage
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.compensations.causes import Cause, CauseKind
from profiles.compensations.learned import ExpectedPart
from profiles.findings import Finding, Severity
from profiles.problem import Problem
from tests.tui import align_stage, run_stage
from tests.tui.page_stage import Shown, shown_on
from tests.tui.scenes import previewed, signed, taught_part
from tests.tui.stage import LANGUAGES

EN = load("en")
PART = taught_part()
"""A part with 1.8 um of lobe left, of which two clampings may differ by 9.24 um."""


def cam() -> Work:
    return with_strategy(signed(), "cam")


def fails(measured: MeasuredPart) -> MeasuredPart:
    return replace(measured, job=replace(measured.job, roundness_tolerance_um=2.0))


def inspected(measured: MeasuredPart, language: str = "en") -> Shown:
    state = StationState(activity=Activity.READY, measured=measured)
    return shown_on(InspectPage, state, work=cam(), language=language)


def panel(measured: MeasuredPart) -> str:
    """What the panel Learn says, as w shows it."""
    assert measured.learning is not None
    failed = measured.result.ront_um > measured.job.roundness_tolerance_um
    return " ".join(plain(learn_lines(measured.learning, cam(), EN, 76, failed=failed)).split())


def test_what_may_not_help_is_not_offered_and_what_is_offered_is_not_called_so() -> None:
    passed, failed = inspected(PART), inspected(fails(PART))
    assert "leave it" in panel(PART) and "a accepts" not in passed.next_step
    assert "leave it" not in panel(fails(PART)) and "a accepts" in failed.next_step
    assert "the next part shows whether it repeats" in panel(fails(PART))
    assert "repeats" in failed.next_step


def test_of_a_lobe_that_is_elsewhere_the_set_up_is_asked_for_first() -> None:
    assert PART.learning is not None and PART.learning.taught is not None
    warned = replace(PART.learning.taught, warnings=(Problem(code="learned.lobe_elsewhere", value="+15 deg"),))
    for measured in (PART, fails(PART)):
        page = inspected(replace(measured, learning=replace(PART.learning, taught=warned)))
        assert page.next_step == EN("inspect_page.next.check_jaw")
        assert "check jaw 1 before a" in " ".join(page.text.split())


@pytest.mark.parametrize("language", LANGUAGES)
def test_where_jaw_1_explains_the_most_it_is_one_remedy_or_the_other(language: str) -> None:
    """A correction learned with jaw 1 taken wrongly would be made twice once jaw 1 is found again."""
    assert PART.learning is not None and PART.learning.taught is not None
    text = load(language)
    turned = Cause(kind=CauseKind.ANGLE, um_pp=16.8, order=3, value=5.8, sd=1.3)
    step = replace(PART.learning.taught.step, expected_half_width_um_pp=0.0)  # no two clampings differ
    taught = replace(PART.learning.taught, causes=(turned,), step=step)
    measured = replace(PART, learning=replace(PART.learning, taught=taught))
    failed = inspected(fails(measured), language)
    assert failed.next_step == text("inspect_page.next.failed_jaw") and cell_len(failed.next_step) <= 77
    assert "not both" in panel(fails(measured))
    assert inspected(measured, language).next_step == text("inspect_page.next.part_learn"), "it passes as it is"


def test_nothing_is_promised_of_what_may_not_be_kept() -> None:
    assert PART.learning is not None and PART.learning.taught is not None
    worse = Problem(code="learned.worse", key="+25 deg", value="67.0 um", limit="55.0 um")
    step = replace(PART.learning.taught.step, reasons=(worse,))
    part_ = replace(PART, learning=replace(PART.learning, taught=replace(PART.learning.taught, step=step)))
    assert "3/rev 1.82 · 6/rev" in panel(part_)
    assert not any(words in panel(part_) for words in ("→", "gain 1 ", "may not help"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_after_the_gauge_run_says_one_thing(language: str) -> None:
    text = load(language)
    done = run_stage.cut(CutStage.DONE, figures=run_stage.FIGURES)
    # Measuring opens the chuck: nothing is clamped and the drives are off.
    now = run_stage.state(
        replace(run_stage.VALID, clamping=None),
        snapshot=run_stage.look(run_stage.OFF),
        cut=done,
        measured=PART,
    )
    page = shown_on(RunPage, now, work=cam(), language=language)
    assert page.next_step == text("run_page.next.measured") and cell_len(page.next_step) <= 77
    assert text("run_page.after_measured")[:20] in page.words
    assert not any(words in page.words + page.next_step for words in ("not measured yet", "see the list"))


def test_a_list_that_is_spoken_of_is_there() -> None:
    """After a hold the blank may be cut again; the drives were switched off meanwhile."""
    held = run_stage.state(Alignment(), snapshot=run_stage.look(run_stage.OFF), cut=run_stage.cut(CutStage.HELD))
    page = shown_on(RunPage, held, work=cam())
    assert "see the list" in page.next_step
    assert "✗ drives enabled" in page.text or "✗ alignment valid" in page.text


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("carriage_mm", "gap_mm", "said"),
    [
        (41.2, None, "touch_off"),
        (171.0, 0.25, "touch_off_over_enable"),
        (171.0, 0.0, "touch_off_touching"),
        (171.0, -0.003, "touch_off_touching"),
    ],
)
def test_the_touch_off_asks_for_what_is_left_of_it(
    carriage_mm: float, gap_mm: float | None, said: str, language: str
) -> None:
    text = load(language)
    seen = WorkshopView(jaw_1_past_mark_deg=0.0, tool_gap_mm=gap_mm)
    snapshot = align_stage.look(carriage_mm=carriage_mm)
    now = align_stage.state(replace(align_stage.VALID, touch_off=None), seen=seen, snapshot=snapshot)
    page = shown_on(AlignPage, now, language=language)
    assert page.next_step == text(f"align_page.next.{said}", radius="26.000")
    assert cell_len(page.next_step) <= 77
    # F4 takes the tool away from the part, to come in again: it is not proposed to one that is there.
    assert ("F4" in align_stage.words_of(page.text) + page.next_step) is (carriage_mm < 100.0)
    jogging = shown_on(AlignPage, now, "align.enable", language=language)
    assert jogging.next_step in (page.next_step, text("align_page.next.touch_off_over", radius="26.000"))


@pytest.mark.parametrize("language", LANGUAGES)
def test_nobody_is_sent_on_to_align_past_what_was_found(language: str) -> None:
    text, made = load(language), previewed(signed().job)
    warning = Finding(
        severity=Severity.WARNING,
        problem=Problem(code="rule.lobe_unstated", key="lobe_error_source", value="measured", limit="lobe_tool"),
    )
    taught_by = ExpectedPart(ront_um=2.4, lobe=made.target.harmonics[0])
    for found in (False, True):
        seen = replace(made, findings=(warning,) if found else ())
        plainly = replace(signed(), outlook=seen, preview=seen)
        by_part = replace(plainly, preview=replace(seen, taught=taught_by))
        works = (plainly, replace(plainly, stage="air"), replace(plainly, stage="partial"), by_part)
        for work in works:
            page = shown_on(PreviewPage, StationState(activity=Activity.READY), work=work, language=language)
            assert cell_len(page.next_step) <= 77
            opens = text("preview_page.opens_align")
            read = text("preview_page.then_findings", digit="4")
            if work is plainly:
                read = text("preview_page.next_findings", opens=opens)
            assert page.next_step.endswith(read) is found


@pytest.mark.parametrize("language", LANGUAGES)
def test_preview_opens_the_run_where_the_alignment_is_valid(language: str) -> None:
    """It sent to Align after the alignment, too."""
    text, work = load(language), replace(signed(), outlook=(made := previewed(signed().job)), preview=made)
    for alignment, page in ((run_stage.VALID, "run"), (Alignment(), "align")):
        state = StationState(activity=Activity.READY, alignment=alignment)
        shown = shown_on(PreviewPage, state, work=work, language=language)
        assert text(f"preview_page.opens_{page}") in shown.next_step


def test_while_the_tool_is_taken_out_the_row_says_so_and_names_the_stop() -> None:
    for language in LANGUAGES:
        text = load(language)
        taken = shown_on(RunPage, run_stage.state(activity=Activity.RETRACTING), language=language)
        assert taken.next_step == text("run_page.next.taken_out")
        moves = shown_on(RunPage, run_stage.state(activity=Activity.HOMING), language=language)
        assert moves.next_step == text("run_page.next.moves")
