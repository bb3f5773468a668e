"""The axis behind measured responses of its loop: rigid motion, dry friction, and a flexible mode if it shows.

A response T of a loop with known gains gives its plant at that frequency, P = T / (F - T B). Several amplitudes
may be given together: dry friction of the force F is, by its describing function, a damping of 4 F / (pi X w) for
a motion of the amplitude X (A. Gelb and W. E. Vander Velde 1968), so that it separates from the viscous one.

What is fitted is the relative error of P, weighted by its confidence. A mode is taken where chance would show one
as plausible in one fit of a thousand at most (chi-square and Fisher's F). Numpy, and scipy inside the fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode, SampledLoop
from profiles.axis.servo_gains import PidGains
from profiles.least_squares import chance_of

LEAST_SD = 0.01  # of a measured plant: what a describing function and a sampled model are good for
LEAST_POINTS = 5  # frequencies
MOST_MODE_DAMPING = 0.15  # what is damped more is no resonance, but another delay or friction
MODE_POINTS = 10  # with fewer frequencies no mode is looked for
MODE_CHANCE, MODE_GAIN = 1e-3, 16.3  # the gain of chi-square with three parameters at the same chance
FRICTION_DOUBT = 0.3  # of its effect, one standard deviation: presliding, and a tool that stops (choice)
MOST_MISFIT = 0.10  # relative error of a point that the fit may leave, or three standard deviations
_MOST_DELAY_S = 2.0e-3
MODE_REACH = 2.5  # times the highest measured frequency, up to which a mode can be told from a delay
_STARTS = (0.6, 0.9, 1.2, 1.6)  # of the highest frequency, where a mode is looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopPoint:
    """A response of the loop with its gains: `amplitude_um` is that of the command, `gain_ci` for 95 %."""

    gains: PidGains
    hz: float
    response: complex
    gain_ci: float
    amplitude_um: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantFit:
    """A fitted axis with what it rests on.

    `hz` and `measured` are the plant at the measured frequencies, `sd` its relative standard deviation;
    `friction_v` is the dry friction in volts of output, and `others` are plants within the confidence of the fit,
    one parameter off by two standard deviations each. `misfit` is what it leaves at each frequency, relative;
    `worst_hz` has the most over what is `allowed` there.
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

    @property
    def holds(self) -> bool:
        """Whether the fit describes every measured point."""
        return self.worst <= self.allowed


def fitted_plant(loop: SampledLoop, points: Sequence[LoopPoint]) -> PlantFit | None:
    """Return the axis behind the responses of loops; None for less than `LEAST_POINTS` frequencies.

    `loop` has the nominal plant and the servo period; the gains are those of each point.
    """
    ordered = sorted(points, key=lambda point: point.hz)
    hz = floats([point.hz for point in ordered])
    if np.unique(hz).size < LEAST_POINTS:
        return None
    problem = _Problem(loop, hz, ordered)
    start = [math.log(loop.plant.acceleration_per_v), 0.8 * loop.plant.damping_per_s, 0.1, 0.1]
    best = problem.solve_from(floats(start))
    problem.doubt_friction(best.values)
    best = problem.solve_from(best.values)
    if np.unique(hz).size >= MODE_POINTS:
        with_mode = _best_mode(problem, best)
        added = with_mode.values.size - best.values.size
        freedom = 2 * hz.size - with_mode.values.size
        ratio = (best.cost - with_mode.cost) / added / max(with_mode.cost / freedom, 1e-30)
        likely = best.cost - with_mode.cost > MODE_GAIN and chance_of(ratio, added, freedom) < MODE_CHANCE
        if likely and problem.is_resonance(with_mode.values):
            best = with_mode
    return problem.judge_fit(best)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _PlantSolution:
    """Parameters ln a, b, delay in ms, friction over mass; of a mode its fraction, ln Hz and ln damping ratio."""

    values: Floats
    cost: float
    covariance: Floats


