"""Evaluation of a trace by `console roundness`: by its header, for a job, with the requested filter."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from console.cli.library import job_of, name_file_in_problems, naming
from console.session.cut.recording import mean_diameter_of
from console.session.learning.evaluated_part import EvaluatedPart, fold_turns
from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem, ProfileError
from profiles.roundness import OFF_AXIS, RoundnessResult, evaluate
from profiles.trace_files.header import TraceHeader, header_of, size_doubt, unit_doubt
from profiles.traces import Trace


def evaluate_trace_file(options: Namespace, trace: Trace) -> EvaluatedPart:
    """Evaluate a trace and return the results with every warning; without a V-block for the requested circle."""
    where = printable(options.file)
    job = job_of(options).job if options.job else None
    header, warnings = header_of(trace.meta)
    _refuse_method(header, options, where)
    with naming(where):
        turn, turns = fold_turns(trace, header)
        result = _evaluate_trace(turn, header, job, options)
    plane = trace.centre_mm is not None
    doubts = unit_doubt(result.ront_um, trace.meta, plane=plane) if options.vblock is None else ()
    if doubts and job is not None:
        raise ProfileError(*name_file_in_problems(doubts, where))
    of_result = (each for each in result.warnings if each.code != OFF_AXIS or options.vblock is None)
    warnings = (*warnings, *(doubts if plane else ()), *of_result)
    size_mm = mean_diameter_of(trace, result)
    if job is not None and size_mm is None:
        warnings = (*warnings, Problem(code="trace.no_size", key="radius_mm", limit="# radius_mm: R"))
    elif job is not None and size_mm is not None and (doubt := size_doubt(size_mm / 2.0, job)):
        warnings = (*warnings, doubt)
    shown = result if options.vblock is not None else _of_circle(result, options.circle)
    return EvaluatedPart(
        trace=trace,
        header=header,
        turn=turn,
        turns=turns,
        job=job,
        jaw_1_deg=header.jaw_1_of(None if job is None else job.jaw_1_deg),
        judged=replace(shown, warnings=name_file_in_problems(warnings, where)),
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


def _evaluate_trace(turn: Trace, header: TraceHeader, job: Job | None, options: Namespace) -> RoundnessResult:
    filter_upr, filter_kind = options.filter
    above_upr, filter_upr = options.band or (None, filter_upr)
    radius_mm = header.radius_mm if job is None else header.radius_of(job)
    return evaluate(
        turn.angle_deg,
        turn.deviation_um,
        filter_upr,
        state=header.state,
        radius_mm=radius_mm if options.vblock is None else None,
        above_upr=above_upr,
        robust=options.robust,
        filter_kind=filter_kind,
    )


def _refuse_method(header: TraceHeader, options: Namespace, where: str) -> None:
    if header.method == "two_point":
        raise ProfileError(Problem(code="trace.two_point", where=where, key="method", value="two_point"))
    asked = header.method == "v_block" or options.vblock is not None or options.lobes is not None
    if asked and (options.vblock is None or options.lobes is None):
        raise ProfileError(Problem(code="trace.v_block", where=where, limit="--vblock DEG --lobes N"))
