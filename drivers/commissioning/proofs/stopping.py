"""Measure the stops of a machine: control-A, control-K and watchdog timeout, from a jog and from an air cut.

Where stops have a connection of their own, they are sent while a query on the other one is still unanswered:
that is the purpose of such a connection, and each board must show that it works.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace

from drivers.commissioning.check import Check, Group
from drivers.commissioning.checked_configuration import CheckedConfiguration, JudgedAxis, digits, length
from drivers.commissioning.proofs.air_cut import (
    PROGRAM,
    SPINDLE_START,
    AxisStart,
    air_cut,
    air_cut_lines,
    lobe_ends,
)
from drivers.commissioning.proofs.bench import REASON, ProofRig, proof, stop_name
from drivers.commissioning.reading import holds_another
from drivers.commissioning.stop_record import PriorMotion, StopEntry, StopMethod, needed_stops
from drivers.commissioning.verification import after_abort, after_jog_stop, jog_settings_of
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.motion import LINK_LATENCY_MS
from drivers.link.base import StopWay
from drivers.pmac.analysis.units import unit_of
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.heartbeat.watch import (
    LOOK_EVERY_S,
    LOSS_SEEN,
    NOTHING_GUARDED,
    Keeper,
    MotorPoll,
    MotorWatch,
    WatchdogProof,
    keep_watchdog,
    proof_problems,
    rest_s,
    rests,
    withhold,
)
from drivers.pmac.heartbeat.watchdog import PERIOD_MS, SERVO_PERIOD, SYSTEM, WATCHDOG_MS
from drivers.pmac.language.text import format_number
from profiles.findings import Severity
from profiles.problem import Problem

MOVED_COUNTS = 1.0  # an axis that moves less than this after a stop was not moving before
QUESTION = "P0..99"  # it changes nothing, and takes a controller longer to answer than a stop takes to arrive

AT_SPEED_S = 0.1  # how long a motion continues at full speed before it is stopped
REST_LIMIT_S = {
    StopMethod.ABORT: 15.0,
    StopMethod.KILL: 60.0,
    StopMethod.WATCHDOG: 15.0,
}  # after a control-K the spindle coasts
ORDER = (
    StopMethod.WATCHDOG,
    StopMethod.ABORT,
    StopMethod.KILL,
)  # watchdog first: it ends what does not obey a control character
OBEY_LIMIT_S = 0.6  # timeout for a motion to obey; by then its watchdog, which still guards it, has expired
LEAST_SPEED = 0.75  # fraction of its speed at which a motion is at speed, from two polls over a slow line
POLLS_FOR_SPEED = 5  # polls to reach speed: a delayed host or controller gets a little longer
RUNNING_OUT_S, SELDOM_S = 1.0, 0.02  # what still moves after this time is polled less often
TIMEOUT_S = 60.0
TRIES = 3  # a delayed host finds its motion ended by the controller, and begins it anew this often at most
HOMING_ORDER = ("tool", "carriage", "spindle")


@dataclass(frozen=True, slots=True)
class SeenStop:
    """The polls from just before a stop up to rest.

    `pressed_s` is when it, or the last watchdog renewal, was sent; `late_ms` is how old the first poll was
    then. `as_meant` is whether all came to rest by the intended stop. `lobe` are the two ends of the tool's
    lobe in a cut, counts: between two polls it oscillates, so its distance is counted from the further end.
    """

    way: StopMethod
    pressed_s: float
    late_ms: float
    polls: tuple[MotorPoll, ...]
    _: KW_ONLY
    as_meant: bool
    origin: PriorMotion = PriorMotion.JOG
    lobe: tuple[float, float] | None = None
    watchdog: WatchdogProof | None = None

    def counts(self, axis: JudgedAxis) -> float:
        """Return how far an axis travelled from its position before the stop."""
        if axis.name == "tool" and self.lobe is not None:
            rest = self.polls[-1].positions[axis.motor]
            return max(abs(rest - end) for end in self.lobe)
        begun = self.polls[0].positions[axis.motor]
        return max(abs(look.positions[axis.motor] - begun) for look in self.polls)

    def time_s(self, axis: JudgedAxis) -> float:
        """Return the time to rest, infinite when it did not come to rest."""
        found = rest_s(self.polls, axis.motor)
        return math.inf if found is None else found - self.pressed_s


def stop_entries(judged: CheckedConfiguration, seen: SeenStop) -> tuple[StopEntry, ...]:
    """Return the record entries of a correct stop."""
    return tuple(_entry(judged, axis, seen) for axis in judged.driven_axes)


def stop_checks(judged: CheckedConfiguration, seen: SeenStop) -> Iterator[Check]:
    """Check stopping distances against the computed ones; for the first watchdog timeout, also its delay."""
    if seen.watchdog is not None and seen.origin is PriorMotion.JOG:
        ended = "-" if seen.watchdog.ended_s is None else f"{digits(seen.watchdog.ended_s)} s"
        holds = not proof_problems(seen.watchdog)
        yield proof("heartbeat", holds=holds, found=ended, wanted=f"<= {WATCHDOG_MS / 1000.0:g} s")
    machine, found, wanted, holds = judged.machine, [], [], seen.as_meant
    for axis in judged.driven_axes:
        counts = seen.counts(axis)
        bound = _bound_counts(judged, axis, seen.way, seen.origin, seen.late_ms)
        time = "∞" if math.isinf(seen.time_s(axis)) else digits(seen.time_s(axis))
        found.append(f"{axis.name} {length(counts, axis.motor, machine)} {time} s")
        if math.isfinite(bound):
            wanted.append(f"{axis.name} <= {length(bound, axis.motor, machine)}")
        holds = holds and MOVED_COUNTS < counts <= bound
    name = stop_name(seen.way, seen.origin)
    yield proof(name, holds=holds, found=", ".join(found), wanted=", ".join(wanted) or "-")


def _bound_counts(
    judged: CheckedConfiguration, axis: JudgedAxis, way: StopMethod, origin: PriorMotion, late_ms: float
) -> float:
    """Return the longest stopping distance, counts, infinite where settings do not determine it.

    `late_ms` is the age of the poll from which the distance is counted, when the stop was sent. Coasting after
    a control-K, and the end of a cut without a host, are only measured.
    """
    late_ms += judged.machine.controller.background_ms + LINK_LATENCY_MS
    match way, origin:
        case StopMethod.ABORT, PriorMotion.JOG:
            return after_abort(jog_settings_of(judged, axis).speed, judged.of_motor(axis, 15), late_ms).counts
        case StopMethod.ABORT, PriorMotion.CUT if axis.name == "tool":
            # From one end of its lobe to the other, and the stop.
            cut = air_cut(judged.machine)
            return 2.0 * cut.amplitude + after_abort(cut.tool, judged.of_motor(axis, 15), 0.0).counts
        case StopMethod.ABORT, PriorMotion.CUT:
            return after_abort(speed_of(judged, axis, origin), judged.of_motor(axis, 15), late_ms).counts
        case StopMethod.WATCHDOG, PriorMotion.JOG:
            return after_jog_stop(jog_settings_of(judged, axis), WATCHDOG_MS + late_ms).counts
        case _:
            return math.inf


def _entry(judged: CheckedConfiguration, axis: JudgedAxis, seen: SeenStop) -> StopEntry:
    unit = unit_of(judged.machine, axis.motor)
    assert unit is not None  # every axis of the machine has one
    distance, speed = seen.counts(axis) * unit.per_count, speed_of(judged, axis, seen.origin) * unit.velocity
    linear = unit.name == "mm"
    return StopEntry(
        way=seen.way,
        origin=seen.origin,
        axis=axis.name,
        time_s=seen.time_s(axis),
        distance_mm=distance if linear else None,
        distance_deg=None if linear else distance,
        speed_mm_per_s=speed if linear else None,
        speed_rpm=None if linear else speed,
    )


def seen_speed(axis: JudgedAxis, earlier: MotorPoll, later: MotorPoll) -> float:
    """Return the speed between two polls, counts/ms."""
    passed_ms = (later.answered_s - earlier.answered_s) * 1000.0
    return abs(later.positions[axis.motor] - earlier.positions[axis.motor]) / passed_ms


def speed_of(judged: CheckedConfiguration, axis: JudgedAxis, origin: PriorMotion) -> float:
    """Return the speed before the stop, counts/ms; for the tool in a cut, the maximum of its lobe."""
    if origin is PriorMotion.CUT:
        return air_cut(judged.machine).speeds[axis.name]
    return jog_settings_of(judged, axis).speed


def _past_a_question(bench: ProofRig, press: Callable[[str], None]) -> bool:
    """Press; return whether the board kept its two connections apart. With one connection no query is pending."""
    if bench.stop.way is not StopWay.RESERVED:
        press(REASON)
        return bench.stop.way is StopWay.DIRECT
    bench.client.send(QUESTION)
    press(REASON)
    try:
        bench.client.reply(QUESTION)
    except LinkError:
        return False  # the stop was sent; whether it was obeyed is checked, back in step
    return True


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredStops:
    """The checks, and the entries of a record."""

    checks: tuple[Check, ...] = ()
    entries: tuple[StopEntry, ...] = ()


@dataclass(kw_only=True)
class GuardedAxes:
    """The driven axes of a controller whose heartbeat is in order. `starts` is where they were homed, counts.

    Every method that moves raises `DriverError`: `machine.timeout`, somebody has stopped, or the link broke.
    """

    bench: ProofRig
    i10: float
    starts: dict[str, float] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[JudgedAxis, ...]:
        """The axes that the controller moves."""
        return self.bench.judged.driven_axes

    @property
    def watch(self) -> MotorWatch:
        """The monitor of all their motors."""
        bench = self.bench
        motors = tuple(axis.motor for axis in self.axes)
        return MotorWatch(bench.client, bench.clock, bench.dialect, motors, bench.see_owner)

    @property
    def keeper(self) -> Keeper:
        """The watchdog lines."""
        return Keeper(dialect=self.bench.dialect, i10=self.i10)

    def inwards(self, axis: JudgedAxis) -> int:
        """Return the direction away from the home end, +1 or -1: the free travel."""
        return -1 if self.bench.judged.of_motor(axis, 23) > 0.0 and axis.name != "spindle" else 1

    def begin(self, name: str) -> AxisStart:
        """Return where an axis was homed, and the direction of free travel."""
        axis = next(each for each in self.axes if each.name == name)
        return AxisStart(self.starts[name], self.inwards(axis))

    def close(self) -> None:
        """Close every loop at its present position."""
        for axis in self.axes:
            self.bench.move(f"#{axis.motor}J/")
        self.bench.settle()
        self.bench.moving = False

    def home(self) -> None:
        """Home each axis, the tool first, so that it is retracted when another one moves."""
        for axis in sorted(self.axes, key=lambda axis: HOMING_ORDER.index(axis.name)):
            self.starts[axis.name] = self._home_axis(axis)

    def back(self) -> None:
        """Return tool and carriage to their home positions, the tool first."""
        for axis in self.axes:
            if axis.name != "spindle":
                self._go(f"#{axis.motor}J={format_number(self.starts[axis.name])}", axis, lambda _: True)

    def _home_axis(self, axis: JudgedAxis) -> float:
        def done(look: MotorPoll) -> bool:
            flags = look.flags[axis.motor]
            return "home_complete" in flags and "home_search" not in flags

        look = self._go(f"#{axis.motor}HM", axis, done)
        return float(round(look.positions[axis.motor]))

    def _go(self, line: str, axis: JudgedAxis, done: Callable[[MotorPoll], bool]) -> MotorPoll:
        for _ in range(TRIES):
            look = self._move_once(line, axis, done)
            if look is not None:
                return look
        raise self._timeout(axis)

    def _move_once(self, line: str, axis: JudgedAxis, done: Callable[[MotorPoll], bool]) -> MotorPoll | None:
        """Move, and renew the watchdog until done; None when the controller has ended the motion."""
        bench, watch, keeper = self.bench, self.watch, self.keeper
        polls: list[MotorPoll] = []
        end_s = bench.clock.now_s() + TIMEOUT_S
        bench.move(f"{keeper.jog_line()} {line}")
        while not (polls and (polls[-1].lost or (rests(polls) and done(polls[-1])))):
            bench.clock.wait(PERIOD_MS / 1000.0)
            bench.stop.check()
            watch.renew(keeper)
            polls.append(watch.look())
            if bench.clock.now_s() > end_s:
                raise self._timeout(axis)
        watch.client.request(f"{NOTHING_GUARDED} {LOSS_SEEN}")
        bench.moving = polls[-1].lost  # ended by the controller, it may not rest yet
        return None if polls[-1].lost else polls[-1]

    def _timeout(self, axis: JudgedAxis) -> DriverError:
        self.bench.stop.stop(REASON)
        return DriverError(Problem(code="machine.timeout", key=axis.name, value=f"{TIMEOUT_S:g} s"))


def prove_stops(bench: ProofRig) -> MeasuredStops:
    """Load the heartbeat, home, and stop the machine in every way it has, until one fails.

    The drives are killed at the beginning. At the end the loops may be closed; the heartbeat stays on the
    controller. Raises DriverError: somebody has stopped, an axis does not arrive, the link broke.
    """
    heartbeat = Heartbeat(bench.client, bench.clock, bench.judged.machine)
    try:
        heartbeat.prepare()
    except RefusedError as refused:
        found = "; ".join(problem.facts for problem in refused.problems)
        failed = Check(Group.PROOFS, "proof_heartbeat", Severity.REFUSAL, found=found, wanted="-")
        return MeasuredStops(checks=(failed,))
    (i10,) = bench.client.numbers(f"I{SERVO_PERIOD}", again=True)
    axes = GuardedAxes(bench=bench, i10=i10)
    axes.close()
    axes.home()
    loaded = _load(bench, axes)
    try:
        return _measure_stops(bench, axes, (PriorMotion.JOG, PriorMotion.CUT) if loaded else (PriorMotion.JOG,))
    finally:
        if loaded:
            with suppress(DriverError):  # after a stop the program may not have ended yet
                bench.give_back(f"OPEN PROG{PROGRAM}", "CLEAR", "CLOSE")


def _measure_stops(bench: ProofRig, axes: GuardedAxes, origins: tuple[PriorMotion, ...]) -> MeasuredStops:
    needed = {(way, origin) for way, origin, _ in needed_stops(bench.judged.machine)}
    entries: list[StopEntry] = []
    checks: list[Check] = []
    for way, origin in ((way, origin) for origin in origins for way in ORDER if (way, origin) in needed):
        seen = _measure_stop(bench, axes, way, origin)
        checks += stop_checks(bench.judged, seen)
        if any(check.severity is Severity.REFUSAL for check in checks):
            break
        entries += stop_entries(bench.judged, seen)
        axes.close()
        axes.back()
    return MeasuredStops(entries=tuple(entries), checks=tuple(checks))


def _load(bench: ProofRig, axes: GuardedAxes) -> bool:
    """Enter the air cut, unless somebody else's program is there; return whether it was entered."""
    if holds_another(bench.client, PROGRAM):
        return False
    policy = Policy(bench.judged.machine.heartbeat.policy)
    bench.client.download(air_cut_lines(bench.judged, policy, axes.begin("tool"), axes.begin("carriage")))
    return True


