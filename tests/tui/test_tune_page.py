"""The page Tune: margins of the gains that were read, responses that are and are not of this loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.data.health import store as store_test
from console.session.data.identified_responses import store
from console.session.station.commands import ApplyGains, CheckHealth, Command, IdentifyTool, ReadLoop, RevertGains
from console.session.station.state import Activity, StationState
from console.session.tuning.standing_trial import StandingTrial, stands_problem
from console.tui.further.loop_lines import loop_facts
from console.tui.further.tune import TunePage
from console.tui.lines import plain_text
from console.tui.records import background_reader
from drivers.cutting.strategy import Strategy
from drivers.identification.tool_gains import ToolLoop
from drivers.lathe.console_role import ConsoleRole
from drivers.lathe.snapshot import AxisState, Snapshot
from tests.tui import align_stage, run_stage, tune_stage
from tests.tui.page_stage import PageScene, on_page
from tests.tui.stage import LANGUAGES, ON, REST, aligned, lathe

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
    monkeypatch.setattr(background_reader, "SHORT_S", 60.0)


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


async def test_the_margins_are_those_of_the_gains_that_were_read_not_of_the_profile(tmp_path: Path) -> None:
    async with on_page(TuneScene, tmp_path, state=STATE, size=(80, 24)) as stage:
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


async def test_a_setting_that_the_model_does_not_have_and_a_loop_that_was_not_read_are_told(
    tmp_path: Path,
) -> None:
    strange = replace(STATE, tool_loop=with_values(n36=-1.2, n68=40.0))
    async with on_page(TuneScene, tmp_path, state=strange, size=(80, 24)) as stage:
        await stage.show()
        assert "I168 not 0" in stage.words
        assert "I136 -1.2 (0)" in stage.words, "a filter that the profile does not state differs from it"
        stage.control.state = replace(STATE, tool_loop=None)
        await stage.act("tune.read")
        assert "was not read" in stage.words and "Ki 32.2" in stage.words, "the gains are those of the profile"


async def test_the_controller_is_asked_when_the_page_is_shown_but_not_where_that_would_disarm_a_cut(
    tmp_path: Path,
) -> None:
    asked: dict[str, tuple[list[Command], list[str]]] = {}
    states = {
        "ready": STATE,
        "armed": replace(STATE, armed=run_stage.armed()),
        "cutting": replace(STATE, activity=Activity.CUTTING),
        "observing": replace(STATE, standing=ConsoleRole.OUSTED, holder=7),
        "lost": replace(STATE, activity=Activity.LOST),
        "connecting": StationState(),
    }
    async with on_page(TuneScene, tmp_path, state=STATE) as stage:
        for name, state in states.items():
            stage.page.leave()
            stage.control.state, stage.control.orders, stage.ui.key_answer = state, [], ()
            await stage.show()
            by_itself = list(stage.control.orders)
            stage.control.orders = []
            await stage.act("tune.read")
            asked[name] = (by_itself, stage.codes)
            assert (by_itself == []) is bool(stage.codes), name
            assert stage.control.orders == by_itself
    assert {name: bool(orders) for name, (orders, _) in asked.items()} == {
        "ready": True,
        "armed": False,
        "cutting": False,
        "observing": True,
        "lost": False,
        "connecting": False,
    }
    assert asked["armed"][1] == ["screen.tune_armed"] and asked["ready"][0] == [ReadLoop()]


async def test_a_response_of_another_loop_says_why_and_a_broken_file_is_told(tmp_path: Path) -> None:
    tune_stage.fill(tmp_path)
    folder = tmp_path / "identified" / "lee-2001-lathe"
    (folder / "pvt-20260102T000000000Z.json").write_text("{", encoding="utf-8")
    async with on_page(TuneScene, tmp_path, state=STATE, size=(160, 42)) as stage:
        await stage.show()
        assert stage.words.index("cannot be read") < stage.words.index("of this loop")
        assert stage.words.index("of this loop") < stage.words.index("another loop: I130")
        await stage.act("tune.down", "tune.down", "tune.down")
        assert "I130" in stage.words and "600" in stage.words, "the reason in full"


@pytest.mark.first(1)
@pytest.mark.parametrize("language", LANGUAGES)
async def test_plots_and_texts_are_beside_each_other_where_there_is_room_else_by_a_key(
    language: str, tmp_path: Path
) -> None:
    tune_stage.fill(tmp_path)
    words = {"en": ("Gain, command", "phase margin"), "ko": ("이득, 지령", "위상 여유")}[language]
    for size in ((80, 18), (160, 42)):
        async with on_page(TuneScene, tmp_path, state=STATE, size=size, language=language) as stage:
            seen = []
            for _ in range(4):
                await stage.show()
                await stage.show()
                seen.append(tuple(word in stage.text for word in words))
                await stage.act("tune.view")
            wide = stage.app.size.width >= 130
            texts = [(False, False), (False, True)]  # tests, and proposed gains with their margins
            assert seen == (
                [(True, True), *texts, (True, True)] if wide else [(False, True), (True, False), *texts]
            )


def test_table_5_is_shown_beside_the_machine_of_the_paper_alone(tmp_path: Path) -> None:
    machine = lathe().machine
    facts = loop_facts(machine, None, tmp_path, simulated=True)
    assert facts.paper is not None
    # Table 5: 5.8 um of 50 um at 50 Hz, 0.241 rad.
    assert facts.paper.gain_db[2] == pytest.approx(-1.07, abs=0.01)
    assert facts.paper.phase_deg[2] == pytest.approx(-13.8, abs=0.01)
    assert loop_facts(replace(machine, name="other"), None, tmp_path, simulated=True).paper is None


# Health tests ----------------------------------------------------------------------------------------------------

HOMED = AxisState(position=0.0, following_error=0.0, flags=ON)
SET_UP = replace(STATE, snapshot=replace(AT_REST, tool=HOMED, spindle=HOMED, carriage=HOMED))
"""Drives enabled, axes homed, nothing clamped."""


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_test_is_armed_with_what_it_moves_and_started_by_a_key_of_its_own(
    language: str, tmp_path: Path
) -> None:
    async with on_page(TuneScene, tmp_path, state=SET_UP, language=language, size=(80, 18)) as stage:
        await stage.act("tune.arm")
        assert stage.control.orders in ([], [ReadLoop()]) and "25 um" in stage.words and "F6" in stage.words
        await stage.act("tune.start")
        assert stage.control.orders[-1] == CheckHealth(step_um=25.0)
        stage.control.orders, stage.ui.key_answer = [], ()
        await stage.act("tune.start")
        assert (stage.control.orders, stage.codes) == ([], ["screen.tune_not_armed"]), "once"
        await stage.act("tune.kind", "tune.kind", "tune.arm", "tune.start")
        assert stage.control.orders == [IdentifyTool(path=Strategy.CAM)]


async def test_what_was_armed_is_not_started_late_nor_after_anything_has_changed(tmp_path: Path) -> None:
    async with on_page(TuneScene, tmp_path, state=SET_UP) as stage:
        await stage.show()
        changes: dict[str, tuple[StationState, float, tuple[str, ...]]] = {
            "in time": (SET_UP, 119.0, ()),
            "late": (SET_UP, 121.0, ()),
            "another key": (SET_UP, 101.0, ("tune.down",)),
            "lost control": (replace(SET_UP, standing=ConsoleRole.OUSTED, holder=7), 101.0, ()),
            "drives off": (STATE, 101.0, ()),
            "a cut armed": (replace(SET_UP, armed=run_stage.armed()), 101.0, ()),
        }
        started = {}
        for name, (state, at_s, keys) in changes.items():
            stage.control.state = SET_UP
            stage.control.at(100.0)
            await stage.act("tune.arm")
            stage.control.state, stage.control.orders = state, []
            stage.control.at(at_s)
            for action in (*keys, "tune.start"):
                stage.page.act(action)
            started[name] = bool(stage.control.orders)
        stage.control.state = SET_UP
        stage.control.at(100.0)
        await stage.act("tune.arm")
        stage.page.leave()
        stage.control.orders = []
        stage.page.act("tune.start")
        started["left the page"] = bool(stage.control.orders)
        assert started == {name: name == "in time" for name in started}


async def test_a_test_is_refused_with_its_reason_and_the_next_step_is_what_it_still_lacks(tmp_path: Path) -> None:
    states = {
        "alignment.drives_off": (STATE, "A test needs drives enabled and axes homed"),
        "": (SET_UP, "F5 arms"),
        "machine.tool_in_part": (
            replace(SET_UP, alignment=aligned(76.1), snapshot=align_stage.IN_PART),
            "jog it away",
        ),
        "screen.tune_cut_armed": (replace(SET_UP, armed=run_stage.armed()), "F5 says why"),
        "screen.observes": (replace(SET_UP, standing=ConsoleRole.OUSTED, holder=7), ""),
        "screen.in_motion": (replace(SET_UP, activity=Activity.CUTTING), ""),
    }
    async with on_page(TuneScene, tmp_path, state=SET_UP) as stage:
        await stage.act("tune.kind")
        for code, (state, words) in states.items():
            stage.page.leave()
            stage.control.state, stage.control.orders, stage.ui.key_answer = state, [], ()
            await stage.show()
            assert words in stage.next_step, code
            await stage.act("tune.arm")
            if code != "machine.tool_in_part":  # whose reason is that of its next step
                assert stage.codes == ([code] if code else []), code
            assert not [order for order in stage.control.orders if order != ReadLoop()]


async def test_before_the_first_test_the_page_says_what_one_does_and_in_which_unit(tmp_path: Path) -> None:
    async with on_page(TuneScene, tmp_path, state=SET_UP, size=(80, 18)) as stage:
        await stage.act("tune.view")
        await stage.act("tune.view")
        assert "Step, um over ms" in stage.text and "a sine of 40 Hz" in stage.words
        await stage.act("tune.kind")
        assert "it swings by" in stage.words


@pytest.mark.parametrize("size", [(80, 18), (160, 42)])
async def test_the_trend_has_the_newest_first_and_one_beside_model_and_last(
    size: tuple[int, int], tmp_path: Path
) -> None:
    tune_stage.fill_tests(tmp_path)

    def rise(stage: TuneScene) -> list[str]:
        row = next(row for row in stage.text.splitlines() if "rise time" in row)
        return row.strip("│").split("│")[0].split()[-3:]

    async with on_page(TuneScene, tmp_path, state=STATE, size=size) as stage:
        await stage.show()
        while "rise time" not in stage.text:
            await stage.act("tune.view")
            await stage.show()
        assert stage.words.index("2026-01-01 10:00") < stage.words.index("2025-12-20 09:00")
        assert rise(stage) == ["4.9", "4.91", "–"]
        await stage.act("tune.down")
        assert rise(stage) == ["–", "4.91", "–"]


@pytest.mark.first(1)
@pytest.mark.parametrize(("language", "size"), [("en", (80, 18)), ("ko", (80, 18)), ("en", (160, 42))])
async def test_gains_are_proposed_for_the_measured_plant_in_full_and_not_written(
    language: str, size: tuple[int, int], tmp_path: Path
) -> None:
    tune_stage.fill_measured(tmp_path)
    async with on_page(TuneScene, tmp_path, state=STATE, size=size, language=language) as stage:
        await stage.show()
        stage.control.orders = []
        while "I130" not in stage.text or "tool.gain_kp" not in stage.text:
            await stage.act("tune.view")
            await stage.show()
        shown = plain_text(stage.page.in_full(stage.view, 78))
        assert "2026-01-01 10:06" in shown and "528" in shown and "console controller apply" in shown
        assert "tune_page." not in shown + stage.next_step and stage.control.orders == []


async def test_what_was_seen_of_another_firmware_makes_no_proposal_that_apply_would_refuse(tmp_path: Path) -> None:
    """How a filter is read was seen of version 1.17: another gets one that is safe however it is read."""
    store(tmp_path, tune_stage.identified(tune_stage.swept(tune_stage.bending(), 0.0002)))
    store_test(tmp_path, tune_stage.filter_test())
    async with on_page(
        TuneScene, tmp_path, state=replace(STATE, firmware=("1.18", "PMAC")), size=(80, 24)
    ) as stage:
        await stage.act("tune.view", "tune.view", "tune.view")
        await stage.show()
        said = " ".join(plain_text(stage.page.in_full(stage.view, 200)).split())
        assert "I136" in said and "a first notch filter" in said


async def test_without_a_response_of_the_axis_none_are_proposed_and_what_to_measure_is_said(
    tmp_path: Path,
) -> None:
    async with on_page(TuneScene, tmp_path, state=STATE, size=(80, 24)) as stage:
        await stage.act("tune.view", "tune.view", "tune.view")
        said = " ".join(plain_text(stage.page.in_full(stage.view, 200)).split())
        assert "nobody knows what bends" in said and "console identify --frequencies 25,30" in said
        await stage.act("tune.apply")
        assert stage.codes == ["screen.tune_no_proposal"]


OLD = (("I130", 528.0), ("I131", 4905.0), ("I132", 4905.0), ("I133", 811.0))
NEW = (("I130", 700.0), ("I131", 4200.0), ("I132", 4200.0), ("I133", 900.0))


def on_trial(found: tuple[tuple[str, float], ...] = NEW) -> StandingTrial:
    """Gains that were applied, as the controller has them now."""
    return StandingTrial(
        date="2026-01-02T08:30:00.000Z",
        by="kim",
        before=OLD,
        proposed=NEW,
        found=found,
        whole=found == NEW,
        problems=(stands_problem(OLD, NEW, found),),
    )


async def test_proposed_gains_are_written_with_the_second_press_of_a(tmp_path: Path) -> None:
    tune_stage.fill_measured(tmp_path)
    async with on_page(TuneScene, tmp_path, state=STATE, size=(80, 24)) as stage:

        def written() -> list[ApplyGains]:
            return [order for order in stage.control.orders if isinstance(order, ApplyGains)]

        await stage.act("tune.apply")
        assert stage.codes == ["screen.tune_look_first"]
        await stage.act("tune.view", "tune.view", "tune.view")
        assert "a applies these gains on trial" in stage.next_step
        await stage.act("tune.apply")
        assert "a again within 20 s writes" in stage.words and "I130 528 → " in stage.words
        await stage.act("tune.read", "tune.apply")
        assert written() == [], "another key is a change of mind"
        stage.control.at(121.0)
        await stage.act("tune.apply")
        assert written() == [], "it has expired"
        await stage.act("tune.apply")
        (order,) = written()
        # The integrator that was read is in it, not that of the profile.
        assert dict(order.shown)["I133"] == 900.0
        filtered = ["I136", "I137", "I138", "I139"]
        assert [name for name, _ in order.settings] == [name for name, _ in OLD] + filtered


@pytest.mark.parametrize("language", LANGUAGES)
async def test_gains_on_trial_are_shown_with_those_before_and_taken_back_with_b(
    language: str, tmp_path: Path
) -> None:
    async with on_page(
        TuneScene, tmp_path, language=language, state=replace(STATE, trial=on_trial()), size=(80, 24)
    ) as stage:
        await stage.show()
        assert "I130 700" in stage.words, "on the first view, too"
        await stage.act("tune.revert")
        for word in ("2026-01-02 08:30", "kim", "528 700 700", "4905 4200 4200", "I130 700 → 528"):
            assert word in stage.words, word
        assert RevertGains not in {type(order) for order in stage.control.orders}
        await stage.act("tune.revert")
        assert stage.control.orders[-1] == RevertGains()


async def test_what_stands_after_a_broken_writing_is_told_and_nothing_is_written_where_that_is_not_safe(
    tmp_path: Path,
) -> None:
    found = (("I130", 700.0), ("I131", 4905.0), ("I132", 17.0), ("I133", 811.0))
    on = replace(AT_REST, tool=replace(AT_REST.tool, flags=ON))
    states = {
        "screen.tune_drives_on": replace(STATE, snapshot=on, trial=on_trial()),
        "screen.observes": replace(STATE, standing=ConsoleRole.OUSTED, holder=7),
        "screen.tune_gains_armed": replace(STATE, armed=run_stage.armed()),
        "screen.tune_unread": replace(STATE, tool_loop=None),
        "trial.none": STATE,
    }
    async with on_page(TuneScene, tmp_path, state=replace(STATE, trial=on_trial(found)), size=(80, 24)) as stage:
        await stage.act("tune.revert")
        assert "did NOT come to its end" in stage.words
        assert "as proposed I130 700; as before I131 4905, I133 811; neither I132 17" in stage.words
        assert "I132 4905 4200 17" in stage.words
        stage.page.leave()
        for code, state in states.items():
            stage.control.state, stage.ui.key_answer = state, ()
            await stage.act("tune.revert" if code in ("trial.none", "screen.tune_drives_on") else "tune.apply")
            assert stage.codes == [code]
            assert not {ApplyGains, RevertGains} & {type(order) for order in stage.control.orders}
