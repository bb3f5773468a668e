"""The operator's keys of learning: what they choose and keep, what they say, and that nothing moves by them."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.session.cut.alignment import Alignment, JawAngle
from console.session.data.learned_store import FOLDER, asked_for, versions
from console.session.force_record import ForceCheck
from console.session.learning.calibrating import PartLobe, lobe_of
from console.session.learning.part_learning import PartLearning
from console.session.station.progress import CutStage
from console.session.station.state import Activity, MeasuredPart, StationState
from console.session.work import Work, edit_field, open_work, with_strategy
from console.text.catalogue import load
from console.text.part_sentences import force_words
from console.tui.gate import FieldKind
from console.tui.lines import plain_text
from console.tui.pages.inspect import InspectPage
from console.tui.pages.learn_lines import learn_lines
from console.tui.pages.learning_keys import accept_part
from console.tui.pages.preview import PreviewPage
from console.tui.pages.run import RunPage
from console.tui.previewing import ChosenPath
from drivers.cutting.planning import CutPlan, Strategy
from drivers.preview.preview import all_asked, program_of
from profiles.compensations.force_null import ForceNull, ForceNullReason, Sign, unknown
from profiles.compensations.learned_compensation import LearnedCompensation
from profiles.fingerprint.readings import ClampReadings
from profiles.problem import Problem
from profiles.store import load_job
from tests.tui import run_stage
from tests.tui.page_stage import PageScene, Shown, on_page, shown_on
from tests.tui.scenes import BEFORE, part, previewed, signed, taught_part
from tests.tui.stage import LANGUAGES, experiment

PART = taught_part()
"""One that was cut with `cam`, by the model."""

MEASURED = StationState(activity=Activity.READY, measured=PART)
JAW = Alignment(jaw=JawAngle(angle_deg=12.63, jaws=3, at="2 Jan 08:45"))


FAILED = replace(MEASURED, measured=replace(PART, job=replace(PART.job, roundness_tolerance_um=2.0)))


class OnInspect(PageScene):
    page_class = InspectPage


class OnPreview(PageScene):
    page_class = PreviewPage


def cam() -> Work:
    return with_strategy(signed(), "cam")


on_inspect = partial(on_page, OnInspect, work=cam(), state=MEASURED)


def used(stage: PageScene) -> LearnedCompensation:
    assert stage.ui.work is not None and stage.ui.work.compensation is not None
    return stage.ui.work.compensation


def kept(data: Path) -> list[int]:
    work = cam()
    asked = asked_for(work.loaded, work.machine, "cam", simulated=True)
    return [each.version for each in versions(data, asked)]


def without(reason: Problem) -> MeasuredPart:
    """The part, of which nothing may be kept."""
    assert PART.learning is not None and PART.learning.taught is not None
    step = replace(PART.learning.taught.step, reasons=(reason,))
    return replace(PART, learning=replace(PART.learning, taught=replace(PART.learning.taught, step=step)))


async def test_a_keeps_what_the_part_teaches_and_v_goes_back_to_the_model(tmp_path: Path) -> None:
    async with on_inspect(tmp_path, state=FAILED) as stage:
        await stage.show()
        assert "3/rev 1.82 → 0.11" in stage.text and "6/rev 0.58 → 0.00" in stage.text
        assert "gain 0.939 · improving x0.09" in stage.text and "next cut: model, full" in stage.text
        assert "a accepts" in stage.next_step
        await stage.act("inspect.accept")
        assert (used(stage).version, kept(tmp_path)) == (1, [1])
        assert "next cut: learned 1, full" in stage.text and "a accepts" not in stage.next_step
        await stage.act("inspect.accept")
        assert (stage.codes, kept(tmp_path)) == (["learned.accepted"], [1])
        await stage.act("inspect.revert")
        assert (used(stage).reverts, kept(tmp_path)) == (0, [1, 2])
        assert "next cut: learned 2 (= model), full" in stage.text
        await stage.act("inspect.revert")
        assert (stage.codes, kept(tmp_path)) == (["learned.no_before"], [1, 2])
        await stage.act("inspect.accept")
        assert (used(stage).version, kept(tmp_path)) == (3, [1, 2, 3])
        assert (stage.control.orders, stage.control.stops) == ([], [])


async def test_a_disk_error_is_told_and_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / FOLDER).write_text("no folder", encoding="utf-8")
    async with on_inspect(tmp_path) as stage:
        before = stage.ui.work
        await stage.act("inspect.accept")
        assert stage.codes == ["file.not_writable"] and stage.ui.work is before


@pytest.mark.parametrize(
    ("work", "state", "code"),
    [
        (cam(), StationState(activity=Activity.READY), "learned.no_part"),
        (edit_field(cam(), "depth_of_cut_mm", "0.05"), MEASURED, "learned.edited_now"),
        (replace(cam(), loaded=replace(cam().loaded, sha256="f" * 64)), MEASURED, "learned.other_job"),
        (cam(), replace(MEASURED, measured=without(Problem(code="learned.nothing"))), "learned.nothing"),
    ],
)
async def test_what_must_not_be_kept_is_not(work: Work, state: StationState, code: str, tmp_path: Path) -> None:
    async with on_page(OnInspect, tmp_path, work=work, state=state) as stage:
        await stage.act("inspect.accept")
        assert (stage.codes, kept(tmp_path)) == ([code], [])


@pytest.mark.first(4)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("measured", "key"),
    [
        (PART, "Enter"),
        (FAILED.measured, "a"),
        (without(Problem(code="learned.nothing", limit="2.45 sd")), "Enter"),
        (without(Problem(code="learned.diverges", key="--revert 0", value="1.4", limit="< 1")), "v"),
        (without(Problem(code="learned.worse", key="+25 deg", value="61.0 um", limit="55.0 um")), "jaw 1|조 1"),
    ],
)
def test_why_nothing_is_learned_and_what_comes_next_fit_the_screen(
    measured: MeasuredPart | None, key: str, language: str
) -> None:
    assert measured is not None
    page = shown_on(InspectPage, replace(MEASURED, measured=measured), work=cam(), language=language)
    assert cell_len(page.next_step) <= 77 and re.search(key, page.next_step)
    assert len(page.text.splitlines()) <= 18
    for reason in () if measured.learning is None else measured.learning.reasons:
        assert load(language).problem(reason)[:30] in page.text


def test_of_half_a_part_it_is_said_what_is_right_and_nothing_is_judged(tmp_path: Path) -> None:
    assert PART.learning is not None and PART.learning.taught is not None
    made = replace(PART.learning.made, stage="partial")
    half = replace(PART, learning=PartLearning(made=made, problems=(Problem(code="learned.nothing"),)))
    page = shown_on(InspectPage, replace(MEASURED, measured=half), work=cam())
    assert "PASS" not in page.text and "half cut: not judged" in page.text
    assert "full compensation next" in page.next_step
    rows = plain_text(learn_lines(PART.learning, cam(), load("en"), 76))
    assert "within clamping scatter (± 9.2 um): leave it." in " ".join(rows.split())


async def test_l_and_s_choose_and_say_what_does_not_hold(tmp_path: Path) -> None:
    async with on_page(OnPreview, tmp_path, work=cam(), state=MEASURED) as stage:
        await stage.act("preview.learned")
        assert stage.codes == ["learned.none_yet"]
        stage.ui.work = previewed_cam()
        await stage.act("preview.stage")
        assert "cut: model, in air" in stage.text and "Air cut" in stage.next_step
        await stage.act("preview.stage")
        assert "cut: model, half" in stage.text
        await stage.act("preview.stage")
        accept_part(stage.ui)
        await stage.act("preview.learned")
        assert stage.ui.work is not None and stage.ui.work.compensation is None
        await stage.act("preview.learned")
        assert used(stage).version == 1 and "cut: learned 1, full" in stage.text
        assert "(" not in stage.text.partition("── cam")[2].partition("um/div")[0], "no band for what was learned"
        # Another strategy: the version stays chosen, is refused, and comes back with its own.
        await stage.act("preview.strategy")
        assert stage.codes == ["learned.strategy"] and "✗ refused: learned 1, full" in stage.text
        assert "would be refused" in stage.next_step
        for _ in range(4):
            await stage.act("preview.strategy")
        assert stage.codes == [] and used(stage).version == 1
        assert stage.control.orders == []


async def test_an_edited_job_has_no_version_and_the_printed_program_has_no_half(tmp_path: Path) -> None:
    async with on_page(OnPreview, tmp_path, work=edit_field(cam(), "depth_of_cut_mm", "0.05")) as stage:
        await stage.act("preview.learned")
        assert stage.codes == ["learned.edited_now"]
        stage.ui.work = replace(with_strategy(cam(), "paper"), stage="air")
        await stage.act("preview.stage")
        assert stage.codes == [] and stage.ui.work.stage == "full"


def test_run_refuses_what_does_not_hold_and_says_what_is_cut(tmp_path: Path) -> None:
    one = learned()
    page = shown_on(RunPage, run_stage.state(), work=replace(cam(), compensation=one))
    assert "learned 1, full" in page.text and "✓ compensation and stage fit" in page.text
    page = shown_on(RunPage, run_stage.state(), "run.arm", work=replace(signed(), compensation=one))
    assert (page.orders, page.said) == ([], ["learned.strategy"])
    assert "(l, s)" in page.next_step


@pytest.mark.parametrize("language", LANGUAGES)
def test_after_the_air_comes_half_on_the_same_blank(language: str) -> None:
    text, done = load(language), run_stage.cut(CutStage.DONE, figures=run_stage.FIGURES, in_air=True)
    now, air = run_stage.state(cut=done), replace(cam(), stage="air")
    page, inspect = (shown_on(each, now, work=air, language=language) for each in (RunPage, InspectPage))
    assert page.next_step == text("run_page.next.arm_air") and inspect.next_step == text("inspect_page.next.air")
    assert text("run_page.done_in_air")[:12] in page.text and text("run_page.after_air")[:12] in page.text
    half = shown_on(RunPage, now, work=replace(air, stage="partial"), language=language)
    assert half.next_step == text("run_page.next.arm")
    assert max(cell_len(words) for words in (page.next_step, inspect.next_step)) <= 77
    under_way = shown_on(RunPage, run_stage.cutting(in_air=True), work=air, language=language)
    assert text("run_page.cut_in_air") in under_way.text


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_plain_cut_has_no_half_and_no_page_offers_one(language: str, tmp_path: Path) -> None:
    text, made = load(language), previewed(signed().job)
    plain = replace(with_strategy(signed(), "none"), outlook=made, preview=made)
    air = replace(plain, stage="air")
    now = run_stage.state(cut=run_stage.cut(CutStage.DONE, figures=run_stage.FIGURES, in_air=True))
    pages = [shown_on(page, now, work=air, language=language) for page in (PreviewPage, RunPage, InspectPage)]
    half = "절반" if language == "ko" else "half"
    for page in pages:
        assert "s" in page.next_step and half not in page.next_step
        assert cell_len(page.next_step) <= 77
    assert half not in pages[0].next_step and text("run_page.after_air_no_half")[:12] in pages[1].text
    async with on_page(OnPreview, tmp_path, work=plain) as stage:
        for wanted in ("air", "full", "air"):
            await stage.act("preview.stage")
            assert stage.ui.work is not None and (stage.ui.work.stage, stage.codes) == (wanted, [])
        # The half of another strategy is refused, and s leaves it.
        stage.ui.work = replace(plain, stage="partial")
        await stage.act("preview.stage")
        assert stage.ui.work.stage == "full"


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_job_that_has_its_lobe_is_not_said_to_be_compensated_while_its_next_cut_is_plain(language: str) -> None:
    text, made = load(language), part(Strategy.NONE, BEFORE)
    found = lobe_of(
        made.trace,
        made.job,
        PartLobe(loaded=load_job("lee-2001-experiment-1"), file="x", file_sha256=""),
        phase_known=True,
        simulated=True,
    )
    assert found.found is not None
    error_um = found.found.fit.error_um_pp
    job = replace(signed().job, lobe_error_source="fitted", lobe_error_um_pp=error_um)
    now = replace(MEASURED, measured=replace(made, lobe=found))
    for strategy, word, said in (("pvt", "lobe_taken", "lobe_taken"), ("none", "lobe_plain", "lobe_in_job")):
        work = replace(signed(), job=job, strategy=strategy)
        page = shown_on(InspectPage, now, work=work, language=language)
        assert page.next_step == text(f"inspect_page.next.{word}") and cell_len(page.next_step) <= 77
        words = text(f"inspect_page.{said}", job=job.name, strategy=strategy)
        assert words[:30] in page.text, page.text


async def test_a_lobe_twice_as_large_is_taken_only_when_its_ratio_is_typed_out(tmp_path: Path) -> None:
    made, loaded = part(Strategy.NONE, BEFORE), load_job("lee-2001-experiment-1")
    trace = replace(made.trace, deviation_um=2.0 * made.trace.deviation_um)
    bare = PartLobe(loaded=loaded, file="x", file_sha256="")
    found = lobe_of(trace, made.job, bare, phase_known=True, simulated=True)
    assert found.found is not None and not found.reasons
    state = replace(MEASURED, measured=replace(made, trace=trace, lobe=found))
    ratio = found.found.fit.error_um_pp / loaded.job.lobe_error_um_pp
    async with on_page(OnInspect, tmp_path, work=open_work(loaded, signed().machine), state=state) as stage:

        def jobs() -> list[str]:
            return [path.name for path in tmp_path.rglob("*.toml")]

        for typed in ("", "1.5", "x"):
            stage.ui.key_answer = ()
            await stage.act("inspect.accept")
            assert (stage.codes, stage.page.field, jobs()) == (["calibration.step"], FieldKind.NUMBER, [])
            assert "R <> D" in repr(stage.ui.key_answer) and "type out" in stage.next_step
            stage.page._entry.value = typed  # type: ignore[attr-defined]
            await stage.act("inspect.next")
            assert jobs() == [] and stage.gone == []
            await stage.act("inspect.revert")
            assert stage.page.field is FieldKind.NONE, "another key ends the entry"
        await stage.act("inspect.accept")
        stage.page._entry.value = f"{ratio:.3g}"  # type: ignore[attr-defined]
        await stage.act("inspect.next")
        assert jobs() and stage.page.field is FieldKind.NONE and stage.ui.work is not None
        assert stage.ui.work.job.lobe_error_um_pp == pytest.approx(ratio * loaded.job.lobe_error_um_pp)


def test_the_preview_is_of_the_path_that_is_cut_turned_to_jaw_1() -> None:
    one, chosen = learned(), ChosenPath()
    work = replace(cam(), compensation=one)
    path = chosen.path_for(work, JAW, simulated=True)
    assert path is not None and path is chosen.path_for(replace(work), JAW, simulated=True)
    turn_deg = (12.63 - work.job.jaw_1_deg) % 120.0
    assert (path.target.phase_deg - one.path.target.phase_deg) % 120.0 == pytest.approx(turn_deg)
    half = chosen.path_for(replace(work, stage="partial"), JAW, simulated=True)
    assert half is not None and half.target.amplitude_um == pytest.approx(0.5 * path.target.amplitude_um)
    assert chosen.path_for(cam(), JAW, simulated=True) is None
    assert chosen.path_for(with_strategy(work, "pvt"), JAW, simulated=True) is None


def learned() -> LearnedCompensation:
    assert PART.learning is not None and PART.learning.taught is not None
    return PART.learning.taught.step.next


def previewed_cam() -> Work:
    made = previewed(signed().job)
    return replace(cam(), outlook=made, preview=made)


def test_the_program_that_is_shown_for_the_air_is_the_one_further_out() -> None:
    job, machine = signed().job, signed().machine.machine
    asked = {each.strategy: each for each in all_asked(job, machine, Strategy.CAM, None, None, 1.1)}
    assert {strategy for strategy, each in asked.items() if each.air_mm} == {Strategy.CAM}
    air, usual = (
        program_of(each).plan for each in (asked[Strategy.CAM], replace(asked[Strategy.CAM], air_mm=0.0))
    )
    assert isinstance(air, CutPlan) and isinstance(usual, CutPlan)
    out_mm = (usual.setup.surface - air.setup.surface) / machine.tool.counts_per_mm
    assert out_mm == pytest.approx(1.1, abs=1e-9)


# What the cutting force of the half stage says on Run and Inspect, in both languages, at 80 columns.


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
        said += [force_words(unknown(3, why), text) for why in ForceNullReason if why is not ForceNullReason.NONE]
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
@pytest.mark.parametrize(
    ("what", "found"), [("wrong", WRONG), ("right", RIGHT), ("round", unknown(3, ForceNullReason.ROUND))]
)
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
