"""`console simulator`: the simulated machine as a server with a PMAC interface."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path

from console.cli.arguments import (
    DEFAULT_PLANT,
    PLANT,
    WRONG_USAGE,
    add_shared,
    control_address,
    host_port,
    number_or_nan,
    number_parser_within,
)
from console.cli.library import profile_of
from console.cli.output import SCHEMA
from console.cli.parser import Parser
from console.session.ending_signal import has_come
from console.text.catalogue import Catalogue

DIALECTS = ("pmac", "turbo")
SLOWEST, FASTEST = 0.01, 100.0
"""Times real time."""

WITHOUT_CHANCE = (DEFAULT_PLANT, "paper")
SET_UP_BY_HAND = ("mounted", "steady", "easy", "realistic", "hard")
"""Plants whose chuck is at any angle and must be aligned; the others, and files, are as specified."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the address to listen on, the machine, its actual plant, and its time scale."""
    parser.add_argument("--tcp", metavar="HOST:PORT", type=host_port, help=text("help.tcp"))
    parser.add_argument("--ethernet", metavar="HOST:PORT", type=host_port, help=text("help.ethernet"))
    parser.add_argument("--pty", action="store_true", help=text("help.pty"))
    parser.add_argument("--control", metavar="ADDRESS", type=control_address, help=text("help.control"))
    add_shared(parser, text, "machine")
    parser.add_argument("--dialect", choices=DIALECTS, help=text("help.dialect"))
    add_shared(parser, text, *PLANT)
    parser.add_argument("--saved", metavar="FILE", help=text("help.saved"))
    speed = number_parser_within(number_or_nan, SLOWEST, FASTEST, "usage.speed", f"{SLOWEST:g} - {FASTEST:g}")
    parser.add_argument("--speed", metavar="X", type=speed, default=1.0, help=text("help.speed"))


def main(options: Namespace, text: Catalogue) -> int:
    """Serve until a signal ends it."""
    if not (options.tcp or options.ethernet or options.pty):
        print(f"console simulator: {text('usage.no_listener')}", file=sys.stderr)
        return WRONG_USAGE
    if options.seed is not None and options.plant in (None, *WITHOUT_CHANCE) and not options.clamping_sd:
        print(f"console simulator: {text('usage.seed_without_chance')}", file=sys.stderr)
        return WRONG_USAGE
    from drivers.pmac.dialect import DIALECTS as FAMILIES
    from drivers.simulator.hosts.server import Listeners, serve
    from drivers.simulator.machine import SimulatedLathe
    from drivers.simulator.plant.presets import plant_named

    machine = profile_of(options).machine

    def ready(address: str) -> None:
        if options.json:
            # A line each: the reader cannot wait for the end of the output.
            told = {"schema": SCHEMA, "listening": address, "machine": machine.name, "simulated": True}
            print(json.dumps(told))
        else:
            print(text("simulator.ready", machine=machine.name, address=address))
        sys.stdout.flush()

    plant, sd_percent = options.plant or DEFAULT_PLANT, options.clamping_sd
    true = plant_named(plant, machine, options.seed, sd_percent, mounted_by_hand=plant in SET_UP_BY_HAND)
    family = FAMILIES[options.dialect or machine.controller.family]
    lathe = SimulatedLathe(machine, true, family, Path(options.saved) if options.saved else None)
    listeners = Listeners(tcp=options.tcp, ethernet=options.ethernet, pty=options.pty, control=options.control)
    if (ended_by := serve(lathe, listeners, ready, options.speed)) is not None:
        has_come(ended_by)  # the loop handles signals in its own way
    return 0
