"""The faults of one simulated machine: which of them wait, which are there, and when they are over.

All times are simulated. A fault begins, and ends, with a background cycle; one without a delay begins at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from random import Random

from drivers.simulator.faults.catalogue import AFTER, FOR, SEED, Fault, find
from drivers.simulator.faults.effects import Effect, FaultTarget, effect_of, untold
from drivers.simulator.faults.parameter import Parameter, Value, refusal

MOST_FAULTS = 1000
"""Faults that may be there, or wait, at once."""

_AFTER_S, _FOR_S = replace(AFTER, name="after_s"), replace(FOR, name="for_s")
"""What the times are called in a call, where a unit is in the name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Injected:
    """A fault that was asked for; `ends_s` is infinite for one that lasts until it is cleared.

    `outcome` is what has come of it that is to be told, and empty where there is nothing, or not yet.
    """

    fault: Fault
    values: Mapping[str, Value]
    seed: int
    begins_s: float
    ends_s: float
    outcome: Callable[[], str] = field(default=untold, repr=False, compare=False)

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

    def __init__(self, site: FaultTarget) -> None:
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
        given = {_AFTER_S.name: after_s, SEED.name: seed, **parameters}
        return self.ask(name, given if for_s is None else {**given, _FOR_S.name: for_s}, _AFTER_S, _FOR_S)

    def ask(
        self, name: str, given: Mapping[str, Value], after: Parameter = AFTER, lasting: Parameter = FOR
    ) -> Injected:
        """Do the same as `inject`, with values that may be text, and the times among them.

        Raises:
            RefusedError: as `inject`.
        """
        fault = find(name)
        times = {time.name: time for time in ((after, SEED) if fault.moment else (after, lasting, SEED))}
        values = fault.settle({key: value for key, value in given.items() if key not in times}, times)
        timed = {key: float(times[key].check(value, name)) for key, value in given.items() if key in times}
        if len(self._entries) >= MOST_FAULTS:
            raise refusal(name, "fault", f"{len(self._entries) + 1}", f"{MOST_FAULTS} at once; `clear` ends them")
        seed = int(timed.get(SEED.name, 0.0))
        effect = effect_of(name, values, Random(seed), self._site)
        begins_s = self._site.lines.now_s() + timed.get(after.name, 0.0)
        injected = Injected(
            fault=fault,
            values=values,
            seed=seed,
            begins_s=begins_s,
            ends_s=begins_s + timed.get(lasting.name, math.inf),
            outcome=effect.outcome,
        )
        self._entries.append(_Entry(injected=injected, effect=effect))
        self.follow()
        return injected

    def active(self) -> tuple[Injected, ...]:
        """Return the faults that are not over, in the order in which they were asked for; some may yet wait."""
        return tuple(entry.injected for entry in self._entries)

    def clear(self) -> None:
        """End all of them; what is on its way to a host or to the card arrives at once.

        A card whose watchdog has tripped stays dead, and that fault is still there.
        """
        for entry in tuple(self._entries):
            if not (entry.running and entry.injected.fault.moment):
                self._end(entry)
        self._site.lines.clearings += 1

    def power_up(self) -> None:
        """Forget the moments that have happened: the card is not as they have left it any more."""
        for entry in tuple(self._entries):
            if entry.running and entry.injected.fault.moment:
                self._end(entry)

    @property
    def shut_down_s(self) -> float | None:
        """When the watchdog has shut the card down, by whatever fault; None where it has not."""
        return self._site.background.tripped_s

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
        if entry.injected.fault.moment:
            return
        for other in self._entries:
            if other.running and other.injected.name == entry.injected.name:
                other.effect.begin()  # what both have done is not undone by the end of one
