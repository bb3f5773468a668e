"""Measure a part: on the simulated gauge, or by the trace that a gauge elsewhere has written to a file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from types import MappingProxyType
from typing import Any

from console.session.cut.alignment import unclamp_blank
from console.session.cut.recording import budget_event, form_event, part_record
from console.session.cut.run import measured_budget, measured_whole, roundness_of
from console.session.data.learned_store import asked_for
from console.session.data.measured_part import (
    CYLINDRICITY_LIMIT,
    SECTION,
    SECTION_Z,
    CutPart,
    RecordedPart,
    newest_part,
)
from console.session.data.records import add_to_run
from console.session.data.run_reader import story as read_story
from console.session.data.run_rows import problem_events
from console.session.errors import SessionError
from console.session.gauge_in_use import gauge_in_use
from console.session.learning.calibrating import PartLobe, lobe_of
from console.session.learning.evaluated_part import EvaluatedPart, fold_turns, read_gauge_file, refuse_unready
from console.session.learning.gauge_errors import (
    error_drift,
    error_in_use,
    keep_error,
    newest_error,
    refuse_unlike,
    simulated_gauge,
    undeclared_error,
    without_gauge_error,
)
from console.session.learning.learning_steps import as_cut, sections_like
from console.session.learning.part_learning import learning_event, learning_of
from console.session.learning.provenance import of_this_part
from console.session.learning.row_faults import RowFaults, diagnose_parts, find_faults
from console.session.stages import Stage
from console.session.station.commands import CorrectTouchOff, MeasureTurned, TakeTrace
from console.session.station.context import FiledPart, StationContext
from console.session.station.readings import refuse_far
from console.session.station.state import ArmedCut, MeasuredForm, MeasuredPart
from drivers.cutting.strategy import Strategy
from profiles.files import printable
from profiles.gauge import GaugeProfile
from profiles.job import Job
from profiles.lobe.cut_error import middle_mm
from profiles.metrology.cylindricity import LEAST_SQUARES, CylinderResult, cylinder_event, part_section
from profiles.metrology.separation import BY_EYE_DEG, GaugeError, Placement, separate
from profiles.metrology.turns import mean_diameter_mm
from profiles.metrology.uncertainty import KnownGauge, UncertaintyBudget, points_budget
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.roundness import profile_of
from profiles.store import LoadedJob
from profiles.trace_files.gauge_error import sections_without
from profiles.trace_files.header import GAUGE_ERROR, header_of
from profiles.traces import Trace, trace_content


def measure_simulated(context: StationContext) -> None:
    """Take the part from the chuck and measure it on the simulated gauge; `session.no_gauge`."""
    started = context.started
    if context.shop is None or started is None:
        raise SessionError(Problem(code="session.no_gauge"))
    context.reading, context.filed = (context.shop.measure(), context.shop.sections()), None
    error = newest_error(context.records, _gauge_of(context))
    part, trace = _judge_reading(context, started, _just_cut(context, started), error)
    run_id = None if context.record is None else context.record.run_id
    part = replace(part, run_id=run_id)
    if context.record is not None:
        context.record.add("measured", _event(part), _part_to_record(part, trace))
    context.end_record()
    context.tell(cut_done=False, alignment=unclamp_blank(context.state.alignment, context.local_time()))
    _publish(context, part)


def measure_turned(context: StationContext, command: MeasureTurned) -> None:
    """Judge the last part without the error of its gauge, by a second measurement of it, turned by 90 deg.

    The error is kept as the gauge's own; the part is recorded again in its run.

    Raises:
        SessionError: `session.no_gauge`; `gauge.no_reading`, the last part was not measured on it; `_take_turned`.
        ProfileError: as `separate` and `keep_error`.
    """
    if command.second is not None:
        try:
            _take_turned(context, command.second)
        except ProfileError as refused:  # as of a single file
            raise SessionError(*refused.problems) from refused
        return
    started, before, reading = context.started, context.state.measured, context.reading
    if context.shop is None:
        raise SessionError(Problem(code="session.no_gauge"))
    if started is None or before is None or reading is None:
        raise SessionError(Problem(code="gauge.no_reading"))
    traces = reading[0], context.shop.measure(turned_deg=TURNED_DEG)
    contents = [(GAUGE, trace_content(each)) for each in traces]
    error, told = _separated(context, _gauge_of(context), traces, contents, started.job.finished_radius_mm)
    cut = replace(_just_cut(context, started), run_id=before.run_id)
    part, trace = _judge_reading(context, started, cut, error, told)
    part = replace(part, marks_mm=before.marks_mm)
    if part.run_id is not None:
        add_to_run(context.records, part.run_id, "measured", _event(part), _part_to_record(part, trace))
    _publish(context, part)


def _take_turned(context: StationContext, command: TakeTrace) -> None:
    """Judge the last file again, without the error of its gauge by the file of the part turned on that.

    Raises:
        SessionError: `gauge.no_first`, no file was taken; `gauge.none_chosen`; `separation.sections`, one of them
            has no section, or not the same; `trace.changed`, and as `take_trace`.
        ProfileError: as `measure_turned`.
    """
    filed, before, gauge = context.filed, context.state.measured, _gauge(context)
    if filed is None or before is None:
        raise SessionError(Problem(code="gauge.no_first"))
    if gauge is None:
        raise SessionError(Problem(code="gauge.none_chosen"))
    both = [_read(context, each, filed.cut, filed.job, None) for each in (filed.command, command)]
    for each in both:
        if each.is_points or each.section_z_mm != both[0].section_z_mm:
            value = _Z.format(each.section_z_mm)
            raise SessionError(
                Problem(
                    code="separation.sections", where=each.name, value=value, limit=_Z.format(both[0].section_z_mm)
                )
            )
    turns = [fold_turns(each.trace, each.header)[0] for each in both]
    contents = [(each.name, each.content) for each in both]
    refuse_unlike([(each.name, each.trace) for each in both])
    radius_mm, sd_deg = both[0].header.radius_of(filed.job), gauge.set_up_angle_deg
    error, told = _separated(context, gauge.name, turns, contents, radius_mm, sd_deg)
    _take_file(context, filed, error, told)


def _separated(
    context: StationContext,
    gauge: str,
    traces: Sequence[Trace],
    contents: Sequence[tuple[str, bytes]],
    radius_mm: float,
    sd_deg: float | None = None,
) -> tuple[GaugeError, tuple[Problem, ...]]:
    """Return the error of a gauge by two placements, which is kept, and by how much it has drifted.

    `sd_deg` is how exactly the part was turned, None for a mark by eye.
    """
    centred = [profile_of(each.angle_deg, each.deviation_um, None, radius_mm=radius_mm) for each in traces]
    placements = (Placement(turned_deg=0.0), Placement(turned_deg=TURNED_DEG))
    found = separate(centred, placements, turning_sd_deg=BY_EYE_DEG if sd_deg is None else sd_deg)
    last = newest_error(context.records, gauge)
    _kept, error = keep_error(context.records, gauge, found, contents)
    return error, () if last is None else error_drift(error, last)


def _gauge_of(context: StationContext) -> str:
    """Return the name of the simulated gauge: each simulated lathe has one of its own."""
    return GAUGE if context.shop is None else simulated_gauge(context.shop.which)


def _judge_reading(
    context: StationContext,
    started: ArmedCut,
    cut: CutPart,
    error: GaugeError | None,
    told: tuple[Problem, ...] = (),
) -> tuple[MeasuredPart, Trace]:
    """Return the part on the simulated gauge without the error of that, and the trace by which it is judged."""
    assert context.reading is not None
    trace, off = without_gauge_error(context.reading[0], error)
    sections = sections_without(context.reading[1], error if GAUGE_ERROR in trace.meta else None)
    header, _ = header_of(trace.meta)
    found = EvaluatedPart(
        trace=trace,
        header=header,
        turn=trace,
        job=started.job,
        judged=roundness_of(trace),
        warnings=(*off, *told),
        sections=sections_like(trace, sections),
    )
    sha256 = hashlib.sha256(trace.deviation_um.tobytes()).hexdigest()
    error = error if GAUGE_ERROR in trace.meta else None
    part = _judge_part(context, cut, started.loaded, found, (GAUGE, sha256), error)
    part = replace(part, whole=measured_whole(sections), sections=sections, section_z_mm=middle_mm(started.job))
    return replace(part, budget=_budget_of(context, part, error)), trace


GAUGE, _Z = "simulated gauge", "Z {} mm"
TURNED_DEG = 90.0  # of the second placement

MOST_OFFSET_UM = 200.0
"""More than that is no drift of a tool: the touch-off has to be made again."""


def take_trace(context: StationContext, command: TakeTrace) -> None:
    """Judge the part in the chuck, or else the newest one of the job in the record, by the trace in a file.

    Nothing moves. The part is out of the chuck then, so that the clamping ends.

    Raises:
        SessionError: `machine.moving`; `session.nothing_cut`; `learned.edited_part`; `trace.changed`; as
            `of_this_part`, `refuse_unready` and `read_gauge_file`.
    """
    if not context.lathe.snapshot().at_rest:
        raise SessionError(Problem(code="machine.moving"))
    cut, job, loaded = _cut_of(context, command)
    try:
        error = error_in_use(context.records, context.state.machine, simulated=context.shop is not None)
    except ProfileError as refused:
        raise SessionError(*refused.problems) from refused
    _take_file(context, FiledPart(command=command, cut=cut, job=job, loaded=loaded), error)


def _read(
    context: StationContext, command: TakeTrace, cut: CutPart, job: Job, error: GaugeError | None
) -> EvaluatedPart:
    """Return the part in a file as it was chosen, without the error of its gauge; raises as `take_trace`."""
    try:
        simulated = context.shop is not None
        how: dict[str, Any] = {"simulated": simulated, "lathe": cut.lathe, "others": command.others}
        found = read_gauge_file(command.path, job, command.answers, error=error, **how)
    except ProfileError as refused:  # a bad file is a refusal: nothing is wrong with the machine
        raise SessionError(*refused.problems) from refused
    if found.sha256 != command.sha256:
        raise SessionError(Problem(code="trace.changed", where=found.name))
    run_id = context.record.run_id if cut.run_id is None and context.record is not None else cut.run_id
    found = of_this_part(found, context.records, run_id)
    refuse_unready(found)
    return found


def _take_file(
    context: StationContext, filed: FiledPart, error: GaugeError | None, told: tuple[Problem, ...] = ()
) -> None:
    """Judge a part by its file, without the `error` of its gauge; raises as `take_trace`."""
    command, cut, job, loaded = filed.command, filed.cut, filed.job, filed.loaded
    in_chuck = context.state.cut_done
    found = _read(context, command, cut, job, error)
    found = replace(found, warnings=(*told, *found.warnings))
    error = error if GAUGE_ERROR in found.trace.meta else None
    if found.is_points:
        _take_form(context, command, cut, job, found)
        return
    part = _judge_part(context, cut, loaded, found, (found.name, found.sha256), error)
    part = replace(part, budget=_budget_of(context, part, error))
    measured = {**_event(part), **_file_event(found), **command.answers}
    asked = {"answers": dict(command.answers), "radius_mm": found.header.radius_of(job), SECTION: found.place}
    asked |= {} if error is None else {GAUGE_ERROR: asdict(error)}
    kept = _part_to_record(part, found.trace, (found.name, found.content), asked)
    part = replace(part, run_id=_keep_measured(context, cut, measured, kept))
    context.reading, context.filed = None, replace(filed, cut=replace(cut, run_id=part.run_id))
    if in_chuck:
        context.tell(cut_done=False, alignment=unclamp_blank(context.state.alignment, context.local_time()))
    _publish(context, part)


def _take_form(context: StationContext, command: TakeTrace, cut: CutPart, job: Job, found: EvaluatedPart) -> None:
    """Judge a part by points that are no sections, and keep them in its record."""
    whole, header, gauge = found.whole, found.header, _gauge(context)
    assert whole is not None
    sized = header.radius_mm if header.size != "relative" else None
    mean_um = whole.cylinder(LEAST_SQUARES).deviation_um
    *notes, no_sections = found.warnings
    form = MeasuredForm(
        job=job,
        made=cut.made,
        whole=whole,
        meta=found.trace.meta,
        no_sections=no_sections,
        notes=tuple(notes),
        diameter_mm=None if sized is None else mean_diameter_mm(sized, mean_um),
        budget=None if gauge is None else points_budget(gauge),
        run_id=cut.run_id,
        proven=cut.proven,
    )
    told = {
        "job": job.name,
        "strategy": cut.made.strategy,
        "ront_um": None,
        "diameter_mm": form.diameter_mm,
        **_form_figures(whole),
    }
    kept = RecordedPart(
        ront_um=None,
        tolerance_um=job.roundness_tolerance_um,
        passed=form.passes,
        diameter_mm=form.diameter_mm,
        nominal_diameter_mm=job.finished_diameter_mm,
        diameter_tolerance_um=job.diameter_tolerance_um,
        trace=found.content,
        trace_name=found.name,
        data={
            CYLINDRICITY_LIMIT: job.cylindricity_tolerance_um,
            "state": header.state,
            "answers": dict(command.answers),
            "learning": problem_events((no_sections,)),
            "points": whole.count,
            **whole.event(),
            **budget_event(form.budget),
        },
    )
    _keep_measured(context, cut, {**told, **_file_event(found), **command.answers}, kept)
    if context.state.cut_done:
        context.tell(cut_done=False, alignment=unclamp_blank(context.state.alignment, context.local_time()))
    context.tell(measured=None, form=form, armed=None)


def _keep_measured(
    context: StationContext, cut: CutPart, event: Mapping[str, object], kept: RecordedPart
) -> str | None:
    """Add a measurement to the run of its part, and return its id; the run of the part in the chuck ends."""
    if cut.run_id is not None:
        add_to_run(context.records, cut.run_id, "measured", event, kept)
        return cut.run_id
    if context.record is None:
        return None
    context.record.add("measured", event, kept)
    run_id = context.record.run_id
    context.end_record()
    return run_id


def _cut_of(context: StationContext, command: TakeTrace) -> tuple[CutPart, Job, LoadedJob | None]:
    """Return the part that a trace is taken for, with its job: jaw 1 as found for the cut, and as saved."""
    started = context.started
    if context.state.cut_done and started is not None:
        return _just_cut(context, started), started.job, started.loaded
    loaded = command.loaded
    if loaded is None:
        raise SessionError(Problem(code="learned.edited_part", key=command.job.name))
    asked = asked_for(loaded, context.loaded_machine, "", simulated=context.shop is not None)
    part = newest_part(context.records, asked)
    if part is None:
        raise SessionError(Problem(code="session.nothing_cut"))
    return part, as_cut(loaded.job, part.made), loaded


def _just_cut(context: StationContext, started: ArmedCut) -> CutPart:
    """Return the part in the chuck."""
    progress = context.state.cut
    figures = None if progress is None else progress.figures
    return CutPart(
        made=started.made,
        tool_lobe_um=0j if figures is None else figures.tool_lobe_um,
        push_um=0.0 if figures is None else figures.push_um,
        lathe=context.state.lathe,
        proven=figures is not None and figures.verdict.proven,
    )


def _judge_part(
    context: StationContext,
    cut: CutPart,
    loaded: LoadedJob | None,
    found: EvaluatedPart,
    file: tuple[str, str],
    error: GaugeError | None,
) -> MeasuredPart:
    """Return a measured part with its learning step, or its lobe; `file` is the trace with its hash.

    The `error` of its gauge was taken off.
    """
    job, strategy, phase_known = found.job, Strategy(cut.made.strategy), found.header.phase_known
    assert job is not None
    lobe, own = None, _gauge(context)
    untold = () if own is None else undeclared_error(own, error)
    gauge = None if own is None else KnownGauge(profile=own, error=error)
    if not strategy.traits.follows_lobe:
        lobe = PartLobe(loaded=loaded, file=file[0], file_sha256=file[1])
        lobe = lobe_of(found.turn, job, lobe, phase_known=phase_known, simulated=context.shop is not None)
    return MeasuredPart(
        job=job,
        strategy=strategy,
        trace=found.turn,
        result=replace(found.result, warnings=(*found.warnings, *untold, *found.result.warnings)),
        jaw_1_deg=job.jaw_1_deg,
        phase_known=phase_known,
        lobe=lobe,
        whole=found.whole,
        sections=tuple(part_section(each) for each in found.sections if each.z_mm is not None),
        section_z_mm=found.section_z_mm,
        diameter_mm=found.mean_diameter_mm,
        tool_offset_um=found.tool_offset_um,
        marks_mm=context.state.marks_mm if cut.run_id is None else (),
        learning=learning_of(
            loaded, job.name, cut, found.trace, context.loaded_machine, context.records, found.sections, gauge
        ),
        run_id=cut.run_id,
        proven=cut.proven,
    )


def correct_touch_off(context: StationContext, _: CorrectTouchOff) -> None:
    """Move the radius of the tool tip by what the diameter of the last part was off; nothing moves.

    Raises:
        SessionError: `trace.no_part`; `offset.no_size`, or why its size is not one of the job; `offset.taken`;
            `offset.no_touch_off`, that of its cut is no longer in force; `offset.too_large`, the touch-off itself
            was wrong; `alignment.touch_off_far`, many small ones have added up.
    """
    part, alignment = context.state.measured, context.state.alignment
    if part is None:
        raise SessionError(Problem(code="trace.no_part"))
    offset_um = part.tool_offset_um
    if offset_um is None:
        raise SessionError(part.size_doubt or Problem(code="offset.no_size", limit="# radius_mm: R"))
    if part.offset_taken:
        raise SessionError(Problem(code="offset.taken"))
    started, touched = context.started, alignment.touch_off
    if touched is None or started is None or started.alignment.touch_off != touched:
        raise SessionError(Problem(code="offset.no_touch_off"))
    if abs(offset_um) > MOST_OFFSET_UM:
        limit = f"± {MOST_OFFSET_UM:g} um"
        raise SessionError(Problem(code="offset.too_large", value=f"{offset_um:+.0f} um", limit=limit))
    zero_mm, at = touched.zero_radius_mm + offset_um / 1000.0, context.local_time()
    refuse_far(zero_mm, context.loaded_machine.machine.tool)
    context.tell(alignment=replace(alignment, touch_off=replace(touched, zero_radius_mm=zero_mm, at=at)))
    context.tell(measured=replace(part, offset_taken=True))


def _publish(context: StationContext, part: MeasuredPart) -> None:
    part = _with_faults(context, part)
    context.tell(measured=part, form=None, armed=None)
    if not part.strategy.traits.follows_lobe:
        context.tell(uncompensated=part)


def _with_faults(context: StationContext, part: MeasuredPart) -> MeasuredPart:
    """Return a part with what its record says of faults; the hypotheses only of one that fails."""
    learning = part.learning
    if learning is None:
        return part
    fails = not part.is_half and any(each.passes is False for each in part.judged)
    evidence = None if learning.taught is None else learning.taught.evidence
    try:
        if part.run_id is not None:
            story = read_story(context.records, part.run_id)
            faults = find_faults(story, context.records, explains=fails, evidence=evidence)
        elif fails and evidence is not None:
            found = diagnose_parts([evidence], part.job, context.loaded_machine.machine)
            faults = RowFaults(diagnosis=found)
        else:
            return part
    except ProblemError:  # the measurement stands without it
        return part
    return replace(part, learning=replace(learning, faults=faults))


def _gauge(context: StationContext) -> GaugeProfile | None:
    """Return the gauge in use, None without one; SessionError: it cannot be read."""
    try:
        return gauge_in_use(context.records, context.state.machine)
    except ProfileError as refused:
        raise SessionError(*refused.problems) from refused


def _budget_of(
    context: StationContext, part: MeasuredPart, error: GaugeError | None = None
) -> UncertaintyBudget | None:
    """Return the uncertainty of a part by the gauge in use, whose `error` was taken off; None without one."""
    sections = part.sections if part.whole is not None else ()
    return measured_budget(_gauge(context), part.job, part.trace, sections, error)


def _event(part: MeasuredPart) -> dict[str, object]:
    """Return what the run record keeps of a measurement."""
    return {
        "job": part.job.name,
        "strategy": part.strategy.value,
        "ront_um": part.result.ront_um,
        "diameter_mm": part.diameter_mm,
        **_form_figures(part.whole),
    }


def _form_figures(whole: CylinderResult | None) -> dict[str, object]:
    """Return CYLt and the sections of a part, as the list of the jobs needs them."""
    return {key: cylinder_event(whole)[key] for key in ("CYLt_um", "sections")}


def _part_to_record(
    part: MeasuredPart,
    trace: Trace,
    file: tuple[str, bytes] | None = None,
    asked: Mapping[str, object] = MappingProxyType({}),
) -> RecordedPart:
    """Return what the record keeps of a part.

    `file` is the name and the content of an imported trace, `asked` what it was judged with beside its header.
    """
    learning = part.learning
    assert learning is not None
    made = learning.made
    header = made.header()
    more = {
        "learning": learning_event(learning),
        "jaw_1_deg": part.jaw_1_deg,
        "phase_known": part.phase_known,
        SECTION_Z: part.section_z_mm,
        **asked,
        **form_event(part.whole, part.sections),
        **budget_event(part.budget),
    }
    return part_record(
        part.job, part.result, trace, Stage(made.stage), proven=part.proven, made=header, file=file, more=more
    )


def _file_event(found: EvaluatedPart) -> dict[str, object]:
    """Return the file of a measurement, so that it can be found again."""
    files = [printable(each.name) for each in (found.path, *found.others)]
    return {"trace": found.name, "trace_sha256": found.sha256, **({"files": files} if found.others else {})}
