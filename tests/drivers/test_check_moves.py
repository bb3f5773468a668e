"""Every move as the checker reports it, of the paper's program and of any other."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.analysis.findings import ExplanationSentence, FindingCode, ProgramFinding, Value
from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis, analyse_moves
from drivers.pmac.analysis.program import ProgramCheck, check_program
from drivers.pmac.analysis.timeline import Timeline
from drivers.pmac.analysis.walk import Walk, WalkEnding, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.paper import paper_program
from drivers.pmac.programs.setup import cut_setup
from drivers.pmac.requests import HomeRequest
from drivers.pmac.settings import settings_with
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

FREE = {190: 1000.0}
"""No limit of velocity or acceleration; speeds are per second."""


def analysed(
    lines: str, variables: dict[int, float] | None = None, axes: Sequence[str] = ("#1->X",)
) -> tuple[MoveAnalysis, ...]:
    definitions = read_definitions(axes)
    text = read_program(f"OPEN PROG 1\nCLEAR\n{lines}\nCLOSE")
    walked = walk(text, variables or FREE, definitions, {d.motor: 0.0 for d in definitions})
    assert walked.error is None
    return analyse_moves(walked, Timeline(walked.pieces))


def reached(moves: Sequence[MoveAnalysis]) -> list[float]:
    return [move.motors[0].reached for move in moves]


@pytest.mark.parametrize(("ts", "divisor"), [(0, 4), (10, 6)])
def test_a_zig_zag_turns_round_short_of_its_point(ts: int, divisor: int) -> None:
    """v TA/4 with straight ramps, v TA/6 with full S-curves; v = 300/40 counts/ms, TA 20 ms."""
    moves = analysed(f"INC TA20 TS{ts} TM40\n" + "X300\nX-300\n" * 3)
    short = 300 / 40 * 20 / divisor
    assert reached(moves[:-1]) == pytest.approx([300 - short, short, 300 - short, short, 300 - short])
    assert [move.motors[0].turns for move in moves] == [True] * 5 + [False]
    assert moves[2].motors[0].made == pytest.approx(300 - 2 * short)
    assert moves[2].motors[0].lost == pytest.approx(2 * short)


@pytest.mark.parametrize(("ts", "divisor"), [(0, 8), (10, 12)])
def test_a_blended_corner_is_passed_inside(ts: int, divisor: int) -> None:
    """(v2 - v1) TA/8 with straight ramps, TA/12 with full S-curves, at the nominal end."""
    moves = analysed(f"INC TA20 TS{ts} TM40\nX40\nX120")
    assert moves[0].motors[0].reached == pytest.approx(40 + (3 - 1) * 20 / divisor)
    assert not moves[0].motors[0].turns
    assert moves[1].motors[0].reached == 160


def test_peaks_of_one_move_are_those_of_the_manuals_figure() -> None:
    """X100 in TM100, TA40 TS10: 1 count/ms, 1/(TA - TS) counts/ms2, 1/((TA - TS) TS) counts/ms3."""
    (move,) = analysed("INC TA40 TS10 TM100\nX100")
    peaks = move.motors[0].peaks
    assert peaks.velocity == pytest.approx(1)
    assert peaks.acceleration == pytest.approx(1 / 30)
    assert peaks.jerk == pytest.approx(1 / 300)
    assert (move.begins_ms, move.ends_ms) == (20, 120)
    (move,) = analysed("INC TA40 TS0 TM100\nX100")
    assert move.motors[0].peaks.jerk is None


def test_what_is_not_blended_reaches_its_point() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nDWELL0\nX-300\nDWELL10\nX50")
    assert reached(moves) == [300, 0, 50]
    assert [move.blended for move in moves] == [False, False, False]
    moves = analysed("INC TA20 TS10 TM40\nX300\nX-300\nX50", {**FREE, 192: 1.0})
    assert reached(moves) == [300, 0, 50]
    moves = analysed("INC TA20 TS10 TM40\nX300\nSTOP\nX100")
    assert reached(moves) == [300, 400]


def test_pvt_goes_through_its_points_and_a_spline_passes_inside() -> None:
    moves = analysed("ABS PVT20\nX10:1\nX40:1\nX50:0")
    assert reached(moves) == pytest.approx([10, 40, 50])
    assert [move.mode for move in moves] == ["PVT"] * 3
    assert moves[1].motors[0].peaks.velocity == pytest.approx(1.5 * 30 / 20, rel=1e-3)
    # The way-point of SPLINE1 is (P0 + 4 P1 + P2)/6: 0, 1, 0 gives 2/3.
    moves = analysed("ABS TA20 SPLINE1\nX1\nX0")
    assert [move.mode for move in moves] == ["SPLINE", "SPLINE"]
    assert moves[0].motors[0].reached == pytest.approx(2 / 3)
    assert moves[1].motors[0].reached == 0


def test_a_rapid_move_has_its_own_peaks_and_reaches_its_point() -> None:
    variables = {**FREE, 116: 30.0, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC RAPID X1000\nTA20 TS10 TM40 LINEAR X40\nX-40", variables)
    assert [move.mode for move in moves] == ["RAPID", "LINEAR", "LINEAR"]
    assert reached(moves)[0] == 1000
    assert moves[0].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].motors[0].reached == pytest.approx(1040 - 1 * 20 / 6)
    # Jogged at 10 counts/ms; the spline of 0, 0, 3000, 3000 is at 3/4 of 3000 counts in 20 ms in its middle.
    variables = {**FREE, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC RAPID X1000\nTA20 SPLINE1 X3000", variables)
    assert [move.mode for move in moves] == ["RAPID", "SPLINE"]
    assert moves[0].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].motors[0].peaks.velocity == pytest.approx(0.75 * 3000 / 20)
    # I12 = 0: the jog at 10 counts/ms follows the stop from 100 counts/ms at once.
    variables = {**FREE, 12: 0.0, 119: 1.0, 120: 100.0, 121: 20.0, 122: 10.0}
    moves = analysed("INC TA20 TS10 TM40\nX4000\nRAPID X1000", variables)
    assert moves[0].motors[0].peaks.velocity == pytest.approx(100)
    assert moves[1].motors[0].peaks.velocity == pytest.approx(10)
    assert moves[1].begins_ms == pytest.approx(moves[0].ends_ms + 10)


def test_after_a_home_or_a_preset_the_motor_counts_from_another_place() -> None:
    moves = analysed("INC TA20 TS10 TM40\nX300\nHOME1\nX100")
    assert [move.motors[0].target for move in moves] == [300, 100]
    assert moves[1].motors[0].commanded == moves[1].motors[0].made == 100
    # The motor stands at 300 counts; that is X50 from now on, and X60 is 10 counts further.
    moves = analysed("ABS TA20 TS10 TM40\nX300\nPSET X50\nX60")
    assert moves[1].motors[0].target == pytest.approx(310)
    assert moves[1].motors[0].commanded == pytest.approx(10)


def test_every_motor_has_its_own_point_also_in_what_is_called() -> None:
    moves = analysed("INC TA20 TS10 TM20\n" + "X275 Y1000\nX-275 Y1000\n" * 2, axes=("#1->X", "#2->Y"))
    tool, spindle = moves[1].motors
    assert (tool.motor, spindle.motor) == (1, 2)
    assert tool.made == pytest.approx(-275 * 2 / 3)
    assert spindle.made == pytest.approx(1000)
    assert not spindle.turns
    text = read_program("OPEN PROG 1\nCLEAR\nINC TA20 TS10 TM40\nCALL 5\nX10\nCLOSE\nOPEN PROG 5\nX30\nCLOSE")
    definitions = read_definitions(["#1->X"])
    walked = walk(text, FREE, definitions, {1: 0.0})
    moves = analyse_moves(walked, Timeline(walked.pieces))
    assert [(move.program, move.line) for move in moves] == [(5, 0), (1, 2)]


def ramp_integral(t: float, ta: float, ts: float) -> float:
    """The way of a unit velocity step after two boxes of ta - ts and ts, at time t."""

    def power(x: float, n: int) -> float:
        return max(x, 0.0) ** n

    wide = ta - ts
    if ts == 0:
        return (power(t, 2) - power(t - wide, 2)) / (2 * wide)
    return (power(t, 3) - power(t - wide, 3) - power(t - ts, 3) + power(t - ta, 3)) / (6 * wide * ts)


def convolved(distances: Sequence[int], ta: float, ts: float, tm: float, t: float) -> float:
    """The position at a time from the start of motion."""
    return sum(
        d / tm * (ramp_integral(t - i * tm, ta, ts) - ramp_integral(t - (i + 1) * tm, ta, ts))
        for i, d in enumerate(distances)
    )


def turning_point(distances: Sequence[int], place: int, ta: float, ts: float, tm: float) -> float:
    """The extreme of the convolved path around the end of a move, by golden section."""
    sign, boundary = math.copysign(1, distances[place]), (place + 1) * tm + ta / 2
    low, high = boundary - ta / 2, boundary + ta / 2
    ratio = (5**0.5 - 1) / 2
    for _ in range(80):
        one, two = high - ratio * (high - low), low + ratio * (high - low)
        if sign * convolved(distances, ta, ts, tm, one) > sign * convolved(distances, ta, ts, tm, two):
            high = two
        else:
            low = one
    return convolved(distances, ta, ts, tm, (low + high) / 2)


@given(
    distances=st.lists(st.integers(-1000, 1000), min_size=1, max_size=6),
    ts=st.integers(0, 8),
    plateau=st.integers(1, 10),
    extra=st.integers(0, 20),
)
def test_reached_points_are_on_the_convolved_path(distances: list[int], ts: int, plateau: int, extra: int) -> None:
    ta = 2 * ts + plateau
    tm = ta + extra
    moves = analysed(f"INC TA{ta} TS{ts} TM{tm}\n" + "\n".join(f"X{d}" for d in distances))
    expected = []
    for place, (distance, after) in enumerate(zip(distances, [*distances[1:], 0], strict=True)):
        boundary = (place + 1) * tm + ta / 2
        if place == len(distances) - 1:
            expected.append(float(sum(distances)))
        elif distance * after < 0:
            expected.append(turning_point(distances, place, ta, ts, tm))
        else:
            expected.append(convolved(distances, ta, ts, tm, boundary))
    assert reached(moves) == pytest.approx(expected, abs=1e-6)
    made = [b - a for a, b in zip([0.0, *expected], expected, strict=False)]
    assert [move.motors[0].made for move in moves] == pytest.approx(made, abs=1e-6)


# Programs of random statements, all of them well formed: what the checker says of their motion holds.
#
# The oracle is the motion itself: between any two instants a motor is, on the average, no faster than its peak,
# and no change of its velocity is quicker than the peak of its acceleration.

MACHINE = load_machine("lee-2001-lathe").machine
PARTS = 16

way = st.integers(-2000, 2000)
point = st.integers(0, 5000)


def lines(*words: st.SearchStrategy[str] | str) -> st.SearchStrategy[str]:
    return st.tuples(*(st.just(word) if isinstance(word, str) else word for word in words)).map("\n".join)


def filled(text: str, *numbers: st.SearchStrategy[int]) -> st.SearchStrategy[str]:
    return st.tuples(*numbers).map(lambda values: text.format(*values))


linear = filled("LINEAR INC TA{} TS{} TM{}", st.integers(1, 40), st.integers(0, 20), st.integers(5, 60))
step = st.one_of(
    filled("X{}", way),
    filled("X{} Y{}", way, way),
    filled("X{} Y{} Z{}", way, way, way),
    filled("DELAY{}", st.integers(1, 30)),
)
block = st.one_of(
    lines(linear, step),
    lines(linear, step, step),
    lines(linear, step, step, step),
    lines(linear, filled("F{} FRAX(X,Y)", st.integers(100, 50_000)), step, step),
    lines("ABS RAPID", filled("X{} Z{}", point, point), linear),
    lines("RAPID INC", filled("X{}", way), linear),
    lines(filled("SPLINE{} INC TA{}", st.integers(1, 2), st.integers(2, 40)), filled("X{} Y{}", way, way), linear),
    lines(filled("SPLINE1 INC TA{}", st.integers(2, 40)), *[filled("X{} Y{}", way, way)] * 3, linear),
    lines(filled("INC PVT{}\nX{}:{}\nX{}:0", st.integers(2, 40), way, st.integers(-500, 500), way), linear),
    lines(linear, filled("CIRCLE1\nX{0} Y{0} I{0} J0", st.integers(10, 2000)), linear),
    lines(linear, filled("CIRCLE2 X{0} Y{0} R{0}", st.integers(10, 2000)), "LINEAR", step),
    filled("DWELL{}", st.integers(0, 30)),
    filled("PSET X{}", way),
    st.sampled_from(["STOP", "HOME1", "HOMEZ2", "M1=1", "WAIT"]),
)
body = st.lists(block, min_size=1, max_size=4).map("\n".join)
loop = filled("P{0}=0\nWHILE(P{0}<{1})\nP{0}=P{0}+1", st.integers(1, 9), st.integers(1, 4))
part = st.one_of(
    body,
    st.tuples(loop, body).map(lambda two: f"{two[0]}\n{two[1]}\nENDWHILE"),
    st.tuples(body, body).map(lambda two: f"IF(P1=3)\n{two[0]}\nELSE\n{two[1]}\nENDIF"),
    st.just("GOSUB100"),
)
delays = st.sampled_from(["I11=0 I12=0 I13=0", "I11=0 I12=10 I13=5", "I11=5 I12=0 I13=5", "I11=5 I12=10 I13=0"])
programs = st.tuples(delays, st.lists(part, min_size=1, max_size=4), body).map(
    lambda three: "\n".join(
        [three[0], "OPEN PROG 1", "CLEAR", *three[1], "RETURN", "N100", three[2], "RETURN", "CLOSE"]
    )
)


def walked(text: str) -> Walk:
    definitions = read_definitions(MACHINE.controller.axis_definitions)
    variables = settings_with(MACHINE.controller.variables)
    return walk(read_program(text), variables, definitions, {d.motor: 0.0 for d in definitions})


def numbers(value: object) -> Iterator[float]:
    """Every number in a value, however deep."""
    if isinstance(value, float | int):
        yield value
    elif isinstance(value, dict):
        yield from (number for part in value.values() for number in numbers(part))
    elif isinstance(value, list | tuple):
        yield from (number for part in value for number in numbers(part))
    elif dataclasses.is_dataclass(value):
        yield from numbers([getattr(value, field.name) for field in dataclasses.fields(value)])


def close(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-6)


def cuts(begin_ms: float, end_ms: float) -> list[float]:
    return [begin_ms + (end_ms - begin_ms) * part / PARTS for part in range(PARTS + 1)]


def assert_peaks_are_peaks(timeline: Timeline, index: int, move: MoveAnalysis, motor: MotorMove) -> None:
    for before, after in pairwise(cuts(move.begins_ms, move.ends_ms)):
        time_ms = after - before
        if time_ms <= 1e-3:
            continue
        mean = abs(timeline.position(index, after) - timeline.position(index, before)) / time_ms
        assert mean <= motor.peaks.velocity * (1 + 1e-6) + 1e-6
        change = abs(timeline.velocity(index, after) - timeline.velocity(index, before)) / time_ms
        assert change <= motor.peaks.acceleration * (1 + 1e-6) + 1e-6


def assert_no_motion_is_without_a_move(timeline: Timeline, moves: Sequence[MoveAnalysis]) -> None:
    """The fastest that a motor is anywhere is the peak of one of its moves, and no move claims more."""
    for index in range(len(timeline.pieces[0].cubics)):
        whole = timeline.peaks(index, 0.0, timeline.ends_ms)
        told = [move.motors[index].peaks for move in moves]
        assert close(max(peaks.velocity for peaks in told), whole.velocity)
        assert close(max(peaks.acceleration for peaks in told), whole.acceleration)


@given(programs)
def test_what_is_said_of_the_motion_of_any_program_holds(text: str) -> None:
    checked = check_program(text, MACHINE)
    assert checked.duration_ms >= 0
    said = [finding.values for finding in checked.findings], [sentence.values for sentence in checked.explanation]
    assert all(map(math.isfinite, numbers((checked.moves, said))))

    found = walked(text)
    # A text that stops at once would show nothing: these run to their end.
    assert (found.error, found.ending) == (None, WalkEnding.FINISHED)
    timeline = Timeline(found.pieces)
    moves = analyse_moves(found, timeline)
    if not moves:
        return
    for move in moves:
        for index, motor in enumerate(move.motors):
            assert_peaks_are_peaks(timeline, index, move, motor)
    assert_no_motion_is_without_a_move(timeline, moves)
    if not any(isinstance(step.request, HomeRequest) for step in found.steps[moves[-1].step :]):
        ends = [motor.reached for motor in moves[-1].motors]
        assert all(map(close, ends, found.steps[-1].at))


# Prog. 1 of Lee and Lee (2001) under the checker: the numbers that explain why half of the error was kept.

ROOT = Path(__file__).parents[2]


@pytest.fixture
def printed() -> str:
    """The literal text, as the document quotes it."""
    section = (
        (ROOT / "docs/paper-program.md").read_text(encoding="utf-8").split("\n## The printed program\n", 1)[1]
    )
    return re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1]


@pytest.fixture
def meant(printed: str) -> str:
    """The same with the move time that its comment names, 50 Hz."""
    return re.sub(r"P400=[^;]*", "P400=1000/(2*50) ", printed)


def of_code(checked: ProgramCheck, code: FindingCode) -> list[ProgramFinding]:
    return [finding for finding in checked.findings if finding.code is code]


def said(checked: ProgramCheck, code: ExplanationSentence) -> Mapping[str, Value]:
    (sentence,) = [sentence for sentence in checked.explanation if sentence.code is code]
    return sentence.values


def test_the_stroke_of_the_printed_times_is_two_thirds_and_explained(meant: str, machine: MachineProfile) -> None:
    """183.3 of 275 counts, 36.67 of 55 um; between 545.8 and 729.2 counts."""
    checked = check_program(meant, machine)
    (lost,) = of_code(checked, FindingCode.STROKE_LOST)
    assert lost.values["made_counts"] == pytest.approx(183.333, abs=1e-3)
    assert lost.values["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert lost.values["kept_percent"] == pytest.approx(66.667, abs=1e-3)
    assert lost.lines == (21, 23)
    points = {round(move.motors[0].reached, 1) for move in checked.moves[4:-3]}
    assert points == {545.8, 729.2}
    checked = check_program(meant, machine)
    assert said(checked, ExplanationSentence.TOLD) == pytest.approx(
        {"length": 55, "unit": "um", "tm_ms": 10, "hz": 50}
    )
    assert said(checked, ExplanationSentence.ACCELERATION_TIME) == pytest.approx(
        {"ta_ms": 10, "ts_ms": 10, "used_ms": 20}
    )
    slowed = said(checked, ExplanationSentence.SLOWED_DOWN)
    assert [slowed[key] for key in ("asked_hz", "hz", "asked_rpm", "rpm")] == pytest.approx([50, 25, 1000, 500])
    assert said(checked, ExplanationSentence.STROKE_MADE)["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert said(checked, ExplanationSentence.LEFT_BY_BLENDING)["left_um"] == pytest.approx(18.33, abs=0.01)
    with_servo = said(checked, ExplanationSentence.LEFT_WITH_THE_SERVO)
    assert with_servo["left_um"] == pytest.approx(28, abs=0.5)
    assert with_servo["percent"] == pytest.approx(50, abs=1)
    assert said(checked, ExplanationSentence.TIMES_FOR_THE_SPEED) == {"tm_ms": 10, "ta_ms": 10, "ts_ms": 5}


def test_ts_5_keeps_the_speed_and_not_the_stroke(meant: str, machine: MachineProfile) -> None:
    """At 50 Hz the loop of section 4.2 has a gain of 0.885 and is 0.903 rad late; about 43 um stay."""
    checked = check_program(meant, machine, ts_ms=5)
    assert of_code(checked, FindingCode.STRETCHED) == []
    (lost,) = of_code(checked, FindingCode.STROKE_LOST)
    assert lost.values["kept_percent"] == pytest.approx(66.667, abs=1e-3)
    servo = said(checked, ExplanationSentence.LEFT_WITH_THE_SERVO)
    assert servo["gain"] == pytest.approx(0.885, abs=1e-3)
    assert servo["late_deg"] == pytest.approx(51.7, abs=0.1)
    assert servo["left_um"] == pytest.approx(43, abs=0.5)


def test_linear_ramps_lose_half_and_short_ones_little(meant: str, machine: MachineProfile) -> None:
    """1 - TA/(2 TM): 1/2 at TA10 TS0, 3/4 at TA5 TS0."""
    for ta_ms, kept in ((10, 50.0), (5, 75.0)):
        (lost,) = of_code(check_program(meant, machine, ta_ms=ta_ms, ts_ms=0), FindingCode.STROKE_LOST)
        assert lost.values["kept_percent"] == pytest.approx(kept, abs=1e-6)


def test_what_is_advised_makes_up_for_the_loss(meant: str, machine: MachineProfile) -> None:
    advice = said(check_program(meant, machine), ExplanationSentence.TIMES_FOR_THE_STROKE)
    followed = check_program(meant, machine, ta_ms=float(advice["ta_ms"]), ts_ms=float(advice["ts_ms"]))
    (lost,) = of_code(followed, FindingCode.STROKE_LOST)
    assert lost.values["kept_percent"] == pytest.approx(advice["percent"])
    assert (
        of_code(followed, FindingCode.STRETCHED) == of_code(followed, FindingCode.STRETCHED_BY_ACCELERATION) == []
    )
    longer = said(check_program(meant, machine), ExplanationSentence.STROKE_THAT_MAKES_UP)["longer_counts"]
    checked = check_program(re.sub(r"P500= 275", f"P500={longer}", meant), machine)
    assert of_code(checked, FindingCode.STROKE_LOST)[0].values["made_counts"] == pytest.approx(275)


def test_the_printed_text_lost_a_power_of_ten_and_plunges(printed: str, machine: MachineProfile) -> None:
    checked = check_program(printed, machine)
    (tiny,) = of_code(checked, FindingCode.TIME_BELOW_INTERRUPT)
    assert tiny.values["tm_ms"] == pytest.approx(1 / (2 * 103 * 50))
    assert said(checked, ExplanationSentence.TOLD_WITHOUT_TIME)["length"] == pytest.approx(55)
    assert said(checked, ExplanationSentence.SPEED_MADE) == pytest.approx({"hz": 25, "rpm": 500})
    checked = check_program(printed, machine)
    refused = of_code(checked, FindingCode.LINE_REFUSED)
    assert [finding.lines for finding in refused] == [(22,), (24,)]
    assert {finding.values["number"] for finding in refused} == {4.0}
    assert len(checked.moves) > 10
    # From 500 counts by 10000: 10500, which is 9725 counts or 1.945 mm below the deepest point that was told.
    checked = check_program(printed, machine)
    (plunge,) = of_code(checked, FindingCode.PLUNGE)
    assert plunge.lines == (27,)
    assert plunge.values == pytest.approx({"counts": 10_000, "mm": 2.0, "deeper_mm": 1.945})
    assert checked.worst is Severity.REFUSAL


def test_the_loop_never_ends_and_the_zig_zag_is_one_sided(meant: str, machine: MachineProfile) -> None:
    checked = check_program(meant, machine)
    (endless,) = of_code(checked, FindingCode.ENDLESS_LOOP)
    assert (endless.lines, endless.values["flags"]) == ((20,), "M26=1")
    executed = [place for place in checked.places if place == 21]
    assert endless.values["passes"] == len(executed)
    (one_sided,) = of_code(checked, FindingCode.ONE_SIDED)
    assert one_sided.values == pytest.approx({"begins_counts": 500, "middle_counts": 637.5, "deeper_um": 27.5})


def test_a_sixth_of_a_turn_does_not_drift_and_whole_counts_do(meant: str, machine: MachineProfile) -> None:
    """Six moves of 1666 counts are 4 short of a turn: 0.144 deg, and 139 turns until the lobe is 20 deg off."""
    assert of_code(check_program(meant, machine), FindingCode.DRIFT) == []
    (drift,) = of_code(check_program(meant.replace("10000/6", "INT(10000/6)"), machine), FindingCode.DRIFT)
    assert drift.values["lobes"] == 3
    assert drift.values["counts_per_turn"] == pytest.approx(-4, abs=1e-3)
    assert drift.values["deg_per_turn"] == pytest.approx(-0.144, abs=1e-4)
    assert drift.values["useless_after_turns"] == pytest.approx(139, abs=0.5)
    assert drift.values["useless_after_s"] == pytest.approx(2 * 8.3, abs=0.1)  # at 500 rpm


def test_the_mended_program_has_no_fault(machine: MachineProfile) -> None:
    job = load_job("lee-2001-experiment-1").job
    checked = check_program(paper_program(job, machine, cut_setup(job, machine, 0.0)), machine)
    assert [finding for finding in checked.findings if finding.severity is Severity.REFUSAL] == []
    assert of_code(checked, FindingCode.ENDLESS_LOOP) == []
    assert of_code(checked, FindingCode.STROKE_LOST)[0].values["made_length"] == pytest.approx(36.667, abs=1e-3)
    assert said(checked, ExplanationSentence.SLOWED_DOWN)["rpm"] == pytest.approx(500)
