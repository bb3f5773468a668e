"""What may have left 30 and 14 um: ten explanations, how many of them the parts cannot tell apart, what would.

Each is a path, a servo and a lobe frequency, or a chuck that deflects in proportion to the depth. One that leaves
what Fig 16 shows of both parts, within `WITHIN_UM`, explains them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from functools import partial

from profiles.axis.servo import eq9_response
from profiles.paper.experiments import COMPENSATED_UM, CONCLUDED_UM, Experiments
from profiles.paper.record import Basis, Record
from profiles.paper.residual import (
    SINE,
    Ramps,
    Servo,
    fundamental_fraction,
    ideal_servo,
    left_by_compliance_um_pp,
    left_um_pp,
    stroke_fraction,
    zigzag,
)
from profiles.paper.table_5 import measured_response

FULL_BLEND = 1.0  # TA = TM: every move of Prog. 1 is all acceleration time
WITHIN_UM = 6.0  # required agreement with a measured part of a model without any tuned factor
COMPLIANCE = "compliance"
_BLENDED = "s_curve_measured"

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
        records += [of(f"cause.{name}", each[number - 1], why=_why(name)) for name, each in left.items()]
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


def _why(name: str) -> str:
    return COMPLIANCE if name == COMPLIANCE else ""
