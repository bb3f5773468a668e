"""Cut of `console run`, on a machine behind a link or a simulated one in this process: its output and records."""

from __future__ import annotations

import shlex
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from console.cli.arguments import stated_identity
from console.cli.judgement import force_line, span_fields
from console.cli.library import data_of
from console.cli.machine.run_request import RunRequest
from console.cli.machine.stopping import StopMonitor
from console.cli.measured.roundness_report import cause_rows, judged_rows, roundness_fields
from console.cli.output import confirm_motion, fields_of, harmonics_of, show
from console.cli.output import tell as tell_problems
from console.session.cut.engine import CutContext, NotAsPlannedError, PartStep
from console.session.cut.in_process import simulated_context
from console.session.cut.recording import TRIAL_BAND, CutRecorder, LogRecorder, budget_event, part_record
from console.session.cut.run import RunResult, TellPart, roundness_of, run, run_once
from console.session.cut.simulated_parts import LatheParts, lathe_setup
from console.session.cut.telemetry import stretches_event
from console.session.data.kept_files import RunDates
from console.session.data.learned_store import NONE
from console.session.data.measured_part import FINGERPRINT, MODEL, MadeWith, tool_event
from console.session.data.records import DRIVES_ON_TIMEOUT_S, OPEN_TIMEOUT_S, RunFacts, RunRecord, begin_record
from console.session.data.run_rows import problem_events
from console.session.errors import SessionError, refuse
from console.session.feed.followed_run import FollowedRun, Run, RunAlarms
from console.session.feed.server import FeedServer
from console.session.force_record import force_event
from console.session.learning.learning import learn
from console.session.learning.learning_beside import TRIM_LIMIT_UM
from console.session.learning.row_result import LearnedPart, LearnResult
from console.session.operator import operator_name
from console.session.part_identity import PartIdentity
from console.session.signals import Interruption
from console.session.stages import Stage
from console.session.station.actions import stopped_by
from console.session.station.alarms import collision_problems
from console.session.station.machine_connection import (
    ConnectedMachine,
    commissioning,
    guard,
    leave,
    machine_context,
    reach,
)
from console.session.tuning.air_proof import stated_filter_problems
from console.text import part_sentences
from console.text.along_length import form_words, stretch_words
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.recorded_words import identity_words, plain_cut_words
from drivers.clock import boot_s
from drivers.lathe.snapshot import Snapshot
from drivers.link.tracing import Tracing
from drivers.simulator.plant.which_lathe import LATHE
from profiles.compensations.certificate import OrderStatus
from profiles.compensations.path import PathHarmonic
from profiles.job import TOLERANCES, Job
from profiles.metrology.cylindricity import cylinder_event
from profiles.problem import Problem, ProblemError
from profiles.roundness import RoundnessResult
from profiles.traces import Trace, write_trace


def agreed_to(options: Namespace, request: RunRequest, text: Catalogue) -> bool:
    """Report what the cut rests on without a touch-off, and have the name of the machine typed."""
    machine, job = request.plan.machine, request.plan.job
    rests_on = text(
        "run.rests_on",
        machine=machine.name,
        address=request.address,
        radius=f"{machine.tool.home_radius_mm:.3f}",
        jaw=f"{job.jaw_1_deg:.2f}",
        force=f"{job.chucking_force_n:.0f}",
    )
    print(f"{rests_on}\n{force_line(job, machine, text)}", file=sys.stderr)
    return confirm_motion(options, machine.name, request.simulated, text)


