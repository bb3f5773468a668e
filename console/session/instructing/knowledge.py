"""What the console knows of a lathe at a checkpoint. It is as true of the lathe that continues from there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from console.session.station.state import Armed
    from drivers.commissioning.fingerprint import Fingerprint
    from drivers.cutting.planning import CutPlan

KEPT = (
    "alignment",
    "cut",
    "cut_done",
    "touched",
    "marks_mm",
    "measured",
    "uncompensated",
    "tool_loop",
    "tested",
    "uncommissioned",
    "trial",
)
"""Fields of the state that are about the lathe and its part, and are not read with every poll."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Knowledge:
    """What was known at a checkpoint: fields of the state, the plan of the last arming, what was last started."""

    name: str
    at: str
    fields: Mapping[str, Any]
    plan: CutPlan | None
    started: Armed | None
    limits_seen: frozenset[str]
    fingerprint: Fingerprint | None
