"""The help of the commands is as wide as the terminal, or as COLUMNS says."""

from __future__ import annotations

import os
import sys

import pytest

from console.cli.parser import columns


@pytest.mark.parametrize(("told", "width"), [("132", 132), ("", 97), ("0", 97), ("wide", 97), ("-5", 97)])
def test_the_width_is_that_of_columns_else_that_of_the_terminal(
    monkeypatch: pytest.MonkeyPatch, told: str, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", told)
    monkeypatch.setattr(os, "get_terminal_size", lambda fd: os.terminal_size((97, 30)))
    assert columns() == width


def test_without_a_terminal_it_is_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "__stdout__", pipe)
        assert columns() == 80
    assert columns() == 80  # closed
    os.close(reading)
