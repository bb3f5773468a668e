"""Words: any encoding and any name steer no terminal; the Korean glossary; inches beside millimetres."""

from __future__ import annotations

import ast
import io
import json
import os
import re
import subprocess
import sys
import unicodedata
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pytest import MonkeyPatch

import console.tui as tui
from console.__main__ import main
from console.cli.output import EscapedOutput, print_json
from console.escaping import encodable, escape_text, escaped_line
from console.session.typed_number import stored_length, typed_length
from console.text.catalogue import load, words_of
from console.text.columns import cell_width
from console.tui.lines import Sheet, plain_text
from console.tui.pages.fields import FORM, entry_of, format_field, judge, limit_of
from console.tui.theme import MONO, Token
from console.units import METRIC, Units
from profiles.problem import Problem, ProfileError
from profiles.store import load_job, save_job
from tests.compact import save_compact
from tests.tui.stage import experiment

JOB = "lee-2001-experiment-1"
EVIL = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e\x00\x7f\udcff\r"
"""Sets a title, clears the screen, changes the colour, turns the direction round; and what no encoding has."""

ENCODINGS = ("ascii", "latin-1", "cp949", "utf-16", "utf-8")
SAYS = {
    "help": ("--help",),
    "help of a command": ("run", "--help"),
    "wrong usage": ("frobnicate", EVIL),
    "jobs": ("jobs",),
    "jobs as JSON": ("jobs", "--json"),
    "preview": ("preview", JOB),
    "predict": ("predict", JOB),
    "program": ("program", JOB, "--strategy", "paper"),
    "check-program": ("check-program", "evil.pmc"),
    "learn": ("learn", "--job", JOB, "--list"),
    "an unknown job": ("preview", f"no{EVIL}"),
    "a missing trace": ("roundness", f"/nowhere/{EVIL}".replace("\x00", "")),
    "a calibration": ("calibrate", "chuck", "evil.csv"),
    "an identification": ("run", JOB, "--sim", "--identified", "evil.json"),
    "the notes of the paper": ("reproduce", "--help"),
    "a fault": ("fault", "tcp:127.0.0.1:1", EVIL),
}


@pytest.fixture
def evil(tmp_path: Path, monkeypatch: MonkeyPatch) -> Path:
    """A folder with files that have steering characters wherever a text is looked for."""
    folder = tmp_path / f"data{EVIL}".replace("\x00", "")
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    raw = os.fsencode(EVIL)
    (tmp_path / "evil.pmc").write_bytes(b"OPEN PROG 1\n" + raw + b"\nX" + raw + b"\nCLOSE\n")
    (tmp_path / "evil.csv").write_text(f"torque_n_m,force_n,{EVIL!r}\n1,2,3\n")
    (tmp_path / "evil.json").write_text(json.dumps({"schema": EVIL, "origin": {EVIL: EVIL}}))
    return folder


def said(words: tuple[str, ...], encoding: str, monkeypatch: MonkeyPatch) -> tuple[int, str]:
    """Return exit code and everything that a command writes to streams of an encoding that forgives nothing."""
    outputs = [io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="strict") for _ in range(2)]
    with monkeypatch.context() as streams:
        for name, output in zip(("stdout", "stderr"), outputs, strict=True):
            streams.setattr(sys, name, output)
        code = main(words)
        for output in outputs:
            output.flush()
    return code, "".join(output.buffer.getvalue().decode(encoding) for output in outputs)


def steering(text: str) -> set[str]:
    return {c for c in text if unicodedata.category(c)[0] == "C" and c not in "\n\t\ufeff"}


@pytest.mark.parametrize("what", SAYS)
def test_no_name_ends_a_command_or_steers_a_terminal(evil: Path, monkeypatch: MonkeyPatch, what: str) -> None:
    codes = set()
    for encoding, language in (("ascii", "ko"), ("latin-1", "en"), ("utf-8", "en")):
        code, text = said((*SAYS[what], "--data", str(evil), "--lang", language), encoding, monkeypatch)
        codes.add(code)
        assert text and steering(text) == set()
        assert "UnicodeEncodeError" not in text and "internal error" not in text and "내부 오류" not in text
    assert len(codes) == 1


@pytest.mark.long
def test_a_run_of_the_real_program_survives_an_encoding_without_its_signs(tmp_path: Path) -> None:
    job = tmp_path / "short.toml"
    save_job(replace(load_job(JOB).job, cut_length_mm=0.5), job)
    words = ("run", str(job), "--sim", "--data", str(tmp_path), *save_compact(tmp_path))
    done = subprocess.run(
        [sys.executable, "-m", "console", *words],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "latin-1", "LC_ALL": "C.UTF-8"},
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "um" in done.stdout.decode("latin-1") and b"fault" not in done.stderr


