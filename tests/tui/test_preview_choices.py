"""Page Preview: a response is chosen as versions are; the band, the speed and the findings are explained."""

from __future__ import annotations

import math
import re
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.session.cut.alignment import Alignment
from console.session.data.identified_responses import store
from console.session.station.commands import Arm
from console.session.station.state import Activity, StationState
from console.session.work import Work, edit_field, with_strategy
from console.text.catalogue import load
from console.tui.lines import plain_text
from console.tui.pages import run as run_page
from console.tui.pages.learn_lines import identified_words
from console.tui.pages.preview import PreviewPage, SpeedLimits, speed_line, why_lines
from console.tui.pages.preview_lines import findings_of
from console.tui.pages.run import RunPage
from console.tui.previewing import ChosenPath, Previewer
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, ResponseOrigin
from drivers.preview.band import predicted_band
from drivers.preview.outlook import outlook
from profiles.axis.servo import sampled_response
from profiles.job import Job
from tests.tui import run_stage
from tests.tui.page_stage import PageScene, on_page, shown_on
from tests.tui.scenes import previewed, signed
from tests.tui.stage import LANGUAGES, lathe

OLD, NEW = "2026-01-02T08:00:00.000Z", "2026-01-03T09:30:00.000Z"
READY = StationState(activity=Activity.READY)


def response(
    date: str,
    *,
    gain: float = 0.9,
    path: Strategy = Strategy.PVT,
    hz: tuple[float, ...] = (10.0, 50.0, 80.0),
    **of: object,
) -> IdentifiedResponse:
    """What `console identify` keeps of this lathe, whose tool follows with a fraction of the model's gain."""
    machine = lathe().machine
    gains = {f"I{number}": machine.controller.variables[f"I{number}"] for number in range(130, 136)}
    told: dict[str, object] = {"machine": machine.name, "simulated": True, "version": "1.17", "kind": "PMAC1, X1"}
    origin = ResponseOrigin(
        **{**told, "gains": gains, "servo_period_ms": machine.controller.servo_period_ms, **of}  # type: ignore[arg-type]
    )
    return IdentifiedResponse(
        origin=origin,
        path=path,
        how="measured",
        delay_cycles=0,
        date=date,
        points=tuple(point(each, gain * complex(sampled_response(machine, each))) for each in hz),
    )


def point(frequency_hz: float, found: complex) -> IdentifiedPoint:
    return IdentifiedPoint(
        frequency_hz=frequency_hz,
        gain=abs(found),
        phase_deg=math.degrees(math.atan2(found.imag, found.real)),
        gain_ci=0.002,
        phase_ci_deg=0.1,
        coherence=0.999,
        amplitude_um=30.0,
    )


class OnPreview(PageScene):
    page_class = PreviewPage


def pvt() -> Work:
    made = previewed(signed().job)
    return replace(signed(), outlook=made, preview=made)


def on_preview(data: Path) -> AbstractAsyncContextManager[OnPreview]:
    return on_page(OnPreview, data, work=pvt(), state=READY)


def chosen(stage: PageScene) -> str | None:
    assert stage.ui.work is not None
    return None if stage.ui.work.inverts is None else stage.ui.work.inverts.identified.date


async def test_i_steps_through_the_responses_of_this_machine_newest_first_and_back_to_the_model(
    tmp_path: Path,
) -> None:
    for each in (response(OLD), response(NEW), response("2026-01-04T00:00:00.000Z", simulated=False)):
        store(tmp_path, each)
    store(tmp_path, response("2026-01-05T00:00:00.000Z", gains={"I130": 1.0}))
    store(tmp_path, response("2026-01-06T00:00:00.000Z", path=Strategy.CAM))
    store(tmp_path, response("2026-01-07T00:00:00.000Z", machine="another"))
    async with on_preview(tmp_path) as stage:
        dates = []
        for _ in range(4):
            await stage.act("preview.response")
            dates.append(chosen(stage))
        assert dates == [NEW, OLD, None, NEW]
        assert stage.codes == [] and stage.control.orders == []
        short = identified_words(load("en"), "pvt-20260103T093000000Z.json")
        assert f"cut: {short}, full" in stage.text


