"""The aims, each with the benchmark that shows it; and the table of what is met and what is missed.

A goal is of one column of some rows: the worst of them counts, and is named. Where it is a ratio, its baseline is
a row of the same run.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from benchmarks.tables import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A bound for a column, or for what it has above the column `above`: `at_most` or `at_least` the limit.

    It is one of all rows whose name matches `rows` entirely.
    """

    what: str
    benchmark: str
    column: str
    unit: str
    rows: str = ".*"
    at_most: float | None = None
    at_least: float | None = None
    above: str | None = None

    @property
    def limit(self) -> str:
        """The bound as it is shown."""
        if self.at_most is not None:
            return f"<= {self.at_most:g} {self.unit}"
        return f">= {self.at_least:g} {self.unit}"

    def met_by(self, value: float) -> bool:
        """Whether a figure keeps the bound."""
        return (self.at_most is None or value <= self.at_most) and (
            self.at_least is None or value >= self.at_least
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """What a run gives for a goal: the worst row, and its values in each round."""

    goal: Goal
    row: str
    values: tuple[float, ...]

    @property
    def value(self) -> float:
        """The middle of the rounds."""
        return median(self.values)

    @property
    def noise(self) -> float | None:
        """By which part of itself the figure differed between rounds; None with one round, or of nothing."""
        if len(self.values) < 2 or self.value == 0.0:
            return None
        return (max(self.values) - min(self.values)) / abs(self.value)


REAL_TIME = "x real time"

GOALS = (
    Goal(what="stop: call to wire, 99 %", benchmark="stop_latency", column="99 %", unit="ms", at_most=20.0),
    Goal(
        what="stop: key to wire, 99 %",
        benchmark="stop_latency",
        column="from the key, 99 %",
        unit="ms",
        at_most=20.0,
    ),
    Goal(
        what="first paint", benchmark="first_paint", column="x baseline", unit="x", rows="console.*", at_most=1.6
    ),
    Goal(
        what="console --help",
        benchmark="command_start",
        column="x baseline",
        unit="x",
        rows="console --help",
        at_most=6.0,
    ),
    Goal(
        what="console jobs",
        benchmark="command_start",
        column="x baseline",
        unit="x",
        rows="console jobs",
        at_most=10.0,
    ),
    Goal(what="from the key to armed", benchmark="arming", column="armed", unit="s", at_most=1.0),
    Goal(
        what="preview of all strategies",
        benchmark="preview",
        column="median",
        unit="ms",
        rows="the whole preview",
        at_most=500.0,
    ),
    Goal(
        what="first view of it", benchmark="preview", column="median", unit="ms", rows="first view.*", at_most=50.0
    ),
    Goal(what="bytes at rest", benchmark="at_rest", column="bytes/s", unit="bytes/s", at_most=200.0),
    Goal(
        what="processor at rest", benchmark="at_rest", column="CPU", unit="%", rows="(?!.*baseline).*", at_most=1.0
    ),
    Goal(
        what="bytes of a frame, 80 x 24",
        benchmark="run_page",
        column="bytes a frame",
        unit="bytes",
        rows="80 x 24, console",
        at_most=3000.0,
    ),
    Goal(
        what="bytes of a frame, 160 x 48",
        benchmark="run_page",
        column="bytes a frame",
        unit="bytes",
        rows="160 x 48, console",
        at_most=8000.0,
    ),
    Goal(
        what="simulated programs",
        benchmark="simulation_speed",
        column=REAL_TIME,
        unit=REAL_TIME,
        rows="LINEAR.*|PVT.*",
        at_least=400.0,
    ),
    Goal(
        what="simulated cam, PLC, gathering",
        benchmark="simulation_speed",
        column=REAL_TIME,
        unit=REAL_TIME,
        rows=".*cam.*|.*gathering",
        at_least=200.0,
    ),
    Goal(
        what="commands a second",
        benchmark="command_rate",
        column="x echo",
        unit="x",
        rows="one in flight, (tcp|ethernet)",
        at_least=1.0 / 3.0,
    ),
    Goal(
        what="minimum zone circle",
        benchmark="roundness",
        column="x as fast",
        unit="x",
        rows=".*exchange.*",
        at_least=20.0,
    ),
    Goal(what="95 % intervals", benchmark="confidence", column="as stated", unit="%", at_least=90.0),
    Goal(
        what="learning: third part above the floor",
        benchmark="learning",
        column="third",
        unit="um",
        rows="lee-2001-experiment-1",
        at_most=1.0,
        above="floor",
    ),
    Goal(
        what="records: list and begin, 5000 runs",
        benchmark="records",
        column="x baseline",
        unit="x",
        rows="list, newest.*|begin a run",
        at_most=1.5,
    ),
    Goal(
        what="records to the shop, of what thirty lathes need",
        benchmark="ship",
        column="x need",
        unit="x",
        rows="a backlog of .*",
        at_least=100.0,
    ),
    Goal(
        what="queries and panels of the shop, a million runs",
        benchmark="shop_views",
        column="ms",
        unit="ms",
        rows=".*",
        at_most=1000.0,
    ),
    Goal(
        what="memory over a shift, growth",
        benchmark="shift",
        column="against the first",
        unit="MiB",
        at_most=5.0,
    ),
)


def figures(rounds: Sequence[Sequence[Table]]) -> list[Figure]:
    """Return the figure of each goal that the tables have; the worst row is that of the worst middle."""
    return [figure for goal in GOALS if (figure := _figure(goal, rounds)) is not None]


def _figure(goal: Goal, rounds: Sequence[Sequence[Table]]) -> Figure | None:
    pattern, values = re.compile(goal.rows), dict[str, list[float]]()
    for tables in rounds:
        for table in tables:
            if table.benchmark == goal.benchmark:
                below = dict(table.numbers(pattern, goal.above)) if goal.above is not None else {}
                for name, value in table.numbers(pattern, goal.column):
                    values.setdefault(name, []).append(value - below.get(name, 0.0))
    if not values:
        return None
    worst = max if goal.at_most is not None else min
    row = worst(values, key=lambda name: median(values[name]))
    return Figure(goal=goal, row=row, values=tuple(values[row]))


HEAD = ("", "goal", "figure", "figure / goal", "", "worst row")


def cells(figure: Figure) -> tuple[str, ...]:
    """Return a figure as a row of the table."""
    goal = figure.goal
    limit = goal.at_most if goal.at_most is not None else goal.at_least
    assert limit is not None
    met = "met" if goal.met_by(figure.value) else "MISSED"
    return goal.what, goal.limit, f"{figure.value:.4g}", f"{figure.value / limit:.2f}", met, figure.row
