"""How fast the records of lathes reach the database of a shop, beside what thirty lathes record.

python -m benchmarks.ship

A PostgreSQL server of its own, with its usual settings (each transaction is on the disk), on a Unix socket.
The lathe's backlog is copies of a run of a minute: 40 polls a second in blocks of 0.4 s, events, a measured
part with its trace.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.measure import extent, print_table, seconds
from benchmarks.records import a_part, begun
from console.session.data.run_log import PERIOD_S
from console.session.data.run_reader import runs
from console.site.shop.identity import lathe_identity
from console.site.shop.reading import ShopQuery, shop_folder
from console.site.shop.shipping import ship
from tests.site.shop_server import SHIPPER, ShopServer, programs, shop_server
from tests.system.site.lathe_records import assert_all_there, multiply, rows_here

LATHES = 30
RUNS = extent(8400, 60)
"""A month of two shifts, with a run every 2.5 minutes."""

CUT_S, POLL_S = 60.0, 0.023


def one_run(folder: Path) -> None:
    """Record the run that the others are copies of, as a cut of a minute does."""
    machine = "x" * 6000
    blocks = round(CUT_S / PERIOD_S)
    polls = np.random.default_rng(1).normal(size=(round(PERIOD_S / POLL_S), 7))
    run = begun(folder, program="X1 Y2 Z3\n" * 270, machine_text_sha256=machine, job_text_sha256="y" * 2000)
    for kind in ("armed", "planned", "started", "step", "step"):
        run.add(kind, {"force_n": 1314.0})
    for _ in range(blocks):
        run.log.add_window("", polls)
    for command in ("Arm", "Start", "Measure"):
        run.log.event("command", {"command": command, "by": "operator"})
    run.add("cut", {"turn": 1000.0})
    run.add("measured", {"ront_um": 1.0}, a_part(1))
    run.close()


def _listed(server: ShopServer) -> None:
    with shop_folder(server.dsn(), ShopQuery(limit=20, whole=False)) as found:
        assert len(runs(found.path, limit=20)) == 20


def main() -> int:
    """Send a backlog; print the rate and what thirty lathes that cut without a pause need."""
    if programs() is None:
        print("no PostgreSQL server is installed (Debian: apt-get install postgresql)")
        return 0
    with tempfile.TemporaryDirectory() as made, shop_server(fsync=True) as server:
        folder = Path(made)
        one_run(folder)
        rows_of_one = sum(len(rows) for rows in rows_here(folder).values())
        multiply(folder, RUNS - 1)
        size = (folder / "records.sqlite3").stat().st_size
        server.new_shop()
        began = time.perf_counter()
        sent = ship(folder, server.dsn(SHIPPER))
        took_s = time.perf_counter() - began
        if RUNS < 1000:
            assert_all_there(server, folder)
        ((in_shop,),) = server.sql("SELECT pg_database_size('shop')")
        server.sql("ANALYZE")
        listed = seconds(lambda: _listed(server))
        charted = seconds(lambda: server.sql("SELECT * FROM shop.run_chart"))
        judged = seconds(lambda: server.sql("SELECT * FROM shop.roundness_capability"))
        assert lathe_identity(folder).lathe_id == sent.lathe.lathe_id
    need = LATHES * rows_of_one / CUT_S
    rows = [
        ("rows of a run of a minute", f"{rows_of_one}", ""),
        (f"{LATHES} lathes that cut without a pause need", f"{need:.0f} rows/s", "1"),
        (
            f"a backlog of {RUNS} runs, {sent.total} rows",
            f"{sent.total / took_s:.0f} rows/s",
            f"{sent.total / took_s / need:.0f}",
        ),
        ("the same", f"{size / took_s / 1e6:.1f} MB/s", ""),
        ("it took", f"{took_s:.1f} s in {sent.transactions} transactions", ""),
        ("a run at the lathe", f"{size / RUNS / 1000:.0f} kB", ""),
        ("a run in the shop", f"{int(str(in_shop)) / RUNS / 1000:.0f} kB", ""),
    ]
    rows += [
        (name, f"{1000.0 * each:.0f} ms", "")
        for name, each in (
            ("the newest 20 runs, for a list", listed),
            ("run chart of all parts", charted),
            ("capability of all jobs", judged),
        )
    ]
    print_table("Records sent to the shop", ("", "", "x need"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
