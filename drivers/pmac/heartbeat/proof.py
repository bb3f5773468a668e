"""The proof test: something moves in air, the lease is withheld, and how long the card took to end it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED, Keeper
from drivers.pmac.heartbeat.lease import LEASE_MS, PERIOD_MS, SERVO_PERIOD
from drivers.pmac.heartbeat.watch import LOOK_EVERY_S, Look, Watch, rest_s, rests
from profiles.problem import Problem

KEPT_S = 0.2
"""Before the silence: so long a jog has to reach its speed."""

GIVE_UP_S = 0.6
"""What is not ended after twice the promise is stopped in another way."""

REST_LIMIT_S = 5.0
"""How long the way to rest is watched."""

Stop = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaseProof:
    """What was seen, in s behind the last lease; None: it did not come about.

    The end came between `still_going_s`, of the last look without it, and `ended_s`, of the first one with it.
    `looks` are all of them; the first was made just behind the last lease.
    """

    still_going_s: float
    ended_s: float | None
    at_rest_s: float | None
    looks: tuple[Look, ...] = ()


def prove_lease(
    client: PmacClient, clock: Clock, dialect: Dialect, motor: int, direction: int, stop: Stop
) -> LeaseProof:
    """Jog a motor in air in the direction of +1 or -1, withhold the lease, and look on.

    This moves the machine: for 0.55 s at Ix22, and the ramp. The motor is at rest in closed loop, homed, with that
    way before it; the heartbeat has been found in order. `stop` is the stop of the machine: it is called when the
    jog does not end, or nobody can see whether it does.

    Raises:
        DriverError: the link broke, or the controller refused the jog; the machine was stopped.
    """
    watch = Watch(client, clock, dialect, (motor,))
    try:
        (i10,) = client.numbers(f"I{SERVO_PERIOD}")
        keeper = Keeper(dialect=dialect, i10=i10)
        client.request(LOSS_SEEN)
        sign = "+" if direction > 0 else "-"
        client.request(f"{keeper.jog_line()} #{motor}J{sign}")
        _, before = kept(watch, keeper, KEPT_S, lambda: None)
        return withhold(watch, before, stop)
    except DriverError as error:
        stop(str(error))
        raise


def kept(watch: Watch, keeper: Keeper, kept_s: float, check: Callable[[], None]) -> tuple[Look, Look]:
    """Renew the lease of what has been begun for so long; return a look in front of the last one, and one behind.

    `check` ends it.

    Raises:
        DriverError: that of `check`; the link broke.
    """
    end_s = watch.clock.now_s() + kept_s
    while watch.clock.now_s() < end_s:
        watch.clock.wait(PERIOD_MS / 1000.0)
        check()
        watch.client.request(keeper.line)
    earlier = watch.look()
    watch.clock.wait(PERIOD_MS / 1000.0)
    check()
    watch.client.request(keeper.line)
    return earlier, watch.look()


def withhold(watch: Watch, before: Look, stop: Stop, rest_limit_s: float = REST_LIMIT_S) -> LeaseProof:
    """Look on without a lease until everything has come to rest; `before` was made just behind the last one.

    Raises:
        DriverError: the link broke.
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
    return LeaseProof(
        still_going_s=going[-1].asked_s - last_s if going else 0.0,
        ended_s=None if ended is None else ended.answered_s - last_s,
        at_rest_s=None if rested_s is None else rested_s - last_s,
        looks=tuple(looks),
    )


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
