"""How the simulated lathe behind the screens really is, as the command line says."""

from __future__ import annotations

from argparse import Namespace

from drivers.link.address import SimulatedAddress
from profiles.machine import MachineProfile

ASKED_FOR = ("plant", "seed", "clamping_sd")


def simulation_told(options: Namespace, machine: MachineProfile) -> SimulatedAddress | None:
    """Return the simulated lathe that --plant, --seed and --clamping-sd ask for, None where nothing does.

    Raises:
        ProfileError: no such plant, or its file cannot be used.
    """
    if all(getattr(options, name) is None for name in ASKED_FOR):
        return None
    default = SimulatedAddress()
    plant, sd_percent = options.plant or default.plant, options.clamping_sd or 0.0
    from drivers.simulator.plant.presets import plant_named

    plant_named(plant, machine, options.seed, sd_percent)
    return SimulatedAddress(plant=plant, seed=options.seed, clamping_sd_percent=sd_percent)
