"""A measured part along its length: Inspect and Records draw its sections as a stack and as a map."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from rich.cells import cell_len

from console.session.cut.recording import form_event
from console.session.cut.telemetry import CutStretch
from console.session.station.progress import CutStage
from console.session.station.state import Activity, StationState
from console.session.work import with_strategy
from console.text.catalogue import load
from console.tui.pages.inspect import InspectPage
from console.tui.records import background_reader
from profiles.metrology.cylindricity import PartSection, evaluate_cylinder
from tests.tui import records_stage, run_stage
from tests.tui.page_stage import PageScene, on_page
from tests.tui.scenes import AFTER, signed, taught_part
from tests.tui.stage import LANGUAGES, experiment

ROOMS = ((80, 18), (160, 42))
ANGLE_DEG = np.arange(0.0, 360.0)
SECTIONS = tuple(
    PartSection(z_mm=z, angle_deg=ANGLE_DEG, deviation_um=lobe_um * np.cos(np.radians(3.0 * ANGLE_DEG)))
    for z, lobe_um in ((22.0, 4.0), (24.0, 1.0), (26.0, 0.5))
)
WHOLE = evaluate_cylinder(SECTIONS, filter_upr=50.0)
ONE = taught_part(AFTER)
PART = replace(ONE, whole=WHOLE, sections=SECTIONS, section_z_mm=24.0)


STRETCHES = tuple(
    CutStretch(from_z_mm=30.0 - 1.6 * place, to_z_mm=28.4 - 1.6 * place, error_um=um)
    for place, um in enumerate((127.24, 120.71, 17.68, 14.72, None))
)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", [(80, 24), (160, 48)])
def test_run_shows_the_tool_error_of_each_stretch_and_where_it_is_largest(
    room: tuple[int, int], language: str
) -> None:
    text = run_stage.shown(run_stage.cutting(stretches=STRETCHES), size=room, language=language).text
    assert "127.2  120.7  17.7  14.7  – um" in text and "Z 30.0…28.4 mm" in text
    spindle = run_stage.shown(run_stage.cutting(stretches=STRETCHES, judged=False), size=room, language=language)
    assert "30.0…28.4" not in spindle.text, "a tool that follows no lobe is off by all of it"


def test_the_end_of_a_cut_says_where_its_peak_was() -> None:
    ended = run_stage.cut(CutStage.DONE, figures=replace(run_stage.FIGURES, stretches=STRETCHES))
    assert "1.41 um Z 30.0…28.4" in run_stage.shown(run_stage.state(cut=ended, cut_done=True)).text


class OnInspect(PageScene):
    page_class = InspectPage


play = partial(on_page, OnInspect, work=with_strategy(signed(), "cam"))


async def press_l(stage: PageScene) -> str:
    await stage.act("inspect.length")
    for _ in range(3):
        await stage.show()
    return stage.text


@pytest.mark.first(2)
@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("room", ROOMS)
async def test_l_shows_all_sections_then_their_map_then_the_part_again(
    room: tuple[int, int], language: str, tmp_path: Path
) -> None:
    text = load(language)
    worst = text("sections.worst", z="22.0 mm", ront=f"{WHOLE.worst.ront_um:.2f} um")
    state = StationState(activity=Activity.READY, measured=PART)
    async with play(tmp_path, language=language, size=room, state=state) as stage:
        stack = await press_l(stage)
        assert text("sections.stack") in stack and worst in stack
        for z_mm in ("26.0", "24.0", "22.0▸"):
            assert z_mm in stack
        await stage.act("inspect.larger")
        area = await press_l(stage)
        assert text("sections.map") in area and worst in area and "22.0▸" in area
        assert "▒" in area and text("sections.stack") not in area
        again = await press_l(stage)
        assert text("sections.map") not in again and "RONt LSC" in again
        for shown in (stack, area):
            assert all(cell_len(row) <= room[0] for row in shown.splitlines())
        assert stage.control.orders == [] and stage.codes == []


async def test_the_verdict_stays_beside_them_where_there_is_room(tmp_path: Path) -> None:
    async with play(tmp_path, size=ROOMS[1], state=StationState(activity=Activity.READY, measured=PART)) as stage:
        for _ in range(2):
            assert "CYLt MZCY, 3 sections" in await press_l(stage)


async def test_one_section_has_no_length(tmp_path: Path) -> None:
    one = replace(ONE, section_z_mm=24.0)
    async with play(tmp_path, size=ROOMS[1], state=StationState(activity=Activity.READY, measured=PART)) as stage:
        await press_l(stage)
        stage.control.state = replace(stage.control.state, measured=one)
        for _ in range(3):
            await stage.show()
        assert "RONt LSC" in stage.text and "CYLt" not in stage.text
        before = stage.text
        assert await press_l(stage) == before
        assert stage.codes == ["trace.few_sections"]


@pytest.mark.parametrize("room", ROOMS)
async def test_a_recorded_part_is_drawn_after_a_restart(
    room: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(background_reader, "SHORT_S", 60.0)  # however busy this computer is
    records_stage.run(tmp_path, 1.3)
    records_stage.run(tmp_path, 1.3, more=form_event(WHOLE, SECTIONS))
    async with on_page(records_stage.RecordsScene, tmp_path, work=experiment(), size=room) as page:
        await page.act("records.open", "records.length")
        shown = page.text
        worst = f"▸ worst at Z 22.0 mm: RONt {WHOLE.worst.ront_um:.2f} um"
        assert shown.count(worst) == 2 and "▒" in shown and "360°" in shown
        await page.act("records.length")
        full = " ".join("".join(piece for piece, _ in row) for row in page.page.in_full(page.view, 78))
        assert "worst at Z 22.0 mm" in full and "22.0" in full and "◂ worst" in full
        await page.act("records.back", "records.down", "records.open", "records.length")
        assert "No sections of a part are recorded." in page.text
