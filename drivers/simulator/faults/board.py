"""The faults of one simulated machine: which of them wait, which are there, and when they are over.

All times are simulated. A fault begins, and ends, with a background cycle; one without a delay begins at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random

from drivers.simulator.faults.catalogue import AFTER, FOR, SEED, Fault, find
from drivers.simulator.faults.effects import Effect, Site, effect_of
from drivers.simulator.faults.parameter import Value, refusal


@dataclass(frozen=True, slots=True, kw_only=True)
class Injected:
    """A fault that was asked for; `ends_s` is infinite for one that lasts until it is cleared."""

    fault: Fault
    values: Mapping[str, Value]
    seed: int
    begins_s: float
    ends_s: float

    @property
    def name(self) -> str:
        """That of the fault."""
        return self.fault.name


@dataclass(slots=True, eq=False, kw_only=True)
class _Entry:
    injected: Injected
    effect: Effect
    running: bool = False


class FaultBoard:
    """Faults on demand; any number of them at once."""

    def __init__(self, site: Site) -> None:
        """`site` is what they happen to."""
        self._site = site
        self._entries: list[_Entry] = []

    def inject(
        self,
        name: str,
        *,
        after_s: float = 0.0,
        for_s: float | None = None,
        seed: int = 0,
        **parameters: Value,
    ) -> Injected:
        """Let a fault happen in `after_s`, for `for_s` or else until `clear`; its chance is drawn from `seed`.

        Raises:
            RefusedError: `simulator.fault`, there is no such fault or parameter, or a value is out of range.
        """
        return self.ask(name, parameters, after_s=after_s, for_s=for_s, seed=seed)

    def ask(
        self, name: str, parameters: Mapping[str, Value], *, after_s: Value, for_s: Value | None, seed: Value
    ) -> Injected:
        """Do the same as `inject`, with values that may be text.

        Raises:
            RefusedError: as `inject`.
        """
        fault = find(name)
        values = fault.settle(parameters)
        wait_s, drawn = float(AFTER.check(after_s, name)), int(SEED.check(seed, name))
        lasts_s = math.inf
        if for_s is not None:
            if fault.moment:
                raise refusal(name, "parameter", FOR.name, ", ".join(time.name for time in fault.times))
            lasts_s = float(FOR.check(for_s, name))
        begins_s = self._site.lines.now_s() + wait_s
        injected = Injected(fault=fault, values=values, seed=drawn, begins_s=begins_s, ends_s=begins_s + lasts_s)
        effect = effect_of(name, values, Random(drawn), self._site)
        self._entries.append(_Entry(injected=injected, effect=effect))
        self.follow()
        return injected

    def active(self) -> tuple[Injected, ...]:
        """Return the faults that are not over, in the order in which they were asked for; some may yet wait."""
        return tuple(entry.injected for entry in self._entries)

    def clear(self) -> None:
        """End all of them. A card whose watchdog has tripped stays dead, and that fault is still there."""
        for entry in tuple(self._entries):
            if not (entry.running and entry.injected.fault.moment):
                self._end(entry)

    def follow(self) -> None:
        """Begin and end what is due."""
        if not self._entries:
            return
        now_s = self._site.lines.now_s()
        for entry in tuple(self._entries):
            if not entry.running and entry.injected.begins_s <= now_s:
                entry.running = True
                entry.effect.begin()
            if entry.running and (entry.injected.ends_s <= now_s or entry.effect.over()):
                self._end(entry)

    def _end(self, entry: _Entry) -> None:
        self._entries.remove(entry)
        if not entry.running:
            return
        entry.effect.end()
        for other in self._entries:
            if other.running and other.injected.name == entry.injected.name:
                other.effect.begin()  # what both have done is not undone by the end of one
