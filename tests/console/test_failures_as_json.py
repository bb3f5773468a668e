"""What a script relies on: failures as JSON, a schema in each object, exit codes, output in any encoding."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from profiles.store import load_job, save_job
from tests.console.commands import Console


@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        (("preview", "nope"), 1, "job.unknown"),
        (("watch",), 1, "feed.none"),
        (("frobnicate",), 2, "usage"),
        (("jobs", "--frob"), 2, "usage"),
        (("simulator",), 2, "usage"),  # told by the command itself
        (("--instructor", "unix:/tmp/x"), 2, "usage"),
    ],
)
@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_failure_is_one_object_with_the_line_for_people_beside_it(
    console: Console, tmp_path: Path, words: tuple[str, ...], code: int, error: str, language: str
) -> None:
    options = ("--json", "--lang", language, "--data", str(tmp_path))
    said = console(*(words + options if words[0][0] != "-" else options + words))
    assert said.code == code
    assert (said.json["schema"], said.json["exit_code"]) == (1, code)
    (found,) = said.json["errors"]
    assert found["code"] == error
    assert found["text"] and said.err.strip().endswith(found["text"])
    assert set(found) == {"text", "code", "where", "key", "value", "limit"}


def test_without_json_nothing_is_on_stdout(console: Console) -> None:
    assert console("preview", "nope").out == ""


def test_every_problem_is_in_it(console: Console, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    text = load_job("lee-2001-experiment-1").path.read_text(encoding="utf-8")
    wrong.write_text(text.replace("diameter_mm = 52.0", "diameter_mm = -1.0").replace("feed_mm_per_rev", "fed"))
    said = console("preview", str(wrong), "--json")
    assert len(said.json["errors"]) == said.err.count("\n") >= 2
    assert all(each["where"] == str(wrong) for each in said.json["errors"])


def test_a_result_that_was_printed_stays_the_only_object(console: Console, tmp_path: Path) -> None:
    bad = tmp_path / "bad.pmc"
    bad.write_text("OPEN PROG 1 CLEAR\nX1000000\nCLOSE\n")
    said = console("check-program", str(bad), "--json")
    assert "schema" in said.json and "errors" not in said.json


@pytest.mark.parametrize(
    "words",
    [("--version",), ("jobs",), ("lessons",), ("config",), ("records", "list"), ("mtconnect", "--devices")],
)
def test_every_object_has_its_schema(console: Console, tmp_path: Path, words: tuple[str, ...]) -> None:
    assert console(*words, "--json", "--data", str(tmp_path)).json["schema"] == 1


@pytest.mark.parametrize(("tolerance_um", "code"), [(100.0, 0), (5.0, 3)])
@pytest.mark.first(1)
def test_a_part_out_of_tolerance_is_told_by_the_exit_code_on_request(
    console: Console, close: tuple[str, str], tmp_path: Path, tolerance_um: float, code: int
) -> None:
    # A plain cut leaves the whole lobe of the job, 33 um p-p: between the two tolerances.
    job = tmp_path / "ring.toml"
    short = replace(load_job("lee-2001-experiment-2").job, cut_length_mm=0.5, roundness_tolerance_um=tolerance_um)
    save_job(short, job)
    trace = tmp_path / "part.csv"
    words = ("run", str(job), *close, "--sim", "--json", "--strategy", "none", "--part", str(trace))
    ran = console(*words, "--fail-out-of-tolerance")
    assert (ran.code, ran.json["within_tolerance"]) == (code, code == 0)
    assert "errors" not in ran.json
    measured = ("roundness", str(trace), "--job", str(job), "--json")
    assert console(*measured).code == 0  # only on request
    assert console(*measured, "--fail-out-of-tolerance").code == code
    assert console("roundness", str(trace), "--fail-out-of-tolerance").code == 2  # the tolerance is in the job


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "environment",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "latin-1"},
    ],
    ids=["C", "ascii", "latin-1"],
)
def test_signs_are_spelled_and_korean_comes_with_a_hint(environment: dict[str, str], tmp_path: Path) -> None:
    def said(*words: str) -> tuple[str, str]:
        command = [sys.executable, "-m", "console", *words, "--data", str(tmp_path)]
        done = subprocess.run(command, capture_output=True, env={**os.environ, **environment}, check=True)
        assert b"Traceback" not in done.stderr
        return done.stdout.decode("latin-1"), done.stderr.decode("latin-1")

    out, err = said("predict", "lee-2001-experiment-1", "--lang", "en")
    assert err == "" and "?" not in out
    assert ("±" if environment.get("PYTHONIOENCODING") == "latin-1" else "+/- ") in out and "..." in out
    out, err = said("jobs", "--lang", "ko")
    assert "???" in out and "lee-2001-experiment-1" in out
    assert "cannot show Korean; set LC_ALL=C.UTF-8" in err and "--lang en" in err
    out, _ = said("jobs", "--lang", "ko", "--json")
    assert json.loads(out)["jobs"]  # JSON has escapes of its own
