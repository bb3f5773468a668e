"""A part evaluated from its trace, which is in the record, as it was judged then, or in the file of a gauge."""

from __future__ import annotations

import cmath
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from console.session.cut.recording import mean_diameter_of
from console.session.cut.run import FILTER_UPR
from console.session.data.measured_part import RecordedPart, is_other_lathe
from console.session.errors import SessionError, refuse
from console.session.learning.learning_steps import is_simulated, lathe_of
from profiles.arrays import Floats, read_only
from profiles.files import printable
from profiles.job import Job
from profiles.metrology.circles import ReferenceCircle
from profiles.metrology.cylindricity import CylinderResult
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.turns import Turns, several_turns, tool_offset_um
from profiles.problem import Problem
from profiles.roundness import RoundnessResult, centred_profile, evaluate
from profiles.strict_values import number_or_none
from profiles.trace_files.header import TraceHeader, header_of, size_doubt, unit_doubt
from profiles.trace_files.sections import TraceSection
from profiles.traces import Trace, parse_trace, read_trace_file

FREE, CLAMPED = "free", "clamped"
QUESTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"state": (FREE, CLAMPED), "direction": ("cw", "ccw"), "start_mark": ("jaw 1", "spindle index", "unknown")}
)
"""Header keys that an operator is asked for where the file does not state them, with the possible answers."""

