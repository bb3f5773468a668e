"""Consoles that are killed while they record, and many at once: what is acknowledged is in the file."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import struct
import time
import warnings
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from console.session.data import run_log
from console.session.data.record_file import FILE_NAME
from console.session.data.records import RunRecord
from console.session.data.run_reader import runs, story

pytestmark = pytest.mark.long

KILLS, AT_ONCE, LONGEST_S = 200, 20, 0.15
CONSOLES, EVENTS = 50, 5
RUN = {
    **dict.fromkeys(("software", "job_sha256", "machine_sha256", "strategy", "program"), ""),
    "job": "ring",
    "machine": "lathe",
    "simulated": 1,
    "python": "3",
}
ACKNOWLEDGED = struct.Struct("<16sid")
"""The run, how many events are on disk, and how many polls were given by now, with the time of the last."""


def forked(act: Callable[[], None]) -> int:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if not child:
        try:
            act()
        finally:
            os._exit(0)
    return child


def rows(polls: object) -> np.ndarray:
    return np.array(polls, dtype=np.float64)


def record_until_killed(data: Path, acknowledge: int, period_s: float) -> None:
    """Record events and polls as fast as it goes; say what is done."""
    run_log.PERIOD_S = period_s
    record = RunRecord(data, RUN, open_timeout_s=60.0, timeout_s=60.0)
    record.log.begin_cut("", rows)
    for number in range(1_000_000):
        record.log.poll((float(number), *(0.0,) * 6))
        if number % 4 == 0:
            record.add("step", {"number": number // 4})
        run = bytes.fromhex(record.run_id)
        os.write(acknowledge, ACKNOWLEDGED.pack(run, number, time.monotonic()))
        time.sleep(0.001)


def writer(data: Path, period_s: float) -> tuple[int, int]:
    """Start a writer; return its process, and the pipe on which it says what is done."""
    ours, theirs = os.pipe()
    child = forked(lambda: record_until_killed(data, theirs, period_s))
    os.close(theirs)
    return child, ours


def kill(child: int) -> float:
    os.kill(child, signal.SIGKILL)
    at_s = time.monotonic()
    os.waitpid(child, 0)
    return at_s


def all_of(pipe: int) -> bytes:
    with open(pipe, "rb") as stream:
        return stream.read()


def check_whole(data: Path) -> None:
    with closing(sqlite3.connect(data / FILE_NAME)) as database:
        assert database.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


def test_after_200_kills_at_any_moment_the_file_is_whole_and_has_what_was_acknowledged(tmp_path: Path) -> None:
    RunRecord(tmp_path, RUN).close()
    random.seed(1)
    begun = 0
    for _ in range(KILLS // AT_ONCE):
        writers = [(random.uniform(0.0, LONGEST_S), writer(tmp_path, 0.01)) for _ in range(AT_ONCE)]
        begun_s = time.monotonic()
        for after_s, (child, _) in sorted(writers):
            time.sleep(max(0.0, begun_s + after_s - time.monotonic()))
            kill(child)
        for said in [all_of(pipe) for _, (_, pipe) in writers]:
            if not said:
                continue
            begun += 1
            run, number, _ = [*ACKNOWLEDGED.iter_unpack(said)][-1]
            told = story(tmp_path, run.hex())
            steps = [event.data["number"] for event in told.events]
            assert steps[: number // 4 + 1] == [*range(number // 4 + 1)] and len(steps) <= number // 4 + 2
            for telemetry in told.telemetry:  # all up to some poll, none of it twice
                assert telemetry.column("time_s").tolist() == [*range(len(telemetry.rows))]
            assert told.complete is not True and told.damaged == ()
        check_whole(tmp_path)
    assert begun > KILLS // 4
    assert len(runs(tmp_path, limit=1000)) >= begun + 1


def test_a_kill_loses_at_most_the_last_second_of_telemetry(tmp_path: Path) -> None:
    RunRecord(tmp_path, RUN).close()
    random.seed(2)
    writers = [writer(tmp_path, run_log.PERIOD_S) for _ in range(3)]
    begun = [os.read(pipe, ACKNOWLEDGED.size) for _, pipe in writers]  # each has begun
    for (child, pipe), first in zip(writers, begun, strict=True):
        time.sleep(random.uniform(1.05, 1.3) if child == writers[0][0] else random.uniform(0.0, 0.2))
        killed_s = kill(child)
        given = [*ACKNOWLEDGED.iter_unpack(first + all_of(pipe))]
        due = [number for _, number, at_s in given if at_s < killed_s - 1.0]
        (telemetry,) = story(tmp_path, given[0][0].hex()).telemetry
        assert due and telemetry.column("time_s")[-1] >= due[-1]


def test_of_fifty_consoles_at_one_file_no_event_is_lost(tmp_path: Path) -> None:
    def console() -> None:
        record = RunRecord(tmp_path, RUN, open_timeout_s=60.0, timeout_s=60.0)
        record.log.begin_cut("", rows)
        for number in range(EVENTS):
            record.add("step", {"number": number})
            record.log.event("command", {"number": number})
            record.log.poll((float(number), *(0.0,) * 6))
        record.log.end_cut()
        record.close()

    for child in [forked(console) for _ in range(CONSOLES)]:
        assert os.waitpid(child, 0)[1] == 0
    check_whole(tmp_path)
    listed = runs(tmp_path, limit=100)
    assert len(listed) == CONSOLES
    for row in listed:
        told = story(tmp_path, row.run_id)
        for kind in ("step", "command"):
            assert [e.data["number"] for e in told.events if e.kind == kind] == [*range(EVENTS)]
        assert told.complete


@pytest.mark.parametrize("waiting", [0, 3])
def test_a_full_queue_loses_what_does_not_fit_and_says_so(tmp_path: Path, waiting: int) -> None:
    record = RunRecord(tmp_path, RUN)
    record.log = run_log.RunLog(tmp_path, record.run_id, most_waiting=waiting)
    for number in range(5):
        record.log.event("command", {"number": number})
    record.close()
    problem = record.log.problem
    assert problem is not None and (problem.code, problem.limit) == ("record.incomplete", str(5 - waiting))
    assert len(story(tmp_path, record.run_id).events) == waiting
