"""`console simulator`: the simulated machine as a server that speaks like a PMAC."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import TYPE_CHECKING

from console.cli.library import machine_of
from console.cli.output import print_json
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from drivers.link.address import TcpAddress


def main(options: Namespace, text: Catalogue) -> int:
    """Serve until a signal ends it."""
    from drivers.simulator.machine import SimulatedLathe
    from drivers.simulator.server import serve

    machine = machine_of(options).machine

    def ready(bound: TcpAddress) -> None:
        if options.json:
            print_json({"listening": str(bound), "machine": machine.name, "simulated": True})
        else:
            print(text("simulator.ready", machine=machine.name, address=bound))
        sys.stdout.flush()

    serve(SimulatedLathe(machine), options.tcp, ready)
    return 0
