"""What the card and the iron truly are, block by block, and everything that a host sends: seen by nobody else."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from drivers.lathe.snapshot import AxisName
from drivers.link.memory import MemoryLink
from drivers.simulator.card.motor import Motor
from drivers.simulator.hosts.port import Port
from drivers.simulator.machine import SimulatedLathe

MOTORS = {AxisName.TOOL: 1, AxisName.SPINDLE: 2, AxisName.CARRIAGE: 3}


class Moment(NamedTuple):  # one for each block: made three times as fast
    """The end of one block of servo cycles: iron and reported positions in counts, amplifiers, program."""

    at_s: float
    true_position: tuple[float, ...]
    told: tuple[float, ...]
    powered: tuple[bool, ...]
    running: bool


class WatchedLathe(SimulatedLathe):
    """A simulated lathe that keeps a moment for each block, and when which amplifier was switched on."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.moments: list[Moment] = []
        self.energised: list[tuple[float, AxisName]] = []
        self._watched = [self.controller.motors[number] for number in MOTORS.values()]
        for axis, number in MOTORS.items():
            self._watch_amplifier(axis, self.controller.motors[number])

    def keep(self) -> None:
        a, b, c = self._watched
        self.moments.append(
            Moment(
                self.now_s(),
                (a.true_position, b.true_position, c.true_position),
                (a.position, b.position, c.position),
                (a.amplifier_enabled, b.amplifier_enabled, c.amplifier_enabled),
                self.controller.systems[1].running,
            )
        )

    def since(self, begun_s: float, until_s: float = float("inf")) -> list[Moment]:
        """The moments of a stretch of time, with the last one before it."""
        return list(self._reversed_since(begun_s, until_s))[::-1]

    def _reversed_since(self, begun_s: float, until_s: float) -> Iterator[Moment]:
        for moment in reversed(self.moments):
            if moment.at_s <= until_s:
                yield moment
            if moment.at_s < begun_s:
                return

    def _watch_amplifier(self, axis: AxisName, motor: Motor) -> None:
        """Between two blocks a loop may be opened and closed again."""
        enable = motor.enable

        def watched() -> None:
            if not motor.enabled:
                self.energised.append((self.now_s(), axis))
            enable()

        motor.enable = watched  # type: ignore[method-assign]

    def _run_block(self) -> None:
        super()._run_block()
        self.keep()


@dataclass(frozen=True, slots=True)
class Sent:
    """One piece of what the host has sent."""

    at_s: float
    data: bytes
    urgent: bool

    @property
    def line(self) -> str:
        return self.data.decode("latin-1").rstrip("\r")


@dataclass
class Wiretap(MemoryLink):
    """A link that keeps what goes out. `before` is called with each line, before it leaves."""

    port: Port
    sim: WatchedLathe
    sent: list[Sent] = field(default_factory=list)
    before: Callable[[Sent], None] = lambda _: None

    def __post_init__(self) -> None:
        super().__init__(self.port, self.sim)

    def send(self, data: bytes) -> None:
        self._keep(data, urgent=False)
        super().send(data)

    def send_urgent(self, data: bytes) -> None:
        self._keep(data, urgent=True)
        super().send_urgent(data)

    def _keep(self, data: bytes, *, urgent: bool) -> None:
        piece = Sent(self.sim.now_s(), data, urgent)
        self.before(piece)
        self.sent.append(piece)
