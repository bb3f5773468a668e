"""`console check-program`, through the real entry point."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import console as package
from console.text.catalogue import load
from console.text.columns import broken, cell_width
from drivers.pmac.analysis.findings import Code, Said

Console = Callable[..., Any]

ROOT = Path(__file__).parents[2]
CLEAN = "OPEN PROG 1\nCLEAR\nINC\nTA100 TS20 TM500\nX1000\nDWELL10\nX-1000\nCLOSE\n"


@pytest.fixture
def printed(tmp_path: Path) -> Path:
    """Prog. 1 of the paper as a file, literally."""
    section = (
        (ROOT / "docs/paper-program.md").read_text(encoding="utf-8").split("\n## The printed program\n", 1)[1]
    )
    path = tmp_path / "prog1.pmc"
    path.write_text(re.split(r"^```\w*\n", section, maxsplit=2, flags=re.MULTILINE)[1], encoding="utf-8")
    return path


@pytest.fixture
def meant(printed: Path) -> Path:
    """The same with the move time of 10 ms that its comment names."""
    path = printed.with_name("meant.pmc")
    path.write_text(re.sub(r"P400=[^;]*", "P400=1000/(2*50) ", printed.read_text("utf-8")), encoding="utf-8")
    return path


@pytest.fixture
def program(tmp_path: Path) -> Callable[[str], str]:
    def write(text: str) -> str:
        path = tmp_path / "mine.pmc"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def test_the_papers_program_is_explained_in_plain_sentences(console: Console, meant: Path) -> None:
    said = console("check-program", str(meant))
    text = " ".join(said.out.split())
    for words in (
        "a zig-zag of 55 um, 10 ms each way, 50 Hz",
        "an acceleration time of 20 ms",
        "TM 10 became 20 ms",
        "the zig-zag went at 25 Hz in place of 50, and the spindle at 500 rpm in place of 1000",
        "of 55 um only 36.67 were made (66.7 %)",
        "leaves 18.3 of 55 um",
        "27.8 of 55 um (51 %)",
        "2 mm towards the part",
        "nothing in the program ends this loop",
    ):
        assert words in text
    assert said.err == ""


def test_a_program_that_would_crash_leaves_with_1_and_a_clean_one_with_0(
    console: Console, printed: Path, program: Callable[[str], str]
) -> None:
    assert console("check-program", str(printed)).code == 1
    clean = console("check-program", program(CLEAN))
    assert (clean.code, clean.err) == (0, "")
    assert "no findings" in clean.out


def test_a_warning_alone_leaves_with_0(console: Console, program: Callable[[str], str]) -> None:
    said = console("check-program", program(CLEAN.replace("TM500", "TM50")))
    assert "TM 50 ms becomes 100 ms" in said.out
    assert said.code == 0


def test_repeated_moves_stand_once_with_their_number(console: Console, meant: Path) -> None:
    said = console("check-program", str(meant))
    row = next(line for line in said.out.splitlines() if "-183.33" in line)
    assert re.search(r"23 +x \d+  10>20  10  10>20  #1 +-275 +-183.33 +545.83$", row)
    assert sum("x " in line for line in said.out.splitlines()) == 4  # two lines in each of two tables


@pytest.mark.parametrize("language", ["en", "ko"])
def test_everything_fits_80_columns(console: Console, printed: Path, tmp_path: Path, language: str) -> None:
    files = [printed]
    for strategy in ("paper", "pvt"):
        files.append(tmp_path / f"{strategy}.pmc")
        text = console("program", "lee-2001-experiment-1", "--strategy", strategy).out
        files[-1].write_text(text, encoding="utf-8")
    for path in files:
        for line in console("check-program", str(path), "--lang", language).out.splitlines():
            assert cell_width(line) <= 80, line


def test_the_lines_of_a_long_program_are_not_all_listed(console: Console, program: Callable[[str], str]) -> None:
    text = "OPEN PROG 1\nINC\nTA10 TS10 TM20\n" + "X10\nX-20\n" * 100 + "CLOSE\n"
    assert "lines 4-203: TA 10 with TS 10" in console("check-program", program(text)).out
    scattered = text.replace("X-20\n", "X-20\n;\n")
    assert "lines 4-5, 7-8, 10-11, 13-14, ...: TA 10" in console("check-program", program(scattered)).out


def test_json_has_every_move_unrounded(console: Console, meant: Path) -> None:
    said = console("check-program", str(meant), "--json")
    result = said.json
    assert said.code == 1
    move = result["moves"][10]
    assert (move["mode"], move["commanded"]["tm_ms"], move["effective"]["tm_ms"]) == ("LINEAR", 10, 20)
    tool, spindle, carriage = move["motors"]
    assert abs(tool["made_counts"]) == pytest.approx(275 * 2 / 3, abs=1e-9)
    assert abs(tool["made_mm"]) == pytest.approx(0.055 * 2 / 3, abs=1e-12)
    assert tool["lost_counts"] == pytest.approx(275 / 3)
    assert tool["acceleration_m_per_s2"] == pytest.approx(0.55)
    assert tool["jerk_m_per_s3"] == pytest.approx(55)
    assert spindle["velocity_rpm"] == pytest.approx(500)
    assert spindle["made_deg"] == pytest.approx(60)
    assert carriage["made_mm"] == 0
    codes = {finding["code"]: finding for finding in result["findings"]}
    assert codes["plunge"]["level"] == "fault"
    assert codes["stroke_lost"]["lines"] == [21, 23]
    assert codes["stroke_lost"]["values"]["kept_percent"] == pytest.approx(66.6667, abs=1e-4)
    assert [sentence["code"] for sentence in result["explanation"]][:2] == ["told", "acceleration_time"]


def test_times_of_the_operator_take_the_place_of_the_printed_ones(console: Console, meant: Path) -> None:
    result = console("check-program", str(meant), "--ta", "5", "--ts", "0", "--json").json
    assert (result["ta_ms"], result["ts_ms"]) == (5, 0)
    lost = next(finding for finding in result["findings"] if finding["code"] == "stroke_lost")
    assert lost["values"]["kept_percent"] == pytest.approx(75)
    assert "stretched" not in {finding["code"] for finding in result["findings"]}


def test_a_lobe_that_drifts_is_told(console: Console, meant: Path) -> None:
    meant.write_text(meant.read_text("utf-8").replace("10000/6", "1666"), encoding="utf-8")
    assert "drift by -0.144 deg a turn (-4 counts); after 138.9 turns" in " ".join(
        console("check-program", str(meant)).out.split()
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("P1=1\n", "no OPEN PROG"),
        ("OPEN PROG 1\nWHILE(P1=0)\nX1\nCLOSE\n", "ERR016"),
        ("OPEN PROG 1\nENDWHILE\nCLOSE\n", "ERR009"),
    ],
)
def test_what_is_no_program_is_refused_in_one_line(
    console: Console, program: Callable[[str], str], text: str, words: str
) -> None:
    said = console("check-program", program(text))
    assert (said.code, said.out) == (1, "")
    assert words in said.err
    assert "mine.pmc" in said.err
    assert said.err.count("\n") == 1


def test_a_file_that_is_not_there_is_told(console: Console, tmp_path: Path) -> None:
    said = console("check-program", str(tmp_path / "none.pmc"))
    assert said.code == 1
    assert "none.pmc" in said.err


def test_comments_in_another_encoding_do_no_harm(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "cp949.pmc"
    path.write_bytes(CLEAN.replace("DWELL10", "DWELL10 ;공구").encode("cp949"))
    assert "no findings" in console("check-program", str(path)).out


def test_wrong_words_are_wrong_usage(console: Console, meant: Path) -> None:
    assert console("check-program").code == 2
    said = console("check-program", str(meant), "--ta", "1.5")
    assert said.code == 2
    assert "1.5" in said.err


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_finding_and_every_sentence_has_its_words(language: str) -> None:
    (folder,) = package.__path__
    entries = tomllib.loads((Path(folder) / "text" / language / "check-program.toml").read_text("utf-8"))
    wanted = {f"check.finding.{code}" for code in Code} | {f"check.said.{said}" for said in Said}
    assert wanted == {key for key in entries if key.startswith(("check.finding.", "check.said."))}
    assert load(language)("check.clean") == entries["check.clean"]


def test_text_is_broken_at_spaces_by_cells() -> None:
    assert broken("one two three", 7) == ["one two", "three"]
    assert broken("한글 두 칸", 7) == ["한글 두", "칸"]
    assert broken("unbreakable", 4) == ["unbreakable"]
