"""Targets of files: jobs, machines, plants, lessons, traces, what was learned, recorded and backed up."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import drivers.simulator.plant.presets as presets
from console.flight.recording import read_recording
from console.school.training import lesson
from console.session.data import calibrations, identified_responses, learned_store
from console.session.data.run_reader import RunFilters, runs, story
from console.session.errors import SessionError
from drivers.commissioning.backup import END_OF_HEADER, backup_text, read_backup
from drivers.commissioning.configuration import digest
from drivers.simulator.plant.presets import plant_named
from profiles.compensations.learned_compensation import as_table as learned_table
from profiles.files import parse_toml
from profiles.job import job_from_table
from profiles.machine import machine_from_table
from profiles.problem import ProblemError, ProfileError
from profiles.store import BUNDLED_JOBS, load_machine
from profiles.traces import parse_trace
from tests.fuzz.target import FoundError, Target, Try, pure

MACHINES = BUNDLED_JOBS.parent / "machines"
MACHINE = load_machine("lee-2001-lathe").machine
SAMPLES = Path(__file__).parent.parent / "profiles" / "samples"
POINTS = "\n".join(f"{22.5 * place:g},{0.5 * (place % 3):g}" for place in range(16))
TRACES = (
    f"# direction: cw\n# jaw_1_deg: 0\nangle_deg,deviation_um\n{POINTS}\n".encode(),
    f"x_mm;y_mm\n{POINTS}\n".replace(",", ";").encode(),
    b"aBCR-1.0\nNumPoints = 4\nNumProfiles = 1\nXscale = 1e-3\nYscale = 1\nZscale = 1E-6\nDataType = 7\n"
    b"*\n1\n2\n3\n4\n*\n",
    f"angle_deg\tdeviation_um\n{POINTS}\n".replace(",", "\t").encode("utf-16"),
)


def _of(folder: Path, *patterns: str) -> list[bytes]:
    return [path.read_bytes() for pattern in patterns for path in sorted(folder.glob(pattern))]


def _toml(read: Callable[[Mapping[str, Any]], object]) -> Try:
    return lambda data: read(parse_toml(data, "fuzz"))


@contextmanager
def in_file(name: str, read: Callable[[Path], object]) -> Iterator[Try]:
    """A reader of a file of this name, in memory where the system has such a folder."""
    with TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        path = Path(folder, name)

        def attempt(data: bytes) -> None:
            path.write_bytes(data)
            try:
                read(path)
            finally:
                if path.read_bytes() != data:
                    raise FoundError("reading has changed the file")

        yield attempt


def _plant(path: Path) -> None:
    plant_named(str(path), MACHINE, 1)


def _version(path: Path) -> object:
    return learned_store._load(path)


def _learned() -> list[bytes]:
    from tests.console.test_own_files import LEARNED

    return [_json(learned_table(LEARNED))]


def _json(table: object) -> bytes:
    import json

    return json.dumps(table).encode()


def _identified() -> list[bytes]:
    from drivers.identification.result import as_table
    from tests.console.test_identify_command import RESPONSE

    return [_json(as_table(RESPONSE))]


def _calibrations() -> list[bytes]:
    from dataclasses import asdict

    from tests.console.test_own_files import CALIBRATION

    return [_json(asdict(CALIBRATION))]


def _backups() -> list[bytes]:
    from drivers.commissioning.reading import read_configuration, whole_card
    from drivers.link.memory import MemoryLink
    from drivers.pmac.client import PmacClient
    from drivers.simulator.machine import SimulatedLathe

    card = SimulatedLathe(load_machine("lee-2001-lathe").machine)
    client = PmacClient(MemoryLink(card.connect(), card), card)
    client.connect()
    plain = read_configuration(client, client.dialect, whole_card(client.dialect))
    client.request("DEFINE UBUFFER 20", lines=0)
    whole = read_configuration(client, client.dialect, whole_card(client.dialect, values=True))
    return [backup_text(each, "2001-11-30").encode() for each in (plain, whole)]


def _read_signed_backup(data: bytes) -> None:
    """Read a backup whose hash is that of its lines, so that they are looked at."""
    text = data.decode("utf-8", "replace")
    head, mark, body = text.partition(f"{END_OF_HEADER}\n")
    signed = re.sub(r"; sha256 \S*", f"; sha256 {digest(body.splitlines())}", head, count=1)
    read_backup(f"{signed}{mark}{body}", "fuzz")


def _flights() -> list[bytes]:
    from console.flight.frozen_recordings import frozen_in
    from tests.console.flight.bench import FlightBench

    with TemporaryDirectory() as folder:
        bench = FlightBench(Path(folder))
        bench.runs(2.0)
        bench.alarms()
        bench.runs(6.0)
        return [path.read_bytes() for path in frozen_in(bench.data)]


@contextmanager
def damaged_records() -> Iterator[Try]:
    """A record of two runs with parts of its file changed: what can be read is read, the rest is refused."""
    from tests.console.reported_runs import lobed, recorded

    with TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as folder:
        sound, damaged = Path(folder, "sound"), Path(folder, "damaged")
        for path in (sound, damaged):
            path.mkdir()
        for amplitude_um in (5.0, 2.0):
            recorded(sound, {"after": lobed(amplitude_um)})
        (name,) = (path.name for path in sound.glob("*.sqlite3"))
        content = (sound / name).read_bytes()

        def attempt(data: bytes) -> None:
            shutil.rmtree(damaged)
            damaged.mkdir()
            (damaged / name).write_bytes(_damaged(content, data))
            for found in runs(damaged, RunFilters()):
                story(damaged, found.run_id)

        yield attempt


def _damaged(content: bytes, data: bytes) -> bytes:
    """Take pairs of a place (three bytes) and a length with what stands there instead; an odd first byte cuts."""
    made = bytearray(content)
    for start in range(1, len(data) - 3, 8):
        place = int.from_bytes(data[start : start + 3], "big") % len(made)
        piece = data[start + 3 : start + 8]
        made[place : place + len(piece)] = piece
    if data[:1] and data[0] & 1:
        del made[int.from_bytes(data[1:4], "big") % len(made) :]
    return bytes(made)


def _file(
    name: str, what: str, file: str, read: Callable[[Path], object], seeds: Callable[[], list[bytes]]
) -> Target:
    return Target(name=name, what=what, seeds=seeds, errors=(ProblemError,), opened=partial(in_file, file, read))


OF_FILES = (
    Target(
        name="jobs",
        what="job files",
        seeds=lambda: _of(BUNDLED_JOBS, "*.toml"),
        errors=(ProfileError,),
        opened=pure(_toml(job_from_table)),
    ),
    Target(
        name="machines",
        what="machine files",
        seeds=lambda: _of(MACHINES, "*.toml"),
        errors=(ProfileError,),
        opened=pure(_toml(machine_from_table)),
    ),
    _file("plants", "plant files", "plant.toml", _plant, lambda: _of(presets._FOLDER, "*.toml")),
    _file(
        "lessons",
        "lesson files",
        "mine.toml",
        lambda path: lesson.load_lesson(str(path), path.parent),
        lambda: _of(lesson.FOLDER, "*.toml"),
    ),
    Target(
        name="traces",
        what="traces in all formats",
        seeds=lambda: [*TRACES, *_of(SAMPLES, "*.x3p")],
        errors=(ProfileError,),
        opened=pure(parse_trace),
    ),
    _file("learned", "learned versions", "version-000001.json", _version, _learned),
    _file("identified", "identified responses", "pvt.json", identified_responses.load, _identified),
    _file(
        "calibrations",
        "kept calibrations",
        "wrench.json",
        lambda path: calibrations.load(path, "m", "wrench"),
        _calibrations,
    ),
    Target(
        name="controller-backups",
        what="backups of a controller",
        seeds=_backups,
        errors=(ProfileError,),
        opened=pure(lambda data: read_backup(data.decode("utf-8", "replace"), "fuzz")),
    ),
    Target(
        name="signed-backups",
        what="backups of a controller, with the right hash",
        seeds=_backups,
        errors=(ProfileError,),
        opened=pure(_read_signed_backup),
    ),
    _file("flight", "flight recordings", "frozen.flight", read_recording, _flights),
    Target(
        name="records",
        what="a damaged record (SQLite)",
        seeds=lambda: [bytes(range(64)), b"\1\0\x20\0"],
        errors=(SessionError,),
        opened=damaged_records,
    ),
)
