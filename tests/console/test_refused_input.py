"""Bad input: one clear line on stderr, the right exit code, the same as JSON; closed streams."""

from __future__ import annotations

import json
import os
import random
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import profiles.store
from profiles.store import load_job, save_job
from tests.console.commands import Console, JobFile


def refused(said: Any, *words: str, code: int = 1) -> None:
    assert said.code == code
    assert said.out == "" or json.loads(said.out)["errors"]  # with --json the reason is an object as well
    assert said.err.count("\n") == 1, said.err
    assert "Traceback" not in said.err
    for word in words:
        assert word in said.err


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wall_thickness_mm": "40.0"}, ("wall_thickness_mm", "40", "26 mm")),
        ({"chucking_force_n": "-5"}, ("chucking_force_n", "-5", ">= 0.1")),
        ({"feed_mm_per_rev": None}, ("feed_mm_per_rev", "missing")),
        ({"depth_of_cut_mm": "nan"}, ("depth_of_cut_mm", "nan", "finite")),
        ({"spindle_speed_rpm": "inf"}, ("spindle_speed_rpm", "inf")),
        ({"jaws": "3.5"}, ("jaws", "3.5", "whole")),
        ({"jaws": '"three"'}, ("jaws", "three")),
        ({"material": "7"}, ("material", "7")),
        ({"lobe_error_source": '"guessed"'}, ("lobe_error_source", "guessed", "measured")),
        ({"overhang_mm": "30.0\ncolour = 3"}, ("colour",)),
        ({"chucking_force_n": "344.0", "lobe_force_n": "344.0"}, ("grip margin", "0 N")),
        (
            {
                "spindle_speed_rpm": "3500.0",
                "chucking_force_n": "5000.0",
                "lobe_force_n": "5000.0",
                "material": '"A6061"',
            },
            ("3500 rpm", "3000 rpm"),
        ),
        ({"cut_length_mm": "29.0"}, ("29 mm", "28 mm")),
        ({"depth_of_cut_mm": "0.02"}, ("depth_of_cut_mm", "0.02 mm", ">= 0.0325 mm", "leaves the part")),
        ({"lobe_error_um_pp": "300.0"}, ("depth_of_cut_mm", "0.1 mm", ">= 0.155 mm", "cut deeper")),
        ({"wall_thickness_mm": "1e-320"}, ("wall_thickness_mm", "1e-320", ">= 0.001, <= 250 mm")),
        ({"lobe_error_um_pp": "1e-320"}, ("lobe_error_um_pp", "1e-320", ">= 0, <= 1000 um")),
    ],
)
def test_a_job_that_cannot_be_is_refused_by_key_value_and_limit(
    console: Console, job_file: JobFile, data_folder: Path, changes: dict[str, str | None], words: tuple[str, ...]
) -> None:
    path = job_file(**changes)
    refused(console("run", str(path), "--sim", "--json"), "mine.toml", *words)
    assert not data_folder.exists()


def test_a_file_that_is_no_job_is_one_line_and_every_mistake_of_one_is_told_at_once(
    console: Console, job_file: JobFile, tmp_path: Path
) -> None:
    path = tmp_path / "empty.toml"
    path.touch()
    for language, told in (("en", "keys are missing"), ("ko", "빠진 키")):
        said = console("run", str(path), "--sim", "--lang", language)
        refused(said, "empty.toml", "chucking_force_n", "jaws", told)
    path.write_bytes(random.Random(7).randbytes(4000))
    refused(console("run", str(path), "--sim"), "empty.toml")
    said = console("run", str(job_file(chucking_force_n="-5", jaws="1", feed_mm_per_rev=None)), "--sim")
    assert said.code == 1 and len(said.err.splitlines()) == 3


def test_a_machine_without_a_setting_says_so_without_a_hole(console: Console, tmp_path: Path) -> None:
    text = (profiles.store.BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    path = tmp_path / "bare.toml"
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("I311 ")))
    said = console("preview", "lee-2001-experiment-1", "--machine", str(path))
    refused(said, "bare.toml", "I311", "allowed any number")


