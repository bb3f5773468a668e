"""A part of one's own on a machine without a gauge: from a blank form to a round part, by what the screens say."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from console.session.data.kept_files import jobs_folder
from profiles.store import load_job
from tests.system.shop import Operator, Shop
from tests.terminal import Terminal

pytestmark = [pytest.mark.system, pytest.mark.timeout(240), pytest.mark.long]

VALUES = ("steel", "60", "1.5", "25", "4", "2500", "0.1", "0.05", "600", "1", "5", "30")
JOB = "steel-60"


def makes_a_job(operator: Operator) -> None:
    """On a blank form, with a value in each of its fields."""
    operator.press("n")
    operator.sees("setup.new_title")
    operator.press("enter")
    for value in VALUES:
        operator.press(*value, "tab")
    operator.sees("setup.next.save_new")
    operator.press("s")
    operator.terminal.wait_for(rf"\[{JOB} ", 5.0)
    operator.press("enter")
    operator.sees("setup.next.plain")


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_part_of_ones_own_becomes_round_on_a_machine_without_a_gauge(language: str, tmp_path: Path) -> None:
    shop = Shop(tmp_path)
    with shop.served() as address:
        words = ("--machine", str(shop.profile), "--link", address, "--data", str(tmp_path), "--lang", language)
        with Terminal([sys.executable, "-m", "console", *words], columns=80, rows=24) as terminal:
            operator = Operator(terminal, language, shop)
            operator.sees("activity.ready", 30.0)
            makes_a_job(operator)
            operator.press("4")
            operator.clamps_a_blank(JOB)
            operator.aligns_it()
            operator.cuts()
            operator.takes_out_and_brings_the_trace("plain.csv")
            operator.sees("inspect_page.next.lobe")
            operator.press("a")
            operator.sees("inspect_page.next.lobe_taken")
            operator.goes_on(JOB)
            operator.cuts()
            operator.takes_out_and_brings_the_trace("first.csv")
            first_um = operator.ront_um()
            operator.press("a")
            operator.sees("inspect_page.next.kept")
            operator.press("o")
            operator.sees("inspect_page.diameter_taken")
            operator.goes_on(JOB)
            operator.cuts()
            operator.takes_out_and_brings_the_trace("second.csv")
            assert operator.ront_um() < min(
                first_um, load_job(JOB, jobs_folder(tmp_path)).job.roundness_tolerance_um
            )
            assert "✓" in operator.diameter()
            operator.press("4", "ctrl+q")
            assert terminal.wait_exit(15.0) == 0