def result_fields(result: RunResult, warnings: list[str]) -> dict[str, object]:
    """Return a run, with the warnings that were printed; of several parts the last one, with all of them after."""
    plan, figures, several = result.plan, result.figures, dict[str, object]()
    if isinstance(result, LearnResult):
        several = {
            "passes": [_part_fields(part) for part in result.parts],
            "floor": {**roundness_fields(result.floor), **cylinder_event(result.floor_whole)},
        }
    return {
        "job": plan.job.name,
        "machine": plan.machine.name,
        "simulated": result.simulated,
        "strategy": plan.cut.strategy.value,
        "stage": plan.stage.value,
        "compensation": plan.compensation,
        "inverted": plan.inverted or "model",
        **({FINGERPRINT: plan.fingerprint} if plan.fingerprint else {}),
        "expected": None if plan.expected_residual is None else harmonics_of(plan.expected_residual),
        "clamping": span_fields(plan.job, plan.machine),
        "spindle_rpm": figures.spindle_speed_rpm,
        "lobe_frequency_hz": result.lobe_frequency_hz,
        "before": None if result.before is None else roundness_fields(result.before),
        "after": None if result.after is None else roundness_fields(result.after),
        **cylinder_event(result.whole),
        "improvement_percent": result.improvement_percent,
        **fields_of(plan.job, *TOLERANCES),
        "within_tolerance": None,
        **part_sentences.judged_fields(result.judged),
        **budget_event(result.budget),
        **fields_of(figures, "tool_error_um", "tool_error_rms_um", "following_error_um", "following_error_rms_um"),
        **tool_event(figures.tool_lobe_um, figures.push_um),
        **figures.event(),
        **force_event(result.force),
        "telemetry_samples": figures.samples,
        "segment_ms": plan.cut.segment_ms,
        "cut_duration_s": plan.cut.duration_s,
        "warnings": warnings,
        "collisions": list(result.collisions),
        **several,
    }


def _part_fields(part: LearnedPart) -> dict[str, object]:
    path = part.path
    return {
        **roundness_fields(part.roundness),
        **cylinder_event(part.whole),
        "mean_deviation_um": part.roundness.mean_deviation_um,
        "learned": {
            "air_lobe_error_um_pp": list(part.air_um),
            "wanted_mean_um": path.target.mean_um,
            "wanted": _harmonic_fields(path.target.harmonics),
            "command_mean_um": path.command.mean_um,
            "command": _harmonic_fields(path.command.harmonics),
            "trim": _harmonic_fields([PathHarmonic.from_coefficient(path.target.lobes, part.trim_um)]),
            "tool_mean_error_um": part.tool_off.mean_um,
            "tool_error": _harmonic_fields(
                PathHarmonic.from_coefficient(n, um) for n, um in sorted(part.tool_off.coefficients_um.items())
            ),
            "part_gain": part.part_gain,
            "learned_waves": list(part.learned),
            "certificate": part_sentences.certificate_fields(part.certificate),
            "changes": [asdict(each) for each in part.changes],
            "trim_short": [{"n": n, "short_um": um} for n, um in sorted(part.trim_short.items())],
            "lobe_left": None if part.left is None else asdict(part.left),
            "fingerprint": None
            if part.clamped is None
            else part_sentences.clamped_fields(part.clamped, path.target.lobes),
            TRIAL_BAND: None if part.band is None else part.band.event(),
            "frozen": [{"n": each.order, **fields_of(each, "best_um", "grown_um")} for each in part.grown],
        },
    }


def _harmonic_fields(harmonics: Iterable[PathHarmonic]) -> list[dict[str, object]]:
    return [{"n": h.lobes, "amplitude_um": h.amplitude_um, "crest_deg": h.phase_deg} for h in harmonics]


def result_lines(result: RunResult, text: Catalogue) -> list[str]:
    """Return the result in words."""
    if not isinstance(result, LearnResult):
        closing = "run.cut_air" if result.plan.stage is Stage.AIR else "run.measure_it"
        return [*_run_lines(result, text), text("run.simulated" if result.simulated else closing)]
    last = result.parts[-1]
    certificate = [
        *part_sentences.certificate_lines(last.certificate, result.plan.job.jaws, text),
        *_left_lobe(result, text),
        *_trial_band(result, text),
        *_describe_blank_orders(result, text),
    ]
    return [*_run_lines(result, text), "", *_series(result, text), "", *certificate, text("run.simulated")]


def _left_lobe(result: LearnResult, text: Catalogue) -> list[str]:
    """Return what of the lobe that the last part has left repeats, and what was of its clamping alone."""
    left = result.parts[-1].left
    if left is None:
        return []
    figures = {"left": left.left_um_pp, "own": left.own_um_pp, "rest": left.repeats_um_pp}
    words = {name: f"{um_pp:.2f}" for name, um_pp in figures.items()}
    force = f"{100.0 * left.force_deviation:+.1f}"
    return [text("learn.left", n=result.plan.job.jaws, part=len(result.parts), force=force, **words)]


