"""Why a part is not the same over its length: taper, a lobe that changes along Z, the entry, a bent axis.

Each section is described by its mean radius (order 0), the place of its middle (order 1) and its undulations from
2 per revolution on. A cause is named if it is beyond the noise of the traces, which their undulations above
`HIGHEST_ORDER` show, and a fraction of CYLt. Which size and fraction are worth naming is a choice.

- Entry: in one order all sections but that nearest to the free end (the largest Z) lie on a straight line, and
  that one is off it. It takes four sections; the others alone then say whether that order has another cause.
- Taper: the straight line through the mean radii, from the first section to the last.
- Lobe: the undulations of one order at either end less those in the middle, peak to peak.
- Bent: the middles of the sections lie in a circle about their straight line; its diameter, as for ISO 12180.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from profiles.arrays import Floats
from profiles.metrology.conformity import JudgedFigure, ToleranceKind

CAUSES = "length_causes"  # key of results and records
HIGHEST_ORDER, HIGHEST_NOISE = 15, 30
LEAST_UM = 0.3
LEAST_OF_CYLT = 0.15
NOISE_SD = 8.0
"""Standard deviations of a coefficient: none of the 28 differences of two sections exceeds it by noise alone."""

ALONE = 0.12
"""The most that the other sections are off their line, relative to the section that is off alone."""

LEAST_FOR_ENTRY = 4
_RAYLEIGH_MEDIAN = math.sqrt(2.0 * math.log(2.0))

Complexes = NDArray[np.complex128]


class LengthCauseKind(StrEnum):
    """What makes the sections of a part differ."""

    TAPER = "taper"
    LOBE = "lobe"
    ENTRY = "entry"
    BENT = "bent"
    MARK = "mark"  # of a stop, in the section at `first_mm`: known by the console alone


@dataclass(frozen=True, slots=True, kw_only=True)
class LengthCause:
    """A cause with its amount: um p-p, of the radius for a taper, of the diameter of a zone for a bent axis.

    `order` are the undulations per revolution, 0 for the mean radius. From `first_mm` to `last_mm` (Z) a taper
    adds `last_um` to the radius; the ends of a lobe have `first_um` and `last_um` p-p more than the middle, less
    if negative. At the entry `last_um` is how far the section at `last_mm` is off, signed for a mean radius.
    """

    kind: LengthCauseKind
    um_pp: float
    order: int = 0
    first_mm: float = 0.0
    last_mm: float = 0.0
    first_um: float = 0.0
    last_um: float = 0.0


_ORDERS = {
    ToleranceKind.ROUNDNESS: range(2, HIGHEST_ORDER + 1),
    ToleranceKind.CYLINDRICITY: range(HIGHEST_ORDER + 1),
    ToleranceKind.DIAMETER: range(1),
}
"""The orders by which a figure can be beyond its limit: no taper makes a section less round."""


def causes_of_failure(causes: Iterable[LengthCause], judged: Sequence[JudgedFigure]) -> tuple[LengthCause, ...]:
    """Return the causes that can explain a figure that fails; all of them if none does."""
    failed = [each.kind for each in judged if each.passes is False]
    return tuple(each for each in causes if not failed or any(each.order in _ORDERS[kind] for kind in failed))


def length_causes(z_mm: Floats, turns_um: Floats, points: int, cylt_um: float) -> tuple[LengthCause, ...]:
    """Return the causes, the largest first; none where the sections differ by no more than noise.

    `z_mm` are K heights from the jaws on, shape (K,), K >= 3; `turns_um` the deviations of their radii at equal
    angles, shape (K, M), from traces of `points` each. `cylt_um` is the cylindricity of the part.
    """
    orders = np.fft.rfft(turns_um, axis=1)[:, : HIGHEST_NOISE + 1] / turns_um.shape[1]
    orders[:, 1:] *= 2.0
    noise = orders[:, HIGHEST_ORDER + 1 : max((points - 1) // 2, HIGHEST_ORDER + 2)]
    noise_um = NOISE_SD * float(np.median(np.abs(noise))) / _RAYLEIGH_MEDIAN
    named_um = max(LEAST_UM, LEAST_OF_CYLT * cylt_um, 2.0 * noise_um)
    found, entries = list[LengthCause](), list[LengthCause]()
    for n in range(HIGHEST_ORDER + 1):
        values, z = orders[:, n], z_mm
        entry = _entry(n, values, z_mm) if n != 1 else None
        if entry is not None and entry.um_pp > named_um:
            entries.append(entry)
            values, z = values[:-1], z_mm[:-1]
        cause = {0: _taper, 1: _bent}.get(n, _lobe)(n, values, z)
        if cause.um_pp > named_um:
            found.append(cause)
    found += sorted(entries, key=lambda each: -each.um_pp)[:1]
    return tuple(sorted(found, key=lambda each: -each.um_pp))


def _line(values: Complexes, z_mm: Floats, at_mm: Floats) -> Complexes:
    """Return the straight line through values at the heights `at_mm`."""
    about = z_mm - z_mm.mean()
    slope = np.sum(about * values) / np.sum(about**2)
    return np.asarray(values.mean() + slope * (at_mm - z_mm.mean()))


def _entry(n: int, values: Complexes, z_mm: Floats) -> LengthCause | None:
    if z_mm.size < LEAST_FOR_ENTRY:
        return None
    off = values - _line(values[:-1], z_mm[:-1], z_mm)
    if np.abs(off[:-1]).max() > ALONE * abs(off[-1]):
        return None
    last_um = float(off[-1].real) if n == 0 else 2.0 * float(abs(off[-1]))
    return _cause(LengthCauseKind.ENTRY, n, z_mm, abs(last_um), (0.0, last_um))


def _taper(_: int, values: Complexes, z_mm: Floats) -> LengthCause:
    first, last = _line(values, z_mm, z_mm[[0, -1]]).real.tolist()
    return _cause(LengthCauseKind.TAPER, 0, z_mm, abs(last - first), (0.0, last - first))


def _bent(_: int, values: Complexes, z_mm: Floats) -> LengthCause:
    um = 2.0 * float(np.abs(values - _line(values, z_mm, z_mm)).max())
    return _cause(LengthCauseKind.BENT, 1, z_mm, um)


def _lobe(n: int, values: Complexes, z_mm: Floats) -> LengthCause:
    middle = values[int(np.abs(z_mm - 0.5 * (z_mm[0] + z_mm[-1])).argmin())]
    highest = values[int(np.abs(values).argmax())]

    def more_um(value: complex) -> float:
        return 2.0 * math.copysign(abs(value - middle), ((value - middle) * highest.conjugate()).real)

    first_um, last_um = more_um(complex(values[0])), more_um(complex(values[-1]))
    um = max(abs(first_um), abs(last_um))
    return _cause(LengthCauseKind.LOBE, n, z_mm, um, (first_um, last_um))


def _cause(
    kind: LengthCauseKind, order: int, z_mm: Floats, um_pp: float, ends_um: tuple[float, float] = (0.0, 0.0)
) -> LengthCause:
    first_mm, last_mm = float(z_mm[0]), float(z_mm[-1])
    return LengthCause(
        kind=kind,
        um_pp=um_pp,
        order=order,
        first_mm=first_mm,
        last_mm=last_mm,
        first_um=ends_um[0],
        last_um=ends_um[1],
    )
