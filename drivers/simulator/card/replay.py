"""A stretch of servo cycles of a motor, kept so that the motor can be shown as it was after each of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from drivers.simulator.plant.axis import read_encoder


class Shown(NamedTuple):
    """What registers read of a motor after a servo cycle; `noise` and `noise_before` are of the scale."""

    desired: float
    velocity: float
    actual: float
    last_actual: float
    correction: float
    noise: float
    noise_before: float


class Replay:
    """The last stretch: its `cycles`, and the `encoders` and `commands` in each of them, counts.

    Those two are also what a table sees of a motor that has not been run.
    """

    def __init__(self) -> None:
        self.cycles: list[Shown] = []
        self.encoders: Sequence[float] = ()
        self.commands: Sequence[float] = ()
        self._begun = 0.0, 0.0, 0.0

    def begin(self, desired: float, actual: float, noise: float) -> None:
        """Take the state before a stretch."""
        self._begun = desired, actual, noise

    def keep(
        self,
        track: Sequence[float],
        noise: Sequence[float] | None,
        commands: Sequence[float] | None,
        corrections: Sequence[float],
        cycle_ms: float,
    ) -> None:
        """Keep the stretch just run, with its `commands`, None in open loop, and the `corrections` beside them."""
        desired, actual, noise_before = self._begun
        noise = noise or [0.0] * len(track)
        encoders = [float(read_encoder(place + each)) for place, each in zip(track, noise, strict=True)]
        if commands is None:
            commands = [place - added for place, added in zip(encoders, corrections, strict=True)]
            velocity = [0.0] * len(track)
        else:
            before = [desired, *commands[:-1]]
            velocity = [(now - then) / cycle_ms for now, then in zip(commands, before, strict=True)]
        self.encoders, self.commands = encoders, commands
        actuals, noises = [actual, *track[:-1]], [noise_before, *noise[:-1]]
        self.cycles = list(map(Shown, commands, velocity, track, actuals, corrections, noise, noises))
