"""What is known of the lobe, part by part: the mean one, this clamping's force, and the gain of its fingerprint.

A part springs back by L (1 + k s): L is the mean lobe, a complex number, and s the deviation of this clamping's
force from that of the job, as a fraction, with the scatter of the chuck. Rotation takes some of the force, so k
is a little above 1. An indicator shows the same clamping at rest: d = q L exp(g) (1 + s), with the ratio q by
calculation. By how much that is off (finger-tight is no zero force, a blank is stiffer than the part, the
angle of the readings) is g, the same each time. L, g and s are found together by an extended Kalman filter (Kalman
1960; iterated as a Gauss-Newton method, Bell and Cathey 1993): from a fingerprint before the cut, from the
measured part after it. Without a fingerprint it is Kalman's gain, which trusts the angle of a part more than its
height: a force turns nothing.

Of a path W for the lobe the cut loses the fraction a: L (1 + k s) - (1 - a) W is on the part, and L / (1 - a)
would remove the mean lobe. One part cannot tell a from L, nor does it have to: both ask for the same next path.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats, floats

GAIN_SD, TURN_SD_DEG = 0.05, 1.0
"""How well g is known before parts have shown it: height, and angle in degrees of spindle; assumed."""

SURPRISE = 18.0
"""Square of an error over what was expected, in two directions, beyond which the set-up was changed: then what was
known of the lobe does not count. By chance it is one in 8000."""

SURPRISE_OF_ONE = 14.7
"""The same in one direction, as of a height: by chance it is as rare."""

_ROUNDS = 6
_LR, _LI, _GR, _GI, _S, _A = range(6)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClampingScale:
    """How a force bends a part: `at_speed` is k, `at_rest` the ratio q of fingerprint to lobe, `sd` that of s."""

    at_speed: float
    at_rest: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredCoefficient:
    """A complex coefficient as measured, um, with the standard deviation of each of its two components.

    `along` is the direction in which alone it was measured, None for both.
    """

    value: complex
    sd_um: float
    along: complex | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Surprise:
    """A fingerprint against what was expected: `off` along the lobe and across it, in standard deviations.

    `expected_um` is the amplitude that was expected, `sd_um` the standard deviations of both.
    """

    expected_um: float
    off: tuple[float, float]
    sd_um: tuple[float, float]

    @property
    def of_height(self) -> bool:
        """Whether the height is too far off for chance."""
        return self.off[0] ** 2 > SURPRISE_OF_ONE

    @property
    def of_angle(self) -> bool:
        """Whether the angle makes it too far off for chance, where the height alone does not."""
        return not self.of_height and self.off[0] ** 2 + self.off[1] ** 2 > SURPRISE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LobeFilter:
    """Mean and covariance of L (two components, um), g (two), s of the clamping in the chuck now, and a."""

    scale: ClampingScale
    mean: Floats
    covariance: Floats

    @property
    def lobe_um(self) -> complex:
        """The mean lobe."""
        return complex(self.mean[_LR], self.mean[_LI])

    @property
    def path_um(self) -> complex:
        """The path that removes the mean lobe."""
        return self.lobe_um / (1.0 - float(self.mean[_A]))

    @property
    def this_um(self) -> complex:
        """The lobe of the part that is clamped."""
        return self.lobe_um * (1.0 + self.scale.at_speed * float(self.mean[_S]))

    @property
    def turn(self) -> complex:
        """The factor by which the indicator turns the lobe, as its stylus is not quite at the mark."""
        return complex(np.exp(1j * self.mean[_GI]))

    @property
    def arrives(self) -> float:
        """The fraction of a path that arrives in the surface, 1 - a."""
        return 1.0 - float(self.mean[_A])

    @property
    def force_deviation(self) -> float:
        """By which fraction this clamping's force deviates from that of the job."""
        return float(self.mean[_S])

    @property
    def sd_um(self) -> float:
        """The standard deviation of the height of the lobe of the part that is clamped.

        To first order that is what is not known along it. What is not known across, c, makes it higher by
        c^2 / (2 height), whose mean square is 3/4 of the square of the variance of c over the height.
        """
        lobe_um, slope = self.this_um, self._slope_of_part(self.mean, 0j)
        if not lobe_um:
            return math.sqrt(float(np.trace(slope @ self.covariance @ slope.T)))
        along, across = (_two(turn * lobe_um / abs(lobe_um)) @ slope for turn in (1.0, 1j))
        higher_um = 0.5 * math.sqrt(3.0) * float(across @ self.covariance @ across) / abs(lobe_um)
        return math.hypot(math.sqrt(float(along @ self.covariance @ along)), higher_um)

    def predict_clamping(self, repeats_um: float = 0.0) -> LobeFilter:
        """Return the filter for the next clamping, of which nothing is known but the scatter.

        `repeats_um` is by how much a lathe changes its lobe from part to part.
        """
        mean, covariance = self.mean.copy(), self.covariance.copy()
        mean[_S] = 0.0
        covariance[_S, :] = covariance[:, _S] = 0.0
        covariance[_S, _S] = self.scale.sd**2
        covariance[_LR, _LR] += 0.5 * repeats_um**2
        covariance[_LI, _LI] += 0.5 * repeats_um**2
        return replace(self, mean=mean, covariance=covariance)

    def move(self, by_um: complex) -> LobeFilter:
        """Return the filter for a mean lobe that has moved, so that its path is another one by so much."""
        mean = self.mean.copy()
        mean[_LR : _LI + 1] += (1.0 - mean[_A]) * _two(by_um)
        return replace(self, mean=mean)

    def surprise(self, deflection: MeasuredCoefficient) -> Surprise:
        """Return how far a fingerprint is from what is known before it.

        Along and across the lobe are independent of each other but for what is learned: that is left out.
        """
        value, slope = self._shown_by_indicator(self.mean)
        covariance = slope @ self.covariance @ slope.T + deflection.sd_um**2 * np.eye(2)
        axes = [_two(turn * value / abs(value)) for turn in (1.0, 1j)]
        along, across = (math.sqrt(float(axis @ covariance @ axis)) for axis in axes)
        higher_um = abs(deflection.value) - abs(value)
        turned = 0.0 if deflection.along is not None else float(_two(deflection.value) @ axes[1]) / across
        return Surprise(expected_um=abs(value), off=(higher_um / along, turned), sd_um=(along, across))

    def update_by_fingerprint(self, deflection: MeasuredCoefficient) -> LobeFilter:
        """Return the filter with the fingerprint of the clamping."""
        return self._update_state(deflection, self.covariance, self._shown_by_indicator)

    def update_by_part(self, plain: MeasuredCoefficient, path_um: complex = 0j) -> LobeFilter:
        """Return the filter with the released part: the lobe that it has, and `path_um`, its path, together."""
        value, slope = self._shown_by_part(self.mean, path_um)
        expected = slope @ self.covariance @ slope.T + plain.sd_um**2 * np.eye(2)
        error, covariance = _two(plain.value - value), self.covariance
        if float(error @ np.linalg.solve(expected, error)) > SURPRISE:
            covariance = covariance.copy()
            covariance[:2, :2] += np.eye(2) * float(error @ error)
        return self._update_state(plain, covariance, lambda state: self._shown_by_part(state, path_um))

    def update_by_band(self, arrived: MeasuredCoefficient) -> LobeFilter:
        """Return the filter with what the same indicator sees of a trial band, over the path of that.

        It is 1 - a; the stylus reads it at the angle at which it has read the fingerprint, which is of g.
        """
        return self._update_state(arrived, self.covariance, self._shown_by_band)

    def _shown_by_band(self, state: Floats) -> tuple[complex, Floats]:
        """Return what a trial band would show of a state, and by how much each element changes it."""
        turn = complex(np.exp(1j * state[_GI]))
        value = (1.0 - float(state[_A])) * turn
        by = (0j, 0j, 0j, 1j * value, 0j, -turn)
        return value, floats([[each.real for each in by], [each.imag for each in by]])

    def _slope_of_part(self, state: Floats, path_um: complex) -> Floats:
        k, (re, im, _, _, s, _) = self.scale.at_speed, state
        return floats(
            [[1 + k * s, 0.0, 0.0, 0.0, k * re, path_um.real], [0.0, 1 + k * s, 0.0, 0.0, k * im, path_um.imag]]
        )

    def _shown_by_part(self, state: Floats, path_um: complex) -> tuple[complex, Floats]:
        """Return what a part of a state would show with this path, and by how much each element changes that."""
        lobe, s = complex(state[_LR], state[_LI]), float(state[_S])
        value = lobe * (1.0 + self.scale.at_speed * s) + float(state[_A]) * path_um
        return value, self._slope_of_part(state, path_um)

    def _shown_by_indicator(self, state: Floats) -> tuple[complex, Floats]:
        """Return what an indicator on the part would show of a state, and by how much each element changes it."""
        lobe, s = complex(state[_LR], state[_LI]), float(state[_S])
        gain = self.scale.at_rest * np.exp(complex(state[_GR], state[_GI]))
        value = complex(gain * lobe * (1.0 + s))
        by = (gain * (1.0 + s), 1j * gain * (1.0 + s), value, 1j * value, gain * lobe, 0j)
        return value, floats([[each.real for each in by], [each.imag for each in by]])

    def _update_state(
        self, seen: MeasuredCoefficient, known: Floats, shown: Callable[[Floats], tuple[complex, Floats]]
    ) -> LobeFilter:
        """Return the filter after an observation, before which the covariance was `known`.

        It is iterated, each time with the slope where it has arrived.
        """
        axes = np.eye(2) if seen.along is None else _two(seen.along / abs(seen.along))[None, :]
        noise = seen.sd_um**2 * np.eye(len(axes))
        state = self.mean
        for _ in range(_ROUNDS):
            value, slope = shown(state)
            slope = axes @ slope
            left = axes @ _two(seen.value - value) - slope @ (self.mean - state)
            gain = known @ slope.T @ np.linalg.inv(slope @ known @ slope.T + noise)
            state = self.mean + gain @ left
        kept = np.eye(len(state)) - gain @ slope
        covariance = kept @ known @ kept.T + gain @ noise @ gain.T
        return replace(self, mean=floats(state), covariance=floats(covariance))


