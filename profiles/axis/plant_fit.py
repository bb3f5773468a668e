"""The axis behind measured responses of its loop: rigid motion, lag, dry friction, and flexible modes that show.

A response T of a loop with known gains gives its plant at that frequency, P = T / (F - T B). Several amplitudes
may be given together: dry friction of the force F is, by its describing function, a damping of 4 F / (pi X w) for
a motion of the amplitude X (A. Gelb and W. E. Vander Velde 1968), so that it separates from the viscous one. For a
small motion that a swing of the peak speed V carries it is 2 F / (pi V), the mean slope of the sign of the speed;
between the two 4 F / (pi hypot(X w, 2 V)).

What is fitted is the relative error of P, weighted by its confidence. A lag of the current takes from the gain as
well as from the phase, a delay from the phase alone: the one that describes the points better is taken, or both. A
mode, and the second of these, is taken where chance would show it in one fit of a thousand at most (chi-square and
Fisher's F). A loop that was measured is stable: a mode is damped at least as much as that needs. Numpy, and scipy
inside the fit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.margins import is_stable
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop
from profiles.axis.servo_gains import PidGains
from profiles.least_squares import chance_of

LEAST_SD = 0.01  # of a measured plant: what a describing function and a sampled model are good for
LEAST_POINTS = 5  # frequencies
LEAST_MODE_DAMPING, MOST_MODE_DAMPING = (
    0.003,
    0.15,
)  # what is damped more is no resonance, but another delay or friction
MODE_POINTS = 10  # with fewer frequencies no mode is looked for
MODE_CHANCE, MODE_GAIN = 1e-3, 16.3  # the gain of chi-square with three parameters at the same chance
FRICTION_DOUBT = 0.3  # of its effect, one standard deviation: presliding, and a tool that stops (choice)
MOST_MISFIT = 0.10  # relative error of a point that the fit may leave, or three standard deviations
_MOST_DELAY_S = _MOST_LAG_S = 2.0e-3
MOST_MODES, _MORE_DAMPING = 3, 1.1
_AXIS, _MODE, _DELAY, _LAG = 5, 3, 2, 4  # parameters of the axis and of each mode, and places of two
SECOND_GAIN = 10.8  # of chi-square with one parameter
_NONE, _DAMPED = 1e-6, math.log(0.03)
MODE_REACH = 2.5  # times the highest measured frequency, up to which a mode can be told from a delay
_MOST_OF_NYQUIST = 0.9
_STARTS = (0.6, 0.9, 1.2, 1.6)  # of the highest frequency, where a mode is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopPoint:
    """A response of the loop with its gains: `amplitude_um` is that of the command, `gain_ci` for 95 %.

    `carried_m_per_s` is the peak speed of a slow swing that carries the sine, 0 for a sine alone.
    """

    gains: PidGains
    hz: float
    response: complex
    gain_ci: float
    amplitude_um: float
    carried_m_per_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantFit:
    """A fitted axis with what it rests on.

    `hz` and `measured` are the plant at the measured frequencies, `sd` its relative standard deviation;
    `friction_v` is the dry friction in volts of output, and `others` are plants within the confidence of the fit,
    one parameter off by two standard deviations each. `misfit` is what it leaves at each frequency, relative;
    `worst_hz` has the most over what is `allowed` there. `denied` is whether a loop that was measured, and so is
    stable, would not be with it.
    """

    plant: AxisPlant
    friction_v: float
    friction_sd_v: float
    hz: Floats
    measured: Complexes
    sd: Floats
    others: tuple[AxisPlant, ...]
    misfit: Floats
    worst_hz: float
    worst: float
    allowed: float
    denied: bool

    @property
    def holds(self) -> bool:
        """Whether the fit describes every measured point, and leaves the measured loops stable."""
        return self.worst <= self.allowed and not self.denied


def fitted_plant(loop: SampledLoop, points: Sequence[LoopPoint]) -> PlantFit | None:
    """Return the axis behind the responses of loops; None for less than `LEAST_POINTS` frequencies.

    `loop` has the nominal plant and the servo period; the gains are those of each point.
    """
    ordered = sorted(points, key=lambda point: point.hz)
    hz = floats([point.hz for point in ordered])
    if np.unique(hz).size < LEAST_POINTS:
        return None
    problem = _Problem(loop, hz, ordered)
    start = floats([math.log(loop.plant.acceleration_per_v), 0.8 * loop.plant.damping_per_s, 0.1, 0.1, 0.1])
    problem.doubt_friction(problem.solve_from(start, (_LAG,)).values)
    either = [_with_modes(problem, problem.solve_from(start, (absent,)), start) for absent in (_LAG, _DELAY)]
    best = min(either, key=lambda each: each.cost + MODE_GAIN * (each.values.size - _AXIS) / _MODE)
    halves = np.array(best.values)
    halves[[_DELAY, _LAG]] = 0.5 * (best.values[_DELAY] + best.values[_LAG])
    both = problem.solve_stable(floats(halves), ())
    return problem.judge_fit(both if problem.is_likely(best, both, 1, SECOND_GAIN) else best)


def _with_modes(problem: _Problem, best: _PlantSolution, start: Floats) -> _PlantSolution:
    """Return a solution with the modes that show."""
    while problem.points >= MODE_POINTS and best.values.size < _AXIS + MOST_MODES * _MODE:
        known = start if best.values.size == _AXIS else best.values
        found = min(
            (
                problem.solve_from(np.append(known, [fraction, math.log(hz), _DAMPED]), best.absent)
                for hz in problem.likely_hz(best.values)
                for fraction in (0.1, -0.1)
            ),
            key=lambda each: each.cost,
        )
        found = problem.solve_stable(found.values, best.absent)
        if not (problem.is_likely(best, found, _MODE, MODE_GAIN) and problem.is_resonance(found.values)):
            break
        best = found
    return best


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PlantSolution:
    """Parameters ln a, b, delay in ms, friction over mass, lag in ms; delay or lag are 0 where `absent`.

    Of each mode its fraction, ln Hz and ln damping ratio.
    """

    values: Floats
    cost: float
    covariance: Floats
    absent: tuple[int, ...]


class _Problem:
    """The least-squares problem of one set of points."""

    def __init__(self, loop: SampledLoop, hz: Floats, points: Sequence[LoopPoint]) -> None:
        loops = [(replace(loop, gains=point.gains), [point.hz]) for point in points]
        forward = complexes([each.forward(at)[0] for each, at in loops])
        back = complexes([each.feedback(at)[0] for each, at in loops])
        response = complexes([point.response for point in points])
        open_part = forward - response * back
        self._loop, self._hz, self._s = loop, hz, 2j * np.pi * hz
        self._gains = {point.gains for point in points}
        self._measured = complexes(response / open_part)
        # An error of T reaches P as much as the loop lets it.
        relative = np.abs(forward / open_part) * floats(
            [point.gain_ci / 1.96 / abs(point.response) for point in points]
        )
        self._sd = floats(np.hypot(relative, LEAST_SD))
        moved_m = floats([point.amplitude_um * 1e-6 * abs(point.response) for point in points])
        carried = floats([point.carried_m_per_s for point in points])
        self._per_friction = 4.0 / (math.pi * np.hypot(moved_m * 2.0 * np.pi * hz, 2.0 * carried))

    def model(self, values: Floats) -> Complexes:
        """Return the plant at the points."""
        plant, friction = _plant_of(values), values[3]
        rigid = replace(self._loop, plant=replace(plant, modes=())).plant_response(self._hz)
        damped = plant.damping_per_s + friction * self._per_friction
        found = rigid * (self._s + plant.damping_per_s) / (self._s + damped)
        if not plant.modes:
            return complexes(found)
        return complexes(found + replace(self._loop, plant=plant).plant_response(self._hz) - rigid)

    def is_resonance(self, values: Floats) -> bool:
        """Whether each mode is inside its bounds: one that leaves them stands for another delay, or friction."""
        return all(
            mode.damping_ratio < 0.98 * MOST_MODE_DAMPING and mode.hz < 0.98 * self.reach_hz
            for mode in _plant_of(values).modes
        )

    def is_denied(self, values: Floats) -> bool:
        """Whether a loop that was measured would be unstable."""
        plant = _plant_of(values)
        return not all(is_stable(replace(self._loop, plant=plant, gains=gains)) for gains in self._gains)

    def doubt_friction(self, values: Floats) -> None:
        """Count a fraction of what friction does at each point as unknown: it is not the relay of the formula."""
        without = np.array(values)
        without[3] = 0.0
        effect = np.abs(self.model(values) / self.model(floats(without)) - 1.0)
        self._sd = floats(np.hypot(self._sd, FRICTION_DOUBT * effect))

    def is_likely(self, less: _PlantSolution, more: _PlantSolution, added: int, gain: float) -> bool:
        """Whether that many parameters more are not by chance."""
        freedom = 2 * self._hz.size - more.values.size
        ratio = (less.cost - more.cost) / added / max(more.cost / freedom, 1e-30)
        return less.cost - more.cost > gain and chance_of(ratio, added, freedom) < MODE_CHANCE

    def solve_stable(self, start: Floats, absent: tuple[int, ...]) -> _PlantSolution:
        """Return the best parameters near a start, with modes that are damped as the measured loops need."""
        found, ratio = self.solve_from(start, absent), LEAST_MODE_DAMPING
        while found.values.size > _AXIS and self.is_denied(found.values) and ratio < MOST_MODE_DAMPING:
            ratio = _MORE_DAMPING * max(ratio, math.exp(found.values[_AXIS + 2 :: _MODE].min()))
            found = self.solve_from(found.values, absent, min(ratio, 0.95 * MOST_MODE_DAMPING))
        return found

    def solve_from(
        self, start: Floats, absent: tuple[int, ...], least_ratio: float = LEAST_MODE_DAMPING
    ) -> _PlantSolution:
        """Return the best parameters near a start, with modes that are damped by that ratio at least."""
        from scipy.optimize import least_squares

        low, high = _bounds(start.size, self.reach_hz, least_ratio)
        high[list(absent)] = _NONE
        inside = np.clip(start, low + 0.1 * _NONE, high - 0.1 * _NONE)
        found = least_squares(self._residuals, inside, bounds=(low, high), x_scale="jac", max_nfev=60)
        freedom = max(2 * self._hz.size - start.size, 1)
        spread = max(2.0 * float(found.cost) / freedom, 1.0)
        values, slopes = np.array(found.x), np.array(found.jac)
        values[list(absent)], slopes[:, list(absent)] = 0.0, 0.0
        return _PlantSolution(
            values=floats(values),
            cost=2.0 * float(found.cost),
            covariance=floats(spread * np.linalg.pinv(slopes.T @ slopes)),
            absent=absent,
        )

    def judge_fit(self, found: _PlantSolution) -> PlantFit:
        """Return the fit with its misfit and its neighbours."""
        misfit = np.abs(self._measured / self.model(found.values) - 1.0)
        allowed = np.maximum(MOST_MISFIT, 3.0 * self._sd)
        place = int(np.argmax(misfit / allowed))
        friction_sd = math.sqrt(max(float(found.covariance[3, 3]), 0.0))
        plant = _plant_of(found.values)
        volts = 1.0 / plant.acceleration_per_v
        return PlantFit(
            plant=plant,
            friction_v=float(found.values[3]) * volts,
            friction_sd_v=friction_sd * volts,
            hz=self._hz,
            measured=self._measured,
            sd=self._sd,
            others=tuple(_neighbours(found.values, found.covariance)),
            misfit=floats(misfit),
            worst_hz=float(self._hz[place]),
            worst=float(misfit[place]),
            allowed=float(allowed[place]),
            denied=self.is_denied(found.values),
        )

    def _residuals(self, values: Floats) -> Floats:
        off = (self.model(values) / self._measured - 1.0) / self._sd
        return np.concatenate([off.real, off.imag])

    def likely_hz(self, values: Floats) -> list[float]:
        """Return where a mode is looked for: about the highest frequency, and where least is explained."""
        unexplained = np.abs(self._measured / self.model(values))
        return [*(share * self.highest_hz for share in _STARTS), float(self._hz[np.argmax(unexplained)])]

    @property
    def reach_hz(self) -> float:
        """Up to where a mode can be told from a delay."""
        return min(MODE_REACH * self.highest_hz, _MOST_OF_NYQUIST * self._loop.nyquist_hz)

    @property
    def points(self) -> int:
        """How many frequencies were measured."""
        return int(np.unique(self._hz).size)

    @property
    def highest_hz(self) -> float:
        """The highest frequency that was measured."""
        return float(self._hz.max())


def _bounds(count: int, reach_hz: float, least_ratio: float = LEAST_MODE_DAMPING) -> tuple[Floats, Floats]:
    low = [-20.0, 0.0, 0.0, 0.0, 0.0]
    high = [20.0, 1e4, 1000.0 * _MOST_DELAY_S, 100.0, 1000.0 * _MOST_LAG_S]
    for _ in range((count - _AXIS) // _MODE):
        low += [-3.0, math.log(20.0), math.log(least_ratio)]
        high += [3.0, math.log(reach_hz), math.log(MOST_MODE_DAMPING)]
    return floats(low), floats(high)


def _plant_of(values: Floats) -> AxisPlant:
    modes = (
        FlexibleMode(hz=math.exp(hz), damping_ratio=math.exp(ratio), fraction=float(fraction))
        for fraction, hz, ratio in values[_AXIS:].reshape(-1, _MODE)
    )
    return AxisPlant(
        acceleration_per_v=math.exp(values[0]),
        damping_per_s=float(values[1]),
        delay_s=float(values[2]) / 1000.0,
        lag_s=float(values[4]) / 1000.0,
        modes=tuple(modes),
    )


def _neighbours(values: Floats, covariance: Floats) -> Iterator[AxisPlant]:
    """Yield plants with one parameter off: by two standard deviations, or by what a machine's life changes.

    That is 5 % of the acceleration, 0.03 ms of delay; of each mode a tenth of its fraction, 2 % of its frequency,
    and its damping halved.
    """
    fractions = values[_AXIS::_MODE]
    least = [0.05, 0.0, 0.03, 0.0, 0.0, *(each for c in fractions for each in (0.1 * abs(c), 0.02, 0.7))]
    sds = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for place in range(values.size):
        step, is_ratio = (
            max(2.0 * float(sds[place]), least[place]),
            place >= _AXIS and (place - _AXIS) % _MODE == 2,
        )
        if place == 3 or not step:
            continue
        if is_ratio:
            step = min(step, 1.0)
        for sign in (-1.0, 1.0):
            if (place == 1 or is_ratio) and sign > 0:
                continue  # more damping does no harm
            off = np.array(values)
            off[place] += sign * step
            if place in (1, _DELAY, _LAG):
                off[place] = max(off[place], 0.0)
            yield _plant_of(floats(off))
