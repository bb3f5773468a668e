"""Actions of `console learn`: learn from a part, list the versions, or revert to one; for people and for JSON."""

from __future__ import annotations

import cmath
import hashlib
import math
import shlex
from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from console.cli.library import data_of, known_gauge_of, name_file_in_problems, naming
from console.cli.measured.roundness_report import budget_lines
from console.cli.output import show, tell
from console.session.cut.recording import budget_event
from console.session.cut.run import FILTER_UPR
from console.session.data.calibrated_chuck import CalibratedMachine
from console.session.data.kept_files import is_ahead, utc_now
from console.session.data.learned_store import asked_for, elsewhere_problems, store, versions
from console.session.data.measured_part import KEYS, SECTION_Z
from console.session.data.run_reader import run_of_trace, story
from console.session.errors import SessionError
from console.session.learning.evaluated_part import FiledSections, fold_turns, read_section_file
from console.session.learning.gauge_errors import spindle_told
from console.session.learning.learning_steps import (
    SIMULATED,
    LearningOutcome,
    lathe_of,
    learn_from_trace,
    revert_version,
)
from console.session.learning.part_learning import record_accepted
from console.session.learning.provenance import taken_before
from console.session.learning.row_faults import diagnose_parts, find_faults
from console.session.stages import Stage
from console.text.along_length import form_words
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.part_sentences import at_height, certificate_fields, certificate_lines
from console.text.run_debrief import diagnosis_fields, fault_words
from drivers.simulator.plant.which_lathe import options_of
from profiles.compensations.hypotheses import FaultDiagnosis
from profiles.compensations.learned_compensation import (
    HoldsFor,
    LearnedCompensation,
    as_table,
    changed_settings,
    differences,
)
from profiles.compensations.next_version import Contraction, LearningStep
from profiles.files import printable
from profiles.forecast import LEAST_FORECAST_UM, forecast_um, is_below_forecast
from profiles.job import Job
from profiles.metrology.cylindricity import cylinder_event, part_section
from profiles.metrology.uncertainty import KnownGauge, UncertaintyBudget, part_budget
from profiles.problem import Problem
from profiles.store import LoadedJob
from profiles.trace_files.header import GAUGE_ERROR, header_of
from profiles.trace_files.sections import TraceSection


def learn_from(options: Namespace, job: LoadedJob, machine: CalibratedMachine, text: Catalogue) -> None:
    """Learn from the trace of a part; with `--keep` store the next version.

    A part without a place on the spindle is reported as it was measured, and refused.
    """
    data, where = data_of(options), printable(options.file)
    filed = read_section_file(Path(options.file), job.job)
    gauge = known_gauge_of(options, lathe_of(filed.trace))
    if gauge is not None and gauge.error is not None:
        filed = read_section_file(Path(options.file), job.job, gauge.error)
    content, trace = filed.content, filed.trace
    if options.sim and trace.meta.get(SIMULATED[0]) != SIMULATED[1]:
        raise SessionError(Problem(code="learned.not_simulated", where=where, limit=": ".join(SIMULATED)))
    made = {key: getattr(options, key) for key in KEYS if getattr(options, key) is not None}
    with naming(where):
        found = learn_from_trace(
            trace,
            job,
            machine,
            data,
            made,
            None if options.identified is None else Path(options.identified),
            gain=options.gain,
            robust=options.robust,
            date=utc_now(),
            extra=options.extra or (),
            sections=filed.sections,
            gauge=gauge,
        )
    if taken := taken_before(data, hashlib.sha256(content).hexdigest(), None, found.made):
        raise SessionError(*name_file_in_problems(taken, where))
    following, reasons = found.step.next, found.step.reasons
    refused = bool(reasons) and (options.keep or not found.step.placed)
    told = (*machine.warnings, *filed.doubts, *spindle_told(gauge), *found.warnings)
    warnings = tell((*told, *(() if refused else reasons)), text)
    kept = store(data, following) if options.keep and not reasons else None
    if kept is not None:
        warnings += tell(_record_learning_step(data, content, following), text)
    fails = _fails(found, job)
    diagnosis = _diagnosis(data, content, found, job, machine) if fails else None
    asked, form = options.keep or bool(reasons), cylinder_event(filed.whole)
    budget = None if gauge is None else _budget(gauge, job.job, filed)
    show(
        options,
        lambda: {
            **_step_fields(found),
            "diagnosis": diagnosis_fields(diagnosis),
            SECTION_Z: filed.section_z_mm,
            **form,
            **budget_event(budget),
            "kept": kept and str(kept),
            "warnings": warnings,
        },
        lambda: [
            at_height(filed.section_z_mm, text),
            *([f"{text('run.whole')}: {form_words(form, text)}"] if filed.whole else []),
            *budget_lines(budget, text),
            *_step_lines(found, text, fails=fails, diagnosis=diagnosis),
            *_kept_lines(following, kept, asked, options, text),
        ],
    )
    if refused:
        raise SessionError(*reasons)


