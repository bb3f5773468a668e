"""What `console run` was asked for: a job on a machine at a place, planned, with nothing sent yet."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass

from console.cli.library import job_of, machine_of
from console.cli.simulation import simulation_told
from console.session.learning import refuse_unlearnable
from console.session.run import RunPlan, plan_run
from console.session.whereabouts import address_of
from drivers.cut import Strategy
from drivers.heartbeat import cut_condition
from drivers.link.address import LinkAddress, SimulatedAddress
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters
from profiles.machine import MachineProfile
from profiles.store import LoadedJob, LoadedMachine


@dataclass(frozen=True, kw_only=True)
class RunOrder:
    """`address` is None for a simulated machine in this process, in the time that computing it takes.

    `true` is what that one is really like, None as its profile says. `parts` are so many in a row that learn.
    """

    job: LoadedJob
    machine: LoadedMachine
    plan: RunPlan
    address: LinkAddress | None
    true: TrueParameters | None = None
    parts: int | None = None

    @property
    def simulated(self) -> bool:
        """Whether no iron is behind it."""
        return self.address is None or isinstance(self.address, SimulatedAddress)


def ordered(options: Namespace) -> RunOrder:
    """Load and plan what the command line asks for.

    Raises:
        ProblemError: everything that forbids it; nothing was opened.
    """
    job, machine = job_of(options), machine_of(options)
    address = None if options.sim else address_of(machine.machine, options.link, simulated=False)
    plan = plan_run(
        job.job,
        machine.machine,
        Strategy(options.strategy),
        options.ts,
        str(job.path),
        lease=cut_condition(machine.machine),
    )
    true = None if address is not None else _true(options, machine.machine)
    if options.learn is not None:
        refuse_unlearnable(plan, measured=address is None)
    return RunOrder(job=job, machine=machine, plan=plan, address=address, true=true, parts=options.learn)


def _true(options: Namespace, machine: MachineProfile) -> TrueParameters | None:
    told = simulation_told(options, machine)
    return None if told is None else plant_named(told.plant, machine, told.seed, told.clamping_sd_percent)
