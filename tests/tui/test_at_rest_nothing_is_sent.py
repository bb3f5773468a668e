"""While nothing changes nothing is painted: on no page, at no size, however often the screen ticks."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from textual.widget import Widget

from console.tui.keymap import PageName
from tests.tui.scenes import application, fill, fixed_world, keys_to, played, settle
from tests.tui.test_settings_page import EVERYWHERE

TICKS = 3


@pytest.mark.parametrize("size", [(80, 24), (160, 48)])
@pytest.mark.long
async def test_a_tick_without_news_paints_nothing_on_any_page(
    size: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    painted: Counter[tuple[str, str]] = Counter()
    here = PageName.JOBS

    def counted(widget: Widget, *regions: object, **how: object) -> Widget:
        painted[here, widget.id or type(widget).__name__] += 1
        return refresh(widget, *regions, **how)  # type: ignore[arg-type]

    refresh = Widget.refresh
    fill(tmp_path)
    with fixed_world():
        app, _ = application(replace(EVERYWHERE, page=PageName.JOBS), tmp_path)
        async with played(app, replace(EVERYWHERE, page=PageName.JOBS), size) as pilot:
            for page in PageName:
                await pilot.press(*keys_to(page))
                await settle(app, pilot)
                here = page
                with monkeypatch.context() as patch:
                    patch.setattr(Widget, "refresh", counted)
                    for _ in range(TICKS):
                        app.tick()
                        await pilot.pause()
                    assert painted == {}
                    app.ui.say("screen.key_repeats")
                    app.tick()
                    assert painted, "what is painted would not be seen"
                painted.clear()
                app.ui.said = ()
        assert app.fault is None
