"""Diagnose the cause of a lobe, clamping or compliance, by its sign at the jaws."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

CLEAR_DEG = 45.0
"""How far, in degrees of lobe, a maximum or minimum may be from the jaws and still count as at them."""


class Mechanism(StrEnum):
    """The cause of a lobe."""

    SPRING_BACK = "spring_back"
    WALL = "wall_compliance"
    CONTACT = "contact_compliance"


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Where the part is high, in degrees of lobe from the jaws (-180 to 180), and the cause that this suggests.

    `mechanism` is None where the lobe is a quarter of a lobe off: jaw 1 is marked wrongly, or the part vibrates
    near its resonance (Eq 3). `high_at_jaws` is then None, too.
    """

    lobe_phase_deg: float
    high_at_jaws: bool | None
    mechanism: Mechanism | None


def diagnose(*, phase_deg: float, jaw_1_deg: float, jaws: int, thin: bool) -> Diagnosis:
    """Return the cause that a measured lobe suggests; angles are spindle angles in degrees.

    A thin part that was deformed by clamping and turned round is HIGH at the jaws after release. A wall that
    deflects between the jaws is cut less there: LOW at the jaws. A stiff bar deflects least where a jaw is
    opposite to the force (Fig 3), and the tool pushes from the other side: HIGH at the jaws with an odd number
    of jaws, LOW with an even one.
    """
    lobe_phase_deg = (jaws * (phase_deg - jaw_1_deg) + 180) % 360 - 180
    high = abs(lobe_phase_deg) <= CLEAR_DEG
    if not high and abs(lobe_phase_deg) < 180 - CLEAR_DEG:
        return Diagnosis(lobe_phase_deg=lobe_phase_deg, high_at_jaws=None, mechanism=None)
    if thin:
        mechanism: Mechanism | None = Mechanism.SPRING_BACK if high else Mechanism.WALL
    else:
        mechanism = Mechanism.CONTACT if high == (jaws % 2 == 1) else None
    return Diagnosis(lobe_phase_deg=lobe_phase_deg, high_at_jaws=high, mechanism=mechanism)
