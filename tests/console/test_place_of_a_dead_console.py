"""Every command that needs control takes the place of a console of this computer that died, and of nobody else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.session.station.owning import take_lock
from tests.console.commands import Console, on_one, real
from tests.console.consoles import logged
from tests.drivers.commissioned import Commissioned

ADDRESS = "tcp:lathe:1"
"""That of the real controller of these tests."""

DEAD = 4711
BACKUP = "backup"
GOOD = "OPEN PROG 101 CLEAR\nX1\nCLOSE\n"
COMMANDS = (
    ("doctor", "--prove", "--yes"),
    ("tune", "apply", "--factor", "0.9", "--yes"),
    ("controller", "apply", "--yes"),
    ("controller", "restore", BACKUP, "--yes"),
    ("controller", "download", GOOD, "--yes"),
)

every_command = pytest.mark.parametrize("words", COMMANDS, ids=lambda words: "-".join(words[:2]))


@pytest.fixture
def command(
    console: Console,
    card: Commissioned,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    words: tuple[str, ...],
) -> Callable[[], Any]:
    """The command, for a real machine that has something to write: its filter differs from profile and backup."""
    backup, program = tmp_path / "whole.pmac", tmp_path / "own.pmc"
    assert console("controller", "backup", str(backup)).code == 0
    program.write_text(GOOD, "utf-8")
    files = {BACKUP: str(backup), GOOD: str(program)}
    real(card, monkeypatch)
    monkeypatch.setattr(card.client, "connect", lambda: ("1.17", "PMAC1, X1"))
    if words[0] == "controller":
        card.tell("I138=0.25")
    return lambda: console(*(files.get(word, word) for word in words))


def left_by(number: int, data: Path, *, dead: bool) -> Any:
    """What a console leaves in the lock of its computer; its lock too, unless it is dead."""
    lock = take_lock(data, ADDRESS)
    assert lock is not None
    lock.keep(number)
    if dead:
        lock.close()
    return lock


@on_one
@every_command
def test_the_place_of_a_dead_console_is_taken_logged_and_released(
    card: Commissioned, command: Callable[[], Any], data_folder: Path
) -> None:
    data = data_folder / "trilobe"
    left_by(DEAD, data, dead=True)
    card.tell(f"P1000={DEAD}")
    said = command()
    assert "control" not in said.err, said.err
    assert said.code == 0, said.out + said.err
    assert card.client.numbers("P1000") == (0.0,)
    (line,) = logged(data)
    assert line.startswith(f"{ADDRESS} in the place of a console that died: console {DEAD} -> console ")


@on_one
@every_command
@pytest.mark.parametrize("whose", ["running", "elsewhere"])
def test_a_console_that_may_be_alive_keeps_control(
    card: Commissioned, command: Callable[[], Any], data_folder: Path, whose: str
) -> None:
    data = data_folder / "trilobe"
    left_by(DEAD, data, dead=whose == "elsewhere")
    held = DEAD if whose == "running" else DEAD + 1
    card.tell(f"P1000={held}")
    said = command()
    assert (said.code, "control" in said.err) == (1, True), said.out + said.err
    assert card.client.numbers("P1000") == (float(held),)
    assert logged(data) == []
