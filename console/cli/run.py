"""`console run`: a whole job, from the saved job to the measured part."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import suppress
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.agreement import agreed
from console.session.errors import SessionError
from console.session.signals import Interruption
from console.text.catalogue import Catalogue
from profiles.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from console.session.records import RunRecord
    from console.session.run import RunPlan, RunResult
    from console.session.sequence import Shop, Step
    from drivers.link.address import LinkAddress
    from drivers.link.tracing import Tracing
    from profiles.machine import MachineProfile
    from profiles.store import LoadedJob, LoadedMachine


def main(options: Namespace, text: Catalogue) -> int:
    """Run a job, on a machine or simulated, and print what became of it; 1 when nobody agreed to move a machine.

    Raises:
        ProblemError: a refusal before anything moved, or what ended the cut; the machine is at rest.
    """
    interruption = Interruption()
    interruption.install()
    # Numerics take longer to load than the whole command line; the signals are already in hand.
    from console.cli.library import data_of, job_of, machine_of
    from console.cli.output import print_json
    from console.cli.run_report import fields, lines
    from console.cli.warn import tell as tell_problems
    from console.cli.warn import tell_warnings
    from console.session.run import run
    from console.session.whereabouts import address_of
    from drivers.link.address import SimulatedAddress
    from drivers.link.tracing import Tracing

    job, machine = job_of(options), machine_of(options)
    address = None if options.sim else address_of(machine.machine, options.link, simulated=False)
    plan = _planned(options, job, machine.machine)
    warnings = tell_warnings(plan, text)
    if address is not None and not _agreed(options, plan, address, text):
        return 1
    tracing = Tracing(None if options.trace is None else Path(options.trace), f"run {job.job.name}")
    simulated = address is None or isinstance(address, SimulatedAddress)
    record = _record(data_of(options), job, machine, plan, simulated=simulated)
    tell = _teller(options, text, interruption, record.add, simulated=simulated)
    try:
        if address is None:
            open_shop = _simulated_shop(machine.machine, interruption, tracing)
            result = _recorded(record, warnings, plan, lambda: run(plan, open_shop, tell))
        else:
            work = partial(_run_there, options, machine, address, plan, interruption, tracing, tell)
            result = _recorded(record, warnings, plan, work)
    finally:
        warnings += tell_problems(tracing.problems, text)
    if options.json:
        print_json(fields(result, warnings))
    else:
        print("\n".join(lines(result, text)))
    return 0


def _planned(options: Namespace, job: LoadedJob, machine: MachineProfile) -> RunPlan:
    from console.session.run import plan_run
    from drivers.cut import Strategy
    from drivers.heartbeat import cut_condition

    strategy, where = Strategy(options.strategy), str(job.path)
    return plan_run(job.job, machine, strategy, options.ts, where, lease=cut_condition(machine))


def _agreed(options: Namespace, plan: RunPlan, address: LinkAddress, text: Catalogue) -> bool:
    """Say what the cut rests on where nobody has touched off, and have the name of the machine typed."""
    from drivers.link.address import SimulatedAddress

    machine, job = plan.machine, plan.job
    rests_on = text(
        "run.rests_on",
        machine=machine.name,
        address=address,
        radius=f"{machine.tool.home_radius_mm:.3f}",
        jaw=f"{job.lobe_phase_deg:.2f}",
        force=f"{job.chucking_force_n:.0f}",
    )
    print(rests_on, file=sys.stderr)
    return agreed(options, machine.name, isinstance(address, SimulatedAddress), text, "run")


def _run_there(
    options: Namespace,
    machine: LoadedMachine,
    address: LinkAddress,
    plan: RunPlan,
    interruption: Interruption,
    tracing: Tracing,
    tell: Callable[[str, Step, str], None],
) -> RunResult:
    """Cut one part on a machine behind a link, and leave it with its drives off."""
    from console.cli.library import data_of
    from console.session.commissioned import Commissioned
    from console.session.machine_run import leave, machine_shop
    from console.session.reaching import reach
    from console.session.run import run_once

    data = data_of(options)
    reached = reach(machine, address, data, tracing)
    try:
        interruption.guard(reached.stop)
        commissioned = Commissioned(
            reached.client, reached.heartbeat, machine.machine, data, simulated=reached.simulated
        )
        result = run_once(plan, machine_shop(reached, commissioned), tell)
        if not leave(reached.lathe, reached.owning):
            raise SessionError(Problem(code="machine.state_unknown"))
        return result
    except BaseException:
        leave(reached.lathe, reached.owning)
        raise
    finally:
        reached.close()


def _record(data: Path, job: LoadedJob, machine: LoadedMachine, plan: RunPlan, *, simulated: bool) -> RunRecord:
    from console.session.records import RunRecord

    return RunRecord(data, _described(job, machine, plan, simulated=simulated))


def _described(job: LoadedJob, machine: LoadedMachine, plan: RunPlan, *, simulated: bool) -> dict[str, object]:
    return {
        "software": f"trilobe {version('trilobe')}",
        "job": job.job.name,
        "job_sha256": job.sha256,
        "machine": machine.machine.name,
        "machine_sha256": machine.sha256,
        "simulated": int(simulated),
        "strategy": plan.cut.strategy.value,
        "program": plan.cut.text,
    }


def _recorded(record: RunRecord, warnings: list[str], plan: RunPlan, work: Callable[[], RunResult]) -> RunResult:
    """Run, and keep in the record how it went, however it ends."""
    from console.cli.run_report import fields

    try:
        record.add("planned", {"warnings": warnings, "duration_s": plan.cut.duration_s})
        result = work()
        record.add("result", fields(result, warnings))
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

        def turn(rpm: float | None) -> None:
            if rpm is None:
                simulated.stop_spindle()
            else:
                simulated.set_spindle_rpm(rpm)

        return Shop(
            lathe=lathe,
            clamp=simulated.mount,
            measure=simulated.measure,
            simulated=True,
            collisions=lambda: simulated.look().collisions,
            turn=turn if machine.spindle.followed else None,
        )

    return open_shop


def _teller(
    options: Namespace,
    text: Catalogue,
    interruption: Interruption,
    keep: Callable[[str, dict[str, object]], None],
    *,
    simulated: bool,
) -> Callable[[str, Step, str], None]:
    """Return what is told at each step: a line for people, an event for the record."""
    sim = f"{text('sim')}  " if simulated else ""

    def tell(part: str, step: Step, detail: str) -> None:
        keep("step", {"part": part, "step": step.value, "detail": detail})
        if options.json:
            return
        if step.value == "cut":
            detail = f"{detail} · {text('run.how_to_stop')}"
        try:
            print(f"{sim}{text(f'part.{part}')}  {text(f'step.{step}')}  {detail}".rstrip())
            sys.stdout.flush()
        except OSError:
            # Nobody can see the machine any more, so it is not to go on.
            interruption.end("output closed")

    return tell
