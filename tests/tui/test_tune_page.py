"""The page Tune: margins of the gains that were read, responses that are and are not of this loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.station.commands import Command, ReadLoop
from console.session.station.state import Activity, StationState
from console.tui.further.tune import TunePage
from console.tui.records import beside
from console.tui.tuning.loop_facts import loop_facts
from drivers.identification.tool_loop import ToolLoop
from drivers.lathe.snapshot import AxisState, Snapshot
from drivers.lathe.standing import Standing
from tests.tui import tune_stage
from tests.tui.machine_states import REST
from tests.tui.page_stage import PageScene, play_on
from tests.tui.stage import LANGUAGES, lathe
from tests.tui.test_console_keys import armed

AT_REST = Snapshot(
    asked_s=100.0,
    at_s=100.0,
    tool=AxisState(position=0.0, following_error=0.0, flags=REST),
    spindle=AxisState(position=0.0, following_error=0.0, flags=REST),
    carriage=AxisState(position=0.0, following_error=0.0, flags=REST),
    program_running=False,
    runtime_error=False,
)
STATE = StationState(
    activity=Activity.READY, machine="lee-2001-lathe", snapshot=AT_REST, tool_loop=tune_stage.tool_loop()
)


@pytest.fixture(autouse=True)
def in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is computed is there when it is asked for, however busy this computer is."""
    monkeypatch.setattr(beside, "SHORT_S", 60.0)


class TuneScene(PageScene):
    page_class = TunePage

    @property
    def words(self) -> str:
        return " ".join(self.text.replace("│", " ").split())


def with_values(**changed: float) -> ToolLoop:
    """The loop with other values of Ixx, by their numbers: `n30=...`."""
    numbers = {int(name[1:]): value for name, value in changed.items()}
    loop = tune_stage.tool_loop()
    return replace(loop, values=tuple((number, numbers.get(number, value)) for number, value in loop.values))


def test_the_margins_are_those_of_the_gains_that_were_read_not_of_the_profile(tmp_path: Path) -> None:
    async def scene(stage: TuneScene) -> None:
        await stage.show()
        # By python-control: tests/profiles/test_margins.py. Four times the gain leaves a fourth of the margin.
        assert "gain margin 5.58 (+14.9 dB) @ 281 Hz" in stage.words
        stage.control.state = replace(STATE, tool_loop=with_values(n30=2112.0))
        await stage.act("tune.read")
        assert "! gain margin 1.39 (+2.9 dB) @ 281 Hz" in stage.words
        assert "I130 2112 (528), I133 900 (811)" in stage.words
        stage.control.state = replace(STATE, tool_loop=with_values(n30=40_000.0))
        await stage.act("tune.read")
        assert "UNSTABLE" in stage.words and "gain margin" not in stage.words

    play_on(TuneScene, scene, tmp_path, state=STATE, size=(80, 24))


def test_a_setting_that_the_model_does_not_have_is_told(tmp_path: Path) -> None:
    async def scene(stage: TuneScene) -> None:
        await stage.show()
        assert "I136, I168 not 0" in stage.words

    play_on(TuneScene, scene, tmp_path, state=replace(STATE, tool_loop=with_values(n36=-1.2, n68=40.0)))


def test_the_controller_is_asked_when_the_page_is_shown_but_not_where_that_would_disarm_a_cut(
    tmp_path: Path,
) -> None:
    asked: dict[str, tuple[list[Command], list[str]]] = {}
    states = {
        "ready": STATE,
        "armed": replace(STATE, armed=armed()),
        "cutting": replace(STATE, activity=Activity.CUTTING),
        "observing": replace(STATE, standing=Standing.OUSTED, holder=7),
        "lost": replace(STATE, activity=Activity.LOST),
        "connecting": StationState(),
    }

    async def scene(stage: TuneScene) -> None:
        for name, state in states.items():
            stage.page.leave()
            stage.control.state, stage.control.orders, stage.ui.said = state, [], ()
            await stage.show()
            by_itself = list(stage.control.orders)
            stage.control.orders = []
            await stage.act("tune.read")
            asked[name] = (by_itself, stage.codes)
            assert (by_itself == []) is bool(stage.codes), name
            assert stage.control.orders == by_itself

    play_on(TuneScene, scene, tmp_path, state=STATE)
    assert {name: bool(orders) for name, (orders, _) in asked.items()} == {
        "ready": True,
        "armed": False,
        "cutting": False,
        "observing": True,
        "lost": False,
        "connecting": False,
    }
    assert asked["armed"][1] == ["screen.tune_armed"] and asked["ready"][0] == [ReadLoop()]


def test_a_response_of_another_loop_says_why_and_a_broken_file_is_told(tmp_path: Path) -> None:
    tune_stage.fill(tmp_path)
    folder = tmp_path / "identified" / "lee-2001-lathe"
    (folder / "pvt-20260102T000000000Z.json").write_text("{", encoding="utf-8")

    async def scene(stage: TuneScene) -> None:
        await stage.show()
        assert stage.words.index("cannot be read") < stage.words.index("of this loop")
        assert stage.words.index("of this loop") < stage.words.index("another loop: I130")
        await stage.act("tune.down", "tune.down", "tune.down")
        assert "I130" in stage.words and "600" in stage.words, "the reason in full"

    play_on(TuneScene, scene, tmp_path, state=STATE, size=(160, 42))


@pytest.mark.parametrize("language", LANGUAGES)
def test_plots_and_texts_are_beside_each_other_where_there_is_room_else_by_a_key(
    language: str, tmp_path: Path
) -> None:
    tune_stage.fill(tmp_path)
    words = {"en": ("Gain, command", "phase margin"), "ko": ("게인, 지령", "위상 여유")}[language]

    async def scene(stage: TuneScene) -> None:
        seen = []
        for _ in range(2):
            await stage.show()
            await stage.show()
            seen.append(tuple(word in stage.text for word in words))
            await stage.act("tune.view")
        wide = stage.app.size.width >= 130
        assert seen == ([(True, True)] * 2 if wide else [(False, True), (True, False)])

    for size in ((80, 18), (160, 42)):
        play_on(TuneScene, scene, tmp_path, state=STATE, size=size, language=language)


def test_without_a_reading_the_gains_are_those_of_the_profile_and_the_page_says_so(tmp_path: Path) -> None:
    async def scene(stage: TuneScene) -> None:
        await stage.show()
        assert "was not read" in stage.words and "Ki 32.2" in stage.words

    play_on(TuneScene, scene, tmp_path, state=replace(STATE, tool_loop=None), size=(80, 24))


def test_table_5_is_shown_beside_the_machine_of_the_paper_alone(tmp_path: Path) -> None:
    machine = lathe().machine
    facts = loop_facts(machine, None, tmp_path, simulated=True)
    assert facts.paper is not None
    # Table 5: 5.8 um of 50 um at 50 Hz, 0.241 rad.
    assert facts.paper.gain_db[2] == pytest.approx(-1.07, abs=0.01)
    assert facts.paper.phase_deg[2] == pytest.approx(-13.8, abs=0.01)
    assert loop_facts(replace(machine, name="other"), None, tmp_path, simulated=True).paper is None