async def test_without_one_the_key_says_what_makes_one(tmp_path: Path) -> None:
    async with on_preview(tmp_path) as stage:
        await stage.act("preview.response")
        assert stage.codes == ["response.none_kept"] and chosen(stage) is None
        store(tmp_path, response(NEW, gains={"I130": 1.0}))
        await stage.act("preview.response")
        assert stage.codes == ["response.of_another"] and chosen(stage) is None


def test_the_prediction_and_its_band_are_those_of_the_chosen_response() -> None:
    """A tool that follows with 0.9 of the model's gain is commanded 1 / 0.9 times as far, and leaves nothing."""
    from console.session.cut.compensated_cut import inverting
    from console.session.data.identified_responses import ChosenResponse
    from drivers.identification.result import as_response

    kept = response(NEW)
    choice = ChosenResponse(file=Path("there.json"), identified=kept, response=as_response(kept, "there.json"))
    work, path, previewer = inverting(signed(), choice), ChosenPath(), Previewer()
    cut = path.path_for(work, Alignment(), simulated=True)
    assert cut is not None
    by_model = previewed(signed().job)
    assert cut.command.amplitude_um == pytest.approx(by_model.command.amplitude_um / 0.9, rel=1e-3)
    begun = previewer.refresh_work(work, Alignment(), path=cut)
    assert begun.outlook is not None and begun.outlook.response is choice.response
    assert begun.outlook.command.amplitude_um == pytest.approx(cut.command.amplitude_um)
    half = path.path_for(replace(work, stage="partial"), Alignment(), simulated=True)
    assert half is not None and half.target.amplitude_um == pytest.approx(0.5 * cut.target.amplitude_um)
    # Refused for another strategy: neither is its path shown for what is cut.
    assert path.path_for(with_strategy(work, "cam"), Alignment(), simulated=True) is None


async def test_learned_and_identified_take_turns_and_another_strategy_is_refused(tmp_path: Path) -> None:
    from tests.tui.test_learning_keys import learned

    store(tmp_path, response(NEW))
    version = learned()
    async with on_preview(tmp_path) as stage:
        assert stage.ui.work is not None
        stage.ui.work = replace(stage.ui.work, compensation=version)
        await stage.act("preview.response")
        assert chosen(stage) == NEW and stage.ui.work.compensation is None
        assert [problem.code for problem in stage.ui.work.set_aside] == ["learned.set_aside"]
        await stage.act("preview.strategy")
        assert stage.codes == ["response.of_another"] and "✗ refused: ident." in stage.text
        assert "would be refused" in stage.next_step
        await stage.act("preview.response")
        assert chosen(stage) is None and stage.codes == []


async def test_a_speed_outside_what_was_identified_is_told_and_the_model_is_one_key_away(tmp_path: Path) -> None:
    store(tmp_path, response(NEW, hz=(10.0, 20.0, 30.0)))
    async with on_preview(tmp_path) as stage:
        await stage.act("preview.response")
        assert stage.ui.work is not None
        work = Previewer().refresh_work(stage.ui.work, Alignment(), path=None)
        assert [problem.code for problem in work.preview_problems] == ["response.outside_band"]
        stage.ui.work = work
        await stage.show()
        assert "i chooses another or the model" in stage.next_step
        await stage.act("preview.response")
        assert chosen(stage) is None


def test_the_command_and_the_summary_of_a_cut_have_the_response(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_page, "changed_since_opened", lambda _: ())  # the revision of this job is made up
    from console.session.data.identified_responses import kept_responses

    store(tmp_path, response(NEW))
    kept = kept_responses(tmp_path, lathe().machine, Strategy.PVT, simulated=True)[0]
    work = replace(signed(), inverts=kept)
    page = shown_on(RunPage, run_stage.state(), "run.arm", work=work)
    (order,) = page.orders
    assert isinstance(order, Arm) and order.inverts is kept and order.compensation is None
    assert identified_words(load("en"), kept.name) in page.words
    refused = shown_on(RunPage, run_stage.state(), "run.arm", work=with_strategy(work, "cam"))
    assert (refused.orders, refused.said) == ([], ["response.of_another"])


