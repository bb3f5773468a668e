"""Cuts that lost their host, and the marks of a cut that has ended."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.pvt import pvt_program
from drivers.pmac.programs.setup import cut_setup
from drivers.simulator.machine import SimulatedLathe
from profiles.compensations.path import LobedPath
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.drivers.conftest import JobMaker
from tests.drivers.plc_bench import (
    CARRIAGE,
    DEEP,
    RPM_1000,
    SPINDLE,
    SURFACE,
    TOOL,
    TURN_MS,
    Host,
    begin_cut,
    cut_program,
    host_of,
    leased_loop,
    run_for,
    values,
)
from tests.system.lathe_sites import compact

FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=lambda dialect: dialect.name)

PROMISE_S = 0.3
REST_S = 2.0
CYCLE_S = 0.005
OUT_COUNTS = 500
"""The tool counts as out within 0.1 mm."""

AHEAD_MS = 10
"""One move of 10 ms is calculated ahead of the one that is played."""

WAY_OUT_MS = 5 + 200 + 195 - 88
"""10000 counts in 200 ms, with a ramp of 10 ms before and one of 390 ms, all the room there is, behind them; the
last 500 counts take sqrt(2 * 500 * 390 / 50) = 88 ms."""

DEAF = "1=1"
"""A loop that neither looks at the hold flag nor at the lease."""


def is_out(host: Host) -> bool:
    return host.place(TOOL) < SURFACE + OUT_COUNTS


@FAMILIES
@pytest.mark.parametrize("flag_only", [False, True], ids=["lease", "flag"])
def test_retract_ends_the_turn_and_lets_the_program_take_the_tool_out(
    machine: MachineProfile, dialect: Dialect, flag_only: bool
) -> None:
    host = host_of(machine, dialect)
    begin_cut(host, cut_program("M26=0" if flag_only else leased_loop(dialect)))
    spindle = host.card.card.motors[SPINDLE]
    out_s = host.until(lambda: is_out(host))
    assert spindle.velocity > 0, "the spindle comes last"
    assert out_s <= PROMISE_S + (TURN_MS + AHEAD_MS + WAY_OUT_MS) / 1000.0 + CYCLE_S
    assert host.until(host.still) <= REST_S
    assert values(host.card, "M26 P1003 P1004") == [1, 0, 2]
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)
    run_for(host.card, 200)
    assert values(host.card, "P1006 P1009") == [0, 0]
    assert host.card.port.take_output() == b""


@FAMILIES
def test_retract_aborts_a_cut_that_does_not_end_itself(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    begin_cut(host, cut_program(DEAF))
    run_for(host.card, 260)
    assert host.card.card.systems[1].running
    assert host.until(lambda: not host.card.card.systems[1].running) <= PROMISE_S + 1.1 + CYCLE_S
    z = host.place(CARRIAGE)
    assert host.until(lambda: is_out(host) and host.still()) <= REST_S
    assert host.place(CARRIAGE) == pytest.approx(z, abs=5), "Z stays"
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)


@FAMILIES
def test_the_grace_is_that_of_the_cut(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    begin_cut(host, cut_program(DEAF), grace_ms=2500.0)
    ended_s = host.until(lambda: not host.card.card.systems[1].running)
    assert 0.28 + 2.5 - CYCLE_S <= ended_s <= 0.28 + 2.5 + 2 * CYCLE_S


@FAMILIES
def test_stop_aborts_at_once_and_takes_the_tool_out(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect, Policy.STOP)
    begin_cut(host, cut_program(leased_loop(dialect)))
    assert host.until(lambda: not host.card.card.systems[1].running) <= PROMISE_S
    assert host.until(lambda: is_out(host)) <= 1.0
    assert host.until(host.still) <= 1.0
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)


@FAMILIES
def test_finish_lets_the_cut_go_on_to_its_end(machine: MachineProfile, dialect: Dialect) -> None:
    """The loop counts its turns; nothing that the card says or does shows but the latch."""
    host = host_of(machine, dialect, Policy.FINISH)
    host.card.tell("P90=0")
    program = [line if line != "ENDWHILE" else "P90=P90+1 ENDWHILE" for line in cut_program("M26=0 AND P90<50")]
    begin_cut(host, program)
    host.until(lambda: host.value("P1004") == 2)
    turns = host.value("P90")
    assert host.until(host.still) > 2.0
    assert turns < 40
    assert values(host.card, "P90 M26 P1003 P1004") == [50, 0, 0, 2]
    assert host.place(TOOL) == pytest.approx(SURFACE, abs=20)


@FAMILIES
@pytest.mark.parametrize("policy", [Policy.RETRACT, Policy.STOP])
def test_a_spindle_apart_from_the_program_is_stopped_behind_the_tool(
    machine: MachineProfile, dialect: Dialect, policy: Policy
) -> None:
    host = host_of(machine, dialect, policy)
    host.card.tell("&1#2->0", f"I222={RPM_1000}", "#2J+")
    begin_cut(host, cut_program(leased_loop(dialect), with_spindle=False))
    spindle = host.card.card.motors[SPINDLE]
    host.until(lambda: is_out(host))
    assert spindle.velocity == pytest.approx(RPM_1000)
    host.until(lambda: host.still(SPINDLE))
    assert spindle.enabled


@FAMILIES
@pytest.mark.parametrize("policy", [Policy.RETRACT, Policy.STOP])
def test_a_tripped_spindle_lets_the_tool_go_out(machine: MachineProfile, dialect: Dialect, policy: Policy) -> None:
    """The trip has ended the program, with the tool in the part; the loop of the spindle stays open."""
    mode = "I224=$400000" if dialect is TURBO else "I225=$400000"
    host = host_of(machine, dialect, policy)
    host.card.tell(mode)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.card.sim.faults.inject("amplifier-fault", motor="spindle")
    host.until(lambda: is_out(host) and host.still(TOOL))
    assert host.silence_s < 1.0
    run_for(host.card, 200)
    assert not host.card.card.motors[SPINDLE].amplifier_enabled
    assert host.card.port.take_output() == b""


@FAMILIES
@pytest.mark.parametrize("policy", list(Policy))
def test_a_tripped_tool_is_moved_by_nothing(machine: MachineProfile, dialect: Dialect, policy: Policy) -> None:
    mode = "I124=$400000" if dialect is TURBO else "I125=$400000"
    host = host_of(machine, dialect, policy)
    host.card.tell(mode)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.card.sim.faults.inject("amplifier-fault", motor="tool")
    run_for(host.card, 600)
    tool = host.card.card.motors[TOOL]
    assert not tool.amplifier_enabled
    assert host.place(TOOL) > DEEP - 1000
    assert host.still(SPINDLE, CARRIAGE)
    assert host.value("P1004") == 2
    assert host.card.port.take_output() == b""


@FAMILIES
@pytest.mark.parametrize("policy", list(Policy))
@pytest.mark.parametrize("word", [b"\x01", b"\x0b"], ids=["abort", "kill"])
def test_a_cut_that_somebody_has_stopped_is_left_as_it_stands(
    machine: MachineProfile, dialect: Dialect, policy: Policy, word: bytes
) -> None:
    """An observer may stop. What comes to rest so is not moved by a card that misses its host."""
    host = host_of(machine, dialect, policy)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.card.raw(word)
    run_for(host.card, 60)
    closed = [host.card.card.motors[number].enabled for number in (TOOL, SPINDLE, CARRIAGE)]
    assert closed == [word == b"\x01"] * 3
    place = host.place(TOOL)
    run_for(host.card, 600)
    assert [host.card.card.motors[number].enabled for number in (TOOL, SPINDLE, CARRIAGE)] == closed
    assert host.place(TOOL) == pytest.approx(place, abs=20)


@FAMILIES
@pytest.mark.parametrize("policy", [Policy.RETRACT, Policy.STOP])
def test_a_host_that_is_back_restarts_nothing(machine: MachineProfile, dialect: Dialect, policy: Policy) -> None:
    host = host_of(machine, dialect, policy)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.until(lambda: host.value("P1004") == 2)
    host.keep(3.0)
    assert is_out(host)
    assert host.still()
    assert not host.card.card.systems[1].running
    assert values(host.card, "P1003 P1004") == [0, 2]


@FAMILIES
def test_a_slow_background_changes_little_by_the_lease(machine: MachineProfile, dialect: Dialect) -> None:
    host = host_of(machine, dialect)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.card.sim.faults.inject("slow-background", cycle_ms=100.0)
    assert host.until(lambda: is_out(host) and host.still()) <= REST_S


@FAMILIES
def test_a_slow_background_delays_an_abort_by_some_cycles(machine: MachineProfile, dialect: Dialect) -> None:
    """280 ms, then at most a cycle until each of these: seen, aborted, out."""
    host = host_of(machine, dialect, Policy.STOP)
    begin_cut(host, cut_program(leased_loop(dialect)))
    host.card.sim.faults.inject("slow-background", cycle_ms=100.0)
    assert host.until(lambda: not host.card.card.systems[1].running) <= 0.28 + 0.1 + 2 * CYCLE_S
    assert host.until(lambda: is_out(host) and host.still()) <= 1.0


@FAMILIES
def test_the_pvt_cut_is_retracted_and_at_rest_within_2_s(
    machine: MachineProfile, dialect: Dialect, experiment: JobMaker
) -> None:
    job = experiment(1)
    setup = cut_setup(job, machine, watchdog=watchdog_condition(dialect))
    command = LobedPath(mean_um=100.0, amplitude_um=27.5, phase_deg=0.0, lobes=3)
    program = read_program(pvt_program(job, setup, command))
    host = host_of(machine, dialect)
    host.card.tell(f"#1J={setup.retracted}", f"#3J={setup.carriage_start}")
    host.card.settle()
    host.card.tell("CLOSE", *program.lines, f"&1B{program.number}")
    host.beat(host.keeper.cut_line(setup.retracted))
    host.card.tell("R")
    host.keep(3.0)
    assert host.place(TOOL) > setup.surface
    # The turn, three segments of 3 ms calculated and played, and 106 of them on the way out.
    out_s = host.until(lambda: host.place(TOOL) < setup.retracted + OUT_COUNTS)
    assert out_s <= PROMISE_S + (TURN_MS + 3 * 3 + 106 * 3) / 1000.0 + CYCLE_S
    assert host.until(host.still) <= REST_S
    assert host.place(TOOL) == pytest.approx(setup.retracted, abs=20)


# What a program says of its end: finished only where it came there segment by segment, on its own time base.

LOOK_S = 0.05
LONGEST_S = 40.0


def ended(strategy: Strategy, family: str, line: str, at_turn: float = 4.0) -> tuple[float, float]:
    """Run the program of a short cut, with another host's line in the midst of it; return P43 and P44."""
    machine = compact(family)
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.3)
    plan = plan_cut(job, machine, strategy)
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    for motor in sim.controller.motors.values():
        motor.home_zero()
    client.request("#1J/#2J/#3J/")
    client.request(f"#3J={plan.carriage_start:.3f} #2J={plan.spindle_start:.3f} #1J={plan.tool_start:.3f}")
    sim.wait(5.0)
    client.download(plan.program.lines)
    client.request(f"&1B{plan.program.number}R")
    sent = not line
    for _ in range(round(LONGEST_S / LOOK_S)):
        sim.wait(LOOK_S)
        if not sent and turn_of(sim, plan) > at_turn:
            client.request(line)
            sent = True
        if not sim.controller.systems[1].running:
            break
    assert sent
    turns, finished = client.numbers("P43", "P44")
    return turns, finished


