"""The form of the page Inspect in which the part is given the names that its certificate has."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from textual.widgets import Input

from console.report.page import write_report
from console.session.station.state import Activity, StationState
from console.session.work import with_strategy
from console.text.catalogue import load
from console.tui.pages.inspect import InspectPage
from tests.console.reported_runs import lobed, recorded
from tests.console.test_report import run_of, words
from tests.tui.page_stage import PageScene, on_page
from tests.tui.scenes import AFTER, signed, taught_part
from tests.tui.stage import LANGUAGES


class OnInspect(PageScene):
    page_class = InspectPage


play = partial(on_page, OnInspect, work=with_strategy(signed(), "cam"), size=(80, 18))


def measured(run_id: str | None) -> StationState:
    return StationState(activity=Activity.READY, measured=replace(taught_part(AFTER), run_id=run_id))


async def typed(stage: OnInspect, value: str) -> None:
    """Enter opens the selected field, the value is typed, Enter takes it."""
    await stage.act("inspect.next")
    stage.page.query_one("#part-entry", Input).value = value
    await stage.act("inspect.next")
    await stage.show()


@pytest.mark.parametrize("language", LANGUAGES)
async def test_what_is_typed_is_on_the_certificate_of_the_part(tmp_path: Path, language: str) -> None:
    run, text = recorded(tmp_path, {"after": lobed(1.0)}), load(language)
    async with play(tmp_path, state=measured(run), language=language) as stage:
        await stage.show()
        await stage.act("inspect.identify")
        await stage.show()
        for key in ("drawing", "order", "batch", "serial_number"):
            assert text(f"identity.{key}") in stage.text
        await stage.act("inspect.down")
        await typed(stage, "DR-100")
        await typed(stage, "4500012")
        assert "DR-100" in stage.text and "4500012" in stage.text
        await stage.act("inspect.measure")
        assert stage.codes == ["screen.close_identity"]
        await stage.act("inspect.last", "inspect.up")  # above the gauge
        await typed(stage, "200")
        assert stage.codes == ["value.out_of_range"], "and the entry stays, to be corrected"
        assert stage.page.query_one("#part-entry", Input).display
        stage.page.query_one("#part-entry", Input).value = "20,4"
        await stage.act("inspect.next", "inspect.identify")
        await stage.show()
        assert "DR-100" not in stage.text
        assert stage.control.orders == []
    said = words(write_report(run_of(tmp_path, run), text))
    assert "DR-100" in said and "4500012" in said and "20.4 °C" in said


async def test_a_part_that_no_record_has_is_given_no_names(tmp_path: Path) -> None:
    async with play(tmp_path, state=measured(None)) as stage:
        await stage.show()
        await stage.act("inspect.identify")
        await stage.show()
        text = load("en")
        assert text("identity.gauge") in stage.text and text("identity.drawing") not in stage.text
