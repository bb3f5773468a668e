"""A conventional spindle: an induction motor on an inverter, switched and set at the lathe.

The controller reads its encoder and never closes its loop: the controller's output is not connected.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from drivers.simulator.plant.axis import EncoderAxis, read_encoder
from drivers.simulator.plant.true_parameters import TrueParameters


class InverterSpindle(EncoderAxis):
    """A spindle that turns as its inverter commands, whatever the controller commands.

    `load_n_m` is the torque of the cut. Enabled while it coasts, the inverter catches it at its speed. The slip is
    `slip_rpm` of its true parameters at the peak torque, or less below.
    """

    def __init__(self, true: TrueParameters, counts_per_turn: float, cycle_s: float, origin: float) -> None:
        super().__init__(origin)
        self.load_n_m = 0.0
        self._true = true
        self._counts_per_rad = counts_per_turn / (2.0 * math.pi)
        self._cycle_s = cycle_s
        self._speed = 0.0  # rad/s
        self._field = 0.0  # inverter output, rad/s
        self._target: float | None = None  # rad/s; None is disabled

    @property
    def speed_rpm(self) -> float:
        """Its true speed."""
        return self._speed * 30.0 / math.pi

    def set_rpm(self, rpm: float) -> None:
        """Enable and ramp to a speed; positive is the direction of the cut."""
        if self._target is None:
            self._field = self._speed
        self._target = rpm * math.pi / 30.0

    def switch_off(self) -> None:
        """Let it coast."""
        self._target = None

    def close_loop(self) -> float:
        """Return the present reading, the last one of an encoder that does not count; there is no loop."""
        return self._reading if self.encoder_lost else read_encoder(self._x)

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Turn; the commands have no effect."""
        return self.coast(len(commands))

    def push(self, output: float, cycles: int) -> list[float]:
        """Turn; the output has no effect."""
        return self.coast(cycles)

    def coast(self, cycles: int) -> list[float]:
        """Turn as the inverter commands, or coast."""
        track, steady = [], False
        x, speed, cycle_s, counts_per_rad = self._x, self._speed, self._cycle_s, self._counts_per_rad
        for _ in range(cycles):
            before = speed
            if not steady:
                # The field that has come to its target stays, and so does all that follows from it.
                steady = not self.jammed and self._field == self._target
                speed = self._speed = self._next_speed()
            x += 0.5 * (before + speed) * cycle_s * counts_per_rad
            track.append(x)
        self._x = x
        self._blind = self.encoder_lost
        if not self._blind:
            self._reading = float(read_encoder(self._x))
        return track

    def _next_speed(self) -> float:
        """Return the speed a cycle later: the field less the slip, or decelerated by drag and load."""
        true = self._true
        inertia_kg_m2, drag_n_m_s_per_rad = true.spindle_inertia_kg_m2, true.spindle_drag_n_m_s_per_rad
        against_n_m = true.spindle_friction_n_m + self.load_n_m
        if self._target is None:
            slower = self._speed * math.exp(-drag_n_m_s_per_rad / inertia_kg_m2 * self._cycle_s)
            slower -= math.copysign(against_n_m / inertia_kg_m2 * self._cycle_s, self._speed)
            stopped = self.jammed or slower * self._speed <= 0.0
            return 0.0 if stopped else slower
        if self.jammed:
            self._field = 0.0  # freed, it accelerates again by the ramp
            return 0.0
        most = true.ramp_rpm_per_s * math.pi / 30.0 * self._cycle_s
        self._field += max(-most, min(self._target - self._field, most))
        per_n_m = true.slip_rpm * math.pi / 30.0 / true.spindle_peak_torque_n_m
        loaded = abs(self._field) - per_n_m * against_n_m
        # The drag is part of the load, and depends on the resulting speed.
        return math.copysign(max(loaded, 0.0) / (1.0 + per_n_m * drag_n_m_s_per_rad), self._field)
