"""The harmonics of a measured part in spindle angles, where a tool path can use them.

A trace whose angles are t has Re(c exp(j n t)); at spindle angles a = s t + o, with s = -1 where the trace runs
against the spindle, that is Re(c' exp(j n a)) with c' = c exp(-j n o), or conj(c) exp(-j n o) against it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from profiles.arrays import Floats
from profiles.calibration.lobe import INDEX, OVAL, find_lobe
from profiles.compensations.learning import fit_harmonics
from profiles.job import Job
from profiles.lobe.lobe_fit import FittedHarmonic, fit_lobe
from profiles.metrology.turns import several_turns
from profiles.metrology.uncertainty import KnownGauge
from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate
from profiles.trace_files.header import TraceHeader, header_of
from profiles.traces import Trace

_OF_A_PLAIN_CUT = ("lobe.not_significant", "lobe.compensated", "lobe.simulated")
"""Reasons why a part does not show the lobe of its job; a path may still be learned from it."""

MOST_ORDER = 15  # that a diagnosis looks at

_UNPLACED = ("lobe.phase_unknown", "learned.jaw_assumed")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PartHarmonics:
    """A part: coefficients in um by order, in spindle angle, positive outwards, with standard errors.

    `angle_deg` and `deviation_um` are one turn of the trace, shape (M,), the angles its own; its angle 0 is at the
    spindle angle `begins_deg`. `mean_um` is the mean of the fit, `filter_upr` the filter of RONt, `radius_mm` the
    radius of the part. `reasons` are why nothing may be learned from it; `warnings` do not prevent it.
    """

    mean_um: float
    coefficients_um: Mapping[int, complex]
    sd_um: Mapping[int, float]
    angle_deg: Floats
    deviation_um: Floats
    against_spindle: bool
    begins_deg: float
    filter_upr: float
    radius_mm: float
    reasons: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()

    @property
    def is_placed(self) -> bool:
        """Whether its angles are known on the spindle."""
        return not any(reason.code in _UNPLACED for reason in self.reasons)

    @property
    def spindle_deg(self) -> Floats:
        """The spindle angles of its trace, shape (M,)."""
        return (-1.0 if self.against_spindle else 1.0) * self.angle_deg + self.begins_deg

    def ront_um(self, less_um: Mapping[int, complex] | None = None) -> float:
        """Return RONt of the part, lowered by Re(c exp(j n angle)) for each n of `less_um`."""
        left_um = np.array(self.deviation_um)
        for n, coefficient in (less_um or {}).items():
            left_um -= np.real(coefficient * np.exp(1j * n * np.radians(self.spindle_deg)))
        return evaluate(self.angle_deg, left_um, self.filter_upr, radius_mm=self.radius_mm).ront_um

    def turn_by(self, by_deg: float) -> PartHarmonics:
        """Return the part as if mounted so many degrees of spindle further on, as `LobedPath.turn_by`."""
        turn = math.radians(by_deg)
        turned = {n: c * cmath.exp(-1j * n * turn) for n, c in self.coefficients_um.items()}
        return replace(self, coefficients_um=turned, begins_deg=self.begins_deg + by_deg)


def part_harmonics(
    trace: Trace,
    job: Job,
    *,
    filter_upr: float,
    extra: Iterable[int] = (),
    beside: Sequence[int] = (),
    robust: bool = False,
    gauge: KnownGauge | None = None,
) -> PartHarmonics:
    """Return the harmonics of a part of this job; `filter_upr` filters its RONt, `extra` are further orders.

    Those of `beside` are fitted for themselves: they change nothing of the others, and where the trace cannot
    separate them they are missing. With a `gauge` no standard error is below the uncertainty of that at its order.
    Raises `ProfileError`: what the fit, or the roundness of such a trace, refuses.
    """
    found = find_lobe(trace, job, extra=extra, robust=robust)
    header, _ = header_of(trace.meta)
    begins_deg = _begins_deg(header, job)
    reasons = [problem for problem in found.reasons if problem.code not in _OF_A_PLAIN_CUT]
    if found.phase_assumed:
        reasons.append(Problem(code="learned.jaw_assumed", key="lobe_phase_deg", limit=f"# start_mark: {INDEX}"))
    angle_deg, deviation_um = trace.angle_deg, trace.deviation_um
    if header.turns > 1:
        turns = several_turns(angle_deg, deviation_um, header.turns)
        angle_deg, deviation_um = turns.angle_deg, turns.repeatable_um
    placed: dict[int, complex] = {}
    fitted = {
        each.n: each for each in (*_fit_further_harmonics(trace, job, beside, robust=robust), *found.fit.harmonics)
    }
    for harmonic in fitted.values():
        own = complex(harmonic.cos_um, -harmonic.sin_um)
        if harmonic.n == OVAL:
            # A circle off the gauge's axis by c has a second harmonic of c^2 / (4 R), which is not of the part.
            own -= complex(fitted[1].cos_um, -fitted[1].sin_um) ** 2 / (4000.0 * header.radius_of(job))
        seen = own.conjugate() if header.against_spindle else own
        placed[harmonic.n] = seen * cmath.exp(-1j * harmonic.n * math.radians(begins_deg))
    least_um = {} if gauge is None else gauge.order_sd_um(placed, trace.angle_deg.size)
    return PartHarmonics(
        mean_um=found.fit.mean_um,
        coefficients_um=placed,
        sd_um={n: max(harmonic.sd_um, least_um.get(n, 0.0)) for n, harmonic in fitted.items()},
        angle_deg=angle_deg,
        deviation_um=deviation_um,
        against_spindle=header.against_spindle,
        begins_deg=begins_deg,
        filter_upr=filter_upr,
        radius_mm=header.radius_of(job),
        reasons=tuple(reasons),
        warnings=found.warnings,
    )


def _fit_further_harmonics(
    trace: Trace, job: Job, orders: Sequence[int], *, robust: bool
) -> Sequence[FittedHarmonic]:
    """Return the harmonics of these orders, none where the angles of the trace cannot separate so many."""
    if not orders:
        return ()
    try:
        found = fit_lobe(trace.angle_deg, trace.deviation_um, job.jaws, extra=orders, robust=robust)
    except ProfileError:
        return ()
    return [harmonic for harmonic in found.harmonics if harmonic.n in orders]


def _begins_deg(header: TraceHeader, job: Job) -> float:
    """Return the spindle angle at angle 0 of the trace; 0 where unknown, which is then a reason."""
    if header.start_mark == INDEX or header.jaw_1_deg is None:
        return 0.0
    return job.jaw_1_deg - (-1.0 if header.against_spindle else 1.0) * header.jaw_1_deg


def seen_orders(part: PartHarmonics) -> Mapping[int, complex]:
    """Return the harmonics of the part up to `MOST_ORDER`, at spindle angles."""
    return fit_harmonics(part.spindle_deg, part.deviation_um, range(1, MOST_ORDER + 1)).coefficients_um
