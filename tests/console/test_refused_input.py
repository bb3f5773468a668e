"""Bad input: one clear line on stderr, the right exit code, and nothing moved or recorded."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

import pytest

import profiles.store
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


def test_every_mistake_of_a_file_is_told_at_once(console: Console, job_file: JobFile) -> None:
    said = console("run", str(job_file(chucking_force_n="-5", jaws="1", feed_mm_per_rev=None)), "--sim")
    assert said.code == 1
    assert len(said.err.splitlines()) == 3


@pytest.mark.parametrize(("language", "said"), [("en", "keys are missing"), ("ko", "빠진 키")])
def test_an_empty_job_file_is_one_line(console: Console, tmp_path: Path, language: str, said: str) -> None:
    path = tmp_path / "empty.toml"
    path.touch()
    refused(console("run", str(path), "--sim", "--lang", language), "empty.toml", "chucking_force_n", "jaws", said)


def test_a_machine_without_a_setting_says_so_without_a_hole(console: Console, tmp_path: Path) -> None:
    text = (profiles.store.BUNDLED_MACHINES / "lee-2001-lathe.toml").read_text(encoding="utf-8")
    path = tmp_path / "bare.toml"
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("I311 ")))
    said = console("preview", "lee-2001-experiment-1", "--machine", str(path))
    refused(said, "bare.toml", "I311", "allowed any number")


def test_a_wrong_address_is_told_in_its_own_words(console: Console) -> None:
    refused(console("simulator", "--tcp", "nonsense"), "nonsense", "HOST:PORT", code=2)


def test_fixed_words_are_korean_too(console: Console, tmp_path: Path) -> None:
    refused(console("preview", f"{tmp_path}/", "--lang", "ko"), "보통 파일이 아님")
    assert "usage:" not in console("jobs", "--help", "--lang", "ko").out
    assert "사용법: console jobs" in console("jobs", "--help", "--lang", "ko").out
    assert "usage: console jobs" in console("jobs", "--help").out


def test_random_bytes_are_no_job(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "noise.toml"
    path.write_bytes(random.Random(7).randbytes(4000))
    refused(console("run", str(path), "--sim"), "noise.toml")


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


@pytest.mark.parametrize(
    "words",
    [
        ("frobnicate",),
        ("run",),
        ("run", "lee-2001-experiment-1", "--sim", "--strategy", "magic"),
        ("run", "lee-2001-experiment-1", "--sim", "--ts", "5"),
        ("run", "lee-2001-experiment-1", "--sim", "--strategy", "paper", "--ts", "-1"),
        ("run", "lee-2001-experiment-1", "--sim", "--strategy", "paper", "--ts", "2.5"),
        ("run", "lee-2001-experiment-1", "--sim", "--lang", "xx"),
        ("run", "lee-2001-experiment-1", "--sim", "--frob"),
        ("roundness", "x.csv", "--filter", "zero"),
        ("simulator",),
        ("simulator", "--tcp", "nonsense"),
        ("simulator", "--tcp", "localhost:99999"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(console: Console, words: tuple[str, ...]) -> None:
    refused(console(*words), code=2)


def test_alone_it_prints_the_choices(console: Console) -> None:
    said = console()
    assert said.code == 2
    for command in ("jobs", "preview", "program", "run", "simulator", "fault", "roundness"):
        assert command in said.out
        assert command in said.err


@pytest.mark.parametrize("command", ["jobs", "preview", "program", "run", "simulator", "fault", "roundness"])
@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_command_explains_itself(console: Console, command: str, language: str) -> None:
    said = console(command, "--help", "--lang", language)
    assert said.code == 0
    assert "--json" in said.out
    assert "--lang" in said.out


def test_a_missing_or_unknown_word_is_answered_with_what_there_is(console: Console) -> None:
    refused(console("records"), "ACTION (list, show, debrief, export)", "--help", code=2)
    refused(console("run", "any", "--colour", "red"), "--colour red", "--help", code=2)
    refused(console("run", "any", "--seed"), "--seed needs a value", code=2)
    refused(console("jobs", "--machine"), "--machine needs a value", code=2)
