"""From program requests to pieces of motion: the one place where a move mode becomes a trajectory.

The simulator plays the pieces, the checker plots them. Motors are in the order of the axis definitions; positions
are counts, times ms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from drivers.pmac import requests
from drivers.pmac.axes import AXIS_LETTERS, AxisDefinition
from drivers.pmac.execution.run import ProgramRun
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.settings import servo_cycle_ms
from drivers.pmac.trajectory.circle import Arc, chord_length
from drivers.pmac.trajectory.course import MOST_CUTS, lay_course, stop_course
from drivers.pmac.trajectory.frame import MotorFrame
from drivers.pmac.trajectory.jog import SHORTEST_RAMP_MS, rapid, rapid_time_ms
from drivers.pmac.trajectory.linear import Blend, Limits, LinearMove, at_rest, timing_of
from drivers.pmac.trajectory.pieces import Piece, Vector, constant, hermite, position_at, ramp, velocity_at
from drivers.pmac.trajectory.planned_pieces import (
    MoveRecord,
    PlannedPieces,
    check_segment,
    circle_time_ms,
    defer,
    plain_record,
)
from drivers.pmac.variables import VariableStore


@dataclass(frozen=True, slots=True, kw_only=True)
class Spline:
    """A spline planned up to `position` with `velocity`, where the segment to `point` begins.

    `distance` is that of the segment to `point`, `duration_ms` its time, `before_ms` that of the one before it.
    """

    uniform: bool
    point: Vector
    distance: Vector
    before_ms: float
    duration_ms: float
    position: Vector
    velocity: Vector

    def goes_on(self, duration_ms: float, uniform: bool) -> bool:
        """Whether a segment belongs to this spline; SPLINE1 begins again when its time changes."""
        return self.uniform == uniform and (duration_ms == self.duration_ms or not uniform)


def begin(start: Vector, duration_ms: float, uniform: bool) -> Spline:
    """Begin at rest: a segment of zero distance comes first, as long as the first programmed one."""
    still = tuple(0.0 for _ in start)
    first = {"before_ms": duration_ms, "duration_ms": duration_ms}
    return Spline(uniform=uniform, point=start, distance=still, position=start, velocity=still, **first)


def add(spline: Spline, target: Vector, duration_ms: float, next_ms: float) -> tuple[Piece, Spline]:
    """Add a segment to `target` that is followed by one of `next_ms`.

    Returns:
        The motion of the segment before it, which can now be played, and the extended spline.
    """
    distance = tuple(t - p for t, p in zip(target, spline.point, strict=True))
    here_ms = spline.duration_ms
    joint_ms = here_ms + duration_ms
    # A cubic B-spline: its acceleration continues at the joints, so it passes beside its points. With equal times
    # the joint is at (P0 + 4 P1 + P2) / 6, its velocity (P2 - P0) / (2 T).
    early = duration_ms / (joint_ms * (spline.before_ms + joint_ms))
    late = here_ms / (joint_ms * (joint_ms + next_ms))
    pairs = tuple(zip(spline.distance, distance, strict=True))
    velocity = tuple(3.0 * (early * before + late * after) for before, after in pairs)
    position = tuple(
        point - early * duration_ms * before + late * here_ms * after
        for point, (before, after) in zip(spline.point, pairs, strict=True)
    )
    piece = hermite(spline.position, spline.velocity, position, velocity, here_ms)
    longer = Spline(
        uniform=spline.uniform,
        point=target,
        distance=distance,
        before_ms=here_ms,
        duration_ms=duration_ms,
        position=position,
        velocity=velocity,
    )
    return piece, longer


def end(spline: Spline) -> tuple[Piece, ...]:
    """Come to rest at the last point: its segment, and one of zero distance and equal duration."""
    duration_ms = spline.duration_ms
    last, rest = add(spline, spline.point, duration_ms, duration_ms)
    still, _ = add(rest, spline.point, duration_ms, duration_ms)
    return last._replace(calculates=False), still._replace(calculates=False)


_State = tuple[Blend, Vector | None, Spline | None, bool, Blend | None, Mapping[str, float]]
SEGMENT_MS = 10.0  # of the last stop, where the setting is 0 by then
STEP_MS = 0.01  # along the path, to both sides, from which the velocity of a motor is taken
AXES_ALONE = tuple(
    AxisDefinition(motor=number, terms=((axis, 1.0),)) for number, axis in enumerate(AXIS_LETTERS, 1)
)
"""A motor for each axis, one count to a user unit: moves along the path of the axes are planned with them."""

STILL: Vector = tuple(0.0 for _ in AXES_ALONE)
NO_LIMITS = Limits(velocity=STILL, acceleration=STILL)

Solve = Callable[[Vector], Vector]
"""From axis positions, in the order of `AXIS_LETTERS`, to motor positions."""


def through_inverse(pieces: Iterable[Piece], segment_ms: float, solve: Solve) -> tuple[Piece, ...]:
    """Return the motion of motors for that of axes."""
    return tuple(part for piece in pieces for part in _cut_piece(piece, segment_ms, solve))


def _cut_piece(piece: Piece, segment_ms: float, solve: Solve) -> list[Piece]:
    if not any(any(cubic[1:]) for cubic in piece.cubics):
        here = solve(tuple(cubic[0] for cubic in piece.cubics))
        return [constant(here, tuple(0.0 for _ in here), piece.duration_ms)._replace(calculates=piece.calculates)]
    count = math.ceil(min(MOST_CUTS, piece.duration_ms / segment_ms)) or 1
    times = [piece.duration_ms * k / count for k in range(count + 1)]
    states = [_state(piece, instant, solve) for instant in times]
    return [
        hermite(*states[k], *states[k + 1], times[k + 1] - times[k], calculates=piece.calculates and k == 0)
        for k in range(count)
    ]


def _state(piece: Piece, instant_ms: float, solve: Solve) -> tuple[Vector, Vector]:
    """Return position and velocity of the motors; the last thing that is solved is where the axes are."""
    place = tuple(position_at(cubic, instant_ms) for cubic in piece.cubics)
    velocity = tuple(velocity_at(cubic, instant_ms) for cubic in piece.cubics)
    before = solve(tuple(p - STEP_MS * v for p, v in zip(place, velocity, strict=True)))
    after = solve(tuple(p + STEP_MS * v for p, v in zip(place, velocity, strict=True)))
    moving = tuple((a - b) / (2.0 * STEP_MS) for a, b in zip(after, before, strict=True))
    return solve(place), moving


class MotionPlanner:
    """Plans the trajectory of one program run, one request at a time.

    The planned motion ends at `_blend`: at rest, in a blended move, or, at its target, in a PVT or SPLINE
    sequence.
    """

    def __init__(
        self,
        run: ProgramRun,
        definitions: tuple[AxisDefinition, ...],
        variables: VariableStore,
        position: Vector,
        system: int = 1,
    ) -> None:
        """Take `position`, the commanded motor positions in counts, in the order of `definitions`."""
        self.run = run
        self._frame = MotorFrame(definitions, variables, system)
        self._variables = variables
        self._system = system
        self._blend: Blend = at_rest(position)
        self._pvt_velocity: Vector | None = None
        self._spline: Spline | None = None
        self._ahead: requests.Request | None = None
        self._after_break = True
        self._newest: tuple[requests.Request, _State] | None = None
        # Of a move along the path of the axes: its end, in user units. The motors have no blend of their own then.
        self._axis_blend: Blend | None = None
        self._axes: Mapping[str, float] = run.positions if self._frame.solves else {}

    @property
    def target(self) -> Vector:
        """The last programmed point, counts."""
        return self._blend.target

    @property
    def _state(self) -> _State:
        return self._blend, self._pvt_velocity, self._spline, self._after_break, self._axis_blend, self._axes

    @_state.setter
    def _state(self, state: _State) -> None:
        self._blend, self._pvt_velocity, self._spline, self._after_break, self._axis_blend, self._axes = state

    def plan(self) -> PlannedPieces:
        """Calculate the next request and plan its motion. Raises PmacError: a run-time error of the program."""
        before = self._state
        self._newest = None
        try:
            request, self._ahead = self._ahead or self.run.advance(), None
            planned = self._lay(request)
            if self._frame.solves and isinstance(request, requests.MoveRequest):
                self._axes = request.targets
            self._newest = request, before
            return planned
        except PmacError:
            # Nothing of this request is played: what follows must join on to what has been played.
            self._state = before
            raise

    def take_back(self) -> bool:
        """Discard the motion planned last, and plan it again at the next call; False if that is impossible."""
        if self._newest is None or self._ahead is not None:
            return False
        self._ahead, self._state = self._newest
        self._newest = None
        return True

    def settle(self) -> tuple[Piece, ...]:
        """Bring the motion to rest at its programmed point; the next move begins as after a break.

        A PVT segment that does not end at rest ramps down at Ix15 after its point.

        Raises PmacError: TA and TS are both zero.
        """
        self._after_break = True
        if any(self._pvt_velocity or ()):
            return self.halt(self._frame.abort_rates())
        return self._rest()

    def halt(self, rates: Vector) -> tuple[Piece, ...]:
        """End the program: a blended or splined move ends at its target, a PVT motion ramps down.

        `rates` are Ix15 of the motors, counts/ms^2; the slowest motor sets the time, so that they stop together.
        """
        self._after_break = True
        velocity = self._pvt_velocity
        self._pvt_velocity = None
        if velocity is None or not any(velocity):
            return self._rest(SHORTEST_RAMP_MS)
        times = [abs(v) / rate if rate > 0.0 else 0.0 for v, rate in zip(velocity, rates, strict=True)]
        pieces = ramp(self.target, velocity, self._frame.still, max(times) or 1.0, 0.0, calculates=False)
        self._blend = at_rest(tuple(position_at(c, pieces[-1].duration_ms) for c in pieces[-1].cubics))
        return pieces

    def relocate(self, counts: Vector, definitions: tuple[AxisDefinition, ...] | None = None) -> None:
        """Continue from rest at `counts`: after a home search, or a motion commanded elsewhere.

        After a PSET the axes have other positions there: `definitions` gives them.
        """
        before = self._frame.positions(self.target)
        self._frame = MotorFrame(definitions or self._frame.definitions, self._variables, self._system)
        self._axes = self._frame.positions(counts)
        self._re_aim(before, self._axes)
        self._blend = at_rest(counts)
        self._pvt_velocity = self._spline = self._axis_blend = None
        self._after_break = True

    def _re_aim(self, before: Mapping[str, float], now: Mapping[str, float]) -> None:
        """Restart a move that was calculated but not yet planned from the present axis positions.

        Distances (INC) stay distances; what follows it in the program counts from its end.
        """
        ahead, self._newest = self._ahead, None
        if not isinstance(ahead, requests.MoveRequest):
            return
        shift = {axis: now[axis] - before[axis] for axis in now if axis not in ahead.absolute}
        targets = {axis: target + shift.get(axis, 0.0) for axis, target in ahead.targets.items()}
        self._ahead = replace(ahead, targets=targets)
        self.run.relocate(targets)

    def _lay(self, request: requests.Request) -> PlannedPieces:  # noqa: C901 - one branch a case
        match request:
            case requests.LinearRequest():
                return self._linear(request)
            case requests.PvtRequest():
                return self._pvt(request)
            case requests.SplineRequest():
                return self._spline_move(request)
            case requests.CircleRequest():
                return self._circle(request)
            case requests.RapidRequest():
                return self._rapid(request)
            case requests.DwellRequest():
                return self._dwell(request.duration_ms, request.deferred, self.settle())
            case requests.BlendBreak():
                return self._dwell(0.0)
            case requests.HomeRequest() | requests.PresetRequest() | requests.Halt():
                return self._dwell(0.0)._replace(event=request)
            case requests.TriggerRequest():
                return self._dwell(0.0, request.deferred)._replace(event=request)
            case requests.EndOfProgram():
                return PlannedPieces(pieces=self._rest(), finished=True)

    def _linear(self, request: requests.LinearRequest) -> PlannedPieces:
        if self._frame.along_axes:
            return self._along_axes(request)
        lead = self._lead_blended()
        target = self._frame.counts(request.targets, self.target, request.absolute)
        return self._blend_move(request, target, request.tm_ms, lead)

    def _along_axes(self, request: requests.LinearRequest | requests.CircleRequest) -> PlannedPieces:
        """Follow the path of the axes, through the inverse kinematics of each segment; it blends as theirs."""
        lead: tuple[Piece, ...] = ()
        start = tuple([self._axes[axis] for axis in AXIS_LETTERS])
        if self._axis_blend is None:
            lead = self._rest() + self._first_delay()
            self._axis_blend = at_rest(start)
        target = tuple([request.targets[axis] for axis in AXIS_LETTERS])
        distance = tuple([t - p for t, p in zip(target, start, strict=True)])
        arc, tm_ms = None, 0.0
        if isinstance(request, requests.LinearRequest):
            tm_ms = request.tm_ms
        elif request.center is None and request.radius is None:
            tm_ms = circle_time_ms(request, chord_length(request, self._axes))
        else:
            arc = self._frame.arc_by(AXES_ALONE, request, self._axes, start, target)
            tm_ms = circle_time_ms(request, arc.length)
        move = LinearMove(distance=distance, ta_ms=request.ta_ms, ts_ms=request.ts_ms, tm_ms=tm_ms)
        segment_ms = self._frame.segment_ms
        laid, self._axis_blend, timing = lay_course(self._axis_blend, move, arc, NO_LIMITS, segment_ms)
        pieces = through_inverse(laid, segment_ms, self._frame.solve)
        self._blend = at_rest(self._frame.solve(target))
        asked = timing_of(request.ta_ms, request.ts_ms, tm_ms)
        record = MoveRecord(line=request.line, target=self.target, asked=asked, timing=timing)
        return PlannedPieces(pieces=(*lead, *defer(pieces, request.deferred), *self._stop_pieces()), record=record)

    def _circle(self, request: requests.CircleRequest) -> PlannedPieces:
        if self._frame.along_axes:
            return self._along_axes(request)
        start = self._frame.positions(self.target)
        # Without segmentation, or without a centre, it is replaced by a straight move.
        straight = self._frame.segment_ms <= 0.0 or (request.center is None and request.radius is None)
        tm_ms = circle_time_ms(request, chord_length(request, start)) if straight else 0.0
        lead = self._lead_blended()
        target = self._frame.counts(request.targets, self.target, request.absolute)
        if straight:
            return self._blend_move(request, target, tm_ms, lead)
        arc = self._frame.arc(request, start, self.target, target)
        return self._blend_move(request, target, circle_time_ms(request, arc.length), lead, arc)

    def _blend_move(
        self,
        request: requests.LinearRequest | requests.CircleRequest,
        target: Vector,
        tm_ms: float,
        lead: tuple[Piece, ...],
        arc: Arc | None = None,
    ) -> PlannedPieces:
        ta_ms, ts_ms = request.ta_ms, request.ts_ms
        distance = tuple([place - self.target[at] for at, place in enumerate(target)])
        move = LinearMove(distance=distance, ta_ms=ta_ms, ts_ms=ts_ms, tm_ms=tm_ms)
        limits, segment_ms = self._frame.limits(), self._frame.segment_ms
        laid, self._blend, timing = lay_course(self._blend, move, arc, limits, segment_ms)
        asked = timing_of(ta_ms, ts_ms, tm_ms)
        record = MoveRecord(request.line, target, asked, timing)
        return PlannedPieces((*lead, *defer(laid, request.deferred), *self._stop_pieces()), record)

    def _rapid(self, request: requests.RapidRequest) -> PlannedPieces:
        """Jog, and calculate nothing until it is done; a RAPID of no distance takes an interrupt."""
        pieces = self._rest()
        start = self.target
        target = self._frame.counts(request.targets, start, request.absolute)
        settings = self._frame.rapid_settings()
        pieces += self._wait(self._frame.jog_delay_ms(request.moving))
        jog = rapid(start, target, settings) or self._wait(self._interrupt_ms())
        self._blend, self._after_break = at_rest(target), True
        record = plain_record(request.line, target, rapid_time_ms(start, target, settings))
        return PlannedPieces(pieces=(*pieces, *defer(jog, request.deferred)), record=record)

    def _pvt(self, request: requests.PvtRequest) -> PlannedPieces:
        lead = self._rest() + self._first_delay() if self._pvt_velocity is None else ()
        check_segment(request.duration_ms)
        start = self.target
        target, after = self._frame.moving(request.targets, request.velocities, start, request.absolute)
        before = self._pvt_velocity or self._frame.still
        laid = hermite(start, before, target, after, request.duration_ms)
        self._blend, self._pvt_velocity = at_rest(target), after
        pieces = defer((laid,), request.deferred)
        record = plain_record(request.line, target, request.duration_ms)
        return PlannedPieces((*lead, *pieces) if lead else pieces, record)

    def _spline_move(self, request: requests.SplineRequest) -> PlannedPieces:
        duration_ms = request.duration_ms
        check_segment(duration_ms)
        lead: tuple[Piece, ...] = ()
        if self._spline is None or not self._spline.goes_on(duration_ms, request.uniform):
            lead = self._rest() + self._first_delay()
            self._spline = begin(self.target, duration_ms, request.uniform)
        target = self._frame.counts(request.targets, self.target, request.absolute)
        next_ms = duration_ms if request.uniform else self._following_ms(duration_ms)
        laid, self._spline = add(self._spline, target, duration_ms, next_ms)
        self._blend = at_rest(target)
        record = plain_record(request.line, target, duration_ms)
        return PlannedPieces(pieces=(*lead, *defer((laid,), request.deferred)), record=record)

    def _following_ms(self, duration_ms: float) -> float:
        """Return the time of the following segment; after the last one, that of the last."""
        if self._ahead is None:
            self._ahead = self.run.advance()
        following = self._ahead
        if isinstance(following, requests.SplineRequest) and not following.uniform and following.duration_ms > 0.0:
            return following.duration_ms
        return duration_ms

    def _dwell(
        self,
        duration_ms: float,
        deferred: tuple[requests.DeferredValue, ...] = (),
        settled: tuple[Piece, ...] | None = None,
    ) -> PlannedPieces:
        """Wait at rest; `settled` are the pieces that have brought it to rest, by default those of `_rest`."""
        pieces = self._rest() if settled is None else settled
        self._after_break = True
        # At least one real-time interrupt, or a loop without moves would never let time advance.
        wait_ms = max(duration_ms, 0.0 if pieces and not deferred else self._interrupt_ms())
        waits = [wait._replace(real_time=True, deferred=deferred) for wait in self._wait(wait_ms)]
        return PlannedPieces(pieces=(*pieces, *waits))

    def _lead_blended(self) -> tuple[Piece, ...]:
        """End what a LINEAR or CIRCLE move cannot blend with, and wait before the first one (I11)."""
        lead: tuple[Piece, ...] = ()
        if self._pvt_velocity is not None or self._spline is not None or self._axis_blend is not None:
            lead = self._rest()
        return lead + self._first_delay() if self._after_break else lead

    def _first_delay(self) -> tuple[Piece, ...]:
        """Wait for I11 between a break and the first move after it, on the time base."""
        waits = self._after_break
        self._after_break = False
        return self._wait(self._variables.i(11)) if waits else ()

    def _wait(self, duration_ms: float) -> tuple[Piece, ...]:
        """Stand still at the target."""
        return (constant(self.target, self._frame.still, duration_ms),) if duration_ms > 0.0 else ()

    def _stop_pieces(self) -> tuple[Piece, ...]:
        """Ix92: stop after each move."""
        if not self._variables.system(self._system, 92):
            return ()
        self._after_break = True
        return self._rest()

    def _rest(self, least_ms: float = 0.0) -> tuple[Piece, ...]:
        """Come to rest, blended moves with the modal TA and TS; a PVT sequence ends as programmed."""
        ended, self._spline = self._spline, None
        if ended is not None:
            return end(ended)
        if self._axis_blend is not None:
            return self._rest_of_axes(self._axis_blend, least_ms)
        if self._pvt_velocity is not None:
            if any(self._pvt_velocity):
                raise PmacError(ErrorCode.DATA_ERROR, "a PVT sequence that does not end at rest")
            self._pvt_velocity = None
            return ()
        ta_ms = max(self._variables.blend_ms(self._system, 87), least_ms)
        ts_ms = self._variables.blend_ms(self._system, 88)
        pieces = stop_course(self._blend, ta_ms, ts_ms, self._frame.limits())
        self._blend = at_rest(self.target)
        return pieces

    def _rest_of_axes(self, blend: Blend, least_ms: float) -> tuple[Piece, ...]:
        self._axis_blend = None
        ta_ms = max(self._variables.blend_ms(self._system, 87), least_ms)
        pieces = stop_course(blend, ta_ms, self._variables.blend_ms(self._system, 88), NO_LIMITS)
        # A segmentation time that was switched off on the way ends with the move that began with it.
        return through_inverse(pieces, self._frame.segment_ms or SEGMENT_MS, self._frame.solve)

    def _interrupt_ms(self) -> float:
        return (self._variables.i(8) + 1.0) * servo_cycle_ms(self._variables.i(10))
