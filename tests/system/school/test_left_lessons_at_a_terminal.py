"""A lesson that was left at a real terminal is offered to be continued, on the same lathe."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.system.school.test_lessons_at_a_terminal import LANGUAGES, begins, debriefed, kept, lesson_at
from tests.trainee import Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]


@pytest.mark.long
@pytest.mark.parametrize("language", LANGUAGES)
def test_a_lesson_whose_terminal_was_closed_goes_on_with_its_steps(language: str, tmp_path: Path) -> None:
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        trainee = Trainee(terminal, language)
        begins(trainee)
        trainee.switches_on()
        terminal.hang_up()
        terminal.wait_exit(20.0)
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        trainee = Trainee(terminal, language)
        trainee.sees("lesson_start.ask")
        assert ": 2." in terminal.text, "steps that stay made"
        trainee.press("x", "enter", "enter")  # no answer, then yes
        terminal.wait_for(lambda text: text.count("✓ ") == 2, 20.0)
        begins(trainee)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.sees("align_page.next.jaw_enable", 30.0)
        assert debriefed(trainee) == 100
        trainee.press("ctrl+q")
        assert terminal.wait_exit(15.0) == 0
    (one,) = kept(tmp_path, "Kim")
    words = [each["word"] for each in one["happened"] if each["what"] == "step"]  # type: ignore[attr-defined]
    assert words == ["clamped", "drives_on", "homed"]
    with lesson_at(tmp_path, "first-look", language, "--trainee", "Kim") as terminal:
        Trainee(terminal, language).sees("train_page.hint")
        assert "lesson_start" not in terminal.text, "what was debriefed is not offered again"
