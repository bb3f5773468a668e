"""`console mtconnect`: the state of a machine for MTConnect agents, as an adapter that speaks SHDR."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from typing import TYPE_CHECKING

from console.cli.arguments import add_shared, host_port
from console.cli.library import data_of
from console.cli.output import print_json
from console.cli.parser import Parser
from console.session.data.kept_files import make_folder
from console.site.cli.followed_machine import add_rate, changes_of, follow_machine, machine_name, warn_open
from console.text.catalogue import Catalogue

if TYPE_CHECKING:
    from console.site.exchange.adapter import Adapter

LISTEN = "127.0.0.1:7878"  # the port that agents expect an adapter at


def add(parser: Parser, text: Catalogue) -> None:
    """Add the machine, the address, the rate, and whether only to print the description for an agent."""
    add_shared(parser, text, "machine", command="mtconnect")
    add_shared(parser, text, "sim", command="mtconnect")
    listen_help = text("help.mtconnect_listen", default=LISTEN)
    parser.add_argument("--listen", metavar="HOST:PORT", type=host_port, help=listen_help)
    add_rate(parser, text)
    parser.add_argument("--devices", action="store_true", help=text("help.mtconnect_devices"))


def main(options: Namespace, text: Catalogue) -> int:
    """Serve agents until the user ends it; LinkError `link.cannot_listen`."""
    if options.devices:
        return _show_devices(options)
    from console.site.exchange.adapter import Adapter

    data_of(options)  # refuses a folder that this account may not read, before anybody connects
    machine = machine_name(options)
    address = options.listen or host_port(LISTEN)
    adapter = Adapter(address.host, address.port)
    bound = adapter.start()
    warn_open(address.host, bound, text)
    try:
        _tell_address(bound, machine, options, text)
        _serve(adapter, machine, options, text)
    except KeyboardInterrupt:  # the usual way to end it
        pass
    finally:
        adapter.close()
    return 0


def _serve(adapter: Adapter, machine: str, options: Namespace, text: Catalogue) -> None:
    with follow_machine(machine, options, text) as follower:
        for published, _ in changes_of(follower, machine, options, text):
            adapter.show(published)


def _show_devices(options: Namespace) -> int:
    from console.site.exchange.mtconnect import devices_xml
    from console.site.shop.identity import lathe_identity

    data, machine = data_of(options), machine_name(options)
    make_folder(data)
    document = devices_xml(machine, options.sim, lathe_identity(data).lathe_id)
    if options.json:
        print_json({"devices": document})
    else:
        print(document)
    return 0


def _tell_address(bound: str, machine: str, options: Namespace, text: Catalogue) -> None:
    if options.json:  # a line each: the reader cannot wait for the end of the output
        print(json.dumps({"schema": 1, "listening": bound, "machine": machine, "simulated": bool(options.sim)}))
    else:
        sim = f"{text('sim')}  " if options.sim else ""
        print(f"{sim}{machine}  {text('mtconnect.listening', address=bound)}")
    sys.stdout.flush()
