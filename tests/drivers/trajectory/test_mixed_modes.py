"""Any move after any other, with errors and steps among them: the commanded motion never jumps."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.language.errors import PmacError
from drivers.pmac.requests import BlendBreak, DwellRequest, Halt, LinearRequest, Request
from drivers.pmac.trajectory.pieces import Piece
from tests.drivers.trajectory.motion import assert_smooth, circle, linear, planner_for, pvt, rapid, splined

TURNED = ("#1->866X-500Y+10", "#2->500X+866Y", "#3->-40C")
RATES = (0.5, 0.5, 0.5)

COORDINATES = st.integers(-50, 50).map(float)
TARGETS = st.fixed_dictionaries({"X": COORDINATES, "Y": COORDINATES, "C": st.integers(-400, 400).map(float)})
MS = st.integers(1, 120).map(float)
BLEND = st.fixed_dictionaries({"ta": st.integers(0, 60).map(float), "ts": st.integers(0, 30).map(float)})


def round_trip(request: LinearRequest, absolute: bool) -> LinearRequest:
    return LinearRequest(
        line=0,
        targets=request.targets,
        ta_ms=request.ta_ms,
        ts_ms=request.ts_ms,
        tm_ms=request.tm_ms,
        absolute=frozenset("C") if absolute else frozenset(),
    )


LINEAR = st.builds(
    lambda targets, blend, tm, absolute: round_trip(linear(tm=tm, **blend, **targets), absolute),
    TARGETS,
    BLEND,
    MS,
    st.booleans(),
)
CIRCLE = st.builds(
    lambda targets, blend, tm, i, j, clockwise: circle(
        targets, {"X": i, "Y": j}, tm=tm, clockwise=clockwise, **blend
    ),
    TARGETS,
    BLEND,
    MS,
    COORDINATES,
    COORDINATES,
    st.booleans(),
)
RADIUS = st.builds(lambda targets, radius, tm: circle(targets, radius=radius, tm=tm), TARGETS, COORDINATES, MS)
RAPID = st.builds(lambda targets: rapid(**targets), TARGETS)
SPLINE = st.builds(
    lambda targets, ms, uniform: splined(ms, uniform=uniform, **targets),
    TARGETS,
    st.sampled_from([0.0, 10.0, 10.0, 35.0]),
    st.booleans(),
)
PVT = st.builds(
    lambda targets, ms, velocity: pvt(ms, velocity, **targets), TARGETS, MS, st.sampled_from([0.0, 0.0, 0.3])
)
PAUSES = st.sampled_from([DwellRequest(duration_ms=0.0), DwellRequest(duration_ms=20.0), BlendBreak(), Halt()])


@given(
    requests=st.lists(st.one_of(LINEAR, LINEAR, CIRCLE, CIRCLE, RADIUS, RAPID, SPLINE, PVT, PAUSES), max_size=10),
    steps=st.sets(st.integers(0, 9)),
    variables=st.fixed_dictionaries(
        {
            13: st.sampled_from([0.0, 10.0]),
            11: st.sampled_from([0.0, 5.0]),
            192: st.sampled_from([0.0, 0.0, 1.0]),
            117: st.sampled_from([0.0, 2.0]),
            327: st.sampled_from([0.0, 14_400.0, -14_400.0]),
        }
    ),
)
def test_position_and_velocity_never_jump(
    requests: list[Request], steps: set[int], variables: dict[int, float]
) -> None:
    """A run-time error, here and there, halts the motion; the program is then run on, as after R."""
    planner = planner_for(requests, TURNED, variables)
    pieces: list[Piece] = []
    for number in range(len(requests) + 20):
        try:
            planned = planner.plan()
            pieces += planned.pieces
            if planned.finished:
                break
            if number in steps:
                pieces += planner.settle()
        except PmacError:
            pieces += planner.halt(RATES)
    else:
        pytest.fail("no end")
    assert_smooth(pieces, (10.0, 0.0, 0.0), 100_000.0)
