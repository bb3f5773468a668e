"""How long the queries of docs/shop.md and the panels of its dashboard take, in a shop of its real size.

python -m benchmarks.shop_views

A PostgreSQL server of its own with its usual settings, and a million runs of thirty lathes: four months of two
shifts, twelve jobs that each lathe cuts in turn, a measured part a run, an alarm in every third. A query is asked
for one lathe, one machine and one job as the dashboard asks it, and as the document prints it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from statistics import median

from benchmarks.measure import extent, print_table, seconds
from tests.site.shop_server import READER, ROOT, ShopServer, documented_sql, programs, shop_server

LATHES = 30
RUNS_OF_A_LATHE = extent(33_334, 20)
JOBS = extent(12, 2)
PIECE = 1000  # runs of a lathe that arrive in one transaction
EACH = 3  # times that a query is asked

RUNS = f"""INSERT INTO shop.runs OVERRIDING USER VALUE
SELECT lathe_id, lathe_id || ' first', place, 0, now(), md5(lathe_id || place), at_utc, repeat('0', 64),
    'ring' || place / 50 % {JOBS}, repeat('0', 64), 'lathe', repeat('0', 64), 0, 'cam',
    repeat(E'X1 Y2 Z3\\n', 270), NULL, NULL, '3.11.2', '1.17A', 'turbo', 'full', 3, 'kim', 5,
    format('{{"clamped_at": "%s", "note": "%s"}}', chuck, repeat(md5(at_utc), 12))
FROM made"""
MEASUREMENTS = """INSERT INTO shop.measurements
SELECT lathe_id, lathe_id || ' first', place, md5(lathe_id || place), 1, at_utc, 'after', 1, um, 5,
    CASE WHEN um <= 5 THEN 1 ELSE 0 END, 51.8 + um / 1000, 51.8, 20, um / 2, NULL, NULL,
    format('{"RONt_um": %s, "harmonics": "%s"}', um, repeat(md5(at_utc), 40))
FROM made"""
EVENTS = """INSERT INTO shop.events
SELECT lathe_id, lathe_id || ' first', 10 * place + number, md5(lathe_id || place), number, at_utc, kind,
    CASE kind WHEN 'alarm_raised' THEN format('{"code": "code.%s", "priority": "high"}', place % 20)
        ELSE '{"turn": 1000.0}' END
FROM made, unnest(ARRAY['armed', 'started', 'cut', 'alarm_raised']) WITH ORDINALITY AS each (kind, number)
WHERE kind <> 'alarm_raised' OR place % 3 = 0"""
MADE = f"""WITH made AS (
    SELECT md5('lathe ' || lathe) AS lathe_id, place, 2 + 3 * random() + random() AS um,
        to_char(moment, 'YYYY-MM-DD"T"HH24:MI:SS"Z"') AS at_utc,
        to_char(moment, 'YYYY-MM-DD"T"HH24:00:00"Z"') AS chuck
    FROM generate_series(%s, %s) AS place CROSS JOIN generate_series(1, {LATHES}) AS lathe,
        LATERAL (SELECT now() - ({RUNS_OF_A_LATHE} - place) * interval '315 s') AS at_the_lathe (moment)
) """
OF_LATHES = f"""INSERT INTO shop.contacts SELECT md5('lathe ' || lathe), 'lathe-' || lathe, 'trilobe', at, at
FROM generate_series(1, {LATHES}) AS lathe, generate_series(now() - interval '4 months', now(), '1 h') AS at;
INSERT INTO shop.progress SELECT md5('lathe ' || lathe), 'first', 'runs', {RUNS_OF_A_LATHE}
FROM generate_series(1, {LATHES}) AS lathe"""


def add_runs(server: ShopServer, first: int, last: int) -> None:
    """Put runs of each lathe into a shop; what the views show of them is summarised at once."""
    for line in (RUNS, MEASUREMENTS, EVENTS):
        server.sql(MADE % (first, last) + line)


def fill(server: ShopServer) -> None:
    """Put the runs of all lathes into a shop, in the order in which they would have arrived."""
    for first in range(1, RUNS_OF_A_LATHE + 1, PIECE):
        add_runs(server, first, min(first + PIECE - 1, RUNS_OF_A_LATHE))
    server.sql(OF_LATHES)
    server.sql("VACUUM ANALYZE")


def queries() -> Iterator[tuple[str, str]]:
    """Yield what is asked, with its name: of the document, and of each panel and choice of the dashboard."""
    for number, query in enumerate(documented_sql("docs/shop.md", "## Queries"), 1):
        view = query.partition("shop.")[2].split()[0]
        yield f"document {number}, {view}", query.replace("'ring'", "'ring1'")
    dashboard = json.loads((ROOT / "docs/deploy/grafana/trilobe-shop.json").read_text(encoding="utf-8"))
    for each in dashboard["templating"]["list"]:
        if each["type"] == "query":
            yield f"choice, {each['name']}", each["query"]
    for panel in dashboard["panels"]:
        yield f"panel {panel['id']}, {panel['title'].partition(',')[0]}", panel["targets"][0]["rawSql"]


def chosen(query: str) -> str:
    """Return a query for one lathe, its machine and one job."""
    for name, value in (("lathe", "md5('lathe 7')"), ("machine", "'lathe'"), ("job", "'ring1'")):
        query = query.replace(f"${{{name}:sqlstring}}", value)
    return query


def took_ms(server: ShopServer, query: str) -> float:
    """Return how long a query takes that is asked by a reader, ms, with its rows fetched; the middle of some."""
    return 1000.0 * median(seconds(lambda: server.sql(query, READER)) for _ in range(EACH))


def main() -> int:
    """Ask everything, and print how long it takes."""
    if programs() is None:
        print("no PostgreSQL server is installed (Debian: apt-get install postgresql)")
        return 0
    with shop_server() as server:
        server.new_shop()
        fill(server)
        rows = [(name, f"{took_ms(server, chosen(query)):.0f}") for name, query in queries()]
        more = RUNS_OF_A_LATHE + 1
        rows.append((f"{LATHES} runs more", f"{1000.0 * seconds(lambda: add_runs(server, more, more)):.0f}"))
    print_table(f"A shop of {LATHES * RUNS_OF_A_LATHE} runs of {LATHES} lathes", ("", "ms"), rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
