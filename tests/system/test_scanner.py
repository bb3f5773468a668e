"""A wedge scanner at the real program: its code opens a job where Enter would, and never does anything else."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from console.tui.pace import QUIET_S
from tests.trainee import FIRST_JOB, Trainee, console, console_at

pytestmark = [pytest.mark.system, pytest.mark.timeout(120)]

OTHER = "ring-7"
SAME_PIECE_S = 0.2


@contextmanager
def at_a_console(data: Path) -> Iterator[Trainee]:
    with console(data, "en", 80, 24, short_ways=True) as terminal:
        text = (data / "jobs" / f"{FIRST_JOB}.toml").read_text(encoding="utf-8")
        named = re.sub(r'(?m)^name = ".*"', f'name = "{OTHER}"', text)
        (data / "jobs" / f"{OTHER}.toml").write_text(named, encoding="utf-8")
        yield console_at(terminal)


def types(trainee: Trainee, *pieces: str) -> None:
    """Type pieces as a line brings them, each at once."""
    for piece in pieces:
        trainee.terminal.type(piece)
        time.sleep(SAME_PIECE_S)
    time.sleep(QUIET_S)


@pytest.mark.first(1)
@pytest.mark.parametrize("pieces", [(f"job:{OTHER}\r",), (f"JOB:{OTHER[:3]}", f"{OTHER[3:]}\r\n")])
def test_a_code_opens_its_job_and_no_other_does_anything(tmp_path: Path, pieces: tuple[str, ...]) -> None:
    with at_a_console(tmp_path) as trainee:
        terminal = trainee.terminal
        trainee.press("4")
        trainee.sees("align_page.next.clamp")
        types(trainee, f"b:{OTHER}\r")  # its prefix was cut off
        terminal.wait_for(rf'scanned "b:{OTHER}"', 2.0)
        trainee.sees("align_page.next.clamp")
        types(trainee, "job:nothing\r")
        trainee.sees("problem.screen.scanned_no_job", 2.0)
        types(trainee, "ㅓㅐㅠ:ㄹ미ㅏ\n")
        trainee.sees("problem.screen.scanned_no_job", 2.0)
        trainee.sees("align_page.next.clamp")
        types(trainee, *pieces)
        terminal.wait_for(f"Set-up: {OTHER}", 5.0)
        assert "STOPPED" not in terminal.text


@pytest.mark.long
def test_in_an_entry_or_in_motion_no_job_is_opened(tmp_path: Path) -> None:
    """Rules M4 and M6: nothing changes the job while anything moves, and an entry is the operator's."""
    with at_a_console(tmp_path) as trainee:
        terminal, code = trainee.terminal, f"job:{OTHER}\r"
        trainee.press("down", "enter")
        trainee.sees("setup.next.entry", 2.0)
        types(trainee, code)
        trainee.sees("problem.screen.too_fast_entry", 2.0)
        assert f"Set-up: {FIRST_JOB}" in terminal.text
        trainee.press("u")
        trainee.switches_on()
        trainee.starts_homing()
        types(trainee, code)
        trainee.sees("problem.screen.scanned_stopped", 5.0)
        trainee.sees("activity.stopped", 10.0)
        trainee.press("f2")
        trainee.sees("align_page.next.home", 10.0)
        terminal.wait_for(FIRST_JOB[-8:], 2.0)
