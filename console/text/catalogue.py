"""The text catalogues: every sentence by its key, in the operator's language."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from profiles.problem import Problem

LANGUAGES = ("en", "ko")
_FOLDER = Path(__file__).parent


class Catalogue:
    """One language. A key that is missing shows itself: better an ugly line than none."""

    def __init__(self, language: str, entries: Mapping[str, str]) -> None:
        self.language = language
        self._entries = entries

    def __call__(self, key: str, /, **fields: object) -> str:
        """Return the sentence of `key` with its fields filled in."""
        entry = self._entries.get(key)
        if entry is None:
            return " ".join([key, *(f"{name}={value}" for name, value in fields.items())])
        return entry.format(**fields)

    def problem(self, problem: Problem) -> str:
        """Return one line that names what, where, value, limit and remedy."""
        key = f"problem.{problem.code}"
        if key not in self._entries:
            return " ".join(str(problem).split())
        # A field without bounds says nothing of what is allowed.
        unbounded = "any number" if problem.code.startswith(("key.", "value.")) else ""
        value, limit = self._word(problem.value), self._word(problem.limit or unbounded)
        sentence = self(key, key=problem.key, value=value, limit=limit, where=problem.where)
        shown = f"{problem.where}: {sentence}" if problem.where and problem.where not in sentence else sentence
        return " ".join(shown.split())

    def _word(self, fact: str) -> str:
        """Return the fixed wording of a fact, such as "not a regular file", in this language; else the fact."""
        return self._entries.get(f"word.{fact}", fact)


@cache
def load(language: str) -> Catalogue:
    """Read the catalogue of a language in `LANGUAGES`: all files of its folder, each key in one of them."""
    entries: dict[str, str] = {}
    for path in sorted((_FOLDER / language).glob("*.toml")):
        entries |= tomllib.loads(path.read_text(encoding="utf-8"))
    return Catalogue(language, entries)


def choose_language(arguments: Sequence[str], environment: Mapping[str, str]) -> str:
    """Return the language asked for with `--lang`, else that of the environment, else English."""
    for place, argument in enumerate(arguments):
        if argument == "--lang" and place + 1 < len(arguments) and arguments[place + 1] in LANGUAGES:
            return arguments[place + 1]
        if argument.startswith("--lang=") and argument[7:] in LANGUAGES:
            return argument[7:]
    for name in ("LC_ALL", "LC_MESSAGES", "LANG"):
        value = environment.get(name, "")
        if value:
            return "ko" if value.startswith("ko") else "en"
    return "en"
