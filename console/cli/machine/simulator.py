"""`console simulator`: the simulated machine as a server with a PMAC interface."""

from __future__ import annotations

import json
import sys
from argparse import ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from console.cli.arguments import DEFAULT_PLANT, add_machine, add_plant, control_address
from console.cli.library import profile_of
from console.cli.parser import Parser
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from drivers.link.address import TcpAddress
    from drivers.simulator.machine import SimulatedLathe
    from profiles.machine import MachineProfile

WRONG_USAGE = 2
DIALECTS = ("pmac", "turbo")
SLOWEST, FASTEST = 0.01, 100.0
"""Times real time."""

WITHOUT_CHANCE = (DEFAULT_PLANT, "paper")
SET_UP_BY_HAND = ("mounted", "realistic")
"""Plants whose chuck is at any angle and must be aligned; the others, and files, are as specified."""


def add(parser: Parser, text: Catalogue) -> None:
    """Add the address to listen on, the machine, its actual plant, and its time scale."""
    parser.add_argument("--tcp", metavar="HOST:PORT", type=_host_port, help=text("help.tcp"))
    parser.add_argument("--ethernet", metavar="HOST:PORT", type=_host_port, help=text("help.ethernet"))
    parser.add_argument("--pty", action="store_true", help=text("help.pty"))
    parser.add_argument("--control", metavar="ADDRESS", type=control_address, help=text("help.control"))
    add_machine(parser, text)
    parser.add_argument("--dialect", choices=DIALECTS, help=text("help.dialect"))
    add_plant(parser, text)
    parser.add_argument("--saved", metavar="FILE", help=text("help.saved"))
    parser.add_argument("--speed", metavar="X", type=_speed, default=1.0, help=text("help.speed"))


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
            # A line each: the reader cannot wait for the end of the output.
            print(json.dumps({"listening": address, "machine": machine.name, "simulated": True}))
        else:
            print(text("simulator.ready", machine=machine.name, address=address))
        sys.stdout.flush()

    listeners = Listeners(tcp=options.tcp, ethernet=options.ethernet, pty=options.pty, control=options.control)
    serve(_lathe(machine, options), listeners, ready, options.speed)
    return 0


def _lathe(machine: MachineProfile, options: Namespace) -> SimulatedLathe:
    """Return the machine with the controller of its profile, or with the requested one."""
    from drivers.pmac.dialect import DIALECTS
    from drivers.simulator.machine import SimulatedLathe
    from drivers.simulator.plant.presets import plant_named

    family = DIALECTS[options.dialect or machine.controller.family]
    plant, sd_percent = options.plant or DEFAULT_PLANT, options.clamping_sd or 0.0
    true = plant_named(plant, machine, options.seed, sd_percent, mounted_by_hand=plant in SET_UP_BY_HAND)
    return SimulatedLathe(machine, true, family, Path(options.saved) if options.saved else None)


def _host_port(word: str) -> TcpAddress:
    from drivers.link.address import parse_host_port
    from profiles.problem import ProblemError

    try:
        return parse_host_port(word)
    except ProblemError as error:
        raise ArgumentTypeError(Parser.text.problem(error.problems[0])) from error


def _speed(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = 0.0
    if not SLOWEST <= value <= FASTEST:
        limit = f"{SLOWEST:g} - {FASTEST:g}"
        raise ArgumentTypeError(Parser.text("usage.speed", value=word, limit=limit))
    return value