@example(EVIL)
@given(st.text(st.characters(codec=None, exclude_categories=())))
def test_nothing_steers_a_terminal_that_comes_through_the_streams(text: str) -> None:
    for encoding in ENCODINGS:
        bytes_ = io.BytesIO()
        stream = io.TextIOWrapper(bytes_, encoding=encoding, errors="strict", newline="")
        out = EscapedOutput(stream)
        assert out.write(text) == len(text)
        out.flush()
        found = bytes_.getvalue().decode(encoding)
        assert steering(found) == set()
        plain_ = escape_text(text)
        assert escape_text(plain_) == plain_ and encodable(plain_, "utf-8") == plain_
        assert cell_width(encodable(plain_, encoding)) == cell_width(plain_)


@example(EVIL)
@given(st.text(st.characters(codec=None, exclude_categories=())))
def test_what_json_says_is_what_it_was_and_steers_nothing(text: str) -> None:
    for encoding in ("ascii", "utf-8"):
        bytes_ = io.BytesIO()
        stream = io.TextIOWrapper(bytes_, encoding=encoding, errors="strict")
        with MonkeyPatch.context() as streams:
            streams.setattr(sys, "stdout", EscapedOutput(stream))
            print_json({text: [text]})
            sys.stdout.flush()
        found = bytes_.getvalue().decode(encoding)
        assert steering(found) == set() and json.loads(found) == {"schema": 1, text: [text]}


def test_what_is_harmless_stays_as_it_is() -> None:
    for text in ("plain", "µm ± 3 °", "한국어 보상", "a\nb\tc", "a\u3000b\xa0c"):
        assert escape_text(text) == encodable(text, "utf-8") == encodable(text, None) == text
    assert escaped_line("a\nb\tc\x1b") == "a\\nb\\tc\\x1b"


def test_a_sheet_shows_what_would_steer_the_terminal_as_it_is_written() -> None:
    sheet = Sheet(MONO)
    sheet.show([(("a ", Token.TEXT), (f"{EVIL}\n", Token.WARNING)), (("b", Token.DIM),)])
    shown = plain_text(sheet.lines)
    assert steering(shown) == set() and shown.count("\n") == 1
    assert "\\x1b]0;owned\\x07" in shown


def test_on_the_screens_text_comes_only_through_what_escapes_it() -> None:
    """`to_strip` has the lines of a sheet; a picture of cells takes no character that is not one cell wide.

    The entry of the form has what is typed there, and a key that is no sign of a text is none for it.
    """
    folder = Path(str(tui.__file__)).parent
    makers = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                if node.func.id in (
                    "Segment",
                    "Static",
                    "Label",
                    "Input",
                    "EntryLine",
                    "JobsEntry",
                    "CalibrateEntry",
                    "Text",
                    "to_strip",
                ):
                    makers.add(f"{path.relative_to(folder).as_posix()} {node.func.id}")
    assert makers == {
        "calibration/panels.py CalibrateEntry",
        "lines.py Segment",
        "plot/cell_view.py Segment",
        "lines.py to_strip",
        "further/log.py EntryLine",
        "further/settings.py EntryLine",
        "application/glyphs.py Segment",
        "pages/jobs.py JobsEntry",
        "pages/records.py EntryLine",
        "further/controller.py EntryLine",
        "pages/setup.py EntryLine",
        "pages/inspect.py CalibrateEntry",
        "pages/trace_chooser.py EntryLine",
        "inspection/part_form.py EntryLine",
    }


GLOSSARY = {
    "lease": ("통신 감시", r"임대|리스"),
    "silent console": ("콘솔 응답이 끊길 때", r"조용"),
    "emergency stop": ("비상정지", r"비상\s+정지"),
    "spindle": ("스핀들", r"주축"),
    "drive": ("드라이브", r"구동"),
    "machine profile": ("기계 프로필", r"기계 파일|프로파일"),
    "part": ("공작물", r"부품"),
    "compensation table": ("보정표", r"테이블"),
    "carriage": ("왕복대", r"캐리지"),
    "gain": ("이득", r"게인"),
    "controller": ("제어기", r"카드|컨트롤러"),
    "enabling device": ("작동 허가 장치", r"허가 스위치"),
    "chuck key": ("척 렌치", r"척 키"),
}
"""The word of each thing, and the words that were or might be used beside it."""


def test_one_thing_has_one_name() -> None:
    said = dict(words_of("ko"))
    for name, others in GLOSSARY.values():
        assert {key: s for key, s in said.items() if re.search(others, s)} == {}
        assert any(name in s for s in said.values()), name


HEDGED = re.compile(r"\([은는이가을를으]\)")
AFTER_A_VALUE = re.compile(r"\} ?(은|는|이|가|을|를|와|과|로|으로)(?![가-힣])")


def test_no_particle_hangs_on_a_value() -> None:
    hanging = {k: s for k, s in words_of("ko").items() if HEDGED.search(s) or AFTER_A_VALUE.search(s)}
    assert hanging == {}


def test_one_alarm_is_no_plural() -> None:
    for count, english, korean in (
        (0, "0 alarms", "경보 (0)"),
        (1, "1 alarm", "경보 (1)"),
        (2, "2 alarms", "경보 (2)"),
    ):
        assert [load(language)("messages.alarms", count=count) for language in ("en", "ko")] == [english, korean]
    assert load("en")("roundness.left_out", count=1) == "outliers excluded: 1", "it has no singular"


