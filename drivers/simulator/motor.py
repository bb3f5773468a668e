"""A motor of the simulated controller: its loop, its jogs and its home search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.trajectory.jog import JogSettings, change_speed, decelerate, jog_to
from drivers.pmac.trajectory.pieces import Piece, position_at
from drivers.pmac.trajectory.planner import SHORTEST_RAMP_MS
from drivers.pmac.variables import VariableStore
from drivers.simulator.plant.encoder import read_encoder
from drivers.simulator.player import Player
from drivers.simulator.servo import Axis


@dataclass(frozen=True, slots=True, kw_only=True)
class HomeSensor:
    """Where the home trigger is, in machine counts.

    Without a period it is a flag that is met at `position` and stays met below it, at the end of travel; with
    a period it is an index once a turn.
    """

    position: float = 0.0
    period: float | None = None

    def passed(self, before: float, after: float) -> float | None:
        """Return the machine position of the trigger met on the way from `before` to `after`, if any."""
        if self.period is None:
            return self.position if min(before, after) <= self.position else None
        forward = after >= before
        mark = math.floor(max(before, after) / self.period) if forward else math.ceil(after / self.period)
        crossed = mark * self.period
        return crossed if min(before, after) < crossed <= max(before, after) else None


class Homing(Enum):
    """The stages of a home search."""

    SEARCHING = auto()
    STOPPING = auto()
    OFFSET = auto()


class Motor:
    """Commanded position, mode and status of one motor; `axis` is the iron behind it."""

    def __init__(self, number: int, variables: VariableStore, axis: Axis, home: HomeSensor) -> None:
        self.number = number
        self.axis = axis
        self.enabled = False
        self.home_complete = False
        self.fatal_error = False
        self.desired = 0.0
        self.velocity = 0.0  # commanded, counts/ms
        self.actual = 0.0
        self.aborting = False
        self._last_actual = 0.0
        self._variables = variables
        self._home = home
        self._homing: Homing | None = None
        self._player: Player | None = None
        self._before_jog = 0.0

    @property
    def activated(self) -> bool:
        """Whether Ix00 is set."""
        return self.variable(0) != 0.0

    @property
    def encoder(self) -> float:
        """Actual position as the encoder counts it."""
        return float(read_encoder(self.actual))

    @property
    def encoder_step(self) -> float:
        """Actual velocity in counts per servo cycle."""
        return self.encoder - read_encoder(self._last_actual)

    @property
    def following_error(self) -> float:
        """Commanded minus actual position in counts; 0 in open loop."""
        return self.desired - self.encoder if self.enabled else 0.0

    @property
    def out_of_hand(self) -> bool:
        """Whether the following error is above Ix11."""
        limit = self.variable(11)
        return limit > 0.0 and abs(self.following_error) * PARTS_PER_COUNT > limit

    @property
    def jogging(self) -> bool:
        """Whether a jog or a home search is being played."""
        return self._player is not None

    @property
    def homing(self) -> bool:
        """Whether a home search is under way."""
        return self._homing is not None

    @property
    def in_position(self) -> bool:
        """Closed loop, at rest, nothing to play, and within Ix28."""
        return (
            self.enabled
            and self.velocity == 0.0
            and not self.jogging
            and abs(self.following_error) * PARTS_PER_COUNT < self.variable(28)
        )

    def variable(self, number: int) -> float:
        """Return Ix`number` of this motor."""
        return self._variables.motor(self.number, number)

    def run(self, cycles: int, cycle_ms: float, commands: Sequence[float] | None) -> list[float]:
        """Run a block; `commands` come from a coordinate system, None means the motor's own jog.

        Returns:
            The true machine position (counts) at each servo cycle.
        """
        if not self.enabled:
            track = self.axis.coast(cycles)
            self.desired, self.velocity = float(read_encoder(track[-1])), 0.0
        else:
            commands = self._own_commands(cycles, cycle_ms) if commands is None else commands
            track = self.axis.follow(commands)
            before = commands[-2] if cycles > 1 else self.desired
            self.desired, self.velocity = commands[-1], (commands[-1] - before) / cycle_ms
        self._last_actual = track[-2] if cycles > 1 else self.actual
        start, self.actual = self.actual + self.axis.origin, track[-1]
        origin = self.axis.origin
        machine = [position + origin for position in track] if origin else track
        if self._homing is not None:
            self._search(start, machine[-1])
        return machine

    def enable(self) -> None:
        """Close the loop where the motor stands."""
        if not self.enabled:
            self.enabled = True
            self.fatal_error = False
            self.desired, self.velocity = self.axis.close_loop(), 0.0

    def kill(self) -> None:
        """Open the loop; the axis coasts."""
        self.enabled = False
        self.aborting = False
        self._forget_motion()

    def reset(self) -> None:
        """Start as at power-up: killed, not homed, and at position 0 wherever the iron is."""
        self.kill()
        self.home_complete = self.fatal_error = False
        self._rebase(self.encoder)

    def jog_speed(self, direction: int) -> None:
        """Jog for ever in `direction`; 0 stops, and closes the loop of a killed motor."""
        self.enable()
        speed = direction * abs(self.variable(22))
        if not speed and not self.velocity:
            self._play(())
            return
        pieces = change_speed(self.desired, self.velocity, speed, self._jog_settings())
        if speed:
            end = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms)
            pieces = (*pieces, Piece(float("inf"), ((end, speed, 0.0, 0.0),)))
        self._play(pieces)

    def jog_to(self, target: float) -> None:
        """Jog to a motor position in counts, after a stop when the motor moves."""
        self.enable()
        settings = self._jog_settings()
        pieces: tuple[Piece, ...] = ()
        start = self.desired
        if self.velocity:
            pieces = change_speed(self.desired, self.velocity, 0.0, settings)
            start = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms)
        self._play((*pieces, *jog_to(start, target, settings)))

    def jog_back(self) -> None:
        """Jog to where the motor stood before it was jogged last."""
        self.jog_to(self._before_jog)

    def home(self) -> None:
        """Search the home trigger at Ix23."""
        self.enable()
        speed = self.variable(23)
        pieces = change_speed(self.desired, self.velocity, speed, self._jog_settings())
        end = position_at(pieces[-1].cubics[0], pieces[-1].duration_ms)
        self._play((*pieces, Piece(float("inf"), ((end, speed, 0.0, 0.0),))))
        self.home_complete = False
        self._homing = Homing.SEARCHING

    def abort(self) -> None:
        """Come to rest at Ix15; an open loop is closed."""
        self.enable()
        pieces = decelerate(self.desired, self.velocity, self.variable(15))
        self._play(pieces)
        self.aborting = bool(pieces)

    def _own_commands(self, cycles: int, cycle_ms: float) -> list[float]:
        if self._player is None:
            return [self.desired] * cycles
        commands = self._player.sample(cycles, cycle_ms)[0]
        if self._player.idle:
            self._player = None
            self.aborting = False
            self._continue_homing(commands[-1])
        return commands

    def _search(self, start: float, end: float) -> None:
        """Capture the trigger: the zero of the motor moves there (plus Ix26), then the motor stops."""
        trigger = self._home.passed(start, end)
        if self._homing is not Homing.SEARCHING or trigger is None:
            return
        self._rebase(trigger - self.axis.origin)
        self.home_complete = True
        pieces = change_speed(self.desired, self.velocity, 0.0, self._jog_settings())
        self._play(pieces)
        self._homing = Homing.STOPPING

    def _continue_homing(self, position: float) -> None:
        if self._homing is Homing.STOPPING:
            self._homing = Homing.OFFSET
            self._player = Player((position,))
            self._player.append(jog_to(position, self.variable(26) / PARTS_PER_COUNT, self._jog_settings()))
        elif self._homing is Homing.OFFSET:
            self._homing = None

    def _rebase(self, offset: float) -> None:
        """Make `offset` the new zero; the iron does not move."""
        self.axis.rebase(offset)
        self.desired -= offset
        self.actual -= offset
        self._last_actual -= offset

    def _play(self, pieces: tuple[Piece, ...]) -> None:
        if self._player is None:
            self._before_jog = self.desired
        self._forget_motion()
        if not pieces:
            return
        self._player = Player((self.desired,))
        self._player.append(pieces)

    def _forget_motion(self) -> None:
        self._player = None
        self._homing = None
        self.aborting = False

    def _jog_settings(self) -> JogSettings:
        ta_ms, ts_ms = (float(max(0, math.floor(self.variable(n) + 0.5))) for n in (20, 21))
        return JogSettings(
            acceleration=self.variable(19),
            ta_ms=ta_ms or (0.0 if ts_ms else SHORTEST_RAMP_MS),
            ts_ms=ts_ms,
            speed=abs(self.variable(22)),
        )
