"""A recorded part evaluated anew from its trace, as it was judged: for Records, Inspect and the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from console.session.cut.recording import mean_diameter_of
from console.session.cut.run import FILTER_UPR
from console.session.data.measured_part import RecordedPart
from console.session.learning.imported import on_the_spindle, one_turn
from profiles.arrays import Floats
from profiles.problem import Problem
from profiles.roundness import RoundnessResult, centred_profile, evaluate
from profiles.strict_values import number_or_none
from profiles.trace_files.header import TraceHeader, header_of
from profiles.traces import Trace

SAME_UM, SAME_MM = 1e-6, 1e-9
"""Difference within which two evaluations are the same: far above the last bit, far below the last digit shown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedPart:
    """A recorded part with one turn of its trace; what takes numerics is computed when it is first asked for.

    `jaw_1_deg` is jaw 1 in the angles of `turn`, None if that is unknown; `warnings` are those of the header.
    `result` and `profile_um` raise ProfileError where the trace cannot be evaluated.
    """

    recorded: RecordedPart
    header: TraceHeader
    trace: Trace
    turn: Trace
    jaw_1_deg: float | None
    warnings: tuple[Problem, ...] = ()

    @property
    def radius_mm(self) -> float | None:
        """Radius that the part was judged with, None where its trace has no size."""
        return number_or_none(self.recorded.data.get("radius_mm"))

    @property
    def filter_upr(self) -> float:
        """Cut-off of the filter, undulations per revolution."""
        return number_or_none(self.recorded.data.get("filter_upr")) or FILTER_UPR

    @cached_property
    def result(self) -> RoundnessResult:
        """The roundness at the angles of the turn."""
        turn, state = self.turn, self.header.state
        return evaluate(turn.angle_deg, turn.deviation_um, self.filter_upr, state=state, radius_mm=self.radius_mm)

    @cached_property
    def profile_um(self) -> Floats:
        """The deviations from the least squares circle at the angles of the turn."""
        return centred_profile(self.turn.angle_deg, self.turn.deviation_um, self.filter_upr)

    @property
    def differing(self) -> tuple[str, ...]:
        """The names of the recorded figures that the trace does not give."""
        part, found = self.recorded, self.result
        pairs = [
            (name, number_or_none(part.data.get(f"{name}_um")), getattr(found, f"{name.lower()}_um"), SAME_UM)
            for name in ("RONp", "RONv", "RONq")
        ]
        pairs = [("RONt", part.ront_um, found.ront_um, SAME_UM), *pairs]
        pairs.append(("D", part.diameter_mm, mean_diameter_of(self.trace, found), SAME_MM))
        return tuple(
            name
            for name, one, other, allowed in pairs
            if one is not None and other is not None and not abs(one - other) <= allowed
        )


def evaluated_part(
    part: RecordedPart, setup: Mapping[str, Any], *at_once: str, on_spindle: bool = False
) -> EvaluatedPart | None:
    """Read the trace of a part of a run with this set-up, None without one; `on_spindle` at spindle angles.

    `at_once` are the properties that are computed here and not where they are first asked for.
    Raises ProfileError: the trace cannot be read, or not evaluated.
    """
    trace = part.read_trace()
    if trace is None:
        return None
    header, warnings = header_of(trace.meta)
    turn = one_turn(trace, header)
    spindle_deg = number_or_none(part.data.get("jaw_1_deg", setup.get("jaw_1_deg")))
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if on_spindle:
        jaw_1_deg = spindle_deg if header.phase_known else None
        turn = turn if jaw_1_deg is None else on_the_spindle(turn, header, jaw_1_deg)
    found = EvaluatedPart(
        recorded=part, header=header, trace=trace, turn=turn, jaw_1_deg=jaw_1_deg, warnings=warnings
    )
    for name in at_once:
        getattr(found, name)
    return found
