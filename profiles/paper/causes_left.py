"""What may have left 30 and 14 um: ten explanations, how many of them the parts cannot tell apart, what would.

Each is a path, a servo and a lobe frequency, or a chuck that deflects in proportion to the depth. One that leaves
what Fig 16 shows of both parts, within `WITHIN_UM`, explains them.

The motion that Prog. 1 really commands: two moves +P and -P of a time TM whose corners are blended over TA <= TM.
As a fraction of P, with its maximum at phase 0, it is sum c_k cos(k phase) over odd k about its mean (PMAC,
blended LINEAR moves):

c_k = 4 / (pi k)^2 for a triangle, times sin(x)/x, x = k pi TA / (2 TM), with linear ramps,
    times (sin(x/2)/(x/2))^2 with full S-curves.

The part stands high by (E/2) cos(phase); the tool goes in by E sum c_k Re(T(k f) exp(j k phase)).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Complexes, Floats, floats
from profiles.axis.servo import eq9_response
from profiles.paper.record import COMPENSATED_UM, CONCLUDED_UM, Basis, Experiments, Record
from profiles.paper.table_5 import measured_response

FULL_BLEND = 1.0  # TA = TM: every move of Prog. 1 is all acceleration time
WITHIN_UM = 6.0  # required agreement with a measured part of a model without any tuned factor
COMPLIANCE = "compliance"
_BLENDED = "s_curve_measured"

Servo = Callable[[ArrayLike], Complexes]
"""From frequencies in Hz to responses."""

HARMONICS, PLACES = 201, 3600


class Ramps(StrEnum):
    """How the velocity passes from one move to the next: TS 0, or TA = 2 TS."""

    LINEAR = "linear"
    S_CURVE = "s_curve"


SINE: Mapping[int, float] = {1: 0.5}  # the target path: its swing is P


def zigzag(ramps: Ramps, blend_fraction: float) -> dict[int, float]:
    """Return the c_k of a zigzag that blends over `blend_fraction` = TA / TM (0 to 1) of each move."""
    harmonics = {}
    for k in range(1, HARMONICS, 2):
        x = k * blend_fraction / 2  # numpy's sinc includes pi
        blend = np.sinc(x) if ramps is Ramps.LINEAR else np.sinc(x / 2) ** 2
        harmonics[k] = float(4 / (np.pi * k) ** 2 * blend)
    return harmonics


def stroke_fraction(ramps: Ramps, blend_fraction: float) -> float:
    """Return the swing over P: 1 - TA/(2 TM) with linear ramps, 1 - TA/(3 TM) with full S-curves."""
    return 1 - blend_fraction / (2 if ramps is Ramps.LINEAR else 3)


def fundamental_fraction(harmonics: Mapping[int, float]) -> float:
    """Return the swing of the first harmonic over P."""
    return 2 * harmonics[1]


def ideal_servo(frequency_hz: ArrayLike) -> Complexes:
    """Return 1 at every frequency."""
    return np.ones(np.shape(frequency_hz), dtype=np.complex128)


def left_um(
    error_um_pp: float, harmonics: Mapping[int, float], servo: Servo, lobe_hz: float, phase_rad: ArrayLike
) -> Floats:
    """Return the deviation of the part at phases of the lobe, in their shape; positive where it stands high."""
    phase = floats(phase_rad)
    moved = np.zeros(phase.shape)
    responses = servo(np.array(list(harmonics), dtype=np.float64) * lobe_hz)
    for (k, fraction), response in zip(harmonics.items(), responses, strict=True):
        moved += fraction * np.real(response * np.exp(1j * k * phase))
    return floats(error_um_pp * (0.5 * np.cos(phase) - moved))


def left_um_pp(error_um_pp: float, harmonics: Mapping[int, float], servo: Servo, lobe_hz: float) -> float:
    """Return the remaining roundness error: order N does not move the centre of a circle."""
    phase = 2 * np.pi * np.arange(PLACES) / PLACES
    return float(np.ptp(left_um(error_um_pp, harmonics, servo, lobe_hz, phase)))


def left_by_compliance_um_pp(error_um_pp: float, depth_um: float, mean_shift_um: float) -> float:
    """Return the lobe that a perfect sine leaves where the error is caused by compliance, in proportion to depth.

    removed = s (depth + shift - tool), s = s0 + (E / 2 D) sin(3 angle), and s0 = 1 - E / (2 D), because nothing
    is cut deeper than the tool goes: E (1 - s0) + E shift / D are left.
    """
    fraction = error_um_pp / (2 * depth_um)
    return error_um_pp * fraction + error_um_pp * mean_shift_um / depth_um


Model = tuple[Mapping[int, float], Servo, float]


def models(paper: Experiments) -> dict[str, Model]:
    """Return what may explain the residual: a trajectory, a servo, and the lobe frequency in Hz."""
    eq9 = partial(eq9_response, paper.machine)
    s_curve, linear = zigzag(Ramps.S_CURVE, FULL_BLEND), zigzag(Ramps.LINEAR, FULL_BLEND)
    return {
        "sine_measured": (SINE, measured_response, 50.0),
        "sine_eq9": (SINE, eq9, 50.0),
        "s_curve_ideal": (s_curve, ideal_servo, 50.0),
        _BLENDED: (s_curve, measured_response, 50.0),
        "s_curve_measured_25": (s_curve, measured_response, 25.0),
        "s_curve_eq9_25": (s_curve, eq9, 25.0),
        "linear_ideal": (linear, ideal_servo, 50.0),
        "linear_measured": (linear, measured_response, 50.0),
        "triangle_measured": (zigzag(Ramps.LINEAR, 0.0), measured_response, 50.0),
    }


def cause_records(paper: Experiments) -> tuple[Record, ...]:
    """Return what each explanation leaves of both parts, how many explain both, and what would tell them apart."""
    left = _left_um(paper)
    records = []
    for number, measured in enumerate(COMPENSATED_UM, start=1):
        of = partial(Record, unit="um", at=f"{number}", expected=measured, tolerance=WITHIN_UM, basis=Basis.RIVAL)
        records += [of(f"cause.{name}", each[number - 1], why=_name_cause(name)) for name, each in left.items()]
    both = explaining(paper)
    lost = 100 * (1 - stroke_fraction(Ramps.S_CURVE, FULL_BLEND))
    facts = {"count": len(both), "all": len(left), "lost_percent": lost, "within_um": WITHIN_UM}
    facts |= {"concluded_um": CONCLUDED_UM}
    count = Record("fig16.explained", float(len(both)), expected=1.0, why="not_identified", facts=facts)
    return (*records, count, *_deciding(paper, both))


def explaining(paper: Experiments) -> tuple[str, ...]:
    """Return the explanations that leave what was measured of both parts."""
    return tuple(
        name
        for name, each in _left_um(paper).items()
        if all(abs(um - measured) <= WITHIN_UM for um, measured in zip(each, COMPENSATED_UM, strict=True))
    )


def _left_um(paper: Experiments) -> dict[str, Sequence[float]]:
    found: dict[str, Sequence[float]] = {
        name: [left_um_pp(error, *model) for error in paper.errors_um_pp] for name, model in models(paper).items()
    }
    found[COMPLIANCE] = [
        left_by_compliance_um_pp(error, 1000 * job.depth_of_cut_mm, error / 2)
        for job, error in zip(paper.jobs, paper.errors_um_pp, strict=True)
    ]
    return found


def _deciding(paper: Experiments, both: Sequence[str]) -> list[Record]:
    """Return what the scale of the tool would show in experiment 1, by each explanation that is left.

    The chuck that deflects has a perfect sine, whatever made it.
    """
    error_um, records = paper.errors_um_pp[0], []
    of = {**models(paper), COMPLIANCE: (SINE, ideal_servo, 50.0)}
    for name in both:
        harmonics, servo, hz = of[name]
        gain, phase_rad = cmath.polar(complex(servo(hz)))
        stroke_um = error_um * fundamental_fraction(harmonics) * gain
        records.append(Record("decide.stroke", stroke_um, "um", at=name))
        records.append(Record("decide.lag", 0.0 - math.degrees(phase_rad), "deg", at=name))
    return records


def _name_cause(name: str) -> str:
    return COMPLIANCE if name == COMPLIANCE else ""
