"""Poll motors that are coming to rest, and test the watchdog: without renewals a motion must end in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from drivers.clock import Clock
from drivers.controller import Controller
from drivers.errors import out_of_step
from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.heartbeat import watchdog
from drivers.pmac.heartbeat.arming import silent
from drivers.pmac.heartbeat.plc import GRACE_MS, RUN_DOWN_MS
from drivers.pmac.heartbeat.watchdog import (
    ENDING,
    PERIOD_MS,
    SYSTEM,
    WATCHDOG_MS,
    GuardedActivity,
    cycles_of,
    watchdog_line,
)
from drivers.pmac.language.text import format_number
from drivers.pmac.status import decode
from profiles.problem import Problem

LOOK_EVERY_S = 0.01
POLLS_AT_REST = 3
REST_BAND_COUNTS = 2.0
"""Number of polls in a row that make rest, and the permitted movement between them: an encoder dithers by one."""

GIVE_UP_S = 0.6  # What has not ended after twice the specified time is stopped in another way
REST_LIMIT_S = 5.0  # How long to poll until rest

Flags = frozenset[str]
NOTHING_GUARDED = f"P{reserved.ACTIVITY}={GuardedActivity.NOTHING:d}"
"""Reports that the guarded motion has ended; the watchdog may run out then."""

LOSS_SEEN = f"P{reserved.LOST}=0"  # Clears the loss flag, once an operator has seen it
PERIOD_S = 0.1  # Time between two queries of the echo: they are sent with a renewal
TIMEOUT_S = 0.3  # How long the PLC may stay at one number: three scans of a busy controller


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorPoll:
    """One poll, between two times of the host.

    `lost` is whether the controller has ended something without a host, `ending` whether it is still about to.
    """

    asked_s: float
    answered_s: float
    lost: bool
    ending: bool
    running: bool
    positions: Mapping[int, float]
    flags: Mapping[int, Flags]

    def still(self, motor: int) -> bool:
        """Whether a motor is commanded to stand still with no move left, or is not commanded at all."""
        flags = self.flags[motor]
        return "open_loop" in flags or ("desired_velocity_zero" in flags and "move_timer_active" not in flags)


@dataclass(frozen=True, slots=True, kw_only=True)
class Keeper:
    """The watchdog of a controller whose I10 is `i10`; `renewed_at_s`: time of the last renewal, host's time."""

    dialect: Dialect
    i10: float
    renewed_at_s: float | None = None

    @property
    def line(self) -> str:
        """The line that renews the watchdog."""
        return watchdog_line(self.dialect, self.i10)

    def due_s(self, now_s: float) -> float:
        """Return when the next renewal is to be sent."""
        return now_s if self.renewed_at_s is None else self.renewed_at_s + PERIOD_MS / 1000.0

    def has_lapsed(self, now_s: float) -> bool:
        """Whether the watchdog has timed out: what it guarded was ended, and a renewal does not revive it.

        A host that finds this, after a stall of its own, reads the state of the machine instead of renewing.
        """
        return self.renewed_at_s is None or now_s - self.renewed_at_s >= WATCHDOG_MS / 1000.0

    def record_renewal(self, now_s: float) -> Keeper:
        """Record that `line`, or a line that begins with a renewal, is being sent now."""
        return replace(self, renewed_at_s=now_s)

    def jog_line(self) -> str:
        """Return the commands that precede a jog or a home search, on its line."""
        return f"{self.line} P{reserved.ACTIVITY}={GuardedActivity.JOG:d}"

    def cut_line(self, retracted_counts: float, grace_ms: float = GRACE_MS) -> str:
        """Return the commands that precede the start of a cut, on its line.

        `retracted_counts` is the tool position clear of the part. `grace_ms` is the time the program may need to
        get it there, to the end of a turn and out; after that it has `RUN_DOWN_MS`.
        """
        values = {
            reserved.RETRACTED: format_number(retracted_counts),
            watchdog.GRACE: cycles_of(grace_ms, self.i10),
            watchdog.RUN_DOWN: cycles_of(RUN_DOWN_MS, self.i10),
        }
        settings = " ".join(f"P{number}={value}" for number, value in values.items())
        return f"{settings} {self.line} P{reserved.ACTIVITY}={GuardedActivity.CUT:d}"


@dataclass(slots=True, kw_only=True)
class EchoWatch:
    """The echo as seen during one motion. `due_s` is the time of the next query, host's time.

    `problem` is that of a PLC that has stopped, so that it guards nothing any more; None if there is none.
    """

    due_s: float = float("-inf")
    problem: Problem | None = None
    _counted: float | None = None
    _since_s: float = 0.0

    def record_query(self, now_s: float) -> None:
        """Record that a query is sent now."""
        self.due_s = now_s + PERIOD_S

    def see(self, echo: float, asked_s: float) -> None:
        """Process the reply to the query that was sent at `asked_s`."""
        if echo != self._counted:
            self._counted, self._since_s, self.problem = echo, asked_s, None
        elif asked_s - self._since_s > TIMEOUT_S:
            self.problem = silent(echo, echo)


