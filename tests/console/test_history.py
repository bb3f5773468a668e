"""The list of jobs knows what their last parts were like, and is never held up by the record."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from console.session.data.history import last_results
from console.session.data.record_file import FILE_NAME
from console.session.data.records import RunRecord


def run(folder: Path, *measured: dict[str, object], simulated: bool = True) -> None:
    record = RunRecord(
        folder,
        {
            "software": "test",
            "job": "",
            "job_sha256": "",
            "machine": "",
            "machine_sha256": "",
            "simulated": int(simulated),
            "strategy": "pvt",
            "program": "",
        },
    )
    record.add("started", {"job": "ring", "ront_um": 99.0})
    for data in measured:
        record.add("measured", data)
    record.close()


def test_the_last_measured_part_is_the_one_that_is_told(tmp_path: Path) -> None:
    run(tmp_path, {"job": "ring", "ront_um": 55.0, "strategy": "none"}, {"job": "bar", "ront_um": 1.5})
    run(tmp_path, {"job": "ring", "ront_um": 2.6, "strategy": "pvt"})
    results = last_results(tmp_path, simulated=True)
    assert sorted(results) == ["bar", "ring"]
    ring = results["ring"]
    assert (ring.ront_um, ring.strategy, ring.parts) == (2.6, "pvt", 2)
    assert ring.measured_at.tzinfo is not None


def test_a_simulated_part_is_not_shown_as_a_real_one(tmp_path: Path) -> None:
    run(tmp_path, {"job": "ring", "ront_um": 2.6})
    run(tmp_path, {"job": "ring", "ront_um": 7.0}, simulated=False)
    assert last_results(tmp_path, simulated=False)["ring"].ront_um == 7.0
    assert last_results(tmp_path, simulated=True)["ring"].ront_um == 2.6


def test_without_a_record_nothing_is_known_and_nothing_is_made(tmp_path: Path) -> None:
    assert last_results(tmp_path / "new", simulated=True) == {}
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("content", [b"", b"no database" * 500])
def test_a_broken_record_says_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / FILE_NAME).write_bytes(content)
    assert last_results(tmp_path, simulated=True) == {}


def test_a_locked_record_says_nothing(tmp_path: Path) -> None:
    run(tmp_path, {"job": "ring", "ront_um": 2.6})
    writer = sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)
    writer.execute("PRAGMA journal_mode=DELETE")
    writer.execute("BEGIN EXCLUSIVE")
    assert last_results(tmp_path, simulated=True) == {}
    writer.execute("ROLLBACK")
    assert "ring" in last_results(tmp_path, simulated=True)
    writer.close()


def test_what_another_version_wrote_is_passed_over(tmp_path: Path) -> None:
    strange: list[dict[str, object]] = [{"job": "ring", "ront_um": value} for value in ("much", "9.9", True)]
    run(tmp_path, {"job": "ring", "ront_um": 2.6}, {"job": "ring"}, *strange)
    assert last_results(tmp_path, simulated=True)["ring"].ront_um == 2.6
