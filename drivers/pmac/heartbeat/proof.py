"""The watchdog commissioning test: withhold renewals from a motion in air, and time how long it takes to end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivers.pmac.heartbeat.keeper import LOSS_SEEN, NOTHING_GUARDED, Keeper
from drivers.pmac.heartbeat.watch import LOOK_EVERY_S, Look, Watch, rest_s, rests
from drivers.pmac.heartbeat.watchdog import PERIOD_MS, WATCHDOG_MS
from profiles.problem import Problem

GIVE_UP_S = 0.6
"""What has not ended after twice the specified time is stopped in another way."""

REST_LIMIT_S = 5.0
"""How long to poll until rest."""

Stop = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchdogProof:
    """The observations, in s after the last renewal; None: not observed.

    The end came between `still_going_s`, the last poll without it, and `ended_s`, the first one with it. `looks`
    are all polls; the first was made just after the last renewal.
    """

    still_going_s: float
    ended_s: float | None
    at_rest_s: float | None
    looks: tuple[Look, ...] = ()


def kept(watch: Watch, keeper: Keeper, kept_s: float, check: Callable[[], None]) -> tuple[Look, Look]:
    """Renew the watchdog of a motion for a time; return one poll from before the last renewal, and one after it.

    `check` ends it.

    Raises:
        DriverError: that of `check`; that of the watch; the link broke.
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


def withhold(watch: Watch, before: Look, stop: Stop, rest_limit_s: float = REST_LIMIT_S) -> WatchdogProof:
    """Poll without renewals until everything is at rest; `before` was made just after the last renewal.

    Raises:
        DriverError: that of the watch; the link broke.
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
    """Return what the test has not shown. Only what is certainly late counts as late."""
    allowed_s = WATCHDOG_MS / 1000.0
    limit = f"<= {allowed_s:g} s"
    if proof.ended_s is None:
        return (Problem(code="heartbeat.not_ended", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.still_going_s > allowed_s:
        return (Problem(code="heartbeat.late", value=f"{proof.still_going_s:.2f} s", limit=limit),)
    if proof.at_rest_s is None:
        return (Problem(code="heartbeat.no_rest", value=f"{REST_LIMIT_S:g} s"),)
    return ()
