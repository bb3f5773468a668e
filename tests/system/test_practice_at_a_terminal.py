"""A real console records a fault in mid-cut; another one practises that very event, on its own simulated lathe."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from console.flight.frozen_recordings import frozen_in
from profiles.store import load_job
from tests.compact import save_compact
from tests.terminal import Terminal
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(240)]

LESSON = """
minutes = 10
plant = "mounted"
steps = ["touched_off", "in_cut", "stopped"]
[[event]]
after = "in_cut"
wait_s = 1.0
fault = "{fault}"
[en]
title = "-"
goal = "-"
hints = ["-", "-", "-"]
[ko]
title = "-"
goal = "-"
hints = ["-", "-", "-"]
"""


def own_job(data: Path) -> None:
    """A job that is not bundled, first in the list."""
    text = load_job("lee-2001-experiment-1").path.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^cut_length_mm = 8.0", "cut_length_mm = 5.0", text)
    (data / "jobs").mkdir(parents=True)
    (data / "jobs" / "a-flange.toml").write_text(
        re.sub(r"(?m)^name = .*", 'name = "a-flange"', text), encoding="utf-8"
    )


def records(data: Path, fault: str, seen: str) -> str:
    """Cut the job at a real terminal until the fault has come; return the name of the recording."""
    own_job(data)
    (data / "lessons").mkdir()
    (data / "lessons" / "a.toml").write_text(LESSON.format(fault=fault), encoding="utf-8")
    command = [sys.executable, "-m", "console", "--sim", "--lesson", "a", "--data", str(data), *save_compact(data)]
    with Terminal(command, columns=80, rows=24) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("train_page.hint")
        trainee.sees("activity.ready", 40.0)
        trainee.press("1", "enter")
        trainee.sees("setup.next.ready")
        trainee.aligns()
        trainee.starts_the_cut()
        trainee.sees(seen, 30.0)
        terminal.wait_for(lambda _: bool(frozen_in(data)), 15.0)
        trainee.press("ctrl+q")
        terminal.wait_exit(30.0)
    return frozen_in(data)[0].stem


def practised(data: Path, name: str, language: str) -> Terminal:
    command = [sys.executable, "-m", "console", "--sim", "--from", name, "--data", str(data), "--lang", language]
    return Terminal(command, columns=80, rows=24)


def starts(terminal: Terminal, language: str) -> Trainee:
    """Read what is said before, start, and find the lathe aligned and the job open: F5 and F6 are enough."""
    trainee = Trainee(terminal, language)
    trainee.sees("practice.start")
    trainee.sees("practice.otherwise")
    terminal.press("enter")
    trainee.sees("train_page.hint", 30.0)
    trainee.sees("activity.ready", 40.0)
    terminal.wait_for(r"^ SIM .*a-flange", 10.0)
    trainee.press("4")
    trainee.sees("align_page.valid_title")
    trainee.starts_the_cut()
    return trainee


@pytest.mark.long
def test_a_following_error_in_mid_cut_is_practised(tmp_path: Path) -> None:
    name = records(tmp_path, "following-error-trip motor=spindle", "frame.recover")
    with practised(tmp_path, name, "en") as terminal:
        trainee = starts(terminal, "en")
        terminal.wait_for("spindle: following error", 30.0)
        trainee.sees("frame.recover", 20.0)
        trainee.press("k", "k", "f2", "4")
        trainee.sees("align_page.next.drives", 20.0)
        trainee.does_step("align_page.valid_title")
        trainee.press("9")
        trainee.sees("train_page.next.done")
        assert "SIM" in terminal.row(0)
        trainee.press("ctrl+q")
        assert terminal.wait_exit(30.0) == 0


@pytest.mark.long
def test_a_cable_that_was_cut_in_mid_cut_is_practised_in_korean(tmp_path: Path) -> None:
    name = records(tmp_path, "cut-cable for=8", "activity.lost")
    with practised(tmp_path, name, "ko") as terminal:
        trainee = starts(terminal, "ko")
        trainee.sees("activity.lost", 30.0)
        trainee.sees("frame.recover", 60.0)
        trainee.press("f2")
        trainee.sees("run_page.next.align", 30.0)
        trainee.press("4")
        trainee.sees("align_page.next.drives")
        trainee.does_step("align_page.valid_title")
        trainee.press("9")
        trainee.sees("train_page.next.done")
        trainee.press("ctrl+q")
        assert terminal.wait_exit(30.0) == 0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--from", "FOREIGN"), "no flight recording"),
        (("--from", "FOREIGN", "--machine", "lee-2001-lathe"), "--machine"),
        (("--before", "5"), "--from"),
    ],
)
def test_what_is_no_recording_or_contradicts_it_is_refused_in_one_sentence(
    more: tuple[str, ...], said: str, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign.flight"
    foreign.write_text("name = 1", encoding="utf-8")
    words = [str(foreign) if word == "FOREIGN" else word for word in more]
    command = [sys.executable, "-m", "console", "--sim", *words, "--data", str(tmp_path)]
    with Terminal(command, columns=80, rows=24) as terminal:
        terminal.wait_for(re.escape(said), 20.0)
        assert terminal.wait_exit(15.0) in (1, 2)
        assert "Traceback" not in terminal.text