# What is explained ---------------------------------------------------------------------------------------------


def told(work: Work, language: str = "en", width: int = 78) -> str:
    seen = work.preview
    assert seen is not None
    strategy = Strategy(work.strategy)
    return plain_text(why_lines(work, seen, strategy, SpeedLimits().limit_for(seen), load(language), width))


def test_the_band_is_explained_largest_first_and_adds_up() -> None:
    """The root of the sum of squares of all but the deflection, which is added: the upper end of the band."""
    work = pvt()
    rows = told(work).splitlines()
    values = [float(row.split(" um ")[0]) for row in rows if row.lstrip()[:1].isdigit() and " um " in row]
    assert len(values) == 5 and values == sorted(values, reverse=True)
    assert work.preview is not None
    band = predicted_band(work.preview, Strategy.PVT)
    assert band is not None and band.cutting_um is not None
    squares = sum(value**2 for value in values) - band.cutting_um**2
    assert band.after_um + band.cutting_um + math.sqrt(squares) == pytest.approx(band.high_um, abs=0.05)
    assert f"{max(band.low_um, 2.0):.1f} to {band.high_um:.1f} um" in rows[0]


@pytest.mark.parametrize("language", LANGUAGES)
def test_nothing_below_2_um_is_forecast_and_what_is_calculated_is_told(language: str) -> None:
    work = pvt()
    assert work.preview is not None
    calculated_um = work.preview.predictions[Strategy.PVT].ront_um
    assert calculated_um < 0.5, "what the model of an inverted servo leaves"
    page = shown_on(PreviewPage, READY, work=work, language=language)
    for name in ("pvt", "cam", "timebase"):
        (row,) = [each for each in page.text.splitlines() if f" {name} " in each and "um" in each]
        assert re.search(r"\b2\.0 um", row), row
    assert "(2.0–" in page.text and "(0." not in page.text
    assert f"{calculated_um:.2f} um" in told(work, language)


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_highest_safe_speed_is_there_with_what_limits_it(language: str) -> None:
    text, page = load(language), shown_on(PreviewPage, READY, work=pvt(), language=language)
    assert f"1000 / 1734 rpm {text('speed_limit.grip')}" in page.text
    assert text("preview_page.why_speed", rpm=1734, limit=text("speed_limit.grip")) in told(pvt(), language)


def test_a_job_that_turns_faster_is_marked_in_words_and_figures() -> None:
    fast = replace(signed().job, spindle_speed_rpm=1800.0)
    limit = SpeedLimits().limit_for(outlook(fast, lathe().machine))
    assert limit.is_exceeded
    assert "! 1800 / 17" in plain_text([speed_line(limit, load("en"), 60)])


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("name", ["peak_thrust", "following_error", "encoder_acceleration", "grip_loss"])
def test_whatever_limits_the_speed_fits_its_row(name: str, language: str) -> None:
    limit = replace(
        SpeedLimits().limit_for(outlook(signed().job, lathe().machine)), limits_rpm={name: 5509.9}, binding=name
    )
    row = plain_text([speed_line(limit, load(language), 42)])
    assert cell_len(row) <= 42 and load(language)(f"speed_limit.{name}") in row and "1000 / 5509 rpm" in row


def demanding() -> Job:
    """A job with several findings."""
    return edit_field(
        replace(signed(), job=replace(signed().job, spindle_speed_rpm=1800.0)), "chucking_force_n", "2500"
    ).job


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.long
async def test_every_finding_is_read_in_full_at_the_smallest_size(language: str) -> None:
    text, seen = load(language), previewed(demanding())
    work = replace(signed(), job=demanding(), outlook=seen, preview=seen)
    found = findings_of(seen, Strategy(work.strategy))
    assert len(found) >= 2
    async with on_page(OnPreview, Path("/nowhere"), work=work, state=READY, language=language) as stage:
        await stage.show()
        rows = plain_text(stage.page.in_full(stage.view, 78))
        words = "".join(rows.split())
        for finding in found:
            assert "".join(text.problem(finding.problem).split()) in words
        assert all(cell_len(row) <= 78 for row in rows.splitlines())
