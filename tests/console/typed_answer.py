"""A terminal at which the answer to a question is typed: how old it is has tests at a real one."""

from __future__ import annotations

import io
import sys

import pytest

from console.session.dated_input import TypedLine


def answers(monkeypatch: pytest.MonkeyPatch, text: str, *, late: bool = False) -> None:
    """Answer the next question of a command."""
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stdin", terminal)

    def read_line(question: str) -> TypedLine:
        print(question, end="", file=sys.stderr)
        return TypedLine(text, late=late)

    monkeypatch.setattr("console.session.dated_input.read_line", read_line)