UNKNOWN_STATE = "unknown"
_FULL_TURN_DEG = 360.0
SAME_UM, SAME_MM = 1e-6, 1e-9
"""Difference within which two evaluations are the same: far above the last bit, far below the last digit shown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EvaluatedPart:
    """A part with its trace and one `turn` of it; numerics run when their result is first read.

    `jaw_1_deg` is jaw 1 in the angles of `turn`, None if unknown; `warnings` are those of the header. `judged` is
    the result by which it is judged, None if it is not, for `problems` or before the state is known. `result` and
    `profile_um` raise ProfileError if the trace cannot be evaluated.

    The trace of a file, at `path` with this `content`, has the operator's answers among its header lines. `asked`
    are the keys that the file does not state, `open` those of them without an answer yet.

    `sections` are all measured ones from the lowest Z up, in the job's Z (mm from the jaw faces), each as one turn
    at the angles of `turn`; `trace` and `turn` are those of the section nearest to the middle of the cut. With one
    section only its `z_mm` may be None: not stated. `whole` is the form over the length, None where sections are
    too few for it.
    """

    trace: Trace
    header: TraceHeader
    turn: Trace
    turns: Turns | None = None
    jaw_1_deg: float | None = None
    job: Job | None = None
    filter_upr: float = FILTER_UPR
    radius_mm: float | None = None
    judged: RoundnessResult | None = None
    warnings: tuple[Problem, ...] = ()
    problems: tuple[Problem, ...] = ()
    recorded: RecordedPart | None = None
    path: Path = Path()
    content: bytes = field(default=b"", repr=False)
    asked: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    sections: tuple[TraceSection, ...] = ()
    whole: CylinderResult | None = None

    @cached_property
    def result(self) -> RoundnessResult:
        """The roundness at the angles of the turn."""
        turn, state = self.turn, self.header.state
        return self.judged or evaluate(
            turn.angle_deg, turn.deviation_um, self.filter_upr, state=state, radius_mm=self.radius_mm
        )

    @cached_property
    def profile_um(self) -> Floats:
        """The deviations from the least squares circle at the angles of the turn."""
        return centred_profile(self.turn.angle_deg, self.turn.deviation_um, self.filter_upr)

    @cached_property
    def sha256(self) -> str:
        """The hash of the file."""
        return hashlib.sha256(self.content).hexdigest()

    @property
    def ready(self) -> bool:
        """Whether the part can be judged by the trace."""
        return self.judged is not None and not self.open and not self.problems

    @property
    def mean_diameter_mm(self) -> float | None:
        """The mean diameter; None if the trace has no size."""
        return mean_diameter_of(self.trace, self.result)

    @property
    def tool_offset_um(self) -> float | None:
        """How much deeper the tool has to go for the diameter of the job; None without a size that may be its."""
        diameter_mm, job = self.mean_diameter_mm, self.job
        if diameter_mm is None or job is None or size_doubt(diameter_mm / 2.0, job) is not None:
            return None
        return tool_offset_um(diameter_mm, job.finished_diameter_mm)

    def past_jaw_1_deg(self, harmonic: Harmonic) -> float | None:
        """Return the phase of an undulation (its first maximum) from jaw 1, None if that is unknown."""
        if self.jaw_1_deg is None:
            return None
        return harmonic.past_jaw_1_deg(self.jaw_1_deg, against_spindle=self.header.against_spindle)

    @property
    def differing(self) -> tuple[str, ...]:
        """The names of the recorded figures that the trace does not give."""
        part, found = self.recorded, self.result
        if part is None:
            return ()
        pairs = [
            (name, number_or_none(part.data.get(f"{name}_um")), getattr(found, f"{name.lower()}_um"), SAME_UM)
            for name in ("RONp", "RONv", "RONq")
        ]
        pairs = [("RONt", part.ront_um, found.ront_um, SAME_UM), *pairs]
        pairs.append(("D", part.diameter_mm, self.mean_diameter_mm, SAME_MM))
        return tuple(
            name
            for name, one, other, allowed in pairs
            if one is not None and other is not None and not abs(one - other) <= allowed
        )


def evaluate_part(
    part: RecordedPart, setup: Mapping[str, Any], *at_once: str, on_spindle: bool = False
) -> EvaluatedPart | None:
    """Read the trace of a part of a run with this set-up, None without one; `on_spindle`: at spindle angles.

    `at_once` are the properties that are computed here and not when they are first read.
    Raises ProfileError: the trace cannot be read, or not evaluated.
    """
    trace = part.read_trace()
    if trace is None:
        return None
    header, warnings = header_of(trace.meta)
    turn, _ = fold_turns(trace, header)
    spindle_deg = number_or_none(part.data.get("jaw_1_deg", setup.get("jaw_1_deg")))
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if on_spindle:
        jaw_1_deg = spindle_deg if header.phase_known else None
        turn = turn if jaw_1_deg is None else turn_to_spindle(turn, header, jaw_1_deg)
    found = EvaluatedPart(
        recorded=part,
        trace=trace,
        header=header,
        turn=turn,
        jaw_1_deg=jaw_1_deg,
        filter_upr=number_or_none(part.data.get("filter_upr")) or FILTER_UPR,
        radius_mm=number_or_none(part.data.get("radius_mm")),
        warnings=warnings,
    )
    for name in at_once:
        getattr(found, name)
    return found


def read_gauge_file(
    path: Path, job: Job, answers: Mapping[str, str], *, simulated: bool, lathe: str = ""
) -> EvaluatedPart:
    """Read the trace in a file for a part of `job`, cut with jaw 1 where the job has it.

    `answers` replace the keys of `QUESTIONS` that the file does not state; `simulated`: the part was cut in a
    simulator, `lathe` names the simulated lathe, "" if unknown.

    Raises ProfileError: the file cannot be read, or its points cannot be evaluated.
    """
    content = read_trace_file(path)
    filed = parse_trace(content, where=printable(str(path)))
    asked = _list_questions(header_of(filed.meta)[0])
    given = {key: answers[key] for key in asked if key in answers}
    trace = replace(filed, meta=MappingProxyType({**filed.meta, **given}))
    header, warnings = header_of(trace.meta)
    open_ = tuple(key for key in _list_questions(header) if key not in given)
    problems = _refusals(trace, header, simulated=simulated, lathe=lathe)
    turn, turns = fold_turns(trace, header)
    result = None
    if not problems and header.state != UNKNOWN_STATE:
        result = evaluate(
            turn.angle_deg, turn.deviation_um, FILTER_UPR, state=header.state, radius_mm=header.radius_of(job)
        )
        result = turn_result_to_spindle(result, header, job.jaw_1_deg)
        problems = unit_doubt(result.ront_um, trace.meta, plane=trace.centre_mm is not None)
    return EvaluatedPart(
        path=path,
        content=content,
        trace=trace,
        header=header,
        turn=turn_to_spindle(turn, header, job.jaw_1_deg),
        turns=turns,
        job=job,
        asked=asked,
        open=open_,
        judged=None if problems else result,
        warnings=warnings,
        problems=problems,
    )


def refuse_unready(found: EvaluatedPart) -> None:
    """Refuse a trace by which the part cannot be judged (its `problems`), or that leaves a question open.

    Raises SessionError: `trace.unanswered`, and the problems of `read_gauge_file`.
    """
    refuse(found.problems)
    if found.open:
        where = printable(found.path.name)
        raise SessionError(Problem(code="trace.unanswered", where=where, key=", ".join(found.open)))


def _list_questions(header: TraceHeader) -> tuple[str, ...]:
    """Return the keys that a header leaves open; without a mark, the direction says nothing."""
    marked = header.jaw_1_deg is not None or header.start_mark is not None
    tied = header.jaw_1_deg is not None or header.start_mark != "unknown"
    missing = {
        "state": header.state == UNKNOWN_STATE,
        "direction": tied and header.direction is None,
        "start_mark": not marked,
    }
    return tuple(key for key in QUESTIONS if missing[key])


def _refusals(trace: Trace, header: TraceHeader, *, simulated: bool, lathe: str) -> tuple[Problem, ...]:
    """Return why a part must not be judged by this trace."""
    problems = []
    if is_simulated(trace) is not simulated:
        problems.append(Problem(code="trace.simulated_part" if not simulated else "trace.real_part"))
    elif is_other_lathe(lathe_of(trace), lathe):
        problems.append(Problem(code="trace.other_lathe", value=printable(lathe_of(trace), 60), limit=lathe))
    if header.method == "two_point":
        problems.append(Problem(code="trace.two_point", key="method", value="two_point"))
    elif header.method == "v_block":
        problems.append(Problem(code="trace.v_block_part"))
    if header.state not in (FREE, UNKNOWN_STATE):
        problems.append(Problem(code="trace.not_released", key="state", value=printable(header.state, 60)))
    return tuple(problems)


def fold_turns(trace: Trace, header: TraceHeader) -> tuple[Trace, Turns | None]:
    """Return the repeatable deviation of the turns of a trace as one turn, and all; ProfileError `trace.turns`."""
    if header.turns == 1:
        return trace, None
    turns = several_turns(trace.angle_deg, trace.deviation_um, header.turns)
    meta = MappingProxyType({key: value for key, value in trace.meta.items() if key != "turns"})
    return Trace(angle_deg=turns.angle_deg, deviation_um=turns.repeatable_um, meta=meta), turns


def turn_to_spindle(turn: Trace, header: TraceHeader, spindle_deg: float) -> Trace:
    """Return a turn at spindle angles, rising from 0; unchanged if they are unknown.

    `spindle_deg` is the spindle angle of jaw 1 in the cut.
    """
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if jaw_1_deg is None:
        return turn
    way = -1.0 if header.against_spindle else 1.0
    angle_deg = np.mod(spindle_deg + way * (turn.angle_deg - jaw_1_deg), _FULL_TURN_DEG)
    order = np.argsort(angle_deg, kind="stable")
    meta = {key: value for key, value in turn.meta.items() if key != "jaw_1_deg"}
    return Trace(
        angle_deg=read_only(angle_deg[order]),
        deviation_um=read_only(turn.deviation_um[order]),
        meta=MappingProxyType({**meta, "direction": "spindle", "start_mark": "spindle index"}),
    )


def turn_result_to_spindle(found: RoundnessResult, header: TraceHeader, spindle_deg: float) -> RoundnessResult:
    """Return the result of a turn at spindle angles; no figure changes.

    The contacts of the circles are left out: they are indices into the points of the file.
    """
    jaw_1_deg = header.jaw_1_of(spindle_deg)
    if jaw_1_deg is None:
        return found
    way = -1.0 if header.against_spindle else 1.0
    turned = cmath.exp(1j * math.radians(spindle_deg - way * jaw_1_deg))

    def centre(x_um: float, y_um: float) -> complex:
        return turned * complex(x_um, way * y_um)

    def placed(each: Harmonic) -> Harmonic:
        past_deg = each.past_jaw_1_deg(jaw_1_deg, against_spindle=header.against_spindle)
        phase_deg = replace(each, phase_deg=past_deg).past_jaw_1_deg(-spindle_deg)
        return replace(each, phase_deg=phase_deg)

    def about(circle: ReferenceCircle) -> ReferenceCircle:
        own = centre(circle.centre_x_um, circle.centre_y_um)
        return replace(circle, centre_x_um=own.real, centre_y_um=own.imag, contacts=())

    own = centre(found.centre_x_um, found.centre_y_um)
    return replace(
        found,
        centre_x_um=own.real,
        centre_y_um=own.imag,
        harmonics=tuple(placed(each) for each in found.harmonics),
        circles=tuple(about(each) for each in found.circles),
    )
