"""Sending what is recorded as it is recorded, whatever happens to the network and the database meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

from console.site.shop.connection import connect_shop
from console.site.shop.identity import lathe_identity
from console.site.shop.schema import refuse_other_schema
from console.site.shop.shipping import SentRows, greet, ship_over
from profiles.problem import Problem, ProblemError

PERIOD_S = 5.0
GREET_S = 3600.0
LEAST_PAUSE_S, MOST_PAUSE_S = 1.0, 60.0
SAID_AGAIN_S = 60.0

PASSING = frozenset({"ship.lost", "ship.no_schema", "ship.older_schema", "record.not_readable"})
"""Refusals that may end by themselves, or by what somebody does at the database: tried again."""

Waits = Callable[[float], object]


def follow(
    data: Path,
    given: str,
    *,
    period_s: float = PERIOD_S,
    told: Callable[[SentRows], object] = lambda sent: None,
    waits: Waits = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Generator[SentRows | Problem, None, None]:
    """Send for ever; yield what each pass has sent, and a refusal that is tried again, each minute while it lasts.

    `waits` waits some seconds. Between two tries the pause doubles, up to a minute. Raises SessionError: any
    refusal that is not in `PASSING`.
    """
    pause_s, last, said_s = LEAST_PAUSE_S, None, 0.0
    while True:
        try:
            for sent in _over_one_link(data, given, period_s, told, waits):
                pause_s, last = LEAST_PAUSE_S, None
                yield sent
        except ProblemError as error:
            problem = error.problems[0]
            if problem.code not in PASSING:
                raise
            if problem != last or clock() - said_s >= SAID_AGAIN_S:
                last, said_s = problem, clock()
                yield problem
        waits(pause_s)
        pause_s = min(2.0 * pause_s, MOST_PAUSE_S)


def _over_one_link(
    data: Path, given: str, period_s: float, told: Callable[[SentRows], object], waits: Waits
) -> Iterator[SentRows]:
    lathe = lathe_identity(data)
    with connect_shop(given) as link:
        refuse_other_schema(link)
        greeted_s, sent = -GREET_S, None
        while True:
            if time.monotonic() - greeted_s >= GREET_S:
                greet(link, lathe)
                greeted_s = time.monotonic()
            sent = ship_over(link, data, lathe, told=told, before=sent)
            yield sent
            waits(period_s)
