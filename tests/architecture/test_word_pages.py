"""Pages that quote the program have its words of today, and no sign in them is taken for Markdown."""

from __future__ import annotations

import re

import pytest

from console.tui.glossary import TERMS
from docs.word_pages import FOLDER, PAGES, filled, sentences, shown
from profiles.words.sentences import LANGUAGES

WRITE_THEM = "written anew by: .venv/bin/python -m docs.word_pages"


def page(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


@pytest.mark.parametrize(("name", "language"), PAGES.items())
def test_a_page_has_the_words_of_today(name: str, language: str) -> None:
    is_today = filled(page(name), language) == page(name)
    assert is_today, WRITE_THEM


@pytest.mark.parametrize(("name", "language"), [("troubleshooting.md", "en"), ("troubleshooting.ko.md", "ko")])
def test_every_message_is_found_by_its_code(name: str, language: str) -> None:
    codes = [key.removeprefix("problem.") for key in sentences(language) if key.startswith("problem.")]
    found = re.findall(r"\| `([^`]+)` \|$", page(name), flags=re.MULTILINE)
    assert len(codes) > 500
    assert sorted(found) == sorted(codes)


def test_every_term_of_the_screens_is_in_the_glossary_in_both_languages() -> None:
    text = page("glossary.md")
    for language in LANGUAGES:
        words = sentences(language)
        terms = {term for terms in TERMS.values() for term in terms}
        assert {term for term in terms if f"| {shown(words[f'glossary.{term}'])} |" not in text} == set()


def test_what_a_message_leaves_open_is_an_ellipsis_and_its_signs_stay_signs() -> None:
    assert shown("{key} = {value} * 2 in P0..99 | <a> [b] {unit_mm}") == r"… = … \* 2 in P0..99 \| \<a\> \[b\] mm"


def test_a_group_that_no_block_names_is_in_the_block_without_names() -> None:
    text = "<!-- messages: link -->\n<!-- end -->\n\n<!-- messages: -->\nOF BEFORE\n<!-- end -->\n"
    first, _, rest = filled(text, "en").partition("<!-- end -->")
    assert "`link.refused`" in first and "`link.refused`" not in rest
    assert "`file.exists`" in rest and "OF BEFORE" not in rest
