"""A fuzzer of our own, for where the coverage-guided one is not installed: seeded mutations of sound inputs.

It does not see which code an input reaches; the same seed tries the same inputs, in the same order.
"""

from __future__ import annotations

import resource
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from random import Random

from tests.fuzz.target import LONGEST, Target

TOO_LONG_S = 10.0
"""Of processor time, for one input of at most `LONGEST` bytes."""

TOO_MUCH_BYTES = 512 * 1024 * 1024
"""How much the memory of the process may grow over all inputs."""

WORDS = (
    b"\r",
    b"\n",
    b"\x06",
    b"\x07ERR003\r",
    b"\0",
    b"\x1b[",
    b"nan",
    b"-1",
    b"1e999",
    b"999999999999",
    b"[",
    b'"',
    b"\xff",
    b"=",
)
KEPT = 500
"""Accepted inputs that are mutated further, beside those to begin from."""


class TooLongError(Exception):
    """One input has taken too long."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What came of a run; `broken_by` is the input that broke the reader, with the error."""

    tried: int
    accepted: int
    seconds: float
    broken_by: bytes | None = None
    error: str = ""


def named(error: Exception) -> str:
    """Return type and sentence of an error; it may come from another process."""
    return f"{type(error).__name__}: {error}"


def mutated(data: bytes, other: bytes, random: Random) -> bytes:
    """Return an input with one to four changes."""
    made = bytearray(data)
    for _ in range(random.randint(1, 4)):
        place = random.randint(0, len(made))
        length = min(random.choice((1, 1, 2, 8, 64)), len(made) - place)
        match random.randrange(7):
            case 0 if made:
                made[place % len(made)] ^= 1 << random.randrange(8)
            case 1:
                made[place:place] = bytes(random.randrange(256) for _ in range(random.randint(1, 4)))
            case 2:
                del made[place : place + length]
            case 3:
                made[place:place] = made[place : place + length] * random.randint(1, 8)
            case 4:
                made[place:place] = random.choice(WORDS)
            case 5 if other:
                start = random.randrange(len(other))
                made[place : place + length] = other[start : start + random.randint(1, 64)]
            case 6:
                made[place : place + length] = b"%d" % random.choice(
                    (0, 1, -1, 2**31, 2**63, random.randrange(10_000))
                )
    return bytes(made[:LONGEST])


def mutate(target: Target, *, inputs: int, seconds: float, seed: int) -> Outcome:
    """Try inputs until there were so many, the time is over, or one breaks the reader."""
    random, starts = Random(f"{target.name} {seed}"), target.starts()
    pool, began_s, before = list(starts), time.monotonic(), _memory()
    tried = accepted = 0
    with target.trying() as one, _bounded():
        while tried < inputs and time.monotonic() - began_s < seconds:
            first = tried < len(starts)
            data = starts[tried] if first else mutated(random.choice(pool), random.choice(pool), random)
            tried += 1
            try:
                signal.setitimer(signal.ITIMER_PROF, TOO_LONG_S)
                good = one(data)
                signal.setitimer(signal.ITIMER_PROF, 0.0)
                if _memory() - before > TOO_MUCH_BYTES:
                    raise MemoryError(f"{_memory() - before} bytes")
            except Exception as error:
                seconds_s = time.monotonic() - began_s
                return Outcome(
                    tried=tried, accepted=accepted, seconds=seconds_s, broken_by=data, error=named(error)
                )
            accepted += good
            if good and not first and len(pool) < len(starts) + KEPT:
                pool.append(data)
    return Outcome(tried=tried, accepted=accepted, seconds=time.monotonic() - began_s)


def _memory() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@contextmanager
def _bounded() -> Iterator[None]:
    def too_long(*_: object) -> None:
        raise TooLongError(f"> {TOO_LONG_S:g} s of processor time")

    before = signal.signal(signal.SIGPROF, too_long)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
