"""The pages Controller and Scope at a real terminal, on a served simulator taken for a machine."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.signed_profile import signed
from tests.system.conftest import Serve
from tests.system.lathe_sites import compact_text
from tests.terminal import Terminal
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(90)]


@pytest.mark.long
def test_an_engineer_asks_watches_backs_up_and_gathers(serve: Serve, tmp_path: Path) -> None:
    profile = tmp_path / "shop-9.toml"
    text = signed(compact_text("turbo")).replace('name = "turbo-ethernet-lathe"', 'name = "shop-9"')
    assert 'name = "shop-9"' in text
    profile.write_text(text, encoding="utf-8")
    data = tmp_path / "data"
    with serve("--machine", str(profile), "--tcp", "127.0.0.1:0") as simulator:
        link = "tcp:{}:{}".format(*simulator.tcp)
        command = [sys.executable, "-m", "console", "--machine", str(profile), "--link", link, "--data", str(data)]
        with Terminal(command, columns=80, rows=24) as terminal:
            engineer = Trainee(terminal, "en")
            engineer.sees("activity.ready", 30.0)
            engineer.press("0", "d")
            terminal.wait_for("603382", 10.0)
            engineer.press("right", "right", "enter", *"p40", "enter")
            terminal.wait_for(r"P40\s+0", 10.0)
            engineer.press("right", "enter", *"#1j+", "enter")
            terminal.wait_for("jog on page Align", 10.0)
            engineer.press("b")
            terminal.wait_for("Backup written", 40.0)
            engineer.press("f")
            terminal.wait_for("no differences", 40.0)
            engineer.press("0", "o", "g")
            terminal.wait_for("Tool FE um", 20.0)
            engineer.press("x")
            terminal.wait_for("kept as", 10.0)
    (backup,) = (data / "backups").iterdir()
    (kept,) = (data / "scope").iterdir()
    assert backup.name.startswith("shop-9-") and kept.read_text(encoding="utf-8").startswith("# trilobe scope 1")
    assert json.loads((data / "watch" / "shop-9.json").read_text(encoding="utf-8"))["items"] == ["P40"]
