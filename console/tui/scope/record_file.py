"""Records of the scope on disk: a CSV with SI units in its head, kept in the data folder and opened again."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from console.session.data.kept_files import folder_name, make_folder, names_in
from drivers.beside.scope_gather import Record
from drivers.beside.scope_setup import Channel, Trigger, channel_of
from profiles.arrays import Floats
from profiles.files import printable, read_regular_file, write_atomically
from profiles.own_values import DAMAGED_AT
from profiles.problem import Problem, ProfileError

FOLDER = "scope"
TITLE = "# trilobe scope 1"
CAP_BYTES = 50_000_000
_KEYS = ("machine", "taken", "trigger")
_TIME = "time [s]"


def keep_record(data: Path, record: Record) -> Path:
    """Write a record into the data folder; return the file. Raises ProfileError: as `write_atomically`."""
    folder = data / FOLDER
    make_folder(folder)
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    path = folder / f"{folder_name(record.machine)}-{stamp}Z.csv"
    write_atomically(path, record_text(record).encode("utf-8"), overwrite=False, private=True)
    return path


def record_text(record: Record) -> str:
    """Return a record as CSV: times in s from the trigger, channels in m, rad, m/s, rad/s."""
    head = [TITLE, *(f"# {key}: {printable(str(getattr(record, key)))}" for key in _KEYS)]
    head.append(",".join([_TIME, *(f"{channel.key} [{channel.si_unit}]" for channel in record.values)]))
    columns = np.column_stack([record.times_s, *record.values.values()])
    rows = (",".join(f"{value:.12g}" for value in row) for row in columns.tolist())
    return "\n".join([*head, *rows]) + "\n"


def read_record(path: Path) -> Record:
    """Return a kept record. Raises ProfileError: `scope.unreadable`, or as `read_regular_file`."""
    where = printable(str(path))
    try:
        text = read_regular_file(path, cap_bytes=CAP_BYTES).decode("utf-8")
        lines = text.splitlines()
        if len(lines) < 5 or lines[0] != TITLE:
            raise ValueError(lines[0] if lines else f"{DAMAGED_AT}: 1")
        facts = dict(line.removeprefix("# ").split(": ", 1) for line in lines[1:4])
        if not text.endswith("\n"):  # its last number may be half of one
            raise ValueError(f"{DAMAGED_AT}: {len(lines)}")
        channels = [_channel(each) for each in lines[4].split(",")[1:]]
        rows = _numbers(lines[5:], len(channels) + 1)
        return Record(
            machine=facts["machine"],
            taken=facts["taken"],
            trigger=Trigger(facts["trigger"]),
            times_s=rows[:, 0],
            values={channel: rows[:, place] for place, channel in enumerate(channels, start=1)},
        )
    except (ValueError, IndexError, KeyError) as error:
        problem = Problem(code="scope.unreadable", where=where, value=printable(str(error), 60))
        raise ProfileError(problem) from error


def _numbers(lines: list[str], columns: int) -> Floats:
    """Return the samples, a row for each. Raises ValueError: the number of the first line that is none."""
    found = []
    for number, each in enumerate(lines, start=6):
        try:
            row = [float(value) for value in each.split(",")]
        except ValueError:
            row = []
        if len(row) != columns or not np.isfinite(row).all():
            raise ValueError(f"{DAMAGED_AT}: {number}")
        found.append(row)
    if len(found) < 2:
        raise ValueError(f"{DAMAGED_AT}: {len(lines) + 6}")
    return np.array(found, dtype=np.float64)


def records_of(data: Path) -> tuple[Path, ...]:
    """Return the kept records, newest first by the times in their names; ProfileError `file.unreadable`."""
    return tuple(
        sorted(names_in(data / FOLDER, ".csv"), key=lambda path: path.stem.rpartition("-")[2], reverse=True)
    )


def _channel(head: str) -> Channel:
    name, _, unit = head.partition(" ")
    channel = channel_of(name)
    if unit != f"[{channel.si_unit}]":
        raise ValueError(head)
    return channel
