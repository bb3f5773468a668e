"""Evaluation of a trace by `console roundness`: by its header, for a job, with the requested filter."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, replace
from pathlib import Path

from console.cli.library import job_of, named, naming
from profiles.files import printable
from profiles.job import Job
from profiles.metrology.harmonics import Harmonic
from profiles.metrology.turns import Turns, mean_diameter_mm, several_turns, tool_offset_um
from profiles.problem import Problem, ProfileError
from profiles.roundness import OFF_AXIS, RoundnessResult, evaluate
from profiles.trace_files.header import TraceHeader, header_of, size_doubt, unit_doubt
from profiles.traces import Trace, read_trace


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTrace:
    """A trace with its header and results.

    `jaw_1_deg` is the angle of jaw 1 in the angles of the trace, None where it is unknown. `mean_diameter_mm` is
    None where the trace has no size; `tool_offset_um`, positive into the work, also where there is no job to
    compare it with, or the trace is of another size. `tolerance_um` is that of the job.
    """

    trace: Trace
    header: TraceHeader
    result: RoundnessResult
    turns: Turns | None
    jaw_1_deg: float | None
    mean_diameter_mm: float | None
    tool_offset_um: float | None
    tolerance_um: float | None

    def past_jaw_1_deg(self, harmonic: Harmonic) -> float | None:
        """Return the phase of an undulation (its first maximum) from jaw 1, None where that is unknown."""
        if self.jaw_1_deg is None:
            return None
        return harmonic.past_jaw_1_deg(self.jaw_1_deg, against_spindle=self.header.against_spindle)


def measured_trace(options: Namespace) -> MeasuredTrace:
    """Evaluate a trace and return the results with every warning; without a V-block for the requested circle."""
    where = printable(options.file)
    job = job_of(options).job if options.job else None
    trace = read_trace(Path(options.file))
    header, warnings = header_of(trace.meta)
    _refuse_method(header, options, where)
    with naming(where):
        turns, result = _evaluated(trace, header, job, options)
    plane = trace.centre_mm is not None
    doubts = unit_doubt(result.ront_um, trace.meta, plane=plane) if options.vblock is None else ()
    if doubts and job is not None:
        raise ProfileError(*named(doubts, where))
    of_result = (each for each in result.warnings if each.code != OFF_AXIS or options.vblock is None)
    warnings = (*warnings, *(doubts if plane else ()), *of_result)
    size_mm = offset_um = None
    if header.radius_mm is not None and header.size != "relative":
        size_mm = mean_diameter_mm(header.radius_mm, result.mean_deviation_um)
    if job is not None and size_mm is not None:
        if doubt := size_doubt(size_mm / 2.0, job):
            warnings = (*warnings, doubt)
        else:
            offset_um = tool_offset_um(size_mm, job.finished_diameter_mm)
    elif job is not None:
        warnings = (*warnings, Problem(code="trace.no_size", key="radius_mm", limit="# radius_mm: R"))
    shown = result if options.vblock is not None else _of_circle(result, options.circle)
    return MeasuredTrace(
        trace=trace,
        header=header,
        result=replace(shown, warnings=named(warnings, where)),
        turns=turns,
        jaw_1_deg=header.jaw_1_of(None if job is None else job.jaw_1_deg),
        mean_diameter_mm=size_mm,
        tool_offset_um=offset_um,
        tolerance_um=None if job is None else job.roundness_tolerance_um,
    )


def _of_circle(result: RoundnessResult, kind: str) -> RoundnessResult:
    """Return the result with the figures of another reference circle."""
    if kind == result.reference_circle:
        return result
    circle = result.circle(kind)
    without = result.without_features
    return replace(
        result,
        reference_circle=kind,
        without_features=without and _of_circle(without, kind),
        ront_um=circle.ront_um,
        ronp_um=circle.ronp_um,
        ronv_um=circle.ronv_um,
        ronq_um=circle.ronq_um,
        centre_x_um=circle.centre_x_um,
        centre_y_um=circle.centre_y_um,
    )


def _evaluated(
    trace: Trace, header: TraceHeader, job: Job | None, options: Namespace
) -> tuple[Turns | None, RoundnessResult]:
    above_upr, filter_upr = options.band or (None, options.filter)
    angle_deg, deviation_um, turns = trace.angle_deg, trace.deviation_um, None
    if header.turns > 1:
        turns = several_turns(angle_deg, deviation_um, header.turns)
        angle_deg, deviation_um = turns.angle_deg, turns.repeatable_um
    radius_mm = header.radius_mm if job is None else header.radius_of(job)
    result = evaluate(
        angle_deg,
        deviation_um,
        filter_upr,
        state=header.state,
        radius_mm=radius_mm if options.vblock is None else None,
        above_upr=above_upr,
        robust=options.robust,
    )
    return turns, result


def _refuse_method(header: TraceHeader, options: Namespace, where: str) -> None:
    if header.method == "two_point":
        raise ProfileError(Problem(code="trace.two_point", where=where, key="method", value="two_point"))
    asked = header.method == "v_block" or options.vblock is not None or options.lobes is not None
    if asked and (options.vblock is None or options.lobes is None):
        raise ProfileError(Problem(code="trace.v_block", where=where, limit="--vblock DEG --lobes N"))
