"""Measure the stops of a machine: control-A, control-K and watchdog timeout, from a jog and from an air cut.

Where stops have a connection of their own, they are sent while a query on the other one is still unanswered:
that is the purpose of such a connection, and each board must show that it works.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

from drivers.commissioning.check import Check, Group
from drivers.commissioning.proofs.air_cut import PROGRAM, SPINDLE_START, air_cut, air_cut_lines, lobe_ends
from drivers.commissioning.proofs.bench import REASON, ProofRig
from drivers.commissioning.proofs.guarded import TRIES, Guarded
from drivers.commissioning.proofs.stop_results import SeenStop, seen_speed, speed_of, stop_checks, stop_entries
from drivers.commissioning.reading import ask_or_none
from drivers.commissioning.stop_record import Origin, StopEntry, Way, needed_stops
from drivers.commissioning.stops import after_jog_stop, jog_settings_of
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.heartbeat import Heartbeat
from drivers.link.base import StopWay
from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED
from drivers.pmac.heartbeat.plc import Policy
from drivers.pmac.heartbeat.watch import LOOK_EVERY_S, Look, kept, rests, withhold
from drivers.pmac.heartbeat.watchdog import SERVO_PERIOD, SYSTEM
from drivers.pmac.language.text import format_number
from profiles.findings import Severity
from profiles.problem import Problem

QUESTION = "P0..99"
"""It changes nothing, and takes a controller longer to answer than a stop takes to arrive."""


def past_a_question(bench: ProofRig, press: Callable[[str], None]) -> bool:
    """Press; return whether the board kept its two connections apart. With one connection no query is pending.

    Raises:
        LinkError: the query could not be sent; nothing was pressed.
    """
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


AT_SPEED_S = 0.1
"""How long a motion continues at full speed before it is stopped."""

REST_LIMIT_S = {Way.ABORT: 15.0, Way.KILL: 60.0, Way.WATCHDOG: 15.0}
"""Timeout for rest; after a control-K the spindle coasts."""

ORDER = (Way.WATCHDOG, Way.ABORT, Way.KILL)
"""Watchdog first: it ends what does not obey a control character not yet tested on this controller."""

OBEY_LIMIT_S = 0.6
"""Timeout for a motion to obey; by then its watchdog, which still guards it, has expired."""

LEAST_SPEED = 0.75
"""Fraction of its speed at which a motion counts as being at speed, from two polls over a slow line."""

LOOKS_FOR_SPEED = 5
"""Polls to reach speed: a delayed host or controller gets a little longer."""

RUNNING_OUT_S, SELDOM_S = 1.0, 0.02
"""What still moves after this time is polled less often."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredStops:
    """The measured stops: the entries of a record, and the checks."""

    entries: tuple[StopEntry, ...] = ()
    checks: tuple[Check, ...] = ()


def prove_stops(bench: ProofRig) -> MeasuredStops:
    """Load the heartbeat, home, and stop the machine in every way it has, until one fails.

    The drives are killed at the beginning. At the end the loops may be closed; the heartbeat stays on the
    controller.

    Raises:
        DriverError: somebody has stopped, an axis does not arrive, the link broke.
    """
    heartbeat = Heartbeat(bench.client, bench.clock, bench.judged.machine)
    try:
        heartbeat.prepare()
    except RefusedError as refused:
        found = "; ".join(problem.facts for problem in refused.problems)
        failed = Check(group=Group.PROOFS, code="proof_lease", severity=Severity.REFUSAL, found=found, wanted="-")
        return MeasuredStops(checks=(failed,))
    (i10,) = bench.client.numbers(f"I{SERVO_PERIOD}", again=True)
    axes = Guarded(bench=bench, i10=i10)
    axes.close()
    axes.home()
    loaded = _load(bench, axes)
    try:
        return _all(bench, axes, (Origin.JOG, Origin.CUT) if loaded else (Origin.JOG,))
    finally:
        if loaded:
            _unload(bench)


def _all(bench: ProofRig, axes: Guarded, origins: tuple[Origin, ...]) -> MeasuredStops:
    needed = {(way, origin) for way, origin, _ in needed_stops(bench.judged.machine)}
    entries: list[StopEntry] = []
    checks: list[Check] = []
    for way, origin in ((way, origin) for origin in origins for way in ORDER if (way, origin) in needed):
        seen = _measured(bench, axes, way, origin)
        checks += stop_checks(bench.judged, seen)
        if any(check.severity is Severity.REFUSAL for check in checks):
            break
        entries += stop_entries(bench.judged, seen)
        axes.close()
        axes.back()
    return MeasuredStops(entries=tuple(entries), checks=tuple(checks))


def _load(bench: ProofRig, axes: Guarded) -> bool:
    """Enter the air cut, unless somebody else's program is there; return whether it was entered."""
    if ask_or_none(bench.client, f"LIST PROG{PROGRAM}"):
        return False
    policy = Policy(bench.judged.machine.heartbeat.policy)
    bench.client.download(air_cut_lines(bench.judged, policy, axes.begin("tool"), axes.begin("carriage")))
    return True


def _unload(bench: ProofRig) -> None:
    with suppress(DriverError):  # after a stop the program may not have ended yet
        bench.give_back(f"OPEN PROG{PROGRAM}", "CLEAR", "CLOSE")


