"""The terms of the pages: each is explained in both languages, in one line, and stands on its page."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.text.catalogue import load
from console.tui.glossary import TERMS, glossary_lines
from console.tui.keymap import PageName
from console.tui.lines import plain, width_of
from profiles.words.sentences import entries_in
from tests.tui.stage import LANGUAGES

GOLDENS = Path(__file__).with_name("goldens")
TEXTS = Path(__file__).parents[2] / "console" / "text"
FILES = {"preview": ("preview_page",), "inspect": ("inspect_page",), "records": ("records_page",)}


def page_text(page: PageName, language: str) -> str:
    """What the page shows in its kept pictures, and the sentences of its catalogue that they do not show."""
    shown = "".join(path.read_text("utf-8") for path in sorted(GOLDENS.glob(f"{page}-*-{language}.txt")))
    said = entries_in(TEXTS / language)
    names = (f"{page}_page.", f"{page}.", f"key.{page}.", f"key_help.{page}.")
    return (shown + " ".join(words for key, words in said.items() if key.startswith(names))).casefold()


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", TERMS)
def test_every_term_stands_on_its_page_and_is_explained_in_one_line(page: PageName, language: str) -> None:
    text, shown = load(language), page_text(page, language)
    rows = glossary_lines(text, page, 78)
    assert all(width_of(row) <= 78 for row in rows) and len(rows) <= 18
    assert len(rows) == len(TERMS[page]) + 3, "one line each, between the title and the last row"
    for term, row in zip(TERMS[page], rows[1:], strict=False):
        assert text(f"term.{term}").casefold() in shown, term
        assert plain([row]).startswith(text(f"term.{term}")) and text(f"glossary.{term}") in plain([row])


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_explained_term_is_one_of_a_page(language: str) -> None:
    keys = {key for key in entries_in(TEXTS / language) if key.startswith(("term.", "glossary."))}
    used = {term for terms in TERMS.values() for term in terms}
    expected = {f"{kind}.{term}" for kind in ("term", "glossary") for term in used} | {"glossary.title"}
    assert keys == expected
