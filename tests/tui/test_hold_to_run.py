"""Hold-to-run by the repeat of a terminal: measured before it is used, and ended by all but its next repeat."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest
from textual.pilot import Pilot

from console.session.station.commands import Jog
from console.session.station.state import Activity
from console.tui.align.hold_run import Calibration, HoldRun, Repeat
from console.tui.keymap import PageName
from tests.tui import align_stage
from tests.tui.scenes import Scene, application, fill, played
from tests.tui.stage import experiment, grid

REPEAT = Repeat(first_s=0.5, gap_s=0.035)
READY = align_stage.state()


def calibrated(first_s: float, period_s: float, late_s: float = 0.0) -> Repeat | None:
    """Hold a key for four seconds on a terminal with this repeat, of which one comes late."""
    calibration, now_s = Calibration(), 0.0
    calibration.press(now_s)
    now_s += first_s
    for n in range(int(4.0 / period_s)):
        now_s += late_s if n == 10 else 0.0
        if calibration.press(now_s):
            return calibration.measured
        now_s += period_s
    return None


def test_the_timeout_follows_from_the_largest_gap() -> None:
    quick, slow = calibrated(0.5, 0.033), calibrated(0.25, 0.092)
    assert quick is not None and (quick.first_s, quick.timeout_s) == (0.5, 0.1)
    assert slow is not None and slow.timeout_s == pytest.approx(0.138)


@pytest.mark.parametrize(
    ("first_s", "period_s", "late_s"), [(0.5, 0.2, 0.0), (0.5, 0.033, 0.15), (0.75, 0.033, 0.0)]
)
def test_a_slow_terminal_or_an_uneven_line_stays_with_single_steps(
    first_s: float, period_s: float, late_s: float
) -> None:
    assert calibrated(first_s, period_s, late_s) is None


def test_taps_of_the_key_measure_nothing() -> None:
    calibration = Calibration()
    assert not any(calibration.press(n * 0.9) for n in range(10))


def held(*repeats_s: float) -> HoldRun:
    run = HoldRun()
    run.begin(0.0)
    for at_s in repeats_s:
        run.repeat(at_s, REPEAT)
    return run


def test_it_runs_while_repeats_come_and_not_before() -> None:
    assert not held().runs(0.3, REPEAT)
    assert held(0.5, 0.533, 0.566).runs(0.6, REPEAT)
    assert not held(0.5, 0.533, 0.566).runs(0.7, REPEAT)
    assert not held(0.5).runs(0.52, None)


def test_what_a_stalled_line_brings_later_moves_nothing() -> None:
    run = held(0.5, 0.533, 0.566)
    # Half a second nothing, then everything at once, and then the rhythm again: the key has to be pressed anew.
    for at_s in (1.1, 1.1, 1.1, 1.133, 1.166):
        run.repeat(at_s, REPEAT)
        assert not run.runs(at_s, REPEAT)
    run.begin(3.0)
    run.repeat(3.5, REPEAT)
    assert run.runs(3.51, REPEAT)


def test_the_overrun_counts_the_step_under_way_and_those_begun_until_the_timeout() -> None:
    # 0.1 s of timeout and 0.25 s till then; a step takes 0.3 s: under way, begun, begun before the end.
    assert REPEAT.overrun_steps(0.3) == 3
    assert REPEAT.overrun_steps(0.6) == 2


def hold(
    tmp_path: Path, key: str, *, calibrate: bool = True, stall_at_s: float = 99.0
) -> tuple[int, str, list[str]]:
    """Hold h for 3.2 s, then a jog key for 2 s, on a machine that makes each step at once; then let 1 s pass."""
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=READY, work=experiment())
    app, control = application(scene, tmp_path)
    shown: list[str] = []
    counts: list[int] = []

    async def press(pilot: Pilot[None], key: str, begin_s: float, for_s: float) -> None:
        now_s = begin_s
        while now_s < begin_s + for_s:
            control.at(now_s)
            await pilot.press(key)
            app.tick()
            gap_s = 0.5 if now_s == begin_s else 0.05
            stalls = key != "h" and abs(now_s - begin_s - stall_at_s) < 0.03
            now_s += gap_s + (0.4 if stalls else 0.0)
            counts.append(len(control.orders))

    async def run() -> None:
        async with played(app, scene, (80, 24)) as pilot:
            if calibrate:
                await press(pilot, "h", 100.0, 3.2)
            control.at(104.0)
            await pilot.press("j")
            await press(pilot, key, 105.0, 2.0)
            for n in range(10):
                control.at(107.1 + 0.1 * n)
                app.tick()
                await pilot.pause()
            shown.append(grid(app))

    asyncio.run(run())
    orders = [order for order in control.orders if isinstance(order, Jog)]
    assert len(orders) == counts[-1]  # none after the last repeat
    return len(orders), shown[0], [problem.code for problem in app.ui.said]


def test_a_held_key_is_one_step_before_the_repeat_is_measured(tmp_path: Path) -> None:
    steps, text, said = hold(tmp_path, "right", calibrate=False)
    assert (steps, said) == (1, ["screen.jog_key_held"])
    assert "Jog, step only" in text


def test_a_held_key_runs_in_steps_once_it_is_and_ends_with_its_repeats(tmp_path: Path) -> None:
    steps, text, _ = hold(tmp_path, "pageup")
    assert steps > 20  # 30 repeats, on a machine that needs no time for a step
    # Step 0.10 degrees, 4 of them.
    assert "Jog, hold: ≤ 0.4° over" in text


def test_a_stall_ends_it_although_the_key_is_still_held(tmp_path: Path) -> None:
    steps, _, _ = hold(tmp_path, "pageup", stall_at_s=0.8)
    assert 1 < steps < hold(tmp_path / "even", "pageup")[0] / 2


@pytest.mark.long
def test_toward_the_work_every_step_is_a_press(tmp_path: Path) -> None:
    steps, _, said = hold(tmp_path, "down")
    assert (steps, said) == (1, ["screen.no_hold_to_work"])


async def test_one_step_is_under_way_at_most(tmp_path: Path) -> None:
    fill(tmp_path)
    scene = Scene(page=PageName.ALIGN, state=READY, work=experiment())
    app, control = application(scene, tmp_path)
    control.arrives = False
    async with played(app, scene, (80, 24)) as pilot:
        for n in range(70):
            control.at(100.0 + (0.0 if n == 0 else 0.5 + 0.05 * n))
            await pilot.press("h")
        control.at(106.0)
        await pilot.press("j")
        for n in range(30):
            control.at(107.0 + (0.0 if n == 0 else 0.5 + 0.05 * n))
            control.state = replace(READY, activity=Activity.JOGGING if n else Activity.READY)
            await pilot.press("pageup")
            app.tick()
    assert len(control.orders) == 1