def turn_of(sim: SimulatedLathe, plan: CutPlan) -> float:
    """Turns of feed that the carriage has gone."""
    return (sim.controller.motors[3].position - plan.carriage_start) / plan.setup.carriage_per_turn


@pytest.mark.parametrize(
    ("strategy", "family"),
    [*((each, "pmac") for each in Strategy), (Strategy.CAM, "turbo"), (Strategy.TIMEBASE, "turbo")],
)
@pytest.mark.first(2)
def test_an_undisturbed_program_says_its_turns_and_that_it_is_finished(strategy: Strategy, family: str) -> None:
    turns, finished = ended(strategy, family, "")
    assert (turns, finished) == (20.0, 1.0)


@pytest.mark.parametrize(
    ("strategy", "line"),
    [
        (Strategy.PVT, "P25=P25+1"),
        (Strategy.PVT, "P25=P25-1"),
        (Strategy.CAM, "P25=P25-1"),
        (Strategy.TIMEBASE, "P25=P25+1"),
        (Strategy.PAPER, "P630=P630+2"),
        (Strategy.TIMEBASE, "I193=0"),
    ],
)
@pytest.mark.first(2)
def test_a_program_in_which_somebody_goes_on_elsewhere_is_not_finished(strategy: Strategy, line: str) -> None:
    assert ended(strategy, "pmac", line)[1] == 0.0