def _trial_band(result: LearnResult, text: Catalogue) -> list[str]:
    """Return what the trial band of the last part has shown, peak to peak; nothing without one."""
    band = result.parts[-1].band
    if band is None:
        return []
    missing = ", ".join(f"{n}/rev {2.0 * abs(c):.1f}" for n, c in sorted(band.missing_um.items()))
    numbers = {"arrives": f"{100.0 * band.arrives:.0f}", "stylus": f"{band.stylus_deg:+.1f}"}
    push = f"{band.push_um:.1f}"
    return [text("learn.band", part=len(result.parts), missing=missing, push=push, **numbers)]


def _describe_blank_orders(result: LearnResult, text: Catalogue) -> list[str]:
    """Return which orders of the last part are mostly of its own blank, or of what else varies."""
    number, short = len(result.parts), result.parts[-1].trim_short
    lines = []
    for each in result.own_orders:
        heights = {"left": each.on_part_um, "tool": each.tool_off_um, "rest": each.left_um}
        words = {name: f"{2.0 * (um or 0.0):.2f}" for name, um in heights.items()}
        key = "learn.varies" if each.standing is OrderStatus.VARIES else "learn.of_blank"
        limit = text("learn.trim_limit", most=f"{2.0 * TRIM_LIMIT_UM:g}") if each.order in short else ""
        lines.append(text(key, n=each.order, part=number, **words) + limit)
    return lines


def lathe_line(parts: LatheParts, text: Catalogue) -> str:
    """Return which parts of a simulated lathe are cut, and from the second on how to cut the first again."""
    first, last = parts.part, parts.part + parts.parts - 1
    number = f"{first} … {last}" if last > first else f"{first}"
    said = text("run.lathe_part", lathe=parts.lathe, number=number)
    return said if first == 1 else f"{said} · {text('run.lathe_part_again')}"


def _run_lines(result: RunResult, text: Catalogue) -> list[str]:
    plan, figures = result.plan, result.figures
    facts = [
        (text("run.spindle"), f"{figures.spindle_speed_rpm:.1f} rpm, {result.lobe_frequency_hz:.2f} Hz"),
        (text("run.tool_error"), f"{figures.tool_error_um:.2f} um, rms {figures.tool_error_rms_um:.2f} um"),
        (text("stretches.title"), stretch_words(stretches_event(figures.stretches), text)),
        (
            text("run.following"),
            f"{figures.following_error_um:.2f} um, rms {figures.following_error_rms_um:.2f} um",
        ),
    ]
    if result.improvement_percent is not None:
        facts.insert(0, (text("run.improvement"), f"{result.improvement_percent:.1f} %"))
    if plan.expected_residual is not None:
        right, wrong = f"{plan.expected_residual.right_um_pp:.1f}", f"{plan.expected_residual.wrong_um_pp:.1f}"
        facts.append((text("run.expected"), text("run.expected_lobe", right=right, wrong=wrong)))
    if result.whole is not None:
        facts.insert(0, (text("run.whole"), form_words(result.whole.event(), text)))
    facts.append((text("run.cut_verdict"), part_sentences.verdict_words(figures.verdict.event(), text)))
    facts += judged_rows(result.judged, text)
    facts += [(text("run.collision"), text.problem(problem)) for problem in collision_problems(result.collisions)]
    sim = f"{text('sim')}  " if result.simulated else ""
    head = f"{sim}{plan.job.name} · {plan.machine.name} · {plan.cut.strategy}"
    force = [] if result.force is None else ["", part_sentences.force_words(result.force, text)]
    whole, failed = result.whole, result.within_tolerance is False
    causes = cause_rows(whole, result.judged, text) if whole is not None and (failed or whole.is_uneven) else []
    return ["", head, "", *_parts(result, text), *table(facts), *causes, *force]


def _parts(result: RunResult, text: Catalogue) -> list[str]:
    """Return the table of the measured parts, with a line below it; nothing without any."""
    after = "partial" if result.plan.stage is Stage.PARTIAL else "after"
    parts = {"before": result.before, after: result.after}
    measured = {name: part for name, part in parts.items() if part is not None}
    if not measured:
        return []
    jaws, first = result.plan.job.jaws, next(iter(measured.values()))
    circle = f"RONt ({first.reference_circle}, {first.filter_upr:g} UPR, {text(f'state.{first.state}')})"
    lobes = [f"{2.0 * part.amplitude_um(jaws):.2f}" for part in measured.values()]
    rows = [
        ("", *(text(f"part.{name}") for name in measured), ""),
        (circle, *(f"{part.ront_um:.2f}" for part in measured.values()), "um"),
        (text("run.harmonic", n=jaws), *lobes, "um"),
    ]
    return [*table(rows, numeric=tuple(range(1, 1 + len(measured)))), ""]


