"""What stands between moves: stops, delays, events, assignments that wait for their move, and coming back."""

from __future__ import annotations

import pytest

from drivers.pmac.axes import preset_origins, read_definitions
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.requests import (
    BlendBreak,
    DeferredValue,
    DwellRequest,
    Halt,
    HomeRequest,
    LinearRequest,
    PresetRequest,
    PvtRequest,
    RapidRequest,
    Request,
    SplineRequest,
)
from tests.drivers.trajectory.motion import (
    INTERRUPT_MS,
    Motion,
    Script,
    assert_smooth,
    circle,
    linear,
    motion,
    planner_for,
    plans,
    pvt,
    rapid,
    splined,
)

EVENTS = (HomeRequest(line=0, motors=(1,), zero=False), PresetRequest(line=0, positions={"X": 0.0}), Halt())
BREAKS = (DwellRequest(duration_ms=0.0), BlendBreak(), *EVENTS)
NAMES = ["DWELL0", "two jumps back", "HOME", "PSET", "STOP"]


@pytest.mark.parametrize("between", BREAKS, ids=NAMES)
def test_what_breaks_blending_brings_the_motion_to_its_point(between: Request) -> None:
    made = motion([linear(X=100.0, tm=50), between, linear(X=200.0, tm=50)])
    assert made.at(60.0) == pytest.approx(100.0)
    assert made.velocity(60.0) == pytest.approx(0.0, abs=1e-9)
    assert made.duration_ms == pytest.approx(2 * 60.0)


@pytest.mark.parametrize("between", BREAKS, ids=NAMES)
def test_without_motion_before_it_a_break_takes_an_interrupt_of_real_time(between: Request) -> None:
    (piece,) = planner_for([between]).plan().pieces
    assert piece.duration_ms == pytest.approx(INTERRUPT_MS)
    assert piece.real_time


@pytest.mark.parametrize("event", EVENTS, ids=NAMES[2:])
def test_an_event_is_handed_on_with_the_motion_that_comes_before_it(event: Request) -> None:
    first, second, *_ = plans(planner_for([linear(X=100.0, tm=50), event]))
    assert first.event is None
    assert second.event is event
    assert Motion(second.pieces).end() == pytest.approx(100.0)


def test_a_dwell_passes_in_real_time_and_a_delay_on_the_time_base() -> None:
    *_, dwell, _ = plans(planner_for([linear(X=100.0), DwellRequest(duration_ms=250.0)]))
    assert [piece.real_time for piece in dwell.pieces] == [False] * (len(dwell.pieces) - 1) + [True]
    assert dwell.pieces[-1].duration_ms == 250.0
    delay = motion([linear(X=100.0, tm=30), linear(X=100.0, tm=250)])
    assert not any(piece.real_time for piece in delay.pieces)
    assert delay.duration_ms == pytest.approx(5 + 30 + 250 + 5)


@pytest.mark.parametrize("first", [linear(X=100.0, tm=50), pvt(50.0, X=100.0), splined(50.0, X=100.0)])
def test_i11_passes_before_the_first_move_on_the_time_base(first: Request) -> None:
    with_delay, without = motion([first], settings={11: 40.0}), motion([first])
    assert with_delay.duration_ms == pytest.approx(40.0 + without.duration_ms)
    assert with_delay.at(40.0) == 0.0
    assert not with_delay.pieces[0].real_time


@pytest.mark.parametrize(
    ("between", "delays"),
    [
        (BREAKS[0], 2),
        (BREAKS[1], 2),
        (BREAKS[2], 2),
        (BREAKS[3], 2),
        (rapid(X=150.0), 2),
        (linear(X=100.0, tm=30), 1),
    ],
    ids=["DWELL", "two jumps back", "HOME", "PSET", "RAPID", "DELAY does not count"],
)
def test_i11_passes_after_each_break(between: Request, delays: int) -> None:
    requests: list[Request] = [linear(X=100.0, tm=50), between, linear(X=200.0, tm=50)]
    settings = {12: 0.0}
    slow = motion(requests, settings={**settings, 11: 40.0})
    assert slow.duration_ms == pytest.approx(40.0 * delays + motion(requests, settings=settings).duration_ms)


def test_with_ix92_every_move_stops_and_i11_passes_before_each() -> None:
    requests: list[Request] = [linear(X=100.0, tm=50), linear(X=200.0, tm=50)]
    made = motion(requests, settings={192: 1, 11: 7.0})
    assert made.duration_ms == pytest.approx(2 * (7 + 50 + 10))
    assert made.at(67.0) == pytest.approx(100.0)
    assert made.velocity(67.0) == pytest.approx(0.0, abs=1e-9)
    requests = [circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}), linear(X=30.0, Y=0.0, tm=50)]
    made = motion(requests, ("#1->X", "#2->Y"), {192: 1, 13: 10.0})
    assert made.duration_ms == pytest.approx(110 + 60)
    assert made.at(110.0) == pytest.approx(20.0)
    assert made.velocity(110.0, 1) == pytest.approx(0.0, abs=1e-9)


M1 = (DeferredValue(kind=VariableKind.M, index=1, value=1.0),)


