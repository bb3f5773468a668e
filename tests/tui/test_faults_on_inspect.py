"""What Inspect says of a part that fails: the hypotheses of its record, the mark of a stop, parts made worse."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rich.cells import cell_len

from console.session.learning.row_faults import RowFaults
from console.session.station.state import MeasuredPart, StationState
from console.session.work import with_strategy
from console.text.catalogue import load
from console.text.run_debrief import fault_words
from console.tui.pages.inspect import InspectPage
from profiles.compensations.hypotheses import Explanation, FaultDiagnosis, LatheFault
from profiles.problem import Problem
from tests.tui.page_stage import Shown, shown_on
from tests.tui.scenes import AFTER, signed, taught_part
from tests.tui.stage import LANGUAGES
from tests.tui.test_parts_along_their_length import SECTIONS, WHOLE

ONE = taught_part(AFTER)
FAILED = replace(ONE, job=replace(ONE.job, roundness_tolerance_um=2.5), whole=WHOLE, sections=SECTIONS)
"""RONt 8.0 um at Z 22, 2.0 and 1.0 um at Z 24 and 26."""


def inspected(part: MeasuredPart, language: str = "en") -> Shown:
    return shown_on(
        InspectPage, StationState(measured=part), work=with_strategy(signed(), "cam"), language=language
    )


def words(part: MeasuredPart, language: str = "en") -> str:
    return " ".join(inspected(part, language).text.replace("│", " ").split())


def with_faults(part: MeasuredPart, faults: RowFaults) -> MeasuredPart:
    assert part.learning is not None
    return replace(part, learning=replace(part.learning, faults=faults))


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_section_in_the_mark_of_a_stop_teaches_nothing_and_is_named(language: str) -> None:
    text, behind_mm = load(language), FAILED.job.overhang_mm - 22.0
    named = text("length_cause.mark", first="22.0")[:30]
    marked = inspected(replace(FAILED, marks_mm=(behind_mm + 0.3,)), language)
    said = " ".join(marked.text.replace("│", " ").split())
    assert named in said and not any(words in said for words in ("→", "(noise)", text("inspect_page.noise")))
    assert marked.next_step == text("inspect_page.next.failed_mark") and cell_len(marked.next_step) <= 77
    elsewhere = replace(FAILED, marks_mm=(behind_mm + 3.0,))
    others = replace(FAILED, job=replace(FAILED.job, roundness_tolerance_um=1.5), marks_mm=(behind_mm,))
    for part in (elsewhere, others):  # a mark where it is round, or a part that fails beside its mark, too
        assert inspected(part, language).next_step != marked.next_step
    assert named not in words(elsewhere, language)


def diagnosis(best: LatheFault, other: LatheFault, lead: float, um_pp: float = 11.1) -> FaultDiagnosis:
    ranked = (
        Explanation(fault=best, log_likelihood=lead, um_pp=um_pp),
        Explanation(fault=other, log_likelihood=0.0, um_pp=7.0, amount=-2.9),
    )
    return FaultDiagnosis(ranked=ranked, parts=3, misfit=0.5, apart_um={7: 3.4})


@pytest.mark.parametrize(
    ("best", "named"),
    [
        (LatheFault.BACKLASH, "play between scale and tip"),
        (LatheFault.HOLD, "a hold in the cut"),
        (LatheFault.ENTRY, "the push of the cut at its entry"),
    ],
)
def test_the_likeliest_fault_is_said_and_what_none_explains(best: LatheFault, named: str) -> None:
    found = diagnosis(best, LatheFault.ANGLE, 9.0)
    sure = with_faults(FAILED, RowFaults(diagnosis=found))
    assert f"Sure (parts: 3): {named}" in words(sure)
    (other,) = fault_words(found, (), load("en"))[1]
    assert other.startswith("7/rev is not from the chuck: 3.4 um p-p")
    assert inspected(sure).next_step != load("en")("inspect_page.next.failed_jaw")
    unsure = with_faults(FAILED, RowFaults(diagnosis=diagnosis(best, LatheFault.ANGLE, 1.0)))
    assert f"Likeliest: {named}" in words(unsure) and "next: jaw 1 elsewhere, by -2.9°" in words(unsure)
    assert "To decide:" in words(unsure)


def test_what_explains_nothing_of_the_part_has_no_um() -> None:
    nothing = RowFaults(diagnosis=diagnosis(LatheFault.CLAMPING, LatheFault.DRIFT, 1.0, 0.04))
    assert "clampings that scatter (nothing of the last)" in words(with_faults(FAILED, nothing))
    assert " 0.0 um p-p of the last" not in words(with_faults(FAILED, nothing))
    usual = RowFaults(diagnosis=diagnosis(LatheFault.USUAL, LatheFault.DRIFT, 1.0, 0.0))
    assert "no fault beyond the usual scatter; next" in words(with_faults(FAILED, usual))


@pytest.mark.parametrize("language", LANGUAGES)
def test_parts_that_a_compensation_makes_worse_are_advised_to_be_cut_without(language: str) -> None:
    text = load(language)
    worse = Problem(code="learning.worse", key="3", value="2.4 um", limit="1.8 um")
    passed = replace(ONE, job=replace(ONE.job, roundness_tolerance_um=5.0))
    for part in (passed, FAILED):
        page = inspected(with_faults(part, RowFaults(worse=(worse,))), language)
        assert page.next_step == text("inspect_page.next.plain_better") and cell_len(page.next_step) <= 77
        assert "--strategy none" in " ".join(page.text.replace("│", " ").split())