def _series(result: LearnResult, text: Catalogue) -> list[str]:
    lobes = result.plan.job.jaws
    head = ("", "RONt", text("run.harmonic", n=lobes), text("learn.air"), text("learn.trim"), "")
    rows = [
        (*head, text("learn.grown")),
        (text("part.before"), *_figures(result.before, lobes), "", "", "um", ""),
        *(
            (
                f"{text('part.part')} {number}",
                *_figures(part.roundness, lobes),
                " ".join(f"{error_um:.2f}" for error_um in part.air_um),
                f"{2.0 * abs(part.trim_um):.2f}",
                "um",
                " ".join(f"{each.order}/rev" for each in part.grown),
            )
            for number, part in enumerate(result.parts, start=1)
        ),
        (text("part.floor"), *_figures(result.floor, lobes), "", "", "um", ""),
    ]
    return table(rows, numeric=(1, 2, 4))


def _figures(roundness: RoundnessResult, lobes: int) -> tuple[str, str]:
    return f"{roundness.ront_um:.2f}", f"{2.0 * roundness.amplitude_um(lobes):.2f}"


def cut_requested(
    options: Namespace, request: RunRequest, interruption: Interruption, warnings: list[str], text: Catalogue
) -> RunResult:
    """Cut with a record and, if requested, a trace, whose early end is added to the warnings; print the result."""
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"run {request.job.job.name}")
    data = data_of(options)
    record = begin_record(
        data,
        _facts(request, warnings, stated_identity(options)),
        request.machine,
        request.plan.cut,
        simulated=request.simulated,
        open_timeout_s=OPEN_TIMEOUT_S,
        # On a lathe in this process, a wait for other writers keeps no real drive enabled.
        timeout_s=OPEN_TIMEOUT_S if request.address is None else DRIVES_ON_TIMEOUT_S,
        now_s=boot_s if request.address is not None else lambda: 0.0,  # until there is a simulated machine
    )
    tell_cut_with(options, request, text, record.identity)
    kept = LogRecorder(record.log, partial(_keep_part, record, request))
    recorder = FollowedRun(_feed_run(request, record), kept, RunAlarms(record.log.event))
    feed = FeedServer(data, recorder.observe_state)
    feed.launch()
    tell = _followed_by(recorder, _teller(options, text, interruption, record, simulated=request.simulated))
    try:
        work = partial(_cut_job, request, data, interruption, tracing, recorder, record.log.dates, tell, text)
        result = _record_run(record, warnings, request, work)
    finally:
        feed.close()
        missing = () if record.log.problem is None else (record.log.problem,)
        warnings += tell_problems((*tracing.problems, *missing, *feed.problems), text)
    learned = result.warnings if isinstance(result, LearnResult) else ()
    warnings += tell_problems((*result.figures.verdict.problems, *learned), text)
    show(
        options,
        lambda: _fields(request, result, warnings),
        lambda: [*result_lines(result, text), *learn_hint(options, request, text)],
    )
    _save_part(request, result)
    return result


def _fields(request: RunRequest, result: RunResult, warnings: list[str]) -> dict[str, object]:
    """Return a run, and of a simulated one which lathe it was, and which of its parts."""
    lathe = {} if request.lathe_parts is None else {LATHE: request.lathe_parts.fields()}
    return {**result_fields(result, warnings), **lathe}


def _feed_run(request: RunRequest, record: RunRecord) -> Run:
    return Run(
        job=request.job.job.name,
        machine=request.machine.machine,
        run_id=record.run_id,
        simulated=request.simulated,
        air=request.plan.stage is Stage.AIR,
    )


def _followed_by(recorder: FollowedRun, tell: TellPart) -> TellPart:
    """Return the same callback, of whose steps the state feed learns first."""

    def followed(part: str, step: PartStep, detail: str) -> None:
        recorder.take_step(step)
        tell(part, step, detail)

    return followed


