"""What the cutting force of the half stage says on Run and Inspect, in both languages, at 80 columns."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from rich.cells import cell_len

from console.session.force_record import ForceCheck
from console.session.learning.part_learning import PartLearning
from console.session.station.progress import CutStage
from console.text.catalogue import load
from console.text.part_sentences import force_words
from console.tui.pages.inspect import InspectPage
from console.tui.pages.run import RunPage
from profiles.compensations.force_null import ForceNull, Sign, Why, unknown
from profiles.fingerprint.readings import ClampReadings
from profiles.problem import Problem
from profiles.words.sentences import LANGUAGES
from tests.tui import run_stage
from tests.tui.page_stage import Shown, shown_on
from tests.tui.scenes import taught_part
from tests.tui.stage import experiment

WRONG = ForceNull(
    sign=Sign.WRONG_SIGN,
    lobes=3,
    force_n=1.06j,
    force_sd_n=0.03,
    right_n=-0.57j,
    wrong_n=1.05j,
    mean_n=2.6,
    ratio=-0.98 + 0j,
    turned_deg=-59.8,
    turned_sd_deg=1.7,
    air_turns=6,
    cut_turns=6,
)
RIGHT = replace(WRONG, sign=Sign.AGREES, force_n=-0.55j, ratio=0.9 + 0j, turned_deg=0.4)


def test_every_verdict_and_every_reason_has_words() -> None:
    for language in LANGUAGES:
        text = load(language)
        said = [force_words(replace(WRONG, sign=sign), text) for sign in Sign if sign is not Sign.UNKNOWN]
        said += [force_words(unknown(3, why), text) for why in Why if why is not Why.NONE]
        assert len(set(said)) == 9 and all("{" not in each for each in said)


WORDS = {
    ("en", "wrong"): "THE SIGN IS WRONG",
    ("ko", "wrong"): "부호가 틀렸습니다",
    ("en", "right"): "sign and angle are right",
    ("ko", "right"): "부호와 각도가 맞습니다",
    ("en", "round"): "round in the jaws",
    ("ko", "round"): "조에 물린 상태에서 이미 둥글었습니다",
}
"""What an operator reads of each verdict."""


def words_of(page: Shown) -> str:
    """The text of the panels on the left as it is read, from line to line."""
    return " ".join(" ".join(line.split("││")[0].strip("│ ") for line in page.text.splitlines()).split())


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("what", "found"), [("wrong", WRONG), ("right", RIGHT), ("round", unknown(3, Why.ROUND))])
def test_run_says_it_after_the_cut(language: str, what: str, found: ForceNull) -> None:
    done = run_stage.cut(CutStage.DONE, figures=run_stage.FIGURES, force=found)
    page = shown_on(RunPage, run_stage.state(cut=done, cut_done=True), language=language)
    assert WORDS[language, what] in words_of(page)


@pytest.mark.parametrize("language", LANGUAGES)
def test_run_warns_of_the_whole_before_it_is_armed(language: str) -> None:
    text, work = load(language), experiment()
    check = ForceCheck(job=work.job, found=WRONG)
    page = shown_on(RunPage, run_stage.state(force=check), work=work, language=language)
    assert f"! {text('run_page.check.force')}" in page.text
    for other in (replace(work, stage="partial"), replace(work, strategy="none")):
        unasked = shown_on(RunPage, run_stage.state(force=check), work=other, language=language)
        assert text("run_page.check.force") not in unasked.text


@pytest.mark.parametrize("language", LANGUAGES)
def test_inspect_says_it_beside_the_measured_half_and_leads_to_jaw_1(language: str) -> None:
    text, part = load(language), taught_part()
    assert part.learning is not None
    made = replace(part.learning.made, stage="partial")
    half = replace(part, learning=PartLearning(made=made, problems=(Problem(code="learned.nothing"),)))
    state = run_stage.state(measured=half, force=ForceCheck(job=part.job, found=WRONG))
    page = shown_on(InspectPage, state, work=experiment(), language=language)
    assert page.next_step == text("inspect_page.next.force") and cell_len(page.next_step) <= 77
    assert WORDS[language, "wrong"] in words_of(page)
    right = replace(state, force=ForceCheck(job=part.job, found=RIGHT))
    assert shown_on(InspectPage, right, work=experiment(), language=language).next_step == text(
        "inspect_page.next.half"
    )


@pytest.mark.parametrize("language", LANGUAGES)
def test_run_warns_of_indicator_readings_that_nothing_explains(language: str) -> None:
    text, work = load(language), experiment()
    angles = tuple(30.0 * place for place in range(12))
    for lobe_um, said in ((16.0, True), (30.0, False)):
        pressed = tuple(-lobe_um * math.cos(math.radians(3.0 * angle)) for angle in angles)
        read = ClampReadings(angle_deg=angles, finger_um=(0.0,) * 12, full_um=pressed, from_jaw_1=True)
        aligned = run_stage.state()
        aligned = replace(aligned, alignment=replace(aligned.alignment, readings=read))
        page = shown_on(RunPage, aligned, work=work, language=language)
        assert (f"! {text('run_page.check.fingerprint')}" in page.text) == said
