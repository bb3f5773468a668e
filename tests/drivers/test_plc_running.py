"""PLCs in the simulated card: who has a scan and when, what ends it, and that nobody else is kept waiting."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from tests.drivers.conftest import Recorder
from tests.drivers.plc_bench import BLOCK, plc_card, reset, run_for, store, values
from tests.drivers.wire_card import ACK, Wire

FAMILIES = [PMAC, TURBO]

PATIENCE = 20
"""Scans without a sign of the host."""

WATCH = f"""
    IF(P100!=P101)
    P101=P100
    P102=0
    ELSE
    P102=P102+1
    IF(P102={PATIENCE})
    P103=P103+1
    CMD"#1J/"
    ENDIF
    ENDIF
"""
"""Ten lines: the jog of motor 1 is stopped, once, when the host has stopped counting P100."""

JOG_SPEED, JOG_STOP_MS = 50.0, 100.0
"""I122 and I120 of the bundled machine; Ix19 does not lengthen that ramp."""


@pytest.fixture(params=FAMILIES, ids=lambda dialect: dialect.name)
def card(machine: MachineProfile, request: pytest.FixtureRequest) -> Wire:
    """Background PLCs are permitted."""
    dialect: Dialect = request.param
    return plc_card(machine, dialect)


def jog_under_watch(card: Wire, beats: int = 15) -> None:
    """Jog motor 1 and count P100 every third background cycle; the last count ends a cycle."""
    store(card, 4, WATCH)
    card.tell("#1J+")
    for _ in range(beats):
        card.port.receive(b"P100=P100+1\r")
        run_for(card, 3)
    card.port.receive(b"P100=P100+1\r")
    run_for(card)
    assert card.port.take_output() == ACK * (beats + 1)


def test_a_watching_plc_stops_the_jog_when_the_host_is_silent(card: Wire) -> None:
    """One scan sees the last count; the PLC then counts its scans, and the CMD of the last one acts at once."""
    jog_under_watch(card)
    motor = card.card.motors[1]
    run_for(card, 1 + PATIENCE)
    assert motor.velocity == pytest.approx(JOG_SPEED)
    assert values(card, "P102 P103") == [PATIENCE, 1]
    run_for(card)
    assert motor.velocity < JOG_SPEED
    blocks_to_rest = -(-JOG_STOP_MS // (BLOCK * card.card.cycle_ms))
    run_for(card, int(blocks_to_rest) - 2)
    assert motor.velocity > 0
    run_for(card)
    assert motor.velocity == 0
    assert not motor.jogging
    run_for(card, 50)
    assert values(card, "P103") == [1], "one edge, one command"


@pytest.mark.parametrize(("dialect", "i5"), [(PMAC, 0), (TURBO, 0)], ids=["pmac", "turbo"])
def test_no_background_plc_runs_from_the_factory(machine: MachineProfile, dialect: Dialect, i5: int) -> None:
    made = plc_card(machine, dialect, i5=3)
    made.tell("I5=*")
    assert values(made, "I5") == [i5]
    store(made, 1, "P1=P1+1")
    run_for(made, 5)
    assert values(made, "P1") == [0]


@pytest.mark.parametrize("dialect", FAMILIES, ids=lambda dialect: dialect.name)
def test_the_machine_profile_may_permit_plcs(machine: MachineProfile, dialect: Dialect) -> None:
    controller = replace(machine.controller, variables={**machine.controller.variables, "I5": 2})
    sim = SimulatedLathe(replace(machine, controller=controller), dialect=dialect)
    made = Wire(sim=sim, port=sim.connect())
    made.raw("I3=2 I6=1\r")
    store(made, 1, "P1=P1+1")
    run_for(made, 5)
    assert values(made, "I5 P1") == [2, 5]


def test_the_background_scans_in_the_order_of_the_numbers(card: Wire) -> None:
    for number in (7, 31, 1, 3):
        store(card, number, f"P1=P1*100+{number}")
    run_for(card)
    assert values(card, "P1") == [1_03_07_31]


def test_what_an_earlier_one_switches_off_has_no_scan_and_what_it_switches_on_the_next(card: Wire) -> None:
    store(card, 2, "P2=P2+1")
    store(card, 3, "P3=P3+1", on=False)
    store(card, 1, "DISABLE PLC 1,2\nENABLE PLC 3")
    run_for(card)
    assert values(card, "P2 P3") == [0, 0]
    assert card.card.plcs.switches.enabled == {3}
    run_for(card)
    assert values(card, "P2 P3") == [0, 1]


@pytest.mark.parametrize("i8", [0, 1, 2, 3, 10, 25])
def test_plc_0_has_a_scan_every_i8_plus_1_servo_cycles(card: Wire, i8: int) -> None:
    card.tell(f"I5=1 I8={i8}")
    store(card, 0, "P1=P1+1")
    first = card.card.cycles
    run_for(card, 37)
    interrupts = [cycle for cycle in range(first + 1, card.card.cycles + 1) if cycle % (i8 + 1) == 0]
    assert values(card, "P1") == [len(interrupts)]
    assert len(interrupts) == pytest.approx(37 * BLOCK / (i8 + 1), abs=1)


def test_plc_0_sees_the_motor_where_it_is_between_two_background_cycles(card: Wire) -> None:
    """At a constant jog speed the encoder gains as much from scan to scan; three servo cycles are a scan."""
    register = card.card.dialect.registers["actual"]
    card.tell(f"I5=1 I8=2 M1->D:${register.address:X}", "#1J+")
    run_for(card, 60)
    store(card, 0, "P(P1+10)=M1/(I108*32)\nP1=P1+1")
    run_for(card, 6)
    count = int(values(card, "P1")[0])
    assert count == 6 * BLOCK // 3
    places = values(card, f"P10..{9 + count}")
    steps = [after - before for before, after in pairwise(places)]
    assert steps == pytest.approx([3 * card.card.cycle_ms * JOG_SPEED] * (count - 1), abs=2)


def test_plc_0_stops_within_the_block_in_which_it_switches_itself_off(card: Wire) -> None:
    card.tell("I5=3 I8=0")
    store(card, 0, "P1=P1+1\nIF(P1=4)\nDISABLE PLC 0\nENDIF")
    run_for(card, 3)
    assert values(card, "P1") == [4]


def test_off_and_on_again_begins_at_the_top_and_on_while_it_is_on_does_not(card: Wire) -> None:
    store(card, 1, "P1=P1+1\nWHILE(1=1)\nP2=P2+1\nENDWHILE")
    run_for(card, 3)
    card.tell("ENABLE PLC 1")
    run_for(card)
    assert values(card, "P1 P2") == [1, 4]
    card.tell("DISABLE PLC 1")
    run_for(card, 3)
    assert values(card, "P1 P2") == [1, 4]
    card.tell("ENABLE PLC 1")
    run_for(card)
    assert values(card, "P1 P2") == [2, 5]


def test_i5_that_comes_back_goes_on_inside_the_while(card: Wire) -> None:
    store(card, 1, "P1=P1+1\nWHILE(1=1)\nP2=P2+1\nENDWHILE")
    run_for(card, 2)
    card.tell("I5=0")
    run_for(card, 4)
    card.tell("I5=2")
    run_for(card)
    assert values(card, "P1 P2") == [1, 3]


def test_a_run_time_error_switches_off_that_plc_alone(card: Wire) -> None:
    store(card, 1, "P1=P1+1\nP(P2)=0\nP3=P3+1")
    store(card, 2, "P4=P4+1")
    run_for(card)
    card.tell("P2=9999")
    run_for(card, 4)
    assert values(card, "P1 P3 P4") == [2, 1, 5]
    assert card.card.plcs.switches.enabled == {2}
    fault = card.card.plcs.faults[1]
    assert (fault.line, fault.code) == (1, 3)
    assert "P9999" in fault.detail
    card.tell("P2=0", "ENABLE PLC 1")
    run_for(card)
    assert values(card, "P1 P3 P4") == [3, 2, 6]
    assert not card.card.plcs.faults


def test_a_run_time_error_of_plc_0_switches_it_off(card: Wire) -> None:
    card.tell("I5=1")
    store(card, 0, "P1=P1+1\nP(9999)=0")
    run_for(card, 3)
    assert values(card, "P1") == [1]
    assert card.card.plcs.switches.enabled == set()


@pytest.mark.parametrize("by", ["host", "plc"])
def test_control_d_switches_every_plc_off(card: Wire, by: str) -> None:
    card.tell("I5=3")
    store(card, 0, "P1=P1+1")
    store(card, 1, "P2=P2+1")
    if by == "host":
        run_for(card)
        assert card.raw("\x04") == b""
    else:
        store(card, 2, "CMD^D")
        run_for(card)
    before = values(card, "P1 P2")
    assert all(before)
    run_for(card, 5)
    assert values(card, "P1 P2") == before
    assert card.card.plcs.switches.enabled == set()


def test_a_stop_of_a_host_has_the_last_word_over_a_command_of_the_same_cycle(card: Wire) -> None:
    """In the cycle in which control-D and control-K come, the PLC still has its scan and commands the jog."""
    store(card, 1, 'P1=P1+1\nCMD"#1J+"')
    run_for(card, 4)
    motor = card.card.motors[1]
    assert motor.jogging
    card.port.receive(b"\x04\x0b")
    run_for(card)
    assert values(card, "P1") == [5]
    assert not motor.enabled
    run_for(card, 20)
    assert not motor.enabled
    assert not motor.jogging


def test_commands_mean_what_the_plc_has_addressed_whatever_the_host_does(card: Wire) -> None:
    store(card, 1, 'ADDRESS#3&2\nCMD"J^500"\nCMD"Q5=7"\nDISABLE PLC 1')
    card.tell("#2&1")
    card.settle()
    assert card.ask("#3P #2P") == ["500", "0"]
    card.tell("#2")
    assert card.ask("# & &1Q5 &2Q5") == ["2", "1", "0", "7"]


def test_new_text_goes_on_with_what_the_old_one_had_addressed_until_a_reset(card: Wire) -> None:
    store(card, 1, "ADDRESS#3&2")
    run_for(card)
    for change in ("DISABLE PLC 1", "DELETE PLC 1"):
        card.tell(change)
        store(card, 1, "Q1=Q1+1")
        run_for(card)
    assert values(card, "&2Q1 &1Q1") == [2, 0]
    reset(card)
    card.tell("I5=2")
    run_for(card)
    assert values(card, "&2Q1 &1Q1") == [2, 1]


@pytest.mark.parametrize("number", [0, 1])
def test_an_endless_plc_keeps_nobody_waiting(card: Wire, number: int) -> None:
    """Whatever is in it, a scan executes each line once at most."""
    card.tell("I5=3 I8=10")
    store(card, number, "WHILE(1=1)\n" + "P1=P1+1\n" * 200 + 'CMD"P2=P2+1"\nENDWHILE')
    store(card, 5, "P3=P3+1")
    run_for(card, 30)
    assert values(card, "P1 P2 P3") == [200 * 30, 30, 30]
    assert card.ask("#1P") == ["0"]


def test_two_plcs_that_switch_each_other_on_have_a_scan_a_cycle(card: Wire) -> None:
    store(card, 1, "P1=P1+1\nDISABLE PLC 1\nENABLE PLC 1,2")
    store(card, 2, "P2=P2+1\nDISABLE PLC 1,2\nENABLE PLC 1,2")
    run_for(card, 10)
    assert values(card, "P1 P2") == [10, 10]


PATHS = (
    ("ABS TA20 TS5 TM60", "X500 Y300", "X-200 Y900", "INC F3000", "X700", "DWELL30", "Y-250"),
    ("INC", "PVT50", "X200:4000 Y50:1000", "X200:4000 Y50:1000", "X100:0 Y20:0"),
    ("RAPID INC X300", "LINEAR TA10 TM40", "M1==1 X90", "P900=P900+M1", "X-30"),
)


def tracked(
    machine: MachineProfile, dialect: Dialect, lines: tuple[str, ...], plc: int | None
) -> list[list[float]]:
    """Run a program, with or without a PLC; return what motors 1 and 2 were told and where they were."""
    card = plc_card(machine, dialect, i5=3)
    if plc is not None:
        store(card, plc, "P1=P1+SIN(P1*7)+M1\nIF(P1>3)\nP1=P1-3\nENDIF\nP2=P2+1")
    card.tell("#1J/ #2J/ #3J/", "OPEN PROG 1 CLEAR", *lines, "CLOSE", "&1B1")
    recorders = []
    for number in (1, 2):
        motor = card.card.motors[number]
        recorder = Recorder(motor.axis)
        motor.axis = recorder
        recorders.append(recorder)
    run_for(card, 3)
    card.tell("R")
    run_for(card, 200)
    assert not card.card.systems[1].moving
    assert bool(values(card, "P2")[0]) is (plc is not None)
    return [track for recorder in recorders for track in (recorder.commands, recorder.positions)]


@pytest.mark.parametrize("dialect", FAMILIES, ids=lambda dialect: dialect.name)
@pytest.mark.parametrize("lines", PATHS, ids=["linear", "pvt", "rapid"])
def test_a_computing_plc_changes_no_bit(machine: MachineProfile, dialect: Dialect, lines: tuple[str, ...]) -> None:
    alone = tracked(machine, dialect, lines, plc=None)
    assert max(alone[0]) > 50
    assert tracked(machine, dialect, lines, plc=1) == alone
    assert tracked(machine, dialect, lines, plc=0) == alone
