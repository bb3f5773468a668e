"""`console simulator`: the simulated machine as a server that speaks like a PMAC."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.library import profile_of
from console.cli.parser import DEFAULT_PLANT
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from drivers.simulator.machine import SimulatedLathe
    from profiles.machine import MachineProfile

WRONG_USAGE = 2
WITHOUT_CHANCE = (DEFAULT_PLANT, "paper")
SET_UP_BY_HAND = ("mounted", "realistic")
"""Whoever connects has to align these: the chuck is at any angle. The others, and files, are as said."""


def main(options: Namespace, text: Catalogue) -> int:
    """Serve until a signal ends it."""
    if not (options.tcp or options.ethernet or options.pty):
        print(f"console simulator: {text('usage.no_listener')}", file=sys.stderr)
        return WRONG_USAGE
    if options.seed is not None and options.plant in (None, *WITHOUT_CHANCE) and not options.clamping_sd:
        print(f"console simulator: {text('usage.seed_without_chance')}", file=sys.stderr)
        return WRONG_USAGE
    from drivers.simulator.hosts.server import Listeners, serve

    machine = profile_of(options).machine

    def ready(address: str) -> None:
        if options.json:
            # A line each: who reads them cannot wait for the end of the output.
            print(json.dumps({"listening": address, "machine": machine.name, "simulated": True}))
        else:
            print(text("simulator.ready", machine=machine.name, address=address))
        sys.stdout.flush()

    listeners = Listeners(tcp=options.tcp, ethernet=options.ethernet, pty=options.pty, control=options.control)
    serve(_lathe(machine, options), listeners, ready, options.speed)
    return 0


def _lathe(machine: MachineProfile, options: Namespace) -> SimulatedLathe:
    """Return the machine with the controller that its profile names, or with the one that is asked for."""
    from drivers.pmac.dialect import DIALECTS
    from drivers.simulator.machine import SimulatedLathe
    from drivers.simulator.plant.presets import plant_named

    family = DIALECTS[options.dialect or machine.controller.family]
    plant, sd_percent = options.plant or DEFAULT_PLANT, options.clamping_sd or 0.0
    true = plant_named(plant, machine, options.seed, sd_percent, mounted_by_hand=plant in SET_UP_BY_HAND)
    return SimulatedLathe(machine, true, family, Path(options.saved) if options.saved else None)
