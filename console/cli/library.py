"""Loading what the arguments name: the data folder, the job and the machine, real or simulated."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import DEFAULT_PLANT
from console.session.data.calibrated_chuck import CalibratedMachine, calibrated
from console.session.data.kept_files import data_folder, jobs_folder, machines_folder
from console.session.errors import SessionError
from drivers.link.address import LinkAddress, SimulatedAddress, parse_address
from profiles.machine import MachineProfile, real_machine_problems
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedJob, LoadedMachine, load_job, load_machine

if TYPE_CHECKING:
    from drivers.simulator.plant.true_parameters import TrueParameters

DEFAULT_MACHINE = "lee-2001-lathe"
OF_A_SIMULATION = ("plant", "seed", "clamping_sd")
"""Options that describe the actual plant of a simulated lathe."""


def data_of(options: Namespace) -> Path:
    """Return the data folder of this call."""
    return data_folder(options.data)


def job_of(options: Namespace) -> LoadedJob:
    """Load the job named on the command line.

    Raises:
        ProfileError: with every problem of it.
    """
    return load_job(options.job, jobs_folder(data_of(options)))


def profile_of(options: Namespace) -> LoadedMachine:
    """Load the machine named on the command line, for reading and calculating only.

    Raises:
        ProfileError: with every problem of it.
    """
    return load_machine(options.machine or DEFAULT_MACHINE, machines_folder(data_of(options)))


def machine_of(options: Namespace) -> LoadedMachine:
    """Load the machine named on the command line, for a command that moves it.

    Raises:
        ProfileError: with every problem of it; `safety.signed_for_simulator`, it is not for a real link.
        LinkError: `link.bad_address`.
    """
    loaded = profile_of(options)
    if is_real(link_address(options, loaded)):
        refuse_unsigned(loaded.machine)
    return loaded


def judged_of(options: Namespace) -> CalibratedMachine:
    """Load the machine named on the command line with its newest calibrations, to judge a job on it.

    Raises:
        ProfileError: with every problem of it; see `calibrated`.
    """
    return calibrated(profile_of(options), data_of(options))


def link_address(options: Namespace, machine: LoadedMachine) -> LinkAddress:
    """Return the machine's address from --link or its profile; a simulated one where neither gives one.

    Raises:
        LinkError: `link.bad_address`.
    """
    told = options.link or machine.machine.link
    return parse_address(told) if told and not options.sim else SimulatedAddress()


def is_real(address: LinkAddress) -> bool:
    """Whether the console must assume a real machine."""
    return not isinstance(address, SimulatedAddress)


def refuse_unsigned(machine: MachineProfile) -> None:
    """Refuse a machine on a real link whose profile was signed for the simulator.

    Raises:
        ProfileError: `safety.signed_for_simulator`.
    """
    if problems := real_machine_problems(machine):
        raise ProfileError(*problems)


def plant_given(options: Namespace) -> bool:
    """Whether the command line describes a simulated plant."""
    return any(getattr(options, name) is not None for name in OF_A_SIMULATION)


def simulated_address(options: Namespace, machine: MachineProfile) -> SimulatedAddress | None:
    """Return the simulated lathe that --plant, --seed and --clamping-sd describe, None without these.

    Raises:
        ProfileError: no such plant, or its file cannot be used.
    """
    if not plant_given(options):
        return None
    plant, sd_percent = options.plant or SimulatedAddress().plant, options.clamping_sd or 0.0
    from drivers.simulator.plant.presets import plant_named

    plant_named(plant, machine, options.seed, sd_percent)
    return SimulatedAddress(plant=plant, seed=options.seed, clamping_sd_percent=sd_percent)


def true_parameters_of(options: Namespace, machine: MachineProfile) -> TrueParameters | None:
    """Return the actual plant that a command without screens cuts on, None where it is not specified.

    Without screens there is no alignment, so the plant must be set up as profile and job say: `ideal` by default.

    Raises:
        SessionError: `session.nobody_aligns`, the plant `mounted`.
        ProfileError: no such plant, or its file cannot be used.
    """
    if not plant_given(options):
        return None
    from drivers.simulator.plant.presets import MOUNTED, plant_named

    plant = options.plant or DEFAULT_PLANT
    if plant == MOUNTED:
        raise SessionError(Problem(code="session.nobody_aligns", key="--plant", value=plant))
    return plant_named(plant, machine, options.seed, options.clamping_sd or 0.0)