RUN = ("run", "lee-2001-experiment-1", "--sim")
USAGE: list[tuple[tuple[str, ...], tuple[str, ...]]] = [
    (("frobnicate",), ()),
    (("run",), ()),
    ((*RUN, "--strategy", "magic"), ()),
    ((*RUN, "--ts", "5"), ()),
    *(((*RUN, "--strategy", "paper", "--ts", ts), ()) for ts in ("-1", "2.5")),
    ((*RUN, "--lang", "xx"), ()),
    ((*RUN, "--frob"), ()),
    (("run", "any", "--colour", "red"), ("--colour red", "--help")),
    (("run", "any", "--seed"), ("--seed needs a value",)),
    (("jobs", "--machine"), ("--machine needs a value",)),
    (("records",), ("ACTION (list, show, debrief, export)", "--help")),
    (("roundness", "x.csv", "--filter", "zero"), ()),
    (("simulator",), ()),
    (("simulator", "--tcp", "nonsense"), ("nonsense", "HOST:PORT")),
    (("simulator", "--tcp", "localhost:99999"), ()),
    *((words, ()) for words in (("fault",), ("fault", "unix:/run/x"), ("fault", "tcp:10.0.0.1:5", "list"))),
]


def test_wrong_usage_is_one_line_and_exit_2_with_what_there_is(console: Console) -> None:
    for words, told in USAGE:
        refused(console(*words), *told, code=2)


def test_fixed_words_are_korean_too(console: Console, tmp_path: Path) -> None:
    refused(console("preview", f"{tmp_path}/", "--lang", "ko"), "보통 파일이 아님")
    assert "usage:" not in console("jobs", "--help", "--lang", "ko").out
    assert "사용법: console jobs" in console("jobs", "--help", "--lang", "ko").out
    assert "usage: console jobs" in console("jobs", "--help").out


@pytest.mark.parametrize(
    ("words", "met"),
    [
        (("run", "nowhere.toml", "--sim"), "nowhere.toml"),
        (("run", "no-such-job", "--sim"), "lee-2001-experiment-1"),
        (("run", "lee-2001-experiment-1", "--sim", "--machine", "nobody"), "lee-2001-lathe"),
        (("run", "lee-2001-experiment-1"), "--sim"),
        (("preview", "no-such-job"), "no-such-job"),
        (("program", "no-such-job"), "no-such-job"),
        (("roundness", "nowhere.csv"), "nowhere.csv"),
    ],
)
def test_what_is_not_there_is_refused(console: Console, words: tuple[str, ...], met: str) -> None:
    refused(console(*words), met)


def test_alone_it_prints_the_choices_and_every_command_explains_itself(console: Console) -> None:
    said = console()
    assert said.code == 2
    for command in ("jobs", "preview", "program", "run", "simulator", "fault", "roundness"):
        assert command in said.out and command in said.err
        for language in ("en", "ko"):
            helped = console(command, "--help", "--lang", language)
            assert helped.code == 0 and "--json" in helped.out and "--lang" in helped.out


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


FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")


def shell(words: str, *, unbuffered: bool = False) -> subprocess.CompletedProcess[str]:
    command = f"{sys.executable} -m console {words}"
    environment = {**os.environ, "PYTHONUNBUFFERED": "1" if unbuffered else "", "LC_ALL": "C.UTF-8"}
    return subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=30, env=environment)


@pytest.mark.parametrize("closed", [pytest.param(">&-", marks=pytest.mark.long), "2>&-", "<&- >&- 2>&-"])
@pytest.mark.first(1)
def test_a_closed_stream_changes_nothing_else(closed: str) -> None:
    done = shell(f"jobs {closed}")
    assert (done.returncode, done.stderr) == (0, "")
    assert ("lee-2001-experiment-1" in done.stdout) == (closed == "2>&-")
    assert shell(f"preview no-such-job {closed}").returncode == 1
    assert shell(f"frobnicate {closed}").returncode == 2


@needs_full
@pytest.mark.parametrize("unbuffered", [False, True])
@pytest.mark.parametrize(
    "words", ["jobs", "--help", "jobs --help", "predict lee-2001-experiment-1 --json", "--version"]
)
@pytest.mark.first(3)
def test_a_full_disk_is_one_line(words: str, unbuffered: bool) -> None:
    done = shell(f"{words} >{FULL}", unbuffered=unbuffered)
    assert done.returncode == 1
    assert done.stderr == "console: cannot write the output (No space left on device)\n"


