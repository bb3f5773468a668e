"""CIRCLE moves against exact arcs: which arc it is, how exactly it is followed, and how it is blended."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.errors import PmacError
from drivers.pmac.requests import CircleRequest, Request
from tests.drivers.trajectory.motion import Motion, assert_smooth, circle, linear, motion, planner_for, where

XY = ("#1->1000X", "#2->1000Y")
XYZ = (*XY, "#3->1000Z")
SEGMENTS = {13: 9.0}
"""An even number of them are in the moves that are looked at in their middle, which is a node then."""


def path(
    request: Request, definitions: tuple[str, ...] = XY, start: dict[int, float] | None = None, **more: float
) -> Motion:
    settings = {**SEGMENTS, **{int(name[1:]): value for name, value in more.items()}}
    return motion([request], definitions, settings, start)


def point(made: Motion, t: float, definitions: tuple[str, ...] = XY) -> dict[str, float]:
    return where(definitions, [made.at(t, m) for m in range(len(definitions))])


def from_center(made: Motion, t: float, x: float, y: float) -> float:
    here = point(made, t)
    return math.hypot(here["X"] - x, here["Y"] - y)


def middle(request: CircleRequest, definitions: tuple[str, ...] = XY) -> tuple[float, ...]:
    """Where half of the way is made."""
    made = path(request, definitions)
    return tuple(point(made, made.duration_ms / 2, definitions).values())


@pytest.mark.parametrize(("clockwise", "sign"), [(True, 1), (False, -1)])
def test_half_a_circle_goes_clockwise_or_counterclockwise(clockwise: bool, sign: int) -> None:
    """From 0,0 to 20,0 about 10,0: clockwise is over the top."""
    half = circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, clockwise=clockwise)
    assert middle(half) == pytest.approx((10.0, sign * 10.0), abs=1e-9)


@pytest.mark.parametrize(
    ("normal", "over"),
    [((0.0, 0.0, -1.0), "Y"), ((0.0, -1.0, 0.0), "X"), ((-1.0, 0.0, 0.0), "Z")],
    ids=["NORMAL K-1 is XY", "NORMAL J-1 is ZX", "NORMAL I-1 is YZ"],
)
def test_clockwise_is_right_handed_about_the_normal(normal: tuple[float, float, float], over: str) -> None:
    """In each plane from the first axis to its other side: XY over +Y, ZX over +X, YZ over +Z."""
    along = {"Y": "X", "X": "Z", "Z": "Y"}[over]
    targets = {"X": 0.0, "Y": 0.0, "Z": 0.0, along: 20.0}
    expected = {"X": 0.0, "Y": 0.0, "Z": 0.0, along: 10.0, over: 10.0}
    assert middle(circle(targets, {along: 10.0}, normal=normal), XYZ) == pytest.approx(
        tuple(expected.values()), abs=1e-9
    )


def test_the_end_point_at_the_start_is_a_full_circle() -> None:
    made = path(circle({"X": 0.0, "Y": 0.0}, {"X": 10.0}, tm=400.0))
    assert tuple(point(made, made.duration_ms / 2).values()) == pytest.approx((20.0, 0.0), abs=1e-9)
    assert tuple(point(made, made.duration_ms).values()) == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize(("setting", "dialect_is_turbo"), [(90, False), (5197, True)])
def test_an_angle_below_the_least_arc_is_a_full_circle_more(setting: int, dialect_is_turbo: bool) -> None:
    """1 degree is 1/180 of a half turn; I90, or Isx97 of a Turbo, draws the line."""
    angle = math.radians(1.0)
    request = circle({"X": 10.0 - 10.0 * math.cos(angle), "Y": 10.0 * math.sin(angle)}, {"X": 10.0})
    extra = {"dialect": TURBO} if dialect_is_turbo else {}
    segments = {5113: 10.0} if dialect_is_turbo else {13: 10.0}
    for least, sweep in ((0.005, angle), (0.006, angle + math.tau)):
        made = motion([request], XY, {**segments, setting: least}, **extra)  # type: ignore[arg-type]
        speed = math.hypot(made.velocity(60.0, 0), made.velocity(60.0, 1))
        assert speed == pytest.approx(1000.0 * 10.0 * sweep / 100.0, rel=1e-3)


@pytest.mark.parametrize(("radius", "middle_y"), [(12.5, 5.0), (-12.5, 20.0)])
def test_a_radius_is_the_short_arc_a_negative_one_the_long(radius: float, middle_y: float) -> None:
    """A chord of 20 and a radius of 12.5 put the centre 7.5 beside the chord."""
    assert middle(circle({"X": 20.0, "Y": 0.0}, radius=radius)) == pytest.approx((10.0, middle_y), abs=1e-9)
    other_way = circle({"X": 20.0, "Y": 0.0}, radius=radius, clockwise=False)
    assert middle(other_way) == pytest.approx((10.0, -middle_y), abs=1e-9)


def test_an_arc_may_be_too_long_within_ix96_and_a_change_of_radius_is_taken_up() -> None:
    """INC X7.072 Y7.072 R5: the distance is 10.0013, so with a limit of 0.003 a near-circle is made."""
    request = circle({"X": 7.072, "Y": 7.072}, radius=5.0)
    made = path(request, I196=0.003)
    assert tuple(point(made, made.duration_ms).values()) == pytest.approx((7.072, 7.072), abs=1e-9)
    distance = math.hypot(7.072, 7.072)
    x = y = 5.0 / distance * 7.072
    for node in made.starts_ms:
        assert 5.0 - 1e-9 <= from_center(made, node, x, y) <= distance - 5.0 + 1e-9
    request = circle({"X": 7.072, "Y": 7.072}, radius=5.0)
    with pytest.raises(PmacError, match="radius 5"):
        path(request, I196=0.001)
    made = path(request, I196=0.0)
    assert made.end(0) == pytest.approx(7072.0)
    # From radius 10 to radius 12 over a quarter.
    made = path(circle({"X": 10.0, "Y": 12.0}, {"X": 10.0}, tm=100.0))
    assert from_center(made, made.duration_ms / 2, 10.0, 0.0) == pytest.approx(11.0, abs=1e-9)
    assert tuple(point(made, made.duration_ms).values()) == pytest.approx((10.0, 12.0), abs=1e-9)


@pytest.mark.parametrize(
    "request_",
    [
        circle({"X": 20.0, "Y": 0.0}, {}),
        circle({"X": 10.0, "Y": 0.0}, {"X": 10.0}),
        circle({"X": 0.0, "Y": 0.0}, radius=5.0),
        circle({"X": 20.0, "Y": 0.0}, radius=0.0),
        circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, normal=(0.0, 0.0, 0.0)),
        circle({"X": 20.0, "Y": 0.0}, {"X": 1e300}),
        circle({"X": 20.0, "Y": 0.0}, radius=1e200),
        circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=None, speed=0.0),
    ],
    ids=["no radius", "end at centre", "full by radius", "radius 0", "no normal", "centre far", "far", "no speed"],
)
def test_an_arc_that_does_not_exist_is_a_run_time_error(request_: CircleRequest) -> None:
    with pytest.raises(PmacError):
        path(request_)


def test_vectors_out_of_the_plane_are_projected_and_a_third_axis_makes_a_helix() -> None:
    targets = {"X": 20.0, "Y": 0.0, "Z": 0.0}
    assert middle(circle(targets, {"X": 10.0, "Z": 7.0}), XYZ) == pytest.approx((10.0, 10.0, 0.0), abs=1e-9)
    definitions = (*XYZ, "#4->100C")
    request = circle({"X": 0.0, "Y": 0.0, "Z": 8.0, "C": 90.0}, {"X": 10.0}, tm=400.0)
    made = path(request, definitions)
    for node in made.starts_ms:
        here = point(made, node, definitions)
        assert math.hypot(here["X"] - 10.0, here["Y"]) == pytest.approx(10.0, abs=1e-9)
        if 10.0 <= node <= 400.0:
            assert here["Z"] == pytest.approx(8.0 * (node - 5.0) / 400.0)
            assert here["C"] == pytest.approx(90.0 * (node - 5.0) / 400.0)


@pytest.mark.parametrize(("z", "length"), [(0.0, math.pi * 10.0), (8.0, math.hypot(math.pi * 10.0, 8.0))])
def test_a_feedrate_counts_along_the_path(z: float, length: float) -> None:
    request = circle({"X": 20.0, "Y": 0.0, "Z": z}, {"X": 10.0}, tm=None, speed=0.1)
    assert path(request, XYZ).duration_ms == pytest.approx(length / 0.1 + 10.0)


def test_without_segments_or_a_centre_a_circle_move_is_linear() -> None:
    request = circle({"X": 20.0, "Y": 0.0}, {"X": 10.0})
    made = motion([request], XY, {13: 0.0})
    straight = motion([linear(tm=100.0, X=20.0, Y=0.0)], XY)
    assert made.pieces == straight.pieces
    by_speed = motion([circle({"X": 3.0, "Y": 4.0}, {"X": 1.0}, tm=None, speed=0.05)], XY, {13: 0.0})
    assert by_speed.duration_ms == pytest.approx(5.0 / 0.05 + 10.0)
    assert middle(circle({"X": 20.0, "Y": 8.0})) == pytest.approx((10.0, 4.0))


def test_pieces_are_no_longer_than_the_segmentation_time_and_know_no_ix16_and_ix17() -> None:
    request = circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=100.0)
    limited = path(request, I116=1.0, I117=0.001)
    assert limited.duration_ms == pytest.approx(110.0)
    made = path(circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=96.0))
    assert max(piece.duration_ms for piece in made.pieces) <= 9.0
    assert len(path(circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=8e6), I13=0.001).pieces) < 20_000


@given(
    radius=st.floats(0.5, 200.0),
    begin=st.floats(0.0, math.tau),
    sweep=st.floats(0.01, math.tau - 0.01),
    clockwise=st.booleans(),
    tm=st.integers(20, 2000),
    segment=st.sampled_from([2.0, 5.0, 10.0]),
)
def test_nodes_are_on_the_circle_and_the_rest_within_the_error_of_the_cubics(
    radius: float, begin: float, sweep: float, clockwise: bool, tm: int, segment: float
) -> None:
    """The error of a Hermite cubic is h^4/384 times the fourth derivative, here radius x (angle a ms)^4."""
    turn = begin + (-sweep if clockwise else sweep)
    start = (radius * math.cos(begin), radius * math.sin(begin))
    request = circle(
        {"X": radius * math.cos(turn), "Y": radius * math.sin(turn)},
        {"X": -start[0], "Y": -start[1]},
        clockwise=clockwise,
        tm=float(tm),
    )
    made = path(request, start={1: 1000.0 * start[0], 2: 1000.0 * start[1]}, I13=segment)
    for node in made.starts_ms:
        assert from_center(made, node, 0.0, 0.0) == pytest.approx(radius, abs=1e-9 * radius)
    bound = radius * (sweep / tm) ** 4 * segment**4 / 384
    for k in range(200):
        t = 10.0 + (tm - 10.0) * k / 200
        assert abs(from_center(made, t, 0.0, 0.0) - radius) <= 1.001 * bound + 1e-9 * radius
    end = point(made, made.duration_ms)
    assert (end["X"], end["Y"]) == pytest.approx(tuple(request.targets.values()), abs=1e-9 * radius)
    assert_smooth(made.pieces, (1000.0 * start[0], 1000.0 * start[1]), 1000.0 * radius)


def gone(t: float, ta: float, ts: float) -> float:
    """The time gained at a boundary at 0, delayed by half a ramp: as in the test of LINEAR moves."""

    def after(t: float, power: int) -> float:
        return t**power if t > 0.0 else 0.0

    if ts == 0.0:
        return (after(t, 2) - after(t - ta, 2)) / (2 * ta)
    wide = ta - ts
    return (after(t, 3) - after(t - wide, 3) - after(t - ts, 3) + after(t - ta, 3)) / (6 * wide * ts)


def blended(t: float, ta: float, ts: float) -> tuple[float, float]:
    """10 along X in 100 ms, a quarter about (10, 10) in 200 ms, 10 along Y in 50 ms: the ways are added."""
    share = [
        (gone(t - begin, ta, ts) - gone(t - end, ta, ts)) / (end - begin)
        for begin, end in ((0.0, 100.0), (100.0, 300.0), (300.0, 350.0))
    ]
    angle = math.pi / 2 * share[1]
    return 10.0 * share[0] + 10.0 * math.sin(angle), 10.0 * (1.0 - math.cos(angle)) + 10.0 * share[2]


@pytest.mark.parametrize(("ta", "ts"), [(10.0, 0.0), (30.0, 0.0), (30.0, 10.0), (40.0, 20.0)])
def test_arcs_and_straight_moves_are_blended_by_adding_their_ways(ta: float, ts: float) -> None:
    requests: list[Request] = [
        linear(ta, ts, 100.0, X=10.0, Y=0.0),
        circle({"X": 20.0, "Y": 10.0}, {"Y": 10.0}, clockwise=False, ta=ta, ts=ts, tm=200.0),
        linear(ta, ts, 50.0, X=20.0, Y=20.0),
    ]
    made = motion(requests, XY, {13: 1.0, 187: ta, 188: ts})
    assert made.duration_ms == pytest.approx(350.0 + ta)
    for node in made.starts_ms:
        here = point(made, node)
        assert (here["X"], here["Y"]) == pytest.approx(blended(node, ta, ts), abs=1e-9 * 20.0)
    for k in range(300):
        t = made.duration_ms * k / 300
        here = point(made, t)
        assert (here["X"], here["Y"]) == pytest.approx(blended(t, ta, ts), abs=1e-6)
    assert_smooth(made.pieces, (0.0, 0.0), 20_000.0)


@given(
    moves=st.lists(
        st.tuples(
            st.sampled_from(["line", "clockwise", "counterclockwise"]),
            st.integers(-50, 50),
            st.integers(-50, 50),
            st.integers(1, 60),
            st.integers(0, 30),
            st.integers(1, 200),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_any_lines_and_arcs_are_smooth_to_their_end(moves: list[tuple[str, int, int, int, int, int]]) -> None:
    x = y = 0.0
    requests: list[Request] = []
    for kind, dx, dy, ta, ts, tm in moves:
        targets = {"X": x + dx, "Y": y + dy}
        if kind == "line":
            requests.append(linear(ta, ts, tm, **targets))
        else:
            # Off the chord, so that neither end is at the centre.
            center = {"X": dx / 2 - dy - 1.5, "Y": dy / 2 + dx + 0.25}
            requests.append(circle(targets, center, clockwise=kind == "clockwise", ta=ta, ts=ts, tm=float(tm)))
        x, y = targets["X"], targets["Y"]
    made = motion(requests, XY, {13: 10.0})
    assert (made.end(0), made.end(1)) == pytest.approx((1000.0 * x, 1000.0 * y), abs=1e-3)
    assert_smooth(made.pieces, (0.0, 0.0), 1e6)


def test_axes_that_are_turned_against_the_motors_make_the_same_circle() -> None:
    turned = ("#1->8660.25X-5000Y", "#2->5000X+8660.25Y")
    request = circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=200.0)
    made = path(request, turned)
    for node in made.starts_ms:
        here = point(made, node, turned)
        assert math.hypot(here["X"] - 10.0, here["Y"]) == pytest.approx(10.0, abs=1e-9)


def test_a_stop_after_an_arc_keeps_to_its_segments_when_i13_is_set_to_0_meanwhile() -> None:
    planner = planner_for([circle({"X": 20.0, "Y": 0.0}, {"X": 10.0}, tm=400.0)], XY, SEGMENTS)
    pieces = planner.plan().pieces
    planner._variables.replace_i({**planner._variables.dialect.factory, 187: 10.0, 13: 0.0})
    pieces += planner.settle()
    assert from_center(Motion(pieces), 205.0, 10.0, 0.0) == pytest.approx(10.0, abs=1e-5)