def lobe_filter(
    lobe_um: complex,
    lobes: int,
    scale: ClampingScale,
    *,
    height_sd: float,
    turn_sd_deg: float,
    beside_um: float,
    lost_sd: float = 0.0,
) -> LobeFilter:
    """Return what a job knows: its lobe, known in height within a fraction and in angle within degrees of spindle.

    `beside_um` is how much of that order is no lobe, in each component: the spindle, the response of the tool.
    `lost_sd` is the standard deviation of a, which is most likely 0.
    """
    along = _two(lobe_um / abs(lobe_um)) if lobe_um else floats([1.0, 0.0])
    across = floats([-along[1], along[0]])
    height_um, turn_um = height_sd * abs(lobe_um), lobes * math.radians(turn_sd_deg) * abs(lobe_um)
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = (
        height_um**2 * np.outer(along, along) + turn_um**2 * np.outer(across, across) + beside_um**2 * np.eye(2)
    )
    covariance[_GR, _GR], covariance[_GI, _GI] = GAIN_SD**2, (lobes * math.radians(TURN_SD_DEG)) ** 2
    covariance[_S, _S], covariance[_A, _A] = scale.sd**2, lost_sd**2
    mean = floats([lobe_um.real, lobe_um.imag, 0.0, 0.0, 0.0, 0.0])
    return LobeFilter(scale=scale, mean=mean, covariance=floats(covariance))


def _two(value: complex) -> Floats:
    return floats([value.real, value.imag])
