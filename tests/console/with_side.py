"""A floor whose station passes on what worker threads ask."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from drivers.link.passing import TappedLink
from drivers.requests.side_line import Heard, SideLine
from tests.console.floor import Floor

MOST_STEPS = 20_000


def with_side(floor: Floor) -> Floor:
    """Give a station its side line, with all that goes over the link from now on."""
    client: Any = floor.lathe._client
    heard = Heard(floor.sim.now_s)
    heard.poll_line = floor.lathe.poll_line.encode("ascii")
    client.link = client._exchange.link = TappedLink(client.link, heard.tap)
    floor.context.side = SideLine(client, floor.sim, heard, lambda: floor.stop.reason is not None)
    return floor


def served(floor: Floor, work: Callable[[], Any], *, step: bool = True, idle_s: float = 0.05) -> Any:
    """Return what some work in a thread returns or raises, while the station polls."""
    found: list[Any] = []

    def run() -> None:
        try:
            found.append(work())
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    for _ in range(MOST_STEPS):
        if not thread.is_alive():
            break
        if step:
            floor.idle(idle_s)
        time.sleep(0.0005)
    thread.join(5.0)
    assert found, "the work has not ended"
    return found[0]
