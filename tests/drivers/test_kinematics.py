"""Inverse and forward kinematics of a Turbo: a two-link arm, whose joints are worked out here with numpy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from drivers.pmac.analysis.findings import FindingCode
from drivers.pmac.analysis.program import check_program
from drivers.pmac.dialect import PMAC, TURBO
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.drivers.families import of_family
from tests.drivers.wire_card import Wire, wire

UPPER, FORE, PER_DEGREE = 400.0, 300.0, 100.0
FORWARD = ("Q7=Q91*COS(P4/Q93)+Q92*COS((P4+P5)/Q93)", "Q8=Q91*SIN(P4/Q93)+Q92*SIN((P4+P5)/Q93)")
INVERSE = (
    "Q20=(Q7*Q7+Q8*Q8-Q91*Q91-Q92*Q92)/(2*Q91*Q92)",
    "Q21=ACOS(Q20)",
    "Q0=Q7",
    "Q22=ATAN2(Q8)",
    "Q0=Q91+Q92*COS(Q21)",
    "Q23=ATAN2(Q92*SIN(Q21))",
    "P4=(Q22-Q23)*Q93",
    "P5=Q21*Q93",
)
"""Elbow to the right, in degrees (I15 = 0)."""

PVT_INVERSE = (
    *INVERSE,
    "IF(Q10=1)",
    "Q24=Q91*Q92*SIN(Q21)*3.14159265358979/180",
    "P104=(Q92*COS(P4/Q93+Q21)*Q17+Q92*SIN(P4/Q93+Q21)*Q18)/Q24*Q93",
    "P105=-(Q7*Q17+Q8*Q18)/Q24*Q93",
    "ENDIF",
)
SET_UP = ("UNDEFINE ALL", "&2#4->I", "#5->I", "I400=1 I500=1 I5250=1", "Q91=400 Q92=300 Q93=100 Q10=9")


def tip(shoulder: float, elbow: float) -> np.ndarray:
    """Where the tip is for the counts of both motors."""
    first, both = np.radians(shoulder / PER_DEGREE), np.radians((shoulder + elbow) / PER_DEGREE)
    return np.array([UPPER * np.cos(first) + FORE * np.cos(both), UPPER * np.sin(first) + FORE * np.sin(both)])


def joints(x: float, y: float) -> np.ndarray:
    """The counts of both motors for a place of the tip."""
    elbow = np.arccos((x * x + y * y - UPPER**2 - FORE**2) / (2.0 * UPPER * FORE))
    shoulder = np.arctan2(y, x) - np.arctan2(FORE * np.sin(elbow), UPPER + FORE * np.cos(elbow))
    return np.degrees([shoulder, elbow]) * PER_DEGREE


def arm(machine: MachineProfile, *program: str, inverse: Sequence[str] = INVERSE, segment_ms: int = 0) -> Wire:
    """The arm at (450, 250), with its program 5."""
    card = wire(machine, TURBO)
    card.tell(*SET_UP, f"I5213={segment_ms}")
    card.tell("OPEN FORWARD CLEAR", *FORWARD, "CLOSE", "OPEN INVERSE CLEAR", *inverse, "CLOSE")
    card.tell("OPEN PROG 5 CLEAR", *program, "CLOSE", "#4J/#5J/")
    shoulder, elbow = joints(450.0, 250.0)
    card.tell(f"#4J={shoulder:.6f}", f"#5J={elbow:.6f}")
    card.settle()
    return card


def places(card: Wire) -> np.ndarray:
    return np.array([card.card.motors[number].desired for number in (4, 5)])


def played(card: Wire, most_s: float = 10.0) -> np.ndarray:
    """Run program 5, and return the commanded places of both motors in each background cycle."""
    card.tell("&2B5R")
    seen = [places(card)]
    end_s = card.sim.now_s() + most_s
    while card.card.systems[2].running or card.card.systems[2].moving:
        card.sim.wait(0.005)
        seen.append(places(card))
        assert card.sim.now_s() < end_s
    assert not card.card.systems[2].motion.runtime_error
    return np.array(seen)


def off_the_line(seen: np.ndarray, begin: Sequence[float], end: Sequence[float]) -> float:
    """How far the tip leaves the straight line between two places, at most."""
    way = np.subtract(end, begin)
    tips = np.array([tip(*row) for row in seen]) - np.asarray(begin)
    return float(np.abs(tips @ np.array([-way[1], way[0]])).max() / np.hypot(*way))


@pytest.mark.parametrize("segment_ms", [0, 10], ids=["at the end points", "in segments"])
def test_each_move_ends_where_the_joints_have_to_be(machine: MachineProfile, segment_ms: int) -> None:
    card = arm(machine, "LINEAR ABS TA100 TS0 TM400 X600 Y200", "DWELL0", "INC X-200 Y150", segment_ms=segment_ms)
    seen = played(card)
    np.testing.assert_allclose(seen[-1], joints(400.0, 350.0), atol=1e-6)
    assert card.ask("Q7Q8Q10") == ["400", "350", "0"]


def test_a_path_in_segments_keeps_its_line_its_time_and_its_circle(machine: MachineProfile) -> None:
    line = ("LINEAR ABS TA100 TS0 TM400 X600 Y-200",)
    ends = (450.0, 250.0), (600.0, -200.0)
    assert off_the_line(played(arm(machine, *line)), *ends) > 5.0
    assert off_the_line(played(arm(machine, *line, segment_ms=10)), *ends) < 1e-3
    assert off_the_line(played(arm(machine, *line, segment_ms=50)), *ends) < 0.1
    card = arm(machine, "CIRCLE1 ABS TA50 TS0 TM800 X450 Y250 I50 J0", "LINEAR", segment_ms=5)
    radius = [np.hypot(*(tip(*row) - (500.0, 250.0))) for row in played(card)]
    middle = np.array(radius[len(radius) // 4 : -len(radius) // 4])
    assert np.abs(middle - 50.0).max() < 1e-3
    # 100 units at 200 units a second: 0.5 s, and TA more.
    card = arm(machine, "LINEAR INC TA100 TS0 F200 X100", segment_ms=5)
    began_s = card.sim.now_s()
    played(card)
    assert card.sim.now_s() - began_s == pytest.approx(0.6, abs=0.02)


def test_moves_go_by_end_points_and_begin_where_the_arm_is(machine: MachineProfile) -> None:
    card = arm(machine, "RAPID ABS X600 Y200", "LINEAR TA50 TM200 X550", "SPLINE1 TM100 X500", segment_ms=10)
    np.testing.assert_allclose(played(card)[-1], joints(500.0, 200.0), atol=1e-6)
    card = arm(machine, "LINEAR INC TA50 TS0 TM200 X10")
    shoulder, elbow = joints(380.0, 300.0)
    card.tell(f"#4J={shoulder:.6f}", f"#5J={elbow:.6f}")
    card.settle()
    np.testing.assert_allclose(played(card)[-1], joints(390.0, 300.0), atol=1e-3)


def test_pvt_asks_for_the_velocities_too(machine: MachineProfile) -> None:
    """A segment to (500, 250) at 200 units a second, and one to rest."""
    card = arm(machine, "PVT200 ABS X470:200", "X500:200", "X520:0", inverse=PVT_INVERSE)
    seen = played(card)
    np.testing.assert_allclose(seen[-1], joints(520.0, 250.0), atol=1e-5)
    step = 1e-3
    speed = (joints(500.0 + step, 250.0) - joints(500.0 - step, 250.0)) / (2.0 * step) * 200.0
    assert card.ask("Q10") == ["1"]
    nearest = int(np.argmin([np.hypot(*(tip(*row) - (500.0, 250.0))) for row in seen]))
    found = (seen[nearest + 1] - seen[nearest - 1]) / 2.0
    np.testing.assert_allclose(found / np.linalg.norm(found), speed / np.linalg.norm(speed), atol=0.02)


def test_pmatch_says_where_the_tip_is_and_switched_off_nothing_moves(machine: MachineProfile) -> None:
    card = arm(machine)
    card.tell("Q7=0 Q8=0", "&2PMATCH")
    assert [round(float(text), 3) for text in card.ask("Q7Q8")] == [450.0, 250.0]
    card = arm(machine, "LINEAR ABS TA50 TS0 TM200 X600 Y200")
    card.tell("I5250=0")
    seen = played(card)
    np.testing.assert_allclose(seen[-1], seen[0], atol=1e-9)


def test_listing_saving_and_deleting(machine: MachineProfile, tmp_path: Path) -> None:
    card = wire(machine, TURBO, tmp_path / "saved.json")
    card.tell("&3 OPEN INVERSE CLEAR", *INVERSE, "CLOSE", "OPEN FWD", "q1 = p1 / 10", "CLOSE", "SAVE")
    assert card.ask("LIST FORWARD") == ["Q1=P1/10", "RET"]
    assert card.ask("LIST FORWARD,1,80") == ["1:RET"]
    assert card.refusal("LIST FORWARD,80,80") == 3
    assert card.refusal("&2 LIST INVERSE") == 3
    card.tell("&3", "DELETE INVERSE", "OPEN FORWARD CLEAR", "CLOSE")
    assert card.refusal("LIST INV") == 3
    assert card.ask("LIST FWD") == ["RET"]
    again = wire(machine, TURBO, tmp_path / "saved.json")
    assert again.ask("&3 LIST INVERSE") == [*INVERSE, "RET"]


def test_what_is_refused(machine: MachineProfile) -> None:
    card = wire(machine, TURBO)
    card.tell("OPEN INVERSE")
    assert [card.refusal(line) for line in ("X10", "DWELL5", "M1==1", "OPEN FORWARD")] == [3, 3, 3, 7]
    card.tell("CLOSE", "#4->I")
    assert card.ask("#4->") == ["I"]
    assert card.refusal("X=5") == 3
    old = wire(machine, PMAC)
    assert [old.refusal(line) for line in ("OPEN INVERSE", "LIST FORWARD", "#4->I")] == [3, 3, 3]


def test_a_loop_without_an_end_is_a_run_time_error(machine: MachineProfile) -> None:
    card = arm(machine, "LINEAR X500", inverse=("WHILE(1=1)", "Q30=Q30+1", "ENDWHILE"))
    card.tell("&2B5R")
    card.sim.wait(0.1)
    assert card.card.systems[2].motion.runtime_error


TEXT = "\n".join(
    [
        "UNDEFINE ALL",
        "#4->I",
        "#5->I",
        "I5150=1 I5113={segment}",
        "Q91=400 Q92=300 Q93=100",
        "OPEN FORWARD CLEAR",
        *FORWARD,
        "CLOSE",
        "OPEN INVERSE CLEAR",
        *INVERSE,
        "CLOSE",
        "OPEN PROG 5 CLEAR",
        "LINEAR ABS TA100 TS0 TM400 X600 Y200",
        "X450 Y-250",
        "CLOSE",
    ]
)


@pytest.mark.parametrize("segment", [0, 10])
def test_the_checker_predicts_what_the_card_does(segment: int) -> None:
    turbo = of_family(load_machine("lee-2001-lathe").machine, "turbo")
    checked = check_program(TEXT.format(segment=segment), turbo)
    assert not [f for f in checked.findings if f.code in (FindingCode.LINE_REFUSED, FindingCode.RUN_TIME_ERROR)]
    assert checked.motors == (4, 5), "the text undefines all other axes"
    arms = [checked.motors.index(motor) for motor in (4, 5)]
    for move, place in zip(checked.moves, ((600.0, 200.0), (450.0, -250.0)), strict=True):
        ends = [move.motors[index].target for index in arms]
        np.testing.assert_allclose(ends, joints(*place), atol=1e-6)


def test_the_checker_refuses_them_where_the_family_has_none() -> None:
    text = TEXT.replace("I5150=1 I5113={segment}", "P9=0")
    checked = check_program(text, load_machine("lee-2001-lathe").machine)
    refused = {line for f in checked.findings if f.code is FindingCode.LINE_REFUSED for line in f.lines}
    wrong = ("#4->I", "#5->I", "OPEN FORWARD CLEAR", "OPEN INVERSE CLEAR")
    assert {text.splitlines().index(line) + 1 for line in wrong} <= refused
