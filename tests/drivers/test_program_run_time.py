"""Programs that go wrong, go on for ever, are quit or watched: the motion stays smooth and the time goes on."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench, BenchMaker

PVT_MOVES = ("ABS", "PVT50", "Z100:4000", "Z300:4000")
LINEAR_MOVES = ("INC", "TA20 TS0 TM100", "Z400", "Z400")


def acceleration(commands: np.ndarray, cycle_ms: float) -> np.ndarray:
    """Commanded acceleration in counts/ms2."""
    return np.diff(commands, 2) / cycle_ms**2


def run(bench: Bench, *lines: str, wait_s: float = 2.0) -> np.ndarray:
    recorder = bench.record(3)
    bench.program(*lines)
    bench.client.request("R")
    bench.sim.wait(wait_s)
    return np.array(recorder.commands)


@pytest.mark.parametrize(
    "error",
    [
        "P(0-1)=3",
        "TA0 TS0 Z400",
        "TA(0-5)",
        "F0 Z100",
        "Z(EXP(700))",
        "Z100:500",
        "P1=EXP(900)",
        "PVT0",
        "PVT10 Z2000:(EXP(700))",
    ],
)
def test_a_run_time_error_in_linear_moves_ends_the_motion_at_its_target_without_a_jump(
    closed: Bench, error: str
) -> None:
    """The moves that are calculated are done: 800 counts, with the ramps of TA20 at the most (1 ms after TA0)."""
    commands = run(closed, *LINEAR_MOVES, error)
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
    commands = run(closed, *PVT_MOVES, error)
    assert closed.lathe.snapshot().runtime_error
    assert commands[-1] == pytest.approx(300 + 4**2 / (2 * 0.5), abs=1e-3)
    velocity = np.diff(commands) / closed.cycle_ms
    assert np.abs(np.diff(velocity)).max() <= 0.5 * closed.cycle_ms * 1.001


def test_a_pvt_sequence_that_ends_in_motion_is_an_error_and_is_ramped_down(closed: Bench) -> None:
    commands = run(closed, *PVT_MOVES)
    assert closed.lathe.snapshot().runtime_error
    assert commands[-1] == pytest.approx(316, abs=1e-3)


def test_illegal_arithmetic_goes_on_as_on_the_card(closed: Bench) -> None:
    run(closed, "P1=5/0", "P2=0-5/0", "P3=5%0", "P4=LN(0)", "P5=1", wait_s=0.1)
    assert closed.client.numbers("P1", "P2", "P3", "P4", "P5") == (2**47, -(2**47), 0, 0, 1)
    assert not closed.lathe.snapshot().runtime_error


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
    run(closed, "TA1 TS0", *loop, wait_s=2.0)
    assert closed.lathe.snapshot().program_running
    assert time.process_time() - started < 5.0
    closed.client.request("A")
    closed.settle()


def test_an_endless_loop_counts_with_the_real_time_interrupt(closed: Bench) -> None:
    """Two jumps back end a look at the program; the next one comes (I8 + 1) servo cycles later."""
    run(closed, "P1=0", "WHILE(1=1)", "P1=P1+1", "ENDWHILE", wait_s=1.0)
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


def test_a_quit_finishes_the_moves_that_are_calculated(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.program("INC", "TA10 TS0 TM200", *["Z100"] * 20)
    closed.client.request("R")
    closed.sim.wait(0.5)
    closed.client.request("Q")
    assert not closed.lathe.snapshot().program_running
    assert closed.moving
    closed.settle()
    assert recorder.commands[-1] in (pytest.approx(300), pytest.approx(400))
    assert np.abs(acceleration(np.array(recorder.commands), closed.cycle_ms)).max() <= 0.5 / 10 * 1.001
    assert not closed.lathe.snapshot().runtime_error


def test_a_quit_in_pvt_ramps_down(closed: Bench) -> None:
    recorder = closed.record(3)
    closed.program("ABS", "P1=0", "PVT50", "Z100:4000", "WHILE(1=1)", "P1=P1+1", "Z(100+200*P1):4000", "ENDWHILE")
    closed.client.request("R")
    closed.sim.wait(0.5)
    closed.client.request("Q")
    closed.settle()
    velocity = np.diff(recorder.commands) / closed.cycle_ms
    assert np.abs(np.diff(velocity)).max() <= 0.5 * closed.cycle_ms * 1.001
    assert velocity[-1] == 0


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


def test_a_program_runs_again_from_its_first_line(closed: Bench) -> None:
    closed.program("INC", "TA10 TS0 TM50", "P1=P1+1", "Z10")
    for _ in range(3):
        closed.client.request("R")
        closed.settle()
    assert closed.number("P1") == 3
    assert closed.number("#3P") == pytest.approx(30)


def test_axis_units_and_offsets_are_those_of_the_definition(closed: Bench) -> None:
    closed.client.request("#3->-10Z+500")
    commands = run(closed, "ABS", "TA10 TS0 TM50", "Z20", wait_s=0.5)
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


def test_a_trajectory_is_the_same_to_the_last_bit_with_and_without_a_second_client(
    make_bench: BenchMaker,
) -> None:
    tracks = []
    for polled in (False, True):
        bench = make_bench()
        bench.lathe.enable()
        other = bench.sim.connect()
        tool, spindle = bench.record(1), bench.record(2)
        bench.program("INC", "TA10 TS5 TM(17.3)", "WHILE(P1<30)", "P1=P1+1", "X50 Y1000", "X-50 Y1000", "ENDWHILE")
        bench.client.request("R")
        for _ in range(150):
            if polled:
                other.receive(b"#1P F ? #2P V &1?? P1 M26\rI130 ???\r\x18LIST PROG1\rUUU\r")
            bench.sim.wait(0.01)
        tracks.append((tool.commands, tool.positions, spindle.commands))
        assert len(tool.commands) > 3000
    assert tracks[0] == tracks[1]


def test_the_end_is_the_same_however_the_time_is_cut(make_bench: BenchMaker) -> None:
    tracks = []
    for slices in (1, 7, 1000):
        bench = make_bench()
        bench.lathe.enable()
        recorder = bench.record(3)
        bench.program(*LINEAR_MOVES)
        bench.client.request("R")
        for _ in range(slices):
            bench.sim.wait(1.0 / slices)
        tracks.append(recorder.commands[:2000])
    assert tracks[0] == tracks[1] == tracks[2]
