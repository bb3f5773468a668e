"""The form of a part apart from the error of the gauge's spindle: readings of one part in several placements.

A part turned by phi on the gauge is read as m(theta) = p(theta - phi) + s(theta), theta the angle of the gauge;
with the probe on the opposite side as p(theta - phi - 180 deg) - s(theta) (Donaldson's reversal: the part is
turned by 180 deg, too). Of order n that is M_k = P exp(-j n phi_k) + s_k S, phasors of deviation = sum Re(c_n
exp(j n theta)), um: least squares of P and S for each n. Where all readings show the same sum of both, the
placements are blind: two at 90 deg of 4, 8, ..., n equal steps of the multiples of n; a reversal of none. Order 1
is the eccentricity, which is new each time.

A placement that is off by delta turns P by n delta: its cost grows with n |P|. The first one defines the angle.
After D. J. Whitehouse (1976), "Some theoretical aspects of error separation techniques in surface metrology".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profiles.arrays import Floats, floats
from profiles.least_squares import CONFIDENCE, fit, harmonic_columns, phasors
from profiles.metrology.harmonics import HIGHEST_HARMONIC
from profiles.metrology.points import angle_weights
from profiles.problem import refusal_error

BY_EYE_DEG = 1.0  # standard deviation of a mark that is set by eye
MOST_PLACEMENTS = 12
VALID_DAYS = 365  # of a gauge's error, from its separation on (choice)
MOST_AMPLIFIED = 5.0  # by more than that the noise of a reading grows in a blind order (choice)
TURNED_BACK = 5.0  # times less of the gauge's error, if the part was turned the other way (choice)
SURE = math.sqrt(-2.0 * math.log(1.0 - CONFIDENCE))  # radius of 95 % of a phasor's scatter, in standard deviations
_DECIMAL_UM = 1e-9  # below the last decimal of any file
_NOISE_ORDERS = range(HIGHEST_HARMONIC + 1, 2 * HIGHEST_HARMONIC + 1)
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """How a part sits: turned by so much in the direction of the gauge's angles, the probe opposite or not."""

    turned_deg: float
    opposite: bool = False

    @property
    def sign(self) -> float:
        """The sign with which the error of the gauge is in its reading."""
        return -1.0 if self.opposite else 1.0

    @property
    def shift_deg(self) -> float:
        """The angle by which its reading is that of the part, later."""
        return self.turned_deg + (180.0 if self.opposite else 0.0)

    def __str__(self) -> str:
        return f"{self.turned_deg:g}{'r' if self.opposite else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeOrder:
    """The error of a gauge at one order: cosine cos(upr theta) + sine sin(upr theta), theta the gauge's angle.

    `sd_um` is the largest standard deviation of the phasor along any direction.
    """

    upr: int
    cosine_um: float
    sine_um: float
    sd_um: float

    @property
    def proven(self) -> bool:
        """Whether it is not 0, with a probability of 95 %."""
        return math.hypot(self.cosine_um, self.sine_um) > SURE * self.sd_um


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeError:
    """Error of a gauge's spindle by order, found on `date`, in use up to `valid_until` (ISO 8601; "": for ever).

    `placements` are those that found it, `blind` the orders that they left together with the part.
    """

    gauge: str
    date: str
    valid_until: str
    placements: tuple[str, ...]
    blind: tuple[int, ...]
    orders: tuple[GaugeOrder, ...]

    @property
    def proven(self) -> tuple[GaugeOrder, ...]:
        """The orders that are taken off a reading: to take off what is not proven would only add noise."""
        return tuple(each for each in self.orders if each.proven)

    def at_um(self, angle_deg: ArrayLike) -> Floats:
        """Return the proven error at angles of the gauge, um; shape as `angle_deg`."""
        theta = np.radians(floats(angle_deg))
        waves = [e.cosine_um * np.cos(e.upr * theta) + e.sine_um * np.sin(e.upr * theta) for e in self.proven]
        return floats(sum(waves, np.zeros_like(theta)))

    def drift_um(self, earlier: GaugeError) -> dict[int, float]:
        """Return by how much each order has changed beyond the scatter of both separations, um."""
        before = {each.upr: each for each in earlier.orders}
        found = {}
        for now in self.orders:
            if (then := before.get(now.upr)) is not None:
                moved_um = math.hypot(now.cosine_um - then.cosine_um, now.sine_um - then.sine_um)
                if moved_um > SURE * math.hypot(now.sd_um, then.sd_um):
                    found[now.upr] = moved_um
        return found


