"""The outbox of a lathe: what is on its disk, in the order in which it was written; read, and never changed."""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from console.session.data.record_file import FILE_NAME
from console.session.errors import SessionError
from console.site.shop.outbox import outbox
from console.site.shop.tables import RUNS, SENT
from tests.console.test_run_reader import record


def test_only_rows_that_are_on_the_disk_are_sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is recorded while the journal is brought to the disk may not be there yet: it has to wait."""
    first = record(tmp_path, 2.0)
    synchronised: list[str] = []

    def fsync(descriptor: int) -> None:
        synchronised.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")).name)
        monkeypatch.undo()
        record(tmp_path, 3.0)

    with closing(sqlite3.connect(tmp_path / FILE_NAME)):  # somebody has it open: the journal stays
        journal = tmp_path / f"{FILE_NAME}-wal"
        journal.touch()
        monkeypatch.setattr("console.site.shop.outbox.os.fsync", fsync)
        with outbox(tmp_path) as box:
            assert box is not None and synchronised == [journal.name]
            assert [row[1] for row in box.rows(RUNS, 0, 10)] == [first]
            assert box.file_id == first
    with outbox(tmp_path) as box:
        assert box is not None and len(list(box.rows(RUNS, 0, 10))) == 2 and box.file_id == first
        assert list(box.rows(RUNS, 1, 1)) == list(box.rows(RUNS, 1, 10))


def test_every_column_of_every_table_is_sent(tmp_path: Path) -> None:
    record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        (names,) = zip(*database.execute("SELECT name FROM sqlite_schema WHERE type = 'table'"), strict=True)
        assert sorted(names) == sorted(table.name for table in SENT)
        for table in SENT:
            columns = tuple(row[1] for row in database.execute(f"PRAGMA table_info({table.name})"))
            assert sorted(table.columns) == sorted(columns)
        for number, table in enumerate(SENT):
            refers_to = {row[2] for row in database.execute(f"PRAGMA foreign_key_list({table.name})")}
            assert refers_to <= {other.name for other in SENT[:number]}, "sent before what it refers to"


def test_what_has_no_records_yet_or_those_of_another_console(tmp_path: Path) -> None:
    with outbox(tmp_path) as box:
        assert box is None
    (tmp_path / FILE_NAME).touch()
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.empty"
    (tmp_path / FILE_NAME).unlink()
    record(tmp_path, 2.0)
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as database:
        database.execute("PRAGMA user_version = 99")
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.other_schema"
    (tmp_path / FILE_NAME).write_bytes(b"no database at all" * 1000)
    with pytest.raises(SessionError) as refused, outbox(tmp_path):
        pass
    assert refused.value.problems[0].code == "record.damaged"
