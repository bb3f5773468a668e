"""Lessons walked at a real terminal by scripted trainees; `python -m tests.school.walk_lessons` walks all."""

from __future__ import annotations

import pytest

from console.school.training.lesson import FOLDER
from tests.school.lesson_plays import PLAYS
from tests.school.walk_lessons import CARELESS, LUCKY, PERFECT, UNLUCKY, Walk, score

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


def test_there_is_a_way_through_every_bundled_lesson() -> None:
    assert set(PLAYS) == {path.stem for path in FOLDER.glob("*.toml")}


@pytest.mark.long
def test_a_perfect_trainee_lives_through_a_second_console() -> None:
    assert score(Walk("second-console", PERFECT, "ko")) >= 95


@pytest.mark.long
def test_a_careless_trainee_scores_below_50() -> None:
    assert score(Walk("first-chucking", CARELESS, "en")) < 50


@pytest.mark.long
def test_luck_is_told_from_skill_by_a_second_lathe() -> None:
    assert score(Walk("read-a-plot", LUCKY, "en")) >= 95
    assert score(Walk("read-a-plot", UNLUCKY, "en")) < 80