def _budget(gauge: KnownGauge, job: Job, filed: FiledSections) -> UncertaintyBudget:
    """Return the uncertainty of a part in a file, of which only the judged section counts if it has no form."""
    (header, _), meta = header_of(filed.trace.meta), filed.trace.meta
    whole = filed.sections if filed.whole is not None else (TraceSection(z_mm=0.0, trace=filed.trace),)
    turns = (TraceSection(z_mm=each.z_mm, trace=fold_turns(each.trace, header)[0]) for each in whole)
    return part_budget(
        gauge.profile,
        [part_section(each) for each in turns],
        None,
        filter_upr=FILTER_UPR,
        header=header,
        job=job,
        error=gauge.error if GAUGE_ERROR in meta else None,
    )


def _record_learning_step(data: Path, content: bytes, kept: LearnedCompensation) -> tuple[Problem, ...]:
    """Add an accepted learning step to the recorded run whose part has this trace; return why it could not be."""
    try:
        run_id = run_of_trace(data, hashlib.sha256(content).hexdigest())
    except SessionError as unreadable:
        return tuple(unreadable.problems)
    return record_accepted(data, run_id, kept)


def _diagnosis(
    data: Path, content: bytes, found: LearningOutcome, job: LoadedJob, machine: CalibratedMachine
) -> FaultDiagnosis | None:
    """Return the hypotheses on a part: with those before it if it is recorded, else on it alone."""
    if found.evidence is None:
        return None
    with suppress(SessionError):
        sha256 = hashlib.sha256(content).hexdigest()
        run_id = run_of_trace(data, sha256)
        of = None if run_id is None else story(data, run_id)
        if of is not None and of.product is not None and of.product.trace_sha256 == sha256:
            return find_faults(of, data, evidence=found.evidence).diagnosis
    return diagnose_parts([found.evidence], job.job, machine.machine)


def _fails(found: LearningOutcome, job: LoadedJob) -> bool:
    """Whether a part is out of its tolerance; one with half its compensation is not judged."""
    part = found.step.next.part
    return found.stage is Stage.FULL and part is not None and part.ront_um > job.job.roundness_tolerance_um


def list_or_revert(options: Namespace, job: LoadedJob, machine: CalibratedMachine, text: Catalogue) -> None:
    """Print the versions of the job on the machine, or make an older one the newest again.

    With `--keep` store that. Options for learning are refused with `learned.unused`.
    """
    _refuse_unused(options)
    data, asked = data_of(options), asked_for(job, machine, "", simulated=options.sim)
    known = versions(data, asked)
    other = () if known else elsewhere_problems(data, asked)
    if options.list:
        show(
            options,
            lambda: {
                "versions": [_version_fields(each, asked) for each in known],
                "elsewhere": [each.code for each in other],
            },
            lambda: [*_version_lines(known, asked, text), *map(text.problem, other)],
        )
        return
    if other:
        raise SessionError(*other)
    back = revert_version(options.revert, job, machine, data, simulated=options.sim, date=utc_now())
    kept = store(data, back) if options.keep else None
    head = text("learned.reverts", version=back.version, older=back.reverts, strategy=back.holds_for.strategy)
    show(
        options,
        lambda: {**_version_fields(back, asked), "kept": kept and str(kept)},
        lambda: [head, *_kept_lines(back, kept, options.keep, options, text)],
    )


