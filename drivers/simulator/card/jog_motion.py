"""Motor motion that no program commands: jogs, home searches with their trigger, and ramps to rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

from drivers.pmac.trajectory.jog import change_speed, decelerate, jog_settings, jog_to
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.player import Player


class TriggerStage(Enum):
    """The stages of a move that waits for a trigger: a home search, or a jog-until-trigger."""

    SEARCHING = auto()
    STOPPING = auto()
    LAST_MOVE = auto()
    MISSED = auto()
    """The move has ended without a trigger; kept until the next one, for the host to read (User Manual)."""


class JogMotion:
    """The motion of a motor outside programs.

    Positions are counts from the motor's zero; `here` and `velocity` (counts/ms) are the present commanded ones.
    `player` is None at rest. `stage` is None in a move without a trigger; `homes` is whether the trigger becomes
    the motor's home. `aborting` is a ramp at Ix15, `pre_jog` the return to where a program was stopped. `began_at`
    is the motor's position before this move and the moves it has interrupted.
    """

    def __init__(self, motor: int, variables: VariableStore) -> None:
        self.player: Player | None = None
        self.stage: TriggerStage | None = None
        self.homes = False
        self.aborting = False
        self.pre_jog = False
        self.began_at = 0.0
        self._past_trigger = 0.0
        self._rest: list[float] = []
        self._motor = motor
        self._variables = variables

    def run_at(self, speed: float, here: float, velocity: float) -> None:
        """Change to a speed (counts/ms) and keep it, including 0, until something else is played."""
        pieces = change_speed(here, velocity, speed, jog_settings(self._variables, self._motor))
        end = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms)
        self._play((*pieces, Piece(float("inf"), ((end, speed, 0.0, 0.0),))), here)

    def stop(self, here: float, velocity: float) -> None:
        """Come to rest as a jog does."""
        self._play(self._stopping(here, velocity), here)

    def go_to(self, target: float, here: float, velocity: float) -> None:
        """Jog to `target`, after a stop if the motor moves."""
        pieces = self._stopping(here, velocity)
        start = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms) if pieces else here
        self._play((*pieces, *jog_to(start, target, jog_settings(self._variables, self._motor))), here)

    def abort(self, here: float, velocity: float) -> None:
        """Come to rest at Ix15."""
        pieces = decelerate(here, velocity, self._variables.motor(self._motor, 15))
        self._play(pieces, here)
        self.aborting = bool(pieces)

    def seek(self, *, homes: bool, past_trigger: float = 0.0) -> None:
        """Let the move that has just begun wait for the trigger, to end this many counts past it."""
        self.stage = TriggerStage.SEARCHING
        self.homes, self._past_trigger = homes, past_trigger

    def stop_past(self, trigger: float, here: float, velocity: float) -> None:
        """Stop because the trigger was found, then go to the end position."""
        self.stop(here, velocity)
        self.stage = TriggerStage.STOPPING
        self._past_trigger += trigger
        if self.player is None:
            self._next_stage(here)

    def forget(self) -> None:
        """Play nothing."""
        self.player = None
        self.stage = None
        self.aborting = self.pre_jog = False

    def sample(self, cycles: int, cycle_ms: float, here: float) -> list[float]:
        """Return the commands of a block: at rest the same list each time, so that an axis sees it at once."""
        player = self.player
        if player is None:
            if len(self._rest) != cycles or self._rest[0] != here:
                self._rest = [here] * cycles
            return self._rest
        commands = player.sample(cycles, cycle_ms)[0]
        if player.idle:
            self.player = None
            self.aborting = self.pre_jog = False
            self._next_stage(commands[-1])
        return commands

    def _next_stage(self, position: float) -> None:
        """Continue with the next stage when a move has ended: past the trigger, and then nothing."""
        ended, self.stage = self.stage, None
        if ended is TriggerStage.SEARCHING:
            self.stage = TriggerStage.MISSED
        elif ended is TriggerStage.STOPPING:
            pieces = jog_to(position, self._past_trigger, jog_settings(self._variables, self._motor))
            if pieces:
                self.stage = TriggerStage.LAST_MOVE
                self._queue(pieces, position)

    def _stopping(self, here: float, velocity: float) -> tuple[Piece, ...]:
        settings = jog_settings(self._variables, self._motor)
        return change_speed(here, velocity, 0.0, settings) if velocity else ()

    def _play(self, pieces: tuple[Piece, ...], here: float) -> None:
        if self.player is None:
            self.began_at = here
        self.forget()
        if pieces:
            self._queue(pieces, here)

    def _queue(self, pieces: tuple[Piece, ...], here: float) -> None:
        self.player = Player((here,))
        self.player.append(pieces)


@dataclass(frozen=True, slots=True, kw_only=True)
class HomeSensor:
    """The position of the home trigger, in machine counts.

    Without a period it is a flag that is found at `position` and stays set below it, at the end of travel; with a
    period it is an index once per turn.
    """

    position: float = 0.0
    period: float | None = None

    def find_trigger(self, before: float, after: float) -> float | None:
        """Return the machine position of the trigger between `before` and `after`, if any."""
        if self.period is None:
            return self.position if min(before, after) <= self.position else None
        forward = after >= before
        mark = math.floor(max(before, after) / self.period) if forward else math.ceil(after / self.period)
        crossed = mark * self.period
        return crossed if min(before, after) < crossed <= max(before, after) else None