def _teller(
    options: Namespace, text: Catalogue, interruption: Interruption, record: RunRecord, *, simulated: bool
) -> TellPart:
    """Return the callback for each step: a line for people, an event for the record."""
    sim = f"{text('sim')}  " if simulated else ""

    def tell(part: str, step: PartStep, detail: str) -> None:
        record.add("step", {"part": part, "step": step.value, "detail": detail})
        if options.json:
            return
        if step.value == "cut":
            detail = f"{detail} · {text('run.how_to_stop')}"
        try:
            print(f"{sim}{text(f'part.{part}')}  {text(f'step.{step}')}  {detail}".rstrip())
            sys.stdout.flush()
        except OSError:
            # The operator no longer sees the machine, so it must not continue.
            interruption.end("output closed")

    return tell


def tell_cut_with(
    options: Namespace, request: RunRequest, text: Catalogue, identity: PartIdentity | None = None
) -> None:
    """Print, for people, the lines before the steps: the stage, the compensation, the force, what the part is.

    On a real machine, the operator has read the force before giving consent.
    """
    if options.json:
        return
    plan = request.plan
    which = "run.cut_with_none" if plan.compensation is None else "run.cut_with"
    made = text(which, version=plan.compensation, stage=text(f"stage.{plan.stage}"), strategy=plan.cut.strategy)
    lines = [plain_cut_words(plan.cut.strategy, plan.stage, text) or made]
    if not request.address:
        lines.append(force_line(request.job.job, request.machine.machine, text))
    if request.lathe_parts is not None and request.lathe_parts.parts:
        lines.append(lathe_line(request.lathe_parts, text))
    if request.fingerprint is not None:
        lines.append(part_sentences.fingerprint_line(request.fingerprint, text))
    if identity is not None:
        lines.append(text("identity.told", words=identity_words(identity, text)))
    # In one piece: a reader that closes after the first line is noticed at the first step, which stops the cut.
    print("".join(f"{text('sim')}  {line}\n" if request.simulated else f"{line}\n" for line in lines), end="")


def _save_part(request: RunRequest, result: RunResult) -> None:
    """Write the trace of the part if requested, with header lines that state how it was cut."""
    if request.part_file is None or result.trace is None:
        return
    made = _describe_plan(request)
    write_trace(request.part_file, replace(result.trace, meta={**result.trace.meta, **made}))


def _describe_plan(request: RunRequest) -> dict[str, str]:
    """Return how the part was cut, as header lines of its trace."""
    plan = request.plan
    made = MadeWith(
        compensation=NONE if plan.compensation is None else str(plan.compensation),
        strategy=plan.cut.strategy.value,
        stage=plan.stage.value,
        inverted=plan.inverted or MODEL,
        fingerprint=plan.fingerprint,
    )
    return made.header()


def _facts(request: RunRequest, warnings: list[str], identity: Mapping[str, object]) -> RunFacts:
    """Return what the run rests on: without a touch-off, the radius and the angle of the files."""
    plan, machine = request.plan, request.machine
    return RunFacts(
        job=plan.job,
        job_sha256=request.job.sha256,
        job_text=request.job.text,
        job_path=request.job.path,
        stage=plan.stage.value,
        compensation=plan.compensation,
        setup={
            "force_n": plan.job.chucking_force_n,
            "jaw_1_deg": plan.job.jaw_1_deg,
            "zero_radius_mm": machine.machine.tool.home_radius_mm,
            "aligned": False,
            "calibrations": machine.calibration_dates,
            "inverted": plan.inverted or MODEL,
            **({FINGERPRINT: plan.fingerprint} if plan.fingerprint else {}),
            **lathe_setup(request.which, request.lathe_parts),
            "address": "" if request.address is None else str(request.address),
            "warnings": warnings,
        },
        identity=identity,
    )


def _keep_part(
    record: RunRecord,
    request: RunRequest,
    job: Job,
    trace: Trace,
    *,
    part: str,
    product: bool,
    proven: bool,
    more: Mapping[str, object],
) -> None:
    """Add a measured part to the record; SessionError `record.lost`."""
    result = roundness_of(trace)
    stage, made = request.plan.stage, _describe_plan(request)
    kept = part_record(job, result, trace, stage, part=part, product=product, proven=proven, made=made, more=more)
    record.add("part", {"part": part, "ront_um": result.ront_um}, kept)