def _measure_stop(bench: ProofRig, axes: GuardedAxes, way: StopMethod, origin: PriorMotion) -> SeenStop:
    """Move, stop and record; repeat when this host was delayed and the controller ended the motion before."""
    for _ in range(TRIES):
        line, kept_s = _begin(bench, axes, origin)
        bench.move(line)
        before, at_speed = _at_speed(bench, axes, origin, kept_s)
        if not before.lost:
            seen = (
                _silence(bench, axes, before) if way is StopMethod.WATCHDOG else _press(bench, axes, way, before)
            )
            lobe = lobe_ends(bench.judged.machine, axes.begin("tool")) if origin is PriorMotion.CUT else None
            return replace(seen, origin=origin, lobe=lobe, as_meant=seen.as_meant and at_speed)
        _until_rest(axes, (before,), REST_LIMIT_S[StopMethod.WATCHDOG])
        bench.tell(f"{NOTHING_GUARDED} {LOSS_SEEN}")
        axes.close()
        axes.back()
    bench.stop.stop(REASON)
    raise DriverError(Problem(code="heartbeat.lapsed", where=bench.client.link.address))


def _begin(bench: ProofRig, axes: GuardedAxes, origin: PriorMotion) -> tuple[str, float]:
    """Return the line that begins a motion, and how long it is kept up, s."""
    machine, keeper = bench.judged.machine, axes.keeper
    if origin is PriorMotion.JOG:
        ramps = (after_jog_stop(jog_settings_of(bench.judged, axis), 0.0).time_ms for axis in axes.axes)
        jogs = "".join(f"#{axis.motor}J{'+' if axes.inwards(axis) > 0 else '-'}" for axis in axes.axes)
        return f"{keeper.jog_line()} {jogs}", max(ramps) / 1000.0 + AT_SPEED_S
    spindle = 0.0 if machine.spindle.followed else bench.position(machine.spindle.motor)
    # Address the system first: after a value, & would be the operator of the expression.
    line = f"&{SYSTEM} {keeper.cut_line(axes.starts['tool'], machine.heartbeat.grace_ms)}"
    start = f"{SPINDLE_START}={format_number(spindle)} B{PROGRAM}R"
    return f"{line} {start}", air_cut(machine).full_speed_s + AT_SPEED_S


