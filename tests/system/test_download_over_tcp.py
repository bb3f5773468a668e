"""Programs of a file, sent to a served controller over a real socket, and listed again."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from drivers.clock import RealClock
from drivers.commissioning.downloading import differing, planned, send
from drivers.link.address import TcpAddress
from drivers.link.opening import TcpLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_text import read_program

if TYPE_CHECKING:
    from tests.system.conftest import Serve

pytestmark = pytest.mark.system

TEXT = "OPEN PROG 51 CLEAR\ninc x 5\ndwe 20\nCLOSE\nOPEN PLC 5 CLEAR\nP51 = 2\nCLOSE\n"


@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_a_program_and_a_plc_arrive_over_a_socket(serve: Serve, family: str) -> None:
    buffers = read_program(TEXT).source.buffers
    with serve("--tcp", "127.0.0.1:0", "--dialect", family) as served:
        host, port = served.tcp
        with closing(TcpLink(TcpAddress(host=host, port=port))) as link:
            client = PmacClient(link, RealClock())
            client.connect()
            changes = planned(client, client.dialect, buffers)
            send(client, client.dialect, changes, "text", lambda sent, of: None)
            assert differing(client, changes) == []
            assert [line.strip() for line in client.question("LIST PROG51")] == ["INCX5", "DWE20", "RET"]
            assert [line.strip() for line in client.question("LIST PLC5")] == ["P51=2", "RET"]
