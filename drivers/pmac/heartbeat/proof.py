"""The proof test: a jog in air, the lease withheld, and how long the card took to end it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.pmac import reserved
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED, Keeper
from drivers.pmac.heartbeat.lease import LEASE_MS, PERIOD_MS, SERVO_PERIOD, Activity
from drivers.pmac.status import decode
from profiles.problem import Problem

BEATS = 5
"""Renewals before the silence: so long the jog has to reach its speed."""

LOOK_EVERY_S = 0.01
GIVE_UP_S = 0.6
"""A jog that is not ended after twice the promise is stopped in another way."""

REST_LIMIT_S = 5.0
"""How long the ramp is watched."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseProof:
    """What was seen, in s behind the last lease; None: it did not come about.

    The end came between `still_going_s`, of the last look without it, and `ended_s`, of the first one with it.
    `run_on_counts` is the way from the last lease to rest.
    """

    still_going_s: float
    ended_s: float | None
    at_rest_s: float | None
    run_on_counts: float


@dataclass(frozen=True, slots=True)
class _Look:
    asked_s: float
    answered_s: float
    lost: bool
    at_rest: bool
    position: float


class _Watch:
    """One motor and the word of the PLC, asked for in one request."""

    def __init__(self, client: PmacClient, clock: Clock, dialect: Dialect, motor: int) -> None:
        self._client, self._clock, self._dialect, self._motor = client, clock, dialect, motor

    def look(self) -> _Look:
        asked_s = self._clock.now_s()
        lost, position, status = self._client.query(f"P{reserved.LOST}", f"#{self._motor}P", "?")
        flags = decode(status, self._dialect.motor_bits)
        return _Look(
            asked_s=asked_s,
            answered_s=self._clock.now_s(),
            lost=float(lost) == Activity.JOG,
            at_rest=bool({"desired_velocity_zero", "open_loop"} & flags),
            position=float(position),
        )


def prove_lease(
    client: PmacClient, clock: Clock, dialect: Dialect, motor: int, direction: int, stop: Callable[[str], None]
) -> LeaseProof:
    """Jog a motor in air in the direction of +1 or -1, withhold the lease, and look on.

    This moves the machine: for 0.55 s at Ix22, and the ramp. The motor is at rest in closed loop, homed, with that
    way before it; the heartbeat has been found in order. `stop` is the stop of the machine: it is called when the
    jog does not end, or nobody can see whether it does.

    Raises:
        DriverError: the link broke, or the controller refused the jog; the machine was stopped.
    """
    (i10,) = client.numbers(f"I{SERVO_PERIOD}")
    watch = _Watch(client, clock, dialect, motor)
    try:
        client.request(LOSS_SEEN)
        last_s, before = _jog(
            client, clock, Keeper(dialect=dialect, i10=i10), watch, f"#{motor}J{_sign(direction)}"
        )
        proof = _look_on(watch, clock, last_s, before, stop)
        client.request(f"{NOTHING_GUARDED} {LOSS_SEEN}")
    except DriverError as error:
        stop(str(error))
        raise
    return proof


def proof_problems(proof: LeaseProof) -> tuple[Problem, ...]:
    """Return what the proof has not shown. Only what is surely late is called so."""
    allowed_s = LEASE_MS / 1000.0
    limit = f"<= {allowed_s:g} s"
    if proof.ended_s is None:
        return (Problem(code="heartbeat.not_ended", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.still_going_s > allowed_s:
        return (Problem(code="heartbeat.late", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.at_rest_s is None:
        return (Problem(code="heartbeat.no_rest", value=f"{REST_LIMIT_S:g} s"),)
    return ()


def _sign(direction: int) -> str:
    return "+" if direction > 0 else "-"


def _jog(client: PmacClient, clock: Clock, keeper: Keeper, watch: _Watch, jog: str) -> tuple[float, _Look]:
    """Begin the jog and renew its lease a few times; return when the last one was answered, and a look then."""
    client.request(f"{keeper.jog_line()} {jog}")
    for _ in range(BEATS):
        clock.wait(PERIOD_MS / 1000.0)
        client.request(keeper.line)
    return clock.now_s(), watch.look()


def _look_on(watch: _Watch, clock: Clock, last_s: float, before: _Look, stop: Callable[[str], None]) -> LeaseProof:
    going_s, ended_s, at_rest_s, seen = 0.0, None, None, before
    while at_rest_s is None:
        if not seen.lost and ended_s is None:
            going_s = seen.asked_s - last_s
        elif ended_s is None:
            ended_s = seen.answered_s - last_s
        if ended_s is not None and seen.at_rest:
            at_rest_s = seen.answered_s - last_s
        elif clock.now_s() - last_s > (GIVE_UP_S if ended_s is None else REST_LIMIT_S):
            stop("the lease did not end the jog")
            break
        else:
            clock.wait(LOOK_EVERY_S)
            seen = watch.look()
    return LeaseProof(
        still_going_s=going_s,
        ended_s=ended_s,
        at_rest_s=at_rest_s,
        run_on_counts=abs(seen.position - before.position),
    )
