"""The injected faults of one simulated machine: pending, active and over.

All times are simulated. A fault begins, and ends, with a background cycle; one without a delay begins at once.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from random import Random

from drivers.simulator.faults.catalogue import AFTER, FOR, SEED, Fault, Value, find, refusal
from drivers.simulator.faults.effects import Effect, FaultTarget, effect_of

MOST_FAULTS = 1000  # maximum number of pending and active faults


@dataclass(slots=True, kw_only=True)
class InjectedFault:
    """A fault that was requested; `ends_s` is infinite for one that lasts until it is cleared."""

    fault: Fault
    values: Mapping[str, Value]
    seed: int
    begins_s: float
    ends_s: float
    effect: Effect = field(repr=False, compare=False)
    running: bool = field(default=False, repr=False, compare=False)


class FaultBoard:
    """Injects faults; any number of them at once."""

    def __init__(self, site: FaultTarget) -> None:
        self._site = site
        self._injected: tuple[InjectedFault, ...] = ()

    def inject(
        self, name: str, *, after_s: float = 0.0, for_s: float | None = None, seed: int = 0, **parameters: Value
    ) -> InjectedFault:
        """Inject a fault in `after_s`, for `for_s` or else until `clear`; its random effects use `seed`.

        Raises RefusedError: `simulator.fault`, there is no such fault or parameter, or a value is out of range.
        """
        given = {AFTER.name: after_s, SEED.name: seed, **parameters}
        return self.ask(name, given if for_s is None else {**given, FOR.name: for_s})

    def ask(self, name: str, given: Mapping[str, Value]) -> InjectedFault:
        """Do the same as `inject`, with values that may be text, also the times. Raises what `inject` does."""
        fault = find(name)
        values, times = fault.settle(given)
        if len(self._injected) >= MOST_FAULTS:
            raise refusal(name, "fault", f"{len(self._injected) + 1}", f"{MOST_FAULTS} at once; `clear` ends them")
        seed = int(times.get(SEED.name, 0.0))
        begins_s = self._site.lines.now_s() + times.get(AFTER.name, 0.0)
        injected = InjectedFault(
            fault=fault,
            values=values,
            seed=seed,
            begins_s=begins_s,
            ends_s=begins_s + times.get(FOR.name, math.inf),
            effect=effect_of(name, values, Random(seed), self._site),
        )
        self._injected += (injected,)
        self.follow()
        return injected

    def active(self) -> tuple[InjectedFault, ...]:
        """Return the faults that are not over, in the order of request; some may be pending."""
        return self._injected

    def clear(self) -> None:
        """End all of them; delayed bytes to a host or to the controller arrive at once.

        A controller whose watchdog has tripped stays dead, and that fault stays active.
        """
        for injected in self._injected:
            if not (injected.running and injected.fault.moment):
                self._end(injected)
        self._site.lines.clearings += 1

    def power_up(self) -> None:
        """Forget momentary faults that have happened: the controller's state no longer shows them."""
        for injected in self._injected:
            if injected.running and injected.fault.moment:
                self._end(injected)

    @property
    def shut_down_s(self) -> float | None:
        """Time at which the watchdog has shut the controller down, by any fault; None if it has not."""
        return self._site.background.tripped_s

    def follow(self) -> None:
        """Begin and end the faults that are due."""
        if not self._injected:
            return
        now_s = self._site.lines.now_s()
        for injected in self._injected:
            if not injected.running and injected.begins_s <= now_s:
                injected.running = True
                injected.effect.begin()
            if injected.running and (injected.ends_s <= now_s or injected.effect.over()):
                self._end(injected)

    def _end(self, ended: InjectedFault) -> None:
        self._injected = tuple(injected for injected in self._injected if injected is not ended)
        if not ended.running:
            return
        ended.effect.end()
        if ended.fault.moment:
            return
        for other in self._injected:
            if other.running and other.fault is ended.fault:
                other.effect.begin()  # the end of one must not undo what both have done


def inject_words(board: FaultBoard, name: str, settings: Sequence[str]) -> InjectedFault:
    """Inject a fault by its name, with settings `KEY=VALUE`. Raises RefusedError: `simulator.fault`."""
    return board.ask(name, given_in(name, settings))


def given_in(name: str, settings: Sequence[str]) -> dict[str, Value]:
    """Return the values of settings. Raises RefusedError: `simulator.fault`, no such fault; one is no setting."""
    find(name)
    given: dict[str, Value] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key or key in given:
            raise refusal(name, "setting", ascii(setting)[1:-1], "KEY=VALUE, each key once")
        given[key] = value
    return given


def check_line(line: str) -> None:
    """Check a line without injecting anything. Raises RefusedError: `simulator.fault`, it is no fault."""
    words = words_of(line)
    find(words[0]).settle(given_in(words[0], words[1:]))


def words_of(line: str) -> list[str]:
    """Return the words of a line, at least one. Raises RefusedError: `simulator.fault`."""
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise refusal("", "command", ascii(f"{line} ({error})")[1:-1][:80], "NAME [KEY=VALUE ...]") from error
    if not words:
        raise refusal("", "command", "", "NAME [KEY=VALUE ...]")
    return words
