"""Opening what the arguments name: the job, the machine and the data folder."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.calibrated_chuck import CalibratedMachine, calibrated
from console.session.paths import data_folder, jobs_folder, machines_folder
from profiles.machine_signature import iron_problems
from profiles.problem import ProfileError
from profiles.store import LoadedJob, LoadedMachine, load_job, load_machine

if TYPE_CHECKING:
    from drivers.link.address import LinkAddress
    from profiles.machine import MachineProfile

DEFAULT_MACHINE = "lee-2001-lathe"


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
    """Load the machine named on the command line, for what is only read or calculated.

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
    if is_real(address_told(options, loaded)):
        refuse_unsigned(loaded.machine)
    return loaded


def judged_of(options: Namespace) -> CalibratedMachine:
    """Load the machine named on the command line with its newest calibrations, for what judges a job on it.

    Raises:
        ProfileError: with every problem of it; see `calibrated`.
    """
    return calibrated(profile_of(options), data_of(options))


def address_told(options: Namespace, machine: LoadedMachine) -> LinkAddress:
    """Return where the machine is: as --link says, or its profile; a simulated one where neither does.

    Raises:
        LinkError: `link.bad_address`.
    """
    from drivers.link.address import SimulatedAddress, parse_address

    told = options.link or machine.machine.link
    return parse_address(told) if told and not options.sim else SimulatedAddress()


def is_real(address: LinkAddress) -> bool:
    """Whether the console has to take what is there for iron."""
    from drivers.link.address import SimulatedAddress

    return not isinstance(address, SimulatedAddress)


def refuse_unsigned(machine: MachineProfile) -> None:
    """Make sure that the profile of a machine behind a real link was not signed for the simulator.

    Raises:
        ProfileError: `safety.signed_for_simulator`.
    """
    if problems := iron_problems(machine):
        raise ProfileError(*problems)
