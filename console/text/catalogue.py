"""The text catalogues: every sentence by its key, in the operator's language."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from profiles.problem import Problem

LANGUAGES = ("en", "ko")
"""Each is a folder beside this file, named as the environment names the language."""

NAMES_A_KEY = ("key.", "value.", "schema.", "safety.not_signed", "safety.unknown", "safety.nobody_named")
"""Problems, by the beginning of their code, whose key is that of a file: it is written as in the file."""

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
        key = f"problem.{problem.code}.{problem.key}"
        if key not in self._entries:
            key = f"problem.{problem.code}"
        if key not in self._entries:
            return " ".join(str(problem).split())
        # A field without bounds says nothing of what is allowed.
        unbounded = "any number" if problem.code.startswith(("key.", "value.")) else ""
        of_a_stop = problem.code == "machine.stopped"
        value = self.reason(problem.value) if of_a_stop else self.words(problem.value)
        name = problem.key if problem.code.startswith(NAMES_A_KEY) else self.words(problem.key)
        limit = self.words(problem.limit or unbounded)
        sentence = self(key, key=name, value=value, limit=limit, where=problem.where)
        shown = f"{problem.where}: {sentence}" if problem.where and problem.where not in sentence else sentence
        return " ".join(shown.split())

    def reason(self, reason: str) -> str:
        """Return for what the machine was stopped: a key, a fault, a motion that did not end, a signal.

        The code of a problem says that its alarm tells more.
        """
        kind, _, key = reason.partition(" ")
        if key and f"stop_reason.{kind}_key" in self._entries:
            return self(f"stop_reason.{kind}_key", key=key)
        said = self._entries.get(f"stop_reason.{reason}")
        if said is None and f"problem.{reason}" in self._entries:
            said = self._entries["stop_reason.alarm"]
        return said or self.words(reason)

    def words(self, fact: str) -> str:
        """Return the wording of a fact in this language, such as "not a regular file"; else the fact.

        Of facts with commas between each is worded, and of "tool: amplifier_fault" both sides of the colon.
        """
        whole = self._entries.get(f"word.{fact}")
        if whole is not None:
            return whole
        return ", ".join(self._pair(each) for each in fact.split(", "))

    def _pair(self, fact: str) -> str:
        head, colon, tail = fact.partition(": ")
        if f"word.{head}" not in self._entries:
            return fact
        return self._entries[f"word.{head}"] + colon + self._entries.get(f"word.{tail}", tail)


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
            return next((each for each in LANGUAGES if value.startswith(each)), "en")
    return "en"
