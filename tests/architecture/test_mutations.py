"""The rules that are broken on purpose (tests/mutations.py) can be broken, and their page is true."""

from __future__ import annotations

import re

import pytest

from tests.broken_rules import GROUPS, Mutation
from tests.golden_text import writing
from tests.mutations import PAGE, ROOT, page

ALL = [each for mutations in GROUPS.values() for each in mutations]


def test_ten_rules_of_each_kind_are_broken() -> None:
    assert all(len(mutations) >= 10 for mutations in GROUPS.values())
    assert len({each.rule for each in ALL}) == len(ALL)


def test_what_is_broken_stands_once_in_its_file() -> None:
    assert [each.rule for each in ALL if not _stands(each)] == []


def _stands(mutation: Mutation) -> bool:
    text = (ROOT / mutation.file).read_text(encoding="utf-8")
    return text.count(mutation.old) == 1 and mutation.new not in (mutation.old, "")


def test_the_tests_that_notice_are_there() -> None:
    assert [each.test for each in ALL if not _is_there(each.test)] == []


def _is_there(test: str) -> bool:
    file, _, name = test.partition("::")
    text = (ROOT / file).read_text(encoding="utf-8")
    return re.search(rf"^def {name}\(", text, re.MULTILINE) is not None


def test_the_page_lists_them() -> None:
    if writing():
        PAGE.write_text(page(), encoding="utf-8")
        pytest.fail(f"{PAGE.name} was written: look at it, then run without GOLDENS", pytrace=False)
    assert PAGE.read_text(encoding="utf-8") == page()
