"""From the lobe of a job to the motion of the tool: Eqs 4, 6 to 8, 10 and 11 for any number of jaws.

Angles are spindle angles in degrees. Motion and depth are in um, positive into the workpiece. Deviations of the
released part are positive where it is high. The rule is independent of the cause of the lobe: the tool moves in
where the finished part would stand high.

A first part with an untried compensation gets a fraction of it, enough to judge sign and angle. A lobe E
compensated by the fraction s leaves E |1 - s c|, with c = 1 for a tool that follows exactly. At one half, a
wrong sign (c = -1) leaves 3/2 E, and an error of d degrees of spindle leaves E |1 - exp(-j N d) / 2|: the part
is worse by half a lobe at most, and the two cases are a whole lobe apart.

Learning corrects a path; it never replaces it. Anything beyond the bounds about what the job wants is not a
correction of this cut, but a fault of the trace, the file or the set-up, and must not be commanded.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.axis.response import AMPLIFICATION_LIMIT
from profiles.job import Job
from profiles.problem import Problem, refusal_error

PARTIAL_FRACTION = 0.5
AXIAL_POWERS = (1, 2)  # of an axial term: slope and curvature along a cut
PLACES_ALONG = np.linspace(-1.0, 1.0, 41)  # of a cut, in half lengths past its middle
TURNS_SIGN = 0.1  # factor of the amplitude at which what is even along the cut has seven tenths of its size


@dataclass(frozen=True, slots=True, kw_only=True)
class PathHarmonic:
    """amplitude cos(lobes (angle - phase)): order `lobes`, a maximum at the spindle angle `phase_deg`."""

    lobes: int
    amplitude_um: float
    phase_deg: float

    @classmethod
    def from_coefficient(cls, lobes: int, coefficient: complex) -> PathHarmonic:
        """Return Re(c exp(j lobes angle)), c in um, as a harmonic."""
        phase_deg = -math.degrees(cmath.phase(coefficient)) / lobes
        return cls(lobes=lobes, amplitude_um=abs(coefficient), phase_deg=phase_deg)

    @property
    def coefficient(self) -> complex:
        """The c of Re(c exp(j lobes angle)), in um."""
        return self.amplitude_um * cmath.exp(-1j * self.lobes * math.radians(self.phase_deg))

    def at_um(self, angle_deg: ArrayLike) -> Floats:
        """Return the values at spindle angles, in the shape of `angle_deg`."""
        angle = floats(angle_deg)
        return floats(self.amplitude_um * np.cos(self.lobes * np.radians(angle - self.phase_deg)))

    def turn_by(self, by_deg: float) -> PathHarmonic:
        """Return the harmonic turned by degrees of spindle: at angle + by_deg it has its value at angle."""
        return replace(self, phase_deg=self.phase_deg + by_deg)


@dataclass(frozen=True, slots=True, kw_only=True)
class AlongCut:
    """How a path changes along the cut: polynomials in s, half lengths past its middle towards the jaws.

    The amplitude of an order n of `orders` is 1 + c1 s + c2 s^2 + ... of that in the middle; other orders do not
    change. The mean is further in by m1 s + m2 s^2 + ... um. s is -1 where the cut begins, and 1 where it ends.
    `even` is the c of Re(c exp(j n angle)), um, of which an order has only the sign of its factor: what makes up
    for dry friction is as large for a small motion.
    """

    half_length_mm: float = 1.0
    orders: tuple[tuple[int, tuple[float, ...]], ...] = ()
    mean_um: tuple[float, ...] = ()
    even: tuple[tuple[int, complex], ...] = ()

    def powers(self, order: int) -> tuple[float, ...]:
        """Return c1, c2, ... of an order."""
        return dict(self.orders).get(order, ())

    def factor(self, order: int, past_middle_mm: ArrayLike) -> Floats:
        """Return the amplitude of an order over that in the middle, in the shape of `past_middle_mm`."""
        return floats(polyval(floats(past_middle_mm) / self.half_length_mm, (1.0, *self.powers(order))))

    def beyond_um(self, order: int, angle_deg: ArrayLike, past_middle_mm: ArrayLike) -> Floats:
        """Return what an order has more than its factor of that in the middle, at angles and places."""
        factor, even = self.factor(order, past_middle_mm), dict(self.even).get(order, 0j)
        sign = factor * math.hypot(1.0, TURNS_SIGN) / np.hypot(factor, TURNS_SIGN)
        return floats((sign - factor) * (even * np.exp(1j * order * np.radians(floats(angle_deg)))).real)

    def further_um(self, past_middle_mm: ArrayLike) -> Floats:
        """Return by how much the mean is further in than in the middle, in the shape of `past_middle_mm`."""
        return floats(polyval(floats(past_middle_mm) / self.half_length_mm, (0.0, *self.mean_um)))


@dataclass(frozen=True, slots=True, kw_only=True)
class AxialTerm:
    """(cos_um cos(lobes angle) + sin_um sin(lobes angle)) s^power, added to a path; `lobes` 0 is its mean.

    s is that of `AlongCut`: power 1 is a slope along the cut, 2 a curvature; both are none in the middle.
    """

    lobes: int
    power: int
    cos_um: float
    sin_um: float = 0.0

    @property
    def coefficient(self) -> complex:
        """The c of Re(c exp(j lobes angle)) s^power, in um."""
        return complex(self.cos_um, -self.sin_um)


def axial_terms(coefficients_um: Mapping[tuple[int, int], complex]) -> tuple[AxialTerm, ...]:
    """Return the terms with these coefficients, um, by order and power."""
    return tuple(
        AxialTerm(lobes=n, power=power, cos_um=c.real, sin_um=-c.imag)
        for (n, power), c in sorted(coefficients_um.items())
    )


def axial_um(terms: Iterable[AxialTerm]) -> dict[tuple[int, int], complex]:
    """Return the coefficients of terms, um, by order and power."""
    return {(term.lobes, term.power): term.coefficient for term in terms}


@dataclass(frozen=True, slots=True, kw_only=True)
class LobedPath:
    """mean + amplitude cos(lobes (angle - phase)) + overtones, by the angle of the spindle.

    Order `lobes`, with a maximum at `phase_deg`, is the lobe itself; `overtones` have other orders. All are those
    in the middle of the cut, and elsewhere as `along` has it, with the terms of `axial` beside that. `push_um` is
    how far the force of the cut pushes the tool out at first, for which a command makes up until the loop has.
    """

    mean_um: float
    amplitude_um: float
    lobes: int
    phase_deg: float
    overtones: tuple[PathHarmonic, ...] = ()
    along: AlongCut = AlongCut()
    axial: tuple[AxialTerm, ...] = ()
    push_um: float = 0.0

    @property
    def harmonics(self) -> tuple[PathHarmonic, ...]:
        """The lobe and the overtones."""
        lobe = PathHarmonic(lobes=self.lobes, amplitude_um=self.amplitude_um, phase_deg=self.phase_deg)
        return (lobe, *self.overtones)

    @property
    def largest_um(self) -> float:
        """The amplitude of the lobe where along the cut it is largest."""
        return float(np.abs(polyval(PLACES_ALONG, self.powers_um()[self.lobes])).max())

    def powers_um(self) -> dict[int, tuple[complex, ...]]:
        """Return the coefficient of each order along the cut, um, by rising powers of s; 0 is the mean."""
        found = {0: [complex(self.mean_um), *map(complex, self.along.mean_um)]}
        for each in self.harmonics:
            found[each.lobes] = [each.coefficient * power for power in (1.0, *self.along.powers(each.lobes))]
        for term in self.axial:
            powers = found.setdefault(term.lobes, [0j])
            powers += [0j] * (term.power + 1 - len(powers))
            powers[term.power] += term.coefficient
        return {order: tuple(powers) for order, powers in found.items()}

    def at_um(self, angle_deg: ArrayLike, past_middle_mm: ArrayLike = 0.0) -> Floats:
        """Return the values at spindle angles, past the middle of the cut; in the shape of `angle_deg`."""
        path_um = self.mean_um + self.along.further_um(past_middle_mm)
        for harmonic in self.harmonics:
            path_um = path_um + self.along.factor(harmonic.lobes, past_middle_mm) * harmonic.at_um(angle_deg)
            path_um = path_um + self.along.beyond_um(harmonic.lobes, angle_deg, past_middle_mm)
        s = floats(past_middle_mm) / self.along.half_length_mm
        for term in self.axial:
            turning = np.exp(1j * term.lobes * np.radians(floats(angle_deg)))
            path_um = path_um + s**term.power * np.real(term.coefficient * turning)
        return floats(path_um)

    def turn_by(self, by_deg: float) -> LobedPath:
        """Return the path so many degrees of spindle further on, for a chuck mounted so much further.

        The phase of order n is later by n times that.
        """
        overtones = tuple(harmonic.turn_by(by_deg) for harmonic in self.overtones)
        turn = math.radians(by_deg)
        axial = {(n, power): c * cmath.exp(-1j * n * turn) for (n, power), c in axial_um(self.axial).items()}
        return replace(self, phase_deg=self.phase_deg + by_deg, overtones=overtones, axial=axial_terms(axial))

    def plus_axial(self, change_um: Mapping[tuple[int, int], complex]) -> LobedPath:
        """Return this path with Re(c exp(j n angle)) s^p added for each order n and power p, in um."""
        sums = axial_um(self.axial)
        return replace(
            self, axial=axial_terms(sums | {key: sums.get(key, 0j) + c for key, c in change_um.items()})
        )

    def fold_axial(self) -> LobedPath:
        """Return the path as segments make it: its axial terms in `along`, of the lobe those in phase with it."""
        mean, lobe = self.powers_um()[0], self.harmonics[0].coefficient
        orders = dict(self.along.orders)
        if lobe and any(term.lobes for term in self.axial):
            orders[self.lobes] = tuple((power / lobe).real for power in self.powers_um()[self.lobes][1:])
        mean_um = tuple(power.real for power in mean[1:])
        return replace(self, along=replace(self.along, orders=tuple(orders.items()), mean_um=mean_um), axial=())

    def plus(self, coefficients: Mapping[int, complex], mean_um: float = 0.0) -> LobedPath:
        """Return this path with Re(c exp(j n angle)) added for each n, and an addition to its mean, in um."""
        sums = {harmonic.lobes: harmonic.coefficient for harmonic in self.harmonics}
        for n, coefficient in coefficients.items():
            sums[n] = sums.get(n, 0j) + coefficient
        lobe = PathHarmonic.from_coefficient(self.lobes, sums.pop(self.lobes))
        return LobedPath(
            mean_um=self.mean_um + mean_um,
            amplitude_um=lobe.amplitude_um,
            lobes=self.lobes,
            phase_deg=lobe.phase_deg if lobe.amplitude_um else self.phase_deg,
            overtones=tuple(PathHarmonic.from_coefficient(n, sums[n]) for n in sorted(sums)),
            along=self.along,
            axial=self.axial,
            push_um=self.push_um,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CutPath:
    """A cut: the `target` of the tool tip, and the `command` with which an axis makes it."""

    target: LobedPath
    command: LobedPath

    def turn_by(self, by_deg: float) -> CutPath:
        """Return both so many degrees of spindle further on: the axis response does not change with angle."""
        return CutPath(target=self.target.turn_by(by_deg), command=self.command.turn_by(by_deg))

    def add_push(self, further_um: float) -> CutPath:
        """Return the path with a command that makes up for so much more of the push of the cut."""
        command = replace(self.command, push_um=self.command.push_um + further_um)
        return CutPath(target=self.target, command=command)


def spindle_speed_rpm(lobe_frequency_hz: float, jaws: int) -> float:
    """Eq 4: V = 60 f / N, which is 20 f for three jaws."""
    return 60 * lobe_frequency_hz / jaws


def lobe_frequency_hz(spindle_speed_rpm: float, jaws: int) -> float:
    """Eq 4 inverted: f = N V / 60."""
    return jaws * spindle_speed_rpm / 60


def removed_depth_um(
    angle_deg: ArrayLike, *, a0_um: float, a1_um: float, b1_um: float = 0.0, jaws: int = 3
) -> Floats:
    """Eq 6: A0 + A1 sin(N angle) - B1 cos(N angle), the depth that a plain cut takes; Eq 7 with B1 = 0.

    Eqs 10a and 10b are (100, 27.5) and (60, 16.5): amplitudes, half of the measured 55 and 33 um.
    """
    phase = jaws * np.radians(floats(angle_deg))
    return floats(a0_um + a1_um * np.sin(phase) - b1_um * np.cos(phase))


def compensated_depth_um(
    angle_deg: ArrayLike, *, a0_um: float, a1_um: float, b1_um: float = 0.0, jaws: int = 3
) -> Floats:
    """Eq 8: A0 - A1 sin(N angle) + B1 cos(N angle), the tool path against `removed_depth_um` (Eqs 11)."""
    return removed_depth_um(angle_deg, a0_um=a0_um, a1_um=-a1_um, b1_um=-b1_um, jaws=jaws)


def free_state_lobe(job: Job) -> LobedPath:
    """Return the deviation of the released part after a plain cut: high at jaw 1, mean 0."""
    return LobedPath(
        mean_um=0.0,
        amplitude_um=job.lobe_amplitude_um,
        lobes=job.jaws,
        phase_deg=job.lobe_phase_deg,
    )


def target_path(job: Job) -> LobedPath:
    """Return the target path of the tool tip: the depth of cut plus the free-state lobe."""
    return replace(free_state_lobe(job), mean_um=1000 * job.depth_of_cut_mm)


def invert(target: LobedPath, response: complex | Callable[[int], complex]) -> LobedPath:
    """Return the command that makes an axis of this response follow `target`.

    `response` is T(j w) from command to position: at the lobe frequency for a path without overtones, else a
    function of the order. The amplitude is divided by |T|, the phase is advanced by -arg T, an nth of that in
    spindle angle. The mean passes unchanged (T(0) = 1). Raises `ProfileError` (`response.too_small`) where the
    command would be more than `AMPLIFICATION_LIMIT` times the motion.
    """
    lobe, *overtones = (_invert_harmonic(harmonic, response) for harmonic in target.harmonics)
    return replace(target, amplitude_um=lobe.amplitude_um, phase_deg=lobe.phase_deg, overtones=tuple(overtones))


def _invert_harmonic(harmonic: PathHarmonic, response: complex | Callable[[int], complex]) -> PathHarmonic:
    here = response(harmonic.lobes) if callable(response) else response
    gain = abs(here)
    if not math.isfinite(gain) or gain * AMPLIFICATION_LIMIT < 1.0:
        limit = f">= {1.0 / AMPLIFICATION_LIMIT:g}"
        raise refusal_error("response.too_small", value=f"{gain:.3g}", limit=limit)
    phase_deg = harmonic.phase_deg + math.degrees(cmath.phase(here)) / harmonic.lobes
    return replace(harmonic, amplitude_um=harmonic.amplitude_um / gain, phase_deg=phase_deg)


def residual_um_pp(error_um_pp: float, compensation: complex) -> float:
    """Return the residual E |1 - c| of the lobe E when the tool makes c times the target motion."""
    return error_um_pp * abs(1 - compensation)


def misalignment(angle_deg: float, jaws: int) -> complex:
    """Return the effective compensation c of a path that lags by `angle_deg` of spindle: exp(-j N angle)."""
    return cmath.exp(-1j * jaws * math.radians(angle_deg))


def delay_response(response: complex, frequency_hz: float, delay_s: float) -> complex:
    """Return the response of an axis whose command is delayed by a constant time."""
    return response * cmath.exp(-2j * math.pi * frequency_hz * delay_s)


def chord_scale(points: float) -> float:
    """Return the factor that raises the points of a sine so that straight lines between them keep its amplitude.

    With so many equidistant `points` in a period the lines have a fundamental of (sin x / x)^2, x = pi / points.
    """
    x = math.pi / points
    return (x / math.sin(x)) ** 2


def chord_error(points: float) -> float:
    """Return the largest distance of those lines from the sine, as a fraction of its amplitude.

    It is at the points, which are too high, or between them, where the lines are too low.
    """
    scale = chord_scale(points)
    return max(scale - 1.0, 1.0 - scale * math.cos(math.pi / points))


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedResidual:
    """What is left of the lobe, um p-p: with correct sign and angle, and with the sign (or half a lobe) wrong."""

    right_um_pp: float
    wrong_um_pp: float


def fraction_of(path: CutPath, fraction: float) -> CutPath:
    """Return a path with this fraction of its harmonics, at the same mean; axes respond linearly."""
    return CutPath(target=scale_path(path.target, fraction), command=scale_path(path.command, fraction))


def expect_residual(lobe_um_pp: float, fraction: float) -> ExpectedResidual:
    """Return what a fraction of the compensation leaves of a lobe of `lobe_um_pp`."""
    return ExpectedResidual(
        right_um_pp=residual_um_pp(lobe_um_pp, fraction), wrong_um_pp=residual_um_pp(lobe_um_pp, -fraction)
    )


def scale_path(path: LobedPath, fraction: float) -> LobedPath:
    """Return a path with all its harmonics so many times as high, at the same mean."""
    overtones = tuple(
        replace(harmonic, amplitude_um=fraction * harmonic.amplitude_um) for harmonic in path.overtones
    )
    axial = {(n, power): fraction * c if n else c for (n, power), c in axial_um(path.axial).items()}
    return replace(path, amplitude_um=fraction * path.amplitude_um, overtones=overtones, axial=axial_terms(axial))


MOST_MEAN_UM = 60.0  # tolerance of the mean: a soft servo under a fine cut is held back by some tens of um
# Tolerance of a harmonic, relative to what is wanted and in um; for a command plus what friction may hold back.
MOST_FRACTION, MOST_HARMONIC_UM = 0.6, 10.0
MOST_HARMONICS = 50  # highest order of an overtone
OVAL = 2
MOST_HARDER = 0.1  # by which fraction one jaw may press harder than the others; assumed


def path_problems(
    path: CutPath,
    job_wants: LobedPath,
    response: Callable[[int], complex],
    friction_um: Callable[[int], float] = lambda _: 0.0,
    oval_over_ring: float = 1.0,
) -> tuple[Problem, ...]:
    """Return why a path does not fit a cut whose target is `job_wants`: codes `path.*`.

    `response` is the nominal one from command to tool, by order; `friction_um` the amplitude by which dry
    friction may hold the tool back at them, which its command has to make up for. `oval_over_ring` is the oval of
    a part over that of a ring with the same lobe.
    """
    shapes = (*_shape(path.target, job_wants), *_shape(path.command, job_wants))
    if shapes:
        return shapes
    target, command, lobe = path.target.harmonics[0], path.command.harmonics[0], job_wants.harmonics[0]
    most_um = MOST_FRACTION * lobe.amplitude_um + MOST_HARMONIC_UM
    off_and_most_um = {
        "wanted": (abs(target.coefficient - lobe.coefficient), most_um),
        "command": (
            abs(response(lobe.lobes) * command.coefficient - target.coefficient),
            most_um + friction_um(lobe.lobes),
        ),
        "wanted mean": (abs(path.target.mean_um - job_wants.mean_um), MOST_MEAN_UM),
        "command push": (abs(path.command.push_um) - job_wants.push_um, MOST_MEAN_UM),
        "command mean": (abs(path.command.mean_um - path.target.mean_um), MOST_MEAN_UM),
    }
    for harmonic in path.target.overtones:
        off_and_most_um[f"{harmonic.lobes}/rev wanted"] = (
            harmonic.amplitude_um,
            MOST_HARMONIC_UM + oval_over_ring * _oval_um(harmonic.lobes, job_wants),
        )
    for harmonic in path.command.overtones:
        wanted = {each.lobes: each.coefficient for each in path.target.overtones}.get(harmonic.lobes, 0j)
        off_and_most_um[f"{harmonic.lobes}/rev command"] = (
            abs(response(harmonic.lobes) * harmonic.coefficient - wanted),
            MOST_FRACTION * abs(wanted) + MOST_HARMONIC_UM + friction_um(harmonic.lobes),
        )
    for term in path.target.axial:
        share = MOST_FRACTION * lobe.amplitude_um if term.lobes == lobe.lobes else 0.0
        limit_um = share + MOST_HARMONIC_UM if term.lobes else MOST_MEAN_UM
        off_and_most_um[f"{term.lobes}/rev along Z, power {term.power}"] = abs(term.coefficient), limit_um
    return tuple(
        Problem(code="path.beyond", key=key, value=f"{off_um:.1f} um", limit=f"<= {limit_um:.1f} um")
        for key, (off_um, limit_um) in off_and_most_um.items()
        if not off_um <= limit_um
    )


def _oval_um(order: int, job_wants: LobedPath) -> float:
    """Return the oval, um of amplitude, that one jaw makes which presses `MOST_HARDER`; 0 at other orders.

    A radial load bends a ring n times a turn by 1 / (n^2 - 1)^2 of it, and the jaws share what one of N has more:
    with 6 jaws 2.7 times the lobe, with 3 a third of it.
    """
    jaws = job_wants.lobes
    if order != OVAL or jaws == OVAL:
        return 0.0
    softer = (jaws**2 - 1) ** 2 / (OVAL**2 - 1) ** 2
    return MOST_HARDER / (jaws - 1) * softer * job_wants.amplitude_um


def _shape(path: LobedPath, job_wants: LobedPath) -> tuple[Problem, ...]:
    numbers = [harmonic.lobes for harmonic in path.harmonics]
    if path.lobes != job_wants.lobes or len(set(numbers)) != len(numbers):
        value, limit = ", ".join(map(str, numbers)), f"{job_wants.lobes}, and others once each"
        return (Problem(code="path.harmonics", key="lobes", value=value, limit=limit),)
    if not all(1 <= number <= MOST_HARMONICS for number in numbers):
        return (
            Problem(
                code="path.harmonics",
                key="lobes",
                value=", ".join(map(str, numbers)),
                limit=f"1 to {MOST_HARMONICS}",
            ),
        )
    return ()
