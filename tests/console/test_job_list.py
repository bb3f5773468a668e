"""The list of the jobs stays a table, whatever the files in the folder are called."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import profiles.store
from tests.console.commands import Console


@pytest.fixture
def own_jobs(data_folder: Path) -> Path:
    folder = data_folder / "trilobe" / "jobs"
    folder.mkdir(parents=True)
    return folder


def bundled() -> bytes:
    return (profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_bytes()


@pytest.mark.parametrize("content", [bundled(), b"name = 3"])
def test_a_line_end_in_a_file_name_breaks_no_table(console: Console, own_jobs: Path, content: bytes) -> None:
    (own_jobs / "two\nlines\x1b[31m.toml").write_bytes(content)
    rows = [line for line in console("jobs").out.splitlines() if "two" in line]
    assert rows[0].startswith(r"two\nlines\x1b[31m  ")
    assert "\x1b" not in console("jobs").out
    names = [job["name"] for job in console("jobs", "--json").json["jobs"]]
    assert "two\nlines\x1b[31m" in names


def test_a_file_name_that_is_no_text_is_listed(console: Console, own_jobs: Path) -> None:
    (own_jobs / os.fsdecode(b"odd\xff.toml")).write_bytes(bundled())
    assert r"odd\udcff" in console("jobs").out
    assert console("jobs", "--json").code == 0


def test_a_plain_copy_is_listed_with_why_it_is_not_cut(console: Console, own_jobs: Path) -> None:
    """Its runs and learned versions would be those of the job that it was copied from."""
    (own_jobs / "copy.toml").write_bytes(bundled())
    jobs = {job["name"]: job for job in console("jobs", "--json").json["jobs"]}
    assert "title" not in jobs["copy"] and any('name = "copy"' in said for said in jobs["copy"]["problems"])
    assert jobs["lee-2001-experiment-1"]["title"] == "lee-2001-experiment-1"
    said = console("run", "copy", "--sim")
    assert said.code == 1 and 'name = "copy"' in said.err


def test_with_a_machine_each_job_is_judged_by_its_rules(console: Console, own_jobs: Path) -> None:
    thick = bundled().replace(b"wall_thickness_mm = 2.5", b"wall_thickness_mm = 99.0")
    thick = thick.replace(b'name = "lee-2001-experiment-1"', b'name = "thick"')
    (own_jobs / "thick.toml").write_bytes(thick)
    said = console("jobs", "--machine", "lee-2001-lathe")
    assert said.code == 0 and "lee-2001-lathe" in said.out.splitlines()[-1]
    rows = {line.split()[0]: line for line in said.out.splitlines()}
    assert rows["lee-2001-experiment-1"].endswith("fits") and "refused" in rows["thick"]
    assert "thicker than the radius" in said.out
    found = console("jobs", "--machine", "lee-2001-lathe", "--json").json
    assert found["judged_on"] == "lee-2001-lathe"
    problems = {job["name"]: job["problems"] for job in found["jobs"]}
    assert problems["lee-2001-experiment-1"] == []
    assert any("thicker than the radius" in sentence for sentence in problems["thick"])


def test_an_unknown_machine_is_refused_with_those_that_are_known(console: Console) -> None:
    said = console("jobs", "--machine", "no-such-lathe")
    assert (said.code, said.out) == (1, "") and "no-such-lathe" in said.err and "lee-2001-lathe" in said.err


def test_a_configured_machine_leaves_the_list_as_it_is(
    console: Console, own_jobs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TRILOBE_MACHINE", "no-such-lathe")
    assert console("jobs").code == 0 and "fits" not in console("jobs").out