def _refuse_unused(options: Namespace) -> None:
    unused = [
        key
        for key in (*KEYS, "identified", "gain", "extra", "gauge", "accept")
        if getattr(options, key) is not None
    ]
    if options.list and options.keep:
        unused.append("keep")
    if value := ", ".join(f"--{key}" for key in unused):
        key = "--list" if options.list else "--revert"
        raise SessionError(Problem(code="learned.unused", key=key, value=value))


def _step_fields(found: LearningOutcome) -> dict[str, object]:
    """Return a learning step; what cannot be determined from two parts, or not without angles, is null."""
    step = found.step
    lobes, part = step.next.path.target.lobes, step.next.part
    assert part is not None
    expected = {
        "lobe_um_pp": step.expected_lobe_um_pp,
        "half_width_um_pp": step.expected_half_width_um_pp,
        "RONt_um": step.expected_ront_um,
        "forecast_RONt_um": forecast_um(step.expected_ront_um),
    }
    return {
        "cut_with": found.made.header(),
        "measured": {"lobe_um_pp": 2.0 * part.lobe.amplitude_um, "RONt_um": part.ront_um},
        "next": as_table(step.next) if step.placed else None,
        "learned_waves": list(step.learned),
        "expected": expected if step.placed else None,
        "contraction": None if step.contraction is None else _contraction_fields(step.contraction, lobes),
        "certificate": certificate_fields(step.certificate),
        "contractions": [{"n": n, **_contraction_fields(c, n)} for n, c in sorted(step.contractions.items())],
    }


def _version_fields(version: LearnedCompensation, asked: HoldsFor) -> dict[str, object]:
    return {**as_table(version), "holds": _still_holds(version, asked)}


def _contraction_fields(contraction: Contraction, n: int) -> dict[str, object]:
    fraction, late_deg = _arrival(contraction, n)
    return {
        "value": contraction.value,
        "half_width": contraction.half_width,
        "verdict": contraction.verdict.value,
        "arrives_share": fraction,
        "arrives_late_deg": late_deg,
    }


def _arrival(contraction: Contraction, n: int) -> tuple[float, float]:
    """Return the fraction of harmonic `n` of the path that reaches the part, and its lag in spindle degrees."""
    return abs(contraction.arrives), -math.degrees(cmath.phase(contraction.arrives)) / n


def _still_holds(version: LearnedCompensation, asked: HoldsFor) -> bool:
    """Whether job and machine are still those that it was learned for."""
    return not differences(version, replace(asked, strategy=version.holds_for.strategy))


def _step_lines(
    found: LearningOutcome, text: Catalogue, *, fails: bool, diagnosis: FaultDiagnosis | None
) -> list[str]:
    """Return a learning step; for a part that `fails` also why it is not round."""
    step, made = found.step, found.made
    holds, part = step.next.holds_for, step.next.part
    assert part is not None
    head = text("learned.head", made=f"{made.compensation} · {made.strategy} · {text(f'stage.{found.stage}')}")
    expected = f"{step.expected_lobe_um_pp:.2f} ± {step.expected_half_width_um_pp:.2f}"
    rows = [
        ("", text("learned.measured"), text("learned.next"), ""),
        ("RONt", f"{part.ront_um:.2f}", f"{forecast_um(step.expected_ront_um):.2f}", "um"),
        (text("learned.lobe"), f"{2 * part.lobe.amplitude_um:.2f}", expected, "um"),
    ]
    lines = [f"{_subject(holds, text)}: {head}", ""]
    if step.placed:
        lines += [*table(rows, numeric=(1, 2)), *_below_forecast(step.expected_ront_um, text)]
        lines += ["", *table(_facts(step, text))]
        lines += ["", *certificate_lines(step.certificate, step.next.path.target.lobes, text)]
    else:
        lines += table([(name, measured, unit) for name, measured, _, unit in rows], numeric=(1,))
    likely, others = fault_words(diagnosis, (), text)
    alone = [text("diagnosis.alone"), *(f"  {words}" for words in others)] if others else []
    return [*lines, "", *likely, *alone] if fails and likely else lines


