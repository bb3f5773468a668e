"""A controller behind the pages that ask it: simulated, and asked at once by whichever thread asks."""

from __future__ import annotations

import threading
from collections.abc import Callable

from drivers.link.memory import MemoryLink
from drivers.link.passing import TappedLink
from drivers.pmac.client import PmacClient
from drivers.requests.side_line import CancelledError, Lines, LineTraffic, RequestConditions, SideLine, SideRequest
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile


class DirectSide(SideLine):
    """Serves each request in the thread that asks it, as at rest; `moment` may be replaced."""

    def __init__(self, machine: MachineProfile) -> None:
        self.sim = SimulatedLathe(machine)
        plain = MemoryLink(self.sim.connect(), self.sim)
        heard = LineTraffic(self.sim.now_s)
        self.client = PmacClient(TappedLink(plain, heard.tap), self.sim)
        super().__init__(self.client, self.sim, heard)
        self.client.connect()
        self.moment = RequestConditions(at_rest=True, controls=True)
        self._one = threading.Lock()

    def ask(self, asked: SideRequest, cancelled: Callable[[], bool] = lambda: False) -> Lines:
        """Ask at once."""
        if cancelled():
            raise CancelledError
        with self._one:
            self._waiting.put(asked)
            self.serve(self.moment)
        answer = asked.answer.get(timeout=10.0)
        if isinstance(answer, BaseException):
            raise answer
        return answer
