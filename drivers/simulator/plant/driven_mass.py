"""A mass driven by a current amplifier: the slide of a linear motor, or the rotor of a spindle motor.

It is described in axis units, motor counts and DAC bits, so that one loop serves both. On dry guides, and with a
current that lags, its motion is exact through a servo cycle, stop and start included. What makes an axis more than
that: a flexible mode (`SimulatedMode`), and friction that builds up over a distance (`Presliding`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from drivers.simulator.plant.tip_load import TipLoad

PARTS = 4  # of a servo cycle in which a slide comes to rest, or starts, while its current changes
NO_DAMPING = 1e-6  # loss of speed in a servo cycle below which the formulas with damping cancel out


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroOrderHold:
    """One servo cycle of a mass under a constant force, exact.

    With x in counts, v in counts/s and the force in DAC bits, at the end of the cycle
    x' = x + glide v + push_x force and v' = decay v + push_v force.
    """

    decay: float
    glide: float
    push_x: float
    push_v: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenMass:
    """A mass with viscous damping driven by a current amplifier, as in Eq 9 and Table 4 of the paper.

    `damping_per_s` is damping over mass, `acceleration_per_bit` in counts/s2. `friction` is the deceleration by
    Coulomb friction, in counts/s2, at any speed; at rest it holds against a force below it.
    """

    damping_per_s: float
    acceleration_per_bit: float
    peak_output_bits: float
    friction: float = 0.0

    def zero_order_hold(self, cycle_s: float) -> ZeroOrderHold:
        """Return its motion in a servo cycle of `cycle_s`, without the friction."""
        rate = self.damping_per_s
        if rate * cycle_s < NO_DAMPING:
            glide, push = cycle_s, 0.5 * cycle_s**2
        else:
            glide = -math.expm1(-rate * cycle_s) / rate
            push = (cycle_s - glide) / rate
        return ZeroOrderHold(
            decay=math.exp(-rate * cycle_s),
            glide=glide,
            push_x=push * self.acceleration_per_bit,
            push_v=glide * self.acceleration_per_bit,
        )


def linear_motor(
    *,
    mass_kg: float,
    damping_n_s_per_m: float,
    force_n_per_bit: float,
    peak_output_bits: float,
    counts_per_m: float,
    friction_n: float = 0.0,
) -> DrivenMass:
    """Return the slide of a linear motor."""
    return DrivenMass(
        damping_per_s=damping_n_s_per_m / mass_kg,
        acceleration_per_bit=force_n_per_bit / mass_kg * counts_per_m,
        peak_output_bits=peak_output_bits,
        friction=friction_n / mass_kg * counts_per_m,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLag:
    """Effect of a current lag within a servo cycle; exact for a constant command.

    The difference d between the force and its command decays as d exp(-t / lag). At the end of the cycle `left` of
    it remains; `mean` is its mean over the cycle. Compared with that constant mean, it moves the mass by an
    additional `more_x` d and its speed by `more_v` d, because more of it comes early (counts and counts/s, d in
    counts/s2).
    """

    left: float
    mean: float
    more_x: float
    more_v: float


def current_lag(mass: DrivenMass, cycle_s: float, lag_s: float) -> CurrentLag:
    """Return the lag of a first-order current loop with the time constant `lag_s`, above 0, through one cycle.

    With r = damping over mass: v = (exp(-T/lag) - exp(-r T)) / (r - 1/lag), x = (lag (1 - exp(-T/lag)) - v) / r.
    """
    left, rate = math.exp(-cycle_s / lag_s), mass.damping_per_s
    impulse_s = lag_s * (1.0 - left)
    if rate * cycle_s < NO_DAMPING:
        v, x = impulse_s, lag_s * (cycle_s - impulse_s)
    else:
        v = (left - math.exp(-rate * cycle_s)) / (rate - 1.0 / lag_s)
        x = (impulse_s - v) / rate
    mean = impulse_s / cycle_s
    held = mass.zero_order_hold(cycle_s)
    per_unit = 1.0 / mass.acceleration_per_bit if mass.acceleration_per_bit else 0.0
    return CurrentLag(
        left=left, mean=mean, more_x=x - mean * held.push_x * per_unit, more_v=v - mean * held.push_v * per_unit
    )


class DrySlide:
    """One servo cycle of a mass with viscous damping and Coulomb friction under a constant force.

    With `lag_s` the force follows its command with that time constant, which is exact while the mass slides; a
    cycle with a stop or a start is stepped in `PARTS`, each of which uses the mean of its force.
    """

    def __init__(self, mass: DrivenMass, cycle_s: float, lag_s: float = 0.0, *, is_part: bool = False) -> None:
        self._one = replace(mass, acceleration_per_bit=1.0)
        self._friction = mass.friction
        self._per_bit = mass.acceleration_per_bit
        self._cycle_s = cycle_s
        self._whole = self._one.zero_order_hold(cycle_s)
        self._lag = current_lag(self._one, cycle_s, lag_s) if lag_s else None
        self._part = DrySlide(mass, cycle_s / PARTS, lag_s, is_part=True) if lag_s and not is_part else self
        self.driven = 0.0  # counts/s2, by the current at the beginning of a cycle

    @property
    def constants(self) -> tuple[float, ...]:
        """Friction, acceleration by a bit, the lag (0 without) and a whole cycle, for a loop that does `step`."""
        whole, lag = self._whole, self._lag
        late = (lag.left, lag.mean, lag.more_x, lag.more_v) if lag is not None else (0.0, 0.0, 0.0, 0.0)
        return (self._friction, self._per_bit, *late, whole.decay, whole.glide, whole.push_x, whole.push_v)

    def step(self, x: float, v: float, force: float, load: float = 0.0) -> tuple[float, float]:
        """Return position and speed (counts, counts/s) a cycle later, by `force` (bits) and `load` (counts/s2)."""
        drive, late = force * self._per_bit, 0.0
        if self._lag is not None:
            late = self.driven - drive
            self.driven = drive + self._lag.left * late
            drive += self._lag.mean * late
        return self.advance(x, v, drive + load, late)

    def advance(self, x: float, v: float, drive: float, late: float) -> tuple[float, float]:
        """Return position and speed after a cycle by the mean `drive`, of which `late` fades (counts/s2)."""
        lag, whole, friction = self._lag, self._whole, self._friction
        if friction and v == 0.0:
            return self.start(x, drive, late)
        more_x, more_v = (lag.more_x * late, lag.more_v * late) if lag is not None else (0.0, 0.0)
        pull = drive - math.copysign(friction, v)
        later = whole.decay * v + whole.push_v * pull + more_v
        if later * v > 0.0 or not friction:
            return x + whole.glide * v + whole.push_x * pull + more_x, later
        return self.stop(x, v, drive, late)

    def start(self, x: float, drive: float, late: float) -> tuple[float, float]:
        """Return position and speed after a cycle from rest; `drive` and `late` as in `advance`."""
        if self._part is not self and abs(drive) > self._friction:
            return self._in_parts(x, 0.0, drive, late)
        return self._from_rest(x, drive, self._cycle_s)

    def stop(self, x: float, v: float, drive: float, late: float) -> tuple[float, float]:
        """Return position and speed after a cycle in which the slide comes to rest, and may start again."""
        if self._part is not self:
            return self._in_parts(x, v, drive, late)
        pull = drive - math.copysign(self._friction, v)
        stops_s = min(self._time_to_rest(v, pull), self._cycle_s)
        glide, push = self._glide_and_push(stops_s)
        return self._from_rest(x + glide * v + push * pull, drive, self._cycle_s - stops_s)

    def _in_parts(self, x: float, v: float, drive: float, late: float) -> tuple[float, float]:
        """Return position and speed after a cycle, stepped in parts of it."""
        _, _, left, mean, *_ = self._part.constants
        asked = drive - self.constants[3] * late
        for _ in range(PARTS):
            x, v = self._part.advance(x, v, asked + mean * late, late)
            late *= left
        return x, v

    def fades(self, cycles: int) -> bool:
        """Let the current fade at rest without a command; False, and nothing is done, where that could move it."""
        if not self._friction or abs(self.driven) > self._friction:
            return False
        if self._lag is not None:
            for _ in range(cycles):
                self.driven = 0.0 + self._lag.left * (self.driven - 0.0)  # the operations of `step`, to the bit
        return True

    def _from_rest(self, x: float, drive: float, left_s: float) -> tuple[float, float]:
        if abs(drive) <= self._friction or left_s <= 0.0:
            return x, 0.0
        pull = drive - math.copysign(self._friction, drive)
        glide, push = self._glide_and_push(left_s)
        return x + push * pull, glide * pull

    def _glide_and_push(self, time_s: float) -> tuple[float, float]:
        """Return glide and push of `DrivenMass.zero_order_hold`, which are all that a part of a cycle needs."""
        rate = self._one.damping_per_s
        if rate * time_s < NO_DAMPING:
            return time_s, 0.5 * time_s**2
        glide = -math.expm1(-rate * time_s) / rate
        return glide, (time_s - glide) / rate

    def _time_to_rest(self, v: float, pull: float) -> float:
        """Return when a pull has reduced a speed to 0: v exp(-rt) + pull (1 - exp(-rt)) / r = 0."""
        if pull * v >= 0.0:
            return self._cycle_s  # it only comes to rest because of the current lag
        rate = self._one.damping_per_s
        return -v / pull if rate == 0.0 else math.log1p(-rate * v / pull) / rate


class SimulatedMode:
    """A resonance that the scale sees: something between motor, scale and tip that bends. Counts, Hz.

    q'' + 2 z w q' + w^2 q = c a, with a the acceleration that the current gives the rigid axis, c the fraction of
    the mode and z its damping ratio. Scale and tip are at x + q; `bend` is q. A constant force through a servo
    cycle moves it exactly. Neither friction nor the force of the cut bends it.
    """

    def __init__(
        self, hz: float, damping_ratio: float, fraction: float, cycle_s: float, lag_s: float = 0.0
    ) -> None:
        """Take frequency, damping and fraction, and the time constant of the current."""
        omega = 2.0 * math.pi * hz
        damped = omega * math.sqrt(1.0 - damping_ratio**2)
        fade, decay = math.exp(-damping_ratio * omega * cycle_s), damping_ratio * omega
        cosine, sine = fade * math.cos(damped * cycle_s), fade * math.sin(damped * cycle_s) / damped
        self._own = cosine + decay * sine, sine, -(omega**2) * sine, cosine - decay * sine
        self._static = fraction / omega**2
        rate = 1.0 / lag_s if lag_s else 0.0
        # A part of the acceleration that decays as exp(-rate t) has a bend that does, too.
        fading = fraction / (rate**2 - 2.0 * damping_ratio * omega * rate + omega**2) if lag_s else 0.0
        self._fading = fading, rate, math.exp(-rate * cycle_s)
        self.bend = 0.0
        self._speed = 0.0

    def step(self, acceleration: float, late: float = 0.0) -> None:
        """Advance one cycle under the commanded acceleration of the rigid axis, counts/s2.

        `late` is by how much that of the current is more when the cycle begins.
        """
        rest, (fading, rate, left) = self._static * acceleration, self._fading
        faded = fading * late
        off, speed = self.bend - rest - faded, self._speed + rate * faded
        own = self._own
        self.bend = rest + left * faded + own[0] * off + own[1] * speed
        self._speed = own[2] * off + own[3] * speed - rate * left * faded


class Presliding:
    """A load on the tool: friction of its rolling guides, and the force of the cut (`TipLoad`) if there is one.

    Dahl's law with exponent 1, a slide on a spring until it slides: with each displacement dx the friction F comes
    nearer to its limit F_c against the motion, dF/dx = (F_c - F sign(dx)) / s, at any speed.

    `limit` is F_c as a deceleration, counts/s2; `distance` is s, counts, where 63 % of it are there. Forces are
    positive with the direction of counting.
    """

    acts = True

    def __init__(self, limit: float, distance: float, cut: TipLoad | None) -> None:
        self._limit, self._distance, self._cut = limit, distance, cut
        self._cutting: TipLoad | None = None
        self._at: float | None = None
        self._drag = 0.0

    @property
    def led(self) -> bool:
        """Whether the force of the cut is found for each servo cycle."""
        return self._cut is not None and self._cut.led

    def begin(self) -> None:
        """Begin a block of servo cycles."""
        if self._cut is not None:
            self._cut.begin()
            self._cutting = self._cut if self._cut.acts else None

    def push(self, place: float) -> float:
        """Return the acceleration through the servo cycle that begins at this place, counts/s2.

        It is that of the middle of the cycle, as if the speed stayed: taken at its beginning the spring would
        lag by half a cycle, which is a damping below 0.
        """
        moved = 0.0 if self._at is None else place - self._at
        self._at = place
        self._drag = self._friction_after(moved)
        pushed = self._friction_after(0.5 * moved)
        return -pushed if self._cutting is None else self._cutting.push(place) - pushed

    def _friction_after(self, moved: float) -> float:
        """Return the friction against the motion, positive with counting, after a displacement."""
        limit = math.copysign(self._limit, moved)
        return limit + (self._drag - limit) * math.exp(-abs(moved) / self._distance)