def _at_speed(bench: ProofRig, axes: GuardedAxes, origin: PriorMotion, kept_s: float) -> tuple[MotorPoll, bool]:
    """Keep a motion up until it is seen at speed; return the last poll, and whether it was."""
    for _ in range(POLLS_FOR_SPEED):
        polls = keep_watchdog(axes.watch, axes.keeper, kept_s, bench.stop.check)
        at_speed = all(
            seen_speed(axis, *polls) >= LEAST_SPEED * speed_of(bench.judged, axis, origin)
            for axis in axes.axes
            if origin is PriorMotion.JOG or axis.name != "tool"  # in a cut it oscillates
        )
        if at_speed or polls[-1].lost:
            break
        kept_s = AT_SPEED_S
    return polls[-1], at_speed


def _silence(bench: ProofRig, axes: GuardedAxes, before: MotorPoll) -> SeenStop:
    found = withhold(axes.watch, before, bench.stop.stop, REST_LIMIT_S[StopMethod.WATCHDOG])
    rested = found.at_rest_s is not None
    bench.moving = not rested
    return SeenStop(StopMethod.WATCHDOG, before.asked_s, 0.0, found.looks, as_meant=rested, watchdog=found)


def _press(bench: ProofRig, axes: GuardedAxes, way: StopMethod, before: MotorPoll) -> SeenStop:
    """Stop by a control character, and release that stop at rest; anybody else's stop stays in force."""
    stop = bench.stop
    earlier = stop.mark or 0
    stop.check()
    # A control-A would close a loop that has opened meanwhile; without this it is a control-K.
    stop.loops_closed = all(
        "amplifier_enabled" in flags and "open_loop" not in flags for flags in before.flags.values()
    )
    pressed_s = bench.clock.now_s()
    answered = _past_a_question(bench, stop.stop if way is StopMethod.ABORT else stop.kill)
    polls, obeyed = _until_obeyed(axes, way, before)
    if obeyed:
        bench.client.request(NOTHING_GUARDED)  # not before: what does not obey is ended by its watchdog
    polls = _until_rest(axes, polls, REST_LIMIT_S[way])
    killed, rested = stop.killed, rests(polls)
    if rested and obeyed:
        stop.rest_proven(earlier + 1)
        with suppress(RefusedError):
            stop.release()
        stop.check()  # what was not released is somebody else's stop
    as_meant = answered and obeyed and rested and killed == (way is StopMethod.KILL)
    return SeenStop(way, pressed_s, (pressed_s - before.asked_s) * 1000.0, polls, as_meant=as_meant)


def _until_obeyed(axes: GuardedAxes, way: StopMethod, before: MotorPoll) -> tuple[tuple[MotorPoll, ...], bool]:
    wanted = {"open_loop"} if way is StopMethod.KILL else {"abort_deceleration", "desired_velocity_zero"}
    watch, polls = axes.watch, [before]
    end_s = watch.clock.now_s() + OBEY_LIMIT_S
    while watch.clock.now_s() < end_s:
        polls.append(watch.look())
        if polls[-1].lost:
            break
        if all(wanted & flags for flags in polls[-1].flags.values()):
            return tuple(polls), True
        watch.clock.wait(LOOK_EVERY_S)
    return tuple(polls), False


def _until_rest(axes: GuardedAxes, before: tuple[MotorPoll, ...], limit_s: float) -> tuple[MotorPoll, ...]:
    watch, polls = axes.watch, list(before)
    began_s = watch.clock.now_s()
    while not rests(polls) and (passed_s := watch.clock.now_s() - began_s) < limit_s:
        watch.clock.wait(LOOK_EVERY_S if passed_s < RUNNING_OUT_S else SELDOM_S)
        polls.append(watch.look())
    axes.bench.moving = not rests(polls)
    return tuple(polls)
