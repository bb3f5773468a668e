"""Commissioning checks before each arm: who writes to the machine, how it stops, and how people are guarded."""

from __future__ import annotations

from datetime import date
from pathlib import Path

from console.session.data.stop_records import stop_record_problems
from drivers.commissioning.fingerprint import Fingerprint, fingerprint_problems, ours, read_fingerprint
from drivers.lathe.heartbeat import Heartbeat
from drivers.lathe.safety import safety_problems
from drivers.lathe.snapshot import Snapshot
from drivers.pmac.client import PmacClient
from profiles.machine import MachineProfile
from profiles.problem import Problem


class Commissioned:
    """One machine on one connection. `data` is the folder with the stopping-performance records."""

    def __init__(
        self, client: PmacClient, heartbeat: Heartbeat, machine: MachineProfile, data: Path, *, simulated: bool
    ) -> None:
        self._heartbeat = heartbeat
        self._client, self._machine, self._data, self._simulated = client, machine, data, simulated
        self._fingerprint: Fingerprint | None = None

    def take_fingerprint(self) -> None:
        """Read the controller's settings once; changes by somebody else from then on are reported before each arm.

        A change is accepted by connecting again, not by reading it again.

        Raises:
            DriverError: the link broke, or the controller sent an unexpected reply.
        """
        if self._fingerprint is None:
            self._fingerprint = read_fingerprint(self._client, self._machine, self._client.dialect)

    def problems(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Return every reason why this machine may not be armed; `snapshot` is of now.

        Raises:
            DriverError: the link broke, or the controller sent an unexpected reply.
        """
        guards = safety_problems(self._machine, snapshot.inputs)
        return (*guards, *self._heartbeat.problems(), *self._strange(), *self._unmeasured())

    def _strange(self) -> tuple[Problem, ...]:
        before, dialect = self._fingerprint, self._client.dialect
        if before is None:
            return (Problem(code="alignment.not_verified"),)
        now = read_fingerprint(self._client, self._machine, dialect, before)
        return fingerprint_problems(before, now, ours(self._machine, dialect))

    def _unmeasured(self) -> tuple[Problem, ...]:
        today = date.today()
        return stop_record_problems(
            self._client, self._machine, self._client.dialect, self._data, self._simulated, today
        )