INCH = Units("inch")
FIELDS = {field.key: field for field in FORM}
MM_IN_AN_INCH = Decimal("25.4")  # exactly, by the international yard and pound agreement of 1959


@pytest.mark.parametrize(
    ("value", "unit", "decimals", "shown"),
    [
        (25.4, "mm", 3, "1.00000 in"),
        (0.001, "mm", 3, "0.00004 in"),
        (52.0, "mm", 1, "2.047 in"),
        (76.0131, "mm", 4, "2.992642 in"),
        (2.54, "um", 2, "100.0 uin"),
        (1.0, "um", 0, "39 uin"),
        (50.8, "mm/s", 1, "2.000 in/s"),
        (0.127, "mm/rev", 3, "0.00500 in/rev"),
        (1000.0, "rpm", 0, "1000 rpm"),
        (12.5, "N/um", 1, "12.5 N/um"),
    ],
)
def test_a_value_is_shown_in_inches(value: float, unit: str, decimals: int, shown: str) -> None:
    assert INCH.show(value, unit, decimals) == shown
    assert METRIC.show(value, unit, decimals) == f"{value:.{decimals}f} {unit}"


SHOWN = st.sampled_from([("mm", 3), ("mm", 1), ("mm", 4), ("um", 2), ("um", 1)])


@given(st.integers(-5_000_000, 5_000_000), SHOWN)
def test_what_millimetres_tell_apart_inches_tell_apart(steps: int, shown: tuple[str, int]) -> None:
    unit, decimals = shown
    values = [steps / 10**decimals, (steps + 1) / 10**decimals]
    assert len({INCH.figure(value, unit, decimals) for value in values}) == 2


@given(st.decimals(min_value="0.0001", max_value="19", places=6), st.booleans())
def test_what_is_typed_is_kept_exactly_and_shown_again_as_typed(typed: Decimal, comma: bool) -> None:
    text = f"{typed:f}".replace(".", ",") if comma and typed < 1 else f"{typed:f}"
    judged = judge(experiment(), FIELDS["diameter_mm"], text, INCH)
    assert judged.problems == ()
    kept = judged.work.job.diameter_mm
    assert Decimal(repr(kept)) == Decimal(repr(float(typed * MM_IN_AN_INCH)))
    assert Decimal(format_field(FIELDS["diameter_mm"], judged.work.job, INCH)) == typed


@given(st.floats(0.001, 500.0))
def test_an_entry_that_is_left_as_it_began_keeps_every_digit(value_mm: float) -> None:
    work = judge(experiment(), FIELDS["overhang_mm"], f"{Decimal(repr(value_mm)):f}", METRIC).work
    began = entry_of(FIELDS["overhang_mm"], work, INCH)
    assert judge(work, FIELDS["overhang_mm"], f" {began} ", INCH).work is work


@pytest.mark.parametrize("key", [field.key for field in FORM if field.rule.unit in ("mm", "um", "mm/rev")])
def test_the_shown_range_is_that_of_the_field(key: str) -> None:
    field = FIELDS[key]
    assert limit_of(field, METRIC) == field.rule.limit
    *_, most = limit_of(field, INCH).split(", ")
    sign, number, unit = most.split(" ")
    assert (sign, unit) == ("<=", INCH.unit(field.rule.unit))
    assert judge(experiment(), field, number, INCH).problems == ()
    beyond = f"{Decimal(number) * Decimal('1.001'):f}"
    (problem,) = judge(experiment(), field, beyond, INCH).problems
    assert (problem.code, problem.value, problem.limit) == ("value.out_of_range", beyond, limit_of(field, INCH))


def test_a_number_that_could_be_two_is_refused_in_inches_too() -> None:
    with pytest.raises(ProfileError) as error:
        stored_length("1,234", "diameter_mm", "", "mm", INCH)
    assert [problem.code for problem in error.value.problems] == ["value.ambiguous"]
    assert typed_length("0,5", "z", "", "mm", INCH) == 12.7
    assert typed_length("0,5", "c", "", "°", INCH) == 0.5
    with pytest.raises(ProfileError):
        typed_length("half", "z", "", "mm", INCH)


def test_a_message_has_both_units() -> None:
    metric = "the target 300.000 mm is out of range; allowed 0.000 … 254.000 mm, ± 2.5 um, 3 mm/s, 5 N/um"
    assert INCH.add_inches(metric) == (
        "the target 300.000 mm (11.81102 in) is out of range; allowed 0.000 … 254.000 mm (0.00000 … 10.00000 in), "
        "± 2.5 um (98 uin), 3 mm/s (0.12 in/s), 5 N/um"
    )
    assert METRIC.add_inches(metric) == metric


def test_commands_speak_in_millimetres_whatever_a_screen_shows() -> None:
    problem = Problem(code="screen.number_out_of_range", value="3.0 mm", limit="<= 2.0 mm")
    assert "in)" not in load("en").problem(problem)
