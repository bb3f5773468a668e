"""Rules of the frame that no page may break: the name of the stop, nothing flashes, the word SIM, one key."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import console
from console.text.catalogue import load
from console.tui.frame import ROWS
from console.tui.gate import FieldKind
from console.tui.keymap import ACTIONS, PageName
from console.tui.lines import plain
from console.tui.theme import COLOUR, Token
from tests.tui.stage import LANGUAGES
from tests.tui.test_frame_rows import frame

TUI = Path(console.__file__).parent / "tui"


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_stop_key_is_no_emergency_stop(language: str) -> None:
    """Rules S1 and S2: it is called STOP MOTION, and is neither red nor yellow."""
    text = load(language)
    for field, key in ((FieldKind.NONE, "frame.stop"), (FieldKind.TEXT, "frame.stop_in_text")):
        shown = text(key)
        assert ("STOP MOTION" if language == "en" else "정지") in shown
        assert not {"emergency", "비상", "e-stop"} & set(shown.casefold().split())
        row = ROWS["stop"](replace(frame(language=language), field=field), 80)[-1]
        assert row[0][0].strip() == shown and row[0][1] is Token.STOP
    background = COLOUR[Token.STOP].bgcolor
    assert background is not None and background.triplet is not None
    assert max(background.triplet) - min(background.triplet) < 32, "a grey"


def test_nothing_flashes() -> None:
    """Rule C4."""
    lines = [line for path in TUI.rglob("*.py") for line in path.read_text(encoding="utf-8").splitlines()]
    assert {line.strip().rpartition(".")[2] for line in lines if "blink" in line} == {"cursor_blink = False"}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", PageName)
def test_a_simulation_is_called_one_in_the_first_row(page: PageName, language: str) -> None:
    """Rule X1."""
    shown = frame(language=language)
    for simulated in (True, False):
        now = replace(shown, page=page, state=replace(shown.state, simulated=simulated))
        assert (load(language)("sim") in plain(ROWS["state"](now, 80)).split()) is simulated


def test_every_action_has_a_single_key() -> None:
    """Rule L1: a chord exists only beside a single key, and to leave."""
    chords = [
        action.id for action in ACTIONS if action.keys and all("+" in key and len(key) > 1 for key in action.keys)
    ]
    assert chords == ["quit"]
