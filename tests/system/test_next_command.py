"""`console next`: the next step at a running console, in the operator's language, and why it cannot be done."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from console.__main__ import main
from console.cli.feed.next_step import step_words
from console.session.feed import server as server_module
from console.session.feed.feed_state import read_state
from console.session.feed.observed import RUN, Observed
from console.session.feed.report import line_of
from console.session.station.state import StationState
from console.text.catalogue import load
from tests.fuzz.of_feed import sound_states
from tests.system.test_feed import wait_for_feed
from tests.tui import align_stage, run_stage
from tests.tui.stage import MACHINE, experiment, lathe

pytestmark = pytest.mark.system
UNCLAMPED = replace(align_stage.VALID, clamping=None, drives_on=False)


class Screens:
    """Screens whose feed shows one moment."""

    def __init__(self) -> None:
        self.shown = Observed(state=StationState(), machine=lathe().machine, now_s=100.0)

    def show(self, state: StationState, program: str = "screens") -> None:
        named = replace(state, machine=MACHINE)
        self.shown = replace(self.shown, state=named, work=experiment(), program=program)


@pytest.fixture
def screens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Screens]:
    monkeypatch.setattr(server_module, "SHARED_S", 0.0)  # a line is of the moment that is shown
    shown = Screens()
    shown.show(run_stage.state())
    server = server_module.FeedServer(tmp_path, lambda: shown.shown)
    server.launch()
    wait_for_feed(tmp_path)
    yield shown
    server.close()


def said(capsys: pytest.CaptureFixture[str], data: Path, *more: str) -> str:
    assert main(["next", "--data", str(data), *more]) == 0
    return capsys.readouterr().out


def test_the_step_is_told_with_its_key_in_the_language_of_the_operator(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for language, page in (("en", "Run"), ("ko", load("ko")("page.run"))):
        out = said(capsys, tmp_path, "--lang", language)
        assert out.count("\n") == 1 and "SIM" in out and f"{MACHINE}@" in out
        assert out.rstrip().endswith(f"{page}: {load(language)('run_page.next.arm')}")
    screens.show(align_stage.state(UNCLAMPED, snapshot=align_stage.look(align_stage.OFF)))
    assert "1314 N" in said(capsys, tmp_path, "--machine", MACHINE)


def test_what_is_against_the_step_is_below_it(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    screens.show(align_stage.state(UNCLAMPED, snapshot=align_stage.look(align_stage.OFF)))
    step, *why = said(capsys, tmp_path).splitlines()
    assert "Enter" in step and any("drives" in each for each in why) and all(each[:4] == "  - " for each in why)
    told = json.loads(said(capsys, tmp_path, "--json"))
    assert (told["machine"], told["next"]["word"], told["next"]["key"]) == (MACHINE, "align.clamp", "align.take")
    assert "alignment.no_clamping" in [each["code"] for each in told["next"]["why"]]


def test_a_run_asks_nobody_and_no_console_is_an_error(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    screens.show(run_stage.cutting(), RUN)
    assert said(capsys, tmp_path).rstrip().endswith(load("en")("next.none"))
    assert main(["next", "--data", str(tmp_path), "--machine", "another"]) == main(
        ["watch", "--list", "--data", str(tmp_path), "--machine", "another"]
    )
    assert "another" in capsys.readouterr().err


def test_a_step_of_a_newer_console_is_told_by_its_word() -> None:
    values = {"word": "align.polish", "key": "align.polish", "left_s": None, "force_n": None, "radius_mm": None}
    table = json.loads(line_of(asdict(sound_states()[0])))
    for word in ("align.polish", "records.next", "x", "jog_page.{no}", "run.{left.__class__}"):
        table["next"] = {**values, "word": word, "why": []}
        state = read_state(json.dumps(table).encode())
        assert state.next is not None and step_words(state.next, state, load("en")) == word
