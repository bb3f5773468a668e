"""The measured parts of a run, evaluated anew from their recorded traces, and compared with the record."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from console.session.cut.recording import mean_diameter_of
from console.session.cut.run import FILTER_UPR
from console.session.data.run_reader import RecordedPart
from profiles.arrays import Floats
from profiles.metrology.turns import several_turns
from profiles.problem import Problem, ProfileError
from profiles.roundness import RoundnessResult, centred_profile, evaluate
from profiles.trace_files.header import TraceHeader, header_of
from profiles.traces import Trace, parse_trace

SAME_UM, SAME_MM = 1e-6, 1e-9
"""Difference within which two evaluations are the same: far above the last bit, far below the last digit shown."""

DRAWN_POINTS = 720
"""Points of a drawn profile: some fourteen for each undulation that the filter passes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """What a recorded trace gives.

    The profile has M points, um, from the least squares circle: shape (M,) each. `jaw_1_deg` is jaw 1 in the
    angles of the trace, None where that is unknown; `warnings` are those of the header and of the evaluation.
    """

    result: RoundnessResult
    header: TraceHeader
    angle_deg: Floats = field(repr=False)
    profile_um: Floats = field(repr=False)
    jaw_1_deg: float | None
    diameter_mm: float | None
    warnings: tuple[Problem, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvaluatedPart:
    """A part of a run, with the evaluation of its trace.

    `found` is None without a trace, or with `problems` that prevent an evaluation. `differing` names the recorded
    figures that the trace does not give, `same_trace` is whether the trace has its recorded hash.
    """

    recorded: RecordedPart
    found: Evaluation | None = None
    problems: tuple[Problem, ...] = ()
    differing: tuple[str, ...] = ()
    same_trace: bool = True

    @property
    def doubtful(self) -> bool:
        """Whether record and trace contradict each other."""
        return bool(self.differing or self.problems) or not self.same_trace

    @property
    def jaw_1_deg(self) -> float | None:
        """Angle of jaw 1 in the trace, None where it is unknown."""
        return None if self.found is None else self.found.jaw_1_deg


def evaluated(part: RecordedPart, jaw_1_deg: float | None) -> EvaluatedPart:
    """Evaluate a part's trace as it was judged; `jaw_1_deg` is the spindle angle of jaw 1, None unknown."""
    if part.trace is None:
        return EvaluatedPart(recorded=part)
    same = part.trace_sha256 in (None, hashlib.sha256(part.trace).hexdigest())
    try:
        found = _evaluation(part, part.trace, jaw_1_deg)
    except ProfileError as refused:
        return EvaluatedPart(recorded=part, problems=tuple(refused.problems), same_trace=same)
    except ValueError as refused:  # a header that no console has written
        problem = Problem(code="trace.header_value", value=str(refused))
        return EvaluatedPart(recorded=part, problems=(problem,), same_trace=same)
    return EvaluatedPart(recorded=part, found=found, differing=_differing(part, found), same_trace=same)


def _evaluation(part: RecordedPart, content: bytes, jaw_1_deg: float | None) -> Evaluation:
    filed = parse_trace(content)
    answers = part.data.get("answers")
    given = {str(key): str(value) for key, value in answers.items()} if isinstance(answers, Mapping) else {}
    trace = replace(filed, meta=MappingProxyType({**filed.meta, **given}))
    header, warnings = header_of(trace.meta)
    turn = _one_turn(trace, header)
    radius_mm = _number(part.data.get("radius_mm"))
    filter_upr = _number(part.data.get("filter_upr")) or FILTER_UPR
    result = evaluate(turn.angle_deg, turn.deviation_um, filter_upr, state=header.state, radius_mm=radius_mm)
    profile = centred_profile(turn.angle_deg, turn.deviation_um, filter_upr)
    order = np.argsort(np.mod(turn.angle_deg, 360.0), kind="stable")
    kept = order[:: max(1, math.ceil(order.size / DRAWN_POINTS))]
    return Evaluation(
        result=result,
        header=header,
        angle_deg=turn.angle_deg[kept],
        profile_um=profile[kept],
        jaw_1_deg=header.jaw_1_of(jaw_1_deg),
        diameter_mm=mean_diameter_of(trace, result),
        warnings=(*warnings, *result.warnings),
    )


def _one_turn(trace: Trace, header: TraceHeader) -> Trace:
    if header.turns == 1:
        return trace
    turns = several_turns(trace.angle_deg, trace.deviation_um, header.turns)
    return Trace(angle_deg=turns.angle_deg, deviation_um=turns.repeatable_um, meta=trace.meta)


def _differing(part: RecordedPart, found: Evaluation) -> tuple[str, ...]:
    """Return the names of the recorded figures that the trace does not give."""
    pairs = [("RONt", part.ront_um, found.result.ront_um, SAME_UM)]
    recorded = {name: _number(part.data.get(f"{name}_um")) for name in ("RONp", "RONv", "RONq")}
    pairs += [
        (name, value, getattr(found.result, f"{name.lower()}_um"), SAME_UM)
        for name, value in recorded.items()
        if value is not None
    ]
    if part.diameter_mm is not None and found.diameter_mm is not None:
        pairs.append(("D", part.diameter_mm, found.diameter_mm, SAME_MM))
    return tuple(name for name, one, other, allowed in pairs if not abs(one - other) <= allowed)


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
