"""What a program makes the motors do over a port, goes wrong or goes on for ever."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from drivers.pmac.dialect import TURBO
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.paper import paper_program, segment_ms, spindle_start_counts
from drivers.pmac.programs.setup import cut_setup
from drivers.pmac.settings import servo_cycle_ms, settings_with
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


def test_the_mended_program_is_read_while_it_runs_ends_with_its_flag_and_withdraws_the_tool(
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


def test_p_v_and_f_are_read_while_it_runs(closed: Bench, machine: MachineProfile, experiment: JobMaker) -> None:
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


def test_a_dwell_lets_the_programmed_point_be_reached_and_waits(closed: Bench) -> None:
    commands = run(closed, "INC", "TA20 TS0 TM40", "Z400", "DWELL100", "Z-400")
    assert commands.max() == pytest.approx(400, abs=1e-6)
    at_top = np.count_nonzero(np.abs(commands - 400) < 1e-6) * closed.cycle_ms
    assert at_top == pytest.approx(100, abs=1.0)


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


# Programs that go wrong, go on for ever, are quit or watched: the motion stays smooth and the time goes on.

PVT_MOVES = ("ABS", "PVT50", "Z100:4000", "Z300:4000")
LINEAR_MOVES = ("INC", "TA20 TS0 TM100", "Z400", "Z400")


def acceleration(commands: np.ndarray, cycle_ms: float) -> np.ndarray:
    """Commanded acceleration in counts/ms2."""
    return np.diff(commands, 2) / cycle_ms**2


def run_for(bench: Bench, *lines: str, wait_s: float = 2.0) -> np.ndarray:
    recorder = bench.record(3)
    bench.program(*lines)
    bench.client.request("R")
    bench.sim.wait(wait_s)
    return np.array(recorder.commands)


@pytest.mark.parametrize(
    "error",
    (
        "P(0-1)=3 | TA0 TS0 Z400 | TA(0-5) | F0 Z100 | Z(EXP(700)) | Z100:500 | P1=EXP(900) | PVT0 | "
        "PVT10 Z2000:(EXP(700))"
    ).split(" | "),
)
def test_a_run_time_error_in_linear_moves_ends_at_the_target_without_a_jump(closed: Bench, error: str) -> None:
    """The moves that are calculated are done: 800 counts, with the ramps of TA20 at the most (1 ms after TA0)."""
    commands = run_for(closed, *LINEAR_MOVES, error)
    snapshot = closed.lathe.snapshot()
    assert snapshot.runtime_error
    assert not snapshot.program_running
    assert not closed.moving
    assert commands[-1] == pytest.approx(800, abs=1e-6)
    limit = 5.0 if "TA0" in error else 4 / 20
    assert np.abs(acceleration(commands, closed.cycle_ms)).max() <= limit * 1.001
    assert closed.lathe.snapshot().loops_closed


@pytest.mark.parametrize("error", ["P(0-1)=3", "TA0 Z500:0", "LINEAR TM100 Z900", "PVT0", "Z(EXP(700))"])
def test_a_run_time_error_in_pvt_ramps_the_speed_down_without_a_jump(closed: Bench, error: str) -> None:
    """4 counts/ms at Ix15 = 0.5 of the carriage, 0.5 of the spindle and 40 of the tool: 16 counts more."""
    commands = run_for(closed, *PVT_MOVES, error)
    assert closed.lathe.snapshot().runtime_error
    assert commands[-1] == pytest.approx(300 + 4**2 / (2 * 0.5), abs=1e-3)
    velocity = np.diff(commands) / closed.cycle_ms
    assert np.abs(np.diff(velocity)).max() <= 0.5 * closed.cycle_ms * 1.001


@pytest.mark.parametrize(
    "loop",
    [
        ("WHILE(1=1)", "ENDWHILE"),
        ("WHILE(1=1)", "P1=P1+1", "ENDWHILE"),
        ("WHILE(1=1)", "DWELL0", "ENDWHILE"),
        ("WHILE(1=1)", "DELAY0", "ENDWHILE"),
        ("WHILE(1=1)", "Q1=1", "WHILE(Q1<3)", "Q1=Q1+1", "ENDWHILE", "ENDWHILE"),
    ],
)
def test_a_loop_without_moves_lets_the_time_go_on(closed: Bench, loop: tuple[str, ...]) -> None:
    started = time.process_time()
    run_for(closed, "TA1 TS0", *loop, wait_s=2.0)
    assert closed.lathe.snapshot().program_running
    assert time.process_time() - started < 5.0
    closed.client.request("A")
    closed.settle()


def test_an_endless_loop_counts_with_the_real_time_interrupt(closed: Bench) -> None:
    """Two jumps back end a look at the program; the next one comes (I8 + 1) servo cycles later."""
    run_for(closed, "P1=0", "WHILE(1=1)", "P1=P1+1", "ENDWHILE", wait_s=1.0)
    looks = 1000 / (3 * closed.cycle_ms)
    assert closed.number("P1") == pytest.approx(2 * looks, rel=0.02)


def test_a_flag_ends_the_loop_at_the_latest_one_move_after_the_one_that_runs(closed: Bench) -> None:
    for delay_s in (0.33, 0.37, 0.41, 0.45):
        recorder = closed.record(3)
        closed.program("INC", "TA10 TS0 TM100", "M26=0", "WHILE(M26=0)", "Z100", "ENDWHILE")
        closed.client.request("R")
        closed.sim.wait(delay_s)
        begun = (recorder.commands[-1] - recorder.commands[0]) // 100 + 1
        closed.client.request("M26=1")
        closed.settle()
        done = (recorder.commands[-1] - recorder.commands[0]) / 100
        assert done == pytest.approx(round(done), abs=1e-6)
        assert begun <= done <= begun + 1 + 1e-6


def test_a_quit_of_nothing_and_a_second_quit_do_no_harm(closed: Bench) -> None:
    closed.client.request("Q")
    closed.program(*LINEAR_MOVES)
    closed.client.request("R Q Q")
    closed.settle()
    assert closed.lathe.snapshot().loops_closed


def test_an_abort_ramps_each_motor_down_at_its_own_rate(closed: Bench) -> None:
    closed.client.request("I215=1 I315=0.25")
    spindle, carriage = closed.record(2), closed.record(3)
    closed.program("INC", "TA20 TS0 TM2000", "Y20000 Z20000")
    closed.client.request("R")
    closed.sim.wait(0.5)
    start = [recorder.commands[-1] for recorder in (spindle, carriage)]
    closed.client.request("A")
    assert not closed.lathe.snapshot().program_running
    closed.settle()
    slack = 10 * 6.0
    assert spindle.commands[-1] - start[0] == pytest.approx(10**2 / 2, abs=slack)
    assert carriage.commands[-1] - start[1] == pytest.approx(10**2 / 0.5, abs=slack)
    for recorder, rate in ((spindle, 1.0), (carriage, 0.25)):
        jumps = np.abs(acceleration(np.array(recorder.commands), closed.cycle_ms))
        assert jumps.max() <= max(rate, 10 / 20) * 1.001


def test_a_program_runs_again_from_its_first_line_in_the_units_of_its_axes(closed: Bench) -> None:
    closed.program("INC", "TA10 TS0 TM50", "P1=P1+1", "Z10")
    for _ in range(3):
        closed.client.request("R")
        closed.settle()
    assert closed.number("P1") == 3
    assert closed.number("#3P") == pytest.approx(30)
    closed.client.request("#3->-10Z+500")
    commands = run_for(closed, "ABS", "TA10 TS0 TM50", "Z20", wait_s=0.5)
    assert commands[-1] == pytest.approx(-10 * 20 + 500)


def test_a_servo_time_of_zero_stops_neither_the_card_nor_its_answers(closed: Bench) -> None:
    closed.client.request("I10=0")
    closed.program(*LINEAR_MOVES)
    closed.client.request("R")
    closed.sim.wait(0.5)
    assert closed.number("#3P") == 0
    closed.client.request("I10=3713707")
    closed.settle()
    assert closed.number("#3P") == pytest.approx(800)


# Programs are written by the controller's own rules: segment times, I10, the settings of a machine.


@pytest.mark.parametrize(("ts_ms", "used_ms"), [(0, 10), (5, 10), (7, 14), (10, 20)])
def test_a_segment_takes_what_the_ramp_needs(
    machine: MachineProfile, experiment: JobMaker, ts_ms: int, used_ms: float
) -> None:
    """50 Hz asks for 10 ms; rule 1 makes 2 TS of it. Ix17 does not bind: 27.5 to -27.5 counts/ms at 422."""
    assert segment_ms(experiment(1), machine, ts_ms) == used_ms


def test_a_weak_motor_stretches_the_segment_by_its_change(machine: MachineProfile, experiment: JobMaker) -> None:
    """275 counts with TA 2 x 10 ms: v = 13.75 counts/ms after 275/t of the move before, at 2 counts/ms^2.

    Ix17: t = (13.75 + 275/t)/2 + TS, so t^2 - 16.875 t - 137.5 = 0.
    """
    variables = {**machine.controller.variables, f"I{machine.tool.motor}17": 2.0}
    weak = replace(machine, controller=replace(machine.controller, variables=variables))
    expected_ms = (16.875 + math.sqrt(16.875**2 + 4 * 137.5)) / 2
    assert segment_ms(experiment(1), weak, 10) == pytest.approx(expected_ms, rel=1e-9)


@pytest.mark.parametrize(
    ("i10", "cycle_ms"), [(8_388_607, 1.0), (4_194_304, 0.5), (8_388_608 + 4_194_304, 0.5), (0, 2**-23)]
)
def test_i10_is_servo_time_in_23_bits(i10: float, cycle_ms: float) -> None:
    assert servo_cycle_ms(i10) == pytest.approx(cycle_ms, rel=2e-7)


def test_a_loop_without_motion_waits_in_the_time_that_wrapped_too(closed: Bench) -> None:
    """I10 = 2^23 + 3713707 is the 443 us of 3713707, so a look every third cycle: 752 looks a second."""
    closed.program("P1=0", "WHILE(1=1)", "P1=P1+1", "ENDWHILE")
    closed.client.request(f"I10={8_388_608 + 3_713_707}")
    closed.client.request("&1R")
    closed.sim.wait(1.0)
    # A look ends at the second backward jump.
    assert closed.number("P1") == pytest.approx(2 * 1000 / (3 * 0.442708), rel=0.02)


def test_settings_have_the_names_of_the_paper_or_the_family_and_factory_values() -> None:
    """Ix16 = 32, Ix88 = 50 from the factory (Quick Reference)."""
    settings = settings_with({"I116": 500.0})
    assert (settings[116], settings[216], settings[388]) == (500.0, 32, 50)
    # Ix87 of coordinate system 1 is I187 on a PMAC and I5187 on a Turbo; what a fault kills, I125 and I124.
    for named in ({"I187": 7.0, "I125": 4.0, "I13": 5.0}, {"I5187": 7.0, "I124": 4.0, "I5113": 5.0}):
        settings = settings_with(named, TURBO)
        assert (settings[5187], settings[124], settings[5113]) == (7.0, 4.0, 5.0)
        assert max(settings) <= TURBO.highest_index
