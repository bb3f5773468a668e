"""`console study`: every combination is a row, whoever makes it when; what cannot be made says why."""

from __future__ import annotations

import csv
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import console.session.errors as extras
from console.session.errors import SessionError
from console.site.study import running
from console.site.study.cells import MADE, TABLE, Cell, Row, cells, read_study, write_table
from console.site.study.running import NAME, CellResult, StudyProgress, carry_out, failed_row, software
from console.site.study.workers import Workers, processes
from profiles.problem import ProblemError

DIES = 3


def make_or_die(content: bytes) -> CellResult:
    """Make nothing of a cell; with the seed `DIES`, the process ends as by lack of memory."""
    cell: Cell = pickle.loads(content)
    if cell.names["seed"] == DIES:
        os._exit(9)
    return CellResult(cell.number, (failed_row(cell, MADE),), software())


Console = Callable[..., Any]

SMALL = """\
schema = 1
jobs = ["lee-2001-experiment-1"]
machines = ["lee-2001-lathe"]
plants = ["ideal"]
strategies = ["cam"]
seeds = [1]
cut_length_mm = 1.5
"""


def study_file(folder: Path, text: str = SMALL, **changes: str) -> Path:
    lines = [line for line in text.splitlines() if line.partition(" ")[0] not in changes]
    path = folder / "small.toml"
    path.write_text("\n".join([*lines, *(f"{key} = {value}" for key, value in changes.items())]) + "\n")
    return path


def cells_of(path: Path) -> list[Cell]:
    return list(cells(read_study(path), path.parent / "data", path.parent))


@contextmanager
def threads(count: int = 1) -> Iterator[Workers]:
    with ThreadPoolExecutor(count) as pool:
        yield Workers(pool, count)