def is_same_reading(one_um: Floats, other_um: Floats) -> bool:
    """Return whether two readings differ by no more than the rounding of the one with fewer decimals."""
    if one_um.size != other_um.size:
        return False
    coarser_um = max(map(_last_decimal, (one_um, other_um)))
    return float(np.abs(one_um - other_um).max()) <= 0.5 * coarser_um + _DECIMAL_UM


def _last_decimal(deviation_um: Floats) -> float:
    """Return the step of the last decimal of written deviations, um; 0 if they are not rounded."""
    written = (k for k in range(9) if np.abs(deviation_um - np.round(deviation_um, k)).max() < _DECIMAL_UM)
    return next((10.0**-k for k in written), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderApart:
    """Part and gauge at one order: `part_um` is a phasor, `turning_um` what of `gauge.sd_um` is the turning."""

    part_um: complex
    part_sd_um: float
    gauge: GaugeOrder
    turning_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """Part and gauge by order, and the `blind` orders, which these placements leave together.

    `noise_um` is the standard deviation of a component of a reading's phasor.
    """

    placements: tuple[Placement, ...]
    orders: tuple[OrderApart, ...]
    blind: tuple[int, ...]
    noise_um: float

    def error_of(self, gauge: str, date: str, valid_until: str) -> GaugeError:
        """Return the error of the gauge of this name."""
        return GaugeError(
            gauge=gauge,
            date=date,
            valid_until=valid_until,
            placements=tuple(map(str, self.placements)),
            blind=self.blind,
            orders=tuple(each.gauge for each in self.orders),
        )


def separate(
    readings: Sequence[tuple[ArrayLike, ArrayLike]],
    placements: Sequence[Placement],
    *,
    turning_sd_deg: float = BY_EYE_DEG,
) -> Separation:
    """Separate the readings of K placements: angles of the gauge, deg, and deviations about the centre, um, each.

    Noise is what K >= 3 placements leave over, of two all that is read at 16 to 30 undulations, which is too much.
    Raises `ProfileError`: `separation.placements`, their number is not 2 to 12 or not that of the readings;
    `separation.blind`, no order can be separated; `separation.turned_back`, the part was turned the other way.
    """
    count = len(placements)
    if not 2 <= count <= MOST_PLACEMENTS or count != len(readings):
        value, limit = f"{count} : {len(readings)}", f"2 - {MOST_PLACEMENTS}"
        raise refusal_error("separation.placements", key="--separate", value=value, limit=limit)
    spectra = [_spectrum(np.asarray(angle, float), np.asarray(um, float)) for angle, um in readings]
    shared = set.intersection(*(set(each) for each in spectra))
    wanted = [n for n in range(2, HIGHEST_HARMONIC + 1) if n in shared]
    seen = [n for n in wanted if not _is_blind(n, placements)]
    if not seen:
        words = ", ".join(map(str, placements))
        raise refusal_error("separation.blind", key="--separate", value=words, limit=f"2 - {HIGHEST_HARMONIC} UPR")
    read = {n: np.array([each[n] for each in spectra]) for n in seen}
    found = {n: _solve(n, read[n], placements) for n in seen}
    if count > 2:
        left = sum(float(np.sum(np.abs(rest) ** 2)) for _, rest in found.values())
        noise_um = math.sqrt(left / (2.0 * (count - 2) * len(seen)))
    else:
        beyond = [abs(each[n]) ** 2 for each in spectra for n in _NOISE_ORDERS if n in each]
        noise_um = math.sqrt(float(np.mean(beyond)) / 2.0) if beyond else 0.0
    orders = [_order(n, found[n][0], placements, noise_um, turning_sd_deg) for n in seen]
    blind = tuple(n for n in wanted if n not in seen)
    _refuse_turned_back(orders, read, placements)
    return Separation(placements=tuple(placements), orders=tuple(orders), blind=blind, noise_um=noise_um)


def _refuse_turned_back(
    orders: Sequence[OrderApart], read_um: Mapping[int, Complexes], placements: Sequence[Placement]
) -> None:
    """Refuse placements with which the gauge has an error that vanishes if the part was turned the other way.

    The part has to be like that at each odd order by chance: two placements would keep its lobe as the gauge's.
    """
    back = [replace(each, turned_deg=0.0 - each.turned_deg) for each in placements]
    tells = {n for n in read_um if np.abs(_columns(n, placements) - _columns(n, back)).max() > 1.0}
    gauge = [each.gauge for each in orders if each.gauge.upr in tells]
    if any(each.proven for each in gauge):
        of_gauge_um = math.hypot(*(math.hypot(each.cosine_um, each.sine_um) for each in gauge))
        if TURNED_BACK * math.hypot(*(abs(_solve(n, read_um[n], back)[0][1]) for n in tells)) < of_gauge_um:
            said, other = (",".join(map(str, each)) for each in (placements, back))
            raise refusal_error("separation.turned_back", key="--separate", value=said, limit=other)


def _spectrum(angle_deg: Floats, deviation_um: Floats) -> dict[int, complex]:
    highest = min(_NOISE_ORDERS[-1], (angle_deg.size - 1) // 4)
    orders = range(1, highest + 1)
    columns = harmonic_columns(np.radians(angle_deg), orders)
    return phasors(fit(columns, deviation_um, np.sqrt(angle_weights(angle_deg))).coefficients, orders)


def _columns(n: int, placements: Sequence[Placement]) -> Complexes:
    """Return what part and gauge of phasor 1 give in each reading; shape (K, 2)."""
    shifts = np.radians([each.shift_deg for each in placements])
    return np.stack([np.exp(-1j * n * shifts), np.array([each.sign for each in placements])], axis=1)


def _is_blind(n: int, placements: Sequence[Placement]) -> bool:
    """Return whether noise would grow beyond `MOST_AMPLIFIED`: 1 / the smallest singular value."""
    return float(np.linalg.svd(_columns(n, placements), compute_uv=False)[-1]) * MOST_AMPLIFIED < 1.0


def _solve(n: int, read_um: Complexes, placements: Sequence[Placement]) -> tuple[Complexes, Complexes]:
    """Return the phasors of part and gauge, shape (2,), and what is left of the readings, (K,)."""
    columns = _columns(n, placements)
    both = np.linalg.pinv(columns) @ read_um
    return both, read_um - columns @ both


def _order(
    n: int, both: Complexes, placements: Sequence[Placement], noise_um: float, turning_sd_deg: float
) -> OrderApart:
    inverse = np.abs(np.linalg.pinv(_columns(n, placements))) ** 2  # (2, K); the first placement is not off
    noise = noise_um * np.sqrt(inverse.sum(axis=1))
    turning = n * abs(both[0]) * math.radians(turning_sd_deg) * np.sqrt(inverse[:, 1:].sum(axis=1))
    part_sd_um, gauge_sd_um = np.hypot(noise, turning).tolist()
    gauge_um = complex(both[1])
    return OrderApart(
        part_um=complex(both[0]),
        part_sd_um=part_sd_um,
        gauge=GaugeOrder(upr=n, cosine_um=gauge_um.real, sine_um=-gauge_um.imag, sd_um=gauge_sd_um),
        turning_um=float(turning[1]),
    )
