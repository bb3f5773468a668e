"""The force of a cut at the order of the lobe: are sign and angle of its compensation right? Without a gauge.

A blank that was round before it was clamped is pressed in where the part will spring back: its clamped surface is
s = -L, with L the lobe of the blank, an infeed as the path is. A tool at the infeed x cuts the depth x + s; the
cut pushes it out with K (x + s). So the force at N per turn is K (x - L): it vanishes where the whole lobe is
followed, is -K L / 2 in the half stage, and -3 K L / 2 there with the sign wrong. Solved for what the tool met,

L = x - F / K,    q = L / W,    W the whole path of the cut (the target over its fraction)

and q is 1 with sign and angle right, -1 with the sign wrong, and exp(-j N d) where the lobe is d further on than
the path has it.

F is what the motor gives beyond what the same motion needs in air, in the turns just before the tool meets the
part: of U thrust and D = exp(-j w 1.5 T), what the hold and a servo cycle delay,

F = D (U_cut - U_air r / |r|) - (|r| - 1) Z x_air r / |r|,    r = x_cut / x_air,    Z = -M w^2 + j B w

Mass, dry friction, cogging and the gain of the drive are in both, and drop out: a friction has the same height at
another amplitude, and turns with the motion; mass and damping of the profile scale the rest, |r| - 1, which is
some per cent. Guides that give way before they roll have a friction that grows with the amplitude: what
D U_air - Z x_air has of it is taken to be uncertain by half of |r| - 1, in any direction. K is the mean force over
the mean depth of the same turns, so that the gain drops out of F / K, too.
Where K is a fraction e off, q is off by e F / (K W).

Harmonics are Re(c exp(j N angle)), angle from the spindle's index; infeeds are positive into the work, um; a force
is positive where it pushes the tool out, N.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from profiles.arrays import Floats
from profiles.least_squares import fit, harmonic_columns, harmonic_slice, student

FULL_CHIP_TURNS = 2.0  # after the face, until the chip is full and the tool has yielded
BEFORE_FACE_TURNS = 0.25  # what the place of the face may be off, by the time between angle and carriage of a poll
LEAST_TURNS = 2  # in air, and in the part
STEADY = 0.97  # of the amplitude of the last turn in air: below it the program still raises it
MULTIPLES = (1, 2, 3, 5)  # of the lobe: dry friction has the odd ones
SAMPLES_A_PERIOD = 3.0  # of the highest order that is fitted

STIFFNESS_SD = 0.2  # of the cut, relative: touch-off and mean of the blank, of a depth of some tenths of a mm
LAG_SD_S = 0.0002  # of the current, which no profile states
FRICTION_SD = 0.35  # of a friction, for the relative change of its amplitude: 0 dry, 1 before rollers roll
LEAST_FORCE_FRACTION = 0.1  # of the predicted mean force: the law is good to 50 %
SURE = 2.0  # standard deviations, 95 %
LEAST_RATIO, MOST_RATIO = 0.5, 2.0  # of the lobe that the tool met over the one of the path
MOST_SD_DEG = 22.5  # of the angle of the lobe, in degrees of its own: 45 with 95 %, a right angle between cases
AGREES_DEG = 30.0
"""Angle of the lobe, in degrees of its own, that is no error of the set-up: half of it is left there."""
MIRRORED_DEG = 150.0  # from which on the sign is wrong


class Sign(StrEnum):
    """What the force says of sign and angle of the compensation."""

    AGREES = "agrees"
    WRONG_SIGN = "wrong_sign"
    TURNED = "turned"
    UNKNOWN = "unknown"


class ForceNullReason(StrEnum):
    """Why it says nothing; `NONE` where it does."""

    NONE = ""
    NOT_GATHERED = "not_gathered"
    NO_REFERENCE = "no_reference"
    NO_FORCE = "no_force"
    NOISE = "noise"
    ROUND = "round"
    TOO_LARGE = "too_large"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceRecord:
    """Samples of servo cycles, shape (M,): spindle angle (deg), infeed of the tip from the surface (um), thrust.

    The thrust is what the output commands, N, positive into the work. The leading edge meets the face of the part
    at the spindle angle `face_deg`.
    """

    angle_deg: Floats
    infeed_um: Floats
    thrust_n: Floats
    face_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedForce:
    """What the cut is meant to be: `whole_um` the harmonic of the whole path at `lobes` per turn, infeed.

    `passive_n` is the predicted mean force, `mass_kg` and `damping_n_s_per_m` those of the tool, `cycle_s` the
    servo period, `turns_hz` the speed of the spindle.
    """

    lobes: int
    whole_um: complex
    passive_n: float
    mass_kg: float
    damping_n_s_per_m: float
    cycle_s: float
    turns_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceNull:
    """What the force of a cut says of its compensation.

    `force_n` is the c of the force Re(c exp(j N angle)), N, with N the `lobes` a turn and the angle that of the
    spindle from its index; positive where the force pushes the tool out. `force_sd_n` is the standard deviation of
    each of its two components, N. `right_n` and `wrong_n` are what `force_n` would be with sign and angle right,
    and with the sign wrong; `mean_n` is the mean force, N, positive outwards. `ratio` is the lobe that the tool
    met over the one of the path, no unit: 1 is right, -1 the wrong sign, and its phase falls by N degrees with
    each degree that the lobe is further on. `turned_deg` is by how much that is, degrees of spindle in its own
    direction, within half a lobe; `turned_sd_deg` its standard deviation. All are single numbers of one section,
    over `air_turns` before the part and `cut_turns` in it; 0 where `why` says that nothing was found.
    """

    sign: Sign
    why: ForceNullReason = ForceNullReason.NONE
    lobes: int
    force_n: complex = 0j
    force_sd_n: float = 0.0
    right_n: complex = 0j
    wrong_n: complex = 0j
    mean_n: float = 0.0
    ratio: complex = 0j
    turned_deg: float = 0.0
    turned_sd_deg: float = 0.0
    air_turns: int = 0
    cut_turns: int = 0

    @property
    def alarms(self) -> bool:
        """Whether it contradicts the compensation."""
        return self.sign in (Sign.WRONG_SIGN, Sign.TURNED)


def unknown(lobes: int, why: ForceNullReason) -> ForceNull:
    """Return that nothing was found, and why."""
    return ForceNull(sign=Sign.UNKNOWN, why=why, lobes=lobes)


def force_null(record: ForceRecord, expected: ExpectedForce) -> ForceNull:
    """Return what a record of a cut, from before its face on, says of sign and angle of its compensation."""
    lobes = expected.lobes
    if record.angle_deg.size < 2 or not expected.whole_um:
        return unknown(lobes, ForceNullReason.NOT_GATHERED)
    onwards = 1.0 if record.angle_deg[-1] >= record.angle_deg[0] else -1.0
    turns = onwards * (record.angle_deg - record.face_deg) / 360.0
    air, cut = _air(record, turns, lobes), _select_cut_window(record, turns, lobes)
    if air is None or cut is None:
        return unknown(lobes, ForceNullReason.NO_REFERENCE)
    mean_n = cut.thrust.mean - air.thrust.mean
    mean_sd_n = math.hypot(cut.thrust.mean_sd, air.thrust.mean_sd)
    if mean_n < max(LEAST_FORCE_FRACTION * expected.passive_n, 2.0 * SURE * mean_sd_n) or cut.infeed.mean <= 0.0:
        return unknown(lobes, ForceNullReason.NO_FORCE)
    return _judge_windows(air, cut, mean_n, mean_sd_n, expected, onwards)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Harmonic:
    """The harmonic of one channel in a window, its mean, and the standard deviation of each component.

    All in the unit of the channel: um of infeed, N of thrust.
    """

    value: complex
    sd: float
    mean: float
    mean_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Window:
    """Whole turns in which nothing changes."""

    infeed: _Harmonic
    thrust: _Harmonic
    turns: int


def _air(record: ForceRecord, turns: Floats, lobes: int) -> _Window | None:
    """Return the last turns before the face with a steady amplitude, None if they are too few."""
    most = math.floor(-float(turns.min()) - BEFORE_FACE_TURNS)
    firsts = [-turn - BEFORE_FACE_TURNS for turn in range(1, most + 1)]
    amplitudes_um = [abs(_window(record, turns, lobes, first, 1).infeed.value) for first in firsts]
    rises = (turn for turn, each in enumerate(amplitudes_um) if each < STEADY * amplitudes_um[0])
    count = next(rises, max(most, 0))
    return _window(record, turns, lobes, firsts[count - 1], count) if count >= LEAST_TURNS else None


def _select_cut_window(record: ForceRecord, turns: Floats, lobes: int) -> _Window | None:
    """Return all whole turns with a full chip, None if they are too few."""
    count = math.floor(float(turns.max()) - FULL_CHIP_TURNS)
    return None if count < LEAST_TURNS else _window(record, turns, lobes, FULL_CHIP_TURNS, count)


def _window(record: ForceRecord, turns: Floats, lobes: int, first: float, count: int) -> _Window:
    each = [_of_turn(record, turns, lobes, first + turn) for turn in range(count)]
    infeed, thrust = (np.array(found) for found in zip(*each, strict=True))
    return _Window(infeed=_over_turns(infeed), thrust=_over_turns(thrust), turns=count)


def _of_turn(record: ForceRecord, turns: Floats, lobes: int, first: float) -> tuple[Floats, Floats]:
    """Return mean, and both components of the harmonic, of infeed and thrust in one turn: a lock-in."""
    inside = (turns >= first) & (turns < first + 1.0)
    angle_rad = np.radians(record.angle_deg[inside])
    highest = angle_rad.size / SAMPLES_A_PERIOD
    orders = sorted({lobes} | {n for n in (1, 2, *(lobes * each for each in MULTIPLES)) if n <= highest})
    columns = harmonic_columns(angle_rad, orders)
    place = harmonic_slice(orders.index(lobes))
    channels = (fit(columns, values[inside]).coefficients for values in (record.infeed_um, record.thrust_n))
    infeed, thrust = (np.array([found[0], *found[place]]) for found in channels)
    return infeed, thrust


def _over_turns(found: Floats) -> _Harmonic:
    """Return the mean of so many turns, shape (n, 3), and its standard deviation by their scatter.

    The noise of a servo is far from white, which a fit through the samples would take it for. Neighbouring turns
    share the reading between them, so that their mean is surer than this. So few turns tell their scatter badly:
    it is widened as Student's t is.
    """
    count, freedom = found.shape[0], found.shape[0] - 1
    mean, cosine, sine = found.mean(axis=0)
    if not freedom:
        return _Harmonic(value=complex(cosine, -sine), sd=math.inf, mean=float(mean), mean_sd=math.inf)
    squares, cosines, sines = ((found - found.mean(axis=0)) ** 2).sum(axis=0) / (freedom * count)
    return _Harmonic(
        value=complex(cosine, -sine),
        sd=_student_widening(2 * freedom) * math.sqrt((cosines + sines) / 2.0),
        mean=float(mean),
        mean_sd=_student_widening(freedom) * math.sqrt(squares),
    )


def _student_widening(freedom: int) -> float:
    return student(freedom) / student(math.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Force:
    """The harmonic of the force with the standard deviation of each component, and the effect of friction."""

    value_n: complex
    sd_n: float
    friction_n: float
    omega_rad_s: float


def _force_at_lobe(air: _Window, cut: _Window, expected: ExpectedForce, onwards: float) -> _Force:
    """Return what the motor gives in the part beyond what the same motion needs in air."""
    omega_rad_s = onwards * 2.0 * math.pi * expected.lobes * expected.turns_hz
    mass_n_per_um = -1e-6 * expected.mass_kg * omega_rad_s**2
    moved_n_per_um = complex(mass_n_per_um, 1e-6 * expected.damping_n_s_per_m * omega_rad_s)
    # The output is applied one servo cycle after it was gathered, and held for a cycle: half a cycle more.
    delayed = cmath.exp(-1.5j * omega_rad_s * expected.cycle_s)
    ratio = cut.infeed.value / air.infeed.value
    turned, more = ratio / abs(ratio), abs(ratio) - 1.0
    moved_n = moved_n_per_um * air.infeed.value
    return _Force(
        value_n=delayed * (cut.thrust.value - air.thrust.value * turned) - more * moved_n * turned,
        sd_n=math.hypot(cut.thrust.sd, air.thrust.sd, *(abs(moved_n_per_um) * x.infeed.sd for x in (air, cut))),
        friction_n=abs(delayed * air.thrust.value - moved_n) * abs(more) * FRICTION_SD,
        omega_rad_s=omega_rad_s,
    )


def _judge_windows(
    air: _Window, cut: _Window, mean_n: float, mean_sd_n: float, expected: ExpectedForce, onwards: float
) -> ForceNull:
    lobes, whole_um = expected.lobes, expected.whole_um
    force = _force_at_lobe(air, cut, expected, onwards)
    stiffness_n_per_um = mean_n / cut.infeed.mean
    lobe_n = stiffness_n_per_um * abs(whole_um)
    by_force = force.value_n / stiffness_n_per_um / whole_um
    met = cut.infeed.value / whole_um - by_force
    noise = math.hypot(force.sd_n / lobe_n, cut.infeed.sd / abs(whole_um))
    wrong = (by_force * math.hypot(STIFFNESS_SD, mean_sd_n / mean_n), 1j * by_force * force.omega_rad_s * LAG_SD_S)
    across = 1j * met / abs(met)
    off = ((each * across.conjugate()).real for each in wrong)
    sd_rad = math.hypot(noise, force.friction_n / lobe_n, *off) / abs(met)
    lobe_deg, lobe_sd_deg = math.degrees(cmath.phase(met)), math.degrees(sd_rad)
    sign, why = _verdict(abs(met), noise, lobe_deg, lobe_sd_deg)
    return ForceNull(
        sign=sign,
        why=why,
        lobes=lobes,
        force_n=force.value_n,
        force_sd_n=force.sd_n,
        right_n=stiffness_n_per_um * (cut.infeed.value - whole_um),
        wrong_n=stiffness_n_per_um * (cut.infeed.value + whole_um),
        mean_n=mean_n,
        ratio=met,
        turned_deg=-lobe_deg / lobes,
        turned_sd_deg=lobe_sd_deg / lobes,
        air_turns=air.turns,
        cut_turns=cut.turns,
    )


def _verdict(ratio: float, noise: float, lobe_deg: float, sd_deg: float) -> tuple[Sign, ForceNullReason]:
    """Return the verdict, from the size of the lobe that the tool met and its angle against the path's."""
    if noise > LEAST_RATIO / (2.0 * SURE):
        return Sign.UNKNOWN, ForceNullReason.NOISE
    if ratio < LEAST_RATIO:
        return Sign.UNKNOWN, ForceNullReason.ROUND
    if ratio > MOST_RATIO:
        return Sign.UNKNOWN, ForceNullReason.TOO_LARGE
    off_deg = abs(lobe_deg)
    if off_deg <= AGREES_DEG and sd_deg <= MOST_SD_DEG:
        return Sign.AGREES, ForceNullReason.NONE
    if sd_deg > MOST_SD_DEG or off_deg - SURE * sd_deg <= AGREES_DEG:
        return Sign.UNKNOWN, ForceNullReason.NOISE
    return (Sign.WRONG_SIGN if off_deg >= MIRRORED_DEG else Sign.TURNED), ForceNullReason.NONE