def carried_out(
    path: Path, folder: Path, told: Callable[[StudyProgress], object] = lambda _: None
) -> tuple[Row, ...]:
    return carry_out(cells_of(path), folder, threads, told)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Cells are made without a cut; the list has their numbers."""
    made: list[int] = []

    def rows(cell: Cell) -> tuple[Row, ...]:
        made.append(cell.number)
        if cell.problems:
            raise ProblemError(*cell.problems)
        if cell.names["seed"] == 13:
            raise TypeError("a fault\nof ours")
        return (running._row(cell, {"part": 1, "outcome": "made", "ront_um": cell.number / 3}),)

    monkeypatch.setattr(running, "_rows", rows)
    return made


@pytest.mark.long
@pytest.mark.timeout(240)
def test_a_part_of_a_study_is_the_part_that_a_run_cuts(console: Console, tmp_path: Path) -> None:
    (row,) = carried_out(study_file(tmp_path, plants='["realistic"]', compare='"on"'), tmp_path / "out")
    job = tmp_path / "job.toml"
    said = console("jobs", "--json").json
    bundled = Path(next(each["path"] for each in said["jobs"] if each["name"] == "lee-2001-experiment-1"))
    text = bundled.read_text(encoding="utf-8").splitlines()
    short = ["cut_length_mm = 1.5" if line.startswith("cut_length_mm") else line for line in text]
    job.write_text("\n".join(short), encoding="utf-8")
    run = console(
        "run", str(job), "--sim", "--plant", "realistic", "--seed", "1", "--strategy", "cam", "--json"
    ).json
    assert row["ront_um"] == run["after"]["RONt_um"] and row["before_ront_um"] == run["before"]["RONt_um"]
    assert row["tool_error_um"] == run["tool_error_um"] and row["within_tolerance"] == run["within_tolerance"]
    assert row["lobe_um_pp"] == 2.0 * next(h["amplitude_um"] for h in run["after"]["harmonics"] if h["n"] == 3)


def test_a_study_cuts(tmp_path: Path) -> None:
    """On an ideal lathe the lobe of 55 um is turned away but for what the servo leaves."""
    path = study_file(tmp_path, strategies='["pvt"]')
    (row,) = carried_out(path, tmp_path / "out")
    assert (row["outcome"], row["part"], row["within_tolerance"]) == ("made", 1, True)
    assert 0.0 < float(row["ront_um"] or 0.0) < 1.0


def test_every_combination_is_a_row_and_what_cannot_be_made_has_its_reason(
    tmp_path: Path, quick: list[int]
) -> None:
    (tmp_path / "broken.toml").write_text("schema = 1\nname = 3\n")
    path = study_file(
        tmp_path,
        jobs='["lee-2001-experiment-1", "broken.toml", "nosuch"]',
        plants='["ideal", "mounted"]',
        seeds="[1, 13]",
    )
    rows = carried_out(path, tmp_path / "out")
    assert [row["cell"] for row in rows] == list(range(1, 13))
    codes = [(row["job"], row["plant"], row["seed"], row["outcome"], row["reason_code"]) for row in rows]
    assert codes[:4] == [
        ("lee-2001-experiment-1", "ideal", 1, "made", None),
        ("lee-2001-experiment-1", "ideal", 13, "fault", "session.fault"),
        ("lee-2001-experiment-1", "mounted", 1, "refused", "study.mounted"),
        ("lee-2001-experiment-1", "mounted", 13, "refused", "study.mounted"),
    ]
    assert rows[1]["reason"] == "TypeError: a fault of ours"
    assert {(row["job"], row["reason_code"]) for row in rows[8:] if row["plant"] == "ideal"} == {
        ("nosuch", "job.unknown")
    }
    of_broken = {str(row["reason_code"]) for row in rows[4:6]}
    assert len(of_broken) == 1 and "key.missing" in of_broken.pop()


def test_jobs_machines_and_plants_may_be_files_beside_the_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from profiles.store import load_job, load_machine, save_job

    save_job(load_job("lee-2001-experiment-1").job, tmp_path / "ours.toml")
    (tmp_path / "lathe.toml").write_text(load_machine("lee-2001-lathe").text, encoding="utf-8")
    (tmp_path / "off.toml").write_text('schema = 1\nlike = "ideal"\n[chuck]\nlobe_factor = 1.5\n')
    changes = {"jobs": '["ours.toml"]', "machines": '["./lathe.toml"]', "plants": '["off.toml", "ideal"]'}
    path = study_file(tmp_path, **changes)
    monkeypatch.chdir("/")
    off, ideal = cells_of(path)
    assert off.true is not None and ideal.true is not None and off.job is not None
    assert off.true.lobe_factor == 1.5 * ideal.true.lobe_factor
    assert off.job.cut_length_mm == 1.5 and not off.problems


def test_a_study_resumes_after_what_a_kill_has_left(tmp_path: Path, quick: list[int]) -> None:
    path = study_file(tmp_path, seeds="{ from = 1, count = 6 }")
    whole = write_table(tmp_path, carried_out(path, tmp_path / "whole")).read_bytes()
    quick.clear()

    def stops(progress: StudyProgress) -> None:
        if progress.made_now == 3:
            raise KeyboardInterrupt

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        carried_out(path, out, stops)
    journal = out / NAME
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:3]) + lines[3][: len(lines[3]) // 2])
    quick.clear()
    first: list[StudyProgress] = []
    rows = carried_out(path, out, first.append)
    assert (first[0].kept, first[0].made_now, first[-1].kept, first[-1].made_now) == (2, 0, 6, 4)
    assert sorted(quick) == [3, 4, 5, 6]
    assert write_table(out, rows).read_bytes() == whole
    quick.clear()
    assert carried_out(path, out) == rows and quick == []


def test_a_changed_study_or_a_damaged_journal_is_not_resumed(tmp_path: Path, quick: list[int]) -> None:
    out = tmp_path / "out"
    carried_out(study_file(tmp_path), out)
    for changed in ({"seeds": "[2]"}, {"parts": "2"}, {"cut_length_mm": "2.0"}, {"plants": '["easy"]'}):
        with pytest.raises(SessionError) as refused:
            carried_out(study_file(tmp_path, **changed), out)
        assert refused.value.problems[0].code == "study.other"
    carried_out(study_file(tmp_path), out)
    with (out / NAME).open("ab") as file:
        file.write(b"garbage\n")
    with pytest.raises(SessionError) as refused:
        carried_out(study_file(tmp_path), out)
    assert refused.value.problems[0].code == "study.journal"


def test_two_processes_do_not_carry_out_one_study(tmp_path: Path, quick: list[int]) -> None:
    path, codes = study_file(tmp_path, seeds="[1, 2]"), list[str]()

    def again(_: StudyProgress) -> None:
        if not codes:
            with pytest.raises(SessionError) as refused:
                carried_out(path, tmp_path / "out")
            codes.append(refused.value.problems[0].code)

    carried_out(path, tmp_path / "out", again)
    assert codes == ["study.running"]


@pytest.mark.parametrize(
    ("changes", "codes"),
    [
        ({"jobs": "[]"}, ["study.empty_list"]),
        ({"jobs": '["a", "b", "a"]', "seeds": "[1, 1]"}, ["study.twice", "study.twice"]),
        ({"strategies": '["best"]', "parts": "0"}, ["value.not_choice", "value.out_of_range"]),
        ({"seeds": "[1.5]"}, ["value.not_whole"]),
        ({"seeds": "{ from = 1 }"}, ["key.missing"]),
        ({"seeds": "{ from = 4294967295, count = 2 }"}, ["value.out_of_range"]),
        ({"seeds": "{ from = 1, count = 100000 }", "plants": '["easy", "hard"]'}, ["study.too_large"]),
        ({"stage": '"air"'}, ["value.not_choice"]),
        ({"joks": '["a"]'}, ["key.unknown"]),
    ],
)
def test_a_mistake_in_the_file_is_told_in_both_languages(
    console: Console, tmp_path: Path, changes: dict[str, str], codes: list[str]
) -> None:
    path = study_file(tmp_path, **changes)
    with pytest.raises(ProblemError) as refused:
        read_study(path)
    assert [problem.code for problem in refused.value.problems] == codes
    for lang in ("en", "ko"):
        said = console("study", str(path), "--lang", lang)
        assert said.code == 1 and len(said.err.splitlines()) == len(codes) and "small.toml" in said.err
    assert not (tmp_path / "small.study").exists()


def test_the_documented_study_is_one(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "study.md").read_text(encoding="utf-8")
    path = tmp_path / "documented.toml"
    path.write_text(text.split("```toml\n", 1)[1].split("```", 1)[0], encoding="utf-8")
    assert read_study(path).size == 2 * 1 * 2 * 2 * 40


def test_what_needs_an_optional_part_says_so_before_it_begins(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = study_file(tmp_path)
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    for words, extra in ((["--parquet"], "trilobe[parquet]"), (["--scheduler", "tcp://x:1"], "trilobe[dask]")):
        said = console("study", str(path), *words)
        assert said.code == 1 and f"pip install '{extra}'" in said.err


@pytest.mark.long
def test_a_cell_that_ends_its_process_is_a_row_and_the_others_are_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "make", make_or_die)
    path = study_file(tmp_path, seeds="{ from = 1, count = 7 }")
    rows = carry_out(cells_of(path), tmp_path / "out", lambda: processes(2), lambda _: None)
    assert [row["outcome"] for row in rows] == ["fault" if seed == DIES else "made" for seed in range(1, 8)]
    assert "process ended" in str(rows[DIES - 1]["reason"])


@pytest.mark.long
def test_the_command_writes_tables_that_agree(console: Console, tmp_path: Path, quick: list[int]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="the extra parquet is not installed")
    path = study_file(tmp_path, seeds="[1, 13, 3]")
    rows = carried_out(path, tmp_path / "small.study")  # what remains for the command is to write them
    said = console("study", str(path), "--parquet", "--data", str(tmp_path / "data"))
    assert said.code == 0 and "1 of 1 made" not in said.out and "TypeError" in said.out
    assert max(map(len, said.out.splitlines())) <= 80 or str(tmp_path) in said.out
    with (tmp_path / "small.study" / TABLE).open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["ront_um"] for row in table] == [
        "" if row["ront_um"] is None else str(row["ront_um"]) for row in rows
    ]
    assert parquet.read_table(tmp_path / "small.study" / "results.parquet").to_pylist() == [
        dict(row) for row in rows
    ]
    fields = console("study", str(path), "--json", "--data", str(tmp_path / "data")).json
    assert fields["outcomes"] == {"made": 2, "fault": 1} and fields["rows"] == 3


SIX = {"plants": '["steady"]', "strategies": '["pvt"]', "seeds": "{ from = 1, count = 6 }"}


@pytest.fixture(scope="module")
def by_one(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The table of six cells, made by one process."""
    folder = tmp_path_factory.mktemp("one")
    return table_by(study_file(folder, **SIX), folder, "--workers", "1")


