"""Opening what the arguments name: the job, the machine and the data folder."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from console.session.paths import data_folder, jobs_folder, machines_folder
from profiles.store import LoadedJob, LoadedMachine, load_job, load_machine

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


def machine_of(options: Namespace) -> LoadedMachine:
    """Load the machine named on the command line.

    Raises:
        ProfileError: with every problem of it.
    """
    return load_machine(options.machine or DEFAULT_MACHINE, machines_folder(data_of(options)))
