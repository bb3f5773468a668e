"""Stopping-performance record of a machine: in the data folder, checked before each arm. No record, no arm.

A simulated machine measures its own at once, on a copy of itself in simulated time; it is never written to disk,
so that it cannot be taken for that of a real machine. The file has a checksum: one that was changed or is
damaged is not accepted.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import date
from pathlib import Path
from urllib.parse import quote

from console.session.data.kept_files import delete_file, make_folder, path_exists
from drivers.commissioning.checked_configuration import CheckedConfiguration
from drivers.commissioning.proofs.bench import ProofRig
from drivers.commissioning.stop_record import StopRecord, StopsNow, record_problems, stop_key
from drivers.commissioning.verification import read_of_machine
from drivers.errors import DriverError
from drivers.lathe.stop import StopPath, way_problems
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import Dialect
from profiles.files import printable, read_regular_file, write_atomically
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.strict_values import from_json, read_own

FOLDER = "stops"
SCHEMA = 1

CHECKSUM = "sha256"
UNREADABLE = "stops.unreadable"
CAP_BYTES = 1_000_000

_measured: dict[tuple[str, str], StopRecord] = {}
"""Records that simulated machines have measured since the program started, by family and profile."""


def record_path(data: Path, machine: MachineProfile) -> Path:
    """Return the path of a machine's record, whatever the machine's name."""
    return data / FOLDER / f"{quote(machine.name, safe='')}.json"


def store(data: Path, machine: MachineProfile, record: StopRecord) -> Path:
    """Replace the record; return its path. ProfileError `file.not_writable`."""
    path = record_path(data, machine)
    values = {"schema": SCHEMA, **asdict(record), "measured_at": record.measured_at.isoformat()}
    make_folder(path.parent)
    write_atomically(path, with_checksum(values), overwrite=True, private=True)
    return path


def with_checksum(values: Mapping[str, object]) -> bytes:
    """Return a file of these values with a checksum that detects a change of any character."""
    text = json.dumps({**values, CHECKSUM: ""}, ensure_ascii=False, indent=1) + "\n"
    digest = hashlib.sha256(text.encode()).hexdigest()
    return text.replace(f'"{CHECKSUM}": ""', f'"{CHECKSUM}": "{digest}"').encode()


def withdraw(data: Path, machine: MachineProfile) -> None:
    """Remove the record of a machine that was seen to stop otherwise; ProfileError `file.not_writable`."""
    delete_file(record_path(data, machine))


def load(data: Path, machine: MachineProfile) -> StopRecord | None:
    """Return the record of a machine, None when there is none.

    Raises:
        ProfileError: `stops.unreadable`, not a record; `stops.changed`, not as written;
            `stops.unknown_schema`; `file.unreadable`, it cannot be opened.
    """
    path = record_path(data, machine)
    if not path_exists(path):
        return None
    content = read_regular_file(path, cap_bytes=CAP_BYTES)
    where = printable(str(path))
    try:
        table = from_json(content)
    except ValueError as error:
        raise ProfileError(Problem(code=UNREADABLE, where=where, value=printable(str(error)))) from error
    if isinstance(table, dict) and "schema" in table:
        schema, checksum = table["schema"], str(table.pop(CHECKSUM, ""))
        if type(schema) is not int or schema != SCHEMA:
            code, value, limit = "stops.unknown_schema", printable(str(schema), 60), str(SCHEMA)
            raise ProfileError(Problem(code=code, where=where, key=machine.name, value=value, limit=limit))
        if checksum != hashlib.sha256(content.replace(checksum.encode(), b"")).hexdigest():
            raise ProfileError(Problem(code="stops.changed", where=where, key=machine.name))
    return read_own(StopRecord, table, schema=SCHEMA, code=UNREADABLE, where=where, judge=_judge)


def simulated_record(machine: MachineProfile, dialect: Dialect, now: date) -> StopRecord:
    """Measure a simulated machine as its profile describes it, within a second; a failed test has no entry."""
    # The simulator and the analysis of commissioning tests load numerics, which a real machine does not need.
    from drivers.commissioning.proofs.stopping import MeasuredStops, prove_stops
    from drivers.simulator.machine import SimulatedLathe

    sim = SimulatedLathe(machine, dialect=dialect)
    link = MemoryLink(sim.connect(), sim)
    client = PmacClient(link, sim)
    version, kind = client.connect()
    judged = CheckedConfiguration(configuration=read_of_machine(client, machine, dialect), machine=machine)
    try:
        stops = prove_stops(ProofRig(client=client, stop=StopPath(link), clock=sim, judged=judged))
    except DriverError:
        stops = MeasuredStops()
    return StopRecord(
        machine=machine.name,
        kind=kind,
        version=version,
        key=stop_key(client, machine, dialect),
        measured_at=now,
        address=link.address,
        stop_way=link.stop_way,
        entries=stops.entries,
    )


def stop_record_problems(
    client: PmacClient, machine: MachineProfile, dialect: Dialect, data: Path | None, simulated: bool, today: date
) -> tuple[Problem, ...]:
    """Return why the machine's stopping-performance record forbids arming. `data` is the data folder, None: none.

    The settings that the record was measured with are read from the controller, eleven short lines.
    """
    key, link = stop_key(client, machine, dialect), client.link
    record: StopRecord | None
    try:
        if simulated:
            of = dialect.name, repr(machine)
            if of not in _measured:
                _measured[of] = simulated_record(machine, dialect, today)
            record = _measured[of]
        else:
            record = load(data, machine) if data else None
    except ProfileError as error:
        return tuple(error.problems)
    address = None if simulated else link.address
    now = StopsNow(machine=machine, key=key, today=today, stop_way=link.stop_way, address=address)
    return (*way_problems(now.stop_way), *record_problems(record, now))


def _judge(found: StopRecord) -> None:
    for entry in found.entries:
        if min(value for value in asdict(entry).values() if isinstance(value, float)) < 0.0:
            raise ValueError(f"{entry.way} {entry.origin} {entry.axis} < 0")