@pytest.mark.parametrize(
    ("move", "begins_ms"),
    [
        (LinearRequest(line=0, targets={"X": 200.0}, ta_ms=10, ts_ms=0, tm_ms=50, deferred=M1), 50.0),
        (RapidRequest(line=0, targets={"X": 200.0}, moving=frozenset("X"), deferred=M1), 60.0 + 10.0),
        (RapidRequest(line=0, targets={"X": 100.0}, moving=frozenset("X"), deferred=M1), 60.0 + 10.0),
        (SplineRequest(line=0, targets={"X": 200.0}, duration_ms=50, uniform=True, deferred=M1), 60.0),
        (PvtRequest(line=0, targets={"X": 200.0}, velocities={}, duration_ms=50, deferred=M1), 60.0),
        (DwellRequest(duration_ms=50, deferred=M1), 60.0),
        (DwellRequest(duration_ms=0, deferred=M1), 60.0),
    ],
    ids=["LINEAR", "RAPID", "RAPID of no distance", "SPLINE1", "PVT", "DWELL", "DWELL0"],
)
def test_an_assignment_waits_for_the_piece_in_which_its_move_begins(move: Request, begins_ms: float) -> None:
    """LINEAR: half a ramp before the boundary, at 55. RAPID: after I12. Spline and PVT: their first segment."""
    made = motion([linear(X=100.0, tm=50), move], settings={12: 10.0})
    carrying = [start for start, piece in zip(made.starts_ms, made.pieces, strict=True) if piece.deferred]
    assert carrying == [pytest.approx(begins_ms)]


def test_a_step_comes_to_rest_at_its_point_and_the_next_begins_anew() -> None:
    planner = planner_for([linear(X=100.0, tm=50), linear(X=200.0, tm=50)], settings={11: 3.0})
    first = Motion((*planner.plan().pieces, *planner.settle()))
    assert first.end() == pytest.approx(100.0)
    assert first.duration_ms == pytest.approx(63.0)
    second = Motion((*planner.plan().pieces, *planner.settle()))
    assert second.duration_ms == pytest.approx(63.0)
    assert planner.settle() == ()


@pytest.mark.parametrize("uniform", [True, False])
def test_steps_through_a_spline_rest_at_each_point(uniform: bool) -> None:
    planner = planner_for([splined(10, uniform=uniform, X=6.0), splined(20, uniform=uniform, X=9.0)])
    for point, ms in ((6.0, 30.0), (9.0, 60.0)):
        step = Motion((*planner.plan().pieces, *planner.settle()))
        assert step.end() == pytest.approx(point)
        assert step.duration_ms == pytest.approx(ms)
    assert planner.plan().finished


def test_a_step_through_pvt_ramps_down_at_ix15_behind_its_point() -> None:
    planner = planner_for([pvt(10.0, 1.0, X=5.0), pvt(30.0, X=40.0)], settings={115: 0.1})
    first = Motion((*planner.plan().pieces, *planner.settle()))
    assert first.duration_ms == pytest.approx(10.0 + 10.0)
    assert first.end() == pytest.approx(5.0 + 5.0)
    second = Motion((*planner.plan().pieces, *planner.settle()))
    assert second.at(0.0) == pytest.approx(10.0)
    assert second.velocity(0.0) == 0.0
    assert second.end() == pytest.approx(40.0)


FAR = 1e12


@pytest.mark.parametrize(
    "before",
    [linear(X=100.0, tm=50), splined(50.0, X=100.0), splined(50.0, uniform=False, X=100.0), pvt(50.0, X=100.0)],
)
@pytest.mark.parametrize(
    "fault",
    [linear(X=FAR), rapid(X=FAR), splined(50.0, X=FAR), splined(20.0, uniform=False, X=FAR), pvt(50.0, X=FAR)],
)
def test_a_run_time_error_ends_the_motion_without_a_jump(before: Request, fault: Request) -> None:
    planner = planner_for([before, fault])
    pieces = planner.plan().pieces
    with pytest.raises(PmacError):
        planner.plan()
    pieces += planner.halt((0.1,))
    assert_smooth(pieces, (0.0,), 100.0)
    assert Motion(pieces).end() == pytest.approx(100.0)


def test_a_program_that_is_given_up_ends_at_its_point_and_goes_on_from_there() -> None:
    planner = planner_for([linear(X=100.0, tm=50), linear(X=200.0, tm=50)])
    given_up = Motion((*planner.plan().pieces, *planner.halt((0.1,))))
    assert given_up.end() == pytest.approx(100.0)
    assert Motion(planner.plan().pieces).at(0.0) == pytest.approx(100.0)


def test_after_a_home_search_the_motion_goes_on_from_where_the_motor_is() -> None:
    planner = planner_for([linear(X=100.0), EVENTS[0], linear(X=20.0)])
    planner.plan()
    planner.plan()
    planner.relocate((0.0,))
    last = Motion((*planner.plan().pieces, *planner.settle()))
    assert last.at(0.0) == 0.0
    assert last.end() == pytest.approx(20.0)


def test_pset_moves_the_origin_of_the_axis_and_no_motor() -> None:
    """At X100 (10000 counts) PSET X5 is heard: X6 is then one unit, 100 counts, further."""
    (definition,) = read_definitions(["#1->100X"])
    planner = planner_for([linear(X=100.0), EVENTS[1], linear(X=6.0)], ("#1->100X",))
    planner.plan()
    planner.plan()
    origins = preset_origins({}, {"X": 100.0}, {"X": 5.0})
    planner.relocate((10_000.0,), (definition.shift_origins(origins),))
    last = Motion((*planner.plan().pieces, *planner.settle()))
    assert last.at(0.0) == 10_000.0
    assert last.end() == pytest.approx(10_100.0)


def test_spline2_asks_for_one_request_more_and_loses_none() -> None:
    planner = planner_for([splined(10, uniform=False, X=6.0), linear(X=9.0)])
    planner.plan()
    script = planner.run
    assert isinstance(script, Script)
    assert script.given == 2
    rest = plans(planner)
    assert [planned.record is not None for planned in rest] == [True, False]
    assert Motion(rest[-1].pieces).end() == pytest.approx(9.0)
