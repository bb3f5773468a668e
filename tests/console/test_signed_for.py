"""A copied profile on a real link: refused before anything is opened, until somebody has signed at the machine."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from profiles.store import load_machine
from tests.console.commands import Console
from tests.signed_profile import signed

JOB = "lee-2001-experiment-1"
NOBODY_THERE = "tcp:127.0.0.1:1"
"""No port to listen at for anybody but the system: whoever gets there is refused by the link."""


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """What an engineer begins with: the bundled profile, with the address of his controller."""
    path = tmp_path / "lathe.toml"
    text = load_machine("lee-2001-lathe").path.read_text(encoding="utf-8")
    path.write_text(text.replace("schema = 1", f'schema = 1\nlink = "{NOBODY_THERE}"'), encoding="utf-8")
    return path


def sign(profile: Path) -> None:
    profile.write_text(signed(profile.read_text(encoding="utf-8")), encoding="utf-8")


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize(
    "command", [("run", JOB, "--yes"), ("identify", "--yes"), ()], ids=["run", "identify", "screens"]
)
def test_a_copy_is_refused_where_it_would_move_iron(
    console: Console, copied: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...], language: str
) -> None:
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    said = console("--machine", str(copied), *command, "--lang", language)
    assert (said.code, said.out) == (1, "")
    assert "safety.signed_for" in said.err and '"machine"' in said.err
    assert "127.0.0.1" not in said.err  # nobody was looked for


@pytest.mark.parametrize("command", [("run", JOB), ("identify",)], ids=["run", "identify"])
def test_once_signed_for_the_machine_it_is_looked_for(
    console: Console, copied: Path, command: tuple[str, ...]
) -> None:
    sign(copied)
    said = console("--machine", str(copied), *command, "--yes")
    assert said.code == 1
    assert "127.0.0.1" in said.err and "safety" not in said.err


def test_what_sends_nothing_needs_no_signature(console: Console, copied: Path) -> None:
    for command in ("preview", "program"):
        assert console(command, JOB, "--machine", str(copied)).code == 0


def test_a_copy_works_the_simulated_machine(console: Console, copied: Path) -> None:
    short = ("--frequencies", "50", "--periods", "8")
    assert console("identify", "--sim", "--machine", str(copied), *short).code == 0
