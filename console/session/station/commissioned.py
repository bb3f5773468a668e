"""What has to hold of a machine before each arm: who writes to it, how it stops, and who is guarded from it."""

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
    """One machine behind one connection. `data` is the folder with the stop records."""

    def __init__(
        self, client: PmacClient, heartbeat: Heartbeat, machine: MachineProfile, data: Path, *, simulated: bool
    ) -> None:
        self._heartbeat = heartbeat
        self._client, self._machine, self._data, self._simulated = client, machine, data, simulated
        self._fingerprint: Fingerprint | None = None

    def take_fingerprint(self) -> None:
        """Read what the card is set to, once; what somebody else changes from then on is told before each arm.

        What was changed is accepted by connecting again, not by another look.

        Raises:
            DriverError: the link broke, or the card does not answer what was asked for.
        """
        if self._fingerprint is None:
            self._fingerprint = read_fingerprint(self._client, self._machine, self._client.dialect)

    def problems(self, snapshot: Snapshot) -> tuple[Problem, ...]:
        """Return every reason why this machine may not be armed; `snapshot` is of now.

        Raises:
            DriverError: the link broke, or the card does not answer what was asked for.
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