def learn_hint(options: Namespace, request: RunRequest, text: Catalogue) -> list[str]:
    """Return how to learn from the part; nothing for an air cut, or a strategy that follows no path."""
    if not request.plan.cut.strategy.traits.inverts or request.plan.stage is Stage.AIR:
        return []
    if request.simulated and request.part_file is None:
        return []
    words = ["console", "learn", options.part or "FILE.csv", "--job", options.job]
    if options.machine:
        words += ["--machine", options.machine]
    if options.identified:
        words += ["--identified", options.identified]
    return [text("run.learn_from_it", command=shlex.join(words))]


def _record_run(
    record: RunRecord, warnings: list[str], request: RunRequest, work: Callable[[], RunResult]
) -> RunResult:
    """Run, and record the course however it ends.

    With the plan it records the dates of the calibrations with which the job was judged.
    """
    try:
        duration_s, used = request.plan.cut.duration_s, request.machine.calibration_dates
        record.add("planned", {"warnings": warnings, "duration_s": duration_s, "calibrations": used})
        result = work()
        record.add("result", _fields(request, result, warnings))
    except BaseException as error:
        # What ended the run matters more than a record that cannot be written.
        with suppress(SessionError):
            add_end(record, error)
        raise
    finally:
        record.close()
    return result


def add_end(record: RunRecord, error: BaseException) -> None:
    """Record what ended a run: the cut was not the planned one, somebody stopped it, or it failed."""
    problems = list(error.problems) if isinstance(error, ProblemError) else []
    cause = error.__cause__
    if isinstance(cause, NotAsPlannedError):
        why = problem_events(cause.problems)
        record.add("ended_early", {"turns": cause.turns, **why, "cut_verdict": cause.judgement})
    said: dict[str, object] = {"reason": str(error) or type(error).__name__}
    if isinstance(error, KeyboardInterrupt):
        said |= {"stopped": True, "by": operator_name()}
    for problem in problems:
        if problem.code == "machine.stopped":
            said |= {"stopped": True, "by": stopped_by(problem.value), "reason": problem.value}
    record.add("ended", said)


def _cut_job(
    request: RunRequest,
    data: Path,
    interruption: Interruption,
    tracing: Tracing,
    recorder: FollowedRun,
    dates: RunDates,
    tell: TellPart,
    text: Catalogue,
) -> RunResult:
    """Cut the requested job, or its series of parts, each corrected by the ones before, at the requested place.

    On a machine behind a link, print on stderr how to stop it; leave its drives off.
    """
    if request.address is None:
        refuse(stated_filter_problems(request.machine.machine, data, simulated=True))

        def open_machine() -> CutContext:
            """Open a new simulated machine for each part."""
            context, simulated = simulated_context(request.machine.machine, request.true, tracing)
            dates.follow(simulated.now_s)
            interruption.guard(context.lathe.stop)
            return replace(context, recorder=recorder, gauge=request.gauge)

        if request.parts is None:
            return run(request.plan, open_machine, tell)
        return learn(
            request.plan, open_machine, tell, request.parts, fingerprint=request.felt, band=request.banded
        )
    stopping = StopMonitor(interruption, text)

    def seen(snapshot: Snapshot) -> None:
        stopping.note_reply(snapshot)
        recorder.take_poll(snapshot)

    reached = reach(request.machine, request.address, data, tracing, seen)
    recorder.stop, recorder.alarms.heartbeat = reached.stop, reached.heartbeat
    try:
        guard(interruption, reached.lathe, reached.clock.now_s)
        with stopping.watching(reached.stop):
            return _cut_there(request, reached, data, recorder, tell)
    finally:
        reached.close()


def _cut_there(
    request: RunRequest, reached: ConnectedMachine, data: Path, recorder: CutRecorder, tell: TellPart
) -> RunResult:
    try:
        commissioned = commissioning(reached, request.machine, data)
        context = replace(machine_context(reached, commissioned), recorder=recorder, gauge=request.gauge)
        result = run_once(request.plan, context, tell)
        if not leave(reached.lathe, reached.owning):
            raise SessionError(Problem(code="machine.state_unknown"))
        return result
    except BaseException:
        leave(reached.lathe, reached.owning)
        raise