def table_by(path: Path, folder: Path, *words: str) -> bytes:
    done = subprocess.run(command(path, folder, *words), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return (path.parent / "small.study" / TABLE).read_bytes()


def command(path: Path, folder: Path, *words: str) -> list[str]:
    return [sys.executable, "-m", "console", "study", str(path), "--data", str(folder / "data"), *words]


@pytest.mark.long
@pytest.mark.timeout(240)
def test_two_processes_make_the_same_bytes_also_after_a_kill(by_one: bytes, tmp_path: Path) -> None:
    path = study_file(tmp_path, **SIX)
    journal = tmp_path / "small.study" / NAME
    with subprocess.Popen(command(path, tmp_path, "--workers", "2"), stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        until_s = time.monotonic() + 100.0
        while not (journal.exists() and len(journal.read_bytes().splitlines()) >= 3):
            assert process.poll() is None and time.monotonic() < until_s
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    # Its workers end with it: nobody writes, or computes, any more.
    kept = len(journal.read_bytes().splitlines()) - 1
    assert 2 <= kept < 6
    assert table_by(path, tmp_path, "--workers", "2") == by_one
    numbers = [json.loads(line)["cell"] for line in journal.read_bytes().splitlines()[1:]]
    assert sorted(numbers) == list(range(1, 7))


@pytest.mark.long
@pytest.mark.timeout(240)
@pytest.mark.filterwarnings("default")
def test_a_dask_cluster_makes_the_same_bytes(by_one: bytes, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    path = study_file(tmp_path, **SIX)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as made:
        assert table_by(path, tmp_path, "--scheduler", made.scheduler_address) == by_one


@pytest.mark.long
def test_a_scheduler_that_is_not_there_is_told(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    from console.site.study import workers

    monkeypatch.setattr(workers, "CONNECT_S", 0.3)
    said = console("study", str(study_file(tmp_path)), "--scheduler", "tcp://127.0.0.1:9")
    assert said.code == 1 and "dask scheduler" in said.err and len(said.err.splitlines()) == 2
