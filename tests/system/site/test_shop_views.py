"""The views of the shop say what the statistics of the console say, and every documented query is one."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from console.session.data.records import RunRecord
from console.site.shop.shipping import ship
from profiles.metrology.process_statistics import capability_below, capability_within, run_chart
from tests.console.test_run_reader import RUN, part
from tests.site.shop_server import READER, ROOT, SHIPPER, ShopServer, documented_sql, needs_postgresql, shop_server

pytestmark = [pytest.mark.system, needs_postgresql]

PARTS = 31
ROUNDNESS_UM = 3.0 + 0.4 * np.random.default_rng(7).normal(size=PARTS)
ROUNDNESS_UM[12] = 5.6  # one to look at: beyond the limits, and out of the tolerance of 5 um
DIAMETER_MM = 51.8 + 0.002 * np.random.default_rng(8).normal(size=PARTS)
LOBE_UM = [1.0 + 0.5 * (place // 10) for place in range(PARTS)]


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ShopServer]:
    """A shop with 31 parts, ten in a clamping, and what must not count: a simulated one, one for comparison."""
    folder = tmp_path_factory.mktemp("lathe")
    for place in range(PARTS):
        setup = f'{{"clamped_at": "2026-05-01T{8 + place // 10:02d}:00:00Z"}}'
        run = RunRecord(folder, {**RUN, "simulated": 0, "setup": setup, "operator": "kim"})
        run.add("measured", {}, part(99.0, part="after"))  # measured again below
        measured = {
            "diameter_mm": float(DIAMETER_MM[place]),
            "nominal_diameter_mm": 51.8,
            "diameter_tolerance_um": 10.0,
            "lobe_um_pp": LOBE_UM[place],
            "part": "after",
        }
        run.add("measured", {}, part(float(ROUNDNESS_UM[place]), **measured))
        run.add("measured", {}, part(50.0, part="before", product=False))
        run.add("cut", {"turn": 9.0})
        if place == PARTS - 1:
            run.log.event("alarm_raised", {"code": "drive.fault", "priority": "high", "value": "tool"})
        run.close()
    simulated = RunRecord(folder, {**RUN, "simulated": 1})
    simulated.add("measured", {}, part(80.0))
    simulated.log.event("alarm_raised", {"code": "cut.out_of_phase", "priority": "high", "value": "12 deg"})
    simulated.log.event("alarm_raised", {"code": "odd", "value": float("nan")})
    simulated.close()
    with shop_server() as server:
        for name in [name for name in os.environ if name.startswith("PG")]:
            del os.environ[name]
        server.new_shop()
        ship(folder, server.dsn(SHIPPER))
        yield server


@pytest.mark.long
def test_the_run_chart_is_that_of_the_console(shop: ShopServer) -> None:
    rows = shop.sql(
        "SELECT ront_um, mean_um, lower_um, upper_um, beyond FROM shop.run_chart ORDER BY place", READER
    )
    found = np.array([row[:4] for row in rows], dtype=float)
    chart = run_chart(ROUNDNESS_UM)
    assert chart is not None
    assert found[:, 0] == pytest.approx(ROUNDNESS_UM)
    assert found[0, 1:] == pytest.approx([chart.mean, chart.lower, chart.upper])
    assert [place for place, row in enumerate(rows) if row[4]] == list(chart.beyond)


def test_capability_is_that_of_the_console_and_not_claimed_below_thirty_parts(shop: ShopServer) -> None:
    ((parts, mean, cpk),) = shop.sql("SELECT parts, mean_um, cpk FROM shop.roundness_capability", READER)
    one = capability_below(ROUNDNESS_UM, 5.0)
    assert one is not None and parts == PARTS
    assert (mean, cpk) == (pytest.approx(one.mean), pytest.approx(one.cpk))
    ((cp, cpk),) = shop.sql("SELECT cp, cpk FROM shop.diameter_capability", READER)
    both = capability_within(1000.0 * (DIAMETER_MM - 51.8), -10.0, 10.0)
    assert both is not None and both.cp is not None
    assert (cp, cpk) == (pytest.approx(both.cp, rel=1e-6), pytest.approx(both.cpk, rel=1e-6))
    shop.sql(
        "CREATE TABLE away AS SELECT * FROM shop.measurements WHERE run_id IN (SELECT run_id FROM shop.parts"
        " ORDER BY place LIMIT 2)"
    )
    shop.sql("DELETE FROM shop.measurements WHERE run_id IN (SELECT run_id FROM away)")
    try:
        assert shop.sql("SELECT parts, cpk FROM shop.roundness_capability", READER) == [(PARTS - 2, None)]
    finally:
        shop.sql("INSERT INTO shop.measurements SELECT * FROM away; DROP TABLE away")


def test_the_lobe_drifts_from_clamping_to_clamping(shop: ShopServer) -> None:
    rows = shop.sql(
        "SELECT clamping, parts, mean_lobe_um_pp, drift_um_pp FROM shop.lobe_drift ORDER BY clamping", READER
    )
    assert rows == [(1, 10, 1.0, 0.0), (2, 10, 1.5, 0.5), (3, 10, 2.0, 1.0), (4, 1, 2.5, 1.5)]


def test_alarms_are_listed_and_one_that_is_no_json_stays(shop: ShopServer) -> None:
    rows = shop.sql("SELECT code, priority, value, simulated FROM shop.alarms ORDER BY number", READER)
    assert sorted(rows, key=str) == [
        ("cut.out_of_phase", "high", "12 deg", True),
        ("drive.fault", "high", "tool", False),
        (None, None, None, True),
    ]


def test_every_query_of_the_document_is_one(shop: ShopServer) -> None:
    queries = documented_sql("docs/shop.md", "## Queries")
    assert len(queries) >= 6
    views = set(re.findall(r"shop\.(\w+)", " ".join(queries)))
    assert views >= {"lathes", "run_chart", "roundness_capability", "diameter_capability", "alarms", "lobe_drift"}
    for query in queries:
        assert shop.sql(query, READER), query


DASHBOARD = json.loads((ROOT / "docs/deploy/grafana/trilobe-shop.json").read_text(encoding="utf-8"))


def asked(shop: ShopServer, query: str, chosen: dict[str, str]) -> list[dict[str, Any]]:
    """Rows of a query of the dashboard, with what is chosen above it as Grafana writes it in: quoted for SQL."""
    import psycopg
    from psycopg.rows import dict_row

    for name, value in chosen.items():
        query = query.replace(f"${{{name}:sqlstring}}", "'" + value.replace("'", "''") + "'")
    with psycopg.connect(shop.dsn(READER), row_factory=dict_row) as link:
        return link.execute(query.encode()).fetchall()


@pytest.fixture(scope="module")
def chosen(shop: ShopServer) -> dict[str, str]:
    """What the dashboard offers first: a lathe, a machine on it, a job on that."""
    found: dict[str, str] = {}
    for variable in DASHBOARD["templating"]["list"]:
        if variable["type"] == "query":
            first, *_ = asked(shop, variable["query"], found)
            found[variable["name"]] = str(first.get("__value", first.get(variable["name"])))
    return found


@pytest.mark.parametrize("panel", DASHBOARD["panels"], ids=lambda panel: panel["title"])
def test_every_panel_of_the_dashboard_shows_columns_of_the_views(
    shop: ShopServer, chosen: dict[str, str], panel: dict[str, Any]
) -> None:
    (target,) = panel["targets"]
    rows = asked(shop, target["rawSql"], chosen)
    assert rows, "nothing is shown"
    named = {each["matcher"]["options"] for each in panel["fieldConfig"]["overrides"]}
    named |= {panel["options"][key] for key in ("xField",) if key in panel["options"]}
    assert named <= rows[0].keys()
    if panel["type"] == "trend":
        places = [row[panel["options"]["xField"]] for row in rows]
        assert places == sorted(set(places)), "Grafana draws a trend only over x that grows"
    assert "$" not in re.sub(r"\$\{(lathe|machine|job):sqlstring\}", "", target["rawSql"])


def test_the_dashboard_names_the_part_beyond_the_limits(shop: ShopServer, chosen: dict[str, str]) -> None:
    (looked,) = [each for each in DASHBOARD["panels"] if each["title"].startswith("Parts to look at")]
    (row,) = asked(shop, looked["targets"][0]["rawSql"], chosen)
    assert (row["place"], row["ront_um"], row["beyond"], row["out_of_tolerance"]) == (13, 5.6, True, True)


FORCED = ("parallel_setup_cost = 0", "parallel_tuple_cost = 0", "min_parallel_table_scan_size = 0")


def test_every_view_and_query_can_be_asked_by_a_plan_with_parallel_workers(
    shop: ShopServer, chosen: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ((version,),) = shop.sql("SHOW server_version_num")
    forced = "debug_parallel_query" if int(str(version)) >= 160000 else "force_parallel_mode"
    settings = " ".join(f"-c {each.replace(' ', '')}" for each in (*FORCED, f"{forced} = on"))
    monkeypatch.setenv("PGOPTIONS", settings)
    plan = shop.sql("EXPLAIN SELECT * FROM shop.roundness_capability", READER)
    assert any("Gather" in str(line) for (line,) in plan), "nothing is forced"
    queries = documented_sql("docs/shop.md", "## Queries")
    queries += [panel["targets"][0]["rawSql"] for panel in DASHBOARD["panels"]]
    views = shop.sql("SELECT table_name FROM information_schema.views WHERE table_schema = 'shop'")
    for query in (*queries, *(f"SELECT * FROM shop.{name}" for (name,) in views)):
        assert asked(shop, query, chosen), query


def test_what_triggers_have_kept_is_what_the_records_say(shop: ShopServer) -> None:
    for name in ("part", "alarm"):
        kept, recorded = (
            sorted(shop.sql(f"SELECT * FROM shop.{table}"), key=repr)
            for table in (f"{name}_summaries", f"{name}s_of_records")
        )
        assert kept and kept == recorded


def test_what_is_measured_again_or_removed_is_at_once_what_the_views_show(shop: ShopServer) -> None:
    import psycopg

    newest = "SELECT ront_um FROM shop.parts ORDER BY place DESC LIMIT 1"
    with psycopg.connect(shop.dsn()) as link:

        def shown() -> list[tuple[float]]:
            return link.execute(newest.encode()).fetchall()

        ((was,),) = shown()
        link.execute(
            b"CREATE TEMP TABLE again AS SELECT m.* FROM shop.measurements AS m JOIN shop.parts AS p"
            b" USING (lathe_id, run_id, part) ORDER BY p.place DESC, m.number DESC LIMIT 1"
        )
        link.execute(b"UPDATE again SET number = number + 100, ront_um = 4.25")
        link.execute(b"INSERT INTO shop.measurements SELECT * FROM again")
        assert shown() == [(4.25,)]
        link.execute(b"DELETE FROM shop.measurements WHERE number > 100")
        assert shown() == [(was,)]
        (alarms,) = link.execute(b"SELECT count(*) FROM shop.alarms").fetchall()
        link.execute(b"DELETE FROM shop.events WHERE kind = 'alarm_raised' AND data LIKE '%drive.fault%'")
        assert link.execute(b"SELECT count(*) + 1 FROM shop.alarms").fetchall() == [alarms]
        link.rollback()