class _Problem:
    """The least-squares problem of one set of points."""

    def __init__(self, loop: SampledLoop, hz: Floats, points: Sequence[LoopPoint]) -> None:
        loops = [(replace(loop, gains=point.gains), [point.hz]) for point in points]
        forward = complexes([each.forward(at)[0] for each, at in loops])
        back = complexes([each.feedback(at)[0] for each, at in loops])
        response = complexes([point.response for point in points])
        open_part = forward - response * back
        self._loop, self._hz, self._s = loop, hz, 2j * np.pi * hz
        self._measured = complexes(response / open_part)
        # An error of T reaches P as much as the loop lets it.
        relative = np.abs(forward / open_part) * floats(
            [point.gain_ci / 1.96 / abs(point.response) for point in points]
        )
        self._sd = floats(np.hypot(relative, LEAST_SD))
        moved_m = floats([point.amplitude_um * 1e-6 * abs(point.response) for point in points])
        self._per_friction = 4.0 / (math.pi * moved_m * 2.0 * np.pi * hz)

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
        """Whether a mode is inside its bounds: one that leaves them stands for another delay, or friction."""
        (mode,) = _plant_of(values).modes
        return mode.damping_ratio < 0.98 * MOST_MODE_DAMPING and mode.hz < 0.98 * MODE_REACH * self.highest_hz

    def doubt_friction(self, values: Floats) -> None:
        """Count a fraction of what friction does at each point as unknown: it is not the relay of the formula."""
        without = np.array(values)
        without[3] = 0.0
        effect = np.abs(self.model(values) / self.model(floats(without)) - 1.0)
        self._sd = floats(np.hypot(self._sd, FRICTION_DOUBT * effect))

    def solve_from(self, start: Floats) -> _PlantSolution:
        """Return the best parameters near a start."""
        from scipy.optimize import least_squares

        low, high = _bounds(start.size, self.highest_hz)
        inside = np.clip(start, low + 1e-9, high - 1e-9)
        found = least_squares(self._residuals, inside, bounds=(low, high), x_scale="jac", max_nfev=60)
        freedom = max(2 * self._hz.size - start.size, 1)
        spread = max(2.0 * float(found.cost) / freedom, 1.0)
        return _PlantSolution(
            values=floats(found.x),
            cost=2.0 * float(found.cost),
            covariance=floats(spread * np.linalg.pinv(found.jac.T @ found.jac)),
        )

    def judge_fit(self, found: _PlantSolution) -> PlantFit:
        """Return the fit with its misfit and its neighbours."""
        misfit = np.abs(self._measured / self.model(found.values) - 1.0)
        allowed = np.maximum(MOST_MISFIT, 3.0 * self._sd)
        place = int(np.argmax(misfit / allowed))
        sds = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
        plant = _plant_of(found.values)
        volts = 1.0 / plant.acceleration_per_v
        return PlantFit(
            plant=plant,
            friction_v=float(found.values[3]) * volts,
            friction_sd_v=float(sds[3]) * volts,
            hz=self._hz,
            measured=self._measured,
            sd=self._sd,
            others=tuple(_neighbours(found.values, sds)),
            misfit=floats(misfit),
            worst_hz=float(self._hz[place]),
            worst=float(misfit[place]),
            allowed=float(allowed[place]),
        )

    def _residuals(self, values: Floats) -> Floats:
        off = (self.model(values) / self._measured - 1.0) / self._sd
        return np.concatenate([off.real, off.imag])

    @property
    def highest_hz(self) -> float:
        """The highest frequency that was measured."""
        return float(self._hz.max())


def _best_mode(problem: _Problem, rigid: _PlantSolution) -> _PlantSolution:
    starts = [
        np.append(rigid.values, [fraction, math.log(share * problem.highest_hz), math.log(0.03)])
        for share in _STARTS
        for fraction in (0.1, -0.1)
    ]
    return min((problem.solve_from(start) for start in starts), key=lambda each: each.cost)


def _bounds(count: int, highest_hz: float) -> tuple[Floats, Floats]:
    low, high = [-20.0, 0.0, 0.0, 0.0], [20.0, 1e4, 1000.0 * _MOST_DELAY_S, 100.0]
    if count > len(low):
        low += [-3.0, math.log(20.0), math.log(0.003)]
        high += [3.0, math.log(MODE_REACH * highest_hz), math.log(MOST_MODE_DAMPING)]
    return floats(low), floats(high)


def _plant_of(values: Floats) -> AxisPlant:
    modes: tuple[FlexibleMode, ...] = ()
    if values.size > 4:
        fraction, hz, ratio = float(values[4]), math.exp(values[5]), math.exp(values[6])
        modes = (FlexibleMode(hz=hz, damping_ratio=ratio, fraction=fraction),)
    return AxisPlant(
        acceleration_per_v=math.exp(values[0]),
        damping_per_s=float(values[1]),
        delay_s=float(values[2]) / 1000.0,
        modes=modes,
    )


def _neighbours(values: Floats, sds: Floats) -> list[AxisPlant]:
    """Return plants with one parameter off: by two standard deviations, or by what a machine's life changes.

    That is 5 % of the acceleration, 0.03 ms of delay; of a mode a tenth of its fraction, 2 % of its frequency, and
    its damping halved.
    """
    least = floats([0.05, 0.0, 0.03, 0.0, *([0.1 * abs(values[4]), 0.02, 0.7] if values.size > 4 else [])])
    found = []
    for place in range(values.size):
        if place == 3:
            continue
        step = max(2.0 * float(sds[place]), float(least[place]))
        if place == 6:
            step = min(step, 1.0)
        for sign in (-1.0, 1.0):
            if place in (1, 6) and sign > 0:
                continue  # more damping does no harm
            off = np.array(values)
            off[place] = max(off[place] + sign * step, 0.0) if place in (1, 2) else off[place] + sign * step
            found.append(_plant_of(floats(off)))
    return found
