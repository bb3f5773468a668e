"""One shift by itself: what happened in it, and which invariant was broken."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from tests.soak.script import Event, Script, drawn
from tests.soak.shift import BrokenError, Count, Shift


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """A shift that is over: what happened, which invariant was broken ("" for none), and what was counted."""

    seed: int
    script: Script
    said: str
    passed_s: float
    count: Count
    grown_mb: float


def lone_shift(seed: int, *, seconds: float, until_s: float) -> Done | None:
    """Run a shift, unless it is too late to begin."""
    if time.monotonic() > until_s:
        return None
    count, before_mb = Count(), _memory_mb()
    script, said, passed_s = one_shift(seed, seconds, count)
    grown_mb = _memory_mb() - before_mb
    return Done(seed=seed, script=script, said=said, passed_s=passed_s, count=count, grown_mb=grown_mb)


def one_shift(seed: int, seconds: float, count: Count) -> tuple[Script, str, float]:
    """Run a shift; return what happened, which invariant was broken, and the simulated time, s."""
    random, happened = Random(seed), list[Event]()
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, count)
        try:
            while shift.now_s < seconds:
                happened.append(drawn(random))
                shift.happen(happened[-1])
            shift.close()
        except Exception as error:
            return tuple(happened), _sentence(error), shift.now_s
        return tuple(happened), "", shift.now_s


def broken_by(script: Script, seed: int) -> str:
    """Play a script; return which invariant it breaks, or nothing."""
    with TemporaryDirectory() as folder:
        shift = Shift(Path(folder), seed, Count())
        try:
            shift.play(script)
            shift.close()
        except Exception as error:
            return _sentence(error)
    return ""


def _sentence(error: Exception) -> str:
    """Return the invariant that is broken; any other error of a shift breaks one, too."""
    return str(error) if isinstance(error, BrokenError) else f"{type(error).__name__}: {error}"


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