def _measured(bench: ProofRig, axes: Guarded, way: Way, origin: Origin) -> SeenStop:
    """Move, stop and record; repeat when this host was delayed and the controller ended the motion before.

    Raises:
        DriverError: `heartbeat.lapsed`, this host is too slow; somebody has stopped; the link broke.
    """
    for _ in range(TRIES):
        line, kept_s = _begin(bench, axes, origin)
        bench.move(line)
        before, at_speed = _at_speed(bench, axes, origin, kept_s)
        if not before.lost:
            seen = _silence(bench, axes, before) if way is Way.WATCHDOG else _press(bench, axes, way, before)
            lobe = lobe_ends(bench.judged.machine, axes.begin("tool")) if origin is Origin.CUT else None
            return replace(seen, origin=origin, lobe=lobe, as_meant=seen.as_meant and at_speed)
        _until_rest(axes, (before,), REST_LIMIT_S[Way.WATCHDOG])
        bench.tell(f"{NOTHING_GUARDED} {LOSS_SEEN}")
        axes.close()
        axes.back()
    bench.stop.stop(REASON)
    raise DriverError(Problem(code="heartbeat.lapsed", where=bench.client.link.address))


def _begin(bench: ProofRig, axes: Guarded, origin: Origin) -> tuple[str, float]:
    """Return the line that begins a motion, and how long it is kept up, s."""
    machine, keeper = bench.judged.machine, axes.keeper
    if origin is Origin.JOG:
        ramps = (after_jog_stop(jog_settings_of(bench.judged, axis), 0.0).time_ms for axis in axes.axes)
        jogs = "".join(f"#{axis.motor}J{'+' if axes.inwards(axis) > 0 else '-'}" for axis in axes.axes)
        return f"{keeper.jog_line()} {jogs}", max(ramps) / 1000.0 + AT_SPEED_S
    spindle = 0.0 if machine.spindle.followed else bench.position(machine.spindle.motor)
    # Address the system first: after a value, & would be the operator of the expression.
    line = f"&{SYSTEM} {keeper.cut_line(axes.starts['tool'], machine.heartbeat.grace_ms)}"
    start = f"{SPINDLE_START}={format_number(spindle)} B{PROGRAM}R"
    return f"{line} {start}", air_cut(machine).full_speed_s + AT_SPEED_S


def _at_speed(bench: ProofRig, axes: Guarded, origin: Origin, kept_s: float) -> tuple[Look, bool]:
    """Keep a motion up until it is seen at speed; return the last poll, and whether it was."""
    for _ in range(LOOKS_FOR_SPEED):
        looks = kept(axes.watch, axes.keeper, kept_s, bench.stop.check)
        at_speed = all(
            seen_speed(axis, *looks) >= LEAST_SPEED * speed_of(bench.judged, axis, origin)
            for axis in axes.axes
            if origin is Origin.JOG or axis.name != "tool"  # in a cut it oscillates
        )
        if at_speed or looks[-1].lost:
            break
        kept_s = AT_SPEED_S
    return looks[-1], at_speed


def _silence(bench: ProofRig, axes: Guarded, before: Look) -> SeenStop:
    found = withhold(axes.watch, before, bench.stop.stop, REST_LIMIT_S[Way.WATCHDOG])
    bench.moving = found.at_rest_s is None
    return SeenStop(
        way=Way.WATCHDOG,
        pressed_s=before.asked_s,
        late_ms=0.0,
        looks=found.looks,
        as_meant=found.at_rest_s is not None,
        watchdog=found,
    )


def _press(bench: ProofRig, axes: Guarded, way: Way, before: Look) -> SeenStop:
    """Stop by a control character, and release that stop at rest; anybody else's stop stays in force."""
    stop = bench.stop
    earlier = stop.mark or 0
    stop.check()
    # A control-A would close a loop that has opened meanwhile; without this it is a control-K.
    stop.loops_closed = all(
        "amplifier_enabled" in flags and "open_loop" not in flags for flags in before.flags.values()
    )
    pressed_s = bench.clock.now_s()
    answered = past_a_question(bench, stop.stop if way is Way.ABORT else stop.kill)
    looks, obeyed = _until_obeyed(axes, way, before)
    if obeyed:
        bench.client.request(NOTHING_GUARDED)  # not before: what does not obey is ended by its watchdog
    looks = _until_rest(axes, looks, REST_LIMIT_S[way])
    killed, rested = stop.killed, rests(looks)
    if rested and obeyed:
        stop.rest_proven(earlier + 1)
        with suppress(RefusedError):
            stop.release()
        stop.check()  # what was not released is somebody else's stop
    return SeenStop(
        way=way,
        pressed_s=pressed_s,
        late_ms=(pressed_s - before.asked_s) * 1000.0,
        looks=looks,
        as_meant=answered and obeyed and rested and killed == (way is Way.KILL),
    )


def _until_obeyed(axes: Guarded, way: Way, before: Look) -> tuple[tuple[Look, ...], bool]:
    """Poll until every motor obeys the stop; return the polls, and whether all motors did."""
    wanted = {"open_loop"} if way is Way.KILL else {"abort_deceleration", "desired_velocity_zero"}
    watch, looks = axes.watch, [before]
    end_s = watch.clock.now_s() + OBEY_LIMIT_S
    while watch.clock.now_s() < end_s:
        looks.append(watch.look())
        if looks[-1].lost:
            break
        if all(wanted & flags for flags in looks[-1].flags.values()):
            return tuple(looks), True
        watch.clock.wait(LOOK_EVERY_S)
    return tuple(looks), False


def _until_rest(axes: Guarded, before: tuple[Look, ...], limit_s: float) -> tuple[Look, ...]:
    watch, looks = axes.watch, list(before)
    began_s = watch.clock.now_s()
    while not rests(looks) and (passed_s := watch.clock.now_s() - began_s) < limit_s:
        watch.clock.wait(LOOK_EVERY_S if passed_s < RUNNING_OUT_S else SELDOM_S)
        looks.append(watch.look())
    axes.bench.moving = not rests(looks)
    return tuple(looks)
