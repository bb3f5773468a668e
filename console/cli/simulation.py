"""How the simulated lathe of a command really is, as the command line says."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from console.cli.parser import DEFAULT_PLANT
from console.session.errors import SessionError
from drivers.link.address import SimulatedAddress
from profiles.machine import MachineProfile
from profiles.problem import Problem

if TYPE_CHECKING:
    from drivers.simulator.plant.true_parameters import TrueParameters

ASKED_FOR = ("plant", "seed", "clamping_sd")


def anything_told(options: Namespace) -> bool:
    """Whether the command line says anything of a simulated lathe."""
    return any(getattr(options, name) is not None for name in ASKED_FOR)


def simulation_told(options: Namespace, machine: MachineProfile) -> SimulatedAddress | None:
    """Return the lathe behind the screens that --plant, --seed and --clamping-sd ask for, None where nothing does.

    Raises:
        ProfileError: no such plant, or its file cannot be used.
    """
    if not anything_told(options):
        return None
    plant, sd_percent = options.plant or SimulatedAddress().plant, options.clamping_sd or 0.0
    from drivers.simulator.plant.presets import plant_named

    plant_named(plant, machine, options.seed, sd_percent)
    return SimulatedAddress(plant=plant, seed=options.seed, clamping_sd_percent=sd_percent)


def iron_told(options: Namespace, machine: MachineProfile) -> TrueParameters | None:
    """Return the iron that a command without screens cuts on, None where nothing is said of it.

    Nobody aligns it, so that a plant has to be set up as profile and job say: `ideal` where none is named.

    Raises:
        SessionError: `session.nobody_aligns`, the plant `mounted`.
        ProfileError: no such plant, or its file cannot be used.
    """
    if not anything_told(options):
        return None
    from drivers.simulator.plant.presets import MOUNTED, plant_named

    plant = options.plant or DEFAULT_PLANT
    if plant == MOUNTED:
        raise SessionError(Problem(code="session.nobody_aligns", key="--plant", value=plant))
    return plant_named(plant, machine, options.seed, options.clamping_sd or 0.0)
