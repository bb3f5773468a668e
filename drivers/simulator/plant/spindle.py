"""The spindle of a lathe with any drive, and its errors: speed ripple, and radial error motion.

The ripple is the effect of belt, gears or load within a turn, which no servo removes; the radial error is how the
axis wanders as it turns, unseen by any encoder.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random

from drivers.simulator.plant.axis import Axis

PLACES = 3600  # angular resolution of the error motion: 0.1 deg, whose error is below a hundredth of it
PIECES = (2, 3, 4, 5, 7)  # undulations per revolution, synchronous; one is no error: off the axis, and round
STRAY_PER_TURN = (0.43, 2.57)  # the same, asynchronous: cage and rolling elements of a bearing
STRAY_FRACTION = 0.1  # asynchronous over synchronous part, peak to peak
FADES_IN_TURNS = 0.25  # turns over which the ripple fades: the spindle must not jump, nor turn by itself
FADES_IN_S = 0.1  # time constant with which it fades while the spindle stands
NONE_BELOW_RPM, FULL_FROM_RPM = 3.0, 20.0  # the ripple fades in between: a standing spindle has none
SMOOTHED_S = 0.02  # time constant of the mean speed: servo motion at rest is not speed
GONE_COUNTS = 1e-3


class RadialError:
    """Harmonics of falling size and random phases, `um_pp` peak to peak over a turn; a few asynchronous."""

    def __init__(self, um_pp: float, random: Random) -> None:
        phases = [(n, random.uniform(0.0, 2.0 * math.pi)) for n in PIECES]
        turn = [2.0 * math.pi * place / PLACES for place in range(PLACES)]
        raw = [sum(math.cos(n * angle + phase) / n for n, phase in phases) for angle in turn]
        scale = um_pp / 1000.0 / (max(raw) - min(raw))
        self._repeats_mm = [scale * value for value in raw]
        self._stray_mm = 0.25 * STRAY_FRACTION * um_pp / 1000.0
        self._strays = [(2.0 * math.pi * each, random.uniform(0.0, 2.0 * math.pi)) for each in STRAY_PER_TURN]
        self.most_mm = max(max(self._repeats_mm), -min(self._repeats_mm)) + len(self._strays) * self._stray_mm

    def at_mm(self, turns: float) -> float:
        """Return the displacement of the work towards the tool, mm, at spindle position `turns` from its index."""
        (rate_1, phase_1), (rate_2, phase_2) = self._strays
        strays = math.sin(rate_1 * turns + phase_1) + math.sin(rate_2 * turns + phase_2)
        return self._repeats_mm[int(turns % 1.0 * PLACES) % PLACES] + self._stray_mm * strays


class SimulatedSpindle:
    """A rotary axis: one of the drives, and a speed ripple after it that its loop does not see.

    `speed_ripple` is the fraction f by which the speed varies about its mean v, `ripple_per_turn` times a turn.
    With k = 2 pi per_turn / turn and a phase p, the angle is x + (f / k) sin(k x + p), and so the speed
    v (1 + f cos(k x + p)).
    """

    def __init__(
        self,
        drive: Axis,
        counts_per_turn: float,
        cycle_s: float,
        built: tuple[float, int] = (0.0, 2),
        phase_rad: float = 0.0,
    ) -> None:
        """`built` is its ripple without a fault: the fraction, and the cycles per turn."""
        self.drive = drive
        self.speed_ripple, self.ripple_per_turn = self._built = built
        self._counts_per_turn = counts_per_turn
        self._cycle_s = cycle_s
        self._phase_rad = phase_rad
        self._amplitude = 0.0  # counts; not 0 while there is some ripple, commanded or still fading
        self._speed = 0.0  # counts/s
        self._per_turn = 0
        self._last: float | None = None

    def swing_as_built(self) -> None:
        """Restore the ripple without a fault."""
        self.speed_ripple, self.ripple_per_turn = self._built

    @property
    def origin(self) -> float:
        """Machine position of motor zero."""
        return self.drive.origin

    @origin.setter
    def origin(self, counts: float) -> None:
        self.drive.origin = counts

    @property
    def encoder_lost(self) -> bool:
        """Whether the encoder does not count."""
        return self.drive.encoder_lost

    @encoder_lost.setter
    def encoder_lost(self, lost: bool) -> None:
        self.drive.encoder_lost = lost

    @property
    def jammed(self) -> bool:
        """Whether the axis stands still whatever the force."""
        return self.drive.jammed

    @jammed.setter
    def jammed(self, jammed: bool) -> None:
        self.drive.jammed = jammed

    def close_loop(self) -> float:
        """Hold the present mean position; the ripple is a following error."""
        return self.drive.close_loop()

    def rebase(self, counts: float) -> None:
        """Shift the motor's zero by `counts`."""
        self.drive.rebase(counts)

    def follow(self, commands: Sequence[float]) -> list[float]:
        """Run one servo cycle per command."""
        return self._add_ripple(self.drive.follow(commands))

    def push(self, output: float, cycles: int) -> list[float]:
        """Run in open loop."""
        return self._add_ripple(self.drive.push(output, cycles))

    def coast(self, cycles: int) -> list[float]:
        """Run with the amplifier disabled."""
        return self._add_ripple(self.drive.coast(cycles))

    def _add_ripple(self, track: list[float]) -> list[float]:
        """Return a track with the ripple; a jammed axis stays."""
        if not (self.speed_ripple or self._amplitude):
            return track
        origin, jammed = self.origin, self.jammed
        if not self._amplitude:
            self._per_turn = self.ripple_per_turn
        rad_per_count = 2.0 * math.pi * self._per_turn / self._counts_per_turn
        # Another number of cycles per turn starts when this one has faded out.
        target = self.speed_ripple / rad_per_count if self._per_turn == self.ripple_per_turn else 0.0
        if not self._amplitude and (jammed or (self._last is not None and self._creeps(track, self._last))):
            turned = track  # without a ripple each is where its mean is
            self._last = track[-1] + origin
        else:
            turned = self._fade_ripple(track, target, rad_per_count)
        if not (self.speed_ripple or self._amplitude):
            self._last, self._speed = None, 0.0
        return turned

    def _creeps(self, track: list[float], last: float) -> bool:
        """Whether the spindle is too slow for a ripple to begin in a block; if so, its speed is followed."""
        speed, origin, cycle_s, fastest = self._speed, self.origin, self._cycle_s, 0.0
        for mean in track:
            place = mean + origin
            speed += ((place - last) / cycle_s - speed) * cycle_s / SMOOTHED_S
            last = place
            if speed > fastest or -speed > fastest:
                fastest = abs(speed)
        if fastest / (self._counts_per_turn / 60.0) > NONE_BELOW_RPM:
            return False
        self._speed = speed
        return True

    def _fade_ripple(self, track: list[float], target: float, rad_per_count: float) -> list[float]:
        """Return a track with the ripple, which fades towards an amplitude of `target` counts."""
        origin, phase, cycle_s, last = self.origin, self._phase_rad, self._cycle_s, self._last
        speed, amplitude, jammed = self._speed, self._amplitude, self.jammed
        counts_per_rpm, fades_in = self._counts_per_turn / 60.0, FADES_IN_TURNS * self._counts_per_turn
        turned = []
        for mean in track:
            place = mean + origin
            if last is not None and not jammed:
                speed += ((place - last) / cycle_s - speed) * cycle_s / SMOOTHED_S
                rise = (abs(speed) / counts_per_rpm - NONE_BELOW_RPM) / (FULL_FROM_RPM - NONE_BELOW_RPM)
                aim = target if rise >= 1.0 else target * rise if rise > 0.0 else 0.0
                part = abs(speed) * cycle_s / fades_in
                if aim < amplitude:
                    part = max(part, cycle_s / FADES_IN_S)
                amplitude += (aim - amplitude) * (part if part < 1.0 else 1.0)
                if not aim and amplitude < GONE_COUNTS:
                    amplitude = 0.0
            last = place
            turned.append(mean + amplitude * math.sin(rad_per_count * place + phase))
        self._speed, self._amplitude, self._last = speed, amplitude, last
        return turned
