"""Data folders of lathes for tests of the shop: real records, and many of them without cutting each."""

from __future__ import annotations

import json
import shutil
import sqlite3
import uuid
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from console.session.data.record_file import FILE_NAME
from console.site.shop.identity import lathe_identity
from console.site.shop.outbox import SENT
from tests.console.test_run_reader import RUN, part
from tests.site.shop_server import ShopServer

Rows = list[tuple[Any, ...]]


def record_runs(folder: Path, count: int, **changes: Any) -> None:
    """Record runs as a console does: texts, events, commands, telemetry, a measured part with its trace."""
    import numpy as np

    from console.session.data.records import RunRecord

    for place in range(count):
        run = RunRecord(folder, {**RUN, "job_text_sha256": f"job {place % 3}\n", "simulated": 0, **changes})
        run.add("started", {"text": "로브 ± µm \\ \t \"'", "place": place})
        run.log.begin_cut("", lambda polls: np.full((len(polls), 7), np.nan))
        run.log.poll((0.0,))
        run.log.event("alarm_raised", {"code": "cut.out_of_phase", "priority": "high", "value": "1\n2\\."})
        run.log.end_cut()
        run.add("measured", {}, part(2.0 + place % 5, lobe_um_pp=1.5, diameter_mm=51.8))
        run.add("cut", {"turn": 90.0})
        run.close()


def multiply(folder: Path, count: int) -> None:
    """Add copies of the first run, under ids of their own, straight into the file."""
    with closing(sqlite3.connect(folder / FILE_NAME, isolation_level=None)) as database:
        (first,) = database.execute("SELECT run_id FROM runs ORDER BY rowid LIMIT 1").fetchone()
        database.execute("BEGIN")
        for place in range(count):
            # The same in each folder that is a copy of another.
            run_id = uuid.uuid5(uuid.NAMESPACE_OID, f"{first} {place}").hex
            for table in SENT[1:]:
                others = ", ".join(table.columns[1:])
                database.execute(
                    f"INSERT INTO {table.name} (run_id, {others}) SELECT ?, {others} FROM {table.name}"
                    " WHERE run_id = ? ORDER BY rowid",
                    (run_id, first),
                )
        database.execute("COMMIT")


def copied_lathes(folder: Path, root: Path, names: Sequence[str]) -> list[Path]:
    """Copies of a data folder, with the same runs, each of a lathe of its own."""
    found = []
    for name in names:
        made = root / name
        shutil.copytree(folder, made)
        (made / "lathe.json").unlink(missing_ok=True)
        lathe_identity(made)
        path = made / "lathe.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), "name": name}))
        found.append(made)
    return found


def rows_here(folder: Path) -> dict[str, Rows]:
    """All rows at a lathe, in their order."""
    with closing(sqlite3.connect(folder / FILE_NAME)) as database:
        return {
            table.name: database.execute(
                f"SELECT rowid, {', '.join(table.columns)} FROM {table.name} ORDER BY rowid"
            ).fetchall()
            for table in SENT
        }


def rows_in_shop(server: ShopServer, folder: Path, database: str = "shop") -> dict[str, Rows]:
    """All rows of a lathe in the shop, in their order; of the texts those that it refers to, by their hash."""
    lathe = lathe_identity(folder).lathe_id
    found = {}
    for table in SENT[1:]:
        columns = ", ".join(table.columns)
        line = (
            f"SELECT source_row, {columns} FROM shop.{table.name} WHERE lathe_id = '{lathe}' ORDER BY source_row"
        )
        found[table.name] = server.sql(line, database=database)
    found["texts"] = server.sql("SELECT sha256, content FROM shop.texts ORDER BY sha256", database=database)
    return found


def assert_all_there(server: ShopServer, folder: Path, database: str = "shop") -> None:
    """Every row of a lathe is in the shop once, in its order, without a gap, with every value."""
    here, there = rows_here(folder), rows_in_shop(server, folder, database)
    texts = sorted(row[1:] for row in here.pop("texts"))
    assert [row for row in there.pop("texts") if row in texts] == texts
    for name, rows in here.items():
        assert [row[0] for row in there[name]] == list(range(1, len(rows) + 1)), name
        assert there[name] == rows, name
