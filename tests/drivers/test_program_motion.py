"""What a program makes the motors do, commanded position by commanded position, over a port."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.pmac.program_text import read_program
from drivers.pmac.programs.paper import paper_program, spindle_start_counts
from drivers.pmac.programs.setup import cut_setup

if TYPE_CHECKING:
    from profiles.machine import MachineProfile
    from tests.drivers.conftest import Bench, JobMaker, Recorder


def run(bench: Bench, *lines: str, motor: int = 3) -> np.ndarray:
    """Run a program to its end; return the commanded positions of a motor, one servo cycle apart."""
    recorder = bench.record(motor)
    bench.program(*lines)
    bench.client.request("R")
    bench.settle()
    return np.array(recorder.commands)


def duration_ms(commands: np.ndarray, cycle_ms: float) -> float:
    changes = np.flatnonzero(np.diff(commands))
    return float(changes[-1] - changes[0] + 1) * cycle_ms


def steps(recorder: Recorder) -> np.ndarray:
    return np.diff(np.array(recorder.commands))


def play_paper(
    bench: Bench, machine: MachineProfile, experiment: JobMaker, ts_ms: int
) -> tuple[Recorder, Recorder]:
    """The mended Prog. 1 typed line by line; the two recorders hold its steady state."""
    job = experiment(1)
    text = paper_program(job, machine, cut_setup(job, machine, spindle_start_counts(job, machine)), ts_ms)
    bench.client.download(read_program(text).lines)
    bench.client.request("&1B1R")
    bench.sim.wait(3.0)
    tool, spindle = bench.record(1), bench.record(2)
    bench.sim.wait(1.2)
    assert bench.lathe.snapshot().program_running
    return tool, spindle


@pytest.mark.parametrize(("ts_ms", "rpm"), [(10, 500.0), (5, 1000.0)])
def test_the_mended_program_keeps_two_thirds_of_the_stroke(
    closed: Bench, machine: MachineProfile, experiment: JobMaker, ts_ms: int, rpm: float
) -> None:
    """TA10 TS10 TM10 makes 20 ms segments and 500 rpm, TS5 10 ms and 1000 rpm; 183.3 counts of 275 either way."""
    tool, spindle = play_paper(closed, machine, experiment, ts_ms)
    counts_per_ms = steps(spindle) / closed.cycle_ms
    assert counts_per_ms.min() == pytest.approx(rpm / 6, rel=1e-6)
    assert counts_per_ms.max() == pytest.approx(rpm / 6, rel=1e-6)
    commands = np.array(tool.commands)
    # The peak may fall between two servo cycles; at its top the acceleration is 2 v/TA.
    missed = 0.5 * (2 * 275 / (60_000 / rpm / 6) ** 2) * (0.5 * closed.cycle_ms) ** 2
    assert np.ptp(commands) == pytest.approx(275 * 2 / 3, abs=3 * missed)
    crossings = np.flatnonzero(np.diff(np.sign(commands - commands.mean())) > 0)
    period_ms = (crossings[-1] - crossings[0]) / (len(crossings) - 1) * closed.cycle_ms
    assert period_ms == pytest.approx(60_000 / rpm / 3, rel=2e-3)


def test_the_mended_program_ends_with_its_flag_and_withdraws_the_tool(
    closed: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
    tool, spindle = play_paper(closed, machine, experiment, 10)
    before = closed.number("P630")
    closed.client.request("M26=1")
    assert closed.number("M26") == 1
    closed.settle()
    assert closed.number("P630") <= before + 4
    assert np.array(tool.commands)[-1] < np.array(tool.commands).max() - 9_800
    assert steps(spindle)[-1] == 0


def test_p_v_and_f_are_read_while_the_program_runs(
    closed: Bench, machine: MachineProfile, experiment: JobMaker
) -> None:
    play_paper(closed, machine, experiment, 10)
    first = closed.client.numbers("#1P", "V", "F", "#2P", "V", "F")
    closed.sim.wait(0.12)
    second = closed.client.numbers("#1P", "V", "F", "#2P", "V", "F")
    assert second[3] - first[3] == pytest.approx(500 / 60 * 10_000 * 0.125, rel=0.05)
    assert first[4] == pytest.approx(500 / 6 * closed.cycle_ms, abs=1)
    assert abs(first[2]) > 0


def test_a_loop_of_one_move_meets_one_jump_back_and_blends(closed: Bench) -> None:
    """Ten moves of 100 ms and one acceleration time; the speed never drops in between."""
    commands = run(closed, "INC", "TA20 TS0 TM100", "P1=0", "WHILE(P1<10)", "P1=P1+1", "Z500", "ENDWHILE")
    assert commands[-1] == pytest.approx(5000)
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(1020, abs=1)


def test_two_jumps_back_for_each_move_stop_the_blending(closed: Bench) -> None:
    """Each move is then alone: TM + TA, ten times (User Manual, why moves may not be blended)."""
    commands = run(
        closed,
        *("INC", "TA20 TS0 TM100", "P1=0", "WHILE(P1<10)", "P1=P1+1", "P2=0"),
        *("WHILE(P2<2)", "P2=P2+1", "ENDWHILE", "Z500", "ENDWHILE"),
    )
    assert commands[-1] == pytest.approx(5000)
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(10 * 120, abs=6)
    velocity = np.diff(commands)
    slow = velocity < 0.05 * velocity.max()
    assert np.count_nonzero(slow[1:] & ~slow[:-1]) == 10


def reached(commands: np.ndarray, place: float) -> bool:
    return bool(np.abs(commands - place).min() < 0.01)


def test_a_dwell_lets_the_programmed_point_be_reached_and_waits(closed: Bench) -> None:
    commands = run(closed, "INC", "TA20 TS0 TM40", "Z400", "DWELL100", "Z-400")
    assert commands.max() == pytest.approx(400, abs=1e-6)
    at_top = np.count_nonzero(np.abs(commands - 400) < 1e-6) * closed.cycle_ms
    assert at_top == pytest.approx(100, abs=1.0)


def test_without_a_dwell_a_reversal_turns_round_short_of_the_point(closed: Bench) -> None:
    """By v TA/4 = 10 counts/ms x 20 ms / 4."""
    commands = run(closed, "INC", "TA20 TS0 TM40", "Z400", "Z-400")
    assert commands.max() == pytest.approx(400 - 50, abs=0.1)


def test_a_delay_is_blended_like_a_move_of_no_distance(closed: Bench) -> None:
    """Z400, DELAY40, Z400: TA/2 + 40 + 40 + 40 + TA/2, half of the acceleration time inside the delay."""
    commands = run(closed, "INC", "TA20 TS0 TM40", "Z400", "DELAY40", "Z400")
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(140, abs=1)
    at_rest = np.count_nonzero(np.abs(commands - 400) < 1e-6) * closed.cycle_ms
    assert at_rest == pytest.approx(40 - 20, abs=1.0)


def hermite(p0: float, v0: float, p1: float, v1: float, t: np.ndarray, h: float) -> np.ndarray:
    """The cubic by its basis functions."""
    u = t / h
    return np.asarray(
        p0 * (1 + 2 * u) * (1 - u) ** 2
        + h * v0 * u * (1 - u) ** 2
        + p1 * u**2 * (3 - 2 * u)
        + h * v1 * u**2 * (u - 1)
    )


def test_pvt_passes_its_points_with_the_velocities_asked(closed: Bench) -> None:
    points = [(0.0, 0.0), (150.0, 6.0), (700.0, 2.0), (500.0, -4.0), (400.0, 0.0)]
    commands = run(closed, "ABS", "PVT50", "Z150:6000", "Z700:2000", "Z500:(0-4000)", "Z400:0")
    start = np.flatnonzero(np.diff(commands))[0]
    times = np.arange(1, int(200 / closed.cycle_ms) + 1) * closed.cycle_ms
    segment = np.minimum((times / 50).astype(int), 3)
    target = np.empty_like(times)
    for index, ((p0, v0), (p1, v1)) in enumerate(pairwise(points)):
        inside = segment == index
        target[inside] = hermite(p0, v0, p1, v1, times[inside] - 50 * index, 50)
    assert np.abs(commands[start + 1 : start + 1 + len(times)] - target).max() < 1e-6
    assert commands[-1] == pytest.approx(400)


def test_a_feedrate_takes_distance_over_f_of_the_feedrate_axes(closed: Bench) -> None:
    """X30 Y40 Z10 at F100: half a second and, at 1 count a unit, 60, 80 and 20 counts/s (FRAX X, Y only there)."""
    closed.client.request("I188=0")
    recorder = closed.record(2)
    closed.program("INC", "TA10 TS0 F100", "X30 Y40")
    closed.client.request("R")
    closed.settle()
    commands = np.array(recorder.commands)
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(510, abs=1)
    assert np.diff(commands).max() / closed.cycle_ms == pytest.approx(0.080, rel=1e-6)


def test_the_last_of_tm_and_f_wins(closed: Bench) -> None:
    commands = run(closed, "INC", "TA10 TS0", "TM50 F1000", "Z100", "F1000 TM50", "Z100")
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(100 + 50 + 10, abs=1)


def test_factory_velocity_limit_stretches_the_move(closed: Bench) -> None:
    closed.client.request("I316=32 I317=0")
    commands = run(closed, "INC", "TA10 TS0 TM1000", "Z100000")
    assert np.diff(commands).max() / closed.cycle_ms == pytest.approx(32)
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(3135, abs=1)


def test_ta_and_ts_are_rounded_to_whole_milliseconds_when_executed(closed: Bench) -> None:
    commands = run(closed, "INC", "TA10.4 TS0.2 TM20.5", "Z100")
    assert closed.client.numbers("I187", "I188", "I189") == (10, 0, 20.5)
    assert duration_ms(commands, closed.cycle_ms) == pytest.approx(30.5, abs=0.9)