class MotorWatch:
    """Polls some motors, their program, the loss flag of the PLC and the owner in one request."""

    def __init__(
        self,
        client: Controller,
        clock: Clock,
        dialect: Dialect,
        motors: tuple[int, ...],
        owner_seen: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Take `owner_seen`, called in each poll with the console in control; what it raises ends the watch."""
        self.client, self.clock, self.motors = client, clock, motors
        self._dialect, self._owner_seen = dialect, owner_seen

    def renew(self, keeper: Keeper) -> None:
        """Renew the watchdog of what moves.

        Raises DriverError: that of `owner_seen`; the link broke, or replies something that was not asked for.
        """
        (owner,) = self.client.request(f"{keeper.line} P{reserved.OWNER}", lines=1)
        self._owner_seen(self.client.number(owner))

    def look(self) -> MotorPoll:
        """Poll once; raises as `renew` does."""
        asked_s = self.clock.now_s()
        of_motors = [item for motor in self.motors for item in (f"#{motor}P", "?")]
        words = (f"P{reserved.OWNER}", f"P{reserved.LOST}", f"P{ENDING}")
        owner, lost, ending, *found, system = self.client.query(*words, *of_motors, f"&{SYSTEM}??", again=True)
        self._owner_seen(self.client.number(owner))
        try:
            return MotorPoll(
                asked_s=asked_s,
                answered_s=self.clock.now_s(),
                lost=number_of(lost) != 0.0,
                ending=number_of(ending) != 0.0,
                running="running_program" in decode(system, self._dialect.system_bits),
                positions={motor: number_of(text) for motor, text in zip(self.motors, found[::2], strict=True)},
                flags={
                    motor: decode(text, self._dialect.motor_bits)
                    for motor, text in zip(self.motors, found[1::2], strict=True)
                },
            )
        except ValueError as error:
            raise out_of_step(self.client.link.address, "P ? ??", str(error)) from error


def rests(looks: Sequence[MotorPoll]) -> bool:
    """Whether everything is at rest by the last polls."""
    last = looks[-POLLS_AT_REST:]
    return len(last) == POLLS_AT_REST and all(_is_at_rest(last, motor) for motor in last[0].positions)


def rest_s(looks: Sequence[MotorPoll], *motors: int) -> float | None:
    """Return when motors (all, if none is named) were first seen at permanent rest; None: they were not."""
    found = None
    for place in range(len(looks) - POLLS_AT_REST, -1, -1):
        window = looks[place : place + POLLS_AT_REST]
        if not all(_is_at_rest(window, motor) for motor in motors or window[0].positions):
            break
        found = window[0].answered_s
    return found


def _is_at_rest(looks: Sequence[MotorPoll], motor: int) -> bool:
    places = [look.positions[motor] for look in looks]
    still = all(look.still(motor) and not look.running for look in looks)
    return still and max(places) - min(places) <= REST_BAND_COUNTS


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchdogProof:
    """The observations, in s after the last renewal; None: not observed.

    The end came between `still_going_s`, the last poll without it, and `ended_s`, the first one with it. `looks`
    are all polls; the first was made just after the last renewal.
    """

    still_going_s: float
    ended_s: float | None
    at_rest_s: float | None
    looks: tuple[MotorPoll, ...] = ()


def keep_watchdog(
    watch: MotorWatch, keeper: Keeper, kept_s: float, check: Callable[[], None]
) -> tuple[MotorPoll, MotorPoll]:
    """Renew the watchdog of a motion for a time; return one poll from before the last renewal, and one after it.

    `check` ends it.

    Raises DriverError: that of `check`; that of the watch; the link broke.
    """
    end_s = watch.clock.now_s() + kept_s
    while watch.clock.now_s() < end_s:
        watch.clock.wait(PERIOD_MS / 1000.0)
        check()
        watch.renew(keeper)
    earlier = watch.look()
    watch.clock.wait(PERIOD_MS / 1000.0)
    check()
    watch.renew(keeper)
    return earlier, watch.look()


def withhold(
    watch: MotorWatch, before: MotorPoll, stop: Callable[[str], None], rest_limit_s: float = REST_LIMIT_S
) -> WatchdogProof:
    """Poll without renewals until everything is at rest; `before` was made just after the last renewal.

    Raises DriverError: that of the watch; the link broke.
    """
    last_s, looks = before.asked_s, [before]
    while not (looks[-1].lost and not looks[-1].ending and rests(looks)):
        limit_s = rest_limit_s if looks[-1].lost else GIVE_UP_S
        if looks[-1].asked_s - last_s > limit_s:
            stop("the lease did not end the motion")
            break
        watch.clock.wait(LOOK_EVERY_S)
        looks.append(watch.look())
    watch.client.request(f"{NOTHING_GUARDED} {LOSS_SEEN}")
    going = [look for look in looks if not look.lost]
    ended = next((look for look in looks if look.lost), None)
    rested_s = rest_s(looks) if ended is not None else None
    return WatchdogProof(
        still_going_s=going[-1].asked_s - last_s if going else 0.0,
        ended_s=None if ended is None else ended.answered_s - last_s,
        at_rest_s=None if rested_s is None else rested_s - last_s,
        looks=tuple(looks),
    )


def proof_problems(proof: WatchdogProof) -> tuple[Problem, ...]:
    """Return the failures of the test. Only a certainly late end counts as late."""
    allowed_s = WATCHDOG_MS / 1000.0
    limit = f"<= {allowed_s:g} s"
    if proof.ended_s is None:
        return (Problem(code="heartbeat.not_ended", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.still_going_s > allowed_s:
        return (Problem(code="heartbeat.late", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.at_rest_s is None:
        return (Problem(code="heartbeat.no_rest", value=f"{REST_LIMIT_S:g} s"),)
    return ()
