"""The whole job at a real terminal: from the first paint to the measured part, with a stop in between."""

from __future__ import annotations

import functools
import json
import operator
import re
import sqlite3
import time
from pathlib import Path

import pytest

from profiles.store import load_job
from tests.console.floor import LOGGED
from tests.trainee import FIRST_JOB, Trainee, console

RONT = r"RONt\D*?(\d+\.\d+)\D+?(\d+\.\d+)"

OTHER_JOB = "two-jaws-60"
MORE_THAN_THE_LINE_HOLDS = ("?",) * 84
"""Lists of keys to be painted, one key as if it were held down, until the screen waits for a stalled line."""

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]


@pytest.mark.parametrize(
    ("language", "columns", "rows"), [("en", 80, 24), pytest.param("ko", 100, 30, marks=pytest.mark.long)]
)
def test_a_trainee_makes_a_round_part_with_a_stop_in_mid_cut(
    language: str, columns: int, rows: int, tmp_path: Path
) -> None:
    makes_a_job_for_another_chuck(tmp_path)
    with console(tmp_path, language, columns, rows, short_ways=True) as terminal:
        trainee = Trainee(terminal, language)
        terminal.wait_for("SIM", 10.0)
        trainee.opens_the_first_job()
        trainee.press("5", "f8")
        trainee.sees("problem.machine.tool_unknown")
        trainee.aligns()
        trainee.starts_the_cut()
        trainee.sees("frame.sync.in_sync", 30.0)
        STOPS[language](trainee, tmp_path)
        trainee.sees("frame.recover")
        trainee.press("f2")
        trainee.sees("run_page.next.retract")
        trainee.sees("run_page.check.touched_blank")
        trainee.press("f8")
        trainee.starts_the_cut("run_page.next.arm_again")
        trainee.waits_for_the_end_of_the_cut()
        trainee.press("6")
        trainee.sees("inspect_page.next.measure")
        trainee.press("m")
        terminal.wait_for(RONT)
        fails_at_its_mark_alone(trainee)
        assert ront_after_um(terminal.text) < 1.0
        assert "SIM" in terminal.row(0)
        trainee.press("4")
        terminal.wait_for("✓ 5.*\n.*✓ 6", 5.0)
        opens_the_other_job(trainee)
        trainee.press("4")
        terminal.wait_for("○ 5.*\n.*○ 6", 5.0)
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
        terminal.wait_alone(5.0)


def makes_a_job_for_another_chuck(data: Path) -> None:
    """Two jaws and 60 mm: neither jaw 1 nor the touch-off of experiment 1 is of it."""
    text = load_job(FIRST_JOB).path.read_text(encoding="utf-8")
    for line in ("jaws = 2", "diameter_mm = 60.0"):
        text, found = re.subn(rf"(?m)^{line.split()[0]} = \S+", line, text)
        assert found == 1
    file = data / "jobs" / f"{OTHER_JOB}.toml"
    file.parent.mkdir(parents=True)
    file.write_text(text.replace(f'"{FIRST_JOB}"', f'"{OTHER_JOB}"'), encoding="utf-8")


def opens_the_other_job(trainee: Trainee) -> None:
    """Down the list to it, and Enter."""
    terminal = trainee.terminal
    trainee.press("1")
    terminal.wait_for(OTHER_JOB, 5.0)
    for _ in range(20):
        if re.search(rf"▸[ ●]*{OTHER_JOB}", terminal.text):
            break
        before = terminal.text
        trainee.press("down")
        terminal.wait_for(functools.partial(operator.ne, before), 5.0)
    trainee.press("enter")
    terminal.wait_for(OTHER_JOB, 5.0)


def ront_after_um(screen: str) -> float:
    """RONt of the page Inspect: before, then after."""
    found = re.search(RONT, screen)
    assert found is not None, screen
    return float(found[2])


def fails_at_its_mark_alone(trainee: Trainee) -> None:
    """Another cut does not remove the mark of a stop: the part passes unless one of its sections is in that mark.

    The land of the tool is 0.4 mm wide, and the carriage coasts.
    """
    verdict = re.compile(r"([✗✓]) (?:PASS|FAIL|합격|불합격)[^\n]*?Z (\d+\.\d)")
    mark = re.compile(r"(?:marked it|자유단에서)[^.]*?(\d+\.\d)(?= *(?:mm|│))")
    shown: list[tuple[str, float, float]] = []

    def are_shown(text: str) -> bool:
        if (judged := verdict.search(text)) and (marked := mark.search(text)):
            shown.append((judged[1], float(judged[2]), float(marked[1])))
        return bool(shown)

    trainee.sees("inspect_page.marked")
    trainee.terminal.wait_for(are_shown)
    sign, z_mm, mark_mm = shown[-1]
    if sign == "✗":
        assert load_job(FIRST_JOB).job.overhang_mm - z_mm == pytest.approx(mark_mm, abs=0.35)
        trainee.terminal.wait_for(r"Mark[\s│]+of[\s│]+a[\s│]+stop|정지[\s│]+자국:")
    else:
        trainee.sees("inspect_page.next.part")


def presses_stop(trainee: Trainee, data: Path) -> None:
    """The operator has seen something."""
    trainee.press("space")


def line_stalls(trainee: Trainee, data: Path) -> None:
    """The screen waits for the line, and the machine must not; it is told when the line runs again."""
    trainee.terminal.stall()
    # What comes at once is painted once.
    trainee.press(*MORE_THAN_THE_LINE_HOLDS, pace_s=0.04)
    wait_for_the_record(data)
    kind, content = last_event(data)
    assert (kind, content["reason"], content["proven"]) == ("stopped", "screen", True)
    trainee.terminal.resume()
    trainee.sees("activity.stopped", 5.0)
    trainee.sees("problem.session.screen_silent", 5.0)
    # What was pressed while it stood still is not done any more, so the list of keys may be open or closed.
    trainee.sees("problem.screen.keys_late", 5.0)
    if trainee.finds("glossary.title"):
        trainee.press("backspace")
    trainee.press("5")  # the page that it is: takes the message away


STOPS = {"en": presses_stop, "ko": line_stalls}


def last_event(data: Path) -> tuple[str, dict[str, object]]:
    database = sqlite3.connect(data / "records.sqlite3")
    found = database.execute("SELECT kind, data FROM events ORDER BY number DESC").fetchall()
    database.close()
    kind, content = next((kind, data) for kind, data in found if kind not in LOGGED)
    return kind, json.loads(content)


def wait_for_the_record(data: Path) -> None:
    """Until the stop is in the record: while the line stalls, nothing else tells of it."""
    end_s = time.monotonic() + 15.0
    while last_event(data)[0] != "stopped":
        assert time.monotonic() < end_s, last_event(data)
        time.sleep(0.05)
