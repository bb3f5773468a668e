"""A code of a scanner: put together from keys that did nothing; `job:NAME` names a job, the rest means nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.events import Key

from console.tui.application.scan_collector import Collector, Scan
from console.tui.application.scans import LONGEST, found, job_named, keys_of, shown
from console.tui.driver import Reader
from console.tui.pace import Pace
from profiles.problem import Problem
from profiles.store import LibraryEntry

FAST_S = 0.004


def heard(*pieces: tuple[float, str], gap_s: float = FAST_S) -> list[Scan]:
    """What is made of pieces of terminal input, each at its time, its characters a moment apart."""
    pace, codes = Pace[str](), Collector()
    said: list[Scan | None] = []
    reader, at_s = Reader(), 0.0
    for begin_s, piece in pieces:
        at_s = max(at_s, begin_s)
        said.append(codes.due(at_s))
        pace.due(at_s - 1e-6)  # what was held back was done meanwhile
        for character in piece:
            at_s += gap_s
            for event in reader.read(character, at_s):
                assert isinstance(event, Key)
                burst = pace.hold(event.key, event.key, at_s)
                said.append(
                    codes.hear(event.key, event.character, at_s, burst=burst, written=False, stopped=False)
                )
    said.append(codes.due(at_s + 10.0))
    return [each for each in said if each is not None]


@pytest.mark.parametrize("end", ["", "\r", "\n", "\r\n", "\t"])
@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.03])
def test_the_whole_code_is_there_however_it_ends(end: str, gap_s: float) -> None:
    assert [each.text for each in heard((0.0, f"job:flange-1{end}"), gap_s=gap_s)] == ["job:flange-1"]


def test_two_pieces_of_a_slow_line_are_one_code() -> None:
    assert [each.text for each in heard((0.0, "job:fla"), (0.3, "nge-1\r"))] == ["job:flange-1"]


def test_two_codes_in_a_row_are_two() -> None:
    assert [each.text for each in heard((0.0, "job:one\r\njob:two\r\n"))] == ["job:one", "job:two"]


def test_a_person_scans_nothing() -> None:
    assert heard(*((0.2 * n, key) for n, key in enumerate("job:flange-1\r"))) == []
    assert heard((0.0, "14")) == []  # two keys in one piece


def test_arrows_and_function_keys_are_no_code() -> None:
    assert heard((0.0, "\x1b[A\x1b[B1234\r")) == []


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("job:flange-1", "flange-1"),
        ("JOB:FLANGE-1", "FLANGE-1"),
        ("job: flange-1 ", "flange-1"),
        ("ㅓㅐㅠ:리뭏ㄷ-1", "flange-1"),
        ("ㅓㅐㅠ:flange-1", "flange-1"),
        ("job:플랜지", "플랜지"),
        ("b:flange-1", None),
        ("flange-1", None),
        ("job:", None),
        ("WO-10024", None),
    ],
)
def test_only_a_whole_prefix_names_a_job(code: str, name: str | None) -> None:
    assert job_named(code) == name


def test_the_keys_of_the_hangul_layout() -> None:
    """The two-set layout of KS X 5002: the key q writes ㅂ, and a syllable is written by two to five keys."""
    assert keys_of("ㅂㅈㄷㄱㅅ") == "qwert"
    assert keys_of("한글") == "gksrmf"
    assert keys_of("닭뷁괜찮다") == "ekfrqnpfrrhoscksgek"
    assert keys_of("ㅃㅖ-1") == "QP-1"


def entries(*names: str) -> list[LibraryEntry]:
    return [LibraryEntry(name=name, path=Path(f"{name}.toml"), bundled=False) for name in names]


def test_a_name_is_found_as_written_else_in_whatever_case() -> None:
    jobs = entries("flange-1", "Flange-2", "FLANGE-2", "ring")
    for name, expected in (("flange-1", "flange-1"), ("RING", "ring"), ("FLANGE-2", "FLANGE-2")):
        entry = found(jobs, name)
        assert isinstance(entry, LibraryEntry) and entry.name == expected
    for name, code in (("flange-2", "screen.scanned_several"), ("flange", "screen.scanned_no_job")):
        problem = found(jobs, name)
        assert isinstance(problem, Problem) and problem.code == code


def test_a_name_in_hangul_is_not_taken_for_its_keys() -> None:
    entry = found(entries("플랜지", "vmffoswl"), "플랜지")
    assert isinstance(entry, LibraryEntry) and entry.name == "플랜지"


def test_what_is_shown_is_harmless_and_short() -> None:
    assert "\x1b" not in shown("job:\x1b[2J")
    assert len(shown("x" * 500)) == LONGEST
