"""`console check-program`, through the real entry point."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

import console as package
from console.cli.part.check_program_report import PlainNumber
from console.text.catalogue import load
from console.text.columns import cell_width, wrap_text
from drivers.pmac.analysis.findings import ExplanationSentence, FindingCode
from tests.console.commands import Console

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
        "TM 10 becomes 20 ms",
        "The zig-zag therefore runs at 25 Hz instead of 50, and the spindle at 500 rpm instead of 1000",
        "only 36.67 of 55 um is travelled (66.7 %)",
        "leaves 18.3 of 55 um",
        "27.8 of 55 um (51 %)",
        "2 mm toward the part",
        "nothing in the program ends this loop",
    ):
        assert words in text
    assert said.err == ""


def test_a_crash_is_1_a_warning_or_nothing_is_0(
    console: Console, printed: Path, program: Callable[[str], str]
) -> None:
    assert console("check-program", str(printed)).code == 1
    clean = console("check-program", program(CLEAN))
    assert (clean.code, clean.err) == (0, "") and "no findings" in clean.out
    said = console("check-program", program(CLEAN.replace("TM500", "TM50")))
    assert said.code == 0 and "TM 50 ms becomes 100 ms" in said.out


def test_repeated_moves_stand_once_with_their_number(console: Console, meant: Path) -> None:
    said = console("check-program", str(meant))
    row = next(line for line in said.out.splitlines() if "-183.33" in line)
    assert re.search(r"23 +x \d+  10>20  10  10>20  #1 +-275 +-183.33 +545.83$", row)
    assert sum("x " in line for line in said.out.splitlines()) == 4  # two lines in each of two tables


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.long
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


def test_rounding_does_not_unfold_what_repeats(console: Console, program: Callable[[str], str]) -> None:
    """The spindle turns evenly: what is left of its acceleration is arithmetic, and no jerk without a value."""
    text = console("program", "lee-2001-experiment-1", "--strategy", "paper").out
    path = program(text)
    asked = console("check-program", path, "--ta", "5", "--ts", "0").out.splitlines()
    assert len(asked) < 80
    assert max(int(found[1]) for row in asked if (found := re.search(r"x (\d+) ", row))) > 500


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("job", "strategy"),
    [
        ("lee-2001-experiment-1", "pvt"),
        ("lee-2001-experiment-2", "paper"),
        ("lee-2001-experiment-1", "none"),
    ],
)
def test_what_is_printed_is_sound(
    console: Console, program: Callable[[str], str], job: str, strategy: str
) -> None:
    said = console("check-program", program(console("program", job, "--strategy", strategy).out))
    assert said.code == 0
    assert re.search(r"^Starts at X\d+ Y[\d.]+ Z169300, as line 1 states\.", said.out, re.MULTILINE)
    assert "✗" not in said.out
    assert "deeper than it started" not in said.out


def test_the_printed_program_is_the_same_in_json(console: Console) -> None:
    words = ("program", "lee-2001-experiment-1", "--strategy", "pvt")
    assert console(*words, "--json").json["program"] == console(*words).out


def test_the_start_is_told_and_may_be_given(console: Console, program: Callable[[str], str]) -> None:
    path = program("; starts at X7\n" + CLEAN.replace("INC", "ABS"))
    assert "Starts at X7 Y0 Z0, as line 1 states." in console("check-program", path).out
    said = console("check-program", path, "--from", "X=1000,Y=-5")
    assert "Starts at X1000 Y-5 Z0, as given with --from." in said.out
    result = console("check-program", path, "--from", "X=1000,Y=-5", "--json").json
    assert result["start"] == {"source": "operator", "positions": {"X": 1000, "Y": -5, "Z": 0}}
    assert result["moves"][0]["motors"][0]["commanded_counts"] == 0
    assert "All motors start at home, 0 counts." in console("check-program", program(CLEAN)).out


@pytest.mark.parametrize(
    ("start", "code", "words"),
    [
        ("X", 2, "--from: 'X' is not a position; give each axis once with a number"),
        ("X=1,X=2", 2, "--from: 'X=2' is not a position"),
        ("X=1e5", 2, "--from: 'X=1e5' is not a position"),
        ("U=5", 1, "no motor drives the axis U of the start position; axes here: X, Y, Z"),
        ("X=99999999999", 1, "the program cannot start with motor #1 at 99999999999 counts"),
    ],
)
def test_a_start_that_is_none_is_refused(console: Console, meant: Path, start: str, code: int, words: str) -> None:
    said = console("check-program", str(meant), "--from", start)
    assert (said.code, said.out) == (code, "")
    assert words in said.err
    assert said.err.count("\n") == 1


def test_a_long_text_has_its_findings_first_and_some_rows(console: Console, program: Callable[[str], str]) -> None:
    """100 moves to and fro with 100 ways, and the turn of the spindle: 200 rows in each table."""
    moves = "".join(f"X{way} Y1000\nX-{way} Y1000\n" for way in range(101, 151))
    path = program(f"OPEN PROG 1\nINC\nTA10 TS5 TM20\n{moves}CLOSE\n")
    rows = console("check-program", path).out.splitlines()
    title = next(number for number, row in enumerate(rows) if row.startswith("line  "))
    finding = next(number for number, row in enumerate(rows) if row.startswith("!"))
    assert finding < title
    assert [row for row in rows if "more rows" in row] == ["... 160 more rows; --json lists every move"] * 2
    assert len(rows) < title + 90
    assert len(console("check-program", path, "--json").json["moves"]) == 100


def test_the_numbers_of_the_printed_program_are_the_same_wherever_they_are_said(
    console: Console, printed: Path
) -> None:
    """TM 1/10300 ms, in the table, in two findings and in two sentences; each pass executes line 21 once."""
    said = console("check-program", str(printed)).out
    assert not re.search(r"\de[+-]\d", said)
    assert set(re.findall(r"0\.0000\d+", said)) == {"0.000097087"}
    assert said.count("0.000097087") == 8
    moves = console("check-program", str(printed), "--json").json["moves"]
    assert f"ended it after {sum(move['line'] == 21 for move in moves)} passes" in " ".join(said.split())


@pytest.mark.parametrize(
    ("value", "spec", "shown"),
    [
        (1 / 10_300, ".5g", "0.000097087"),
        (1 / 10_300, ".3g", "0.000097087"),
        (1_234_567.0, ".6g", "1234567"),
        (-1_234_567.0, "+.4g", "-1234567"),
        (1_234_567.0, "+.4g", "+1234567"),
        (-2e-5, "+.4g", "-0.00002"),
        (-1e-12, ".4g", "0"),
        (10.0, "g", "10"),
        (0.25, ".1f", "0.2"),
    ],
)
def test_numbers_have_no_exponent(value: float, spec: str, shown: str) -> None:
    assert format(PlainNumber(value), spec) == shown


def test_a_lobe_that_drifts_is_told(console: Console, meant: Path) -> None:
    meant.write_text(meant.read_text("utf-8").replace("10000/6", "1666"), encoding="utf-8")
    assert "drift by -0.144 deg per turn (-4 counts); after 138.9 turns" in " ".join(
        console("check-program", str(meant)).out.split()
    )


def test_what_is_no_program_is_refused_in_one_line(console: Console, tmp_path: Path) -> None:
    path, korean = tmp_path / "mine.pmc", CLEAN.replace("DWELL10", "DWELL10 ;공구")
    for content, words in (
        (b"P1=1\n", "no OPEN PROG"),
        (b"OPEN PROG 1\nWHILE(P1=0)\nX1\nCLOSE\n", "ERR016"),
        (b"OPEN PROG 1\nENDWHILE\nCLOSE\n", "ERR009"),
        *(
            (korean.encode(encoding), f"mine.pmc: this text is {encoding[:6].upper()}")
            for encoding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32")
        ),
        (None, "mine.pmc"),
    ):
        path.unlink() if content is None else path.write_bytes(content)
        said = console("check-program", str(path))
        assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
        assert words in said.err and "mine.pmc" in said.err
    path.write_bytes(korean.encode("cp949"))  # comments in another encoding do no harm
    assert "no findings" in console("check-program", str(path)).out
    assert console("check-program").code == 2
    said = console("check-program", str(path), "--ta", "1.5")
    assert said.code == 2 and "1.5" in said.err


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_finding_and_every_sentence_has_its_words(language: str) -> None:
    (folder,) = package.__path__
    entries = tomllib.loads((Path(folder) / "text" / language / "check-program.toml").read_text("utf-8"))
    target = {f"check.finding.{code}" for code in FindingCode} | {
        f"check.said.{said}" for said in ExplanationSentence
    }
    assert target == {key for key in entries if key.startswith(("check.finding.", "check.said."))}
    assert load(language)("check.clean") == entries["check.clean"]


def test_text_is_broken_at_spaces_by_cells() -> None:
    assert wrap_text("one two three", 7) == ["one two", "three"]
    assert wrap_text("한글 두 칸", 7) == ["한글 두", "칸"]
    assert wrap_text("unbreakable", 4) == ["unbreakable"]
