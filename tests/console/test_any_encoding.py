"""Whatever the encoding of the output, and whatever is in names and files: it is said, and steers no terminal."""

from __future__ import annotations

import ast
import io
import json
import os
import subprocess
import sys
import unicodedata
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import console.tui as tui
from console.__main__ import main
from console.cli.output import EscapedOutput, print_json
from console.escaping import encodable, escaped, escaped_line
from console.text.columns import cell_width
from console.tui.lines import Sheet, plain
from console.tui.theme import MONO, Token
from profiles.store import load_job, save_job
from tests.compact import save_compact

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
def evil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with files that have steering characters wherever a text is looked for."""
    folder = tmp_path / f"data{EVIL}".replace("\x00", "")
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    raw = os.fsencode(EVIL)
    (tmp_path / "evil.pmc").write_bytes(b"OPEN PROG 1\n" + raw + b"\nX" + raw + b"\nCLOSE\n")
    (tmp_path / "evil.csv").write_text(f"torque_n_m,force_n,{EVIL!r}\n1,2,3\n")
    (tmp_path / "evil.json").write_text(json.dumps({"schema": EVIL, "origin": {EVIL: EVIL}}))
    return folder


def said(words: tuple[str, ...], encoding: str, monkeypatch: pytest.MonkeyPatch) -> tuple[int, str]:
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
def test_no_encoding_and_no_name_ends_a_command_or_steers_the_terminal(
    evil: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
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
        plain_ = escaped(text)
        assert escaped(plain_) == plain_ and encodable(plain_, "utf-8") == plain_
        assert cell_width(encodable(plain_, encoding)) == cell_width(plain_)


@example(EVIL)
@given(st.text(st.characters(codec=None, exclude_categories=())))
def test_what_json_says_is_what_it_was_and_steers_nothing(text: str) -> None:
    for encoding in ("ascii", "utf-8"):
        bytes_ = io.BytesIO()
        stream = io.TextIOWrapper(bytes_, encoding=encoding, errors="strict")
        with pytest.MonkeyPatch.context() as streams:
            streams.setattr(sys, "stdout", EscapedOutput(stream))
            print_json({text: [text]})
            sys.stdout.flush()
        found = bytes_.getvalue().decode(encoding)
        assert steering(found) == set() and json.loads(found) == {"schema": 1, text: [text]}


@pytest.mark.parametrize("text", ["plain", "µm ± 3 °", "한국어 보상", "a\nb\tc", "a\u3000b\xa0c"])
def test_what_is_harmless_stays_as_it_is(text: str) -> None:
    assert escaped(text) == text
    assert encodable(text, "utf-8") == text and encodable(text, None) == text


def test_on_its_line_a_text_stays() -> None:
    assert escaped_line("a\nb\tc\x1b") == "a\\nb\\tc\\x1b"


def test_a_sheet_shows_what_would_steer_the_terminal_as_it_is_written() -> None:
    sheet = Sheet(MONO)
    sheet.show([(("a ", Token.TEXT), (f"{EVIL}\n", Token.WARNING)), (("b", Token.DIM),)])
    shown = plain(sheet.lines)
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
                    "JobsEntry",
                    "CalibrateEntry",
                    "Text",
                    "to_strip",
                ):
                    makers.add(f"{path.relative_to(folder).as_posix()} {node.func.id}")
    assert makers == {
        "calibrating/panels.py CalibrateEntry",
        "lines.py Segment",
        "plot/cell_view.py Segment",
        "lines.py to_strip",
        "further/log.py Input",
        "further/settings.py Input",
        "application/glyphs.py Segment",
        "pages/jobs.py JobsEntry",
        "pages/records.py Input",
        "further/controller.py Input",
        "pages/setup.py Input",
        "pages/inspect.py CalibrateEntry",
        "pages/trace_chooser.py Input",
    }
