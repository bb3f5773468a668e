"""A language that is added as CONTRIBUTING.md says, and a ring that is taken away with its words."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import tomlkit

from console.rings import RINGS
from console.school.training.lesson import lesson_paths
from profiles.files import read_toml
from profiles.words.sentences import LANGUAGES, word_folders

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
ADDED = "de"
ENTRY = re.compile(r'^("[^"]+" = ")', re.MULTILINE)
BARE_KEY = re.compile(r"\b(?:help|usage|page|more|key|key_help|command)\.[a-z_.]+\b")

EVERY_KEY = """
from console.text.catalogue import LANGUAGES, load
from console.tui.key_help import help_lines
from console.tui.keymap import ABSENT, PageName
from console.tui.lines import plain_text
for text in map(load, LANGUAGES):
    for page in (page for page in PageName if page not in ABSENT):
        print(text(f"page.{page}"), *(plain_text(help_lines(text, page, number, 80)) for number in (1, 2)))
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of the packages, which may be changed."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    return tmp_path


def said(tree: Path, *command: str) -> str:
    """What a command of that tree prints; it succeeds and complains of nothing."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "XDG_DATA_HOME": str(tree / "data")}
    arguments = [sys.executable, "-P", *command]
    done = subprocess.run(arguments, env=environment, cwd=tree, capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()
    return done.stdout


@pytest.fixture
def german(tree: Path) -> Path:
    """That copy in another language: the English words, each with a mark."""
    for folder in word_folders():
        folder = tree / folder.relative_to(ROOT)
        shutil.copytree(folder / "en", folder / ADDED)
        for path in (folder / ADDED).glob("*.toml"):
            path.write_text(ENTRY.sub(r"\1DE ", path.read_text(encoding="utf-8")), encoding="utf-8")
    for path in (tree / "console/school/training/lessons").glob("*.toml"):
        lesson = tomlkit.parse(path.read_text(encoding="utf-8"))
        lesson[ADDED] = {**lesson["en"].unwrap(), "title": "DE Titel"}
        path.write_text(tomlkit.dumps(lesson), encoding="utf-8")
    listed = tree / "profiles/words/sentences.py"
    text = listed.read_text(encoding="utf-8")
    assert text.count('"ko": "Korean"}') == 1
    listed.write_text(text.replace('"ko": "Korean"}', '"ko": "Korean", "de": "German"}'), encoding="utf-8")
    return tree


@pytest.mark.system
def test_commands_speak_an_added_language(german: Path) -> None:
    lessons = len(list((german / "console/school/training/lessons").glob("*.toml")))
    assert said(german, "-m", "console", "lessons", "--lang", ADDED).count("DE Titel") == lessons
    assert "DE Titel" in said(german, "-m", "console", "lessons", "first-look", "--lang", ADDED)
    assert "DE " in said(german, "-m", "console", "jobs", "--lang", ADDED)
    assert "DE Lists the lessons" in said(german, "-m", "console", "lessons", "--help", "--lang", ADDED)
    assert BARE_KEY.findall(said(german, "-c", EVERY_KEY)) == []


@pytest.mark.system
@pytest.mark.parametrize("ring", RINGS)
def test_a_console_without_a_ring_lacks_no_words(tree: Path, ring: str) -> None:
    shutil.rmtree(tree / ring.replace(".", "/"))
    for command in (("-m", "console", "--help"), ("-m", "console", "jobs"), ("-c", EVERY_KEY)):
        assert BARE_KEY.findall(said(tree, *command)) == []


def test_the_languages_are_listed_once() -> None:
    found = []
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Tuple | ast.List | ast.Set | ast.Dict):
                items = node.keys if isinstance(node, ast.Dict) else node.elts
                said = {each.value for each in items if isinstance(each, ast.Constant)}
                found += [str(path.relative_to(ROOT))] if set(LANGUAGES) <= said else []
    assert found == ["profiles/words/sentences.py"]


def test_each_bundled_lesson_has_its_words_in_each_language(tmp_path: Path) -> None:
    missing = []
    for path in lesson_paths(tmp_path):
        _, table = read_toml(path)
        missing += [(path.name, language) for language in LANGUAGES if language not in table]
    assert missing == []
