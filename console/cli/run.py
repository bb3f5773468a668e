"""`console run`: a whole job, from the saved job to the measured part."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.errors import SessionError
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from profiles.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from console.session.records import RunRecord
    from console.session.run import RunPlan, RunResult
    from console.session.sequence import Shop, Step
    from drivers.link.tracing import Tracing
    from profiles.machine import MachineProfile
    from profiles.store import LoadedJob, LoadedMachine


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job on the simulator, and print what became of it.

    Raises:
        ProblemError: a refusal before anything moved, or what ended the cut; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    if not options.sim:
        raise SessionError(Problem(code="session.no_machine"))
    # Numerics take longer to load than the whole command line; the signals are already in hand.
    from console.cli.library import data_of, job_of, machine_of
    from console.cli.output import print_json
    from console.cli.warn import tell as tell_problems
    from console.cli.warn import tell_warnings
    from console.session.records import RunRecord
    from console.session.run import plan_run
    from drivers.cut import Strategy
    from drivers.link.tracing import Tracing
    from drivers.pmac.dialect import DIALECTS
    from drivers.pmac.heartbeat.lease import lease_condition

    job, machine = job_of(options), machine_of(options)
    lease = lease_condition(DIALECTS[machine.machine.controller.family])
    strategy, where = Strategy(options.strategy), str(job.path)
    plan = plan_run(job.job, machine.machine, strategy, options.ts, where, lease=lease)
    warnings = tell_warnings(plan, text)
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"run {job.job.name}")
    record = RunRecord(data_of(options), _described(job, machine, plan))
    tell = _teller(options, text, interruption, record.add)
    open_shop = _simulated_shop(machine.machine, interruption, tracing)
    try:
        result = _recorded(plan, record, open_shop, tell, warnings)
    finally:
        warnings += tell_problems(tracing.problems, text)
    if options.json:
        print_json(_fields(result, warnings))
    else:
        print("\n".join(_lines(result, text)))
    return 0


def _described(job: LoadedJob, machine: LoadedMachine, plan: RunPlan) -> dict[str, object]:
    return {
        "software": f"trilobe {version('trilobe')}",
        "job": job.job.name,
        "job_sha256": job.sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": 1,
        "strategy": plan.cut.strategy.value,
        "program": plan.cut.text,
    }


def _recorded(
    plan: RunPlan,
    record: RunRecord,
    open_shop: Callable[[], Shop],
    tell: Callable[[str, Step, str], None],
    warnings: list[str],
) -> RunResult:
    """Run, and keep in the record how it went, however it ends."""
    from console.session.run import run

    try:
        record.add("planned", {"warnings": warnings, "duration_s": plan.cut.duration_s})
        result = run(plan, open_shop, tell)
        record.add("result", _fields(result, warnings))
    except BaseException as error:
        # What ended the run matters more than a record that cannot take it.
        with suppress(SessionError):
            record.add("ended", {"reason": str(error) or type(error).__name__})
        raise
    finally:
        record.close()
    return result


def _simulated_shop(machine: MachineProfile, interruption: Interruption, tracing: Tracing) -> Callable[[], Shop]:
    """Return a function that opens a simulated machine of its own for each part."""
    from console.session.sequence import Shop
    from drivers.heartbeat import Heartbeat
    from drivers.lathe import Lathe
    from drivers.link.memory import MemoryLink
    from drivers.pmac.client import PmacClient
    from drivers.simulator.machine import SimulatedLathe
    from drivers.stop import StopPath

    def open_shop() -> Shop:
        simulated = SimulatedLathe(machine)
        link = tracing.of(MemoryLink(simulated.connect(), simulated), simulated.now_s)
        stop = StopPath(link)
        interruption.guard(stop)
        client = PmacClient(link, simulated)
        heartbeat = Heartbeat(client, simulated, machine)
        lathe = Lathe(client, machine, simulated, stop, heartbeat=heartbeat)
        return Shop(
            lathe=lathe,
            clamp=simulated.mount,
            measure=simulated.measure,
            simulated=True,
            collisions=lambda: simulated.look().collisions,
        )

    return open_shop


def _teller(
    options: Namespace,
    text: Catalogue,
    interruption: Interruption,
    keep: Callable[[str, dict[str, object]], None],
) -> Callable[[str, Step, str], None]:
    """Return what is told at each step: a line for people, an event for the record."""

    def tell(part: str, step: Step, detail: str) -> None:
        keep("step", {"part": part, "step": step.value, "detail": detail})
        if options.json:
            return
        if step.value == "cut":
            detail = f"{detail} · {text('run.how_to_stop')}"
        try:
            print(f"{text('sim')}  {text(f'part.{part}')}  {text(f'step.{step}')}  {detail}".rstrip())
            sys.stdout.flush()
        except OSError:
            # Nobody can see the machine any more, so it is not to go on.
            interruption.end("output closed")

    return tell


def _fields(result: RunResult, warnings: list[str]) -> dict[str, object]:
    from console.cli.output import roundness_fields

    plan, figures = result.plan, result.figures
    return {
        "job": plan.job.name,
        "machine": plan.machine.name,
        "simulated": result.simulated,
        "strategy": plan.cut.strategy.value,
        "spindle_rpm": figures.spindle_speed_rpm,
        "lobe_frequency_hz": result.lobe_frequency_hz,
        "before": roundness_fields(result.before),
        "after": roundness_fields(result.after),
        "improvement_percent": result.improvement_percent,
        "roundness_tolerance_um": plan.job.roundness_tolerance_um,
        "within_tolerance": result.within_tolerance,
        "tool_error_um": figures.tool_error_um,
        "tool_error_rms_um": figures.tool_error_rms_um,
        "following_error_um": figures.following_error_um,
        "following_error_rms_um": figures.following_error_rms_um,
        "telemetry_samples": figures.samples,
        "segment_ms": plan.cut.segment_ms,
        "cut_duration_s": plan.cut.duration_s,
        "warnings": warnings,
        "collisions": list(result.collisions),
    }


def _lines(result: RunResult, text: Catalogue) -> list[str]:
    from console.session.collisions import collision_problems
    from console.text.columns import table

    job, before, after, figures = result.plan.job, result.before, result.after, result.figures
    circle = f"RONt ({before.reference_circle}, {before.filter_upr:g} UPR, {text(f'state.{before.state}')})"
    lobe = text("run.harmonic", n=job.jaws)
    rows = [("", text("part.before"), text("part.after"), "")]
    rows += [(circle, f"{before.ront_um:.2f}", f"{after.ront_um:.2f}", "um")]
    rows += [(lobe, f"{before.amplitude_um(job.jaws):.2f}", f"{after.amplitude_um(job.jaws):.2f}", "um")]
    verdict = text(
        "run.within" if result.within_tolerance else "run.outside", limit=f"{job.roundness_tolerance_um:g}"
    )
    facts = [
        (text("run.improvement"), f"{result.improvement_percent:.1f} %"),
        (text("run.spindle"), f"{figures.spindle_speed_rpm:.1f} rpm, {result.lobe_frequency_hz:.2f} Hz"),
        (text("run.tool_error"), f"{figures.tool_error_um:.2f} um, rms {figures.tool_error_rms_um:.2f} um"),
        (
            text("run.following"),
            f"{figures.following_error_um:.2f} um, rms {figures.following_error_rms_um:.2f} um",
        ),
        (text("run.verdict"), verdict),
    ]
    facts += [(text("run.collision"), text.problem(met)) for met in collision_problems(result.collisions)]
    head = f"{text('sim')}  {job.name} · {result.plan.machine.name} · {result.plan.cut.strategy}"
    return ["", head, "", *table(rows, numeric=(1, 2)), "", *table(facts), text("run.simulated")]
