"""The whole job at a real terminal: from the first paint to the measured part, with a stop in between."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.trainee import Trainee, console

RONT = r"RONt\D*?(\d+\.\d+)\D+?(\d+\.\d+)"

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]


@pytest.mark.parametrize(("language", "columns", "rows"), [("en", 80, 24), ("ko", 100, 30)])
def test_a_trainee_makes_a_round_part_with_a_stop_in_mid_cut(
    language: str, columns: int, rows: int, tmp_path: Path
) -> None:
    with console(tmp_path, language, columns, rows) as terminal:
        trainee = Trainee(terminal, language)
        terminal.wait_for("SIM", 10.0)
        trainee.opens_the_first_job()
        trainee.aligns()
        trainee.starts_the_cut()
        trainee.sees("frame.sync.in_sync", 30.0)
        trainee.press("space")
        trainee.sees("frame.recover")
        trainee.press("f2")
        trainee.sees("run_page.next.retract")
        trainee.sees("run_page.check.touched_blank")
        trainee.press("f8")
        trainee.starts_the_cut("run_page.next.arm_again")
        trainee.waits_for_the_end_of_the_cut()
        trainee.measures()
        terminal.wait_for(RONT)
        assert ront_after_um(terminal.text) < 1.0
        assert "SIM" in terminal.row(0)
        terminal.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
        terminal.wait_alone(5.0)


def ront_after_um(screen: str) -> float:
    """RONt of the page Inspect: before, then after."""
    found = re.search(RONT, screen)
    assert found is not None, screen
    return float(found[2])
