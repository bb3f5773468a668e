"""Programs of random statements, all of them well formed: what the checker says of their motion holds.

The oracle is the motion itself: between any two instants a motor is, on the average, no faster than its peak, and
no change of its velocity is quicker than the peak of its acceleration.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.analysis.moves import MotorMove, MoveAnalysis, analyse_moves
from drivers.pmac.analysis.program import check_program
from drivers.pmac.analysis.timeline import Timeline
from drivers.pmac.analysis.walk import Ending, Walk, walk
from drivers.pmac.axes import read_definitions
from drivers.pmac.program_text import read_program
from drivers.pmac.requests import HomeRequest
from drivers.pmac.settings import settings_with
from profiles.store import load_machine

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
    assert (found.error, found.ending) == (None, Ending.FINISHED)
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
