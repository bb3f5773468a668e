"""The page Run: what must hold, two acts to start, the cut as it goes, and how it ended."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.cells import cell_len

from console.session.alignment import Alignment, Clamping, JawAngle, TouchOff
from console.session.intents import Arm, Disarm, Hold, Intent, Retract, Start
from console.session.progress import PHASE_LIMIT_DEG, CutProgress, CutStage
from console.session.state import Activity, Armed, StationState, StopState
from console.session.telemetry import CutFigures
from console.session.work import Work, edited, with_strategy
from console.tui.desk import View
from console.tui.pages.cut_lines import gauge, mean_error_um
from console.tui.pages.run import RunPage
from drivers.cut import Strategy, plan_cut
from drivers.snapshot import AxisState, Snapshot
from tests.tui.stage import FRAME_ROWS, LANGUAGES, SIZES, FixedControl, PageStage, desk_for, experiment, grid

ON = frozenset({"desired_velocity_zero", "in_position", "amplifier_enabled", "home_complete"})
OFF = frozenset({"desired_velocity_zero", "in_position", "open_loop", "home_complete"})
VALID = Alignment(
    settings=(),
    drives_on=True,
    homed=True,
    clamping=Clamping(force_n=1314.0, diameter_mm=52.0, at="08:40"),
    jaw=JawAngle(angle_deg=12.6, at="08:45"),
    touch_off=TouchOff(zero_radius_mm=76.0, at="08:46"),
)
SURFACE_COUNTS = 250_000.0
"""50 mm in from a zero at 76 mm: the radius of the part, 26 mm."""

FIGURES = CutFigures(
    spindle_speed_rpm=1000.04,
    tool_error_um=1.41,
    tool_error_rms_um=0.44,
    following_error_um=14.12,
    following_error_rms_um=9.02,
    samples=340,
)


def look(flags: frozenset[str] = ON, *, tool: float = 240_000.0, running: bool = False) -> Snapshot:
    def axis(position: float) -> AxisState:
        return AxisState(position=position, following_error=0.0, flags=flags)

    return Snapshot(
        at_s=100.0,
        tool=axis(tool),
        spindle=axis(350.0),
        carriage=axis(41_200.0),
        program_running=running,
        runtime_error=False,
    )


def state(alignment: Alignment = VALID, **changes: Any) -> StationState:
    known: dict[str, Any] = {"activity": Activity.READY, "looked_s": 100.0, "snapshot": look()}
    return StationState(alignment=alignment, **{**known, **changes})


def cut(stage: CutStage = CutStage.CUT, **changes: Any) -> CutProgress:
    angles_deg = np.arange(0.0, 200.0 * 137.0, 137.0) % 360.0
    known: dict[str, Any] = {
        "stage": stage,
        "holding": False,
        "turn": 83.0,
        "turns": 160.0,
        "z_mm": 4.2,
        "length_mm": 8.0,
        "left_s": 4.6,
        "speed_rpm": 1000.3,
        "tool_radius_mm": 25.9271,
        "infeed_um": 72.9,
        "wanted_um": 73.5,
        "tool_error_um": -0.6,
        "tool_error_peak_um": 1.4,
        "following_error_um": 12.3,
        "phase_error_deg": 0.08,
        "angles_deg": angles_deg,
        "errors_um": 0.5 * np.sin(np.radians(3.0 * angles_deg)),
    }
    return CutProgress(**{**known, **changes})


def cutting(**changes: Any) -> StationState:
    return state(activity=Activity.CUTTING, snapshot=look(running=True), cut=cut(**changes))


def stopped(**changes: Any) -> StationState:
    known: dict[str, Any] = {"reason": "space", "killed": False, "sent_s": 98.0, "rest_s": 99.3}
    return state(activity=Activity.STOPPED, cut=cut(), stop=StopState(**{**known, **changes}))


@pytest.fixture(scope="module")
def armed() -> Armed:
    work = experiment()
    plan = plan_cut(work.job, work.machine.machine, Strategy.PVT)
    return Armed(job=work.job, strategy=Strategy.PVT, plan=plan, until_s=108.4)


@dataclass(frozen=True)
class Shown:
    """What came of some keys."""

    text: str
    next_step: str
    orders: Sequence[Intent]
    said: Sequence[str]

    @property
    def words(self) -> str:
        """The text of the left panels, then that of the right ones, without line breaks and frames."""
        rows = [row.strip("│").partition("││") for row in self.text.splitlines()]
        return " ".join(" ".join([row[0] for row in rows] + [row[2] for row in rows]).split())


def shown(
    now: StationState,
    *actions: str,
    size: tuple[int, int] = (80, 24),
    language: str = "en",
    work: Work | None = None,
    no_job: bool = False,
) -> Shown:
    control = FixedControl(now)
    job = None if no_job else work or experiment()
    desk = desk_for(control, Path("/nowhere"), language, job)
    page = RunPage(desk)
    view = View(state=now, work=job, now_s=100.0)

    async def run() -> str:
        app = PageStage(page, view)
        async with app.run_test(size=(size[0], size[1] - FRAME_ROWS)) as pilot:
            await pilot.pause()
            for action in actions:
                page.act(action)
            for _ in range(2):
                page.show(view)
                await pilot.pause()
            return grid(app)

    text = asyncio.run(run())
    return Shown(
        text=text,
        next_step="".join(words for words, _ in page.next_step(view)),
        orders=control.orders,
        said=[problem.code for problem in desk.said],
    )


STATES = {
    "nothing known": StationState(),
    "ready": state(),
    "not aligned": state(Alignment()),
    "cutting": cutting(),
    "nothing seen yet": cutting(
        stage=CutStage.POSITION, phase_error_deg=None, angles_deg=np.empty(0), errors_um=np.empty(0)
    ),
    "done": state(cut=cut(CutStage.DONE, figures=FIGURES), cut_done=True),
    "held": state(cut=cut(CutStage.HELD)),
    "stopping": stopped(rest_s=None),
    "stopped in the part": stopped(tool_in_part=True, can_retract=True),
    "killed in the part": stopped(tool_in_part=True, killed=True),
}


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("size", [*SIZES, (60, 18)])
@pytest.mark.parametrize("name", STATES)
def test_no_row_is_wider_than_the_terminal(name: str, size: tuple[int, int], language: str) -> None:
    page = shown(STATES[name], size=size, language=language)
    rows = page.text.splitlines()
    assert len(rows) <= size[1] - FRAME_ROWS
    assert max(cell_len(row) for row in rows) <= size[0]
    assert cell_len(page.next_step) <= 77
    assert "run_page." not in page.text + page.next_step


def test_before_the_start_every_condition_has_a_mark_and_a_reason() -> None:
    page = shown(state(replace(VALID, jaw=None)))
    assert "✓ drives on" in page.text
    assert "✗ alignment valid" in page.text
    assert "jaw 1 is not found" in page.words
    assert "○ program" in page.text
    assert "4" in page.next_step


def test_the_summary_names_what_will_be_cut() -> None:
    page = shown(state(), size=(100, 30))
    for value in ("1314 N", "08:40", "0.100 mm", "0.050 mm/rev", "1000 rpm", "12.60 °", "R 76.000 mm"):
        assert value in page.text
    assert experiment().loaded.sha256[:6] in page.text
    assert "on radius" in page.text


def test_f5_arms_what_is_in_hand() -> None:
    work = with_strategy(experiment(), "paper")
    page = shown(state(), "run.arm", work=work)
    assert page.orders == [Arm(job=work.job, job_sha256=work.loaded.sha256, strategy=Strategy.PAPER)]


def test_an_edited_job_is_not_recorded_as_its_file() -> None:
    work = edited(experiment(), "depth_of_cut_mm", "0.05")
    page = shown(state(), "run.arm", work=work)
    (order,) = page.orders
    assert isinstance(order, Arm)
    assert order.job.depth_of_cut_mm == 0.05
    assert order.job_sha256 != work.loaded.sha256
    assert "edited since" in page.text


@pytest.mark.parametrize(
    ("now", "code"),
    [
        (state(replace(VALID, jaw=None)), "alignment.no_jaw"),
        (state(snapshot=look(OFF)), "alignment.drives_off"),
        (state(snapshot=look(running=True)), "screen.in_motion"),
        (state(snapshot=look(ON | {"amplifier_fault"})), "screen.axis_fault"),
        (state(cut=cut(CutStage.DONE), cut_done=True), "screen.part_is_cut"),
        (state(activity=Activity.VERIFYING), "screen.busy"),
        (stopped(), "screen.stopped_first"),
        (StationState(), "screen.nothing_known"),
    ],
)
def test_what_stands_in_the_way_is_said_and_nothing_armed(now: StationState, code: str) -> None:
    page = shown(now, "run.arm")
    assert (page.orders, page.said[0]) == ([], code)


def test_a_job_that_does_not_fit_is_not_armed() -> None:
    work = edited(experiment(), "cut_length_mm", "29")
    page = shown(state(), "run.arm", work=work)
    assert (page.orders, page.said) == ([], ["rule.length_over_overhang"])
    assert "2 changes it" in page.next_step


def test_without_a_job_there_is_nothing_to_arm() -> None:
    page = shown(state(), "run.arm", no_job=True)
    assert (page.orders, page.said) == ([], ["screen.nothing_to_cut"])


def test_armed_says_what_moves_first_and_how_long_it_holds(armed: Armed) -> None:
    page = shown(state(armed=armed), size=(100, 30))
    assert "ARMED" in page.text
    assert "F6 starts within 9 s" in page.words
    assert "tool out, carriage, spindle, tool in" in page.words
    assert "✓ program" in page.text
    assert "F6" in page.next_step


def test_f6_starts_only_what_is_armed(armed: Armed) -> None:
    assert shown(state(armed=armed), "run.start").orders == [Start()]
    assert shown(state(), "run.start").said == ["screen.not_armed"]
    late = replace(armed, until_s=99.0)
    assert shown(state(armed=late), "run.start").said == ["screen.not_armed"]


def test_f5_takes_the_arming_back(armed: Armed) -> None:
    assert shown(state(armed=armed), "run.arm").orders == [Disarm()]


def test_the_cut_shows_its_values_with_units() -> None:
    page = shown(cutting())
    assert "turn 83 of 160 · Z 4.2 of 8.0 mm · 5 s left" in page.text
    assert "52 %" in page.text
    # 3 lobes at 1000.3 rpm; the tool stands 0.6 um less deep than wanted, so wanted is the smaller radius.
    for value in ("1000.3 rpm", "50.0 Hz", "R 25.9271 mm", "R 25.9265 mm", "-0.60 um", "1.40 um", "+0.08 °"):
        assert value in page.text
    assert f"± {PHASE_LIMIT_DEG:.2f}°" in page.text
    assert "CUTTING" in page.text


def test_out_of_phase_is_a_word() -> None:
    assert "OUT -1.40 °" in shown(cutting(phase_error_deg=-1.4)).text
    assert "OUT" not in shown(cutting()).text


def test_the_plots_follow_the_looks() -> None:
    def dots(text: str) -> int:
        return sum(1 for character in text if 0x2800 < ord(character) <= 0x28FF)

    none = cutting(angles_deg=np.empty(0), errors_um=np.empty(0))
    assert dots(shown(none).text) == 0
    assert dots(shown(cutting()).text) > 10
    assert "um/div" in shown(cutting(), size=(100, 30)).text


def test_the_mean_error_is_that_of_the_lobe() -> None:
    moment = cut()
    angles_deg, errors_um = mean_error_um(moment)
    assert len(angles_deg) == 36
    assert errors_um == pytest.approx(0.5 * np.sin(np.radians(3.0 * angles_deg)), abs=0.1)


@pytest.mark.parametrize(
    ("share", "mark"),
    [
        (0.0, "├───●───┤"),
        (1.0, "├───┼──●┤"),
        (-1.0, "├●──┼───┤"),
        (1.5, "├───┼───▶"),
        (-9.0, "◀───┼───┤"),
        (None, "├───┼───┤"),
    ],
)
def test_the_gauge_shows_where_a_value_stands_in_its_limits(share: float | None, mark: str) -> None:
    assert gauge(share, 9) == mark


def test_hold_once_and_only_in_a_cut() -> None:
    assert shown(cutting(), "run.hold").orders == [Hold()]
    held = shown(cutting(holding=True), "run.hold")
    assert (held.orders, held.said) == ([], ["screen.holding_already"])
    assert "HOLD" in held.text
    assert shown(state(), "run.hold").said == ["screen.nothing_to_hold"]


def test_after_the_cut_figures_and_the_way_on() -> None:
    page = shown(STATES["done"])
    for value in ("1000.0 rpm", "1.41 um", "0.44 um", "14.12 um", "9.02 um", "340"):
        assert value in page.text
    assert "not measured yet" in page.words
    assert page.next_step.startswith("6 ")
    real = shown(replace(STATES["done"], simulated=False))
    assert "simulated" not in real.text


def test_a_held_cut_is_not_called_done() -> None:
    page = shown(STATES["held"])
    assert "Held at the end of a turn" in page.text
    assert "cut in part only" in page.words
    assert shown(STATES["held"], "run.arm").orders


def test_a_stop_tells_how_it_ended_and_what_to_do() -> None:
    page = shown(STATES["stopped in the part"])
    assert "1.3 s" in page.text
    assert "IN OR AT THE PART" in page.text
    assert "F2 goes on" in page.words
    assert "F8 takes the tool out" in page.words
    assert "NOT YET" in shown(STATES["stopping"]).text
    killed = shown(STATES["killed in the part"])
    assert "drives off" in killed.text
    assert "F8 cannot take the tool out" in killed.words


@pytest.mark.parametrize(
    ("now", "code"),
    [
        (stopped(tool_in_part=True, can_retract=True), "screen.stopped_first"),
        (cutting(), "screen.in_motion"),
        (state(), "screen.tool_is_out"),
        (state(snapshot=look(OFF, tool=SURFACE_COUNTS)), "machine.retract_not_possible"),
        (state(activity=Activity.ARMING, snapshot=look(tool=SURFACE_COUNTS)), "screen.busy"),
        (StationState(), "screen.nothing_known"),
    ],
)
def test_retract_says_why_not(now: StationState, code: str) -> None:
    page = shown(now, "run.retract")
    assert (page.orders, page.said) == ([], [code])


def test_retract_after_a_cut_that_was_left() -> None:
    left = state(snapshot=look(tool=SURFACE_COUNTS), cut=cut())
    page = shown(left, "run.retract")
    assert page.orders == [Retract()]
    assert "F8" in page.next_step
    assert "switches on" in shown(replace(left, snapshot=look(OFF, tool=SURFACE_COUNTS))).next_step


def test_enter_is_no_key_of_this_page() -> None:
    page = shown(state(), "run.take")
    assert page.orders == []
