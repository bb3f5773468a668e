"""The table of goals: what counts of a printed table, when a goal is met, and what is worse than before."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import comparison, measure, performance
from benchmarks.__main__ import NAMES
from benchmarks.goals import GOALS, Figure, Goal, cells, figures
from benchmarks.tables import Table, added, number, printed, read, write

ROOT = Path(__file__).parents[2]
PAINT = Goal(what="first paint", benchmark="first_paint", column="x baseline", unit="x", at_most=1.6)


def paint(*ratios: str) -> Table:
    rows = tuple((f"console {n}", "300 ms", ratio) for n, ratio in enumerate(ratios))
    return Table(benchmark="first_paint", title="First paint", head=("", "median", "x baseline"), rows=rows)


def test_the_number_of_a_cell_is_that_with_which_it_begins() -> None:
    assert [number(cell) for cell in ("1.60", "39 ms", "-0.5", "3.02 / 8.60", "3e-14 um", "no picture", "")] == [
        *(1.60, 39.0, -0.5, 3.02, 3e-14),
        *(None, None),
    ]


def test_what_is_printed_is_kept_and_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(measure.TABLES, str(tmp_path / "kept"))
    measure.print_table("First paint", ("", "median", "x baseline"), [("console 0", "300 ms", "1.50")])
    assert "console 0  300 ms" in capsys.readouterr().out
    tables = printed("first_paint", (tmp_path / "kept").read_text().splitlines())
    assert tables == [paint("1.50")]
    write(tmp_path / "rounds.json", [tables, tables])
    assert read(tmp_path / "rounds.json") == [tables, tables]


def test_the_worst_row_counts_and_of_several_rounds_the_middle() -> None:
    rounds = [[paint("1.5", "1.7")], [paint("1.9", "1.5")], [paint("1.4", "1.6")]]
    (figure,) = [each for each in figures(rounds) if each.goal.benchmark == "first_paint"]
    assert (figure.row, figure.values, figure.value) == ("console 1", (1.7, 1.5, 1.6), 1.6)
    assert cells(figure)[1:] == ("<= 1.6 x", "1.6", "1.00", "met", "console 1")
    assert figure.noise == pytest.approx(0.2 / 1.6)


def test_a_goal_may_be_what_one_column_has_above_another() -> None:
    table = Table(
        benchmark="learning",
        title="realistic",
        head=("job", "how", "first", "third", "last", "floor"),
        rows=(("lee-2001-experiment-1", "all", "18.4 / 32.6", "3.0 / 8.6", "-", "1.60"),),
    )
    (figure,) = figures([[table]])
    assert figure.value == pytest.approx(1.4) and "MISSED" in cells(figure)


@pytest.mark.parametrize(
    ("earlier", "now", "verdict"),
    [
        ((1.5,), (1.6,), "within the noise"),  # a fifth is assumed of one round
        ((1.5,), (1.9,), "worse"),
        ((1.5, 1.5), (1.6, 1.6), "worse"),
        ((1.5, 1.5), (1.3, 1.3), "better"),
        ((1.5, 1.7), (1.7, 1.7), "within the noise"),
    ],
)
def test_worse_is_what_differs_by_more_than_both_runs_do_in_themselves(
    earlier: tuple[float, ...], now: tuple[float, ...], verdict: str
) -> None:
    assert comparison.verdict(*(Figure(goal=PAINT, row="", values=values) for values in (earlier, now))) == verdict


def test_more_is_better_where_a_goal_is_a_least() -> None:
    goal = Goal(what="speed", benchmark="simulation_speed", column="x", unit="x", at_least=100.0)
    half, whole = (Figure(goal=goal, row="", values=(value,)) for value in (50.0, 100.0))
    assert comparison.verdict(whole, half) == "worse" and comparison.verdict(half, whole) == "better"
    assert (goal.met_by(99.0), goal.met_by(100.0)) == (False, True)


def test_the_page_names_the_machine_and_each_figure() -> None:
    rounds = [[paint("1.5")]]
    page = performance.page(figures(rounds), rounds)
    assert (
        performance.machine() in page
        and "### first_paint\n" in page
        and "| first paint | <= 1.6 x | 1.5 | 0.94 | met | console 0 |" in page
    )


@pytest.mark.parametrize("goal", GOALS, ids=lambda goal: goal.what)
def test_every_goal_is_of_a_column_that_its_benchmark_prints(goal: Goal) -> None:
    assert goal.benchmark in NAMES
    assert (goal.at_most is None) is not (goal.at_least is None)
    source = (ROOT / "benchmarks" / f"{goal.benchmark}.py").read_text(encoding="utf-8")
    assert f'"{goal.column}"' in source and (goal.above is None or f'"{goal.above}"' in source)


def test_what_was_not_run_is_taken_from_an_earlier_run() -> None:
    one, two, three = ([paint(each)] for each in ("1.1", "1.2", "1.3"))
    assert added([one], [two, three]) == [one, []]
    other = [replace(two[0], benchmark="arming")]
    assert added([one], [[*two, *other], three]) == [[*one, *other], []]