def test_an_output_that_only_reads_is_one_line() -> None:
    done = shell("jobs 1<&0 0</dev/null 1<&0")
    assert (done.returncode, done.stderr) == (1, "console: cannot write the output (Bad file descriptor)\n")


@needs_full
def test_wrong_usage_stays_wrong_usage_on_a_full_disk() -> None:
    done = shell(f"frobnicate >{FULL}")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "module", ["console.text.catalogue", "console.cli.parser", "console.cli.part.jobs", "tomllib"]
)
def test_a_ctrl_c_during_the_imports_is_one_line(module: str) -> None:
    interrupted = f"""
import sys
class Interrupt:
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt())
from console.__main__ import main
sys.exit(main(["jobs"]))
"""
    environment = {**os.environ, "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        [sys.executable, "-c", interrupted], capture_output=True, text=True, timeout=30, env=environment
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "console: ended by SIGINT; this command was not moving anything\n"


def test_the_entry_point_imports_nothing_of_the_project() -> None:
    show = (
        "import sys, console.__main__; print(*(name for name in sys.modules"
        " if name.split('.')[0] in ('profiles', 'drivers', 'console')))"
    )
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.split() == ["console", "console.__main__"]


TIMEOUT_S = 10.0


@contextmanager
def answering(path: Path, said: bytes) -> Iterator[list[bytes]]:
    """Somebody at a socket who reads one line, and then says this."""
    lines: list[bytes] = []
    with closing(socket.socket(socket.AF_UNIX)) as listening:
        listening.bind(str(path))
        listening.listen()
        listening.settimeout(TIMEOUT_S)

        def serve() -> None:
            host, _ = listening.accept()
            with closing(host):
                host.settimeout(TIMEOUT_S)
                with host.makefile("rb") as reading:
                    lines.append(reading.readline())
                host.sendall(said)

        serving = threading.Thread(target=serve)
        serving.start()
        yield lines
        serving.join(TIMEOUT_S)


def test_the_answer_is_printed_without_its_verdict(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "faults"
    with answering(path, b"stranger-writes\nok\n") as lines:
        said = console("fault", f"unix:{path}", "inject", "stranger-writes", "line=#1J+ P1=3", "seed=3")
    assert (said.code, said.out, said.err) == (0, "stranger-writes\n", "")
    assert lines == [b"inject stranger-writes 'line=#1J+ P1=3' seed=3\n"]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_refusal_is_told_in_one_line_with_its_reason(console: Console, tmp_path: Path, language: str) -> None:
    path = tmp_path / "faults"
    with answering(path, b"refused: nul: share '2' is not possible; allowed: 0 < share <= 1\n"):
        said = console("fault", f"control:unix:{path}", "inject", "nul", "share=2", "--lang", language)
    assert (said.code, said.out, len(said.err.splitlines())) == (1, "", 1)
    assert "nul: share '2' is not possible; allowed: 0 < share <= 1" in said.err


@pytest.mark.parametrize(("verdict", "reason"), [(b"ok", None), (b"refused: why", "why")])
def test_as_json_answer_and_reason(console: Console, tmp_path: Path, verdict: bytes, reason: str | None) -> None:
    path = tmp_path / "faults"
    with answering(path, b"a\nb\n" + verdict + b"\n"):
        said = console("fault", f"unix:{path}", "active", "--json")
    assert json.loads(said.out) == {"schema": 1, "answer": ["a", "b"], "refused": reason, "simulated": True}
    assert said.code == (0 if reason is None else 1)


def test_two_lines_nobody_there_and_a_broken_answer_are_refused(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "faults"
    with answering(path, b"half a li"):
        said = console("fault", f"unix:{path}", "list")
    assert (said.code, said.out) == (1, "")
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        port = server.getsockname()[1]
    for address in (f"tcp:127.0.0.1:{port}", f"unix:{tmp_path / 'nothing'}"):
        refused(console("fault", address, "list"))
    for language in ("en", "ko"):
        refused(console("fault", address, "inject", "nul\nclear", "--lang", language), code=2)
