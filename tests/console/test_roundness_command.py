"""`console roundness`: every problem and warning names its file, and warnings stay off the result."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Console = Callable[..., Any]


def trace(tmp_path: Path, angles_deg: Any, *head: str, eccentric_um: float = 0.0) -> Path:
    path = tmp_path / "part.csv"
    rows = [f"{a},{eccentric_um * np.cos(np.radians(a))}" for a in angles_deg]
    path.write_text("\n".join([*head, "angle_deg,deviation_um", *rows]))
    return path


def test_a_warning_goes_to_stderr_with_its_file(console: Console, tmp_path: Path) -> None:
    path = trace(tmp_path, range(360), "# radius_mm: 26", eccentric_um=500.0)
    said = console("roundness", str(path), "--filter", "15")
    assert said.code == 0
    assert said.err == f"console: warning: {path}: " + said.err.split(": ", 3)[3]
    assert "off centre" in said.err
    assert "off centre" not in said.out
    listed = console("roundness", str(path), "--filter", "15", "--json")
    assert said.err == f"console: warning: {listed.json['warnings'][0]}\n"


@pytest.mark.parametrize("stated", ["0,026", "inf", "nan", "-26", "26 mm", "0"])
def test_a_radius_that_is_none_is_a_warning_with_its_value(console: Console, tmp_path: Path, stated: str) -> None:
    path = trace(tmp_path, range(360), f"# radius_mm: {stated}")
    said = console("roundness", str(path), "--filter", "15")
    assert said.code == 0
    assert said.err.count("\n") == 1
    for word in ("warning", "part.csv", "radius_mm", stated, "> 0 mm"):
        assert word in said.err


def test_a_usable_radius_says_nothing(console: Console, tmp_path: Path) -> None:
    assert console("roundness", str(trace(tmp_path, range(360), "# radius_mm: 26")), "--filter", "15").err == ""


@pytest.mark.parametrize(
    ("angles", "words"),
    [
        (range(180), ("181 deg", "60 deg", "all round")),
        ([*range(0, 340, 10), 355], ("equally", "25 deg", "--filter none")),
    ],
)
def test_what_the_evaluation_refuses_names_the_file(
    console: Console, tmp_path: Path, angles: Any, words: tuple[str, ...]
) -> None:
    said = console("roundness", str(trace(tmp_path, angles)))
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
    for word in ("part.csv", *words):
        assert word in said.err


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize(
    "content",
    [b"", b"angle_deg,deviation_um\n1,\xb5\n", b"# : 1\n", b"# a: 1\n# a: 2\nangle_deg,deviation_um\n"],
)
def test_no_sentence_has_a_hole(console: Console, tmp_path: Path, content: bytes, language: str) -> None:
    path = tmp_path / "part.csv"
    path.write_bytes(content)
    said = console("roundness", str(path), "--lang", language)
    assert said.code == 1
    for hole in ("()", "( )", " )", "allowed \n", "허용 \n", "  "):
        assert hole not in said.err


def test_a_perfect_part_has_no_negative_zero(console: Console, tmp_path: Path) -> None:
    path = trace(tmp_path, range(360))
    assert "-0.0" not in console("roundness", str(path), "--filter", "none").out
    assert "-0.0" not in json.dumps(console("roundness", str(path), "--filter", "none", "--json").json["RONv_um"])
