"""A stretch of servo cycles of a motor, kept so that the motor can be shown as it was after each of them."""

from __future__ import annotations

from typing import NamedTuple

from drivers.simulator.plant.axis import counted, counted_along


class Shown(NamedTuple):
    """What registers read of a motor after a servo cycle; `noise` and `noise_before` are of the scale."""

    desired: float
    velocity: float
    actual: float
    last_actual: float
    correction: float
    noise: float
    noise_before: float


class _Kept(NamedTuple):
    """A stretch as it was run; `commands` is None in open loop, `corrections` where the same one was added."""

    track: list[float]
    noise: list[float] | None
    commands: list[float] | None
    corrections: list[float]
    cycle_ms: float


class Replay:
    """The last stretch of a motor, counts. What is asked of it is worked out once, and only then.

    `encoders` and `commands` are also what a table sees of a motor that has not been run.
    """

    def __init__(self) -> None:
        self._begun = 0.0, 0.0, 0.0
        self._kept = _Kept([], None, [], [], 1.0)
        self._encoders: list[float] | None = None
        self._commands: list[float] | None = None
        self._cycles: list[Shown] | None = None

    @property
    def encoders(self) -> list[float]:
        """What the encoder counts in each cycle."""
        if self._encoders is None:
            track, noise = self._kept.track, self._kept.noise
            places = track if noise is None else [place + each for place, each in zip(track, noise, strict=True)]
            self._encoders = counted_along(places)
        return self._encoders

    @property
    def commands(self) -> list[float]:
        """The commanded position in each cycle; in open loop it goes along with the encoder."""
        if self._commands is None:
            told, corrections = self._kept.commands, self._kept.corrections
            if told is None:
                encoders = self.encoders
                told = [encoders[at] - corrections[at] for at in range(len(encoders))]
            self._commands = told
        return self._commands

    @property
    def corrections(self) -> list[float]:
        """What tables add in each cycle."""
        return self._kept.corrections

    @property
    def encoder_steps(self) -> list[float]:
        """Actual velocity in each cycle, counts per cycle."""
        encoders, (_, actual, noise) = self.encoders, self._begun
        last, steps = counted(actual + noise), []
        for encoder in encoders:
            steps.append(encoder - last)
            last = encoder
        return steps

    @property
    def cycles(self) -> list[Shown]:
        """All of it, cycle by cycle."""
        if self._cycles is None:
            desired, actual, noise_before = self._begun
            kept, commands = self._kept, self.commands
            noise = kept.noise or [0.0] * len(kept.track)
            velocity = [0.0] * len(kept.track)
            if kept.commands is not None:
                before = [desired, *commands[:-1]]
                velocity = [(now - then) / kept.cycle_ms for now, then in zip(commands, before, strict=True)]
            actuals, noises = [actual, *kept.track[:-1]], [noise_before, *noise[:-1]]
            columns = commands, velocity, kept.track, actuals, kept.corrections, noise, noises
            self._cycles = list(map(Shown, *columns))
        return self._cycles

    def begin(self, desired: float, actual: float, noise: float) -> None:
        """Take the state before a stretch."""
        self._begun = desired, actual, noise

    def stand(self, encoder: float, desired: float, cycles: int) -> None:
        """Let it be a stretch of a motor that keeps its position, until it is run through it."""
        self._encoders, self._commands = [encoder] * cycles, [desired] * cycles

    def keep(
        self,
        track: list[float],
        noise: list[float] | None,
        commands: list[float] | None,
        corrections: list[float],
        cycle_ms: float,
    ) -> None:
        """Keep the stretch just run, with its `commands`, None in open loop, and the `corrections` beside them."""
        self._kept = _Kept(track, noise, commands, corrections, cycle_ms)
        self._encoders = self._commands = self._cycles = None
