"""Machine of a cut and the equipment beside it, for the screens and for `console run` alike."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.job import Job
from profiles.problem import Problem
from profiles.traces import Trace


class Workshop(Protocol):
    """Simulated workshop: chuck, gauge, and the switch of an inverter-driven spindle."""

    def mount(self, job: Job) -> None:
        """Clamp a new blank."""

    def measure(self) -> Trace:
        """Release the part and measure it."""

    def look(self) -> WorkshopView:
        """Return what can be seen at the chuck."""

    def set_spindle(self, rpm: float | None) -> None:
        """Set a spindle that the controller does not drive, rpm; None switches it off."""


def _always(_: Snapshot) -> tuple[Problem, ...]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CutContext:
    """One machine. Without a `workshop` the operator clamps, measures and sets the spindle.

    `commissioned` returns every reason why the machine, as the snapshot shows it, may not cut. Whoever connects
    for one cut alone calls `admit` once the controller answers, before anything is written. `sets_spindle` says
    that the workshop sets the spindle for the cut and switches it off afterwards.
    """

    lathe: Lathe
    workshop: Workshop | None = None
    commissioned: Callable[[Snapshot], tuple[Problem, ...]] = _always
    admit: Callable[[], None] = lambda: None
    sets_spindle: bool = False

    @property
    def simulated(self) -> bool:
        """Whether the machine is simulated."""
        return self.workshop is not None
