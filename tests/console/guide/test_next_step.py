"""The next step of the job: one row in every situation, each row for some, with words and a key that there are."""

from __future__ import annotations

from collections import Counter

import pytest

from console.session.guide.refusals import AGAINST
from console.session.guide.rows import ALIGN, INSPECT, RUN, row_of
from console.text.catalogue import load
from console.tui.keymap import ACTIONS
from tests.console.guide.guided_situations import all_situations

TABLES = {"align": ALIGN, "run": RUN, "inspect": INSPECT}
FACTS = {"force": "1314", "radius": "26.000", "angle": "12.60", "left": "8"}


def test_every_row_is_the_next_step_in_some_situation() -> None:
    """In each situation each page has its row; `row_of` raises where none applies."""
    reached: Counter[int] = Counter()
    for now in all_situations():
        for table in TABLES.values():
            reached[id(row_of(table, now))] += 1
    unreached = [row.word for table in TABLES.values() for row in table if not reached[id(row)]]
    assert unreached == []


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("page", TABLES)
def test_every_word_has_a_sentence_and_every_key_is_one_of_the_keymap(page: str, language: str) -> None:
    text, actions = load(language), {action.id for action in ACTIONS}
    for row in TABLES[page]:
        assert row.word.startswith(f"{page}.")
        said = text(row.sentence, **FACTS)
        assert said != row.sentence and "{" not in said and not said.startswith(f"{page}_page")
        assert row.key is None or row.key in actions
    assert set(AGAINST) <= actions
