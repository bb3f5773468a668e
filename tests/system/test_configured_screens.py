"""Plain `console` at a real terminal, where the configuration of the lathe says everything else."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from console.text.catalogue import load
from profiles.store import load_machine
from tests.terminal import Terminal

pytestmark = [pytest.mark.system, pytest.mark.timeout(60)]

OTHER = "turbo-ethernet-lathe"


def test_the_screens_open_on_the_configured_machine_in_its_language(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, file = tmp_path / "lathe", tmp_path / "trilobe" / "config.toml"
    file.parent.mkdir()
    file.write_text(f'schema = 1\ndata = "{data}"\nmachine = "{OTHER}"\nlink = "sim:"\nlanguage = "ko"\n')
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with Terminal([sys.executable, "-m", "console"]) as terminal:
        terminal.wait_for(load("ko")("activity.ready"), 30.0)
        assert load_machine(OTHER).machine.name in terminal.row(0) and "SIM" in terminal.row(0)