def _below_forecast(calculated_um: float, text: Catalogue) -> list[str]:
    """Return that less is calculated for the next part than is forecast."""
    if not is_below_forecast(calculated_um):
        return []
    return [text("forecast.least", calculated=f"{calculated_um:.2f}", least=f"{LEAST_FORECAST_UM:g}")]


def _kept_lines(
    version: LearnedCompensation, kept: Path | None, asked: bool, options: Namespace, text: Catalogue
) -> list[str]:
    """Return where a version was kept and how to cut with it; nothing where that was `asked` and failed."""
    if kept is None:
        return [] if asked else ["", text("calibrate.not_kept")]
    words = ["console", "run", options.job, "--strategy", version.holds_for.strategy, "--compensation", "newest"]
    if options.machine:
        words += ["--machine", options.machine]
    if version.holds_for.simulated:
        words += ["--sim", *options_of(version.holds_for.lathe)]
    file = printable(str(kept))
    return ["", text("learned.kept", version=version.version, file=file, command=shlex.join(words))]


def _version_lines(known: Sequence[LearnedCompensation], asked: HoldsFor, text: Catalogue) -> list[str]:
    head = _subject(asked, text)
    if not known:
        return [f"{head}: {text('learned.no_versions')}"]
    columns = ("version", "date", "strategy", "from", "gain", "ront", "lobe", "now")
    rows = [tuple(text(f"learned.column.{name}") for name in columns)]
    rows += [_row(version, asked, text) for version in known]
    return [head, "", *table(rows, numeric=(0, 4, 5, 6))]


def _subject(holds: HoldsFor, text: Catalogue) -> str:
    sim = f"{text('sim')}  " if holds.simulated else ""
    return f"{sim}{holds.job} · {holds.machine}"


def _row(version: LearnedCompensation, asked: HoldsFor, text: Catalogue) -> tuple[str, ...]:
    part, reverts = version.part, version.reverts
    return (
        str(version.version),
        f"{version.date} {text('learned.date_ahead')}" if is_ahead(version.date) else version.date,
        version.holds_for.strategy,
        str(version.parent) if reverts is None else text("learned.again", version=reverts),
        f"{version.gain:.3g}",
        "" if part is None else f"{part.ront_um:.2f}",
        "" if part is None else f"{2 * part.lobe.amplitude_um:.2f}",
        _standing(version, asked, text),
    )


def _standing(version: LearnedCompensation, asked: HoldsFor, text: Catalogue) -> str:
    """Return whether a version is valid, else what has changed since."""
    changed = changed_settings(version.holds_for, asked)
    return changed or text("learned.holds" if _still_holds(version, asked) else "learned.changed")


def _facts(step: LearningStep, text: Catalogue) -> list[tuple[str, str]]:
    learned = ", ".join(str(n) for n in step.learned) or text("learned.no_harmonics")
    rows = [(text("learned.harmonics"), learned), (text("learned.gain"), f"{step.next.gain:.3g}")]
    lobes, contraction = step.next.path.target.lobes, step.contraction
    if contraction is not None:
        fraction, late_deg = _arrival(contraction, lobes)
        late = text("learned.arrives_late", share=f"{100 * fraction:.1f}", late=f"{late_deg:+.2f}")
        rows += [(text("learned.arrives"), late), (text("learned.factor"), _factor(contraction, text))]
    others = sorted((n, each) for n, each in step.contractions.items() if n != lobes)
    return [*rows, *((text("learned.factor_of", harmonics=f"{n}/rev"), _factor(each, text)) for n, each in others)]


def _factor(contraction: Contraction, text: Catalogue) -> str:
    factor = f"{contraction.value:.2f} ± {contraction.half_width:.2f}"
    return f"{factor}: {text(f'learned.verdict.{contraction.verdict}')}"
