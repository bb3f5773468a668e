"""A language that is added as CONTRIBUTING.md says: two folders and its name in `LANGUAGES`."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from console.school.training.lesson import lesson_paths
from profiles.files import read_toml
from profiles.words.sentences import LANGUAGES

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
SPOKEN = ("en", "ko")


@pytest.mark.system
@pytest.mark.parametrize("command", [("lessons",), ("lessons", "first-look"), ("jobs",)], ids=" ".join)
def test_a_command_speaks_the_added_language(tmp_path: Path, command: tuple[str, ...]) -> None:
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    for folder in ("console/text", "profiles/words"):
        shutil.copytree(tmp_path / folder / "en", tmp_path / folder / "de")
    listed = tmp_path / "profiles/words/sentences.py"
    text = listed.read_text(encoding="utf-8")
    assert f"LANGUAGES = {SPOKEN!r}".replace("'", '"') in text
    listed.write_text(text.replace('("en", "ko")', '("en", "ko", "de")'), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "XDG_DATA_HOME": str(tmp_path / "data")}
    arguments = [sys.executable, "-P", "-m", "console", *command, "--lang", "de"]
    done = subprocess.run(arguments, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()


def test_the_languages_are_listed_once() -> None:
    found = []
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Tuple | ast.List | ast.Set):
                said = {each.value for each in node.elts if isinstance(each, ast.Constant)}
                found += [str(path.relative_to(ROOT))] if set(SPOKEN) <= said else []
    assert found == ["profiles/words/sentences.py"]


def test_each_bundled_lesson_has_its_words_in_each_language(tmp_path: Path) -> None:
    missing = []
    for path in lesson_paths(tmp_path):
        _, table = read_toml(path)
        missing += [(path.name, language) for language in LANGUAGES if language not in table]
    assert missing == []
